"""The published study of a catamaran's manoeuvring, repeated on turns simulated from its own derivatives.

Its method: nonlinear least squares on GPS position and speed of one turn, the resistance fixed by towing, every other
derivative within a range. Ours: `identify_manoeuvring` on the same turn, with compass, gyro and the same resistance.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from swath_sysid.common.wings import yaml_table
from swath_sysid.manoeuvring.hull.model import DIFFERENCE, ManoeuvringModel, parameter_values
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre, simulate
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, with_noise
from swath_sysid.manoeuvring.hull.terms import PrimeUnits
from swath_sysid.manoeuvring.identification.identify import ManoeuvringIdentification, identify_manoeuvring
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.intake import prepare_runs
from swath_sysid.manoeuvring.motion.trial import ManoeuvringTrial

STEP_S = 0.2
NOISE = RunNoise()


@dataclass(frozen=True)
class EstimatedDerivative:
    """One derivative, without dimension times 1e5."""

    name: str
    printed: float
    truth: float  #: As simulated.
    estimate: float  #: By the study's method.
    std: float  #: NaN where fixed.
    ours: float  #: NaN where our identification leaves the term out.
    ours_std: float
    lower: float  #: Of the range of the estimate.
    upper: float
    mariner: float


@dataclass(frozen=True)
class ManoeuvringStudy:
    """The study carried out again."""

    content: dict  #: Of the study's file.
    truth: ManoeuvringModel
    estimated: ManoeuvringModel
    ours: ManoeuvringIdentification
    derivatives: tuple[EstimatedDerivative, ...]
    iterations: np.ndarray  #: (K, n); every free derivative over its true value.
    free: tuple[str, ...]
    runs: dict  #: ``identification`` and ``validation``: as simulated, and as measured.

    def simulated(self, model: ManoeuvringModel, run: str) -> Manoeuvre:
        """A model under the thrusts of a run, from its first state."""
        port, starboard = self.content['runs'][run]
        return _turn(model, self.content['assumed'], port, starboard)


def run_manoeuvring_study() -> ManoeuvringStudy:
    """Carry the study out again."""
    content = yaml_table(Path(__file__).with_name('wam-v.yaml'))
    units = PrimeUnits(content['craft']['length_m'], content['assumed']['speed_m_s'])
    prime = {**content['derivatives']['printed'], **content['reading']['corrected']}
    factor = content['reading']['factor']
    values = {name: units.from_prime(name, factor * value) for name, value in prime.items()}
    truth = _craft(content, values)
    runs = {}
    for k, (name, (port, starboard)) in enumerate(content['runs'].items()):
        exact = _turn(truth, content['assumed'], port, starboard)
        runs[name] = exact, with_noise(exact, NOISE, 1 + k)
    estimated, std, shares, free = _estimated(content, truth, values, runs['identification'][1])
    ours = _ours(content, runs, {name: values[name] for name in content['fixed_by_towing']})
    derivatives = tuple(
        _derivative(content, units, name, truth, estimated, std.get(name, float('nan')), ours) for name in prime
    )
    return ManoeuvringStudy(content, truth, estimated, ours, derivatives, shares, free, runs)


def _craft(content: dict, values: dict[str, float]):
    mass, length = content['craft']['displacement_kg'], content['craft']['length_m']
    known = {
        'm': mass,
        'Iz': mass * (content['assumed']['gyradius_over_length'] * length) ** 2,
        'lever': content['assumed']['lever_m'],
        **content['thrust'],
    }
    largest = max(max(thrusts) for thrusts in content['runs'].values())
    return ManoeuvringModel(parameter_values({**known, **values}), length=length, largest_input=largest)


def _turn(model: ManoeuvringModel, assumed: dict, port: float, starboard: float):
    """An approach with the larger thrust on both sides, then the turn."""
    count = [round(assumed[key] / STEP_S) for key in ('approach_s', 'turn_s')]
    return simulate(model, np.repeat([starboard, port], count), np.repeat([starboard, starboard], count), STEP_S)


def _estimated(content: dict, truth: ManoeuvringModel, values: dict[str, float], measured: Manoeuvre):
    """Least squares within ranges; model, standard deviations by name, shares of the truth by iteration, names."""
    assumed = content['assumed']
    free = tuple(name for name in values if name not in content['fixed_by_towing'])
    scale = np.array([values[name] for name in free])
    port, starboard = content['runs']['identification']
    history = []

    def model_of(shares: np.ndarray) -> ManoeuvringModel:
        return truth.with_values(**dict(zip(free, shares * scale, strict=True)))

    def residuals(shares: np.ndarray) -> np.ndarray:
        found = _turn(model_of(shares), assumed, port, starboard)
        gap = np.concatenate(
            [
                (found.x - measured.x) / NOISE.position,
                (found.y - measured.y) / NOISE.position,
                (np.hypot(found.surge, found.sway) - np.hypot(measured.surge, measured.sway)) / NOISE.speed,
            ]
        )
        return np.nan_to_num(gap, nan=1e6, posinf=1e6, neginf=-1e6)

    def jacobian(shares: np.ndarray) -> np.ndarray:
        history.append(shares.copy())
        steps = DIFFERENCE * np.eye(len(free))
        return np.stack([residuals(shares + s) - residuals(shares - s) for s in steps], axis=1) / (2.0 * DIFFERENCE)

    bounds = assumed['least_share'], assumed['largest_share']
    start = np.full(len(free), assumed['start_share'])
    found = least_squares(residuals, start, jacobian, bounds=bounds, xtol=1e-8, ftol=1e-8, max_nfev=200)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    std = dict(zip(free, np.abs(scale) * np.sqrt(np.diag(covariance)), strict=True))
    return model_of(found.x), std, np.array([*history, found.x]), free


def _ours(content: dict, runs: dict, towed: dict[str, float]):
    measured = 'time', 'port', 'starboard', 'surge', 'sway', 'yaw_rate', 'heading', 'x', 'y'
    trials = [
        ManoeuvringTrial(**{channel: getattr(m, channel) for channel in measured}, frame='enu', source=name)
        for name, (_, m) in runs.items()
    ]
    settings = ManoeuvringSettings(
        mass=content['craft']['displacement_kg'],
        lever=content['assumed']['lever_m'],
        length=content['craft']['length_m'],
        fixed={**content['thrust'], **towed},
        current='none',
    )
    identification, validation = prepare_runs(trials)
    return identify_manoeuvring([identification], settings, [validation])


def _derivative(
    content: dict,
    units: PrimeUnits,
    name: str,
    truth: ManoeuvringModel,
    estimated: ManoeuvringModel,
    std: float,
    ours: ManoeuvringIdentification,
):
    def prime(value: float) -> float:
        return units.to_prime(name, value) * 1e5

    assumed, own = content['assumed'], ours.derivatives.get(name)
    fixed = name in content['fixed_by_towing']
    shares = (1.0, 1.0) if fixed else (assumed['least_share'], assumed['largest_share'])
    low, high = sorted(prime(truth[name]) * share for share in shares)
    return EstimatedDerivative(
        name,
        content['derivatives']['printed'][name],
        prime(truth[name]),
        prime(estimated[name]),
        abs(prime(std)),
        prime(own.value) if own else float('nan'),
        abs(prime(own.std)) if own else float('nan'),
        low,
        high,
        content['mariner'][name],
    )


def track_error(found: Manoeuvre, measured: Manoeuvre) -> float:
    """Root mean square distance of two tracks, m."""
    return float(np.sqrt(np.mean((found.x - measured.x) ** 2 + (found.y - measured.y) ** 2)))
