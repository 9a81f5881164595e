"""The launch file, as far as it can be held to something without the launch system."""
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from swath_sysid.nodes.parameter_tables import TABLES

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'launch' / 'swath_sysid.launch.xml'


@pytest.fixture(scope='module')
def launch():
    return ElementTree.parse(FILE).getroot()


def test_every_argument_is_described_and_used(launch):
    text = FILE.read_text(encoding='utf-8')
    arguments = {argument.get('name'): argument for argument in launch.findall('arg')}
    assert set(arguments) == {'namespace', 'params_file', 'model_file', 'use_sim_time', 'imu_topic'}
    for name, argument in arguments.items():
        assert argument.get('description') and argument.get('default') is not None
        assert f'$(var {name})' in text
    assert set(re.findall(r'\$\(var (\w+)\)', text)) == set(arguments)


def test_every_node_is_started_once_with_parameters_that_exist(launch):
    nodes = launch.findall('group/node')
    assert {node.get('exec') for node in nodes} == set(TABLES)
    for name in TABLES:
        conditions = {(node.get('if'), node.get('unless')) for node in nodes if node.get('exec') == name}
        if conditions != {(None, None)}:
            (positive,), (negative,) = {i for i, _ in conditions} - {None}, {u for _, u in conditions} - {None}
            assert positive == negative and len(conditions) == 2
    for node in nodes:
        assert node.get('pkg') == 'swath_sysid' and node.get('name') == node.get('exec')
        parameters = {parameter.get('name') for parameter in node.findall('param')} - {None, 'use_sim_time'}
        assert parameters <= {parameter.name for parameter in TABLES[node.get('exec')]}
        hears = {remap.get('from') for remap in node.findall('remap')}
        assert hears == (set() if node.get('exec') == 'identifier' else {'imu/data'})


def test_the_default_parameter_file_is_installed(launch):
    default = launch.find("arg[@name='params_file']").get('default')
    assert (ROOT / default.replace('$(find-pkg-share swath_sysid)/', '')).is_file()
