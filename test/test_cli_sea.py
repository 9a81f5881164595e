"""The verb ``sea``: words, JSON and a picture of a simulated sea, and what cannot be used."""

import json

import numpy as np
import pytest

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.main import main
from swath_sysid.formats.csv_trials import write_csv

BEARING = np.radians(30.0)


def one_wave(duration, length=60.0, height=1.0):
    """A craft that lies on a long wave of nearly one frequency, from abaft the port bow."""
    time = np.arange(0.0, duration, 0.1)
    w = np.sqrt(2.0 * np.pi * STANDARD_GRAVITY / length) * np.array([0.97, 1.0, 1.03])[:, None]
    number, phase = w**2 / STANDARD_GRAVITY, np.array([0.1, 2.0, 4.0])[:, None]
    size = 0.5 * height * np.array([0.3, 0.6, 0.3])[:, None]
    swing = w * time + phase
    slope = (number * size * np.cos(swing)).sum(axis=0)
    slope_rate = -(number * w * size * np.sin(swing)).sum(axis=0)
    up = STANDARD_GRAVITY - (w**2 * size * np.sin(swing)).sum(axis=0)
    roll, pitch = np.sin(BEARING) * slope, -np.cos(BEARING) * slope
    force = [-np.sin(pitch) * up, np.sin(roll) * np.cos(pitch) * up, np.cos(roll) * np.cos(pitch) * up]
    trial = Trial(time, roll, pitch, np.sin(BEARING) * slope_rate, -np.cos(BEARING) * slope_rate, *force)
    return trial, 4.0 * np.sqrt(0.5 * (size**2).sum()), 2.0 * np.pi / w[1, 0]


@pytest.fixture(scope='module')
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp('sea') / 'wave.csv'
    trial, height, period = one_wave(900.0)
    write_csv(path, trial)
    return path, height, period


def test_a_known_wave_is_told_as_json_and_drawn(record, tmp_path, capsys):
    path, height, period = record
    assert main(['sea', str(path), '--json', '--plot', str(tmp_path / 'sea.png')]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['significant_height_m'] == pytest.approx(height, rel=0.02)
    assert told['mean_period_s'] == pytest.approx(period, rel=0.01)
    assert told['peak_period_interval_s'][0] <= period <= told['peak_period_interval_s'][1]
    assert np.degrees(told['axis_rad']) == pytest.approx(30.0, abs=2.0)
    assert (tmp_path / 'sea.png').stat().st_size > 10_000


def test_words_say_what_it_is_and_what_it_is_not(record, capsys):
    assert main(['sea', str(record[0]), '--start', '100', '--end', '500']) == 0
    told = capsys.readouterr().out
    words = '7 min', 'significant height', '30 ±', 'to port of the bow', 'at the sensor', 'encounter', 'not a wave buoy'
    assert [part for part in words if part not in told] == []


@pytest.mark.parametrize(
    ('options', 'words'), [(['--end', '120'], 'too few waves'), (['--start', '1000'], 'no two samples')]
)
def test_what_shows_no_sea_is_refused(record, options, words, capsys):
    assert main(['sea', str(record[0]), *options]) == 2
    assert words in capsys.readouterr().err


def test_a_record_without_accelerations_is_refused(tmp_path, capsys):
    trial, *_ = one_wave(400.0)
    write_csv(tmp_path / 'angles.csv', Trial(trial.time, trial.roll, trial.pitch))
    assert main(['sea', str(tmp_path / 'angles.csv')]) == 2
    assert 'holds no accel_x' in capsys.readouterr().err
