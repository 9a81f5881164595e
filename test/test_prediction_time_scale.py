"""The period of a motion against sines whose period is known, and when another one is taken."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.time_scale import TimeScale, period_of

STEP, SIZE = 0.1, 0.1
NOISE = 0.01, 0.03
SILENCE = np.zeros(2), np.zeros(2)


def swing(period, periods=40, step=STEP, sizes=(SIZE, 0.0)):
    """Angles and rates (N, 2) of sines over whole periods of the motion about each axis."""
    w, time = 2.0 * math.pi / period, step * np.arange(round(periods * period / step))
    turn = w * time[:, None] + np.array([0.3, 1.1])
    return np.array(sizes) * np.sin(turn), np.array(sizes) * w * np.cos(turn)


def unmeasured(angles):
    return np.full_like(angles, math.nan)


def rows_at(ages, period, phase):
    """Angle and rate (N, 1) of a sine at times, s."""
    at = math.tau * ages[:, None] / period + phase
    return SIZE * np.sin(at), SIZE * math.tau / period * np.cos(at)


def rows_of(periods, period, step=STEP):
    return round(periods * period / step)


@pytest.mark.parametrize('period', [0.8, 3.2, 15.0])
def test_the_period_of_a_sine_is_its_period(period):
    block = rows_of(2.0, period)
    assert period_of(*swing(period), STEP, *SILENCE, block) == pytest.approx(period, rel=2e-3)
    # a difference over a step is the mean of the rate over it, which has less of the sine by sin(x) / x
    angles, _ = swing(period)
    half_turn = math.pi * STEP / period
    found = period_of(angles, unmeasured(angles), STEP, *SILENCE, block)
    assert found == pytest.approx(period * half_turn / math.sin(half_turn), rel=5e-3)


@pytest.mark.parametrize('has_rates', [True, False])
def test_noise_of_known_size_is_taken_off(has_rates):
    rng, period = np.random.default_rng(1), 4.0
    angles, rates = swing(period, 1500, sizes=(0.03, 0.03))
    # a difference doubles the noise of angles, over the square of a step
    angle_noise = NOISE[0] if has_rates else 1e-3
    angles = angles + rng.normal(0.0, angle_noise, angles.shape)
    rates = rates + rng.normal(0.0, NOISE[1], rates.shape) if has_rates else unmeasured(angles)
    variances = np.full(2, angle_noise**2), np.full(2, NOISE[1] ** 2)
    block = rows_of(2.0, period)
    assert period_of(angles, rates, STEP, *variances, block) == pytest.approx(period, rel=0.02)
    # what would be found otherwise
    assert abs(period_of(angles, rates, STEP, *SILENCE, block) / period - 1.0) > 0.04


def test_what_is_missing_is_left_out_and_one_that_is_not_measured_does_not_count():
    rng, (angles, rates) = np.random.default_rng(2), swing(3.0, 100, sizes=(SIZE, 0.5 * SIZE))
    for values in (angles, rates):
        values[rng.uniform(size=values.shape) < 0.2] = math.nan
    assert period_of(angles, rates, STEP, *SILENCE, 60) == pytest.approx(3.0, rel=0.02)
    angles[:, 0] = math.nan
    assert period_of(angles, rates, STEP, *SILENCE, 60) == pytest.approx(3.0, rel=0.02)
    angles[2:, 1] = math.nan
    assert math.isnan(period_of(angles, rates, STEP, *SILENCE, 60)), 'two samples are no motion'


@pytest.mark.parametrize('sizes', [(1.0, 1.0), (2.0, 1.0), (0.1, 1.0)])
def test_two_axes_count_as_their_motion_is_large(sizes):
    """The root of the mean square of the frequencies, weighted by the variances of the angles."""
    periods = np.array([2.0, 6.0])
    both = [swing(period, 120.0 / period, sizes=sizes) for period in periods]
    angles, rates = (np.column_stack([one[:, 0], other[:, 1]]) for one, other in zip(*both, strict=True))
    square = np.square(sizes)
    wanted = 1.0 / math.sqrt(square @ periods**-2 / square.sum())
    # whole periods of both in a block
    assert period_of(angles, rates, STEP, *SILENCE, 120) == pytest.approx(wanted, rel=2e-3)


@given(
    factor=st.floats(0.05, 20.0), seed=st.integers(0, 100), has_rates=st.booleans(), block=st.sampled_from([7, 50, 300])
)
def test_motion_stretched_in_time_has_a_period_stretched_as_much(factor, seed, has_rates, block):
    rng = np.random.default_rng(seed)
    angles, rates = rng.normal(size=(2, 100, 2))
    if not has_rates:
        rates = unmeasured(rates)
    noise, of_rate = np.full(2, 0.01), np.full(2, 0.02)
    found = period_of(angles, rates, STEP, noise, of_rate, block)
    stretched = period_of(angles, rates / factor, factor * STEP, noise, of_rate / factor**2, block)
    assert stretched == pytest.approx(factor * found, rel=1e-9)


def test_angles_of_which_no_two_follow_each_other_have_no_period():
    angle, _ = rows_at(STEP * np.arange(9.0), USUAL_PERIOD, 0.0)
    angle[1::2] = math.nan
    for block in (5, 100):
        assert math.isnan(period_of(angle, np.full_like(angle, math.nan), STEP, np.zeros(1), np.zeros(1), block))


def test_a_craft_at_rest_has_no_period():
    rng = np.random.default_rng(3)
    variances = np.full(2, NOISE[0] ** 2), np.full(2, NOISE[1] ** 2)
    for _ in range(20):
        angles, rates = (rng.normal(0.0, noise, (300, 2)) for noise in NOISE)
        assert math.isnan(period_of(angles, rates, STEP, *variances, 64))
        assert math.isnan(period_of(angles, unmeasured(rates), STEP, *variances, 64))
    for angles in (np.zeros((0, 2)), np.zeros((300, 2)), np.full((300, 2), math.nan)):
        assert math.isnan(period_of(angles, angles, STEP, *SILENCE, 64))


@given(seed=st.integers(0, 1000), count=st.integers(3, 90), block=st.integers(3, 100), lost=st.sampled_from([0.0, 0.3]))
def test_variances_are_about_the_means_of_the_newest_whole_blocks(seed, count, block, lost):
    """And where there is no whole one, about the mean of all, of which that of rates is motion."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(2, count)).cumsum(axis=1)
    values[rng.uniform(size=values.shape) < lost] = math.nan
    squares = []
    for each, is_rate in zip(values, (False, True), strict=True):
        end, apart = count, []
        while end >= block or end == count:
            part = [value for value in each[max(end - block, 0) : end] if value == value]
            mean = 0.0 if is_rate and count < block else sum(part) / max(len(part), 1)
            if len(part) > 1:
                apart += [(value - mean) ** 2 for value in part]
            end -= block
        squares.append(sum(apart) / len(apart) if apart else 0.0)
    found = period_of(*(each[:, None] for each in values), STEP, np.zeros(1), np.zeros(1), block)
    if min(np.isfinite(values).sum(axis=1)) < 3:
        return
    if min(squares) == 0.0:
        assert math.isnan(found)
    else:
        assert found == pytest.approx(2.0 * math.pi * math.sqrt(squares[0] / squares[1]), rel=1e-9)


@pytest.mark.parametrize('period', [2.0, 8.0])
@pytest.mark.parametrize('share', [0.03, 0.2, 0.5, 0.71])
@pytest.mark.parametrize(('over', 'has_rates'), [(0.0, True), (0.5, True), (0.5, False), (2.0, True), (2.0, False)])
def test_a_list_that_changes_does_not_change_the_period_of_the_motion_beside_it(period, share, over, has_rates):
    """By one and a half amplitudes, at once or within some periods, wherever it is in a past of thirty."""
    angles, rates = swing(period, 30)
    begin, block = round(share * len(angles)), rows_of(2.0, period)
    for shift in range(0, block, block // 8):
        time = STEP * (np.arange(len(angles)) - begin - shift)[:, None]
        part = np.clip(time / (over * period), 0.0, 1.0) if over else (time >= 0.0).astype(float)
        listed = angles + 1.5 * SIZE * np.sin(0.5 * math.pi * part) ** 2
        slope = 0.75 * SIZE * np.sin(math.pi * part) * math.pi / (over * period) if over else 0.0
        known, beside = (rates, rates + slope) if has_rates else (unmeasured(rates),) * 2
        for length, is_kept in ((block, True), (len(angles), False)):
            plain = period_of(angles, known, STEP, *SILENCE, length)
            found = period_of(listed, beside, STEP, *SILENCE, length)
            # about one mean, the list adds a share of s (1 - s) of its square to the variance
            inside = (begin + shift) / len(angles)
            if is_kept:
                assert found == pytest.approx(plain, rel=0.05)
            elif 0.1 < inside < 0.9:
                assert found > math.sqrt(1.0 + 0.7 * 1.5**2 / 0.5 * inside * (1.0 - inside)) * plain


@pytest.mark.parametrize('has_rates', [True, False])
@pytest.mark.parametrize('begin', [0.0, 0.5, 1.0, 1.7])
def test_a_craft_that_is_held_and_let_go_has_the_period_of_its_oscillation(begin, has_rates):
    """Held at an angle for ten periods and ``begin`` more, and free for twenty with a damping of 2 %."""
    period, damping = 4.0, 0.02
    w = 2.0 * math.pi / period
    held, free = rows_of(10.0 + begin, period), rows_of(20.0, period)
    time = STEP * np.arange(free)
    swung = SIZE * np.exp((1j - damping) * w * time)
    decay = swung.real, ((1j - damping) * w * swung).real
    angles, rates = (
        np.column_stack([np.concatenate([np.full(held, value), part]), np.zeros(held + free)])
        for value, part in zip((SIZE, 0.0), decay, strict=True)
    )
    # with waves that are a tenth of it
    waves = [0.1 * each for each in swing(period, (held + free) * STEP / period)]
    angles, rates = angles + waves[0], rates + waves[1] if has_rates else unmeasured(rates)
    found, contrast = (
        period_of(angles, rates, STEP, *SILENCE, length) for length in (rows_of(2.0, period), len(angles))
    )
    assert contrast > 1.3 * period
    assert found == pytest.approx(period, rel=0.05)


def looks(scale, found, until, step=0.01):
    """Ages, s, at which it looked and whether it took what was found."""
    looked = []
    for age in np.arange(1, round(until / step) + 1) * step:
        if scale.is_due(age):
            looked.append((age, scale.follow(found(age) if callable(found) else found, age)))
    return looked


def spells(*each):
    """What is found by age: of each spell that ends at an age, s, one period."""
    return lambda age: next(value for end, value in each if age <= end)


def test_it_looks_at_a_quarter_of_a_period_then_as_often_doubled_until_the_motion_is_settled_and_then_every_period():
    scale = TimeScale()
    ages, taken = zip(*looks(scale, USUAL_PERIOD, 62.0), strict=True)
    assert not any(taken) and scale.period == USUAL_PERIOD
    wanted = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 17.0, 18.0, 19.0]
    assert np.array(ages) / USUAL_PERIOD == pytest.approx(wanted, abs=0.03)


def test_a_period_that_is_much_shorter_is_taken_at_once_and_looked_at_again_by_its_own_measure():
    scale = TimeScale()
    ages, taken = zip(*looks(scale, 0.5, 20.0), strict=True)
    assert taken[0] and not any(taken[1:]) and scale.period == 0.5
    assert ages[0] == pytest.approx(0.25 * USUAL_PERIOD, abs=0.02)
    assert np.diff(ages)[-1] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize('period', [6.0, 10.0, 40.0])
def test_of_a_longer_one_the_first_looks_know_a_part_and_its_own_first_period_all(period):
    """Of the logarithm of the ratio the share of a period that has passed, at each look from what is in use."""
    scale = TimeScale()
    used, shares = USUAL_PERIOD, []
    for age in np.arange(0.01, 3.0 * period, 0.01):
        if not scale.is_due(age):
            continue
        share = min(age / period, 1.0)
        part = used * (period / used) ** share
        taken = scale.follow(period, age)
        assert taken == (part / used > 1.15)
        used = part if taken else used
        assert scale.period == pytest.approx(used, rel=1e-9) and USUAL_PERIOD <= used <= period * (1.0 + 1e-9)
        shares.append(share)
    assert min(shares) < 0.2 and max(shares) == 1.0
    assert used > period / 1.15


def test_another_period_must_differ_by_more_the_longer_the_motion_is_known():
    """By 15 % in the first three periods of motion, 5 % until twelve, and 40 % of a sea that is known for long."""
    for ratio, early, settled, late in (
        (1.04, False, False, False),
        (1.1, False, True, False),
        (1.3, True, True, False),
        (1.5, True, True, True),
    ):
        for other in (ratio * USUAL_PERIOD, USUAL_PERIOD / ratio):
            taken = []
            for begin in (1.9, 3.9, 15.9):
                scale = TimeScale()
                before = USUAL_PERIOD * begin
                found = looks(scale, spells((before, USUAL_PERIOD), (math.inf, other)), 70.0)
                assert not any(took for age, took in found if age <= before)
                taken.append(next(took for age, took in found if age > before))
                assert scale.period == (other if any(took for _, took in found) else USUAL_PERIOD)
            assert taken == [early, settled, late], ratio


@pytest.mark.parametrize('calm', [2.0, 30.0])
def test_after_a_calm_the_first_motion_is_taken_as_soon_as_it_is_known(calm):
    """Of another motion that was known for long, less than two fifths different, nothing would be taken."""
    known = 20.0 * USUAL_PERIOD
    begin = known + calm * USUAL_PERIOD
    for ratio in (0.25, 0.5):
        scale, other = TimeScale(), ratio * USUAL_PERIOD
        found = looks(scale, spells((known, USUAL_PERIOD), (begin, math.nan), (math.inf, other)), begin + 30.0)
        assert not any(took for age, took in found if age <= begin)
        # since the last look at the calm
        known_at = max(age for age, _ in found if age <= begin) + 1.25 * other
        assert [took for age, took in found if begin < age][: sum(begin < age < known_at for age, _ in found) + 1][-1]
        assert not any(took for age, took in found if age < known_at)
    # one that differs less: within its first period, however long the one before was known
    for other in (1.3 * USUAL_PERIOD, USUAL_PERIOD / 1.3):
        for end, is_taken in ((begin, True), (known, False)):
            value = spells((known, USUAL_PERIOD), (end, math.nan), (math.inf, other))
            found = [age for age, took in looks(TimeScale(), value, begin + 30.0) if took]
            assert bool(found) == is_taken
            if is_taken:
                assert found[0] <= begin + 1.3 * max(other, USUAL_PERIOD)


def test_nothing_found_changes_nothing_and_looks_go_on_every_quarter_of_a_period():
    scale = TimeScale()
    ages, taken = zip(*looks(scale, math.nan, 30.0), strict=True)
    assert not any(taken) and scale.period == USUAL_PERIOD
    assert np.diff(ages) == pytest.approx(0.25 * USUAL_PERIOD, abs=0.011)


def test_the_past_looked_at_is_thirty_periods_in_blocks_of_two():
    scale = TimeScale()
    assert scale.past(7.0) == (7.0, pytest.approx(2.0 * USUAL_PERIOD))
    assert scale.past(1e4) == (pytest.approx(30.0 * USUAL_PERIOD), pytest.approx(2.0 * USUAL_PERIOD))


@given(st.floats(0.25, 0.98), st.floats(0.0, math.tau), st.floats(0.05, 1.0))
def test_a_part_of_a_period_makes_no_motion_quicker_than_was_known(part, phase, share):
    """Where it turns, it looks like one whose period has just been seen."""
    ages = np.linspace(0.0, part * USUAL_PERIOD, 60)
    angle, rate = rows_at(ages, USUAL_PERIOD, phase)
    found = period_of(angle, rate, ages[1], np.zeros(1), np.zeros(1), 1000)
    scale = TimeScale()
    scale.period = known = share * USUAL_PERIOD
    scale.follow(found, ages[-1])
    assert scale.period >= known
    assert scale.period <= max(1.26 * USUAL_PERIOD, known)


@pytest.mark.parametrize(
    ('interval', 'period', 'usual'),
    [(0.01, 0.32, USUAL_PERIOD), (0.3, USUAL_PERIOD, USUAL_PERIOD), (1.0, 10.0, 10.0), (6.0, 60.0, 60.0)],
)
def test_a_sensor_is_expected_to_see_ten_samples_of_a_motion_and_a_quick_one_a_quick_motion(interval, period, usual):
    """Until it sees a craft at rest."""
    scale = TimeScale()
    scale.expect(interval)
    assert scale.period == pytest.approx(period)
    (first, took), *later = looks(scale, math.nan, 3.0 * usual)
    assert first == pytest.approx(0.25 * period, abs=0.02) and took == (usual > period)
    assert scale.period == usual and not any(took for _, took in later)
