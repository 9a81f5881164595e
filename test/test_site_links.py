"""README and site say what is true: links, what they name of the repository, command lines, explained names."""

import ast
import re
import runpy
import subprocess
import sys
import unicodedata

import pytest
from markdown_it import MarkdownIt
from repository import ABSENT, ROOT
from site_pages import PAGES, command_lines, parse

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.cli.main import VERBS
from swath_sysid.common.advice import SENTENCES
from swath_sysid.common.conditions import GROUPS
from swath_sysid.common.wings import handed_in
from swath_sysid.formats.topics import LEADS, TYPES
from swath_sysid.nodes.parameters.table import NODES, table_of

OTHERS = ('CONTRIBUTING.md', 'QUALITY_DECLARATION.md', 'SECURITY.md')
TEXTS = PAGES | {name: (ROOT / name).read_text(encoding='utf-8') for name in OTHERS}
IGNORED = {line.strip('/') for line in (ROOT / '.gitignore').read_text(encoding='utf-8').split()}
IN_ROOT = [path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith('.')]
FOLDERS = tuple(f'{name}/' for name in IN_ROOT if name not in IGNORED)
#: written when the site is built, or by the commands of a page; and of absent wings
ELSEWHERE = ('docs/generated/', 'examples/swath-pitch/out', 'examples/swath-pitch/trials')
ELSEWHERE += tuple(f'{folder}/{wing}' for folder in ('swath_sysid', 'test') for wing in ABSENT)
PATH = re.compile(r'(?<![\w/.$)-])((?:\w[\w.-]*/)+[\w.*-]*)')


PIPES = {'stdout': subprocess.PIPE, 'stderr': subprocess.DEVNULL, 'text': True}
SITE = '\n'.join(PAGES.values())


def tokens_of(text):
    for token in MarkdownIt().enable('table').parse(text):
        yield token
        yield from token.children or ()


def anchors_of(text):
    tokens = list(MarkdownIt().parse(text))
    titles = [after.content for token, after in zip(tokens, tokens[1:], strict=False) if token.type == 'heading_open']
    return {re.sub(r'[^\w\- ]', '', unicodedata.normalize('NFC', title.lower())).replace(' ', '-') for title in titles}


def written_by_the_build():
    """The names that docs/conf.py hands to its ``write``."""
    tree = ast.parse((ROOT / 'docs' / 'conf.py').read_text(encoding='utf-8'))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'write']
    return {f'docs/generated/{call.args[0].value}' for call in calls if isinstance(call.args[0], ast.Constant)}


@pytest.mark.parametrize('page', TEXTS)
def test_every_link_leads_somewhere(page):
    dead = []
    for token in tokens_of(TEXTS[page]):
        link = token.attrs.get('href') or token.attrs.get('src') or ''
        if not link or re.match(r'\w+:', link):
            continue
        file, _, anchor = link.partition('#')
        target = (ROOT / page).parent.joinpath(file).resolve().relative_to(ROOT).as_posix() if file else page
        if not (ROOT / target).exists() and target not in written_by_the_build():
            dead.append(link)
        elif anchor and anchor not in anchors_of(TEXTS[target]):
            dead.append(link)
    assert dead == []


@pytest.mark.parametrize('page', TEXTS)
def test_what_is_named_of_the_repository_is_there(page):
    """Paths in code and in commands that begin with a folder of the checkout."""
    codes = [token.content for token in tokens_of(TEXTS[page]) if token.type in ('code_inline', 'fence')]
    named = {path for code in codes for path in PATH.findall(code) if path.startswith(FOLDERS)}
    gone = [path for path in named if not path.startswith(ELSEWHERE) and not any(ROOT.glob(path.rstrip('/.')))]
    assert gone == []


def test_the_site_lists_every_page_and_the_readme_fits_on_a_screen_with_absolute_links_on_an_index():
    trees = re.findall(r'```{toctree}\n(?::.*\n)*\n([^`]*)```', PAGES['docs/index.md'])
    listed = {f'docs/{name}' for tree in trees for name in tree.split()}
    assert {page.removesuffix('.md') for page in PAGES} - listed == {'README.md'.removesuffix('.md'), 'docs/index'}
    readme = TEXTS['README.md']
    assert len(readme.split()) <= 350
    assert len([token for token in tokens_of(readme) if token.type == 'link_open']) <= 10
    assert max(each.stat().st_size for each in (ROOT / 'docs').glob('motion*.gif')) <= 1.5e6
    pytest.importorskip('setuptools')
    done = subprocess.run([sys.executable, 'setup.py', '-q', '--long-description'], cwd=ROOT, **PIPES)
    links = [token.attrs.get('href') or token.attrs.get('src') for token in tokens_of(done.stdout)]
    assert done.returncode == 0 and [link for link in links if link and not link.startswith('https://')] == []
    pictures = re.findall(r'\bsrc(?:set)?="([^"]+)', done.stdout)
    assert sum(map(bool, links)) > 5 and all(picture.startswith('https://') for picture in pictures)


@pytest.mark.parametrize('line', command_lines())
def test_every_command_line_is_one(line):
    parse(line)


def test_every_verb_hull_preset_and_topic_is_explained():
    names = (*VERBS, *PUBLISHED_HULLS, *PRESETS, *TYPES, LEADS, *handed_in('topics'))
    assert [name for name in names if name not in SITE] == []
    assert set(re.findall(r'`swath-sysid ([a-z-]+)', SITE)) <= set(VERBS) or ABSENT
    assert set(VERBS) - {line.split()[1] for line in command_lines()} <= {'compare', 'scale', 'demo'}


def test_generated_pages_are_those_of_the_code(tmp_path):
    (tmp_path / 'conf.py').write_text((ROOT / 'docs' / 'conf.py').read_text(encoding='utf-8'), encoding='utf-8')
    runpy.run_path(str(tmp_path / 'conf.py'))
    written = {path.name: path.read_text(encoding='utf-8') for path in (tmp_path / 'generated').rglob('*.*')}
    for node in NODES:
        assert all(f'| `{parameter.name}` |' in written['parameters.md'] for parameter in table_of(node))
    assert all(f'\n## {verb}\n' in written['commands.md'] for verb in VERBS)
    conditions = written['conditions.md']
    for code, each in ((code, each) for rows in GROUPS.values() for code, each in rows.items()):
        assert f'| `{code}` | {each.level} |' in conditions and each.cure.replace('|', '\\|') in conditions
    assert all(
        f'../generated/parts/{name}.md' in PAGES['docs/reference/warnings.md'] for name in ('conditions', 'warnings')
    )
    rows = written['warnings.md'].splitlines()
    assert all(any(row.startswith(f'| `{key.partition(":")[0]}` |') for row in rows) for key in SENTENCES)
    assert '{' not in written['warnings.md'] + conditions
