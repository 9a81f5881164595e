"""Over DDS: the predictor's diagnostics name a sensor that sits otherwise than was said, and go on naming it."""

import pytest

pytest.importorskip('rclpy')

import numpy as np  # noqa: E402
from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import Bench, running, start_together, wait_for  # noqa: E402

pytestmark = pytest.mark.dds

STEP = 20_000_000
OK, WARN = 0, 1


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.close()


def rolling(first, seconds, **changes):
    """A craft that rolls in waves, by a sensor with forward-right-down axes."""
    readings, noise = [], np.random.default_rng(first)
    for k in range(first, first + round(seconds * 1e9) // STEP):
        t = k * STEP * 1e-9
        roll, rate = 0.1 * np.sin(1.5 * t), 0.15 * np.cos(1.5 * t)
        force = 0.0, 9.81 * np.sin(roll), -9.81 * np.cos(roll) + noise.normal(0.0, 0.02)
        readings.append(reading(EPOCH_NS + k * STEP, roll, 0.0, rate, force=force, **changes))
    return readings


def installation(bench):
    return bench.statuses.get('predictor: installation', (None, '', {}))


def sent_until(bench, condition):
    """Five seconds of messages after the others, a minute at most, until the diagnostics say what is waited for."""
    for first in range(0, 60 * 10**9 // STEP, 5 * 10**9 // STEP):
        bench.send(rolling(first, 5.0))
        # messages may be lost on a busy machine; what has come is judged with the next diagnostics
        reports = bench.reports
        wait_for(lambda heard=reports: bench.reports > heard + 6, 'further diagnostics')
        if condition():
            return
    raise AssertionError(f'after a minute of messages: {installation(bench)}')


@pytest.mark.long
def test_axes_of_the_other_frame_are_named_with_their_cure(bench):
    with running(bench, start_together()):
        sent_until(bench, lambda: installation(bench)[0] == WARN)
        level, message, values = installation(bench)
        assert level == WARN and values['contradictions'] == 'axes-of-sensor'
        assert 'gravity reads -9.8 m/s^2' in message and 'set frame to frd' in message
        # silence, and a warning, are no reason to forget it
        reports = bench.reports
        wait_for(lambda: bench.reports > reports + 10, 'further diagnostics')
        assert installation(bench)[:2] == (level, message)


@pytest.mark.long
def test_the_right_frame_is_not_warned_of(bench):
    with running(bench, start_together('-p', 'frame:=frd')):
        sent_until(bench, lambda: int(installation(bench)[2].get('judgements', 0)) >= 3)
        assert installation(bench)[0] == OK and 'agree' in installation(bench)[1]
