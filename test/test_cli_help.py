"""What the command line tells those who look for a verb, a flag or a value."""

import json
import shlex
import subprocess
from xml.etree import ElementTree

import pytest

from swath_sysid.cli.flags import table_of_verbs
from swath_sysid.cli.main import VERBS, build_parser, main, module_of
from swath_sysid.formats.model_file import read_model
from swath_sysid.share import share_folder


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
        ('manoeuvre simulat', "there is no task 'simulat' (did you mean simulate?)"),
        ('identify x.csv --axs roll', "there is no argument '--axs' (did you mean --axis?)"),
        ('forecast x.csv --axis rol', "there is no --axis 'rol' (did you mean roll?): choose from roll, pitch"),
        ('forecast x.csv --leads -1,2', '--leads: cannot be -1'),
        ('simulate --hull swath-roll --output', '--output needs a value'),
        ('manoeuvre simulate --hull wamv-vrx-old --test turning-circle --noise 1', '--noise needs 2 values'),
        ('identify', 'these are missing: TRIAL'),
    ],
)
def test_a_slip_is_one_sentence_that_says_what_is_meant(words, said, capsys):
    assert main(shlex.split(words)) == 2
    told = capsys.readouterr().err
    assert said in told and told.count('\n') == 1


def test_a_slip_in_the_only_column_is_reported_with_its_name(tmp_path, capsys):
    (tmp_path / 'a.csv').write_text('time_s,rol_deg\n0,1\n1,2\n')
    assert main(['inspect', str(tmp_path / 'a.csv')]) == 2
    assert "'rol_deg': did you mean roll_deg?" in capsys.readouterr().err


def test_bash_completes_verbs_flags_choices_and_leaves_files_to_the_shell(tmp_path, capsys):
    assert main(['--completion']) == 0
    (tmp_path / 'script').write_text(capsys.readouterr().out)
    for line, completed in (
        ('swath-sysid ide', ['identify']),
        ('swath-sysid identify --ob', ['--objective']),
        ('swath-sysid identify --objective one', ['one-step']),
        ('swath-sysid manoeuvre sim', ['simulate']),
        ('swath-sysid identify record', []),
    ):
        words = line.split()
        set_up = f'. ./script; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _swath_sysid; '
        ask = set_up + 'printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run(['bash', '-c', ask], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert done.stdout.split() == completed and not done.stderr


def test_run_lists_every_topic_and_service_of_the_policy_with_its_type(capsys):
    assert main(['run', '--list']) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert all('/msg/' in line[-1] or '/srv/' in line[-1] for line in lines)
    policy = ElementTree.parse(share_folder() / 'config' / 'sros2_policy.xml')
    of_ros = ('/parameter_events', '/rosout', '/clock', 'parameter', 'get_type_description')
    expected = {
        (profile.get('node'), item.text.replace('~', profile.get('node')))
        for profile in policy.iter('profile')
        for item in profile.iter()
        if item.tag in ('topic', 'service') and not any(part in item.text for part in of_ros)
    }
    assert {(line[0], line[-2]) for line in lines} == expected


def test_simulate_and_scale_print_json(tmp_path, capsys, model_file):
    capsys.readouterr()
    words = ['simulate', '--hull', 'swath-roll', '--initial-angle-deg', '6', '--duration', '2']
    assert main([*words, '--output', str(tmp_path / 'a.csv'), '--json']) == 0
    made = json.loads(capsys.readouterr().out)
    assert made['axis'] == 'roll' and made['ratios'].keys() >= {'b1', 's1'} and made['samples'] > 100
    assert main(['scale', str(model_file), '--ratio', '4', '--output', str(tmp_path / 'b.yaml'), '--json']) == 0
    (axis,) = json.loads(capsys.readouterr().out)['axes'].values()
    assert axis['natural_period_s'][1] == pytest.approx(2.0 * axis['natural_period_s'][0])


@pytest.fixture
def model_file(tmp_path):
    record = share_folder() / 'records' / 'kvlcc2_roll_decay.csv'
    path = tmp_path / 'model.yaml'
    assert (
        main(['identify', str(record), '--axis', 'roll', '--equation', 'b1|r1', '--output', str(path), '--force']) == 0
    )
    assert read_model(path)
    return path
