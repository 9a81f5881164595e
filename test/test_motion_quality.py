"""The quality gates: each speaks where it should, and all keep quiet on good records."""

from dataclasses import replace

import numpy as np
import pytest

from swath_sysid.files.reading import read_trial
from swath_sysid.hull.catalogue import EQUATIONS
from swath_sysid.hull.decay_model import DecayModel
from swath_sysid.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.motion.quality import check_decay, check_motion
from swath_sysid.motion.segmentation import find_decay
from swath_sysid.report.figures import save_figure
from swath_sysid.report.record_figure import record_figure

HULL = DecayModel.from_terms(EQUATIONS['linear'], {'b1': 0.25, 'r1': 9.0}, axis='roll')


def decay(rate_hz=100.0, angle_deg=8.0, angle_noise=0.0005):
    noise = SensorNoise(angle_noise, 0.002)
    trial = simulated_trial(HULL, np.radians(angle_deg), 25.0, rate_hz, noise, seed=1, hold=2.0)
    return replace(trial.axis('roll'), rate=None)


def codes(motion, start=2.2, end=20.0):
    segment = find_decay(motion, start, end)
    return {a.code for a in (*check_motion(motion), *check_decay(motion, segment))}


def test_a_good_record_passes():
    assert codes(decay()) == set()


@pytest.mark.parametrize('name', ['run2_0kn', 'run3_15kn'])
def test_good_tank_records_pass(name, data_folder):
    motion = read_trial(data_folder / f'decay/kvlcc2/{name}.csv').axis('roll')
    assert check_motion(motion) == ()
    assert check_decay(motion, find_decay(motion)) == ()


def test_good_platform_records_pass(data_folder):
    for path in sorted((data_folder / 'decay/foswec').glob('*.csv')):
        motion = read_trial(path).axis('pitch')
        assert check_decay(motion, find_decay(motion)) == (), path.name


def test_too_few_cycles():
    assert 'too-few-cycles' in codes(decay(), 2.2, 5.0)


def test_too_small():
    assert 'too-small' in codes(decay(angle_deg=1.0, angle_noise=0.004), 2.2, 10.0)


def test_low_rate():
    assert 'low-rate' in codes(decay(rate_hz=6.0))


def test_gaps():
    motion = decay()
    holed = motion.only(~((motion.time > 4.0) & (motion.time < 4.6)))
    segment = find_decay(holed, 2.2, 20.0)
    (whole,), inside = check_motion(holed), check_decay(holed, segment)
    assert (whole.code, [a.code for a in inside]) == ('gaps', ['gaps'])
    assert '0.6' in whole.message


def test_saturation_is_told_from_rounding():
    motion = decay(angle_noise=0.0)
    assert codes(replace(motion, angle=np.clip(motion.angle, -0.08, 0.08)), 2.4, 20.0) == {'saturation'}
    assert codes(replace(motion, angle=np.round(motion.angle, 4))) == set()


def test_coarse_quantisation():
    motion = decay(angle_noise=0.0)
    assert 'coarse-quantisation' in codes(replace(motion, angle=np.round(motion.angle / 0.005) * 0.005))


def test_picture_of_a_record_is_drawn_with_its_decays(tmp_path, data_folder):
    trial = read_trial(data_folder / 'decay/kvlcc2/run3_15kn.csv')
    figure = record_figure([trial.axis('roll'), trial.axis('pitch')])
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert any('cycles of 2.54 s' in w for w in words)
    save_figure(figure, tmp_path / 'record.png')
    assert (tmp_path / 'record.png').stat().st_size > 20_000
