"""What was learnt of a sea is a candidate at the next start: right from the first rows on, and harmless where wrong."""

from dataclasses import replace

import numpy as np
import pytest
from records_at_sea import sea
from scipy.linalg import block_diag

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.rows import CHANNELS
from swath_sysid.attitude.prediction.sea_memory import SeaMemory, at_step
from swath_sysid.attitude.prediction.state_space import InnovationsFilter, InnovationsModel
from swath_sysid.attitude.prediction.variate_analysis import identify
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.sea_memory_file import MATRICES, read_sea_memory, write_sea_memory
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed, samples_of
from swath_sysid.share import share_folder

LEADS = (0.3, 0.5, 1.0)
SETTINGS = PipelineSettings(forecaster=ForecasterSettings(leads=LEADS, horizon=1.0))
STEP, PERIOD = 0.1, 3.0
YOUNG = 7.0
"""s in which a start knows little of the sea: some two periods."""


def played(trial, memory=None):
    """The pipeline after a trial, and the squared errors (N, L, A) of what it issued."""
    pipeline, errors = ForecastPipeline(SETTINGS), []
    pipeline.remember(memory)
    angles = np.stack([trial.channels[axis] for axis in AXES], axis=1)
    for step in followed(pipeline, samples_of(trial)):
        if step.forecast is not None:
            due = trial.time[0] + step.sample.stamp_ns * 1e-9 - trial.time[0] + np.array(LEADS)
            came = np.stack([np.interp(due, trial.time, angle, right=np.nan) for angle in angles.T], axis=1)
            errors.append((step.forecast.mean[:, : len(AXES)] - came) ** 2)
    return pipeline, np.array(errors)


def rows_of(trial):
    """The rows of a trial with a sample a row."""
    return np.column_stack([trial.channels.get(name, np.full(trial.time.size, np.nan)) for name in CHANNELS])


def taught(trial):
    """What a trial teaches."""
    waves = identify(rows_of(trial), CHANNELS, STEP, PERIOD)
    return SeaMemory(PERIOD, (trial.time[-1] - trial.time[0]) / PERIOD, waves)


@pytest.fixture(scope='module')
def buoy():
    """A measured sea, and what its first four minutes teach."""
    whole = read_trial(share_folder() / 'records' / 'morro_buoy.csv')
    return whole, taught(whole.between(0.0, 240.0))


def oscillators():
    """A state space of two angles, each a damped oscillator, in innovations form."""
    blocks = [0.98 * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]]) for w in (0.2, 0.33)]
    a = np.block([[blocks[0], np.zeros((2, 2))], [np.zeros((2, 2)), blocks[1]]])
    c = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    k = np.array([[0.9, 0.0], [0.3, 0.0], [0.0, 0.8], [0.0, 0.2]])
    return InnovationsModel(AXES, (0, 1), 0.1, np.zeros(2), np.ones(2), a, k, c, np.eye(2) / 36.0, np.eye(4))


def motion_of(model, count, seed=1):
    """Rows (N, C) that a model makes."""
    rng, state, rows = np.random.default_rng(seed), np.zeros(len(model.a)), []
    for e in rng.normal(size=(count, len(model.c))) @ np.linalg.cholesky(model.s).T:
        rows.append(model.c @ state + e)
        state = model.a @ state + model.k @ e
    return np.array(rows)


def lagged(model, lag):
    """Covariance of rows so many apart, by a sum over all innovations before them."""
    responses, power = [np.eye(len(model.c))], model.k
    for _ in range(600):
        responses.append(model.c @ power)
        power = model.a @ power
    return sum(later @ model.s @ now.T for later, now in zip(responses[lag:], responses, strict=False))


def test_the_level_of_a_memory_is_that_of_the_day():
    """Rows with another level are forecast as those without it, once a few periods have shown it, and as surely."""
    model, level = oscillators(), np.array([0.8, -0.5])
    rows = motion_of(model, 400)
    leads = np.array([0.1, 0.4, 1.0])
    of_model = InnovationsFilter(model, AXES, 2.0)
    of_memory = InnovationsFilter(SeaMemory(2.0, 200.0, model).candidate(0.1), AXES, 2.0)
    of_model.seed(rows)
    of_memory.seed(rows + level)
    (mean, spread), (with_level, wider) = of_model.ahead(leads / 0.1), of_memory.ahead(leads / 0.1)
    assert np.abs(with_level - level - mean).max() < 0.2
    assert np.allclose(wider, spread, rtol=0.1) and (np.diagonal(wider - spread, axis1=1, axis2=2) > 0.0).all()


def rms(trial, memory=None):
    """Of the errors of a trial's forecasts, of both axes."""
    return np.sqrt(np.nanmean(played(trial, memory)[1]))


@pytest.mark.parametrize('every', [1, 2, 3, 5])
def test_a_memory_on_every_so_many_rows_is_that_of_the_same_motion(every):
    """Oracle: the covariances of the rows; one-step errors of what the model itself makes are white, and as claimed."""
    model = oscillators()
    seldom = at_step(model, every * model.step)
    expected = [lagged(model, every * lag) for lag in range(4)]
    assert np.allclose([lagged(seldom, lag) for lag in range(4)], expected, atol=1e-9)
    state, errors = np.zeros(4), []
    for row in motion_of(model, 4000)[::every]:
        errors.append(row - seldom.c @ state)
        state = seldom.a @ state + seldom.k @ errors[-1]
    errors = np.array(errors[50:])
    assert np.allclose(errors.var(axis=0), np.diag(seldom.s), rtol=0.2)
    assert np.abs((errors[1:] * errors[:-1]).mean(axis=0) / errors.var(axis=0)).max() < 0.15


def test_a_state_that_ends_at_once_has_no_memory_on_more_rows():
    """Its powers below one are not finite; on fewer rows it is gone."""
    model = oscillators()
    ended = replace(
        model, a=block_diag(model.a, 0.0), k=np.vstack([model.k, [[0.1, 0.1]]]), c=np.hstack([model.c, [[0.1], [0.1]]])
    )
    memory = SeaMemory(2.0, 200.0, replace(ended, prior=np.eye(5)))
    assert memory.candidate(0.05) is None
    assert memory.candidate(0.3) is not None


def test_a_memory_on_more_rows_forecasts_them(buoy):
    """That of every second row, alone: over half a second it errs by a fifth of the motion at most."""
    rows = rows_of(buoy[0])
    space = InnovationsFilter(at_step(identify(rows[:2400:2], CHANNELS, 2.0 * STEP, PERIOD), STEP), AXES, 1.0)
    missed = []
    for place in range(2400, len(rows) - 5):
        space.take(rows[place])
        missed.append(space.ahead([5])[0][0] - rows[place + 5, : len(AXES)])
    assert (np.std(missed[100:], axis=0) < 0.2 * np.std(rows[2400:, : len(AXES)], axis=0)).all()


@pytest.mark.long
def test_a_start_in_the_same_sea_errs_much_less(buoy):
    whole, memory = buoy
    starts = [whole.between(begin, begin + YOUNG) for begin in (250.0, 280.0, 310.0)]
    ratios = [rms(start, memory) / rms(start) for start in starts]
    assert max(ratios) < 1.0 and np.exp(np.mean(np.log(ratios))) < 0.65


def test_a_list_since_then_changes_nothing(buoy):
    whole, memory = buoy
    later = whole.between(280.0, 280.0 + YOUNG)
    listed = replace(later, roll=later.roll + 0.1, pitch=later.pitch - 0.05)
    assert rms(listed, memory) < 1.1 * rms(later, memory)


@pytest.mark.long
@pytest.mark.parametrize('factor', [0.6, 1.7])
def test_the_memory_of_another_craft_does_no_harm(buoy, factor):
    """The craft is as many times as slow, on the same rows."""
    quick = sea(duration=40.0, seed=5)
    even = np.arange(0.0, factor * quick.time[-1], STEP)
    channels = {name: np.interp(even, factor * quick.time, values) for name, values in quick.channels.items()}
    channels |= {f'{axis}_rate': channels[f'{axis}_rate'] / factor for axis in AXES}
    craft = replace(quick, time=even, **channels).between(0.0, 20.0)
    assert rms(craft, buoy[1]) < 1.1 * rms(craft)


def test_a_shorter_past_replaces_no_memory(buoy):
    whole, memory = buoy
    later = whole.between(280.0, 292.0)
    assert played(later, memory)[0].memory is memory and played(later)[0].memory is None


def test_other_settings_leave_the_memory(buoy):
    pipeline = ForecastPipeline(SETTINGS)
    pipeline.remember(buoy[1])
    pipeline.reset(PipelineSettings())
    assert pipeline.memory is buoy[1]


def test_a_memory_is_written_and_read_to_the_last_bit(buoy, tmp_path):
    memory, path = buoy[1], tmp_path / 'craft.sea.npz'
    write_sea_memory(memory, path)
    read = read_sea_memory(path)
    assert path.stat().st_size < 1_000_000
    assert (read.period, read.periods, read.waves.step) == (memory.period, memory.periods, memory.waves.step)
    assert read.waves.channels == memory.waves.channels and read.waves.places == memory.waves.places
    assert all(np.array_equal(getattr(read.waves, name), getattr(memory.waves, name)) for name in MATRICES)


def spoilt(change):
    """A file whose arrays are changed."""

    def write(path, good):
        with np.load(good) as file:
            held = {name: file[name] for name in file.files}
        held |= change(held)
        with open(path, 'wb') as file:
            np.savez(file, **held)

    return write


@pytest.mark.parametrize(
    ('write', 'says'),
    [
        (lambda path, good: path.write_bytes(good.read_bytes()[:-200]), 'no memory of the sea'),
        (lambda path, good: path.write_text('roll'), 'no memory of the sea'),
        (lambda path, good: np.save(path.open('wb'), np.array([{}], dtype=object)), 'no memory of the sea'),
        (spoilt(lambda held: {'layout': 2}), 'layout 2'),
        (spoilt(lambda held: {'a': 2.0 * held['a']}), 'not stable'),
        (spoilt(lambda held: {'s': -held['s']}), 'no covariance'),
        (spoilt(lambda held: {'k': held['k'][:, 1:]}), 'k of shape'),
        (spoilt(lambda held: {'c': np.nan * held['c']}), 'c of shape'),
        (spoilt(lambda held: {'period': 0.0}), 'positive'),
        (spoilt(lambda held: {'channels': np.array(['sway'] * held['channels'].size)}), 'no memory of the sea'),
    ],
)
def test_a_file_that_holds_no_memory_is_refused_in_a_sentence(buoy, tmp_path, write, says):
    good, path = tmp_path / 'good.sea.npz', tmp_path / 'bad.sea.npz'
    write_sea_memory(buoy[1], good)
    write(path, good)
    with pytest.raises(InputError, match=says):
        read_sea_memory(path)
