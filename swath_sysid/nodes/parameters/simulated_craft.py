"""From the parameters of simulated_craft to the settings of the core."""

from math import radians

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import CraftSettings, SensorNoise, release_angle
from swath_sysid.nodes.parameters.table import Values, check

#: What a small attitude sensor shows at rest at 100 Hz; the published trials were noisier, up to five times.
MEMS_NOISE = SensorNoise(angle=0.0005, rate=0.003, acceleration=0.02)


def craft_settings(values: Values) -> CraftSettings:
    """Settings of simulated_craft's core; raises `InputError` where a value is not allowed."""
    check('simulated_craft', values)
    model = hull_named(values['hull']).model
    angle = radians(values['angle_deg']) or release_angle(model)
    return CraftSettings(model, angle, noise=MEMS_NOISE, seed=values['noise_seed'], sea=radians(values['sea_deg']))
