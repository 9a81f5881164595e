"""Declaring a node's parameters from its table, and checking every change."""

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.parameter import NodeParameter, Table, Values


class NodeParameters:
    """The parameters of one node, declared and kept valid.

    Args:
        settings_of: Turns a dict of all values into the settings of the core, or raises `InputError`.
        on_change: Called with the new settings after a change was accepted.
        further: Turns the values into a table of parameters that exist only with them.

    Raises:
        InputError: A value given at the start is not allowed.
    """

    def __init__(
        self,
        node: Node,
        table: Table,
        settings_of: Callable[[Values], Any],
        on_change: Callable[[Any], None] | None = None,
        further: Callable[[Values], Table] = lambda values: (),
    ):
        self._settings_of = settings_of
        self._on_change = on_change
        self.values = _declared(node, table)
        self.values |= _declared(node, further(self.values))
        self._names = set(self.values)
        self.settings = settings_of(self.values)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def _changed(self, parameters: list[Parameter]) -> Values:
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


def _declared(node: Node, table: Table) -> Values:
    return {p.name: _plain(node.declare_parameter(p.name, p.default, _descriptor(p)).value) for p in table}


def _plain(value: Any) -> Any:
    """Arrays come as array.array: as lists they compare and print like the defaults."""
    return value if isinstance(value, bool | int | float | str) else list(value)


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    descriptor = ParameterDescriptor(description=f'{parameter.meaning}{unit}', read_only=parameter.read_only)
    if parameter.range_text:
        descriptor.additional_constraints = parameter.range_text
    if isinstance(parameter.default, float) and parameter.lowest is not None:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(parameter.lowest), to_value=float(parameter.highest or 0.0), step=0.0)
        ]
    elif type(parameter.default) is int and parameter.lowest is not None:
        descriptor.integer_range = [IntegerRange(from_value=parameter.lowest, to_value=parameter.highest, step=1)]
    return descriptor
