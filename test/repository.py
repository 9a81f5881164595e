"""The checkout under test; where a wing was deleted, its documents, scripts and files are left over in it."""

from pathlib import Path

from swath_sysid.common.wings import wings

ROOT = Path(__file__).resolve().parents[1]
#: the measured records that ship
RECORDS = ROOT / 'records'
ABSENT = {'evaluation', 'page', 'tank', 'manoeuvring'} - {wing.name for wing in wings()}


def are_those(found, expected):
    """Whether they are the expected ones, in order; those that an absent wing left over may be among them."""
    return list(found) == list(expected) or bool(ABSENT) and set(found) > set(expected)
