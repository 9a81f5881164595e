"""Forecasts and tables against test/data/stored_results.json; ``python test/test_stored_results.py`` stores them."""

import csv
import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulated_craft import SensorNoise, simulated_trial
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.main import main
from swath_sysid.common.processes import SerialExecutor
from swath_sysid.formats.bags import opened_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.report.tables import table_as_csv
from swath_sysid.tank.campaign.manifest import read_manifest
from swath_sysid.tank.campaign.run import run_campaign
from swath_sysid.tank.campaign.work import ResultStore
from swath_sysid.tank.report.campaign_report import campaign_tables

STORED = Path(__file__).parent / 'data' / 'stored_results.json'
EVERY = 150
"""Messages from one that is stored to the next."""

CLOSE = 1e-7
"""Relative, and in rad: where a fit ends depends on rounding, with and without numba by 8e-9."""

HULL = hull_named('swath-roll').model
TRACES_OF_FILES = ('trials',)
"""Tables that hold hashes: a simulated record may differ in its last digit from one machine to the next."""

MANIFEST = """\
craft: {name: model, draft_m: 0.154}
axis: roll
equations: [linear, odd-cubic]
objectives: [simulation, one-step]
trials:
  - pattern: 'roll_{angle}deg_repeat{repeat}.csv'
"""


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
    store, found = get_typestore(Stores.ROS2_JAZZY), {}
    with opened_bag(folder / 'out.mcap') as (readers, _):
        for connection, _, raw in (m for reader in readers for m in reader.messages(reader.connections)):
            topic = found.setdefault(connection.topic, {'count': 0, 'some': []})
            if topic['count'] % EVERY == 0 and connection.topic != '/motion/window':
                message = store.deserialize_cdr(raw, connection.msgtype)
                if connection.topic.endswith('horizon'):
                    message.points = message.points[::25]
                topic['some'].append([*numbers_in(message)])
            topic['count'] += 1
    return found


def tables_of_a_campaign(folder):
    """Name to rows of cells of the tables of a small campaign."""
    for seed, (angle, repeat) in enumerate((a, r) for a in (4, 8) for r in (1, 2)):
        made = simulated_trial(HULL, math.radians(angle), 12.0, 50.0, SensorNoise(), seed)
        write_csv(folder / f'roll_{angle}deg_repeat{repeat}.csv', made)
    (folder / 'campaign.yaml').write_text(MANIFEST)
    outcome = run_campaign(read_manifest(folder / 'campaign.yaml'), ResultStore(folder / 'results'), SerialExecutor())
    return {
        table.name: list(csv.reader(io.StringIO(table_as_csv(table))))
        for table in campaign_tables(outcome)
        if table.name not in TRACES_OF_FILES
    }


@pytest.fixture(scope='module')
def stored():
    return json.loads(STORED.read_text())


def test_a_record_played_through_gives_the_stored_messages(stored, tmp_path):
    found = played_through(tmp_path)
    assert {topic: kept['count'] for topic, kept in found.items()} == {
        topic: kept['count'] for topic, kept in stored['played'].items()
    }
    for topic, kept in stored['played'].items():
        for one, other in zip(found[topic]['some'], kept['some'], strict=True):
            np.testing.assert_allclose(one, other, rtol=CLOSE, atol=CLOSE, err_msg=topic)


@pytest.mark.long
@pytest.mark.slow
def test_a_campaign_gives_the_stored_tables(stored, tmp_path):
    pytest.importorskip('numba', reason='a fit without it ends elsewhere by 5e-8, which the scatter magnifies')
    found = tables_of_a_campaign(tmp_path)
    assert list(found) == list(stored['tables'])
    for name, rows in stored['tables'].items():
        for one, other in zip(found[name], rows, strict=True):
            # the scatter of repeats about their mean, in the fourth column, shows the last digits of the repeats
            rounding = 1e-8 * abs(float(other[3])) if name.startswith('repeats') and other != rows[0] else 1e-12
            assert [comparable(cell, rounding) for cell in one] == [comparable(cell, rounding) for cell in other], name


def comparable(cell, rounding):
    """A number as equal to its like, any other cell as it is.

    Kernels are compiled for the processor at hand: R2 agrees to 2e-13 between two of them, the values of fits to 4e-9.
    """
    try:
        return pytest.approx(float(cell), rel=1e-6, abs=rounding, nan_ok=True)
    except ValueError:
        return cell


if __name__ == '__main__':
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(
            json.dumps({'played': played_through(Path(name)), 'tables': tables_of_a_campaign(Path(name))}, indent=None)
        )
