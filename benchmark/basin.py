"""Whether a fit's intervals hold, its release is found and its verdict is right, in basins that are never quite still.

    python benchmark/basin.py                                   every scene, 12 seeds, the true equation
    python benchmark/basin.py --scenes white,waves-0.3 --seeds 3
    python benchmark/basin.py --scenes all --first 12 --seeds 48    other seeds, and enough to judge one coefficient
    python benchmark/basin.py --equation auto                   without an equation: the general hull, pruned
    python benchmark/basin.py --equation odd-cubic              the same with one equation for every hull

The trials are made by scipy's solve_ivp from coefficients copied out of the papers; nothing of the package makes them.

12 seeds judge a scene but not a coefficient, which has 24 fits then: of 22 perfect intervals, were they independent,
one would hold less than .85 in half of all runs. With 48 seeds it would in one run of 500.
"""

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

TRUE_EQUATION = 'that of the hull'
RATE_HZ = 100.0
FREE_S = 15.0
ANGLE_NOISE, RATE_NOISE = 1e-3, 8e-3
"""rad and rad/s, white: an inertial sensor of the papers' kind; their objective values are .007 to .026 rad/s."""

SWATH_PITCH = {'b1': 1.532821844, 'b2': 0.070225711, 'r1': 10.12179946, 'r2': 19.38332837, 'r3': 96.71965662}
SWATH_ROLL = {'b1': 0.006167, 'b2': 12.225251, 'b3': 32.557548, 's1': 6.203614, 's2': 45.607759}
HYDROFOIL = {'b1': 8.79129395, 'b2': 0.00850162, 'b3': 0.04839175, 'r1': 32.953354, 'r2': 130.820453, 'r3': 56.8982143}
USV_PITCH = {'b1': 2.027905, 'b2': 0.141434, 'b3': 0.049248, 'r1': 7.440276, 'r2': 0.016690, 'r3': 8.755567}
HULLS = {
    'swath-pitch 6': ('pitch', SWATH_PITCH, 6.0),
    'swath-pitch 9': ('pitch', SWATH_PITCH, 9.0),
    'swath-roll 5': ('roll', SWATH_ROLL, 5.0),
    'swath-roll 15': ('roll', SWATH_ROLL, 15.0),
    'hydrofoil-pitch 3': ('pitch', HYDROFOIL, 3.0),
    'hydrofoil-pitch 5': ('pitch', HYDROFOIL, 5.0),
    'swath-usv-pitch 5': ('pitch', USV_PITCH, 5.0),
    'swath-usv-pitch 9': ('pitch', USV_PITCH, 9.0),
}


@dataclass(frozen=True)
class Scene:
    """What disturbs a trial; angles in degrees."""

    waves: float = 0.0
    wobble: float = 0.0
    trim: float = 0.0
    gyro_bias: float = 0.0
    coloured_angle: bool = False
    coloured_rate: bool = False


SCENES = {
    'white': Scene(),
    'wobble-trim': Scene(wobble=0.3, trim=1.5),
    'bias-coloured-angle': Scene(gyro_bias=0.2, coloured_angle=True),
    'coloured': Scene(coloured_angle=True, coloured_rate=True),
    'waves-0.1': Scene(waves=0.1),
    'waves-0.3': Scene(waves=0.3),
    'all': Scene(0.1, 0.3, 1.5, 0.2, True, True),
}


@dataclass(frozen=True)
class Made:
    """A trial made: time, s; angle, rad; rate, rad/s; the truth's coefficients and its release, s."""

    axis: str
    time: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    truth: dict
    release: float


def acceleration(x, rate, c):
    """Of the published hulls, without disturbance."""
    b = [c.get(name, 0.0) for name in ('b1', 'b2', 'b3')]
    r = [c.get(name, 0.0) for name in ('r1', 'r2', 'r3', 's1', 's2')]
    sine = np.sin(x)
    damping = (b[0] + b[1] * abs(rate) + b[2] * rate * rate) * rate
    return -damping - ((r[0] + r[1] * x + r[2] * x * x) * x + r[3] * sine + r[4] * sine * sine)


def free_motion(c, x, rate, elapsed, moment=None):
    """Angle from trim and rate at the elapsed times, by scipy's solver."""
    moment = moment or (lambda t: 0.0)
    found = solve_ivp(
        lambda t, y: (y[1], acceleration(y[0], y[1], c) + moment(t)),
        (0.0, elapsed[-1] + 1e-9),
        (x, rate),
        t_eval=elapsed,
        rtol=1e-8,
        atol=1e-10,
        max_step=0.1,
    )
    if found.y.shape[1] < elapsed.size or np.abs(found.y[0]).max() > 1.0:
        raise ValueError('this hull does not return')
    return found.y


def residual_waves(c, rms, rng):
    """A moment over inertia, rad/s^2, of 25 waves about resonance that roll or pitch the hull by ``rms`` rad."""
    natural = np.sqrt(c.get('r1', 0.0) + c.get('s1', 0.0))
    w, phase, size = natural * rng.uniform(0.7, 1.3, 25), rng.uniform(0, 2 * np.pi, 25), rng.rayleigh(1, 25)
    a = np.sqrt(2.0) * rms
    rate = natural * a
    damping = c.get('b1', 0) + 8 / (3 * np.pi) * c.get('b2', 0) * rate + 0.75 * c.get('b3', 0) * rate**2
    gain = size / np.sqrt((natural**2 - w**2) ** 2 + (damping * w) ** 2)
    size = size * rms / np.sqrt(np.sum(gain**2) / 2)
    return lambda t: float(size @ np.cos(w * t + phase))


def coloured(size, std, memory, rng):
    """First-order noise of a given standard deviation and memory, s."""
    keep = np.exp(-1.0 / (RATE_HZ * memory))
    noise = std * rng.normal(size=size)
    noise[1:] *= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], noise)


def made_trial(hull, scene, seed):
    """One trial: a hand holds, lets go, and the craft oscillates in a basin that may move.

    Parameters
    ----------
    hull : str
        Of ``HULLS``.
    scene : Scene
    seed : int
    """
    axis, c, initial_deg = HULLS[hull]
    rng = np.random.default_rng([seed, list(HULLS).index(hull), list(SCENES.values()).index(scene)])
    release = rng.uniform(2.0, 3.0)
    time = np.arange(round((release + FREE_S) * RATE_HZ)) / RATE_HZ
    held = time < release
    frequency, phase = 2 * np.pi * rng.uniform(0.4, 1.5, 3), rng.uniform(0, 2 * np.pi, 3)
    size = np.radians(scene.wobble) * rng.rayleigh(1, 3) / np.sqrt(3)

    def hand(t):
        t = np.asarray(t)[..., None]
        angle = np.sum(size * np.sin(frequency * t + phase), axis=-1)
        return np.radians(initial_deg) + angle, np.sum(size * frequency * np.cos(frequency * t + phase), axis=-1)

    moment = residual_waves(c, np.radians(scene.waves), rng) if scene.waves else None
    angle, rate = hand(time)
    let_go = [float(value) for value in hand(release)]
    angle[~held], rate[~held] = free_motion(c, *let_go, np.r_[0.0, time[~held] - release], moment)[:, 1:]
    angle = angle + np.radians(scene.trim) + ANGLE_NOISE * rng.normal(size=time.size)
    rate = rate + np.radians(scene.gyro_bias) + RATE_NOISE * rng.normal(size=time.size)
    if scene.coloured_angle:
        angle = angle + coloured(time.size, ANGLE_NOISE, 0.3, rng)
    if scene.coloured_rate:
        rate = rate + coloured(time.size, RATE_NOISE, 0.1, rng)
    return Made(axis, time, angle, rate, c, release)


def cramer_rao_std(hull):
    """Least standard deviation of each coefficient from the white record after its release, state and trim unknown."""
    _, c, initial_deg = HULLS[hull]
    elapsed = np.arange(round(FREE_S * RATE_HZ)) / RATE_HZ
    names = list(c)
    base = np.array([*c.values(), np.radians(initial_deg), 0.0])

    def motion(values):
        return free_motion(dict(zip(names, values[:-2], strict=True)), *values[-2:], elapsed)

    columns = [[np.ones(elapsed.size), np.zeros(elapsed.size)]]
    for k, value in enumerate(base):
        step = np.zeros(base.size)
        step[k] = 1e-4 * max(abs(value), 0.1)
        columns.append((motion(base + step) - motion(base - step)) / (2 * step[k]))
    slopes = np.array([np.concatenate([a / ANGLE_NOISE, w / RATE_NOISE]) for a, w in columns])
    return dict(zip(names, np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))[1:-2], strict=True))


def equation_of(truth):
    """The composition of the true terms."""
    damping = ','.join(name for name in truth if name[0] == 'b')
    return f'{damping}|{",".join(name for name in truth if name[0] != "b")}'


def fit_of(made, equation):
    """The package's fit of a trial made, or its refusal."""
    from swath_sysid.attitude.identification.identify import identify_problem
    from swath_sysid.attitude.identification.problem import prepare
    from swath_sysid.attitude.identification.result import IdentificationSettings
    from swath_sysid.attitude.motion.trial import AxisMotion
    from swath_sysid.common.errors import InputError

    try:
        problem = prepare([AxisMotion(made.axis, made.time, made.angle, made.rate)])
        return identify_problem(problem, IdentificationSettings(equation))
    except InputError as error:
        return str(error)


def judged(task):
    """What one fit was worth, in plain numbers."""
    hull, scene_name, seed, equation = task
    made = made_trial(hull, SCENES[scene_name], seed)
    found = fit_of(made, equation_of(made.truth) if equation == TRUE_EQUATION else equation)
    row = {'hull': hull, 'scene': scene_name, 'seed': seed, 'found': not isinstance(found, str)}
    if isinstance(found, str):
        return row | {'why': found}
    stiffness = sum(v for k, v in made.truth.items() if k in ('r1', 's1'))
    truths = made.truth if 'r1' not in found.model.terms else made.truth | {'r1': stiffness}
    terms = {}
    for name, value in found.model.terms.items():
        truth, std = truths.get(name), found.std[name]
        low, high = found.intervals[name]
        terms[name] = (value, std, truth, None if truth is None else bool(low <= truth <= high))
    return row | {
        'terms': terms,
        'motion': None if found.posterior is None else motion_held(made, found, np.radians(SCENES[scene_name].trim)),
        'late': found.records[0].segment.start - made.release,
        'r2': found.r2,
        'equation': found.model.equation.name,
        'period': found.model.natural_period,
        'true_period': 2 * np.pi / np.sqrt(stiffness),
        'level': found.verdict.level,
        'code': found.verdict.code,
    }


def motion_held(made, found, trim):
    """Share of the first two periods of the next release that its pointwise 95 % interval holds."""
    from swath_sysid.attitude.identification.fit_quality import drawn_releases, largest_releases

    start, away = largest_releases(found)[0], trim - found.model.trim
    time, drawn = drawn_releases(found.model, found.posterior, found.trim_std, start, found.problem.scales)
    early = (time > 0.0) & (time < 2.0 * found.model.natural_period)
    low, high = np.quantile(drawn[early, :-1], (0.025, 0.975), axis=1)
    truth = free_motion(made.truth, start - away, 0.0, time[early])[0] + away
    return float(np.mean((low <= truth) & (truth <= high)))


def show_default(rows, scenes):
    """How often the intervals of the linear restoring, and so of the period, and of the next release hold."""
    print('scene                 fits  r1 or period holds  >3 std  furthest  next release holds')
    for scene in scenes:
        fits = [r for r in rows if r['scene'] == scene and r['found']]
        off = np.array([abs(v - truth) / std for r in fits for v, std, truth, _ in [r['terms']['r1']]])
        hold = [r['terms']['r1'][-1] for r in fits]
        motion = [r['motion'] for r in fits]
        print(
            f'{scene:<22}{len(fits):>4} {np.mean(hold):>19.3f} {np.mean(off > 3):>7.3f} {off.max():>9.1f} '
            f'{np.mean(motion):>19.3f}'
        )


def show_intervals(rows, scenes):
    """How often the intervals hold, by scene and coefficient."""
    print('scene                 fits  hold  least of a coefficient   >5 std  furthest  median error')
    for scene in scenes:
        fits = [r for r in rows if r['scene'] == scene and r['found']]
        entries = [(r['hull'].split()[0], n, *t) for r in fits for n, t in r['terms'].items()]
        if not entries:
            continue
        hold = np.array([e[-1] for e in entries])
        off = np.array([abs(e[2] - e[4]) / e[3] for e in entries])
        names = {}
        for e in entries:
            names.setdefault(f'{e[0]} {e[1]}', []).append(e[-1])
        name, least = min(((n, np.mean(h)) for n, h in names.items()), key=lambda pair: pair[1])
        errors = [abs(e[2] - e[4]) / cramer_rao(e[0], e[1], fits) for e in entries]
        print(
            f'{scene:<22}{len(fits):>4} {hold.mean():>5.3f}  {least:.2f} {name:<22} {np.mean(off > 5):.3f} '
            f'{off.max():>8.1f} {np.median(errors):>8.2f}'
        )
    white = [r for r in rows if r['scene'] == 'white' and r['found']]
    if white:
        excess = {}
        for r in white:
            bound = BOUNDS[r['hull']]
            for name, (_, std, *_) in r['terms'].items():
                excess.setdefault(f'{r["hull"]} {name}', []).append(std / bound[name])
        print('white noise, std over the Cramer-Rao bound (median of the seeds):')
        print('  ' + ', '.join(f'{name} {np.median(ratio):.2f}' for name, ratio in excess.items()))


BOUNDS = {}


def cramer_rao(hull, name, fits):
    """The bound of a coefficient, the mean over the angles of release that were fitted."""
    for r in fits:
        BOUNDS.setdefault(r['hull'], None)
        BOUNDS[r['hull']] = BOUNDS[r['hull']] or cramer_rao_std(r['hull'])
    return np.mean([bound[name] for key, bound in BOUNDS.items() if bound and key.split()[0] == hull])


def show_releases(rows):
    """How many releases were found, and how late."""
    late = np.array([r['late'] for r in rows if r['found']])
    print(
        f'releases: {len(late)} of {len(rows)} found ({len(late) / len(rows):.3f}), within 30 ms '
        f'{np.mean(np.abs(late) <= 0.03):.3f}, 5 to 95 %: {1e3 * np.quantile(late, 0.05):.0f} to '
        f'{1e3 * np.quantile(late, 0.95):.0f} ms'
    )
    for key in sorted({(r['hull'], r['scene']) for r in rows}):
        some = [r for r in rows if (r['hull'], r['scene']) == key]
        off = [r for r in some if not r['found'] or abs(r['late']) > 0.03]
        if off:
            print(
                f'  {key}: {len(off)} of {len(some)}:',
                ', '.join('not found' if not r['found'] else f'{1e3 * r["late"]:.0f} ms' for r in off),
            )
    for why in sorted({r['why'] for r in rows if not r['found']}):
        print('  ', why[:150])


def show_verdicts(rows):
    """Whether wrong choices are called so."""
    fits = [r for r in rows if r['found']]
    wrong = [r for r in fits if is_wrong(r)]
    said = [r for r in wrong if r['level'] != 'adequate']
    print(f'verdicts: {len(fits)} fits, r1 or period off by more than 3 std in {len(wrong)}; said so in {len(said)}')
    right = [r for r in fits if not is_wrong(r)]
    if right:
        called = {level: sum(r['level'] == level for r in right) for level in ('adequate', 'doubtful', 'rejected')}
        print(f'  of the {len(right)} others: {called}')
        for scene in dict.fromkeys(r['scene'] for r in right):
            codes = [r['code'] for r in right if r['scene'] == scene]
            print(f'    {scene}:', {code: codes.count(code) for code in sorted(set(codes))})


def is_wrong(row):
    """Whether the linear restoring, or the period that follows from it, is more than 3 std off."""
    stiffness = [(v, s) for name, (v, s, *_) in row['terms'].items() if name in ('r1', 's1')]
    value, std = sum(v for v, _ in stiffness), max(s for _, s in stiffness)
    return abs(value - (2 * np.pi / row['true_period']) ** 2) > 3 * std


def main():
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--scenes', default=','.join(SCENES))
    parser.add_argument('--hulls', default=','.join(HULLS))
    parser.add_argument('--first', type=int, default=0, help='the first seed')
    parser.add_argument('--seeds', type=int, default=12, help='how many')
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--equation', default=TRUE_EQUATION)
    parser.add_argument('--rows', action='store_true', help='print every coefficient')
    given = parser.parse_args()
    scenes = given.scenes.split(',')
    seeds = range(given.first, given.first + given.seeds)
    tasks = [(h, s, k, given.equation) for s in scenes for h in given.hulls.split(',') for k in seeds]
    with ProcessPoolExecutor(given.jobs) as pool:
        rows = list(pool.map(judged, tasks, chunksize=4))
    if given.rows:
        for r in rows:
            print(
                r['scene'],
                r['hull'],
                r['seed'],
                r.get('equation'),
                r.get('level'),
                r.get('code'),
                *(f'{n} {v:.4g}+-{s:.2g}({t})' for n, (v, s, t, _) in r.get('terms', {}).items()),
            )
    if given.equation == TRUE_EQUATION:
        show_intervals(rows, scenes)
    elif given.equation == 'auto':
        show_default(rows, scenes)
    show_releases(rows)
    show_verdicts(rows)
    return 0


if __name__ == '__main__':
    sys.exit(main())
