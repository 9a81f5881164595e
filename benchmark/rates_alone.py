"""Forecasts of a sensor without orientation: the moored buoy, and simulated craft whose gyroscope has a bias.

    OMP_NUM_THREADS=1 python benchmark/rates_alone.py
    OMP_NUM_THREADS=1 python benchmark/rates_alone.py --craft known --bias 0.3

For each axis and span of seconds: root mean square error over the standard deviation of the motion, the standard
deviation issued, likewise, and coverage of the 90 % intervals, of the angle that was taken away. The buoy keeps its
accelerations, and its own bias. Records are read from the folder that SWATH_SYSID_DATA names.
"""

from typing import Annotated

import numpy as np
from record_forecasts import buoy
from shocks import CRAFTS, motion_of_craft

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.evaluation.cli.benchmark import Benchmark, LeadErrors, Line
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


def lines(
    *, craft: Annotated[str, CRAFTS] = ('buoy', 'unknown', 'known'), bias: Annotated[float, 'deg/s, of rates'] = 0.3
):
    """A line for each craft, axis and span."""
    yield f'leads {LEADS} s; error | stated | held'
    for name in craft:
        trial = trial_of(name, bias)
        rates = {channel: values for channel, values in trial.channels.items() if channel not in AXES}
        steps = run_through(Trial(trial.time, **rates), ForecasterSettings(LEADS), CRAFTS[name]).steps
        stamps = np.array([step.stamp for step in steps])
        for place, axis in enumerate(AXES):
            truth = np.interp(stamps[:, None] + LEADS, trial.time, trial.channels[axis], right=np.nan)
            errors = np.array([step.forecast.angle(axis) for step in steps]) - truth
            deviations = np.array([step.forecast.deviation[:, place] for step in steps])
            size, whole = trial.channels[axis].std(), np.isfinite(errors).all(axis=1)
            of_all = LeadErrors(stamps[whole], errors[whole], deviations[whole])
            for begin, end in SPANS:
                now = of_all.within(begin, end)
                figures = {'error': now.rms / size, 'stated': now.deviation.mean(axis=0) / size, 'held': now.held}
                yield Line(f'{name:7} {axis:5} {begin:3.0f} to {end:3.0f} s', figures)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
