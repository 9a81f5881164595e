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


@pytest.mark.parametrize('place', ['absent/model.yaml', 'file/model.yaml', ''])
def test_place_that_cannot_be_written_is_one_sentence(tmp_path, place, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError), replacing(place) as temporary:
        temporary.write_text('')


def test_block_that_writes_nothing_is_told(tmp_path):
    with pytest.raises(InputError, match='cannot write'), replacing(tmp_path / 'a.csv'):
        pass


@pytest.mark.parametrize(
    ('failure', 'told'),
    [(KeyboardInterrupt(), KeyboardInterrupt), (OSError(28, 'No space left on device'), InputError)],
)
def test_failure_leaves_all_as_it_was(tmp_path, failure, told):
    target = tmp_path / 'model.yaml'
    target.write_text('old')
    with pytest.raises(told, match='No space left' if told is InputError else None), replacing(target) as temporary:
        temporary.write_text('half')
        raise failure
    assert target.read_text() == 'old'
    assert os.listdir(tmp_path) == ['model.yaml']
