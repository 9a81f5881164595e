"""Scores of vertical motion at points: errors of known size, what is not known yet, and the verb that prints them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from records_at_sea import swell

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecast import AxisForecast, Forecast
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.pipeline.record_run import Run
from swath_sysid.pipeline.scoring import SENSOR, score

LEADS = np.array([0.5, 2.0])
BOW = Point('bow', (2.5, 0.0, 0.0))
DEVIATIONS = np.array([0.1, 0.2, 0.05])


def forecasts(trial, motion, learnt, seed=1):
    """A run whose forecasts have errors of known size from a time on, and none of vertical motion before."""
    rng, steps = np.random.default_rng(seed), []
    covariance = np.tile(np.diag([*DEVIATIONS**2, 1.0, 1.0, 1.0, 1.0]), (LEADS.size, 1, 1))
    for stamp in trial.time.tolist():
        angle = AxisForecast(np.zeros(2), np.zeros(2), np.tile(np.eye(2), (2, 1, 1)))
        points = {
            point.name: PointMotion(
                point.place, motion(stamp + LEADS, point.place[0]) + DEVIATIONS * rng.normal(size=(2, 3)), covariance
            )
            for point in (SENSOR, BOW)
            if stamp >= learnt
        }
        ahead = Forecast(stamp, LEADS, {'roll': angle, 'pitch': angle}, points=points)
        steps.append(SimpleNamespace(stamp=stamp, forecast=ahead, horizon=ahead))
    return Run(tuple(steps))


def test_errors_of_known_size_at_a_point_are_scored_as_such():
    trial, motion = swell(300.0)
    skill = score(trial, forecasts(trial, motion, 0.0), LEADS, 60.0, 60.0, points=(SENSOR, BOW))
    assert list(skill.points) == ['sensor', 'bow']
    for kinds in skill.points.values():
        for scores, deviation in zip(kinds.values(), DEVIATIONS, strict=True):
            assert scores.nrmse['forecast'] * scores.deviation == pytest.approx([deviation] * 2, rel=0.12)
            assert scores.coverage[:, 1] == pytest.approx([0.9] * 2, abs=0.04)
            assert not scores.replaced_share['forecast'].any()
            # from the warm-up to half a minute before the end, where what came is not known
            assert scores.counted == pytest.approx([2100 - 5, 2100 - 20], abs=3)
            assert scores.nrmse['mean'] == pytest.approx([1.0] * 2, abs=0.1)


def test_persistence_and_constant_rate_begin_from_what_came_until_then():
    trial, motion = swell(300.0)
    skill = score(trial, forecasts(trial, motion, 0.0), LEADS, 60.0, 60.0, points=(BOW,))
    time = np.arange(60.0, 269.0, 0.1)
    now, ahead = motion(time, 2.5), motion(time + 0.5, 2.5)
    scores = skill.points['bow']['vertical_velocity']
    errors = {'persistence': now[:, 1] - ahead[:, 1], 'constant_rate': now[:, 1] + 0.5 * now[:, 2] - ahead[:, 1]}
    for name, error in errors.items():
        assert scores.nrmse[name][0] * scores.deviation == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)
    assert set(scores.nrmse) == {'forecast', 'persistence', 'constant_rate', 'mean'}


def test_forecasts_before_vertical_motion_is_learnt_count_as_the_mean():
    trial, motion = swell(300.0)
    run = forecasts(trial, motion, 100.0)
    before, late = (score(trial, run, LEADS, 60.0, 60.0, until=until, points=(SENSOR,)) for until in (99.95, 200.0))
    for scores in before.points['sensor'].values():
        assert scores.nrmse['forecast'] == pytest.approx(scores.nrmse['mean'])
    for scores in late.points['sensor'].values():
        assert scores.replaced_share['forecast'] == pytest.approx([40.0 / 140.0] * 2, abs=0.01)
        assert (scores.coverage[:, 2] < 0.75).all()


def test_where_vertical_motion_is_not_known_nothing_is_scored():
    trial, motion = swell(120.0)
    with pytest.raises(InputError, match='within 30 s of the ends'):
        score(trial, forecasts(trial, motion, 0.0), LEADS, 95.0, 60.0, points=(SENSOR,))


@pytest.fixture(scope='module')
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp('point') / 'swell.csv'
    write_csv(path, swell(250.0)[0])
    return str(path)


def test_the_verb_scores_points_and_the_sensor(record, tmp_path, capsys):
    options = ['--leads', '0.5,1', '--warmup', '200', '--plot', str(tmp_path / 'skill.png')]
    assert main(['forecast', record, '--point', 'bow:2.5,0,0', *options, '--json']) == 0
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
    for words in ('bow: RMSE', 'vertical velocity', 'm/s', 'persistence', '90 % coverage'):
        assert words in told


@pytest.mark.parametrize(
    ('points', 'words'),
    [
        (['bow:1,2,3', 'bow:1,2,4'], 'given twice'),
        (['sensor:1,0,0'], "sensor's own position"),
        *(([point], '--point: ') for point in ('bow', 'bow:1,2', 'bow:1,2,x', '2bow:1,2,3', 'bow:1,2,nan')),
    ],
)
def test_impossible_points_are_refused(record, points, words, capsys):
    assert main(['forecast', record, *(word for point in points for word in ('--point', point))]) == 2
    assert words in capsys.readouterr().err


def test_a_record_without_accelerations_has_no_points(tmp_path, capsys):
    trial, _ = swell(60.0)
    write_csv(tmp_path / 'angles.csv', Trial(trial.time, trial.roll, trial.pitch))
    assert main(['forecast', str(tmp_path / 'angles.csv'), '--point', 'bow:1,0,0']) == 2
    assert 'holds no' in capsys.readouterr().err
