"""The identifier on a window of waves, over DDS: on demand, and never in place of a decay's model."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy')

from craft_at_sea import known_sea  # noqa: E402
from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import Bench, running, settings, start_together, wait_for  # noqa: E402

from swath_sysid.attitude.hull.catalogue import EQUATIONS, hull_named  # noqa: E402
from swath_sysid.attitude.hull.decay_model import DecayModel  # noqa: E402
from swath_sysid.attitude.hull.identified_model import IdentifiedModel  # noqa: E402
from swath_sysid.attitude.identification.at_sea import is_at_sea  # noqa: E402
from swath_sysid.formats.model_file import model_from_yaml, read_model, write_model  # noqa: E402

pytestmark = pytest.mark.dds

LINEAR = DecayModel.from_terms(EQUATIONS['linear'], {'b1': 0.5, 'r1': 6.25}, axis='roll')
RATE_HZ, DURATION = 10, 240.0


@pytest.fixture(scope='module')
def readings():
    """A craft that rolls in a beam sea."""
    sea = known_sea(LINEAR, [6], 1.4, np.radians(2.0), DURATION, interval=1.0 / RATE_HZ)
    noise = np.random.default_rng(1).normal(size=(sea.time.size, 2)) * (1e-3, 5e-3)
    motion = np.column_stack([sea.angle[:, 0], sea.rate[:, 0]]) + noise
    return [
        reading(EPOCH_NS + k * 10**9 // RATE_HZ, roll=angle, roll_rate=rate)
        for k, (angle, rate) in enumerate(motion.tolist())
    ]


def identified_in_waves(readings, model_path):
    """What the services answer after these readings, twice, with the bench that heard it."""
    bench = Bench()
    arguments = settings(f'model_path:={model_path}', 'window_s:=300.0', 'max_rate_hz:=50.0', 'window_timeout_s:=60.0')
    try:
        with running(bench, start_together(*arguments)):
            bench.settle('imu_buffer', bench.send(readings))
            first = bench.call('identifier/identify')
            if first.success:
                wait_for(lambda: bench.heard['model/description'], 'model')
            return first, bench.call('identifier/identify'), bench
    finally:
        bench.close()


@pytest.mark.long
def test_waves_are_identified_on_demand_and_only_better_models_published(readings, tmp_path):
    first, second, bench = identified_in_waves(readings, tmp_path / 'craft.yaml')
    assert first.success and first.message.startswith('roll: at sea, equivalent linear at 2'), first.message
    assert '\n' not in first.message and 'pitch: no free decay' in first.message
    identified = model_from_yaml(bench.heard['model/description'][-1].data)['roll']
    std = identified.metrics['natural_period_std_s']
    assert is_at_sea(identified) and std < 0.2
    assert identified.model.natural_period == pytest.approx(LINEAR.natural_period, abs=3.5 * std)
    assert read_model(tmp_path / 'craft.yaml')['roll'] == identified
    shares = [message.data for message in bench.heard['identifier/progress']]
    assert shares[-1] == 1.0 and len(shares) > 4
    assert not second.success and 'the current model explains the window as well' in second.message


@pytest.mark.long
def test_the_model_of_a_decay_stays_and_the_answer_says_so(readings, tmp_path):
    path = tmp_path / 'tank.yaml'
    tank = IdentifiedModel.exactly(hull_named('swath-roll').model)
    write_model(path, {'roll': replace(tank, trim_std=0.0, amplitude_range=(0.01, 0.1))})
    before = path.read_text()
    answer, _, _ = identified_in_waves(readings, path)
    assert not answer.success and 'the model of the free decay stays' in answer.message
    assert path.read_text() == before
