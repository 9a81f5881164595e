"""Whatever text comes: a model, or one sentence, soon, and nothing else."""

import os
import re

import pytest
import yaml
from hostile_manoeuvring_models import manoeuvring_text, manoeuvring_texts
from hostile_models import attitude_text, attitude_texts
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats import schema
from swath_sysid.formats import schema as untrusted_yaml
from swath_sysid.formats.files import shown
from swath_sysid.formats.model_file import description_from_yaml, model_to_yaml, read_model
from swath_sysid.formats.schema import LARGEST_TEXT, dumped, plain_content, text_of
from swath_sysid.manoeuvring.formats.model_file import (
    manoeuvring_from_yaml,
    manoeuvring_to_yaml,
    read_manoeuvring_model,
)
from swath_sysid.tank.campaign.manifest import read_manifest

READERS = {'attitude': description_from_yaml, 'manoeuvring': manoeuvring_from_yaml}
VALID = {'attitude': attitude_text(), 'manoeuvring': manoeuvring_text()}
HOSTILE = {'attitude': attitude_texts(), 'manoeuvring': manoeuvring_texts()}
CASES = [(kind, name) for kind, texts in HOSTILE.items() for name in texts]

#: characters; a sentence may list the names there are, and shows at most 80 of a value
LONGEST_SENTENCE = 600


def refusal(read, text):
    with pytest.raises(InputError) as caught:
        read(text, 'the model')
    sentence = str(caught.value)
    assert '\n' not in sentence and len(sentence) < LONGEST_SENTENCE
    return sentence


@pytest.mark.parametrize(('kind', 'name'), CASES)
def test_hostile_texts_are_refused_by_the_field(kind, name):
    text, words = HOSTILE[kind][name]
    assert re.search(words, refusal(READERS[kind], text))


@pytest.mark.parametrize(
    'words',
    [
        ['scale', 'PATH', '--ratio', '2', '--output', 'OUT'],
        ['simulate', '--model', 'PATH', '--initial-angle-deg', '3', '--output', 'OUT'],
        ['forecast', 'TRIAL', '--model', 'PATH'],
        ['manoeuvre', 'simulate', '--model', 'PATH', '--test', 'programme', '--output', 'OUT'],
        ['campaign', 'PATH', '--output', 'OUT'],
    ],
)
def test_every_verb_refuses_a_deep_file(words, tmp_path, capsys):
    path, trial = tmp_path / 'deep.yaml', tmp_path / 'trial.csv'
    path.write_text('a: ' + '[' * 100_000)
    trial.write_text('time_s,pitch_deg\n' + ''.join(f'{k / 10},{k % 7}\n' for k in range(200)))
    named = {'PATH': str(path), 'OUT': str(tmp_path / 'out.csv'), 'TRIAL': str(trial)}
    assert main([named.get(word, word) for word in words]) == 2
    sentence = capsys.readouterr().err
    assert 'deep' in sentence and sentence.count('\n') == 1 and 'Traceback' not in sentence
    assert not (tmp_path / 'out.csv').exists()


SCALARS = st.one_of(
    st.none() | st.booleans() | st.text(max_size=30) | st.dates() | st.binary(max_size=20),
    st.floats() | st.integers(-(10**50), 10**50) | st.sampled_from(['1e999', '-0', '1_0', '0x10', '.5', '12:30:00']),
    st.sampled_from(['.nan', '-.inf', '!!int x', '&a b', '*a', '~', '<<', '2024-13-45', "'", '"', '{', '[', '%']),
)


@st.composite
def mutated(draw, text):
    """A model file with something cut off, flipped, replaced, doubled or left out."""
    how = draw(st.sampled_from(['cut', 'flip', 'scalar', 'scalar', 'scalar', 'line', 'lines', 'insert']))
    place = draw(st.integers(0, len(text) - 1))
    if how == 'cut':
        return text[:place]
    if how == 'flip':
        return text[:place] + chr(ord(text[place]) ^ 2 ** draw(st.integers(0, 6))) + text[place + 1 :]
    if how == 'insert':
        return text[:place] + draw(st.text(max_size=5)) + text[place:]
    lines = text.splitlines()
    if how == 'line':
        del lines[place % len(lines)]
    elif how == 'lines':
        lines.insert(place % len(lines), lines[draw(st.integers(0, len(lines) - 1))])
    else:
        scalars = list(re.finditer(r'(?<=[:\[,-] )[^,:{}\[\]\n]+', text))
        match = scalars[place % len(scalars)]
        return text[: match.start()] + str(draw(SCALARS)) + text[match.end() :]
    return '\n'.join(lines)


def structures():
    names = st.one_of(st.sampled_from(['format', 'axes', 'pitch', 'ratios', 'b1', 'value']), st.text(max_size=5))
    plain = st.recursive(
        st.one_of(st.floats(), st.integers(), st.none(), st.booleans(), st.text(max_size=10), st.dates()),
        lambda inner: st.one_of(st.lists(inner, max_size=5), st.dictionaries(names, inner, max_size=5)),
        max_leaves=30,
    )
    headed = plain.map(lambda content: {'format': 'swath_sysid decay model', 'version': 1, 'axes': content})
    return st.one_of(plain, headed).map(lambda content: yaml.safe_dump(content, allow_unicode=True))


def texts_for(kind):
    marks = st.text(alphabet='[]{}:,-&*!|>%@`"\' \n#?a1')
    return st.one_of(mutated(VALID[kind]), mutated(VALID[kind]), structures(), st.text(), marks)


EVERY_TEXT = settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))
WRITERS = {
    'attitude': lambda found: model_to_yaml(found[0]) if found[0] and not found[1] else None,
    'manoeuvring': manoeuvring_to_yaml,
}


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize('kind', READERS)
@EVERY_TEXT
@given(data=st.data())
def test_a_text_is_a_model_or_one_sentence(kind, data):
    text = data.draw(texts_for(kind))
    try:
        found = READERS[kind](text, 'the model')
    except InputError as error:
        assert '\n' not in str(error) and len(str(error)) < LONGEST_SENTENCE
    else:
        # what is accepted is a model that can be written, and read again as the same
        again = WRITERS[kind](found)
        if again is not None:
            assert WRITERS[kind](READERS[kind](again, 'the model')) == again


@pytest.mark.long
@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_a_manifest_is_one_or_one_sentence(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp('manifest')
    (folder / 'pitch_3deg.csv').write_text('')
    text = data.draw(st.one_of(mutated(MANIFEST), mutated(MANIFEST), structures(), st.text()))
    path = folder / 'campaign.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogatepass'))
    try:
        found = read_manifest(path)
    except InputError as error:
        assert str(path) in str(error)
    else:
        assert found.trials


MANIFEST = """\
title: Pitch
craft: {name: model, draft_m: 0.15, displacement_kg: 30}
axis: pitch
equations: [linear, odd-cubic]
objectives: [simulation, one-step]
search: {algorithm: ga, seed: 1, generations: 20, population: 50}
trials:
  - {file: pitch_3deg.csv, initial_angle_deg: 3, repeat: 1, start_s: 0.5, end_s: 9.0, frame: flu}
  - {pattern: 'pitch_{angle}deg.csv', draft_factor: 0.9}
"""


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
    texts = [text for text, _ in HOSTILE['attitude'].values() if len(text) < 20_000] + list(VALID.values())

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
    monkeypatch.setattr(untrusted_yaml, '_PARSER', yaml.SafeLoader)
    assert outcomes() == by_library


def test_files_that_are_none(tmp_path):
    large = tmp_path / 'large.yaml'
    large.write_text('# ' * LARGEST_TEXT)
    binary = tmp_path / 'binary.yaml'
    binary.write_bytes(b'\xff\xfe\x00')
    pipe = tmp_path / 'pipe.yaml'
    os.mkfifo(pipe)
    for path, words in (
        (large, 'larger than 256 kB'),
        (binary, 'not text in UTF-8'),
        (tmp_path, 'is a folder'),
        ('/dev/zero', 'a special file'),
        (pipe, 'a special file'),
        (tmp_path / ('x' * 300), 'cannot read'),
        (tmp_path / 'a\0b', 'no file has such a name'),
        (tmp_path / 'absent', 'cannot read'),
    ):
        for read in (text_of, read_model, read_manoeuvring_model, read_manifest):
            with pytest.raises(InputError, match=words):
                read(path)


def test_limits_are_those_that_the_sentences_name():
    plain_content('[' * 20 + ']' * 20, 'x')
    plain_content(f'[{",".join(7999 * "1")}]', 'x')
    schema.text()('a' * 200, 'x')
    assert len(shown('a' * 500)) == 80
    for build, words in (
        (lambda: plain_content('[' * 21 + ']' * 21, 'x'), 'more than 20 deep'),
        (lambda: plain_content(f'[{",".join(8000 * "1")}]', 'x'), 'more than 8000 values'),
        (lambda: schema.text()('a' * 201, 'x'), 'at most 200 characters'),
    ):
        with pytest.raises(InputError, match=words):
            build()
