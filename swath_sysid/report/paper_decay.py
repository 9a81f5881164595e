"""The page of a study of free decays: its tables and figures in its order, printed and obtained side by side."""
import math

import matplotlib
import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.identification.forecast_check import next_step
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.campaign.papers.decay_study import COEFFICIENTS, DRAFT_FACTORS, DRAFT_POWERS, SWARM
from swath_sysid.report.campaign_figures import HEIGHT, LINE_STYLES, STYLE, WIDTH, Drawing, legend_below
from swath_sysid.report.campaign_page import bullets, figures, inline, page, paragraph, section, svg_of, table_as_html
from swath_sysid.report.campaign_tables import Column, Table, digits
from swath_sysid.report.figures import MEASURED, MODEL, RESIDUAL, SERIES, new_figure, quiet

TWO_STD = 2.0
STEADY = 0.2
"""A curve that changes by less than this share of its largest value hardly changes."""

ROUNDING = 1e-9
"""Ratios to inertia below this are zero, to the rounding of a search."""

GENETIC, OURS, HULL = 'genetic', 'ours', 'hull'
BY = {GENETIC: "the study's method", OURS: 'the simulated motion'}


def decay_page(study, wall_s):
    """HTML of a study carried out again.

    Parameters
    ----------
    study : DecayStudy
    wall_s : float

    Returns
    -------
    str
    """
    p = study.publication
    sections = [
        ('short', 'In short', [bullets(_in_short(study, wall_s))]),
        ('trials', 'Model and trials', [table_as_html(_particulars(study)), paragraph(_how_simulated(study), 'note')]),
        ('method', 'Equations and search', [table_as_html(_equations(study)), table_as_html(_search(study))]),
        ('decays', 'Decays', _drawn(study, 'decays')),
        ('objective', 'Objective values', [table_as_html(_objective(study)), *_drawn(study, 'objective')]),
        ('chosen', 'The chosen equation', [table_as_html(_coefficients(study))]),
        ('motion', 'Measured and identified motion', _drawn(study, 'motion')),
        ('next-step', 'One step ahead', [table_as_html(_next_step(study))] if p.next_step else []),
        ('angle', 'Coefficients', [*_drawn(study, 'against-angle'), *_drawn(study, 'coefficients')]),
        ('conclusions', 'Conclusions', [table_as_html(_claims(study))]),
        ('limits', 'What cannot come out, and why', [bullets(_limits(study))]),
    ]
    body = [section(*parts) for parts in sections]
    links = [(anchor, name) for (anchor, name, _), text in zip(sections, body, strict=True) if text]
    return page(f'{p.title}: the study and its repetition', [text for text in body if text], links)


# --- numbers ---------------------------------------------------------------------------------------------------------


def coefficient(study, record, name, by):
    """A printed coefficient of one record, with the study's inertia given.

    Parameters
    ----------
    study : DecayStudy
    record : StudiedRecord
    name : str
        N, W, x, C1 to C3, or I', which only the search has.
    by : str
        ``genetic``, ``ours`` or ``hull``: what was simulated.

    Returns
    -------
    value, std : float
        NaN where the equation has none.
    """
    nothing = float('nan'), float('nan')
    if name == "I'":
        return (study.chosen(record).genetic.inertia, float('nan')) if by == GENETIC else nothing
    if by == OURS:
        terms = {t: record.ours.ratio(t) for t in record.ours.terms}
    else:
        ratios = record.hull.terms if by == HULL else study.chosen(record).genetic.ratios
        terms = {t: (value, float('nan')) for t, value in ratios.items()}
    for term, (value, std) in terms.items():
        printed, factor = COEFFICIENTS[term]
        if printed == name:
            return value * study.inertia * factor, std * study.inertia * factor
    return nothing


def coefficient_names(study):
    """Names of the coefficients of the chosen equation, as the study orders them."""
    used = {COEFFICIENTS[t][0] for t in equation_named(study.publication.chosen).terms}
    return [name for name in ('N', 'W', 'x', 'C1', 'C2', 'C3') if name in used]


def trend_of(values):
    """``falls``, ``rises``, ``steady`` or ``neither`` of values along a curve."""
    values = np.asarray(values, dtype=float)
    if np.ptp(values) <= STEADY * np.abs(values).max():
        return 'steady'
    steps = np.diff(values)
    return 'falls' if (steps <= 0.0).all() else 'rises' if (steps >= 0.0).all() else 'neither'


def next_step_errors(study, record, ratios):
    """Relative errors of the rate one step ahead where the study looks, or where it turns fastest; shape (N,).

    ``ratios`` None: of the rate that stays as it is.
    """
    checked = _next_steps(study, record, ratios)
    return np.abs(checked[2] - checked[1]) / np.abs(checked[1])


def _next_steps(study, record, ratios):
    """Time since release, measured and predicted rate at the times that the study prints."""
    motion = record.problem.motions[0]
    model = record.hull.with_trim(record.problem.states[0].trim)
    found = next_step(model.from_terms(equation_named(study.publication.chosen), ratios or {}, trim=model.trim), motion)
    predicted = found.predicted if ratios else motion.rate[:-1]
    since = found.time - motion.time[0]
    times = [row[0] for row in study.publication.next_step.rows]
    at = [int(np.argmin(np.abs(since - t))) for t in times]
    return since[at], found.measured[at], predicted[at]


def _check_record(study):
    printed = study.publication.next_step
    return study.at(printed.draft_factor, printed.angle_deg)


# --- tables ----------------------------------------------------------------------------------------------------------


def _in_short(study, wall_s):
    p, records = study.publication, study.records
    pairs = sum(
        big != small and equation_named(big).contains(equation_named(small))
        for big in p.equations for small in p.equations
    ) * len(records)  # fmt: skip
    beyond = max(s.genetic.value / s.exact.value - 1.0 for r in records for s in r.searched.values())
    inside = [
        abs(value - r.hull.terms[t]) <= TWO_STD * std
        for r in records for t, (value, std) in ((t, r.ours.ratio(t)) for t in r.ours.terms) if std > 0.0
    ]  # fmt: skip
    printed = [min(v.values()) for v in p.printed_objective.values()]
    obtained = [study.chosen(r).genetic.value for r in records]
    ratio = np.median(np.array(obtained) / printed)
    return [
        f'{len(records)} records of {p.repeats} repeat(s) each, {len(p.equations)} equations: searched with the ranges '
        f'and the budget of the study by genetic algorithm and by particle swarm, and fitted by the simulated motion; '
        f'{wall_s:.0f} s.',
        f'The objective values come out at {ratio:.2f} of the printed ones (median): they are the noise of the rate, '
        f'one step ahead, whatever the equation.',
        f'In the printed table an equation is worse than one that it contains in {len(p.out_of_order)} of {pairs} '
        f'comparisons, which no converged search can be. Here the genetic search ends within '
        f'{100.0 * max(beyond, 1e-8):.1g} % of the exact optimum, found by bounded least squares, everywhere.',
        f'The simulated motion brings back the hull: {sum(inside)} of {len(inside)} ratios within two standard '
        f'deviations. The objective of the study does not: {_bias(study)}.',
    ]


def _bias(study):
    shares = [study.chosen(r).exact.ratios['b1'] / r.hull.terms['b1'] for r in study.records]
    return f'its linear damping is {np.median(shares):.3g} times that of the hull (median of the records)'


NAMES = {
    'length_m': 'length [m]', 'beam_m': 'breadth [m]', 'depth_m': 'depth [m]', 'draft_m': 'draft [m]',
    'displacement_kg': 'displacement [kg]',
}  # fmt: skip


def _particulars(study):
    p = study.publication
    angles = sorted({r.angle_deg for r in study.records})
    rows = [(NAMES[key], f'{value:g}') for key, value in p.craft.items() if key in NAMES]
    rows += [
        ('released from [deg]', ', '.join(f'{a:g}' for a in angles)),
        ('at draft factors', ', '.join(f'{f:g}' for f in DRAFT_FACTORS)),
        ('repeats, the best kept', str(p.repeats)),
        ('recorded [s]', f'{p.duration_s:g}'),
    ]
    return Table('particulars', p.craft['name'], 'As printed.', (Column('what'), Column('value')), tuple(rows))


def _how_simulated(study):
    powers = ', '.join(f'{t} by the power {DRAFT_POWERS[t]:g}' for t in equation_named(study.publication.chosen).terms)
    return (
        'The measured records were not published. Here they are simulated: the printed hull, with the same ratios at '
        'every angle; white noise of the rate, the printed objective value of each record over the square root of two; '
        f'of the angle, 0.001 rad; 100 Hz. How the ratios follow the draft is assumed: {powers}.'
    )


def _equations(study):
    rows = tuple((e, ' '.join(equation_named(e).terms)) for e in study.publication.equations)
    note = 'b: damping over inertia, linear, quadratic, cubic; r: restoring over inertia; s: sine and sine squared.'
    return Table('equations', 'Equations', note, (Column('equation'), Column('terms')), rows)


def _search(study):
    preset = PRESETS[study.publication.name]
    g = preset.genetic
    rows = (
        ('generations', g.generations, SWARM['generations']), ('population', g.population, SWARM['population']),
        ('crossover', g.crossover, None), ('mutation', g.mutation, None), ('last mutation', g.final_mutation, None),
        ('genetic factor', g.genetic_factor, None), ('evolution weight', g.evolution_weight, None),
        ("range of I'", f'0 to {preset.inertia:g}', f'0 to {preset.inertia:g}'),
        ('range of N and W', f'0 to {preset.damping:g}', f'0 to {preset.damping:g}'),
        ('range of x, C1, C2, C3', f'0 to {preset.restoring:g}', f'0 to {preset.restoring:g}'),
    )  # fmt: skip
    shown = Column('genetic algorithm', _plain), Column('particle swarm', _plain)
    note = 'Genetic algorithm: as printed. Particle swarm: the same ranges, stopped when it stagnates.'
    return Table('search', 'Search', note, (Column('setting'), *shown), rows)


def _plain(value):
    return '-' if value is None else f'{value:g}' if isinstance(value, float) else str(value)


def _objective(study):
    p = study.publication
    rows, marks = [], {}
    for record in study.records:
        printed = p.printed_objective[record.draft_factor, record.angle_deg]
        kinds = {
            'printed': [printed[e] for e in p.equations],
            'genetic': [record.searched[e].genetic.value for e in p.equations],
            'swarm': [record.searched[e].swarm.value for e in p.equations],
            'least possible': [record.searched[e].exact.value for e in p.equations],
        }
        for kind, values in kinds.items():
            marks |= {(len(rows), 3 + k): 'best' for k, v in enumerate(values) if v <= min(values) * (1.0 + 1e-7)}
            rows.append((f'{record.angle_deg:g} deg', f'{record.draft_factor:g} T', kind, *values))
    columns = (Column('from'), Column('at'), Column('value'), *(Column(e, digits(7)) for e in p.equations))
    note = (
        f'{p.objective.table[0].upper()}{p.objective.table[1:]}, rad/s; the least of a row is marked, with all that '
        'equal it to 1e-7. Printed: with its own records; the others: with those simulated here.'
    )
    return Table('objective', 'Objective values by equation, angle and draft', note, columns, tuple(rows), marks)


def _coefficients(study):
    printed = study.publication.coefficients
    record = study.at(printed.draft_factor, printed.angle_deg)
    inertia = study.inertia
    rows = []
    chosen = study.chosen(record)
    for term in equation_named(study.publication.chosen).terms:
        name, factor = COEFFICIENTS[term]
        given = printed.published_form.get(name)
        if given is None:
            given = printed.ratios.get(term)
        elif name != "I'":
            given = given / inertia / factor
        if not printed.published_form and study.publication.name == 'swath-pitch':
            given = given / inertia
        value, std = record.ours.ratio(term)
        rows.append((
            f'{term} ({_in_words(name, factor)})', given, chosen.genetic.ratios[term], chosen.swarm.ratios[term],
            chosen.exact.ratios[term], value, TWO_STD * std, record.hull.terms[term],
        ))  # fmt: skip
    names = 'printed', 'genetic', 'swarm', 'exact optimum of the objective', 'simulated motion'
    columns = (
        Column('ratio to inertia'), *(Column(name, _ratio_shown) for name in names), Column('+- 2 std', digits(2)),
        Column('the simulated hull', _ratio_shown),
    )  # fmt: skip
    stopped = ', '.join(f'{i:.4f}' for i in (chosen.genetic.inertia, *study.inertias))
    note = (
        f"{study.publication.chosen}, {printed.angle_deg:g} deg, {printed.draft_factor:g} T ({printed.table}), over I' "
        f"= {inertia:g}{' (assumed)' if _inertia_is_assumed(study) else ''}. Searches with four seeds stop at I' = "
        f'{stopped}, with the same objective value: the motion tells only the ratios.'
    )
    return Table('coefficients', 'Coefficients of the chosen equation', note, columns, tuple(rows))


def _ratio_shown(value):
    return '0' if abs(value) < ROUNDING else digits(6)(value)


def _inertia_is_assumed(study):
    return "I'" not in study.publication.coefficients.published_form


def _in_words(name, factor):
    return f"{1.0 / factor:g} {name}/I'" if factor != 1.0 else f"{name}/I'"


def _next_step(study):
    printed, record = study.publication.next_step, _check_record(study)
    chosen = study.chosen(record)
    ours = dict(zip(record.ours.terms, record.ours.ratios, strict=True))
    time, measured, by_search = _next_steps(study, record, chosen.genetic.ratios)
    by_ours, unchanged = (_next_steps(study, record, r)[2] for r in (ours, None))
    rows = []
    for k, (t, was, identified, error) in enumerate(printed.rows):
        rows.append((
            t, was, identified, error, float(measured[k]), float(by_search[k]),
            *(100.0 * abs(float(v[k] - measured[k]) / float(measured[k])) for v in (by_search, by_ours, unchanged)),
        ))  # fmt: skip
    percent = digits(3)
    columns = (
        Column('time [s]', digits(3)), Column('printed measured [rad/s]', digits(6)),
        Column('printed identified [rad/s]', digits(6)), Column('printed error [%]', percent),
        Column('measured here [rad/s]', digits(6)), Column('identified here [rad/s]', digits(6)),
        Column('error here [%]', percent), Column('simulated-motion model [%]', percent),
        Column('no change at all [%]', percent),
    )  # fmt: skip
    note = (
        f'{printed.table[0].upper()}{printed.table[1:]}: {printed.angle_deg:g} deg, {printed.draft_factor:g} T, '
        f'{study.publication.chosen}. No change at all: the rate measured before stands for the next.'
    )
    return Table('next_step', 'Rate one step ahead', note, columns, tuple(rows))


# --- conclusions -----------------------------------------------------------------------------------------------------


def _claims(study):
    rows, marks = [], {}
    for claim in study.publication.claims:
        answers = CLAIMS[claim['kind']](study, claim)
        marks[len(rows), len(answers)] = 'best' if answers[-1] == 'yes' else 'beyond'
        rows.append((claim['text'], *answers))
    columns = (
        Column('the study concludes'), Column("by the study's method here"), Column('by the simulated motion'),
        Column('the simulated hull'), Column('holds here'),
    )  # fmt: skip
    note = (
        'Curves: an angle or a draft each. The simulated hull has the same coefficients at every angle: a trend with '
        "the angle that the study's method shows here comes from the method. A conclusion holds here where the method "
        'shows it and the hull has it.'
    )
    return Table('claims', 'Conclusions of the study, and whether they hold here', note, columns, tuple(rows), marks)


def _claim_least(study, claim):
    def share(tables):
        least = [t[claim['equation']] <= min(t.values()) * (1.0 + 1e-7) for t in tables]
        return sum(least), len(least)

    printed, count = share(study.publication.printed_objective.values())
    here, _ = share([{e: s.genetic.value for e, s in r.searched.items()} for r in study.records])
    return f'in {here} of {count} records; in the printed table in {printed}', '-', '-', _verdict(here, count)


def _claim_next_step(study, claim):
    record = _check_record(study)
    ours = dict(zip(record.ours.terms, record.ours.ratios, strict=True))
    models = study.chosen(record).genetic.ratios, ours, None
    found = [100.0 * next_step_errors(study, record, ratios).max() for ratios in models]
    return (
        f'at most {found[0]:.3g} %; no change at all: {found[2]:.3g} %', f'at most {found[1]:.3g} %', '-',
        'yes' if found[0] <= claim['percent'] else 'no',
    )  # fmt: skip


def _claim_trend(study, claim):
    drafts = claim.get('draft_factors', DRAFT_FACTORS)
    angles = claim.get('angles_deg', sorted({r.angle_deg for r in study.records}))
    curves = [[(f, a) for a in angles] for f in drafts]
    if claim['against'] == 'draft':
        curves = [list(curve) for curve in zip(*curves, strict=True)]
    found = {}
    for by in (GENETIC, OURS, HULL):
        trends = [
            trend_of([coefficient(study, study.at(*place), claim['coefficient'], by)[0] for place in curve])
            for curve in curves
        ]
        found[by] = (sum(t == claim['direction'] for t in trends), trends)
    if claim['coefficient'] == "I'":
        return _curves(found[GENETIC]), '-', '-', 'no: any value fits alike'
    verdict = _verdict(min(found[GENETIC][0], found[HULL][0]), len(curves))
    return *(_curves(found[by]) for by in (GENETIC, OURS, HULL)), verdict


def _curves(found):
    holds, trends = found
    if len(trends) == 1:
        return trends[0]
    return f'{holds} of {len(trends)} curves ({", ".join(trends)})'


def _verdict(holds, count):
    return 'yes' if holds == count else 'no' if holds == 0 else f'in {holds} of {count}'


CLAIMS = {'least': _claim_least, 'next-step': _claim_next_step, 'trend': _claim_trend}


def _limits(study):
    p = study.publication
    lines = [
        "I' and every coefficient multiplied by one number give the same motion, so that I' cannot come out of a free "
        "decay, nor N, W, x and C1 to C3 without it: only their ratios to I' can. The printed I' is where the search "
        'happened to stop.',
        f'Under noise the objective has its least value at the wrong hull, because the measured rate stands on both '
        f'sides of it: {_bias(study)}. The smaller the angle, the larger this is against the motion, which makes '
        'coefficients seem to depend on the angle.',
    ]
    if p.out_of_order:
        draft, angle, big, small = p.out_of_order[0]
        values = p.printed_objective[draft, angle]
        lines.append(
            f'Printed values that are no optima: for example at {angle:g} deg and {draft:g} T, {big} with '
            f'{values[big]:.9g} rad/s although it contains {small} with {values[small]:.9g}. Such '
            f'pairs: {len(p.out_of_order)}. Those digits are of the search, not of the hull.'
        )
    spread = [max(v.values()) / min(v.values()) - 1.0 for v in p.printed_objective.values()]
    uncertain = [1.0 / math.sqrt(2.0 * r.problem.motions[0].size) for r in study.records]
    lines.append(
        f'Within a record the printed values of all equations differ by {100.0 * np.median(spread):.2g} % (median); '
        f'the noise alone moves a value by {100.0 * np.median(uncertain):.2g} % between repeats. Which equation is '
        'least is decided by noise where they are closer than that.'
    )
    if p.next_step:
        lines += _limits_of_the_check(study)
    weak = sorted({
        t for r in study.records for t in r.ours.terms
        if r.ours.ratio(t)[1] > 0.5 * abs(r.hull.terms[t])
    }, key=list(COEFFICIENTS).index)  # fmt: skip
    if weak:
        lines.append(
            f'{", ".join(weak)}: known to worse than half of its value on at least one record; a printed trend of such '
            'a coefficient is no finding.'
        )
    return lines


def _limits_of_the_check(study):
    record = _check_record(study)
    ours = dict(zip(record.ours.terms, record.ours.ratios, strict=True))
    models = study.chosen(record).genetic.ratios, ours, None
    found = [100.0 * np.median(next_step_errors(study, record, ratios)) for ratios in models]
    _, measured, _, errors = np.array(study.publication.next_step.rows).T
    steps = 100.0 * np.abs(np.diff(measured) / measured[1:])
    lines = [
        f"The check one step ahead tells no model from another: the study's method errs by {found[0]:.3g} % there, the "
        f'simulated motion by {found[1]:.3g} %, no change at all by {found[2]:.3g} % (medians). The noise of two '
        'readings decides. What tells a model is its simulated motion.'
    ]
    if steps.max() > 3.0 * errors.max():
        lines.append(
            f'The printed readings change by up to {steps.max():.2g} % from one to the next, the printed errors are at '
            f'most {errors.max():.3g} %: no prediction from the reading before can follow such noise.'
        )
    return lines


# --- figures ---------------------------------------------------------------------------------------------------------


def _drawn(study, kind):
    """The figures of one kind, as parts of a section."""
    with matplotlib.rc_context(STYLE):
        drawings = [
            (spec['number'], drawing) for spec in study.publication.figures if spec['kind'] == kind
            for drawing in FIGURES[kind](study, spec)
        ]  # fmt: skip
    shown = [
        inline(svg_of(d.figure, d.name), d.name.replace('.', '_'), f'As figure {number}: {d.caption}')
        for number, d in drawings
    ]
    return [figures(shown)] if shown else []


def _axes(title=''):
    figure = new_figure(WIDTH, HEIGHT)
    axes = quiet(figure.subplots())
    axes.set_title(title)
    return figure, axes


def _decays(study, spec):
    figure, axes = _axes()
    for factor in DRAFT_FACTORS:
        motion = study.at(factor, spec['angle_deg']).problem.motions[0]
        axes.plot(motion.time - motion.time[0], motion.rate, linewidth=0.9, label=f'{factor:g} T')
    axes.set_xlabel('time since release [s]')
    axes.set_ylabel(f'{study.publication.axis} rate [rad/s]')
    axes.legend(frameon=False, ncols=3)
    return [Drawing('decays', f'rates of the three drafts, released from {spec["angle_deg"]:g} deg', figure)]


def _motion(study, spec):
    record = study.at(spec['draft_factor'], spec['angle_deg'])
    motion, state = record.problem.motions[0], record.ours.initial_states[0]
    searched = record.hull.from_terms(
        equation_named(study.publication.chosen), study.chosen(record).genetic.ratios, axis=motion.axis
    )
    models = [(searched, BY[GENETIC], MODEL, '--'), (record.ours.model, BY[OURS], RESIDUAL, '-')]
    found = []
    for quantity, unit in (('angle', '[deg]'), ('rate', 'rate [deg/s]')):
        figure, axes = _axes()
        time = motion.time - motion.time[0]
        measured = np.degrees(getattr(motion, quantity))
        axes.plot(time, measured, color=MEASURED, linewidth=0.7, alpha=0.7, label='measured')
        for model, label, colour, style in models:
            axes.plot(time, np.degrees(_simulated(model, state, motion)[quantity]), style, color=colour, label=label)
        axes.set_xlabel('time since release [s]')
        axes.set_ylabel(f'{motion.axis} {unit}')
        axes.legend(frameon=False)
        caption = f'{quantity}, measured and identified, {record.angle_deg:g} deg at {record.draft_factor:g} T'
        found.append(Drawing(f'motion_{quantity}', caption, figure))
    return found


def _simulated(model, state: InitialState, motion):
    angle, rate = simulate(model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
    return {'angle': angle, 'rate': rate}


def _objective_by_equation(study, spec):
    p = study.publication
    found = []
    for angle in sorted({r.angle_deg for r in study.records}):
        figure, axes = _axes(f'from {angle:g} deg')
        places = np.arange(1, len(p.equations) + 1)
        for k, factor in enumerate(DRAFT_FACTORS):
            record, printed = study.at(factor, angle), p.printed_objective[factor, angle]
            axes.plot(places, [printed[e] for e in p.equations], 'o--', color=SERIES[k], markersize=4, linewidth=0.9,
                      markerfacecolor='none', label=f'{factor:g} T printed')  # fmt: skip
            axes.plot(places, [record.searched[e].genetic.value for e in p.equations], 'o-', color=SERIES[k],
                      markersize=4, linewidth=1.2, label=f'{factor:g} T here')  # fmt: skip
        axes.set_xticks(places)
        axes.set_xlabel('equation')
        axes.set_ylabel('objective [rad/s]')
        axes.set_ylim(bottom=0.0)
        legend_below(axes)
        found.append(Drawing(f'objective_{angle:g}', f'objective value by equation, {angle:g} deg', figure))
    return found


def _against_angle(study, spec):
    found = []
    for name in spec['coefficients']:
        for by, words in BY.items():
            if name == "I'" and by == OURS:
                continue
            figure, axes = _axes(f'{name} by {words}')
            shown = [_one_curve(axes, study, name, by, k, factor) for k, factor in enumerate(DRAFT_FACTORS)]
            _limit(axes, np.concatenate(shown))
            axes.set_xlabel('initial angle [deg]')
            axes.set_ylabel(name)
            legend_below(axes)
            caption = f'{name} against initial angle, a curve a draft, by {words}'
            if name != "I'":
                caption += f"; I' {study.inertia:g} given; dotted: the simulated hull"
            if by == OURS:
                caption += '; two standard deviations'
            found.append(Drawing(f'{name}_{by}'.replace("'", ''), caption, figure))
    return found


def _one_curve(axes, study, name, by, k, factor):
    """Draw a draft's curve with that of the hull; the values that the figure has to show."""
    records = sorted((r for r in study.records if r.draft_factor == factor), key=lambda r: r.angle_deg)
    angles = [r.angle_deg for r in records]
    values, stds = np.array([coefficient(study, r, name, by) for r in records]).T
    hull = np.array([coefficient(study, r, name, HULL)[0] for r in records])
    if by == OURS:
        axes.errorbar(angles, values, TWO_STD * stds, marker='o', markersize=4, capsize=3, color=SERIES[k],
                      linewidth=1.2, label=f'{factor:g} T')  # fmt: skip
    else:
        axes.plot(angles, values, 'o-', markersize=4, color=SERIES[k], linewidth=1.2, label=f'{factor:g} T')
    axes.plot(angles, hull, ':', color=SERIES[k], linewidth=1.2)
    # what is not known at all must not hide the rest
    known = ~(stds > 2.0 * np.nanmax(np.abs([*hull, 0.0])))
    return np.concatenate([hull[np.isfinite(hull)], values[known], [0.0]])


def _limit(axes, shown):
    low, high = float(np.min(shown)), float(np.max(shown))
    margin = 0.12 * (high - low) or 0.1
    axes.set_ylim(low - margin, high + margin)


def _all_coefficients(study, spec):
    factor = spec['draft_factor']
    records = sorted((r for r in study.records if r.draft_factor == factor), key=lambda r: r.angle_deg)
    found = []
    for by, words in BY.items():
        figure, axes = _axes(f'{factor:g} T, by {words}')
        for k, name in enumerate(["I'", *coefficient_names(study)]):
            values = [coefficient(study, r, name, by)[0] for r in records]
            if np.isfinite(values).any():
                axes.plot([r.angle_deg for r in records], values, marker='o', markersize=4, linewidth=1.1, label=name,
                          color=SERIES[k % len(SERIES)], linestyle=LINE_STYLES[k // len(SERIES)])  # fmt: skip
        axes.set_yscale('symlog', linthresh=1e-3)
        axes.set_xlabel('initial angle [deg]')
        axes.legend(frameon=False, ncols=1, loc='center left', bbox_to_anchor=(1.0, 0.5))
        caption = f"all coefficients at {factor:g} T against initial angle, by {words}; I' {study.inertia:g} given"
        found.append(Drawing(f'coefficients_{factor:g}_{by}', caption, figure))
    return found


FIGURES = {
    'decays': _decays, 'motion': _motion, 'objective': _objective_by_equation, 'against-angle': _against_angle,
    'coefficients': _all_coefficients,
}  # fmt: skip
