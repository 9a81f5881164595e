"""Core and wings: what a wing hands in is there, and where one is deleted nothing else is missing."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from repository import ROOT
from test_package import MODULES, PACKAGE, imports_of

import swath_sysid
from swath_sysid.cli.flags import SHARED
from swath_sysid.cli.main import VERBS, module_of
from swath_sysid.common.wings import named, wings, yaml_table
from swath_sysid.nodes.parameters.table import defaults, node_module

WINGS = {wing.name: wing for wing in wings()}


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
    assert own.isdisjoint(yaml_table(PACKAGE / 'cli' / 'flags.yaml')) and set(table) - {SHARED} <= set(VERBS)
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


#: of each room of the core what is quick, and all that asks for what wings hand in
TESTS = (
    'common_sentences common_signals motion_attitude hull_schedule hull_simulation prediction_quiescence '
    'pipeline_baselines files_csv files_untrusted files_outputs formats_points report_fit_figure page_live_view '
    'nodes_parameter_tables nodes_launch nodes_messages cli cli_run package public_api site_links docs_commands light '
    'wings'
).split()
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
    for listed in (*(f' {node},' for node in wing.nodes), *(f',{study}' for study in wing.papers)):
        left = {verb: text.replace(listed, '') for verb, text in left.items()}
    return left


@pytest.mark.long
@pytest.mark.parametrize('gone', [*([name] for name in WINGS), list(WINGS)], ids=' '.join)
def test_where_wings_are_deleted_nothing_else_is_missing(gone, tmp_path):
    ignored = (ROOT / '.gitignore').read_text(encoding='utf-8').replace('/', '').split()
    copy = tmp_path / 'copy'
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns('.git', *ignored))
    for place in (f'{folder}/{name}' for folder in (PACKAGE.name, 'test') for name in gone):
        shutil.rmtree(copy / place)
    expected, found = (json.loads(run_in(folder, '-c', TOLD)) for folder in (ROOT, copy))
    home_of = swath_sysid._HOME_OF
    of_gone = {name for name in home_of if home_of[name].partition('.')[0] in gone}
    assert set(expected.pop('names')) - of_gone == set(found.pop('names'))
    for name in gone:
        expected = without(expected, WINGS[name])
    assert found == expected
    tests = [f'test/test_{name}.py' for name in TESTS]
    run_in(copy, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '-m', 'not dds and not long', *tests)
