"""Texts that are not manoeuvring models: see hostile_models.py."""

import re

from hostile_models import editor, of_any_kind
from manoeuvring_runs import identified

from swath_sysid.manoeuvring.formats.model_file import manoeuvring_to_yaml


def manoeuvring_text():
    return manoeuvring_to_yaml(identified())


def manoeuvring_texts():
    text = manoeuvring_text()
    edited = editor(text)
    return {
        **of_any_kind(text),
        'a parameter of no kind': (edited('Xuu:', 'Xww:'), "no parameter 'Xww'"),
        'mass 1e300': (edited(r'm: \{value: [^,]*', 'm: {value: 1.0e+300'), 'parameter m'),
        'mass NaN': (edited(r'm: \{value: [^,]*', 'm: {value: .nan'), 'finite'),
        'mass zero': (edited(r'm: \{value: [^,]*', 'm: {value: 0.0'), 'must be positive'),
        'damping 1e300': (edited(r'Xu: \{value: [^,]*', 'Xu: {value: -1.0e+300'), 'parameter Xu'),
        'std a text': (edited(r'std: [0-9][^,]*', "std: 'x'"), "std: 'x' is not a number"),
        'variance negative': (edited(r'- \[1\.0', '- [-1.0'), 'not negative'),
        'not positive': (edited(r'- \[1\.0, 0\.1\]\n- \[0\.1', '- [1.0, 7.0]\n- [7.0'), 'larger than one'),
        'covariance a text': (re.sub(r'covariance:\n.*\n.*', 'covariance: none', text), 'rows'),
        'identified a number': (edited(r'identified: .*', 'identified: 5'), 'identified'),
        'identified twice': (edited(r'identified: .*', 'identified: [Xu, Xu]'), 'twice'),
        'input of no kind': (edited(r'thrust_input: .*', 'thrust_input: [force]'), 'thrust_input'),
        'length a text': (edited(r'length_m: .*', 'length_m: long'), "length_m: 'long' is not a number"),
        'current a date': (edited(r'current_m_s: .*', 'current_m_s: [2024-13-45, 0.0]'), 'current_m_s'),
        'noise negative': (edited(r'noise: .*', 'noise: [-0.05, 0.05, 0.005]'), 'noise'),
        'region exchanged': (edited(r'slowest: [^,]*', 'slowest: 9.0'), 'region'),
        'name a mapping': (edited(r'name: .*', 'name: {a: b}'), 'name'),
    }
