"""The public names: what importing them loads, that their examples run, and that the page of reference lists them."""

import doctest
import functools
import importlib
import inspect
import json
import re
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot
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


@pytest.mark.long
def test_the_notebook_runs(monkeypatch, capsys):
    drawn = []
    monkeypatch.setattr('matplotlib.pyplot.show', lambda: drawn.append(len(matplotlib.pyplot.gca().lines)))
    cells = json.loads((ROOT / 'examples' / 'first_forecast.ipynb').read_text(encoding='utf-8'))['cells']
    code, names = [''.join(cell['source']) for cell in cells if cell['cell_type'] == 'code'], {}
    for cell in code:
        exec(cell, names)
        matplotlib.pyplot.close('all')
    assert drawn == [2, 2]
    roll = names['skill'].axes['roll']
    assert (roll.ratio < 1.0).all() and '1 s ahead' in capsys.readouterr().out
    assert names['found'].verdict.level == 'adequate'
    assert sum(bool(line.strip()) for cell in code for line in cell.splitlines()) <= 40
