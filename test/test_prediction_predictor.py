"""The predictor under good samples, faults of time, and faults of value."""
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.errors import InputError
from swath_sysid.hull.catalogue import hull_named
from swath_sysid.hull.simulation import simulate
from swath_sysid.prediction.predictor import REASONS, ImuSample, Predictor, PredictorSettings

ROLL, PITCH = hull_named('swath-roll').model, hull_named('swath-pitch').model


def _samples(duration=20.0, dt=0.01, seed=0, start=0.0, noise=1.0):
    time = np.arange(0.0, duration, dt)
    roll, roll_rate = simulate(ROLL, 0.08, 0.0, time)
    pitch, pitch_rate = simulate(PITCH, 0.08, 0.0, time)
    rng = np.random.default_rng(seed)
    columns = [
        clean + noise * rng.normal(0.0, deviation, time.size)
        for clean, deviation in (
            (roll, 1e-3), (pitch, 1e-3), (roll_rate, 4e-3), (pitch_rate, 4e-3),
            (0.0 * roll, 0.05), (0.0 * roll, 0.05), (0.0 * roll + 9.81, 0.05),
        )
    ]  # fmt: skip
    return [ImuSample(*row) for row in np.column_stack([start + time, *columns]).tolist()], np.c_[roll, pitch]


def _with_models():
    predictor = Predictor()
    predictor.set_model('roll', ROLL)
    predictor.set_model('pitch', PITCH)
    return predictor


def test_every_sample_gives_estimates_and_the_next_sample():
    samples, truth = _samples()
    predictor = _with_models()
    steps = [predictor.observe(s) for s in samples]
    assert all(s.used for s in steps)
    assert all(s.next is not None for s in steps[1:])
    assert steps[-1].next.leads[0] == pytest.approx(0.01)
    errors = np.array([s.next.axes['roll'].angle[0] for s in steps[500:-1]]) - truth[501:, 0]
    assert errors.std() < 1e-3


def test_forecasts_come_at_their_rate_and_at_their_leads():
    samples, _ = _samples()
    predictor = Predictor(PredictorSettings(leads=(0.25, 1.0), forecast_rate=5.0, horizon=2.0, horizon_step=0.05))
    issued = [s for s in (predictor.observe(x) for x in samples) if s.forecast]
    assert np.allclose(np.diff([s.stamp for s in issued[3:]]), 0.2, atol=0.011)
    assert len(issued) == pytest.approx(100, abs=2)
    assert issued[-1].forecast.leads.tolist() == [0.25, 1.0]
    horizon = issued[-1].horizon
    assert horizon.leads[-1] == pytest.approx(2.0)
    assert horizon.axes['pitch'].angle.shape == (40,)
    assert np.linalg.eigvalsh(horizon.axes['pitch'].covariance).min() >= 0.0


def test_the_hull_sharpens_the_forecast_of_a_decay():
    samples, truth = _samples(duration=12.0)
    errors = {}
    for name, predictor in (('free', Predictor()), ('hull', _with_models())):
        steps = [s for s in (predictor.observe(x) for x in samples) if s.forecast and 1.0 < s.stamp < 9.0]
        future = truth[[round((s.stamp + 2.0) / 0.01) for s in steps], 0]
        place = steps[0].forecast.leads.tolist().index(2.0)
        forecast = np.array([s.forecast.axes['roll'].angle[place] for s in steps])
        errors[name] = np.sqrt(np.mean((forecast - future) ** 2))
    now = [s.estimates['roll'] for s in steps]
    constant_rate = np.array([e.angle + 2.0 * e.rate for e in now])
    assert errors['hull'] < 0.1 * np.sqrt(np.mean((constant_rate - future) ** 2))
    assert errors['hull'] < 0.8 * errors['free']
    assert errors['free'] < 1.5 * np.sqrt(np.mean(future**2))


def test_the_same_samples_give_the_same_numbers():
    samples, _ = _samples(duration=5.0)
    runs = []
    for _ in range(2):
        predictor = _with_models()
        issued = [s.forecast for s in (predictor.observe(x) for x in samples) if s.forecast]
        runs.append(np.array([f.axes[axis].angle for f in issued for axis in f.axes]))
    assert np.array_equal(*runs)


def test_repeated_and_late_stamps_are_dropped_and_counted():
    samples, _ = _samples(duration=5.0)
    predictor, plain = _with_models(), _with_models()
    for k, sample in enumerate(samples):
        plain.observe(sample)
        step = predictor.observe(sample)
        if k % 100 == 50:
            assert predictor.observe(sample).reasons == ('duplicate-stamp',)
            assert not predictor.observe(sample._replace(stamp=sample.stamp - 0.005, roll=1.0)).used
    last = plain.observe(samples[-1]._replace(stamp=5.0))
    assert predictor.observe(samples[-1]._replace(stamp=5.0)).estimates['roll'].angle == last.estimates['roll'].angle
    counts = predictor.diagnostics().counts
    assert (counts['duplicate-stamp'], counts['out-of-order']) == (5, 5)
    assert step.used


def test_a_clock_that_jumps_back_starts_anew():
    samples, _ = _samples(duration=5.0)
    predictor = _with_models()
    steps = [predictor.observe(s) for s in samples + samples]
    assert steps[len(samples)].reasons == ('clock-jumped-back',)
    assert steps[len(samples)].estimates['roll'].restarted
    assert all(s.used for s in steps)
    assert predictor.diagnostics().counts['clock-jumped-back'] == 1
    assert steps[-1].forecast or steps[-5].stamp < 5.0


def test_a_small_jump_back_that_stays_is_followed_in_the_end():
    samples, _ = _samples(duration=3.0)
    predictor = _with_models()
    for sample in samples:
        predictor.observe(sample)
    again = [predictor.observe(s._replace(stamp=s.stamp + 2.5)) for s in samples]
    assert predictor.diagnostics().counts['clock-jumped-back'] == 1
    assert sum(not s.used for s in again) < 50


def test_a_short_gap_is_predicted_through_and_a_long_one_restarts():
    samples, truth = _samples(duration=10.0)
    predictor = _with_models()
    for sample in samples[:500]:
        predictor.observe(sample)
    step = predictor.observe(samples[540])
    assert step.reasons == ('gap-predicted-through',)
    assert step.estimates['roll'].angle == pytest.approx(truth[540, 0], abs=0.003)
    assert predictor.observe(samples[541]).reasons == ()
    step = predictor.observe(samples[900])
    assert step.reasons == ('gap-too-long',)
    assert step.estimates['roll'].restarted


@pytest.mark.parametrize(('field', 'value', 'reason'), [
    ('roll', 572900.5, 'absurd-value'),
    ('pitch_rate', math.inf, 'not-finite'),
    ('accel_z', -1e9, 'absurd-value'),
    ('stamp', math.nan, 'not-finite'),
])  # fmt: skip
def test_what_cannot_be_is_dropped_by_reason(field, value, reason):
    samples, _ = _samples(duration=1.0)
    predictor = _with_models()
    for sample in samples:
        predictor.observe(sample)
    step = predictor.observe(samples[-1]._replace(**({'stamp': 1.0} | {field: value})))
    assert (step.used, step.reasons) == (False, (reason,))
    assert predictor.observe(samples[-1]._replace(stamp=1.01)).used


def test_a_sample_of_nothing_is_dropped():
    assert Predictor().observe(ImuSample(0.0)).reasons == ('not-finite',)


def test_rates_alone_and_angles_alone_are_enough():
    samples, truth = _samples()
    for missing in (('roll', 'pitch'), ('roll_rate', 'pitch_rate'), ('accel_x', 'accel_y', 'accel_z')):
        predictor = _with_models()
        for sample in samples:
            step = predictor.observe(sample._replace(**dict.fromkeys(missing, math.nan)))
        assert step.used
        assert step.estimates['roll'].angle == pytest.approx(truth[-1, 0], abs=0.01)


def test_one_axis_alone_is_forecast_alone():
    samples, _ = _samples(duration=2.0)
    predictor = Predictor()
    issued = [predictor.observe(s._replace(pitch=math.nan, pitch_rate=math.nan)) for s in samples]
    assert set(issued[-1].next.axes) == {'roll'}
    assert set(next(s for s in reversed(issued) if s.forecast).forecast.axes) == {'roll'}


def test_a_changed_sample_rate_is_followed():
    fast, _ = _samples(duration=10.0, dt=0.01)
    slow, _ = _samples(duration=60.0, dt=0.1, start=10.0)
    predictor = _with_models()
    steps = [predictor.observe(s) for s in fast + slow]
    assert steps[-1].next.leads[0] == pytest.approx(0.1)
    assert predictor.diagnostics().counts['gap-predicted-through'] < 40
    assert steps[-1].reasons == ()


def test_without_a_model_it_says_so():
    samples, _ = _samples(duration=1.0)
    predictor = Predictor()
    for sample in samples:
        predictor.observe(sample)
    told = predictor.diagnostics()
    assert {a.code for a in told.advice} == {'no-model'}
    assert told.has_model == {'roll': False, 'pitch': False}
    predictor.set_model('roll', ROLL)
    assert predictor.diagnostics().has_model == {'roll': True, 'pitch': False}


_VALUE = st.one_of(st.just(math.nan), st.floats(-3.0, 3.0), st.floats(allow_nan=True, allow_infinity=True))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.one_of(st.floats(0.0, 10.0), st.floats()), *[_VALUE] * 7), max_size=60))
def test_no_sequence_of_samples_makes_it_fail_or_say_nonsense(rows):
    predictor = _with_models()
    for row in rows:
        step = predictor.observe(ImuSample(*row))
        assert set(step.reasons) <= set(REASONS)
        for told in (step.next, step.forecast, step.horizon):
            for axis in told.axes.values() if told else ():
                assert np.isfinite(axis.angle).all() and np.isfinite(axis.covariance).all()


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match='leads'):
        PredictorSettings(leads=(1.0, 0.5))
    with pytest.raises(InputError, match='horizon'):
        PredictorSettings(horizon=-1.0)
    with pytest.raises(InputError, match='yaw'):
        Predictor().set_model('yaw', None)
