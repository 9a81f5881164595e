"""The benchmark of neural networks: samples without look-ahead, training, and what it says without torch."""

import subprocess
import sys

import numpy as np
import pytest
from repository import ROOT

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.evaluation.baselines import Record

LEADS = np.array((0.1, 0.5, 1.2))


@pytest.fixture
def networks(benchmark_module):
    return benchmark_module('networks')


@pytest.fixture
def swinging():
    """Roll and pitch at 10 Hz, with noise, so that no two samples are the same."""
    time, rng = 0.1 * np.arange(1200), np.random.default_rng(3)
    roll = 0.1 * np.sin(1.7 * time) + 0.03 * np.sin(2.9 * time)
    pitch = 0.05 * np.cos(1.7 * time)
    motion = {'roll': roll, 'pitch': pitch, 'roll_rate': np.gradient(roll, time)}
    return Trial(time, **{name: values + rng.normal(0.0, 1e-3, time.size) for name, values in motion.items()})


@pytest.mark.long
def test_without_torch_one_sentence_says_what_to_install():
    code = f"""
import importlib.util, runpy, sys
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == 'torch' else found(name, *rest)
sys.path[:0] = {[str(ROOT), str(ROOT / 'benchmark')]}
sys.argv = ['networks.py']
runpy.run_path('benchmark/networks.py', run_name='__main__')
"""
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == ''
    assert done.stderr == 'The networks need torch: pip install swath_sysid[benchmark-networks]\n'


@pytest.mark.long
def test_samples_are_those_of_a_plain_loop(networks, swinging):
    """Inputs end with the sample of the stamp; targets are the angles one lead later."""
    past, channels, axes = 20, ['roll_rate', 'roll', 'pitch'], ['roll', 'pitch']
    found = networks.samples_of(Record.of(swinging), swinging.time, past, channels, axes, LEADS)
    for row in range(swinging.time.size):
        inputs, targets = np.full((past, 3), np.nan), np.full((3, 2), np.nan)
        for lag in range(past):
            for place, name in enumerate(channels):
                if row - lag >= 0:
                    inputs[past - 1 - lag, place] = getattr(swinging, name)[row - lag]
        for place, steps in enumerate((1, 5, 12)):
            for column, axis in enumerate(axes):
                if row + steps < swinging.time.size:
                    targets[place, column] = getattr(swinging, axis)[row + steps]
        assert found.inputs[row] == pytest.approx(inputs, abs=1e-12, nan_ok=True), row
        assert np.array_equal(found.targets[row], targets, equal_nan=True), row
        assert np.array_equal(found.now[row, 0], [swinging.roll[row], swinging.pitch[row]])


def test_a_lost_sample_is_bridged_once_the_next_has_come(networks, swinging):
    """Until then it is no stamp; as a target it is missing."""
    lost = 500
    kept = np.delete(np.arange(swinging.time.size), lost)
    seen = Trial(swinging.time[kept], **{name: values[kept] for name, values in swinging.channels.items()})
    found = networks.samples_of(Record.of(seen), seen.time, 4, ['roll'], ['roll'], np.array([0.1]))
    middle, after = found.inputs[lost, :, 0], 0.5 * seen.roll[lost - 1 : lost + 1].sum()
    assert found.inputs[lost - 1, :, 0] == pytest.approx(swinging.roll[lost - 4 : lost])
    assert middle == pytest.approx([*swinging.roll[lost - 2 : lost], after, swinging.roll[lost + 1]])
    assert np.isnan(found.targets[lost - 1]).all() and np.isfinite(found.targets[lost]).all()


def test_what_comes_later_changes_neither_inputs_nor_what_is_learnt_from(networks, swinging):
    """Training and validation end with the first half; an input of the test ends with its stamp."""
    task, half = networks.task_of(swinging, LEADS), 0.5 * swinging.time[-1]
    assert 0.0 < task.training.stamps[-1] + LEADS[-1] <= 0.8 * half + 1e-9 < task.validation.stamps[0]
    assert task.validation.stamps[-1] + LEADS[-1] <= half + 1e-9 < task.test.stamps[0]
    for known in (600, 900):
        channels = {name: np.append(v[:known], -2.0 * v[known:]) for name, v in swinging.channels.items()}
        other = networks.task_of(Trial(swinging.time, **channels), LEADS)
        for mine, its in ((task.training, other.training), (task.validation, other.validation)):
            assert all(np.array_equal(a, b) for a, b in zip(mine, its, strict=True))
        assert np.array_equal(task.centre, other.centre) and np.array_equal(task.scale, other.scale)
        before = task.test.stamps < swinging.time[known]
        assert np.array_equal(task.test.inputs[before], other.test.inputs[before])
        assert not np.array_equal(task.test.inputs, other.test.inputs)


def test_the_regression_is_ridge_regression_of_the_scaled_lags(networks, swinging, monkeypatch):
    monkeypatch.setattr(networks, 'RIDGES', (1e-3,))
    task = networks.task_of(swinging, LEADS)
    rows = task.scaled(task.training).reshape(task.training.stamps.size, -1)
    rows = np.column_stack([np.ones(rows.shape[0]), rows])
    # as least squares with rows that pull the coefficients to zero
    pulled = np.vstack([rows, np.sqrt(1e-3 * rows.shape[0]) * np.eye(rows.shape[1])])
    targets = task.training.targets.reshape(rows.shape[0], -1)
    wanted = np.vstack([targets, np.zeros((rows.shape[1], targets.shape[1]))])
    expected = rows @ np.linalg.lstsq(pulled, wanted, rcond=None)[0]
    found = networks.regression(task)(task.training)
    assert found.reshape(expected.shape) == pytest.approx(expected, abs=1e-9)


def test_the_worst_ratio_is_that_to_the_network_with_the_least_error(networks):
    def row(roll, pitch):
        return networks.Row({'roll': np.array(roll), 'pitch': np.array(pitch)})

    rows = {
        'persistence': row([0.1, 0.1], [0.1, 0.1]),
        'swath_sysid': row([1.0, 2.0], [3.0, 4.0]),
        'regression': row([0.2, 0.2], [0.2, 0.2]),
        'MLP, median': row([2.0, 4.0], [2.0, 8.0]),
        'TCN, best': row([4.0, 1.0], [4.0, 5.0]),
    }
    assert networks.ratios_of(rows).tolist() == [1.5, 2.0]
    lines = networks.table_of('Sea', (0.5, 1.0), rows).splitlines()
    assert lines[-1] == '| worst | swath_sysid over the best network | 1.500 | 2.000 | |'
    assert lines[8] == '| roll | TCN, best | 4.000 | 1.000 |  |'
