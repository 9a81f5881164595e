"""The package as a whole: what it installs, which room may use what, its release, and its files for other programs."""

import ast
import contextlib
import functools
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
import types
from pathlib import Path
from unittest.mock import patch
from xml.etree import ElementTree

import pytest
import yaml
from repository import ROOT, are_those

import swath_sysid
from swath_sysid.cli.main import build_parser, main
from swath_sysid.cli.run import _type_of
from swath_sysid.common.errors import InputError
from swath_sysid.common.wings import wings
from swath_sysid.formats.forecast_output import forecast_topics
from swath_sysid.formats.messages import typestore
from swath_sysid.formats.topics import HORIZON_TOPIC, IMU, NEXT_TOPIC, TYPES, frame_at, lead_topic
from swath_sysid.nodes.parameters.parameter_files import values_from_file
from swath_sysid.nodes.parameters.settings import pipeline_settings, window_settings
from swath_sysid.nodes.parameters.table import NODES, defaults, node_module
from swath_sysid.share import share_folder

PACKAGE = ROOT / 'swath_sysid'
MODULES = sorted(PACKAGE.rglob('*.py'))

#: of what is imported; every one exists on Ubuntu 24.04, where python3-rich brings markdown_it
ROSDEP_KEYS = {name: f'python3-{name}' for name in ('argcomplete', 'matplotlib', 'numpy', 'rich', 'scipy', 'yaml')} | {
    'filterpy': 'python3-filterpy-pip',
    'markdown_it': 'python3-rich',
    'rosbags': 'python3-rosbags-pip',
}

DISTRIBUTIONS = {'nptdms': 'npTDMS', 'yaml': 'PyYAML'}
#: imports that may fail, and the extra that installs them
OPTIONAL = {
    'numba': 'fast',
    'distributed': 'cluster',
    **dict.fromkeys(('h5py', 'nptdms', 'openpyxl', 'pyarrow'), 'tank'),
    **dict.fromkeys(('pymavlink', 'pyulog'), 'logs'),
    **dict.fromkeys(('fastapi', 'nicegui', 'uvicorn'), 'page'),
}
ROS_PACKAGES = set(
    'ament_index_python builtin_interfaces diagnostic_msgs geometry_msgs launch launch_ros nav_msgs rcl_interfaces '
    'rclpy rosgraph_msgs rosidl_runtime_py sensor_msgs std_msgs std_srvs tf2_msgs trajectory_msgs'.split()
)

NODE_VERBS = {'demo', 'page', 'record', 'replay', 'run'}
WINGS = [wing.name for wing in wings()]
INNER_ORDER = ('motion', 'hull', 'identification', 'prediction')
ABOVE = {room: INNER_ORDER[:level] for level, room in enumerate(INNER_ORDER)}
#: of a wing; the rest of it is pure and names no flag
SHOWING_ROOMS = ('report', 'nodes', 'cli')
PURE_ROOMS = {'common', 'pipeline', *WINGS, *(f'{one}/{room}' for one in ('attitude', *WINGS) for room in INNER_ORDER)}
SCREENS = {'page'}  #: wings whose own modules show, too
PURE_ROOMS -= SCREENS
OF_OTHER_COMMANDS = {'registry.py': 'rosbags-convert', 'manifest.py': 'the comment above a new manifest'}
BASE = {'common', 'share'}
CORE = BASE | {f'attitude/{room}' for room in INNER_ORDER} | {'pipeline'}
MAY_IMPORT = {
    'common': set(),
    'share': {'common'},
    'start': set(),
    **{f'attitude/{room}': BASE | {f'attitude/{above}' for above in ABOVE[room]} for room in INNER_ORDER},
    'pipeline': CORE,
    'formats': CORE,
    'report': CORE | {'formats'},
    'nodes': CORE | {'formats'},
    'cli': CORE | {'formats', 'report', 'nodes'},
}
for _wing in WINGS:
    _found = {path.name for path in (PACKAGE / _wing).iterdir() if path.is_dir() and path.name != '__pycache__'}
    _own = sorted(_found - {*INNER_ORDER, *MAY_IMPORT})
    _order = [*INNER_ORDER, 'formats', *_own, *SHOWING_ROOMS]
    MAY_IMPORT[_wing] = CORE | {'formats', f'{_wing}/formats'} | ({'report'} if _wing in SCREENS else set())
    for _level, _room in enumerate(_order):
        _of_core = BASE | {'pipeline'} if _room in ABOVE else MAY_IMPORT.get(_room, CORE | {'formats'}) | {_room}
        MAY_IMPORT[f'{_wing}/{_room}'] = _of_core | {_wing, *(f'{_wing}/{above}' for above in _order[:_level])}
IMPURE_MODULES = {'logging', 'random', 'rich', 'time'}
#: compared with the end of the called name
IMPURE_CALLS = set('print input warnings.warn datetime.now datetime.utcnow datetime.today date.today'.split())


def text_of(name):
    return (ROOT / name).read_text(encoding='utf-8')


def room_of(path):
    """That of a file: ``'attitude/hull'``, ``'cli'``."""
    return room_at(path.relative_to(PACKAGE).with_suffix('').parts)


def room_at(parts):
    """The room of a module given by the parts of its name inside the package."""
    is_inner = parts[0] in ('attitude', *WINGS) and len(parts) > 1 and PACKAGE.joinpath(*parts[:2]).is_dir()
    return '/'.join(parts[:2]) if is_inner else parts[0]


@functools.cache
def tree_of(path):
    return ast.parse(path.read_text(encoding='utf-8'), str(path))


@functools.cache
def imports_of(path):
    nodes = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not any(getattr(node, 'level', 0) for node in nodes), f'{path} imports by a relative name'
    pairs = [(getattr(node, 'module', None), alias.name) for node in nodes for alias in node.names]
    return {f'{module}.{name}' if module else name for module, name in pairs}


def outside_imports(path):
    """Top-level names of the imports that are neither ours nor the standard library's."""
    tops = {name.split('.')[0] for name in imports_of(path)}
    return tops - sys.stdlib_module_names - {PACKAGE.name}


def calls_of(path):
    """What a file calls, and whether with arguments: ``{('np.random.default_rng', True)}``."""
    calls = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.Call)]
    return {(ast.unparse(call.func), bool(call.args or call.keywords)) for call in calls}


@pytest.fixture(scope='module')
def manifest():
    return ElementTree.parse(ROOT / 'package.xml').getroot()


@pytest.fixture(scope='module')
def setup_arguments():
    """What setup.py hands to setuptools, which need not be installed for this."""
    captured = {}
    stand_in = types.ModuleType('setuptools')
    stand_in.setup = lambda **arguments: captured.update(arguments)
    stand_in.find_packages = lambda **arguments: arguments['include']
    with patch.dict(sys.modules, setuptools=stand_in), contextlib.chdir(ROOT):
        runpy.run_path('setup.py')
    return captured


def requirement_names(requirements):
    return {re.match(r'[\w.-]+', requirement).group() for requirement in requirements}


def test_manifest_names_an_ament_python_package_of_one_version(manifest, setup_arguments):
    named = [manifest.findtext(name) for name in ('name', 'export/build_type', 'license')]
    assert (manifest.get('format'), *named) == ('3', PACKAGE.name, 'ament_python', 'Apache-2.0')
    assert 'Apache License' in text_of(manifest.find('license').get('file'))
    assert re.fullmatch(r'\d+\.\d+\.\d+', manifest.findtext('version'))
    assert swath_sysid.__version__ == manifest.findtext('version') == setup_arguments['version']
    urls = manifest.findall('url')
    assert {url.get('type') for url in urls} == {'website', 'repository', 'bugtracker'}
    assert all(url.text.startswith('https://') for url in urls)


def test_both_manifests_cover_every_import(manifest, setup_arguments):
    imported = set().union(*(outside_imports(path) for path in MODULES)) - set(OPTIONAL)
    used = imported.union(*(outside_imports(path) for path in (ROOT / 'launch').glob('*.py')))
    keys = {name if name in ROS_PACKAGES else ROSDEP_KEYS.get(name, f'a key for {name}') for name in used}
    assert keys <= {element.text for element in manifest.findall('exec_depend')}
    required = requirement_names(setup_arguments['install_requires'])
    assert {DISTRIBUTIONS.get(name, name) for name in imported - ROS_PACKAGES} <= required


def test_test_dependencies_are_declared(manifest, setup_arguments):
    imported = set().union(*(outside_imports(path) for path in (ROOT / 'test').rglob('*.py')))
    ours = {path.stem for path in (ROOT / 'test').rglob('*.py')}
    extra = imported - set(ROSDEP_KEYS) - ROS_PACKAGES - set(OPTIONAL) - ours
    assert {f'python3-{name}' for name in extra} <= {element.text for element in manifest.findall('test_depend')}
    assert extra <= requirement_names(setup_arguments['extras_require']['test'])
    extras = {extra: requirement_names(needs) for extra, needs in setup_arguments['extras_require'].items()}
    assert [name for name, extra in OPTIONAL.items() if DISTRIBUTIONS.get(name, name) not in extras[extra]] == []


def without_ros():
    of_nodes = {f'cli/{verb}' for verb in NODE_VERBS}
    others = (path for path in MODULES if room_of(path).rpartition('/')[2] != 'nodes')
    return [path for path in others if f'{path.parent.name}/{path.stem}' not in of_nodes]


def test_imports_go_up_the_layers_only_and_only_nodes_and_their_verbs_import_ros():
    assert [path for path in without_ros() if outside_imports(path) & ROS_PACKAGES] == []
    assert outside_imports(PACKAGE / '__init__.py') == set()
    offenders = {}
    for path in (path for path in MODULES if path != PACKAGE / '__init__.py'):
        room = room_of(path)
        rooms = {room_at(name.split('.')[1:]) for name in imports_of(path) if name.startswith(f'{PACKAGE.name}.')}
        if wrong := rooms - MAY_IMPORT.get(room, set()) - {room, '__version__'}:
            offenders[str(path.relative_to(PACKAGE))] = wrong
    assert offenders == {}


def test_all_but_the_nodes_import_without_ros_and_numba():
    # what is imported only where numba is loaded needs it
    paths = [path for path in without_ros() if not any(name.startswith('numba.') for name in imports_of(path))]
    parts = [path.relative_to(ROOT).with_suffix('').parts for path in paths]
    names = ['.'.join(each).removesuffix('.__init__') for each in parts]
    code = f"""
import importlib, sys
sys.modules.update(dict.fromkeys({sorted(ROS_PACKAGES | set(OPTIONAL))}))
for name in {names}:
    importlib.import_module(name)
"""
    result = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr.splitlines()[-1]


def test_the_core_is_pure():
    offenders = []
    for path in (path for path in MODULES if room_of(path) in PURE_ROOMS):
        wrong = {name.split('.')[0] for name in imports_of(path)} & IMPURE_MODULES
        calls = calls_of(path)
        wrong |= {name for name, _ in calls if f'.{name}'.endswith(tuple(f'.{call}' for call in IMPURE_CALLS))}
        random = {(name, arguments) for name, arguments in calls if re.fullmatch(r'(np|numpy)\.random\.\w+', name)}
        wrong |= random - {('np.random.default_rng', True), ('np.random.SeedSequence', True)}
        offenders += [(str(path.relative_to(PACKAGE)), each) for each in wrong]
    assert offenders == []


def names_no_flag(room):
    first, _, inner = room.partition('/')
    return (
        first in ('common', 'attitude', 'pipeline', 'formats')
        or room not in SCREENS
        and first in WINGS
        and inner not in SHOWING_ROOMS
    )


def test_flags_of_the_command_line_stay_there():
    offenders = [
        (str(path.relative_to(PACKAGE)), node.value)
        for path in MODULES
        if names_no_flag(room_of(path)) and path.name not in OF_OTHER_COMMANDS
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if re.search(r'(?<![-\w])--[a-z]', node.value)
    ]
    assert offenders == []


def test_ros2_run_finds_every_node_after_pip_and_colcon():
    programs = {path for path in MODULES if '\nPLAN: Plan = ' in path.read_text(encoding='utf-8')}
    modules = [f'{node_module(node)}.py' for node in (*NODES, 'all_in_one')]
    assert programs == {ROOT / module.replace('.', '/', module.count('.') - 1) for module in modules}
    scripts = {path.name: path for path in (ROOT / 'scripts').iterdir()}
    assert are_those(sorted(scripts), sorted([*NODES, 'swath-sysid']))
    assert all(os.access(path, os.X_OK) for path in scripts.values())
    assert scripts['swath-sysid'].read_text(encoding='utf-8').endswith('/../../bin/swath-sysid" "$@"\n')
    assert text_of('setup.cfg').count(f'$base/lib/{PACKAGE.name}\n') == 2


def echo_beside(folder):
    """A command line in a folder that prints its arguments, one a line."""
    folder.mkdir(parents=True)
    (folder / 'swath-sysid').write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    (folder / 'swath-sysid').chmod(0o755)


def said_by(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_the_script_of_a_node_hands_its_arguments_on(tmp_path):
    echo_beside(tmp_path / 'a prefix')
    for node in NODES:
        script, given = shutil.copy(ROOT / 'scripts' / node, tmp_path / 'a prefix'), ['--ros-args', '-p', 'a:=b c']
        assert said_by(script, *given) == ['run', '--only', node, *given]


def test_everything_shared_is_installed(setup_arguments):
    installed = {source: target for target, sources in setup_arguments['data_files'] for source in sources}
    assert installed[f'resource/{PACKAGE.name}'] == 'share/ament_index/resource_index/packages'
    assert installed['package.xml'] == f'share/{PACKAGE.name}'
    for folder in ('config', 'launch', 'environment', 'records'):
        for path in (ROOT / folder).rglob('*'):
            if path.is_file() and '__pycache__' not in path.parts:
                source = path.relative_to(ROOT)
                assert installed[source.as_posix()] == f'share/{PACKAGE.name}/{source.parent.as_posix()}'


def test_every_data_file_inside_the_package_is_packaged(setup_arguments):
    patterns = setup_arguments.get('package_data', {}).get(PACKAGE.name, [])
    packaged = {path for pattern in patterns for path in PACKAGE.glob(pattern)}
    files = {path for path in PACKAGE.rglob('*') if path.is_file() and '__pycache__' not in path.parts}
    assert files - set(MODULES) == packaged
    assert [path for path in MODULES if not (path.parent / '__init__.py').is_file()] == []
    # with a [project] table `colcon build --symlink-install` silently makes no executables
    assert set(tomllib.loads(text_of('pyproject.toml'))) == {'build-system', 'tool'}


def test_colcon_puts_the_command_line_and_nothing_else_on_the_path(setup_arguments, tmp_path):
    """Names such as identifier are too general for it: the nodes are where `ros2 run` looks, not in bin/."""
    assert setup_arguments['entry_points']['console_scripts'] == ['swath-sysid = swath_sysid.start:command_line']
    files = setup_arguments['data_files']
    installed = {f'{target}/{Path(source).name}': source for target, sources in files for source in sources}
    (hook,) = json.loads(text_of('colcon.pkg'))['hooks']
    action, variable, folder = (ROOT / installed[hook]).read_text(encoding='utf-8').strip().split(';')
    assert (action, variable) == ('prepend-non-duplicate', 'PATH')
    assert [name for name in installed if name.startswith(f'{folder}/')] == [f'{folder}/swath-sysid']
    echo_beside(tmp_path / 'lib' / PACKAGE.name)
    (tmp_path / folder).mkdir(parents=True)
    command = shutil.copy(ROOT / installed[f'{folder}/swath-sysid'], tmp_path / folder)
    assert said_by(command, 'run', '--only', 'a b') == ['run', '--only', 'a b']


def test_every_public_module_and_function_is_documented():
    public = [
        (path.name, node)
        for path in MODULES
        for node in (tree_of(path), *tree_of(path).body)
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef)
        if not getattr(node, 'name', '').startswith('_')
    ]
    assert [(name, getattr(node, 'name', '')) for name, node in public if not ast.get_docstring(node)] == []


def test_the_share_folder_of_an_installation_and_of_a_checkout(tmp_path):
    for layout in ('lib/python3.12/site-packages', 'lib/python3/dist-packages', 'local/lib/python3.12/dist-packages'):
        prefix = tmp_path / layout.replace('/', '_')
        module = prefix / layout / PACKAGE.name / 'share.py'
        module.parent.mkdir(parents=True)
        module.touch()
        with pytest.raises(InputError, match='install swath_sysid with pip or colcon'):
            share_folder(module)
        (prefix / 'share' / PACKAGE.name).mkdir(parents=True)
        shutil.copy(ROOT / 'package.xml', prefix / 'share' / PACKAGE.name)
        assert share_folder(module) == (prefix / 'share' / PACKAGE.name).resolve()
    # as colcon build --symlink-install lays it out: the module's real place is the checkout
    (tmp_path / PACKAGE.name).symlink_to(PACKAGE)
    assert share_folder(tmp_path / PACKAGE.name / 'share.py') == share_folder() == ROOT


def test_citation_and_changelog_are_of_this_version():
    citation = yaml.safe_load(text_of('CITATION.cff'))
    assert {'cff-version', 'message', 'title', 'authors'} <= set(citation)
    assert (citation['version'], citation['license']) == (swath_sysid.__version__, 'Apache-2.0')
    # REP 132 asks for sections called ``Forthcoming`` or ``1.2.3 (2027-01-31)``, newest first
    lines = text_of('CHANGELOG.rst').splitlines()
    assert lines[1] == 'Changelog for package swath_sysid'
    headings = [lines[k - 1] for k, line in enumerate(lines) if k > 2 and re.fullmatch('-{3,}', line)]
    assert headings
    released = [re.fullmatch(r'(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)', heading) for heading in headings]
    assert all(released[1:]) and (released[0] or headings[0] == 'Forthcoming')
    prepared = re.search(r'Prepared as (\S+),', text_of('CHANGELOG.rst'))
    newest = (released[0] or prepared).group(1)
    assert newest == swath_sysid.__version__


CONFIG = share_folder() / 'config'
LEADS = [f'/{lead_topic(lead)}' for lead in defaults('predictor')['leads_s']]
NAMES = ('imu/data', 'model/description', 'model/coefficients', 'identifier/progress', NEXT_TOPIC, HORIZON_TOPIC)
BOAT = ('--namespace', 'boat1', '--imu-topic', '/sensors/imu', '--frame-id', 'base_link_of_1')
OURS = {f'/{name}' for name in NAMES} | set(LEADS)


def test_layouts_draw_our_topics_by_header_stamp():
    """Else a forecast would be drawn when it was made, not over the moment it is for."""
    plotjuggler, foxglove = text_of('config/plotjuggler_layout.xml'), text_of('config/foxglove_layout.json')
    for text in (plotjuggler, foxglove):
        named = {f'/{each}' for each in re.findall(r'/(?:degrees/)?((?:imu|forecast|model|identifier)/\w+)', text)}
        assert {'/imu/data', f'/{NEXT_TOPIC}', *LEADS} <= named <= OURS
    assert '<use_header_stamp value="true" />' in plotjuggler
    paths = [path for panel in json.loads(foxglove)['configById'].values() for path in panel.get('paths', [])]
    methods = {path['timestampMethod'] for path in paths if path['value'].startswith('/degrees')}
    assert methods == {'headerStamp'}
    scripts = [script['sourceCode'] for script in json.loads(foxglove)['userNodes'].values()]
    assert scripts and all(re.search(r'inputs = \["(.+?)"\](.|\n)*output = "/degrees\1"', each) for each in scripts)


@pytest.mark.parametrize(('given', 'namespace', 'sensor'), [((), '', '/imu/data'), (BOAT, '/boat1', '/sensors/imu')])
def test_every_topic_and_field_of_a_layout_exists(given, namespace, sensor, capsys):
    texts = []
    for program in ('plotjuggler', 'foxglove', 'rviz'):
        assert main(['layout', program, *given]) == 0
        texts.append(capsys.readouterr().out)
    plotjuggler, foxglove = ElementTree.fromstring(texts[0].encode()), json.loads(texts[1])
    published = [f'{namespace}/{name}' for name in (*forecast_topics(defaults('predictor')['leads_s'], ()), *NAMES[1:])]
    known = {sensor: IMU, **{topic: _type_of(topic.removeprefix(f'{namespace}/')) for topic in published}}
    known |= {f'{namespace}/identifier/progress': 'std_msgs/msg/Float32', '/diagnostics': TYPES['/diagnostics']}

    def assert_has(path, parts):
        topic = max((topic for topic in known if path.startswith(topic)), key=len)
        kind = known[topic]
        for name in re.split(parts, path[len(topic) :])[1:]:
            # the parts of an array; what PlotJuggler and the scripts make of an orientation
            if name.rstrip(':]').isdigit() or name == ':]' or kind.endswith('Quaternion') and name in ('roll', 'pitch'):
                continue
            fields = dict(typestore().fielddefs[kind][1])
            assert name in fields, (path, name)
            kind = next(iter(re.findall(r'\w+/msg/\w+', str(fields[name]))), kind)

    selected = next(plotjuggler.iter('selected_topics')).get('value').split(';')
    assert selected and set(selected) <= set(known)
    sources = {each.text for each in plotjuggler.iter('linked_source')}
    curves = {each.get('name') for each in plotjuggler.iter('curve')}
    made = {each.get('name') for each in plotjuggler.iter('snippet')}
    for path in [*sources, *(name for name in curves - made if not name.startswith('/diagnostics/'))]:
        assert_has(path, '/')
    health = {name for name in curves if name.startswith('/diagnostics/')}
    assert health and all(name.startswith(f'/diagnostics{namespace}/') for name in health)
    scripts = {}
    for each in foxglove['userNodes'].values():
        (read,), (written,) = (re.findall(rf'{word} = .*?"(.*)"', each['sourceCode']) for word in ('inputs', 'output'))
        scripts[f'/{each["name"]}'] = read
        assert written == f'/{each["name"]}' == f'/degrees{read}' and known[read] == IMU
        assert set(re.findall(r'event\.message\.(\w+)', each['sourceCode'])) <= {'orientation', 'header'}
    for panel in foxglove['configById'].values():
        for path in [*(each['value'] for each in panel.get('paths', [])), *filter(None, [panel.get('topicPath')])]:
            if path.startswith('/degrees'):
                assert path.rpartition('.')[0] in scripts and path.rpartition('.')[2] in ('roll', 'pitch')
            else:
                assert_has(path, r'[.\[]')
    assert f'base_link{"_of_1" * bool(given)}_in_1_0s' in texts[2]


def test_a_layout_for_a_name_that_ros_rejects_is_refused(tmp_path, capsys):
    for words in (['foxglove', '--namespace', 'my boat'], ['rviz', '--output', str(tmp_path / 'a.json')], ['gnuplot']):
        assert main(['layout', *words]) == 2
        assert capsys.readouterr().err.count('\n') == 1 and not list(tmp_path.iterdir())


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
    assert all(service['read_only'] and service['tmpfs'] == '/tmp' for service in services.values())
    for service in services.values():
        words = re.sub(r'\$\{\w+:-([^}]*)\}', r'\1', service['command']).split()
        given = vars(build_parser(words[0]).parse_args(words))
        assert service['network_mode'] == service['ipc'] == 'host'
        if given.get('params_file'):
            assert (CONFIG / given['params_file'].removeprefix('/config/')).is_file()
