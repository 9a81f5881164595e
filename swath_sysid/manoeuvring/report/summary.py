"""Manoeuvring results in words and in plain data."""

from collections.abc import Callable, Iterable

from swath_sysid.common.advice import Advice, counted, with_flags
from swath_sysid.common.plain import as_plain, finite_or_none
from swath_sysid.manoeuvring.hull.standard_tests import ManoeuvringTest
from swath_sysid.manoeuvring.hull.terms import PARAMETERS, Parameter
from swath_sysid.manoeuvring.identification.identify import ManoeuvringIdentification
from swath_sysid.manoeuvring.identification.selection import HELD
from swath_sysid.manoeuvring.identification.shooting import CURRENT
from swath_sysid.manoeuvring.identification.validation import Scores
from swath_sysid.manoeuvring.prediction.skill import ForecastScores
from swath_sysid.report.fit_summary import short_name, warnings_as_data

OF_PARAMETERS = ('not-separable', 'uncertain', 'at-bound')  #: Warnings that are not about single runs.
#: Of the parameters that are not hydrodynamic derivatives.
_MEANINGS = {
    'm': 'mass',
    'Iz': 'yaw inertia',
    'gain': 'thrust per unit of input at full input ahead',
    'reverse_ratio': 'thrust at full input astern as a share of that ahead',
    'dead_band': 'share of the full input that gives no thrust',
    'exponent': 'of the thrust curve ahead',
    'reverse_exponent_ratio': 'exponent astern as a multiple of that ahead',
    'balance': 'share by which the starboard thruster is stronger',
    'advance': 'loss of thrust by speed',
    'lag': 'of the thrusters, first order',
    'delay': 'of the thrusters',
    'deduction': 'thrust lost at the hull, a share',
    'lever': 'half the distance between the thrusters',
    'moment_factor': 'gain of the yaw moment at the hull, a share',
    'full_input': 'input at which the thrust curve is 1: 1 for commands, N for forces',
    'deviation_B': 'of the compass, by the sine of the heading (from east to north)',
    'deviation_C': 'of the compass, by the cosine of the heading',
    'sensor_x': 'sensor ahead of the origin',
    'sensor_y': 'sensor to port of the origin',
    'x_G': 'centre of gravity ahead of the origin, about which the hull is symmetric',
}
#: Of a quantity, by the ending of its name; the longest first.
_UNITS = {
    '_rad_s': 'rad/s',
    '_rad': 'rad',
    '_deg_s_per_input': 'deg/s per unit of input',
    '_deg_s': 'deg/s',
    '_m_s': 'm/s',
    '_deg': 'deg',
    '_m': 'm',
    '_s': 's',
}


def condensed(advice: Iterable[Advice]) -> tuple[Advice, ...]:
    """Warnings without repetitions; of one kind from many runs, the first and the number of the others."""
    kinds: dict[str, list[Advice]] = {}
    for item in dict.fromkeys(advice):
        kinds.setdefault(item.code, []).append(item)
    shown: list[Advice] = []
    for code, alike in kinds.items():
        if code in OF_PARAMETERS or len(alike) == 1:
            shown += alike
        else:
            shown.append(Advice(code, f'{alike[0].message} (and {counted(len(alike) - 1, "more run")})'))
    return tuple(shown)


def identification_as_data(found: ManoeuvringIdentification, wall_s: float | None = None) -> dict:
    """Output of ``manoeuvre identify --json``; ``wall_s`` is its duration."""
    model = found.model
    std = dict(zip(found.names, found.covariance.diagonal() ** 0.5, strict=True))

    def both(pick: Callable):
        validation = None if found.validation is None else pick(found.validation)
        return {'identification': pick(found.identification), 'validation': validation}

    leads = tuple(found.identification.position_error)
    current = None
    if CURRENT[0] in found.names:
        current = {
            name: {'value': value, 'std': float(std[key])}
            for name, key, value in zip(('east', 'north'), CURRENT, model.current, strict=True)
        }
    by_run = None
    if found.has_currents_by_run:
        by_run = {
            run.source: {'east': east, 'north': north}
            for run, (east, north) in zip(found.identified_on, found.currents.tolist(), strict=True)
        }
    return finite_or_none(
        {
            'verdict': vars(found.verdict),
            'thrust_input': model.thrust_input,
            'derivatives': as_plain(found.derivatives),
            'given': found.fixed,
            'prime_units': {
                'length_m': found.prime_units.length,
                'speed_m_s': found.prime_units.speed,
                'density_kg_m3': found.prime_units.density,
            },
            'current_m_s': current,
            'current_by_run_m_s': by_run if found.has_currents_by_run else None,
            'r2': {channel: both(lambda scores, c=channel: scores.r2[c]) for channel in found.identification.r2},
            'position_error_m': {f'{lead:g}': both(lambda scores, s=lead: scores.position_error[s]) for lead in leads},
            'heading_error_rad': {f'{lead:g}': both(lambda scores, s=lead: scores.heading_error[s]) for lead in leads},
            'windows': both(lambda scores: scores.windows),
            'diverged_windows': both(lambda scores: scores.diverged),
            'runs': {
                'identification': [run.source for run in found.identified_on],
                'validation': [run.source for run in found.validated_on],
            },
            'stability': {'stable': found.stability.stable, 'largest_growth_1_s': found.stability.largest_growth},
            'noise': dict(zip(('surge_m_s', 'sway_m_s', 'yaw_rate_rad_s'), found.noise.tolist(), strict=True)),
            'refused_terms': found.rejected,
            'effective_samples': found.effective_samples,
            'wall_s': wall_s,
            **warnings_as_data(condensed(found.advice)),
        }
    )


def terms_in_words() -> list[str]:
    """Name, unit and meaning of each parameter of the catalogue, one per line."""
    sides = {'X': 'surge force', 'Y': 'sway force', 'N': 'yaw moment'}

    def meaning(p: Parameter):
        by = ' '.join(f'd{f.lower()}/dt' if f.isupper() else f for f in p.factors)
        return _MEANINGS.get(p.name) or (f'{sides[p.row]} by {by}' if by else f'steady {sides[p.row]}')

    return [f'  {p.name:<24}{p.unit:<10}{meaning(p)}' for p in PARAMETERS]


def identification_in_words(found: ManoeuvringIdentification) -> list[str]:
    """Lines for a reader."""
    model = found.model
    names = ', '.join(short_name(run.source) for run in found.validated_on)
    others = '' if found.validated_model is model else ' by a fit to the others'
    held = f', validated on {names}{others}' if names else ''
    width = max(map(len, found.derivatives), default=0)
    # without a length or a scale of its own the prime system says nothing
    assumed = {a.code for a in found.advice} & {'length-assumed', 'scale-not-given'}
    lines = [
        f'manoeuvring model from {counted(len(found.identified_on), "run")}{held}; thrust as {model.thrust_input}',
        f'  {with_flags(found.verdict.code, str(found.verdict))}',
        f'  {"":<{width}}{"value":>12}    {"std":<10}{"" if assumed else "prime":>11}  unit',
    ]
    for name, d in found.derivatives.items():
        prime = '' if d.prime is None or assumed else f'{d.prime:.3e}'
        flags = f'  [{", ".join(d.flags)}]' if d.flags else ''
        lines.append(f'  {name:<{width}}{d.value:>12.5g} +- {d.std:<10.3g}{prime:>11}  {d.unit}{flags}')
    if found.fixed:
        lines.append('  given or assumed: ' + ', '.join(f'{n} {v:.5g}' for n, v in found.fixed.items()))
    at_limit = [f'{name} {model[name]:.5g}' for name, reason in found.rejected.items() if reason == HELD]
    if at_limit:
        lines.append(f'  held at the limit of its range: {", ".join(at_limit)}')
    if CURRENT[0] in found.names:
        several = ' (mean; each run has its own)' if found.has_currents_by_run else ''
        lines.append(f'  current {model.current[0]:+.3f} m/s east, {model.current[1]:+.3f} m/s north{several}')
    lines += _scores_in_words('identification', found.identification)
    lines += [] if found.validation is None else _scores_in_words('validation', found.validation)
    stable = 'stable' if found.stability.stable else 'NOT stable'
    return [
        *lines,
        f'  {stable} at the speeds and inputs seen (slowest decay {-found.stability.largest_growth:.3g} 1/s)',
        '  R2 compares with the mean of each channel: 1 is perfect, 0 is as good as that mean. If a craft',
        '  hardly sways, an R2 of sway of -0.1 means only that the error is as large as the sensor noise.',
    ]


def _scores_in_words(label: str, scores: Scores) -> list[str]:
    named = {name: name.replace('_', ' ') for name in scores.r2}
    r2 = ', '.join(f'{named[name]} {value:.4f}' for name, value in scores.r2.items() if value == value)
    units = {'yaw_rate': 'rad/s'}
    rmse = ', '.join(
        f'{named[name]} {value:.3g} {units.get(name, "m/s")}' for name, value in scores.rmse.items() if value == value
    )
    errors = '; '.join(
        f'{lead:g} s: '
        + (f'{apart:.2f} m, ' if (apart := scores.position_error[lead]) == apart else '')
        + f'{heading:.3f} rad'
        for lead, heading in scores.heading_error.items()
        if heading == heading
    )
    return [
        f'  {label}: R2 of free simulation over {scores.windows} windows: {r2}',
        f'    root mean square errors: {rmse}',
        *([f'    {scores.diverged} windows DIVERGED'] if scores.diverged else []),
        f'    error after {errors}',
    ]


def test_in_words(report: ManoeuvringTest) -> list[str]:
    """Lines for a reader."""
    lines = [report.name.replace('-', ' ')]
    for name, value in report.numbers.items():
        label, unit = _label_and_unit(name)
        shown = f'{round(value, 3) + 0.0:>10.3f} {unit}' if value == value else '  not reached'
        lines.append(f'  {label:<34}{shown}')
    return lines


def forecast_as_data(scores: ForecastScores, future: str) -> dict:
    """Output of ``manoeuvre forecast --json``: root mean square errors by method, quantity and lead."""

    def by_lead(values: Iterable[float]):
        return {f'{lead:g}': float(value) for lead, value in zip(scores.leads, values, strict=True)}

    return finite_or_none(
        {
            'future': future,
            'forecasts': scores.count,
            'leads_s': list(scores.leads),
            'rmse': {method: {q: by_lead(v) for q, v in table.items()} for method, table in scores.rmse.items()},
            'within_90_percent': {q: by_lead(v) for q, v in scores.spread.items()},
        }
    )


def forecast_in_words(scores: ForecastScores, future: str) -> list[str]:
    """One table per quantity: methods by leads."""
    lines = [f'{scores.count} forecasts, future thrust {future}; root mean square errors by lead']
    heads = ''.join(f'{lead:>9g} s' for lead in scores.leads)
    for quantity in next(iter(scores.rmse.values())):
        if all((table[quantity] != table[quantity]).all() for table in scores.rmse.values()):
            continue
        label, unit = _label_and_unit(quantity)
        lines.append(f'  {f"{label} ({unit})":<22}{heads}')
        for method, table in scores.rmse.items():
            values = ''.join(f'{value:>11.3f}' if value == value else f'{"-":>11}' for value in table[quantity])
            lines.append(f'    {method:<20}{values}')
        if quantity in scores.spread:
            values = ''.join(f'{value:>11.0%}' if value == value else f'{"-":>11}' for value in scores.spread[quantity])
            lines.append(f'    {"model, 90 % interval":<20}{values}')
    return lines


def _label_and_unit(name: str):
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending).replace('_', ' '), unit
    return name.replace('_', ' '), ''
