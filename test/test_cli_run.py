"""The verb run: what it hands to ROS, what it says where there is none, and a signal while it starts."""

import argparse
import functools
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from package_process import environment

from swath_sysid.cli import run
from swath_sysid.cli.flags import add_arguments
from swath_sysid.cli.main import VERBS, main
from swath_sysid.cli.progress import progress_of
from swath_sysid.cli.ros import ros_needed
from swath_sysid.common.errors import InputError
from swath_sysid.formats.schema import plain_content
from swath_sysid.share import share_folder


def parsed(*words):
    parser = argparse.ArgumentParser()
    add_arguments(parser, 'run')
    return parser.parse_args(words)


def test_what_is_asked_for_is_handed_on_and_nothing_else(tmp_path, monkeypatch):
    assert run.ros_arguments(parsed()) == []
    monkeypatch.chdir(tmp_path)
    Path('p.yaml').write_text('/**: {ros__parameters: {use_sim_time: true}}')
    words = '--params-file p.yaml --model m.yaml --namespace /craft/ --imu-topic /sensor/imu --use-sim-time'
    ros = "--params-file p.yaml -p model_path:='m.yaml' -p sea_memory:='m.sea.npz' "
    ros += '-r __ns:=/craft -r imu/data:=/sensor/imu -p use_sim_time:=true'
    given = '-p seed:=2 --log-level warn'
    assert run.ros_arguments(parsed(*f'{words} --ros-args {given}'.split())) == f'{ros} {given}'.split()
    # where a memory of the sea is named, or none is wanted, it is not that beside the model
    assert run.ros_arguments(parsed(*"--model m.yaml --ros-args -p predictor:sea_memory:=''".split()))[:2] == [
        '-p',
        "model_path:='m.yaml'",
    ]
    # ROS takes values for YAML: 12 would be a number, and what follows a # a comment
    for node, parameter in run.MODEL_PARAMETERS.items():
        arguments = parsed('--only', node, '--model', "o'brien's boat #2.yaml")
        assert run.ros_arguments(arguments) == ['-p', f"{parameter}:='o''brien''s boat #2.yaml'"]
    with pytest.raises(InputError, match='predictor reads no model file'):
        run.ros_arguments(parsed('--only', 'predictor', '--model', 'm.yaml'))


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        ('--simulate titanic', 'swath-pitch, swath-roll, hydrofoil-pitch, swath-usv-pitch'),
        ('--simulate swath-roll --sea -1', 'cannot be -1'),
        ('--simulate swath-roll --use-sim-time', 'leave out --use-sim-time'),
        ('--sea 0.3', 'add --simulate'),
        ('--simulate hydrofoil', "no hull 'hydrofoil': choose from swath-pitch"),
    ],
)
def test_what_cannot_be_simulated_is_refused_before_anything_starts(words, sentence, capsys):
    pytest.importorskip('rclpy')
    assert main(['run', *words.split()]) == 2
    told = capsys.readouterr().err
    assert sentence in told and 'Traceback' not in told


def test_the_simulated_craft_beside_the_nodes_hears_the_same_names():
    words = '--simulate swath-pitch --sea 0.3 --namespace craft --imu-topic /sensor/imu'
    command = run.simulator_command(parsed(*words.split()))
    given = '-p hull:=swath-pitch -p sea_deg:=0.3 -r __ns:=/craft -r imu/data:=/sensor/imu'
    assert command[-len(given.split()) :] == given.split()


def test_without_ros_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    with pytest.raises(InputError, match=re.escape('pip install "swath_sysid[ros]", or source a ROS 2')):
        run.run(parsed())


def test_it_says_where_nobody_has_decided_how_far_the_nodes_are_heard(monkeypatch, capsys):
    pytest.importorskip('rclpy')
    from swath_sysid.nodes import executor_loop

    monkeypatch.setattr(executor_loop, 'run', lambda plan, args: 0)
    for decided in ('', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY'):
        for name in ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY'):
            monkeypatch.delenv(name, raising=False)
        if decided:
            monkeypatch.setenv(decided, '1')
        assert run.run(parsed('--only', 'predictor')) == 0
        assert ('of this subnet' in capsys.readouterr().err) is not bool(decided)


@pytest.mark.dds
def test_wrong_arguments_are_one_sentence_and_exit_code_2(capfd):
    pytest.importorskip('rclpy')
    for value, sentence in (('seed', 'parameter override'), ('seed:=-1', 'seed')):
        assert run.run(parsed('--ros-args', '-p', value)) == 2
        told = capfd.readouterr().err
        assert sentence in told and 'swath_sysid: ' in told and 'Traceback' not in told


def test_without_a_folder_for_the_log_of_ros_it_says_which_variable_names_one(monkeypatch, capfd):
    pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_LOG_DIR', '/dev/null/log')
    assert main(['run', '--only', 'imu_buffer']) == 2
    assert capfd.readouterr().err.rstrip().endswith('set ROS_LOG_DIR to a writable folder')


@pytest.mark.parametrize('node', [(), *(('--only', node) for node in run.MODEL_PARAMETERS)])
def test_files_that_are_none_are_refused_before_anything_starts(node, tmp_path):
    (tmp_path / 'none.yaml').write_text('imu_buffer: [oops')
    for flag, name in (
        ('--model', tmp_path / 'none.yaml'),
        ('--model', '/dev/null'),
        ('--params-file', tmp_path / 'none.yaml'),
        ('--params-file', tmp_path / 'absent.yaml'),
    ):
        with pytest.raises(InputError, match=str(name)):
            run.ros_arguments(parsed(*node, flag, str(name)))
    assert run.ros_arguments(parsed(*node, '--model', str(tmp_path / 'later.yaml')))


def test_what_is_nearly_a_node_a_parameter_or_a_name_is_rejected_with_what_was_meant(tmp_path):
    file = tmp_path / 'p.yaml'
    file.write_text('/usv/predictor: {ros__parameters: {leads_s: [1]}}\n')
    given = ['--ros-args', '--params-file', str(file)]
    for namespace in (['--namespace', 'usv'], ['--ros-args', '-r', '__ns:=/usv']):
        assert run.ros_arguments(parsed(*namespace[: 2 if '--namespace' in namespace else 3], *given))
    assert run.ros_arguments(parsed('--only', 'predictor', *given, '-r', '__ns:=/usv', '-r', '__node:=predictor'))
    for words, sentence in (
        (given, 'no section for any of these nodes, only for others such as /usv/predictor'),
        (['--params-file', str(file)], 'name one /.. or /imu_buffer'),
        (['--ros-args', '-p', 'horizn_s:=5'], '-p: no node has a parameter horizn_s: did you mean horizon_s'),
        (['--ros-args', '-p', 'nonsense:=5'], '-p: no node has a parameter nonsense; config/'),
        (['--ros-args', '-p', 'predictor:window_s:=5'], 'predictor has no parameter window_s'),
        (['--ros-args', '-p', 'in_step:=5'], 'in_step must be of the type'),
        (['--namespace', 'usv-1'], "namespace 'usv-1': .* as in usv_1"),
        (['--imu-topic', '/1imu/data'], "topic '/1imu/data': .* as in /_1imu/data"),
        (['--imu-topic', 'imu data'], 'as in imu_data'),
    ):
        with pytest.raises(InputError, match=sentence):
            run.ros_arguments(parsed(*words))
    assert run.ros_arguments(parsed('--imu-topic', '~/imu', '--ros-args', '-p', 'mounting_deg:=[15,-10,90]'))


@pytest.mark.parametrize(('given', 'threads'), [({}, '1'), ({'OMP_NUM_THREADS': '2'}, '2')])
def test_linear_algebra_takes_one_thread_unless_more_are_asked_for(given, threads):
    program = """
import os, sys
from swath_sysid.start import command_line
assert 'numpy' not in sys.modules
try:
    command_line()
finally:
    print(os.environ['OMP_NUM_THREADS'])
"""
    others = {name: value for name, value in environment().items() if name != 'OMP_NUM_THREADS'}
    command = [sys.executable, '-c', program, '--help']
    printed = subprocess.run(command, env=others | given, capture_output=True, text=True, check=True).stdout
    assert printed.endswith(f'{threads}\n')


def test_an_interrupted_tool_ends_though_a_thread_waits_for_a_lock_that_nobody_holds():
    """As that of a pool does where Ctrl-C came while a future was locked."""
    program = """
import sys, threading
import swath_sysid.cli.main as cli
from swath_sysid.start import command_line
def interrupted(**_):
    threading.Thread(target=threading.Event().wait).start()
    print('stopped', file=sys.stderr)
    return 130
cli.main = interrupted
sys.exit(command_line())
"""
    ended = subprocess.run(
        [sys.executable, '-c', program], env=environment(), stderr=subprocess.PIPE, text=True, timeout=90.0
    )
    assert (ended.returncode, ended.stderr) == (130, 'stopped\n')


def started(*arguments):
    """As the console script, but says when it begins; SIGINT is ignored as in the background of a shell."""
    program = "from swath_sysid.start import command_line; print('begun', flush=True); raise SystemExit(command_line())"
    pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, 'text': True}
    command = [sys.executable, '-c', program, *arguments]
    ignoring = functools.partial(signal.signal, signal.SIGINT, signal.SIG_IGN)
    return subprocess.Popen(command, env=environment(), preexec_fn=ignoring, **pipes)


@pytest.mark.parametrize(
    ('words', 'number', 'after'),
    [
        ('identify missing.csv --inertia -1', signal.SIGINT, 0.02),
        ('identify missing.csv --inertia -1', signal.SIGINT, 1.0),
        ('identify missing.csv --inertia -1', signal.SIGTERM, 0.6),
        ('run --only predictor --ros-args -r __ns:=/early', signal.SIGINT, 0.8),
        ('run --namespace early', signal.SIGTERM, 0.02),
    ],
)
def test_a_tool_interrupted_at_its_start_ends_with_130_and_nodes_with_0(words, number, after, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    if words.startswith('run'):
        pytest.importorskip('rclpy', reason='nodes need ROS 2')
    process = started(*words.split())
    assert process.stdout.readline() == 'begun\n'
    time.sleep(after)
    process.send_signal(number)
    try:
        told = ''.join(process.communicate(timeout=90.0))
    finally:
        process.kill()
    assert 'Traceback' not in told and 'Exception ignored' not in told
    # a tool may have come to its own end before, and said so; the interpreter's very last moments know no handlers
    ended = 'must be greater than zero' in told
    expected = [0] if words.startswith('run') else [130, 2, -number] if ended else [130]
    assert process.returncode in expected, told
    assert process.returncode != 130 or ended or told.startswith('stopped before anything was done: '), told


@pytest.mark.skipif(sys.platform != 'linux', reason='other systems do not tell a process of the death of its parent')
def test_what_runs_beside_the_nodes_ends_when_they_are_killed():
    beside = 'import time; print("begun", flush=True); time.sleep(600)'
    program = f"""import sys
from swath_sysid.cli.run import process_beside
with process_beside([sys.executable, '-c', {beside!r}]) as process:
    print(process.pid, flush=True)
    process.wait()
"""
    with subprocess.Popen([sys.executable, '-c', program], stdout=subprocess.PIPE, text=True) as parent:
        pid = next(int(line) for line in parent.stdout if line.strip().isdigit())
        parent.kill()
    deadline = time.monotonic() + 60.0
    while Path(f'/proc/{pid}').exists() and Path(f'/proc/{pid}/stat').read_text().split()[2] != 'Z':
        assert time.monotonic() < deadline
        time.sleep(0.05)


def unwritable(kind):
    """A stream that takes nothing: a full disk, or a pipe whose reader has gone."""
    if kind == 'full':
        return open('/dev/full', 'w')
    reader, writer = os.pipe()
    os.close(reader)
    return os.fdopen(writer, 'w')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='/dev/full is of Linux')
@pytest.mark.parametrize(('kind', 'why'), [('full', 'No space left on device'), ('pipe', 'Broken pipe')])
def test_output_that_cannot_be_written_is_one_sentence_whatever_the_verb(kind, why, monkeypatch, capsys, tmp_path):
    helps = [[verb, '--help'] for verb in VERBS]
    record = str(share_folder() / 'records' / 'kvlcc2_roll_decay.csv')
    for words in (['--help'], ['--completion'], *helps, ['inspect', record], ['inspect', record, '--json']):
        with unwritable(kind) as stream, monkeypatch.context() as patched:
            patched.setattr('sys.stdout', stream)
            try:
                code = main(words)
            except SystemExit as error:
                code = error.code
        assert code == 1, words
        told = capsys.readouterr().err
        assert told == f'swath-sysid: standard output cannot be written ({why}): redirect it elsewhere\n'
    with unwritable(kind) as stream, monkeypatch.context() as patched:
        stream.reconfigure(line_buffering=True)  # as standard error is
        patched.setattr('sys.stderr', stream)
        assert main(['inspect', str(tmp_path / 'none.csv')]) == 1


@pytest.mark.long
def test_figures_are_drawn_whatever_backend_the_environment_names(tmp_path):
    (tmp_path / 'matplotlibrc').write_text('backend: none_such\n')
    record = share_folder() / 'records' / 'kvlcc2_roll_decay.csv'
    done = subprocess.run(
        [sys.executable, '-m', 'swath_sysid.start', 'inspect', record, '--plot', 'decay.png'],
        env=environment() | {'MPLBACKEND': 'none_such'},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and 'Traceback' not in done.stderr, done.stderr
    assert (tmp_path / 'decay.png').stat().st_size > 10_000


@pytest.mark.long
def test_a_matplotlibrc_that_is_no_text_is_reported_in_a_sentence(tmp_path):
    (tmp_path / 'matplotlibrc').write_bytes(b'font.family: Caf\xe9\n')
    record = share_folder() / 'records' / 'kvlcc2_roll_decay.csv'
    for verb, *flags in (['inspect', '--plot', 'decay.png'], ['identify', '--plot', 'fit.png']):
        command = [sys.executable, '-m', 'swath_sysid.start', verb, record, *flags]
        done = subprocess.run(command, env=environment(), cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 2 and 'is not UTF-8' in done.stderr and 'Traceback' not in done.stderr, done.stderr


@pytest.mark.long
def test_a_name_of_any_bytes_is_drawn_printed_and_stored_as_it_is(tmp_path):
    (tmp_path / 'matplotlibrc').write_text('text.usetex: True\nfont.family: NoSuchFont\n')
    name = b'd\xe9cay b$x_$%s [red]<b>&[|x].csv'
    (tmp_path / os.fsdecode(name)).symlink_to(share_folder() / 'records' / 'kvlcc2_roll_decay.csv')
    fit = b'--equation odd-cubic --axis roll --plot fit.png --output model.yaml'.split()
    for words in ([b'inspect', name, b'--plot', b'record.svg'], [b'identify', name, *fit]):
        command = [sys.executable, '-m', 'swath_sysid.start', *words]
        done = subprocess.run(command, env=environment(), cwd=tmp_path, capture_output=True)
        assert done.returncode == 0 and b'Traceback' not in done.stderr, done.stderr
        assert name in done.stdout
    assert r'd\xe9cay b$x_$%s [red]&lt;b&gt;&amp;[|x].csv' in (tmp_path / 'record.svg').read_text()
    model = plain_content((tmp_path / 'model.yaml').read_text('utf-8'), 'model.yaml')
    assert repr(r'd\xe9cay b$x_$%s [red]<b>&[|x].csv') in str(model)


def test_a_bar_of_progress_shows_a_name_with_brackets(monkeypatch, capsys):
    monkeypatch.setattr('sys.stderr.isatty', lambda: True, raising=False)
    with progress_of('inspect') as progress:
        progress(0.5, '[/x] [red]z')


@pytest.mark.parametrize(
    ('name', 'value', 'sentence'),
    [
        ('ROS_DOMAIN_ID', '300', 'ROS_DOMAIN_ID is 300, which has no ports: give 0 to 232'),
        (
            'RMW_IMPLEMENTATION',
            'rmw_other_cpp',
            'rmw_other_cpp, which is not installed: install it, or give rmw_mine_cpp',
        ),
    ],
)
def test_what_would_end_ros_within_its_libraries_is_one_sentence(name, value, sentence, monkeypatch, tmp_path):
    for library in ('rmw_mine_cpp', 'rmw_mine_shared_cpp', 'rmw_x__rosidl_typesupport_cpp'):
        (tmp_path / f'lib{library}.so').touch()
    monkeypatch.setenv('LD_LIBRARY_PATH', f'{tmp_path}:')
    monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=sentence), ros_needed():
        pass
    monkeypatch.setenv('ROS_DOMAIN_ID', '232')
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_mine_cpp')
    with ros_needed():
        pass
