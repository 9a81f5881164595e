"""Forecasts against test/data/stored_results.json; ``python test/test_stored_results.py`` stores them."""

import json
import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from bag_messages import STORE

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.main import main
from swath_sysid.formats.bags import opened_bag
from swath_sysid.formats.csv_trials import write_csv

STORED = Path(__file__).parent / 'data' / 'stored_results.json'
EVERY = 150
"""Messages from one that is stored to the next."""

CLOSE = 1e-7
"""Relative, and in rad: where a fit ends depends on rounding, with and without numba by 8e-9."""

HULL = hull_named('swath-roll').model


def a_record():
    """A release and the waves after it, 40 Hz for 70 s."""
    fall = simulated_trial(HULL, math.radians(6.0), 20.0, 40.0, SensorNoise(0.0005, 0.003), seed=5, hold=3.0)
    random = np.random.default_rng(6)
    time = np.arange(2800) / 40.0
    motion = np.zeros((4, time.size))
    frequencies, phases = random.uniform(1.5, 4.0, 12), random.uniform(0.0, 6.28, (12, 2))
    for frequency, size, phase in zip(frequencies, random.uniform(0.0, 0.02, (12, 2)), phases, strict=True):
        angle = frequency * time[:, None] + phase
        motion += np.concatenate([size * np.sin(angle), size * frequency * np.cos(angle)], axis=1).T
    motion *= np.clip((time - 24.0) / 4.0, 0.0, 1.0)
    motion += random.normal(0.0, 1.0, motion.shape) * [[0.0005], [0.0005], [0.003], [0.003]]
    motion[::2, : fall.time.size] += fall.roll, fall.roll_rate
    return Trial(time, roll=motion[0], pitch=motion[1], roll_rate=motion[2], pitch_rate=motion[3])


def numbers_in(value):
    """Every number of a decoded message, in the order of its fields."""
    if isinstance(value, str | bytes):
        return []
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [number for item in value for number in numbers_in(item)]
    if hasattr(value, '__dataclass_fields__'):
        return [number for name in value.__dataclass_fields__ for number in numbers_in(getattr(value, name))]
    return [value]


def played_through(folder):
    """Topic to the number of its messages and the numbers in some of them."""
    write_csv(folder / 'record.csv', a_record())
    assert main(['play-through', str(folder / 'record.csv'), '--output', str(folder / 'out.mcap')]) == 0
    found = {}
    with opened_bag(folder / 'out.mcap') as (readers, _):
        for connection, _, raw in (m for reader in readers for m in reader.messages(reader.connections)):
            if connection.topic == '/forecast/outlook':
                continue  # it repeats two others
            topic = found.setdefault(connection.topic, {'count': 0, 'some': []})
            if topic['count'] % EVERY == 0 and connection.topic != '/motion/window':
                message = STORE.deserialize_cdr(raw, connection.msgtype)
                if connection.topic.endswith('horizon'):
                    message.points = message.points[1::25]  # the first is the sample
                topic['some'].append([*numbers_in(message)])
            topic['count'] += 1
    return found


@pytest.mark.long
def test_a_record_played_through_gives_the_stored_messages(tmp_path):
    stored, found = json.loads(STORED.read_text())['played'], played_through(tmp_path)
    counts, expected = ({topic: kept['count'] for topic, kept in each.items()} for each in (found, stored))
    assert counts == expected
    for topic, kept in stored.items():
        for one, other in zip(found[topic]['some'], kept['some'], strict=True):
            np.testing.assert_allclose(one, other, rtol=CLOSE, atol=CLOSE, err_msg=topic)


def store(name, results_in):
    """Replace one of the stored results by what a function makes in a folder."""
    stored = json.loads(STORED.read_text())
    with tempfile.TemporaryDirectory() as folder:
        stored[name] = results_in(Path(folder))
    STORED.write_text(json.dumps(stored, indent=None))


if __name__ == '__main__':
    store('played', played_through)
