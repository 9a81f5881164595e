"""Manoeuvring trials: what the sensors and thrusters of a twin-thruster craft recorded, made ready.

A `ManoeuvringTrial` is a record as it was read, in the frame it states. `prepare` makes a `Run` of
it: even steps, axes x forward, y to port, z up and world x east, y north, speeds over ground.
"""
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter
from scipy.signal import lfilter, savgol_filter

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import bin_means, white_noise

FORCE, COMMAND = 'force', 'command'
CHANNELS = ('surge', 'sway', 'yaw_rate')
POSE = ('heading', 'x', 'y')
MEASURED = CHANNELS + POSE

USUAL_STEP = 0.1
"""s; used where the record's own interval is far from it."""

HOLD = 0.5
"""s for which a command is held after it was last published."""

LONGEST_GAP = 1.0
"""s; over a longer gap in the thrust nothing is known of the motion."""

ABSURD = {'surge': 50.0, 'sway': 50.0, 'yaw_rate': 10.0, 'x': 1e8, 'y': 1e8, 'heading': 1e6}
LEAST_SPIKE = {'surge': 0.5, 'sway': 0.5, 'yaw_rate': 0.3, 'x': 3.0, 'y': 3.0}
"""m/s, rad/s, m by which a single sample jumps away from its neighbours at least to be left out."""

SPIKE = 10.0
"""Usual distances from the neighbours, beyond which a sample is left out."""

NEIGHBOURS = 7
MOST_SPIKES = 0.03

SMOOTHING = 0.4
"""s; width of the Gaussian that gives smooth states."""

NOISY = 0.1
"""A noise of this share of the motion asks for the full smoothing."""

MOVING = 0.3
"""m/s; above this a course tells a heading."""

LEAST_MISALIGNMENT, LARGEST_MISALIGNMENT = math.radians(4.0), math.radians(40.0)
SURE = 4.0
"""Standard deviations by which a compass must be askew to be turned."""

USUAL_CURRENT = 0.3
"""m/s."""

REMEMBERED = 10.0
"""Half seconds over which wind and manoeuvres leave the same sway: so many samples count as one."""

SEEN = 0.5
"""A correlation beyond this, against expectation, counts as a reversed channel."""


@dataclass(frozen=True)
class ManoeuvringTrial:
    """A record as it was read; arrays of shape (N,), None where not measured, NaN where missing.

    Attributes
    ----------
    time : ndarray
        s.
    port, starboard : ndarray
        Thrust, N, or normalised commands, positive ahead.
    thrust_input : str
        ``force`` or ``command``.
    surge, sway : ndarray or None
        Over ground in body axes, m/s.
    yaw_rate, heading : ndarray or None
        rad/s, rad.
    x, y : ndarray or None
        m; in NED x is north and y east, in ENU x is east and y north.
    frame : str or None
        ``enu`` (y and sway to port, yaw to port positive), ``ned`` (to starboard), None: not stated.
    lever : float or None
        Half the distance between the thrusters, m, where stated.
    length : float or None
        Of the hulls, m, where stated.
    source : str
    advice : tuple of Advice
    """

    time: np.ndarray
    port: np.ndarray
    starboard: np.ndarray
    thrust_input: str = FORCE
    surge: np.ndarray | None = None
    sway: np.ndarray | None = None
    yaw_rate: np.ndarray | None = None
    heading: np.ndarray | None = None
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    frame: str | None = None
    lever: float | None = None
    length: float | None = None
    source: str = ''
    advice: tuple[Advice, ...] = ()


@dataclass(frozen=True)
class Run:
    """A record in even steps, ready for identification; arrays of shape (N,).

    Attributes
    ----------
    step : float
        s.
    time : ndarray
        s, as recorded.
    port, starboard : ndarray
        Held over the step that follows; zero where unknown.
    driven : ndarray of bool
        Where the thrust is known.
    surge, sway, yaw_rate : ndarray
        Over ground, m/s and rad/s, NaN where not measured.
    heading, x, y : ndarray or None
        rad (not wrapped) and m, without gaps; None where not measured.
    smooth : ndarray, shape (3, N)
        Smoothed surge, sway, yaw rate, NaN where none was measured.
    thrust_input, source : str
    lever, length : float or None
    advice : tuple of Advice
    """

    step: float
    time: np.ndarray
    port: np.ndarray
    starboard: np.ndarray
    driven: np.ndarray
    surge: np.ndarray
    sway: np.ndarray
    yaw_rate: np.ndarray
    heading: np.ndarray | None
    x: np.ndarray | None
    y: np.ndarray | None
    smooth: np.ndarray
    thrust_input: str = FORCE
    source: str = ''
    lever: float | None = None
    length: float | None = None
    advice: tuple[Advice, ...] = ()

    @property
    def channels(self):
        """Surge, sway and yaw rate, shape (3, N)."""
        return np.stack([self.surge, self.sway, self.yaw_rate])

    @property
    def duration(self):
        """s."""
        return float(self.time[-1] - self.time[0])


def prepare(trial, gap_means_zero=False, step=None):
    """Make one trial ready for identification; see `prepare_all`."""
    return prepare_all([trial], gap_means_zero, step)[0]


def prepare_all(trials, gap_means_zero=False, step=None):
    """Make trials of one craft ready for identification.

    Reversed and swapped channels are found over all trials together: what a trial does not tell by
    itself is taken from the others.

    Parameters
    ----------
    trials : sequence of ManoeuvringTrial
    gap_means_zero : bool
        Commands are published only while driving: where there are none the thrust is zero.
    step : float, optional
        s, of all runs; by default that of the records, if it is near ``USUAL_STEP``.

    Returns
    -------
    list of Run

    Raises
    ------
    InputError
        Too few samples, no thrust, or neither speed nor yaw rate in one of them.
    """
    advice = [list(trial.advice) for trial in trials]
    trials = [_without_spikes(_without_absurd(_in_order(t, a), a), a) for t, a in zip(trials, advice, strict=True)]
    trials = _set_right(trials, advice)
    if step is None:
        interval = float(np.median([np.median(np.diff(trial.time)) for trial in trials]))
        step = round(interval if 0.04 <= interval <= 0.25 else USUAL_STEP, 3)
    return [_run(t, gap_means_zero, step, a) for t, a in zip(trials, advice, strict=True)]


def _run(trial, gap_means_zero, step, advice):
    """The run of a trial whose channels have been set right."""
    count = int((trial.time[-1] - trial.time[0]) / step) + 1
    if count < 20:
        raise InputError(f'{trial.source}: {trial.time[-1] - trial.time[0]:.1f} s are too short: record 30 s or more')
    grid = trial.time[0] + step * np.arange(count)
    port, starboard, driven = _thrust_on(grid, trial, gap_means_zero, advice)
    measured = {}
    for name in MEASURED:
        values = getattr(trial, name)
        if values is not None and np.isfinite(values).sum() >= 4:
            if name == 'heading':
                values = _unwrapped(values)
            measured[name] = _on_grid(grid, step, trial.time, _not_held(name, values, advice, trial.source))
    pose = {name: _filled(measured.get(name)) for name in POSE}
    if pose['heading'] is not None:
        pose['heading'] = np.unwrap(pose['heading'])
    _derive_channels(measured, pose, step, advice, trial.source)
    if not any(name in measured for name in ('surge', 'yaw_rate')):
        raise InputError(f'{trial.source} holds neither speed nor yaw rate, nor heading and position to derive them '
                         f'from: add surge_m_s or yaw_rate_rad_s')
    nothing = np.full(count, np.nan)
    surge, sway, yaw_rate = (measured.get(name, nothing) for name in CHANNELS)
    smooth = np.stack([smoothed(c, step) for c in (surge, sway, yaw_rate)])
    return Run(
        step, grid, port, starboard, driven, surge, sway, yaw_rate, **pose, smooth=smooth,
        thrust_input=trial.thrust_input, source=trial.source, lever=trial.lever, length=trial.length,
        advice=tuple(advice),
    )  # fmt: skip


def smoothed(values, step, width=SMOOTHING):
    """Local linear fit with a Gaussian window of ``width`` seconds; NaN where nothing is near.

    Shape (N,) to (N,).
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.size, np.nan)
    spacing = values.size / known.sum()
    sigma = max(width * _noisiness(values[known]) / step, 0.8 * spacing)
    place = np.arange(values.size, dtype=float)
    filled = np.where(known, values, 0.0)

    def spread(weights):
        return gaussian_filter1d(weights, sigma, mode='constant', truncate=4.0)

    w0, m1, m2 = spread(1.0 * known), spread(known * place), spread(known * place**2)
    y0, y1 = spread(filled), spread(filled * place)
    # moments about each place itself, so that long records lose no digits
    s1, s2 = m1 - place * w0, m2 - 2 * place * m1 + place**2 * w0
    t1 = y1 - place * y0
    with np.errstate(invalid='ignore', divide='ignore'):
        fit = np.where(w0 * s2 - s1**2 > 1e-6 * w0, (s2 * y0 - s1 * t1) / (w0 * s2 - s1**2), y0 / w0)
    return np.where(w0 > 1e-3 / spacing, fit, np.nan)


def _noisiness(values):
    """Share of the full smoothing that a channel needs, 0.3 to 1,"""
    if values.size < 8 or np.std(values) == 0.0:
        return 1.0
    return float(np.clip(white_noise(values) / (NOISY * np.std(values)), 0.3, 1.0))


def _in_order(trial, advice):
    """Samples in order of time, without repeated or unreadable stamps."""
    time = np.asarray(trial.time, dtype=float)
    good = np.isfinite(time)
    latest = np.maximum.accumulate(np.where(good, time, -np.inf))
    good &= np.concatenate([[True], time[1:] > latest[:-1]])
    if good.sum() < 20:
        raise InputError(f'{trial.source} holds {int(good.sum())} samples in order of time: record 30 s or more')
    if not good.all():
        advice.append(Advice('time-disorder', (
            f'{trial.source}: {int((~good).sum())} rows with missing, repeated or backward time left out: check the '
            f'recorder')))  # fmt: skip
    for name in ('port', 'starboard', *MEASURED):
        values = getattr(trial, name)
        if values is not None:
            trial = replace(trial, **{name: np.asarray(values, dtype=float)[good]})
    return replace(trial, time=time[good])


def _without_absurd(trial, advice):
    names = [n for n in MEASURED if getattr(trial, n) is not None]
    for name in names:
        values = getattr(trial, name)
        with np.errstate(invalid='ignore'):
            bad = ~(np.abs(values) <= ABSURD[name])
        if bad.all():
            trial = replace(trial, **{name: None})
            advice.append(Advice('empty-channel', f'{trial.source}: {name} holds no usable value and is left out'))
            continue
        wild = bad & np.isfinite(values)
        if wild.any():
            advice.append(Advice('absurd-values', (
                f'{trial.source}: {int(wild.sum())} values of {name} beyond {ABSURD[name]:g} left out: check its '
                f'unit')))  # fmt: skip
        trial = replace(trial, **{name: np.where(bad, np.nan, values)})
    rows = np.all([~np.isfinite(getattr(trial, n)) for n in names if getattr(trial, n) is not None], axis=0)
    if np.sum(rows):
        advice.append(Advice('missing-rows', (
            f'{trial.source}: {int(np.sum(rows))} rows hold no measured value and are bridged by the simulation: check '
            f'the logger if they are many')))  # fmt: skip
    return trial


def _without_spikes(trial, advice):
    """Without single samples far from their neighbours on both sides, as receivers and buses make them."""
    for name, least in LEAST_SPIKE.items():
        values = getattr(trial, name)
        known = np.flatnonzero(np.isfinite(values)) if values is not None else np.zeros(0, dtype=int)
        if known.size < 10 * NEIGHBOURS:
            continue
        away = np.abs(values[known] - median_filter(values[known], NEIGHBOURS, mode='nearest'))
        usual = 1.4826 * median_filter(away, 20 * NEIGHBOURS + 1, mode='nearest')
        spikes = away > np.maximum(SPIKE * usual, least)
        if not spikes.any() or spikes.mean() > MOST_SPIKES:
            continue
        advice.append(Advice('spikes', (
            f'{trial.source}: {int(spikes.sum())} values of {name} jump away for a moment and are left out: look at '
            f'the sensor if they are many')))  # fmt: skip
        cleaned = values.copy()
        cleaned[known[spikes]] = np.nan
        trial = replace(trial, **{name: cleaned})
    return trial


def mirrored(trial):
    """The trial with port and starboard motion exchanged: NED to ENU, and back; thrusters stay."""
    changed = {name: -getattr(trial, name) for name in ('sway', 'yaw_rate') if getattr(trial, name) is not None}
    if trial.heading is not None:
        changed['heading'] = math.pi / 2 - trial.heading
    if trial.x is not None and trial.y is not None:
        changed.update(x=trial.y, y=trial.x)
    return replace(trial, **changed)


def _set_right(trials, advice):
    """The trials in ENU, reversed and swapped channels set right, and reported."""
    for trial in trials:
        if trial.frame not in (None, 'enu', 'ned'):
            raise InputError(f"{trial.source}: there is no frame '{trial.frame}': state enu or ned")
    trials = [mirrored(t) if t.frame == 'ned' else t for t in trials]
    for verdict, remedy in (
        (_heading_turned, _turn_heading), (_yaw_rate_likeness, _reverse_yaw_rate), (_surge_likeness, _reverse_surge),
        (_sway_likeness, _reverse_sway), (_thrust_likeness, _reverse_thrust), (_thruster_likeness, _exchange_sides),
    ):  # fmt: skip
        found = [verdict(t) for t in trials]
        told = [f for f in found if f is not None]
        common = max(told, key=told.count) if told else None
        trials = [
            remedy(t, common if f is None else f, a) if (common if f is None else f) else t
            for t, f, a in zip(trials, found, advice, strict=True)
        ]
    return _aligned(trials, advice)


def _aligned(trials, advice):
    """The trials with the compass along the keel, where it was mounted or calibrated askew.

    A compass that is off by a small angle shows in the sway as that angle times the speed, whatever the course; a
    current shows by the course, and a turn by the yaw rate. So the sway is regressed on all of these.
    """
    rows = [_sway_by_cause(t) for t in trials]
    told = [r for r in rows if r is not None]
    if not told:
        return trials
    count = sum(len(sway) for sway, _, _ in told)
    sway, shared, currents = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 2 * len(told)))
    begin = 0
    for k, (values, causes, course) in enumerate(told):
        span = slice(begin, begin + len(values))
        sway[span], shared[span], currents[span, 2 * k : 2 * k + 2] = values, causes, course
        begin = span.stop
    matrix = np.concatenate([shared, currents], axis=1)
    prior = np.concatenate([np.zeros(3), np.full(currents.shape[1], USUAL_CURRENT**-2.0)])
    variance = np.var(sway)
    for _ in range(3):
        information = matrix.T @ matrix / (variance * REMEMBERED) + np.diag(prior)
        covariance = np.linalg.pinv(information, hermitian=True)
        found = covariance @ (matrix.T @ sway) / (variance * REMEMBERED)
        variance = max(float(np.mean((sway - matrix @ found) ** 2)), 1e-6)
    offset, std = float(np.arctan(found[0])), float(np.sqrt(covariance[0, 0]))
    if not LEAST_MISALIGNMENT < abs(offset) < LARGEST_MISALIGNMENT or abs(offset) < SURE * std:
        return trials
    for item, trial in zip(advice, trials, strict=True):
        item.append(Advice('compass-misaligned', (
            f'{trial.source}: the craft moves {abs(math.degrees(offset)):.1f} deg to '
            f'{"port" if offset > 0.0 else "starboard"} of its heading on straight courses: heading and speeds were '
            f'turned by that much; calibrate the compass')))  # fmt: skip
    return [_turned(trial, offset) for trial in trials]


def _sway_by_cause(trial):
    """Sway every half second under way ahead, and what may cause it; None where a trial does not tell.

    Returns
    -------
    sway : ndarray, shape (N,)
    causes : ndarray, shape (N, 3)
        Surge, yaw rate, and their product.
    course : ndarray, shape (N, 2)
        What a current to the east and to the north adds.
    """
    _, (heading, surge, sway) = _even(trial, 'heading', 'surge', 'sway')
    if heading is None:
        return None
    if surge is None or sway is None:
        track = _speeds_of_track(trial)
        if track is None:
            return None
        surge, sway = track
    rate = np.gradient(_lowpass(heading, 0.5), USUAL_STEP)
    surge, sway = _lowpass(surge, 0.5), _lowpass(sway, 0.5)
    keep = np.arange(surge.size) % round(0.5 / USUAL_STEP) == 0
    keep &= surge > MOVING
    if keep.sum() < 10:
        return None
    causes = np.stack([surge, rate, surge * rate], axis=1)
    return sway[keep], causes[keep], np.stack([-np.sin(heading), np.cos(heading)], axis=1)[keep]


def _turned(trial, offset):
    """The trial with heading and speeds turned to port by an angle, rad."""
    changed = {}
    if trial.heading is not None:
        changed['heading'] = trial.heading + offset
    if trial.surge is not None and trial.sway is not None:
        cosine, sine = math.cos(offset), math.sin(offset)
        changed.update(
            surge=trial.surge * cosine + trial.sway * sine, sway=trial.sway * cosine - trial.surge * sine)
    return replace(trial, **changed)


def _even(trial, *names):
    """Channels at even times, s and values, gaps bridged; None where a channel was not measured."""
    time = np.arange(trial.time[0], trial.time[-1], USUAL_STEP)
    found = []
    for name in names:
        values = getattr(trial, name)
        known = np.isfinite(values) if values is not None else np.zeros(1, dtype=bool)
        if known.sum() < 2:
            found.append(None)
            continue
        values = np.unwrap(values[known]) if name == 'heading' else values[known]
        found.append(np.interp(time, trial.time[known], values))
    return time, found


def _heading_turned(trial):
    """How the heading must be turned to agree with the course over ground.

    Returns
    -------
    None where the trial does not tell, else (mirrored, quarter turns), or () if it agrees.
    """
    _, (heading, x, y) = _even(trial, 'heading', 'x', 'y')
    span = round(2.0 / USUAL_STEP)
    if heading is None or x is None or y is None or heading.size < 4 * span:
        return None
    ahead, aside = x[2 * span :] - x[: -2 * span], y[2 * span :] - y[: -2 * span]
    moving = np.hypot(ahead, aside) > 2 * span * USUAL_STEP * MOVING
    if moving.sum() < 2 * span:
        return None
    course, heading = np.arctan2(aside, ahead)[moving], heading[span:-span][moving]
    straight, reverse = np.mean(np.exp(1j * (course - heading))), np.mean(np.exp(1j * (course + heading)))
    quarters, mirrored_quarters = (round(np.angle(mean) / (math.pi / 2)) % 4 for mean in (straight, reverse))
    if max(abs(straight), abs(reverse)) < 0.8:
        return None
    # on a straight course both readings are possible: a heading that agrees, else a compass' (clockwise from north)
    alike = abs(abs(straight) - abs(reverse)) < 0.2
    if (abs(straight) > abs(reverse) or alike) and quarters in (0, 2):
        return ()
    if abs(reverse) > abs(straight) + 0.2 or (alike and mirrored_quarters == 1):
        return True, mirrored_quarters
    return None if alike else (False, quarters)


def _turn_heading(trial, verdict, advice):
    if trial.heading is None:
        return trial
    reverse, quarters = verdict
    if reverse:
        advice.append(Advice('mixed-frames', (
            f'{trial.source}: heading and position are in different frames (one in NED, one in ENU): the heading is '
            f'taken as {90 * quarters} deg minus what was recorded; give both in one frame')))  # fmt: skip
        return replace(trial, heading=quarters * math.pi / 2 - trial.heading)
    advice.append(Advice('mixed-frames', (
        f'{trial.source}: the heading is off the course by {90 * quarters} deg and was turned by that much: check '
        f'which axis heading and position are measured from')))  # fmt: skip
    return replace(trial, heading=trial.heading + quarters * math.pi / 2)


def _yaw_rate_likeness(trial):
    """Whether yaw rate and heading turn opposite ways; None where the trial does not tell."""
    _, (heading, rate) = _even(trial, 'heading', 'yaw_rate')
    if heading is None or rate is None:
        return None
    slope, rate = np.gradient(_lowpass(heading, 0.5), USUAL_STEP), _lowpass(rate, 0.5)
    if np.std(rate) < 0.02 or np.std(slope) < 0.02:
        return None
    return _reversed(_correlation(slope, rate))


def _reverse_yaw_rate(trial, _, advice):
    if trial.yaw_rate is None:
        return trial
    advice.append(Advice('yaw-rate-reversed', (
        f'{trial.source}: yaw rate and heading turn opposite ways (one in NED, one in ENU): the yaw rate is reversed; '
        f'give both in one frame')))  # fmt: skip
    return replace(trial, yaw_rate=-trial.yaw_rate)


def _speeds_of_track(trial):
    """Surge and sway by position and heading, m/s, at even times; None where not measured."""
    _, (heading, x, y) = _even(trial, 'heading', 'x', 'y')
    if heading is None or x is None or y is None:
        return None
    east, north = (_slope(p, USUAL_STEP, 3.1) for p in (x, y))
    return east * np.cos(heading) + north * np.sin(heading), -east * np.sin(heading) + north * np.cos(heading)


def _speed_likeness(trial, name, place):
    """Whether a speed is opposite to that of the track; None where the trial does not tell."""
    _, (measured,) = _even(trial, name)
    track = _speeds_of_track(trial)
    if measured is None or track is None or np.sqrt(np.mean(track[place] ** 2)) < 0.1:
        return None
    # about zero, not about the mean: a steady speed tells its sign as well
    return _reversed(_likeness(measured, track[place]))


def _surge_likeness(trial):
    return _speed_likeness(trial, 'surge', 0)


def _sway_likeness(trial):
    return _speed_likeness(trial, 'sway', 1)


def _reverse_speed(trial, name, advice):
    if getattr(trial, name) is None:
        return trial
    advice.append(Advice(f'{name}-reversed', (
        f'{trial.source}: {name} is opposite to the change of position and is reversed: check its sign')))
    return replace(trial, **{name: -getattr(trial, name)})


def _reverse_surge(trial, _, advice):
    return _reverse_speed(trial, 'surge', advice)


def _reverse_sway(trial, _, advice):
    return _reverse_speed(trial, 'sway', advice)


def _thrust_likeness(trial):
    """Whether the speed falls when thrust rises: ``surge`` or ``thrust``, whichever is to be reversed."""
    _, (surge, port, starboard, x) = _even(trial, 'surge', 'port', 'starboard', 'x')
    if surge is None or port is None or starboard is None:
        return None
    total = port + starboard
    best = max((_likeness(_lowpass(total, tau), surge) for tau in (0.5, 2.0, 5.0)), key=abs)
    if np.std(surge) < 0.1 and abs(np.mean(surge)) < 0.2:
        return None
    if abs(best) < 0.7:
        return None
    if best > 0.0:
        return ()
    turned = _thruster_correlation(trial)
    confirmed = x is not None and trial.heading is not None
    return 'thrust' if confirmed or (turned is not None and turned < -SEEN) else 'surge'


def _reverse_thrust(trial, what, advice):
    if what == 'thrust':
        advice.append(Advice('thrust-reversed', (
            f'{trial.source}: the craft moves astern under positive thrust: both thrusts are reversed; check their '
            f'sign')))  # fmt: skip
        return replace(trial, port=-trial.port, starboard=-trial.starboard)
    if trial.surge is None:
        return trial
    advice.append(Advice('surge-reversed', (
        f'{trial.source}: the speed is negative under positive thrust and is reversed: check its sign, or that of both '
        f'thrusts')))  # fmt: skip
    return replace(trial, surge=-trial.surge)


def _thruster_correlation(trial):
    """Of the thrust difference with the yaw rate; None where the trial does not tell."""
    _, (rate, heading, port, starboard) = _even(trial, 'yaw_rate', 'heading', 'port', 'starboard')
    if rate is None and heading is not None:
        rate = np.gradient(_lowpass(heading, 0.5), USUAL_STEP)
    if rate is None or port is None or starboard is None:
        return None
    difference = starboard - port
    if not np.any(difference) or np.sqrt(np.mean(rate**2)) < 0.01:
        return None
    return max((_likeness(_lowpass(difference, tau), rate) for tau in (0.3, 1.0, 3.0)), key=abs)


def _thruster_likeness(trial):
    """Whether more thrust to starboard turns to starboard; None where the trial does not tell."""
    found = _thruster_correlation(trial)
    return None if found is None else _reversed(found)


def _exchange_sides(trial, _, advice):
    if trial.frame is None:
        advice.append(Advice('frame-assumed', (
            f'{trial.source}: more thrust to starboard turns to negative yaw, so yaw is taken as in NED; state the '
            f'frame (ned or enu): if it is ENU, port and starboard are swapped')))  # fmt: skip
        return mirrored(trial)
    advice.append(Advice('thrusters-swapped', (
        f'{trial.source}: more thrust to starboard turns to starboard in the frame stated ({trial.frame}), so port and '
        f'starboard were exchanged; check the channels, or the frame')))  # fmt: skip
    return replace(trial, port=trial.starboard, starboard=trial.port)


def _reversed(likeness):
    """True or False where a likeness is clear, else None."""
    return None if abs(likeness) < SEEN else bool(likeness < 0.0)


def _thrust_on(grid, trial, gap_means_zero, advice):
    """Inputs held on the grid, and where they are known."""
    known = np.isfinite(trial.port) & np.isfinite(trial.starboard)
    if not known.any():
        if not gap_means_zero:
            raise InputError(f'{trial.source} holds no finite thrust of both thrusters: check its columns')
        return np.zeros(grid.size), np.zeros(grid.size), np.ones(grid.size, dtype=bool)
    time = trial.time[known]
    last = np.searchsorted(time, grid + 1e-6, side='right') - 1
    age = grid - time[np.maximum(last, 0)]
    started = last >= 0
    last = np.maximum(last, 0)
    port, starboard = trial.port[known][last], trial.starboard[known][last]
    hold = max(HOLD, 3.0 * float(np.median(np.diff(time)))) if time.size > 1 else HOLD
    if gap_means_zero:
        silent = ~started | (age > min(hold, LONGEST_GAP))
        port, starboard = np.where(silent, 0.0, port), np.where(silent, 0.0, starboard)
        return port, starboard, np.ones(grid.size, dtype=bool)
    driven = started & (age <= max(LONGEST_GAP, hold))
    lost = 1.0 - driven.mean()
    if lost > 0.001:
        advice.append(Advice('thrust-gaps', (
            f'{trial.source}: the thrust is missing for {lost * (grid[-1] - grid[0]):.0f} s, which are left out: if '
            f'commands are published only while driving, say that a gap means zero (--gap-means-zero)')))  # fmt: skip
    return np.where(driven, port, 0.0), np.where(driven, starboard, 0.0), driven


def _not_held(name, values, advice, source):
    """NaN for repetitions of a slower sensor's last value."""
    known = np.flatnonzero(np.isfinite(values))
    changed = np.diff(values[known]) != 0.0
    if known.size < 20 or not changed.any() or np.std(values[known]) == 0.0:
        return values
    runs = np.diff(np.flatnonzero(np.concatenate([[True], changed, [True]])))
    usual = float(np.median(runs))
    if usual < 3.0 or np.mean(runs[runs > 1] <= 2.5 * usual) < 0.7:
        return values
    advice.append(Advice('held-samples', (
        f'{source}: {name} changes only at every {usual:.0f}th sample: the repetitions are taken as missing')))
    fresh = values.copy()
    fresh[known[1:][~changed]] = np.nan
    return fresh


def _on_grid(grid, step, time, values):
    """Fast channels averaged around each grid time, slow ones put at the nearest, NaN elsewhere."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    interval = float(np.median(np.diff(time))) if time.size > 1 else step
    if interval < 0.75 * step:
        place = np.rint((time - grid[0]) / step).astype(int)
        inside = (place >= 0) & (place < grid.size)
        held, means = bin_means(place[inside], values[inside])
        found = np.full(grid.size, np.nan)
        found[held] = means
        return found
    after = np.clip(np.searchsorted(time, grid), 0, time.size - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(time[after] - grid) <= np.abs(grid - time[before]), after, before)
    near = np.abs(time[nearest] - grid) <= 0.5 * step + 1e-9
    if interval <= 1.5 * step:
        between = (time[after] - time[before] < 1.8 * interval) & (time[before] <= grid) & (grid <= time[after])
        found = np.where(between, np.interp(grid, time, values), np.where(near, values[nearest], np.nan))
        return found
    return np.where(near, values[nearest], np.nan)


def _derive_channels(measured, pose, step, advice, source):
    """Yaw rate from heading, speeds from position and heading, where they were not measured."""
    heading, x, y = (pose[name] for name in POSE)
    if 'yaw_rate' not in measured and heading is not None:
        measured['yaw_rate'] = _slope(heading, step, 1.1)
        advice.append(Advice('yaw-rate-derived', f'{source}: no yaw rate: it is derived from the heading'))
    if heading is None or x is None or y is None or ('surge' in measured and 'sway' in measured):
        return
    east, north = _slope(x, step, 2.1), _slope(y, step, 2.1)
    derived = {
        'surge': east * np.cos(heading) + north * np.sin(heading),
        'sway': -east * np.sin(heading) + north * np.cos(heading),
    }
    missing = [name for name in derived if name not in measured]
    measured.update({name: derived[name] for name in missing})
    advice.append(Advice('speed-derived', (
        f'{source}: no {" and no ".join(missing)}: derived from position and heading')))  # fmt: skip


def _slope(values, step, span):
    window = max(5, 2 * int(span / step / 2) + 1)
    return savgol_filter(values, min(window, 2 * ((values.size - 1) // 2) + 1), 2, deriv=1, delta=step)


def _filled(values):
    """Linear over gaps; None stays None."""
    return None if values is None else _bridged(values)


def _bridged(values):
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(values.size)
    if known.all():
        return values
    place = np.arange(values.size)
    return np.interp(place, place[known], values[known])


def _unwrapped(heading):
    known = np.isfinite(heading)
    found = np.full(heading.size, np.nan)
    found[known] = np.unwrap(heading[known])
    return found


def _lowpass(values, tau):
    decay = math.exp(-USUAL_STEP / tau)
    return lfilter([1.0 - decay], [1.0, -decay], values, zi=[decay * values[0]])[0]


def _correlation(a, b):
    return _likeness(a - np.mean(a), b - np.mean(b))


def _likeness(a, b):
    """Correlation about zero."""
    size = np.sqrt(np.sum(a * a) * np.sum(b * b))
    return float(np.sum(a * b) / size) if size > 0 else 0.0
