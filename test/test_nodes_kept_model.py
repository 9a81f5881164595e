"""The file of a node's model: what it held before is beside it, and leads back after another start."""

import os

import pytest
from hostile_models import attitude_texts

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.refit import Refitter
from swath_sysid.formats.model_file import model_to_yaml, read_model, write_model
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.pipeline.health import WARN, IdentifierHealth


def model(number):
    terms = {'b1': 0.4, 'r1': 5.0 + number}
    return {'pitch': IdentifiedModel.exactly(DecayModel.from_terms(EQUATIONS['linear'], terms, axis='pitch'))}


def model_file(path):
    return ModelFile(path, read_model, model_to_yaml, write_model, IdentifierHealth())


def restarted(path):
    file = model_file(path)
    return file, Refitter(None, file.read(), file.history())


def took(refitter, models):
    refitter._history.append((refitter.models, refitter.decays))
    refitter.models = models


def test_twenty_files_before_are_kept_and_no_more(tmp_path):
    path = tmp_path / 'craft.yaml'
    file = model_file(path)
    assert file.keep(model(0)) == ''
    for number in range(1, 24):
        assert file.keep(model(number)).endswith(f'kept as {path}.1')
    held = {each.name: read_model(each) for each in tmp_path.iterdir()}
    assert held == {'craft.yaml': model(23)} | {f'craft.yaml.{23 - number}': model(number) for number in range(3, 23)}


def test_the_way_back_outlives_every_restart(tmp_path):
    path = tmp_path / 'craft.yaml'
    write_model(path, model(0))
    path.write_text(path.read_text() + '# of the yard\n')
    by_hand = path.read_text()
    for number in range(1, 4):
        file, refitter = restarted(path)
        took(refitter, model(number))
        file.keep(refitter.models)
    for number in (2, 1):
        file, refitter = restarted(path)
        assert refitter.models == model(number + 1) and refitter.steps_back == number + 1
        assert refitter.rollback() and refitter.models == model(number)
        file.keep(refitter.models)
    file, refitter = restarted(path)
    took(refitter, model(9))
    file.keep(refitter.models)
    file, refitter = restarted(path)
    assert refitter.rollback() and refitter.models == model(1)
    assert refitter.rollback() and refitter.models == model(0)
    assert not refitter.rollback()
    texts = [each.read_text() for each in tmp_path.iterdir()]
    assert by_hand in texts and all(any(model_to_yaml(model(n)) == text for text in texts) for n in (1, 2, 3, 9))


def test_a_file_that_cannot_be_used_is_reported_at_the_start_and_left_as_it_is(tmp_path):
    path = tmp_path / 'craft.yaml'
    for text in ('', *(text for text, _ in attitude_texts().values())):
        path.write_text(text)
        health = IdentifierHealth()
        file = ModelFile(path, read_model, model_to_yaml, write_model, health)
        assert not file.read() and file.history() == []
        told = health.report('none', 0, False)
        assert (told.level, told.values['bad-model-file']) == (WARN, 1) and str(path) in told.message
        assert 'could not be read' in file.keep(model(1)) and path.read_text() == text
    for unusable in (tmp_path, '/dev/zero'):
        assert model_file(unusable).read() is None


class Killed(BaseException):
    pass


@pytest.mark.parametrize('following', [model(7), {}])
@pytest.mark.parametrize('step', range(5))
def test_killed_at_any_step_all_is_still_there(tmp_path, monkeypatch, step, following):
    path = tmp_path / 'craft.yaml'
    file = model_file(path)
    for number in range(4):
        file.keep(model(number))
    replace, left = os.replace, [step]

    def replace_until_killed(*names):
        if not left[0]:
            raise Killed
        left[0] -= 1
        replace(*names)

    monkeypatch.setattr(os, 'replace', replace_until_killed)
    try:
        file.keep(following)
    except Killed:
        pass
    monkeypatch.undo()
    found = [read_model(each) for each in tmp_path.iterdir() if each.is_file()]
    assert all(model(number) in found for number in range(4))
    assert not following or read_model(path) in (model(3), following)
    file, refitter = restarted(path)
    file.keep(model(8))
    _, refitter = restarted(path)
    back = []
    while refitter.rollback():
        back.append(refitter.models)
    assert [each for each in back if each not in ({}, following)] == [model(number) for number in (3, 2, 1, 0)]
