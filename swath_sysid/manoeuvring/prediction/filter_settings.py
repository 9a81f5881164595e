"""What a manoeuvring filter measures and how well, without the filter, whose libraries only forecasts need."""

from dataclasses import dataclass
from typing import Self

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel

MEASURABLE = ('surge', 'sway', 'yaw_rate', 'heading', 'x', 'y')


@dataclass(frozen=True)
class ManoeuvreFilterSettings:
    """Sensor noise and outlier gate of the filter; standard deviations hold where messages give none."""

    speed_noise: float = 0.05  #: m/s.
    yaw_rate_noise: float = 0.01  #: rad/s.
    heading_noise: float = 0.01  #: rad.
    position_noise: float = 0.5  #: m.
    gate_probability: float = 1e-9  #: Probability that a good measurement is rejected as an outlier.
    gate_patience: int = 10  #: So many rejections of a channel in a row, and the filter follows the sensor.

    def __post_init__(self):
        for name, value in vars(self).items():
            if not value > 0:
                raise InputError(f'the filter setting {name} must be positive, not {value}: give a positive number')

    @classmethod
    def of(cls, identified: IdentifiedManoeuvringModel) -> Self:
        """With the sensor noise on the runs of a model's identification."""
        if identified.forecast is None:
            return cls()
        speed, yaw_rate, heading, position = identified.forecast.sensors.tolist()
        return cls(speed, yaw_rate, heading, position)

    def noise(self, name: str) -> float:
        """Standard deviation of a measurable channel."""
        shared = {'surge': 'speed', 'sway': 'speed', 'x': 'position', 'y': 'position'}
        return float(getattr(self, f'{shared.get(name, name)}_noise'))
