"""The log of a hull: changes by a likelihood ratio, dates, what is left out, and an interruption."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.craft_simulator import simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.at_sea import AT_SEA
from swath_sysid.cli.main import main
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.model_file import model_to_yaml, write_model
from swath_sysid.tank.campaign import history as log
from swath_sysid.tank.cli import history

TERMS = {'b1': 0.25, 'b2': 0.3, 'r1': 9.0, 'r3': -12.0}
FALL = math.log(0.95)


def model_of(gm=1.0, verdict='adequate', std=1e-3, damping=1.0):
    """A hull as identified, whose terms are known to a share ``std``."""
    factors = {'b1': damping, 'b2': damping, 'r1': gm, 'r3': gm}
    terms = {name: value * factors[name] for name, value in TERMS.items()}
    model = DecayModel.from_terms(equation_named('odd-cubic'), terms, axis='roll')
    spread = np.diag([(std * abs(terms[name])) ** 2 for name in model.equation.terms])
    return IdentifiedModel(model, spread, amplitude_range=(0.02, 0.14), metrics={'verdict': verdict})


def rows_of(folder):
    with open(folder / 'history.csv', newline='') as file:
        return list(csv.DictReader(file))


def series_of(seed, fall_at=None, count=20):
    """A logarithm of GM over days, with a scatter from day to day that is not in the standard deviations."""
    rng = np.random.default_rng(seed)
    std = 0.0008 * rng.uniform(0.7, 1.5, count)
    value = np.hypot(std, rng.choice([0.0, 0.002, 0.006])) * rng.standard_normal(count)
    return log.Series(value + FALL * (np.arange(count) >= (fall_at or count)), std, np.zeros(count, dtype=bool))


@pytest.mark.long
def test_a_fall_of_gm_is_found_on_its_day_and_none_where_there_is_none(monkeypatch):
    monkeypatch.setattr(log, 'DRAWS', 600)
    held = 0
    for seed in range(20):
        assert log.changes_of(series_of(seed), log.FALSE_ALARM / 2) == []
        day = 3 + seed % 15
        series = series_of(100 + seed, day)
        (change,) = log.changes_of(series, log.FALSE_ALARM / 2)
        assert abs(change.place - day) <= 1 and change.earliest <= day <= change.latest
        ((step, half),) = log.steps_of(series, [change.place])
        held += abs(step - FALL) <= half
    assert held >= 18


def test_the_likelihoods_are_those_of_normal_distributions(monkeypatch):
    monkeypatch.setattr(log, 'SCATTERS', np.array([0.7]))
    rng = np.random.default_rng(3)
    series = log.Series(rng.standard_normal(9), rng.uniform(0.2, 1.0, 9), np.arange(9) % 3 == 0)
    without, best, _ = series.likelihoods(series.value[None])
    spread = np.diag(series.std**2 + (0.7 * series.value.std()) ** 2)

    def of(columns):
        weight = np.linalg.inv(spread)
        mean = columns @ np.linalg.solve(columns.T @ weight @ columns, columns.T @ weight @ series.value)
        return multivariate_normal(mean, spread).logpdf(series.value) + 4.5 * math.log(2.0 * math.pi)

    assert without[0] == pytest.approx(of(series.levels))
    expected = [of(np.column_stack([series.levels, np.arange(9) >= place])) for place in range(1, 9)]
    np.testing.assert_allclose(best[0], expected)


def test_decays_and_waves_have_levels_of_their_own(monkeypatch):
    monkeypatch.setattr(log, 'DRAWS', 300)
    series = series_of(5)
    at_sea = np.arange(20) % 4 == 1
    other = replace(series, value=series.value + 0.2 * at_sea, at_sea=at_sea)
    assert log.changes_of(other, 0.005) == []
    assert log.changes_of(replace(other, at_sea=np.arange(20) >= 10, value=other.value), 0.005) == []


@pytest.mark.long
def test_model_files_of_many_days(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(log, 'DRAWS', 999)
    for day in range(1, 11):
        gm = (0.95 if day > 6 else 1.0) * (1.0 + 1e-3 * math.sin(7.0 * day))
        verdict = 'doubtful' if day == 3 else 'adequate'
        # the folder is not in the order of the days
        write_model(
            tmp_path / f'{20 - day}_2026-11-{day:02}.yaml',
            {'roll': model_of(gm, verdict, damping=1.1 if day > 5 else 1.0)},
        )
    write_model(
        tmp_path / 'pitch_2026-11-20.yaml',
        {'pitch': replace(model_of(), model=replace(model_of().model, axis='pitch'))},
    )
    assert main(['history', str(tmp_path), '--gm', '0.8', '--output', str(tmp_path / 'out')]) == 1
    said = capsys.readouterr().out
    assert 'no roll model' in said and '9 of 10 entries are used' in said
    assert 'GM fell by 5.0' in said and '2026-11-06 00:00' in said and '2026-11-07 00:00' in said
    rows = rows_of(tmp_path / 'out')
    assert [row['date [UTC]'][8:10] for row in rows] == [f'{day:02}' for day in range(1, 11)]
    assert float(rows[-1]['GM [m]']) == pytest.approx(0.76, rel=3e-3)
    assert (rows[5]['change'], rows[6]['change']) == ('the damping', 'GM')
    page = (tmp_path / 'out' / 'history.html').read_text()
    assert 'GM fell by' in page and '<svg' in page and (tmp_path / 'out' / 'history.svg').is_file()


def test_a_model_at_sea_keeps_its_own_period(tmp_path):
    metrics = {'natural_period_s': 2.2, 'natural_period_std_s': 0.05, 'damping_ratio': 0.1, 'damping_ratio_std': 0.02}
    sea = replace(model_of(), metrics=metrics, provenance={'identified_from': AT_SEA}, amplitude_range=(0.3, 0.3))
    logged = [log.Logged('sea', None, 'adequate', sea), log.Logged('decay', 5.0, 'adequate', model_of())]
    (first, second), amplitude = log.entries_of(logged)
    assert (first.name, first.at_sea, first.period) == ('sea', True, 2.2)
    assert amplitude == pytest.approx(math.sqrt(0.02 * 0.14))
    assert second.period == pytest.approx(2.0 * math.pi / 3.0, rel=0.01) and 0.0 < second.period_std < 0.01


def test_an_interrupted_log_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    done = []

    def hull_of(trial, axis, began):
        done.append(trial.source)
        if len(done) == 4:
            raise KeyboardInterrupt
        return [began, 'adequate', model_to_yaml({axis: model_of()}), {'axis': axis, 'tilts': []}]

    monkeypatch.setattr(history, 'hull_of', hull_of)
    trial = simulated_trial(model_of().model, 0.1, 10.0, 20.0, hold=1.0)
    for day in range(1, 7):
        moved = replace(trial, roll=trial.roll + 1e-4 * day)
        write_imu_bag(tmp_path / f'bag{day}', moved, start_stamp_ns=(1_790_000_000 + 86_400 * day) * 10**9)
    (tmp_path / 'torn.csv').write_text('not a record')
    write_csv(tmp_path / 'copy.csv', trial)
    command = ['history', str(tmp_path), '--jobs', '1', '--output', str(tmp_path / 'out')]
    assert main(command) == 130
    assert not (tmp_path / 'out' / 'history.csv').exists()
    assert main(command) == 1
    assert len(done) == 8 and len(set(done)) == 7
    said = capsys.readouterr()
    assert 'the same command continues' in said.err and 'left out: torn.csv' in said.out
    rows = rows_of(tmp_path / 'out')
    assert len({row['date [UTC]'] for row in rows}) == 7 and {row['verdict'] for row in rows} == {'adequate'}


def test_dates_of_bags_and_of_names(tmp_path):
    write_imu_bag(
        tmp_path / 'bag', simulated_trial(model_of().model, 0.1, 3.0, 20.0), start_stamp_ns=1_790_000_000 * 10**9
    )
    assert history._start_of(str(tmp_path / 'bag')) == pytest.approx(1_790_000_000, abs=1.0)
    for name, seconds in (
        ('rosbag2_2026_11_27-10_15_30.csv', 1795774530.0),
        ('20261127T1015.csv', 1795774500.0),
        ('log 2026-11-27.csv', 1795737600.0),
        ('roll_2026-13-40.csv', None),
        ('R20261127123.csv', None),
        ('V01.csv', None),
    ):
        assert history._date_in(name) == seconds, name


def test_bad_input_is_one_sentence(tmp_path, capsys):
    (tmp_path / 'empty').mkdir()
    for words, said in (
        ([str(tmp_path / 'empty')], 'holds no record'),
        ([str(tmp_path / 'absent.csv')], 'absent.csv'),
        ([str(tmp_path), '--gm', '0'], '--gm must be greater than zero'),
    ):
        assert main(['history', *words, '--output', str(tmp_path / 'out')]) == 2
        assert said in capsys.readouterr().err
