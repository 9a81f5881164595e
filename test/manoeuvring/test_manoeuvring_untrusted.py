"""Whatever text comes, it is a manoeuvring model or one sentence: see test_files_untrusted.py."""

import re

import pytest
import yaml
from hostile_manoeuvring_models import manoeuvring_text, manoeuvring_texts
from hostile_models import (
    EVERY_TEXT,
    assert_a_deep_file_is_refused,
    assert_a_model_or_one_sentence,
    refusal,
    texts_like,
)
from hypothesis import given

from swath_sysid.formats.schema import plain_content
from swath_sysid.manoeuvring.formats.model_file import manoeuvring_from_yaml, manoeuvring_to_yaml

HOSTILE = manoeuvring_texts()


@pytest.mark.parametrize('name', HOSTILE)
def test_hostile_texts_are_refused_by_the_field(name):
    text, words = HOSTILE[name]
    assert re.search(words, refusal(manoeuvring_from_yaml, text))


def test_a_deep_file_is_refused(tmp_path, capsys):
    words = 'manoeuvre simulate --model {0}/file.yaml --test programme --output {0}/out'
    assert_a_deep_file_is_refused(words, tmp_path, capsys)


@pytest.mark.long
@EVERY_TEXT
@given(texts_like(manoeuvring_text()))
def test_a_text_is_a_model_or_one_sentence(text):
    assert_a_model_or_one_sentence(text, manoeuvring_from_yaml, manoeuvring_to_yaml)


def test_pure_python_reads_a_model_as_the_library_does(monkeypatch):
    by_library = plain_content(manoeuvring_text(), 'it')
    monkeypatch.setattr('swath_sysid.formats.schema._PARSER', yaml.SafeLoader)
    assert plain_content(manoeuvring_text(), 'it') == by_library
