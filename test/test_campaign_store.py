"""The store of results: whole or not there, the same to the last bit, one process at a time."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.campaign.result_store import ResultStore, key_of
from swath_sysid.common.errors import InputError


@pytest.fixture
def store(tmp_path):
    return ResultStore(tmp_path / 'results')


def test_results_come_back_bit_by_bit(store):
    values = np.random.default_rng(1).normal(size=100) * 10.0 ** np.arange(-50, 50)
    result = {'values': values.tolist(), 'none': None, 'words': 'ψ', 'inf': math.inf}
    store.put('ab' * 32, result)
    assert store.get('ab' * 32) == result
    assert math.isnan((store.put('cd' * 32, [math.nan]), store.get('cd' * 32))[1][0])


def test_what_is_not_there_or_torn_is_none(store, tmp_path):
    assert store.get('00' * 32) is None
    store.put('00' * 32, [1, 2, 3])
    (file,) = (tmp_path / 'results').rglob('*.json')
    file.write_text('[1, 2')
    assert store.get('00' * 32) is None


def test_leftovers_of_a_killed_process_are_cleared(store, tmp_path):
    store.put('ab' * 32, [1])
    leftover = tmp_path / 'results' / 'ab' / '.writing-xyz'
    leftover.mkdir()
    (leftover / 'half.json').write_text('[1')
    with store.locked():
        assert not leftover.exists()
    assert store.get('ab' * 32) == [1]


def test_one_process_at_a_time(store, tmp_path):
    code = (
        'import sys\nfrom swath_sysid.campaign.result_store import ResultStore\n'
        'with ResultStore(sys.argv[1]).locked(): print("alone")\n'
    )
    command = [sys.executable, '-c', code, str(tmp_path / 'results')]
    with store.locked():
        assert 'another campaign is writing' in subprocess.run(command, capture_output=True, text=True).stderr
    assert subprocess.run(command, capture_output=True, text=True).stdout == 'alone\n'


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='cannot make the folder'):
        ResultStore(tmp_path / 'file' / 'results')


@given(st.lists(st.one_of(st.text(), st.floats(allow_nan=False), st.integers(), st.none()), min_size=1), st.data())
def test_a_key_tells_whatever_differs(parts, data):
    other = list(parts)
    index = data.draw(st.integers(0, len(parts) - 1))
    other[index] = (parts[index], 'more')
    assert key_of(*parts) == key_of(*parts)
    assert key_of(*parts) != key_of(*other)
    assert key_of({'b': 1, 'a': parts}) == key_of({'a': parts, 'b': 1})
