"""One axis of a sensor: its noise, its hull filter, and the size of its motion."""

import math
from collections.abc import Sequence

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.prediction.hull_filter import HEALTHY_STRAIN, HullFilter, HullFilterSettings
from swath_sysid.attitude.prediction.sensor_noise import AgreementMeter, NoiseMeter

#: First guess, least and most noise of sensors that do not report theirs, rad and rad/s.
ANGLE_NOISE, RATE_NOISE = (0.002, 1e-4, 0.02), (0.005, 1e-4, 0.05)

LEAST_SIZE = ANGLE_NOISE[1]  #: rad and rad/s; a craft that moves less is at rest.

_ACTIVITY_TIME = 5.0  #: s; most of a period of a craft.


class AxisFilter:
    """Follows angle and rate of one axis, sample by sample."""

    def __init__(self, settings: HullFilterSettings, memory: float) -> None:
        self.hull = HullFilter(settings)
        self.identified: IdentifiedModel | None = None
        self.size = MotionSize(memory)
        self.reported = (0.0, 0.0)  #: Noise variances of angle and rate that the sensor reports; zero if it does not.
        self.noise = self.noise_to_hull = (math.nan, math.nan)  #: Those in use, and with the disagreement of both.
        #: Since a moment unforeseen by an identified hull has begun or ended; counted by who takes the rows.
        self.rows_since_surprise = 10**9
        self._meters = NoiseMeter(*ANGLE_NOISE), NoiseMeter(*RATE_NOISE)
        self._agreement = AgreementMeter()

    @property
    def motion(self) -> tuple[float, float]:
        """Filtered angle and rate, rad and rad/s."""
        state = self.hull.x
        return state.item(0), state.item(1)

    @property
    def explains(self) -> bool:
        """Whether an identified hull explains the newest samples."""
        return self.identified is not None and self.hull.is_started and self.hull.strain < HEALTHY_STRAIN

    def set_model(self, identified: IdentifiedModel | None) -> None:
        """Swap the hull; None where none is known."""
        self.identified = identified
        self.hull.set_hull(identified)

    def follow(
        self, angle: float, rate: float, reported: Sequence[float], elapsed: float, linked: bool, even: bool
    ) -> tuple[bool, bool]:
        """Take angle and rate, NaN where not measured; whether they were rejected, and whether the filter restarted.

        ``elapsed`` s after the ones before; ``linked``: motion goes on; ``even``: the interval is the usual one.
        """
        hull = self.hull
        if not hull.is_started and angle != angle and rate != rate:
            return False, False
        variances = self._variances(angle, rate, reported, even)
        rejected = restarted = False
        if linked and hull.is_started:
            of_angle, of_rate = variances
            of_rate += self._agreement.take(elapsed, angle, rate, of_angle, of_rate)
            self.noise_to_hull = of_angle, of_rate
            observed = hull.observe(elapsed, angle, rate, of_angle, of_rate)
            rejected, restarted = observed.rejected, observed.restarted
            if self.identified is not None and (observed.surprised or restarted):
                self.rows_since_surprise = 0
        else:
            self._agreement.restart()
            hull.start(angle, rate, *variances)
        self.size.follow(*self.motion, elapsed)
        return rejected, restarted

    def _variances(self, angle: float, rate: float, reported: Sequence[float], even: bool):
        """Noise variances that the sensor reports, or else measured ones."""
        of_angle, of_rate = self._meters
        if not even:
            of_angle.restart()
            of_rate.restart()
        angle_variance, rate_variance = reported
        angle_variance = angle_variance if angle_variance > 0.0 else 0.0
        rate_variance = rate_variance if rate_variance > 0.0 else 0.0
        self.reported = angle_variance, rate_variance
        self.noise = angle_variance or of_angle.take(angle), rate_variance or of_rate.take(rate)
        return self.noise


class MotionSize:
    """Running size of the motion about one axis over a memory, s."""

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self._elapsed = 0.0
        self.mean = math.nan
        self._square = self._rate_square = self._recent = LEAST_SIZE**2

    def restart(self) -> None:
        """Restart the recent size."""
        self._recent = LEAST_SIZE**2

    def follow(self, angle: float, rate: float, elapsed: float) -> None:
        """Add the filtered motion, rad and rad/s, after the elapsed seconds."""
        self._elapsed += elapsed
        slow = elapsed / min(self._memory, self._elapsed) if elapsed > 0.0 else 0.0
        quick = min(1.0, elapsed / min(_ACTIVITY_TIME, max(self._elapsed, elapsed, 1e-9)))
        if self.mean != self.mean:
            self.mean = angle
        self.mean += slow * (angle - self.mean)
        square = (angle - self.mean) ** 2
        self._square += slow * (square - self._square)
        self._rate_square += slow * (rate * rate - self._rate_square)
        # both halves of the oscillation's energy, so that the size does not oscillate with the phase
        share = self._square / max(self._rate_square, LEAST_SIZE**2)
        self._recent += quick * (0.5 * (square + share * rate * rate) - self._recent)

    @property
    def deviation(self) -> float:
        """Standard deviation over the memory, rad."""
        return max(math.sqrt(self._square), LEAST_SIZE)

    @property
    def activity(self) -> float:
        """Size over the last seconds, rad."""
        return max(math.sqrt(self._recent), LEAST_SIZE)
