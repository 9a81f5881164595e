"""Texts that are not models, made from one that is: what a broken stick, a wrong tool or a stranger might publish."""

import os
import re

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import model_to_yaml
from swath_sysid.formats.schema import LARGEST_TEXT

#: characters; a sentence may list the names there are, and shows at most 80 of a value
LONGEST_SENTENCE = 600
EVERY_TEXT = settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))

DEEPER = [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, 12)]
ALIASES = '\n'.join(['a0: &a0 [x, x, x, x, x, x, x, x, x]', *DEEPER])


def attitude_text():
    model = PUBLISHED_HULLS['swath-pitch'].model.with_trim(0.01)
    covariance = np.diag([1e-4, 1e-2, 1e-3, 1.0, 400.0])
    identified = IdentifiedModel(model, covariance, 2e-5, (0.01, 0.1), {'r2': 0.999}, {'seed': 1})
    return model_to_yaml({'pitch': identified})


def editor(text):
    """Replaces the first match of a pattern in a text, which must be there."""

    def edited(pattern, replacement):
        found = re.sub(pattern, replacement, text, count=1)
        assert found != text, pattern
        return found

    return edited


def of_any_kind(text):
    """Texts that are refused whatever they should describe: name to the text and a word of the sentence."""
    return {
        'nothing but a brace': ('{', 'not YAML'),
        'nested brackets': (f'version: {"[" * 5000}{"]" * 5000}', 'deep'),
        'only brackets': ('[' * 250_000, 'deep'),
        'aliases': (f'{text}\n{ALIASES}', 'anchors'),
        'aliases for the version': (re.sub('version: 1', f'{ALIASES}\nversion: *a11', text), 'anchors'),
        'a long list': (f'version: [{"1, " * 80_000}1]', 'values'),
        'a megabyte': (f'version: [{"1, " * 330_000}1]', 'larger than 256 kB'),
        'twenty megabytes': (text + '#' * 20_000_000, 'larger than 256 kB'),
        'a tag of Python': ('!!python/object/apply:os.system [id]', 'tag'),
        'a tag of YAML': (re.sub('version: 1', 'version: !!int abc', text), 'tag'),
        'directives': ('%TAG !a! !b\n' * 15_000, 'directives'),
        'a long number': (re.sub('version: 1', f'version: {"9" * 401}', text), '401 characters'),
        'version true': (re.sub('version: 1', 'version: true', text), 'version True'),
        'version as a number with a point': (re.sub('version: 1', 'version: 1.0', text), 'version 1.0'),
        'version twice': (re.sub('version: 1', 'version: 1\nversion: 1', text), 'given twice'),
        'metrics 5': (re.sub(r'metrics: \{.*?\}', 'metrics: 5', text), 'metrics'),
        'metrics not finite': (re.sub(r'metrics: \{.*?\}', 'metrics: {r2: .inf}', text), 'finite'),
        'two documents': (f'{text}\n---\n{text}', 'second document'),
        'the beginning': (text[: len(text) // 2], ''),
        'all but the end': (text[: text.rindex('provenance')], "'provenance' is missing"),
        'a NUL': (text.replace('version', 'ver\0sion'), 'not YAML'),
        'a long name': (text + 'x' * 1000 + ': 1\n', 'unknown field'),
    }


def attitude_texts():
    text = attitude_text()
    edited = editor(text)
    return {
        **of_any_kind(text),
        'trim a date': (edited(r'trim_rad: .*', 'trim_rad: 2024-13-45'), "trim_rad: '2024-13-45' is not a number"),
        'trim a true date': (edited(r'trim_rad: .*', 'trim_rad: 2024-12-24'), 'trim_rad'),
        'trim NaN': (edited(r'trim_rad: .*', 'trim_rad: .nan'), 'trim_rad: .nan is not a finite number'),
        'trim infinite': (edited(r'trim_rad: .*', 'trim_rad: .inf'), 'trim_rad'),
        'trim beyond all floats': (edited(r'trim_rad: .*', 'trim_rad: 1.0e+999'), 'trim_rad'),
        'trim in degrees': (edited(r'trim_rad: .*', 'trim_rad: 5.0'), 'trim_rad must lie within'),
        'trim a tag': (edited(r'trim_rad: .*', 'trim_rad: !!int abc'), 'tag'),
        'std a text': (edited(r'std: [^,]*', "std: 'x'"), "std: 'x' is not a number"),
        'std negative': (edited(r'std: [^,]*', 'std: -0.01'), 'std must lie within'),
        'std of another model': (edited(r'std: [^,]*', 'std: 77.0'), 'not that of the covariance'),
        'trim_std not finite': (edited(r'trim_std_rad: .*', 'trim_std_rad: .nan'), 'trim_std_rad'),
        'variance NaN': (edited(r'- \[0\.0001', '- [.nan'), 'finite'),
        'variance negative': (edited(r'- \[0\.0001', '- [-0.0001'), 'not negative'),
        'covariance not symmetric': (edited(r'- \[0\.0001, 0\.0', '- [0.0001, 0.0009'), 'symmetric'),
        'covariance too large': (edited(r'- \[0\.0001, 0\.0', '- [0.0001, 0.9'), 'larger than one'),
        'r1 of 1e300': (edited(r'r1: \{value: [^,]*', 'r1: {value: 1.0e+300'), 'ratio r1'),
        'b1 of 1e300': (edited(r'b1: \{value: [^,]*', 'b1: {value: 1.0e+300'), 'ratio b1'),
        'b1 negative': (edited(r'b1: \{value: [^,]*', 'b1: {value: -1.0'), 'ratio b1'),
        'a period of an hour': (edited(r'r1: \{value: [^,]*', 'r1: {value: 3.0e-06'), 'natural period'),
        'a period of 10 ms': (edited(r'r1: \{value: [^,]*', 'r1: {value: 394784.0'), 'natural period|ratio r1'),
        'amplitudes exchanged': (edited(r'valid_amplitude_rad: .*', 'valid_amplitude_rad: [0.1, 0.01]'), 'this order'),
        'equation a list': (edited(r'equation: .*', 'equation: [a, b]'), 'equation'),
        'equation of many characters': (edited(r'equation: .*', f'equation: {"e" * 90_000}'), 'equation'),
        'provenance a text': (edited(r'provenance: .*', 'provenance: none known'), 'provenance'),
        'friction rate zero': (edited(r'friction_rate_rad_s: .*', 'friction_rate_rad_s: 0.0'), 'friction_rate'),
    }


def refusal(read, text):
    with pytest.raises(InputError) as caught:
        read(text, 'the model')
    sentence = str(caught.value)
    assert '\n' not in sentence and len(sentence) < LONGEST_SENTENCE
    return sentence


def assert_a_deep_file_is_refused(words, folder, capsys):
    """By a verb that is given the file, and an output and a record in its folder."""
    (folder / 'file.yaml').write_text('a: ' + '[' * 100_000)
    (folder / 'trial.csv').write_text('time_s,pitch_deg\n' + ''.join(f'{k / 10},{k % 7}\n' for k in range(200)))
    assert main(words.format(folder).split()) == 2
    sentence = capsys.readouterr().err
    assert 'more than 20 deep' in sentence and sentence.count('\n') == 1 and 'Traceback' not in sentence
    assert not [*folder.glob('out*')]


def assert_files_that_are_none_are_refused(folder, *readers):
    (folder / 'large.yaml').write_text('# ' * LARGEST_TEXT)
    (folder / 'binary.yaml').write_bytes(b'\xff\xfe\x00')
    os.mkfifo(folder / 'pipe.yaml')
    for path, words in (
        (folder / 'large.yaml', 'larger than 256 kB'),
        (folder / 'binary.yaml', 'not text in UTF-8'),
        (folder, 'is a folder'),
        ('/dev/zero', 'a special file'),
        (folder / 'pipe.yaml', 'a special file'),
        (folder / ('x' * 300), 'cannot read'),
        (folder / 'a\0b', 'no file has such a name'),
        (folder / 'absent', 'cannot read'),
    ):
        for read in readers:
            with pytest.raises(InputError, match=words):
                read(path)


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


def texts_like(valid):
    """Texts near one that is valid, and others."""
    marks = st.text(alphabet='[]{}:,-&*!|>%@`"\' \n#?a1')
    return st.one_of(mutated(valid), mutated(valid), structures(), st.text(), marks)


def assert_a_model_or_one_sentence(text, read, write):
    """What is accepted is a model that can be written, and read again as the same."""
    try:
        found = read(text, 'the model')
    except InputError as error:
        assert '\n' not in str(error) and len(str(error)) < LONGEST_SENTENCE
    else:
        again = write(found)
        assert again is None or write(read(again, 'the model')) == again
