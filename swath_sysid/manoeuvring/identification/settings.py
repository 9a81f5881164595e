"""Settings of an identification."""

from dataclasses import dataclass, field

from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.manoeuvring.hull.terms import INDEX
from swath_sysid.manoeuvring.identification.windows import LENGTH

AUTO, SHARED, NONE = 'auto', 'shared', 'none'
CURRENT_CHOICES = (AUTO, SHARED, NONE)


@dataclass(frozen=True)
class ManoeuvringSettings:
    """Settings of `identify_manoeuvring`.

    Raises:
        InputError: A value is not positive, or there is no such parameter or choice; the sentence names it.

    Example:
        >>> settings = ManoeuvringSettings(mass=180.0, lever=1.03, fixed={'Xu_dot': -18.0})
        >>> settings.window
        20.0
    """

    mass: float | None = None  #: kg, cargo included.
    inertia: float | None = None  #: Yaw inertia without added inertia, kg m^2.
    thrust_per_command: float | None = None  #: Thrust of one thruster at full command ahead, N.
    lever: float | None = None  #: Half the distance between the thrusters, m.
    length: float | None = None  #: Of the hulls, m.
    terms: tuple[str, ...] | None = None  #: Exactly these derivatives; None: the simplest adequate set.
    fixed: dict[str, float] = field(default_factory=dict)  #: Known parameters.
    #: Parameter to value and standard deviation of its regularisation.
    towards: dict[str, tuple[float, float]] = field(default_factory=dict)
    current: str = AUTO  #: ``auto`` (one for each of several runs with heading), ``shared`` (one for all), ``none``.
    window: float = LENGTH  #: Length of the windows, s.
    generations: int = 15  #: Of the genetic search for a start; 0: regression alone.
    population: int = 24  #: Of the genetic search.
    seed: int = 1

    def __post_init__(self):
        for name in ('mass', 'inertia', 'thrust_per_command', 'lever', 'length', 'window'):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < 1e9:
                raise InputError(f'{name} must be a positive number, not {value}')
        for name in (*(self.terms or ()), *self.fixed, *self.towards):
            check_choice(name, INDEX, 'manoeuvring parameter')
        check_choice(self.current, CURRENT_CHOICES, 'choice of the current')
        if self.generations < 0:
            raise InputError('generations must not be negative')
        if self.population < 8:
            raise InputError('population must be at least 8')
