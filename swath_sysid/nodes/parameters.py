"""Declaring a node's parameters from its table, and checking every change."""
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult

from swath_sysid.common.errors import InputError


class NodeParameters:
    """The parameters of one node, declared and kept valid.

    Parameters
    ----------
    node : rclpy.node.Node
    table : tuple of NodeParameter
    settings_of : callable
        Turns a dict of all values into the settings of the core, or raises `InputError`.
    on_change : callable, optional
        Called with the new settings after a change was accepted.

    Raises
    ------
    InputError
        A value given at the start is not allowed.
    """

    def __init__(self, node, table, settings_of, on_change=None):
        self._names = {parameter.name for parameter in table}
        self._settings_of = settings_of
        self._on_change = on_change
        self.values = {p.name: _plain(node.declare_parameter(p.name, p.default, _descriptor(p)).value) for p in table}
        self.settings = settings_of(self.values)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def __getitem__(self, name):
        return self.values[name]

    def _changed(self, parameters):
        ours = {p.name: _plain(p.value) for p in parameters if p.name in self._names}
        return {**self.values, **ours}

    def _check(self, parameters):
        try:
            self._settings_of(self._changed(parameters))
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters):
        changed = self._changed(parameters)
        if changed != self.values:
            self.values = changed
            self.settings = self._settings_of(changed)
            if self._on_change is not None:
                self._on_change(self.settings)


def _plain(value):
    """Arrays come as array.array: as lists they compare and print like the defaults."""
    return value if isinstance(value, bool | int | float | str) else list(value)


def _descriptor(parameter):
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    descriptor = ParameterDescriptor(description=f'{parameter.meaning}{unit}', read_only=parameter.read_only)
    if parameter.range_text:
        descriptor.additional_constraints = parameter.range_text
    if isinstance(parameter.default, float) and parameter.lowest is not None:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(parameter.lowest), to_value=float(parameter.highest), step=0.0)
        ]
    elif type(parameter.default) is int and parameter.lowest is not None:
        descriptor.integer_range = [IntegerRange(from_value=parameter.lowest, to_value=parameter.highest, step=1)]
    return descriptor
