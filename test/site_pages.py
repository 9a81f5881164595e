"""The pages that a visitor reads, and the blocks in them."""

import re
import shlex
from dataclasses import dataclass

from markdown_it import MarkdownIt
from repository import ABSENT, ROOT

from swath_sysid.cli.main import build_parser
from swath_sysid.common.errors import InputError

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


def commands_of(page):
    """The ``swath-sysid`` commands of a page, in a block or in a sentence, as a shell would hand them over."""
    scripts = '\n'.join(block.text.replace('\\\n', ' ') for block in blocks_of(page))
    lines = re.findall(r'^\s*(swath-sysid .*)$', scripts, flags=re.MULTILINE)
    lines += re.findall(r'`(swath-sysid [a-z-]+\s[^`]+)`', PAGES[page])
    return {' '.join(line.split(' #')[0].split('--ros-args')[0].split()) for line in lines if not EXAMPLE.search(line)}


def parse(line):
    """Raise `InputError` unless a command is one."""
    words = shlex.split(line.removesuffix('&'))[1:]
    build_parser(words[0]).parse_args(words)


def is_left_over(line):
    """Whether a command is that of an absent wing: while one is absent, there is no such verb or flag."""
    try:
        parse(line)
    except InputError:
        return bool(ABSENT)
    return False


def command_lines():
    """Every command of the pages."""
    return sorted(line for line in set().union(*map(commands_of, PAGES)) if not is_left_over(line))
