"""One axis of a sensor: its noise, its hull filter, and the size of its motion."""

import math
from collections import deque
from collections.abc import Sequence
from math import degrees, inf

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.channels import Channels, Motion
from swath_sysid.attitude.prediction.hull_filter import HullFilter, HullFilterSettings
from swath_sysid.attitude.prediction.hull_watch import HullWatch
from swath_sysid.attitude.prediction.memories import LEAST_SIZE, MEMORY_OF_SIZE, NOW, USUAL_PERIOD
from swath_sysid.attitude.prediction.unmeasured_angle import UnmeasuredAngle
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import THREE_STD

#: First guess, least and most noise of sensors that do not report theirs, rad and rad/s.
ANGLE_NOISE, RATE_NOISE = (0.002, LEAST_SIZE, 0.02), (0.005, LEAST_SIZE, 0.05)

LATELY = 5.0  #: Periods over which the motion of late is averaged, of which an error may be a share, and errors.
_FIRST, _MEMORY = 20, 1000  #: Samples that the first guess counts for, and over which the variance is averaged.

# variances of the third and fourth difference of white noise: sums of squared binomials
_THIRD_DIFFERENCE_GAIN, _FOURTH_DIFFERENCE_GAIN = math.comb(6, 3), math.comb(8, 4)
_ALIKE = 1.25  #: Ratio of the variances that both differences show, up to which noise is white.
_TOLD_WRONG = 1.5  #: Ratio of a sensor's noise variance to the one that it reports, from which its report is wrong.

#: A squared error over its expected value counts as this much at the most: what nobody could foresee, such as a glitch
#: or a hand on the craft, says little of the errors to come.
CREDIBLE = THREE_STD * THREE_STD
#: Mean square disagreement over that of the noise, above which the channels contradict each other.
_BEYOND_CHANCE = 2.0
BLOCKS = 16  #: The past is kept as the extremes of this many parts.
BEYOND = 1.1  #: Factor beyond the largest amplitude of the record from which the model is not valid.


class AxisFilter:
    """Follows angle and rate of one axis, sample by sample."""

    def __init__(self, settings: HullFilterSettings, memory: float) -> None:
        self.hull = HullFilter(settings)
        self.identified: IdentifiedModel | None = None
        self.reach: Reach | None = None  #: Of the measured angle, where a hull is known.
        self.watch = HullWatch()  #: Over the hull in waves, since its model.
        self.size = MotionSize(memory)
        #: Variances of white noise in angle and rate, which a sensor reports; zero where none is known for certain.
        self.known_noise = (0.0, 0.0)
        #: Those in use, up to all that is not smooth, and with the disagreement of both.
        self.noise = self.noise_to_hull = (math.nan, math.nan)
        self._meters = NoiseMeter(*ANGLE_NOISE), NoiseMeter(*RATE_NOISE)
        self._agreement = AgreementMeter()
        self.unmeasured, self.channels = UnmeasuredAngle(memory), Channels()

    @property
    def motion(self) -> tuple[float, float]:
        """Filtered angle and rate, rad and rad/s."""
        state = self.hull.x
        return state.item(0), state.item(1)

    @property
    def doubt_of_level(self) -> float:
        """Variance, rad^2, of the level where no angle tells it, and no hull that comes back to its trim."""
        return self.unmeasured.level_variance if self.hull.model is None and self.unmeasured.is_unknown else 0.0

    @property
    def doubt_of_angle(self) -> float:
        """Variance, rad^2, of what stands in for an angle that is unknown; zero where it is measured."""
        return self.doubt_of_level + self.hull.P.item(0, 0) if self.unmeasured.is_unknown else 0.0

    def set_model(self, identified: IdentifiedModel | None) -> None:
        """Swap the hull; None where none is known."""
        self.identified, self.watch = identified, HullWatch()
        self.reach = None if identified is None else Reach(identified.model.natural_period)
        self.hull.set_hull(identified)
        self.set_period(self.size.period)

    def set_period(self, period: float) -> None:
        """Measure sizes and agreement in another period of the motion, s."""
        # a craft that is held and released moves as its hull does
        natural = math.inf if self.identified is None else self.identified.model.natural_period
        self.hull.set_period(min(period, natural))
        self.size.period = self._agreement.period = self.unmeasured.period = period

    def believed(self, angle: float, rate: float, sensed: float, elapsed: float) -> tuple[float, float]:
        """Angle, rad, and rate, rad/s, as they are believed after the elapsed s; see `Channels.take`."""
        unmeasured, size = self.unmeasured, self.size
        bias = unmeasured.bias, unmeasured.bias_variance
        return self.channels.take(angle, rate, sensed, elapsed, Motion(size.period, size.deviation, self.noise, bias))

    def follow(
        self, angle: float, rate: float, reported: Sequence[float], elapsed: float, linked: bool, even: bool
    ) -> tuple[bool, bool]:
        """Take angle and rate, NaN where not measured; whether they were rejected, and whether the filter restarted.

        ``elapsed`` s after the ones before; ``linked``: motion goes on; ``even``: the interval is the usual one.
        """
        hull = self.hull
        if not hull.is_started and angle != angle and rate != rate:
            return False, False
        variances = self._variances(reported)
        measured, unmeasured = (angle, rate), self.unmeasured
        unmeasured.take(angle, rate, elapsed)
        if unmeasured.is_missing:
            rate -= unmeasured.bias
        rejected = restarted = False
        if linked and hull.is_started:
            of_angle, of_rate = variances
            if not even and elapsed > self._agreement.span:
                self._agreement.restart()
            of_rate += self._agreement.excess(elapsed)
            self.noise_to_hull = of_angle, of_rate
            seen = angle, rate
            if unmeasured.is_missing and elapsed > 0.0:
                of_rate += unmeasured.rate_noise(elapsed, comes_back=hull.model is not None)
                if hull.model is None and unmeasured.is_unknown:
                    angle, of_angle = unmeasured.level, unmeasured.angle_noise(elapsed)
            observed = hull.observe(elapsed, angle, rate, of_angle, of_rate)
            rejected, restarted = observed.rejected, observed.restarted
            # what is rejected leaves no mark
            self._agreement.take(elapsed, *((math.nan, math.nan) if rejected else seen), *variances)
        else:
            self._agreement.restart()
            hull.start(angle, rate, *variances)
        self._learn_noise(*((math.nan, math.nan) if rejected else measured), even)
        # of a motion that nothing shows, the filter's mean comes to rest
        if not rejected and (measured[0] == measured[0] or rate == rate):
            self.size.follow(*self._seen(measured[0], rate, variances[0]), elapsed)
        return rejected, restarted

    def _seen(self, angle: float, rate: float, of_angle: float) -> tuple[float, float]:
        """Filtered angle and rate, or measured ones, NaN where they are not, if the filter has run away from them."""
        filtered = self.motion
        off, size = abs(filtered[0] - angle), self.size
        if off * off > CREDIBLE * of_angle and off > size.deviation:
            return angle, rate if rate == rate else 0.0
        return filtered

    def evidence_of_step(self, angle: float, rate: float, usual: float, elapsed: float) -> float:
        """Log likelihood ratio of angle and rate, NaN where not measured, ``usual`` s against ``elapsed`` s later.

        After the elapsed s they may also be anything of the size of the motion.
        """
        if not self.hull.is_started:
            return 0.0
        values = np.array([angle, rate])
        seen = np.isfinite(values)
        noise = np.where(np.isfinite(self.noise), self.noise, 0.0)
        size = self.size.activity * np.array([1.0, 2.0 * math.pi / self.size.period])
        leads, places = np.unique([usual, elapsed], return_inverse=True)
        means, spreads = (values[places] for values in self.hull.forecast(leads))
        means, spreads = np.vstack([means, [self.size.mean, 0.0]]), np.concatenate([spreads, np.diag(size**2)[None]])
        spreads = (spreads + np.diag(noise))[:, seen][:, :, seen]
        errors = (values - means)[:, seen]
        squares = np.einsum('ki,kij,kj->k', errors, np.linalg.inv(spreads), errors)
        log = -0.5 * (squares + np.linalg.slogdet(spreads)[1])
        return float(log[0] - log[1:].max())

    def advice(self) -> tuple[Advice, ...]:
        """What contradicts the hull's model: what the filter learns, its own verdict, and the size of the motion."""
        identified = self.identified
        # the filter learns more slowly than the waves tell
        found = self.watch.advice() or list(self.hull.advice())
        if identified is None or self.reach is None:
            return ()
        axis = identified.model.axis
        if identified.verdict not in ('', 'adequate'):
            sentence = identified.verdict_sentence or 'release the craft again, and identify it'
            found.append(Advice.of('model-doubtful', axis=axis, verdict=identified.verdict, sentence=sentence))
        (smallest, largest), reached = identified.amplitude_range, self.reach.amplitude
        # a single amplitude is that of an equivalent linear model in waves, not of their crests
        if smallest < largest and reached > BEYOND * largest:
            found.append(
                Advice.of('outside-valid-amplitude', axis=axis, reached=degrees(reached), largest=degrees(largest))
            )
        return tuple(found)

    def _variances(self, reported: Sequence[float]):
        """Noise variances that the sensor reports, where they are not clearly wrong, or else measured ones."""
        of_angle, of_rate = self._meters
        self.known_noise = of_angle.believed(reported[0]), of_rate.believed(reported[1])
        self.noise = self.known_noise[0] or of_angle.variance, self.known_noise[1] or of_rate.variance
        return self.noise

    def _learn_noise(self, angle: float, rate: float, even: bool):
        for meter, value in zip(self._meters, (angle, rate), strict=True):
            if not even:
                meter.restart()
            meter.take(value)


class Reach:
    """Half the width of an angle's motion, over the last two of its periods, s."""

    def __init__(self, period: float) -> None:
        self.period = period
        self._lows, self._highs = deque([inf], BLOCKS), deque([-inf], BLOCKS)
        self._end = -inf

    def add(self, time: float, angle: float) -> None:
        """Add an angle, rad; NaN: not measured."""
        block = NOW * self.period / BLOCKS
        if not self._end - block <= time < self._end:
            self._end = time + block
            self._lows.append(inf)
            self._highs.append(-inf)
        self._lows[-1] = min(self._lows[-1], angle if angle == angle else inf)
        self._highs[-1] = max(self._highs[-1], angle if angle == angle else -inf)

    @property
    def amplitude(self) -> float:
        """rad; zero where no angle was measured."""
        return max(0.5 * (max(self._highs) - min(self._lows)), 0.0)


class MotionSize:
    """Running size of the motion about one axis over a memory in periods."""

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self.reach = Reach(USUAL_PERIOD)  #: Of the last two periods.
        self._elapsed = 0.0
        self.mean = self._angle = math.nan
        self._square = self._rate_square = self._energy = self._recent = self._present = LEAST_SIZE**2

    @property
    def period(self) -> float:
        """s; of the motion."""
        return self.reach.period

    @period.setter
    def period(self, period: float) -> None:
        self.reach.period = period

    def restart(self) -> None:
        """Restart the recent sizes."""
        self._recent = self._present = LEAST_SIZE**2

    def follow(self, angle: float, rate: float, elapsed: float) -> None:
        """Add the filtered motion, rad and rad/s, after the elapsed seconds."""
        self._elapsed += elapsed
        self._angle = angle
        self.reach.add(self._elapsed, angle)
        slow = min(1.0, elapsed / min(self._memory * self.period, self._elapsed)) if elapsed > 0.0 else 0.0
        known = max(self._elapsed, 1e-9)
        quick = elapsed / min(NOW * self.period, known)
        steady = elapsed / min(LATELY * self.period, known)
        if self.mean != self.mean:
            self.mean = angle
        self.mean += slow * (angle - self.mean)
        square = (angle - self.mean) ** 2
        self._square += slow * (square - self._square)
        self._rate_square += slow * (rate * rate - self._rate_square)
        # both halves of the oscillation's energy, so that the size does not oscillate with the phase
        share = self._square / max(self._rate_square, LEAST_SIZE**2)
        self._energy = 0.5 * (square + share * rate * rate)
        self._recent += min(1.0, quick) * (self._energy - self._recent)
        self._present += min(1.0, steady) * (square - self._present)

    @property
    def deviation(self) -> float:
        """Standard deviation over the memory, rad."""
        return max(math.sqrt(self._square), LEAST_SIZE)

    @property
    def present(self) -> float:
        """Size over the last periods, rad."""
        return max(math.sqrt(self._present), LEAST_SIZE)

    @property
    def activity(self) -> float:
        """Size at this moment, rad."""
        return max(math.sqrt(self._recent), LEAST_SIZE)

    @property
    def extent(self) -> float:
        """Amplitude of the last two periods or present displacement, whichever is larger, rad."""
        return max(self.reach.amplitude, abs(self._angle - self.mean), LEAST_SIZE)

    @property
    def is_young(self) -> bool:
        """Whether less motion like that of now has been seen than what an amplitude is measured over."""
        return self._cycles_as_large < NOW

    @property
    def doubt_of_mean(self) -> float:
        """How far the level may lie from the mean of as few cycles, rad."""
        return math.sqrt(2.0 * self._largest / max(self._cycles_as_large, 1.0))

    @property
    def _cycles_as_large(self) -> float:
        """As the motion is now; a craft that is held goes through none."""
        cycles = self._elapsed * math.sqrt(self._rate_square) / (2.0 * math.pi * self.deviation)
        return cycles * min(self._square / self._largest, 1.0)

    @property
    def _largest(self) -> float:
        """Mean square of an oscillation with the energy of this moment or of the newest cycle, rad^2."""
        return max(self._energy, self.activity**2)


class NoiseMeter:
    """Running variance of the white noise in one evenly sampled channel, initial and bounds in its unit.

    The third difference removes motion that is quadratic over four samples and leaves 20 times the noise variance
    (Hamming 1973). Motion left at slow sampling counts as noise: an upper bound, kept below ``most``. The fourth
    difference, of 70 times the variance, leaves less of motion, and as much of noise.
    """

    def __init__(self, initial: float, least: float, most: float) -> None:
        self.variance = self._average = self._finer = initial**2
        self._least, self._most, self._floor = least**2, most**2, 0.01 * least**2
        self._count = _FIRST
        self.restart()

    def restart(self) -> None:
        """Forget the neighbours (after a gap or a missing value), not what was learnt."""
        self._a = self._b = self._c = self._third = math.nan

    def take(self, value: float) -> float:
        """Add the next value and return the noise variance."""
        a, b, c, before = self._a, self._b, self._c, self._third
        self._a, self._b, self._c = b, c, value
        self._third = third = value - 3.0 * c + 3.0 * b - a
        if third == third:
            if self._count < _MEMORY:
                self._count += 1
            self._average = average = self._averaged(self._average, third * third / _THIRD_DIFFERENCE_GAIN)
            self.variance = self._least if average < self._least else self._most if average > self._most else average
            fourth = third - before
            if fourth == fourth:
                self._finer = self._averaged(self._finer, fourth * fourth / _FOURTH_DIFFERENCE_GAIN)
        return self.variance

    def _averaged(self, average: float, square: float):
        # clipped, so that a glitch counts as at most a few samples; the first guess weighs as 20 samples
        if square > CREDIBLE * average:
            square = CREDIBLE * average
        average += (square - average) / self._count
        return average if average > self._floor else self._floor

    def believed(self, reported: float) -> float:
        """The variance reported, or measured where that is certainly another; zero: none is reported."""
        if self._count == _FIRST and reported > 0.0:
            self._average = self._finer = reported
        if not reported > 0.0:
            return 0.0
        if self._count < _MEMORY:
            return reported
        least, most = sorted((self._average, self._finer))
        measured = max(least, self._least)
        is_less = measured * _TOLD_WRONG < reported
        is_more = self._finer > _TOLD_WRONG * reported and most < _ALIKE * least
        return measured if is_less or is_more else reported


class AgreementMeter:
    """Additional noise variance of a rate that a filter uses as the derivative of an angle.

    Filtered attitude lags behind the gyroscopes, or has a gain: over some tenths of a period the angle's change differs
    from the rate's integral by more than white noise explains.
    """

    def __init__(self, period: float = USUAL_PERIOD) -> None:
        self.period = period  #: s; of the motion.
        self._seconds = self._square = self._chance = 0.0
        self._past: deque[tuple[float, float]] = deque()
        self.restart()

    @property
    def span(self) -> float:
        """s over which the rate is integrated: a radian of the motion."""
        return self.period / math.tau

    def restart(self) -> None:
        """Forget the neighbours (after a gap or a missing value), not what was learnt."""
        self._past.clear()
        self._rate = math.nan
        self._time = self._integral = 0.0

    def take(self, elapsed: float, angle: float, rate: float, angle_variance: float, rate_variance: float) -> None:
        """Add elapsed s, angle, rad, and rate, rad/s (NaN: not measured), and variances of their white noise."""
        change = rate - self._rate
        if change != change or angle != angle:
            self.restart()
            self._rate = rate
            return
        self._rate = rate
        self._time += elapsed
        self._integral += elapsed * (rate - 0.5 * change)
        # trapezoids with the ends' correction (Euler and Maclaurin)
        departure = angle - self._integral + elapsed / 12.0 * change
        past = self._past
        past.append((self._time, departure))
        while len(past) > 1 and self._time - past[1][0] > self.span - 1e-6:
            past.popleft()
        span = self._time - past[0][0]
        if span > self.span - 1e-6:
            self._seconds = min(self._seconds + elapsed, MEMORY_OF_SIZE * self.period)
            gain = elapsed / self._seconds
            chance = 2.0 * angle_variance + rate_variance * elapsed * span
            square = (departure - past[0][1]) ** 2
            self._square += gain * (square - self._square)
            self._chance += gain * (chance - self._chance)

    def excess(self, elapsed: float) -> float:
        """Additional variance, rad^2/s^2, of a rate after the elapsed s; zero where both agree within their noise."""
        if self._seconds < 10.0 * self.span or self._square < _BEYOND_CHANCE * self._chance:
            return 0.0
        return (self._square - self._chance) / (self.span * elapsed)
