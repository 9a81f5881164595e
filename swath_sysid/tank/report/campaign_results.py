"""What a client asks of a campaign: for each draft the period, the damping at named amplitudes, and a verdict."""

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.identification.result import Identification
from swath_sysid.common.advice import counted
from swath_sysid.common.conventions import digits
from swath_sysid.report.tables import Table
from swath_sysid.tank.campaign.manifest import LOADING_NAMES, loading_in_words
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.extinction import TankQuantity, tank_quantities
from swath_sysid.tank.report.campaign_tables import VERDICT_MARKS
from swath_sysid.tank.report.extinction_tables import SOURCES, particulars_of

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
    places = max(0, 1 - math.floor(math.log10(float(f'{spread:.1e}'))))
    shown = f'{value:.{places}f} ± {spread:.{places}f}'.replace('-', '−')
    return f'({shown}) × 10^{power}' if power else shown


def type_b_in_words(outcome: CampaignOutcome) -> str:
    """Which sources beside fit and scatter an uncertainty contains, and which it does not."""
    budget = vars(outcome.manifest.uncertainty)
    given = ', '.join(SOURCES[name] for name, share in budget.items() if share)
    absent = ' and '.join(SOURCES[name] for name in ('sensor_scale', 'time_base') if not budget[name])
    type_b = f', with {given} as stated for the tests' * bool(given)
    return type_b + f', without {absent}, not stated' * bool(absent)


def results_table(outcome: CampaignOutcome) -> Table:
    """Period and damping of each draft at named amplitudes, with the verdict."""
    items = [(result, at, {q.name: q for q in own}) for result in draft_results(outcome) for at, own in result.rows]
    symbols = sorted({each for _, _, own in items for each in own if each in ('B44', 'B55')})
    names = (
        ('natural period', 'natural period', 's'),
        ('equivalent damping ratio', 'damping ratio', '-'),
        *((each, each, 'N m s') for each in symbols),
    )
    known = f' {symbols[0]} where mass and GM, or the inertia, are given for the draft.' if symbols else ''
    table = Table.of(
        'results',
        '',
        'Natural period and equivalent damping ratio at named amplitudes, of all releases of a draft fitted together. '
        '±: expanded uncertainty (k = 2) by the larger of the fit '
        f'and the scatter of the releases that reach the amplitude{type_b_in_words(outcome)}. The verdict is on the '
        f'forecast of the next release by the fitted model.{known}',
        items,
        *([('axis', lambda item: item[0].axis.axis)] if len(outcome.axes) > 1 else []),
        (LOADING_NAMES[outcome.quantity], lambda item: item[0].loading, digits(4)),
        ('verdict', lambda item: item[0].verdict),
        ('at [deg]', lambda item: item[1], digits(3)),
        *(column for each in names for column in _with_uncertainty(*each)),
        ('releases', lambda item: item[0].releases),
    )
    place = [column.name for column in table.columns].index('verdict')
    table.marks.update({(k, place): VERDICT_MARKS[item[0].verdict] for k, item in enumerate(items)})
    return table


def _with_uncertainty(name: str, heading: str, unit: str) -> tuple[tuple, tuple]:
    """Columns of a quantity and of its expanded uncertainty."""

    def of(part: str):
        return lambda item: getattr(item[2][name], part) if name in item[2] else None

    return (f'{heading} [{unit}]', of('value'), '{:#.5g}'.format), (f'± [{unit}]', of('expanded'), '{:#.2g}'.format)


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
    return f'{result.axis.axis}, {loading_in_words(outcome.quantity, result.loading)}'


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
