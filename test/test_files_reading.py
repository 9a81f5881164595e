"""Whatever a file is, it is read for what it is, or refused in one sentence."""

import gzip
import os
import sqlite3
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial, source_hash

TIME = 0.01 * np.arange(300)
TRIAL = Trial(time=TIME, roll=0.1 * np.sin(TIME), pitch=0 * TIME)
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
        ('noise.bin', bytes(range(256)) * 8, 'not a text file'),
        ('old.bag', b'#ROSBAG V2.0\n' + bytes(100), 'ROS 1 bag'),
        ('log.mtb', b'\xfa\xff\x3e\x02' + bytes(100), 'binary MTi log'),
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
    with pytest.raises(InputError, match='file not found'):
        read_trial(tmp_path / 'absent.csv')
    with pytest.raises(InputError, match='folder without a rosbag2 bag'):
        read_trial(tmp_path)
    with zipfile.ZipFile(tmp_path / 'a.xlsx', 'w') as archive:
        archive.writestr('sheet', 'x')
    with pytest.raises(InputError, match='spreadsheet'):
        read_trial(tmp_path / 'a.xlsx')
    connection = sqlite3.connect(tmp_path / 'other.db')
    connection.execute('CREATE TABLE notes (text)')
    connection.commit()
    connection.close()
    with pytest.raises(InputError, match='damaged'):
        read_trial(tmp_path / 'other.db')
    os.mkfifo(tmp_path / 'pipe')
    with pytest.raises(InputError, match='not a regular file'):
        read_trial(tmp_path / 'pipe')
    write_csv(tmp_path / 'a.csv', TRIAL)
    with pytest.raises(InputError, match='so it has no topic /imu'):
        read_trial(tmp_path / 'a.csv', topic='/imu')


def test_kilohertz_are_read_and_megahertz_are_another_unit(tmp_path):
    write_csv(tmp_path / 'a.csv', Trial(time=2e-4 * np.arange(5000), roll=np.full(5000, 0.1)))
    trial = read_trial(tmp_path / 'a.csv')
    assert trial.time.size == 5000 and trial.advice == ()
    assert trial.axis('roll').sample_interval == pytest.approx(2e-4)
    with pytest.raises(InputError, match='holds no pitch motion'):
        trial.axis('pitch')
    write_csv(tmp_path / 'a.csv', Trial(time=1e-6 * np.arange(5000), roll=np.full(5000, 0.1)))
    with pytest.raises(InputError, match='more often than any sensor'):
        read_trial(tmp_path / 'a.csv')


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    start=st.sampled_from([b'', b'\x89MCAP0\r\n', b'SQLite format 3\0', b'// ', b'time_s,roll_rad\n', b'\xef\xbb\xbf']),
    rest=st.binary(max_size=400),
)
def test_any_file_gives_a_trial_or_one_sentence(tmp_path, start, rest):
    path = tmp_path / 'any'
    path.write_bytes(start + rest)
    try:
        assert read_trial(path).axes
    except InputError as error:
        assert '\n' not in str(error)


def test_hash_is_that_of_the_content(tmp_path):
    import hashlib

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
