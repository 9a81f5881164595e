"""What the log of a hull shows: a table, a picture, and sentences on what changed."""

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from swath_sysid.common.conventions import TWO_STD, digits, percent
from swath_sysid.report.figures import MODEL, RESIDUAL, Figure, new_figure, quiet
from swath_sysid.report.tables import Table
from swath_sysid.tank.campaign.history import FALSE_ALARM, FEWEST, Entry, Found
from swath_sysid.tank.report.campaign_results import places_of

QUANTITIES = {'GM': 'GM', 'damping': 'the damping'}


def date_of(entry: Entry) -> str:
    """Date and time, UTC; nothing where it is not known."""
    return '' if entry.time is None else f'{datetime.fromtimestamp(entry.time, UTC):%Y-%m-%d %H:%M}'


def _named(entry: Entry) -> str:
    return f'{entry.name} ({date_of(entry) or "no date"})'


def _gm_of(entries: Sequence[Entry], gm: float | None) -> list[float]:
    """GM of each entry, m, or over that of the first level where ``gm`` of that level is not given."""
    used = [each for each in entries if each.is_used] or list(entries)
    return [(gm or 1.0) * (used[0].period / each.period) ** 2 for each in entries]


def history_table(entries: Sequence[Entry], found: Sequence[Found], amplitude: float, gm: float | None) -> Table:
    """Every entry, with two standard deviations."""
    changed: dict[int, list[str]] = {}
    for each in found:
        for change in each.changes:
            changed.setdefault(each.places[change.place], []).append(QUANTITIES[each.quantity])
    of_gm = _gm_of(entries, gm)
    rows = list(enumerate(entries))
    return Table.of(
        'history',
        '',
        f'Natural period and equivalent damping ratio at {np.degrees(amplitude):.2g} deg, at sea at the amplitude of '
        'the record; ±: two standard deviations. GM follows the square of the frequency while mass and inertia stay.',
        rows,
        ('record', lambda row: row[1].name),
        ('date [UTC]', lambda row: date_of(row[1])),
        ('from', lambda row: 'waves' if row[1].at_sea else 'decay'),
        ('verdict', lambda row: row[1].verdict),
        ('natural period [s]', lambda row: row[1].period, digits(5)),
        ('± [s]', lambda row: TWO_STD * row[1].period_std, digits(2)),
        ('damping ratio [-]', lambda row: row[1].damping_ratio, digits(4)),
        ('± [-]', lambda row: TWO_STD * row[1].damping_ratio_std, digits(2)),
        ('GM [m]' if gm else 'GM over the first', lambda row: of_gm[row[0]], digits(4)),
        ('±', lambda row: 2.0 * TWO_STD * of_gm[row[0]] * row[1].period_std / row[1].period, digits(2)),
        ('change', lambda row: ' and '.join(changed.get(row[0], []))),
    )


def history_sentences(entries: Sequence[Entry], found: Sequence[Found], axis: str, gm: float | None) -> list[str]:
    """What changed, and how sure that is."""
    used = [each for each in entries if each.is_used]
    others = '; the fits of the others are not adequate' if len(used) < len(entries) else ''
    said = [f'{axis}: {len(used)} of {len(entries)} entries are used{others}.']
    if len(used) < FEWEST:
        return [*said, f'At least {FEWEST} adequate entries are needed to detect a change.']
    for each in found:
        for change, (factor, low, high) in zip(each.changes, each.steps, strict=True):
            when = f'between {_named(used[change.place - 1])} and {_named(used[change.place])}'
            if change.earliest < change.latest:
                early, late = used[change.earliest - 1], used[change.latest]
                when += f', at the earliest after {early.name}, at the latest before {late.name}'
            verb = 'fell' if factor < 1.0 else 'rose'
            places = places_of(50.0 * (high - low))
            least, size, most = (
                f'{100.0 * share:.{places}f}' for share in sorted(abs(f - 1.0) for f in (low, factor, high))
            )
            said.append(
                f'{QUANTITIES[each.quantity]} {verb} by {size} % ({least} to {most} %, 95 %) {when}; the probability '
                f'that an unchanged craft shows as much is {percent(change.chance, 2)} or less.'
            )
        if not each.changes:
            said.append(f'{QUANTITIES[each.quantity]}: no significant change.')
    said.append(
        f'The test reports a change in {percent(FALSE_ALARM)} of the histories of a craft that does not change.'
        + ('' if gm else ' Give the GM of the first entries for GM in m.')
    )
    return [f'{line[0].upper()}{line[1:]}' for line in said]


def history_figure(entries: Sequence[Entry], found: Sequence[Found], axis: str) -> Figure:
    """Period and damping over the days, changes as lines; hollow points are not used."""
    figure = new_figure(6.4, 4.2)
    panels = [quiet(each) for each in figure.subplots(2, 1, sharex=True)]
    is_dated = all(each.time is not None for each in entries)
    first = entries[0].time or 0.0
    at = np.array([((each.time or 0.0) - first) / 86400.0 if is_dated else k + 1.0 for k, each in enumerate(entries)])
    for axes, name, label, of in zip(
        panels, ('period', 'damping_ratio'), (f'{axis} period [s]', 'damping ratio [-]'), found, strict=True
    ):
        for k, each in enumerate(entries):
            axes.errorbar(
                at[k],
                getattr(each, name),
                TWO_STD * getattr(each, f'{name}_std'),
                marker='s' if each.at_sea else 'o',
                markersize=4,
                color=RESIDUAL,
                markerfacecolor=RESIDUAL if each.is_used else 'none',
                capsize=2,
                linewidth=0.9,
            )
        for change in of.changes:
            after = of.places[change.place]
            axes.axvline(
                0.5 * (at[of.places[change.place - 1]] + at[after]), color=MODEL, linestyle='--', linewidth=1.2
            )
        axes.set_ylabel(label)
    panels[1].set_xlabel(f'days since {date_of(entries[0])}' if is_dated else 'entry')
    return figure
