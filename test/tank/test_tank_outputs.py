"""Outputs of the wing are looked at before any work: see test_files_outputs.py."""

from test_files_outputs import refusing

from swath_sysid.cli.main import main

test_harmful_outputs_are_refused_and_nothing_changes = refusing(
    [
        'scale {0}/model.yaml --ratio 4 --output scaled.txt',
        'scale {0}/model.yaml --ratio 4 --output {0}/model.yaml',
        'campaign --new {0} --output {0}/trial.csv',
        'campaign {0}/trial.csv --output {0}/trial.csv',
    ]
)


def test_campaign_does_not_write_over_its_trials(measured, tmp_path, capsys):
    trial = tmp_path / 'tables' / 'fits.csv'
    trial.parent.mkdir()
    trial.write_bytes((measured / 'trial.csv').read_bytes())
    (tmp_path / 'c.yaml').write_text('axis: pitch\ntrials:\n  - file: tables/fits.csv\n')
    assert main(['campaign', str(tmp_path / 'c.yaml'), '--output', str(tmp_path), '--jobs', '1']) == 2
    assert 'is to be written' in capsys.readouterr().err
    assert trial.read_bytes() == (measured / 'trial.csv').read_bytes()
