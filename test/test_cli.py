"""The command line: what it prints, what it writes, its help, and how it answers bad input."""

import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from repository import are_those

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import simulated_trial
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.flags import table_of_verbs
from swath_sysid.cli.main import VERBS, build_parser, main, module_of
from swath_sysid.cli.progress import progress_of
from swath_sysid.common.advice import FLAGS, with_flags
from swath_sysid.common.wings import wings
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.model_file import read_model
from swath_sysid.formats.reading import read_trial
from swath_sysid.nodes.parameters.table import NODES
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
    return released(tmp_path_factory.mktemp('dense'), '--rate', '50')


def table(path, header, rows):
    path.write_text(header + '\n' + ''.join(','.join(map(str, row)) + '\n' for row in rows))
    return path


def last_line(text):
    return text.strip().splitlines()[-1]


@pytest.mark.long
def test_identify_prints_one_json_object(trial_file, capsys):
    words = '--axis pitch --equation swath-pitch-2 --mass 3 --metacentric-height 0.03 --json'
    assert main(['identify', str(trial_file), *words.split()]) == 0
    found = json.loads(capsys.readouterr().out)
    names = 'trim_rad damping_ratio r2 rmse generations evaluations wall_s'
    assert set(names.split()) <= set(found)
    assert (found['equation'], found['axis'], found['objective']['name']) == ('swath-pitch-2', 'pitch', 'simulation')
    assert found['ratios']['b1']['value'] == pytest.approx(1.533, rel=0.05)
    assert found['ratios']['r1']['std'] > 0
    assert found['natural_period_s'] == pytest.approx(1.975, rel=0.01)
    inertia = 3.0 * STANDARD_GRAVITY * 0.03 / found['ratios']['r1']['value']
    assert found['published_form']['inertia'] == pytest.approx(inertia)
    start, end = found['segment_s']
    assert 0.9 <= start < 1.3 < end
    assert all(set(w) == {'code', 'message'} for w in found['warnings'])


@pytest.mark.long
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
    assert source['file'] == str(trial_file) and len(source['sha256']) == 64
    assert picture.read_bytes().startswith(b'\x89PNG')
    again = ['simulate', '--model', str(model), '--initial-angle-deg', '3', '--output', str(tmp_path / 'a.csv')]
    assert main(again) == 0
    assert 'true ratios b1' in capsys.readouterr().out


@pytest.mark.long
def test_identify_fits_every_release_of_a_record_and_names_the_decays_of_the_other_axis(tmp_path, capsys):
    parts = [
        simulated_trial(hull_named(name).model, angle, 15.0, 25.0, hold=3.0, seed=seed)
        for seed, (name, angle) in enumerate((('swath-roll', 0.1), ('swath-roll', 0.08), ('swath-pitch', 0.06)))
    ]
    channels = {name: np.concatenate([part.channels[name] for part in parts]) for name in parts[0].channels}
    write_csv(tmp_path / 'all.csv', Trial(np.arange(3 * parts[0].time.size) / 25.0, **channels))
    words = ['identify', str(tmp_path / 'all.csv'), '--equation', 'linear', '--json', '--force']
    for axis, expected in (([], {'decay-of-other-axis'}), (['--axis', 'roll'], set())):
        assert main([*words, *axis]) == 0
        found = json.loads(capsys.readouterr().out)
        assert {each['code'] for each in found['warnings']} & {'decay-of-other-axis'} == expected
        assert np.array(found['segment_s'])[:, 0] == pytest.approx([3.0, 21.0], abs=0.05)
        assert found['sources'] == [str(tmp_path / 'all.csv')] * 2


@pytest.mark.long
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


def test_progress_without_a_terminal_is_a_line_for_each_quarter(capsys):
    with progress_of('work') as progress:
        for share in range(101):
            progress(share / 100.0)
    assert capsys.readouterr().err.splitlines() == [f'work: {share}%' for share in (0, 25, 50, 75, 100)]


def test_inspect_names_the_decay(trial_file, tmp_path, capsys):
    picture = tmp_path / 'record.png'
    assert main(['inspect', str(trial_file), '--plot', str(picture)]) == 0
    words = capsys.readouterr().out
    assert [
        part
        for part in ('400 samples', '25.0 Hz', 'pitch decay', 'as: a text table', '0.00% missing')
        if part not in words
    ] == []
    assert picture.stat().st_size > 10_000
    assert main(['inspect', str(trial_file), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    (decay,) = found['axes']['pitch']['decays']
    assert decay['start_s'] == pytest.approx(1.1, abs=0.2)


def test_simulate_with_given_ratios(tmp_path, capsys):
    words = f'simulate --equation b1|r1 --ratio b1=0.4 --ratio r1=9 --axis roll --output {tmp_path}/a.db3'
    motion = '--initial-angle-deg 3 --noise none --duration 5 --rate 50 --trim-deg 0.5'
    assert main([*words.split(), *motion.split(), '--json']) == 0
    made = json.loads(capsys.readouterr().out)
    assert (made['axis'], made['ratios'], made['samples']) == ('roll', {'b1': 0.4, 'r1': 9.0}, 250)
    roll = read_trial(tmp_path / 'a.db3').axis('roll')
    assert roll.size == 250 and np.degrees(roll.angle[0]) == pytest.approx(3.5)


@pytest.mark.parametrize('verb', ['identify', 'compare'])
def test_records_without_a_decay_are_answered_with_one_sentence(verb, tmp_path, capsys):
    """Files that are no records are those of test_files_reading.py and test_files_malformed.py."""
    wave = [(k / 10, 5 * np.sin(k / 10) + 4 * np.sin(0.83 * k / 10 + 1)) for k in range(6000)]
    constant = [(k / 100, 1.0) for k in range(2000)]
    paths = [table(tmp_path / f'{k}.csv', 'time_s,roll_deg', rows) for k, rows in enumerate((wave, constant))]
    for path in [*paths, tmp_path / 'absent.csv']:
        assert main([verb, str(path)]) == 2, path
        error = capsys.readouterr().err
        assert last_line(error).startswith(f'swath-sysid {verb}: ') and 'Traceback' not in error


RELEASE = 'simulate --output a.csv --initial-angle-deg 3 '


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        ('identify TRIAL --axis yaw', "no axis 'yaw'"),
        ('identify TRIAL --equation swath-pitch-99', "no equation 'swath-pitch-99'"),
        ('identify TRIAL --generations -3', '--generations: cannot be -3: give 0 to 100000'),
        ('identify TRIAL --generations x', "'x' is not a whole number"),
        ('identify TRIAL --population 1', 'population must be a whole number from 8'),
        ('identify TRIAL --seed -1', 'cannot be -1: give 0 to 2147483647'),
        ('identify TRIAL --start 9 --end 3', 'start must lie before the end'),
        ('identify TRIAL --start 100', 'the record runs from'),
        ('identify TRIAL --start nan', 'nan'),
        ('identify TRIAL --search pso --preset swath-roll', 'genetic algorithm'),
        ('identify TRIAL --mass 30', 'give both --mass and --metacentric-height'),
        ('identify TRIAL --inertia -1', 'greater than zero'),
        ('identify TRIAL --inertia 1 --metacentric-height 1', 'not both: each sets the inertia'),
        ('identify TRIAL TRIAL', 'is given twice'),
        (RELEASE + '--hull titanic', "no hull 'titanic'"),
        (RELEASE + '--hull swath-roll --initial-angle-deg -30', 'does not return'),
        (RELEASE + '--hull swath-roll --rate 0', 'greater than zero'),
        (RELEASE + '--hull swath-roll --duration 1e9', 'cannot be simulated'),
        (RELEASE + '--hull swath-roll --rate-noise -1', 'noise cannot be negative'),
        (RELEASE + '--hull swath-roll --ratio b1=2', '--ratio goes with --equation'),
        (RELEASE + '--equation linear --ratio b1:2', 'is not NAME=VALUE'),
        (RELEASE + '--equation b1|r1 --axis roll --ratio b1=0.4', 'give --ratio r1=VALUE too'),
        (RELEASE + '--model absent.yaml', 'cannot read the model file'),
    ],
)
def test_bad_options_are_answered_with_one_sentence(words, sentence, trial_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([str(trial_file) if word == 'TRIAL' else word for word in words.split()]) == 2
    assert sentence in last_line(capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


def test_flags_that_advice_is_given_exist(capsys):
    for verb in VERBS:
        for task in table_of_verbs()[verb].get('tasks', ['--help']):
            with pytest.raises(SystemExit):
                main([verb, task, '--help'])
    known = capsys.readouterr().out
    for code, flags in FLAGS.items():
        assert with_flags(code, 'set it to [1, 2, 3]') == f'set it to [1, 2, 3] ({flags.format("1,2,3")})'
        assert '{}' not in with_flags(code, 'look again')
        assert all(flag in known for flag in re.findall('--[a-z-]+', flags)) and '--' in flags
    assert with_flags('spikes', 'look again') == 'look again'


@pytest.mark.parametrize('verb', ['identify', 'compare'])
def test_a_record_that_contradicts_itself_is_refused_with_its_cure(verb, trial_file, tmp_path, capsys):
    wrong = tmp_path / 'wrong.csv'
    wrong.write_text(trial_file.read_text().replace('pitch_rate_rad_s', 'pitch_rate_deg_s'))
    assert (
        main([verb, str(wrong), *(['--output', str(tmp_path / 'm.yaml'), '--force'] if verb == 'identify' else [])])
        == 2
    )
    told = capsys.readouterr().err
    assert 'times the derivative of the pitch angle' in told and 'Traceback' not in told
    assert not (tmp_path / 'm.yaml').exists()
    if verb == 'identify':
        wrong.write_text(trial_file.read_text().replace('# frame: flu', '# frame: frd'))
        assert main(['inspect', str(wrong), '--json']) == 0
        (told,) = json.loads(capsys.readouterr().out)['warnings']
        assert told['code'] == 'axes-of-sensor' and 'set frame to flu' in told['message']
        assert main(['identify', str(wrong), '--frame', 'flu']) == 0


@pytest.mark.long
def test_a_verb_ends_in_its_conclusion_which_quiet_leaves_and_reads_standard_input(capsys, monkeypatch):
    record = share_folder() / 'records' / 'kvlcc2_roll_decay.csv'
    monkeypatch.setattr('sys.stdin', SimpleNamespace(buffer=io.BytesIO(record.read_bytes())))
    assert main(['identify', '-', '--equation', 'linear', '--extinction']) == 0
    told = capsys.readouterr().out.splitlines()
    assert 'more rows are left out' in '\n'.join(told) and len(told) < 45
    assert main(['identify', str(record), '--equation', 'linear', '--quiet']) == 0
    out, err = capsys.readouterr()
    assert out.splitlines() == told[-1:] and 'identify: ' not in err
    assert told[-1].startswith('roll: doubtful; at 5.34 deg: natural period 2.5')


@pytest.mark.parametrize(('options', 'code'), [((), 'forced-motion'), (('--end', '120'), 'too-few-waves')])
def test_inspect_promises_of_waves_what_identify_keeps(options, code, capsys):
    words = [str(share_folder() / 'records' / 'morro_buoy.csv'), '--axis', 'roll', *options]
    assert main(['inspect', *words]) == 0
    told = capsys.readouterr().out
    assert f'[{code}]' in told
    if options:
        assert main(['identify', *words, '--at-sea']) == 2
        assert capsys.readouterr().err.partition(': ')[2].strip() in told


@pytest.mark.parametrize('verb', VERBS)
def test_the_examples_of_a_verb_are_in_its_help_and_are_accepted(verb, capsys):
    parser = build_parser(verb)
    examples = table_of_verbs()[verb]['examples']
    for line in examples:
        assert parser.parse_args(shlex.split(line)).verb == verb
    with pytest.raises(SystemExit) as end:
        main([verb, '--help'])
    shown = capsys.readouterr().out
    assert end.value.code == 0 and 'usage: swath-sysid' in shown and callable(module_of(verb).run)
    assert all(f'  swath-sysid {line}\n' in shown for line in examples)


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ('identfy x.csv', "there is no verb 'identfy' (did you mean identify?)"),
        ('identify x.csv --axs roll', "there is no argument '--axs' (did you mean --axis?)"),
        ('simulate --axis rol', "there is no --axis 'rol' (did you mean roll?): choose from roll, pitch"),
        ('simulate --hull swath-roll --output', '--output needs a value'),
        ('identify', 'these are missing: TRIAL'),
    ],
)
def test_a_slip_is_one_sentence_that_says_what_is_meant(words, said, capsys):
    assert main(shlex.split(words)) == 2
    told = capsys.readouterr().err
    assert said in told and told.count('\n') == 1


def completed(line, folder, shell='bash'):
    """What a shell would make of the last word of a line."""
    if not shutil.which(shell):
        pytest.skip(f'there is no {shell}')
    command = folder / 'swath-sysid'
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m swath_sysid.start "$@"\n')
    command.chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ['PATH']])
    places = os.pathsep.join([str(share_folder()), os.environ.get('PYTHONPATH', '')])
    ask = {
        'bash': 'COMP_LINE=$1 COMP_POINT=${#1}; _python_argcomplete swath-sysid; printf "%s\\n" "${COMPREPLY[@]}"',
        'zsh': '_describe() { print -l -- ${(P)2} }; BUFFER=$1 CURSOR=${#1} words=(swath-sysid); _python_argcomplete',
    }
    done = subprocess.run(
        [shell, '-c', f'eval "$(swath-sysid --completion)"; {ask[shell]}', shell, line],
        env={**os.environ, 'PATH': path, 'PYTHONPATH': places},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    # zsh shows what a verb does behind a colon
    return [word.partition(':')[0].strip() for word in done.stdout.splitlines()]


@pytest.mark.parametrize('shell', ['bash', 'zsh'])
def test_a_shell_completes_verbs_flags_choices_and_files(shell, tmp_path):
    (tmp_path / 'record.csv').touch()
    assert completed('swath-sysid ide', tmp_path, shell) == ['identify']
    assert completed('swath-sysid identify --ob', tmp_path, shell) == ['--objective']
    assert completed('swath-sysid identify --objective one', tmp_path, shell) == ['one-step']
    assert completed('swath-sysid inspect rec', tmp_path, shell) == ['record.csv']


def test_completion_without_its_library_is_one_sentence(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'argcomplete', None)
    assert main(['--completion']) == 2
    assert 'which is not installed: pip install argcomplete' in capsys.readouterr().err


def test_run_lists_every_topic_and_service_of_the_policy_with_its_type(capsys):
    assert main(['run', '--list']) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert all('/msg/' in line[-1] or '/srv/' in line[-1] for line in lines)
    policy = ElementTree.parse(share_folder() / 'config' / 'sros2_policy.xml')
    of_ros = ('/parameter_events', '/rosout', '/clock', 'parameter', 'get_type_description')
    expected = {
        (profile.get('node'), item.text.replace('~', profile.get('node')))
        for profile in policy.iter('profile')
        if profile.get('node') in (*NODES, *(each for wing in wings() for each in wing.other_nodes))
        for item in profile.iter()
        if item.tag in ('topic', 'service') and not any(part in item.text for part in of_ros)
    }
    assert are_those(sorted(expected), sorted({(line[0], line[-2]) for line in lines}))


BUOY = str(share_folder() / 'records' / 'morro_buoy.csv')


def test_the_sea_of_a_buoy_is_told_as_json_and_in_words_and_drawn(tmp_path, capsys):
    """Its own wave file gives 2.59 m; waves of known height, period and axis are in test_prediction_sea_state.py."""
    assert main(['sea', BUOY, '--json', '--plot', str(tmp_path / 'sea.png')]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['significant_height_m'] == pytest.approx(2.59, rel=0.1)
    assert told['peak_period_interval_s'][0] < 19.0 < told['peak_period_interval_s'][1]
    assert (tmp_path / 'sea.png').stat().st_size > 10_000
    assert main(['sea', BUOY, '--start', '20']) == 0
    told = capsys.readouterr().out
    words = '6 min', 'significant height', 'the waves run', 'at the sensor', 'encounter', 'not a wave buoy'
    assert [part for part in words if part not in told] == []


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        ((BUOY, '--end', '120'), 'too few waves'),
        ((BUOY, '--start', '10000'), 'no two samples'),
        ((BUOY.replace('morro_buoy', 'kvlcc2_roll_decay'),), 'holds no accel_x'),
    ],
)
def test_what_shows_no_sea_is_refused(words, sentence, capsys):
    assert main(['sea', *words]) == 2
    assert sentence in capsys.readouterr().err
