"""Declaring a node's parameters from the table, and checking every change."""

from collections.abc import Callable
from difflib import get_close_matches
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
        self._settings_of = settings_of
        self._on_change = on_change
        self.values: table.Values = {}
        # twice: the first values may name points, which have a parameter each
        for _ in range(2):
            new = [p for p in table.parameters_of(node_name, self.values) if p.name not in self.values]
            self.values |= {
                p.name: _plain(node.declare_parameter(p.name, p.default, _descriptor(p)).value) for p in new
            }
        self._names = set(self.values)
        _warn_of_unknown(node, self._names)
        table.check_points(self.values, node._parameter_overrides)
        self.settings = settings_of(self.values)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

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


def _warn_of_unknown(node: Node, names: set[str]) -> None:
    """Of what was given at the start and is a parameter of none of the nodes: one file often serves them all."""
    known = names.union(*({p.name for p in table.table_of(each)} for each in table.NODES))
    for name in node._parameter_overrides:
        if name in known or node.has_parameter(name) or name.startswith((table.POSITION, 'qos_overrides.')):
            continue
        meant = get_close_matches(name, sorted(known), 1)
        hint = f'did you mean {meant[0]}?' if meant else 'see `ros2 param list`'
        node.get_logger().warning(f'there is no parameter {name}, so it is ignored: {hint}')


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
