"""Vertical motion of whole records: against closed forms, across gaps, and what lacks a channel."""

from dataclasses import replace

import numpy as np
import pytest
from records_at_sea import only

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.motion.vertical import even_stretches
from swath_sysid.attitude.prediction.point import Point
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation.baselines import vertical_record

POINTS = Point('sensor', (0.0, 0.0, 0.0)), Point('bow', (2.5, -0.5, 1.0))
HEAVE, PITCH = (0.8, 2.0 * np.pi * 0.1), (0.06, 2.0 * np.pi * 0.17)


def sines(step=0.1, duration=300.0):
    """A craft that heaves and pitches, each at a frequency of its own, and its heave."""
    time = np.arange(0.0, duration, step)
    (size, w), (angle, v) = HEAVE, PITCH
    pitch, pitch_rate = angle * np.sin(v * time), angle * v * np.cos(v * time)
    up = STANDARD_GRAVITY - size * w**2 * np.sin(w * time)
    none = np.zeros(time.size)
    return Trial(time, none, pitch, none, pitch_rate, -np.sin(pitch) * up, none, np.cos(pitch) * up)


@pytest.mark.parametrize('step', [0.1, 0.023])
def test_motion_at_a_point_is_that_of_the_closed_form(step):
    found = vertical_record(sines(step), POINTS)
    (size, w), (angle, v) = HEAVE, PITCH
    time = found.time
    pitch, rate = angle * np.sin(v * time), angle * v * np.cos(v * time)
    velocity = size * w * np.cos(w * time)
    expected = {
        'sensor.heave': size * np.sin(w * time),
        'sensor.vertical_velocity': velocity,
        'bow.heave': size * np.sin(w * time) - 2.5 * np.sin(pitch) + np.cos(pitch) - 1.0,
        'bow.vertical_velocity': velocity - (2.5 * np.cos(pitch) + np.sin(pitch)) * rate,
        'bow.heave_rate': velocity - (2.5 * np.cos(pitch) + np.sin(pitch)) * rate,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found.column(name), values, atol=0.05 * size)
    assert time[0] == pytest.approx(30.0, abs=0.2) and time[-1] == pytest.approx(270.0, abs=0.2)


def test_a_short_gap_is_bridged_and_a_long_one_parts_the_record():
    trial = sines()
    bridged = only(trial, (trial.time < 150.0) | (trial.time > 150.6))
    assert len(even_stretches(bridged)) == 1
    parted = only(trial, (trial.time < 150.0) | (trial.time > 155.0))
    first, second = even_stretches(parted)
    assert first.time[-1] < 150.0 and second.time[0] > 155.0
    found = vertical_record(parted, POINTS)
    assert np.isnan(found.at(np.array([10.0, 130.0, 152.0, 170.0, 290.0]))).all()
    assert np.isfinite(found.at(np.array([100.0, 200.0]))).all()


def test_what_does_not_show_its_vertical_motion_is_refused():
    trial = sines()
    with pytest.raises(InputError, match='holds no accel_z'):
        even_stretches(replace(trial, accel_z=None))
    with pytest.raises(InputError, match='without a gap'):
        vertical_record(only(trial, trial.time < 50.0), POINTS)
    with pytest.raises(InputError, match='no two samples'):
        even_stretches(replace(trial, accel_x=np.full(trial.time.size, np.nan)))
