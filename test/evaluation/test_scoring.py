"""Scores of angles and of points, against closed forms, and the verb that prints them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from records_at_sea import only, sea, swell

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecast import NORMAL_QUANTILES, Forecast
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.outlook import Outlook
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation.report.skill import skill_as_data
from swath_sysid.evaluation.scoring import METHODS, SENSOR, resampled, score, usual_limits, usual_warmup
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import Issued, Run, run_through

LEADS = (0.1, 1.0)
PAST = 25.0  # periods, of some 3 s
NOTHING = Outlook(np.nan, None, {})


def rolling(duration):
    return replace(sea(duration), pitch=None, pitch_rate=None)


def forecasts_with_errors(trial, errors, deviation):
    """A run that forecast roll at each sample with the errors given, shape (N, L)."""
    steps = []
    for k, stamp in enumerate(trial.time.tolist()):
        mean = np.full((len(LEADS), 4), np.nan)
        mean[:, 0] = np.interp(stamp + np.array(LEADS), trial.time, trial.roll) + errors[k]
        covariance = np.tile(deviation**2 * np.eye(4), (len(LEADS), 1, 1))
        ahead = Forecast(round(1e9 * stamp), np.array(LEADS), mean, covariance)
        steps.append(Issued(stamp, ahead, ahead, NOTHING))
    return Run(tuple(steps))


@pytest.mark.long
def test_errors_of_known_size_are_scored_as_such_and_so_are_their_intervals():
    rng, trial, size = np.random.default_rng(5), rolling(900.0), 0.02
    errors = rng.normal(0.0, size, (trial.time.size, 2))
    found = score(trial, forecasts_with_errors(trial, errors, size), LEADS, 300.0, PAST).axes['roll']
    issued = np.flatnonzero(trial.time >= 300.0)
    deviation = trial.roll[issued].std()
    for i, ahead in enumerate((1, 10)):
        mine = errors[issued[:-ahead], i]
        assert found.counted[i] == mine.size == 6000 - ahead and found.unmeasured[i] == ahead
        assert found.deviation == pytest.approx(deviation)
        assert found.nrmse['forecast'][i] == pytest.approx(np.sqrt(np.mean(mine**2)) / deviation)
        rest = trial.roll[issued[:-ahead]] - trial.roll[issued[ahead:]]
        assert found.nrmse['persistence'][i] == pytest.approx(np.sqrt(np.mean(rest**2)) / deviation)
        assert found.coverage[i] == pytest.approx([0.5, 0.9, 0.99], abs=0.02)
        low, high = found.interval[i]
        # independent errors: the relative standard deviation of their root mean square is 1 / sqrt(2 N)
        assert low < size / found.deviation < high
        assert (high - low) / found.nrmse['forecast'][i] == pytest.approx(2 * 1.96 / np.sqrt(2 * mine.size), rel=0.35)
        assert found.best[i] == min((n for n in METHODS if n != 'forecast'), key=lambda n: found.nrmse[n][i])
        assert found.ratio[i] == pytest.approx(found.nrmse['forecast'][i] / found.nrmse[found.best[i]][i])
        assert found.ratio_interval[i][0] < found.ratio[i] < found.ratio_interval[i][1]
    assert NORMAL_QUANTILES.size == found.coverage.shape[1]
    assert found.gap_share[0] == 0.0 and np.isnan(found.gap_nrmse['forecast']).all()
    # errors that come in groups widen the intervals
    together = np.repeat(rng.normal(0.0, size, trial.time.size // 100), 100)[:, None] * np.ones(2)
    grouped = score(trial, forecasts_with_errors(trial, together, size), LEADS, 300.0, PAST).axes['roll']
    assert np.diff(grouped.interval[0]) > 4.0 * np.diff(found.interval[0])


def test_where_a_forecast_has_no_value_persistence_stands_in_and_it_is_said():
    trial = rolling(200.0)
    errors = np.zeros((trial.time.size, 2))
    errors[1200:1300] = np.nan
    skill = score(trial, forecasts_with_errors(trial, errors, 0.02), LEADS, 100.0, PAST)
    found, rest = skill.axes['roll'], trial.roll[1200:1300] - trial.roll[1210:1310]
    assert found.counted[1] == 990
    assert found.nrmse['forecast'][1] == pytest.approx(np.sqrt((rest**2).sum() / 990) / found.deviation)
    assert found.replaced_share['forecast'][1] == pytest.approx(100 / 990)
    assert found.coverage[1] == pytest.approx([890 / 990] * 3)
    assert [a.code for a in skill.advice] == ['forecast-missing'] and '100' in skill.advice[0].message


def test_a_forecast_issued_after_a_gap_counts_and_has_a_score_of_its_own():
    whole = rolling(300.0)
    trial = only(whole, whole.time % 20.0 >= 0.5 - 1e-6)
    errors = np.where((trial.time % 20.0 < 4.55)[:, None], 0.03, 0.01) * np.ones(2)
    found = score(trial, forecasts_with_errors(trial, errors, 0.02), LEADS, 100.0, PAST).axes['roll']
    assert found.gap_nrmse['forecast'] == pytest.approx(np.full(2, 0.03 / found.deviation))
    share = found.gap_share[0]
    assert share == pytest.approx(10 * 41 / found.counted[0])
    # at the ends of the gaps nothing was measured a lead later
    assert found.unmeasured[0] == 9 + 1 and found.counted[0] + found.unmeasured[0] == 2000 - 10 * 5
    expected = np.sqrt(share * 0.03**2 + (1 - share) * 0.01**2) / found.deviation
    assert found.nrmse['forecast'][0] == pytest.approx(expected)
    assert 0.0 < found.replaced_share['var_40'][0] < 0.5
    assert np.all(found.replaced_share['persistence'] == 0.0)


@pytest.mark.long
def test_what_is_scored_and_what_is_learnt_from_are_chosen_apart():
    trial = sea(150.0)
    run = run_through(trial, ForecasterSettings(leads=LEADS, window=PAST), {})
    early, late = (score(trial, run, LEADS, warmup, PAST).axes['roll'] for warmup in (60.0, 100.0))
    both = score(trial, run, LEADS, 60.0, PAST, until=100.0 - 0.05).axes['roll']
    squares = [(s.nrmse['var_40'][0] * s.deviation) ** 2 * s.counted[0] for s in (both, late, early)]
    assert squares[0] + squares[1] == pytest.approx(squares[2])
    assert both.counted[0] == 400
    short = score(trial, run, LEADS, 60.0, PAST / 3.0).axes['roll']
    assert np.array_equal(short.nrmse['forecast'], early.nrmse['forecast'])
    assert not np.allclose(short.nrmse['var_40'], early.nrmse['var_40'])


@pytest.mark.long
@pytest.mark.slow
def test_quiescence_is_scored_after_the_warm_up_by_limits_that_the_warm_up_suggests():
    trial, duration = sea(200.0), 3.0
    settings = ForecasterSettings(leads=LEADS, quiescence=QuiescenceLimits(duration=duration))
    limits = usual_limits(trial, settings.quiescence, 100.0)
    run = run_through(trial, settings, {}, limits_from=(100.0, limits))
    told = skill_as_data(score(trial, run, LEADS, 100.0, 10.0 * PAST))['quiescence']
    warm = trial.roll[:1000]
    assert told['limits']['roll'] == pytest.approx(abs(warm.mean()) + 2.0 * warm.std())
    assert told['limits']['roll_rate'] is None and told['limits']['duration'] == duration
    # as many as there are independent ones, about three in a period
    squares = [np.var([trial.roll, trial.pitch]), np.var([trial.roll_rate, trial.pitch_rate])]
    most = 100.0 / (0.31 * 2.0 * np.pi * np.sqrt(squares[0] / squares[1]))
    assert 0.9 * most <= sum(told['count']) <= most
    assert told['brier'] < told['brier_of_climate']
    assert usual_limits(trial, settings.quiescence, 25.0) is None
    assert usual_limits(trial, settings.quiescence, 35.0) is not None


def test_an_hour_is_scored_from_the_tenth_minute_and_intervals_need_eight_blocks():
    hour, short = (Trial(np.linspace(0.0, end, 9), roll=np.zeros(9)) for end in (3600.0, 300.0))
    assert (usual_warmup(hour), usual_warmup(short)) == (600.0, 100.0)
    assert usual_limits(hour, QuiescenceLimits(), 600.0) is None  # a craft that never moves has no limits
    assert np.isnan(resampled(np.ones((1, 7, 1)), 0)).all() and (resampled(np.ones((1, 8, 1)), 0) == 8.0).all()


@pytest.mark.long
def test_the_verb_scores_the_first_minute_and_prints_one_json_object(tmp_path, capsys):
    write_csv(tmp_path / 'sea.csv', sea(80.0))
    picture = tmp_path / 'skill.png'
    command = ['forecast', str(tmp_path / 'sea.csv'), '--leads', '0.5,1', '--warmup', '0', '--until', '60']
    assert main([*command, '--json', '--axis', 'roll', '--plot', str(picture)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told['warmup_s'], told['until_s']) == (0.0, 60.0)
    # 375 periods of sines between 1 and 3 rad/s, of which the first two show the period roughly
    assert told['window_s'] == pytest.approx(375.0 * np.pi, rel=0.2)
    roll = told['axes'].pop('roll')
    assert told['axes'] == {} and roll['counted'] == [600, 600] and told['leads_s'] == [0.5, 1.0]
    assert set(roll['nrmse']) == set(METHODS) and roll['nrmse_interval'] == [[None, None]] * 2
    assert roll['nrmse']['forecast'][1] < 0.6 * roll['nrmse']['persistence'][1]
    assert 'quiescence' not in told and picture.stat().st_size > 10_000


@pytest.mark.long
def test_the_verb_prints_a_table_with_what_came_after_gaps(tmp_path, capsys):
    whole = sea(80.0)
    write_csv(tmp_path / 'sea.csv', only(whole, whole.time % 20.0 >= 0.5 - 1e-6))
    asked = ['forecast', str(tmp_path / 'sea.csv'), '--leads', '0.5', '--warmup', '40', '--window', '10']
    assert main(asked) == 0
    assert 'after gaps' not in capsys.readouterr().out
    assert main([*asked, '--all']) == 0
    printed = capsys.readouterr().out
    rows = 'VAR(60)', 'past mean', 'forecast / best other', '90 % coverage, %', 'scored', '4 s after gaps, %', 'quiet'
    assert [row for row in rows if row not in printed] == []


def test_what_cannot_be_scored_is_refused():
    trial = sea(30.0)
    run = forecasts_with_errors(trial, np.zeros((trial.time.size, 2)), 0.1)
    for match, *given in (
        ('warm-up', trial, run, LEADS, 60.0, PAST),
        ('warm-up', trial, run, LEADS, 10.0, PAST, 5.0),
        ('angles', replace(trial, roll=None, pitch=None), run, LEADS, 10.0, PAST),
        ('leads', trial, run, (0.3,), 10.0, PAST),
        ('no forecast', trial, Run(()), LEADS, 10.0, PAST),
    ):
        with pytest.raises(InputError, match=match):
            score(*given)


@pytest.mark.long
@pytest.mark.slow
def test_a_ship_that_tells_angles_once_a_second_is_forecast_and_its_intervals_hold(data_folder):
    trial, leads = read_trial(data_folder / 'waves' / 'nbp1406_ship.csv'), (2.0, 5.0)
    window = 240.0 / 8.5
    found = score(trial, run_through(trial, ForecasterSettings(leads=leads, window=window), {}), leads, 240.0, window)
    for axis in ('roll', 'pitch'):
        assert np.all(found.axes[axis].nrmse['forecast'] < 0.85)
        assert np.all(np.abs(found.axes[axis].coverage[:, 1] - 0.9) < 0.03)
    # the heading knows of the wave before the roll does: the regression of all channels is the one to beat
    assert found.axes['roll'].nrmse['var_40'][0] < 0.9 * found.axes['roll'].nrmse['ar_40'][0]


# -- vertical motion at points


POINT_LEADS = np.array([0.5, 2.0])
BOW = Point('bow', (2.5, 0.0, 0.0))
DEVIATIONS = np.array([0.1, 0.2, 0.05])


def forecasts_at_points(trial, motion, learnt=0.0):
    """A run whose forecasts have errors of known size from a time on, and none of vertical motion before."""
    rng, steps = np.random.default_rng(1), []
    covariance = np.tile(np.diag([*DEVIATIONS**2, 1.0, 1.0, 1.0, 1.0]), (POINT_LEADS.size, 1, 1))
    for stamp in trial.time.tolist():
        means = {
            point: motion(stamp + POINT_LEADS, point.place[0]) + DEVIATIONS * rng.normal(size=(2, 3))
            for point in (SENSOR, BOW)
            if stamp >= learnt
        }
        points = {point.name: PointMotion(point.place, mean, covariance) for point, mean in means.items()}
        ahead = Forecast(0, POINT_LEADS, np.zeros((2, 4)), np.tile(np.eye(4), (2, 1, 1)), points=points)
        steps.append(Issued(stamp, ahead, ahead, NOTHING))
    return Run(tuple(steps))


@pytest.mark.long
def test_errors_of_known_size_at_a_point_are_scored_as_such():
    trial, motion = swell(300.0)
    run = forecasts_at_points(trial, motion)
    skill = score(trial, run, POINT_LEADS, 60.0, PAST, points=(SENSOR, BOW))
    assert list(skill.points) == ['sensor', 'bow']
    for kinds in skill.points.values():
        for scores, deviation in zip(kinds.values(), DEVIATIONS, strict=True):
            assert scores.nrmse['forecast'] * scores.deviation == pytest.approx([deviation] * 2, rel=0.12)
            assert scores.coverage[:, 1] == pytest.approx([0.9] * 2, abs=0.04)
            assert not scores.replaced_share['forecast'].any()
            # from the warm-up to half a minute before the end, where what came is not known
            assert scores.counted == pytest.approx([2100 - 5, 2100 - 20], abs=3)
            assert scores.nrmse['mean'] == pytest.approx([1.0] * 2, abs=0.1)
    # persistence and constant rate begin from what came until then
    time = np.arange(60.0, 269.0, 0.1)
    now, ahead = motion(time, 2.5), motion(time + 0.5, 2.5)
    scores = skill.points['bow']['vertical_velocity']
    errors = {'persistence': now[:, 1] - ahead[:, 1], 'constant_rate': now[:, 1] + 0.5 * now[:, 2] - ahead[:, 1]}
    for name, error in errors.items():
        assert scores.nrmse[name][0] * scores.deviation == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)
    assert set(scores.nrmse) == {'forecast', 'persistence', 'constant_rate', 'mean'}


@pytest.mark.long
def test_forecasts_before_vertical_motion_is_learnt_count_as_the_mean():
    trial, motion = swell(300.0)
    run = forecasts_at_points(trial, motion, 100.0)
    before, late = (score(trial, run, POINT_LEADS, 60.0, PAST, until=end, points=(SENSOR,)) for end in (99.95, 200.0))
    for scores in before.points['sensor'].values():
        assert scores.nrmse['forecast'] == pytest.approx(scores.nrmse['mean'])
    for scores in late.points['sensor'].values():
        assert scores.replaced_share['forecast'] == pytest.approx([40.0 / 140.0] * 2, abs=0.01)
        assert (scores.coverage[:, 2] < 0.75).all()
    with pytest.raises(InputError, match='within 30 s of the ends'):
        score(trial, run, POINT_LEADS, 275.0, PAST, points=(SENSOR,))


@pytest.fixture(scope='module')
def swell_file(tmp_path_factory):
    path = tmp_path_factory.mktemp('point') / 'swell.csv'
    write_csv(path, swell(220.0)[0])
    return str(path)


@pytest.mark.release
def test_the_verb_scores_points_and_the_sensor(swell_file, tmp_path, capsys):
    options = ['--leads', '0.5,1', '--warmup', '170', '--plot', str(tmp_path / 'skill.png')]
    assert main(['forecast', swell_file, '--point', 'bow:2.5,0,0', *options, '--json']) == 0
    points = json.loads(capsys.readouterr().out)['points']
    assert list(points) == ['sensor', 'bow']
    for kinds in points.values():
        assert set(kinds) == {'heave', 'vertical_velocity', 'vertical_acceleration'}
        velocity = kinds['vertical_velocity']
        assert velocity['nrmse']['forecast'][0] < velocity['nrmse']['mean'][0]
        assert len(velocity['coverage']['90']) == 2 and velocity['deviation_m_s'] > 0.0
    short = str(tmp_path / 'short.csv')
    write_csv(short, swell(80.0)[0])
    assert main(['forecast', short, '--point', 'bow:2.5,0,0', '--leads', '0.5,1', '--warmup', '40']) == 0
    told = capsys.readouterr().out
    assert all(words in told for words in ('bow: RMSE', 'vertical velocity', 'm/s', 'persistence', '90 % coverage'))


@pytest.mark.parametrize(
    ('points', 'words'),
    [
        (['bow:1,2,3', 'bow:1,2,4'], 'given twice'),
        (['sensor:1,0,0'], "sensor's own position"),
        *(([point], '--point: ') for point in ('bow', 'bow:1,2', 'bow:1,2,x', '2bow:1,2,3', 'bow:1,2,nan')),
    ],
)
def test_impossible_points_are_refused(swell_file, points, words, tmp_path, capsys):
    assert main(['forecast', swell_file, *(word for point in points for word in ('--point', point))]) == 2
    assert words in capsys.readouterr().err
    trial, _ = swell(60.0)
    write_csv(tmp_path / 'angles.csv', Trial(trial.time, trial.roll, trial.pitch))
    assert main(['forecast', str(tmp_path / 'angles.csv'), '--point', 'bow:1,0,0']) == 2
    assert 'holds no' in capsys.readouterr().err


@pytest.mark.release
def test_the_error_at_the_valid_lead_is_the_limit():
    settings, waves = ForecasterSettings(leads=(1.0,), horizon=8.0, forecast_rate=5.0, window=40.0), sea(300.0)
    skill = score(waves, run_through(waves, settings, {}), (1.0,), 120.0, 40.0)
    for axis, scores in skill.axes.items():
        found = scores.valid_lead
        assert found.counted > 400 and found.error_over_expected == pytest.approx(1.0, abs=0.2), axis
        assert 0.0 < found.lead[1] <= found.lead[0] <= found.lead[2] <= 8.0
        # the models' own expectation is near what came, and was not made to agree
        assert scores.expected == pytest.approx(scores.nrmse['forecast'], rel=0.3)
