"""Tables of a campaign against test/data/stored_results.json; ``PYTHONPATH=test python`` with this file stores them."""

import csv
import io
import json
import math

import pytest
from test_stored_results import HULL, STORED, store

from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.common.processes import SerialExecutor
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.report.tables import table_as_csv
from swath_sysid.tank.campaign.manifest import read_manifest
from swath_sysid.tank.campaign.run import run_campaign
from swath_sysid.tank.campaign.work import ResultStore
from swath_sysid.tank.report.campaign_report import every_table

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


def tables_of_a_campaign(folder):
    """Name to rows of cells of the tables of a small campaign."""
    for seed, (angle, repeat) in enumerate((a, r) for a in (4, 8) for r in (1, 2)):
        made = simulated_trial(HULL, math.radians(angle), 12.0, 50.0, SensorNoise(), seed)
        write_csv(folder / f'roll_{angle}deg_repeat{repeat}.csv', made)
    (folder / 'campaign.yaml').write_text(MANIFEST)
    outcome = run_campaign(read_manifest(folder / 'campaign.yaml'), ResultStore(folder / 'results'), SerialExecutor())
    return {
        table.name: list(csv.reader(io.StringIO(table_as_csv(table))))
        for table in every_table(outcome)
        if table.name not in TRACES_OF_FILES
    }


@pytest.mark.release
def test_a_campaign_gives_the_stored_tables(tmp_path):
    pytest.importorskip('numba', reason='a fit without it ends elsewhere by 5e-8, which the scatter magnifies')
    stored, found = json.loads(STORED.read_text())['tables'], tables_of_a_campaign(tmp_path)
    assert list(found) == list(stored)
    for name, rows in stored.items():
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
    store('tables', tables_of_a_campaign)
