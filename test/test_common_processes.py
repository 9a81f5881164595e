"""Tasks over processes: results in order, whoever did them."""

import os
import time

import pytest

from swath_sysid.common.processes import processes, results_in_order


def square_and_process(number):
    if number < 0:
        raise ValueError('negative')
    return number**2, os.getpid()


@pytest.mark.parametrize('count', [1, 2, 3])
def test_results_come_in_order(count):
    found = list(results_in_order(square_and_process, list(range(7)), count))
    assert [value for value, _ in found] == [n * n for n in range(7)]
    assert found[0][1] == os.getpid()


def test_an_error_comes_where_its_result_would():
    results = results_in_order(square_and_process, [3, -1, 2], 2)
    assert next(results)[0] == 9
    with pytest.raises(ValueError, match='negative'):
        next(results)


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


def test_one_process_is_this_one_and_several_are_others():
    with processes(1) as executor:
        assert executor.submit(square_and_process, 2).result() == (4, os.getpid())
    with processes(2) as executor:
        value, process = executor.submit(square_and_process, 2).result()
    assert value == 4 and process != os.getpid()
