"""Which readings of an axis are believed: angle and rate, judged by likelihood against what the other one tells of it.

Of every sample, these are compared, each by Student's t of what it would leave of angle and rate, and by its prior:

    good     the angle has gone on by the rates of both samples, and the rate by no more than the motion changes it
    wrong    the angle has gone on by the rate before, and the rate may be anything: another unit, a dead axis
    both     neither of them: a sample that is skipped
    offset   the rate has gone on, and the angle may be anything: a restart, a mount that was hit, a spike
    turned   good, of minus the angle and minus the rate: another frame

A repeated value is stuck if the other channel shows a motion that it hides and that chance does not explain
(`StuckChannels`). While an angle is off, the integrated rate replaces it, about the old level. That ends when the angle
is back, when it turns out to be late (its error goes with the rate) or coarse (its error has no level), or when the
offset is the new level. Until that is decided, forecasts are the mixture of both levels by their probability.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from swath_sysid.attitude.motion.sensor_checks import MIN_TURN
from swath_sysid.common.conventions import NEGLIGIBLE, THREE_STD, TWO_STD

#: What is counted of a sample, of each axis.
FINDINGS = 'stuck', 'outlier', 'angle-jumped', 'angle-late', 'rate-wrong', 'frame-turned'

ALIKE = 1e-8  #: rad, rad/s; a smaller change is that of rounding.
PATIENCE = 5  #: Samples in a row that contradict a repeated rate: a single wrong angle departs from any.
NU = 30.0  #: Of Student's t: what is far off costs its logarithm, not its square.
#: Logarithms of what a wrong angle, rad, and a wrong rate, rad/s, may be anywhere in.
LOG_ANGLES, LOG_RATES = math.log(math.tau), math.log(70.0)
EVERY = 300.0  #: Periods between faults of a channel.
ANY_CRAFT = 0.078  #: rad; an unknown craft may move so far in its period.
MEMORY = 19.0  #: Periods over which is learnt how well readings follow one another.
STILL = 1e-4  #: rad; a smaller disagreement is none.
YOUNG, YOUNG_SAMPLES = 2.0, 50  #: Periods, and samples, until that is known.
#: Spikes of ten offsets before any was seen, and share of their samples that another one follows.
SPIKES, GOES_ON = 9.0, 0.3
DECAYS = 0.25, 0.5, 1.0, 2.0, 4.0, 8.0  #: Periods; time constants of a sensor that finds back to its level.
JUMP = 0.3  #: rad; by which a sensor that was hit may turn.
LEVEL_STD = 0.07  #: Of an offset over its first value, while its kind is found.
CERTAIN = 0.95  #: Probability of a new level from which it is taken over.
EXPLAINS = 0.8  #: Share of an offset's square that goes with the rate, where the angle is late.

_NINE = THREE_STD * THREE_STD
_LOG_FACTOR = math.lgamma(0.5 * NU + 0.5) - math.lgamma(0.5 * NU) - 0.5 * math.log(NU * math.pi)


class _Repeats:
    """How long a channel has repeated its value."""

    def __init__(self) -> None:
        self.value = math.nan
        self.seconds = 0.0  #: Since it was first told.
        self.step = float(MIN_TURN)  #: The smallest change so far: what the channel resolves; no sensor is coarser.
        self.is_stuck = False
        self._hides = 0

    def take(self, value: float, elapsed: float) -> bool:
        """Add a value after the elapsed s; whether it is new."""
        change = abs(value - self.value)
        if change <= ALIKE:
            self.seconds += elapsed
            return False
        if change == change:
            self.step = min(self.step, change)
        self.value, self.seconds, self.is_stuck, self._hides = value, 0.0, False, 0
        return True

    def judge(self, departure: float, variance: float, resolved: float, patience: int) -> None:
        """Take it for stuck where what it hides is no chance and more than it resolves; if it does so often, until new.

        ``variance`` is that of the departure by chance.
        """
        hides = departure * departure > resolved * resolved + _NINE * variance
        self._hides = self._hides + 1 if hides else 0 if self._hides < patience else patience
        # what contradicts a repeated rate once may itself be wrong
        self.is_stuck = (hides and self._hides > 1) or self._hides >= patience


class StuckChannels:
    """Leaves out a repeated angle that the rate has led away from, and a repeated rate that the angle contradicts.

    Where both repeat themselves, neither tells anything.
    """

    def __init__(self) -> None:
        self._angle, self._rate = _Repeats(), _Repeats()
        self._turned = self._untold = 0.0  # rad since the angle was new, and s since the rate was
        self._angle_then = math.nan

    def seconds(self) -> float:
        """How long one of them has repeated itself, and is left out; zero where none is."""
        return max(each.seconds if each.is_stuck else 0.0 for each in (self._angle, self._rate))

    def take(
        self,
        angle: float,
        rate: float,
        noise: tuple[float, float],
        bias: tuple[float, float],
        elapsed: float,
        sensed: float = math.nan,
    ) -> tuple[float, float]:
        """Angle, rad, and rate, rad/s, NaN where stuck, after the elapsed s.

        With the variances of their white noise, and the rate's bias with its variance; ``sensed`` is the rate as the
        gyroscope has it, where known: what repeats itself is that, before attitude and other axes are mixed in.
        """
        of_angle, of_rate = noise
        has_new_angle = self._angle.take(angle, elapsed)
        has_new_rate = self._rate.take(sensed if sensed == sensed else rate, elapsed)
        if has_new_angle:
            self._turned = self._untold = 0.0
        else:
            self._untold += elapsed
            if has_new_rate and rate == rate:
                self._turned += self._untold * (rate - bias[0])
                self._untold = 0.0
                seconds = self._angle.seconds
                doubt = 2.0 * of_angle + seconds * (bias[1] * seconds + of_rate * elapsed)
                self._angle.judge(self._turned, doubt, self._angle.step, 1)
        if has_new_rate:
            self._angle_then = angle
        elif has_new_angle:
            seconds = self._rate.seconds
            departure = angle - self._angle_then - rate * seconds
            doubt = 2.0 * of_angle + (bias[1] + of_rate) * seconds * seconds
            self._rate.judge(departure, doubt, self._rate.step * seconds, PATIENCE)
        return math.nan if self._angle.is_stuck else angle, math.nan if self._rate.is_stuck else rate


class Motion(NamedTuple):
    """What is known of an axis, from its filters."""

    period: float  #: s.
    size: float  #: Standard deviation of the angle, rad.
    noise: tuple[float, float]  #: Variances of white noise in angle and rate.
    bias: tuple[float, float]  #: Of the rate, rad/s, and its variance.


class Offset:
    """How far an angle is off: spike, decay or new level, by the likelihood of how it goes on."""

    def __init__(self, value: float, spikes: float) -> None:
        """With its first value, rad, and how many offsets have been spikes, and one has not."""
        self.first = self.value = value  #: rad.
        self.seconds = self._since = 0.0  #: Since it began, and since it was largest, while it is measured.
        self._spike, self.samples = spikes / (spikes + 1.0), 1
        self._kept, self._decayed = 1.0, [1.0] * len(DECAYS)  # least likelihoods so far, of a level and of what decays
        # of one, the offset, its square, its product with the rate, the square of the rate, and of the offset's change
        self._moments = [0.0] * 6

    def take(self, value: float, rate: float, variance: float, elapsed: float, period: float) -> None:
        """Add the offset, rad, known to this variance, and the rate, rad/s, after the elapsed s."""
        change, self.value = value - self.value, value
        self._since += elapsed
        self._spike *= GOES_ON
        self.samples += 1
        share = value / self.first
        if share > 1.0 + TWO_STD * LEVEL_STD:
            self.first, self._since, share = value, 0.0, 1.0
            self._kept, self._decayed = 1.0, [1.0] * len(DECAYS)
            self._moments, change = [0.0] * len(self._moments), 0.0
        spread = -0.5 / (LEVEL_STD * LEVEL_STD + variance / (self.first * self.first))
        self._kept = min(self._kept, math.exp(spread * (share - 1.0) ** 2))
        shares = [math.exp(-self._since / (t * period)) for t in DECAYS]
        now = [math.exp(spread * (share - each) ** 2) for each in shares]
        self._decayed = [min(before, each) for before, each in zip(self._decayed, now, strict=True)]
        keep = math.exp(-elapsed / period)
        new = 1.0, value, value * value, value * rate, rate * rate, change * change
        self._moments = [keep * before + elapsed * each for before, each in zip(self._moments, new, strict=True)]

    @property
    def level(self) -> float:
        """Probability that it is the new level."""
        kept, decayed = self._kept * math.exp(-0.5 * (self.first / JUMP) ** 2), sum(self._decayed) / len(DECAYS)
        return (1.0 - self._spike) * kept / max(kept + decayed, NEGLIGIBLE)

    @property
    def mean(self) -> float:
        """rad; over the last period."""
        return self._moments[1] / self._moments[0]

    @property
    def square(self) -> float:
        """rad^2; likewise."""
        return self._moments[2] / self._moments[0]

    @property
    def roughness(self) -> float:
        """rad^2; mean square of its change from sample to sample."""
        return self._moments[5] / self._moments[0]

    @property
    def lag(self) -> float:
        """s by which the angle is late, where its error goes with the rate; else zero."""
        _, _, square, product, rates, _ = self._moments
        return -product / rates if product * product > EXPLAINS * square * rates else 0.0


@dataclass
class LagDoubt:
    """Whether an angle is late at all: how well it follows the rates as it is."""

    followed: float  #: rad; by the rates of a radian.
    seconds: float = 0.0  #: Since it has been corrected.
    excess: float = 0.0  #: rad^2 s; of the corrected one's square over its own.


class Wrong:
    """A rate that contradicts its angle: since when, and for how long it has agreed with it again."""

    def __init__(self, angle: float, rate_before: float, odds: float) -> None:
        self.seconds = self.agrees = 0.0
        self._angle = self._begun = angle
        self._turned = 0.0  # rad, by this rate, since it has agreed
        self._rate_before, self._odds = rate_before, odds

    def take(self, angle: float, rate: float, elapsed: float, variances: tuple[float, float], radian: float) -> bool:
        """Add angle, rad, and mean rate, rad/s, after the elapsed s; whether the rate is good.

        With the variances of what an angle that has gone on by this rate, or as before, may be off.
        """
        by_rate, as_before = variances
        self.seconds += elapsed
        self._turned += elapsed * rate
        departure = angle - self._angle - self._turned
        if self.seconds < radian:
            # the angle has followed the rate after all, as after a shock
            before = angle - self._begun - self.seconds * self._rate_before
            return log_density(departure, by_rate) - log_density(before, as_before) > self._odds
        self.agrees += elapsed
        if departure * departure > _NINE * by_rate:
            self._angle, self._turned, self.agrees = angle, 0.0, 0.0
        return self.agrees > radian


class Channels:
    """Angle and rate of one axis: which are believed."""

    def __init__(self) -> None:
        self.stuck = StuckChannels()
        self.is_turned = False  #: Whether the sensor's frame is another one than it was.
        self.level = self.lag = 0.0  #: rad and s; of the sensor's angle, since it was first seen.
        self._of_lag = 0.0  # rad^2; the variance that remains
        self._lag_doubt = LagDoubt(0.0)
        self.offset: Offset | None = None
        self.wrong: Wrong | None = None
        self._untold = self._skipped = 0.0  # s that the angle is missing, and since a sample that was not skipped
        self._both = 0  # samples in a row of which neither is believed
        self._fades = 0.0  # rad; of an offset that is over, to the level
        self._spikes = SPIKES
        self._agrees = 0.0  # s that an angle that was off has been back
        self._time, self._count, self._interval = 0.0, 0, 0.0
        # the newest angle and rate believed, about the old level, and the variance of one that the rate tells
        self._angle, self._rate, self._variance = math.nan, math.nan, 0.0
        # mean squares: an angle off its rates, a rate off the one before, an angle off the rates of a radian
        self._of_angle = self._of_rate = self._of_radian = 0.0
        self._followed = math.nan

    def take(self, angle: float, rate: float, sensed: float, elapsed: float, motion: Motion) -> tuple[float, float]:
        """Angle, rad, about the old level, and rate, rad/s, NaN where not believed, after the elapsed s."""
        angle, rate = self.stuck.take(angle, rate, motion.noise, motion.bias, elapsed, sensed)
        # after a silence that nothing bridges the sensor may have begun anew
        self.is_turned = self.is_turned and elapsed > 0.0
        if self.is_turned:
            angle, rate = -angle, -rate
        if self._fades:
            self._fades *= math.exp(-elapsed / motion.period)
            if abs(self._fades) < STILL:
                self._fades = 0.0
        angle -= self.level + self._fades
        if self.lag and rate == rate:
            angle += self.lag * rate
        radian = motion.period / math.tau
        elapsed += self._skipped
        self._skipped = 0.0
        self._untold = 0.0 if angle == angle else self._untold + elapsed
        if (
            not 0.0 < elapsed < radian
            or self._untold > radian
            or self._angle != self._angle
            or self._rate != self._rate
        ):
            self._begin(angle, rate)
        elif self.offset is not None:
            self._follow_offset(self.offset, angle, rate, elapsed, motion)
            angle = self._angle if angle == angle else angle
        elif self.wrong is not None:
            self._follow_wrong(self.wrong, angle, rate, elapsed, motion)
        elif angle == angle and rate == rate:
            angle, rate = self._judge(angle, rate, elapsed, motion)
        else:
            self._go_on(angle, rate, elapsed, motion)
        if self.is_turned:
            return math.nan, math.nan
        if self.offset is not None and 0.0 < self.offset.seconds < 0.5 * radian:
            angle = math.nan
        return angle, math.nan if self.wrong is not None else rate

    def _begin(self, angle: float, rate: float):
        """Begin, or go on after a gap."""
        self._fades = 0.0
        if self.offset is not None:
            angle -= self.offset.value
        self._angle = self._followed = angle
        self._rate, self._variance, self.wrong = rate, 0.0, None

    def _go_on(self, angle: float, rate: float, elapsed: float, motion: Motion):
        """Of angle and rate at most one is measured."""
        if rate != rate and angle != angle:
            self._skipped = elapsed
            return
        if rate == rate:
            self._tell(rate, elapsed, motion)
            self._rate = rate
        if angle == angle:
            self._angle, self._variance = angle, 0.0
        self._followed = self._angle

    def _tell(self, rate: float, elapsed: float, motion: Motion):
        """Let the rate tell the angle."""
        mean, (bias, bias_variance), (_, of_rate) = 0.5 * (self._rate + rate), motion.bias, motion.noise
        self._angle += elapsed * (mean - bias)
        self._variance += elapsed * elapsed * (of_rate + bias_variance) + 2.0 * elapsed * math.sqrt(
            bias_variance * self._variance
        )

    def _spreads(self, elapsed: float, motion: Motion) -> tuple[float, float, float]:
        """Variances of an angle off both rates, off the rate before, and of a rate off the one before."""
        times, frequency, size = elapsed / self._interval, math.tau / motion.period, motion.size
        times = times * times if times > 1.0 else 1.0
        change = elapsed * frequency * frequency * (size if size > ANY_CRAFT else ANY_CRAFT)
        of_angle = times * self._of_angle + self._variance + STILL * STILL
        turned = 0.5 * elapsed * change
        return of_angle, of_angle + turned * turned, times * self._of_rate + change * change

    def _judge(self, angle: float, rate: float, elapsed: float, motion: Motion) -> tuple[float, float]:
        """Take a whole sample; it as it is believed."""
        bias, change = motion.bias[0], rate - self._rate
        before = self._angle + elapsed * (self._rate - bias)
        off = angle - before - 0.5 * elapsed * change
        if self._count > YOUNG_SAMPLES and self._time > YOUNG * motion.period:
            both, old, of_rate = self._spreads(elapsed, motion)
            if off * off > _NINE * both or change * change > _NINE * of_rate:
                found = self._likeliest(angle, rate, before, elapsed, motion)
                if found == 'turned':
                    self.is_turned = not self.is_turned
                    angle, rate, off, change = -angle - 2.0 * (self.level + self._fades), -rate, 0.0, 0.0
                elif found == 'offset':
                    self._tell(rate, elapsed, motion)
                    self._rate, self._agrees = rate, 0.0
                    self.offset = Offset(angle - self._angle, self._spikes)
                    return math.nan, math.nan
                elif found == 'wrong':
                    self._angle, self._variance = angle, 0.0
                    return math.nan, math.nan
                elif found == 'both' and self._both < PATIENCE:
                    self._both += 1
                    self._skipped = elapsed
                    return math.nan, math.nan
        self._both = 0
        self._learn(off, change, angle, rate - 0.5 * change - bias, elapsed, motion)
        self._angle, self._rate, self._variance = angle, rate, 0.0
        return angle, rate

    def _likeliest(self, angle: float, rate: float, before: float, elapsed: float, motion: Motion) -> str:
        """Of the hypotheses above; ``before`` is the angle, rad, that has gone on by the rate before."""
        both, old, of_rate = self._spreads(elapsed, motion)
        begins, middle = math.log(elapsed / (EVERY * motion.period)), before - 0.5 * elapsed * self._rate
        mirrored = -angle - 2.0 * (self.level + self._fades) - middle + 0.5 * elapsed * rate
        by_rate = log_density(rate - self._rate, of_rate)
        logs = {
            'good': log_density(angle - middle - 0.5 * elapsed * rate, both) + by_rate,
            'wrong': begins - LOG_RATES + log_density(angle - before, old),
            'offset': begins - LOG_ANGLES + by_rate,
            'both': begins - LOG_ANGLES - LOG_RATES,
            'turned': begins + log_density(mirrored, both) + log_density(rate + self._rate, of_rate),
        }
        found = max(logs, key=logs.__getitem__)
        if found == 'wrong':
            self.wrong = Wrong(angle, self._rate - motion.bias[0], logs[found] - logs['good'])
        return found

    def _learn(self, off: float, change: float, angle: float, mean_rate: float, elapsed: float, motion: Motion):
        """Learn how well readings follow one another; what is far off counts for no more than three deviations."""
        self._count += 1
        self._time = time = self._time + elapsed
        memory = MEMORY * motion.period
        gain = elapsed / (time if time < memory else memory)
        followed = self._followed + elapsed * mean_rate
        apart = angle - followed
        self._followed = followed + elapsed * math.tau / motion.period * apart
        off, change, apart = off * off, change * change, apart * apart
        if self.lag:
            self._doubt_lag(angle - self.lag * mean_rate, mean_rate, apart, elapsed, motion)
        if self._count > YOUNG_SAMPLES:
            off, change = min(off, _NINE * self._of_angle), min(change, _NINE * self._of_rate)
            apart = min(apart, _NINE * self._of_radian)
        self._interval += gain * (elapsed - self._interval)
        self._of_angle += gain * (off - self._of_angle)
        self._of_rate += gain * (change - self._of_rate)
        self._of_radian += gain * (apart - self._of_radian)

    def _doubt_lag(self, uncorrected: float, mean_rate: float, square: float, elapsed: float, motion: Motion):
        """Correct the angle no longer once the uncorrected one has followed the rates better over a period.

        ``square`` is how far the corrected one is off the rates of a radian, rad^2.
        """
        doubt = self._lag_doubt
        followed = doubt.followed + elapsed * mean_rate
        apart = uncorrected - followed
        doubt.followed = followed + elapsed * math.tau / motion.period * apart
        keep = math.exp(-elapsed / motion.period)
        doubt.seconds += elapsed
        doubt.excess = keep * doubt.excess + elapsed * (square - apart * apart)
        if doubt.seconds > motion.period and doubt.excess > 0.0:
            self._fades -= self.lag * mean_rate
            self.lag = self._of_lag = 0.0

    def _follow_offset(self, offset: Offset, angle: float, rate: float, elapsed: float, motion: Motion):
        """The rate alone tells the angle, until that is back, or what it is has been found."""
        if rate != rate:
            self.offset = None
            return self._begin(angle, rate)
        self._tell(rate, elapsed, motion)
        self._rate = rate
        offset.seconds += elapsed
        if angle != angle:
            return None
        radian, apart = motion.period / math.tau, angle - self._angle
        variance = self._of_angle + self._variance + min(offset.seconds / radian, 1.0) * self._of_radian
        is_back = apart * apart < _NINE * variance
        self._agrees = self._agrees + elapsed if is_back else 0.0
        offset.take(apart, rate, variance, elapsed, motion.period)
        period = motion.period
        if is_back and (offset.seconds < 0.5 * radian or self._agrees > 0.5 * period):
            if offset.samples > PATIENCE and offset.seconds < radian:
                # no spike: the angle is coarser than it was
                self._of_angle += min(offset.seconds / period, 1.0) * (offset.first**2 - self._of_angle)
            is_spike = offset.seconds < 0.5 * radian
            self._spikes += is_spike
            self._settle(0.0 if is_spike else apart)
            self._angle = angle - self._fades
            return None
        if offset.seconds < 0.5 * period:
            return None
        if offset.roughness > _NINE * self._of_angle or offset.seconds > MEMORY * period:
            # noise, of a coarser sensor or of another one
            self._of_angle = self._of_radian = offset.square
            return self._settle(apart)
        if offset.seconds > period and 0.0 < abs(offset.lag) < radian:
            lag = self.lag + offset.lag
            self.lag = lag if abs(lag) > self._interval else 0.0
            self._lag_doubt = LagDoubt(angle)
            # what the rate changes in that time
            self._of_lag = (0.5 * self.lag**2 * (math.tau / period) ** 2 * motion.size) ** 2
            return self._settle(apart + offset.lag * rate)
        if offset.seconds > YOUNG * period and offset.level > CERTAIN:
            self.level += offset.mean
            return self._settle(apart - offset.mean)
        return None

    def _settle(self, rest: float):
        """Believe the angle again; what is left fades, so that nothing jumps."""
        self.offset, self._variance, self._fades = None, 0.0, rest
        self._followed = self._angle

    def _follow_wrong(self, wrong: Wrong, angle: float, rate: float, elapsed: float, motion: Motion):
        """The angle alone is followed, until the rate agrees with it."""
        if angle != angle:
            self.wrong = None
            return self._begin(angle, rate)
        self._angle = angle
        if rate != rate:
            return None
        times, spreads = wrong.seconds + elapsed, self._spreads(elapsed, motion)
        if wrong.seconds < PATIENCE * self._interval and (rate - self._rate) ** 2 < _NINE * spreads[2]:
            self.wrong, self._rate, self._followed = None, rate, angle
            return None
        change = 0.5 * times * times * (math.tau / motion.period) ** 2 * max(motion.size, ANY_CRAFT)
        by_rate = 2.0 * spreads[0] + self._of_radian + times * elapsed * motion.noise[1]
        if wrong.take(
            angle, rate - motion.bias[0], elapsed, (by_rate, by_rate + change * change), motion.period / math.tau
        ):
            self.wrong, self._rate, self._followed = None, rate, angle
        return None

    @property
    def reading(self) -> tuple[float, float]:
        """What the sensor is expected to read beyond the old level, rad, and its variance, rad^2."""
        offset = self.offset
        if offset is None:
            # the sensor is right, or its rate has been
            half = 0.5 * self._fades
            return self.level + half, half * half + self._of_lag
        share = offset.level
        return self.level + share * offset.value, share * (1.0 - share) * offset.value**2 + self._variance

    def findings(self, radian: float) -> tuple[str, ...]:
        """What is to be counted of the newest sample, of `FINDINGS`, in a motion of which a radian takes so many s."""
        found: tuple[str, ...] = ('stuck',) if self.stuck.seconds() > radian else ()
        if self.is_turned:
            found += ('frame-turned',)
        if self.offset is not None:
            found += ('angle-jumped' if self.offset.seconds > radian else 'outlier',)
        elif self.lag:
            found += ('angle-late',)
        if self._both:
            found += ('outlier',)
        if self.wrong is not None:
            found += ('rate-wrong' if self.wrong.seconds > radian else 'outlier',)
        return found


def log_density(error: float, variance: float) -> float:
    """Of Student's t of `NU` degrees of freedom."""
    return _LOG_FACTOR - 0.5 * ((NU + 1.0) * math.log1p(error * error / (NU * variance)) + math.log(variance))
