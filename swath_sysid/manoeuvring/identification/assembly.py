"""From runs and settings to a problem: known parameters, free ones, and the start of the search."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import white_noise
from swath_sysid.manoeuvring.hull.model import parameter_values
from swath_sysid.manoeuvring.hull.presets import WAMV_LENGTH, WAMV_LEVER
from swath_sysid.manoeuvring.hull.stability import Region
from swath_sysid.manoeuvring.hull.terms import INDEX
from swath_sysid.manoeuvring.hull.thrust import acting_thrust
from swath_sysid.manoeuvring.identification.scaling import Scales
from swath_sysid.manoeuvring.identification.settings import AUTO, SHARED, ManoeuvringSettings
from swath_sysid.manoeuvring.identification.shooting import CURRENT, MIN_DECAY, Unknowns
from swath_sysid.manoeuvring.identification.starts import surge_ratios, sway_ratios, yaw_ratios
from swath_sysid.manoeuvring.motion.trial import COMMAND, Run

AT_ANCHOR_SPEED = 0.15
AT_ANCHOR_YAW_RATE = 0.03
NO_TURN = 0.02  #: rad/s; a lower yaw rate identifies nothing of a turn.
SWAY_SEEN = 0.03  #: m/s.
USUAL_RESPONSE = {'surge': 5.0, 'sway': 1.0, 'yaw': 2.0}  #: s; time constants assumed where the runs show none.

DEVIATION, SENSOR_PLACE = ('deviation_B', 'deviation_C'), ('sensor_x', 'sensor_y')
FIRST_DELAY = 0.15  #: s, first guess of lag and delay of the thrusters.
LARGEST_DRIFT = 2.0  #: m/s.

DRIFT_SPREAD = 0.5
FIRST_DRIFT_SPREAD = 0.02  #: m/s, spread of the currents of the runs before the first fit.

_CANDIDATES = {
    'X': ('Xvr', 'Xvv', 'Xrr', 'Xuuu', 'X0'),
    'Y': ('Yvv', 'Yvvv', 'Yvr', 'Yr', 'Yur', 'Yuv'),
    'N': ('Nrr', 'Nrrr', 'Nur', 'Nuur', 'N0'),
    'N-sway': ('x_G', 'Nvr', 'Nv', 'Nvvv', 'Nuv'),
}
_BASE = {'X': ('Xu', 'Xuu'), 'Y': ('Yv_dot', 'Yv'), 'N': ('Nr',)}


@dataclass(frozen=True)
class Problem:
    """An identification problem."""

    runs: tuple
    thrust_input: str
    base: np.ndarray  #: (n,); Known parameters, and first guesses of the others.
    free: tuple[str, ...]  #: Unknowns that are always searched.
    #: Unknowns that are searched from the start and dropped if weak: lag and delay, either of which alone takes up the
    #: other, and the reverse ratio, without which hull terms take up its effect.
    tentative: tuple[str, ...]
    candidates: tuple[tuple[str, ...], ...]  #: Groups of unknowns that may be added.
    scales: Scales
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
            return 0.1, -LARGEST_DRIFT, LARGEST_DRIFT, 0.0, DRIFT_SPREAD
        low, high = self.scales.bounds(name)
        target, spread = self.towards.get(name, (None, None))
        if target is None:
            target, spread = float(parameter_values({})[INDEX[name]]), self.scales.prior(name)
        return self.scales.unit(name), low, high, target, spread


def moving_runs(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[Advice, ...]]:
    """Runs that moved, and advice for those at anchor or without thrust; rejects runs of which none moved."""
    kept, advice = [], []
    for run in runs:
        speed, rate = _largest(run.smooth[0]), _largest(run.smooth[2])
        if speed < AT_ANCHOR_SPEED and rate < AT_ANCHOR_YAW_RATE:
            advice.append(Advice.of('at-anchor', source=run.source, speed=speed, rate=np.degrees(rate)))
        elif not np.any((run.port != 0.0) | (run.starboard != 0.0)):
            advice.append(Advice.of('no-thrust', source=run.source))
        else:
            kept.append(run)
    if not kept:
        raise InputError(' '.join(a.message for a in advice))
    return tuple(kept), tuple(advice)


def assemble(runs: Sequence[Run], settings: ManoeuvringSettings) -> Problem:
    """Make a problem of moving runs."""
    inputs = {run.thrust_input for run in runs}
    if len(inputs) > 1:
        raise InputError('some runs hold thrust in N and some commands: identify them separately')
    thrust_input = inputs.pop()
    advice: list[Advice] = []
    flags: dict[str, str] = {}
    speeds = np.concatenate([run.smooth[0] for run in runs])
    rates = np.concatenate([run.smooth[2] for run in runs])
    sways = np.concatenate([run.smooth[1] for run in runs])
    rows = _excited_rows(runs, speeds, sways, rates, advice, flags)
    lever, length = _craft(runs, settings, advice)
    values, free, assumed = _anchors(runs, thrust_input, settings, lever, rows, advice)
    scales = Scales(max(_largest(speeds), 0.2), max(_largest(rates), 0.05), values['m'], values['Iz'])
    free += [name for row in rows for name in _BASE[row]]
    for row, names in _BASE.items():
        if row not in rows:
            assumed += [n for n in names if n != 'Xuu']
    if 'Y' not in rows:
        assumed.remove('Yv_dot')
    candidates = _candidates(runs, thrust_input, rows, settings)
    if settings.terms is not None:
        keep = {n for n in free if n in ('m', 'Iz', 'gain')} | set(settings.terms)
        free = [n for n in dict.fromkeys([*free, *settings.terms]) if n in keep]
        candidates = []
        if settings.current == AUTO and all(run.heading is not None for run in runs):
            candidates = [CURRENT]
    tentative = []
    if settings.terms is None:
        usual = ('lag', 'delay', *(['reverse_ratio'] if _goes_astern(runs) else []))
        tentative = [n for n in usual if n not in settings.fixed]
        values.update({n: FIRST_DELAY for n in tentative if n != 'reverse_ratio'})
    if settings.current == SHARED:
        if any(run.heading is None for run in runs):
            raise InputError('a current can be found only where the heading is known: add heading_rad or heading_deg')
        free = [*free, *CURRENT]
        candidates = [c for c in candidates if c != CURRENT]
    drift_spread = 0.0
    if settings.current == AUTO and CURRENT in candidates and len(runs) > 1:
        free, drift_spread = [*free, *CURRENT], FIRST_DRIFT_SPREAD
        candidates.remove(CURRENT)
    free = [n for n in dict.fromkeys(free) if n not in settings.fixed]
    candidates = [c for c in candidates if not set(c) & set(settings.fixed)]
    values.update(settings.fixed)
    ties = _ties(settings, free, advice)
    candidates = [c for c in candidates if not set(c) & set(ties)]
    assumed += ties
    values.update({name: values.get(leader, 0.0) for name, leader in ties.items()})
    motion = np.array([scales.speed, max(_largest(sways), 0.3 * scales.speed), scales.yaw_rate])
    noise = np.fmax(0.05 * motion, np.fmax(sensor_noise(runs), 1e-6))
    return Problem(
        tuple(runs),
        thrust_input,
        parameter_values(values),
        tuple(free),
        tuple(tentative),
        tuple(candidates),
        scales,
        length,
        dict(settings.towards),
        tuple(assumed),
        flags,
        seen_region(runs),
        noise,
        drift_spread,
        tuple(advice),
        ties,
    )


def seen_region(runs: Sequence[Run]) -> Region:
    """The range of motion and inputs in some runs, without their outermost half percent."""
    surge, sway, rate = (np.concatenate([run.smooth[c] for run in runs]) for c in range(3))
    inputs = np.concatenate([np.concatenate([run.port, run.starboard]) for run in runs])
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


def _excited_rows(
    runs: Sequence[Run],
    speeds: np.ndarray,
    sways: np.ndarray,
    rates: np.ndarray,
    advice: list[Advice],
    flags: dict[str, str],
):
    """Equations that the runs excite."""
    rows = []
    total = np.concatenate([run.port + run.starboard for run in runs])
    difference = np.concatenate([run.starboard - run.port for run in runs])
    size = max(_largest(total), 1e-12)
    if np.isfinite(speeds).any():
        rows.append('X')
        moved = _largest(speeds) - float(np.nanquantile(speeds, 0.02))
        if np.std(total) < 0.05 * size:
            separating = 'only its run-up from rest' if moved > 0.3 * _largest(speeds) else 'nothing'
            advice.append(Advice.of('constant-thrust', separating=separating))
            flags.update(dict.fromkeys(('m', 'Xu_dot', 'gain', 'Xu', 'Xuu', 'Xuuu'), 'constant-thrust'))
    else:
        advice.append(Advice.of('no-speed'))
    if np.std(difference) < 0.05 * _largest(difference):
        advice.append(Advice.of('constant-difference'))
        names = ('Iz', 'Nr_dot', 'Yv_dot', 'Nr', 'Yv', 'lag', 'delay')
        flags.update(dict.fromkeys(names, 'constant-difference'))
    turning = np.isfinite(rates).any() and _largest(rates) > NO_TURN
    if turning and _largest(difference) > 0.02 * size:
        rows.append('N')
        if np.isfinite(sways).any() and _largest(sways) > SWAY_SEEN:
            rows.append('Y')
        else:
            advice.append(Advice.of('no-sway'))
    else:
        advice.append(Advice.of('no-turn', rate=np.degrees(_largest(rates))))
    if not rows:
        raise InputError('nothing can be identified: ' + '; '.join(a.message for a in advice))
    return rows


def _craft(runs: Sequence[Run], settings: ManoeuvringSettings, advice: list[Advice]):
    """Lever and length: given, stated in a record, or those of a WAM-V 16."""
    stated = [run.lever for run in runs if run.lever is not None]
    lever = settings.lever or (stated[0] if stated else None)
    lengths = [run.length for run in runs if run.length is not None]
    length = settings.length or (lengths[0] if lengths else None)
    if lever is None and settings.inertia is not None:
        raise InputError(
            'with a given yaw inertia the yaw rate depends on the lever, half the distance between the '
            'thrusters: give it too',
            'lever-assumed',
        )
    if lever is None:
        advice.append(Advice.of('lever-assumed', default_lever=WAMV_LEVER))
    if length is None:
        advice.append(Advice.of('length-assumed', default_length=WAMV_LENGTH))
    return lever or WAMV_LEVER, length or WAMV_LENGTH


def _anchors(
    runs: Sequence[Run],
    thrust_input: str,
    settings: ManoeuvringSettings,
    lever: float,
    rows: list[str],
    advice: list[Advice],
):
    """Known values and first guesses, free parameters, and assumed ones, for the given scale of mass and thrust."""
    inputs = np.concatenate([np.concatenate([run.port, run.starboard]) for run in runs])
    full = 1.0 if thrust_input == COMMAND else float(np.max(np.abs(inputs)))
    values = {'lever': lever, 'full_input': full}
    unit = parameter_values(values)
    acting = [acting_thrust(run.port, run.starboard, unit, run.step) for run in runs]
    gain_ratio, linear, quadratic = surge_ratios(runs, acting) if 'X' in rows else (0.0, 0.0, 0.0)
    fallback = 1.0 / (10.0 * USUAL_RESPONSE['surge'] * max(_largest(np.concatenate([a[0] for a in acting])), 1e-9))
    gain_ratio = gain_ratio or fallback
    free, assumed = [], []
    if thrust_input == COMMAND and settings.thrust_per_command is None:
        if settings.mass is None:
            advice.append(Advice.of('scale-not-given'))
        else:
            advice.append(Advice.of('surge-inertia-assumed', added_mass=settings.fixed.get('Xu_dot', 0.0)))
        mass = settings.mass or 1.0
        values.update(m=mass, gain=gain_ratio * mass)
        thrust_scale = values['gain']
        free.append('gain')
        heavy = mass
    else:
        thrust_scale = settings.thrust_per_command or 1.0
        values['gain'] = thrust_scale
        heavy = thrust_scale / gain_ratio
        if settings.mass is None:
            values['m'] = heavy
            free.append('m')
            advice.append(Advice.of('mass-not-given'))
        else:
            values['m'] = settings.mass
            values['Xu_dot'] = float(np.clip(settings.mass - heavy, -2.0 * settings.mass, 0.4 * settings.mass))
            heavy = settings.mass - values['Xu_dot']
            free.append('Xu_dot')
    if 'X' not in rows:
        free, linear = [], -1.0 / USUAL_RESPONSE['surge']
        assumed.append('m' if settings.mass is None else 'Xu_dot')
    values.update(Xu=linear * heavy, Xuu=quadratic * heavy)
    yaw_gain, yaw_damping = yaw_ratios(runs, acting) if 'N' in rows else (0.0, 0.0)
    inertia = lever * thrust_scale / yaw_gain if yaw_gain > 0.0 else values['m'] * (1.5 * lever) ** 2
    if settings.inertia is None:
        values['Iz'] = inertia
        (free if 'N' in rows else assumed).append('Iz')
        if 'N' in rows:
            advice.append(Advice.of('inertia-includes-added'))
    else:
        values['Iz'] = settings.inertia
        values['Nr_dot'] = float(np.clip(settings.inertia - inertia, -2 * settings.inertia, 0.4 * settings.inertia))
        inertia = settings.inertia - values['Nr_dot']
        if 'N' in rows:
            free.append('Nr_dot')
    values['Nr'] = inertia * (yaw_damping if yaw_damping < 0.0 else -1.0 / USUAL_RESPONSE['yaw'])
    mass = values['m']
    sway_gain, sway_damping = sway_ratios(runs, acting) if 'Y' in rows else (0.0, 0.0)
    sway_mass = float(np.clip(mass / sway_gain, 0.6 * mass, 4.0 * mass)) if sway_gain > 0.0 else mass
    values['Yv_dot'] = mass - sway_mass
    values['Yv'] = sway_mass * (sway_damping if sway_damping < 0.0 else -1.0 / USUAL_RESPONSE['sway'])
    return values, free, assumed


def _ties(settings: ManoeuvringSettings, free: list[str], advice: list[Advice]):
    """Parameters that are assumed equal to another one. No force drives the sway: it stays the same when m - Yur, m -
    Yv_dot and all else in Y are multiplied by one number, so one of them must be given. By default Yur is Xu_dot, by
    the Coriolis forces of added mass (Fossen 2021, 6.3).
    """
    if settings.terms is not None or 'Yv_dot' not in free or {'Yur', 'Yv_dot'} & {*settings.fixed, *settings.towards}:
        return {}
    advice.append(Advice.of('sway-scale-assumed'))
    return {'Yur': 'Xu_dot'}


def _candidates(runs: Sequence[Run], thrust_input: str, rows: list[str], settings: ManoeuvringSettings):
    found: list[tuple[str, ...]] = [(name,) for row in rows for name in _CANDIDATES[row]]
    if 'Y' in rows:
        found += [(name,) for name in _CANDIDATES['N-sway']]
    elif 'N' in rows and 'X' in rows:
        found += [(name,) for name in ('Yv', *_CANDIDATES['N-sway'][2:])]
    found.append(('advance',))
    if 'N' in rows:
        found.append(('balance',))
    found.append(('exponent',))
    if _goes_astern(runs):
        found.append(('reverse_exponent_ratio',))
    if thrust_input == COMMAND:
        found.append(('dead_band',))
    if 'Y' in rows and all(run.heading is not None for run in runs):
        found.append(DEVIATION)
    if 'Y' in rows:
        found.append(SENSOR_PLACE)
    if settings.current == AUTO and 'X' in rows and all(run.heading is not None for run in runs):
        found.append(CURRENT)
    return found


def _goes_astern(runs: Sequence[Run]):
    inputs = np.concatenate([np.concatenate([run.port, run.starboard]) for run in runs])
    return np.mean(inputs < -0.02 * max(_largest(inputs), 1e-12)) > 0.02


def _largest(values: np.ndarray):
    values = np.abs(np.asarray(values, dtype=float))
    return float(np.nanquantile(values, 0.995)) if np.isfinite(values).any() else 0.0


def sensor_noise(runs: Sequence[Run]) -> np.ndarray:
    """White noise of surge, sway and yaw rate, the median of the runs, shape (3,)."""
    return np.array(
        [
            np.median([white_noise(c[np.isfinite(c)]) for c in side])
            for side in zip(*(r.channels for r in runs), strict=True)
        ]
    )
