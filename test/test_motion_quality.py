"""The quality gates: each speaks where it should, and all keep quiet on good records."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.motion.quality import check_decay, check_motion, clipped_extremes
from swath_sysid.attitude.motion.segmentation import find_decay, find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

HULL = DecayModel.from_terms(EQUATIONS['linear'], {'b1': 0.25, 'r1': 9.0}, axis='roll')


def decay(rate_hz=100.0, angle_deg=8.0, angle_noise=0.0005):
    noise = SensorNoise(angle_noise, 0.002)
    trial = simulated_trial(HULL, np.radians(angle_deg), 25.0, rate_hz, noise, seed=1, hold=2.0)
    return replace(trial.axis('roll'), rate=None)


def codes(motion, start=2.2, end=20.0):
    segment = find_decay(motion, start, end)
    return {a.code for a in (*check_motion(motion), *check_decay(motion, segment))}


def test_good_records_pass(data_folder):
    names = [f'decay/kvlcc2/{name}.csv' for name in ('run2_0kn', 'run3_15kn')]
    for path in [*(data_folder / name for name in names), *(data_folder / 'decay/foswec').glob('*.csv')]:
        motion = read_trial(path).axis('pitch' if 'foswec' in str(path) else 'roll')
        assert check_motion(motion) == (), path.name
        assert check_decay(motion, find_decay(motion)) == (), path.name


def test_good_simulated_records_pass_even_with_lone_losses():
    motion = decay()
    lost = np.arange(motion.size) % 37 == 0
    assert codes(motion) == codes(motion, None, None) == codes(motion.only(~lost)) == set()
    assert check_motion(motion, find_decays(motion)) == check_motion(motion)
    assert 'low-rate' not in codes(decay(rate_hz=12.0))


@pytest.mark.parametrize('rate_hz', [3.0, 5.0, 10.0])
def test_the_kink_of_a_release_is_no_spike(rate_hz):
    trial = simulated_trial(HULL, np.radians(8.0), 25.0, rate_hz, SensorNoise(0.0, 0.0), seed=1)
    motion = trial.axis('roll')
    assert 'spikes' not in {a.code for a in check_decay(motion, find_decay(motion))}


@pytest.mark.parametrize(
    ('made', 'bounds', 'code'),
    [
        ({}, (2.2, 5.0), 'too-few-cycles'),
        ({'angle_deg': 0.4, 'angle_noise': 0.0001}, (2.2, 10.0), 'too-small'),
        ({'rate_hz': 6.0}, (), 'low-rate'),
    ],
)
def test_simulated_records_are_told_what_they_lack(made, bounds, code):
    assert code in codes(decay(**made), *bounds)


@pytest.mark.parametrize(
    ('name', 'code'),
    [
        ('waves/morro_buoy', 'forced-motion'),
        ('waves/nbp1406_ship', 'forced-motion'),
        ('faults/oahu_static_bad_packets', 'too-small'),
    ],
)
def test_records_without_a_decay_say_why(name, code, data_folder):
    trial = read_trial(data_folder / f'{name}.csv')
    for motion in map(trial.axis, trial.axes):
        assert find_decays(motion) == () and [a.code for a in check_motion(motion)] == [code]
        assert code == 'too-small' or code in [a.code for a in check_decay(motion, find_decay(motion, 100.0, 300.0))]


def test_gaps_and_spikes():
    motion = decay()
    holed = motion.only(~((motion.time > 4.0) & (motion.time < 4.6)))
    angle = motion.angle.copy()
    angle[[500, 900, 1300]] += 0.3
    for spoilt, code, words in ((holed, 'gaps', '0.6'), (replace(motion, angle=angle), 'spikes', '3 samples')):
        (found,) = check_decay(spoilt, find_decay(spoilt if code == 'gaps' else motion, 2.2, 20.0))
        assert found.code == code and words in found.message


def test_saturation_is_told_from_rounding():
    motion = decay(angle_noise=0.0)
    assert codes(replace(motion, angle=np.clip(motion.angle, -0.08, 0.08)), 2.4, 20.0) == {'saturation'}
    assert codes(replace(motion, angle=np.round(motion.angle, 4))) == set()
    assert codes(replace(motion, angle=np.round(motion.angle / 0.005) * 0.005)) == set()
    whole = simulated_trial(HULL, np.radians(8.0), 25.0, 100.0, SensorNoise(0.0005, 0.002), seed=1).axis('roll')
    motion = replace(whole, rate=np.clip(whole.rate, -0.2, 0.2))
    (found,) = (a for a in check_decay(motion, find_decay(motion)) if a.code == 'saturation')
    assert '11.5 deg/s' in found.message


def test_being_held_is_not_saturation():
    """The same jig holds twice at exactly the same angle, without any noise."""
    time = np.arange(0.0, 40.0, 0.01)
    angle = np.full(time.size, 0.1)
    for release in (5.0, 25.0):
        free = (time >= release) & (time < release + 15.0)
        angle[free] = 0.1 * np.exp(-0.3 * (time[free] - release)) * np.cos(3.0 * (time[free] - release))
    assert clipped_extremes(angle, 100) == (0, 0.0)


def test_clipped_swings_are_counted():
    time = np.arange(0.0, 30.0, 0.01)
    swing = 0.1 * np.exp(-0.05 * time) * np.cos(2 * np.pi * time / 3.0 + 1.0)
    turns = 1.5 * np.arange(1, 20) - 3.0 / (2 * np.pi)
    count, level = clipped_extremes(np.clip(swing, -0.07, 0.07), 150)
    assert level == pytest.approx(0.07)
    assert count == np.count_nonzero(0.1 * np.exp(-0.05 * turns) > 0.07)


def test_given_bounds_that_reach_too_far(data_folder):
    motion = read_trial(data_folder / 'decay/kvlcc2/run3_15kn.csv').axis('roll')

    def told(start, end):
        return [a.code for a in check_decay(motion, find_decay(motion, start, end))]

    assert told(26.0, 75.0) == []
    assert told(26.0, 87.0) == ['disturbed-tail']
    assert told(10.0, 75.0) == ['late-start']


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.sampled_from([0.0, 0.01, 1.0]), st.booleans())
@pytest.mark.filterwarnings('error')
def test_whatever_comes_is_looked_at(seed, size, step, as_rate):
    random = np.random.default_rng(seed)
    time = np.cumsum(random.exponential(size=size) + 1e-6)
    value = np.cumsum(random.normal(size=size))
    value = np.round(value / step) * step if step else value
    motion = AxisMotion('roll', time, None if as_rate else value, value if as_rate else None)
    assert all(a.message for a in check_motion(motion))
    try:
        segment = find_decay(motion, time[size // 4], time[-1])
    except InputError:
        return
    assert all(a.message for a in check_decay(motion, segment))
