"""Rates held against the derivatives of their angles: axis, sign, unit, delay, offset."""
import numpy as np

from swath_sysid.attitude.motion.contradictions import Contradiction
from swath_sysid.attitude.motion.turned_axes import turn_and_cure

FOLLOWS = 0.7
"""Correlation with the derivative of its angle from which a rate is that of the angle."""

EXPLAINS = 0.9
"""Mean correlation from which a delay, or another arrangement of the axes, explains the rates."""

UNITS = {
    57.29578: 'the rate is in deg/s where rad/s is expected',
    1.0 / 57.29578: 'the angle is in degrees where rad is expected',
    1e3: 'the time is in ms where s is expected',
    1e6: 'the time is in us where s is expected',
}
"""What is wrong where the rate is so many times the derivative of the angle."""

UNIT_TOLERANCE = 1.3
"""Factor by which the rates may differ from the derivatives of the angles, and from a unit of `UNITS`."""

LAG_INTERVALS, LEAST_LAG = 2.5, 0.05
"""A delay is told beyond so many sample intervals and so many seconds."""

UNRELATED = 0.6
"""Correlation with the derivative of its angle at every delay below which a rate does not follow it."""

LEAST_SHARE = 0.3
"""Of the derivative's standard deviation that a rate must have to hold it."""

LEAST_FREEDOM = 6.0
"""Degrees of freedom below which a poor correlation is no proof: one noisy swing."""

SIGNIFICANT = 4.0
"""Standard deviations beyond which a delay or a gain is no chance."""

LARGEST_OFFSET = np.radians(2.0)
"""rad/s; uncalibrated gyroscopes at rest stay within 1 deg/s by their data sheets."""

AXIS_NAMES = ('roll', 'pitch', 'yaw')

ARRANGEMENTS = {
    'reversed': -np.eye(3),
    'roll reversed': np.diag([-1.0, 1.0, 1.0]),
    'pitch reversed': np.diag([1.0, -1.0, 1.0]),
    'to port': np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'to starboard': np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'exchanged': np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'exchanged and reversed': np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Which derivative each rate holds, where gravity is as the attitude says."""


def agreement(comparison, arrangement):
    """Mean correlation of the rates with the derivatives of the angles in this arrangement; 0 where none moves."""
    if comparison is None:
        return 0.0
    correlations = []
    for j in np.flatnonzero(evidenced_axes(comparison)):
        i = int(np.argmax(np.abs(arrangement[:, j])))
        if comparison.has_rate[i]:
            correlations.append(arrangement[i, j] * comparison.at_once[i, j])
    return float(np.mean(correlations)) if correlations else 0.0


def evidenced_axes(comparison):
    """Roll and pitch, where they move and some rate is there; compasses are too slow and too rough to tell."""
    return comparison.moves & comparison.has_rate.any() & np.array([True, True, False])


def rates_against_angles(comparison, interval, accelerations, installation):
    """What contradicts itself between rates and angles."""
    evidenced = np.flatnonzero(evidenced_axes(comparison))
    if not evidenced.size:
        return _offsets(comparison)
    follows = [comparison.at_once[j, j] >= FOLLOWS for j in evidenced]
    if not all(follows):
        delayed = float(np.mean([comparison.lagged[j] if comparison.has_rate[j] else 0.0 for j in evidenced]))
        rearranged = _rearranged(comparison, evidenced, accelerations, installation, max(EXPLAINS, delayed))
        if rearranged:
            return rearranged
    scaled = _scales(comparison, evidenced)
    return [
        *(scaled or _offsets(comparison)), *_delays(comparison, evidenced, interval),
        *_unrelated(comparison, evidenced),
    ]


def _rearranged(comparison, evidenced, accelerations, installation, least):
    """Rates on other axes, or with another sign, than their angles."""
    scores = {name: agreement(comparison, arrangement) for name, arrangement in ARRANGEMENTS.items()}
    name = max(scores, key=scores.get)
    if scores[name] < least:
        return []
    if 'exchanged' in name:
        # what stands exchanged in FRD axes is exchanged and reversed in those of the craft
        signs = '' if (name == 'exchanged') == (installation.frame == 'flu') else ', and reverse both'
        return [Contradiction('rates-swapped', (
            f'the roll rate follows the pitch angle and the pitch rate the roll angle: exchange the x and y '
            f'gyroscopes{signs}'
        ))]  # fmt: skip
    if name in ('to port', 'to starboard'):
        turn = (0.0, 0.0, 0.5 * np.pi if name == 'to port' else -0.5 * np.pi)
        return [Contradiction('rates-turned', (
            f'the roll rate follows the pitch angle and the pitch rate the roll angle, one of them reversed: '
            f'{turn_and_cure(turn, installation)}'
        ))]  # fmt: skip
    if name == 'reversed' and evidenced.size > 1:
        return [_both_reversed(accelerations, installation)]
    axis = AXIS_NAMES[evidenced[0]] if name == 'reversed' else name.split()[0]
    return [Contradiction('rate-sign', (
        f'the {axis} rate is the derivative of the {axis} angle with the opposite sign: reverse one of the two (roll '
        f'is positive to starboard, pitch bow down, and so are their rates)'
    ), axis)]  # fmt: skip


def _both_reversed(accelerations, installation):
    seen = 'roll and pitch rate are the derivatives of their angles with the opposite sign'
    turned = turn_and_cure((0.0, 0.0, np.pi), installation)
    reversed_signs = 'reverse the signs of the rates in the driver or the file'
    if accelerations < 0:
        return Contradiction('rates-turned', f'{seen}, and the accelerations are opposite too: {turned}')
    if accelerations > 0:
        return Contradiction('rate-sign', f'{seen}, while the accelerations are as they should be: {reversed_signs}')
    return Contradiction('rate-sign', f'{seen}: {reversed_signs}, unless {turned}')


def _scales(comparison, evidenced):
    """Rates in another unit than the derivatives of the angles."""
    found = []
    for j in evidenced:
        axis, gain = AXIS_NAMES[j], comparison.lagged_gain[j]
        if comparison.lagged[j] < EXPLAINS or not _differs(comparison, j):
            continue
        seen = f'the {axis} rate is {gain:.3g} times the derivative of the {axis} angle'
        unit = next((unit for factor, unit in UNITS.items() if _is_near(gain, factor)), None)
        if unit:
            cure = f'{unit}; give each in the unit expected, or name the one it is in'
        else:
            cure = 'look at the units of angle, rate and time, and at the scale of the gyroscope'
        found.append(Contradiction('rate-unit' if unit else 'rate-scale', f'{seen}: {cure}', axis))
    return found


def _differs(comparison, axis):
    """Whether a rate is more than noise away from the derivative of its angle."""
    gain = comparison.lagged_gain[axis]
    return not _is_near(gain, 1.0) and abs(gain - 1.0) > SIGNIFICANT * comparison.gain_std[axis]


def _is_near(gain, factor):
    return factor / UNIT_TOLERANCE < gain < factor * UNIT_TOLERANCE


def _delays(comparison, evidenced, interval):
    """Rates later, or earlier, than their angles."""
    found = []
    for j in evidenced:
        lag = float(comparison.lag[j])
        limit = max(LAG_INTERVALS * interval, LEAST_LAG, SIGNIFICANT * comparison.lag_std[j])
        if comparison.lagged[j] < EXPLAINS or abs(lag) <= limit:
            continue
        axis = AXIS_NAMES[j]
        late, early = ('rate', 'angle') if lag > 0.0 else ('angle', 'rate')
        found.append(Contradiction(f'{late}-late', (
            f'the {axis} {late} comes {abs(lag):.2f} s after the {axis} {early}: let the driver stamp both when they '
            f'are measured and look for a slow filter on the {late}, or move its column by as much'
        ), axis))  # fmt: skip
    return found


def _offsets(comparison):
    """Rates that are off by a constant."""
    return [
        Contradiction('rate-offset', (
            f'the {axis} rate is {np.degrees(offset):+.1f} deg/s off the change of the angle: calibrate the gyroscope '
            f'at rest, or take the offset away'
        ), axis)
        for axis, offset in zip(AXIS_NAMES[:2], comparison.offset[:2], strict=True) if abs(offset) > LARGEST_OFFSET
    ]  # fmt: skip


def _unrelated(comparison, evidenced):
    """Rates that have nothing to do with the angle while it moves."""
    return [
        Contradiction('rate-unrelated', (
            f'the {AXIS_NAMES[j]} angle moves and its rate does not follow it at any delay: look at what gives the '
            f'rate, or leave it out'
        ), AXIS_NAMES[j])
        for j in evidenced if comparison.has_rate[j] and _is_unrelated(comparison, j)
    ]  # fmt: skip


def _is_unrelated(comparison, axis):
    # noise on top of the derivative makes a rate larger, never smaller
    if comparison.share[axis] < LEAST_SHARE:
        return comparison.lagged[axis] < EXPLAINS
    enough = comparison.freedom[axis] >= LEAST_FREEDOM
    return enough and comparison.lagged[axis] < UNRELATED and _differs(comparison, axis)
