"""Charts as options of Apache ECharts, and their changing series."""

import math
from typing import Any

from swath_sysid.page.live_record import CHECKED_LEAD, SHOWN_S
from swath_sysid.page.live_view import INTERVALS

EARLIER = f'forecast {CHECKED_LEAD:g} s earlier'
MEASURED, FORECAST, CHECKED = '#8a94a0', '#d95f02', '#7570b3'
SMALLEST = {'deg': 1.0, 'm': 0.1}  #: Least half height of a chart; below, noise would look like motion.

ZOOM = {'dataZoom': {'yAxisIndex': 'none', 'title': {'zoom': 'zoom', 'back': 'zoom back'}}}
QUIET = {'type': 'line', 'showSymbol': False, 'silent': True, 'animation': False}


def motion_options(unit: str) -> dict[str, Any]:
    """A chart of measured motion and its forecast, still without data."""
    frame = _frame(unit, 's from now')
    frame['xAxis']['min'] = -SHOWN_S
    return {
        **frame,
        'legend': _legend('measured', 'forecast', EARLIER),
        'series': [
            *(series for interval in INTERVALS for series in _band(interval)),
            {**QUIET, 'name': 'measured', 'lineStyle': {'width': 2}, 'color': MEASURED},
            {**QUIET, 'name': 'forecast', 'lineStyle': {'width': 2}, 'color': FORECAST},
            {**QUIET, 'name': EARLIER, 'lineStyle': {'width': 1, 'type': 'dashed'}, 'color': CHECKED},
        ],
    }


def motion_series(chart: dict[str, list]) -> list[list]:
    """The data of the series of `motion_options`, in their order."""
    bands = [data for band in chart['bands'] for data in _stacked(band)]
    return [*bands, chart['measured'], chart['forecast'], chart['checked']]


def motion_changes(chart: dict[str, list], unit: str) -> dict[str, Any]:
    """The options of `motion_options` that change with this motion."""
    reach = reach_of(chart, SMALLEST[unit])
    last = max((time for time, _ in chart['forecast'][-1:]), default=0.0)
    return {
        'xAxis': {'max': math.ceil(last - 0.5)},
        'yAxis': {'min': -reach, 'max': reach, 'interval': 0.5 * reach},
        'series': [{'data': data} for data in motion_series(chart)],
    }


def release_options() -> dict[str, Any]:
    """A zoomable chart of a measured decay and the model's motion over it."""
    frame = _frame('deg', 's after release')
    frame['xAxis']['min'] = 0.0
    return {
        **frame,
        'legend': _legend('measured', 'model'),
        'toolbox': {'left': 80, 'top': 14, 'iconStyle': {'borderColor': MEASURED}, 'feature': ZOOM},
        'series': [
            {**QUIET, 'name': 'measured', 'lineStyle': {'width': 4, 'opacity': 0.6}, 'color': MEASURED},
            {**QUIET, 'name': 'model', 'lineStyle': {'width': 2}, 'color': FORECAST},
        ],
    }


def curve_options(name: str) -> dict[str, Any]:
    """A chart of a quantity against amplitude with its band, and values from single cycles."""
    return {
        **_frame(name, 'amplitude [deg]'),
        'legend': _legend('cycles', 'model'),
        'series': [
            *_band('band'),
            {'type': 'scatter', 'name': 'cycles', 'color': MEASURED, 'symbolSize': 7, 'silent': True},
            {**QUIET, 'name': 'model', 'color': FORECAST, 'lineStyle': {'width': 2}},
        ],
    }


def curve_series(rows: list, measured: list) -> list[list]:
    """The data of the series of `curve_options`."""
    return [*_stacked([[x, low, high] for x, _, low, high in rows]), measured, [[x, value] for x, value, _, _ in rows]]


def reach_of(chart: dict[str, list], smallest: float) -> float:
    """Half the height of a motion chart: 1, 2 or 5 times a power of ten that holds the curves. Intervals are cut off
    where they would make the motion small.
    """
    drawn = max((abs(value) for name in ('measured', 'forecast') for _, value in chart[name]), default=0.0)
    bands = max((abs(value) for band in chart['bands'] for row in band for value in row[1:]), default=0.0)
    reach = max(1.05 * drawn, min(bands, 2.0 * drawn), smallest)
    power = 10.0 ** math.floor(math.log10(reach))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= 0.999 * reach)


def _legend(*names: str) -> dict[str, Any]:
    shown = {'top': 0, 'right': 8, 'icon': 'roundRect', 'itemHeight': 3, 'textStyle': {'color': MEASURED}}
    return {**shown, 'data': list(names)}


def _frame(name: str, below: str) -> dict[str, Any]:
    # readable on light and on dark
    shared = {
        'type': 'value',
        'scale': True,
        'axisLine': {'onZero': False, 'lineStyle': {'color': MEASURED}},
        'axisLabel': {'color': MEASURED},
    }
    return {
        'animation': False,
        'grid': {'left': 48, 'right': 16, 'top': 48, 'bottom': 40},
        'xAxis': {**shared, 'name': below, 'nameLocation': 'middle', 'nameGap': 24, 'splitLine': {'show': False}},
        'yAxis': {
            **shared,
            'name': name,
            'nameTextStyle': {'align': 'left'},
            'splitLine': {'lineStyle': {'color': MEASURED, 'opacity': 0.2}},
        },
    }


def _band(name: str) -> list[dict[str, Any]]:
    """An area between two lines: the lower one, not drawn, with the distance to the upper stacked on it."""
    stacked = {**QUIET, 'stack': name, 'stackStrategy': 'all', 'lineStyle': {'width': 0}, 'color': FORECAST}
    return [{**stacked, 'name': f'{name} below'}, {**stacked, 'name': name, 'areaStyle': {'opacity': 0.16}}]


def _stacked(rows: list) -> list[list]:
    return [[[x, low] for x, low, _ in rows], [[x, round(high - low, 6)] for x, low, high in rows]]
