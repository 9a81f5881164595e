"""Forecasts after silence, stamps of zero and steps of the clock, against those of the clean stream.

    OMP_NUM_THREADS=1 python benchmark/restarts.py
    OMP_NUM_THREADS=1 python benchmark/restarts.py clean 'clock +0.5 s' --seeds 12

The samples of a craft in waves, 100 Hz with the noise that they report, pass through the pipeline of the nodes. For
each fault, axis and span of time after the first sample that follows it: coverage of the 90 % intervals, their standard
deviation over the root mean square error, and that error over the one of the clean stream, at each lead. Beside it, the
reasons that were counted. Periods are those of the roll motion.
"""

from collections import Counter
from copy import deepcopy
from typing import Annotated

import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, body_rates, quaternion
from swath_sysid.attitude.motion.intake import ImuReading
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.evaluation.cli.benchmark import HALF_90, Benchmark
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline
from swath_sysid.pipeline.record_run import followed

RATE, WARM, AFTER = 100, 100.0, 3.0  # Hz; s; periods
PERIOD = 3.2  # s, of the roll motion
PHASE = 0.4  # of an interval
LEADS = 0.1, 0.5, 1.0, 2.0
SPANS = (0.0, 0.25), (0.25, 1.0), (1.0, 2.0), (2.0, 3.0)  # periods
NOISE = {'angle': 3e-4, 'rate': 2e-3, 'force': 0.03}
UNKNOWN = (0.0,) * 9
CRAFT = {'roll': (3.0, 0.06, 4.0), 'pitch': (2.2, 0.12, 2.0)}  # natural period, s; damping ratio; motion, deg
EPOCH_NS = 1_700_000_000 * 10**9


def hulls(stiffness=1.0):
    """The identified models of the craft, of so many times its stiffness."""
    found = {}
    for axis, (natural, damping, _) in CRAFT.items():
        ratios = {'b1': 4.0 * np.pi * damping / natural, 'r1': stiffness * (2.0 * np.pi / natural) ** 2}
        found[axis] = IdentifiedModel.exactly(DecayModel.from_terms(equation_named('linear'), ratios, axis=axis))
    return found


class Waves:
    """Roll and pitch of a linear craft in random waves, at any time, s: sums of components."""

    def __init__(self, seed, size=1.0):
        random = np.random.default_rng(seed)
        frequency = np.linspace(0.13, 0.77, 80) * (1.0 + 0.004 * random.uniform(-1.0, 1.0, 80))
        self.frequency = 2.0 * np.pi * frequency
        wave = np.sqrt(frequency**-5.0 * np.exp(-1.25 * (0.294 / frequency) ** 4))
        wave = wave * np.exp(2j * np.pi * random.uniform(size=80))
        self.components = {}
        for axis, (natural, damping, deviation) in CRAFT.items():
            ratio = self.frequency * natural / (2.0 * np.pi)
            response = wave * self.frequency**2 / (1.0 - ratio**2 + 2j * damping * ratio)
            response *= size * np.radians(deviation) / np.sqrt((np.abs(response) ** 2).sum() / 2.0)
            self.components[axis] = response
        heave = wave * np.exp(0.7j)
        self.components['heave'] = size * 0.15 * heave / np.sqrt((np.abs(heave) ** 2).sum() / 2.0)

    def motion(self, axis, time, order=0):
        """Angle, heave or a derivative of it at times of any shape, s."""
        swing = np.exp(1j * np.asarray(time)[..., None] * self.frequency)
        return (swing @ (self.components[axis] * (1j * self.frequency) ** order)).real


def readings(waves, time, seed, stamps=None):
    """What a sensor sends at these times, s, stamped so unless other stamps, s, are given; NaN: zero."""
    noise = np.random.default_rng(seed).normal(size=(time.size, 8))
    angles = [waves.motion(axis, time) for axis in AXES]
    rates = [waves.motion(axis, time, 1) for axis in AXES]
    body = np.array([body_rates(*each, 0.0) for each in zip(*angles, *rates, strict=True)])
    body += NOISE['rate'] * noise[:, 2:5]
    measured = [angle + NOISE['angle'] * noise[:, k] for k, angle in enumerate(angles)]
    level = np.array([-np.sin(angles[1]), np.sin(angles[0]) * np.cos(angles[1]), np.cos(angles[0]) * np.cos(angles[1])])
    force = (STANDARD_GRAVITY + waves.motion('heave', time, 2))[:, None] * level.T + NOISE['force'] * noise[:, 5:]
    variances = [np.diag(np.full(3, NOISE[kind] ** 2)).ravel().tolist() for kind in ('angle', 'rate')]
    return [
        ImuReading(
            0 if stamp != stamp else EPOCH_NS + round(1e9 * stamp),
            tuple(map(float, quaternion(roll, pitch, 0.6))),
            variances[0],
            tuple(rate),
            variances[1],
            tuple(specific),
            UNKNOWN,
        )
        for stamp, roll, pitch, rate, specific in zip(
            (time if stamps is None else stamps).tolist(), *measured, body.tolist(), force.tolist(), strict=True
        )
    ]


def silence(duration):
    """No samples for so many s; the sensor's phase is another one when it comes back."""
    return lambda time: (time + duration + PHASE / RATE, time + duration + PHASE / RATE)


def step(by):
    """Stamps from now on are ahead by so many s."""
    return lambda time: (time, time + by)


def zeros(duration):
    """Stamps of zero for so many s."""

    def of(time):
        time = np.concatenate([np.arange(round(duration * RATE)) / RATE, time + duration])
        return time, np.where(time < duration, np.nan, time)

    return of


#: By name, times, s, and stamps, s, NaN for zero, of samples at even times after a moment.
FAULTS = {
    'clean': step(0.0),
    **{f'silence {duration:g} s': silence(duration) for duration in (1.0, 10.0, 60.0)},
    'stamps of zero 10 s': zeros(10.0),
    **{f'clock {by:+g} s': step(by) for by in (0.5, -0.5, 5.0, -5.0, 3600.0)},
}


def play(pipeline, samples):
    """The forecasts that a pipeline issues, and how often each reason is counted."""
    issued, reasons = [], Counter()
    for found in followed(pipeline, samples):
        reasons.update(found.reasons)
        if found.lost:
            reasons['lost'] += found.lost
        if found.forecast is not None:
            issued.append(found)
    return issued, reasons


def errors_after(seed, faults, size, with_hulls):
    """By fault: errors and standard deviations (N, L, A) at ages (N,), periods, after each; the reasons."""
    waves = Waves(seed, size)
    warm = WARM + 0.37 * seed
    before = ForecastPipeline()
    before.set_models(hulls() if with_hulls else {})
    play(before, readings(waves, np.arange(-round(warm * RATE), 0) / RATE, seed))
    even = np.arange(round(AFTER * PERIOD * RATE)) / RATE
    for name in faults:
        time, stamps = FAULTS[name](even)
        samples = readings(waves, time, seed + 1000, stamps)
        issued, reasons = play(deepcopy(before), samples)
        when = dict(zip((each.stamp_ns for each in samples), time.tolist(), strict=True))
        first = time[np.isfinite(stamps)][0]
        now = np.array([when[found.sample.stamp_ns] for found in issued])
        issued = [found.forecast for found, each in zip(issued, now, strict=True) if each >= first]
        now = now[now >= first]
        places = [list(issued[0].leads).index(lead) for lead in LEADS]
        truth = np.stack([waves.motion(axis, now[:, None] + np.array(LEADS)) for axis in AXES], axis=2)
        mean = np.array([forecast.mean[places, : len(AXES)] for forecast in issued])
        deviation = np.array([forecast.deviation[places, : len(AXES)] for forecast in issued])
        yield name, (now - first) / PERIOD, mean - truth, deviation, reasons


def line_of(name, axis, span, of_all, of_clean):
    """One line: by lead, coverage, deviation over error, and error over that of the clean stream."""
    error, deviation = of_all
    rms = np.sqrt(np.mean(error**2, axis=0))
    held = (np.abs(error) <= HALF_90 * deviation).mean(axis=0)
    width = np.sqrt(np.mean(deviation**2, axis=0)) / rms
    clean = rms / np.sqrt(np.mean(of_clean[0] ** 2, axis=0))
    cells = '  '.join(f'{h:5.2f} {w:5.1f} {c:6.1f}' for h, w, c in zip(held, width, clean, strict=True))
    return f'{name:20} {axis:5} {span[0]:4g} to {span[1]:4g}  {len(error):4d}  {cells}'


def lines(
    *faults: Annotated[str, FAULTS, f'of {", ".join(FAULTS)}'],
    seeds: int = 8,
    size: Annotated[float, 'the motion as many times larger; 0: at rest'] = 1.0,
    with_hulls: Annotated[bool, 'the true ones'] = False,
):
    """The table of the faults asked for."""
    faults = ['clean', *(name for name in faults or FAULTS if name != 'clean')]
    found = {name: [] for name in faults}
    reasons = {name: Counter() for name in faults}
    for seed in range(1, seeds + 1):
        for name, *result, counted in errors_after(seed, faults, size, with_hulls):
            found[name].append(result)
            reasons[name].update(counted)
    yield f'{"":44}' + '  '.join(f'{f"{lead:g} s: held std err":18}' for lead in LEADS)
    of_clean = {}
    for name in faults:
        age, error, deviation = (np.concatenate(values) for values in zip(*found[name], strict=True))
        for place, axis in enumerate(AXES):
            for span in SPANS:
                now = (age >= span[0] - 1e-9) & (age < span[1] - 1e-9)
                chosen = error[now][..., place], deviation[now][..., place]
                yield line_of(name, axis, span, chosen, of_clean.setdefault((axis, span), chosen))
        yield f'{name}: {dict(reasons[name])}\n'


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
