"""Outputs are looked at before any work: nothing that is read or was measured is replaced."""

import os
import socket
from pathlib import Path

import pytest

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import replacing
from swath_sysid.formats.outputs import Output, check_outputs, refuse_inputs_among


def contents(folder):
    return {path: path.read_bytes() for path in Path(folder).rglob('*') if path.is_file()}


COMMANDS = [
    'identify {0}/trial.csv --output {0}/trial.csv',
    'identify {0}/../{1}/trial.csv --output link.csv',
    'identify {0}/trial.csv --output a.png --plot ./b/../a.png',
    'identify {0}/trial.csv --output ',
    'identify {0}/trial.csv --output {0}',
    'identify {0}/trial.csv --output /dev/null',
    'identify {0}/trial.csv --output pipe',
    'identify {0}/trial.csv --output absent/model.yaml',
    'identify {0}/trial.csv --output nul\0name',
    'identify {0}/trial.csv --output loop',
    'identify {0}/trial.csv --output {long}',
    'identify {0}/bag --output {0}/bag/model.yaml',
    'identify {0}/trial.csv --plot fit.bmp',
    'identify {0}/trial.csv --output model.txt',
    'identify {0}/trial.csv --output model',
    'simulate --hull swath-roll --initial-angle-deg 3 --output trial.foo',
    'compare {0}/trial.csv --output {0}/trial.csv',
    'inspect {0}/trial.csv --plot {0}/trial.csv',
    'simulate --model {0}/model.yaml --initial-angle-deg 3 --output {0}/model.yaml',
    'play-through {0}/trial.mcap --output {0}/trial.mcap',
    'play-through {0}/bag --output {0}/bag/bag.mcap',
]


def refusing(commands):
    """A test that these are refused; {0} stands for the folder ``measured``."""

    @pytest.mark.parametrize('command', commands)
    def refused(command, measured, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        os.symlink(measured / 'trial.csv', 'link.csv')
        os.symlink('loop', 'loop')
        os.mkfifo('pipe')
        os.mkdir('b')
        words = [w.format(measured, measured.name, long='x' * 300) for w in command.split(' ')]
        before, here = contents(measured), sorted(os.listdir())
        assert main(words) == 2
        error = capsys.readouterr().err.strip()
        assert '\n' not in error.partition('swath-sysid ')[2] and 'Traceback' not in error
        assert contents(measured) == before
        assert sorted(os.listdir()) == here

    return refused


test_harmful_outputs_are_refused_and_nothing_changes = refusing(COMMANDS)


def test_symbolic_links_are_followed_and_a_file_takes_its_name_only_when_whole(tmp_path):
    (tmp_path / 'far').mkdir()
    target, link = tmp_path / 'far' / 'model.yaml', tmp_path / 'model.yaml'
    target.write_text('old')
    link.symlink_to(target)
    check_outputs([Output('--output', link), Output('--none', None)], [tmp_path / 'trial.csv', None])
    with replacing(link) as temporary:
        temporary.write_text('new')
        assert target.read_text() == 'old' and temporary.name == target.name
    assert link.is_symlink() and target.read_text() == 'new'
    target.unlink()
    with replacing(link) as temporary:
        temporary.write_text('later')
    assert link.is_symlink() and target.read_text() == 'later'


def test_hard_links_recordings_and_sockets_are_seen(measured, tmp_path):
    first, second = tmp_path / 'a.csv', tmp_path / 'b.csv'
    first.write_text('x')
    os.link(first, second)
    with pytest.raises(InputError, match='is read by this command'):
        check_outputs([Output('--output', second)], [first])
    with pytest.raises(InputError, match='both name'):
        check_outputs([Output('--output', first), Output('--plot', second)])
    with pytest.raises(InputError, match='is a recording, which it would replace'):
        check_outputs([Output('--output', measured / 'trial.csv')])
    with pytest.raises(InputError, match='is read where .* is to be written'):
        refuse_inputs_among([second], [first])
    with pytest.raises(InputError, match='is not a folder'):
        check_outputs([Output('--output', first, is_folder=True)])
    check_outputs([Output('--output', tmp_path / 'new' / 'folder', is_folder=True)], [first])
    with socket.socket(socket.AF_UNIX) as endpoint:
        endpoint.bind(str(tmp_path / 's'))
        with pytest.raises(InputError, match='socket'):
            check_outputs([Output('--output', tmp_path / 's')])


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_folders_that_may_not_be_written_to_are_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match='is not writable'):
        check_outputs([Output('--output', tmp_path / 'a.yaml')])


@pytest.mark.parametrize('place', ['absent/model.yaml', 'file/model.yaml', ''])
def test_a_place_or_a_block_that_writes_nothing_is_one_sentence(tmp_path, place, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'file').touch()
    with pytest.raises(InputError), replacing(place) as temporary:
        temporary.write_text('')
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
