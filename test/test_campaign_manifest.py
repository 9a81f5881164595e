"""Manifests: five lines for a folder, and every fault named with its entry."""

import pytest

from swath_sysid.campaign.manifest import (
    new_manifest,
    pattern_expression,
    pattern_of_name,
    read_manifest,
    write_new_manifest,
)
from swath_sysid.common.errors import InputError

NAMES = [f'pitch_{angle}deg_repeat{repeat}.csv' for angle in ('3', '8.4') for repeat in (1, 2)]
ONE = 'trials: [{file: pitch_3deg_repeat1.csv}]\n'


@pytest.fixture
def folder(tmp_path):
    """A folder of named files; a manifest does not look into them."""
    for name in NAMES:
        (tmp_path / name).write_text('time_s,pitch_deg\n')
    return tmp_path


def read(folder, text):
    path = folder / 'campaign.yaml'
    path.write_text(text)
    return read_manifest(path)


def test_five_lines_for_a_folder(folder):
    entry = "trials: [{pattern: 'pitch_{angle}deg_repeat{repeat}.csv', draft_factor: 0.9}]\n"
    found = read(folder, 'craft: {name: model, draft_m: 0.15}\naxis: pitch\n' + entry)
    assert found.faults == () and found.title == 'model' and found.craft.draft_m == 0.15
    told = sorted((t.path.name, t.axis, t.loading, t.initial_angle_deg, t.repeat) for t in found.trials)
    assert told == [
        (name, 'pitch', ('draft_factor', 0.9), angle, repeat)
        for name, angle, repeat in zip(NAMES, (3.0, 3.0, 8.4, 8.4), (1, 2, 1, 2), strict=True)
    ]


def test_patterns_tell_folder_axis_and_draft(tmp_path):
    for place, name in (('a/x', 'roll_0,9T_5deg_r1.csv'), ('b/y', 'pitch_1.1T_-3deg_r2.csv')):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / name).write_text('')
    (tmp_path / 'sub').mkdir()
    found = read(tmp_path / 'sub', "trials: [{pattern: '../*/?/{axis}_{draft_factor}T_{angle}deg_r{repeat}.csv'}]")
    told = {(t.axis, t.loading[1], t.initial_angle_deg, t.repeat) for t in found.trials}
    assert told == {('roll', 0.9, 5.0, 1), ('pitch', 1.1, -3.0, 2)}
    absolute = read(tmp_path / 'sub', f"axis: roll\ntrials: [{{pattern: '{tmp_path}/a/x/*.csv', repeat: 1}}]")
    assert [t.path.name for t in absolute.trials] == ['roll_0,9T_5deg_r1.csv']


FAULTS = [
    ('  - file: absent.csv\n', 'file not found'),
    ('  - file: pitch_3deg_repeat1.csv\n    repeat: 9\n', 'already given in trials, 1'),
    ('  - {file: pitch_8.4deg_repeat1.csv, initial_angle_deg: 3, repeat: 1}\n', 'same condition and repeat'),
    ('  - file: pitch_3deg_repeat2.csv\n    angel_deg: 3\n', "unknown field 'angel_deg'"),
    ('  - {file: pitch_3deg_repeat2.csv, axis: yaw}\n', "no axis 'yaw'"),
    ('  - {file: pitch_3deg_repeat2.csv, frame: ned}\n', "no frame 'ned'"),
    ('  - {file: pitch_3deg_repeat2.csv, draft_factor: large}\n', 'is not a number'),
    ('  - {file: pitch_3deg_repeat2.csv, draft_factor: 1, draft_m: 0.1}\n', 'give one of'),
    ('  - {file: pitch_3deg_repeat2.csv, repeat: 1.5}\n', 'whole number'),
    ('  - {file: pitch_3deg_repeat2.csv, start_s: 5, end_s: 2}\n', 'start_s must lie before'),
    ("  - {pattern: 'roll_{angle}.csv'}\n", 'no file matches'),
    ("  - {pattern: 'pitch_{wind}.csv'}\n", "unknown placeholder '{wind}'"),
    ("  - {pattern: 'pitch_{angle}deg_repeat2.csv', initial_angle_deg: 3}\n", 'both by the pattern and beside'),
    ('  - {axis: pitch}\n', "'file:' or 'pattern:'"),
    ('  - just words\n', 'names and values'),
]


@pytest.mark.parametrize('entry, words', FAULTS)
def test_a_bad_entry_is_named_and_the_rest_is_kept(folder, entry, words):
    good = '  - {file: pitch_3deg_repeat1.csv, initial_angle_deg: 3, repeat: 1}\n'
    found = read(folder, f'axis: pitch\ntrials:\n{good}{entry}')
    assert words in found.faults[0] and found.faults[0].startswith('trials, 2')
    assert found.trials[0].path.name == 'pitch_3deg_repeat1.csv'
    assert len(found.trials) == 1


@pytest.mark.parametrize(
    'text, words',
    [
        ('axis: [pitch', 'line 1 is not YAML'),
        ('- a\n- b\n', "must hold 'trials:'"),
        ('', "must hold 'trials:'"),
        ('axis: pitch\n', "'trials:' must list"),
        (f'axis: heave\n{ONE}', "axis: there is no axis 'heave'"),
        (f'axis: pitch\nsearch: {{preset: unheard}}\n{ONE}', 'search: there is no preset'),
        (f'axis: pitch\nobjectives: [luck]\n{ONE}', "objectives, 1: there is no objective 'luck'"),
        (f'axis: pitch\nequations: [luck]\n{ONE}', "equations, 1: there is no equation 'luck'"),
        ('trials: [{file: absent.csv}]\n', 'no trial is left to use: trials, 1: file not found'),
        (ONE, 'no axis is given'),
        (f'axis: pitch\nequatoins: [linear]\n{ONE}', "'equations' is meant?"),
        (f'craft: {{lenght_m: 1.2}}\n{ONE}', "craft: unknown field 'lenght_m'"),
        (f'axis: roll\nuncertainty: {{mass: 2}}\n{ONE}', 'within 0 and 1'),
        (f'axis: roll\npredictions: [{{method: CFD, amplitude_deg: 5}}]\n{ONE}', 'damping_n_m_s or damping_ratio'),
        (f'axis: roll\npredictions: [{{amplitude_deg: 5}}]\n{ONE}', "'method' is missing"),
        (f'craft: {{name: 007}}\n{ONE}', 'craft, name: '),
        ('trials: [{file: pitch_3deg_repeat1.csv, repeat: 1, repeat: 2}]\n', "trials, 1: 'repeat' is given twice"),
    ],
)
def test_what_concerns_all_trials_stops_at_once_with_its_keys(folder, text, words):
    with pytest.raises(InputError, match='campaign.yaml') as caught:
        read(folder, text)
    assert words in str(caught.value)


def test_the_simulation_objective_is_never_left_out(folder):
    found = read(folder, 'axis: pitch\nobjectives: [one-step]\ntrials: [{file: pitch_3deg_repeat1.csv}]\n')
    assert found.objectives == ('simulation', 'one-step')


def test_a_new_manifest_reads_back(folder):
    for name in ('odd one.csv', 'single 8deg 0.25m.csv'):
        (folder / name).write_text('')
    write_new_manifest(folder, folder / 'new.yaml')
    found = read_manifest(folder / 'new.yaml')
    assert found.faults == ()
    assert {t.path.name for t in found.trials} == {*NAMES, 'odd one.csv', 'single 8deg 0.25m.csv'}
    assert {(t.initial_angle_deg, t.repeat) for t in found.trials} >= {(3.0, 1), (8.4, 2), (8.0, None)}
    assert ('draft_m', 0.25) in {t.loading for t in found.trials}
    with pytest.raises(InputError, match='exists already'):
        write_new_manifest(folder, folder / 'new.yaml')
    (folder / 'empty').mkdir()
    for name, words in (('empty', 'holds no trial'), ('absent', 'is not a folder')):
        with pytest.raises(InputError, match=words):
            new_manifest(folder / name)


@pytest.mark.parametrize(
    'name, pattern',
    [
        ('pitch_8.4deg_repeat1.csv', '{axis}_{angle}deg_repeat{repeat}.csv'),
        ('roll_5deg_0.9T_run12.mcap', '{axis}_{angle}deg_{draft_factor}T_run{repeat}.mcap'),
        ('decay_8deg_0.25m.csv', 'decay_{angle}deg_{draft}m.csv'),
        ('1.5m_s_5deg_300mm.csv', '1.5m_s_{angle}deg_300mm.csv'),
        ('30kg-trial3.csv', '{displacement}kg-trial{repeat}.csv'),
        ('notes.csv', 'notes.csv'),
    ],
)
def test_patterns_are_told_from_names(name, pattern):
    assert pattern_of_name(name) == pattern
    assert pattern_expression(pattern).fullmatch(name)


def test_what_was_tried_in_which_water(folder):
    found = read(
        folder,
        (
            'craft: {name: model, gm_transverse_m: 0.05, water_temperature_c: -1, appendages: bilge keels, basin: '
            'long}\naxis: roll\n'
            'uncertainty: {mass: 0.01}\n'
            'predictions:\n'
            '  - {method: Ikeda, amplitude_deg: 5, damping_ratio: 0.06}\n'
            'trials:\n'
            '  - {file: pitch_3deg_repeat1.csv, speed_m_s: 1.5, mass_kg: 30, gm_m: 0.04, inertia_kg_m2: 2}\n'
        ),
    )
    assert found.faults == ()
    assert (found.craft.gm_transverse_m, found.craft.water_temperature_c, found.craft.basin) == (0.05, -1.0, 'long')
    assert found.uncertainty.mass == 0.01
    assert (found.predictions[0].method, found.predictions[0].damping_ratio) == ('Ikeda', 0.06)
    (trial,) = found.trials
    assert (trial.speed_m_s, trial.mass_kg, trial.gm_m, trial.inertia_kg_m2) == (1.5, 30.0, 0.04, 2.0)
