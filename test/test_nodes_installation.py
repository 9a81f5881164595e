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


def sent_until_named(bench, first):
    """Messages until the diagnostics warn; the number of those sent."""
    for _ in range(12):
        bench.send(rolling(first, 5.0))
        first += round(5e9) // STEP
        bench.settle('predictor', first)
        reports = bench.reports
        wait_for(lambda heard=reports: bench.reports > heard + 2, 'further diagnostics')
        if installation(bench)[0] == WARN:
            break
    return first


def test_axes_of_the_other_frame_are_named_with_their_cure(bench):
    with running(bench, start_together()):
        sent = sent_until_named(bench, 0)
        assert sent * STEP <= 60 * 10**9
        level, message, values = installation(bench)
        assert level == WARN and values['contradictions'] == 'axes-of-sensor'
        assert 'gravity reads -9.8 m/s^2' in message and 'set frame to frd' in message
        # silence, and a warning, are no reason to forget it
        reports = bench.reports
        wait_for(lambda: bench.reports > reports + 10, 'further diagnostics')
        assert installation(bench)[:2] == (level, message)


def test_the_right_frame_is_not_warned_of(bench):
    with running(bench, start_together('-p', 'frame:=frd')):
        bench.send(rolling(0, 25.0))
        bench.settle('predictor', round(25e9) // STEP)
        wait_for(lambda: installation(bench)[2].get('judgements', '0') != '0', 'judgement')
        assert installation(bench)[0] == OK
