"""The predictor follows the craft's draft over DDS: the scheduled model, without losing its state."""

import pytest

pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import LATCHED, RELIABLE, Bench, running, start_together, wait_for  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

from swath_sysid.attitude.hull.catalogue import EQUATIONS  # noqa: E402
from swath_sysid.attitude.hull.decay_model import DecayModel  # noqa: E402
from swath_sysid.attitude.hull.identified_model import IdentifiedModel  # noqa: E402
from swath_sysid.attitude.hull.scheduled_model import ScheduledModel  # noqa: E402
from swath_sysid.formats.model_file import scheduled_to_yaml  # noqa: E402

pytestmark = pytest.mark.dds


def schedule():
    models = [
        IdentifiedModel.exactly(DecayModel.from_terms(EQUATIONS['linear'], {'b1': 0.4, 'r1': r1}, axis='pitch'))
        for r1 in (12.0, 9.0, 7.0)
    ]
    return {'pitch': ScheduledModel('draft_m', (0.1, 0.15, 0.2), tuple(models))}


def test_the_predictor_follows_the_draft():
    bench = Bench()
    stamps = iter(range(EPOCH_NS, 10 * EPOCH_NS, 10_000_000))

    def rest(count=100):
        last = None
        for _ in range(count):
            last = next(stamps)
            bench.send([reading(last, 0.0, 0.02)])
        bench.wait_for_forecast_after(last)

    def count(reason):
        return bench.counts('predictor').get(reason, 0.0)

    with running(bench, start_together()):
        description = bench.publisher(String, 'model/description', LATCHED)
        loading = bench.publisher(Float64, 'craft/loading', RELIABLE)
        wait_for(lambda: description.get_subscription_count() and loading.get_subscription_count(), 'connections')
        rest()
        description.publish(String(data=scheduled_to_yaml(schedule())))
        has_model = 'has_model_pitch'
        wait_for(lambda: bench.statuses['predictor: forecast'][2].get(has_model) == 'True', 'model')
        loading.publish(Float64(data=0.12))
        rest()
        assert count('loading-advice') == 0
        loading.publish(Float64(data=0.5))
        wait_for(lambda: count('loading-advice') == 1, 'advice about a draft beyond the schedule')
        loading.publish(Float64(data=-1.0))
        wait_for(lambda: count('bad-loading') == 1, 'count of a draft that is none')
        before = bench.counts('predictor')['used']
        rest()
        wait_for(lambda: bench.counts('predictor')['used'] >= before + 100, 'samples used')
        (refused,) = bench.set_parameters('predictor', loading=-2.0)
        assert 'loading' in refused
        assert bench.set_parameters('predictor', loading=0.2) == []
    bench.close()
