"""The conditions of /diagnostics: those of the core are in conditions.yaml beside this module, a wing's in its own."""

from dataclasses import dataclass
from pathlib import Path

from swath_sysid.common.wings import tables_of_wings, yaml_table

LEVELS = ('ok', 'warn', 'error', 'stale')  #: Of diagnostic_msgs/DiagnosticStatus, by their numbers.


@dataclass(frozen=True)
class ConditionRow:
    """A row of the table."""

    cure: str = ''  #: What it means, and what to do.
    sentence: str = ''  #: What was found, before the cure; values stand in braces by name.
    level: str = 'warn'  #: One of `LEVELS`.
    #: Whether a count that grows is warned of: ``always``, ``recurring`` (from the second report in a row on: a machine
    #: stalls once while programs start), ``once`` (then reported while it lasts) or ``never``.
    warns: str = 'always'
    unless: str = ''  #: Code of a condition that explains it: while that grows too, this one is not warned of.
    is_loss: bool = False  #: Of a message or of values in it; the share is reported.


#: By the place where they are counted, and code; a row that is a text is its cure.
GROUPS = {
    group: {code: ConditionRow(**row) if isinstance(row, dict) else ConditionRow(row) for code, row in rows.items()}
    for table in (yaml_table(Path(__file__).with_suffix('.yaml')), *(t for _, t in tables_of_wings('conditions.yaml')))
    for group, rows in table.items()
}
#: By code; the core's where a wing has one of the same code.
CONDITIONS = {code: row for rows in reversed(GROUPS.values()) for code, row in rows.items()}


def codes_in(*groups: str) -> tuple[str, ...]:
    """The codes of some groups."""
    return tuple(code for group in groups for code in GROUPS[group])
