"""Which model of free decays is published: by its verdict, then by the expected error of the next release."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.scaling import LOWER, UPPER
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.identification.at_sea import is_at_sea
from swath_sysid.attitude.identification.fit_quality import ADEQUATE, LEVELS, REJECTED
from swath_sysid.attitude.identification.hull_terms import CHANCE
from swath_sysid.attitude.identification.motion_fit import SEARCH_STEPS_PER_PERIOD
from swath_sysid.attitude.identification.problem import Problem, block_means, motion_fit
from swath_sysid.attitude.identification.result import Identification


def misfit(problem: Problem, model: DecayModel) -> float:
    """Rms residual of a model on decays, weighted by noise, from its best initial states; infinite if it diverges."""
    count = sum(values.size for values in _measured(problem))
    return float(
        np.sqrt(
            _least_squares(replace(problem, friction_rate=model.friction_rate), model.equation, [model], held=True)
            / count
        )
    )


def _least_squares(problem: Problem, equation: Equation, starts: Sequence[DecayModel], held: bool = False) -> float:
    """The least sum of squares of residuals, started from several hulls, whose ratios may be held."""
    fit, found = motion_fit(problem, equation), [float('inf')]
    for model in starts:
        parameters = fit.refine_states(fit.pack(model.ratios, problem.states))
        if not held:
            parameters, _ = fit.refine(parameters, LOWER[equation.indices], UPPER[equation.indices])
        residuals = np.concatenate(fit.residuals_and_jacobian(parameters)[0])
        # infinite where the motion runs away
        with np.errstate(over='ignore', invalid='ignore'):
            found.append(float(np.nan_to_num(residuals @ residuals, nan=np.inf)))
    return min(found)


def has_changed(problem: Problem, before: DecayModel, of_new: Identification, new: Sequence[int]) -> bool:
    """Whether new decays contradict the others by more than matters; ``new`` are their places in the problem.

    ``before`` is fitted to the others, ``of_new`` to the new ones. One hull for all against one for each part: the sums
    of squares differ by a chi-squared variable (Wilks 1938). The excess matters where it exceeds the new fit's motion
    error.
    """
    places = range(len(problem.motions))
    terms = [name for name in TERM_NAMES if name in (*before.equation.terms, *of_new.model.equation.terms)]
    equation, starts = Equation('', tuple(terms)), (before, of_new.model)
    parts = [_part(problem, each) for each in (places, [k for k in places if k not in new], new)]
    together, *apart = (_least_squares(part, equation, starts) for part in parts)
    measured = _measured(parts[0])
    variance = sum(apart) / sum(values.size for values in measured) * of_new.samples / of_new.effective_samples
    by_chance = variance * chdtri(len(terms), CHANCE)
    matters = of_new.verdict.motion_error**2 * sum(values.size * np.var(values) for values in measured)
    return bool(together - sum(apart) > max(by_chance, matters))


def _part(problem: Problem, places: Sequence[int]) -> Problem:
    """Some decays of a problem, at the search's density, in which two hulls still differ."""
    period = 2.0 * np.pi / problem.scales.frequency
    motions = tuple(block_means(problem.motions[k], period, SEARCH_STEPS_PER_PERIOD) for k in places)
    return replace(problem, motions=motions, states=tuple(problem.states[k] for k in places))


def _measured(problem: Problem) -> list[np.ndarray]:
    """Each measured channel, weighted as its residuals are."""
    angles = [m.angle / problem.noise.angle for m in problem.motions if m.angle is not None]
    return angles + [m.rate / problem.noise.rate for m in problem.motions if m.rate is not None]


def explains_better(found: Identification, held: DecayModel) -> bool:
    """Whether a fit explains its decays better than a model fitted to others, beyond chance.

    Twice the variable of `has_changed`, because both are uncertain.
    """
    terms = len(found.model.equation.terms)
    excess = 2.0 * float(chdtri(terms, CHANCE)) / found.effective_samples
    return bool(misfit(found.problem, found.model) ** 2 * (1.0 + excess) < misfit(found.problem, held) ** 2)


def motion_error(model: IdentifiedModel) -> float:
    """Expected error of the next release, a share of its motion; zero for a model that was given."""
    error = model.metrics.get('motion_error', 0.0)
    return float('inf') if error is None else float(error)


def reason_to_keep(current: IdentifiedModel | None, new: IdentifiedModel, is_contradicted: bool) -> str:
    """Why a model of free decays does not replace the current one; empty where it does.

    A rejected model replaces nothing, and none replaces a better verdict. Among equals a contradiction of the current
    model decides, otherwise the smaller motion error.
    """
    level = new.metrics['verdict']
    if level == REJECTED or not np.isfinite(new.model.natural_period):
        return verdict_text(new)
    if current is None or is_at_sea(current):
        return ''
    held = current.metrics.get('verdict', ADEQUATE)
    better = LEVELS.index(level) - LEVELS.index(held)
    if better < 0:
        return f'{verdict_text(new)}; the current model, which is {held}, stays'
    if better > 0 or is_contradicted or motion_error(new) < motion_error(current):
        return ''
    return (
        f'the current model knows the next release as well (to {motion_error(current):.1%} of its motion, with this '
        f'release {motion_error(new):.1%})'
    )


def verdict_text(model: IdentifiedModel) -> str:
    """The verdict of a model and its sentence."""
    return f'{model.metrics["verdict"]}: {model.metrics["verdict_sentence"]}'


def gain_text(current: IdentifiedModel | None, new: IdentifiedModel, releases: int) -> str:
    """What the last release added to the certainty, in words."""
    count = f'{releases} release{"s" if releases > 1 else ""}'
    if current is None or not 0.0 < motion_error(current) < np.inf:
        return count
    return f'{count}, the next one known to {motion_error(new):.1%} of its motion, {motion_error(current):.1%} before'
