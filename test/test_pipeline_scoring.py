"""Skill: every forecast counts, beside closed forms, with what is lost and what is to come."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from records_at_sea import only, sea

from swath_sysid.attitude.prediction.forecast import NORMAL_QUANTILES, AxisForecast, Forecast
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import Run, run_through
from swath_sysid.pipeline.scoring import METHODS, score, usual_limits
from swath_sysid.report.forecast_figure import forecast_figure
from swath_sysid.report.forecast_summary import skill_as_data

LEADS = (0.1, 1.0)


def lost(trial, every, count):
    """The trial without `count` samples each `every` seconds."""
    return only(trial, trial.time % every >= count * 0.1 - 1e-6)


def forecasts_with_errors(trial, errors, deviation, leads=LEADS):
    """A run that forecast roll at each sample with the errors given, shape (N, L)."""
    steps = []
    for k, stamp in enumerate(trial.time.tolist()):
        angle = np.interp(stamp + np.array(leads), trial.time, trial.roll) + errors[k]
        covariance = np.tile(np.diag([deviation**2, 1.0]), (len(leads), 1, 1))
        ahead = Forecast(stamp, np.array(leads), {'roll': AxisForecast(angle, 0.0 * angle, covariance)})
        steps.append(SimpleNamespace(stamp=stamp, forecast=ahead, horizon=ahead))
    return Run(tuple(steps))


def scored(trial, leads=LEADS, warmup=60.0, window=60.0, **further):
    settings = ForecasterSettings(leads=tuple(leads), window=window)
    return score(trial, run_through(trial, settings, {}), leads, warmup, window, **further)


@pytest.fixture(scope='module')
def whole():
    """A record that lost nothing, and its run with a window of a minute."""
    trial = sea(150.0)
    return trial, run_through(trial, ForecasterSettings(leads=LEADS, window=60.0), {})


def test_errors_of_known_size_are_scored_as_such_and_so_are_their_intervals():
    rng, trial, size = np.random.default_rng(5), replace(sea(900.0), pitch=None, pitch_rate=None), 0.02
    errors = rng.normal(0.0, size, (trial.time.size, 2))
    found = score(trial, forecasts_with_errors(trial, errors, size), LEADS, 300.0, 60.0).axes['roll']
    issued = np.flatnonzero(trial.time >= 300.0)
    for i, ahead in enumerate((1, 10)):
        mine = errors[issued[:-ahead], i]
        assert found.counted[i] == mine.size == 6000 - ahead and found.unmeasured[i] == ahead
        assert found.deviation == pytest.approx(trial.roll[issued].std())
        assert found.nrmse['forecast'][i] == pytest.approx(np.sqrt(np.mean(mine**2)) / trial.roll[issued].std())
        rest = trial.roll[issued[:-ahead]] - trial.roll[issued[ahead:]]
        assert found.nrmse['persistence'][i] == pytest.approx(np.sqrt(np.mean(rest**2)) / trial.roll[issued].std())
        assert found.coverage[i] == pytest.approx([0.5, 0.9, 0.99], abs=0.02)
        low, high = found.interval[i]
        # independent errors: the relative standard deviation of their root mean square is 1 / sqrt(2 N)
        assert low < size / found.deviation < high
        assert (high - low) / found.nrmse['forecast'][i] == pytest.approx(2 * 1.96 / np.sqrt(2 * mine.size), rel=0.35)
        assert found.best[i] == min((n for n in METHODS if n != 'forecast'), key=lambda n: found.nrmse[n][i])
        assert found.ratio[i] == pytest.approx(found.nrmse['forecast'][i] / found.nrmse[found.best[i]][i])
        assert found.ratio_interval[i][0] < found.ratio[i] < found.ratio_interval[i][1]
    assert NORMAL_QUANTILES.size == found.coverage.shape[1]


def test_errors_that_come_in_groups_widen_the_intervals():
    trial = replace(sea(900.0), pitch=None, pitch_rate=None)
    rng = np.random.default_rng(1)
    sizes = {
        'alone': rng.normal(0.0, 0.02, (trial.time.size, 1)),
        'together': np.repeat(rng.normal(0.0, 0.02, trial.time.size // 100), 100)[:, None],
    }
    widths = {}
    for name, errors in sizes.items():
        run = forecasts_with_errors(trial, errors * np.ones(2), 0.02)
        widths[name] = np.diff(score(trial, run, LEADS, 300.0, 60.0).axes['roll'].interval[0])[0]
    assert widths['together'] > 4.0 * widths['alone']


def test_where_a_forecast_has_no_value_persistence_stands_in_and_it_is_said():
    trial = replace(sea(200.0), pitch=None, pitch_rate=None)
    errors = np.zeros((trial.time.size, 2))
    errors[1200:1300] = np.nan
    skill = score(trial, forecasts_with_errors(trial, errors, 0.02), LEADS, 100.0, 60.0)
    found, rest = skill.axes['roll'], trial.roll[1200:1300] - trial.roll[1210:1310]
    assert found.counted[1] == 990
    assert found.nrmse['forecast'][1] == pytest.approx(np.sqrt((rest**2).sum() / 990) / found.deviation)
    assert found.replaced_share['forecast'][1] == pytest.approx(100 / 990)
    assert found.coverage[1] == pytest.approx([890 / 990] * 3)
    assert [a.code for a in skill.advice] == ['forecast-missing'] and '100' in skill.advice[0].message


def test_a_forecast_issued_after_a_gap_counts_and_has_a_score_of_its_own():
    whole = replace(sea(300.0), pitch=None, pitch_rate=None)
    trial = lost(whole, 20.0, 5)
    errors = np.where((trial.time % 20.0 < 4.55)[:, None], 0.03, 0.01) * np.ones(2)
    run = forecasts_with_errors(trial, errors, 0.02)
    found = score(trial, run, LEADS, 100.0, 60.0).axes['roll']
    assert found.gap_nrmse['forecast'] == pytest.approx(np.full(2, 0.03 / found.deviation))
    assert found.gap_share[0] == pytest.approx(10 * 41 / found.counted[0])
    # at the ends of the gaps nothing was measured a lead later
    assert found.unmeasured[0] == 9 + 1 and found.counted[0] + found.unmeasured[0] == 2000 - 10 * 5
    share = found.gap_share[0]
    assert found.nrmse['forecast'][0] == pytest.approx(
        np.sqrt(share * 0.03**2 + (1 - share) * 0.01**2) / found.deviation
    )
    assert 0.0 < found.replaced_share['var_40'][0] < 0.5
    assert np.all(found.replaced_share['persistence'] == 0.0)


def test_a_record_that_lost_samples_scores_worse_than_the_whole_one(whole):
    trial, run = whole
    whole = score(trial, run, LEADS, 100.0, 60.0).axes['roll']
    broken = scored(lost(trial, 10.0, 5), warmup=100.0).axes['roll']
    assert whole.gap_share[0] == 0.0 and np.isnan(whole.gap_nrmse['forecast']).all()
    assert broken.gap_share[0] > 0.3
    for name in ('ar_40', 'var_40'):
        assert broken.nrmse[name][0] > 1.5 * whole.nrmse[name][0]
    assert whole.nrmse['forecast'][0] < broken.nrmse['forecast'][0] < 1.2 * whole.nrmse['forecast'][0]
    assert broken.nrmse['persistence'] == pytest.approx(whole.nrmse['persistence'], rel=0.1)


def test_scores_are_told_as_json_and_drawn(whole):
    trial, run = whole
    skill = score(trial, run, LEADS, 60.0, 60.0)
    data = json.loads(json.dumps(skill_as_data(skill), allow_nan=False))
    assert data['leads_s'] == list(LEADS) and data['warmup_s'] == 60.0 and data['window_s'] == 60.0
    assert set(data['axes']) == {'roll', 'pitch'}
    told = data['axes']['roll']
    assert set(told['nrmse']) == set(METHODS)
    assert all(value is not None for values in told['nrmse'].values() for value in values)
    assert told['nrmse']['forecast'][1] < 0.5 * told['nrmse']['persistence'][1]
    assert told['ratio'][1] < 1.1
    assert 0.8 < told['coverage']['90'][0] < 0.97
    assert told['counted'] == [899, 890] and told['unmeasured'] == [1, 10]
    assert told['nrmse_interval'] == [[None, None]] * 2
    assert forecast_figure(trial, run, skill).axes


def test_what_is_scored_and_what_is_learnt_from_are_chosen_apart(whole):
    trial, run = whole
    early, late = (score(trial, run, LEADS, warmup, 60.0).axes['roll'] for warmup in (60.0, 100.0))
    both = score(trial, run, LEADS, 60.0, 60.0, until=100.0 - 0.05).axes['roll']
    squares = [(s.nrmse['var_40'][0] * s.deviation) ** 2 * s.counted[0] for s in (both, late, early)]
    assert squares[0] + squares[1] == pytest.approx(squares[2])
    assert both.counted[0] == 400
    short = score(trial, run, LEADS, 60.0, 20.0).axes['roll']
    assert np.array_equal(short.nrmse['forecast'], early.nrmse['forecast'])
    assert not np.allclose(short.nrmse['var_40'], early.nrmse['var_40'])


def test_the_first_minute_is_scored_from_its_first_forecast():
    found = scored(sea(90.0), warmup=0.0, until=60.0).axes['roll']
    assert 595 <= found.counted[0] <= 601
    assert found.replaced_share['var_40'][0] > 0.15
    assert found.nrmse['forecast'][1] < found.nrmse['persistence'][1]


@pytest.mark.slow
def test_quiescence_is_scored_after_the_warm_up_by_limits_that_the_warm_up_suggests():
    trial, duration = sea(200.0), 3.0
    settings = ForecasterSettings(leads=LEADS, quiescence=QuiescenceLimits(duration=duration))
    limits = usual_limits(trial, settings.quiescence, 100.0)
    run = run_through(trial, settings, {}, limits_from=(100.0, limits))
    told = skill_as_data(score(trial, run, LEADS, 100.0, 600.0))['quiescence']
    warm = trial.roll[:1000]
    assert told['limits']['roll'] == pytest.approx(abs(warm.mean()) + 2.0 * warm.std())
    assert told['limits']['roll_rate'] is None and told['limits']['duration'] == duration
    assert 90 <= sum(told['count']) <= 100
    assert told['brier'] < told['brier_of_climate']
    assert usual_limits(trial, settings.quiescence, 0.0) is None


def test_the_verb_scores_the_first_minute_and_prints_one_json_object(tmp_path, capsys):
    write_csv(tmp_path / 'sea.csv', sea(80.0))
    picture = tmp_path / 'skill.png'
    command = ['forecast', str(tmp_path / 'sea.csv'), '--leads', '0.5,1', '--warmup', '0', '--until', '60']
    assert main([*command, '--json', '--axis', 'roll', '--plot', str(picture)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told['warmup_s'], told['until_s'], told['window_s']) == (0.0, 60.0, 1200.0)
    assert list(told['axes']) == ['roll'] and told['axes']['roll']['counted'] == [600, 600]
    assert 'quiescence' not in told and picture.stat().st_size > 10_000


def test_the_verb_prints_a_table_with_what_came_after_gaps(tmp_path, capsys):
    write_csv(tmp_path / 'sea.csv', lost(sea(80.0), 20.0, 5))
    assert main(['forecast', str(tmp_path / 'sea.csv'), '--leads', '0.5', '--warmup', '40', '--window', '30']) == 0
    printed = capsys.readouterr().out
    rows = (
        'VAR(60)',
        'past mean',
        'forecast / best other',
        '90 % coverage, %',
        'scored',
        '4 s after gaps, %',
        'quiet for',
    )
    assert [row for row in rows if row not in printed] == []


def test_what_cannot_be_scored_is_refused():
    trial = sea(30.0)
    run = forecasts_with_errors(trial, np.zeros((trial.time.size, 2)), 0.1)
    for match, *given in (
        ('warm-up', trial, run, LEADS, 60.0, 60.0),
        ('warm-up', trial, run, LEADS, 10.0, 60.0, 5.0),
        ('angles', replace(trial, roll=None, pitch=None), run, LEADS, 10.0, 60.0),
        ('leads', trial, run, (0.3,), 10.0, 60.0),
        ('no forecast', trial, Run(()), LEADS, 10.0, 60.0),
    ):
        with pytest.raises(InputError, match=match):
            score(*given)


@pytest.mark.slow
def test_a_ship_that_tells_angles_once_a_second_is_forecast_and_its_intervals_hold(data_folder):
    found = scored(read_trial(data_folder / 'waves' / 'nbp1406_ship.csv'), (2.0, 5.0), warmup=240.0, window=240.0)
    for axis in ('roll', 'pitch'):
        assert np.all(found.axes[axis].nrmse['forecast'] < 0.85)
        assert np.all(np.abs(found.axes[axis].coverage[:, 1] - 0.9) < 0.03)
    # the heading knows of the wave before the roll does: the regression of all channels is the one to beat
    assert found.axes['roll'].nrmse['var_40'][0] < 0.9 * found.axes['roll'].nrmse['ar_40'][0]
