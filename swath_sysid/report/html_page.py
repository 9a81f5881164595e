"""The template of all pages: one HTML file that needs nothing else, dark and light, narrow, wide and printed."""

import html
import io
import re
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from typing import Any

from swath_sysid.formats.files import as_utf_8
from swath_sysid.report.figures import MEASURED, SERIES, Figure, loaded_matplotlib, make_printable, use_plain_style
from swath_sysid.report.tables import Table

LONG_WORDS = 28  #: Characters from which a cell is broken into lines.
FOLDED = 16  #: Rows or figures; of more the page shows the number, until it is opened.
#: Of every figure of a page, as wide as the page: a point is from 0.8 px on a telephone to 2 px.
FIGURE_STYLE: Any = {
    **dict.fromkeys(('text.color', 'axes.labelcolor', 'axes.edgecolor', 'xtick.color', 'ytick.color'), MEASURED),
    'figure.figsize': (6.4, 3.3),
    'path.simplify_threshold': 1.0,
    'font.size': 9.5,
    'axes.titlesize': 'medium',
    'legend.fontsize': 9.0,
    'svg.fonttype': 'none',
}


def escaped(text: object) -> str:
    """Text for HTML."""
    return html.escape(as_utf_8(str(text))).replace(' %', '\u00a0%')


@dataclass(frozen=True)
class Drawing:
    """A figure with its name and what it shows."""

    name: str
    caption: str
    figure: Figure

    @cached_property
    def svg(self) -> str:
        """The same text every time."""
        text = io.StringIO()
        make_printable(self.figure)
        with loaded_matplotlib().rc_context({'svg.fonttype': 'none', 'svg.hashsalt': self.name}):
            # the ticks follow the size of the panel, and the layout follows the ticks
            self.figure.draw_without_rendering()
            self.figure.savefig(text, format='svg', metadata={'Date': None, 'Creator': None})
        return text.getvalue()


def page_style() -> AbstractContextManager:
    """The style in which the figures of a page are drawn."""
    use_plain_style()
    matplotlib = loaded_matplotlib()
    return matplotlib.rc_context({**FIGURE_STYLE, 'axes.prop_cycle': matplotlib.cycler(color=SERIES)})


def page(title: str, sections: Iterable[tuple[str, str, Sequence[str]]], unfolded: int | None = None) -> str:
    """A whole page of sections (anchor, plain name, HTML parts); a section whose parts are all empty is left out. Those
    after the first ``unfolded`` ones show their names until they are opened.
    """
    kept = [(anchor, escaped(name), parts) for anchor, name, parts in sections if any(parts)]
    style = resources.files(__package__).joinpath('page.css').read_text(encoding='utf-8')
    contents = ''.join(f'<li><a href="#{anchor}">{name}</a></li>' for anchor, name, _ in kept)
    count = len(kept) if unfolded is None else unfolded
    body = [
        f'<section id="{anchor}"><h2>{name}</h2>\n' + '\n'.join(filter(None, parts)) + '</section>'
        for anchor, name, parts in kept[:count]
    ]
    body += [
        f'<details class="rest"><summary><h2>{name}</h2></summary>\n<section id="{anchor}">'
        + '\n'.join(filter(None, parts))
        + '</section></details>'
        for anchor, name, parts in kept[count:]
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f'<title>{escaped(title)}</title><style>\n{style}</style></head>\n<body><main>\n<h1>{escaped(title)}</h1>\n'
        f'<nav aria-label="Sections"><ul>{contents}</ul></nav>\n' + '\n'.join(body) + '\n</main></body></html>\n'
    )


def paragraph(text: object, kind: str = '') -> str:
    """A paragraph of plain text."""
    return f'<p class="{kind}">{escaped(text)}</p>' if kind else f'<p>{escaped(text)}</p>'


def bullets(lines: Sequence[str]) -> str:
    """A list of plain lines; nothing where there are none."""
    return f'<ul>{"".join(f"<li>{escaped(line)}</li>" for line in lines)}</ul>' if lines else ''


def table_as_html(table: Table) -> str:
    """A table that scrolls where it is too wide, without columns and rows of dashes; nothing where no row is left."""
    shown = [['' if cell == '-' else cell for cell in row] for row in table.shown()]
    kept = table.filled_columns()
    words = {j: 'words' for j in kept if any(isinstance(row[j], str) for row in table.rows)}
    words |= {j: 'words long' for j in words if max(len(row[j]) for row in shown) > LONG_WORDS}
    head = ''.join(f'<th scope="col"{_css(words.get(j))}>{escaped(table.columns[j].name)}</th>' for j in kept)
    rows = [
        ''.join(f'<td{_css(table.marks.get((k, j)), words.get(j))}>{escaped(row[j])}</td>' for j in kept)
        for k, row in enumerate(shown)
        if any(row[1:])
    ]
    if not rows:
        return ''
    body = '\n'.join(f'<tr>{row}</tr>' for row in rows)
    scrolled = f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'
    return (
        f'<div class="table">{table.title and f"<h3>{escaped(table.title)}</h3>"}{paragraph(table.note, "note")}'
        + _folded(scrolled, len(rows), 'rows')
        + (paragraph(table.finding, 'finding') if table.finding else '')
        + '</div>'
    )


def _folded(body: str, count: int, what: str):
    return body if count <= FOLDED else f'<details><summary>{count} {what}</summary>{body}</details>'


def _css(*kinds: str | None):
    named = ' '.join(filter(None, kinds))
    return f' class="{named}"' if named else ''


def inline(drawing: Drawing) -> str:
    """A drawing as a figure of the page: its ink takes the page's colour, its names are its own."""
    name, caption = drawing.name.replace('.', '_'), escaped(drawing.caption)
    body = drawing.svg[drawing.svg.index('<svg') :]
    body = re.sub(r'<metadata>.*?</metadata>', '', body, flags=re.DOTALL)
    referenced = set(re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', body))
    body = re.sub(r' id="([^"]+)"', lambda m: f' id="{name}-{m.group(1)}"' if m.group(1) in referenced else '', body)
    body = re.sub(r'(url\(#|xlink:href="#)', rf'\g<1>{name}-', body)
    body = body.replace(MEASURED, 'currentColor').replace('fill: #ffffff', 'fill: none')
    # the size is that of the page
    head, end, body = body.partition('>')
    head = re.sub(r'\s(?:width|height)="[^"]*"', '', head) + f' role="img" aria-label="{caption}"'
    body = head + end + body
    return f'<figure>{body.strip()}<figcaption>{caption}</figcaption></figure>'


def figures(drawings: Sequence[Drawing]) -> str:
    """A grid of drawings; nothing where there are none."""
    if not drawings:
        return ''
    grid = f'<div class="figures">{"".join(map(inline, drawings))}</div>'
    return _folded(grid, len(drawings), 'figures')
