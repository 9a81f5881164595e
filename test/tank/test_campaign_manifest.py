"""Manifests: a few lines for a folder, and every fault named with its entry; the store of results."""

import math
import re
import subprocess
import sys

import numpy as np
import pytest
from hostile_models import assert_a_deep_file_is_refused, assert_files_that_are_none_are_refused, mutated, structures
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.tank.campaign.manifest import (
    PLACEHOLDERS,
    pattern_expression,
    read_manifest,
    trials_in_words,
    values_in_name,
)
from swath_sysid.tank.campaign.names import meanings_of, pattern_of
from swath_sysid.tank.campaign.proposal import new_manifest, write_new_manifest
from swath_sysid.tank.campaign.trials import prepared_trials
from swath_sysid.tank.campaign.work import ResultStore, key_of

NAMES = [f'pitch_{angle}deg_repeat{repeat}.csv' for angle in ('3', '8.4') for repeat in (1, 2)]
ONE = 'trials: [{file: pitch_3deg_repeat1.csv}]\n'


@pytest.fixture
def folder(tmp_path):
    for name in NAMES:
        (tmp_path / name).write_text('time_s,pitch_deg\n')
    return tmp_path


def read(folder, text):
    path = folder / 'campaign.yaml'
    path.write_text(text)
    return read_manifest(path)


def test_six_lines_for_a_folder(folder):
    entry = "trials: [{pattern: 'pitch_{angle}deg_repeat{repeat}.csv', draft_factor: 0.9}]\n"
    found = read(folder, 'craft: {name: model, draft_m: 0.15}\naxis: pitch\nobjectives: [one-step]\n' + entry)
    assert found.faults == () and found.title == 'model' and found.craft.draft_m == 0.15
    assert found.objectives == ('simulation', 'one-step')
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
    ('  - file: pitch_3deg_repeat2.csv\n    angel_deg: 3\n', "unknown field 'angel_deg'"),
    ('  - {file: pitch_3deg_repeat2.csv, axis: yaw}\n', "no axis 'yaw'"),
    ('  - {file: pitch_3deg_repeat2.csv, frame: ned}\n', "no frame 'ned'"),
    ('  - {file: pitch_3deg_repeat2.csv, draft_factor: large}\n', 'is not a number'),
    ('  - {file: pitch_3deg_repeat2.csv, draft_factor: 1, draft_m: 0.1}\n', 'give one of'),
    ('  - {file: pitch_3deg_repeat2.csv, repeat: 1.5}\n', 'whole number'),
    ('  - {file: pitch_3deg_repeat2.csv, start_s: 5, end_s: 2}\n', 'start_s must lie before'),
    ("  - {pattern: 'roll_{angle}.csv'}\n", 'no file matches'),
    ("  - {pattern: '{axis}{angle}.csv'}\n", 'no file matches'),
    ("  - {pattern: './/'}\n", 'names no file'),
    (f"  - {{pattern: '{'x/' * 498}*'}}\n", 'is not a pattern'),
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
        (f'axis: roll\nsearch: {{generations: abc}}\n{ONE}', 'generations must be a whole number from 1 to 100000'),
        ('trials: [{file: pitch_3deg_repeat1.csv, start_s: .inf}]\n', 'start_s: .inf is not a finite number'),
        (f'axis: roll\nsearch: {{seed: {{}}}}\n{ONE}', 'one value is expected'),
        (f'axis: roll\nsearch: {{seed: !!python/name:os.system x}}\n{ONE}', 'tag'),
        (f'axis: roll\ncraft: {{draft_m: 1.0e+300}}\n{ONE}', 'draft_m must be at most 1e+09'),
        (f'axis: roll\ntitle: {"x" * 5000}\n{ONE}', 'is not a name'),
        (f'axis: roll\ntitle: {"[" * 5000}\n{ONE}', 'deep'),
    ],
)
def test_what_concerns_all_trials_stops_at_once_with_its_keys(folder, text, words):
    with pytest.raises(InputError, match='campaign.yaml') as caught:
        read(folder, text)
    assert words in str(caught.value) and len(str(caught.value)) < 600 and '\n' not in str(caught.value)


@pytest.mark.parametrize(
    'words', ['campaign {0}/file.yaml --output {0}/out', 'scale {0}/file.yaml --ratio 2 --output {0}/out.yaml']
)
def test_files_that_are_none_or_deep_are_refused(words, tmp_path, capsys):
    assert_a_deep_file_is_refused(words, tmp_path, capsys)
    assert_files_that_are_none_are_refused(tmp_path, read_manifest)


VALID = """\
title: Pitch
craft: {name: model, draft_m: 0.15, displacement_kg: 30}
axis: pitch
equations: [linear, odd-cubic]
objectives: [simulation, one-step]
search: {algorithm: ga, seed: 1, generations: 20, population: 50}
trials:
  - {file: pitch_3deg.csv, initial_angle_deg: 3, repeat: 1, start_s: 0.5, end_s: 9.0, frame: flu}
  - {pattern: 'pitch_{angle}deg.csv', draft_factor: 0.9}
"""


@pytest.mark.long
@settings(max_examples=200, deadline=None)
@given(text=st.one_of(mutated(VALID), mutated(VALID), structures(), st.text()))
def test_a_manifest_is_one_or_one_sentence(text, tmp_path_factory):
    folder = tmp_path_factory.mktemp('manifest')
    (folder / 'pitch_3deg.csv').write_text('')
    path = folder / 'campaign.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogatepass'))
    try:
        found = read_manifest(path)
    except InputError as error:
        assert str(path) in str(error)
    else:
        assert found.trials


def test_columns_are_assigned_for_all_trials_and_for_one(folder):
    shared = "axis: roll\ncolumns: {time: 't:s', roll: 'Phi:deg'}\n"
    found = read(folder, f"{shared}trials: [{{file: {NAMES[0]}}}, {{file: {NAMES[1]}, columns: {{roll: 'x'}}}}]")
    first, second = found.trials
    assert dict(first.columns) == {'time': 't:s', 'roll': 'Phi:deg'} and second.columns == (('roll', 'x'),)


def test_the_page_lists_the_trials_and_what_is_missing(tmp_path):
    angles = {'a1.csv': 5, 'a2.csv': 5, 'b1.csv': 8, 'later.csv': 8}
    for name in list(angles)[:3]:
        (tmp_path / name).write_text(f'# {name}\ntime_s,roll_deg\n0,1\n')
    trials = ''.join(f'  - {{file: {name}, initial_angle_deg: {angle}}}\n' for name, angle in angles.items())
    read(tmp_path, f'axis: roll\ntrials:\n{trials}{trials.splitlines()[0]}')
    rows, missing = trials_in_words(str(tmp_path / 'campaign.yaml'))
    assert [row['file'] for row in rows] == ['a1.csv', 'a2.csv', 'b1.csv']
    assert any('later.csv' in line for line in missing) and 'roll 8 deg: 1 of 2 repeats' in missing
    assert trials_in_words(str(tmp_path / 'none.yaml'))[0] == []


def test_a_new_manifest_reads_back(folder):
    for name in ('odd one.csv', 'single 8deg 0.25m.csv'):
        (folder / name).write_text('')
    (folder / 'elsewhere').mkdir()
    assert main(['campaign', '--new', str(folder), '--output', str(folder / 'elsewhere' / 'new.yaml')]) == 0
    found = read_manifest(folder / 'elsewhere' / 'new.yaml')
    assert found.faults == ()
    assert {t.path.name for t in found.trials} == {*NAMES, 'odd one.csv', 'single 8deg 0.25m.csv'}
    assert {(t.initial_angle_deg, t.repeat, t.loading, t.speed_m_s) for t in found.trials} == {(None,) * 4}
    text = (folder / 'elsewhere' / 'new.yaml').read_text()
    assert "    # draft_m: 0.25   # does '0.25m' mean this?\n" in text
    proposed = "  # - pattern: '../{axis}_{angle}deg_repeat{repeat}.csv'"
    # the second line in place of the first
    believed = text.replace(proposed, proposed.replace('# ', ''))
    believed = believed.replace("  - pattern: '../{axis}_*deg_repeat*.csv'", '  #')
    found = read(folder / 'elsewhere', believed)
    assert {(t.initial_angle_deg, t.repeat) for t in found.trials} >= {(3.0, 1), (8.4, 2)} and not found.faults
    with pytest.raises(InputError, match='exists already'):
        write_new_manifest(folder, folder / 'elsewhere' / 'new.yaml')
    (folder / 'empty').mkdir()
    for name, words in (('empty', 'holds no trial'), ('absent', 'is not a folder')):
        with pytest.raises(InputError, match=words):
            new_manifest(folder / name)


#: Names as tanks give them, and what they may mean, by the key of an entry.
MEANINGS = {
    'pitch_8.4deg_repeat1': 'axis pitch, initial_angle_deg 8.4, repeat 1',
    'roll_5deg_0.9T_run12': 'axis roll, initial_angle_deg 5, draft_factor 0.9, repeat 12',
    'roll_-8deg_R2': 'axis roll, initial_angle_deg -8, repeat 2',
    'roll-8deg-R2': 'axis roll, initial_angle_deg 8, repeat 2',
    'decay_8deg_0.25m': 'initial_angle_deg 8, draft_m 0.25',
    '1.5m_s_5deg_300mm': 'speed_m_s 1.5, initial_angle_deg 5, draft_m 0.3',
    'Rollen_T150mm_V02': 'draft_m 0.15, repeat 2',
    'Versuch_Tiefgang0,15_v1,5m_s_phi8': 'draft_m 0.15, speed_m_s 1.5, initial_angle_deg 8',
    'Tiefgang_15cm_Winkel10_Versuch3': 'draft_m 0.15, initial_angle_deg 10, repeat 3',
    'Krängung 8° T=0,15m': 'initial_angle_deg 8, draft_m 0.15',
    '30kg-trial3': 'displacement_kg 30, repeat 3',
    'Masse31,5kg_10grad': 'displacement_kg 31.5, initial_angle_deg 10',
    'Fn0.3_roll_10deg': 'froude_number 0.3, axis roll, initial_angle_deg 10',
    'draught_0.12_Fr0,25': 'draft_m 0.12, froude_number 0.25',
    'DTC_roll_0kn_run2': 'axis roll, speed_m_s 0, repeat 2',
    'kvlcc2_run2_10kn': 'repeat 2, speed_m_s 5.14444',
    'speed2.0_roll_test07': 'speed_m_s 2, axis roll, repeat 7',
    'u=0.8mps heel12deg': 'speed_m_s 0.8, initial_angle_deg 12',
    '0,75 m-s_6deg_wdh2': 'speed_m_s 0.75, initial_angle_deg 6, repeat 2',
    'draft150_pitch6deg': 'draft_m 0.15, axis pitch, initial_angle_deg 6',
    'Rollen_T150_V01': 'repeat 1',
    'run_v03': 'repeat 3',
    'Versuch_12': 'repeat 12',
    'roll_T0.150_R1': 'axis roll, repeat 1',
    'model_v1.5_roll': 'axis roll',
    '2024-05-03_roll_1230': 'axis roll',
    'heading180deg_H0.05m_T1.2s': '',
    'wave_30deg_h50mm_L2m_run1': 'repeat 1',
    'roll_GM50mm_KG_210mm_ballast5kg_V00': 'axis roll',
    'rudder_10deg_mu_45deg': '',
    'Krängung10grad_T15.5cm_02': 'initial_angle_deg 10, draft_m 0.155',
    'Run 7 - 3.5 kts - 10°': 'repeat 7, speed_m_s 1.80056, initial_angle_deg 10',
    '5m_towing_roll_LCG_-20mm': 'axis roll',
    'bilgekeel_20mm_flap_10deg_phi0': '',
    'weights_5kg_offset_3deg': '',
    'T1_D2_A3': '',
    'notes': '',
}


@pytest.mark.parametrize('name', MEANINGS)
def test_a_name_means_what_stands_beside_a_unit_or_a_word_and_is_not_believed(name):
    found = meanings_of(name)
    told = ', '.join(f'{each.key} {each.value if isinstance(each.value, str) else f"{each.value:g}"}' for each in found)
    assert sorted(told.split(', ')) == sorted(MEANINGS[name].split(', '))
    believed, proposed = (pattern_of(name, found, is_said) for is_said in (False, True))
    assert pattern_expression(believed).fullmatch(name) and pattern_expression(proposed).fullmatch(name)
    assert set(values_in_name(believed, name)) <= {'axis', 'repeat'}
    plain = {each.key: each.value for each in found if each.is_plain and each.placeholder in PLACEHOLDERS}
    assert values_in_name(proposed, name) == plain


@pytest.mark.parametrize(
    'line, said',
    [
        ('Tiefgang: 0,150 m', 'draft_m: 0.15'),
        ('# draft [mm]: 150', 'draft_m: 0.15'),
        ('"Masse";30,5;"kg"', 'displacement_kg: 30.5'),
        ('Geschwindigkeit = 1,5 m/s', 'speed_m_s: 1.5'),
        ('Anfangswinkel;10;°', 'initial_angle_deg: 10.0'),
        ('Tiefgang:;0,150;m;;Geschwindigkeit:;1,5;m/s', 'speed_m_s: 1.5'),
        ('Tiefgang:;0,150;m', 'draft_m: 0.15'),
        ('Model draft;mm;150', 'draft_m: 0.15'),
        ('Draft: 0.15 of the design', ''),
        ('Draft reading: none', ''),
    ],
)
def test_lines_above_a_table_propose_what_they_say_with_a_unit(line, said, tmp_path):
    (tmp_path / 'Versuch.csv').write_text(f'Werft\n{line}\nZeit [s];Rollwinkel [°]\n0,00;1,0\n')
    text, _ = new_manifest(tmp_path)
    assert f'    {said}\n' in text if said else 'draft_m: 0' not in text.partition('trials:\n')[2]


def test_cells_above_a_sheet_say_drafts_and_load_cases_and_several_under_one_draft_factor_are_reported(tmp_path):
    openpyxl = pytest.importorskip('openpyxl')
    time = 0.05 * np.arange(600)
    for draft, case in ((150, 'Ballast'), (170, 'Load')):
        book = openpyxl.Workbook()
        for row in (('Tiefgang:', draft, 'mm'), ('Beladungsfall:', case), ('Zeit [s]', 'Rollwinkel [°]')):
            book.active.append(row)
        free = np.maximum(time - 3.0, 0.0)
        angle = (8.0 + 0.01 * draft) * np.exp(-0.15 * free) * np.cos(3.0 * free)
        for row in zip(time.tolist(), angle.tolist(), strict=True):
            book.active.append(row)
        book.save(tmp_path / f'Rollen_T{draft}_V01.xlsx')
    text, warnings = new_manifest(tmp_path)
    assert "V01.xlsx'   # 1 release, period 2.09 s, load case Ballast\n    draft_m: 0.15\n" in text
    assert '    draft_m: 0.17\n' in text
    assert not warnings and 'speed_m_s: 1' not in text
    entries = "axis: roll\nmounting_deg: [0, 0, 5]\ntrials: [{pattern: 'Rollen_*.xlsx', draft_factor: 1}]\n"
    (tmp_path / 'c.yaml').write_text(entries.replace('mounting_deg: [0, 0, 5]\n', ''))
    _, found = prepared_trials(read_manifest(tmp_path / 'c.yaml'))
    assert {a.message for t in found for a in t.advice if a.code == 'several-drafts'} == {
        'the files of draft factor 1 state drafts of 0.15 to 0.17 m: if these are right, give draft_m beside each '
        'trial, because all of draft factor 1 are fitted as one'
    }
    (tmp_path / 'c.yaml').write_text(entries)
    _, found = prepared_trials(read_manifest(tmp_path / 'c.yaml'))
    assert all('a mounting can turn only both together' in t.reason for t in found)


def test_load_cases_without_drafts_are_reported_and_files_listed_in_their_order(tmp_path):
    def write(ending, number, case):
        text = f'Beladungsfall: {case}\nZeit [s];Rollwinkel [°]\n0,00;1,0\n'
        (tmp_path / f'Rollen_V{number:02}.{ending}').write_text(text)

    write('csv', 1, 'Ballast')
    write('txt', 2, 'Ballast')
    write('csv', 3, 'Ballast')
    assert not any('load cases may' in line for line in new_manifest(tmp_path)[1])
    write('csv', 3, 'Volllast')
    text, warnings = new_manifest(tmp_path)
    assert re.findall(r"file: 'Rollen_V0(\d)", text) == ['1', '2', '3']
    assert any('load cases may mean several drafts (Ballast, Volllast)' in line for line in warnings)


def test_what_lines_and_names_say_of_the_loading_is_one_loading(tmp_path):
    for name in ('Versuch.csv', 'roll_6deg_1.0T.csv'):
        (tmp_path / name).write_text('Tiefgang: 0,15 m\nMasse: 30 kg\nZeit [s];Rollwinkel [°]\n0,00;1,0\n')
    assert main(['campaign', '--new', str(tmp_path)]) == 0
    found = {(t.loading, t.mass_kg) for t in read_manifest(tmp_path / 'campaign.yaml').trials}
    assert found == {(('draft_m', 0.15), 30.0)}
    text = (tmp_path / 'campaign.yaml').read_text()
    assert text.count('draft_m: 0.15   # all files say so\n') == 1 and 'draft_factor: 1' not in text
    one = read(tmp_path, text.replace("'roll_6deg_1.0T.csv'", "'roll_6deg_1.0T.csv'\n    draft_factor: 0.9"))
    assert {t.loading for t in one.trials} == {('draft_m', 0.15), ('draft_factor', 0.9)}


@pytest.fixture
def store(tmp_path):
    return ResultStore(tmp_path / 'results')


def test_results_come_back_bit_by_bit_or_none_and_leftovers_of_a_killed_process_are_cleared(store, tmp_path):
    values = np.random.default_rng(1).normal(size=100) * 10.0 ** np.arange(-50, 50)
    result = {'values': values.tolist(), 'none': None, 'words': 'ψ', 'inf': math.inf}
    store.put('ab' * 32, result)
    assert store.get('ab' * 32) == result
    store.put('cd' * 32, [math.nan])
    assert math.isnan(store.get('cd' * 32)[0])
    assert store.get('00' * 32) is None
    store.put('00' * 32, [1, 2, 3])
    (file,) = (tmp_path / 'results' / '00').rglob('*.json')
    file.write_text('[1, 2')
    assert store.get('00' * 32) is None
    store.put('ab' * 32, [1])
    leftover = tmp_path / 'results' / 'ab' / '.writing-xyz'
    leftover.mkdir()
    (leftover / 'half.json').write_text('[1')
    with store.locked():
        assert not leftover.exists()
    assert store.get('ab' * 32) == [1]


def test_one_process_at_a_time_in_a_folder_that_can_be_made(store, tmp_path):
    code = (
        'import sys\nfrom swath_sysid.tank.campaign.work import ResultStore\n'
        'with ResultStore(sys.argv[1]).locked(): print("alone")\n'
    )
    command = [sys.executable, '-c', code, str(tmp_path / 'results')]
    with store.locked():
        assert 'another campaign is writing' in subprocess.run(command, capture_output=True, text=True).stderr
    assert subprocess.run(command, capture_output=True, text=True).stdout == 'alone\n'
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='cannot make the folder'):
        ResultStore(tmp_path / 'file' / 'results')


@pytest.mark.long
@given(st.lists(st.one_of(st.text(), st.floats(allow_nan=False), st.integers(), st.none()), min_size=1), st.data())
def test_a_key_tells_whatever_differs(parts, data):
    other = list(parts)
    index = data.draw(st.integers(0, len(parts) - 1))
    other[index] = (parts[index], 'more')
    assert key_of(*parts) == key_of(*parts)
    assert key_of(*parts) != key_of(*other)
    assert key_of({'b': 1, 'a': parts}) == key_of({'a': parts, 'b': 1})
