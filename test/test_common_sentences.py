"""The catalogue of sentences, and tasks over processes."""

import ast
import os
import time
from pathlib import Path
from string import Formatter

import pytest

import swath_sysid
from swath_sysid.attitude.motion import intake, stamps
from swath_sysid.attitude.motion.channels import FINDINGS
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.advice import FLAGS, SENTENCES, Advice
from swath_sysid.common.conditions import CONDITIONS, GROUPS, LEVELS, codes_in
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import processes, results_in_order

LONGEST = 300
PACKAGE = Path(swath_sysid.__file__).parent


@pytest.fixture(scope='module')
def nodes():
    """Every node of the syntax trees of the package."""
    trees = [ast.parse(path.read_text(encoding='utf-8')) for path in PACKAGE.rglob('*.py')]
    return [node for tree in trees for node in ast.walk(tree)]


def values_of(sentence):
    """Names of the values of a sentence, with their formats."""
    return {name: spec for _, name, spec, _ in Formatter().parse(sentence) if name is not None}


def test_every_value_is_filled_every_sentence_used_and_every_flag_at_a_code(nodes):
    calls = [node for node in nodes if isinstance(node, ast.Call) and ast.unparse(node.func) == 'Advice.of']
    assert len(calls) > 60
    for call in calls:
        if isinstance(call.args[0], ast.Constant):
            key = call.args[0].value
            assert key in SENTENCES and {each.arg for each in call.keywords} == set(values_of(SENTENCES[key])), key
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert set(SENTENCES) <= texts
    assert set(FLAGS) <= texts | {key.partition(':')[0] for key in SENTENCES}


def test_sentences_are_filled_and_not_too_long():
    for key in SENTENCES:
        advice = Advice.of(
            key, **{name: 12.345 if spec else 'a name' for name, spec in values_of(SENTENCES[key]).items()}
        )
        assert advice.code == key.partition(':')[0] and advice.code.replace('-', '').isalnum()
        assert len(advice.message) <= LONGEST and '{' not in advice.message, key


def test_every_condition_that_is_noticed_is_a_row_and_every_row_is_noticed(nodes):
    noticed = {f'{each}-{axis}' for axis in AXES for each in (*FINDINGS, 'gate-restarted')}
    noticed |= {
        value for name, value in (vars(stamps) | vars(intake)).items() if name.isupper() and isinstance(value, str)
    }
    assert noticed == set(codes_in('stamps', 'losses', 'intake', 'filters'))
    for call in (node for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
        place = {'note': 0, 'found': 0, 'note_while': 1}.get(call.func.attr, 99)
        if place < len(call.args) and isinstance(call.args[place], ast.Constant):
            code = call.args[place].value
            rows = [rows[code] for rows in GROUPS.values() if code in rows]
            assert rows, code
            values = {each.arg for each in call.keywords}
            assert call.func.attr != 'found' or any(values == set(values_of(row.sentence)) for row in rows), code
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert {code for rows in GROUPS.values() for code in rows} <= noticed | texts


def test_a_row_says_what_to_do_at_a_level_and_when_it_is_warned_of():
    for group, rows in GROUPS.items():
        for code, row in rows.items():
            assert row.level in LEVELS and row.warns in ('always', 'recurring', 'once', 'never'), code
            assert row.unless in ('', *CONDITIONS), code
            assert len(row.sentence + row.cure) <= LONGEST and (row.cure or row.sentence), code
            assert CONDITIONS[code] == row or group.startswith('manoeuvring')


def square_and_process(number):
    if number < 0:
        raise ValueError('negative')
    return number**2, os.getpid()


@pytest.mark.parametrize('count', [1, 2, 3])
def test_results_and_errors_come_in_order(count):
    found = list(results_in_order(square_and_process, list(range(7)), count))
    assert [value for value, _ in found] == [n * n for n in range(7)]
    assert found[0][1] == os.getpid()
    results = results_in_order(square_and_process, [3, -1, 2], 2)
    assert next(results)[0] == 9
    with pytest.raises(ValueError, match='negative'):
        next(results)


@pytest.mark.parametrize('count', [1, 2])
def test_an_executor_gives_results_and_errors_in_this_process_or_in_others(count):
    with processes(count) as executor:
        assert executor.submit(square_and_process, 3).result()[0] == 9
        with pytest.raises(ValueError, match='negative'):
            executor.submit(square_and_process, -1).result()


def wait_for(path):
    """The process that waited for the file, where one is named."""
    while path is not None and not path.exists():
        time.sleep(0.01)
    return os.getpid()


def test_no_process_has_a_second_task_while_another_has_none(tmp_path):
    # the other process holds the last task until this one has done all the rest
    results = results_in_order(wait_for, [None] * 5 + [tmp_path / 'go'], 2)
    assert {next(results) for _ in range(5)} == {os.getpid()}
    (tmp_path / 'go').touch()
    assert next(results) != os.getpid()


def test_processes_that_cannot_share_memory_are_one_sentence(monkeypatch):
    def refused(*_, **__):
        raise OSError(30, 'Read-only file system')

    monkeypatch.setattr('multiprocessing.synchronize.SemLock.__init__', refused)
    with pytest.raises(InputError, match=r'\(Read-only file system\): make /dev/shm writable'), processes(2):
        pass
