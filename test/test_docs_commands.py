"""Every block of the pages is carried out as a reader would: page by page, from the top, with the records there."""

import contextlib
import functools
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import yaml
from package_process import wait_for
from repository import ABSENT, ROOT
from site_pages import PAGES, blocks_of, commands_of, is_left_over

from swath_sysid.cli.main import main
from swath_sysid.common.wings import offered

#: s; only a failure waits for it
PATIENCE = 600.0
IN_THE_BOX = ('config', 'examples', 'records')
#: pages that begin with a file from another page, and say so
NEEDS = {
    'docs/howto/bags.md': 'docs/tutorials/first_record.md',
    'docs/howto/export.md': 'docs/tutorials/manoeuvring.md',
    'docs/howto/nav2.md': 'docs/tutorials/manoeuvring.md',
    'docs/howto/reading_the_report.md': 'docs/tutorials/tank_trial.md',
    'docs/howto/score.md': 'docs/tutorials/first_record.md',
}
INSTALLS = 'installs; the stages of .ci/run install by pip and by colcon'
ROS_APT = 'needs what comes with ROS 2 from apt only'
#: by page and by how the block begins, with the reason; nothing else is left out
NOT_RUN = {
    'README.md': {'make demo': 'makes an environment: run before all that changes', 'python3 -m venv': INSTALLS},
    'docs/howto/controllers.md': {
        'python examples/landing.py morro_buoy.csv --frame frd --figure landing.png --live': (
            'takes minutes: test_examples_controllers.py decides landings by what the node publishes'
        )
    },
    'docs/howto/drivers.md': {'IMU_TOPIC=': 'needs a Docker daemon'},
    'docs/howto/frames.md': {'swath-sysid mounting': 'needs a record of a push: test_mounting.py estimates from some'},
    'docs/howto/layouts.md': {'swath-sysid run': 'frames need tf2_msgs, which is not on PyPI', 'rviz2': ROS_APT},
    'docs/howto/manoeuvring.md': {'ros2 service call': ROS_APT},
    'docs/howto/network.md': {'ros2 security': ROS_APT},
    'docs/howto/on_board.md': {'pip install': INSTALLS, 'ros2 launch': ROS_APT, 'ros2 param': ROS_APT},
    'docs/howto/page.md': {
        'pip install': 'installs, and needs a browser: test_page_live.py drives the page where both are',
        'swath-sysid page --host': 'opens the machine to its network',
        'swath-sysid page --port 8484 --origin': 'needs nginx: test_page_hostile.py asks as it does',
    },
    'docs/howto/papers.md': {'swath-sysid paper': 'takes a minute: test_papers.py runs its parts'},
    'docs/howto/reading_the_report.md': {
        'python examples/simulate_trials.py': 'takes minutes: the tutorial of a tank trial runs a smaller one',
        'pip install': 'needs other machines',
    },
    'docs/howto/stability.md': {'swath-sysid history': 'needs the logs of many days: test_history.py makes some'},
    'docs/installation.md': {
        'python3 -m venv': INSTALLS,
        'PIP_BREAK': ROS_APT,
        'docker build': 'needs a Docker daemon',
    },
    'docs/tutorials/manoeuvring.md': {'bash examples/': 'takes a minute; the page runs what it calls, one by one'},
}
#: by page, words that let a command run through less of the sea than its reader's does
SHORTER = {
    'docs/howto/controllers.md': {'--duration 120': '--duration 60'},
    'docs/howto/upstream.md': {'--duration 900': '--duration 240', '--warmup 600': '--warmup 120'},
}
PIPES = {'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT, 'text': True}
LANGUAGES = {'bash', 'text', 'yaml', 'python', 'ini', 'nginx'}  # the last two for systemd and nginx
NUMBER = re.compile(r'[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?')


def is_of_an_absent_wing(page):
    """Whether a page, or the one that it needs, has a command that is left over."""
    return any(map(is_left_over, commands_of(page))) or page in NEEDS and is_of_an_absent_wing(NEEDS[page])


def is_run(page, block):
    return block.language in ('bash', 'python') and not block.text.startswith(tuple(NOT_RUN.get(page, ())))


def blocks_run(page):
    return [block for block in blocks_of(page) if is_run(page, block)]


PAGES_RUN = [page for page in PAGES if blocks_run(page) and page != 'README.md' and not is_of_an_absent_wing(page)]
#: guides that begin with no file from another page: test_docs_guides.py runs them in another process
GUIDES = [page for page in PAGES_RUN if page.startswith('docs/howto/') and page not in NEEDS]


@functools.cache
def environment():
    """That of a reader in whose path are the package's commands and its Python, confined to this machine."""
    return {
        **os.environ,
        'PATH': os.pathsep.join([str(Path(sys.executable).parent), os.environ['PATH']]),
        'PYTHONPATH': os.pathsep.join(path for path in sys.path if Path(path, 'swath_sysid', 'share.py').is_file()),
        'COLUMNS': '120',
        'FASTRTPS_DEFAULT_PROFILES_FILE': str(ROOT / 'test' / 'fast_discovery.xml'),
    }


def command_of(page, block):
    text = block.text
    for words, shorter in SHORTER.get(page, {}).items():
        text = text.replace(words, shorter)
    return [*([sys.executable] if block.language == 'python' else ['bash', '-euo', 'pipefail']), '-c', text]


@contextlib.contextmanager
def beside(page, block, folder):
    """What a block starts, until Ctrl-C ends it, from when it has said its first word."""
    process = subprocess.Popen(command_of(page, block), cwd=folder, env=environment(), start_new_session=True, **PIPES)
    try:
        said = process.stdout.readline()
        assert process.poll() is None, f'{block.text}{said}{process.stdout.read()}'
        yield
        os.killpg(process.pid, signal.SIGINT)
        rest, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 130), f'{block.text}{said}{rest}'
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def push_until_there_is_a_model(folder):
    from live_bench import Bench

    bench = Bench()
    try:
        for _ in range(4):
            assert bench.call('simulated_craft/release').success
            with contextlib.suppress(AssertionError):
                wait_for((folder / 'craft.yaml').exists, 'model', 60.0)
                return
        raise AssertionError('no model')
    finally:
        bench.close()


#: by page, what its reader does before the blocks that run alone
BY_HAND = {'docs/tutorials/first_live_model.md': push_until_there_is_a_model}


@functools.cache
def carried_out(page, base):
    """The folder in which the commands of a page have run, after those of the page that it needs."""
    folder = Path(tempfile.mkdtemp(prefix='site', dir=base))
    if page in NEEDS:
        shutil.copytree(carried_out(NEEDS[page], base), folder, dirs_exist_ok=True, symlinks=True)
    else:
        for name in IN_THE_BOX:
            shutil.copytree(ROOT / name, folder / name)
    printed = ''
    with contextlib.ExitStack() as running:
        for block in blocks_of(page):
            if block.language == 'text':
                assert_printed(block.text, printed)
            elif not is_run(page, block):
                continue
            elif block.manner == 'stays':
                running.enter_context(beside(page, block, folder))
            else:
                if block.manner == 'alone':
                    BY_HAND.get(page, lambda folder: None)(folder)
                    running.close()
                given = {'stdin': subprocess.DEVNULL, 'timeout': PATIENCE, **PIPES}
                done = subprocess.run(command_of(page, block), cwd=folder, env=environment(), **given)
                assert done.returncode == 0, f'{block.text}{done.stdout}'
                printed += done.stdout
    return folder


def assert_printed(text, printed):
    """Each line of a text is among those printed, its numbers to a hundredth."""
    words = {}
    for line in printed.splitlines():
        words.setdefault(NUMBER.sub('0', ' '.join(line.split())), []).append(line)
    for line in text.splitlines():
        alike = words.get(NUMBER.sub('0', ' '.join(line.split())), [])
        numbers = [[float(number) for number in NUMBER.findall(each)] for each in (line, *alike)]
        assert any(numbers[0] == pytest.approx(found, rel=0.01) for found in numbers[1:]), f'not printed: {line}'


def running(pages):
    """A test that carries out these pages, each a case of its own."""

    @pytest.mark.dds
    @pytest.mark.long
    @pytest.mark.timeout(3.0 * PATIENCE)
    @pytest.mark.parametrize('page', pages)
    def run(page, tmp_path_factory):
        if any(block.manner == 'stays' for block in blocks_run(page)):
            pytest.importorskip('rclpy')
        if '--page' in ''.join(block.text for block in blocks_run(page)):
            pytest.importorskip('nicegui', reason='the page needs nicegui: pip install swath_sysid[page]')
        carried_out(page, tmp_path_factory.getbasetemp())

    return run


test_the_commands_of_a_page_run = running([page for page in PAGES_RUN if page not in GUIDES])


def test_the_commands_of_the_readme_are_run_by_other_pages():
    # pages of an absent wing are not run
    pages = {*PAGES} - {'README.md'} if ABSENT else PAGES_RUN
    elsewhere = {line for page in pages for block in blocks_run(page) for line in block.text.splitlines()}
    lines = [line for block in blocks_run('README.md') for line in block.text.splitlines()]
    assert lines and [line for line in lines if line not in elsewhere and not is_left_over(line)] == []


def test_every_block_says_what_it_is_and_the_list_of_those_left_out_is_true():
    blocks = [(page, block) for page in PAGES for block in blocks_of(page)]
    assert [(page, block.text) for page, block in blocks if block.language not in LANGUAGES] == []
    assert {block.manner for _, block in blocks} <= {'', 'stays', 'alone'}
    for page, begins in NOT_RUN.items():
        assert all(any(block.text.startswith(begin) for block in blocks_of(page)) for begin in begins), page
    for page, words in SHORTER.items():
        assert all(any(word in block.text for block in blocks_run(page)) for word in words), page
    assert {page for page in PAGES for block in blocks_of(page) if block.language == 'yaml'} == set(READERS)


def is_a_manifest(text, folder):
    for name in ('pitch_8deg_1.0T_repeat1.csv', 'roll_8deg_1.5ms_repeat1.csv'):
        (folder / name).write_text('time_s,roll_deg\n0,0\n')
    (folder / 'logo.svg').write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    (folder / 'campaign.yaml').write_text(text)
    (trials_of,) = offered('trials_shown')
    trials, missing = trials_of(folder / 'campaign.yaml')
    assert len(trials) == 1 and not missing


def is_a_sea_state(text, _):
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        main(['sea', str(ROOT / 'records' / 'morro_buoy.csv'), '--json'])
    beside = {'stamp_ns', 'is_known', 'reason', 'remarks'}
    assert beside < set(yaml.safe_load(text)) <= beside | set(json.loads(printed.getvalue()))


def is_a_parameter_file(text, _):
    assert all(set(values) == {'ros__parameters'} for values in yaml.safe_load(text).values())


READERS = {
    'docs/howto/nav2.md': is_a_parameter_file,
    'docs/howto/reading_the_report.md': is_a_manifest,
    'docs/howto/waves.md': is_a_sea_state,
}


@pytest.mark.parametrize('page', [page for page in READERS if not is_of_an_absent_wing(page)])
def test_yaml_is_read_by_what_reads_it(page, tmp_path):
    for block in blocks_of(page):
        if block.language == 'yaml':
            READERS[page](block.text, tmp_path)
