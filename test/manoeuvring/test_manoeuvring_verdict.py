"""Verdicts of manoeuvring models: a real catamaran and what free runs of runs that were not fitted say."""

import json
from dataclasses import replace

import numpy as np
import pytest
from manoeuvring_runs import runs_of

from swath_sysid.cli.main import main
from swath_sysid.manoeuvring.cli import manoeuvre
from swath_sysid.manoeuvring.formats.csv import read_manoeuvring_csv
from swath_sysid.manoeuvring.formats.model_file import read_manoeuvring_model
from swath_sysid.manoeuvring.hull.identified_model import StabilityCheck
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring, judge
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.identification.validation import Scores
from swath_sysid.manoeuvring.motion.intake import prepare_runs

NOISE = np.array([0.01, 0.01, 0.001])
EVEN, ODD = range(0, 16, 2), range(1, 9, 2)


@pytest.fixture(scope='session')
def blueboat(data_folder):
    """Runs of a real catamaran by their number."""
    folder = data_folder.parent / 'blueboat'
    if not folder.is_dir():
        pytest.skip(f'no runs of a real catamaran at {folder}')
    return lambda numbers: prepare_runs([read_manoeuvring_csv(folder / f'run_{k:02}.csv') for k in numbers])


def scores(surge, sway, yaw_rate, diverged=0, rmse=0.1):
    r2 = dict(surge=surge, sway=sway, yaw_rate=yaw_rate)
    return Scores(r2, dict.fromkeys(r2, rmse), {}, {}, 19, diverged)


@pytest.mark.parametrize(
    ('validation', 'level', 'code', 'said'),
    [
        (scores(0.99, 0.83, 0.84), 'adequate', 'adequate', '99% of the surge, 83% of the sway, 84% of the yaw rate'),
        (scores(0.99, 0.45, 0.84), 'doubtful', 'poor-validation', 'sway 0.45'),
        (scores(0.99, 0.45, -0.01), 'rejected', 'poor-validation', 'sway 0.45, yaw rate -0.01'),
        (scores(0.99, -0.63, 0.9, rmse=0.019), 'adequate', 'adequate', ''),
        (scores(0.99, 0.9, 0.9, diverged=2), 'rejected', 'diverged', '2 of 19'),
        (scores(0.99, np.nan, np.nan), 'doubtful', 'not-validated', 'sway and yaw rate'),
        (scores(np.nan, np.nan, 0.9), 'doubtful', 'not-validated', 'surge and sway'),
        (None, 'doubtful', 'no-runs-held-out', 'at least three runs'),
    ],
)
def test_the_gravest_cause_decides(validation, level, code, said):
    noise = NOISE if validation is None or validation.rmse['surge'] > 0.05 else 0.01 * np.ones(3)
    verdict = judge(scores(0.99, 0.9, 0.9), validation, noise, None)
    assert (verdict.level, verdict.code) == (level, code)
    assert said in verdict.sentence
    assert bool(verdict.warnings) == (level != 'adequate')
    assert verdict.metrics['verdict'] == level


def test_what_was_never_measured_is_not_asked_of_the_validation_and_a_model_that_runs_away_is_rejected():
    no_sway = scores(0.99, np.nan, 0.9)
    assert judge(no_sway, no_sway, NOISE, None).level == 'adequate'
    assert judge(no_sway, no_sway, NOISE, None).channels == {'surge': 'adequate', 'yaw_rate': 'adequate'}
    good = scores(0.99, 0.9, 0.9)
    verdict = judge(good, good, NOISE, StabilityCheck(False, False, 0.4, 1.2))
    assert (verdict.level, verdict.code) == ('rejected', 'unstable')
    assert '1.20 m/s' in verdict.sentence


@pytest.mark.release
def test_a_rejected_model_is_written_only_by_force(tmp_path, capsys, monkeypatch):
    """Thrust that does not belong to the motion of the run held out: worse than its mean."""
    runs = runs_of(names=['turns_fast', 'mixed', 'zigzag_20'])
    wrong = replace(runs[2], port=runs[2].starboard, starboard=runs[2].port)
    found = identify_manoeuvring(runs[:2], ManoeuvringSettings(mass=180.0, generations=0), [wrong])
    assert found.verdict.level == 'rejected'
    assert found.verdict.channels['yaw_rate'] == 'rejected'
    monkeypatch.setattr(manoeuvre, 'identify_manoeuvring', lambda *args, **kwargs: found)
    monkeypatch.setattr(manoeuvre, 'read_runs', lambda paths, arguments: list(runs))
    paths = [tmp_path / f'{k}.csv' for k in range(2)]
    for k, path in enumerate(paths):
        path.write_text(f'run {k}')
    model = tmp_path / 'craft.yaml'
    command = ['manoeuvre', 'identify', *map(str, paths), '--output', str(model)]
    assert main(command) == 1
    printed = capsys.readouterr()
    assert 'rejected: the model explains too little' in printed.out
    assert '--force' in printed.err
    assert not model.exists()
    assert main([*command, '--force', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['verdict']['level'] == 'rejected'
    assert read_manoeuvring_model(model).verdict == 'rejected'
    assert read_manoeuvring_model(model).verdict_sentence == found.verdict.sentence


@pytest.mark.release
def test_a_real_catamaran(blueboat):
    """As the runs show it: it sailed for minutes, so it is stable. benchmark/manoeuvring.py leaves some of them out."""
    runs, others = blueboat(EVEN), blueboat(ODD)
    found = identify_manoeuvring(runs, ManoeuvringSettings(lever=0.285), others)
    assert found.stability.stable
    assert found.validation.r2['surge'] >= 0.98
    assert found.validation.r2['sway'] >= 0.80
    assert found.validation.r2['yaw_rate'] >= 0.84
    assert found.verdict.level == 'adequate'
