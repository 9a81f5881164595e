"""The verb ``forecast``: its slips, what it refuses, and its conclusion; the part of the demo without ROS."""

import json
import sys

import hostile_models as hostile
import numpy as np
import pytest
from test_cli import last_line, released, table
from test_files_outputs import refusing

from swath_sysid.cli.main import main
from swath_sysid.share import share_folder

RECORD = str(share_folder() / 'records' / 'kvlcc2_roll_decay.csv')

test_harmful_outputs_are_refused_and_nothing_changes = refusing(
    [
        'forecast {0}/trial.csv --plot {0}/absent/a.png',
        'forecast {0}/trial.csv --model {0}/model.yaml --plot {0}/model.yaml',
    ]
)


def test_a_forecast_of_slow_samples_says_which_leads_were_not_measured(tmp_path, capsys):
    """The pitch of noise has no limit where roll alone is scored, and no flag begins with a digit."""
    time = np.arange(240.0)
    rows = zip(time, 5.0 * np.sin(time / 2.1) + np.sin(time / 1.7), 1e-3 * np.sin(7.0 * time), strict=True)
    path = table(tmp_path / 'ship.csv', 'time_s,roll_deg,pitch_deg', rows)
    assert main(['forecast', str(path), '--leads', '0.5,2', '--axis', 'roll', '--all']) == 0
    out, err = capsys.readouterr()
    assert '[leads-between-samples]' in err and 'motion 0.5 s ahead' in err
    assert 'pitch' not in out and ' = VAR(60)' in out
    assert main(['forecast', str(path), '--until', '20']) == 2
    told = last_line(capsys.readouterr().err)
    assert 'scoring ends at 20 s, within the warm-up' in told and '(--until, --warmup)' in told
    assert main(['forecast', str(path), '--leads', '-1,2']) == 2
    assert 'cannot be -1: give 0.01 to 120 s' in last_line(capsys.readouterr().err)


@pytest.mark.release
@pytest.mark.parametrize(('limit', 'why'), [(1e-6, 'never kept'), (90.0, 'never left')])
def test_a_calm_that_never_changes_is_not_scored(limit, why, capsys):
    assert main(['forecast', RECORD, '--leads', '0.5', '--axis', 'roll', '--quiet-deg', f'{limit},{limit}']) == 0
    told = ' '.join(capsys.readouterr().out.split())
    assert f'not scored, since the craft {why} the limits' in told and 'Brier' not in told and 'F1' not in told


@pytest.mark.long
def test_quiet_leaves_the_conclusion(capsys):
    assert main(['forecast', RECORD, '--leads', '0.5,1', '--axis', 'roll', '--quiet']) == 0
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith('roll: ') and 'of the error of' in first and last.startswith('valid lead')


def test_a_deep_model_and_a_record_that_contradicts_itself_are_refused(tmp_path, capsys):
    hostile.assert_a_deep_file_is_refused('forecast {0}/trial.csv --model {0}/file.yaml', tmp_path, capsys)
    trial = released(tmp_path, '--rate', '25')
    trial.write_text(trial.read_text().replace('pitch_rate_rad_s', 'pitch_rate_deg_s'))
    assert main(['forecast', str(trial)]) == 2
    told = capsys.readouterr().err
    assert 'times the derivative of the pitch angle' in told and 'Traceback' not in told


@pytest.mark.long
def test_the_forecast_of_a_record_uses_the_column_and_refuses_one_that_is_not_there(tmp_path, capsys):
    found, time = [], 0.1 * np.arange(1200)
    rows = zip(time, *np.sin([1.3 * time, 1.3 * time + 5.0]), strict=True)
    path = str(table(tmp_path / 'trial.csv', 'time_s,roll_deg,Bow sonar [m]', rows))
    for flags in ([], ['--upstream', 'Bow sonar [m]']):
        assert main(['forecast', path, '--leads', '1', '--warmup', '90', '--json', *flags]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0] != found[1]
    assert main(['forecast', path, '--upstream', 'sonar']) == 2
    assert "no column 'sonar' for an upstream channel" in ' '.join(capsys.readouterr().err.split())


def test_without_ros_the_measured_sea_is_offered(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    assert main(['demo', '--output', str(tmp_path)]) == 2
    assert 'needs none: --only sea' in capsys.readouterr().err
