"""Texts that are not models, made from one that is: what a broken stick, a wrong tool or a stranger might publish."""

import re

import numpy as np

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.formats.model_file import model_to_yaml

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
