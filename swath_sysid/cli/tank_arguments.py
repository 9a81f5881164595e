"""Arguments of a tank's standard output: what is known of the craft, and how well."""

from argparse import ArgumentParser, Namespace
from dataclasses import fields

from swath_sysid.attitude.identification.extinction import Particulars, TypeB
from swath_sysid.cli.settings_flags import add_number
from swath_sysid.common.errors import InputError, check_choice

SOURCES = tuple(f.name for f in fields(TypeB))


def add_tank_arguments(parser: ArgumentParser) -> None:
    """Inertia or what it follows from, the size, and ``--extinction``."""
    group = parser.add_argument_group('damping in dimensions')
    group.add_argument(
        '--extinction',
        action='store_true',
        help='print peaks, logarithmic decrements, the extinction curve, and the damping with its expanded uncertainty',
    )
    add_number(group, '--inertia', 'I', "inertia I', to print the published form as well")
    add_number(group, '--mass', 'KG', 'mass; with --metacentric-height it gives the inertia')
    add_number(group, '--metacentric-height', 'M', 'GM, transverse for roll, longitudinal for pitch')
    add_number(group, '--length', 'M', 'length, for dimensionless pitch damping')
    add_number(group, '--breadth', 'M', 'breadth, for dimensionless roll damping')
    group.add_argument(
        '--uncertainty',
        action='append',
        default=[],
        metavar='SOURCE=SHARE',
        help=f'relative standard uncertainty, such as metacentric_height=0.02, of {", ".join(SOURCES)}',
    )


def particulars_of(arguments: Namespace) -> Particulars:
    """The known particulars of the craft."""
    given = {f.name: getattr(arguments, f.name) for f in fields(Particulars)}
    for name, value in given.items():
        if value is not None and not value > 0.0:
            raise InputError(f'--{name.replace("_", "-")} must be greater than zero, not {value:g}')
    mass, height = arguments.mass is not None, arguments.metacentric_height is not None
    if arguments.inertia is not None and height:
        raise InputError('give --inertia, or --mass with --metacentric-height, not both: each sets the inertia')
    if height and not mass or mass and not height and arguments.inertia is None:
        raise InputError('give both --mass and --metacentric-height, or neither')
    return Particulars(**given)


def type_b_of(arguments: Namespace) -> TypeB:
    """Uncertainties of the command line."""
    given = {}
    for text in arguments.uncertainty:
        name, _, share = text.partition('=')
        check_choice(name, SOURCES, 'source of uncertainty')
        try:
            given[name] = float(share)
        except ValueError:
            raise InputError(f"--uncertainty {name} needs a share such as {name}=0.01, not '{share}'") from None
    return TypeB(**given)
