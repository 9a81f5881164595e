"""Simulated twin-thruster craft with the vices of real ones: a simulator that shares nothing with the package.

Newton's equations in body axes x forward, y port, z up, world x east and y north; classical Runge-Kutta at 20 Hz, all
runs side by side. Thrusters have a curve, a lag and a delay; gusts push (first-order Gauss-Markov); the water drifts;
the compass deviates by its course; the sensor stands off the centre. What is recorded is at 10 Hz.
"""

from dataclasses import dataclass, replace

import numpy as np

STEP, EVERY = 0.05, 2
G = 9.81


@dataclass(frozen=True)
class Craft:
    """Coefficients of a craft, SI; forces that are not listed are zero.

    ``x``, ``y``, ``n``: functions of u, v, r through the water that give the hull's forces and moment.
    """

    mass: float
    inertia: float
    lever: float
    length: float
    added: tuple  # of surge, sway, yaw: positive
    x: object
    y: object
    n: object
    centre: float = 0.0  # of gravity, ahead of the origin
    full_thrust: float = 1.0
    exponent: float = 1.0
    reverse_ratio: float = 1.0
    lag: float = 0.2
    delay: float = 0.1
    gusts: tuple = (0.0, 0.0, 0.0)
    gust_time: float = 8.0
    current: tuple = (0.0, 0.0)
    deviation: tuple = (0.0, 0.0)
    sensor: tuple = (0.0, 0.0)
    noise: tuple = (0.03, 0.002, 0.005, 0.05)  # speeds, yaw rate, heading, position
    logs: str = 'force'


def catamaran(**changes):
    """1.2 m, 26 kg: a thrust curve, a deviating compass, a sensor aside, a drift and gusts."""
    craft = Craft(
        mass=26.0,
        inertia=4.0,
        lever=0.4,
        length=1.2,
        added=(2.5, 22.0, 3.0),
        x=lambda u, v, r: -7.0 * u - 11.0 * abs(u) * u + 20.0 * v * r,
        y=lambda u, v, r: -22.0 * v - 60.0 * abs(v) * v - 4.0 * u * r,
        n=lambda u, v, r: -6.0 * r - 6.0 * abs(r) * r - 5.0 * u * u * r,
        full_thrust=28.0,
        exponent=1.3,
        reverse_ratio=1.17,
        gusts=(1.0, 1.5, 0.4),
        current=(0.16, -0.12),
        deviation=(0.1, -0.098),
        sensor=(0.1, 0.35),
    )
    return replace(craft, **changes)


def otter(munk=0.0, **changes):
    """Otter of 2 m with 25 kg of payload: coefficients of otter.py in T. I. Fossen's Python Vehicle Simulator.

    Surge, sway and yaw of it (https://github.com/cybergalactic/PythonVehicleSimulator, commit c717e07 of 2025-05-13;
    Fossen 2021): cross-flow drag by strips (Hoerner's coefficient at the pontoon's beam over twice its draught), time
    constants of 1 s in sway and yaw and of 0.1 s of the propellers (1 s, and no linear sway damping, until commit
    61a8f41 of 2024-03-11). ``munk`` is the share of the Munk moment: none, as that file offers for stability and as
    it was until then; with all of it the craft does not keep its course beyond 1.2 m/s.
    """
    hull, payload, length, lever = 55.0, 25.0, 2.0, 0.395
    mass = hull + payload
    centre = (hull * 0.2 + payload * 0.05) / mass
    about_origin = hull * ((0.25 * length) ** 2 + centre**2) + payload * 0.05**2
    inertia = about_origin + mass * centre**2
    surge_added, sway_added, yaw_added = 0.1 * hull, 1.5 * hull, 1.7 * about_origin
    surge, turn = 24.4 * G / (6.0 * 0.5144), inertia + yaw_added
    draught = mass / 1025.0 / (2.0 * 0.4 * 0.25 * length)
    strips = np.linspace(-0.5 * length, 0.5 * length, 21)

    def drag(v, r, arm):
        local = np.asarray(v)[..., None] + strips * np.asarray(r)[..., None]
        return -0.5 * 1026.0 * draught * 1.004 * (length / 20.0) * np.sum(np.abs(local) * local * strips**arm, axis=-1)

    craft = Craft(
        mass=mass,
        inertia=inertia,
        lever=lever,
        length=length,
        added=(surge_added, sway_added, yaw_added),
        centre=centre,
        x=lambda u, v, r: -surge * u + sway_added * v * r,
        y=lambda u, v, r: drag(v, r, 0) - (mass + sway_added) * v - surge_added * u * r,
        n=lambda u, v, r: drag(v, r, 1) - turn * (1.0 + 10.0 * abs(r)) * r - munk * (sway_added - surge_added) * u * v,
        full_thrust=0.5 * 24.4 * G,
        exponent=1.0,
        lag=0.1,
        delay=0.0,
        gusts=(0.0, 0.0, 0.0),
        current=(0.2, 0.15),
    )
    if changes.get('logs') == 'command':
        # shaft speed: thrust by its square, k_neg / k_pos astern
        changes = {'exponent': 2.0, 'reverse_ratio': 0.01289 / 0.02216, **changes}
    return replace(craft, **changes)


def unstable_hull(rng):
    """A random hull that turns off its course by itself."""
    mass, length = rng.uniform(20.0, 200.0), rng.uniform(1.2, 4.0)
    radius = 0.28 * length
    full = mass * rng.uniform(0.6, 1.2)
    top = rng.uniform(1.2, 2.2)
    inertia = mass * radius**2
    munk = rng.uniform(0.5, 0.9) * mass
    sway = mass * rng.uniform(0.3, 0.8)
    turning = inertia * rng.uniform(0.4, 0.9)
    return Craft(
        mass=mass,
        inertia=inertia,
        lever=0.2 * length,
        length=length,
        added=(0.08 * mass, 0.8 * mass, 0.5 * inertia),
        x=lambda u, v, r: -0.3 * 2.0 * full / top * u - 0.7 * 2.0 * full / top**2 * abs(u) * u + 0.8 * mass * v * r,
        y=lambda u, v, r: -sway * v - 2.0 * sway * abs(v) * v - 0.08 * mass * u * r,
        n=lambda u, v, r: -turning * r - 2.0 * turning * abs(r) * r - munk * u * v,
        full_thrust=full,
        gusts=(0.01 * full, 0.01 * full, 0.002 * full * length),
        noise=(0.02, 0.002, 0.005, 0.05),
    )


def thrusts(craft, inputs):
    """Steady thrust of inputs from -1 to 1, N."""
    return craft.full_thrust * np.where(inputs < 0.0, -craft.reverse_ratio, 1.0) * np.abs(inputs) ** craft.exponent


def simulate(craft, inputs, seed):
    """Records of a craft under inputs.

    Parameters
    ----------
    craft : Craft
    inputs : list of ndarray, shape (N_k, 2)
        Port and starboard from -1 to 1, every `STEP` seconds.
    seed : int

    Returns
    -------
    list of dict
        Columns of each run at 10 Hz: time, port, starboard, surge, sway, yaw_rate, heading, x, y.
    """
    rng = np.random.default_rng(seed)
    count, longest = len(inputs), max(len(i) for i in inputs)
    command = np.zeros((longest, 2, count))
    for k, rows in enumerate(inputs):
        command[: len(rows), :, k] = rows
    late = round(craft.delay / STEP)
    arriving = np.concatenate([np.zeros((late, 2, count)), thrusts(craft, command)])[:longest]
    keep = np.exp(-STEP / craft.gust_time)
    gust = np.array(craft.gusts)[:, None] * rng.standard_normal((3, count))
    state = np.zeros((6, count))
    state[3] = rng.uniform(-np.pi, np.pi, count)
    thrust, rows = np.zeros((2, count)), []
    (surge_added, sway_added, yaw_added), m, c = craft.added, craft.mass, craft.mass * craft.centre
    masses = np.linalg.inv([[m + surge_added, 0, 0], [0, m + sway_added, c], [0, c, craft.inertia + yaw_added]])
    east, north = craft.current

    def slope(s, push):
        u, v, r, psi = s[:4]
        forces = (
            np.stack(
                [
                    craft.x(u, v, r) + m * v * r + c * r * r + push[0] + push[1],
                    craft.y(u, v, r) - m * u * r,
                    craft.n(u, v, r) - c * u * r + craft.lever * (push[1] - push[0]),
                ]
            )
            + gust
        )
        cosine, sine = np.cos(psi), np.sin(psi)
        return np.concatenate([masses @ forces, [r, u * cosine - v * sine + east, u * sine + v * cosine + north]])

    for k in range(longest):
        rows.append(state)
        behind, half = thrust - arriving[k], np.exp(-0.5 * STEP / max(craft.lag, 1e-3))
        middle, end = arriving[k] + behind * half, arriving[k] + behind * half**2
        k1 = slope(state, thrust)
        k2 = slope(state + 0.5 * STEP * k1, middle)
        k3 = slope(state + 0.5 * STEP * k2, middle)
        k4 = slope(state + STEP * k3, end)
        thrust = end
        state = state + STEP / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        fresh = np.array(craft.gusts)[:, None] * rng.standard_normal((3, count))
        gust = keep * gust + np.sqrt(1.0 - keep**2) * fresh
    states = np.array(rows)
    return [_recorded(craft, states[: len(i) : EVERY, :, k], i[::EVERY], rng) for k, i in enumerate(inputs)]


def _recorded(craft, states, inputs, rng):
    u, v, r, psi, x, y = states.T
    ahead, aside = craft.sensor
    cosine, sine = np.cos(psi), np.sin(psi)
    east = (u - r * aside) * cosine - (v + r * ahead) * sine + craft.current[0]
    north = (u - r * aside) * sine + (v + r * ahead) * cosine + craft.current[1]
    b, c = craft.deviation
    heading = psi.copy()
    for _ in range(3):
        heading = psi + b * np.sin(heading) + c * np.cos(heading)
    speed, rate, angle, place = craft.noise

    def noisy(values, std):
        return values + std * rng.standard_normal(values.size)

    scale = craft.full_thrust if craft.logs == 'force' else 1.0
    return {
        'time': STEP * EVERY * np.arange(len(r)),
        'port': scale * inputs[:, 0],
        'starboard': scale * inputs[:, 1],
        'surge': noisy(east * np.cos(heading) + north * np.sin(heading), speed),
        'sway': noisy(-east * np.sin(heading) + north * np.cos(heading), speed),
        'yaw_rate': noisy(r, rate),
        'heading': noisy(heading, angle),
        'x': noisy(x + ahead * cosine - aside * sine, place),
        'y': noisy(y + ahead * sine + aside * cosine, place),
    }


def drives(seed, spins=True, every=1):
    """Inputs of sixteen runs of 40 to 300 s as people drive: eight to identify from and eight to validate on.

    The second of each eight is one of spins in place where asked. With ``every`` at `EVERY` inputs change at recorded
    samples only, as loggers have it that write each command.
    """
    rng = np.random.default_rng(1000 + seed)
    runs = []
    for k in range(16):
        duration, rows = (rng.uniform(40.0, 300.0) if k % 8 else 300.0), []
        spin = spins and k == 1
        if spin:
            duration = 60.0
        while len(rows) * STEP < duration:
            hold = rng.uniform(2.0, 15.0)
            if spin:
                turn = rng.choice([-1.0, 1.0]) * rng.uniform(0.9, 1.0)
                pair = (-turn * rng.uniform(0.8, 1.0), turn)
            else:
                kind = rng.uniform()
                mean = rng.uniform(0.15, 0.95) if kind < 0.85 else rng.uniform(-0.6, 0.2)
                turn = rng.choice([0.0, 1.0, -1.0]) * rng.uniform(0.03, 0.2)
                pair = (mean - turn, mean + turn)
            rows += [np.clip(pair, -1.0, 1.0)] * (every * round(hold / STEP / every))
        runs.append(np.array(rows[: round(duration / STEP)]))
    return runs
