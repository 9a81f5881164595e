"""What is in a record, in words, in plain data and as a picture: motion with decays and gaps, and spectrum."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.identification.at_sea import sea_of
from swath_sysid.attitude.motion.quality import check_decay, check_motion
from swath_sysid.attitude.motion.segmentation import FORCED_MOTION, TOO_SMALL, DecaySegment, find_decays
from swath_sysid.attitude.motion.trial import AxisMotion, Trial, axis_in_words
from swath_sysid.attitude.motion.turning_points import even_signal, find_gaps, find_turning_points, mean_period
from swath_sysid.common.advice import Advice, with_flags
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, Axes, Figure, measured_channel, new_figure, quiet
from swath_sysid.report.fit_summary import short_name, warnings_as_data

DECAY_FIELDS = 'cycles', 'initial_amplitude', 'final_amplitude', 'beginning', 'ending'


def record_as_data(trial: Trial, motions: Sequence[AxisMotion]) -> dict:
    """What ``inspect --json`` prints of a whole record and the motions of it that are to be described."""
    interval = float(np.median(np.diff(trial.time)))
    decays = [find_decays(motion) for motion in motions]
    return finite_or_none(
        {
            'source': trial.source,
            'read_as': list(trial.understood),
            'samples': int(trial.time.size),
            'start_s': float(trial.time[0]),
            'end_s': float(trial.time[-1]),
            'rate_hz': 1.0 / interval,
            'longest_interval_s': float(np.diff(trial.time).max()),
            'channels': list(trial.channels),
            'axes': {
                motion.axis: {'in_words': axis_in_words(motion.axis, trial.installation)}
                | _axis_as_data(motion, own, is_idle=any(decays) and not own)
                for motion, own in zip(motions, decays, strict=True)
            },
            **warnings_as_data(trial.advice),
        }
    )


def _axis_as_data(motion: AxisMotion, decays: Sequence[DecaySegment], is_idle: bool):
    """Of one axis; of an ``is_idle`` one, beside which the craft was released, nobody expects motion."""
    values, _ = measured_channel(motion)
    advice = [
        _of_waves(motion, each) for each in check_motion(motion, decays) if not (is_idle and each.code == TOO_SMALL)
    ]
    advice += [a for decay in decays for a in (*decay.advice, *check_decay(motion, decay))]
    return {
        'samples': motion.size,
        'measured': [name for name in ('angle', 'rate') if getattr(motion, name) is not None],
        'largest': float(values.max()),
        'smallest': float(values.min()),
        'std': float(values.std()),
        'decays': [
            {f'{name}_s': getattr(decay, name) for name in ('start', 'end', 'period')}
            | {name: getattr(decay, name) for name in DECAY_FIELDS}
            for decay in sorted(decays, key=lambda decay: decay.start)
        ],
        **warnings_as_data(advice),
    }


def _of_waves(motion: AxisMotion, advice: Advice) -> Advice:
    """Where motion in waves is too short to be identified, advice that says so."""
    if advice.code == FORCED_MOTION:
        try:
            sea_of(motion)
        except InputError as error:
            return Advice(error.code or advice.code, str(error))
    return advice


def record_in_words(data: dict) -> list[str]:
    """Lines for a reader of what `record_as_data` gives."""
    lines = [
        f'{data["source"]}: {data["samples"]} samples from {data["start_s"]:.2f} to {data["end_s"]:.2f} s, '
        f'{data["rate_hz"]:.1f} Hz, longest interval {data["longest_interval_s"]:.3g} s',
        *[f'  {"  " * (at > 0) or "read as: "}{said}' for at, said in enumerate(data['read_as'])],
        f'  channels: {", ".join(data["channels"])}',
    ]
    for axis, found in data['axes'].items():
        unit = 'deg' if 'angle' in found['measured'] else 'deg/s'
        low, high, std = (np.degrees(found[key]) for key in ('smallest', 'largest', 'std'))
        lines.append(f'  {found["in_words"]}: {low:.2f} to {high:.2f} {unit}, standard deviation {std:.2f} {unit}')
        lines += [
            f'    {axis} decay from {d["start_s"]:.2f} to {d["end_s"]:.2f} s: {d["cycles"]:.1f} cycles of '
            f'{d["period_s"]:.3f} s, from {np.degrees(d["initial_amplitude"]):.2f} to '
            f'{np.degrees(d["final_amplitude"]):.2f} {unit} ({d["beginning"]}, ended by {d["ending"]})'
            for d in found['decays']
        ]
        lines += [f'    [{w["code"]}] {with_flags(w["code"], w["message"])}' for w in found['warnings']]
    return lines


SPECTRUM_PERIODS = 16.0  #: Length of the averaged windows, in mean periods.
SPECTRUM_REACH = 4.0  #: Highest frequency drawn, over that of the mean period.


def record_figure(motions: Sequence[AxisMotion]) -> Figure:
    """Motion and spectrum of each axis; decays shaded with their turning points, gaps marked."""
    figure = new_figure(11.0, 3.4 * len(motions))
    grid = figure.subplots(len(motions), 2, width_ratios=(3, 1), squeeze=False)
    for (motion_axes, spectrum_axes), motion in zip(grid, motions, strict=True):
        decays = find_decays(motion)
        _draw_motion(quiet(motion_axes), motion, decays)
        _draw_spectrum(quiet(spectrum_axes), motion, decays)
    figure.suptitle(short_name(motions[0].source), fontsize='medium')
    return figure


def _draw_motion(axes: Axes, motion: AxisMotion, decays: Sequence[DecaySegment]):
    measured, label = measured_channel(motion)
    axes.plot(motion.time, np.degrees(measured), color=MEASURED, linewidth=0.9)
    for begin, end in find_gaps(motion, longer_than=3.0 * motion.sample_interval) if motion.size > 2 else ():
        axes.axvspan(begin, end, color=MODEL, alpha=0.5, linewidth=1)
    for index, decay in enumerate(sorted(decays, key=lambda decay: decay.start)):
        axes.axvspan(decay.start, decay.end, color=BAND, alpha=0.35, linewidth=0)
        _draw_turning_points(axes, motion, decay)
        axes.text(
            decay.start,
            0.985,
            f' decay {index + 1}: {decay.cycles:.1f} cycles of {decay.period:.2f} s',
            transform=axes.get_xaxis_transform(),
            va='top',
            fontsize='small',
        )
    # Room for the words above the motion.
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.1 * (high - low) if decays else high)
    axes.set(xlabel='time [s]', ylabel=label)


def _draw_turning_points(axes: Axes, motion: AxisMotion, decay: DecaySegment):
    inside = motion.between(decay.start, decay.end)
    if inside.size < 3:
        return
    points = find_turning_points(inside, decay.period)
    axes.plot(points.time, np.degrees(points.value), '.', color=MODEL, markersize=4)


def _draw_spectrum(axes: Axes, motion: AxisMotion, decays: Sequence[DecaySegment]):
    signal = even_signal(motion)
    points = find_turning_points(motion)
    if signal.value.size < 16 or points.time.size < 2:
        axes.set_visible(False)
        return
    period = decays[0].period if decays else mean_period(points)
    from scipy.signal import welch

    length = int(np.clip(SPECTRUM_PERIODS * period / signal.interval, 16, signal.value.size))
    frequency, density = welch(signal.value, 1.0 / signal.interval, nperseg=length, nfft=4 * length, detrend='linear')
    shown = slice(1, max(3, int(np.searchsorted(frequency, SPECTRUM_REACH / period))))
    axes.plot(frequency[shown], density[shown] / density[shown].max(), color=SERIES[0])
    for decay in decays[:1]:
        axes.axvline(1.0 / decay.period, color=MODEL, linewidth=0.9, linestyle='--', label=f'{decay.period:.2f} s')
        axes.legend(frameon=False, fontsize='small', loc='upper right')
    axes.set(xlabel='frequency [Hz]', ylabel='relative density')
