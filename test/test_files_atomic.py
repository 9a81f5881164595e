"""Nobody sees half a file."""

import os

import pytest

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing


def test_file_takes_its_name_only_when_whole(tmp_path):
    target = tmp_path / 'model.yaml'
    target.write_text('old')
    with replacing(target) as temporary:
        temporary.write_text('new')
        assert target.read_text() == 'old'
        assert temporary.name == target.name
    assert target.read_text() == 'new'
    assert os.listdir(tmp_path) == ['model.yaml']


def test_failure_leaves_all_as_it_was(tmp_path):
    target = tmp_path / 'model.yaml'
    target.write_text('old')
    with pytest.raises(KeyboardInterrupt), replacing(target) as temporary:
        temporary.write_text('half')
        raise KeyboardInterrupt
    assert target.read_text() == 'old'
    assert os.listdir(tmp_path) == ['model.yaml']


def test_folder_is_moved_as_a_whole(tmp_path):
    with replacing(tmp_path / 'bag') as temporary:
        temporary.mkdir()
        (temporary / 'a').write_text('1')
    assert (tmp_path / 'bag' / 'a').read_text() == '1'
    assert os.listdir(tmp_path) == ['bag']


def test_folder_is_never_replaced(tmp_path):
    with pytest.raises(InputError, match='exists already'), replacing(tmp_path):
        pytest.fail('no name to write under may be given')


@pytest.mark.parametrize('place', ['absent/model.yaml', 'file/model.yaml', ''])
def test_place_that_cannot_be_written_is_one_sentence(tmp_path, place, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError), replacing(place) as temporary:
        temporary.write_text('')


def test_full_disk_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match='No space left'), replacing(tmp_path / 'a.csv') as temporary:
        temporary.write_text('half')
        raise OSError(28, 'No space left on device')
    assert os.listdir(tmp_path) == []


def test_block_that_writes_nothing_is_told(tmp_path):
    with pytest.raises(InputError, match='cannot write'), replacing(tmp_path / 'a.csv'):
        pass
