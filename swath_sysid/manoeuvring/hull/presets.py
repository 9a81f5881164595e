"""Ready-made craft: the simulated WAM-V 16 of the public VRX simulator (PAPERS E)."""

from swath_sysid.common.errors import check_choice
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel, parameter_values

WAMV_LENGTH = 4.88  #: m (16 feet).
WAMV_LEVER = 1.027135  #: m, half the distance between the thrusters of the simulated WAM-V 16.


def _wamv(name: str, largest: float, **derivatives: float):
    values = parameter_values(dict(m=180.0, Iz=446.0, lever=WAMV_LEVER, **derivatives))
    return ManoeuvringModel(values, name=name, length=WAMV_LENGTH, largest_input=largest)


#: VRX until 2023 and since; the largest input gives 1.7 and 1.5 m/s.
PRESETS = {
    model.name: model
    for model in (
        _wamv('wamv-vrx-old', 150.0, Xu=-51.3, Xuu=-72.4, Yv=-40.0, Nr=-400.0),
        _wamv('wamv-vrx-new', 250.0, Xu=-100.0, Xuu=-150.0, Yv=-100.0, Yvv=-100.0, Nr=-800.0, Nrr=-800.0),
    )
}


def preset(name: str) -> ManoeuvringModel:
    """The ready-made craft of that name."""
    check_choice(name, PRESETS, 'craft')
    return PRESETS[name]
