"""The public names: what importing them loads, that their examples run, and that the page of reference lists them."""

import doctest
import functools
import importlib
import inspect
import json
import pickle
import re
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot
import numpy as np
import pytest
from repository import ABSENT, ROOT, are_those
from test_light import loaded_by

import swath_sysid
from swath_sysid.common.wings import wings

PAGE = (ROOT / 'docs' / 'api.rst').read_text(encoding='utf-8')
PAGES = [PAGE, *(path.read_text(encoding='utf-8') for path in sorted((ROOT / 'docs' / 'api').glob('*.rst')))]
DOCUMENTED = re.findall(r'^\.\. auto(?:class|function):: swath_sysid\.(.+)$', '\n'.join(PAGES), re.MULTILINE)


#: public names by their wing, '' for the core
NAMES = defaultdict(list)
for _name in swath_sysid.__all__:
    _room = swath_sysid._HOME_OF[_name].partition('.')[0]
    NAMES[_room if _room in {wing.name for wing in wings()} else ''].append(_name)


@functools.cache
def first_lines():
    example = doctest.DocTestParser().get_doctest(PAGE, {}, 'docs/api.rst', None, 0)
    assert doctest.DocTestRunner().run(example, clear_globs=False).failed == 0
    return example.globs


def running_examples(names):
    """A test that each of these names has an example that runs in the folder of examples."""

    @pytest.mark.parametrize('name', names)
    def run(name, folder_of_examples, monkeypatch):
        monkeypatch.chdir(folder_of_examples)
        (example,) = doctest.DocTestFinder(recurse=False).find(getattr(swath_sysid, name), name, globs=first_lines())
        assert example.examples
        told = []
        assert doctest.DocTestRunner().run(example, out=told.append).failed == 0, ''.join(told)

    return run


@pytest.fixture(scope='module')
def folder_of_examples(tmp_path_factory):
    return tmp_path_factory.mktemp('examples')


test_every_public_name_has_an_example_that_runs = running_examples(NAMES[''])


def test_every_parameter_and_result_of_a_public_function_is_explained():
    functions = {name: f for name in swath_sysid.__all__ if inspect.isfunction(f := getattr(swath_sysid, name))}
    for name, function in functions.items():
        missing = [p for p in inspect.signature(function).parameters if f'\n        {p}: ' not in function.__doc__]
        assert missing == [], name
        gives = inspect.signature(function).return_annotation is not None
        assert not gives or re.search(r'\n    (Returns|Yields):\n', function.__doc__), name


def test_the_page_of_reference_lists_the_public_names_and_what_they_give():
    public = [name for name in DOCUMENTED if '.' not in name]
    assert are_those(sorted(public), sorted(swath_sysid.__all__))
    assert len(set(DOCUMENTED)) == len(DOCUMENTED)
    for name in set(DOCUMENTED) - set(public):
        module, _, result = name.rpartition('.')
        if module.partition('.')[0] not in ABSENT:
            assert getattr(importlib.import_module(f'swath_sysid.{module}'), result).__doc__


def test_type_checkers_see_the_public_names_too_and_importing_the_package_loads_none_of_it():
    text = Path(swath_sysid.__file__).read_text(encoding='utf-8')
    for_checkers = re.findall(r'^    from swath_sysid\.\S+ import (\w+) as \1$', text, re.MULTILINE)
    assert are_those(sorted(for_checkers), sorted(swath_sysid.__all__))
    loaded = loaded_by('swath_sysid')
    assert {name for name in loaded if name.startswith('swath_sysid.')} == set()
    assert loaded & {'numpy', 'typing', 'dataclasses', 'inspect'} <= loaded_by('os')
    assert set(swath_sysid.__all__) < set(dir(swath_sysid))
    with pytest.raises(AttributeError, match="module 'swath_sysid' has no attribute 'forcast'"):
        _ = swath_sysid.forcast


RECORD = str(swath_sysid.share_folder() / 'records' / 'kvlcc2_roll_decay.csv')
HULL = swath_sysid.hull_named('swath-roll')
KNOWN = swath_sysid.IdentifiedModel.exactly(HULL.model)
TIME = np.arange(0.0, 10.0, 0.1)
TRIAL = swath_sysid.Trial(TIME, roll=list(0.1 * np.cos(2.0 * TIME)), pitch=0.0 * TIME)
api = swath_sysid


@pytest.mark.parametrize(
    ('call', 'right'),
    [
        (lambda: api.read_trial(None), 'must be a path, not None'),
        (lambda: api.read_trial([RECORD]), 'must be a path, not a list with a str'),
        (lambda: api.read_trial(RECORD, mounting=(0.0, 0.1)), 'mounting must be 3 values, each a number'),
        (lambda: api.read_trial(RECORD, columns='roll'), 'columns must be a mapping from a text to a text or None'),
        (lambda: api.Trial('abc'), 'time must be an array of numbers'),
        (lambda: api.Trial(TIME, roll=[[1.0], ['a']]), 'roll must be an array of numbers or None'),
        (lambda: api.Trial(TIME, roll=[1.0, 2.0]), 'roll has the shape'),
        (lambda: TRIAL.between('start', 3.0), 'Trial.between: start must be a number or None'),
        (lambda: TRIAL.axis(0), 'Trial.axis: name must be a text, not 0'),
        (lambda: api.hull_named(HULL), 'name must be a text, not a PublishedHull'),
        (lambda: api.simulate(HULL, 0.1, 0.0, TIME), 'must be a DecayModel, not a PublishedHull: give its model'),
        (lambda: api.simulate(HULL.model, '5 deg', 0.0, TIME), 'angle must be a number'),
        (lambda: api.simulate(HULL.model, 0.1, 0.0, 10.0), 'time must be an array of numbers'),
        (lambda: api.simulate(HULL.model, 0.1, 0.0, []), 'give at least one'),
        (lambda: api.simulated_trial(HULL.model, 0.1, 9.0, noise=0.1), 'noise must be a SensorNoise, not 0.1'),
        (lambda: api.simulated_trial(HULL.model, 0.1, 9.0, seed=1.5), 'seed must be a whole number'),
        (lambda: api.identify(TRIAL), "holds roll and pitch: name the axis to identify, as in axis='roll'"),
        (lambda: api.identify(TRIAL.axis('roll'), axis='pitch'), 'is about roll, not pitch'),
        (
            lambda: api.identify_at_sea(TRIAL, model=HULL),
            'model must be an IdentifiedModel or None, not a Pub',
        ),
        (lambda: api.identify(TIME), 'records must be a Trial, an AxisMotion, a path or a sequence'),
        (lambda: api.identify(TRIAL.axis('roll'), 'odd-cubic'), 'settings must be an IdentificationSettings'),
        (lambda: api.IdentificationSettings(equation=3), 'equation must be a text'),
        (lambda: api.IdentificationSettings(start=True), 'start must be a number or None, not True'),
        (lambda: api.IdentifiedModel.exactly(HULL), 'must be a DecayModel, not a PublishedHull: give its model'),
        (lambda: api.write_model(KNOWN, 'craft.yaml'), 'path must be a path, not an IdentifiedModel'),
        (
            lambda: api.write_model('craft.yaml', HULL.model),
            'an Identification, an AtSeaIdentification, an IdentifiedModel or',
        ),
        (lambda: api.run_through(RECORD), 'read it with read_trial'),
        (lambda: api.run_through(TRIAL, api.PipelineSettings()), 'not a PipelineSettings: give its forecaster'),
        (lambda: api.run_through(TRIAL, models='craft.yaml'), 'read it with read_model'),
        (lambda: api.run_through(TRIAL, clock=0.0), 'clock must be a function or None'),
        (lambda: api.samples_of(TIME), 'trial must be a Trial'),
        (lambda: api.score(TRIAL, 3), 'run must be a Run, not 3'),
        (lambda: api.ForecastPipeline(api.ForecasterSettings()), 'settings must be a PipelineSettings or None'),
        (lambda: api.ForecastPipeline().add(TRIAL), 'takes one ImuReading at a time'),
        (lambda: api.ForecastPipeline().set_models({'roll': HULL.model}), 'not a dict with a DecayModel in it'),
        (lambda: api.ForecasterSettings(leads=1.0), 'leads must be a sequence, each item a number'),
        (lambda: api.fit_sea(TRIAL), 'request must be a SeaRequest'),
        (lambda: api.read_upstream(RECORD, 'accel_z'), 'names must be a sequence, each item a text'),
    ],
)
def test_arguments_of_a_wrong_kind_are_rejected_with_the_right_one(call, right):
    with pytest.raises(swath_sysid.InputError, match=re.escape(right)):
        call()


@pytest.mark.parametrize('given', [RECORD, Path(RECORD), swath_sysid.read_trial(RECORD)], ids=['text', 'path', 'trial'])
def test_a_record_is_identified_and_its_model_kept_in_a_line_each(given, tmp_path):
    quick = swath_sysid.IdentificationSettings(equation='linear', start=5.0, end=40.0)
    found = swath_sysid.identify(given, quick, axis='roll')
    swath_sysid.write_model(tmp_path / 'craft.yaml', found)
    kept = swath_sysid.read_model(tmp_path / 'craft.yaml')['roll']
    assert kept.model.ratios == pytest.approx(found.model.ratios)
    assert len(kept.provenance['sources'][0]['sha256']) == 64
    swath_sysid.write_model(tmp_path / 'copy.yaml', kept)
    assert (tmp_path / 'copy.yaml').read_text() == (tmp_path / 'craft.yaml').read_text()
    assert pickle.loads(pickle.dumps(swath_sysid.identify)) is swath_sysid.identify


@pytest.mark.long
def test_the_notebook_runs(monkeypatch, capsys):
    drawn = []
    monkeypatch.setattr('matplotlib.pyplot.show', lambda: drawn.append(len(matplotlib.pyplot.gca().lines)))
    cells = json.loads((ROOT / 'examples' / 'first_forecast.ipynb').read_text(encoding='utf-8'))['cells']
    code, names = [''.join(cell['source']) for cell in cells if cell['cell_type'] == 'code'], {}
    assert set(re.findall(r'(?:from|import) (swath_sysid\S*)', ''.join(code))) == {'swath_sysid'}
    assert [len(cell['outputs']) for cell in cells if cell['cell_type'] == 'code'] == [0, 1, 1, 2]
    for cell in code:
        exec(cell, names)
        matplotlib.pyplot.close('all')
    assert drawn == [2, 2]
    roll = names['skill'].axes['roll']
    assert (roll.ratio < 1.0).all() and '1 s ahead' in capsys.readouterr().out
    assert names['found'].verdict.level == 'adequate'
    assert sum(bool(line.strip()) for cell in code for line in cell.splitlines()) <= 40
