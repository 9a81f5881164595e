"""``swath-sysid identify --extinction``: the tables of a towing tank beside a fit."""

from argparse import Namespace
from collections.abc import Callable
from dataclasses import fields

from swath_sysid.attitude.identification.result import Identification
from swath_sysid.cli.identify import check_positive
from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.report.tables import Table
from swath_sysid.tank.extinction import Particulars, TypeB
from swath_sysid.tank.report.extinction_tables import tank_tables


def tables_of(arguments: Namespace) -> Callable[[Identification], list[Table]]:
    """What makes the tables that the flags ask for; raises `InputError` where they cannot be used."""
    check_positive(arguments, ('length', 'breadth'))
    particulars = Particulars(**{f.name: getattr(arguments, f.name) for f in fields(Particulars)})
    type_b = _type_b_of(arguments)
    return lambda found: tank_tables(found, particulars, type_b) if arguments.extinction else []


def _type_b_of(arguments: Namespace) -> TypeB:
    """Uncertainties of the command line."""
    given: dict[str, float] = {}
    sources = [f.name for f in fields(TypeB)]
    for text in arguments.uncertainty:
        name, _, share = text.partition('=')
        check_choice(name, sources, 'source of uncertainty')
        try:
            given[name] = float(share)
        except ValueError:
            raise InputError(f"--uncertainty {name} needs a share such as {name}=0.01, not '{share}'") from None
    return TypeB(**given)
