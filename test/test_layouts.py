"""What stands in config/ for other programs: layouts about topics that exist, parameters for drivers, containers."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from swath_sysid.cli.main import build_parser
from swath_sysid.formats.topics import HORIZON_TOPIC, NEXT_TOPIC, frame_at, lead_topic
from swath_sysid.nodes.parameters.files import values_from_file
from swath_sysid.nodes.parameters.imu_buffer import window_settings
from swath_sysid.nodes.parameters.predictor import pipeline_settings
from swath_sysid.nodes.parameters.table import defaults
from swath_sysid.share import share_folder

ROOT = Path(__file__).resolve().parents[1]
CONFIG = share_folder() / 'config'
LEADS = [f'/{lead_topic(lead)}' for lead in defaults('predictor')['leads_s']]
OURS = {
    '/imu/data',
    '/model/description',
    '/model/coefficients',
    '/motion/window',
    '/identifier/progress',
    '/diagnostics',
    f'/{NEXT_TOPIC}',
    f'/{HORIZON_TOPIC}',
    *LEADS,
}


def topic_of(series):
    """The topic that a PlotJuggler series comes from."""
    return next((topic for topic in sorted(OURS, key=len, reverse=True) if series.startswith(f'{topic}/')), None)


def test_plotjuggler_draws_series_that_are_made_of_our_topics_by_header_stamp():
    plotjuggler = ElementTree.parse(CONFIG / 'plotjuggler_layout.xml').getroot()
    subscriber = plotjuggler.find("Plugins/plugin[@ID='ROS2 Topic Subscriber']")
    selected = set(subscriber.find('selected_topics').get('value').split(';'))
    assert selected <= OURS
    assert {'/imu/data', '/diagnostics', *LEADS} <= selected
    # else a forecast would be drawn when it was made, not over the moment it is for
    assert subscriber.find('use_header_stamp').get('value') == 'true'
    made = {snippet.get('name'): snippet.findtext('linked_source') for snippet in plotjuggler.iter('snippet')}
    curves = [curve.get('name') for curve in plotjuggler.iter('curve')]
    assert len(curves) > 10
    assert {topic_of(made.get(curve, curve)) for curve in curves} <= selected
    assert set(made) <= set(curves)


def test_foxglove_scripts_turn_our_topics_into_degrees():
    foxglove, made = json.loads((CONFIG / 'foxglove_layout.json').read_text(encoding='utf-8')), set()
    for script in foxglove['userNodes'].values():
        read = re.search(r'inputs = \["([^"]+)"\]', script['sourceCode'])[1]
        written = re.search(r'output = "([^"]+)"', script['sourceCode'])[1]
        assert read in OURS
        assert written == f'/degrees{read}'
        made.add(written)
    assert {f'/degrees{topic}' for topic in ('/imu/data', *LEADS)} <= made
    for panel in foxglove['configById'].values():
        for path in panel.get('paths', []):
            assert path['value'].split('.')[0] in made | OURS
            if path['value'].startswith('/degrees'):
                assert path['timestampMethod'] == 'headerStamp'
        for field in ('topicPath', 'topicToRender'):
            if field in panel:
                assert panel[field].split('.')[0] in OURS


def test_rviz_shows_the_frames_that_predictor_publishes():
    layout = yaml.safe_load((CONFIG / 'forecast.rviz').read_text(encoding='utf-8'))['Visualization Manager']
    shown = {display['Reference Frame'] for display in layout['Displays'] if 'Reference Frame' in display}
    assert shown == {'base_link_level', 'base_link_now', frame_at('base_link', 1.0)}
    assert layout['Global Options']['Fixed Frame'] == 'base_link_level'
    assert 1.0 in defaults('predictor')['leads_s']


@pytest.mark.parametrize('path', sorted((CONFIG / 'drivers').glob('*.yaml')), ids=lambda path: path.stem)
def test_the_parameters_for_a_driver_are_read_and_its_command_is_one(path):
    text = path.read_text(encoding='utf-8')
    axes = {values_from_file(path, node)['frame'] for node in ('imu_buffer', 'predictor')}
    assert len(axes) == 1 and {'flu': 'forward-left-up', 'frd': 'forward-right-down'}[axes.pop()] in text
    (command,) = re.findall(r'^# swath-sysid (.*)$', text, re.MULTILINE)
    given = build_parser('run').parse_args(command.split())
    assert f'Topic {given.imu_topic}' in text and ROOT / given.params_file == path
    window_settings(values_from_file(path, 'imu_buffer'))
    pipeline_settings(values_from_file(path, 'predictor'))


def test_the_compose_file_runs_commands_that_exist():
    services = yaml.safe_load((ROOT / 'compose.yaml').read_text(encoding='utf-8'))['services']
    for service in services.values():
        words = re.sub(r'\$\{\w+:-([^}]*)\}', r'\1', service['command']).split()
        given = vars(build_parser(words[0]).parse_args(words))
        assert service['network_mode'] == service['ipc'] == 'host'
        if given.get('params_file'):
            assert (CONFIG / given['params_file'].removeprefix('/config/')).is_file()
