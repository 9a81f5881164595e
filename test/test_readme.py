"""README and site say what is true: every link leads somewhere, every command line is one, every name is explained."""
import re
import runpy
import shlex
from pathlib import Path

import pytest

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.cli.main import VERBS, build_parser
from swath_sysid.formats.topics import LEADS, MANOEUVRING_LEADS, TYPES
from swath_sysid.nodes.parameters.files import NODES, table_of
from swath_sysid.nodes.reason_advice import reasons_table

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / 'README.md', *sorted(p for p in (ROOT / 'docs').rglob('*.md') if 'generated' not in p.parts)]
SITE = '\n'.join(path.read_text(encoding='utf-8') for path in PAGES)
EXAMPLE = re.compile(r'[A-Z]{3,}|\.\.\.')
"""Names that stand for the user's own."""


def command_lines():
    """Every command in the pages, on a line of its own or in a sentence, as a shell would hand it over."""
    lines = re.findall(r'^\s+(swath-sysid .*)$', SITE, flags=re.MULTILINE)
    lines += [' '.join(found.split()) for found in re.findall(r'`(swath-sysid [a-z-]+\s[^`]+)`', SITE)]
    return sorted({line.split(' #')[0].split('--ros-args')[0].strip() for line in lines if not EXAMPLE.search(line)})


def is_generated(link):
    """Whether a page is written when the site is built."""
    return link.startswith(('generated/', '../generated/'))


def test_the_readme_is_short_and_begins_with_a_picture():
    lines = (ROOT / 'README.md').read_text(encoding='utf-8').splitlines()
    assert len(lines) <= 150
    assert lines[2].startswith('![') and 'docs/forecast.png' in lines[2]


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_linked_files_exist(page):
    links = re.findall(r'\]\(([^)#:]+)\)', page.read_text(encoding='utf-8'))
    assert [link for link in links if not is_generated(link) and not (page.parent / link).exists()] == []


def test_every_page_is_in_the_contents():
    contents = (ROOT / 'docs' / 'index.md').read_text(encoding='utf-8')
    names = [p.relative_to(ROOT / 'docs').with_suffix('').as_posix() for p in PAGES[1:]]
    assert [name for name in names if f'\n{name}\n' not in contents and name != 'index'] == []


@pytest.mark.parametrize('line', command_lines())
def test_every_command_line_is_one(line):
    words = shlex.split(line.removesuffix('&'))[1:]
    build_parser(words[0]).parse_args(words)


def test_there_are_command_lines_for_every_verb():
    written = {line.split()[1] for line in command_lines()}
    assert set(VERBS) - written <= {'compare', 'scale', 'demo'}


def test_every_verb_hull_preset_and_topic_is_explained():
    topics = [name for name in (*TYPES, LEADS, MANOEUVRING_LEADS)]
    assert [name for name in (*VERBS, *PUBLISHED_HULLS, *PRESETS, *topics) if name not in SITE] == []


def test_generated_pages_are_those_of_the_code(tmp_path):
    """Parameters, commands and what is counted are written by the code when the site is built."""
    (tmp_path / 'conf.py').write_text((ROOT / 'docs' / 'conf.py').read_text(encoding='utf-8'), encoding='utf-8')
    runpy.run_path(str(tmp_path / 'conf.py'))
    written = {path.name: path.read_text(encoding='utf-8') for path in (tmp_path / 'generated').rglob('*.*')}
    for node in NODES:
        assert all(f'| `{parameter.name}` |' in written['parameters.md'] for parameter in table_of(node))
    assert all(f'\n## {verb}\n' in written['commands.md'] for verb in VERBS)
    assert written['counted.md'] == reasons_table()
    assert 'automodule:: swath_sysid.pipeline.scoring' in written['pipeline.rst']
