"""Rates checked against the derivatives of their angles: axis, sign, unit, delay, offset."""

import numpy as np

from swath_sysid.attitude.motion.contradictions import Contradiction
from swath_sysid.attitude.motion.rate_comparison import RateComparison
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.turned_axes import turn_and_cure

FOLLOWS = 0.7  #: Correlation with the derivative of its angle from which a rate is that of the angle.
EXPLAINS = 0.9  #: Mean correlation from which a delay, or another arrangement of the axes, explains the rates.

#: What is wrong where the rate is this many times the derivative of the angle.
UNITS = {
    57.29578: 'the rate is in deg/s where rad/s is expected',
    1.0 / 57.29578: 'the angle is in degrees where rad is expected',
    1e3: 'the time is in ms where s is expected',
    1e6: 'the time is in us where s is expected',
}

#: Factor by which the rates may differ from the derivatives of the angles, and from a unit of `UNITS`.
UNIT_TOLERANCE = 1.3

LAG_INTERVALS, MIN_LAG = 2.5, 0.05  #: A delay is reported beyond this many sample intervals and this many seconds.
UNRELATED = 0.6  #: Correlation with the derivative of its angle at every delay below which a rate does not follow it.
MIN_SHARE = 0.3  #: Of the derivative's standard deviation that a rate must have to hold it.
MIN_FREEDOM = 6.0  #: Degrees of freedom below which a poor correlation proves nothing: one noisy swing.
SIGNIFICANT = 4.0  #: Standard deviations beyond which a delay or a gain is not chance.
MAX_OFFSET = np.radians(2.0)  #: rad/s; uncalibrated gyroscopes at rest stay within 1 deg/s by their data sheets.

#: Which derivative each rate holds, where gravity agrees with the attitude.
ARRANGEMENTS = {
    'reversed': -np.eye(3),
    'roll reversed': np.diag([-1.0, 1.0, 1.0]),
    'pitch reversed': np.diag([1.0, -1.0, 1.0]),
    'to port': np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'to starboard': np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'exchanged': np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'exchanged and reversed': np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}


def rates_against_angles(
    comparison: RateComparison, interval: float, accelerations: int, installation: Installation
) -> list[Contradiction]:
    """What contradicts itself between rates and angles.

    Args:
        comparison, interval: Of the rates with the derivatives of the angles; s between the samples of the sensor.
        accelerations: Sign with which the accelerations follow the tilt; 0: not known.
        installation: What frame and mounting were taken to be.
    """
    evidenced = comparison.evidenced
    if any(not comparison.at_once[j, j] >= FOLLOWS for j in evidenced):
        delayed = float(np.mean([comparison.lagged[j] if comparison.has_rate[j] else 0.0 for j in evidenced]))
        rearranged = _rearranged(comparison, accelerations, installation, max(EXPLAINS, delayed))
        if rearranged:
            return [rearranged]
    scaled = [found for j in evidenced for found in _scale(comparison, j)]
    delays = [found for j in evidenced for found in _delay(comparison, j, interval)]
    return [*(scaled or _offsets(comparison)), *delays, *_unrelated(comparison)]


def _rearranged(
    comparison: RateComparison, accelerations: int, installation: Installation, least: float
) -> Contradiction | None:
    """Rates on other axes, or with another sign, than their angles."""
    scores = {name: comparison.agreement(arrangement) for name, arrangement in ARRANGEMENTS.items()}
    name = max(scores, key=lambda name: scores[name])
    if scores[name] < least:
        return None
    crossed = 'the roll rate follows the pitch angle and the pitch rate the roll angle'
    if 'exchanged' in name:
        # what stands exchanged in FRD axes is exchanged and reversed in those of the craft
        signs = '' if (name == 'exchanged') == (installation.frame == 'flu') else ', and reverse both'
        return Contradiction('rates-swapped', f'{crossed}: exchange the x and y gyroscopes{signs}')
    if name in ('to port', 'to starboard'):
        turn = (0.0, 0.0, 0.5 * np.pi if name == 'to port' else -0.5 * np.pi)
        return Contradiction('rates-turned', f'{crossed}, one of them reversed: {turn_and_cure(turn, installation)}')
    if name == 'reversed' and comparison.evidenced.size > 1:
        return _both_reversed(accelerations, installation)
    axis = AXES[comparison.evidenced[0]] if name == 'reversed' else name.split()[0]
    return Contradiction(
        'rate-sign',
        (
            f'the {axis} rate is the derivative of the {axis} angle with the opposite sign: reverse one of the two '
            f'(roll is positive to starboard, pitch bow down, and so are their rates)'
        ),
        axis,
    )


def _both_reversed(accelerations: int, installation: Installation) -> Contradiction:
    seen = 'roll and pitch rate are the derivatives of their angles with the opposite sign'
    turned = turn_and_cure((0.0, 0.0, np.pi), installation)
    reversed_signs = 'reverse the signs of the rates in the driver or the file'
    if accelerations < 0:
        return Contradiction('rates-turned', f'{seen}, and the accelerations are opposite too: {turned}')
    if accelerations > 0:
        return Contradiction('rate-sign', f'{seen}, while the accelerations are as they should be: {reversed_signs}')
    return Contradiction('rate-sign', f'{seen}: {reversed_signs}, unless {turned}')


def _scale(comparison: RateComparison, j: int) -> list[Contradiction]:
    """A rate in another unit than the derivative of its angle."""
    axis, gain = AXES[j], comparison.gain[j]
    if comparison.lagged[j] < EXPLAINS or not _differs(comparison, j):
        return []
    unit = next((unit for factor, unit in UNITS.items() if _is_near(gain, factor)), None)
    cure = (
        f'{unit}; give each in the unit expected, or name the one it is in'
        if unit
        else ('check the units of angle, rate and time, and at the scale of the gyroscope')
    )
    return [
        Contradiction(
            'rate-unit' if unit else 'rate-scale',
            (f'the {axis} rate is {gain:.3g} times the derivative of the {axis} angle: {cure}'),
            axis,
        )
    ]


def _differs(comparison: RateComparison, j: int) -> bool:
    """Whether a rate is more than noise away from the derivative of its angle."""
    gain = comparison.gain[j]
    return not _is_near(gain, 1.0) and abs(gain - 1.0) > SIGNIFICANT * comparison.gain_std[j]


def _is_near(gain: float, factor: float) -> bool:
    return factor / UNIT_TOLERANCE < gain < factor * UNIT_TOLERANCE


def _delay(comparison: RateComparison, j: int, interval: float) -> list[Contradiction]:
    """A rate later, or earlier, than its angle."""
    axis, lag = AXES[j], float(comparison.lag[j])
    limit = max(LAG_INTERVALS * interval, MIN_LAG, SIGNIFICANT * comparison.lag_std[j])
    if comparison.lagged[j] < EXPLAINS or abs(lag) <= limit:
        return []
    late, early = ('rate', 'angle') if lag > 0.0 else ('angle', 'rate')
    return [
        Contradiction(
            f'{late}-late',
            (
                f'the {axis} {late} comes {abs(lag):.2f} s after the {axis} {early}: have the driver stamp both when '
                f'they are measured and look for a slow filter on the {late}, or move its column by as much'
            ),
            axis,
        )
    ]


def _offsets(comparison: RateComparison) -> list[Contradiction]:
    """Rates that are off by a constant."""
    return [
        Contradiction(
            'rate-offset',
            (
                f'the {axis} rate is {np.degrees(offset):+.1f} deg/s off the change of the angle: calibrate the '
                f'gyroscope at rest, or take the offset away'
            ),
            axis,
        )
        for axis, offset in zip(AXES, comparison.offset, strict=True)
        if abs(offset) > MAX_OFFSET
    ]


def _unrelated(comparison: RateComparison) -> list[Contradiction]:
    """Rates that have nothing to do with the angle while it moves."""
    return [
        Contradiction(
            'rate-unrelated',
            (
                f'the {AXES[j]} angle moves and its rate does not follow it at any delay: check what gives the '
                f'rate, or leave it out'
            ),
            AXES[j],
        )
        for j in comparison.evidenced
        if comparison.has_rate[j] and _is_unrelated(comparison, j)
    ]


def _is_unrelated(comparison: RateComparison, j: int) -> bool:
    # noise on top of the derivative makes a rate larger, never smaller
    if comparison.share[j] < MIN_SHARE:
        return bool(comparison.lagged[j] < EXPLAINS)
    enough = comparison.freedom[j] >= MIN_FREEDOM
    return bool(enough and comparison.lagged[j] < UNRELATED and _differs(comparison, j))
