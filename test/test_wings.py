"""Core and wings: what a wing hands in is there, and where one is deleted nothing else is missing."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys

import pytest
from repository import ROOT
from test_package import MODULES, PACKAGE, imports_of

import swath_sysid
from swath_sysid.cli.flags import SHARED, table_of_verbs
from swath_sysid.cli.main import VERBS, module_of
from swath_sysid.common.advice import SENTENCES
from swath_sysid.common.wings import named, offered, wings, yaml_table
from swath_sysid.nodes.parameters.table import defaults, node_module, table_of

WINGS = {wing.name: wing for wing in wings()}
OF_CORE = yaml_table(PACKAGE / 'cli' / 'flags.yaml')


def test_the_core_imports_no_wing_and_no_wing_another():
    """The package above them, and the tests: those of the core use no helper of a wing either."""
    paths = {*MODULES, *(ROOT / 'test').rglob('*.py')} - {PACKAGE / '__init__.py'}
    wing_of = {path.stem: path.parent.name for path in (ROOT / 'test').glob('*/*.py')}
    offenders = []
    for path in paths:
        for name in imports_of(path):
            first, *inner = name.split('.')
            wing = inner[0] if first == PACKAGE.name and inner else wing_of.get(first)
            if wing in WINGS and path.relative_to(ROOT).parts[1] != wing:
                offenders.append((str(path.relative_to(ROOT)), name))
    assert offenders == []


@pytest.mark.parametrize('name', WINGS)
def test_all_that_a_wing_hands_in_is_there_and_all_verbs_are_handed_in(name):
    wing, table = WINGS[name], yaml_table(PACKAGE / name / 'flags.yaml')
    own = {verb for verb, entry in table.items() if verb != SHARED and 'summary' in entry}
    assert own.isdisjoint(OF_CORE) and set(table) - {SHARED} <= set(VERBS)
    assert all(callable(module_of(verb).run) and module_of(verb).__name__.split('.')[1] == name for verb in own)
    programs = (path for path in (PACKAGE / name / 'cli').glob('*.py') if '\ndef run(' in path.read_text('utf-8'))
    assert {path.stem.replace('_', '-') for path in programs} == own
    for node in wing.nodes:
        module = ROOT / f'{node_module(node).replace(".", "/")}.py'
        assert '\nPLAN: Plan = ' in module.read_text('utf-8') and defaults(node)
    assert all(parameter in defaults(node) for node, parameter in wing.model_parameters.items())
    assert set(wing.model_parameters) <= set(wing.nodes)
    references = [value for field, value in vars(wing).items() if isinstance(value, str) and field != 'name']
    assert all(callable(named(reference)) for reference in {*references, *wing.papers.values()} - {''})


STAND_IN = {
    'wing.py': """
from swath_sysid.common.wings import Wing

OFFERS = {name: f'stand_in.cli.count {name}' for name in ('plays_bag', 'tables_of_fit', 'trials_shown')}
WING = Wing('stand_in', 3, nodes={'counter': 'stand_in.counter'}, topics={'counts/': 'std_msgs/msg/String'}, **OFFERS)
""",
    'cli/count.py': """
from swath_sysid.common.advice import Advice
from swath_sysid.report.tables import Column, Table

def run(arguments):
    print(arguments.task, arguments.size)
    return 3

def plays_bag(arguments):
    return (7 if arguments.only_count else None), [Advice.of('counted', number=2)]

def tables_of_fit(arguments):
    return lambda found: [Table('counts', 'Counts', '', (Column('what'), Column('n')), (('terms', 2),))]

def trials_shown(manifest):
    return [{'file': manifest}], ['b is missing']
""",
    'flags.yaml': """
count: {summary: count, examples: [count up 1], tasks: {up: {
  summary: up, epilog: "in\\nlines", flags: {size N: {type: count, help: to}}}}}
play-through: {flags: {--only-count: stop}}
shared: {both: {--both: both}}
""",
    'sentences.yaml': "sentences: {counted: '{number} counted'}",
    'parameters.yaml': 'counter: {step: {default: 1, meaning: step}, frame_id: as imu_buffer}',
}


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """The command line and the tables of a core whose only wing is made for the test, loaded anew."""
    for name, text in STAND_IN.items():
        path = tmp_path / 'stand_in' / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(swath_sysid, '__path__', [*swath_sysid.__path__, str(tmp_path)])
    monkeypatch.setattr('swath_sysid.common.wings.PACKAGE', tmp_path)
    caches = wings, table_of_verbs, table_of
    for cache in caches:
        cache.cache_clear()
    try:
        yield lambda module: runpy.run_path(str(PACKAGE / module))
    finally:
        for cache in caches:
            cache.cache_clear()
        for name in [name for name in sys.modules if name.startswith('swath_sysid.stand_in')]:
            del sys.modules[name]


@pytest.mark.long
def test_a_folder_with_a_wing_is_handed_in_everywhere(stand_in, measured, monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(SENTENCES, 'counted', stand_in('common/advice.py')['SENTENCES']['counted'])
    table = stand_in('nodes/parameters/table.py')
    assert 'counter' in table['NODES'] and table['node_module']('counter') == 'swath_sysid.stand_in.counter'
    assert table['defaults']('counter') == {'step': 1, 'frame_id': 'base_link'}
    swath = stand_in('cli/main.py')['main']
    assert swath(['count', 'up', '4']) == 3 and capsys.readouterr().out == 'up 4\n'
    played = ['play-through', str(measured / 'trial.mcap'), '--output', str(tmp_path / 'out.mcap')]
    assert swath([*played, '--only-count']) == 7 and not (tmp_path / 'out.mcap').exists()
    assert swath(played) == 0 and '2 counted' in capsys.readouterr().err
    assert swath(['identify', str(measured / 'trial.csv'), '--equation', 'linear', '--force', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['counts'] == [{'what': 'terms', 'n': 2}]
    assert [shows('a.yaml') for shows in offered('trials_shown')] == [([{'file': 'a.yaml'}], ['b is missing'])]


#: what asks for that which wings hand in, or looks through the whole checkout
TESTS = (
    'files_untrusted files_outputs nodes_parameter_tables nodes_launch cli_run package site_links docs_commands wings'
)
OF_CLI = 'flags_that_advice_is_given or slip or completes or lists or examples or reference or checkers'
TOLD = """
import contextlib, importlib, io, json, pkgutil
import swath_sysid
told = {'names': dir(swath_sysid)}
from swath_sysid.cli.main import VERBS, main
for verb in ('', *VERBS):
    with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):
        main([verb, '--help'] if verb else ['--help'])
    told[verb] = text.getvalue()
for name in swath_sysid.__all__:
    getattr(swath_sysid, name)
for module in pkgutil.walk_packages(swath_sysid.__path__, 'swath_sysid.'):
    if not module.name.endswith('__main__'):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            if error.name.startswith('swath_sysid'):
                raise
print(json.dumps(told))
"""


def run_in(folder, *words):
    """What Python prints there: in a process that knows nothing of this one's tests."""
    others = {name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')}
    environment = others | {'PYTHONPATH': str(folder), 'COLUMNS': '9999'}
    done = subprocess.run([sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, (done.stdout + done.stderr)[-5000:]
    return done.stdout


def flags_in(entries):
    """The flags in an entry of a table of verbs, in groups too."""
    for words, entry in entries.items():
        if words.startswith('--'):
            yield words.split()[0]
        elif isinstance(entry, dict):
            yield from flags_in(entry)


def without(told, wing):
    """What the command line would tell without a wing."""
    table = yaml_table(PACKAGE / wing.name / 'flags.yaml')
    verbs = [verb for verb in table if verb in told and 'summary' in table[verb]]
    left = {verb: text for verb, text in told.items() if verb not in verbs}
    for verb in verbs:
        left[''] = re.sub(rf'\n    {verb} .*', '', left[''])
    for verb in set(table) & set(left):
        for flag in flags_in(table[verb]['flags']):
            left[verb] = re.sub(rf' \[{flag}\b[^]]*\]|\n  {flag}\b.*(\n {{9,}}.*)*', '', left[verb])
    for node in wing.nodes:
        left['run'] = left['run'].replace(f' {node},', '')
    # not in verbs of the core, whose hulls have the names of studies
    for verb in set(left) - set(OF_CORE):
        for study in wing.papers:
            left[verb] = left[verb].replace(f',{study}', '')
    return left


@pytest.fixture(scope='module')
def told_here():
    return run_in(ROOT, '-c', TOLD)


@pytest.mark.long
@pytest.mark.parametrize(
    'gone', [*filter(None, dict.fromkeys([*((name,) for name in WINGS), (*WINGS,)]))], ids=' '.join
)
def test_where_wings_are_deleted_nothing_else_is_missing(gone, told_here, tmp_path):
    ignored = (ROOT / '.gitignore').read_text(encoding='utf-8').replace('/', '').split()
    copy = tmp_path / 'copy'
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns('.git', *ignored))
    for place in (f'{folder}/{name}' for folder in (PACKAGE.name, 'test') for name in gone):
        shutil.rmtree(copy / place)
    expected, found = json.loads(told_here), json.loads(run_in(copy, '-c', TOLD))
    home_of = swath_sysid._HOME_OF
    of_gone = {name for name in home_of if home_of[name].partition('.')[0] in gone}
    assert set(expected.pop('names')) - of_gone == set(found.pop('names'))
    for name in gone:
        expected = without(expected, WINGS[name])
    assert found == expected
    if len(gone) < len(WINGS):
        return  # what the tests of the core need is gone with all of them, if ever
    tests = [f'test/test_{name}.py' for name in TESTS.split()]
    quick = ('-m', 'pytest', '-q', '-p', 'no:cacheprovider', '-m', 'not dds and not long and not release')
    run_in(copy, *quick, *tests)
    run_in(copy, *quick, 'test/test_cli.py', 'test/test_public_api.py', '-k', OF_CLI)
