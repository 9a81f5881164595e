"""What is not read of a record is told with its number, in every format, or the record is refused for it; dates."""

import re
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy.io import savemat
from test_files_tank import WRITERS, sentence

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.account import Loss, in_words, shortage
from swath_sysid.common.errors import InputError
from swath_sysid.formats import mcap_checksums
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.reading import read_trial

h5py = pytest.importorskip('h5py')
openpyxl = pytest.importorskip('openpyxl')

TIME = 0.05 * np.arange(600)
ROLL = 8.0 * np.exp(-0.05 * TIME) * np.cos(2.1 * TIME) + 0.7
PITCH = 2.0 * np.sin(1.3 * TIME)
NAMES = ['time_s', 'roll_deg', 'pitch_deg']
ROWS = list(zip(TIME.tolist(), ROLL.tolist(), PITCH.tolist(), strict=True))


def text(rows, mark=',', names=NAMES):
    return '\n'.join(mark.join(map(str, row)) for row in [names, *rows]) + '\n'


def glued(path):
    path.write_text(text([*ROWS[:99], (*ROWS[99], *ROWS[100]), *ROWS[101:]], ';'))


def quoted_marks(path):
    rows = [(*row, '"still; windy"' if at == 7 else '') for at, row in enumerate(ROWS)]
    path.write_text(text(rows, ';', [*NAMES, 'note']))


def rows_of_another_sensor(path):
    path.write_text(text([line for row in ROWS for line in (row, ('TEMP', 21.5, 'OK'))]))


def empty_rows_between_dates(path):
    rows = [line for t, *rest in ROWS for line in ((f'2026-11-12 10:00:{t:09.6f} UTC', *rest), ('', '', ''))]
    path.write_text(text(rows, '\t', ['Date', '"Roll\n[deg]"', '"Pitch\n[deg]"']))


def other_order(path):
    path.write_text(text(ROWS[:300]) + text([(t, p, r) for t, r, p in ROWS[300:]], names=['time_s', *NAMES[:0:-1]]))


def texts_in_cells(path):
    book = openpyxl.Workbook()
    for row in (NAMES, *[(t, r if at % 50 else 'ERR', p) for at, (t, r, p) in enumerate(ROWS)]):
        book.active.append(row)
    book.save(path)


def texts_in_long_form(path):
    rows = [(t, name, value) for t, r, p in ROWS for name, value in (('roll_deg', r if t else 'ERR'), ('pitch_deg', p))]
    path.write_text(text(rows, names=['time_s', 'field', 'value']))


def texts_of_numbers(path):
    savemat(path, dict(zip(NAMES, (TIME, ROLL, np.array([f'{p:.6f}' for p in PITCH])), strict=True)))


def unwritten_chunks(path):
    with h5py.File(path, 'w') as file:
        file['time_s'], file['roll_deg'] = TIME, ROLL
        chunked = file.create_dataset('pitch_deg', TIME.shape, chunks=(100,), dtype='f8')
        chunked[:300], chunked[400:] = PITCH[:300], PITCH[400:]


def unlike_lengths(path):
    savemat(path, {'time_s': TIME, 'roll_deg': ROLL, 'pitch_deg': PITCH[:-1]})


def longer_than_its_header(path):
    WRITERS['a.outb'](path, {'time_s': TIME, 'roll_deg': ROLL})
    content = path.read_bytes()
    path.write_bytes(content.replace(TIME.size.to_bytes(4, 'little'), (400).to_bytes(4, 'little'), 1))


def shorter_than_its_header(path):
    WRITERS['a.lvm'](path, {'time_s': TIME, 'roll_deg': ROLL})
    path.write_text(''.join(path.read_text().splitlines(keepends=True)[:-100]))


def cut_sentences(path):
    sentences = [
        sentence(f'PASHR,10{t // 60:02.0f}{t % 60:05.2f},90.0,T,{r:.3f},{p:.3f},0,0,0,0,1,0') for t, r, p in ROWS
    ]
    path.write_text('\n'.join(each if at % 50 else each[:20] for at, each in enumerate(sentences)))


def archive_with_an_empty_file(path):
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('motion.csv', text(ROWS))
        archive.writestr('later.csv', '')


FILES = {
    'glued.csv': (glued, 598, ['rows-of-other-width', 'gaps'], '1 row with more or fewer'),
    'quoted.csv': (quoted_marks, 600, [], ''),
    'rows.csv': (rows_of_another_sensor, 600, ['empty-rows'], '600 rows .50%. without a time'),
    'empty.tsv': (empty_rows_between_dates, 600, [], ''),
    'other_order.csv': (other_order, 0, [], 'has other columns from line 302 on'),
    'texts.xlsx': (texts_in_cells, 600, ['text-in-numbers', 'missing-values'], "12 cells .* 'ERR' in line 2"),
    'long.csv': (texts_in_long_form, 600, ['text-in-numbers', 'repeated-samples', 'missing-values'], "'ERR' in line 2"),
    'texts.mat': (texts_of_numbers, 600, [], ''),
    'chunks.h5': (unwritten_chunks, 600, ['unwritten-values', 'missing-values'], 'pitch_deg: 100 of 600 were never'),
    'lengths.mat': (unlike_lengths, 600, ['columns-left-out'], 'holds pitch_deg in'),
    'longer.outb': (longer_than_its_header, 600, [], ''),
    'shorter.lvm': (shorter_than_its_header, 501, ['incomplete-record'], 'lacks 99 of the 600 rows that its header'),
    'cut.nmea': (cut_sentences, 588, ['damaged-sentences'], '12 of 600 sentences'),
    'part.zip': (archive_with_an_empty_file, 600, ['files-left-out'], 'later.csv'),
}  # fmt: skip


@pytest.mark.parametrize('name', FILES)
def test_nothing_is_lost_unsaid(tmp_path, name):
    write, rows, codes, words = FILES[name]
    write(tmp_path / name)
    if not rows:
        with pytest.raises(InputError, match=words):
            read_trial(tmp_path / name)
        return
    trial = read_trial(tmp_path / name)
    assert (trial.time.size, [each.code for each in trial.advice]) == (rows, codes)
    assert re.search(words, str(trial.advice))


def test_a_large_share_is_refused_and_losses_of_columns_are_one_sentence():
    some = [Loss('absurd-values', 3, 90, f'values of {name}', {'largest': 9.0}) for name in ('roll', 'pitch')]
    (advice,) = in_words(some, 'a.csv')
    assert '(roll: 3 of 90, pitch: 3 of 90)' in advice.message and not in_words([Loss('short-rows', 0, 90)], 'a.csv')
    with pytest.raises(InputError, match=r'^a.csv: 9 of 90 rows \(10%\) have no readable time'):
        in_words([Loss('missing-stamps', 9, 90)], 'a.csv')
    assert shortage(90, 91, 'its index') == () and shortage(90, 80, 'its index')[0].number == 10


def test_messages_that_the_index_of_a_bag_leaves_out_are_read(tmp_path):
    time = 0.01 * np.arange(9000)
    write_imu_bag(tmp_path / 'a.mcap', Trial(time=time, roll=0.1 * np.sin(time), pitch=0.1 * np.cos(time)))
    content = bytearray((tmp_path / 'a.mcap').read_bytes())
    with open(tmp_path / 'a.mcap', 'rb') as file:
        first = next(at for code, at, _ in mcap_checksums._records(file) if code == mcap_checksums.CHUNK_INDEX)
    # of a kind that readers pass over, and no check sum of the summary
    content[first - mcap_checksums.HEAD.size], content[-12:-8] = 0x80, bytes(4)
    (tmp_path / 'a.mcap').write_bytes(content)
    trial = read_trial(tmp_path / 'a.mcap')
    assert trial.time.size == time.size and 'its index leaves out messages' in trial.advice[0].message


@pytest.mark.parametrize(
    'form',
    [
        '%m/%d/%Y %H:%M:%S.%f',
        '%m-%d-%y %H:%M:%S.%f',
        '%d.%m.%y %H:%M:%S.%f',
        '%a %b %d %Y %H:%M:%S.%f',
        '%Y/%m/%d-%H:%M:%S.%f',
        '%Y%m%d %H%M%S.%f',
    ],
)
def test_the_order_of_day_and_month_is_that_of_the_whole_column(tmp_path, form):
    days = [datetime(2026, 11, 12, 10), datetime(2026, 11, 13, 9)]
    seconds = [*TIME, *(82800.0 + TIME)]
    dates = [f'{day + timedelta(seconds=float(t)):{form}}' for day in days for t in TIME]
    (tmp_path / 'a.csv').write_text(
        '\n'.join(['Date,roll_deg', *[f'{d},{r}' for d, r in zip(dates, 2 * [*ROLL], strict=True)]])
    )
    savemat(tmp_path / 'a.mat', {'Date': np.array(dates), 'roll_deg': np.tile(ROLL, 2)})
    for name in ('a.csv', 'a.mat'):
        trial = read_trial(tmp_path / name)
        assert trial.time - trial.time[0] == pytest.approx(seconds, abs=1e-3)


@pytest.mark.parametrize(
    'form,starts',
    [
        ('%d/%m/%Y %H:%M:%S.%f', [5]),
        ('%m/%d/%Y %H:%M:%S.%f', [5 + 13.999 / 24]),
        ('%d-%m-%y %H:%M:%S.%f', [1, 2, 3, 4]),
        ('%d.%m.%Y %H:%M:%S.%f', [5, 7]),
        ('%y-%m-%d %H:%M:%S.%f', [5, 7]),
        ('%m/%d/%Y %H:%M:%S.%f', [5, 7]),
        ('%d/%m/%Y %H:%M:%S.%f', [5, 35]),
    ],
)
def test_dates_that_fit_two_orders_are_read_only_where_the_time_between_rows_is_the_same(tmp_path, form, starts):
    seconds = np.concatenate([86400.0 * day + TIME for day in starts])
    dates = [f'{datetime(2026, 5, 31, 10) + timedelta(seconds=float(t)):{form}}' for t in seconds]
    rows = zip(dates, np.tile(ROLL, len(starts)), strict=True)
    (tmp_path / 'a.csv').write_text('# printed on 01/12/2027\n' + text(rows, names=['Date', 'roll_deg']))
    if '/' in form and len(starts) > 1:
        both = r'a.csv: its dates may run from 0\d \w+ 2026 to 0\d \w+ 2026 or from 0\d \w+ 2026 to 0\d \w+ 2026: '
        with pytest.raises(InputError, match=both):
            read_trial(tmp_path / 'a.csv')
        return
    trial = read_trial(tmp_path / 'a.csv')
    assert trial.time - trial.time[0] == pytest.approx(seconds - seconds[0], abs=1e-3)
