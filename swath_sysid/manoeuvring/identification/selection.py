"""The simplest adequate set of terms: forward selection by score tests, with every step checked for stability."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from swath_sysid.common.covariance import ParameterCovariance, sandwich_covariance
from swath_sysid.manoeuvring.hull.identified_model import check_stability, straight_speeds
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import INDEX, NEUTRAL, PARAMETERS, THRUST
from swath_sysid.manoeuvring.identification import held_out
from swath_sysid.manoeuvring.identification.assembly import EQUAL_CURRENTS, USUAL_RESPONSE, RunProblem
from swath_sysid.manoeuvring.identification.scaling import SWAY_SHARE
from swath_sysid.manoeuvring.identification.settings import cut
from swath_sysid.manoeuvring.identification.shooting import (
    CURRENT,
    MIN_DECAY,
    Hidden,
    Shooting,
    bounded_slopes,
    by_channel,
    by_part,
    channel_residuals,
    drift_variance,
    projected,
    refine,
    residuals,
    weighed,
)

MEMORY = 10  #: Lags that must be small before a residual counts as uncorrelated (see noise.autocovariance).
MARGIN = 4.0  #: Added to the criterion's ln(N), so that chance seldom adds one of twenty terms.
NOISE_FLOOR = 0.003  #: Least noise as a share of the motion.
DOUBTED = 6.0  #: A term below so many standard deviations must help runs held out.
LARGEST_GROWTH = 1.5  #: 1/s; a craft whose turns grow faster cannot be steered.
OFF_COURSE = 0.5  #: Largest misfit on runs held out of a course-unstable model, as a share of that of the stable one.
PARTS = 3  #: Parts of a step in the last fit; thrust held for as long as its lag biases lag and inertia.

USUAL_HULL = ('Yvv', 'Nrr', 'Nuv')
USUAL = tuple('Yvv Nrr Nuv Xvr Yur Nuur exponent dead_band deviation_B deviation_C sensor_x sensor_y'.split())
LAST = {'X0', 'N0'}  #: Tried only when nothing else helps, as they imitate many other terms.
EXCLUSIVE = {'Nur': 'Nuur', 'Nuur': 'Nur'}  #: Terms that replace each other: after one the other is not tried.

#: Why terms are rejected.
UNSTABLE, MADE_STABLE = 'unstable', 'until the craft was stable'
AT_BOUND, HELD = 'at the limit of its range', 'held at the limit of its range'
NO_GAIN, NOT_HELD_OUT = 'no gain', 'no gain on runs held out'
NO_SLIP = 'the craft hardly slips sideways'


@dataclass(frozen=True)
class Fit:
    """A fitted set of unknowns."""

    names: tuple[str, ...]
    values: np.ndarray  #: (n,)
    cost: float
    shooting: Shooting
    covariance: ParameterCovariance
    stable: bool
    without_each_part: np.ndarray  #: (K, n); Values fitted without each run.
    inflation: float  #: Factor by which autocorrelation and excess over the noise inflate the squares of the residuals.
    rejected: dict = field(default_factory=dict)  #: Rejected terms and why.
    evaluations: int = 0

    @cached_property
    def certainty(self) -> np.ndarray:
        """Distance of each value from the neutral one in standard deviations, shape (n,); 0 where not known."""
        std = np.sqrt(np.diag(self.covariance.matrix))
        neutral = np.array([NEUTRAL[INDEX[n]] if n in INDEX else 0.0 for n in self.names])
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.where(std > 0.0, np.abs(self.values - neutral) / std, 0.0)

    @cached_property
    def held_out(self) -> np.ndarray:
        """Misfit of each run under the values fitted without it, shape (K,)."""
        return held_out.held_out_costs(self.shooting, self.without_each_part)


def identified(
    problem: RunProblem, start: np.ndarray, window: float, any_terms: bool, note: Callable[[float], object]
) -> tuple[RunProblem, Fit]:
    """The problem, noise and growth as found, and the fit of the terms worth having; ``any_terms`` end at no bound."""
    names = (*problem.free, *problem.tentative)
    values = np.concatenate([start, problem.start(problem.tentative)])
    now = first_fit(problem, shooting_of(problem, window), names, values)
    problem, now = off_course(problem, window, names, values, now)
    problem = with_drift_spread(with_noise(problem, now), now)
    now = fit(problem, renewed(problem, now), now.names, now.values)
    note(0.5)
    free = (ended,) if any_terms else ()
    problem, now = _pruned_by(*_without_slip(*_pruned_by(problem, now, free)), (_weak,))
    problem, found = select(problem, now, lambda count: note(min(0.9, 0.5 + 0.03 * count)))
    problem = with_drift_spread(with_noise(problem, found), found)
    last = fit(problem, renewed(problem, found, PARTS), found.names, found.values)
    evaluations = now.evaluations + found.evaluations + last.evaluations
    problem, found = _pruned_by(problem, replace(last, rejected=found.rejected), (*free, destabilising))
    note(0.95)
    return problem, replace(with_refused(problem, found), evaluations=evaluations)


def model_of(problem: RunProblem, names: Sequence[str], values: np.ndarray) -> ManoeuvringModel:
    """The model for some values of the unknowns."""
    found = dict(zip(names, values, strict=True))
    east, north = (float(found.get(c, 0.0)) for c in CURRENT)
    return ManoeuvringModel(
        problem.unknowns(names).placed_in(problem.base, values),
        thrust_input=problem.thrust_input,
        length=problem.length,
        largest_input=float(problem.region.most_input),
        current=(east, north),
    )


def shooting_of(problem: RunProblem, window: float) -> Shooting:
    """Multiple shooting over the runs of a problem, with its always-free unknowns."""
    windows = cut(problem.runs, window)
    unknowns, hidden = problem.unknowns(()), Hidden.measured(windows)
    bare = Shooting(windows, problem.base, unknowns, problem.noise, problem.scales.speed, hidden)
    return in_problem(bare, problem, problem.free)


def in_problem(shooting: Shooting, problem: RunProblem, names: Sequence[str]) -> Shooting:
    """The shooting with the unknowns, noise and demands of a problem."""
    return replace(
        shooting,
        base=problem.base,
        unknowns=problem.unknowns(names),
        noise=problem.noise,
        drift_spread=problem.drift_spread,
        speeds=straight_speeds(problem.region),
        largest_growth=problem.largest_growth,
    )


def fit(problem: RunProblem, shooting: Shooting, names: Sequence[str], values: np.ndarray, rounds: int = 2) -> Fit:
    """Refine some unknowns from a start, with robust weights renewed in every round."""
    shooting = replace(shooting, unknowns=problem.unknowns(names), base=problem.base)
    evaluations = 0
    for _ in range(rounds):
        found = refine(shooting, values)
        values = found.values
        evaluations += found.evaluations
        shooting = weighed(found.shooting, values)
    found = refine(shooting, values, max_evaluations=8)
    evaluations += found.evaluations
    return replace(fit_at(problem, found.shooting, found.values, found.cost), evaluations=evaluations)


def fit_at(problem: RunProblem, shooting: Shooting, values: np.ndarray, cost: float) -> Fit:
    """The fit at some values, its covariance by the autocorrelation of residuals and the scatter of the runs."""
    names = shooting.unknowns.names
    residual, slopes, _ = projected(shooting, values, shooting.hidden)
    linear = residual, bounded_slopes(slopes)
    told = held_out.information_at(shooting, values, by_part(shooting, *linear))
    without = held_out.values_without_each_part(shooting, values, told)
    left, jacobians = by_channel(shooting, *linear)
    covariance = sandwich_covariance(left, jacobians, MEMORY)
    check = check_stability(model_of(problem, names, values), problem.region)
    stable = check.bounded and check.largest_growth < max(problem.largest_growth, 0.0)
    every = np.clip(np.nan_to_num(np.concatenate(left), nan=1e3), -1e3, 1e3)
    inflation = max(every.size / max(covariance.effective_samples, 1.0) * float(np.mean(every**2)), 1e-9)
    covariance = replace(covariance, matrix=held_out.covariance_over_runs(told, covariance.matrix))
    return Fit(names, values, cost, shooting, covariance, stable, without, inflation)


def first_fit(problem: RunProblem, shooting: Shooting, names: Sequence[str], values: np.ndarray) -> Fit:
    """The best on runs held out of several starts. Without the usual terms a marginally course-stable hull looks like
    a much heavier one, and adding them one by one does not lead away from it; a hull that hardly slips sideways looks
    like a light one behind slow thrusters, unless the search starts from a sway that is damped within a second.
    """
    plain = fit(problem, shooting, names, values)
    exchanged = _exchanged(plain, values)
    if exchanged is not None:
        plain = _best([plain, fit(problem, shooting, names, exchanged)])
    damped = _with_damped_sway(problem, names, values)
    found = [plain]
    for some, start in ((USUAL_HULL, plain.values), (USUAL, plain.values), (USUAL, damped)):
        usual = [n for group in problem.candidates for n in group if n in some and n not in names]
        if usual and start is not None:
            found.append(fit(problem, shooting, (*names, *usual), np.concatenate([start, problem.start(usual)])))
    return _best(found)


def _with_damped_sway(problem: RunProblem, names: Sequence[str], start: np.ndarray):
    """The start with sway damped within its usual time and without added mass; None where sway is not searched."""
    if not {'Yv', 'Yv_dot'} <= set(names):
        return None
    damping = -problem.scales.mass / USUAL_RESPONSE['sway']
    return np.array([{'Yv': damping, 'Yv_dot': 0.0}.get(n, first) for n, first in zip(names, start, strict=True)])


def _exchanged(found: Fit, start: np.ndarray):
    """The start with thruster lag and yaw time constant swapped where a fit has the lag longer: yaw responds alike."""
    value = dict(zip(found.names, found.values, strict=True))
    if not {'lag', 'Iz', 'Nr'} <= set(value) or value['lag'] <= value['Iz'] / -value['Nr']:
        return None
    other = {'lag': value['Iz'] / -value['Nr'], 'Iz': value['lag'] * -value['Nr'], 'Nr': value['Nr']}
    return np.array([other.get(name, first) for name, first in zip(found.names, start, strict=True)])


def _best(found: Sequence[Fit]):
    """The stable fit, or where there is none any fit, with the least misfit on runs held out."""
    stable = [f for f in found if f.stable] or found
    return min(stable, key=lambda f: np.sum(f.held_out))


def off_course(
    problem: RunProblem, window: float, names: Sequence[str], values: np.ndarray, kept: Fit
) -> tuple[RunProblem, Fit]:
    """The problem and fit of a course-unstable craft where its runs show one, else those given."""
    growth = check_stability(model_of(problem, kept.names, kept.values), problem.region).largest_growth
    if growth < -MIN_DECAY:
        return problem, kept
    free = replace(problem, largest_growth=LARGEST_GROWTH)
    found = first_fit(free, shooting_of(free, window), names, values)
    # what is all but unstable converges slowly
    found = fit(free, found.shooting, found.names, found.values)
    ahead, behind = (float(np.sum(f.held_out)) for f in (found, kept))
    return (free, found) if found.stable and ahead < OFF_COURSE * behind else (problem, kept)


def with_noise(problem: RunProblem, found: Fit) -> RunProblem:
    """The problem with the residual noise of a fit, at least `NOISE_FLOOR` of the motion; what is unmeasured stays."""
    residual = channel_residuals(found.shooting, found.values)
    motion = [problem.scales.speed, SWAY_SHARE * problem.scales.speed, problem.scales.yaw_rate]
    noise = []
    for c in range(3):
        known = residual[c][np.isfinite(residual[c])]
        if not known.size:
            noise.append(problem.noise[c])
            continue
        # between the robust and the plain size: outliers neither rule nor vanish
        spread = np.sqrt(np.mean(np.minimum(np.abs(known), 4.0 * 1.4826 * np.median(np.abs(known)) + 1e-12) ** 2))
        noise.append(max(spread, NOISE_FLOOR * motion[c]))
    return replace(problem, noise=np.array(noise))


def with_drift_spread(problem: RunProblem, found: Fit) -> RunProblem:
    """The problem with the spread of the currents of the runs as a fit found it (one step of EM). Autocorrelated
    residuals, which count for fewer samples, weigh less against equal currents.
    """
    if not problem.drift_spread:
        return problem
    variance = found.inflation * drift_variance(found.shooting, found.values)
    spread = np.sqrt(np.mean(found.shooting.hidden.drift**2 + variance))
    return replace(problem, drift_spread=float(max(spread, EQUAL_CURRENTS) / np.sqrt(found.inflation)))


def renewed(problem: RunProblem, found: Fit, parts: int = 1) -> Shooting:
    """A shooting with the noise of the problem and the states of a fit."""
    shooting = in_problem(found.shooting, problem, found.names)
    if parts != shooting.parts:
        shooting = replace(shooting, parts=parts, thrusts={})
    return weighed(shooting, found.values)


def select(problem: RunProblem, first: Fit, note: Callable[[int], object] | None = None) -> tuple[RunProblem, Fit]:
    """Add terms one by one while they gain enough, then drop weak ones; calls ``note`` with the number of terms."""
    now, rejected = first, dict(first.rejected)
    remaining = [c for c in problem.candidates if not set(c) & {*now.names, *rejected}]
    while offers := [(group, gain) for group, gain, _ in _offers(problem, now, remaining) if gain > 0.0]:
        group, _ = min(offers, key=lambda offer: (offer[0][0] in LAST, -offer[1]))
        start = np.concatenate([now.values, problem.start(group)])
        tried = fit(problem, now.shooting, (*now.names, *group), start, rounds=1)
        remaining.remove(group)
        reason = UNSTABLE if now.stable and not tried.stable else _against(group, tried, now)
        if reason:
            rejected[' '.join(group)] = reason
            continue
        remaining = [c for c in remaining if EXCLUSIVE.get(c[0]) not in group]
        now = tried
        if note is not None:
            note(len(now.names))
    return pruned(problem, replace(now, rejected=rejected), _weak)


def _against(names: Sequence[str], more: Fit, fewer: Fit) -> str:
    """Why some terms are not worth having, or nothing. Terms of the thrust curve may instead gain as much in all runs
    as hull terms must on runs held out: they may show in one run only, which cannot confirm them when held out.
    """
    gain, misfit = _gain(more, fewer)
    if gain * 2.0 / more.inflation < 0.5 * _threshold(more, len(names)):
        return NO_GAIN
    of_thrust = all(n in INDEX and PARAMETERS[INDEX[n]].kind == THRUST for n in names)
    if (of_thrust and gain > held_out.MIN_GAIN * misfit) or held_out.helps(more.held_out, fewer.held_out):
        return ''
    return NOT_HELD_OUT


def pruned(
    problem: RunProblem, found: Fit, rule: Callable[[RunProblem, Fit], tuple[list[int], str]]
) -> tuple[RunProblem, Fit]:
    """The problem and fit without terms that a rule drops one by one, the least certain first: it gives the places of
    doubtful terms and why they go, or nothing if only those go that are not worth having.
    """
    kept: set[str] = set()
    while True:
        places, reason = rule(problem, found)
        places = [k for k in np.argsort(found.certainty, kind='stable') if k in places and found.names[k] not in kept]
        if not places:
            return problem, found
        name = found.names[places[0]]
        fewer, tried = _without_term(problem, found, places[0])
        if reason == AT_BOUND:
            held = _without_term(problem, found, places[0], found.values[places[0]])
            if held[1].stable > tried.stable or held_out.helps(held[1].held_out, tried.held_out):
                (fewer, tried), reason = held, HELD
        why = '' if found.stable and not tried.stable else reason or _against((name,), found, tried)
        if why:
            problem, found = fewer, replace(tried, rejected={**found.rejected, name: why})
        else:
            kept.add(name)


def _pruned_by(problem: RunProblem, found: Fit, rules: Sequence[Callable]) -> tuple[RunProblem, Fit]:
    """`pruned` by one rule after the other."""
    for rule in rules:
        problem, found = pruned(problem, found, rule)
    return problem, found


def _without_slip(problem: RunProblem, found: Fit) -> tuple[RunProblem, Fit]:
    """The problem and fit without sway through the water, where its damping is held at the limit: its terms have
    nothing to act on, and would imitate others.
    """
    if found.rejected.get('Yv') != HELD:
        return problem, found

    def of_slip(name: str) -> bool:
        parameter = PARAMETERS[INDEX[name]]
        return parameter.row == 'Y' or bool({'v', 'V'} & set(parameter.factors))

    gone = [name for name in found.names if name in INDEX and of_slip(name)]
    candidates = tuple(group for group in problem.candidates if group == CURRENT or not any(map(of_slip, group)))
    problem = replace(without(problem, gone), candidates=candidates)
    kept = [k for k, name in enumerate(found.names) if name not in gone]
    names = tuple(found.names[k] for k in kept)
    rejected = {**found.rejected, **dict.fromkeys(gone, NO_SLIP)}
    return problem, replace(fit(problem, found.shooting, names, found.values[kept], rounds=1), rejected=rejected)


def _without_term(problem: RunProblem, found: Fit, place: int, value: float | None = None) -> tuple[RunProblem, Fit]:
    """The problem and fit without a term, which is neutral, or held at a value."""
    fewer = without(problem, found.names[place : place + 1])
    if value is not None:
        fewer.base[INDEX[found.names[place]]] = value
    names = (*found.names[:place], *found.names[place + 1 :])
    return fewer, fit(fewer, found.shooting, names, np.delete(found.values, place), rounds=1)


def _weak(problem: RunProblem, found: Fit):
    """Rule of `pruned`: added and tentative terms that are uncertain."""
    free = {*problem.free, *CURRENT}
    named = enumerate(zip(found.names, found.certainty, strict=True))
    return [k for k, (name, certainty) in named if name not in free and certainty < DOUBTED], ''


def ended(problem: RunProblem, found: Fit) -> tuple[list[int], str]:
    """Rule of `pruned`: terms at the bounds of their ranges, which the runs do not determine. They go, or stay at the
    bound where the runs held out call for it: a hull that hardly slips sideways is not one without damping.
    """
    anchors = {'m', 'Iz', 'gain', 'Xu_dot', *CURRENT}
    named = enumerate(zip(found.names, found.values, strict=True))
    return [k for k, (name, value) in named if name not in anchors and at_bound(problem, name, value)], AT_BOUND


def destabilising(problem: RunProblem, found: Fit) -> tuple[list[int], str]:
    """Rule of `pruned`: added hull terms until the craft is stable."""
    added = [n not in problem.free and n in INDEX and PARAMETERS[INDEX[n]].kind != THRUST for n in found.names]
    return [k for k, is_added in enumerate(added) if is_added and not found.stable], MADE_STABLE


def with_refused(problem: RunProblem, found: Fit) -> Fit:
    """The fit with standard deviations that hold whether or not one rejected term is really there. The shift of each
    value by the term, weighted by the evidence for it, counts as a variance (Buckland, Burnham and Augustin 1997); the
    largest shift over all rejected terms counts.
    """
    groups = (*problem.candidates, *((name,) for name in problem.tentative))
    refused = [group for group in groups if not set(group) & set(found.names)]
    shifts = [
        shift / np.sqrt(1.0 + np.exp(-0.5 * np.clip(gain, -200.0, 200.0)))
        for _, gain, shift in _offers(problem, found, refused)
    ]
    if not shifts:
        return found
    matrix = found.covariance.matrix
    wider = held_out.with_variances_of_at_least(matrix, np.diag(matrix) + np.max(np.square(shifts), axis=0))
    return replace(found, covariance=replace(found.covariance, matrix=wider))


def _offers(problem: RunProblem, now: Fit, candidates: Sequence[tuple[str, ...]]):
    """Groups of terms with their expected gain beyond the threshold and their shifts of the values."""
    if not candidates:
        return []
    names = [n for group in candidates for n in group]
    start = np.concatenate([now.values, problem.start(names)])
    wide = replace(now.shooting, unknowns=problem.unknowns((*now.names, *names)), base=problem.base)
    residual, jacobian = map(np.concatenate, by_channel(wide, *projected(wide, start, wide.hidden)[:2]))
    usable = np.all(np.isfinite(jacobian), axis=1) & np.isfinite(residual)
    residual, jacobian = residual[usable], jacobian[usable]
    n = len(now.names)
    held, added = jacobian[:, :n], jacobian[:, n:]
    size = np.sqrt(np.sum(held**2, axis=0))
    basis, factor = np.linalg.qr(held[:, size > 0] / size[size > 0])
    left = residual - basis @ (basis.T @ residual)
    fresh = added - basis @ (basis.T @ added)
    offers, place = [], 0
    for group in candidates:
        columns = slice(place, place + len(group))
        place += len(group)
        part, whole = fresh[:, columns], added[:, columns]
        # what is all but contained in the terms present would only blow them up
        if np.any(np.sum(part**2, axis=0) <= 1e-4 * np.sum(whole**2, axis=0)) or not np.any(part):
            continue
        step = -np.linalg.lstsq(part, left, rcond=None)[0]
        unknowns = problem.unknowns(group)
        at = problem.start(group)
        step = np.clip(at + step, unknowns.lower, unknowns.upper) - at
        drop = np.sum(left**2) - np.sum((left + part @ step) ** 2)
        shift = np.zeros(n)
        shift[size > 0] = -np.linalg.lstsq(factor, basis.T @ (whole @ step), rcond=None)[0] / size[size > 0]
        offers.append((group, drop / now.inflation - _threshold(now, len(group)), shift))
    return offers


def _threshold(found: Fit, count: int):
    """Weighted squares that a group of terms must explain: Schwarz's criterion and a margin."""
    return count * (np.log(max(found.covariance.effective_samples, 10.0)) + MARGIN)


def _gain(more: Fit, fewer: Fit):
    """Misfit that more terms explain in all runs, and the misfit without them."""
    misfit = refine(fewer.shooting, fewer.values, max_evaluations=6).cost
    # both under the robust weights of the fit with fewer terms
    shooting = replace(more.shooting, weights=fewer.shooting.weights)
    residual = np.clip(np.nan_to_num(residuals(shooting, more.values, shooting.hidden)[0], nan=1e6), -1e6, 1e6)
    return misfit - 0.5 * float(np.sum(residual**2)), misfit


def at_bound(problem: RunProblem, name: str, value: float) -> bool:
    """Whether a value lies at a bound of its range."""
    unknowns = problem.unknowns((name,))
    lower, upper, unit = unknowns.lower[0], unknowns.upper[0], unknowns.units[0]
    return value - lower < 1e-3 * min(upper - lower, unit) or upper - value < 1e-3 * unit


def without(problem: RunProblem, names: Sequence[str]) -> RunProblem:
    """The problem with first guesses neutral, or at the end of their range next to that: some damping always stays."""
    base = problem.base.copy()
    for name in set(names) & set(INDEX):
        base[INDEX[name]] = np.clip(NEUTRAL[INDEX[name]], *problem.scales.limits(name)[:2])
    return replace(problem, base=base)
