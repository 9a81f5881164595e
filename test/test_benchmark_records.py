"""The benchmark of measured records: its table is what the code gives, and no row looks ahead."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
TIME = 0.1 * np.arange(1500)


@pytest.fixture
def benchmark(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'benchmark')
    return importlib.import_module('records')


@pytest.fixture
def swinging(benchmark):
    """Two unequal swings, so that no cut leaves the future what it was."""
    from swath_sysid.attitude.motion.trial import Trial

    roll = 0.1 * np.sin(1.7 * TIME) + 0.03 * np.sin(2.9 * TIME)
    return Trial(TIME, roll=roll, roll_rate=np.gradient(roll, TIME))


def rows_of(table):
    """``{(warm-up, axis, forecaster): cells}`` of a table in Markdown."""
    printed = [line for line in table.splitlines() if line.startswith('| ')]
    lines = [[cell.strip() for cell in line.strip('|').split('|')] for line in printed]
    return {tuple(cells[:3]): cells[3:] for cells in lines[1:]}


@pytest.mark.long
@pytest.mark.slow
def test_the_table_of_the_ship_is_what_the_code_gives(benchmark, data_folder):
    """Anew, to a unit of the last digit that is printed; other rows may come from libraries that are not here."""
    case = benchmark.CASES['ship']
    written = (ROOT / 'docs' / 'records_benchmark.md').read_text(encoding='utf-8').split('## ')
    printed = rows_of(next(part for part in written if part.startswith(f'{case.title}\n')))
    anew = rows_of(benchmark.table_of(case, benchmark.scores_of(case, benchmark.ROWS)))
    assert set(anew) <= set(printed) and {name for _, _, name in anew} >= set(benchmark.ROWS)
    for row, cells in anew.items():
        numbers = [[float(text) for text in re.findall(r'[\d.]+', cell)] for cell in cells]
        were = [[float(text) for text in re.findall(r'[\d.]+', cell)] for cell in printed[row]]
        for new, old in zip(numbers, were, strict=True):
            assert new == pytest.approx(old, abs=0.0011), row


@pytest.mark.parametrize('name', ['persistence', 'constant rate', 'AR(40)', 'VAR(40)', 'swath_sysid'])
def test_our_rows_do_not_look_ahead(benchmark, swinging, name, monkeypatch):
    monkeypatch.setattr(benchmark, 'CHECKED', 30.0)
    benchmark.refuse_look_ahead(name, benchmark.ROWS[name], swinging, (0.5, 1.0))


@pytest.mark.parametrize('peek', [0.1, 2.0])
def test_a_row_that_looks_ahead_is_refused(benchmark, swinging, peek):
    """Whether it reads one sample too many or learns from the whole record."""

    def clairvoyant(trial, axes, stamps, leads):
        when = stamps[:, None] + peek + 0.0 * leads
        return {axis: np.interp(when, trial.time, trial.channels[axis]) for axis in axes}

    def of_the_whole(trial, axes, stamps, leads):
        return {axis: np.full((stamps.size, leads.size), trial.channels[axis].std()) for axis in axes}

    for row in (clairvoyant, of_the_whole):
        with pytest.raises(benchmark.LooksAheadError, match='use only those up to and with each stamp'):
            benchmark.refuse_look_ahead('row', row, swinging, (0.5, 1.0))


def test_a_row_is_named_by_module_and_function(benchmark, tmp_path, monkeypatch):
    (tmp_path / 'my_row.py').write_text('def forecasts(trial, axes, stamps, leads):\n    return "mine"\n')
    monkeypatch.chdir(tmp_path)
    assert benchmark.row_named('my_row:forecasts')(None, None, None, None) == 'mine'


def test_a_table_takes_its_place_in_the_page(benchmark):
    first, second = list(benchmark.CASES.values())[:2]
    page = benchmark.page_with({second.title: f'## {second.title}\n\nold\n'})
    page = benchmark.page_with({first.title: f'## {first.title}\n\nnew\n'}, page)
    assert page == benchmark.page_with({first.title: f'## {first.title}\n\nnew\n'}, page)
    assert page.startswith(benchmark.INTRODUCTION)
    assert page.index('new') < page.index('old') and page.count('## ') == 2
