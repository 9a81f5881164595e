"""A time column that counts something else than its name says is found."""

import numpy as np
import pytest

from swath_sysid.attitude.motion.time_base import check_time_base, motion_period
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import read_csv


def swing(size, samples_a_cycle):
    return 0.1 * np.sin(2.0 * np.pi * np.arange(size) / samples_a_cycle)


@pytest.mark.parametrize(
    ('time', 'words'),
    [
        (10.0 * np.arange(900), 'call it time_ms, as its unit is'),
        (1000.0 * np.arange(900), 'call it time_ms or time_us'),
        (1e7 * np.arange(900), 'call it time_ns'),
        (1.7e12 + 10.0 * np.arange(900), 'call it time_ms, as'),
        (1.7e15 + 1e4 * np.arange(900), 'call it time_us, as'),
        (1.7e18 + 1e7 * np.arange(900), 'call it time_ns, as'),
        (1e-5 * np.arange(900), 'more often than any sensor'),
        (1.0 * np.arange(900), 'name it time_samples'),
        (np.delete(1.0 * np.arange(901), 300), 'name it time_samples'),
    ],
)
def test_other_units_are_refused_with_their_cure(time, words):
    with pytest.raises(InputError, match=words):
        check_time_base(time, [swing(900, 200.0)], 'a.csv')


def test_slow_sensors_pass():
    time = np.arange(700.0)
    for samples_a_cycle in (8.0, 50.0):
        check_time_base(time, [swing(700, samples_a_cycle)], 'a.csv')
    check_time_base(time, [np.random.default_rng(1).normal(size=700)], 'a.csv')
    check_time_base(1.7e9 + 0.02 * time, [swing(700, 100.0)], 'a.csv')


def test_period_is_that_of_the_swing():
    assert motion_period(0.02 * np.arange(2000), swing(2000, 150.0)) == pytest.approx(3.0, rel=1e-2)
    assert motion_period(np.arange(50.0), np.full(50, 2.0)) is None


@pytest.mark.parametrize(
    ('name', 'amplitude', 'is_doubted'),
    [('roll_deg', 0.1, True), ('roll_deg', 3.0, False), ('roll_rad', 2.5, True), ('roll_rad', 0.5, False)],
)
def test_angles_of_an_unlikely_size_may_have_the_other_unit(tmp_path, name, amplitude, is_doubted):
    path = tmp_path / 'a.csv'
    rows = '\n'.join(
        f'{0.01 * k},{v}' for k, v in enumerate(amplitude / np.ptp(swing(900, 200.0)) * 2 * swing(900, 200.0))
    )
    path.write_text(f'time_s,{name}\n{rows}\n')
    assert ('other-unit-likely' in {a.code for a in read_csv(path).advice}) == is_doubted


def test_nbp1406_at_one_hertz_is_read(data_folder):
    trial = read_csv(data_folder / 'waves' / 'nbp1406_ship.csv')
    assert 'other-unit-likely' not in {a.code for a in trial.advice}


def test_sample_numbers_are_read_where_their_rate_is_given(tmp_path):
    path = tmp_path / 'a.csv'
    rows = '\n'.join(f'{k},{v}' for k, v in enumerate(swing(900, 200.0)))
    path.write_text(f'# sample_rate_hz: 100\ntime_samples,roll_rad\n{rows}\n')
    trial = read_csv(path)
    assert trial.time == pytest.approx(0.01 * np.arange(900))
    path.write_text(f'time_samples,roll_rad\n{rows}\n')
    with pytest.raises(InputError, match='sample_rate_hz'):
        read_csv(path)
