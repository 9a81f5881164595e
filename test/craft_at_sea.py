"""Hulls simulated in seas of which every wave is known."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, amplitude_curves

COMPONENTS = 400
SETTLING = 20.0
"""s left out at the begin."""


@dataclass(frozen=True)
class KnownSea:
    """Motion of a hull in seas of known excitation: time, s, angle and rate, rad and rad/s, a column a seed."""

    time: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    model: DecayModel

    def truth(self, column=0):
        """Natural period, s, and equivalent damping ratio at two standard deviations of the angle."""
        amplitude = 2.0 * self.angle[:, column].std()
        curves = amplitude_curves(self.model.ratios, np.array([amplitude]), self.model.friction_rate)
        return 2.0 * np.pi / curves.frequency[0], curves.damping_ratio[0]


def jonswap(frequency, peak, gamma):
    """Spectrum of the height of the waves, of any unit."""
    width = np.where(frequency <= peak, 0.07, 0.09)
    enhanced = gamma ** np.exp(-0.5 * ((frequency / peak - 1.0) / width) ** 2)
    return frequency**-5.0 * np.exp(-1.25 * (peak / frequency) ** 4) * enhanced


def known_sea(model, seeds, peak_ratio, std, duration, *, by_slope=False, interval=0.05, gamma=3.3):
    """A hull in long-crested seas, one for each seed, scaled until the angle has the standard deviation, rad.

    ``peak_ratio`` is the peak period of the waves over the natural one; the moment follows the waves' height or slope.
    """
    steps = round((duration + SETTLING) / interval)
    halves = np.arange(2 * steps + 1) * 0.5 * interval
    natural = model.natural_frequency
    peak = natural / peak_ratio
    moments = np.stack([moment_of(halves, peak, gamma, by_slope, natural, seed) for seed in seeds], axis=1)
    scale = scale_for(model, moments, std, interval)
    angle, rate = driven(model, scale * moments, interval)
    assert np.abs(angle).max() < 0.5, 'the hull capsized: choose a smaller std'
    settled = round(SETTLING / interval)
    return KnownSea(halves[::2][settled:steps], angle[settled:], rate[settled:], model)


def scale_for(model, moments, std, interval):
    """What moments at half steps, shape (2 N + 1, S), are to be multiplied with for an angle of this size, rad."""
    scale = 0.02
    for _ in range(6):
        angle, _ = driven(model, scale * moments[:6001], interval)
        found = angle[400:].std()
        if abs(found - std) < 1e-3 * std:
            break
        scale *= std / found if np.isfinite(found) and np.abs(angle).max() < 0.5 else 0.5
    return scale


def moment_of(time, peak, gamma, by_slope, natural, seed):
    """Sum of waves of incommensurate frequencies, one drawn in each of many bands."""
    rng = np.random.default_rng(seed)
    edges = np.linspace(0.4 * peak, max(5.0 * peak, 3.0 * natural), COMPONENTS + 1)
    frequency = rng.uniform(edges[:-1], edges[1:])
    spectrum = jonswap(frequency, peak, gamma) * (frequency**4 if by_slope else 1.0)
    amplitude = np.sqrt(2.0 * spectrum * np.diff(edges))
    phase = rng.uniform(0.0, 2.0 * np.pi, COMPONENTS)
    # the largest is one, whatever the units were
    amplitude /= np.sqrt(0.5 * np.sum(amplitude**2))
    moment = np.empty_like(time)
    for begin in range(0, time.size, 4000):
        part = slice(begin, begin + 4000)
        moment[part] = np.cos(np.outer(time[part], frequency) + phase) @ amplitude
    return moment


def driven(model, moments, interval, start=(0.0, 0.0)):
    """Runge-Kutta from a state at the start, moments at half steps: angles and rates, shapes (N, S)."""
    steps = moments.shape[0] // 2
    angles, rates = np.empty((2, steps, moments.shape[1]))
    x, w = (np.broadcast_to(value, moments.shape[1]) for value in start)
    with np.errstate(all='ignore'):
        for k in range(steps):
            angles[k], rates[k] = x, w
            begin, middle, end = moments[2 * k : 2 * k + 3]
            a1 = model.acceleration(x, w, begin)
            w2 = w + 0.5 * interval * a1
            a2 = model.acceleration(x + 0.5 * interval * w, w2, middle)
            w3 = w + 0.5 * interval * a2
            a3 = model.acceleration(x + 0.5 * interval * w2, w3, middle)
            w4 = w + interval * a3
            a4 = model.acceleration(x + interval * w3, w4, end)
            x = x + interval / 6.0 * (w + 2.0 * w2 + 2.0 * w3 + w4)
            w = w + interval / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return angles, rates
