"""No dead link, without the network: files, headings, and what the pages name of the repository."""

import ast
import re
import unicodedata

import pytest
from markdown_it import MarkdownIt
from site_pages import PAGES, ROOT

OTHERS = ('CONTRIBUTING.md', 'QUALITY_DECLARATION.md', 'SECURITY.md')
TEXTS = PAGES | {name: (ROOT / name).read_text(encoding='utf-8') for name in OTHERS}
IGNORED = {line.strip('/') for line in (ROOT / '.gitignore').read_text(encoding='utf-8').split()}
FOLDERS = tuple(
    f'{path.name}/'
    for path in ROOT.iterdir()
    if path.is_dir() and not path.name.startswith('.') and path.name not in IGNORED
)
"""Of the checkout, not those that a run makes."""

MADE = ('docs/generated/', 'examples/swath-pitch/out', 'examples/swath-pitch/trials')
"""Written when the site is built, or by the commands of a page."""

PATH = re.compile(r'(?<![\w/.$)-])((?:\w[\w.-]*/)+[\w.*-]*)')


def tokens_of(text):
    """All tokens, those inside of paragraphs too."""
    for token in MarkdownIt().enable('table').parse(text):
        yield token
        yield from token.children or ()


def anchors_of(text):
    """Those that GitHub and MyST give the headings."""
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
    gone = [path for path in named if not path.startswith(MADE) and not any(ROOT.glob(path.rstrip('/.')))]
    assert gone == []


def test_the_readme_links_every_page_of_the_site():
    linked = {token.attrs.get('href') for token in tokens_of(TEXTS['README.md'])}
    assert [page for page in PAGES if page not in ('README.md', 'docs/index.md') and page not in linked] == []
