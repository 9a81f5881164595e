"""The parameters of identifier."""

from swath_sysid.attitude.hull.catalogue import AUTO
from swath_sysid.attitude.identification.identify import OBJECTIVES, IdentificationSettings
from swath_sysid.attitude.identification.refit import RefitSettings
from swath_sysid.attitude.identification.search import ALGORITHMS, SearchSettings
from swath_sysid.attitude.identification.stability_watch import StabilitySettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.nodes.parameters.parameter import DIAGNOSTICS, WORKER, NodeParameter, Values, check

TABLE = (
    NodeParameter('axes', list(AXES), 'Axes to identify', choices=AXES),
    NodeParameter(
        'equation',
        AUTO,
        'Equation to fit: a name of the catalogue, or damping|restoring terms as in linear,quadratic|linear,cubic; '
        'auto: every term, then those that the decay does not show are left out',
    ),
    NodeParameter('objective', 'simulation', 'What the fit minimises', choices=OBJECTIVES),
    NodeParameter('search', 'ga', 'Search algorithm', choices=ALGORITHMS),
    NodeParameter('generations', 0, "Generations of the search; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('population', 0, "Candidates a generation; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('seed', 1, 'Seed of the search', '', 0, 2**31 - 1),
    NodeParameter('auto_identify', True, 'Fit the axis of a free decay when imu_buffer has noticed that one has ended'),
    NodeParameter(
        'identify_interval_s',
        0.0,
        'Identify so often by itself, so that the stability is watched; window_s of '
        'imu_buffer as long, and at least 300 s; 0: only when asked',
        's',
        0.0,
        86400.0,
        read_only=True,
    ),
    NodeParameter(
        'stability_limit',
        0.0,
        'Relative change of the metacentric height that is warned of, as in 0.1; 0: only one beyond chance',
        '',
        0.0,
        1.0,
    ),
    NodeParameter(
        'known_gm_m',
        0.0,
        'Metacentric height at the start, by an inclining test, with which the relative one becomes '
        'absolute; 0: not known',
        'm',
        0.0,
        1000.0,
    ),
    NodeParameter(
        'window_service',
        'imu_buffer/publish_window',
        'Service that makes the buffer publish its window',
        read_only=True,
    ),
    NodeParameter('window_timeout_s', 2.0, 'How long ~/identify waits for the window', 's', 0.1, 60.0),
    NodeParameter(
        'model_path',
        '',
        'Model file, read at the start if it exists and replaced whenever the model changes; empty: none',
        read_only=True,
    ),
    *WORKER,
    *DIAGNOSTICS,
)


def refit_settings(values: Values) -> RefitSettings:
    """Settings of identifier's core; raises `InputError` where a value is not allowed."""
    check(TABLE, values)
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
