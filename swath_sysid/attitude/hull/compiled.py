"""The terms of a hull's equation and one step of its motion, compiled once for all who integrate it."""

from swath_sysid.attitude.hull import terms
from swath_sysid.attitude.motion.attitude import Value
from swath_sysid.common.accelerator import accelerated

damping_moment = accelerated(terms.damping_moment)
restoring_moment = accelerated(terms.restoring_moment)
damping_slope = accelerated(terms.damping_slope)
restoring_slope = accelerated(terms.restoring_slope)
term_moments = accelerated(terms.term_moments)


@accelerated
def motion_step(
    x: Value, rate: Value, moment: float, step: float, ratios: Value, active: tuple[bool, ...], friction_rate: float
) -> tuple[Value, Value, Value]:
    """A Runge-Kutta step, s, under a held moment, rad/s^2: the acceleration before it, angle and rate after it."""
    half, sixth = 0.5 * step, step / 6.0
    a1 = moment - damping_moment(rate, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
    w2 = rate + half * a1
    a2 = moment - damping_moment(w2, ratios, active, friction_rate) - restoring_moment(x + half * rate, ratios, active)
    w3 = rate + half * a2
    a3 = moment - damping_moment(w3, ratios, active, friction_rate) - restoring_moment(x + half * w2, ratios, active)
    w4 = rate + step * a3
    a4 = moment - damping_moment(w4, ratios, active, friction_rate) - restoring_moment(x + step * w3, ratios, active)
    return a1, x + sixth * (rate + 2.0 * (w2 + w3) + w4), rate + sixth * (a1 + 2.0 * (a2 + a3) + a4)
