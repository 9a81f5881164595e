"""README and site say what is true: every command line is one, every name is explained."""

import re
import runpy
import shlex
from pathlib import Path

import pytest
from site_pages import PAGES, command_lines

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.cli.main import VERBS, build_parser
from swath_sysid.common.sentences import SENTENCES, reasons_table
from swath_sysid.formats.topics import LEADS, MANOEUVRING_LEADS, TYPES
from swath_sysid.nodes.parameters.table import NODES, table_of

ROOT = Path(__file__).resolve().parents[1]
SITE = '\n'.join(PAGES.values())


@pytest.mark.parametrize('line', command_lines())
def test_every_command_line_is_one(line):
    words = shlex.split(line.removesuffix('&'))[1:]
    build_parser(words[0]).parse_args(words)


def test_there_are_command_lines_for_every_verb():
    written = {line.split()[1] for line in command_lines()}
    assert set(VERBS) - written <= {'compare', 'scale', 'demo'}
    assert set(re.findall(r'`swath-sysid ([a-z-]+)', SITE)) <= set(VERBS)


def test_every_verb_hull_preset_and_topic_is_explained():
    topics = [name for name in (*TYPES, LEADS, MANOEUVRING_LEADS)]
    assert [name for name in (*VERBS, *PUBLISHED_HULLS, *PRESETS, *topics) if name not in SITE] == []


def test_generated_pages_are_those_of_the_code(tmp_path):
    """Parameters, commands, warnings and what is counted are written by the code when the site is built."""
    (tmp_path / 'conf.py').write_text((ROOT / 'docs' / 'conf.py').read_text(encoding='utf-8'), encoding='utf-8')
    runpy.run_path(str(tmp_path / 'conf.py'))
    written = {path.name: path.read_text(encoding='utf-8') for path in (tmp_path / 'generated').rglob('*.*')}
    for node in NODES:
        assert all(f'| `{parameter.name}` |' in written['parameters.md'] for parameter in table_of(node))
    assert all(f'\n## {verb}\n' in written['commands.md'] for verb in VERBS)
    assert written['counted.md'] == reasons_table()
    rows = written['warnings.md'].splitlines()
    assert all(any(row.startswith(f'| `{key.partition(":")[0]}` |') for row in rows) for key in SENTENCES)
    assert '{' not in written['warnings.md']
