"""One parameter of a node, and those that several nodes have."""

from dataclasses import dataclass
from math import radians
from typing import Any

from swath_sysid.attitude.motion.sensor_mount import FRAMES, Installation
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.common.errors import InputError

Table = tuple['NodeParameter', ...]
Values = dict[str, Any]


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node."""

    name: str  #: With its unit, where it has one that is not plain from the meaning.
    default: Any  #: Its type is the parameter's.
    meaning: str
    unit: str = ''
    lowest: float | None = None  #: Bounds, both included; of every element where the parameter is a list.
    highest: float | None = None  #: Bounds, both included; of every element where the parameter is a list.
    choices: tuple[str, ...] = ()  #: Of the value, or of every element.
    read_only: bool = False  #: Set at the start only.

    @property
    def range_text(self) -> str:
        """The allowed values, for people."""
        if self.choices:
            return ', '.join(self.choices)
        if self.lowest is None:
            return ''
        return f'{_number(self.lowest)} to {_number(self.highest)}'

    def check(self, value: Any) -> None:
        """Raise `InputError` unless the value is allowed."""
        for element in value if isinstance(value, list | tuple) else [value]:
            if self.choices and element not in self.choices:
                raise InputError(f"the parameter {self.name} cannot be '{element}': choose from {self.range_text}")
            if self.lowest is not None and not self.lowest <= element <= self.highest:
                raise InputError(
                    f'the parameter {self.name} cannot be {element}: give {self.range_text} {self.unit}'.rstrip()
                )


def _number(value: float | None) -> str:
    return str(value) if isinstance(value, int) else f'{value:g}'


#: What imu_buffer and predictor must agree on.
SENSOR = (
    NodeParameter(
        'frame',
        'flu',
        'Axes of the sensor: forward-left-up in an ENU world (REP 103), or forward-right-down in a NED world',
        choices=FRAMES,
        read_only=True,
    ),
    NodeParameter(
        'mounting_deg',
        [0.0, 0.0, 0.0],
        "Roll, pitch, yaw of the sensor's (FLU) axes as seen from the craft's",
        'deg',
        -180.0,
        180.0,
        read_only=True,
    ),
    NodeParameter('frame_id', 'base_link', 'frame_id of what is published: the axes of the craft', read_only=True),
    NodeParameter(
        'gap_limit_s',
        1.0,
        'After a longer silence (and five sample intervals) the sensor begins anew',
        's',
        0.05,
        60.0,
        read_only=True,
    ),
    NodeParameter(
        'backward_jump_s',
        1.0,
        'A stamp further back is a clock that was set back (a bag that looped); a nearer one is late and left out',
        's',
        0.05,
        60.0,
        read_only=True,
    ),
    NodeParameter(
        'queue_depth',
        1000,
        'IMU messages that may wait while the node is busy',
        'messages',
        1,
        100000,
        read_only=True,
    ),
)

DIAGNOSTICS = (
    NodeParameter('diagnostics_period_s', 1.0, 'Time between diagnostics (wall clock)', 's', 0.1, 60.0, read_only=True),
)

WORKER = (
    NodeParameter(
        'worker_idle_s',
        0.0,
        'The process that identifies ends after so long without work, and starts with the next: '
        'saves its memory; 0: it stays ready',
        's',
        0.0,
        86400.0,
        read_only=True,
    ),
)


def defaults(table: Table) -> Values:
    """Name to default value of a node's parameters."""
    return {parameter.name: parameter.default for parameter in table}


def check(table: Table, values: Values) -> None:
    """Raise `InputError` unless every value is allowed."""
    for parameter in table:
        parameter.check(values[parameter.name])


def installation(values: Values) -> Installation:
    """The mounting of the sensor, of the values of `SENSOR`."""
    if len(values['mounting_deg']) != 3:
        raise InputError('the parameter mounting_deg takes three angles (roll, pitch, yaw), as in [0.0, 0.0, 90.0]')
    roll, pitch, yaw = (radians(angle) for angle in values['mounting_deg'])
    return Installation(values['frame'], (roll, pitch, yaw))


def stamp_settings(values: Values) -> StampSettings:
    """How stamps are judged, of the values of `SENSOR`."""
    return StampSettings(values['backward_jump_s'], values['gap_limit_s'])
