"""From runs and settings to a problem: known parameters, free ones, and the start of the search."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import white_noise
from swath_sysid.manoeuvring.hull.identified_model import Region
from swath_sysid.manoeuvring.hull.model import WAMV_LENGTH, WAMV_LEVER, parameter_values
from swath_sysid.manoeuvring.hull.terms import INDEX, NEUTRAL
from swath_sysid.manoeuvring.hull.thrust import acting_thrust
from swath_sysid.manoeuvring.identification.disturbances import surge_ratios, sway_ratios, yaw_ratios
from swath_sysid.manoeuvring.identification.scaling import SWAY_SHARE, UnitScales
from swath_sysid.manoeuvring.identification.settings import AUTO, SHARED, ManoeuvringSettings
from swath_sysid.manoeuvring.identification.shooting import CURRENT, MIN_DECAY, Unknowns
from swath_sysid.manoeuvring.motion.polarity import USUAL_CURRENT
from swath_sysid.manoeuvring.motion.resampling import TURNING
from swath_sysid.manoeuvring.motion.trial import COMMAND, CraftRun

AT_ANCHOR = 0.15  #: m/s; craft that are never faster, and do not turn, are at anchor.
SWAY_SEEN = 0.03  #: m/s.
#: s; time constants assumed where the runs show none; lag and delay of the thrusters each start from theirs.
USUAL_RESPONSE = {'surge': 5.0, 'sway': 1.0, 'yaw': 2.0, 'thrusters': 0.15}
EQUAL_CURRENTS = 0.02  #: m/s; currents of runs that differ by less are one; their spread before the first fit.

T = TypeVar('T')


@dataclass(frozen=True)
class RunProblem:
    """An identification problem."""

    runs: tuple
    thrust_input: str
    base: np.ndarray  #: (n,); Known parameters, and first guesses of the others.
    free: tuple[str, ...]  #: Unknowns that are always searched.
    #: Unknowns that are searched from the start and dropped if weak: lag and delay, either of which alone takes up the
    #: other, and the reverse ratio, without which hull terms take up its effect.
    tentative: tuple[str, ...]
    candidates: tuple[tuple[str, ...], ...]  #: Groups of unknowns that may be added.
    scales: UnitScales
    length: float  #: m.
    towards: dict
    assumed: tuple[str, ...]  #: Parameters with usual values, which these runs do not excite.
    flags: dict[str, str]  #: Parameter to the code of its warning.
    region: Region
    noise: np.ndarray  #: (3,)
    drift_spread: float  #: m/s, spread of the currents of the runs; 0: one current, or none.
    advice: tuple[Advice, ...]
    ties: dict[str, str]  #: Parameter to the one that it is equal to.
    largest_growth: float = -MIN_DECAY  #: 1/s, of small motions about straight courses; negative: they must decay.

    def unknowns(self, names: Sequence[str]) -> Unknowns:
        """Units, bounds and regularisation of some unknowns."""
        rows = np.array([self._unknown(name) for name in names]).reshape(-1, 5)
        units, lower, upper, target, spread = rows.T
        return Unknowns(tuple(names), units, lower, upper, target, spread, self.ties)

    def start(self, names: Sequence[str]) -> np.ndarray:
        """First guesses of some unknowns, shape (n,)."""
        return np.array([self.base[INDEX[n]] if n in INDEX else 0.0 for n in names])

    def _unknown(self, name: str):
        if name in CURRENT:
            return 0.1, -6.0 * USUAL_CURRENT, 6.0 * USUAL_CURRENT, 0.0, USUAL_CURRENT
        low, high, usual = self.scales.limits(name)
        target, spread = self.towards.get(name, (float(NEUTRAL[INDEX[name]]), usual))
        return self.scales.unit(name), low, high, target, spread


def moving_runs(runs: Sequence[CraftRun]) -> tuple[tuple[CraftRun, ...], tuple[Advice, ...]]:
    """Runs that moved, and advice for those at anchor or without thrust; rejects runs of which none moved."""
    kept, advice = [], []
    for run in runs:
        speed, rate = _largest(run.smooth[0]), _largest(run.smooth[2])
        if speed < AT_ANCHOR and rate < TURNING:
            advice.append(Advice.of('at-anchor', source=run.source, speed=speed, rate=np.degrees(rate)))
        elif not np.any((run.port != 0.0) | (run.starboard != 0.0)):
            advice.append(Advice.of('no-thrust', source=run.source))
        else:
            kept.append(run)
    if not kept:
        raise InputError(' '.join(a.message for a in advice))
    return tuple(kept), tuple(advice)


def assemble(runs: Sequence[CraftRun], settings: ManoeuvringSettings) -> RunProblem:
    """Make a problem of moving runs."""
    inputs = {run.thrust_input for run in runs}
    if len(inputs) > 1:
        raise InputError('some runs hold thrust in N and some commands: identify them separately')
    thrust_input = inputs.pop()
    facts = facts_of(runs, settings)
    if settings.current == SHARED and 'no heading' in facts:
        raise InputError('a current can be found only where the heading is known: add heading_rad or heading_deg')
    if settings.inertia is not None and 'no lever' in facts:
        cause = 'with a given yaw inertia the yaw rate depends on the lever, half the distance between the thrusters'
        raise InputError(f'{cause}: give it too', 'lever-assumed')
    advice = _advice(runs, settings, facts)
    if not facts & {'X', 'N'}:
        raise InputError('nothing can be identified: ' + '; '.join(a.message for a in advice))
    values = _first_guesses(runs, settings, facts)
    largest = _largest_motion(runs)
    scales = UnitScales(max(largest[0], 0.2), max(largest[2], 0.05), values['m'], values['Iz'])
    fixed, terms = set(settings.fixed), settings.terms or ()
    free = [name for name in (*_holding(_SEARCHED, facts), *terms) if name not in fixed]
    tentative = [name for name in _holding(_TENTATIVE, facts) if name not in fixed]
    values.update({name: USUAL_RESPONSE['thrusters'] for name in tentative if name != 'reverse_ratio'})
    values.update(settings.fixed)
    ties = dict(_holding(_TIES, facts))
    values.update({name: values.get(leader, 0.0) for name, leader in ties.items()})
    motion = np.array([scales.speed, max(largest[1], SWAY_SHARE * scales.speed), scales.yaw_rate])
    return RunProblem(
        tuple(runs),
        thrust_input,
        parameter_values(values),
        tuple(dict.fromkeys(free)),
        tuple(tentative),
        tuple(group for group in _holding(_CANDIDATES, facts) if not {*group} & fixed),
        scales,
        _stated(runs, settings, 'length') or WAMV_LENGTH,
        dict(settings.towards),
        (*_holding(_ASSUMED, facts), *ties),
        {name: code for code, names in _DOUBTFUL.items() if code in facts for name in names},
        seen_region(runs),
        np.fmax(0.05 * motion, np.fmax(sensor_noise(runs), 1e-6)),
        EQUAL_CURRENTS if {'many', 'current by run'} <= facts else 0.0,
        advice,
        ties,
    )


def seen_region(runs: Sequence[CraftRun]) -> Region:
    """The range of motion and inputs in some runs, without their outermost half percent."""
    surge, sway, rate = (np.concatenate([run.smooth[c] for run in runs]) for c in range(3))
    inputs = _inputs(runs)
    difference = np.concatenate([run.starboard - run.port for run in runs])
    return Region(
        slowest=float(np.nanquantile(surge, 0.005)) if np.isfinite(surge).any() else 0.0,
        fastest=max(_largest(surge), 0.1),
        largest_sway=max(_largest(sway), 0.05),
        largest_yaw_rate=_largest(rate),
        least_input=float(np.quantile(inputs, 0.005)),
        most_input=float(np.quantile(inputs, 0.995)),
        largest_difference=_largest(difference),
    )


def facts_of(runs: Sequence[CraftRun], settings: ManoeuvringSettings) -> frozenset[str]:
    """What the rules need to know of runs and settings: each fact, or ``no`` and the fact."""
    _, sway, rate = _largest_motion(runs)
    total = np.concatenate([run.port + run.starboard for run in runs])
    difference = np.concatenate([run.starboard - run.port for run in runs])
    inputs, size = _inputs(runs), max(_largest(total), 1e-12)
    surges = np.isfinite(np.concatenate([run.smooth[0] for run in runs])).any()
    turns = rate > TURNING and _largest(difference) > 0.02 * size
    has_heading = all(run.heading is not None for run in runs)
    given = {*settings.fixed, *settings.towards}
    facts = {
        'X': surges,
        'Y': turns and sway > SWAY_SEEN,
        'N': turns,
        'constant-thrust': surges and np.std(total) < 0.05 * size,
        'constant-difference': np.std(difference) < 0.05 * _largest(difference),
        'astern': np.mean(inputs < -0.02 * max(_largest(inputs), 1e-12)) > 0.02,
        'heading': has_heading,
        'many': len(runs) > 1,
        'command': runs[0].thrust_input == COMMAND,
        'thrust': runs[0].thrust_input != COMMAND or settings.thrust_per_command is not None,
        'mass': settings.mass is not None,
        'inertia': settings.inertia is not None,
        'lever': _stated(runs, settings, 'lever') is not None,
        'length': _stated(runs, settings, 'length') is not None,
        'any terms': settings.terms is None,
        'sway scale': bool(given & {'Yur', 'Yv_dot'}),
        'current by run': settings.current == AUTO and has_heading and surges,
        'one current': settings.current == SHARED,
    }
    return frozenset(name if holds else f'no {name}' for name, holds in facts.items())


def _holding(rules: Iterable[tuple[T, str]], facts: frozenset[str]) -> list[T]:
    """What the rules give whose facts, separated by commas, all hold."""
    return [given for given, needed in rules if facts >= set(needed.split(', '))]


def _each(names: str, needed: str):
    """A rule for each of some names."""
    return [(name, needed) for name in names.split()]


#: Warnings, and the facts that call for them.
_WARNINGS = (
    ('no-speed', 'no X'),
    ('constant-thrust', 'constant-thrust'),
    ('constant-difference', 'constant-difference'),
    ('no-turn', 'no N'),
    ('no-sway', 'N, no Y'),
    ('lever-assumed', 'no lever'),
    ('length-assumed', 'no length'),
    ('scale-not-given', 'no thrust, no mass'),
    ('surge-inertia-assumed', 'no thrust, mass'),
    ('mass-not-given', 'thrust, no mass'),
    ('inertia-includes-added', 'N, no inertia'),
    ('sway-scale-assumed', 'Y, any terms, no sway scale'),
)

#: Parameters that the runs can hardly separate, by the fact that makes it so.
_DOUBTFUL = {
    'constant-thrust': ('m', 'Xu_dot', 'gain', 'Xu', 'Xuu', 'Xuuu'),
    'constant-difference': ('Iz', 'Nr_dot', 'Yv_dot', 'Nr', 'Yv', 'lag', 'delay'),
}

#: Unknowns that are always searched: of mass, added mass and thrust scale one can be found in surge and one in yaw.
_SEARCHED = (
    ('gain', 'X, no thrust'),
    ('m', 'X, thrust, no mass'),
    ('Xu_dot', 'X, thrust, mass, any terms'),
    ('Iz', 'N, no inertia'),
    ('Nr_dot', 'N, inertia, any terms'),
    *_each('Xu Xuu', 'X, any terms'),
    ('Nr', 'N, any terms'),
    *_each('Yv_dot Yv', 'Y, any terms'),
    *_each(' '.join(CURRENT), 'one current'),
    *_each(' '.join(CURRENT), 'current by run, many'),
)

_TENTATIVE = (*_each('lag delay', 'any terms'), ('reverse_ratio', 'any terms, astern'))

#: Groups of unknowns that may be added.
_CANDIDATES = (
    *(
        ((name,), f'{needed}, any terms')
        for name, needed in (
            *_each('Xvr Xvv Xrr Xuuu X0', 'X'),
            *_each('Nrr Nrrr Nur Nuur N0', 'N'),
            *_each('Yvv Yvvv Yvr Yr Yuv x_G Nvr', 'Y'),
            ('Yur', 'Y, sway scale'),
            ('Yv', 'X, N, no Y'),
            *_each('Nv Nvvv Nuv', 'X, N'),
            *_each('advance exponent', 'any terms'),
            ('balance', 'N'),
            ('reverse_exponent_ratio', 'astern'),
            ('dead_band', 'command'),
        )
    ),
    (('deviation_B', 'deviation_C'), 'Y, heading, any terms'),
    (('sensor_x', 'sensor_y'), 'Y, any terms'),
    (CURRENT, 'current by run, no many'),
)

#: Parameters with usual values, which the runs do not excite.
_ASSUMED = (
    ('m', 'no X, no mass'),
    ('Xu_dot', 'no X, mass'),
    ('Xu', 'no X'),
    ('Iz', 'no N, no inertia'),
    ('Nr', 'no N'),
    ('Yv', 'no Y'),
)

#: No force drives the sway: it stays the same when m - Yur, m - Yv_dot and all else in Y are multiplied by one number,
#: so one of them must be given. By default Yur is Xu_dot, by the Coriolis forces of added mass (Fossen 2021, 6.3).
_TIES = ((('Yur', 'Xu_dot'), 'Y, any terms, no sway scale'),)


def _advice(runs: Sequence[CraftRun], settings: ManoeuvringSettings, facts: frozenset[str]) -> tuple[Advice, ...]:
    """What cannot be identified from the runs, or only under assumptions."""
    surge = np.abs(np.concatenate([run.smooth[0] for run in runs]))
    runs_up = 'X' in facts and _largest(surge) - np.nanquantile(surge, 0.02) > 0.3 * _largest(surge)
    data = {
        'separating': 'only its run-up from rest' if runs_up else 'nothing',
        'rate': np.degrees(_largest_motion(runs)[2]),
        'default_lever': WAMV_LEVER,
        'default_length': WAMV_LENGTH,
        'added_mass': settings.fixed.get('Xu_dot', 0.0),
    }
    return tuple(Advice.of(code, **data) for code in _holding(_WARNINGS, facts))


def _stated(runs: Sequence[CraftRun], settings: ManoeuvringSettings, name: str) -> float | None:
    """Lever or length of the craft: given, or stated in a record."""
    stated = (getattr(run, name) for run in runs)
    return getattr(settings, name) or next((value for value in stated if value is not None), None)


def _first_guesses(runs: Sequence[CraftRun], settings: ManoeuvringSettings, facts: frozenset[str]) -> dict[str, float]:
    """Known values and first guesses of masses, thrust scale and linear damping, by regression."""
    lever = _stated(runs, settings, 'lever') or WAMV_LEVER
    full = 1.0 if 'command' in facts else float(np.max(np.abs(_inputs(runs))))
    values = {'lever': lever, 'full_input': full}
    unit = parameter_values(values)
    acting = [acting_thrust(run.port, run.starboard, unit, run.step) for run in runs]
    ratio, linear, quadratic = (
        surge_ratios(runs, acting) if 'X' in facts else (0.0, -1.0 / USUAL_RESPONSE['surge'], 0.0)
    )
    most = max(_largest(np.concatenate([port for port, _ in acting])), 1e-9)
    ratio = ratio or 1.0 / (10.0 * USUAL_RESPONSE['surge'] * most)
    scale = (settings.thrust_per_command or 1.0) if 'thrust' in facts else None
    mass = settings.mass or (1.0 if scale is None else scale / ratio)
    gain = ratio * mass if scale is None else scale
    added = float(np.clip(mass - gain / ratio, -2.0 * mass, 0.4 * mass))
    values.update(m=mass, gain=gain, Xu_dot=added, Xu=linear * (mass - added), Xuu=quadratic * (mass - added))
    yaw_gain, yaw_damping = yaw_ratios(runs, acting) if 'N' in facts else (0.0, 0.0)
    whole = lever * gain / yaw_gain if yaw_gain > 0.0 else mass * (1.5 * lever) ** 2
    inertia = settings.inertia or whole
    added = float(np.clip(inertia - whole, -2.0 * inertia, 0.4 * inertia))
    damping = yaw_damping if yaw_damping < 0.0 else -1.0 / USUAL_RESPONSE['yaw']
    values.update(Iz=inertia, Nr_dot=added, Nr=(inertia - added) * damping)
    sway_gain, sway_damping = sway_ratios(runs, acting) if 'Y' in facts else (0.0, 0.0)
    whole = float(np.clip(mass / sway_gain, 0.6 * mass, 4.0 * mass)) if sway_gain > 0.0 else mass
    damping = sway_damping if sway_damping < 0.0 else -1.0 / USUAL_RESPONSE['sway']
    values.update(Yv_dot=mass - whole, Yv=whole * damping)
    return values


def _inputs(runs: Sequence[CraftRun]):
    return np.concatenate([np.concatenate([run.port, run.starboard]) for run in runs])


def _largest_motion(runs: Sequence[CraftRun]) -> tuple[float, float, float]:
    """Largest surge, sway, m/s, and yaw rate, rad/s; zero where not measured."""
    surge, sway, rate = (_largest(np.concatenate([run.smooth[c] for run in runs])) for c in range(3))
    return surge, sway, rate


def _largest(values: np.ndarray):
    values = np.abs(np.asarray(values, dtype=float))
    return float(np.nanquantile(values, 0.995)) if np.isfinite(values).any() else 0.0


def sensor_noise(runs: Sequence[CraftRun]) -> np.ndarray:
    """White noise of surge, sway and yaw rate, the median of the runs, shape (3,)."""
    by_channel = zip(*(run.channels for run in runs), strict=True)
    return np.array([np.median([white_noise(c[np.isfinite(c)]) for c in same]) for same in by_channel])
