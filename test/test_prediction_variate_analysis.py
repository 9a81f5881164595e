"""Canonical variate analysis against direct sums, systems whose best forecast is known, and measured records."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.prediction import variate_analysis as analysis
from swath_sysid.attitude.prediction.candidate import OnRows
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.state_space import InnovationsFilter
from swath_sysid.attitude.prediction.time_scale import period_of

STEP, PERIOD = 0.1, USUAL_PERIOD
NAMES = ('roll', 'pitch')
MEAN = np.array([3.0, -5.0])


def _sea(count, seed=0):
    """Two coupled oscillations of autoregressive waves; the innovations have unit variance."""
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(count, 2))
    y = np.zeros((count, 2))
    first = np.array([[1.80, 0.05], [-0.04, 1.70]])
    second = np.array([[-0.90, 0.0], [0.02, -0.85]])
    for t in range(2, count):
        y[t] = first @ y[t - 1] + second @ y[t - 2] + e[t]
    return y[100:] + MEAN, e[100:], first, second


@settings(max_examples=30)
@given(seed=st.integers(0, 1000), lost=st.sampled_from([0.0, 0.02, 0.2, 0.9]), count=st.integers(2, 9))
def test_the_gram_matrix_is_the_sum_over_complete_lags(seed, lost, count):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(120, 3))
    rows[rng.uniform(size=120) < lost, rng.integers(0, 3)] = np.nan
    lags = np.column_stack([rows[count - 1 - k : rows.shape[0] - k] for k in range(count)])
    lags = lags[np.isfinite(lags).all(axis=1)]
    gram, used = analysis.lag_gram(rows, count)
    assert used == len(lags)
    assert np.allclose(gram, lags.T @ lags, atol=1e-9)


def _filter(model, rows, names=NAMES, horizon=1.0):
    ours = InnovationsFilter(model, names, horizon)
    ours.seed(rows)
    return ours


def test_a_known_system_is_forecast_as_well_as_can_be():
    y, e, first, second = _sea(9100)
    model = analysis.identify(y[:6000], NAMES, STEP, PERIOD)
    assert model.channels == NAMES
    assert model.scale[:, None] * model.s * model.scale == pytest.approx(np.eye(2), abs=0.06)
    ours = _filter(model, y[5500:6000])
    errors, best = [], []
    for t in range(6000, 8990):
        ours.take(y[t])
        one, two = y[t] - MEAN, y[t - 1] - MEAN
        for _ in range(5):
            one, two = first @ one + second @ two, one
        errors.append(ours.ahead([5])[0][0] - y[t + 5])
        best.append(one + MEAN - y[t + 5])
    assert (np.std(errors, axis=0) < 1.02 * np.std(best, axis=0)).all()
    covered = np.abs(errors) < 1.645 * np.sqrt(np.diagonal(ours.ahead([5])[1][0]))
    assert covered.mean() == pytest.approx(0.9, abs=0.02)


def test_the_state_from_lags_is_that_of_a_long_past():
    y, *_ = _sea(4100)
    model = analysis.identify(y, NAMES, STEP, PERIOD)
    (long, covariance), (short, _) = (_filter(model, y[-count:]).ahead([1]) for count in (1500, model.lags))
    assert np.abs(long - short).max() < 0.1 * np.sqrt(np.diagonal(covariance[0])).min()


def test_channels_that_say_nothing_are_left_out():
    y, *_ = _sea(3000)
    rare = np.where(np.random.default_rng(0).uniform(size=y.shape[0]) < 0.3, y[:, 0], np.nan)
    values = np.column_stack([np.full(y.shape[0], 2.0), y[:, 0], rare, np.full(y.shape[0], np.nan), y[:, 1]])
    assert analysis.useful_channels(values) == [1, 4]
    model = analysis.identify(values, ('draft', 'roll', 'heave', 'yaw', 'pitch'), STEP, PERIOD)
    assert (model.channels, model.places) == (('roll', 'pitch'), (1, 4))
    ours = _filter(model, values[-100:])
    assert ours.state_covariance is None and np.isfinite(ours.ahead([5])[0]).all()
    for values in (np.zeros((0, 2)), np.zeros((500, 2)), np.full((500, 2), np.nan), y[:8]):
        assert analysis.identify(values, NAMES, STEP, PERIOD) is None
        assert analysis.identify_alone(values, NAMES, STEP, PERIOD, NAMES) is None


def _waves(seed, components, count):
    """A sum of sines and its derivative, rad and rad/s, to the last digit."""
    rng = np.random.default_rng(seed)
    frequency = rng.uniform(0.5, 3.0, components)
    phase = np.multiply.outer(STEP * np.arange(count), frequency) + rng.uniform(0.0, 6.28, components)
    size = rng.uniform(0.01, 0.03, components) / np.sqrt(components)
    return (size * np.cos(phase)).sum(axis=1), -(size * frequency * np.sin(phase)).sum(axis=1)


KINDS = {
    'a fifth': lambda angle, rate: (angle, 0.2 * angle, rate, 0.2 * rate),
    'twice': lambda angle, rate: (angle, angle, rate, rate),
    'reversed, no rates': lambda angle, rate: (angle, 0.01 - angle),
    'rate and its multiple': lambda angle, rate: (angle, rate, 3.0 * rate),
    'constant': lambda angle, rate: (angle, np.full_like(angle, 0.1), rate, np.zeros_like(rate)),
    'quantised': lambda *both: tuple(np.round(size * values, 4) for values in both for size in (1.0, 0.2)),
}
"""Roll, pitch and their rates, of which some follow from others without any error."""


def _following(kind, angle, rate):
    values = np.column_stack(KINDS[kind](angle, rate))
    return ('roll', 'pitch', 'roll_rate', 'pitch_rate')[: values.shape[1]], values


@settings(max_examples=25)
@given(
    kind=st.sampled_from(tuple(KINDS)),
    seed=st.integers(0, 1000),
    components=st.sampled_from((1, 3, 12, 60)),
    count=st.sampled_from((300, 1000)),
    noise=st.sampled_from((0.0, 1e-9, 1e-6, 1e-4)),
    lost=st.integers(0, 20),
)
def test_channels_that_follow_from_others_give_a_model_and_variances(kind, seed, components, count, noise, lost):
    angle, rate = _waves(seed, components, count)
    angle = angle + noise * np.random.default_rng(seed).normal(size=count)
    names, values = _following(kind, angle, rate)
    values[60 : 60 + lost] = np.nan
    model = analysis.identify(values, names, STEP, PERIOD)
    # of some hundred windows one gives a filter that is not stable; without any noise none would give a model
    assume(model is not None)
    assert np.linalg.eigvalsh(model.s).min() > 0.9e-8
    ours = _filter(model, values, horizon=5.0)
    for known in (np.isfinite(values[-1]), np.arange(len(names)) == 0):
        OnRows(ours).predict(lost + 1)
        ours.take(np.where(known, values[-1], np.nan))
        covariance = ours.ahead(np.arange(51))[1]
        # not at a lead of zero, where what was measured is known
        variances = np.diagonal(covariance[1:], axis1=1, axis2=2)[:, : 1 + (kind != 'constant')]
        assert (variances > 0.0).all(), variances.min()
        assert (np.linalg.eigvalsh(covariance[1:, : variances.shape[1], : variances.shape[1]]) > -1e-12).all()


@pytest.mark.parametrize('kind', ['a fifth', 'twice', 'reversed, no rates'])
def test_what_follows_from_another_channel_is_forecast_with_it(kind):
    names, values = _following(kind, *_waves(4, 3, 1400))
    ours, errors = _filter(analysis.identify(values[:1200], names, STEP, PERIOD), values[1000:1200], horizon=2.0), []
    for t in range(1200, 1380):
        ours.take(values[t])
        errors.append(ours.ahead([10, 20])[0] - values[[t + 10, t + 20], :2])
    # three sines are known for good; an oscillator errs by half of the motion
    assert (np.std(errors, axis=0) < 0.02 * np.std(values[:, :2], axis=0)).all()


def test_each_angle_alone_reads_only_itself_and_its_rate():
    y, *_ = _sea(3000)
    values = np.column_stack([y, np.gradient(y[:, 1]) / STEP + np.random.default_rng(1).normal(size=len(y))])
    model = analysis.identify_alone(values, (*NAMES, 'pitch_rate'), STEP, PERIOD, NAMES)
    assert model.places == (0, 1, 2) and model.channels == (*NAMES, 'pitch_rate')
    assert not model.k[model.c[0].nonzero()[0]][:, 1:].any()
    assert _filter(model, values[-400:]).state_covariance is None


def test_where_every_tenth_row_is_lost_there_is_still_a_model():
    y, *_ = _sea(6100)
    lost = y.copy()
    lost[::10] = np.nan
    assert analysis.broken(lost, analysis.usual_lags(STEP, PERIOD)) and not analysis.broken(
        y, analysis.usual_lags(STEP, PERIOD)
    )
    filled, inner = analysis.fill_short_gaps(lost - y.mean(axis=0)) + y.mean(axis=0), slice(10, -10, 10)
    # the best two-sided interpolation of this system leaves less than the innovations
    assert np.std(filled[inner] - y[inner], axis=0).max() < 0.8
    model = analysis.identify(lost, NAMES, STEP, PERIOD)
    assert model.lags == analysis.identify(y, NAMES, STEP, PERIOD).lags
    assert model.scale[:, None] * model.s * model.scale == pytest.approx(np.eye(2), abs=0.15)


@pytest.mark.parametrize(('periods', 'reach'), [(8.0, 1.0), (16.0, 2.0), (36.0, 3.0), (100.0, 5.0)])
def test_lags_reach_further_back_where_as_many_times_more_rows_show_it(periods, reach):
    a_period, channels = 8.0, 1
    rows = np.zeros((round(periods * a_period + 2.0 * reach * a_period), channels))
    lags = analysis.lags_for(rows, analysis.usual_lags(1.0, a_period), analysis.MAX_LAGS)
    assert lags == pytest.approx(reach * a_period, abs=1.0)
    assert analysis.lags_for(rows[:2], 2, 4) is None


def test_a_spike_and_a_join_are_missing_rows_and_the_steps_of_a_coarse_sensor_are_not():
    y, *_ = _sea(2100)
    y[500] += 2000.0
    y[1000:] += 2000.0
    missing = np.flatnonzero(~np.isfinite(analysis.without_breaks(y)).all(axis=1))
    assert {500, 1000} <= set(missing) and missing.size < 10
    coarse = np.round(_waves(0, 3, 2000)[0], 2)[:, None] * [1.0, 7.3]
    for whole in (y[:400], coarse):
        assert np.array_equal(analysis.without_breaks(whole), whole)
    coarse[1000, 0] += 3.0
    assert np.isnan(analysis.without_breaks(coarse)[1000]).all()


def _nrmse(values, names, start, stop, leads, step):
    """Identified on the past, once a minute, with forecasts at every row."""
    errors, angles = [], values[:start, :2]
    period = period_of(angles, np.full_like(angles, np.nan), step, np.zeros(2), np.zeros(2), start)
    for t in range(start, stop):
        if (t - start) % round(60.0 / step) == 0:
            past = values[t - round(30.0 / step) : t]
            ours = _filter(analysis.identify(values[:t], names, step, period), past, horizon=leads[-1])
        ours.take(values[t])
        errors.append(ours.ahead(np.array(leads) / step)[0] - values[t + np.round(leads / step).astype(int), :2])
    return np.sqrt(np.nanmean(np.square(errors), axis=0)) / np.nanstd(values[start:, :2], axis=0)


def test_a_buoy_and_a_ship_at_one_hertz_are_forecast_as_measured(data_folder):
    d, s = (
        np.genfromtxt(data_folder / 'waves' / name, delimiter=',', names=True)
        for name in ('morro_buoy.csv', 'nbp1406_ship.csv')
    )
    columns = ('roll_deg', 'pitch_deg', *(f'gyro_{c}_deg_s' for c in 'xyz'), *(f'accel_{c}_m_s2' for c in 'xyz'))
    names = (*NAMES, 'gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
    values = np.column_stack([d[c] for c in columns])
    nrmse = _nrmse(values, names, 6000, 9000, np.array([0.1, 0.5, 1.0, 2.0]), 0.1)
    assert (nrmse.T < [[0.0028, 0.0425, 0.195, 0.62], [0.0028, 0.036, 0.23, 0.50]]).all()
    yaw_rate = np.diff(np.unwrap(np.radians(s['heading_deg'])), prepend=np.nan)
    values = np.column_stack([s['roll_deg'], s['pitch_deg'], yaw_rate, s['heave_m']])
    leads = np.array([1.0, 2.0, 3.0, 5.0])
    nrmse = _nrmse(values, (*NAMES, 'yaw_rate', 'heave'), 300, len(values) - 5, leads, 1.0)
    assert (nrmse.T < [[0.142, 0.365, 0.54, 0.705], [0.086, 0.236, 0.315, 0.485]]).all()


GROWTH = 1.8  #: A period, of waves that have just come.


@pytest.mark.parametrize('growth', [1.0, GROWTH])
@pytest.mark.parametrize('step', [0.1, 0.3])
def test_waves_that_grow_give_a_model_of_their_frequency_that_does_not(growth, step):
    """With noise that is a hundredth of them at any time."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        # some twelve periods, the last as large as a wave of 0.1 rad
        time = step * np.arange(round(12.0 * PERIOD / step))
        w, rate = 2.0 * np.pi / PERIOD, np.log(growth) / PERIOD
        envelope = 0.1 * np.exp(rate * (time - time[-1]))
        turn = w * time + np.array([[0.3], [1.4]])
        angles = envelope * np.cos(turn)
        rates = rate * angles - w * envelope * np.sin(turn)
        values = np.vstack([angles, rates]).T
        values += 0.01 * envelope[:, None] * [1.0, 1.0, w, w] * rng.normal(size=values.shape)
        names = ('roll', 'pitch', 'roll_rate', 'pitch_rate')
        for model in (
            analysis.identify(values, names, step, PERIOD),
            analysis.identify_alone(values, names, step, PERIOD, NAMES),
        ):
            assert model is not None, seed
            assert analysis.spectral_radius(model.a) < 1.0
            # that of the mode that fades least
            modes = np.linalg.eigvals(model.a)
            slowest = modes[np.abs(modes).argmax()]
            assert abs(np.angle(slowest)) / step == pytest.approx(w, rel=0.03), seed


def test_growth_is_damped_away_up_to_a_limit():
    """Above it there is no model: one factor on the largest eigenvalue decides."""
    step, w = 0.1, 2.0 * np.pi / PERIOD
    time = step * np.arange(2000)
    for growth in (1.5, 3.0):
        rate = np.log(growth) / PERIOD
        envelope = np.exp(rate * (time - time[-1]))
        noise = 1e-3 * envelope[:, None] * np.random.default_rng(0).normal(size=(2000, 2))
        values = np.column_stack([envelope * np.cos(w * time), envelope * np.sin(w * time)]) + noise
        values /= values.std(axis=0)
        gram, count = analysis.lag_gram(values, 20)
        found = analysis.canonical_state_space(gram / count, 2, 4, max_growth=1e9)
        free = analysis.spectral_radius(found[0])
        assert free <= analysis.LARGEST_RADIUS * (1.0 + 1e-12)
        for limit, is_model in ((0.99 * growth, False), (1.01 * growth, True)):
            limited = analysis.canonical_state_space(gram / count, 2, 4, limit ** (step / PERIOD))
            assert (limited is not None) == is_model, (growth, limit)
