"""What all figures share: size, colours, and writing them whole or not at all."""

from pathlib import Path
from typing import TYPE_CHECKING

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED, MODEL, RESIDUAL, BAND = '#1f2933', '#d1495b', '#2e86ab', '#9ecae1'
SERIES = ('#2e86ab', '#d1495b', '#edae49', '#3b8b5a', '#7b4fa3', '#8c6d46')
FORMATS = ('png', 'svg', 'pdf')


def new_figure(width: float, height: float) -> 'Figure':
    """An empty figure of a width and height in inches, drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def quiet(axes: 'Axes') -> 'Axes':
    """Take away what does not inform: two spines; add a faint grid."""
    axes.spines[['top', 'right']].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    return axes


def save_figure(figure: 'Figure', path: str | Path) -> None:
    """Write a figure in the format of the name's ending.

    Raises
    ------
    InputError
        The ending is none of png, svg, pdf, or the file cannot be written.
    """
    ending = Path(path).suffix.lower().lstrip('.')
    if ending not in FORMATS:
        raise InputError(f"a picture cannot be written as '{path}': end the name in .{', .'.join(FORMATS)}")
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130, format=ending)
