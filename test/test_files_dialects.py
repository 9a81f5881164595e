"""Tables in the dialects that owners have: each is read right, or refused; none is read wrong."""

import os
from collections import Counter
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

EXAMPLES = int(os.environ.get('SWATH_SYSID_DIALECTS', '30'))
STEP = 0.02
TIME = STEP * np.arange(1500)
ROLL = 12.0 * np.exp(-0.1 * TIME) * np.cos(2.5 * TIME) - 0.5
PITCH = 3.0 * np.exp(-0.05 * TIME) * np.sin(1.7 * TIME)
START = datetime(2026, 4, 30, 23, 59, 48, tzinfo=UTC)  #: Midnight, and the end of a month, are in the record.

TITLES = (
    'Model test of a small craft, calm water',
    '# operator: A. B.',
    '--------------------------',
    '',
    'Draft: 0.154 m; LCG 1.2 m',
    '% exported 2026-05-01 12:00',
    'Predictions were generated on 11-Nov-2023 at 11:11:11',
)
NAMES = (
    ('roll', 'pitch'),
    ('Roll', 'Pitch'),
    ('Rollwinkel', 'Nickwinkel'),
    ('heel', 'trim'),
    ('PtfmRoll', 'PtfmPitch'),
    ('gîte', 'assiette'),
)
UNITS = {'deg': 1.0, 'rad': np.pi / 180.0, '°': 1.0, 'degrees': 1.0, 'cdeg': 100.0}


def dated(form, rows=TIME):
    return [(START + timedelta(seconds=float(t))).strftime(form)[: -3 if form.endswith('%f') else None] for t in rows]


def counted(scale, turn=None, start=0.0, digits=6):
    values = start + TIME * scale
    values = values if turn is None else np.remainder(values, turn)
    return [f'{value:.{digits}f}' for value in values]


#: Name (`{}` is where a unit may stand), unit and cells of the columns of a time.
CLOCKS = {
    'seconds': lambda: [('time', 's', counted(1.0))],
    'milliseconds': lambda: [('t', 'ms', counted(1e3, digits=3))],
    'microseconds that wrap': lambda: [('time', 'us', counted(1e6, 2.0**32, 2.0**32 - 7e6, 0))],
    'milliseconds that wrap': lambda: [('time', 'ms', counted(1e3, 2.0**16, 2.0**16 - 9e3, 0))],
    'samples': lambda: [('time', 'samples', counted(50.0, digits=0))],
    'epoch': lambda: [('timestamp', '', counted(1e3, start=1.777e12, digits=0))],
    'iso': lambda: [('time', '', dated('%Y-%m-%dT%H:%M:%S.%f'))],
    'iso with a zone': lambda: [('Timestamp', '', [f'{cell}+02:00' for cell in dated('%Y-%m-%d %H:%M:%S.%f')])],
    'national': lambda: [('Datum', '', dated('%d.%m.%Y %H:%M:%S.%f'))],
    'american': lambda: [('date', '', dated('%m/%d/%Y %H:%M:%S.%f'))],
    'date and time': lambda: [('Date', '', dated('%Y/%m/%d')), ('Time', '', dated('%H:%M:%S.%f'))],
    'clock': lambda: [('Zeit', 'hh:mm:ss.ms', dated('%H:%M:%S.%f'))],
    'day seconds': lambda: [('time', 's', counted(1.0, 86400.0, 86390.0, 3))],
    'GPS week': lambda: [('tow', 's', counted(1.0, 604800.0, 604790.0, 3))],
    'Excel': lambda: [('time', '', counted(1.0 / 86400.0, start=46142.25, digits=10))],
    'MATLAB': lambda: [('time', '', counted(1.0 / 86400.0, start=740000.25, digits=10))],
    'two clocks': lambda: [
        ('time', 's', counted(1.01)),
        ('stamp', 's', counted(1.0, start=1777636800.0, digits=4)),
    ],
    'bursts': lambda: [('time', 's', [f'{0.16 * (k // 8) + 5e-5 * (k % 8):.6f}' for k in range(TIME.size)])],
    'summer time ends': lambda: [
        ('time', '', [cell.replace(' 00:', ' 23:') for cell in dated('2026-10-25 %H:%M:%S.%f')])
    ],
}

dialects = st.fixed_dictionaries(
    {
        'titles': st.lists(st.sampled_from(TITLES), max_size=7),
        'names': st.sampled_from(NAMES),
        'unit': st.sampled_from([*UNITS, 'deg', 'deg']),
        'said': st.sampled_from(['{}_{}', '{} [{}]', '{} ({})', 'row', 'row'] * 2 + ['never']),
        'clock': st.sampled_from(sorted(CLOCKS)),
        'delimiter': st.sampled_from([',', ',', ';', '\t', ' ', '|']),
        'decimal': st.sampled_from('..,'),
        'minus': st.sampled_from(['-', '-', '\u2212']),
        'exponent': st.sampled_from(['', '', 'e', 'D']),
        'encoding': st.sampled_from(['utf-8', 'utf-8-sig', 'utf-16', 'latin-1']),
        'end': st.sampled_from(['\n', '\r\n']),
        'turn': st.booleans(),
        'loss': st.sampled_from(
            [
                '',
                '',
                '',
                'rows',
                'empty',
                'few texts',
                'many texts',
                'order',
                'zeros',
                'footer',
                'header',
                'column',
                'quotes',
            ]
        ),
    }
)


def angle_cells(angle, dialect):
    values = np.remainder(angle, 360.0) if dialect['turn'] else angle
    form = {'': '{:.6f}', 'e': '{:.8e}', 'D': '{:.8e}'}[dialect['exponent']]
    cells = [form.format(value * UNITS[dialect['unit']]) for value in values]
    # a code page has no such sign
    minus = '-' if dialect['encoding'] == 'latin-1' else dialect['minus']
    return [cell.replace('e', dialect['exponent'] or 'e').replace('-', minus, cell.startswith('-')) for cell in cells]


def table_in(dialect):
    """Lines of a table, and the rows of the record that it should hold."""
    clock = CLOCKS[dialect['clock']]()
    columns = [
        *clock,
        *((n, dialect['unit'], angle_cells(a, dialect)) for n, a in zip(dialect['names'], (ROLL, PITCH), strict=True)),
    ]
    rows, mark, said = list(range(TIME.size)), dialect['delimiter'], dialect['said']
    if dialect['loss'] == 'column':
        columns.insert(len(clock), ('operator', '', ['AB'] * TIME.size))
    bare = [
        said == 'row' or not u or ':' in u and '_' in said or said == 'never' and u == dialect['unit']
        for _, u, _ in columns
    ]
    said = '{} [{}]' if said == 'never' else said
    names = [n if is_bare else said.format(n, u) for is_bare, (n, u, _) in zip(bare, columns, strict=True)]
    units = [[f'({u})' if u else '-' for _, u, _ in columns]] if said == 'row' else []
    if dialect['loss'] == 'rows' and dialect['clock'] != 'bursts':
        rows = [k for k in rows if k % 37]
    if dialect['loss'] == 'order':
        rows[300:500] = rows[300:500][::-1]
    cells = [[cells[k] for _, _, cells in columns] for k in rows]
    every, word = {'empty': (29, ''), 'few texts': (29, 'ERR'), 'many texts': (9, 'ERR')}.get(dialect['loss'], (0, ''))
    for row in cells[5::every] if every else ():
        row[-1] = word
    if dialect['decimal'] == ',':
        cells = [
            [cell if ':' in cell or cell.count('.') > 1 else cell.replace('.', ',') for cell in row] for row in cells
        ]
        if mark == ',' or dialect['loss'] == 'quotes':
            cells = [[f'"{cell}"' for cell in row] for row in cells]
    lines = [mark.join(row) for row in (names, *units, *cells)]
    if dialect['loss'] == 'header':
        lines[700:700] = lines[:1]
    rate = ['# sample_rate_hz: 50'] if dialect['clock'] == 'samples' else []
    footer = ['', 'End of file'] if dialect['loss'] == 'footer' else []
    return [*dialect['titles'], *rate, *lines, *footer, ''], rows


def outcome(path, dialect):
    """``read``, ``refused``, or what is wrong."""
    lines, rows = table_in(dialect)
    content = dialect['end'].join(lines).encode(dialect['encoding'], 'replace')
    path.write_bytes(content + (bytes(4096) if dialect['loss'] == 'zeros' else b''))
    try:
        trial = read_trial(path)
    except InputError as error:
        return f'refused: {error}'
    assert trial.roll is not None
    place = np.rint((trial.time - trial.time[0]) / STEP + rows[0]).astype(int)
    if trial.time.size < 0.9 * len(rows) or np.any(np.diff(place) < 1) or place[-1] >= TIME.size:
        return f'wrong time: {trial.time.size} of {len(rows)} rows, {np.diff(trial.time).min()}, {place[-1]}'
    if np.abs(trial.time - trial.time[0] - STEP * (place - rows[0])).max() > 0.25 * STEP:
        return 'wrong time'
    for name, expected in (('roll', ROLL), ('pitch', PITCH)):
        values = getattr(trial, name)
        if values is None or np.isfinite(values).mean() < 0.9:
            return f'no {name}'
        apart = np.abs(np.degrees(values) - expected[place])
        if np.nanmax(apart) > 1e-3:
            return f'wrong {name} by {np.nanmax(apart)}'
    return 'read'


@pytest.mark.long
def test_no_dialect_is_read_wrong_and_most_are_read(tmp_path):
    outcomes = Counter()

    @settings(max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(dialects)
    def run(dialect):
        said = outcome(tmp_path / 'a.txt', dialect)
        kind = said.partition(':')[0]
        assert kind in ('read', 'refused'), said
        outcomes[kind] += 1

    run()
    # few examples are drawn in clumps
    assert outcomes['read'] >= (0.8 if EXAMPLES > 1000 else 0.5) * sum(outcomes.values()), outcomes


#: What is reported of files as owners have them, and the record without a fault that each holds.
FIELD = {
    'bursts.csv': ('bursts', 'plain.csv'),
    'clock_only.csv': ('', 'plain.csv'),
    'date_and_time.csv': ('', 'plain.csv'),
    'dinghy_0_to_2pi_rad.csv': ('angles-unwrapped gaps', 'dinghy_iso_dates_pm180.csv'),
    'dinghy_iso_dates_pm180.csv': ('gaps', 'dinghy_iso_dates_pm180.csv'),
    'dinghy_tracker.log': ('unit-judged unit-judged angles-unwrapped gaps', 'dinghy_iso_dates_pm180.csv'),
    'flume_3031_2_frozen.csv': ('angles-stuck', 'flume_3031_2_frozen.csv'),
    'flume_5041_2_200hz.csv': ('', 'flume_5041_2_200hz.csv'),
    'flume_6041_1_200hz.csv': ('', 'flume_6041_1_200hz.csv'),
    'formula_roll.xlsx': ('', 'plain.csv'),
    'gps_tow.csv': ('time-unwrapped', 'plain.csv'),
    'n20_5041_2.csv': ('', 'flume_5041_2_200hz.csv'),
    'nul_tail.csv': ('zero-bytes', 'plain.csv'),
    'openfast_like.out': ('columns-understood', 'openfast_like.out'),
    'quat_ident_all.csv': ('blank-orientation body-rates', 'quat_ident_all.csv'),
    'roll_0_360.csv': ('angles-unwrapped', 'plain.csv'),
    'segments_no_x.lvm': ('', 'plain.csv'),
    'start_offset_differs.tdms': ('missing-values', 'plain.csv'),
    'text_columns.xlsx': ('', 'plain.csv'),
    'two_clocks.csv': ('two-clocks', 'plain.csv'),
    'v4.mat': ('', 'plain.csv'),
    'waves_wrap16.csv': ('time-unwrapped', 'plain_waves.csv'),
}


@pytest.mark.long
def test_files_of_owners_hold_the_motion_that_was_measured(data_folder):
    folder = data_folder.parent / 'field'
    if not folder.is_dir():
        pytest.skip(f'no files of owners at {folder}')
    for name, (told, whole) in FIELD.items():
        path = folder / name
        trial, expected = read_trial(path), read_trial(path.with_name(whole))
        assert ' '.join(advice.code for advice in trial.advice) == told, name
        for channel in trial.channels.keys() & expected.channels.keys():
            values, reference = trial.channels[channel], expected.channels[channel]
            there = np.interp(trial.time - trial.time[0], expected.time - expected.time[0], reference)
            # numbers were written with fewer digits, or angles in hundredths of a radian
            assert np.nanmax(np.abs(values - there)) < (0.0051 if 'dinghy' in name else 1e-3), (name, channel)


def test_a_file_in_hundredths_of_a_degree_is_read_with_its_unit_only(tmp_path):
    path, phase = tmp_path / 'ship.txt', 0.7 * np.arange(1000)
    rolling, pitching = np.round(1088.0 * np.sin(phase - 0.1281)), np.round(300.0 * np.sin(phase))
    rows = (f'-292 {roll:.0f} {pitch:.0f} -689' for roll, pitch in zip(rolling, pitching, strict=True))
    path.write_text('\n'.join(['# sample_rate_hz: 1', 'YawRate Rolling Pitching Rudder', *rows, '']))
    with pytest.raises(InputError, match="'Rolling' without a unit, .* up to 1088: .*=Rolling:cdeg' for hundredths"):
        read_trial(path)
    with pytest.raises(InputError, match="goes to 1088, .*hundredths of a degree, .*'roll=Rolling:cdeg'"):
        read_trial(path, columns={'roll': 'Rolling:deg'})
    trial = read_trial(path, columns={'roll': 'Rolling:cdeg', 'pitch': 'Pitching:cdeg'})
    assert np.degrees(trial.roll[0]) == pytest.approx(-1.39) and trial.time.size == 1000


ROWS = [f'{t:.2f},{a:.5f}' for t, a in zip(TIME, ROLL, strict=True)]


@pytest.mark.parametrize(
    'lines',
    [
        ['sep=;', 'Time [s];Roll [deg]', *(row.replace(',', ';').replace('.', ',') for row in ROWS)],
        [',time_s,roll_deg', *(f'{k},{row}' for k, row in enumerate(ROWS))],
        ['time_s,roll_deg,', *(f'{row},' for row in ROWS)],
        ['# time [s]   roll [deg]', *(row.replace(',', '   ') for row in ROWS)],
        ['Run,12', 'Draft,0.154', 'Speed,0', 'Mass,12.5', '', 'Time (s),Roll (deg)', *ROWS],
        ['s,deg', 'Time,Roll', *ROWS],
        ['IMU,IMU', 'Time,Roll', 's,deg', *ROWS],
        ['"Time, s","Roll, deg"', *ROWS],
        ['Sample rate,50', 'roll_deg', *(row.partition(',')[2] for row in ROWS)],
        ['2026 05 01', '12 0 3', 'time_s roll_deg', *(row.replace(',', ' ') for row in ROWS)],
        ['time_ms;roll_deg', *(f'{1000 * t:,.1f};{a:.5f}' for t, a in zip(TIME, ROLL, strict=True))],
        ['time_ms;roll_deg', *(f'{1000 * t:,.1f};{a:.5f}'.replace(',', "'") for t, a in zip(TIME, ROLL, strict=True))],
        ['time_s,mode,roll_deg,fix', *(row.replace(',', ',auto,') + ',3D' for row in ROWS)],
        ['Time,Roll [deg]', *(
            f'11:59:{50 + t:05.2f} AM,{a:.5f}' if t < 10 else f'12:00:{t - 10:05.2f} PM,{a:.5f}'
            for t, a in zip(TIME, ROLL, strict=True)
        )],
    ],
)  # fmt: skip
def test_single_habits_of_owners(tmp_path, lines):
    (tmp_path / 'a.csv').write_text('\n'.join(lines))
    trial = read_trial(tmp_path / 'a.csv')
    assert trial.time - trial.time[0] == pytest.approx(TIME[: trial.time.size]) and trial.time.size == TIME.size
    assert np.degrees(trial.roll) == pytest.approx(ROLL, abs=1e-4) and trial.advice == ()


def test_an_angle_without_a_unit_is_read_by_its_rate(tmp_path):
    for scale, unit in ((1.0, 'deg'), (np.radians(1.0), 'rad'), (100.0, 'cdeg')):
        cells = zip(TIME, scale * ROLL, np.gradient(ROLL, TIME), strict=True)
        rows = [','.join(f'{cell:.6f}' for cell in row) for row in cells]
        (tmp_path / 'a.csv').write_text('\n'.join(['time_s,roll,roll_rate_deg_s', *rows]))
        trial = read_trial(tmp_path / 'a.csv')
        assert np.degrees(trial.roll) == pytest.approx(ROLL, abs=1e-3)
        assert [advice.message for advice in trial.advice] == [
            f"'roll' states no unit and is read in {unit}, because its rate says so"
        ]


def test_a_model_in_the_place_of_a_record_is_named(tmp_path):
    (tmp_path / 'model.yaml').write_text('format: swath_sysid decay model\nversion: 1\n')
    with pytest.raises(InputError, match='is a model file, where a record is expected'):
        read_trial(tmp_path / 'model.yaml')
