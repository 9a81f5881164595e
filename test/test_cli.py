"""The command line: what it prints, what it writes, and how it answers bad input."""

import json
import re

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.cli import replay
from swath_sysid.cli.main import VERBS, main
from swath_sysid.common.sentences import FLAGS, with_flags
from swath_sysid.formats.model_file import read_model
from swath_sysid.formats.reading import read_trial
from swath_sysid.share import share_folder


def released(folder, *options):
    path = folder / 'pitch_6deg.csv'
    release = ['--hull', 'swath-pitch', '--initial-angle-deg', '6', '--hold', '1']
    assert main(['simulate', *release, *options, '--output', str(path)]) == 0
    return path


@pytest.fixture(scope='module')
def trial_file(tmp_path_factory):
    return released(tmp_path_factory.mktemp('trials'), '--rate', '25')


@pytest.fixture(scope='module')
def dense_file(tmp_path_factory):
    """Of enough samples for an equation to be told from another."""
    return released(tmp_path_factory.mktemp('dense'), '--rate', '50')


def table(path, header, rows):
    path.write_text(header + '\n' + ''.join(','.join(map(str, row)) + '\n' for row in rows))
    return path


def last_line(text):
    return text.strip().splitlines()[-1]


def test_the_bare_command_names_the_verbs(capsys):
    with pytest.raises(SystemExit):
        main([])
    assert set(VERBS) <= set(capsys.readouterr().out.split())


def test_identify_prints_one_json_object(trial_file, capsys):
    assert main(['identify', str(trial_file), '--axis', 'pitch', '--equation', 'swath-pitch-2', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    names = 'trim_rad damping_ratio r2 rmse generations evaluations wall_s'
    assert set(names.split()) <= set(found)
    assert (found['equation'], found['axis'], found['objective']['name']) == ('swath-pitch-2', 'pitch', 'simulation')
    assert found['ratios']['b1']['value'] == pytest.approx(1.533, rel=0.05)
    assert found['ratios']['r1']['std'] > 0
    assert found['natural_period_s'] == pytest.approx(1.975, rel=0.01)
    start, end = found['segment_s']
    assert 0.9 <= start < 1.3 < end
    assert all(set(w) == {'code', 'message'} for w in found['warnings'])


def test_identify_writes_model_and_picture_and_says_the_published_form(trial_file, tmp_path, capsys):
    model, picture = tmp_path / 'model.yaml', tmp_path / 'fit.png'
    command = ['identify', str(trial_file), '--equation', 'swath-pitch-2', '--inertia', '0.09']
    assert main([*command, '--output', str(model), '--plot', str(picture)]) == 0
    words = capsys.readouterr().out
    assert 'pitch: swath-pitch-2' in words
    assert 'published form: inertia 0.09' in words
    identified = read_model(model)['pitch']
    assert identified.model.terms['r1'] == pytest.approx(10.12, rel=0.02)
    (source,) = identified.provenance['sources']
    assert source['file'] == str(trial_file)
    assert len(source['sha256']) == 64
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert (
        main(['simulate', '--model', str(model), '--initial-angle-deg', '3', '--output', str(tmp_path / 'a.csv')]) == 0
    )
    assert 'true ratios b1' in capsys.readouterr().out


def test_one_step_objective_and_preset(dense_file, capsys):
    command = ['identify', str(dense_file), '--objective', 'one-step', '--preset', 'swath-pitch', '--json']
    # the published objective is biased by noise so far that the model does not follow the motion
    assert main([*command, '--equation', 'swath-pitch-1', '--generations', '300']) == 1
    found = json.loads(capsys.readouterr().out)
    assert 'poor-fit' in [w['code'] for w in found['warnings']]
    assert found['generations'] == 300
    assert found['evaluations'] == 200 + 299 * 190
    assert found['search']['value'] == pytest.approx(found['objective']['value'], rel=1e-4)


@pytest.mark.slow
def test_compare_ranks_and_chooses_the_same_in_one_process_and_two(dense_file, tmp_path, capsys):
    names = 'linear,swath-pitch-3'
    command = ['compare', str(dense_file), '--equations', names]
    assert main([*command, '--jobs', '1', '--json', '--output', str(tmp_path / 'one.yaml')]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {r['equation'] for r in found['ranked']} == set(names.split(','))
    by_name = {r['equation']: r['objective']['value'] for r in found['ranked']}
    assert found['choice'] == 'swath-pitch-3' and by_name['swath-pitch-3'] <= by_name['linear']
    assert main([*command, '--jobs', '2', '--output', str(tmp_path / 'two.yaml')]) == 0
    assert 'Choice: swath-pitch-3' in capsys.readouterr().out
    one, two = (read_model(tmp_path / f'{name}.yaml')['pitch'].model for name in ('one', 'two'))
    assert one == two and one.equation.name == 'swath-pitch-3'


def test_inspect_names_the_decay(trial_file, tmp_path, capsys):
    picture = tmp_path / 'record.png'
    assert main(['inspect', str(trial_file), '--plot', str(picture)]) == 0
    words = capsys.readouterr().out
    assert '400 samples' in words
    assert '25.0 Hz' in words
    assert 'pitch decay' in words
    assert picture.stat().st_size > 10_000
    assert main(['inspect', str(trial_file), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    (decay,) = found['axes']['pitch']['decays']
    assert decay['start_s'] == pytest.approx(1.1, abs=0.2)


@pytest.mark.parametrize('ending', ['csv', 'mcap', 'db3'])
def test_simulated_trials_read_back(ending, tmp_path):
    path = tmp_path / f'trial.{ending}'
    command = ['simulate', '--hull', 'swath-roll', '--initial-angle-deg', '3', '--noise', 'none', '--output', str(path)]
    assert main([*command, '--duration', '5', '--rate', '50', '--trim-deg', '0.5']) == 0
    roll = read_trial(path).axis('roll')
    assert roll.size == 250
    assert np.degrees(roll.angle[0]) == pytest.approx(3.5)


@pytest.mark.parametrize('name', EQUATIONS)
def test_every_equation_can_be_simulated_and_identified(name, tmp_path, capsys):
    path = tmp_path / 'trial.csv'
    release = ['--equation', name, '--initial-angle-deg', '2', '--rate', '50', '--noise', 'none']
    assert main(['simulate', *release, '--output', str(path)]) == 0
    named = ['--equation', name, '--objective', 'one-step', '--generations', '20', '--json']
    assert main(['identify', str(path), *named]) == 0
    assert json.loads(capsys.readouterr().out.partition('\n')[2])['equation'] == name


def test_simulate_with_given_ratios(tmp_path, capsys):
    command = ['simulate', '--equation', 'b1|r1', '--initial-angle-deg', '5', '--output', str(tmp_path / 'a.csv')]
    assert main([*command, '--ratio', 'b1=0.4', '--ratio', 'r1=9', '--axis', 'roll']) == 0
    assert 'of roll, b1|r1, true ratios b1 0.4, r1 9' in capsys.readouterr().out
    assert main([*command, '--ratio', 'b1=0.4']) == 2
    assert 'give --ratio r1=VALUE too' in capsys.readouterr().err


RAMP = [(k / 100, 1.0) for k in range(2000)]


def bad_files(folder):
    """Name to file of everything that is not a trial."""
    wave = [(k / 10, 5 * np.sin(k / 10) + 4 * np.sin(0.83 * k / 10 + 1)) for k in range(6000)]
    (folder / 'folder').mkdir()
    (folder / 'empty.csv').touch()
    (folder / 'text.txt').write_text('the quick brown fox\njumps over\n')
    (folder / 'binary.csv').write_bytes(bytes(range(256)) * 40)
    table(folder / 'nan.csv', 'time_s,roll_deg', [(k / 100, 'nan') for k in range(500)])
    table(folder / 'two.csv', 'time_s,roll_deg', RAMP[:2])
    table(folder / 'constant.csv', 'time_s,roll_deg', RAMP)
    table(folder / 'waves.csv', 'time_s,roll_deg', wave)
    table(folder / 'other.csv', 'zeit,winkel', RAMP)
    return sorted(folder.iterdir())


@pytest.mark.parametrize('verb', ['identify', 'compare'])
def test_bad_files_are_answered_with_one_sentence(verb, tmp_path, capsys):
    for path in [*bad_files(tmp_path), tmp_path / 'absent.csv']:
        assert main([verb, str(path)]) == 2, path
        error = capsys.readouterr().err
        assert last_line(error).startswith(f'swath-sysid {verb}: '), path
        assert 'Traceback' not in error


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--axis', 'yaw'], "no axis 'yaw'"),
        (['--equation', 'swath-pitch-99'], "no equation 'swath-pitch-99'"),
        (['--generations', '-3'], '--generations: cannot be -3: give 0 to 100000'),
        (['--generations', 'x'], "'x' is not a whole number"),
        (['--population', '1'], 'population must be a whole number from 8'),
        (['--seed', '-1'], 'cannot be -1: give 0 to 2147483647'),
        (['--start', '9', '--end', '3'], 'start must lie before the end'),
        (['--start', '100'], 'the record runs from'),
        (['--start', 'nan'], 'nan'),
        (['--search', 'pso', '--preset', 'swath-roll'], 'genetic algorithm'),
        (['--mass', '30'], 'give both --mass and --metacentric-height'),
        (['--inertia', '-1'], 'greater than zero'),
        (['--plot', 'fit.bmp'], '.png'),
        (['--output', 'absent/model.yaml'], 'cannot write'),
        (['--topic', '/imu'], 'has no topic'),
    ],
)
def test_bad_options_are_answered_with_one_sentence(options, words, trial_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['identify', str(trial_file), *options]) == 2
    assert words in last_line(capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


def test_flags_that_advice_is_given_exist(capsys):
    for words in (['identify'], ['simulate'], ['manoeuvre', 'identify'], ['export'], ['campaign']):
        with pytest.raises(SystemExit):
            main([*words, '--help'])
    known = capsys.readouterr().out
    for code, flags in FLAGS.items():
        assert with_flags(code, 'look again') == f'look again ({flags})'
        assert all(flag in known for flag in re.findall('--[a-z-]+', flags)) and '--' in flags
    assert with_flags('spikes', 'look again') == 'look again'


class StoppedReplay:
    """A node that notes what is asked of it."""

    advice, unknown_types, outlets, sent = (), (), {'/imu/data': None}, 0

    def __init__(self):
        self.asked = []

    def __getattr__(self, name):
        return lambda *_: self.asked.append(name) or 0


@pytest.mark.parametrize('is_stopped', [False, True])
def test_a_replay_that_is_stopped_does_not_wait_for_its_messages(is_stopped):
    node = StoppedReplay()
    replay._play(node, 1, lambda: is_stopped)
    assert ('wait_until_received' in node.asked) is not is_stopped and node.asked[-1] == 'destroy_node'


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--hull', 'titanic', '--initial-angle-deg', '5'], "no hull 'titanic'"),
        (['--hull', 'swath-roll', '--initial-angle-deg', '-30'], 'does not return'),
        (['--hull', 'swath-roll', '--initial-angle-deg', '3', '--rate', '0'], 'greater than zero'),
        (['--hull', 'swath-roll', '--initial-angle-deg', '3', '--duration', '1e9'], 'cannot be simulated'),
        (['--hull', 'swath-roll', '--initial-angle-deg', '3', '--rate-noise', '-1'], 'noise cannot be negative'),
        (['--hull', 'swath-roll', '--initial-angle-deg', '3', '--ratio', 'b1=2'], '--ratio goes with --equation'),
        (['--equation', 'linear', '--initial-angle-deg', '3', '--ratio', 'b1:2'], 'is not NAME=VALUE'),
        (['--model', 'absent.yaml', '--initial-angle-deg', '3'], 'cannot read the model file'),
    ],
)
def test_what_cannot_be_simulated_is_said(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['simulate', *options, '--output', 'a.csv']) == 2
    assert words in last_line(capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('verb', ['identify', 'compare', 'forecast'])
def test_a_record_that_contradicts_itself_is_refused_with_its_cure(verb, trial_file, tmp_path, capsys):
    wrong = tmp_path / 'wrong.csv'
    wrong.write_text(trial_file.read_text().replace('pitch_rate_rad_s', 'pitch_rate_deg_s'))
    assert main([verb, str(wrong), *(['--output', str(tmp_path / 'm.yaml')] if verb == 'identify' else [])]) == 2
    told = capsys.readouterr().err
    assert 'times the derivative of the pitch angle' in told and 'Traceback' not in told
    assert not (tmp_path / 'm.yaml').exists()


def test_a_forecast_of_slow_samples_says_which_leads_were_not_measured(tmp_path, capsys):
    """The pitch of noise has no limit where roll alone is scored, and no flag begins with a digit."""
    time = np.arange(240.0)
    rows = zip(time, 5.0 * np.sin(time / 2.1) + np.sin(time / 1.7), 1e-3 * np.sin(7.0 * time), strict=True)
    path = table(tmp_path / 'ship.csv', 'time_s,roll_deg,pitch_deg', rows)
    assert main(['forecast', str(path), '--leads', '0.5,2', '--axis', 'roll']) == 0
    out, err = capsys.readouterr()
    assert '[leads-between-samples]' in err and 'motion 0.5 s ahead' in err
    assert 'pitch' not in out and ' = VAR(60)' in out
    assert main(['forecast', str(path), '--leads', '-1,2']) == 2
    assert 'cannot be -1: give 0.01 to 120 s' in last_line(capsys.readouterr().err)


@pytest.mark.parametrize(('options', 'code'), [((), 'forced-motion'), (('--end', '120'), 'too-few-waves')])
def test_inspect_promises_of_waves_what_identify_keeps(options, code, capsys):
    words = [str(share_folder() / 'records' / 'morro_buoy.csv'), '--axis', 'roll', *options]
    assert main(['inspect', *words]) == 0
    told = capsys.readouterr().out
    assert f'[{code}]' in told
    if options:
        assert main(['identify', *words, '--at-sea']) == 2
        assert capsys.readouterr().err.partition(': ')[2].strip() in told


def test_inspect_tells_what_contradicts_itself(trial_file, tmp_path, capsys):
    wrong = tmp_path / 'wrong.csv'
    wrong.write_text(trial_file.read_text().replace('# frame: flu', '# frame: frd'))
    assert main(['inspect', str(wrong), '--json']) == 0
    (told,) = json.loads(capsys.readouterr().out)['warnings']
    assert told['code'] == 'axes-of-sensor' and 'set frame to flu' in told['message']
    assert main(['identify', str(wrong), '--frame', 'flu']) == 0
