"""The predictor in this process: fits of the waves that come late, and samples that waited while it could not run."""

import itertools
import math
import time

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import LATCHED, RELIABLE, Bench, imu_message, stamp_ns, take, wait_for  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import Float32, Float64, String  # noqa: E402

from swath_sysid.attitude.hull.decay_model import DecayModel  # noqa: E402
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, ScheduledModel  # noqa: E402
from swath_sysid.attitude.motion.stamps import LOST  # noqa: E402
from swath_sysid.attitude.prediction.forecast import Wanted  # noqa: E402
from swath_sysid.attitude.prediction.sea_state import SeaReport  # noqa: E402
from swath_sysid.common.conditions import CONDITIONS  # noqa: E402
from swath_sysid.formats.model_file import scheduled_to_yaml  # noqa: E402
from swath_sysid.formats.topics import QUIESCENCE_TOPIC, SEA_TOPIC  # noqa: E402
from swath_sysid.nodes.executor_loop import events_executor, turn  # noqa: E402
from swath_sysid.nodes.inbox import PASSED_OVER_NS  # noqa: E402
from swath_sysid.nodes.predictor import Predictor  # noqa: E402
from swath_sysid.nodes.worker import WorkerError  # noqa: E402
from swath_sysid.pipeline.health import BEHIND  # noqa: E402
from swath_sysid.pipeline.pacing import Pace  # noqa: E402

pytestmark = pytest.mark.dds


@pytest.fixture
def predictor():
    rclpy.init()
    node = Predictor()
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def set_parameters(node, **values):
    """Whether each is accepted."""
    return [each.successful for each in node.set_parameters([Parameter(n, value=v) for n, v in values.items()])]


class LaterWorker:
    """Keeps what is submitted until the test has it done."""

    def __init__(self):
        self.work = []

    def submit(self, function, arguments, on_end):
        self.work.append((function, arguments, on_end))

    def finish(self):
        function, arguments, on_end = self.work.pop(0)
        on_end(function(*arguments), None)

    def close(self):
        pass


@pytest.fixture
def sailing(predictor):
    """A predictor in waves that has just asked for a fit, and how to send it further samples."""
    predictor.sea.close()
    predictor.sea.worker = LaterWorker()
    sent = 0

    def sail(count):
        nonlocal sent
        for k in range(sent, sent + count):
            roll = 0.05 * math.sin(0.2 * k) + 0.03 * math.sin(0.13 * k)
            rate = 10.0 * (0.05 * 0.2 * math.cos(0.2 * k) + 0.03 * 0.13 * math.cos(0.13 * k))
            take(predictor, imu_message(reading(EPOCH_NS + k * 100_000_000, roll=roll, roll_rate=rate)))
            sent += 1
            if predictor.sea.worker.work:
                return

    sail(600)
    assert predictor.sea.worker.work, 'a fit was asked for'
    return predictor, sail


DELAY = 5
"""Samples between a request and the use of its fit: 0.5 s."""


@pytest.mark.parametrize(('samples_meanwhile', 'late'), [(0, 0), (DELAY - 1, 0), (DELAY, 1), (2 * DELAY, 1), (60, 2)])
def test_a_fit_that_comes_after_its_time_is_counted_and_warns_nobody(sailing, samples_meanwhile, late):
    """After six seconds the next one too, which it kept from beginning."""
    predictor, sail = sailing
    for _ in range(samples_meanwhile):
        sail(1)
    assert len(predictor.sea.worker.work) == 1 and CONDITIONS['late-fit'].warns == 'never'
    predictor.sea.worker.finish()
    sail(1)
    assert predictor.health.counts['late-fit'] == late


def test_waves_that_cannot_be_fitted_warn_until_they_can(sailing):
    predictor, sail = sailing
    _, _, on_end = predictor.sea.worker.work.pop(0)
    on_end(None, WorkerError('out of memory'))
    levels = []
    for _ in range(120):
        sail(1)
        if predictor.sea.worker.work:
            break
        levels.append([each.code for each in predictor.health.holding])
    assert levels and all('waves-not-fitted' in told for told in levels)
    predictor.sea.worker.finish()
    sail(1)
    assert not predictor.health.holding and predictor.health.counts['waves-not-fitted'] == 1


def test_a_sea_state_that_comes_with_a_sample_that_is_passed_over_is_told(predictor, monkeypatch):
    sent, finish = [], predictor.pipeline.finish
    monkeypatch.setattr(predictor, '_publish', lambda messages: sent.extend(topic for topic, _ in messages))
    monkeypatch.setattr(
        predictor.pipeline, 'finish', lambda *given: finish(*given)._replace(sea=SeaReport(None, 'a flat sea'))
    )
    predictor._add(reading(EPOCH_NS, roll=0.01), 0.0, is_passed_over=True)
    assert sent == [SEA_TOPIC]


def test_leads_horizon_and_rate_change_while_it_runs_and_a_fit_of_before_is_not_used(sailing):
    predictor, sail = sailing
    topics = set(predictor._publisher_of)
    (no,) = set_parameters(predictor, horizon_s=0.05)
    assert not no
    for wrong in ({'leads_s': [2.0, 1.0]}, {'horizon_step_s': 8.0}, {'forecast_rate_hz': 0.0}):
        assert set_parameters(predictor, **wrong) == [False]
    assert set(predictor._publisher_of) == topics and predictor.pipeline.used > 50
    values = {'leads_s': [0.4, 1.0], 'horizon_s': 8.0, 'horizon_step_s': 0.2, 'forecast_rate_hz': 2.0}
    assert all(set_parameters(predictor, **values))
    heard = {f'forecast/lead_{lead}s' for lead in ('0_4', '1_0')}
    assert {name for name in predictor._publisher_of if '/lead_' in name} == heard
    predictor._wanted, steps, finish = Wanted, [], predictor.pipeline.finish
    predictor.pipeline.finish = lambda *given: steps.append(finish(*given)) or steps[-1]
    predictor.sea.worker.finish()
    sail(60)
    assert not predictor.pipeline.diagnostics().has_waves
    issued = [step.horizon for step in steps if step.horizon is not None]
    assert issued and np.allclose(issued[-1].leads, np.arange(0.2, 8.1, 0.2))
    assert np.allclose(steps[-1].forecast.leads if steps[-1].forecast else [0.4, 1.0], [0.4, 1.0])
    assert 0.4 < np.median(np.diff([each.stamp_ns for each in issued])) / 1e9 < 0.6


def test_only_what_somebody_may_hear_is_worked_into_messages(predictor, monkeypatch):
    publish, sent = predictor._publish, set()
    heard, always = 'forecast/lead_0_5s', {'forecast/next', 'forecast/calm'}

    def watched(messages):
        found = list(messages)
        sent.update(topic for topic, _ in found)
        publish(found)

    def sail(first):
        sent.clear()
        for k in range(first, first + 20):
            take(predictor, imu_message(reading(EPOCH_NS + k * 100_000_000, roll=0.05 * math.sin(0.2 * k))))

    monkeypatch.setattr(predictor, '_publish', watched)
    sail(0)
    assert sent == always
    listener = rclpy.create_node('listener')
    listener.create_subscription(Imu, heard, lambda message: None, 1)
    wait_for(predictor._publisher_of[heard].get_subscription_count, 'subscription')
    sail(20)
    listener.destroy_node()
    assert sent == {heard, *always}


@pytest.mark.parametrize(
    ('make_executor', 'cost', 'stride'),
    [(events_executor, 0.0, 1), (events_executor, 0.0099, 16), (rclpy.executors.SingleThreadedExecutor, 0.0, 1)],
)
def test_after_a_stall_it_forecasts_from_the_newest_and_leaves_out_what_it_has_no_time_for(
    predictor, make_executor, cost, stride, monkeypatch
):
    """With 10 ms a sample, 400 of them would take four seconds; a pass may take a sixteenth."""
    monkeypatch.setattr(Pace, 'note', lambda pace, now: pace._took.append(cost))
    bench, executor, interval_ns, count = Bench(), make_executor(), 10_000_000, 400
    executor.add_node(predictor)
    # within one process samples arrive as they are published
    sensor = bench.publisher(Imu, 'imu/data', QoSProfile(depth=1000))
    leads = bench.heard['forecast/lead_0_5s']

    def spin_until(condition, what):
        wait_for(lambda: turn(executor, [predictor], 0.02) or condition(), what)

    def send(first, last):
        for k in range(first, last):
            sensor.publish(imu_message(reading(EPOCH_NS + k * interval_ns, 0.01, -0.02)))

    try:
        spin_until(lambda: sensor.get_subscription_count() and bench.node.count_publishers('/forecast/next'), 'nodes')
        next_try = time.monotonic()
        while predictor.health.received == 0:
            # the subscription may still be connecting when the sensor knows of it: what comes before that is lost
            if time.monotonic() >= next_try:
                send(0, 1)
                next_try = time.monotonic() + 2.0
            turn(executor, [predictor], 0.02)
        for k in range(1, 50):
            send(k, k + 1)
            spin_until(lambda k=k: predictor.health.received > k, 'sample')
        assert predictor.health.counts['passed-over'] == 0
        wait_for(lambda: bench.newest_stamp() == EPOCH_NS + 50 * interval_ns, 'forecast')
        bench.heard['forecast/next'].clear()
        leads.clear()
        send(50, 50 + count)
        spin_until(lambda: predictor.health.received == 50 + count, 'all samples')
        newest = EPOCH_NS + (50 + count - 1) * interval_ns
        wait_for(lambda: bench.newest_stamp() > newest, 'forecast from the newest sample')
        wait_for(lambda: leads, 'leads')
        fresh = PASSED_OVER_NS // interval_ns + 1
        assert len(bench.heard['forecast/next']) <= fresh and len(leads) <= 2
        assert all(stamp_ns(lead) - 500_000_000 >= newest - PASSED_OVER_NS for lead in leads)
        assert predictor.pipeline.used == 50 + count // stride
        values = predictor.health.reports(0.0, newest)[0].values
        assert values[BEHIND] == count - count // stride and values[LOST] == 0
        assert values['passed-over'] == count // stride - (PASSED_OVER_NS // (stride * interval_ns) + 1)
    finally:
        executor.shutdown()
        bench.close()


def test_the_predictor_follows_the_draft(predictor):
    models = tuple(IdentifiedModel.exactly(DecayModel.of(b1=0.4, r1=r1, axis='pitch')) for r1 in (12.0, 9.0, 7.0))
    schedule = {'pitch': ScheduledModel('draft_m', (0.1, 0.15, 0.2), models)}
    bench, executor, counts = Bench(), events_executor(), predictor.health.counts
    executor.add_node(predictor)
    description, loading = (
        bench.publisher(kind, topic, how)
        for kind, topic, how in ((String, 'model/description', LATCHED), (Float64, 'craft/loading', RELIABLE))
    )

    def wait_for_stiffness(expected):
        def found():
            executor.spin_once(timeout_sec=0.02)
            held = predictor.pipeline.models['pitch']
            return held and held.model.terms['r1'] == pytest.approx(expected)

        wait_for(found, f'stiffness {expected}')

    try:
        wait_for(lambda: description.get_subscription_count() and loading.get_subscription_count(), 'connections')
        description.publish(String(data=scheduled_to_yaml(schedule)))
        wait_for_stiffness(9.0)
        loading.publish(Float64(data=0.1))
        wait_for_stiffness(12.0)
        assert counts['loading-advice'] == 0
        loading.publish(Float64(data=0.5))
        wait_for_stiffness(7.0)
        assert counts['loading-advice'] == 1
        loading.publish(Float64(data=-1.0))
        wait_for(lambda: executor.spin_once(timeout_sec=0.02) or counts['bad-loading'] == 1, 'a draft that is none')
        assert set_parameters(predictor, loading=-2.0) == [False]
        assert set_parameters(predictor, loading=0.1) == [True]
        wait_for_stiffness(12.0)
    finally:
        executor.shutdown()
        bench.close()


@pytest.mark.long
def test_quiescence_is_told_for_the_limits_of_now(predictor, monkeypatch):
    stamps, told, publish = iter(range(EPOCH_NS, 10 * EPOCH_NS, 100_000_000)), [], predictor._publish

    def watched(messages):
        found = list(messages)
        told.extend(deserialize_message(raw, Float32).data for topic, raw in found if topic == QUIESCENCE_TOPIC)
        publish(found)

    def swing(count):
        """The last probability that is told of a roll of 0.2 degrees, if any."""
        told.clear()
        for stamp in itertools.islice(stamps, count):
            phase = 0.5 * math.pi * (stamp - EPOCH_NS) * 1e-9
            roll, rate = math.radians(0.2) * math.sin(phase), math.radians(0.2) * 0.5 * math.pi * math.cos(phase)
            take(predictor, imu_message(reading(stamp, roll, roll_rate=rate)))
        return told[-1] if told else None

    monkeypatch.setattr(predictor, '_publish', watched)
    listener = rclpy.create_node('listener')
    listener.create_subscription(Float32, QUIESCENCE_TOPIC, lambda message: None, 1)
    wait_for(predictor._publisher_of[QUIESCENCE_TOPIC].get_subscription_count, 'subscription')
    assert swing(600) > 0.9
    assert set_parameters(predictor, quiet_roll_deg=0.05) == [True] and swing(20) < 0.1
    assert set_parameters(predictor, quiet_roll_deg=0.0, quiet_pitch_deg=0.0) == [True, True] and swing(20) is None
    listener.destroy_node()
