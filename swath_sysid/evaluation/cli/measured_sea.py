"""What ``swath-sysid demo`` shows first: the forecast of a measured sea."""

import shlex
from pathlib import Path

from rich.console import Console
from rich.table import Column, Table

from swath_sysid.cli.main import build_parser
from swath_sysid.evaluation.cli.forecast import scored
from swath_sysid.evaluation.report.forecast_skill import cell
from swath_sysid.evaluation.scoring import FORECAST, Skill
from swath_sysid.share import share_folder

SEA_RECORD = 'records/morro_buoy.csv'
SEA_OPTIONS = ('--leads', '0.5,1,2,3', '--warmup', '180')


def forecast_sea(output: Path) -> None:
    """Forecast a measured sea with the command for users' own records."""
    words = ['forecast', str(share_folder() / SEA_RECORD), *SEA_OPTIONS, '--plot', str(output / 'sea.png')]
    print(
        f'Motion of a moored buoy at sea, forecast from past samples only:\n\n    swath-sysid {shlex.join(words)}\n',
        flush=True,
    )
    skill = scored(build_parser(words[0]).parse_args(words))
    Console().print(_table_of_sea(skill))
    print(f'{output / "sea.png"}: these forecasts beside the measured motion; the command prints every method\n')


def _table_of_sea(skill: Skill) -> Table:
    """The forecast beside the best of the usual ones."""
    table = Table(
        'error / motion (1: as bad as the mean)', *(Column(f'{lead:g} s', justify='right') for lead in skill.leads)
    )
    for axis, scores in skill.axes.items():
        best = [scores.nrmse[name][k] for k, name in enumerate(scores.best)]
        table.add_row(f'{axis}: forecast', *map(cell, scores.nrmse[FORECAST]), style='bold')
        table.add_row(f'{axis}: best of {len(scores.nrmse) - 1} usual methods', *map(cell, best))
        inside = (cell(100.0 * share, 0) for share in scores.coverage[:, 1])
        table.add_row(f'{axis}: inside the 90 % interval, %', *inside, style='dim', end_section=True)
    return table
