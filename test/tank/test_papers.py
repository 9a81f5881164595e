"""The published studies: their printed values, and their trials and searches carried out again."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification import search
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.report.html_page import escaped
from swath_sysid.report.published import citation
from swath_sysid.tank.papers.decay_study import DECAY_STUDIES, decay_publication, hull_at, study_record
from swath_sysid.tank.report.paper_decay_claims import trend_of


@pytest.mark.parametrize('name', DECAY_STUDIES)
def test_printed_values_are_complete_and_agree_with_each_other(name):
    publication = decay_publication(name)
    drafts, angles = zip(*publication.printed_objective, strict=True)
    assert len(publication.printed_objective) == len(set(drafts)) * len(set(angles))
    for values in publication.printed_objective.values():
        assert len(values) == len(publication.equations)
        assert all(0.005 < value < 0.06 for value in values.values())
    # printed errors one step ahead are those of their printed rates
    for _, measured, identified, percent in publication.next_step.rows if publication.next_step else ():
        assert 100.0 * abs(identified / measured - 1.0) == pytest.approx(percent, abs=0.3)


def test_the_printed_coefficients_are_those_of_the_catalogues_hulls():
    printed = decay_publication('hydrofoil-pitch').coefficients.ratios
    assert printed == PUBLISHED_HULLS['hydrofoil-pitch'].model.terms
    form = decay_publication('swath-usv-pitch').coefficients.published_form
    assert form['C3'] / form["I'"] == pytest.approx(PUBLISHED_HULLS['swath-usv-pitch'].model.terms['r1'])
    assert 2.0 * form['N'] / form["I'"] == pytest.approx(PUBLISHED_HULLS['swath-usv-pitch'].model.terms['b1'])
    # swath-pitch-1 contains swath-pitch-2, and is printed with .025670453 beside .02566616
    assert (1.0, 9, 'swath-pitch-1', 'swath-pitch-2') in decay_publication('swath-pitch').out_of_order
    design, deep = hull_at('swath-pitch', 1.0), hull_at('swath-pitch', 1.1)
    assert design.terms == PUBLISHED_HULLS['swath-pitch'].model.terms
    assert deep.terms['r1'] == pytest.approx(design.terms['r1'] * 1.1**-1.5)
    with pytest.raises(InputError, match='swath-roll'):
        decay_publication('catamaran')


def test_trends():
    for trend, values in {
        'falls': [3, 2, 2, 1],
        'rises': [1, 2, 3],
        'steady': [1, 0.9, 1.05],
        'rises then falls': [1, 3, 2],
        'mixed': [1, 3, 2, 4],
    }.items():
        assert trend_of(values) == trend


@pytest.fixture
def short_search(monkeypatch):
    """The studies' searches with a fiftieth of their budget."""
    for name in DECAY_STUDIES:
        preset = search.PRESETS[name]
        few = replace(preset.genetic, generations=40, population=60)
        monkeypatch.setitem(search.PRESETS, name, replace(preset, genetic=few))


@pytest.mark.long
def test_a_record_is_searched_down_to_its_exact_optimum_and_no_lower():
    record = study_record('swath-roll', 1.0, 5, seed=2)
    motion, trim = record.problem.motions[0], record.problem.states[0].trim
    x, w, step = motion.angle[:-1] - trim, motion.rate[:-1], np.diff(motion.time)
    # the published objective written out, its least value by non-negative least squares
    columns = np.column_stack([w, np.abs(w) * w, w**3, np.sin(x), np.sin(x) ** 2]) * -step[:, None]
    _, least = nnls(columns, np.diff(motion.rate))
    found = record.searched['swath-roll-3']
    assert found.exact.value == pytest.approx(least / np.sqrt(step.size), rel=1e-9)
    for by_search in (found.genetic, found.swarm):
        assert found.exact.value * (1.0 - 1e-12) <= by_search.value <= found.exact.value * (1.0 + 1e-4)
        ratios = np.array(list(by_search.ratios.values()))
        error = np.diff(motion.rate) - columns @ ratios
        assert by_search.value == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
        assert 0.0 < by_search.inertia <= 0.1
    # about as printed, 0.007095983 rad/s, since the noise sets it
    assert found.genetic.value == pytest.approx(0.0071, rel=0.1)
    # the objective is far off the hull, the simulated motion is on it
    assert found.exact.ratios['b1'] > 100.0 * record.hull.terms['b1']
    for term, value in record.hull.terms.items():
        estimate, std = record.ours.ratio(term)
        assert abs(estimate - value) < 4.0 * std


@pytest.mark.release
@pytest.mark.parametrize('name', ['hydrofoil-pitch', pytest.param('swath-roll', marks=pytest.mark.slow)])
def test_the_page_of_a_study_has_its_figures_and_tables(name, tmp_path, short_search, capsys):
    page = tmp_path / 'study.html'
    assert main(['paper', name, '--output', str(page), '--jobs', '1', '--json']) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['report'] == str(page) and all(record['ratios'] for record in told['records'])
    text = page.read_text(encoding='utf-8')
    publication = decay_publication(name)
    for figure in publication.figures:
        assert f'As figure {figure["number"]}:' in text
    for values in publication.printed_objective.values():
        assert all(f'{value:.7g}' in text for value in values.values())
    assert all(escaped(claim['text']) in text for claim in publication.claims)
    assert escaped(citation(publication.paper, publication.authors)) in text
    assert '>measured<' not in text and 'simulated record' in text
    assert 'by construction' in text
    assert '>nan' not in text
