"""What the studies print, as it is printed; one YAML file a study beside this module."""

from dataclasses import dataclass, field
from importlib import resources

import yaml

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.common.errors import check_choice

DECAY_STUDIES = ('swath-pitch', 'swath-roll', 'hydrofoil-pitch', 'swath-usv-pitch')


@dataclass(frozen=True)
class PrintedTable:
    """A printed table or equation."""

    table: str  #: Which table of the study.
    draft_factor: float | None = None
    angle_deg: float | None = None
    rows: list = field(default_factory=list)
    ratios: dict = field(default_factory=dict)  #: Of the chosen equation, over the inertia.
    published_form: dict = field(default_factory=dict)  #: Of the chosen equation, with the inertia.


@dataclass(frozen=True)
class DecayPublication:
    """A study of free decays."""

    name: str
    title: str
    paper: str
    authors: str | None
    axis: str
    craft: dict  #: Particulars, by the keys of a manifest.
    equations: tuple  #: In the order of the study.
    chosen: str
    draft_powers: dict  #: Assumed: a ratio is proportional to the draft factor to this power, 0 where not listed.
    duration_s: float
    repeats: int
    objective: PrintedTable  #: Rows of draft_factor, angle_deg and values, rad/s.
    coefficients: PrintedTable
    figures: tuple
    claims: tuple
    next_step: PrintedTable | None = None  #: Rows of time, s, measured and identified rate, rad/s, and error, %.

    @property
    def printed_objective(self) -> dict[tuple[float, float], dict[str, float]]:
        """(draft factor, angle in deg) to equation to printed value, rad/s."""
        return {
            (row['draft_factor'], row['angle_deg']): dict(zip(self.equations, row['values'], strict=True))
            for row in self.objective.rows
        }

    @property
    def draft_factors(self) -> list[float]:
        """Of its records."""
        return sorted({factor for factor, _ in self.printed_objective})

    @property
    def out_of_order(self) -> tuple[tuple, ...]:
        """(draft factor, angle, larger, contained equation) where the larger equation has the larger value."""
        return tuple(
            (*place, big, small)
            for place, values in self.printed_objective.items()
            for big in values
            for small in values
            if big != small and EQUATIONS[big].contains(EQUATIONS[small]) and values[big] > values[small]
        )


def decay_publication(name: str) -> DecayPublication:
    """A study of free decays by its name."""
    check_choice(name, DECAY_STUDIES, 'paper')
    content = yaml.safe_load(resources.files(__package__).joinpath(f'{name}.yaml').read_text(encoding='utf-8'))
    tables = {key: PrintedTable(**content[key]) for key in ('objective', 'coefficients', 'next_step') if key in content}
    lists = {key: tuple(content[key]) for key in ('equations', 'figures', 'claims')}
    return DecayPublication(name, **{**content, **tables, **lists})
