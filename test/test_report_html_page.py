"""The template of all pages: it needs nothing else, holds together, and shows each table and drawing as it is."""

import csv
import io
import re

from matplotlib.figure import Figure

from swath_sysid.report.figures import legend_below
from swath_sysid.report.html_page import Drawing, bullets, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.published import citation, verdict_mark
from swath_sysid.report.tables import Table, columns_of, table_as_csv


def assert_holds_together(text):
    ids = re.findall(r'\sid="([^"]*)"', text)
    references = set(re.findall(r'\s(?:src|href|xlink:href|data)="([^"]*)"', text)) - {'data:,'}
    assert len(ids) == len(set(ids)) and references <= {f'#{each}' for each in ids}
    assert '<script' not in text and '@import' not in text and 'url(http' not in text


def drawing(name):
    with page_style():
        figure = Figure()
        axes = figure.subplots()
        axes.plot([0.0, 1.0], [0.1, 0.3], label='roll')
        legend_below(axes)
    return Drawing(name, f'{name} < 5 %', figure)


def test_a_table_shows_what_there_is_and_its_file_every_digit():
    items = [('a <b>', 1 / 3), ('many words that are broken into lines', 0.25)]
    columns = ('what', lambda item: item[0]), ('share', lambda item: item[1], '{:.2f}'.format), ('n', lambda item: None)
    table = Table.of('shares', 'Shares', 'of all', items, *columns)
    (first, _), shown = csv.DictReader(io.StringIO(table_as_csv(table))), table_as_html(table)
    assert float(first['share']) == 1 / 3 and first['n'] == ''
    assert '0.33' in shown and 'a &lt;b&gt;' in shown and '>n<' not in shown and 'words long' in shown
    pairs = tuple((k, 2 * k) for k in range(20))
    shown = table_as_html(Table('rows', '', '', columns_of({'k': str, 'n': str}), pairs, {(3, 1): 'best'}))
    assert '<details><summary>20 rows</summary>' in shown and '<td class="best">6</td>' in shown
    assert table_as_html(Table('none', '', '', table.columns[:2], ((1, None),))) == figures([]) == bullets([]) == ''


def test_no_cell_of_a_csv_file_is_a_formula():
    table = Table(
        'cells', '', '', columns_of({'=k': str}), (('=1+2',), ('-3.5',), (-4.5,), ('+1e3',), ('@x',), ('-x',))
    )
    assert table_as_csv(table).split() == ["'=k", "'=1+2", '-3.5', '-4.5', '+1e3', "'@x", "'-x"]


def test_a_page_holds_together_and_shows_only_what_there_is():
    drawn = drawing('decay'), drawing('roll.at 5')
    assert drawn[0].svg == drawing('decay').svg and 'legend' in drawn[0].svg
    parts = [paragraph('5 %', 'note'), bullets(['one', 'two']), figures(drawn)]
    text = page('A <small> page', [('first', 'A & B', parts), ('empty', 'Nothing', ['', ''])])
    assert_holds_together(text)
    assert '<h1>A &lt;small&gt; page</h1>' in text and 'A &amp; B' in text and 'Nothing' not in text
    assert 'aria-label="decay &lt; 5\u00a0%"' in text and text.count('<figure>') == 2
    assert '<p class="note">5\u00a0%</p>\n<ul><li>one</li><li>two</li></ul>' in text


def test_papers_are_cited_by_what_is_known_and_verdicts_are_marked():
    assert citation('A title', 'A. Author') == 'A. Author: A title.' and 'not known' in citation('A title', None)
    assert [*map(verdict_mark, ('yes, all', 'no', 'in part', 'by construction'))] == ['best', 'beyond', 'beyond', '']
