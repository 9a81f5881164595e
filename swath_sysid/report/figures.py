"""What all figures share: size, colours, and writing them whole or not at all."""

from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.identification.fit_quality import AmplitudeBands
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.conventions import TWO_STD
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import as_utf_8, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    # matplotlib is loaded where something is drawn
    Axes = Figure = Any

MEASURED, MODEL, RESIDUAL, BAND = '#1f2933', '#d1495b', '#2e86ab', '#9ecae1'
SERIES = ('#2e86ab', '#d1495b', '#edae49', '#3b8b5a', '#7b4fa3', '#8c6d46')
LINE_STYLES = ('-', '--', ':', '-.')
FORMATS = ('png', 'svg', 'pdf')


def loaded_matplotlib() -> ModuleType:
    """The library, which reads a matplotlibrc when it is loaded."""
    try:
        import matplotlib
    except UnicodeDecodeError as error:
        raise InputError(
            'a matplotlibrc, in this folder or of this user, is not UTF-8, and matplotlib cannot be loaded: save it as '
            'UTF-8, or move it away'
        ) from error
    return matplotlib


@cache
def use_plain_style() -> None:
    """Draw in the default style of matplotlib, whatever a matplotlibrc says, and texts as they are: two dollar signs in
    the name of a file are no mathematics.
    """
    matplotlib = loaded_matplotlib()
    matplotlib.rcdefaults()
    matplotlib.rcParams['text.parse_math'] = False


def new_figure(*size: float) -> Figure:
    """An empty figure of a width and height in inches, or of those of the page, drawn without a display."""
    use_plain_style()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    inches: Any = size or None
    figure = Figure(figsize=inches, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def quiet(axes: Axes) -> Axes:
    """Take away what does not inform: two spines; add a faint grid."""
    axes.spines[['top', 'right']].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    return axes


def panel(*size: float, **labels: str) -> tuple[Figure, Axes]:
    """A `new_figure` with a single panel, with labels as `Axes.set` takes them."""
    figure = new_figure(*size)
    axes = quiet(figure.subplots())
    axes.set(**labels)
    return figure, axes


def plain_ticks(axis: Any) -> None:
    """Plain numbers at 1, 2 and 5 of every decade of a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(lambda value, _: f'{value:g}')
    axis.set_minor_locator(NullLocator())


def draw_fit(above: Axes, below: Axes, motion: AxisMotion, angle: Any, rate: Any) -> None:
    """A record and the simulated motion, with the residual below."""
    measured, label = measured_channel(motion)
    simulated = rate if motion.angle is None else angle
    time, m, s = motion.time, np.degrees(measured), np.degrees(simulated)
    above.plot(time, m, color=MEASURED, linewidth=1.4, label='record')
    above.plot(time, s, color=MODEL, linewidth=1.0, linestyle='--', label='simulated by the model')
    above.set_ylabel(label)
    above.tick_params(labelbottom=False)
    below.plot(time, m - s, color=RESIDUAL, linewidth=0.7)
    below.axhline(0.0, color=MEASURED, linewidth=0.5)
    below.set(xlabel='time [s]', ylabel=f'residual {label[label.index("[") :]}')


def band(axes: Axes, x: np.ndarray, middle: np.ndarray, half_width: np.ndarray, **style: Any) -> None:
    """Shade to both sides of a curve."""
    axes.fill_between(x, middle - half_width, middle + half_width, linewidth=0, **style)


def two_std_band(axes: Axes, x: np.ndarray, value: np.ndarray, std: np.ndarray, **style: Any) -> None:
    """Shade two standard deviations about a curve."""
    band(axes, x, value, TWO_STD * std, **style)


def curves_of(bands: AmplitudeBands) -> dict[str, tuple[Any, Any]]:
    """Label to natural period and equivalent damping ratio over amplitude, each with its standard deviation."""
    period = 2.0 * np.pi / bands.curves.frequency
    return {
        'natural period [s]': (period, period * bands.frequency_std / bands.curves.frequency),
        'equivalent damping ratio [-]': (bands.curves.damping_ratio, bands.damping_ratio_std),
    }


def measured_channel(motion: AxisMotion) -> tuple[Any, str]:
    """The angle and its label, or the rate where no angle was measured."""
    if motion.angle is None:
        return motion.rate, f'{motion.axis} rate [deg/s]'
    return motion.angle, f'{motion.axis} [deg]'


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure in the format of the name's ending."""
    ending = Path(path).suffix.lower().lstrip('.')
    if ending not in FORMATS:
        raise InputError(f"a picture cannot be written as '{path}': end the name in .{', .'.join(FORMATS)}")
    make_printable(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130, format=ending)


def make_printable(figure: Figure) -> None:
    """Show what is no UTF-8 in the name of a file as in ``d\\xe9cay.csv``: matplotlib cannot draw it."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if not text.get_text().isprintable():
            text.set_text(as_utf_8(text.get_text()))


def legend_below(axes: Axes, columns: int = 2) -> None:
    """Below the axes, where no curve can run through it; nothing where no curve has a name."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.25), ncols=columns, frameon=False)
