"""The pages that a visitor reads, and the blocks in them."""

import re
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).resolve().parents[1]
#: text by name; what is written when the site is built is not among them
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding='utf-8')
    for path in [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
    if 'generated' not in path.parts
}
#: names that stand for the user's own, and what the shell puts in
EXAMPLE = re.compile(r'[A-Z]{3,}|\.\.\.|\$')


@dataclass(frozen=True)
class Block:
    """A block of a page; its manner is the word after the language: ``stays`` beside what follows, or ``alone``."""

    language: str
    manner: str
    text: str


def blocks_of(page):
    tokens = [token for token in MarkdownIt().parse(PAGES[page]) if token.type in ('fence', 'code_block')]
    words = [(token.info.partition(' '), token.content) for token in tokens]
    return [Block(language, manner.strip(), text) for (language, _, manner), text in words if '{' not in language]


def command_lines():
    """Every ``swath-sysid`` command of the pages, in a block or in a sentence, as a shell would hand it over."""
    scripts = [block.text.replace('\\\n', ' ') for page in PAGES for block in blocks_of(page)]
    lines = re.findall(r'^\s*(swath-sysid .*)$', '\n'.join(scripts), flags=re.MULTILINE)
    lines += re.findall(r'`(swath-sysid [a-z-]+\s[^`]+)`', '\n'.join(PAGES.values()))
    lines = {' '.join(line.split(' #')[0].split('--ros-args')[0].split()) for line in lines if not EXAMPLE.search(line)}
    return sorted(lines)
