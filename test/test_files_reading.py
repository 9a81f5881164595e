"""Whatever a file is, it is read for what it is, or refused in one sentence."""

import contextlib
import gzip
import hashlib
import os
import sqlite3
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from test_files_tank import COLUMNS, PACKED, WRITERS

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial, source_hash
from swath_sysid.share import share_folder

TIME = 0.01 * np.arange(300)
TRIAL = Trial(time=TIME, roll=0.1 * np.sin(TIME), pitch=0 * TIME)
RECORDS = share_folder() / 'records'
SOURCES = {'morro_buoy': 'waves/morro_buoy.csv', 'kvlcc2_roll_decay': 'decay/kvlcc2/run2_0kn.csv'}
#: samples of the source to one of ours
EVERY = {'morro_buoy': 1, 'kvlcc2_roll_decay': 4}
MTI = 'PacketCounter\tSampleTimeFine\tRoll\n' + ''.join(f'{n}\t{100 * n}\t{n % 7}\n' for n in range(50))


def test_content_decides_not_the_name(tmp_path):
    write_csv(tmp_path / 'a.mcap', TRIAL)
    assert np.array_equal(read_trial(tmp_path / 'a.mcap').roll, TRIAL.roll)
    write_imu_bag(tmp_path / 'b.mcap', TRIAL)
    (tmp_path / 'b.mcap').rename(tmp_path / 'b.csv')
    assert np.allclose(read_trial(str(tmp_path / 'b.csv')).roll, TRIAL.roll)
    write_imu_bag(tmp_path / 'bag', TRIAL)
    assert np.allclose(read_trial(tmp_path / 'bag', topic='/imu/data').roll, TRIAL.roll)
    (tmp_path / 'c.csv').write_text(MTI)
    assert read_trial(tmp_path / 'c.csv').roll[3] == pytest.approx(np.radians(3))


def test_frame_and_mounting_reach_every_reader(tmp_path):
    write_csv(tmp_path / 'a.csv', TRIAL)
    write_imu_bag(tmp_path / 'a.mcap', TRIAL)
    for name in ('a.csv', 'a.mcap'):
        turned = read_trial(tmp_path / name, frame='flu', mounting=(0.0, 0.0, np.pi / 2))
        assert np.allclose(turned.roll, 0, atol=1e-9) and np.allclose(turned.pitch, TRIAL.roll)
        with pytest.raises(InputError, match="no frame 'up'"):
            read_trial(tmp_path / name, frame='up')


@pytest.mark.parametrize(
    'name,content,said',
    [
        ('empty.csv', b'', 'is empty'),
        ('text.txt', b'It was a dark and stormy night; the rain fell in torrents.\nIndeed.\n', 'no time column'),
        ('noise.dat', bytes(range(256)) * 8, 'not a text file'),
        ('old.bag', b'#ROSBAG V2.0\n' + bytes(100), 'ROS 1 bag'),
        ('log.mtb', b'\xfa\xff\x3e\x02' + bytes(100), 'binary MTi log'),
        ('still.txt', b'PacketCounter\tSampleTimeFine\tRoll\n\t\t\n\t65535\t\n0\t0\t\n65535\t65535\t', 'at least 8'),
        ('a.lvm', b'LabVIEW Measurement\t\r\n', 'cut off'),
        ('a.csv.gz', gzip.compress(b'time_s,roll_rad\n', mtime=0), 'gzip'),
        ('axis.csv', b'time_s,heave_m\n' + b'0,1\n' * 20, 'no roll or pitch motion'),
        ('nan.csv', b'time_s,roll_rad\n' + b''.join(b'%d,nan\n' % n for n in range(50)), '0 rows of 50'),
        ('two.csv', b'time_s,roll_rad\n0,1\n1,2\n', '2 rows'),
        ('text.mcap', b'version https://git-lfs.github.com/spec/v1\n', 'named as a bag but is none'),
    ],
)
def test_what_cannot_be_read_is_one_sentence(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=said) as error:
        read_trial(path)
    assert '\n' not in str(error.value) and str(path) in str(error.value)


def test_other_things_in_the_way(tmp_path):
    with zipfile.ZipFile(tmp_path / 'a.xlsx', 'w') as archive:
        archive.writestr('sheet', 'x')
    with contextlib.closing(sqlite3.connect(tmp_path / 'other.db')) as connection:
        connection.execute('CREATE TABLE notes (text)')
        connection.commit()
    os.mkfifo(tmp_path / 'pipe')
    write_csv(tmp_path / 'a.csv', TRIAL)
    for name, topic, said in (
        ('absent.csv', None, 'file not found'),
        ('', None, 'folder without a rosbag2 bag'),
        ('a.xlsx', None, 'spreadsheet'),
        ('other.db', None, 'damaged'),
        ('pipe', None, 'not a regular file'),
        ('a.csv', '/imu', 'so it has no topic /imu'),
    ):
        with pytest.raises(InputError, match=said):
            read_trial(tmp_path / name, topic=topic)


@pytest.mark.long
def test_kilohertz_are_read_and_megahertz_are_another_unit(tmp_path):
    write_csv(tmp_path / 'a.csv', Trial(time=2e-4 * np.arange(5000), roll=np.full(5000, 0.1)))
    trial = read_trial(tmp_path / 'a.csv')
    assert trial.time.size == 5000 and trial.advice == ()
    assert trial.axis('roll').sample_interval == pytest.approx(2e-4)
    with pytest.raises(InputError, match='holds no pitch motion .* assign the column of pitch'):
        trial.axis('pitch')
    write_csv(tmp_path / 'a.csv', Trial(time=1e-6 * np.arange(5000), roll=np.full(5000, 0.1)))
    with pytest.raises(InputError, match='more often than any sensor'):
        read_trial(tmp_path / 'a.csv')
    savemat(tmp_path / 'a.mat', {'fs': 1e308, 'roll_rad': TRIAL.roll})
    with pytest.raises(InputError, match='more often than any sensor'):
        read_trial(tmp_path / 'a.mat')


def trial_or_sentence(path):
    try:
        trial = read_trial(path)
    except InputError as error:
        assert '\n' not in str(error)
    else:
        assert trial.axes and np.all(np.diff(trial.time) > 0)


def table_of(header, *cells):
    """Tables with these cells, in rows as long as the header."""
    mark = '\t' if '\t' in header else ';'
    columns = header.count(mark) + 1
    lists = st.lists(st.sampled_from(cells), max_size=120)
    rows = lists.map(lambda found: [mark.join(found[at : at + columns]) for at in range(0, len(found), columns)])
    return rows.map(lambda found: '\n'.join([header, *found]).encode('latin-1'))


STARTS = [b'', b'\x89MCAP0\r\n', b'SQLite format 3\0', b'// ', b'time_s,roll_rad\n', b'\xef\xbb\xbf']
WORDS = st.sampled_from([*'\n\n\r \t', *'time_s roll_rad , ; 0 1 2.5 - x " # nan inf 1e999 1,5'.split()])
CONTENTS = {
    'bytes': st.builds(lambda start, rest: start + rest, st.sampled_from(STARTS), st.binary(max_size=400)),
    'text': st.one_of(st.text(max_size=300), st.lists(WORDS, max_size=150).map(''.join)).map(str.encode),
    'table': table_of('time_s;roll_rad;gyro_x_deg_s', '1', '2.5', '', 'nan', 'x', '1e400', '3,4', '\u00ff'),
    'MTi': table_of(
        '// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tRoll\tGyr_X', '', *'0 65535 1.5 x - nan 1e30'.split()
    ),
}
ANY = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.parametrize('kind', CONTENTS)
@ANY
@given(data=st.data())
def test_any_content_gives_a_trial_or_one_sentence(tmp_path, kind, data):
    (tmp_path / 'any').write_bytes(data.draw(CONTENTS[kind]))
    trial_or_sentence(tmp_path / 'any')


# not struct.mat, for which every example would start a process: see below
@pytest.mark.long
@pytest.mark.parametrize('name', ['a.mcap', 'a.db3', *(name for name in PACKED if name != 'struct.mat')])
@ANY
@given(data=st.data())
def test_damaged_bytes_give_a_trial_or_one_sentence(tmp_path, name, data):
    whole, path = tmp_path / f'whole_{name}', tmp_path / name
    if not whole.exists():
        WRITERS.get(name, lambda path, _: write_imu_bag(path, TRIAL))(whole, COLUMNS)
    content = bytearray(whole.read_bytes())
    # mostly where the structure is: the beginning and the end
    span = data.draw(st.sampled_from([64, min(8192, len(content)), len(content)]))
    for at in data.draw(st.lists(st.integers(-span, span - 1), min_size=1, max_size=8)):
        content[at] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    trial_or_sentence(path)


def test_a_mat_file_over_which_its_reader_crashes_is_damaged(tmp_path, monkeypatch):
    # what lies in the working folder is not run
    (tmp_path / 'scipy.py').write_text('raise SystemExit')
    monkeypatch.chdir(tmp_path)
    savemat(tmp_path / 'a.mat', {'run': {'time_s': TRIAL.time, 'roll_rad': TRIAL.roll}})
    content = bytearray((tmp_path / 'a.mat').read_bytes())
    kind_of_the_numbers = content.index((9).to_bytes(4, 'little') + TRIAL.time.nbytes.to_bytes(4, 'little'))
    content[kind_of_the_numbers] = 0
    (tmp_path / 'a.mat').write_bytes(content)
    with pytest.raises(InputError, match='is damaged .*copy or export it again'):
        read_trial(tmp_path / 'a.mat')


def test_hash_is_that_of_the_content(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_bytes(b'abc' * 1_000_000)
    assert source_hash(path) == hashlib.sha256(path.read_bytes()).hexdigest()
    write_imu_bag(tmp_path / 'bag', TRIAL)
    before = source_hash(tmp_path / 'bag')
    assert source_hash(tmp_path / 'bag') == before
    with open(tmp_path / 'bag' / 'metadata.yaml', 'a') as file:
        file.write('\n')
    assert source_hash(tmp_path / 'bag') != before
    with pytest.raises(InputError):
        source_hash(tmp_path / 'absent')


def test_the_records_of_the_package_are_small_and_each_is_named_with_its_licence():
    assert sum(path.stat().st_size for path in RECORDS.iterdir()) < 1_000_000
    notice = (RECORDS / 'NOTICE').read_text(encoding='utf-8')
    names = {f'{name}.{ending}' for name in SOURCES for ending in ('csv', 'mcap')}
    assert {path.name for path in RECORDS.iterdir()} == names | {'NOTICE'}
    assert all(name in notice for name in names)
    for licence in ('Copyright © 2021, Battelle', 'Simplified BSD', '(c) 2020, Martin Alexandersson', 'MIT License'):
        assert licence in notice


@pytest.mark.parametrize('name', SOURCES)
def test_the_bag_holds_what_the_table_holds(name):
    table, bag = (read_trial(RECORDS / f'{name}.{ending}') for ending in ('csv', 'mcap'))
    assert list(bag.channels) == list(table.channels)
    np.testing.assert_allclose(bag.time - bag.time[0], table.time - table.time[0], atol=1e-9)
    for channel, values in table.channels.items():
        np.testing.assert_allclose(bag.channels[channel], values, atol=1e-9)


def test_the_records_of_the_package_are_the_measured_ones(data_folder):
    for name, place in SOURCES.items():
        source = read_trial(data_folder / place, frame='frd' if name == 'morro_buoy' else None)
        ours = read_trial(RECORDS / f'{name}.csv')
        for channel, values in ours.channels.items():
            assert np.array_equal(values, source.channels[channel][:: EVERY[name]][: values.size], equal_nan=True)
