"""The parameters of identifier."""
from swath_sysid.attitude.identification.identify import OBJECTIVES, IdentificationSettings
from swath_sysid.attitude.identification.refit import RefitSettings
from swath_sysid.attitude.identification.search import ALGORITHMS, SearchSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.parameter import DIAGNOSTICS, NodeParameter, Values, check

TABLE = (
    NodeParameter('axes', list(AXES), 'Axes to identify', choices=AXES),
    NodeParameter(
        'equation', 'odd-cubic',
        'Equation to fit: a name of the catalogue, or damping|restoring terms as in linear,quadratic|linear,cubic',
    ),
    NodeParameter('objective', 'simulation', 'What the fit minimises', choices=OBJECTIVES),
    NodeParameter('search', 'ga', 'Search algorithm', choices=ALGORITHMS),
    NodeParameter('generations', 0, "Generations of the search; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('population', 0, "Candidates a generation; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('seed', 1, 'Seed of the search', '', 0, 2**31 - 1),
    NodeParameter(
        'least_improvement', 0.001, 'A refit replaces the model if its residuals on the window are smaller by this '
        'part', '', 0.0, 0.9,
    ),
    NodeParameter('auto_identify', True, 'Refit whenever a window arrives'),
    NodeParameter(
        'window_service', 'imu_buffer/publish_window', 'Service that makes the buffer publish its window',
        read_only=True,
    ),
    NodeParameter('window_timeout_s', 2.0, 'How long ~/identify waits for the window', 's', 0.1, 60.0),
    NodeParameter(
        'model_path', '', 'Model file, read at the start if it exists and replaced whenever the model changes; '
        'empty: none', read_only=True,
    ),
    *DIAGNOSTICS,
)


def refit_settings(values: Values) -> RefitSettings:
    """Settings of identifier's core; raises `InputError` where a value is not allowed."""
    check(TABLE, values)
    identification = IdentificationSettings(
        equation=values['equation'] or None,
        objective=values['objective'],
        search=SearchSettings(
            algorithm=values['search'],
            generations=values['generations'] or None,
            population=values['population'] or None,
            seed=values['seed'],
        ),
    )
    equation = identification.chosen_equation
    if not equation.terms:
        raise InputError(f'the equation {equation.name} has no terms: name another')
    return RefitSettings(tuple(values['axes']), identification, values['least_improvement'])
