"""What the live predictor of manoeuvres does between its messages."""

import math
from dataclasses import replace

import numpy as np
import pytest
from manoeuvring_runs import MODEL, OLD

from swath_sysid.common.errors import InputError
from swath_sysid.formats.topics import manoeuvring_lead_topic
from swath_sysid.manoeuvring.hull.programme import SensorNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.prediction.pipeline import (
    ManoeuvreOutlook,
    ManoeuvreOutlookSettings,
    OdometryReading,
    steady_motion,
)

SETTINGS = ManoeuvreOutlookSettings(leads=(1.0, 5.0), horizon=5.0, rate=1.0)


@pytest.fixture(scope='module')
def manoeuvre():
    return with_noise(trial_programme(OLD)['mixed'], SensorNoise(), 1)


def readings(m, start=1e9):
    return [
        OdometryReading(start + t, x, y, math.remainder(h, 2 * math.pi), u, v, r, {})
        for t, x, y, h, u, v, r in zip(m.time, m.x, m.y, m.heading, m.surge, m.sway, m.yaw_rate, strict=True)
    ]


def play(outlook, m, rows, yaw=True):
    steps = []
    for k, reading in rows:
        outlook.add_thrust(reading.stamp, 'port', float(m.port[k]))
        outlook.add_thrust(reading.stamp, 'starboard', float(m.starboard[k]))
        if yaw:
            outlook.add_yaw_rate(reading.stamp, reading.yaw_rate)
        steps.append((k, outlook.add_odometry(reading)))
    return [(k, step) for k, step in steps if step.path]


def lead_errors(found, m, lead):
    step = round(lead / 0.1)
    index = {1.0: 0, 5.0: 1}[lead]
    return [
        math.hypot(s.leads[index].x - m.x[k + step], s.leads[index].y - m.y[k + step])
        for k, s in found
        if 100 < k < len(m.time) - step
    ]


@pytest.mark.slow
def test_forecasts_are_due_and_right(manoeuvre):
    found = play(ManoeuvreOutlook(SETTINGS, MODEL), manoeuvre, list(enumerate(readings(manoeuvre))))
    assert 100 <= len(found) <= 107
    state = found[50][1].leads[1]
    assert state.stamp == pytest.approx(found[50][1].leads[0].stamp + 4.0)
    assert [p.stamp - state.stamp for p in found[50][1].path[:3]] == pytest.approx([-4.5, -4.0, -3.5], abs=1e-6)
    steady = play(ManoeuvreOutlook(SETTINGS), manoeuvre, list(enumerate(readings(manoeuvre))))
    assert np.median(lead_errors(found, manoeuvre, 5.0)) < 0.7
    assert np.mean(lead_errors(found, manoeuvre, 5.0)) < 0.6 * np.mean(lead_errors(steady, manoeuvre, 5.0))
    assert np.all(np.linalg.eigvalsh(state.pose_covariance) > 0)
    assert np.all(np.linalg.eigvalsh(state.twist_covariance) > 0)


def test_supplied_thrust_bends_the_path(manoeuvre):
    outlook = ManoeuvreOutlook(SETTINGS, MODEL)
    rows = list(enumerate(readings(manoeuvre)))
    play(outlook, manoeuvre, rows[:400])
    outlook.supply([(0.0, 150.0, 0.0)])
    (_, right), *_ = play(outlook, manoeuvre, rows[400:420])
    assert right.leads[1].yaw_rate < -0.1


def test_faults_are_counted_and_survived(manoeuvre):
    outlook = ManoeuvreOutlook(SETTINGS, MODEL)
    rows = readings(manoeuvre)
    play(outlook, manoeuvre, list(enumerate(rows))[:300])
    outlook.add_odometry(replace(rows[300], x=math.nan))
    outlook.add_odometry(rows[290])
    outlook.add_thrust(1e9, 'port', math.inf)
    outlook.add_thrust(rows[300].stamp, 'port', float(manoeuvre.port[300]))
    outlook.add_thrust(rows[300].stamp, 'starboard', float(manoeuvre.starboard[300]))
    for reading in rows[300:303]:
        outlook.add_odometry(replace(reading, x=reading.x + 300.0))
    play(outlook, manoeuvre, list(enumerate(rows))[303:330])
    counts = outlook.counts
    assert (counts['not-finite'], counts['late'], counts['outlier']) == (2, 1, 3)
    outlook.add_odometry(rows[500])
    assert counts['long-gap'] == 1
    outlook.add_odometry(rows[0])
    assert counts['jumped-back'] == 1
    found = play(outlook, manoeuvre, list(enumerate(rows))[1:300])
    assert np.median(lead_errors(found, manoeuvre, 1.0)) < 0.7


def test_silent_thrusters_stop_if_asked(manoeuvre):
    outlook = ManoeuvreOutlook(replace(SETTINGS, stop_after=1.0), MODEL)
    rows = readings(manoeuvre)
    play(outlook, manoeuvre, list(enumerate(rows))[:100])
    for reading in rows[100:130]:
        step = outlook.add_odometry(reading)
    assert outlook.counts['no-thrust'] == 1
    while not step.path:
        step = outlook.add_odometry(replace(reading, stamp=reading.stamp + 1.0))
    assert abs(step.leads[1].surge) < 0.5


def test_steady_motion_is_steady():
    accelerations = steady_motion().model.accelerations(1.0, 0.3, 0.2, 50.0, -50.0)
    assert np.allclose([float(a) for a in accelerations[:2]], 0.0, atol=1e-12)


def test_topics_and_settings():
    assert manoeuvring_lead_topic(0.5) == 'manoeuvring/lead_0_5s'
    for wrong in ({'leads': (2.0, 1.0)}, {'leads': ()}, {'horizon_step': 99.0}, {'rate': 0.0}):
        with pytest.raises(InputError):
            ManoeuvreOutlookSettings(**wrong)


def test_thrust_stamped_by_another_clock_before_the_first_odometry_acts():
    """The node's clock may be far ahead of a simulator's, which is told only by its odometry."""
    outlook = ManoeuvreOutlook(ManoeuvreOutlookSettings(leads=(5.0,)), MODEL)
    for side, value in (('port', 40.0), ('starboard', 90.0)):
        outlook.add_thrust(1.7e9, side, value)
    for k in range(100):
        for side, value in (('port', 40.0), ('starboard', 90.0)):
            outlook.add_thrust(10.0 + 0.1 * k, side, value)
        step = outlook.add_odometry(OdometryReading(10.0 + 0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, {}))
        if step.leads:
            last = step.leads[0]
    assert last.yaw_rate > 0.05
