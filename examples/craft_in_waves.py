"""What the examples of controllers share: a craft in waves, measured or simulated, and what was forecast of it."""

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np

from swath_sysid import ForecasterSettings, InputError, Trial, read_trial, read_upstream, run_through
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.attitude.prediction.point import POINT_MOTION
from swath_sysid.cli.progress import progress_of
from swath_sysid.evaluation.baselines import vertical_record
from swath_sysid.evaluation.scoring import SENSOR
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.report.figures import FORMATS, save_figure

STEP = 0.1
SETTINGS = ForecasterSettings(leads=(0.1, 1.0, 3.0), horizon=3.0, points=(SENSOR,))
NOTHING_FORECAST = 'no vertical motion was forecast in this record: give one that is longer than the warm-up'
ATTITUDE = ('roll', 'pitch', 'roll_rate', 'pitch_rate')


def simulated_craft(duration, seed=1, height=2.0, period=9.0):
    """A craft in a JONSWAP sea as its IMU would have recorded it: it follows the surface, and its slope as a hull does.

    Parameters
    ----------
    duration : float
        s.
    seed : int
    height, period : float
        Significant height, m, and peak period, s.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, STEP)
    frequency = np.fft.rfftfreq(2 * time.size, STEP)
    inside = (frequency > BAND_HZ[0]) & (frequency < 0.5)
    w = 2.0 * np.pi * frequency[inside]
    ratio = w * period / (2.0 * np.pi)
    peak = np.exp(-((ratio - 1.0) ** 2) / (2.0 * np.where(ratio <= 1.0, 0.07, 0.09) ** 2))
    density = ratio**-5.0 * np.exp(-1.25 * ratio**-4.0) * 3.3**peak
    lines = np.sqrt(density / density.sum() / 2.0) * (rng.normal(size=(2, w.size)).T @ (1.0, 1j)) * height / 4.0

    def series(response):
        spectrum = np.zeros(frequency.size, dtype=complex)
        spectrum[inside] = response * lines * time.size * math.sqrt(2.0)
        return np.fft.irfft(spectrum)[: time.size]

    slope, channels = 1j * w**2 / STANDARD_GRAVITY, {}
    for axis, natural_period, damping, share in (('roll', 4.0, 0.12, 0.5), ('pitch', 2.5, 0.2, -0.8)):
        tuning = w * natural_period / (2.0 * np.pi)
        angle = share * slope / (1.0 - tuning**2 + 2j * damping * tuning)
        channels |= {axis: series(angle), f'{axis}_rate': series(1j * w * angle)}
    up, roll, pitch = STANDARD_GRAVITY + series(-(w**2)), channels['roll'], channels['pitch']
    force = -np.sin(pitch) * up, np.sin(roll) * np.cos(pitch) * up, np.cos(roll) * np.cos(pitch) * up
    channels |= dict(zip(('accel_x', 'accel_y', 'accel_z'), force, strict=True))
    noise = {name: 0.01 if name.startswith('accel') else 2e-4 for name in channels}
    return Trial(
        time,
        source='simulated',
        **{name: values + noise[name] * rng.normal(size=time.size) for name, values in channels.items()},
    )


@dataclass(frozen=True)
class Voyage:
    """What was forecast at N moments, and what came.

    Attributes
    ----------
    stamps : ndarray, shape (N,)
        s; forecasts of vertical motion were issued then, whose truth is known at the longest lead.
    leads : ndarray, shape (H,)
        Of the horizon, s.
    mean : ndarray, shape (N, H, 7)
        Heave, vertical velocity, vertical acceleration, roll, pitch and their rates, in SI units.
    covariance : ndarray, shape (N, H, 7, 7)
    truth : callable
        From times, shape (...), to what came, shape (..., 7); NaN where it is not known.
    calm : ndarray, shape (N, 2)
        Begin and end of the window of calm forecast then, s from the stamp; NaN where none was.
    """

    stamps: np.ndarray
    leads: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    truth: object
    calm: np.ndarray

    def at_lead(self, lead):
        """Mean, shape (N, 7), and covariance, shape (N, 7, 7), this many seconds ahead."""
        place = int(np.abs(self.leads - lead).argmin())
        return self.mean[:, place], self.covariance[:, place]


def truth_of(trial):
    """What came, as a function of times: see `Voyage`."""
    vertical = vertical_record(trial, (SENSOR,))
    places = [vertical.names.index(f'{SENSOR.name}.{kind}') for kind in POINT_MOTION]

    def truth(times):
        attitude = [np.interp(times, *_measured(trial, name)) for name in ATTITUDE]
        return np.concatenate([vertical.at(times, places), np.stack(attitude, axis=-1)], axis=-1)

    return truth


def sail(trial, warmup, settings=SETTINGS, progress=None, upstream=None):
    """The predictor run causally through a record, with upstream channels; the first `warmup` seconds are left out."""
    run, truth = run_through(trial, settings, progress=progress, upstream=upstream), truth_of(trial)
    known = [
        step
        for step in run.steps
        if step.stamp >= trial.time[0] + warmup
        and step.horizon.points
        and np.isfinite(truth(step.stamp + np.array([0.0, settings.horizon]))).all()
    ]
    if not known:
        raise InputError(NOTHING_FORECAST)
    ahead, calm = [step.horizon for step in known], [step.outlook.calm for step in known]
    return Voyage(
        np.array([step.stamp for step in known]),
        ahead[0].leads,
        np.concatenate([[h.points[SENSOR.name].mean for h in ahead], [h.mean for h in ahead]], axis=2),
        np.array([h.points[SENSOR.name].covariance for h in ahead]),
        truth,
        np.array([(math.nan, math.nan) if window is None else (window.begin, window.end) for window in calm]),
    )


def _measured(trial, name):
    known = np.isfinite(trial.channels[name])
    return trial.time[known], trial.channels[name][known]


def carry_out(description, demonstrate, argv=None, settings=SETTINGS, live=None):
    """Run an example from its command line.

    Parameters
    ----------
    description : str
    demonstrate : callable
        Prints the table of a `Voyage` and returns its figure.
    argv : sequence of str, optional
    settings : ForecasterSettings, optional
    live : callable, optional
        For ``--live``: the `Voyage` of a trial, a warm-up in s and a rate, through the running nodes.

    Returns
    -------
    int
        The exit code.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument('record', nargs='?', help='of attitude, rates and accelerations (default: simulated)')
    parser.add_argument('--frame', choices=('flu', 'frd'), help="the sensor's axes")
    parser.add_argument('--upstream', action='append', default=[], metavar='COLUMN', help='waves on their way; repeat')
    parser.add_argument('--warmup', type=float, default=600.0, metavar='S', help='not counted (default: %(default)s)')
    parser.add_argument('--figure', default='figure.png', metavar='FILE', help='default: %(default)s')
    if live is not None:
        parser.add_argument('--live', action='store_true', help='replay the record into the running node over DDS')
        parser.add_argument('--rate', type=float, default=50.0, help='times real time at most (default: %(default)s)')
    arguments = parser.parse_args(argv)
    try:
        check_outputs([Output('--figure', arguments.figure, endings=FORMATS)], [arguments.record])
        trial = read_trial(arguments.record, frame=arguments.frame) if arguments.record else simulated_craft(1200.0)
        if arguments.upstream and (arguments.record is None or getattr(arguments, 'live', False)):
            raise InputError('--upstream names a column of a record, and does not go with --live')
        beside = read_upstream(arguments.record, arguments.upstream) if arguments.record else {}
        if live is not None and arguments.live:
            voyage = live(trial, arguments.warmup, arguments.rate)
        else:
            with progress_of('forecasting') as progress:
                voyage = sail(trial, arguments.warmup, settings, progress, beside)
        save_figure(demonstrate(voyage), arguments.figure)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0
