"""Whatever text comes: a model, or one sentence, soon, and nothing else."""

import re

import hostile_models as hostile
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.common.errors import InputError
from swath_sysid.common.wings import offered
from swath_sysid.formats import schema
from swath_sysid.formats.files import shown
from swath_sysid.formats.model_file import description_from_yaml, model_to_yaml, read_model
from swath_sysid.formats.schema import dumped, plain_content, text_of

HOSTILE = hostile.attitude_texts()


@pytest.mark.parametrize('name', HOSTILE)
def test_hostile_texts_are_refused_by_the_field(name):
    text, words = HOSTILE[name]
    assert re.search(words, hostile.refusal(description_from_yaml, text))


@pytest.mark.parametrize(
    'words',
    [
        'simulate --model {0}/file.yaml --initial-angle-deg 3 --output {0}/out.csv',
    ],
)
def test_every_verb_refuses_a_deep_file(words, tmp_path, capsys):
    hostile.assert_a_deep_file_is_refused(words, tmp_path, capsys)


@pytest.mark.long
@hostile.EVERY_TEXT
@given(hostile.texts_like(hostile.attitude_text()))
def test_a_text_is_a_model_or_one_sentence(text):
    hostile.assert_a_model_or_one_sentence(
        text, description_from_yaml, lambda found: model_to_yaml(found[0]) if found[0] and not found[1] else None
    )


def test_plain_data_are_read_as_they_are():
    text = 'a: [1, -2, 3.5, 1e-5, .5, true, no, null, ~, "1", on]\nb: {c: 2024-12-24, d: 12:30:00, e: 0x10, f: ""}\n'
    assert plain_content(text, 'it') == {
        'a': [1, -2, 3.5, 1e-5, 0.5, True, False, None, None, '1', True],
        'b': {'c': '2024-12-24', 'd': '12:30:00', 'e': '0x10', 'f': ''},
    }
    assert plain_content('', 'it') is None
    shared = [1, 2]
    assert plain_content(dumped({'a': shared, 'b': shared}), 'it') == {'a': shared, 'b': shared}


words = st.text(st.characters(codec='utf-8'), max_size=20)
plain_data = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**38), 10**38)
    | words
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from(['1e5', '1e-5', '.nan', 'yes', '2024-12-24', '010', '~', '9' * 64, '12e4' * 16, '=', '<<']),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=4)),
    max_leaves=20,
)


@settings(deadline=None)
@given(plain_data)
def test_what_is_written_is_read_back(content):
    assert plain_content(dumped(content), 'it') == content


def test_pure_python_reads_as_the_library_does(monkeypatch):
    """Where libyaml is not built in, the same texts give the same data and are refused for the same reasons."""
    texts = [text for text, _ in HOSTILE.values() if len(text) < 20_000] + [hostile.attitude_text()]

    def outcomes():
        found = []
        for text in texts:
            try:
                found.append(plain_content(text, 'it'))
            except InputError as error:
                # the words about what is not YAML are the parser's own
                found.append(str(error) if 'not YAML' not in str(error) else 'not YAML')
        return found

    by_library = outcomes()
    monkeypatch.setattr(schema, '_PARSER', yaml.SafeLoader)
    assert outcomes() == by_library


def test_files_that_are_none(tmp_path):
    hostile.assert_files_that_are_none_are_refused(tmp_path, text_of, read_model, *offered('read_model'))


def test_limits_are_those_that_the_sentences_name():
    plain_content('[' * 20 + ']' * 20, 'x')
    plain_content(f'[{",".join(7999 * "1")}]', 'x')
    schema.text()('a' * 200, 'x')
    assert len(shown('a' * 500)) == 80
    assert schema.whole(1)(3.0, 'x') == 3 and schema.one_or_more(schema.text())('a', 'x') == ('a',)
    for build, words in (
        (lambda: plain_content('[' * 21 + ']' * 21, 'x'), 'more than 20 deep'),
        (lambda: plain_content(f'[{",".join(8000 * "1")}]', 'x'), 'more than 8000 values'),
        (lambda: schema.text()('a' * 201, 'x'), 'at most 200 characters'),
        (lambda: schema.whole(1)(1.5, 'x'), 'x must be a whole number from 1, not 1.5'),
        (lambda: schema.one_or_more(schema.text())([], 'x'), 'must be a list of names'),
        (lambda: schema.one_of(('a', 'b'), 'letter')('c', 'x'), "there is no letter 'c': choose from a, b"),
        (lambda: schema.named({'a': schema.anything})([], 'x'), 'must be names and values; fields are a'),
    ):
        with pytest.raises(InputError, match=words):
            build()
