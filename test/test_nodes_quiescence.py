"""Over DDS: the probability of staying quiet, by limits that can be changed at once, and the sea state."""

import math
import time
from itertools import islice

import pytest
import yaml

pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import LATCHED, PATIENCE, RELIABLE, Bench, running, start_together, wait_for  # noqa: E402
from std_msgs.msg import Float32, String  # noqa: E402

pytestmark = pytest.mark.dds

PERIOD_S = 4.0
AMPLITUDE = math.radians(0.2)


@pytest.mark.long
def test_quiescence_is_told_for_the_limits_of_now():
    bench = Bench()
    heard, seas = [], []
    bench.node.create_subscription(Float32, 'forecast/quiescence', lambda m: heard.append(m.data), RELIABLE)
    bench.node.create_subscription(String, 'sea/state', seas.append, LATCHED)
    stamps = iter(range(EPOCH_NS, 10 * EPOCH_NS, 20_000_000))

    def swing(count):
        frequency = 2.0 * math.pi / PERIOD_S
        readings = []
        for stamp in islice(stamps, count):
            phase = frequency * (stamp - EPOCH_NS) * 1e-9
            roll, rate = AMPLITUDE * math.sin(phase), AMPLITUDE * frequency * math.cos(phase)
            readings.append(reading(stamp, roll, roll_rate=rate))
        bench.send(readings)
        bench.wait_for_forecast_after(stamp)

    with running(bench, start_together()):
        swing(2500)
        wait_for(lambda: len(heard) > 5, 'probabilities')
        assert heard[-1] > 0.9
        assert bench.set_parameters('predictor', quiet_roll_deg=0.05) == []
        before = len(heard)
        swing(100)
        wait_for(lambda: len(heard) > before, 'probability of the new limit')
        assert heard[-1] < 0.1
        assert bench.set_parameters('predictor', quiet_roll_deg=0.0, quiet_pitch_deg=0.0) == []
        swing(20)
        before = len(heard)
        swing(100)
        assert len(heard) <= before + 1
        # about each minute; a fit that is late leaves out the one after it
        end = time.monotonic() + PATIENCE
        while not seas:
            assert time.monotonic() < end, 'no sea state'
            swing(500)
            # stamps run faster than the clock: on a busy machine five minutes of them would pass amid the fit
            time.sleep(1.0)
        report = yaml.safe_load(seas[0].data)
        assert not report['is_known'] and 'too few waves' in report['reason']
    bench.close()
