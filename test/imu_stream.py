"""IMU messages of simulated craft, as plain readings, for the tests of the pipeline."""

import numpy as np

from swath_sysid.attitude.motion.attitude import body_rates, quaternion
from swath_sysid.attitude.motion.intake import ImuReading

EPOCH_NS = 1_700_000_000 * 10**9
UNKNOWN = (0.0,) * 9
NOT_GIVEN = (-1.0,) + (0.0,) * 8
GRAVITY = (0.0, 0.0, 9.81)


def diagonal(variance):
    return (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)


def reading(stamp_ns, roll=0.0, pitch=0.0, roll_rate=0.0, pitch_rate=0.0, yaw=0.3, **changes):
    """The reading of a craft with these angles (rad) and Euler rates (rad/s)."""
    plain = ImuReading(
        stamp_ns,
        tuple(map(float, quaternion(roll, pitch, yaw))),
        diagonal(1e-6),
        tuple(map(float, body_rates(roll, pitch, roll_rate, pitch_rate, 0.0))),
        diagonal(2.5e-5),
        GRAVITY,
        UNKNOWN,
    )
    return plain._replace(**changes)


def released(time, release, amplitude=0.1, period=2.6, damping=0.08, hold=4.0):
    """Angle and rate of a craft that is pushed down within two seconds, held, and released; rad and rad/s.

    Released at zero or before, it is free from the start.
    """
    w = 2 * np.pi / period
    t = time - release
    if t < -hold - 2.0:
        return 0.0, 0.0
    if t < -hold:
        x = (t + hold + 2.0) / 2.0
        return amplitude * x * x * (3 - 2 * x), amplitude * 3 * x * (1 - x)
    if t < 0.0:
        return amplitude, 0.0
    fall, v = amplitude * np.exp(-damping * w * t), w * np.sqrt(1 - damping**2)
    return (fall * (np.cos(v * t) + damping * w / v * np.sin(v * t)), -fall * w * w / v * np.sin(v * t))


def decay_stream(rate=100.0, duration=40.0, release=8.0, axis='pitch', seed=1, first_ns=EPOCH_NS, **motion):
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (round(duration * rate), 2)) * (1e-3, 5e-3)
    for k, (angle_noise, rate_noise) in enumerate(noise.tolist()):
        angle, angle_rate = released(k / rate, release, **motion)
        yield reading(
            first_ns + round(k * 1e9 / rate), **{axis: angle + angle_noise, f'{axis}_rate': angle_rate + rate_noise}
        )
