"""The catalogue of sentences: every one is used, every value filled, none too long, every flag at a code there is."""

import ast
from pathlib import Path
from string import Formatter

import pytest

import swath_sysid
from swath_sysid.common.advice import Advice
from swath_sysid.common.sentences import FLAGS, SENTENCES

LONGEST = 300
PACKAGE = Path(swath_sysid.__file__).parent
CATALOGUE = PACKAGE / 'common' / 'sentences.py'


@pytest.fixture(scope='module')
def nodes():
    """Every node of the syntax trees of the package, but those of the catalogue itself."""
    trees = [ast.parse(path.read_text(encoding='utf-8')) for path in PACKAGE.rglob('*.py') if path != CATALOGUE]
    return [node for tree in trees for node in ast.walk(tree)]


def values_of(key):
    """Names of the values of a sentence, with their formats."""
    return {name: spec for _, name, spec, _ in Formatter().parse(SENTENCES[key]) if name is not None}


def test_every_value_is_filled(nodes):
    calls = [node for node in nodes if isinstance(node, ast.Call) and ast.unparse(node.func) == 'Advice.of']
    assert len(calls) > 60
    for call in calls:
        if isinstance(call.args[0], ast.Constant):
            key = call.args[0].value
            assert key in SENTENCES and {each.arg for each in call.keywords} == set(values_of(key)), key


def test_every_sentence_is_used_and_every_flag_is_at_a_code(nodes):
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert set(SENTENCES) <= texts
    assert set(FLAGS) <= texts | {key.partition(':')[0] for key in SENTENCES}


def test_sentences_are_filled_and_not_too_long():
    for key in SENTENCES:
        advice = Advice.of(key, **{name: 12.345 if spec else 'a name' for name, spec in values_of(key).items()})
        assert advice.code == key.partition(':')[0] and advice.code.replace('-', '').isalnum()
        assert len(advice.message) <= LONGEST and '{' not in advice.message, key
