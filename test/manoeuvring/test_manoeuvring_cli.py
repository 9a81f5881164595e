"""The verb ``manoeuvre`` as a user runs it."""

import argparse
import json

import numpy as np
import pytest
from bag_messages import STORE
from manoeuvring_runs import copy_bag
from test_cli import completed

from swath_sysid.cli import play_through
from swath_sysid.cli.flags import add_arguments
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import opened_bag
from swath_sysid.manoeuvring.cli import manoeuvre
from swath_sysid.manoeuvring.formats.bags import holds_manoeuvres, read_manoeuvring_bag


def swath(*words):
    parser = argparse.ArgumentParser()
    add_arguments(parser, 'manoeuvre')
    return manoeuvre.run(parser.parse_args([str(word) for word in words]))


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('manoeuvres')
    assert swath('simulate', '--model', 'wamv-vrx-old', '--test', 'programme', '--output', folder / 'runs') == 0
    return folder


@pytest.fixture(scope='module')
def model(folder):
    runs = [folder / 'runs' / f'{n}.csv' for n in ('zigzag_20', 'mixed')]
    given = ('--validate', folder / 'runs/turns_fast.csv', *'--mass 180 --generations 3 --population 10'.split())
    outputs = ('--output', folder / 'model.yaml', '--plot', folder / 'plots')
    assert swath('identify', *runs, *given, *outputs) == 0
    return folder / 'model.yaml'


@pytest.mark.long
def test_identify_json(folder, capsys):
    runs = [folder / 'runs' / f'{n}.csv' for n in ('zigzag_20', 'mixed', 'turns_slow')]
    capsys.readouterr()
    assert swath('identify', *runs, '--mass', 180, '--json', '--generations', 0) == 0
    data = json.loads(capsys.readouterr().out)
    assert set(data['derivatives']['Nr']) >= {'value', 'std', 'prime'}
    assert data['derivatives']['Nr']['value'] == pytest.approx(-400, rel=0.05)
    for channel in ('surge', 'sway', 'yaw_rate'):
        assert set(data['r2'][channel]) == {'identification', 'validation'}
    assert set(data['position_error_m']) == set(data['heading_error_rad']) == {'5', '10', '20'}
    assert data['r2']['yaw_rate']['validation'] > 0.95
    assert len(data['runs']['validation']) == 1


@pytest.mark.release
def test_identified_model_forecasts_and_simulates(folder, model, capsys):
    names = {path.name for path in (folder / 'plots').iterdir()}
    assert {'derivatives.png', 'residuals.png', 'validation_01_turns_fast.png'} <= names
    capsys.readouterr()
    given = ('--train', folder / 'runs/mixed.csv', '--model', model, '--json', '--leads', '1,5')
    assert swath('forecast', folder / 'runs/zigzag_10.csv', *given, '--plot', folder / 'forecast.png') == 0
    data = json.loads(capsys.readouterr().out)
    assert set(data['rmse']) == {'model', 'constant-velocity', 'constant-turn-rate', 'arx'}
    assert data['rmse']['model']['heading_rad']['1'] < data['rmse']['constant-turn-rate']['heading_rad']['1']
    assert (folder / 'forecast.png').is_file()
    assert swath('forecast', folder / 'runs/zigzag_10.csv', '--model', model, '--leads', '1') == 0
    assert 'position' in capsys.readouterr().out
    outputs = ('--plot', folder / 'spiral.png', '--output', folder / 'spiral.mcap')
    assert swath('simulate', '--model', model, '--test', 'spiral', '--json', *outputs) == 0
    assert json.loads(capsys.readouterr().out)['numbers']
    assert (folder / 'spiral.mcap').stat().st_size > 1000
    assert swath('simulate', '--hull', 'wamv-vrx-new', '--test', 'zigzag') == 0
    assert 'first overshoot' in capsys.readouterr().out


@pytest.mark.release
def test_play_through_is_repeatable_and_right(folder, model, capsys):
    bag = folder / 'circle.mcap'
    swath('simulate', '--hull', 'wamv-vrx-old', '--test', 'turning-circle', '--output', bag)
    outputs = [folder / name for name in ('first.mcap', 'second.mcap')]
    for output in outputs:
        assert swath('play-through', bag, '--model', model, '--output', output, '--rate', 1, '--leads', '2,5') == 0
    assert 'forecasts' in capsys.readouterr().out
    contents = []
    for output in outputs:
        with opened_bag(output) as ((reader,), _):
            contents.append([(c.topic, t, bytes(raw)) for c, t, raw in reader.messages(reader.connections)])
    messages, again = contents
    assert messages == again
    topics = {f'/manoeuvring/{name}' for name in ('forecast', 'lead_2_0s', 'lead_5_0s')}
    assert {topic for topic, _, _ in messages} == topics
    trial, missed = read_manoeuvring_bag(bag), []
    for topic, stamp, raw in messages:
        if topic.endswith('5_0s') and 20e9 < stamp < (trial.time[-1] - 5) * 1e9:
            found = STORE.deserialize_cdr(raw, 'nav_msgs/msg/Odometry')
            at = found.header.stamp.sec + 1e-9 * found.header.stamp.nanosec
            place = found.pose.pose.position
            east, north = (np.interp(at, trial.time, known) for known in (trial.x, trial.y))
            missed.append(np.hypot(place.x - east, place.y - north))
    assert len(missed) > 10
    assert max(missed) < 1.0


@pytest.mark.parametrize(
    'words, match',
    [
        (('play-through', '{runs}/mixed.csv', '--output', 'x.mcap'), 'one rosbag2 bag'),
        (('identify', 'missing.csv'), 'file not found'),
        (('identify', '{runs}/mixed.csv', '{runs}/mixed.csv'), 'given twice'),
        (('identify', '{runs}'), 'is a folder'),
        (('identify', '{runs}/mixed.csv', '--fix', 'Xu'), 'NAME=VALUE'),
        (('identify', '{runs}/mixed.csv', '--towards', 'Xu=1'), 'NAME=VALUE:STD'),
        (('identify', '{runs}/mixed.csv', '--terms', 'Xq'), 'no manoeuvring parameter'),
        (('identify', '{runs}/mixed.csv', '--no-validation', '--validate', '{runs}/reverse.csv'), 'not both'),
        (('simulate', '--model', 'nothing.yaml', '--test', 'speed'), 'cannot read'),
        (('simulate', '--hull', 'wamv-vrx-old', '--test', 'programme'), 'name a folder'),
        (('simulate', '--hull', 'wamv-vrx-old', '--test', 'speed', '--output', 'x.txt'), 'neither .csv'),
        (('simulate', '--hull', 'wamv-vrx-old', '--test', 'zigzag', '--base', '2'), 'within 0 and 1'),
        (('simulate', '--hull', 'wamv-vrx-old', '--test', 'zigzag', '--current', '1', '0'), 'for the programme'),
        (('forecast', '{runs}/mixed.csv', '--model', '{runs}/mixed.csv'), 'not a manoeuvring model|not YAML'),
    ],
)
def test_one_clear_sentence(folder, words, match):
    with pytest.raises(InputError, match=match):
        swath(*(word.format(runs=folder / 'runs') for word in words))


@pytest.mark.long
def test_a_yaw_rate_that_repeats_itself_holds_too_few_readings(tmp_path):
    rows = [
        f'{0.1 * at:.1f},{turn},{0.7 - turn},{0.1 * turn}'
        for at in range(1200)
        for turn in (0.2 + 0.3 * (at // 100 % 2),)
    ]
    (tmp_path / 'a.csv').write_text('\n'.join(['time_s,port_command,starboard_command,yaw_rate_rad_s', *rows]))
    with pytest.raises(InputError, match='8 readings'):
        swath('identify', tmp_path / 'a.csv', '--mass', 20, '--generations', 2, '--population', 8)


def test_a_slip_is_one_sentence_that_says_what_is_meant_and_tasks_are_completed(tmp_path, capsys):
    for words, said in (
        ('manoeuvre simulat', "there is no task 'simulat' (did you mean simulate?)"),
        ('manoeuvre simulate --hull wamv-vrx-old --test turning-circle --noise 1', '--noise needs 2 values'),
    ):
        assert main(words.split()) == 2
        told = capsys.readouterr().err
        assert said in told and told.count('\n') == 1
    assert completed('swath-sysid manoeuvre sim', tmp_path) == ['simulate']


@pytest.mark.release
def test_play_through_of_a_bag_without_imu_plays_the_manoeuvres(folder, tmp_path, capsys):
    bag = tmp_path / 'zigzag.mcap'
    assert swath('simulate', '--hull', 'wamv-vrx-old', '--test', 'zigzag', '--output', bag) == 0
    assert holds_manoeuvres(bag) == (True, True)
    blind = tmp_path / 'blind'
    copy_bag(bag, blind, lambda *sent: [] if sent[1].endswith('Imu') else [sent])
    parser = argparse.ArgumentParser()
    add_arguments(parser, 'play-through')
    assert holds_manoeuvres(blind) == (True, False)
    both = [tmp_path / 'out.mcap', tmp_path / 'again' / 'out.mcap']
    both[1].parent.mkdir()
    assert play_through.run(parser.parse_args([str(blind), '--output', str(both[0])])) == 0
    assert 'forecasts of surge, sway and yaw' in capsys.readouterr().out
    assert swath('play-through', blind, '--output', both[1]) == 0
    assert both[0].read_bytes() == both[1].read_bytes()
    assert play_through.run(parser.parse_args([str(bag), '--output', str(tmp_path / 'attitude.mcap')])) == 0
    assert 'swath-sysid manoeuvre play-through' in capsys.readouterr().err
