"""The model file: exact round trip, and every fault named."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml, read_model, write_model
from swath_sysid.formats.model_format import Stated, covariance


def example():
    model = PUBLISHED_HULLS['swath-pitch'].model.with_trim(0.01)
    covariance = np.diag([1e-4, 1e-2, 1e-3, 1.0, 400.0])
    provenance = {'seed': 1, 'sources': [{'file': 'a.csv'}]}
    return IdentifiedModel(model, covariance, 2e-5, (0.01, 0.1), {'r2': 0.999}, provenance)


def edited(change):
    content = yaml.safe_load(model_to_yaml({'pitch': example()}))
    change(content, content['axes']['pitch'])
    return yaml.safe_dump(content, sort_keys=False)


entries = arrays(float, (4, 4), elements=st.integers(-1000, 1000).map(lambda n: n / 7))


@given(
    st.lists(st.floats(0.1, 1e3), min_size=4, max_size=4),
    entries,
    st.floats(-3.0, 3.0),
    st.floats(1e-6, 100.0),
    st.sampled_from([nan, 0.0, 0.1]),
    st.sampled_from([inf, 0.2]),
)
def test_round_trip_is_exact(values, root, trim, friction_rate, trim_std, largest):
    equation = EQUATIONS['odd-cubic']
    values = dict(zip(equation.terms, [0.1 * values[0], *values[1:]], strict=True))
    model = DecayModel.from_terms(equation, values, trim=trim, friction_rate=friction_rate, axis='roll')
    identified = IdentifiedModel(model, root @ root.T, trim_std, (0.0, largest))
    assert model_from_yaml(model_to_yaml({'roll': identified}))['roll'] == identified


def test_the_posterior_of_every_term_is_kept_in_a_file_of_both_axes(tmp_path):
    equation = Equation('general', ('b1', 'b2', 'b3', 'r1', 'r2', 'r3'))
    root = np.random.default_rng(1).standard_normal((6, 6))
    posterior = HullPosterior(equation, np.arange(1.0, 7.0), root @ root.T)
    roll = IdentifiedModel.exactly(PUBLISHED_HULLS['swath-roll'].model)
    models = {'pitch': replace(example(), posterior=posterior), 'roll': roll}
    write_model(tmp_path / 'model.yaml', models)
    assert read_model(tmp_path / 'model.yaml') == models
    assert list(tmp_path.iterdir()) == [tmp_path / 'model.yaml']
    with pytest.raises(InputError, match='shape'):
        HullPosterior(equation, np.ones(5), np.eye(6))


def test_a_variance_that_is_not_known_stays_so():
    covariance = example().covariance.copy()
    covariance[2] = covariance[:, 2] = nan
    identified = replace(example(), covariance=covariance, metrics={'r2': nan, 'of': {'roll': 0.9}})
    again = model_from_yaml(model_to_yaml({'pitch': identified}))['pitch']
    assert again == replace(identified, metrics={'r2': None, 'of': {'roll': 0.9}})


def test_rows_of_the_covariance_are_those_of_the_file():
    def reversed_order(content, axis):
        axis['ratios'] = dict(reversed(axis['ratios'].items()))
        axis['covariance'] = [row[::-1] for row in axis['covariance'][::-1]]

    assert model_from_yaml(edited(reversed_order))['pitch'] == example()


#: Beside those of hostile_models.py.
@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('- 1', 'is not a model file'),
        (edited(lambda c, a: c.pop('frame')), "frame: 'None' must be"),
        (edited(lambda c, a: c.update(axes={})), 'holds no axis'),
        (edited(lambda c, a: c['axes'].update(yaw={})), "no axis 'yaw'"),
        (edited(lambda c, a: a.pop('trim_rad')), "pitch: the field 'trim_rad' is missing"),
        (edited(lambda c, a: a.update(trim=1)), "unknown field 'trim'"),
        (edited(lambda c, a: a['ratios'].update(q9={})), "no ratio 'q9'"),
        (edited(lambda c, a: a['ratios']['b1'].update(unit='kg')), "b1, unit: 'kg'"),
        (edited(lambda c, a: a['ratios']['b1'].update(value=True)), "'True' is not a number"),
        (edited(lambda c, a: a.update(ratios={'b1': a['ratios']['b1']})), 'one restoring'),
        (edited(lambda c, a: a.update(covariance=3)), 'need 5 rows of 5'),
        (edited(lambda c, a: a.update(valid_amplitude_rad=[1.0])), 'valid_amplitude_rad'),
    ],
)
def test_faults_are_named(text, words):
    with pytest.raises(InputError, match=words):
        model_from_yaml(text)


def test_a_deviation_is_that_of_the_covariance_but_for_rounding():
    covariance([[4.0]], ['b1'], {'b1': Stated(1.0, 2.0 * (1.0 + 8e-7), '1/s')}, 'x')
    with pytest.raises(InputError, match='not that of the covariance'):
        covariance([[4.0]], ['b1'], {'b1': Stated(1.0, 2.0 * (1.0 + 1.2e-6), '1/s')}, 'x')
