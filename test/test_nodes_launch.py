"""The launch files, as far as they can be held to something without the launch system."""

import contextlib
import importlib.util
import os
import re
import shutil
import signal
import subprocess
from xml.etree import ElementTree

import pytest
from package_process import ROOT, is_alive, wait_for

from swath_sysid.nodes.parameters.table import ATTITUDE_NODES, table_of

NODES = {'imu_buffer', 'predictor', 'identifier', 'simulated_craft'}
TYPES = {'str': str, 'float': float, 'bool': bool}


def launch_file(name):
    return ElementTree.parse(ROOT / 'launch' / f'{name}.launch.xml').getroot()


def assert_arguments_are_described_and_used(name, expected):
    launch = launch_file(name)
    text = ElementTree.tostring(launch, encoding='unicode')
    arguments = {argument.get('name'): argument for argument in launch.findall('arg')}
    assert set(arguments) == set(expected.split())
    for argument in arguments.values():
        assert argument.get('description') and argument.get('default') is not None
    assert set(re.findall(r'\$\(var (\w+)\)', text)) == set(arguments)
    # none of these takes its arguments for code, as eval and command do
    assert set(re.findall(r'\$\(([\w-]+)', text)) <= {'var', 'find-pkg-share', 'file-content', 'not-equals'}


def assert_nodes_start_once(name, expected):
    """Each with parameters of its types."""
    launch = launch_file(name)
    nodes = launch.findall('group/node')
    assert {node.get('exec') for node in nodes} == set(expected) and len(list(launch.iter('node'))) == len(nodes)
    for kind in expected:
        conditions = [(node.get('if'), node.get('unless')) for node in nodes if node.get('exec') == kind]
        if len(conditions) > 1:
            (first, _), (_, last) = conditions
            assert conditions == [(first, None), (None, last)] and first == last
    for node in nodes:
        assert node.get('pkg') == 'swath_sysid' and node.get('name') == node.get('exec')
        assert node.get('respawn') == 'true' and float(node.get('respawn_delay')) >= 1.0
        defaults = {p.name: p.default for p in table_of(node.get('exec'))} | {'use_sim_time': False}
        for parameter in node.findall('param'):
            # a path such as 12 or `boat #2` would otherwise be read as YAML
            assert isinstance(defaults[parameter.get('name')], TYPES[parameter.get('type')])


def remapped(name):
    nodes = launch_file(name).iter('node')
    return {node.get('exec'): {remap.get('from') for remap in node.findall('remap')} for node in nodes}


def test_arguments_are_described_nodes_started_once_and_topics_remapped_from_what_they_subscribe_to():
    assert_arguments_are_described_and_used(
        'swath_sysid', 'namespace params_file model_file use_sim_time imu_topic simulate sea_deg'
    )
    assert_nodes_start_once('swath_sysid', NODES)
    assert remapped('swath_sysid') == dict.fromkeys(NODES, {'imu/data'}) | {'identifier': set()}


def test_what_is_given_wins_over_the_parameter_file_and_that_over_defaults():
    """The last word on a command line wins: the file, then an argument, which is only there if it is given."""
    launch = launch_file('swath_sysid')
    first = ['push-ros-namespace', 'set_parameters_from_file', 'set_parameter']
    assert [action.tag for action in launch.find('group')] == [*first, *['node'] * 5]
    given = launch.find('group/set_parameter')
    assert (given.get('name'), given.get('value')) == ('use_sim_time', '$(var use_sim_time)')
    for action, argument in ((given, 'use_sim_time'), (launch.find("group/node[@exec='identifier']"), 'model_file')):
        assert launch.find(f"arg[@name='{argument}']").get('default') == ''
        assert action.get('if') == f'$(not-equals given:$(var {argument}) given:)'
    assert [parameter.get('name') for parameter in launch.iter('param')] == ['model_path', 'hull', 'sea_deg']
    assert launch.find('include').get('file').endswith('/launch/end_once.launch.py')
    # a file that is not there is noticed before any node starts
    actions = [action.tag for action in launch]
    assert actions.index('let') < actions.index('group')
    assert launch.find('let').get('value') == '$(file-content $(var params_file))'
    default = launch.find("arg[@name='params_file']").get('default')
    assert (ROOT / default.replace('$(find-pkg-share swath_sysid)/', '')).is_file()


@pytest.mark.parametrize('code, starts', [(2, 1), (1, 2)])
def test_a_rejected_parameter_ends_a_launch_and_what_died_is_respawned(code, starts, tmp_path):
    actions = pytest.importorskip('launch.actions', reason='launch comes with ROS 2 from apt only')
    from launch import LaunchDescription, LaunchService

    spec = importlib.util.spec_from_file_location('end_once', ROOT / 'launch' / 'end_once.launch.py')
    spec.loader.exec_module(end_once := importlib.util.module_from_spec(spec))
    # the second start, if there is one, ends the launch
    words = f'echo started >> log; [ $(wc -l < log) -lt 2 ] && exit {code} || exit 2'
    process = actions.ExecuteProcess(cmd=['sh', '-c', words], cwd=str(tmp_path), respawn=True, respawn_delay=0.1)
    service = LaunchService()
    service.include_launch_description(end_once.generate_launch_description())
    service.include_launch_description(LaunchDescription([process]))
    service.run()
    assert len((tmp_path / 'log').read_text().split()) == starts


@pytest.mark.dds
@pytest.mark.skipif(
    not (shutil.which('ros2') and importlib.util.find_spec('launch_ros')),
    reason='launch comes with ROS 2 from apt only',
)
def test_launch_starts_the_nodes_respawns_one_that_died_and_ends_them_all(tmp_path):
    """As a user starts it; an apostrophe in a path is no code."""
    model = tmp_path / "o'brien.yaml"
    words = ['ros2', 'launch', 'swath_sysid', 'swath_sysid.launch.xml', 'namespace:=boat', f'model_file:={model}']
    with open(tmp_path / 'log', 'w') as log:
        process = subprocess.Popen(words, stdout=log, stderr=log, start_new_session=True)

    def found(pattern):
        return re.findall(pattern, (tmp_path / 'log').read_text())

    try:
        for node in ATTITUDE_NODES:
            wait_for(lambda node=node: found(rf'boat\.{node}\]: ready'), f'{node} that is ready')
        (first,) = map(int, found(r'\[predictor-\d+\]: process started with pid \[(\d+)\]'))
        os.kill(first, signal.SIGKILL)
        wait_for(lambda: len(found(r'boat\.predictor\]: ready')) == 2, 'predictor that was started again')
        started = [int(pid) for pid in found(r'process started with pid \[(\d+)\]')]
        process.send_signal(signal.SIGINT)
        process.wait(60.0)
        wait_for(lambda: not any(map(is_alive, started)), 'end of all nodes')
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
