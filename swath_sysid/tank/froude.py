"""Froude scaling between a model in a basin and the craft at full scale.

With the length ratio L (full scale over model scale) times scale as sqrt L and angles stay: a ratio to inertia scales
by its power of time. Scale effects on damping: ITTC recommended procedure 7.5-02-07-04.5.
"""

import math
import reprlib
from dataclasses import replace
from fractions import Fraction

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, composed
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel, ScheduledModel
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERMS
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

#: Power of the length ratio in each loading, in water of the same density.
LOADING_POWERS = {'draft_factor': 0, 'draft_m': 1, 'displacement_kg': 3}

RATE_METRICS = ('rate_rmse_rad_s',)

LARGEST_RATIO = 10_000  #: And its inverse: from a bath tub to the largest ship it is 1,000.

LONGEST_RATIO = 200  #: Characters; the product of several scalings is kept as an exact fraction.


def length_ratio(text: str) -> Fraction:
    """An exact length ratio from text such as ``25``, ``0.04`` or ``1/25``."""
    shown = reprlib.repr(text)[1:-1]
    try:
        if len(text) > LONGEST_RATIO:
            raise ValueError(text)
        above, _, below = text.partition('/')
        size = float(above) / float(below or 1)
        # exactly only if in range: 1e300000000 would take forever
        ratio = Fraction(text) if 1.0 / LARGEST_RATIO <= size <= LARGEST_RATIO else None
    except (ValueError, ZeroDivisionError) as error:
        raise InputError(
            f"'{shown}' is not a length ratio: give a number such as 25, or 1/25 for the way back"
        ) from error
    if not size > 0.0:
        raise InputError(f'the length ratio must be greater than zero, not {shown}')
    if ratio is None:
        raise InputError(
            f'the length ratio {shown} is beyond any craft: it must lie within 1/{LARGEST_RATIO} and {LARGEST_RATIO}'
        )
    return ratio


def scaled_model(model: DecayModel, ratio: float | Fraction) -> DecayModel:
    """A decay model at another scale; the ratio is the length of the result over that of the model given."""
    factors = _factors(ratio)
    return replace(model, ratios=model.ratios * factors, friction_rate=model.friction_rate / math.sqrt(ratio))


def scaled(identified: IdentifiedModel, ratio: Fraction) -> IdentifiedModel:
    """An identified model at another scale; scaling starts from the trials, so that scaling back is exact."""
    origin, before = _at_scale_of_trials(identified)
    total = _ratio_in_all(before, ratio)
    if total == 1:
        return origin
    factors = _factors(total)[origin.model.equation.indices]
    metrics = {
        name: value / math.sqrt(total) if name in RATE_METRICS and value is not None else value
        for name, value in origin.metrics.items()
    }
    return replace(
        origin,
        model=scaled_model(origin.model, total),
        covariance=origin.covariance * np.outer(factors, factors),
        metrics=metrics,
        posterior=_scaled_posterior(origin.posterior, total),
        provenance={
            **origin.provenance,
            'froude_scaling': {'length_ratio': str(total), 'scale_of_trials': _plain(origin)},
        },
    )


def _scaled_posterior(posterior: HullPosterior | None, ratio: Fraction):
    if posterior is None:
        return None
    factors = _factors(ratio)[posterior.equation.indices]
    return HullPosterior(
        posterior.equation, posterior.ratios * factors, posterior.covariance * np.outer(factors, factors)
    )


def scaled_schedule(schedule: ScheduledModel, ratio: Fraction) -> ScheduledModel:
    """A scheduled model at another scale: its models and, where they have a length, its loadings."""
    models = [scaled(m, ratio) for m in schedule.models]
    factor = Fraction(ratio) ** LOADING_POWERS[schedule.quantity]
    # exact on decimals, so that scaling back restores them
    return replace(
        schedule, loadings=tuple(float(Fraction(repr(v)) * factor) for v in schedule.loadings), models=tuple(models)
    )


def scaling_advice(model: DecayModel, ratio: Fraction) -> tuple[Advice, ...]:
    """What Froude scaling of a model by this ratio of lengths leaves out."""
    damping = [name for name in DAMPING_NAMES if name in model.equation.terms and name != 'b0']
    side = 'smaller' if ratio > 1 else 'larger'
    viscous = Advice.of('viscous-scale-effect', factor=float(ratio) ** 1.5, damping=', '.join(damping), side=side)
    if 'b0' not in model.equation.terms:
        return (viscous,)
    return viscous, Advice.of('dry-friction-scaled')


def _factors(ratio: float | Fraction) -> np.ndarray:
    """What each ratio is multiplied by, shape (9,): its power of time is one of the root, exact where it is whole."""
    powers = np.array([term.time_power for term in TERMS.values()])
    sizes = float(ratio) ** (abs(powers) // 2) * math.sqrt(ratio) ** (powers % 2)
    return np.where(powers > 0, sizes, 1.0 / sizes)


def _at_scale_of_trials(identified: IdentifiedModel) -> tuple[IdentifiedModel, Fraction]:
    """The model before any scaling, and the length ratio since."""
    history = identified.provenance.get('froude_scaling')
    if history is None:
        return identified, Fraction(1)
    try:
        before = length_ratio(history['length_ratio'])
        kept = history['scale_of_trials']
        origin = replace(
            identified,
            model=DecayModel.from_terms(
                Equation(identified.model.equation.name, tuple(kept['ratios'])),
                kept['ratios'],
                trim=identified.model.trim,
                friction_rate=kept['friction_rate_rad_s'],
                axis=identified.model.axis,
            ),
            covariance=np.array(kept['covariance'], dtype=float),
            metrics=kept['metrics'],
            posterior=_posterior_of(kept.get('posterior')),
            provenance={key: value for key, value in identified.provenance.items() if key != 'froude_scaling'},
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(
            "the model's provenance has a damaged entry 'froude_scaling': scale the file of the identification instead"
        ) from error
    return origin, before


def _ratio_in_all(before: Fraction, ratio: Fraction) -> Fraction:
    """The length ratio since the trials, rejected if it could not be read back from the model file."""
    total = before * Fraction(ratio)
    try:
        return length_ratio(str(total))
    except InputError as error:
        raise InputError(
            f'the model was scaled by {float(before):g} before, and the ratio to its trials would be '
            f'{float(total):g} (1/{LARGEST_RATIO} to {LARGEST_RATIO} are kept, exactly, in {LONGEST_RATIO} '
            f'characters): scale the file of the identification instead'
        ) from error


def _plain(identified: IdentifiedModel) -> dict:
    plain = {
        'ratios': identified.model.terms,
        'covariance': identified.covariance.tolist(),
        'friction_rate_rad_s': identified.model.friction_rate,
        'metrics': identified.metrics,
    }
    posterior = identified.posterior
    if posterior is not None:
        ratios = dict(zip(posterior.equation.terms, posterior.ratios.tolist(), strict=True))
        plain['posterior'] = {'ratios': ratios, 'covariance': posterior.covariance.tolist()}
    return plain


def _posterior_of(plain: dict | None) -> HullPosterior | None:
    if plain is None:
        return None
    equation = composed(tuple(plain['ratios']))
    ratios = np.array([plain['ratios'][name] for name in equation.terms], dtype=float)
    return HullPosterior(equation, ratios, np.array(plain['covariance'], dtype=float))
