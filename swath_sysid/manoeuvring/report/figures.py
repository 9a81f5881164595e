"""Figures of manoeuvring: trajectories, time histories, derivatives, residuals, standard tests."""

import re
from typing import Any

import numpy as np

from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.standard_tests import ManoeuvringTest
from swath_sysid.manoeuvring.hull.terms import HULL, INDEX, PARAMETERS
from swath_sysid.manoeuvring.identification.identify import ManoeuvringIdentification
from swath_sysid.manoeuvring.identification.validation import score, simulate_windows
from swath_sysid.manoeuvring.motion.resampling import smoothed
from swath_sysid.manoeuvring.motion.trial import CHANNELS, CraftRun
from swath_sysid.manoeuvring.prediction.skill import ForecastScores
from swath_sysid.report.figures import MEASURED, MODEL, RESIDUAL, SERIES, Axes, Figure, new_figure, panel, quiet
from swath_sysid.report.fit_summary import short_name

LABELS = ('surge (m/s)', 'sway (m/s)', 'yaw rate (deg/s)')
SIZES = np.array([1.0, 1.0, np.degrees(1.0)])


def identification_figures(found: ManoeuvringIdentification, window: float) -> dict[str, Figure]:
    """Derivatives, residuals, and of every run trajectory and time histories, measured and simulated in windows of some
    s; by file name without ending.
    """
    figures = {'derivatives': _derivatives_figure(found), 'residuals': _residuals_figure(found, window)}
    for label, model, runs, currents in (
        ('identification', found.model, found.identified_on, found.currents),
        ('validation', found.validated_model, found.validated_on, None),
    ):
        for number, run in enumerate(runs, 1):
            its_own = None if currents is None else currents[number - 1 : number]
            simulated = simulate_windows(model, [run], window, currents=its_own)
            name = re.sub(r'[^\w-]', '_', short_name(run.source).rsplit('.', 1)[0])
            r2 = score(model, [run], window, currents=its_own).r2
            figures[f'{label}_{number:02d}_{name}'] = _run_figure(run, simulated, label, r2)
    return figures


def test_figure(report: ManoeuvringTest, model: ManoeuvringModel) -> Figure:
    """Track, time histories and, where the test has one, its curve."""
    figure = new_figure(10, 6)
    track_axes, *others = _grid(figure)
    m = report.manoeuvre
    if report.name == 'spiral':
        track_axes.plot(report.curve['difference'], report.curve['yaw_rate_deg_s'], 'o-', color=MODEL, markersize=4)
        track_axes.set(xlabel='half of starboard less port input', ylabel='steady yaw rate (deg/s)', title='spiral')
    elif report.name == 'speed':
        track_axes.plot(report.curve['input'], report.curve['speed_m_s'], 'o-', color=MODEL)
        track_axes.set(xlabel='input of each thruster', ylabel='steady speed (m/s)', title='speed curve')
        track_axes.set(xlim=(0, None), ylim=(0, None))
    else:
        track_axes.plot(m.x, m.y, color=MODEL)
        track_axes.plot(m.x[0], m.y[0], 'o', color=MEASURED, markersize=5)
        track_axes.set_aspect('equal', adjustable='datalim')
        track_axes.set(xlabel='x (m)', ylabel='y (m)', title=report.name.replace('-', ' '))
    quiet(track_axes)
    series = (
        (np.hypot(m.u, m.v), 'speed (m/s)'),
        (np.degrees(m.heading), 'heading (deg)'),
        (np.degrees(m.yaw_rate), 'yaw rate (deg/s)'),
    )
    for axes, (values, label) in zip(others, series, strict=False):
        axes.plot(m.time, values, color=MODEL)
        axes.set_ylabel(label)
    if report.name == 'zigzag':
        for sign in (-1, 1):
            others[1].axhline(sign * report.numbers['angle_deg'], color=MEASURED, linewidth=0.7, linestyle=':')
    _draw_thrust(others[-1], m.time, m, model.thrust_input)
    figure.suptitle(model.name or 'manoeuvring model')
    return figure


def forecast_figure(scores: ForecastScores, future: str) -> Figure:
    """Errors against lead: one panel per quantity, one line per method."""
    figure = new_figure(12, 6.5)
    panels = figure.subplots(2, 3).ravel()
    labels = {
        'surge_m_s': 'surge (m/s)',
        'sway_m_s': 'sway (m/s)',
        'yaw_rate_rad_s': 'yaw rate (rad/s)',
        'heading_rad': 'heading (rad)',
        'position_m': 'position (m)',
    }
    for axes, (quantity, label) in zip(panels, labels.items(), strict=False):
        for color, (method, table) in zip((MODEL, *SERIES[2:]), scores.rmse.items(), strict=False):
            axes.plot(scores.leads, table[quantity], 'o-', color=color, markersize=3, label=method.replace('-', ' '))
        axes.set(xscale='log', xlabel='lead (s)', title=label)
        axes.set_ylim(bottom=0)
        axes.set_xticks(scores.leads, [f'{lead:g}' for lead in scores.leads], minor=False)
        axes.minorticks_off()
        quiet(axes)
    panels[-1].axis('off')
    panels[-1].legend(*panels[0].get_legend_handles_labels(), frameon=False, loc='center')
    figure.suptitle(f'root mean square error of {scores.count} forecasts; future thrust {future}')
    return figure


def _grid(figure: Figure):
    grid = figure.add_gridspec(4, 2, width_ratios=(1.1, 1.4))
    histories = [quiet(figure.add_subplot(grid[row, 1])) for row in range(4)]
    for axes in histories[:-1]:
        axes.tick_params(labelbottom=False)
    for axes in histories[1:]:
        axes.sharex(histories[0])
    return [figure.add_subplot(grid[:, 0]), *histories]


def _run_figure(run: CraftRun, simulated: Any, label: str, r2: dict[str, float]):
    figure = new_figure(12, 6.5)
    track_axes, *histories = _grid(figure)
    time = run.time - run.time[0]
    windows = simulated.windows
    for c, axes in enumerate(histories[:3]):
        axes.plot(time, run.channels[c] * SIZES[c], color=MEASURED, linewidth=0.8, label='measured')
        axes.set_ylabel(LABELS[c])
    _draw_track(track_axes, run)
    for w in range(windows.count):
        start, steps = windows.start[w], windows.steps[w]
        span = slice(start, start + steps + 1)
        for c, axes in enumerate(histories[:3]):
            if np.isfinite(run.channels[c]).any() or c == 1:
                values, label_of = simulated.states[: steps + 1, c, w] * SIZES[c], 'simulated' if w == 0 else None
                axes.plot(time[span], values, color=MODEL, linewidth=1.4, label=label_of)
                axes.axvline(time[start], color=MEASURED, alpha=0.12, linewidth=0.8)
        if run.x is not None and run.y is not None:
            # from the smoothed position, as the scores compare it
            x, y = (
                own[: steps + 1, w] + smoothed(p, run.step, 0.8)[start] - p[start]
                for own, p in ((simulated.x, run.x), (simulated.y, run.y))
            )
            track_axes.plot(x, y, color=MODEL, linewidth=1.4)
    histories[0].legend(frameon=False, ncols=2, fontsize='small', loc='lower right', bbox_to_anchor=(1.0, 1.0))
    _draw_thrust(histories[3], time, run, run.thrust_input)
    shares = ', '.join(f'{name.replace("_", " ")} {value:.3f}' for name, value in r2.items() if value == value)
    figure.suptitle(
        f'{short_name(run.source)} ({label}): free simulation, each window from its own start\n'
        f"R2 {shares} (1: perfect, 0: as good as the channel's mean)",
        fontsize='medium',
    )
    return figure


def _draw_thrust(axes: Axes, time: np.ndarray, inputs: Any, thrust_input: str):
    axes.step(time, inputs.port, where='post', color=SERIES[0], label='port')
    axes.step(time, inputs.starboard, where='post', color=SERIES[2], label='starboard')
    axes.set(ylabel='thrust (N)' if thrust_input == 'force' else 'command', xlabel='time (s)')
    axes.legend(frameon=False, ncols=2, fontsize='small')


def _draw_track(axes: Axes, run: CraftRun):
    if run.x is not None and run.y is not None:
        axes.plot(run.x, run.y, color=MEASURED, linewidth=0.8)
        axes.plot(run.x[0], run.y[0], 'o', color=MEASURED, markersize=5)
        axes.set_aspect('equal', adjustable='datalim')
        axes.set(xlabel='east (m)', ylabel='north (m)', title='track: measured and simulated')
        quiet(axes)
        return
    axes.axis('off')
    axes.text(0.5, 0.5, 'no position in this run', ha='center', va='center', color=MEASURED)


def _derivatives_figure(found: ManoeuvringIdentification):
    items = list(found.derivatives.items())
    figure, axes = panel(8, 1.6 + 0.32 * len(items), title='identified parameters')
    for row, (_, derivative) in enumerate(items):
        spread = 3.0 * derivative.std / max(abs(derivative.value), 1e-12)
        color = RESIDUAL if not derivative.flags else MODEL
        axes.errorbar(1.0, row, xerr=min(spread, 5.0), fmt='o', color=color, capsize=3, markersize=4)
    axes.axvline(0.0, color=MEASURED, linewidth=0.7)
    names = [f'{n} = {d.value:.4g} {_unit(n)}' for n, d in items]
    axes.set_yticks(range(len(items)), names)
    axes.invert_yaxis()
    reach = max([3.0 * d.std / max(abs(d.value), 1e-12) for _, d in items if not d.flags] + [0.1])
    axes.set_xlim(1.0 - min(1.3 * reach, 1.3), 1.0 + min(1.3 * reach, 1.3))
    axes.set_xlabel('share of the value; bars: 3 std, clipped at the edge; red: see the warnings')
    return figure


def _unit(name: str):
    parameter = PARAMETERS[INDEX[name]]
    return '' if parameter.kind not in HULL and parameter.unit == '-' else parameter.unit


def _residuals_figure(found: ManoeuvringIdentification, window: float):
    figure = new_figure(11, 6)
    rows = figure.subplots(3, 2, gridspec_kw={'width_ratios': (2.2, 1)})
    groups = [
        ('identification', found.model, found.identified_on, found.currents, RESIDUAL),
        ('validation', found.validated_model, found.validated_on, None, MODEL),
    ]
    for label, model, runs, currents, color in groups:
        if not runs:
            continue
        simulated = simulate_windows(model, runs, window, currents=currents)
        measured = simulated.windows.measured
        step = simulated.windows.step
        for c in range(len(CHANNELS)):
            residual = (simulated.states[:, c] - measured[c]) * SIZES[c]
            if not np.isfinite(residual).any():
                continue
            history, spread = rows[c]
            time = step * np.arange(len(residual))
            known = np.isfinite(residual).any(axis=1)
            history.plot(time[known], np.sqrt(np.nanmean(residual[known] ** 2, axis=1)), color=color, label=label)
            values = residual[np.isfinite(residual)]
            limit = 4.0 * max(np.std(values), 1e-9)
            spread.hist(np.clip(values, -limit, limit), bins=60, density=True, histtype='step', color=color)
    for c, (history, spread) in enumerate(rows):
        history.set_ylabel(LABELS[c])
        quiet(history)
        quiet(spread)
    rows[0][0].set_title('root mean square of simulated less measured, against time in the window', fontsize='medium')
    rows[0][1].set_title('distribution', fontsize='medium')
    rows[0][0].legend(frameon=False)
    rows[2][0].set_xlabel('time since the start of the window (s)')
    return figure
