"""The model file: exact round trip, and every fault named."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.errors import InputError
from swath_sysid.files.model_file import model_from_yaml, model_to_yaml, read_model, write_model
from swath_sysid.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.hull.decay_model import DecayModel
from swath_sysid.hull.identified_model import IdentifiedModel

finite = st.floats(allow_nan=False, allow_infinity=False)


def example():
    model = PUBLISHED_HULLS['swath-pitch'].model.with_trim(0.01)
    covariance = np.diag([1e-4, 1e-2, 1e-3, 1.0, 400.0])
    return IdentifiedModel(
        model, covariance, 2e-5, (0.01, 0.1), {'r2': 0.999}, {'seed': 1, 'sources': [{'file': 'a.csv'}]}
    )


def edited(change):
    content = yaml.safe_load(model_to_yaml({'pitch': example()}))
    change(content, content['axes']['pitch'])
    return yaml.safe_dump(content)


@given(
    st.lists(finite, min_size=4, max_size=4), st.lists(finite, min_size=16, max_size=16), finite, st.floats(1e-9, 1e9)
)
def test_round_trip_is_exact(values, covariance, trim, friction_rate):
    equation = EQUATIONS['odd-cubic']
    model = DecayModel.from_terms(
        equation, dict(zip(equation.terms, values, strict=True)), trim=trim, friction_rate=friction_rate, axis='roll'
    )
    with np.errstate(invalid='ignore'):
        identified = IdentifiedModel(model, np.reshape(covariance, (4, 4)))
        assert model_from_yaml(model_to_yaml({'roll': identified}))['roll'] == identified


def test_file_of_both_axes(tmp_path):
    models = {'pitch': example(), 'roll': IdentifiedModel.exactly(PUBLISHED_HULLS['swath-roll'].model)}
    path = tmp_path / 'model.yaml'
    write_model(path, models)
    assert read_model(path) == models
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'is no model file'),
        ('a: [', 'not YAML'),
        ('- 1', 'is no model file'),
        (edited(lambda c, a: c.update(version=99)), 'version 99'),
        (edited(lambda c, a: c.update(colour='red')), "unknown field 'colour'"),
        (edited(lambda c, a: c.pop('frame')), "field 'frame' is missing"),
        (edited(lambda c, a: c.update(frame='NED')), "frame 'NED'"),
        (edited(lambda c, a: c.update(axes={})), 'holds no axis'),
        (edited(lambda c, a: c['axes'].update(yaw=a)), "no axis 'yaw'"),
        (edited(lambda c, a: a.pop('trim_rad')), "pitch: the field 'trim_rad' is missing"),
        (edited(lambda c, a: a.update(trim=1)), "unknown field 'trim'"),
        (edited(lambda c, a: a.update(trim_rad='x')), "'x' is not a number"),
        (edited(lambda c, a: a['ratios'].update(q9={})), "no ratio 'q9'"),
        (edited(lambda c, a: a['ratios']['b1'].pop('std')), "b1: the field 'std' is missing"),
        (edited(lambda c, a: a['ratios']['b1'].update(unit='kg')), "unit 'kg'"),
        (edited(lambda c, a: a['ratios']['b1'].update(value=True)), "'True' is not a number"),
        (edited(lambda c, a: a['ratios']['b1'].update(value=float('nan'))), 'finite'),
        (edited(lambda c, a: a.update(ratios={'b1': a['ratios']['b1']})), 'one restoring'),
        (edited(lambda c, a: a.update(covariance=[[1.0]])), 'covariance'),
        (edited(lambda c, a: a.update(covariance=3)), 'need 5 rows of 5'),
        (edited(lambda c, a: a.update(covariance=[[1.0], [1.0, 2.0]])), 'covariance'),
        (edited(lambda c, a: a.update(valid_amplitude_rad=[1.0])), 'smallest and the largest'),
        (edited(lambda c, a: a.update(friction_rate_rad_s=0.0)), 'friction_rate'),
    ],
)
def test_faults_are_named(text, words):
    with pytest.raises(InputError, match=words):
        model_from_yaml(text)


def test_unreadable_files_are_named(tmp_path):
    with pytest.raises(InputError, match='cannot read the model file'):
        read_model(tmp_path / 'absent.yaml')
    (tmp_path / 'binary.yaml').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(InputError, match='not text'):
        read_model(tmp_path / 'binary.yaml')
