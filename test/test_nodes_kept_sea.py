"""The file of what was learnt of the sea, as the predictor keeps it."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy')


from swath_sysid.attitude.prediction.sea_memory import SeaMemory
from swath_sysid.attitude.prediction.state_space import InnovationsModel
from swath_sysid.formats.sea_memory_file import read_sea_memory, write_sea_memory
from swath_sysid.nodes.kept_sea import PARAMETER, KeptSea
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline


def memory(decay):
    """Of a roll that forgets itself."""
    one = np.eye(1)
    model = InnovationsModel(('roll',), (0,), 0.1, np.zeros(1), np.ones(1), decay * one, 0.5 * one, one, one, one)
    return SeaMemory(3.0, 120.0, model)


class Node:
    """What of a node is asked for: its service and its timer."""

    def create_service(self, kind, name, answer):
        self.name, self.ask = name, lambda: answer(kind.Request(), kind.Response())

    def create_timer(self, period, call, clock):
        self.now_and_then = call


def kept(path, pipeline=None):
    pipeline = pipeline or ForecastPipeline()
    node, health = Node(), PredictorHealth('imu/data', pipeline)
    return SimpleNamespace(node=node, pipeline=pipeline, health=health, sea=KeptSea(node, str(path), pipeline, health))


def test_what_was_learnt_is_there_at_the_next_start(tmp_path):
    path = tmp_path / 'craft.sea.npz'
    first = kept(path)
    assert first.node.name == '~/save_memory' and not first.node.ask().success and not path.exists()
    first.pipeline.remember(memory(0.5))
    assert first.node.ask().success and read_sea_memory(path).waves.a == 0.5
    assert kept(path).pipeline.memory.waves.a == 0.5


def test_only_what_is_new_is_written(tmp_path):
    path = tmp_path / 'craft.sea.npz'
    write_sea_memory(memory(0.5), path)
    again, before = kept(path), path.stat().st_mtime_ns
    assert again.sea.keep() == '' and path.stat().st_mtime_ns == before
    again.pipeline.remember(memory(0.6))
    again.node.now_and_then()
    assert read_sea_memory(path).waves.a == 0.6


def test_a_file_that_cannot_be_used_is_reported_and_left_alone(tmp_path):
    path = tmp_path / 'craft.sea.npz'
    path.write_text('not mine')
    refused = kept(path)
    refused.pipeline.remember(memory(0.5))
    assert 'could not be read' in refused.node.ask().message and path.read_text() == 'not mine'
    assert refused.health.counts['bad-sea-memory'] == 1


def test_a_folder_that_cannot_be_written_is_reported(tmp_path):
    lost = kept(tmp_path / 'absent' / 'craft.sea.npz')
    lost.pipeline.remember(memory(0.5))
    assert 'cannot write' in lost.sea.keep() and lost.health.counts['sea-not-saved'] == 1


def test_without_a_file_nothing_is_kept():
    none = kept('')
    none.pipeline.remember(memory(0.5))
    assert PARAMETER in none.node.ask().message
