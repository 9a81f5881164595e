"""Forecasts of a sensor without orientation: the moored buoy, and simulated craft whose gyroscope has a bias.

    OMP_NUM_THREADS=1 python benchmark/rates_alone.py
    OMP_NUM_THREADS=1 python benchmark/rates_alone.py --craft known --bias 0.3

For each axis and span of seconds: root mean square error over the standard deviation of the motion, the standard
deviation issued, likewise, and coverage of the 90 % intervals, of the angle that was taken away. The buoy keeps its
accelerations, and its own bias. Records are read from the folder that SWATH_SYSID_DATA names.
"""

import argparse

import numpy as np
from record_forecasts import buoy
from shocks import CRAFTS, motion_of_craft

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.pipeline.record_run import run_through

LEADS = 0.1, 0.5, 1.0, 2.0
SPANS = (0.0, 5.0), (5.0, 30.0), (30.0, 120.0), (120.0, 300.0), (300.0, 600.0)


def trial_of(craft, bias_deg):
    """The complete trial, 600 s long, with this bias of the rates of a simulated craft."""
    if craft == 'buoy':
        return buoy().between(0.0, SPANS[-1][1])
    motion = motion_of_craft(1, round(10.0 * SPANS[-1][1]))
    motion[:, len(AXES) :] += np.radians(bias_deg)
    return Trial(0.1 * np.arange(len(motion)), **dict(zip(ATTITUDE, motion.T, strict=True)))


def main() -> None:
    """Print a line for each craft, axis and span."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--craft', choices=CRAFTS, nargs='+', default=['buoy', 'unknown', 'known'])
    parser.add_argument('--bias', type=float, default=0.3, metavar='DEG_S')
    given = parser.parse_args()
    print(f'leads {LEADS} s; error | stated | held')
    for craft in given.craft:
        trial = trial_of(craft, given.bias)
        rates = {name: values for name, values in trial.channels.items() if name not in AXES}
        steps = run_through(Trial(trial.time, **rates), ForecasterSettings(LEADS), CRAFTS[craft]).steps
        stamps = np.array([step.stamp for step in steps])
        for place, axis in enumerate(AXES):
            truth = np.interp(stamps[:, None] + LEADS, trial.time, trial.channels[axis], right=np.nan)
            errors = np.array([step.forecast.angle(axis) for step in steps]) - truth
            deviations = np.array([step.forecast.deviation[:, place] for step in steps])
            size = trial.channels[axis].std()
            for begin, end in SPANS:
                now = (stamps >= begin) & (stamps < end) & np.isfinite(errors).all(axis=1)
                held = np.mean(np.abs(errors[now]) < 1.645 * deviations[now], axis=0)
                error = np.sqrt(np.mean(errors[now] ** 2, axis=0)) / size
                parts = (error, deviations[now].mean(axis=0) / size, held)
                texts = (' '.join(f'{value:5.2f}' for value in values) for values in parts)
                print(f'{craft:7} {axis:5} {begin:3.0f} to {end:3.0f} s | ' + ' | '.join(texts), flush=True)


if __name__ == '__main__':
    main()
