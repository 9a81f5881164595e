"""The benchmarks: tables as the code gives them, no row that looks ahead, and an oracle that is one."""

import json
import re
from typing import Annotated

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from repository import ROOT
from scipy.linalg import companion

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.evaluation.cli.benchmark import Benchmark, LeadErrors, Line


@pytest.fixture
def records(benchmark_module):
    return benchmark_module('records')


@pytest.fixture
def record_forecasts(benchmark_module):
    return benchmark_module('record_forecasts')


@pytest.fixture
def sea_forecasts(benchmark_module):
    return benchmark_module('sea_forecasts')


def test_mutants_change_one_operator_constant_or_condition_of_a_function(benchmark_module, tmp_path):
    mutants, path = benchmark_module('mutants'), tmp_path / 'module.py'
    path.write_text("LIMIT = 3\n\n\ndef kept(x, y):\n    if x < y and y:\n        return f'{x + y}', x - 2 * y\n")
    before, found = path.read_text(), mutants.mutants_of(path)
    after = {mutants.with_change(before, mutant).partition('    if ')[2] for mutant in found}
    condition, result = 'x < y and y', "f'{x + y}', x - 2 * y"
    assert after == {
        *(f'{new}:\n        return {result}\n' for new in ('(not (x < y and y))', '(x < y or y)', '(x <= y) and y')),
        *(
            f"{condition}:\n        return f'{{x + y}}', {new}\n"
            for new in ('(x + 2 * y)', 'x - (2 / y)', 'x - (3) * y')
        ),
    }


# -- measured records


@pytest.fixture
def swinging():
    """Two unequal swings, so that no cut leaves the future what it was."""
    time = 0.1 * np.arange(1500)
    roll = 0.1 * np.sin(1.7 * time) + 0.03 * np.sin(2.9 * time)
    return Trial(time, roll=roll, roll_rate=np.gradient(roll, time))


def rows_of(table):
    """``{(warm-up, axis, forecaster): cells}`` of a table in Markdown."""
    printed = [line for line in table.splitlines() if line.startswith('| ')]
    lines = [[cell.strip() for cell in line.strip('|').split('|')] for line in printed]
    return {tuple(cells[:3]): cells[3:] for cells in lines[1:]}


@pytest.mark.release
def test_the_table_of_the_ship_is_what_the_code_gives(records, data_folder):
    """Anew, to a unit of the last digit that is printed; other rows may come from libraries that are not here."""
    case = records.CASES['ship']
    written = (ROOT / 'docs' / 'records_benchmark.md').read_text(encoding='utf-8').split('## ')
    printed = rows_of(next(part for part in written if part.startswith(f'{case.title}\n')))
    anew = rows_of(records.table_of(case, records.scores_of(case, records.ROWS)))
    assert set(anew) <= set(printed) and {name for _, _, name in anew} >= set(records.ROWS)
    for row, cells in anew.items():
        for cell, other in zip(cells, printed[row], strict=True):
            new, old = ([float(text) for text in re.findall(r'[\d.]+', each)] for each in (cell, other))
            assert new == pytest.approx(old, abs=0.0011), row


@pytest.mark.long
@pytest.mark.parametrize('name', ['persistence', 'constant rate', 'AR(40)', 'VAR(40)', 'swath_sysid'])
def test_our_rows_do_not_look_ahead(records, swinging, name, monkeypatch):
    monkeypatch.setattr(records, 'CHECKED', 30.0)
    records.refuse_look_ahead(name, records.ROWS[name], swinging, (0.5, 1.0))


def test_a_row_that_looks_ahead_is_refused(records, swinging):
    """Whether it reads one sample too many or learns from the whole record."""

    def clairvoyant(trial, axes, stamps, leads):
        when = stamps[:, None] + 0.1 + 0.0 * leads
        return {axis: np.interp(when, trial.time, trial.channels[axis]) for axis in axes}

    def of_the_whole(trial, axes, stamps, leads):
        return {axis: np.full((stamps.size, leads.size), trial.channels[axis].std()) for axis in axes}

    for row in (clairvoyant, of_the_whole):
        with pytest.raises(records.LooksAheadError, match='use only those up to and with each stamp'):
            records.refuse_look_ahead('row', row, swinging, (0.5, 1.0))


def test_other_sections_of_the_page_stay(records):
    titles = [case.title for case in records.CASES.values()]
    page = records.page_with({titles[1]: f'## {titles[1]}\n\nold\n'}) + '\n## Networks\n\n### Buoy\n\nkept\n'
    written = records.page_with({titles[0]: f'## {titles[0]}\n\nnew\n'}, page)
    tables = f'## {titles[0]}\n\nnew\n\n## {titles[1]}\n\nold\n'
    assert written == f'{records.INTRODUCTION}\n{tables}\n## Networks\n\n### Buoy\n\nkept\n'
    assert records.page_with({}, written) == written


@pytest.mark.long
def test_a_buoy_that_turned_meets_the_sea_from_the_side(record_forecasts, data_folder):
    straight, turned = record_forecasts.buoy(), record_forecasts.buoy_that_turned()
    later, was = (trial.time >= record_forecasts.SPLICE for trial in (turned, straight))
    # turned by a quarter, what was pitch is roll, nearly: Euler angles do not change places exactly
    assert np.corrcoef(turned.roll[later], straight.pitch[was])[0, 1] ** 2 > 0.98
    assert np.array_equal(turned.roll[~later], straight.roll[~was])


# -- a JONSWAP sea, beside the filter that knows hull, noise and spectrum


def test_the_shaping_filter_has_the_spectrum_of_the_excitation(sea_forecasts):
    sea = sea_forecasts.make_sea(1, 60.0)
    coefficients, noise, covariance = sea_forecasts.shaping_filter(sea)
    assert covariance[1:] @ coefficients + noise == pytest.approx(covariance[0], rel=1e-6)
    again = [covariance[abs(k - np.arange(1, sea_forecasts.ORDER + 1))] @ coefficients for k in (1, 10, 40)]
    assert again == pytest.approx(covariance[[1, 10, 40]], abs=1e-5 * covariance[0])


@pytest.mark.long
def test_the_best_linear_forecast_errs_like_the_regression_on_what_is_scored(sea_forecasts, monkeypatch):
    monkeypatch.setattr(sea_forecasts, 'LINEAR_PAST', 10)
    sea, leads = sea_forecasts.make_sea(3, 300.0, kind='narrow'), (0.3, 1.0)
    forecasts, readings, truth = sea_forecasts.best_linear(sea, leads)[9:], sea.readings(10.0), sea.angle[::10]
    lags = np.column_stack([readings[9 - k : len(readings) - k] for k in range(10)] + [np.ones(len(readings) - 9)])
    for ahead, expected in zip((3, 10), forecasts.T, strict=True):
        past, later = lags[:-ahead], truth[9 + ahead :]
        regression = past @ np.linalg.lstsq(past, later, rcond=None)[0]
        least = np.std(regression - later)
        assert least < np.std(expected[:-ahead] - later) < 1.05 * least


def test_the_oracle_is_an_extended_kalman_filter_on_hull_and_autoregression(sea_forecasts, monkeypatch):
    monkeypatch.setattr(sea_forecasts, 'ORDER', 12)
    sea, leads = sea_forecasts.make_sea(3, 30.0), (0.1, 0.7)
    coefficients, noise, covariance = sea_forecasts.shaping_filter(sea)
    ekf = ExtendedKalmanFilter(dim_x=14, dim_z=2)
    shift = companion(np.append(1.0, -coefficients))
    ekf.P[:] = 0.0
    ekf.P[:2, :2], ekf.P[2:, 2:] = 1e-2 * np.eye(2), covariance[abs(np.subtract.outer(range(12), range(12)))]
    ekf.R = np.diag([sea_forecasts.ANGLE_NOISE**2, sea_forecasts.RATE_NOISE**2])
    ekf.Q = np.zeros((14, 14))
    ekf.Q[2, 2] = noise

    def following(state):
        return np.concatenate([sea_forecasts.advance(*state[:3]), shift @ state[2:]])

    told = []
    for seen in sea.readings(10.0):
        ekf.update(seen[:, None], lambda x: np.eye(2, 14), lambda x: x[:2])
        now = ekf.x[:, 0]
        ahead = [now]
        for _ in range(7):
            ahead.append(following(ahead[-1]))
        told.append([ahead[1][0], ahead[7][0]])
        ekf.F = np.column_stack([(following(now + d) - following(now - d)) / 2e-5 for d in 1e-5 * np.eye(14)])
        ekf.x = following(now)[:, None]
        ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
    assert sea_forecasts.oracle(sea, leads) == pytest.approx(np.array(told), abs=1e-8)


@pytest.mark.release
def test_forecasts_in_a_sea_come_near_those_of_the_filter_that_knows_everything(sea_forecasts):
    sea, nrmse, coverage = sea_forecasts.compare(2, 200.0, 100.0, (0.5, 2.0, 5.0))
    ours, best = nrmse['10 Hz'], nrmse['oracle']
    assert np.abs(sea.angle).max() < 0.12
    assert np.all(best < 1.03) and np.all(best[:2] < ours[:2])
    assert np.all(ours < 1.3 * best) and np.all(ours < 1.03)
    assert np.all(best[:2] < np.min([nrmse[name][:2] for name in ('ar_40', 'var_40', 'var_60')], axis=0))
    assert np.all(np.abs(coverage['10 Hz'] - 0.9) < 0.06)


def test_a_benchmark_takes_flags_from_its_function_and_tells_its_lines_as_text_or_json(capsys):
    def lines(*cases: Annotated[str, ('a', 'b'), 'which'], rates: Annotated[float, 'Hz'] = (1.0,), still: bool = False):
        yield f'heading of {cases}'
        yield Line('case', {'error': np.array(rates), 'held': [0.5, np.nan]}, '4.1f')
        return 1 if still else None

    benchmark = Benchmark('Of two cases.', lines)
    assert benchmark.run(['a', 'b', '--rates', '2', '3', '--still']) == 1
    assert capsys.readouterr().out == "heading of ('a', 'b')\ncase |  2.0  3.0 |  0.5  nan\n"
    assert benchmark.run(['--json']) == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert told == [{'text': 'heading of ()'}, {'label': 'case', 'error': [1.0], 'held': [0.5, None]}]
    for wrong in (['c'], ['--rates', 'x'], ['--rate', '1', '--unknown']):
        with pytest.raises(SystemExit):
            benchmark.run(wrong)


def test_errors_are_scored_by_age_over_what_came():
    error = np.array([[1.0, 3.0], [-2.0, np.nan], [9.0, 9.0]])
    found = LeadErrors.joined([(np.array([0.0, 0.5]), error[:2], np.ones((2, 2))), ([1.0], error[2:], np.ones((1, 2)))])
    now = found.within(0.0, 1.0)
    assert now.rms == pytest.approx([np.sqrt(2.5), 3.0]) and now.held.tolist() == [0.5, 0.0]
    assert found.within(1.0, 2.0).error.tolist() == [[9.0, 9.0]]
