"""From the parameters of identifier to the settings of the core."""

from swath_sysid.attitude.identification.refit import RefitSettings
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.identification.stability_watch import StabilitySettings
from swath_sysid.nodes.parameters.table import Values, check


def refit_settings(values: Values) -> RefitSettings:
    """Settings of identifier's core; raises `InputError` where a value is not allowed."""
    check('identifier', values)
    identification = IdentificationSettings(
        equation=values['equation'],
        objective=values['objective'],
        search=SearchSettings(
            algorithm=values['search'],
            generations=values['generations'] or None,
            population=values['population'] or None,
            seed=values['seed'],
        ),
    )
    stability = StabilitySettings(values['stability_limit'], values['known_gm_m'])
    return RefitSettings(tuple(values['axes']), identification, stability)
