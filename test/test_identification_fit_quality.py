"""Fits that explain too little are named and not written without --force; those of measured decays pass."""

import json
from dataclasses import replace

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.identification.fit_quality import REFUSED, explained_share
from swath_sysid.attitude.identification.identify import identify
from swath_sysid.cli.main import main
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial

TRUE = simulated_trial(hull_named('swath-pitch').model, np.radians(6.0), 15.0, 50.0, SensorNoise(), 1, 1.0)
FAULTS = {
    'deg/s': lambda rate: np.degrees(rate),
    'sign': lambda rate: -rate,
    'late': lambda rate: np.roll(rate, 20),
    'offset': lambda rate: rate + np.radians(20.0),
}


@pytest.mark.parametrize('fault', FAULTS)
def test_rates_that_contradict_the_angle_are_no_noise(fault, tmp_path, capsys):
    faulty = replace(TRUE, pitch_rate=FAULTS[fault](TRUE.pitch_rate))
    assert identify([faulty.axis('pitch')]).verdict.level == REFUSED
    # and a record that contradicts itself is not fitted to begin with, whatever is forced
    path, model = tmp_path / 'a.csv', tmp_path / 'm.yaml'
    write_csv(path, faulty)
    assert main(['identify', str(path), '--axis', 'pitch', '--output', str(model), '--force']) == 2
    assert 'the pitch rate' in capsys.readouterr().err and not model.exists()


@pytest.mark.parametrize(
    'verb',
    [
        ['identify', '--equation', 'b3|r3'],
        ['compare', '--equations', 'b3|r3', '--jobs', '1'],
    ],
)
def test_a_poor_fit_is_written_only_with_force(verb, tmp_path, capsys):
    path, model = tmp_path / 'a.csv', tmp_path / 'm.yaml'
    write_csv(path, TRUE)
    command = [*verb, str(path), '--axis', 'pitch', '--output', str(model)]
    assert main([*command, '--json']) == 1
    out, error = capsys.readouterr()
    assert 'poor-fit' in [w['code'] for w in json.loads(out)['warnings']]
    assert 'was not written' in error and not model.exists()
    assert main([*command, '--force']) == 0 and model.exists()


def test_white_noise_is_no_fault():
    noisy = SensorNoise(TRUE.pitch.std() / 5.0, 0.1, 0.0)
    trial = simulated_trial(hull_named('swath-pitch').model, np.radians(6.0), 15.0, 50.0, noisy, 1, 0.0)
    assert identify([trial.axis('pitch')]).verdict.level != REFUSED


@pytest.mark.slow
def test_measured_decays_pass(data_folder):
    for name in (
        'kvlcc2/run2_0kn.csv',
        'kvlcc2/run3_15kn.csv',
        'foswec/pitch_3deg_repeat1.csv',
        'foswec/pitch_8.4deg_repeat3.csv',
    ):
        axis = 'roll' if 'kvlcc2' in name else 'pitch'
        assert identify([read_trial(data_folder / 'decay' / name).axis(axis)]).verdict.level != REFUSED, name


def test_explained_share_is_r2():
    measured = np.array([1.0, 2.0, 4.0])
    assert explained_share([(measured, measured)]) == 1.0
    assert explained_share([(measured, np.full(3, measured.mean()))]) == pytest.approx(0.0)
    assert explained_share([(np.ones(3), np.ones(3))]) == 0.0


def test_a_period_of_minutes_is_a_time_in_another_unit(tmp_path, capsys):
    path = tmp_path / 'a.csv'
    write_csv(path, replace(TRUE, time=TRUE.time * 50.0, pitch_rate=None))
    assert main(['identify', str(path), '--axis', 'pitch']) in (1, 2)
    assert 'time_samples' in capsys.readouterr().err


def test_identical_files_count_once(tmp_path, capsys):
    for name in ('a.csv', 'b.csv'):
        write_csv(tmp_path / name, TRUE)
    command = ['identify', str(tmp_path / 'a.csv'), str(tmp_path / 'b.csv'), '--axis', 'pitch', '--json']
    assert main(command) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found['sources']) == 1
    assert 'identical-files' in [w['code'] for w in found['warnings']]


def test_json_carries_what_was_found_in_the_record(tmp_path, capsys):
    path = tmp_path / 'a.csv'
    write_csv(path, TRUE)
    lines = path.read_text().splitlines()
    path.write_text('\n'.join([*lines[:300], lines[299], *lines[300:]]) + '\n')
    for verb, *more in (['identify'], ['compare', '--equations', 'linear', '--jobs', '1'], ['inspect']):
        main([verb, str(path), '--axis', 'pitch', '--json', *more])
        codes = [w['code'] for w in json.loads(capsys.readouterr().out)['warnings']]
        assert codes.count('repeated-stamps') == 1, verb
    assert main(['forecast', str(path), '--axis', 'pitch', '--json', '--leads', '0.1']) == 0
    assert 'repeated-stamps' in [w['code'] for w in json.loads(capsys.readouterr().out)['warnings']]


def test_inertia_beside_mass_is_refused(tmp_path, capsys):
    options = ['--inertia', '1', '--mass', '30', '--metacentric-height', '0.1']
    assert main(['identify', str(tmp_path / 'a.csv'), *options]) == 2
    assert 'not both' in capsys.readouterr().err
