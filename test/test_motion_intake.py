"""One IMU message to the motion of the craft: what is read, what is left out, what is counted."""

from math import inf, isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imu_stream import EPOCH_NS, NOT_GIVEN, UNKNOWN, diagonal, reading
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion.intake import (
    ABSURD,
    ABSURD_COVARIANCE,
    BAD_QUATERNION,
    EMPTY,
    INTAKE_REASONS,
    NEAR_VERTICAL,
    NO_ORIENTATION,
    NO_RATES,
    NOT_FINITE,
    UNKNOWN_COVARIANCE,
    ImuReading,
    convert,
)
from swath_sysid.attitude.motion.sensor_mount import Installation

STRAIGHT = Installation()
ANGLES = ('roll', 'pitch', 'yaw')
RATES = ('roll_rate', 'pitch_rate')


def values_of(sample, names):
    """Some fields of a sample."""
    return [getattr(sample, name) for name in names]


def test_angles_and_euler_rates_come_out_as_they_went_in():
    sample, reasons = convert(reading(EPOCH_NS, 0.2, -0.3, 0.5, -0.6, yaw=1.1), STRAIGHT)
    assert values_of(sample, ANGLES + RATES) == pytest.approx([0.2, -0.3, 1.1, 0.5, -0.6])
    assert sample.stamp_ns == EPOCH_NS and reasons == ()
    assert values_of(sample, ['roll_variance', 'pitch_rate_variance']) == [1e-6, 2.5e-5]
    assert all(type(value) is float for value in sample[1:])


def test_variances_of_a_mounted_sensor_are_those_of_the_craft():
    mounting = (0.3, -0.2, 1.4)
    sits = Rotation.from_euler('ZYX', mounting[::-1]).as_matrix()
    spread = (sits.T @ np.diag([1e-6, 4e-6, 9e-6]) @ sits).ravel().tolist()
    sample, _ = convert(reading(EPOCH_NS, orientation_covariance=spread), Installation('flu', mounting))
    assert values_of(sample, ('roll_variance', 'pitch_variance')) == pytest.approx([1e-6, 4e-6])


def test_a_sensor_in_ned_is_turned():
    sample, _ = convert(reading(EPOCH_NS, 0.2, -0.3, 0.5, -0.6), Installation('frd'))
    assert values_of(sample, ('roll', 'pitch', 'roll_rate', 'pitch_rate')) == pytest.approx([0.2, 0.3, 0.5, 0.6])
    assert sample.accel_z == -9.81


@pytest.mark.parametrize(
    ('changes', 'counted'),
    [
        ({'orientation': (0.0, 0.0, 0.0, 0.0)}, BAD_QUATERNION),
        ({'orientation': (3.0, 1.0, 0.0, 2.0)}, BAD_QUATERNION),
        ({'orientation': (0.0, -inf, 0.0, 1.0)}, NOT_FINITE),
        ({'orientation_covariance': NOT_GIVEN}, NO_ORIENTATION),
    ],
)
def test_without_a_usable_orientation_body_rates_stand_for_euler_rates(changes, counted):
    sample, reasons = convert(reading(EPOCH_NS, 0.2, 0.1, **changes)._replace(rates=(0.1, 0.2, 0.3)), STRAIGHT)
    assert all(isnan(value) for value in values_of(sample, ANGLES))
    assert values_of(sample, RATES) == [0.1, 0.2]
    assert reasons == (counted,)


@pytest.mark.parametrize(
    ('rates', 'counted'), [((nan, 0, 0), NOT_FINITE), ((0, inf, 0), NOT_FINITE), ((0, 0, 1e3), ABSURD)]
)
def test_without_usable_rates_the_angles_stay(rates, counted):
    sample, reasons = convert(reading(EPOCH_NS, 0.2, 0.1, rates=rates), STRAIGHT)
    assert values_of(sample, ('roll', 'pitch')) == pytest.approx([0.2, 0.1])
    assert all(isnan(value) for value in values_of(sample, RATES)) and reasons == (counted,)


def test_what_is_not_measured_or_cannot_be_costs_no_more_than_itself():
    sample, reasons = convert(reading(EPOCH_NS, 0.2, force=(nan, 0.0, 1e9)), STRAIGHT)
    assert isnan(sample.accel_z) and sample.roll == pytest.approx(0.2) and reasons == (NOT_FINITE,)
    sample, reasons = convert(reading(EPOCH_NS, 0.1, rates_covariance=NOT_GIVEN), STRAIGHT)
    assert sample.roll == pytest.approx(0.1) and isnan(sample.roll_rate) and reasons == (NO_RATES,)
    sample, reasons = convert(reading(EPOCH_NS, rates=(nan,) * 3, orientation=(0.0,) * 4), STRAIGHT)
    assert sample is None and set(reasons) == {NOT_FINITE, BAD_QUATERNION, EMPTY}


@pytest.mark.parametrize('covariance', [UNKNOWN, diagonal(nan), diagonal(-1e-6), diagonal(inf), diagonal(1e4)])
def test_covariances_that_say_nothing_are_unknown(covariance):
    sample, reasons = convert(reading(EPOCH_NS, rates_covariance=covariance), STRAIGHT)
    assert isnan(sample.roll_rate_variance) and sample.roll_variance == 1e-6
    assert reasons == (*([ABSURD_COVARIANCE] if covariance[0] == 1e4 else []), UNKNOWN_COVARIANCE)


numbers = st.floats(width=64)


@given(
    st.tuples(*[numbers] * 4),
    st.tuples(*[numbers] * 9),
    st.tuples(*[numbers] * 3),
    st.tuples(*[numbers] * 9),
    st.tuples(*[numbers] * 3),
    st.sampled_from([STRAIGHT, Installation('frd', (0.1, 0.2, 0.3))]),
)
def test_any_message_is_taken_in_without_an_error(orientation, covariance, rates, rates_covariance, force, sits):
    sample, reasons = convert(
        ImuReading(EPOCH_NS, orientation, covariance, rates, rates_covariance, force, UNKNOWN), sits
    )
    assert set(reasons) <= set(INTAKE_REASONS)
    if sample is not None:
        assert not np.isinf(sample[1:]).any()
        assert not (np.array(values_of(sample, ('roll_variance', 'pitch_rate_variance'))) <= 0.0).any()


@pytest.mark.parametrize('std,known', [(0.9 * np.pi, True), (1.1 * np.pi, False), (1e150, False)])
def test_a_covariance_that_is_no_knowledge_is_unknown_and_counted(std, known):
    sample, reasons = convert(reading(EPOCH_NS, orientation_covariance=diagonal(std**2)), STRAIGHT)
    assert isnan(sample.roll_variance) != known and sample.pitch_rate_variance == 2.5e-5
    assert reasons == (() if known else (ABSURD_COVARIANCE, UNKNOWN_COVARIANCE))


@pytest.mark.parametrize('pitch,kept', [(-79.0, True), (81.0, False), (-90.0, False)])
def test_near_the_vertical_nothing_is_used(pitch, kept):
    sample, reasons = convert(reading(EPOCH_NS, 0.1, np.radians(pitch)), STRAIGHT)
    assert (sample is not None) == kept and (NEAR_VERTICAL in reasons) != kept
