"""A running pipeline on a terminal: the angle and its forecast, the model, the diagnostics."""

import math
from dataclasses import dataclass, field

import numpy as np
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

CHART_SPAN = 12.0  #: s of the past; the forecasts reach beyond it.

CHART_ROWS = 13
CHART_COLUMNS = 76
LEVELS = (('ok', 'green'), ('warning', 'yellow'), ('error', 'red'), ('stale', 'red'))


@dataclass(frozen=True)
class ViewState:
    """What is shown. Times in s, angles in rad."""

    title: str
    stage: str
    now: float  #: Stamp of the newest sample.
    time: np.ndarray  #: Recently measured.
    angle: np.ndarray  #: Recently measured.
    forecast_time: np.ndarray  #: Recent forecasts at the lead that is drawn.
    forecast_angle: np.ndarray  #: Recent forecasts at the lead that is drawn.
    drawn_lead: float
    #: Lead, newest forecast, and root mean square of the errors that came due lately (NaN: none).
    leads: tuple[tuple[float, float, float], ...]
    model: tuple[str, ...] = ()  #: Lines.
    diagnostics: tuple[tuple[int, str, str], ...] = field(default=())  #: Level, name, message.
    scale: float = 0.1  #: Largest angle of the chart.


def render(state: ViewState) -> Group:
    """The view as something that rich can draw."""
    lower = Table.grid(expand=True, padding=(0, 1))
    lower.add_column(ratio=2)
    lower.add_column(ratio=3)
    lower.add_row(
        Panel(_forecasts(state), title='forecasts', border_style='cyan'),
        Panel(Text('\n'.join(state.model) or 'none yet: constant rate'), title='model', border_style='cyan'),
    )
    return Group(
        Panel(
            chart(state),
            title=f'{state.title}: {state.stage}',
            border_style='cyan',
            subtitle=f'[white]●[/] measured  [green]•[/] forecast {state.drawn_lead:g} s before',
        ),
        lower,
        Panel(_diagnostics(state), title='diagnostics', border_style='cyan'),
    )


def chart(state: ViewState) -> Text:
    """Measured angle and the forecasts made for each moment, as text."""
    cells = [[' '] * CHART_COLUMNS for _ in range(CHART_ROWS)]
    cells[CHART_ROWS // 2] = ['─'] * CHART_COLUMNS
    begin = state.now - CHART_SPAN
    per_second = CHART_COLUMNS / (CHART_SPAN + state.drawn_lead)
    present = min(int(CHART_SPAN * per_second), CHART_COLUMNS - 1)
    for row in cells:
        row[present] = '│'
    for times, angles, mark in (
        (state.forecast_time, state.forecast_angle, '•'),
        (state.time, state.angle, '●'),
    ):
        for time, angle in zip(times, angles, strict=True):
            column = int((time - begin) * per_second)
            height = angle / state.scale
            if 0 <= column < CHART_COLUMNS and abs(height) <= 1.0:
                cells[round((1.0 - height) * (CHART_ROWS - 1) / 2)][column] = mark
    text = Text()
    largest = math.degrees(state.scale)
    for number, row in enumerate(cells):
        angle = largest * (1.0 - 2.0 * number / (CHART_ROWS - 1))
        label = f'{angle:+6.1f}° ' if number % 3 == 0 else ' ' * 8
        text.append(label, 'dim')
        for cell in row:
            text.append(cell, {'●': 'bold white', '•': 'green'}.get(cell, 'dim'))
        text.append('\n')
    return text


def line(state: ViewState) -> str:
    """The view as one line, for where there is no terminal."""
    angle = f'{math.degrees(state.angle[-1]):+.2f} deg' if len(state.angle) else 'no angle'
    ahead = ', '.join(f'{math.degrees(value):+.2f} in {lead:g} s' for lead, value, _ in state.leads if value == value)
    return f'{state.stage}: {angle}; forecast {ahead or "none"}'


def _forecasts(state: ViewState):
    table = Table.grid(padding=(0, 2))
    table.add_row(Text('ahead', 'dim'), Text('forecast', 'dim'), Text('lately wrong by', 'dim'))
    for lead, angle, error in state.leads:
        table.add_row(
            f'{lead:g} s',
            '' if angle != angle else f'{math.degrees(angle):+7.2f}°',
            '' if error != error else f'{math.degrees(error):6.2f}°',
        )
    return table


def _diagnostics(state: ViewState):
    table = Table.grid(padding=(0, 2))
    for level, name, message in state.diagnostics:
        word, colour = LEVELS[min(level, len(LEVELS) - 1)]
        table.add_row(Text(word, colour), name, Text(message, overflow='ellipsis', no_wrap=True))
    return table if state.diagnostics else Text('none yet')
