"""The nodes over DDS on a craft under way: identification in waves, changing draft, quiescence."""

import math
import time
from itertools import islice

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy')

from craft_at_sea import known_sea  # noqa: E402
from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import LATCHED, RELIABLE, Bench, running, settings, start_together, wait_for  # noqa: E402
from std_msgs.msg import Float32, Float64, String  # noqa: E402

from swath_sysid.attitude.hull.catalogue import EQUATIONS  # noqa: E402
from swath_sysid.attitude.hull.decay_model import DecayModel  # noqa: E402
from swath_sysid.attitude.hull.identified_model import (
    IdentifiedModel,  # noqa: E402
    ScheduledModel,  # noqa: E402
)
from swath_sysid.attitude.identification.at_sea import is_at_sea  # noqa: E402
from swath_sysid.formats.model_file import model_from_yaml, read_model, scheduled_to_yaml  # noqa: E402

pytestmark = pytest.mark.dds


def linear(axis, **terms):
    return DecayModel.from_terms(EQUATIONS['linear'], terms, axis=axis)


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.close()


@pytest.mark.long
def test_waves_are_identified_on_demand_and_only_better_models_published(bench, tmp_path):
    rate_hz, model = 10, linear('roll', b1=0.5, r1=6.25)
    sea = known_sea(model, [6], 1.4, np.radians(2.0), 240.0, interval=1.0 / rate_hz)
    noise = np.random.default_rng(1).normal(size=(sea.time.size, 2)) * (1e-3, 5e-3)
    motion = (np.column_stack([sea.angle[:, 0], sea.rate[:, 0]]) + noise).tolist()
    readings = [
        reading(EPOCH_NS + k * 10**9 // rate_hz, roll=angle, roll_rate=rate) for k, (angle, rate) in enumerate(motion)
    ]
    path = tmp_path / 'craft.yaml'
    given = settings(f'model_path:={path}', 'window_s:=300.0', 'max_rate_hz:=50.0', 'window_timeout_s:=60.0')
    with running(bench, start_together(*given)):
        bench.settle('imu_buffer', bench.send(readings))
        first = bench.call('identifier/identify')
        assert first.success and first.message.startswith('roll: at sea, equivalent linear at 4'), first.message
        assert '\n' not in first.message and 'pitch: no free decay' in first.message
        wait_for(lambda: bench.heard['model/description'], 'model')
        second = bench.call('identifier/identify')
        assert not second.success and 'the current model explains the window as well' in second.message
    identified = model_from_yaml(bench.heard['model/description'][-1].data)['roll']
    std = identified.metrics['natural_period_std_s']
    assert is_at_sea(identified) and std < 0.2
    assert identified.model.natural_period == pytest.approx(model.natural_period, abs=3.5 * std)
    assert read_model(path)['roll'] == identified
    shares = [message.data for message in bench.heard['identifier/progress']]
    assert shares[-1] == 1.0 and len(shares) > 4


def test_the_predictor_follows_the_draft(bench):
    models = tuple(IdentifiedModel.exactly(linear('pitch', b1=0.4, r1=r1)) for r1 in (12.0, 9.0, 7.0))
    schedule = {'pitch': ScheduledModel('draft_m', (0.1, 0.15, 0.2), models)}
    stamps = iter(range(EPOCH_NS, 10 * EPOCH_NS, 10_000_000))

    def rest():
        for stamp in islice(stamps, 100):
            bench.send([reading(stamp, 0.0, 0.02)])
        bench.wait_for_forecast_after(stamp)

    def count(reason):
        return bench.counts('predictor').get(reason, 0.0)

    with running(bench, start_together()):
        description = bench.publisher(String, 'model/description', LATCHED)
        loading = bench.publisher(Float64, 'craft/loading', RELIABLE)
        wait_for(lambda: description.get_subscription_count() and loading.get_subscription_count(), 'connections')
        rest()
        description.publish(String(data=scheduled_to_yaml(schedule)))
        has_model = 'has_model_pitch'
        wait_for(lambda: bench.statuses['predictor: forecast'][2].get(has_model) == 'True', 'model')
        loading.publish(Float64(data=0.12))
        rest()
        assert count('loading-advice') == 0
        loading.publish(Float64(data=0.5))
        wait_for(lambda: count('loading-advice') == 1, 'advice about a draft beyond the schedule')
        loading.publish(Float64(data=-1.0))
        wait_for(lambda: count('bad-loading') == 1, 'count of a draft that is none')
        before = count('used')
        rest()
        wait_for(lambda: count('used') >= before + 100, 'samples used')
        (refused,) = bench.set_parameters('predictor', loading=-2.0)
        assert 'loading' in refused
        assert bench.set_parameters('predictor', loading=0.2) == []


@pytest.mark.long
def test_quiescence_is_told_for_the_limits_of_now(bench):
    heard, seas, stamps = [], [], iter(range(EPOCH_NS, 10 * EPOCH_NS, 20_000_000))
    bench.node.create_subscription(Float32, 'forecast/quiescence', lambda m: heard.append(m.data), RELIABLE)
    bench.node.create_subscription(String, 'sea/state', seas.append, LATCHED)

    def swing(count):
        frequency, amplitude, readings = 2.0 * math.pi / 4.0, math.radians(0.2), []
        for stamp in islice(stamps, count):
            phase = frequency * (stamp - EPOCH_NS) * 1e-9
            roll, rate = amplitude * math.sin(phase), amplitude * frequency * math.cos(phase)
            readings.append(reading(stamp, roll, roll_rate=rate))
        bench.send(readings)
        bench.wait_for_forecast_after(stamp)
        return len(heard)

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
        before = swing(20)
        assert swing(100) <= before + 1
        # the fit ends amid samples that others wait behind, which are passed over; the sea is told all the same
        swing(500)
        wait_for(lambda: seas, 'sea state', meanwhile=lambda: (swing(50), time.sleep(0.2)))
        report = yaml.safe_load(seas[0].data)
        assert report['stamp_ns'] - EPOCH_NS < 110e9
        assert not report['is_known'] and 'too few waves' in report['reason']
