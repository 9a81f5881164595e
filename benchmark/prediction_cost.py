"""Processor time of the predictor on a 100 Hz sensor in a sea: a plain sample, one with forecasts, a refit.

Run it with one thread for linear algebra, as the nodes' background does:
``OMP_NUM_THREADS=1 python benchmark/prediction_cost.py``.
"""
import time

import numpy as np

from swath_sysid.hull.catalogue import hull_named
from swath_sysid.prediction.ekf import runge_kutta_step
from swath_sysid.prediction.predictor import ImuSample, Predictor
from swath_sysid.prediction.waves import fit_waves

HULLS = {'roll': hull_named('swath-roll').model, 'pitch': hull_named('swath-pitch').model}


def sea(duration=60.0, dt=0.01, seed=0):
    """Samples of a craft in irregular waves."""
    rng = np.random.default_rng(seed)
    frequency = np.sort(rng.uniform(1.2, 6.0, 300))
    spectrum = frequency**-5 * np.exp(-1.25 * (2.5 / frequency) ** 4)
    amplitude = 0.25 * np.sqrt(2.0 * spectrum / spectrum.sum())
    phases = rng.uniform(0.0, 2.0 * np.pi, (2, frequency.size))
    time_s, columns = np.arange(0.0, duration, dt), []
    for hull, phase in zip(HULLS.values(), phases, strict=True):
        state, rows = (0.0, 0.0), []
        for now in time_s:
            rows.append(state)
            moment = float((amplitude * np.cos(frequency * (now + dt / 2.0) + phase)).sum())
            state = tuple(map(float, runge_kutta_step(hull.acceleration, *state, moment, dt)))
        columns.append(np.array(rows))
    angles = [c[:, 0] + rng.normal(0.0, 0.001, time_s.size) for c in columns]
    rates = [c[:, 1] + rng.normal(0.0, 0.004, time_s.size) for c in columns]
    directions = -np.sin(angles[1]), np.sin(angles[0]), np.ones_like(time_s)
    force = [9.81 * x + rng.normal(0.0, 0.05, time_s.size) for x in directions]
    return [ImuSample(*row) for row in np.column_stack([time_s, *angles, *rates, *force]).tolist()]


def measure(samples, models):
    """Processor seconds: plain samples, samples with forecasts, refits."""
    predictor, plain, issued, refits = Predictor(), [], [], []
    for axis, model in models.items():
        predictor.set_model(axis, model)
    for sample in samples:
        begun = time.process_time()
        step = predictor.observe(sample)
        (issued if step.forecast else plain).append(time.process_time() - begun)
        if step.refit:
            begun = time.process_time()
            predictor.install(fit_waves(step.refit))
            refits.append(time.process_time() - begun)
    return plain, issued, refits


def main():
    """Print the table."""
    samples = sea()
    measure(samples[:1500], HULLS)
    print('models   sample, us   with forecast, us   all samples: median, us   mean, us   refit at most, ms')
    for models in ({}, HULLS):
        plain, issued, refits = measure(samples, models)
        both = plain + issued
        print(
            f'{"both" if models else "none":6s} {1e6 * np.median(plain):12.0f} {1e6 * np.median(issued):19.0f} '
            f'{1e6 * np.median(both):25.0f} {1e6 * np.mean(both):10.0f} {1e3 * max(refits):19.0f}'
        )


if __name__ == '__main__':
    main()
