"""Malformed tables and bags by the hundred: one sentence, or the right motion, or a warning; never a traceback."""

import gzip
import io
import random
import resource
import time
import tracemalloc
import zipfile
from itertools import chain

import numpy as np
import pytest

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.main import main
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.reading import read_trial

MAX_SECONDS, MAX_BYTES = 5.0, 500e6
NAMES = ('time_s', 'pitch_rad', 'pitch_rate_rad_s')


def decay():
    """A release from 6 deg, period 2 s, without noise."""
    t = np.round(np.arange(0.0, 8.0, 0.02), 6)
    damping, frequency = 0.25, np.pi
    angle = 0.1 * np.exp(-damping * t) * np.cos(frequency * t)
    rate = -0.1 * np.exp(-damping * t) * (damping * np.cos(frequency * t) + frequency * np.sin(frequency * t))
    return Trial(time=t, pitch=np.round(angle, 8), pitch_rate=np.round(rate, 8))


TRUTH = decay()
COLUMNS = (TRUTH.time, TRUTH.pitch, TRUTH.pitch_rate)


def table(columns=COLUMNS, names=NAMES, mark=',', end='\n', write=repr):
    rows = (mark.join(write(float(v)) for v in row) for row in zip(*columns, strict=True))
    return end.join((mark.join(names), *rows, '')).encode()


def with_cells(column, rows, cell):
    lines = table().decode().split('\n')
    for row in rows:
        cells = lines[row + 1].split(',')
        cells[column] = cell
        lines[row + 1] = ','.join(cells)
    return '\n'.join(lines).encode()


def comma(value):
    return repr(value).replace('.', ',')


def tables():
    """Name to content of tables with something wrong, or written in an unusual way."""
    whole = table()
    t, angle, rate = COLUMNS
    size = len(whole)
    rng = random.Random(1)
    for share in (0.0005, 0.001, 0.003, 0.01, 0.02, 0.1, 0.3, 0.5, 0.9, 0.999):
        yield f'cut off at {share}', whole[: int(share * size)]
        yield f'zeros from {share}', whole[: int(share * size)] + bytes(size - int(share * size))
    for number in range(20):
        broken = bytearray(whole)
        for place in rng.sample(range(40, size), 1 + number):
            broken[place] = rng.randrange(256)
        yield f'{number + 1} bytes flipped', bytes(broken)
    for encoding in ('utf-8-sig', 'utf-16', 'utf-16-le', 'utf-16-be', 'utf-32', 'utf-32-le', 'cp037', 'utf-7'):
        yield encoding, whole.decode().encode(encoding)
    yield 'utf-16, cut off', whole.decode().encode('utf-16')[:-1]
    yield 'utf-16, no numbers', NAMES[0].encode('utf-16')
    yield 'utf-16, a lone surrogate', b'\xff\xfe' + b'\x00\xd8' * 500
    cells = 'nan NaN inf -inf None #N/A abc 1e999 -1e308 0x10 1_000 -- ? 1.2.3 1e ٣ " "x \x00 1;2'.split(' ')
    for cell in ('', *cells, ' ' * 1000, '9' * 400, '9' * 40000):
        for column in range(3):
            name = f'{cell[:8]!r} ({len(cell)}) in some cells of column {column}'
            yield name, with_cells(column, range(7, 390, 37), cell)
        yield f'{cell[:8]!r} ({len(cell)}) in all cells of the angle', with_cells(1, range(400), cell)
    yield 'all of it nan', table([t, np.full(400, np.nan), np.full(400, np.nan)])
    yield 'a single name', b'time_s\n' + b'1\n' * 100
    yield 'names alone', ','.join(NAMES).encode()
    rows = whole.split(b'\n')
    yield 'one row', b'\n'.join(rows[:2])
    yield 'seven rows', b'\n'.join(rows[:8])
    yield 'no names', b'\n'.join(rows[1:])
    yield 'blank names', whole.replace(','.join(NAMES).encode(), b',,')
    yield 'comments alone', b'# a\n# b\n' * 50
    yield 'no line ends', whole.replace(b'\n', b' ')
    for name, end in (('cr', '\r'), ('crlf', '\r\n'), ('lf twice', '\n\n'), ('form feed', '\f\n')):
        yield f'lines end in {name}', table(end=end)
    for mark in ';\t |:_':
        yield f'separated by {mark!r}', table(mark=mark)
        yield f'separated by {mark!r}, decimal commas', table(mark=mark, write=comma)
    yield 'decimal commas between commas', table(write=comma)
    yield 'quoted decimal commas', table(write=lambda v: f'"{comma(v)}"')
    yield 'names by commas, numbers by semicolons', table(mark=';').replace(b';', b',', 2)
    yield 'names by semicolons, numbers by commas', table().replace(b',', b';', 2)
    yield 'both separators in turn', b'\n'.join(row.replace(b',', b';') if k % 2 else row for k, row in enumerate(rows))
    yield 'thousands', table(mark=';', columns=[t, 1e5 * angle, rate], write=lambda v: f'{v:,.3f}')
    for extra in (1, 2):
        yield f'{extra} cells too many', whole.replace(b'\n', b',1' * extra + b'\n').replace(b',1' * extra, b'', 1)
        yield f'{extra} cells too few', b'\n'.join([rows[0], *(row.rsplit(b',', extra)[0] for row in rows[1:])])
    yield 'long first line', b'a' * 200_000 + b'\n' + whole
    yield 'long line', whole + b'1' * 3_000_000 + b'\n'
    yield 'many columns', b','.join(b'c%d_s' % k for k in range(9000)) + b'\n' + b','.join([b'1'] * 9000) + b'\n'
    for name in NAMES:
        yield f'{name} twice', table([*COLUMNS, COLUMNS[NAMES.index(name)]], [*NAMES, name])
    yield 'rad and other deg', table([*COLUMNS, np.degrees(angle[::-1])], [*NAMES, 'pitch_deg'])
    yield 'rad and the same deg', table([*COLUMNS, np.degrees(angle)], [*NAMES, 'pitch_deg'])
    turned = [np.sin(0.3 + angle / 2), np.cos(0.3 + angle / 2)]
    quaternion = [f'quaternion_{p}' for p in 'xyzw']
    zero = np.zeros_like(t)
    yield 'another quaternion', table([*COLUMNS, zero, turned[0], zero, turned[1]], [*NAMES, *quaternion])
    yield 'no quaternion', table([*COLUMNS, zero, zero, zero, zero], [*NAMES, *quaternion])
    for unit in ('m', 'min', 'h', 'deg', 'ticks'):
        yield f'time in {unit}', table(names=(f'time_{unit}', *NAMES[1:]))
    for unit, scale in (('ms', 1e3), ('us', 1e6), ('ns', 1e9)):
        yield f'time: {unit}', table([scale * t, angle, rate])
        yield f'time: epoch in {unit}', table([scale * (1.7e9 + t), angle, rate])
    others = {'sample numbers': np.arange(400.0), 'constant': zero, 'back': t[::-1], 'huge': t * 1e300}
    for name, stamps in (others | {'scaled by a million': t / 1e6, 'infinite': t + np.inf}).items():
        yield f'time: {name}', table([stamps, angle, rate])
    yield 'degrees called rad', table([t, np.degrees(angle), rate])
    yield 'radians called deg', table([t, angle], ['time_s', 'pitch_deg'])
    yield 'no unit', table([t, angle], ['time_s', 'pitch'])
    yield 'no motion', table([t, angle], ['time_s', 'height_m'])
    for magic in (b'PK\x03\x04', b'\x1f\x8b', b'\xfa\xff', b'\x89MCAP0\r\n', b'SQLite format 3\0', b'<html>'):
        yield f'begins with {magic[:4]!r}', magic + whole
    yield 'gzip', gzip.compress(whole)
    yield 'zip in zip', zipped(zipped(whole))
    yield 'random', rng.randbytes(100_000)
    yield 'zeros', bytes(100_000)
    yield 'spaces', b' ' * 100_000
    yield 'line ends', b'\n' * 100_000


def zipped(content):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, 'w') as archive:
        archive.writestr('a.csv', content)
    return buffer.getvalue()


def bags(mcap, sqlite):
    rng = random.Random(2)
    for kind, whole in (('mcap', mcap), ('db3', sqlite)):
        size = len(whole)
        for share in (0.0, 0.0001, 0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.9999):
            yield f'{kind} cut off at {share}', whole[: int(share * size)]
        for start in (8, 100, 5000, size // 2, size - 500):
            yield f'{kind}, 64 zeros at {start}', whole[:start] + bytes(64) + whole[start + 64 :]
            yield f'{kind}, 64 bytes of 255 at {start}', whole[:start] + b'\xff' * 64 + whole[start + 64 :]
            yield f'{kind}, 64 bytes missing at {start}', whole[:start] + whole[start + 64 :]
        yield f'{kind} twice', whole + whole
        yield f'{kind} with text behind', whole + b'text' * 99
    for number in range(40):
        place = rng.randrange(8, len(mcap))
        broken = bytearray(mcap)
        broken[place] ^= 1 << rng.randrange(8)
        yield f'mcap, flip {number} at {place}', bytes(broken)
    for length in (2**31, 2**40, 2**63, 2**64 - 1):
        yield f'mcap, a record of {length} bytes', mcap[:9] + length.to_bytes(8, 'little') + mcap[17:]


@pytest.fixture(scope='module')
def malformed(tmp_path_factory):
    folder = tmp_path_factory.mktemp('malformed')
    for ending in ('mcap', 'db3'):
        write_imu_bag(folder / f'whole.{ending}', TRUTH)
    whole = [(folder / f'whole.{ending}').read_bytes() for ending in ('mcap', 'db3')]
    paths = {}
    for number, (name, content) in enumerate(chain(tables(), bags(*whole))):
        assert name not in paths
        paths[name] = folder / f'{number}.bin'
        paths[name].write_bytes(content)
    return paths


def is_true(name, path):
    """Whether the motion read is that written, but for a digit here and there that nothing tells from a right one."""
    trial = read_trial(path)
    if trial.pitch is None:
        return False
    stamps = trial.time - trial.time[0]
    place = np.clip(np.round(stamps / 0.02).astype(int), 0, TRUTH.time.size - 1)
    differing = np.abs(stamps - TRUTH.time[place]) + np.abs(trial.pitch - TRUTH.pitch[place]) > 1e-4
    changed = int(name.split()[0]) if 'bytes flipped' in name else 1 if 'cut off' in name else 0
    whole = trial.time.size >= TRUTH.time.size - changed or 'cut off' in name
    return whole and np.count_nonzero(differing) <= changed


@pytest.mark.long
@pytest.mark.parametrize('first', [0, *(pytest.param(k, marks=pytest.mark.release) for k in (1, 2, 3))])
def test_each_is_refused_warned_of_or_right(first, malformed, capsys):
    assert len(malformed) >= 180
    outcomes, silent = {'refused': 0, 'warned': 0, 'right': 0}, []
    folder = next(iter(malformed.values())).parent
    there = sorted(folder.iterdir())
    for name, path in list(malformed.items())[first::4]:
        began = time.process_time()
        code = main(['inspect', str(path), '--json'])
        out, error = capsys.readouterr()
        assert 'Traceback' not in error and time.process_time() - began < MAX_SECONDS, name
        if code == 2:
            assert error.startswith('swath-sysid inspect: ') or 'warning [' in error, name
            assert len(error.strip().splitlines()[-1]) < 800 and not out, name
            outcomes['refused'] += 1
        elif 'warning [' in error:
            assert code == 0 and '"warnings": [\n' in out, name
            outcomes['warned'] += 1
        else:
            assert code == 0
            silent += [] if is_true(name, path) else [name]
            outcomes['right'] += 1
    assert not silent
    assert sorted(folder.iterdir()) == there
    assert min(outcomes.values()) >= 4


@pytest.mark.long
def test_memory_stays_small(malformed, capsys):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest = sorted(malformed.values(), key=lambda path: path.stat().st_size)[-5:]
    named = [path for name, path in malformed.items() if 'bytes' in name and 'record' in name]
    tracemalloc.start()
    for path in (*largest, *named):
        main(['inspect', str(path)])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MAX_BYTES
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MAX_BYTES


def test_unusual_but_clear_tables_are_read_right(malformed):
    encodings = ('utf-8-sig', 'utf-16', 'utf-16-le', 'utf-16-be')
    commas = ("separated by ';', decimal commas", "separated by '\\t', decimal commas", 'quoted decimal commas')
    for name in (*encodings, *commas, 'lines end in cr', 'rad and the same deg'):
        assert is_true(name, malformed[name]), name


def test_nothing_is_written_of_what_is_refused(malformed, tmp_path, capsys):
    of_tables = ('cut off at 0.001', 'decimal commas between commas', 'time: ms', 'degrees called rad')
    for name in (*of_tables, 'db3 cut off at 0.5'):
        command = ['identify', str(malformed[name]), '--output', str(tmp_path / 'm.yaml')]
        assert main([*command, '--plot', str(tmp_path / 'm.png')]) == 2, name
    assert not list(tmp_path.iterdir())
