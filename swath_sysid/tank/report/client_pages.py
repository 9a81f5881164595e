"""The two pages for the client of a campaign: what was tested and what came out; how, within which limits, how sure."""

import base64
from collections.abc import Callable, Iterator
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from swath_sysid import __version__
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.identification.fit_quality import ADEQUATE_ERROR
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL, LEVELS, TWO_STD, digits, percent
from swath_sysid.common.errors import InputError
from swath_sysid.report.figures import LINE_STYLES, curves_of, legend_below, new_figure, quiet, two_std_band
from swath_sysid.report.html_page import Drawing, bullets, escaped, figures, paragraph, table_as_html
from swath_sysid.report.tables import Table
from swath_sysid.tank.campaign.manifest import LOADING_NAMES, PICTURES, loading_in_words
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.extinction import TankQuantity
from swath_sysid.tank.report.campaign_results import (
    ANGLES,
    draft_results,
    in_words,
    left_out_of,
    place_of,
    places_of,
    results_table,
    used_of,
)
from swath_sysid.tank.report.campaign_tables import colour_of, sides_statement, spread_statement
from swath_sysid.tank.report.extinction_tables import SOURCES, conditions_table

NOT_STATED = 'not stated'
LONGEST_LIST = 8  #: Names of files that stand for test numbers one by one.
#: Terms of the equation of motion, in the symbols of the papers.
PRINTED = {
    'b0': '{b0} sgn({x}̇)',
    'b1': '{b1} {x}̇',
    'b2': '{b2} |{x}̇| {x}̇',
    'b3': '{b3} {x}̇³',
    'r1': '{r1} {x}',
    'r2': '{r2} {x}²',
    'r3': '{r3} {x}³',
    's1': '{s1} sin {x}',
    's2': '{s2} sin² {x}',
}
RESULTS = 'natural period', 'equivalent damping ratio', 'B44', 'B55'  #: Of the quantities of a tank, those shown.
FOR_THE_TANK = 'columns-understood', 'columns-left-out'  #: Advice on how files were read that changes no result.
MEANING = {
    ADEQUATE: f'adequate: the forecast of the next decay is off by at most {percent(ADEQUATE_ERROR)} of its motion',
    DOUBTFUL: 'doubtful: it may be off by more, or something in the records contradicts the model',
}


def cover(outcome: CampaignOutcome) -> list[str]:
    """Title block, verdict, results and picture."""
    left_out = [*outcome.manifest.faults, *left_out_of(outcome), *outcome.failures]
    rows = ''.join(f'<dt>{escaped(name)}</dt><dd>{escaped(value)}</dd>' for name, value in title_rows(outcome))
    return [
        _logo(outcome),
        f'<dl class="block">{rows}</dl>',
        f'<div class="choice">{paragraph(verdict_sentence(outcome))}</div>',
        table_as_html(results_table(outcome, for_eye=True)),
        figures(list(result_drawings(outcome))),
        *(paragraph(f'Left out: {line}', 'left-out') for line in left_out),
    ]


def title_rows(outcome: CampaignOutcome) -> Iterator[tuple[str, str]]:
    """Name and value of every line of the title block."""
    craft, block = outcome.manifest.craft, outcome.manifest.title_block
    stems = list(dict.fromkeys(t.entry.path.stem for t in outcome.trials if t.record is not None))
    of_files = ', '.join(stems) if len(stems) <= LONGEST_LIST else f'{stems[0]} to {stems[-1]} ({len(stems)} files)'
    yield 'Client', block.client or NOT_STATED
    yield 'Tank', ', '.join(filter(None, (block.tank, craft.basin))) or NOT_STATED
    yield 'Date', block.date or NOT_STATED
    yield 'Author', block.author or NOT_STATED
    yield 'Tests', block.test_numbers or of_files
    yield 'Model', f'{craft.name}, scale {block.scale or NOT_STATED}'
    rows = [(*name.replace(']', '').partition(' ['), value) for name, value in conditions_table(outcome).rows]
    said = [f'{name} {value} {unit}'.rstrip() for name, _, unit, value in rows if name not in ('basin', 'speed')]
    yield 'Particulars', ', '.join(said) or NOT_STATED
    for axis in outcome.axes:
        speed = f'at {axis.speed_m_s:g} m/s' if axis.speed_m_s else 'at rest'
        name, _, unit = LOADING_NAMES[outcome.quantity].partition(' [')
        unit = f'of {craft.draft_m:g} m' if outcome.quantity == 'draft_factor' and craft.draft_m else unit
        loadings = ', '.join(f'{each:g}' for each in axis.by_draft)
        angles = ', '.join(signed(each) for each in sorted({c.initial_angle_deg for c in axis.together}))
        yield (
            'Conditions',
            f'{axis.motion} decays {speed}, {f"{name} {loadings} {unit}".rstrip("] ")}, released from {angles} deg; '
            f'{used_of(outcome)}',
        )


def signed(angle_deg: float) -> str:
    """An angle of release with its sign."""
    return f'{angle_deg:+g}'.replace('-', '−')


def _logo(outcome: CampaignOutcome) -> str:
    path = outcome.manifest.title_block.logo
    if path is None:
        return ''
    try:
        content = base64.b64encode(path.read_bytes()).decode('ascii')
    except OSError as error:
        raise InputError(f'cannot read the logo {path}: {error.strerror}') from error
    return f'<img class="logo" alt="logo" src="data:{PICTURES[path.suffix.lower()]};base64,{content}">'


def verdict_sentence(outcome: CampaignOutcome) -> str:
    """What the results are good for, the verdicts together."""
    results = draft_results(outcome)
    parts = []
    for level in reversed(LEVELS):
        of_level = [each for each in results if each.verdict == level]
        if not of_level:
            continue
        places = (
            'all results' if len(of_level) == len(results) else ' and '.join(place_of(outcome, r) for r in of_level)
        )
        verb = 'are' if len(of_level) > 1 or len(results) == 1 else 'is'
        if level == ADEQUATE:
            off = max(each.fit.verdict.motion_error for each in of_level)
            expected = f'the fitted equation forecasts the next decay to within {percent(off, 2)} of its motion'
            parts.append(f'{places} {verb} adequate: {expected}')
        else:
            because = '; '.join(dict.fromkeys(each.fit.verdict.sentence for each in of_level))
            parts.append(f'{places} {verb} {level}: {because}')
    text = '; '.join(parts)
    return f'{text[0].upper()}{text[1:]}.'


def result_drawings(outcome: CampaignOutcome) -> Iterator[Drawing]:
    """Natural period and equivalent damping of each draft against amplitude, side by side."""
    for axis in outcome.axes:
        figure = new_figure(6.4, 2.7)
        panels = list(map(quiet, figure.subplots(1, 2)))
        labels = {'natural period [s]': f'T{ANGLES[axis.motion]} [s]', 'equivalent damping ratio [-]': 'ζ [-]'}
        for axes, (label, symbol) in zip(panels, labels.items(), strict=True):
            axes.set(xlabel=f'{axis.motion} amplitude [deg]', ylabel=symbol)
            ends: list[float] = []
            for style, (loading, fits) in zip(cycle(LINE_STYLES), axis.by_draft.items()):
                bands = fits[axis.choice].bands
                amplitude, (value, std) = np.degrees(bands.curves.amplitude), curves_of(bands)[label]
                colour, name = colour_of(axis, loading), loading_in_words(outcome.quantity, loading)
                two_std_band(axes, amplitude, value, std, color=colour, alpha=0.15)
                axes.plot(amplitude, value, style, color=colour, linewidth=1.8, label=name)
                ends += [np.nanmin(value), np.nanmax(value)]
            # by the curves: a band that is wide where little was measured shall not hide them
            margin = 0.3 * (max(ends) - min(ends)) + 0.01 * max(ends)
            axes.set(xlim=(0.0, None), ylim=(0.0 if axes is panels[1] else min(ends) - margin, max(ends) + margin))
        legend_below(panels[0], 2)
        caption = (
            f'Natural period and equivalent damping ratio against amplitude, {axis.axis}; bands: two standard '
            'deviations of the fit'
        )
        yield Drawing(f'result_{axis.axis}', caption, figure)


def method(outcome: CampaignOutcome) -> list[str]:
    """How it was found, how sure it is, and where it holds."""
    found: list[str] = ['<h3>Method</h3>']
    for axis in outcome.axes:
        terms, x = axis.schedule.equation.terms, ANGLES[axis.motion]
        motion = ' + '.join(PRINTED[term].format(x=x, **{t: t for t in terms}) for term in terms)
        found += [
            paragraph(
                f'Free {axis.motion} decays in still water (ITTC 7.5-02-07-04.5): the model is released at an angle '
                f'and left to itself. The equation of motion {x}̈ + {motion} = 0, each coefficient divided by the '
                'inertia with added inertia, is fitted to the whole motion of all releases of a draft together; period '
                'and damping are those of its solution.'
            ),
            table_as_html(_coefficients(outcome, axis)),
        ]
    found.append('<h3>Uncertainty</h3>')
    found.append(table_as_html(_budget(outcome)))
    for axis in outcome.axes:
        found += [paragraph(line) for line in (spread_statement(axis), sides_statement(outcome, axis)) if line]
    found += [
        '<h3>Limits</h3>',
        bullets(list(_limits(outcome))),
        paragraph(f'Evaluated with swath_sysid {__version__}.'),
    ]
    return found


def _coefficients(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """The coefficients of every draft, each with its uncertainty in one cell."""
    items = [(loading, fits[axis.choice]) for loading, fits in axis.by_draft.items()]

    def of(term: str):
        return lambda item: in_words(item[1].ratio(term)[0], TWO_STD * item[1].ratio(term)[1])

    return Table.of(
        '',
        '',
        'Coefficients over inertia, for small angles in rad; ±: two standard deviations of the fit.',
        items,
        (LOADING_NAMES[outcome.quantity], lambda item: item[0], digits(4)),
        *((f'{term} [{RATIO_UNITS[term].replace("^2", "²")}]', of(term)) for term in items[0][1].model.terms),
    )


def _budget(outcome: CampaignOutcome) -> Table:
    """Contributions to the uncertainty of every draft at its middle amplitude, in percent of the value, to the third
    digit of the expanded one.
    """
    items = []
    for result in draft_results(outcome):
        at, own = result.rows[len(result.rows) // 2]
        items += [(result, at, q) for q in own if q.name in RESULTS]

    def share(of: Callable[[TankQuantity], float | None], more: int = 1):
        def shown(item: tuple[Any, float, TankQuantity]) -> str | None:
            quantity, part = item[2], of(item[2])
            places = places_of(abs(100.0 * quantity.expanded / quantity.value)) + more
            return None if part is None or np.isnan(part) else f'{abs(100.0 * part / quantity.value):.{places}f} %'

        return shown

    return Table.of(
        '',
        '',
        'Standard uncertainties (k = 1) in percent of the value. U is twice the root sum of squares of the larger of '
        'fit and scatter, and of the others.',
        items,
        *([('axis', lambda item: item[0].axis.axis)] if len(outcome.axes) > 1 else []),
        (LOADING_NAMES[outcome.quantity], lambda item: item[0].loading, digits(4)),
        ('at [deg]', lambda item: item[1], digits(3)),
        ('quantity', lambda item: item[2].name),
        ('fit', share(lambda q: q.fit)),
        ('scatter of releases', share(lambda q: q.repeats)),
        *((name, share(partial(_of_source, source))) for source, name in SOURCES.items()),
        ('U (k = 2)', share(lambda q: q.expanded, more=0)),
    )


def _of_source(source: str, quantity: TankQuantity) -> float | None:
    return quantity.type_b.get(source)


def _limits(outcome: CampaignOutcome) -> Iterator[str]:
    """Where the results hold, and what they do not contain."""
    measured = [(place_of(outcome, each), *np.degrees(each.fit.amplitude_range)) for each in draft_results(outcome)]
    ranges = '; '.join(f'{low:.2g} to {high:.2g} deg ({place})' for place, low, high in measured)
    yield f'The results hold for the amplitudes measured: {ranges}.'
    speeds = sorted({axis.speed_m_s for axis in outcome.axes})
    under_way = ' and '.join(f'{speed:g} m/s' for speed in speeds) if any(speeds) else 'zero speed'
    yield f'The results hold at {under_way}, in still water of the depth and width of this tank.'
    if any(len(axis.by_draft) > 1 for axis in outcome.axes):
        yield 'Between the drafts the coefficients may be interpolated linearly; they are not extrapolated.'
    yield (
        'The results are those at model scale: Froude scaling keeps wave damping, but viscous damping does not scale '
        'with it (ITTC 7.5-02-07-04.5).'
    )
    yield f'Verdicts: {MEANING[ADEQUATE]}; {MEANING[DOUBTFUL]}; rejected results are not to be used.'
    yield from dict.fromkeys(
        f'{advice.message[0].upper()}{advice.message[1:]}.'
        for t in outcome.trials
        for advice in t.advice
        if t.record and advice.code not in FOR_THE_TANK
    )
