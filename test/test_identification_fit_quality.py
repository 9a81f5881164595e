"""Verdicts follow from the motion of the next release; what is no decay is never adequate, measured decays are."""

import json
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import equation_named, hull_named
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.identification.fit_quality import ADEQUATE, DOUBTFUL, REJECTED, judge, posterior_errors
from swath_sysid.attitude.identification.identify import IdentificationSettings, identify
from swath_sysid.attitude.motion.assembly import assemble_trial
from swath_sysid.cli.main import main
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial

ROOT = Path(__file__).resolve().parents[1]
TRUE = simulated_trial(hull_named('swath-pitch').model, np.radians(6.0), 15.0, 50.0, SensorNoise(), 1, 1.0)
FAULTS = {
    'the rate is in deg/s': lambda rate: np.degrees(rate),
    'with the opposite sign': lambda rate: -rate,
    'after the': lambda rate: np.roll(rate, 20),
    'calibrate the gyroscope': lambda rate: rate + np.radians(20.0),
    'does not follow it': lambda rate: np.random.default_rng(3).normal(0.0, 0.02, rate.size),
}


@pytest.mark.parametrize('words', FAULTS)
def test_rates_that_contradict_the_angle_are_no_noise(words, tmp_path, capsys):
    faulty = replace(TRUE, pitch_rate=FAULTS[words](TRUE.pitch_rate))
    verdict = identify([faulty.axis('pitch')], IdentificationSettings('swath-pitch-2')).verdict
    assert (verdict.level, verdict.code) == (REJECTED, 'angle-against-rate')
    # and a record that contradicts itself is not fitted to begin with, whatever is forced
    path, model = tmp_path / 'a.csv', tmp_path / 'm.yaml'
    write_csv(path, faulty)
    assert main(['identify', str(path), '--axis', 'pitch', '--output', str(model), '--force']) == 2
    assert words in capsys.readouterr().err and not model.exists()


@pytest.mark.parametrize('verb', [['identify', '--equation'], ['compare', '--jobs', '1', '--equations']])
def test_a_poor_fit_is_written_only_with_force(verb, tmp_path, capsys):
    path, model = tmp_path / 'a.csv', tmp_path / 'm.yaml'
    write_csv(path, TRUE)
    command = [*verb, 'b3|r3', str(path), '--objective', 'one-step', '--axis', 'pitch', '--output', str(model)]
    assert main([*command, '--json']) == 1
    out, error = capsys.readouterr()
    assert 'poor-fit' in [w['code'] for w in json.loads(out)['warnings']]
    assert 'was not written' in error and not model.exists()
    assert main([*command, '--force']) == 0 and model.exists()


def test_white_noise_is_no_fault():
    noisy = SensorNoise(TRUE.pitch.std() / 5.0, 0.1, 0.0)
    trial = simulated_trial(hull_named('swath-pitch').model, np.radians(6.0), 15.0, 50.0, noisy, 1, 0.0)
    assert identify([trial.axis('pitch')]).verdict.level != REJECTED


@pytest.fixture(scope='module')
def found():
    return identify([TRUE.axis('pitch')], IdentificationSettings('swath-pitch-2'))


def test_a_good_fit_is_adequate(found):
    assert found.verdict.level == ADEQUATE and found.verdict.warnings == ()
    assert 0.005 < found.verdict.motion_error < 0.06
    metrics = found.identified_model({}).metrics
    assert {name: metrics[name] for name in found.verdict.metrics} == found.verdict.metrics
    assert metrics['verdict'] == ADEQUATE and metrics['verdict_sentence'] == found.verdict.sentence


@pytest.mark.parametrize(
    'path', ['records/kvlcc2_roll_decay.csv', 'kvlcc2/run3_15kn.csv', 'foswec/pitch_8.4deg_repeat3.csv']
)
def test_measured_decays_are_adequate(path, data_folder):
    is_roll = 'kvlcc2' in path
    place = ROOT / path if path.startswith('records') else data_folder / 'decay' / path
    equation = 'b1,b3|r1,r3' if is_roll else 'b0,b1,b2|r1,r2,r3'
    motion = read_trial(place).axis('roll' if is_roll else 'pitch')
    verdict = identify([motion], IdentificationSettings(equation)).verdict
    assert verdict.level == ADEQUATE, str(verdict)


def test_the_error_of_the_next_release_is_that_of_its_period(found):
    """Against the closed form of a linear oscillator whose stiffness alone is uncertain."""
    damping, stiffness, std = 0.3, 10.0, 0.3
    model = DecayModel.from_terms(equation_named('linear'), {'b1': damping, 'r1': stiffness})
    scales = replace(found.problem.scales, frequency=np.sqrt(stiffness))
    problem = replace(found.problem, scales=scales)
    linear = replace(found, model=model, covariance=np.diag([0.0, std**2]), trim_std=0.0, problem=problem)
    time = np.linspace(0.0, 4.0 * 2.0 * np.pi / np.sqrt(stiffness), 2000)

    def motion(r1):
        frequency = np.sqrt(r1 - damping**2 / 4.0)
        return np.exp(-damping * time / 2.0) * (
            np.cos(frequency * time) + damping / (2.0 * frequency) * np.sin(frequency * time)
        )

    # 90 % of a Gaussian lie within 1.645 of its standard deviations
    sides = [np.std(motion(stiffness + s * 1.645 * std) - motion(stiffness)) for s in (-1.0, 1.0)]
    expected = np.mean(sides) / np.sqrt(np.mean(motion(stiffness) ** 2))
    assert posterior_errors(linear)[0] == pytest.approx(expected, rel=0.15)
    trim, _ = posterior_errors(replace(linear, covariance=np.zeros((2, 2)), trim_std=scales.amplitude / 20.0))
    assert trim == pytest.approx(
        1.645 / 20.0 * np.sqrt(np.mean((1.0 - motion(stiffness)) ** 2) / np.mean(motion(stiffness) ** 2)), rel=0.15
    )


@pytest.mark.parametrize(('scale', 'level'), [(1.0, ADEQUATE), (5.0, DOUBTFUL), (100.0, REJECTED), (np.nan, REJECTED)])
def test_what_the_record_leaves_open_makes_the_verdict(found, scale, level):
    verdict = judge(replace(found, covariance=scale**2 * found.covariance))
    assert verdict.level == level
    assert level == ADEQUATE or verdict.code == 'motion-uncertain'
    assert not np.isnan(scale) or verdict.metrics['motion_error'] is None


@pytest.mark.parametrize(('r1', 'code'), [(0.0, 'no-period'), (-1.0, 'no-period'), (1e-3, 'implausible-period')])
def test_a_period_that_is_none_is_rejected(found, r1, code):
    model = DecayModel.from_terms(found.model.equation, {'b1': 1.5, 'r1': r1, 'r3': 2961.0})
    changed = replace(found, model=model)
    vars(changed)['records'] = found.records
    verdict = judge(changed)
    assert (verdict.level, verdict.code) == (REJECTED, code)
    assert 'nan' not in verdict.sentence and 'inf' not in verdict.sentence
    assert all(value is None or value == value for value in verdict.metrics.values())


@pytest.mark.parametrize(
    ('kind', 'seed'),
    [
        ('bump', 11),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (('trim_shift', 1), ('wake', 6), ('bump', 0), ('trim_shift', 3))
        ),
    ],
)
def test_what_is_no_decay_is_not_adequate(kind, seed):
    """The hardest of 200, each by its seed."""
    bench = runpy.run_path(str(ROOT / 'benchmark' / 'false_models.py'))
    level, code, words = bench['verdict_on'](bench['made_motion'](kind, seed))
    assert level != ADEQUATE, (code, words)


def test_a_fraction_of_the_rows_is_never_adequate(found):
    stamped = np.where(np.random.default_rng(1).random(TRUE.time.size) < 0.15, TRUE.time, np.nan)
    motion = assemble_trial(stamped, {'pitch': TRUE.pitch, 'pitch_rate': TRUE.pitch_rate}).axis('pitch')
    changed = replace(found)
    vars(changed)['records'] = [
        replace(r, motion=replace(r.motion, usable_share=motion.usable_share)) for r in found.records
    ]
    verdict = judge(changed)
    assert (verdict.level, verdict.code) == (DOUBTFUL, 'few-samples')


def test_a_period_of_minutes_is_a_time_in_another_unit(tmp_path, capsys):
    path = tmp_path / 'a.csv'
    write_csv(path, replace(TRUE, time=TRUE.time * 50.0, pitch_rate=None))
    assert main(['identify', str(path), '--axis', 'pitch']) in (1, 2)
    assert 'time_samples' in capsys.readouterr().out


def test_identical_files_count_once(tmp_path, capsys):
    for name in ('a.csv', 'b.csv'):
        write_csv(tmp_path / name, TRUE)
    command = ['identify', str(tmp_path / 'a.csv'), str(tmp_path / 'b.csv'), '--axis', 'pitch', '--json']
    assert main(command) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found['sources']) == 1
    assert 'identical-files' in [w['code'] for w in found['warnings']]
