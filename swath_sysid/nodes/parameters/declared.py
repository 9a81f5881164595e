"""Declaring a node's parameters from the table, and checking every change."""

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters import table


class NodeParameters:
    """The parameters of one node, by its name in the table, declared and kept valid. ``settings_of`` turns all values
    into the settings of the core; ``on_change`` is called with them after a change.
    """

    def __init__(
        self,
        node: Node,
        node_name: str,
        settings_of: Callable[[table.Values], Any],
        on_change: Callable[[Any], None] | None = None,
    ):
        self._node, self._settings_of = node, settings_of
        self._on_change = on_change
        self.values: table.Values = {}
        # twice: the first values may name points, which have a parameter each
        for _ in range(2):
            new = [p for p in table.parameters_of(node_name, self.values) if p.name not in self.values]
            types = {p.name: p.default for p in new}
            for name in types.keys() & node._parameter_overrides.keys():
                node._parameter_overrides[name] = _with_doubles(node._parameter_overrides[name], types)
            self.values |= {
                p.name: _plain(node.declare_parameter(p.name, p.default, _descriptor(p)).value) for p in new
            }
        self._names = set(self.values)
        _reject_misspelt(node, self._names)
        table.check_points(self.values, node._parameter_overrides)
        self.settings = settings_of(self.values)
        node.add_pre_set_parameters_callback(lambda given: [_with_doubles(each, self.values) for each in given])
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def mount(self, angles: list[float] | None) -> None:
        """State the mounting of the sensor, deg, in place of the user, or (None) that nobody does."""
        if angles is not None:
            self._node.set_parameters([Parameter('mounting_deg', value=angles)])
        elif self._on_change is not None:
            self._on_change(self.settings)

    def _changed(self, parameters: list[Parameter]) -> table.Values:
        ours = {p.name: _plain(p.value) for p in parameters if p.name in self._names}
        return {**self.values, **ours}

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._settings_of(self._changed(parameters))
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed != self.values:
            self.values = changed
            self.settings = self._settings_of(changed)
            if self._on_change is not None:
                self._on_change(self.settings)


def _reject_misspelt(node: Node, names: set[str]) -> None:
    """What was given at the start may be for other nodes, also of other packages, unless it is nearly one of ours."""
    known = names | table.every_name()
    for name in node._parameter_overrides:
        if name in known or node.has_parameter(name) or name.startswith(table.POSITION) or table.OF_ROS.match(name):
            continue
        if near := table.meant(name, known):
            raise InputError(f'there is no parameter {name}: did you mean {near}?')


def _with_doubles(parameter: Parameter, defaults: table.Values) -> Parameter:
    """A parameter with whole numbers as doubles where the default is one, as in ``mounting_deg:=[15,-10,90]``."""
    default, value = defaults.get(parameter.name), parameter.value
    if isinstance(default, float) and parameter.type_ is Parameter.Type.INTEGER:
        return Parameter(parameter.name, value=float(value))
    if isinstance(default, list) and isinstance(default[0], float) and parameter.type_ is Parameter.Type.INTEGER_ARRAY:
        return Parameter(parameter.name, value=[float(element) for element in value])
    return parameter


def _plain(value: Any) -> Any:
    """Arrays come as array.array: as lists they compare and print like the defaults."""
    return value if isinstance(value, bool | int | float | str) else list(value)


def _descriptor(parameter: table.NodeParameter) -> ParameterDescriptor:
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    descriptor = ParameterDescriptor(
        description=f'{parameter.meaning}{unit}',
        read_only=parameter.read_only,
        additional_constraints=parameter.allowed,
    )
    if parameter.range:
        lowest, highest = parameter.range
        if isinstance(parameter.default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=lowest, to_value=highest, step=0.0)]
        elif isinstance(parameter.default, int):
            descriptor.integer_range = [IntegerRange(from_value=lowest, to_value=highest, step=1)]
    return descriptor
