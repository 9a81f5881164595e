"""The verb ``run``: imu_buffer, identifier and predictor in one process, or one node; or their topics."""

import math
import os
import re
import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from swath_sysid.cli.ros import ros_needed
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import end_with_parent, ended, module_command
from swath_sysid.common.wings import handed_in, named, offered, wings
from swath_sysid.formats.files import shown
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.formats.schema import plain_content
from swath_sysid.formats.topics import IMU_TOPIC, LEADS, STATIC_FRAMES, TRANSFORMS, TYPES, type_of
from swath_sysid.nodes.parameters.parameter_files import check_sections, values_of
from swath_sysid.nodes.parameters.sections import OPTION, Section, sections_of
from swath_sysid.nodes.parameters.table import NODES, defaults, node_module
from swath_sysid.share import share_folder

OWN_TRIGGERS = 'clear publish_window identify cancel rollback undo_rollback release save_memory'.split()
#: Types of what the nodes do not publish themselves, and of services.
OTHER_TYPES = {
    'craft/loading': 'std_msgs/msg/Float64',
    STATIC_FRAMES: TRANSFORMS,
    '~/progress': 'std_msgs/msg/Float32',
    '~/record': 'std_srvs/srv/SetBool',
    **dict.fromkeys((f'~/{name}' for name in OWN_TRIGGERS), 'std_srvs/srv/Trigger'),
    **handed_in('other_types'),
}
DIRECTIONS = {'publish': 'publishes', 'subscribe': 'subscribes to', 'reply': 'serves', 'request': 'calls'}
SEA_MEMORY = 'sea_memory'  #: The predictor's parameter; with --model, a file beside the model.
MODEL_PARAMETERS = {'identifier': 'model_path', **handed_in('model_parameters')}
OPEN_TO_THE_SUBNET = (
    'note: other machines of this subnet can use these nodes; ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST keeps them here'
)


def interface_lines() -> Iterator[str]:
    """A line for each topic and service of each node, without those that every ROS node has."""
    policy = ElementTree.parse(share_folder() / 'config' / 'sros2_policy.xml')
    nodes = {*NODES, *(each for wing in wings() for each in wing.other_nodes)}
    for profile in policy.iter('profile'):
        node = profile.get('node', '')
        for group in (*profile.iter('topics'), *profile.iter('services')):
            (does,) = (words for key, words in DIRECTIONS.items() if group.get(key))
            for name in (str(item.text) for item in group):
                if (kind := _type_of(name)) and node in nodes:
                    yield f'{node:<22} {does:<14} {name.replace("~", node):<36} {kind}'


def _type_of(name: str) -> str:
    if name in TYPES or name.startswith(LEADS):
        return type_of(name)
    published = next((kind for beginning, kind in handed_in('topics').items() if name.startswith(beginning)), '')
    # a service is another node's own
    return published or OTHER_TYPES.get(name) or OTHER_TYPES.get(f'~/{name.rpartition("/")[2]}', '')


def run(arguments: Namespace) -> int:
    """Run the nodes until a signal comes; returns the exit code."""
    if arguments.list:
        print('\n'.join(interface_lines()))
        return 0
    with ros_needed():
        import rclpy  # noqa: F401 - only to say what to do where it is missing
    given = ros_arguments(arguments)
    from swath_sysid.nodes.executor_loop import run as run_nodes

    program = import_module(node_module(arguments.only or 'all_in_one'))
    if not os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') and os.environ.get('ROS_LOCALHOST_ONLY') != '1':
        print(f'swath-sysid run: {OPEN_TO_THE_SUBNET}', file=sys.stderr, flush=True)
    with ExitStack() as beside:
        for each in processes_beside(arguments):
            beside.enter_context(each)
        return run_nodes(program.PLAN, ['swath-sysid', '--ros-args', *given])


def processes_beside(arguments: Namespace) -> list[AbstractContextManager]:
    """The simulated craft and what wings run: processes of their own, which cost the nodes no sample."""
    command = simulator_command(arguments)
    of_wings = [each for offer in offered('runs_beside') for each in offer(arguments)]
    return [*([process_beside(command)] if command else ()), *of_wings]


def simulator_command(arguments: Namespace) -> list[str]:
    """The command of the simulated craft; empty where none is asked for."""
    if not arguments.simulate:
        if arguments.sea:
            raise InputError('--sea is the sea of a simulated craft: add --simulate and a hull')
        return []
    from swath_sysid.attitude.hull.catalogue import hull_named  # the nodes alone need no hull
    from swath_sysid.nodes.parameters.settings import craft_settings

    if arguments.use_sim_time:
        raise InputError('the simulated craft keeps the time of this machine: leave out --use-sim-time')
    hull_named(arguments.simulate)
    values = {'hull': arguments.simulate, 'sea_deg': arguments.sea}
    craft_settings(defaults('simulated_craft') | values)
    return [*craft_command(**values), *remappings(arguments)]


def craft_command(**parameters: Any) -> list[str]:
    """The process of a simulated craft with some parameters of its node."""
    given = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    return module_command('swath_sysid.nodes', 'simulated_craft', '--ros-args', *given)


@contextmanager
def process_beside(command: list[str], **options: Any) -> Iterator[subprocess.Popen]:
    """Run a command while the block runs; Ctrl-C is for the block, which ends it."""
    process = subprocess.Popen(command, start_new_session=True, preexec_fn=end_with_parent, **options)
    try:
        yield process
    finally:
        # unlike SIGINT, this also ends without a word a process that is still importing
        process.terminate()
        ended(process)


def ros_arguments(arguments: Namespace) -> list[str]:
    """What follows ``--ros-args`` for the nodes."""
    given = ['--params-file', arguments.params_file] if arguments.params_file else []
    # ROS would log a line of its own before its sentence, and would be silent about a name that is misspelt
    sections, names = [*_given_sections([*given, *arguments.ros_args])], full_names(arguments)
    check_sections(sections, names)
    for node, name in names.items():
        values_of(sections, node, name)
    if arguments.model:
        node = arguments.only or 'identifier'
        if node not in MODEL_PARAMETERS:
            raise InputError(f'{node} reads no model file: give --model to the identifier, which publishes it')
        path = Path(arguments.model).expanduser()
        if path.exists():
            # a node would go on without it, and the user at the command line would not notice
            owner = next((wing.read_model for wing in wings() if node in wing.nodes), 'formats.model_file read_model')
            named(owner)(path)
        else:
            check_outputs([Output('--model', path)])
        # for every node, because `identifier:` before it would leave out those in a namespace
        given += ['-p', f'{MODEL_PARAMETERS[node]}:={_quoted(arguments.model)}']
        stated = {name for each in sections if each.holds_for(names['predictor']) for name in each.parameters}
        if not arguments.only and SEA_MEMORY not in stated:
            given += ['-p', f'{SEA_MEMORY}:={_quoted(str(path.with_suffix(".sea.npz")))}']
    if arguments.mounting:
        given += ['-p', f'mounting_deg:={[round(math.degrees(angle), 6) for angle in arguments.mounting]}']
    given += remappings(arguments)
    if arguments.use_sim_time:
        given += ['-p', 'use_sim_time:=true']
    return [*given, *arguments.ros_args]


def full_names(arguments: Namespace) -> dict[str, str]:
    """Node to its name with its namespace."""
    names = {node: [(arguments.namespace or '').strip('/'), node] for node in NODES}
    for word in arguments.ros_args:
        if found := re.fullmatch(r'(?:(\w+):)?__(ns|node):=(.*)', word):
            named = found[1] or arguments.only
            for node in [named] if named in names else [] if named else NODES:
                names[node][found[2] == 'node'] = found[3].strip('/')
    return {node: '/' + '/'.join(filter(None, parts)) for node, parts in names.items()}


def _given_sections(words: Sequence[str]) -> Iterator[Section]:
    """What parameter files and `-p` set, in their order."""
    for flag, word in pairwise(words):
        if flag == '--params-file':
            yield from sections_of(word)
        elif flag in ('-p', '--param') and (found := re.fullmatch(r'(?:([\w/*]+):)?([\w.]+):=(.*)', word, re.DOTALL)):
            yield Section(OPTION, f'/**/{found[1] or "**"}', {found[2]: plain_content(found[3], word, nan=True)})


def remappings(arguments: Namespace) -> list[str]:
    """What `--namespace` and, of a verb that has it, `--imu-topic` are to ROS."""
    given = []
    if arguments.namespace:
        given += ['-r', f'__ns:=/{ros_name("namespace", arguments.namespace.strip("/"))}']
    if getattr(arguments, 'imu_topic', None):
        given += ['-r', f'{IMU_TOPIC}:={ros_name("topic", arguments.imu_topic)}']
    return given


def ros_name(kind: str, name: str) -> str:
    """A name that ROS accepts, or `InputError` with one that it would."""
    part = r'([A-Za-z_]\w*|\{\w+\})'
    if not re.fullmatch(f'(/|~/)?{part}(/{part})*', name, re.ASCII):
        parts = [re.sub(r'\W', '_', word, flags=re.ASCII) for word in name.split('/') if word]
        near = '/'.join(f'_{word}' if word[0].isdigit() else word for word in parts)
        raise InputError(
            f"ROS rejects the {kind} '{shown(name)}': between slashes it takes letters, digits and underscores, and no "
            f'digit first' + (f', as in {"/" * name.startswith("/")}{near}' if near else '')
        )
    return name


def _quoted(text: str):
    """A YAML string, whatever is in it: ROS takes the values of parameters for YAML."""
    return "'" + text.replace("'", "''") + "'"
