"""Records as a random exporter writes them: format, names, units, dates, order, missing cells, repeated rows."""

import zipfile
from collections import Counter
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

h5py = pytest.importorskip('h5py')
openpyxl = pytest.importorskip('openpyxl')
pyarrow = pytest.importorskip('pyarrow')
parquet = pytest.importorskip('pyarrow.parquet')

TIME = 0.05 * np.arange(300)
ROLL = 8.0 * np.exp(-0.05 * TIME) * np.cos(2.1 * TIME) + 0.7
PITCH = 2.0 * np.sin(1.3 * TIME)
START = datetime(2026, 11, 12, 23, 59, 52, tzinfo=UTC)
UNITS = {'deg': 1.0, 'rad': np.pi / 180.0, '°': 1.0, 'mrad': np.pi / 0.18}

exports = st.fixed_dictionaries(
    {
        'format': st.sampled_from(['csv', 'csv', 'xlsx', 'zip', 'mat', 'h5', 'parquet']),
        'names': st.sampled_from(
            [('roll', 'pitch'), ('Heel', 'Trim'), ('Krängung', 'Trimm'), ('imu_roll', 'imu_pitch'),
             ('rollio', 'beccheggio')]
        ),
        'unit': st.sampled_from(['deg', 'deg', 'rad', '°', 'mrad']),
        'said': st.sampled_from(['{}_{}', '{} [{}]', '{} ({})', '{}\n[{}]']),
        'clock': st.sampled_from(['s', 'ms', 'us', 'epoch', 'date', 'day and time', 'Excel days', 'MATLAB days']),
        'date': st.sampled_from(
            ['%Y-%m-%dT%H:%M:%S.%f', '%d-%b-%Y %H:%M:%S.%f', '%d.%m.%y %H:%M:%S.%f', '%m/%d/%Y %H:%M:%S.%f',
             '%Y-%m-%d_%H:%M:%S:%f', '%Y-%m-%d %H:%M:%S.%f UTC', '%Y/%m/%d %H:%M:%S.%fZ']
        ),
        'order': st.permutations(['time', 'roll', 'pitch', 'other']),
        'loss': st.sampled_from(['', '', 'empty cells', 'empty rows', 'each twice']),
        'mark': st.sampled_from(',;\t'),
        'comma': st.booleans(),
        'encoding': st.sampled_from(['utf-8', 'utf-8-sig', 'utf-16']),
    }
)  # fmt: skip


def clock_columns(export):
    """Name and cells of the columns of the time; texts, or numbers."""
    seconds = 1_795_000_000.0 + TIME
    dates = [START + timedelta(milliseconds=round(1e3 * t)) for t in TIME]
    # a variable of MATLAB holds no texts of dates
    is_number = export['format'] in ('mat', 'h5') and 'da' in export['clock']
    match 'MATLAB days' if is_number else export['clock']:
        case 'date':
            return {'Date': [each.strftime(export['date']) for each in dates]}
        case 'day and time':
            return {'Date': [f'{each:%d.%m.%Y}' for each in dates], 'Time': [f'{each:%H:%M:%S.%f}' for each in dates]}
        case 'epoch':
            return {'timestamp': np.round(1e3 * seconds)}
        case 'Excel days':
            return {'Date': 46353.41 + TIME / 86400.0}
        case 'MATLAB days':
            return {'datenum': 740000.25 + TIME / 86400.0}
        case unit:
            return {f'time_{unit}': TIME * {'s': 1.0, 'ms': 1e3, 'us': 1e6}[unit]}


def columns_of(export):
    """The columns in their order, and the rows of the record."""
    scale = UNITS[export['unit']]
    angles = [export['said'].format(name, export['unit']) for name in export['names']]
    parts = {
        'time': clock_columns(export),
        'roll': {angles[0]: ROLL * scale},
        'pitch': {angles[1]: PITCH * scale},
        'other': {'voltage': 12.0 + 0 * TIME},
    }
    columns = {name: cells for part in export['order'] for name, cells in parts[part].items()}
    rows = np.arange(TIME.size)
    if export['loss'] == 'each twice':
        rows = np.repeat(rows, 2)
    columns = {name: [cells[row] for row in rows] for name, cells in columns.items()}
    if export['loss'] == 'empty cells':
        for name in angles:
            columns[name] = [np.nan if at % 40 == 7 else cell for at, cell in enumerate(columns[name])]
    return columns


def text_of(cell, comma):
    if isinstance(cell, str):
        return cell
    said = '' if np.isnan(cell) else f'{cell:.12f}'
    return said.replace('.', ',') if comma else said


def lines_of(columns, export):
    mark = export['mark']
    comma = export['comma'] and mark != ','
    head = mark.join(f'"{name}"' if '\n' in name else name for name in columns)
    rows = [mark.join(text_of(cell, comma) for cell in row) for row in zip(*columns.values(), strict=True)]
    if export['loss'] == 'empty rows':
        rows = [line for row in rows for line in (row, mark * (len(columns) - 1))]
    return '\n'.join([head, *rows]) + '\n'


def write(path, export):
    columns = columns_of(export)
    match export['format']:
        case 'csv':
            path.write_bytes(lines_of(columns, export).encode(export['encoding']))
        case 'zip':
            with zipfile.ZipFile(path, 'w') as archive:
                archive.writestr('run/motion.csv', lines_of(columns, export).encode(export['encoding']))
                archive.writestr('meta/device.csv', 'property,value\nversion,1\n')
        case 'xlsx':
            book = openpyxl.Workbook()
            book.active.append(list(columns))
            for row in zip(*columns.values(), strict=True):
                cells = [None if cell != cell else cell if isinstance(cell, str) else float(cell) for cell in row]
                book.active.append(
                    [text_of(cell, True) if export['comma'] and cell is not None else cell for cell in cells]
                )
            book.save(path)
        case 'mat':
            savemat(path, {plain(name): cells for name, cells in columns.items()}, do_compression=export['comma'])
        case 'h5':
            with h5py.File(path, 'w') as file:
                group = file.create_group('run')
                for name, cells in columns.items():
                    group[name.replace('/', ' ')] = cells
        case 'parquet':
            parquet.write_table(pyarrow.table(columns), path)


def plain(name):
    said = name.replace('°', 'deg').replace('ä', 'ae')
    return ''.join(letter if letter.isascii() and letter.isalnum() else '_' for letter in said).strip('_')


def outcome(path, export):
    write(path, export)
    try:
        trial = read_trial(path)
    except InputError as error:
        return f'refused: {error}'
    step = np.diff(trial.time)
    if trial.time.size != TIME.size or np.abs(step - 0.05).max() > 2e-3:
        return f'wrong time: {trial.time.size} rows, {step.min()} to {step.max()} s'
    for name, expected in (('roll', ROLL), ('pitch', PITCH)):
        values = getattr(trial, name)
        if values is None:
            return f'lost {name}'
        known = np.isfinite(values)
        if known.mean() < 0.95 or np.abs(np.degrees(values[known]) - expected[known]).max() > 1e-6:
            return f'wrong {name}'
    return 'read'


@pytest.mark.long
@pytest.mark.parametrize('examples', [12, pytest.param(2000, marks=pytest.mark.release)])
def test_what_a_random_exporter_writes_is_read_back_or_refused_for_its_cause(tmp_path, examples):
    outcomes, refusals = Counter(), Counter()

    @settings(max_examples=examples, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(exports)
    def run(export):
        said = outcome(tmp_path / f'a.{export["format"]}', export)
        kind, _, cause = said.partition(': ')
        assert kind in ('read', 'refused'), said
        outcomes[kind] += 1
        refusals[cause.partition(':')[0].replace(str(tmp_path), '')[:60]] += kind == 'refused'

    run()
    assert outcomes['read'] >= (0.9 if examples > 1000 else 0.5) * outcomes.total(), refusals
