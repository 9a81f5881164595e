"""The page of the study of a catamaran's manoeuvring: printed and obtained values side by side, in its order."""

from itertools import product

import numpy as np

from swath_sysid.common.conventions import digits
from swath_sysid.manoeuvring.paper.study import ManoeuvringStudy, track_error
from swath_sysid.report import figures as plots
from swath_sysid.report.html_page import Drawing, bullets, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.published import BY_CONSTRUCTION, PARTICULARS, citation, verdict_mark
from swath_sysid.report.tables import Column, Table, columns_of

FIGURE_OF_RUN = {'identification': '4', 'validation': '5'}


def manoeuvring_page(study: ManoeuvringStudy, wall_s: float) -> str:
    """HTML of the repeated study."""
    known = study.content
    with page_style():
        tracks = figures([*_trajectories(study), *_turns(study)])
        iterations = figures(list(_iterations(study)))
    cited = paragraph(citation(known['paper'], known['authors']))
    sections = [
        ('short', 'In short', [cited, bullets(_in_short(study, wall_s))]),
        ('trials', 'Craft and trials', [table_as_html(_craft(study)), paragraph(_how_simulated(study), 'note')]),
        ('derivatives', 'Derivatives', [table_as_html(_derivatives(study))]),
        ('motion', 'Trajectories and turns', [tracks]),
        ('iterations', 'Parameters against iteration', [iterations]),
        ('conclusions', 'Conclusions', [table_as_html(_claims(study))]),
        ('limits', 'What cannot come out, and why', [bullets(known['limits'])]),
    ]
    return page(f'{known["title"]}: the study and its repetition', sections)


def _errors(study: ManoeuvringStudy, run: str):
    """Root mean square distance of the tracks of the study's method, and of ours, from the true one, m."""
    exact, _ = study.runs[run]
    return [track_error(study.simulated(model, run), exact) for model in (study.estimated, study.ours.model)]


def _unknown(study: ManoeuvringStudy):
    return [d for d in study.derivatives if d.std > abs(d.truth)]


def _in_short(study: ManoeuvringStudy, wall_s: float):
    (here, ours_here), (other, ours_other) = (_errors(study, run) for run in FIGURE_OF_RUN)
    free = [d for d in study.derivatives if np.isfinite(d.std)]
    near = [d for d in study.derivatives if abs(d.printed - d.mariner) < 0.1 * abs(d.mariner)]
    return [
        f'Our model is {study.ours.verdict}.',
        f'The turn at {study.content["runs"]["identification"][1]:g} N is fitted by its own method to {here:.2g} m '
        f'(root mean square of the track), and the turn at {study.content["runs"]["validation"][1]:g} N is predicted '
        f'to {other:.2g} m; by ours to {ours_here:.2g} and {ours_other:.2g} m, with fewer terms and no ranges about '
        f'the truth. {wall_s:.0f} s.',
        f'{len(_unknown(study))} of the {len(free)} derivatives that are estimated have a standard deviation larger '
        'than themselves: one steady turn does not determine them, and the study largely prints its start values.',
        f'{len(near)} of the printed values ({", ".join(d.name for d in near)}) lie within 10 % of those of the '
        'Mariner-class cargo ship times 1e-5, 161 m long and unlike a catamaran of 4 m: they look like first guesses '
        'that the data did not move.',
    ]


def _craft(study: ManoeuvringStudy):
    names = PARTICULARS | {
        'height_m': 'height [m]',
        'deduction': 'thrust deduction',
        'moment_factor': 'moment factor',
        'speed_m_s': 'speed of the prime system [m/s]',
        'gyradius_over_length': 'yaw gyradius over length',
        'lever_m': 'half the distance of the thrusters [m]',
        'approach_s': 'approach [s]',
        'turn_s': 'turn [s]',
    }
    content = study.content
    rows = [
        (names[key], f'{value:g}', how)
        for how, group in (('printed', content['craft'] | content['thrust']), ('assumed', content['assumed']))
        for key, value in group.items()
        if key in names
    ]
    rows += [
        (f'thrusts, {run} [N]', f'{port:g} port, {starboard:g} starboard', 'printed')
        for run, (port, starboard) in content['runs'].items()
    ]
    columns = Column('what'), Column('value'), Column('whence')
    return Table('craft', 'WAM-V', 'As printed, or assumed where it is not.', columns, tuple(rows))


def _how_simulated(study: ManoeuvringStudy):
    assumed = study.content['assumed']
    return (
        'The measured runs were not published. Here they are simulated of the printed derivatives: an approach with '
        'both thrusters at the larger thrust, then the turn; GPS position and speed with white noise of 0.3 m and '
        f'0.05 m/s. Each derivative is searched from {assumed["least_share"]:g} to {assumed["largest_share"]:g} times '
        f'its value, beginning at {assumed["start_share"]:g} times it; {", ".join(study.content["fixed_by_towing"])} '
        'are fixed, as by towing tests. As printed, times 1e-3, no craft could have them: the added mass in '
        'sway would be over a hundred times the displacement. They are read times 1e-5, and the first with the '
        'decimal point that it has lost.'
    )


def _derivatives(study: ManoeuvringStudy):
    rows = tuple(
        (d.name, d.printed, d.truth, d.estimate, d.std, d.ours, d.ours_std, d.lower, d.upper, d.mariner)
        for d in study.derivatives
    )
    columns = columns_of(
        {
            'derivative': str,
            'printed': digits(5),
            'simulated': digits(5),
            "study's method": digits(4),
            'std': digits(2),
            'ours': digits(4),
            'ours std': digits(2),
            'range from': digits(4),
            'to': digits(4),
            'Mariner': digits(4),
        }
    )
    marks = {(k, 4): 'beyond' for k, d in enumerate(study.derivatives) if d.std > abs(d.truth)}
    table = study.content['derivatives']['table']
    note = (
        f'Printed in {table}; here times 1e-5. Red: not determined by the turn. Ours leaves out what '
        'the turn does not need. Subscripts in the order of the equations, partly illegible in print.'
    )
    return Table('derivatives', 'Non-dimensional derivatives', note, columns, rows, marks)


def _models(study: ManoeuvringStudy, run: str):
    return [
        (study.runs[run][1], 'simulated run, with noise', dict(color=plots.MEASURED, linewidth=0.7, alpha=0.8)),
        (study.simulated(study.estimated, run), "model by the study's method", dict(color=plots.MODEL, linestyle='--')),
        (study.simulated(study.ours.model, run), 'model by ours', dict(color=plots.RESIDUAL)),
    ]


def _trajectories(study: ManoeuvringStudy):
    for run, number in FIGURE_OF_RUN.items():
        title = f'{run}, {study.content["runs"][run][1]:g} N starboard'
        figure, axes = plots.panel(title=title, xlabel='east [m]', ylabel='north [m]')
        for motion, label, style in _models(study, run):
            axes.plot(motion.x, motion.y, label=label, **style)
        axes.set_aspect('equal', 'datalim')
        plots.legend_below(axes)
        yield Drawing(f'track_{run}', f'As figure {number}: simulated and identified trajectory, {run}', figure)


def _turns(study: ManoeuvringStudy):
    for run in FIGURE_OF_RUN:
        figure = plots.new_figure()
        above, below = (plots.quiet(a) for a in figure.subplots(2, 1, sharex=True))
        for motion, label, style in _models(study, run):
            above.plot(motion.time, np.hypot(motion.surge, motion.sway), label=label, **style)
            below.plot(motion.time, np.degrees(motion.yaw_rate), **style)
        above.set_ylabel('speed [m/s]')
        below.set_ylabel('yaw rate [deg/s]')
        below.set_xlabel('time [s]')
        above.legend(frameon=False)
        yield Drawing(f'turn_{run}', f'Simulated and identified turn, {run}', figure)


def _iterations(study: ManoeuvringStudy):
    for row in ('Y', 'N'):
        labels = {'title': f'{row} derivatives', 'xlabel': 'iteration', 'ylabel': 'over its simulated value'}
        figure, axes = plots.panel(**labels)
        names = [name for name in study.free if name.startswith(row)]
        for name, (style, colour) in zip(names, product(plots.LINE_STYLES, plots.SERIES), strict=False):
            values = study.iterations[:, study.free.index(name)]
            axes.plot(values, style, color=colour, marker='o', markersize=3, label=name)
        axes.axhline(1.0, color=plots.MEASURED, linewidth=0.6)
        plots.legend_below(axes)
        caption = f'As figure 6: parameters of {row} against iteration, in shares of what was simulated'
        yield Drawing(f'iterations_{row}', caption, figure)


def _claims(study: ManoeuvringStudy):
    here, other = (_errors(study, run)[0] for run in FIGURE_OF_RUN)
    rows = (
        ('the simulated trajectory agrees with the measured one', f'to {here:.2g} m', BY_CONSTRUCTION),
        (
            'the model predicts another thrust',
            f'to {other:.2g} m, {other / here:.2g} times the error of its own run',
            BY_CONSTRUCTION,
        ),
        (
            'the parameters converge',
            f'after {len(study.iterations) - 1} iterations they hardly move, the free ones at '
            f'{np.abs(study.iterations[-1] - 1.0).max():.0%} from the truth at most',
            'not to the truth',
        ),
        ('twelve derivatives are identified', f'{len(_unknown(study))} are not determined by the turn', 'no'),
    )
    marks = {(k, 2): verdict_mark(row[2]) for k, row in enumerate(rows)}
    columns = Column('the study concludes'), Column('here'), Column('holds here')
    note = (
        'The runs are simulated by the same equations that are identified: agreement of the tracks holds by '
        'construction, which confirms nothing.'
    )
    return Table('claims', '', note, columns, rows, marks)
