"""Simulated records of sound sensors, of which none may be called wrong: the false alarms of the sensor checks.

Each has its own craft, sea or decay, sample rate (1 to 200 Hz), noise, resolution, gyroscope offset, and channels left
out. Faults are put into those with all channels, to see how many are found; a craft that hardly moves shows none of its
rates.

Run it as ``python benchmark/sensor_checks.py [--records 1000]``.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.cleaning import assemble_trial
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import ConvertedReading, CraftSample
from swath_sysid.attitude.motion.sensor_checks import Contradiction
from swath_sysid.evaluation.cli.benchmark import Benchmark

GRAVITY = 9.80665
FINE = 1e-4
RATES_HZ = 1.0, 2.0, 4.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0, 200.0
ANGLES, GYRO, FORCE = ('roll', 'pitch', 'yaw'), ('gyro_x', 'gyro_y', 'gyro_z'), ('accel_x', 'accel_y', 'accel_z')
CHANNELS = {
    'all': (*ANGLES, *GYRO, *FORCE),
    'no rates': (*ANGLES, *FORCE),
    'no accelerations': (*ANGLES, *GYRO),
    'no angles': (*GYRO, *FORCE),
    'heading only': ('roll', 'pitch', 'heading', 'heave'),
    'yaw rate only': ('roll', 'pitch', 'gyro_z'),
    'roll only': ('roll', 'gyro_x'),
    'roll and the other rate': ('roll', 'gyro_y', 'gyro_z'),
    'one acceleration': ('roll', 'pitch', 'gyro_x', 'gyro_y', 'accel_z'),
    'angles': ('roll', 'pitch'),
}


@dataclass(frozen=True)
class Record:
    """A simulated record: what it is, its time and its readings."""

    kind: str
    time: np.ndarray
    readings: dict[str, np.ndarray]


def in_waves(rng, time):
    """Yaw, pitch and roll, shape (N, 3), and accelerations of the sensor, in waves from calm to heavy."""
    height = 10.0 ** rng.uniform(-2.5, 0.3)
    period, width = rng.uniform(1.5, 12.0), rng.choice([0.03, 0.15, 0.35])
    angles, push = np.zeros((2, time.size, 3))
    angles += [rng.uniform(-np.pi, np.pi), *rng.normal(0.0, 0.03, 2)]
    for _ in range(12):
        w = 2.0 * np.pi / period * max(rng.normal(1.0, width), 0.2)
        shared = rng.uniform(0.0, 2.0 * np.pi)
        for column, size in enumerate((0.05, 0.12, 0.2)):
            phase = shared + rng.normal(0.0, 0.7)
            angles[:, column] += height * size * rng.rayleigh(0.25) * np.sin(w * time + phase)
        for column in range(3):
            push[:, column] += height * rng.rayleigh(0.3) * np.sin(w * time + rng.uniform(0.0, 2.0 * np.pi))
    return angles, push


def decaying(rng, time):
    """The same of a published hull that rests, and is released once or twice."""
    model = list(PUBLISHED_HULLS.values())[rng.integers(len(PUBLISHED_HULLS))].model
    column = 2 if model.axis == 'roll' else 1
    angles = np.zeros((time.size, 3)) + [rng.uniform(-np.pi, np.pi), 0.0, 0.0]
    angles[:, column] = model.trim
    for release in np.sort(rng.uniform(0.05, 0.8, rng.integers(1, 3))) * time[-1]:
        start, pulling = model.trim + np.radians(rng.uniform(1.0, 6.0)), rng.uniform(2.0, 5.0)
        before = angles[:, column].copy()
        share = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - release) / pulling + 1.0, 0.0, 1.0))
        angles[:, column] = before + share * (start - before)
        free = time > release
        angles[free, column] = simulate(model, start, 0.0, np.concatenate([[0.0], time[free] - release]))[0][1:]
    return angles, np.zeros((time.size, 3))


def resolved(values, step):
    return values if step == 0.0 else np.round(values / step) * step


def record(seed):
    """One record of a sound sensor."""
    rng = np.random.default_rng(seed)
    rate, duration = RATES_HZ[rng.integers(len(RATES_HZ))], rng.uniform(20.0, 240.0)
    motion = rng.choice(['waves', 'waves', 'decay'])
    time = np.arange(round(max(duration, 60.0 / rate) * rate)) / rate
    # body rates from rotations a moment apart
    both = np.sort(np.concatenate([time, time + FINE]))
    angles, push = (in_waves if motion == 'waves' else decaying)(rng, both)
    attitude = Rotation.from_euler('ZYX', angles)
    now, soon = attitude[::2], attitude[1::2]
    rates = (now.inv() * soon).as_rotvec() / FINE
    force = now.inv().apply(push[::2] + [0.0, 0.0, GRAVITY])
    noise = 10.0 ** rng.uniform(-5.0, -2.0), 10.0 ** rng.uniform(-4.0, -1.3), 10.0 ** rng.uniform(-3.0, -0.5)
    steps = (
        np.radians(rng.choice([0, 0.01, 0.1, 0.5])),
        np.radians(rng.choice([0, 0.01, 0.1, 0.5])),
        rng.choice([0, 0.01, 0.1]),
    )
    offset = rng.normal(0.0, np.radians(0.3), 3)
    parts = {}
    truth = np.column_stack([angles[::2, ::-1], rates + offset, force])
    for column, name in enumerate((*ANGLES, *GYRO, *FORCE)):
        kind = column // 3
        parts[name] = resolved(truth[:, column] + rng.normal(0.0, noise[kind], time.size), steps[kind])
    parts['heading'] = np.remainder(-parts['yaw'], 2.0 * np.pi)
    parts['heave'] = resolved(push[::2, 2], 0.01)
    if rng.random() < 0.3:
        lost = rng.random(time.size) < rng.uniform(0.0, 0.2)
        for name in ANGLES if rng.random() < 0.5 else GYRO:
            parts[name][lost] = np.nan
    channels = list(CHANNELS)[rng.integers(len(CHANNELS))]
    kept = {name: parts[name] for name in CHANNELS[channels]}
    return Record(f'{motion}, {rate:g} Hz, {channels}', time, kept)


def faults_of(simulated):
    """What the checks find in a record as a whole."""
    trial = assemble_trial(simulated.time, simulated.readings)
    return [each for each in trial.advice if isinstance(each, Contradiction)]


def faults_live(simulated):
    """What the checks find in the same record as it comes."""
    trial = assemble_trial(simulated.time, simulated.readings)
    unknown = np.full(trial.time.size, np.nan)
    names = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
    rows = np.column_stack([trial.channels.get(name, unknown) for name in names]).tolist()
    yaw_rate = trial.channels.get('yaw_rate', unknown).tolist()
    check, found = InstallationCheck(Installation()), {}
    for stamp, row, turning in zip((trial.time * 1e9).astype(int).tolist(), rows, yaw_rate, strict=True):
        check.add(ConvertedReading(CraftSample(stamp, *row, *[1e-6] * 4, 0.0, turning), ()))
        found |= {each.code: each for each in check.judge()}
    return list(found.values())


#: Sound readings made wrong, and the code that names it.
WRONG = {
    'rate-sign': lambda parts: {name: -parts[name] for name in GYRO},
    'rates-swapped': lambda parts: {'gyro_x': parts['gyro_y'], 'gyro_y': parts['gyro_x']},
    'rate-unit': lambda parts: {name: np.degrees(parts[name]) for name in GYRO},
    'rate-offset': lambda parts: {'gyro_x': parts['gyro_x'] + np.radians(20.0)},
    'accelerations-in-g': lambda parts: {name: parts[name] / GRAVITY for name in FORCE},
    'axes-of-sensor': lambda parts: {name: -parts[name] for name in FORCE[1:]},
}


def lines(*, records: int = 1000):
    """Each false alarm, then what is counted."""
    alarms, found, tried = Counter(), Counter(), Counter()
    for seed in range(records):
        sound = record(seed)
        for judged, faults in (('record', faults_of(sound)), ('live', faults_live(sound))):
            for each in faults:
                alarms[each.code] += 1
                yield f'{seed} {judged} ({sound.kind}): [{each.code}] {each.message}'
        if sound.kind.endswith('all'):
            for code, wrong in WRONG.items():
                faults = faults_of(Record(sound.kind, sound.time, {**sound.readings, **wrong(sound.readings)}))
                tried[code] += 1
                found[code] += any(each.code == code for each in faults)
                for other in {each.code for each in faults} - {code}:
                    found[f'{code} called {other}'] += 1
    yield f'{records} sound records: {sum(alarms.values())} false alarms {dict(alarms)}'
    yield (
        'faults put into those with all channels: '
        + ', '.join(f'{code} {found[code]} of {n}' for code, n in tried.items())
    )
    yield 'misnamed: ' + (', '.join(f'{what} {n}' for what, n in found.items() if ' ' in what) or 'none')


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
