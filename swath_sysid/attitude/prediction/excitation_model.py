"""The exciting moment of the sea on a known hull, learnt from a window of angle and rate.

The moment m = angle'' + D(angle') + R(angle) from both sensors weighted by their noise; its spectrum by sine tapers
less the amplified noise; an autoregression (Yule and Walker); and its balanced truncation
for forecasts up to `FORECAST_SPAN` ahead, in modal form.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import eigh, expm, solve_discrete_lyapunov, solve_toeplitz, svd
from scipy.ndimage import gaussian_filter1d

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.prediction.hull_filter import ExcitationFit, ExcitationRequest, HullFilter
from swath_sysid.attitude.prediction.modal_moment import ModalMoment
from swath_sysid.attitude.prediction.variate_analysis import LARGEST_RADIUS, spectral_radius
from swath_sysid.common.conventions import NEGLIGIBLE
from swath_sysid.common.signals import sine_tapers

SMOOTHING = 0.02  #: Standard deviation of the spectrum's smoothing, over the motion's frequency.
HIGHEST_FREQUENCY = 10.0  #: Over the motion's; above, waves move no craft and the hull's inverse only amplifies noise.
AUTOREGRESSION_SPAN = 3.75  #: Periods of lags.

STATES = 20
#: Periods; forecasts up to there decide which states are kept; a new filter finds the waves' phase in as much past.
FORECAST_SPAN = 6.25
DOUBLINGS = 11  #: The filter's covariance is steady after 2048 steps.

MIN_SAMPLES = 300


@dataclass(frozen=True)
class Spectrum:
    """Two-sided spectrum of a moment, at frequencies in rad/s."""

    frequency: np.ndarray
    density: np.ndarray


def fit_excitation(request: ExcitationRequest) -> ExcitationFit | None:
    """The moment of a window; None where the window is too short."""
    if request.angle.size < MIN_SAMPLES or not np.isfinite(request.angle + request.rate).all():
        return None
    moment = reduced_moment(moment_spectrum(request), request)
    mean, covariance, levels = _state_now(request, moment)
    return ExcitationFit(moment, mean, covariance, levels, None if request.hull_is_known else request.model)


def equivalent_hull(model: DecayModel, rates: np.ndarray) -> tuple[float, float]:
    """Stiffness at trim, 1/s^2, and the damping, 1/s, that dissipates the same energy at these rates."""
    by_angle, by_rate = model.jacobian(model.trim, 0.0)
    damping, square = -model.acceleration(model.trim, rates), float(rates @ rates)
    return -by_angle, float(damping @ rates) / square if square > 0.0 else -by_rate


def moment_spectrum(request: ExcitationRequest) -> Spectrum:
    """Spectrum of the moment, noise subtracted."""
    step, n = request.step, request.angle.size
    ramp = max(20, n // 100)
    ends = np.ones(n)
    ends[:ramp] = 0.5 * (1.0 - np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp))
    ends[-ramp:] = ends[ramp - 1 :: -1]
    length = next_fast_len(n, real=True)
    w = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    centre = request.angle.mean()
    angle, rate = rfft((request.angle - centre) * ends, length), rfft(request.rate * ends, length)
    precision = 1.0 / request.angle_variance + w**2 / request.rate_variance
    # the mean of the samples of a step attenuates what is fast (Dirichlet's kernel)
    kept = np.sinc(w * step / (2.0 * np.pi)) / np.sinc(w * step / (2.0 * np.pi * request.samples))
    best = (angle / request.angle_variance - 1j * w * rate / request.rate_variance) / precision / kept
    precision *= kept**2
    highest = HIGHEST_FREQUENCY * 2.0 * np.pi / request.period
    best[w > highest] = 0.0
    parts = [irfft(factor * best, length)[ramp : n - ramp] for factor in (1.0, 1j * w, -w * w)]
    moment = parts[2] - request.model.acceleration(parts[0] + centre, parts[1])
    stiffness, damping = equivalent_hull(request.model, parts[1])
    noise = np.abs(stiffness - w * w + 1j * w * damping) ** 2 * step / precision
    tapered = sine_tapers(moment.size) * (moment - moment.mean())
    length = next_fast_len(moment.size, real=True)
    f = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    keep = (f > 0.0) & (f < highest)
    f, density = f[keep], (np.abs(rfft(tapered, length, axis=1)) ** 2).mean(axis=0)[keep] * step
    noise = np.interp(f, w, noise)
    smooth = gaussian_filter1d(density, SMOOTHING * 2.0 * np.pi / request.period / (f[1] - f[0]), mode='nearest')
    return Spectrum(f, np.maximum(smooth - noise, NEGLIGIBLE * noise))


def autoregression(covariance: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients (p,) and innovation variance from covariances (p + 1,) at lags 0 to p, by Yule and Walker."""
    column = covariance[:-1].copy()
    column[0] *= 1.0 + 1e-8
    coefficients = solve_toeplitz(column, covariance[1:])
    return coefficients, max(float(column[0] - coefficients @ covariance[1:]), 1e-12 * float(column[0]))


def autocovariance(spectrum: Spectrum, step: float, lags: int) -> np.ndarray:
    """Autocovariance of a process at ``lags`` steps from zero; the spectrum's frequencies are in FFT order."""
    first = spectrum.frequency[0]
    return irfft(np.append(0.0, spectrum.density), round(2.0 * np.pi / (first * step)))[:lags] / step


def reduced_moment(spectrum: Spectrum, request: ExcitationRequest) -> ModalMoment:
    """The few states of the moment that forecasts of the angle need."""
    step = request.step
    order = min(round(AUTOREGRESSION_SPAN * request.period / step), request.angle.size // 10)
    covariance = autocovariance(spectrum, step, order + 1)
    coefficients, noise = autoregression(covariance)
    stiffness, damping = equivalent_hull(request.model, request.rate)
    p, first = order, np.eye(1, order)[0]
    companion = np.zeros((p, p))
    companion[0] = coefficients
    companion[np.arange(1, p), np.arange(p - 1)] = 1.0
    motion = expm(np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, 1.0], [0.0, 0.0, 0.0]]) * step)[:2]
    a, q = np.zeros((p + 2, p + 2)), np.zeros((p + 2, p + 2))
    a[:2, :2], a[:2, 2:], a[2:, 2:] = motion[:, :2], np.outer(motion[:, 2], 0.5 * (first + coefficients)), companion
    driven = np.array([*(0.5 * motion[:, 2]), 1.0])
    q[:3, :3] = noise * np.outer(driven, driven)
    q[0, 0] += 1e-14
    q[1, 1] += 1e-14
    known = _filtered_covariance(a, q, (request.angle_variance, request.rate_variance))
    at_rest = covariance[np.abs(np.subtract.outer(np.arange(p), np.arange(p)))]
    rows = np.empty((1 + round(FORECAST_SPAN * request.period / step), p + 2))
    rows[0] = np.eye(1, p + 2)
    for k in range(1, len(rows)):
        rows[k] = rows[k - 1] @ a
    now, then = rows[:-1, :3], rows[1:]
    grown = np.cumsum(((now @ q[:3, :3]) * now).sum(axis=1))
    deviation = np.sqrt(((then @ known) * then).sum(axis=1) + grown)
    weights = np.vstack([then[:, 2:] / deviation[:, None], first / math.sqrt(known[2, 2])])
    left_over = at_rest - known[2:, 2:]
    values, vectors = eigh(0.5 * (left_over + left_over.T))
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    left, values, right = svd(weights @ spread, full_matrices=False)
    n = min(STATES, int(np.count_nonzero(values > 1e-9 * values[0])))
    to = (weights.T @ left[:, :n] / np.sqrt(values[:n])).T
    back = spread @ right[:n].T / np.sqrt(values[:n])
    transition = to @ companion @ back
    transition *= min(1.0, LARGEST_RADIUS / spectral_radius(transition))
    stationary = solve_discrete_lyapunov(transition, noise * np.outer(to[:, 0], to[:, 0]))
    return ModalMoment.from_discrete(transition, back[0], 0.5 * (stationary + stationary.T), step)


def _filtered_covariance(a: np.ndarray, q: np.ndarray, noise: tuple[float, float]):
    """Steady covariance after an update with the first two states, by doubling.

    Chu, Fan, Lin and Wang (2004), Int. J. Control 77, 767.
    """
    c, r = np.eye(2, len(a)), np.diag(noise)
    forward, h, g = a.T, q, c.T @ np.linalg.solve(r, c)
    for _ in range(DOUBLINGS):
        w = np.linalg.inv(np.eye(len(a)) + g @ h)
        after, further = forward @ w, forward.T @ (h @ w @ forward)
        g, h, forward = g + after @ g @ forward.T, h + further, after @ forward
        g, h = 0.5 * (g + g.T), 0.5 * (h + h.T)
    return h - h @ c.T @ np.linalg.solve(c @ h @ c.T + r, c @ h)


def _state_now(request: ExcitationRequest, moment: ModalMoment):
    """Mean, covariance and sizes of a filter with that moment, after it has run over the window's end."""
    r = request
    fitted = HullFilter.for_window(r, moment)
    newest = slice(max(0, r.angle.size - round(FORECAST_SPAN * r.period / r.step)), None)
    (angle, rate), *others = np.where(r.is_measured, [r.angle, r.rate], math.nan).T[newest].tolist()
    fitted.start(angle, rate, r.angle_variance, r.rate_variance)
    for angle, rate in others:
        fitted.observe(r.step, angle, rate, r.angle_variance, r.rate_variance)
    fitted.driven.advance(r.age)
    return fitted.driven.x, fitted.driven.P, tuple(fitted.levels.tolist())
