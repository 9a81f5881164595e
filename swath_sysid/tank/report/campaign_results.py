"""What a client asks of a campaign: for each draft the period, the damping at named amplitudes, and a verdict."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from swath_sysid.attitude.identification.result import Identification
from swath_sysid.attitude.motion.trial import axis_in_words
from swath_sysid.common.advice import counted
from swath_sysid.common.conventions import digits
from swath_sysid.report.tables import Table
from swath_sysid.tank.campaign.manifest import LOADING_NAMES, loading_in_words
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.extinction import TankQuantity, tank_quantities
from swath_sysid.tank.report.campaign_tables import VERDICT_MARKS
from swath_sysid.tank.report.extinction_tables import SOURCES, particulars_of

ANGLES = {'roll': 'φ', 'pitch': 'θ'}
#: Powers of ten within which a number is written without one.
SMALLEST_POWER, LARGEST_POWER = -3, 4

#: deg, of which the three largest that a draft's records cover are reported.
NAMED_AMPLITUDES = tuple(float(f'{mantissa}e{power}') for power in (-1, 0, 1) for mantissa in (1, 2, 5))


@dataclass(frozen=True)
class DraftResult:
    """What all releases of one draft together give."""

    axis: AxisOutcome
    loading: float
    fit: Identification
    releases: int
    rows: tuple[tuple[float, tuple[TankQuantity, ...]], ...]  #: Amplitude, deg, and the quantities there.

    @property
    def verdict(self) -> str:
        """In one word."""
        return self.fit.verdict.level


def draft_results(outcome: CampaignOutcome) -> list[DraftResult]:
    """The results of every axis and draft."""
    found = []
    for axis in outcome.axes:
        for loading, fits in axis.by_draft.items():
            members = [k for k, r in enumerate(axis.records) if r.condition.loading == loading]
            fit = fits[axis.choice]
            low, high = np.degrees(fit.amplitude_range)
            named = [a for a in NAMED_AMPLITUDES if low <= a <= high][-3:] or [math.degrees(fit.reference_amplitude)]
            particulars = particulars_of(outcome, axis.records[members[0]].condition)
            inertia, budget = particulars.inertia_of(fit.model), outcome.manifest.uncertainty
            singles = [axis.fits['simulation'][k][axis.choice] for k in members]
            rows = []
            for at in named:
                angle = math.radians(at)
                repeats = [s.bands for s in singles if s.amplitude_range[0] <= angle <= s.amplitude_range[1]]
                own = tank_quantities(axis.motion, fit.bands, angle, inertia, particulars, budget, repeats)
                rows.append((at, own))
            found.append(DraftResult(axis, loading, fit, len(members), tuple(rows)))
    return found


def in_words(value: float, spread: float) -> str:
    """A value with its uncertainty, both to the second digit that this one has, and with one power of ten."""
    if not (math.isfinite(spread) and spread > 0.0):
        return f'{value:.4g}'
    power = math.floor(math.log10(max(abs(value), spread)))
    power = power if not SMALLEST_POWER <= power <= LARGEST_POWER else 0
    value, spread = value / 10.0**power, spread / 10.0**power
    places = places_of(spread)
    shown = f'{value:.{places}f} ± {spread:.{places}f}'.replace('-', '−')
    return f'({shown}) × 10^{power}' if power else shown


def places_of(spread: float) -> int:
    """Decimal places to the second digit of a spread; none where there is no spread."""
    is_spread = math.isfinite(spread) and spread > 0.0
    return max(0, 1 - math.floor(math.log10(float(f'{spread:.1e}')))) if is_spread else 0


def type_b_in_words(outcome: CampaignOutcome) -> str:
    """Which sources beside fit and scatter an uncertainty contains, and which it does not."""
    budget = vars(outcome.manifest.uncertainty)
    given = ', '.join(SOURCES[name] for name, share in budget.items() if share)
    absent = ' and '.join(SOURCES[name] for name in ('sensor_scale', 'time_base') if not budget[name])
    type_b = f', with {given} as stated for the tests' * bool(given)
    return type_b + f', without {absent}, not stated' * bool(absent)


def results_table(outcome: CampaignOutcome, for_eye: bool = False) -> Table:
    """Period and damping of each draft at named amplitudes, with the verdict; for the eye each value with its
    uncertainty in one cell, in the symbols of the field.
    """
    items = [(result, at, {q.name: q for q in own}) for result in draft_results(outcome) for at, own in result.rows]
    period = 'T' + '/'.join(sorted({ANGLES[axis.motion] for axis in outcome.axes}))
    moments = sorted({n for _, _, own in items for n in own if n in ('B44', 'B55')})
    quantities = (
        ('natural period', period, 'natural period', 's'),
        ('equivalent damping ratio', 'ζ', 'damping ratio', '-'),
        *((name, name, name, 'N m s') for name in moments),
    )
    known = 'equivalent linear damping, where mass and GM, or the inertia, are known'
    of_damping = f'; {moments[0]}: {known}' if moments else ''
    table = Table.of(
        'results',
        '',
        f'{period}: natural period; ζ: equivalent damping ratio{of_damping}; at the amplitude stated, from all '
        f'releases of a draft together. ±: expanded uncertainty U (k = 2){type_b_in_words(outcome)}.',
        items,
        *([('axis', lambda item: item[0].axis.axis)] if len(outcome.axes) > 1 else []),
        (LOADING_NAMES[outcome.quantity], lambda item: item[0].loading, digits(4)),
        ('amplitude [deg]', lambda item: item[1], digits(3)),
        *(column for each in quantities for column in _with_uncertainty(*each, for_eye)),
        ('releases', lambda item: item[0].releases),
        ('verdict', lambda item: item[0].verdict),
    )
    place = len(table.columns) - 1
    table.marks.update({(k, place): VERDICT_MARKS[item[0].verdict] for k, item in enumerate(items)})
    return table


def _with_uncertainty(name: str, symbol: str, heading: str, unit: str, in_one: bool) -> Iterator[tuple]:
    """Columns of a quantity and of its expanded uncertainty, or of both in one."""

    def of(show: Callable[[TankQuantity], Any]):
        return lambda item: show(item[2][name]) if name in item[2] else None

    if in_one:
        yield f'{symbol} [{unit}]', of(lambda q: in_words(q.value, q.expanded))
    else:
        yield f'{heading} [{unit}]', of(lambda q: q.value)
        yield f'± [{unit}]', of(lambda q: q.expanded)


def conclusion_of(outcome: CampaignOutcome) -> list[str]:
    """A line for each draft: period, damping at the middle amplitude, and the verdict."""
    lines = []
    for result in draft_results(outcome):
        at, own = result.rows[len(result.rows) // 2]
        period, damping = in_words(own[0].value, own[0].expanded), in_words(own[1].value, own[1].expanded)
        lines.append(
            f'{place_of(outcome, result)}: {result.verdict}; natural period {period} s, equivalent damping ratio '
            f'{damping} at {at:.3g} deg ({counted(result.releases, "release")})'
        )
    return lines


def place_of(outcome: CampaignOutcome, result: DraftResult) -> str:
    """Axis and draft in words."""
    axis = axis_in_words(result.axis.motion, result.axis.records[0].motion.installation, result.axis.axis)
    return f'{axis}, {loading_in_words(outcome.quantity, result.loading)}'


def used_of(outcome: CampaignOutcome) -> str:
    """How many releases of how many files were used."""
    used = [t for t in outcome.trials if t.record is not None]
    files = {t.entry.path for t in outcome.trials}
    return (
        f'{len(used)} of {counted(len(outcome.trials), "release")} in '
        f'{len({t.entry.path for t in used})} of {counted(len(files), "file")} used'
    )


def left_out_of(outcome: CampaignOutcome) -> list[str]:
    """What was not used and why, the releases of a file with the same reason in one line."""
    reasons = Counter((t.entry.path.name if t.release else t.name, t.reason) for t in outcome.trials if not t.record)
    return [f'{name}{f" ({n} releases)" if n > 1 else ""}, {reason}' for (name, reason), n in reasons.items()]
