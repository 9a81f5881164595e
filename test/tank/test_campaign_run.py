"""Campaigns from manifest to report: bad trials, interruption, workers that die, and what is written."""

import asyncio
import csv
import json
import logging
import math
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_report_html_page import assert_holds_together

from swath_sysid.attitude.hull.catalogue import equation_named, hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import SerialExecutor
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.model_file import read_description, read_model
from swath_sysid.report.html_page import escaped
from swath_sysid.report.tables import table_as_csv
from swath_sysid.tank.campaign import work as executors
from swath_sysid.tank.campaign.evaluation import TIE
from swath_sysid.tank.campaign.manifest import read_manifest
from swath_sysid.tank.campaign.run import run_campaign
from swath_sysid.tank.campaign.work import ResultStore, executor_of
from swath_sysid.tank.cli import kept_work
from swath_sysid.tank.extinction import TypeB
from swath_sysid.tank.report import campaign_tables, client_pages
from swath_sysid.tank.report.campaign_report import every_table, write_report
from swath_sysid.tank.report.campaign_results import in_words
from swath_sysid.tank.report.pdf import BROWSERS, write_pdf

ROOT = Path(__file__).resolve().parents[2]
HULL = hull_named('swath-pitch').model
DRAFTS = (0.9, 1.1)
MANIFEST = """\
title: A <small> campaign
craft: {name: model, draft_m: 0.154}
axis: pitch
equations: [linear, swath-pitch-6]
objectives: [one-step]
trials:
  - pattern: 'pitch_{angle}deg_{draft_factor}T_repeat{repeat}.csv'
"""


def hull_at(factor):
    return DecayModel.from_terms(HULL.equation, HULL.terms | {'r1': HULL.terms['r1'] / factor}, axis='pitch')


@pytest.fixture(scope='module')
def trials(tmp_path_factory):
    """A folder with two drafts, one angle, two repeats at the lighter draft, and the manifest."""
    folder = tmp_path_factory.mktemp('trials')
    for k, (factor, repeat) in enumerate(((0.9, 1), (0.9, 2), (1.1, 1))):
        made = simulated_trial(hull_at(factor), math.radians(6), 6.0, 20.0, SensorNoise(), k + 1)
        write_csv(folder / f'pitch_6deg_{factor}T_repeat{repeat}.csv', made)
    (folder / 'campaign.yaml').write_text(MANIFEST)
    return folder


class Remembering(Executor):
    """Works serially, and each task once in this module: the same arguments give the same result."""

    known = {}

    def submit(self, function, /, *args, **kwargs):
        task = pickle.dumps((function, args, kwargs))
        if task not in self.known:
            self.known[task] = SerialExecutor().submit(function, *args, **kwargs)
        return self.known[task]


def work_off(folder, output, executor=None, text=None, progress=lambda _: None):
    """The campaign in a folder, or one of another manifest, and what it gives."""
    path = folder / ('other.yaml' if text else 'campaign.yaml')
    if text:
        path.write_text(text)
    return run_campaign(read_manifest(path), ResultStore(output / 'results'), executor or Remembering(), progress)


def rows_of(path):
    with open(path, newline='') as file:
        return list(csv.DictReader(file))


def tables_of(outcome):
    return {table.name: table_as_csv(table) for table in every_table(outcome)}


@pytest.fixture(scope='module')
def done(trials, tmp_path_factory):
    output = tmp_path_factory.mktemp('done')
    outcome = work_off(trials, output)
    write_report(outcome, output, with_annex=True)
    return outcome, output


@pytest.mark.long
@pytest.mark.slow
def test_every_record_with_every_equation(done):
    outcome, _ = done
    (axis,) = outcome.axes
    assert len(axis.records) == 3 and axis.names == ('linear', 'swath-pitch-6')
    assert outcome.failures == () and outcome.kept == 0
    for objective in ('simulation', 'one-step'):
        assert [[f.model.equation.name for f in fits] for fits in axis.fits[objective]] == [list(axis.names)] * 3
        assert all(more.objective_value <= less.objective_value * (1.0 + TIE) for less, more in axis.fits[objective])
    assert list(axis.by_draft) == [0.9, 1.1] and len(axis.best) == 2
    stiffness = [m.model.terms['r1'] for m in axis.schedule.models]
    np.testing.assert_allclose(stiffness, [hull_at(f).terms['r1'] for f in DRAFTS], rtol=0.02)


class Ending(Executor):
    """Works off so many tasks; then it raises its end, or gives it as the future."""

    def __init__(self, tasks, end):
        self.left, self.end = tasks, end

    def submit(self, function, /, *args, **kwargs):
        self.left -= 1
        if self.left >= 0:
            return Remembering().submit(function, *args, **kwargs)
        if isinstance(self.end, Future):
            return self.end
        raise self.end


@pytest.mark.long
def test_interrupted_again_and_again_and_continued_gives_the_same_tables(trials, done, tmp_path):
    for tasks in (1, 8, 10):
        with pytest.raises(KeyboardInterrupt):
            work_off(trials, tmp_path, Ending(tasks, KeyboardInterrupt()))
    outcome = work_off(trials, tmp_path)
    assert outcome.kept == 19
    assert outcome.kept + outcome.computed == done[0].computed
    assert tables_of(outcome) == tables_of(done[0])
    assert outcome.axes[0].schedule == done[0].axes[0].schedule


@pytest.mark.release
def test_two_processes_killed_stopped_and_continued_give_the_same_tables(trials, done, tmp_path):
    verb = [sys.executable, '-m', 'swath_sysid.start', 'campaign']
    command = [*verb, str(trials / 'campaign.yaml'), '--output', str(tmp_path), '--jobs', '2']
    environment = os.environ | {'PYTHONPATH': str(ROOT)}
    stopped = '\nstopped: the same command continues from the finished fits'
    for number, code, last_words in (
        (signal.SIGKILL, -signal.SIGKILL, ''),
        (signal.SIGINT, 130, stopped),
        (signal.SIGTERM, 130, stopped),
    ):
        known = len(list(tmp_path.glob('results/??/*.json')))
        pipes = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.PIPE, 'text': True}
        running = subprocess.Popen(command, env=environment, start_new_session=True, **pipes)
        deadline = time.monotonic() + 600
        while len(list(tmp_path.glob('results/??/*.json'))) < known + 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        if number == signal.SIGINT:
            # as a terminal does: to the workers as well
            os.killpg(running.pid, number)
        else:
            running.send_signal(number)
        said = running.stderr.read()
        assert running.wait() == code and said.endswith(f'{last_words}\n'), said
        assert number == signal.SIGKILL or not any(word in said for word in ('Traceback', 'leaked semaphore')), said
        assert not (tmp_path / 'report.html').exists()
    outcome = work_off(trials, tmp_path)
    assert outcome.kept > 0
    assert tables_of(outcome) == tables_of(done[0])


@pytest.mark.long
def test_what_differs_is_computed_again(trials, done, tmp_path):
    _, output = done
    other = MANIFEST.replace('title: A', 'title: B').replace('[linear, swath-pitch-6]', '[linear]')
    same = work_off(trials, output, text=other)
    assert same.kept >= 6 and same.failures == ()
    seeded = other.replace('{draft_factor}T_repeat{repeat}', '0.9T_repeat1') + 'search: {seed: 2}\n'
    assert work_off(trials, output, text=seeded).kept == 0


@pytest.mark.long
@pytest.mark.slow
def test_bad_trials_are_named_and_the_rest_is_done(trials, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('swath_sysid.common.processes.SerialExecutor', Remembering)
    for path in trials.glob('*0.9T*.csv'):
        (tmp_path / path.name).write_text(path.read_text())
    (tmp_path / 'torn.mcap').write_bytes(b'\x89MCAP0\r\n' + b'\x07' * 50)
    (tmp_path / 'noise.csv').write_text('time_s,pitch_deg\n' + ''.join(f'{k / 50},{k % 7}\n' for k in range(400)))
    (tmp_path / 'roll_only.csv').write_text('time_s,roll_deg\n' + ''.join(f'{k / 50},{k % 7}\n' for k in range(400)))
    contradictory = next(trials.glob('*0.9T*')).read_text().replace('pitch_rate_rad_s', 'pitch_rate_deg_s')
    (tmp_path / 'contradictory.csv').write_text(contradictory)
    cut = next(trials.glob('*0.9T*')).read_text().splitlines()[:-3]
    (tmp_path / 'cut.csv').write_text('\n'.join(cut))
    text = MANIFEST.replace('[linear, swath-pitch-6]', '[linear]').replace('[one-step]', '[simulation]') + (
        '  - {file: torn.mcap, initial_angle_deg: 6}\n'
        '  - {file: noise.csv, initial_angle_deg: 6}\n'
        '  - {file: roll_only.csv, initial_angle_deg: 6}\n'
        '  - {file: absent.csv, initial_angle_deg: 6}\n'
        '  - {file: contradictory.csv, initial_angle_deg: 6, draft_factor: 0.9}\n'
        '  - {file: pitch_6deg_0.9T_repeat1.csv, initial_angle_deg: 6, draft_factor: 0.9, repeat: 5}\n'
        '  - {file: cut.csv, initial_angle_deg: 6, draft_factor: 0.9, repeat: 1}\n'
    )
    (tmp_path / 'campaign.yaml').write_text(text)
    output = tmp_path / 'out'
    assert main(['campaign', str(tmp_path / 'campaign.yaml'), '--output', str(output), '--jobs', '1', '--json']) == 1
    said = capsys.readouterr()
    for number, words in (
        (2, 'torn.mcap'),
        (3, 'noise.csv'),
        (4, 'no pitch motion'),
        (5, 'file not found: absent.csv'),
        (6, 'times the derivative of the pitch angle'),
        (7, 'it is given twice: name it once'),
        (8, 'are those of pitch_6deg_0.9T_repeat1.csv: give another repeat'),
    ):
        assert any(f'trials, {number}' in told and words in told for told in said.err.splitlines()), said.err
    told = json.loads(said.out)
    assert told['trials'] == 8 and len(told['left_out']) >= 4 and told['axes']['pitch']['choice']
    page = (output / 'report.html').read_text()
    assert 'torn.mcap' in page and 'absent.csv' in page
    assert len(rows_of(output / 'tables' / 'trials.csv')) == 8


def test_an_equation_that_suits_no_record_is_left_out(trials, tmp_path):
    text = MANIFEST.replace('swath-pitch-6]', 'odd-cubic+friction]').replace('{draft_factor}T_repeat{repeat}', '0.9T*1')
    preset = 'search: {preset: swath-pitch, generations: 3, population: 8}\n'
    outcome = work_off(trials, tmp_path, text=text + preset)
    assert outcome.axes[0].names == ('linear',)
    assert len(outcome.failures) == 2 and 'friction' in outcome.failures[0]
    assert all(t.record is not None for t in outcome.trials)


@pytest.mark.parametrize(
    'content, cure', [('not a trial\n', ''), ('t,Phi\n0,1\n1,2\n', '.*columns: {time: .t:s., roll: .Phi:deg.}')]
)
def test_nothing_usable_is_an_error(tmp_path, content, cure):
    (tmp_path / 'bad.csv').write_text(content)
    with pytest.raises(InputError, match=f'no trial of the campaign can be used: bad.csv: trials, 1{cure}'):
        work_off(tmp_path, tmp_path / 'out', text='axis: pitch\ntrials: [{file: bad.csv}]\n')


def write_releases(path, period, angles, seed):
    """A German export: for each angle the craft is held, let go, and left alone for twelve periods."""
    made = DecayModel.from_terms(
        equation_named('b1|r1'), {'b1': 0.12, 'r1': (2.0 * math.pi / period) ** 2}, axis='roll'
    )
    parts = [simulated_trial(made, math.radians(a), 12 * period, 20.0, SensorNoise(), seed, 6.0).roll for a in angles]
    rows = enumerate(np.degrees(np.concatenate(parts)))
    lines = [f'{k / 20:.2f};{angle:.4f}'.replace('.', ',') for k, angle in rows]
    path.write_text('\n'.join(['Zeit [s];Rollwinkel [°]', *lines]), encoding='utf-8')


@pytest.mark.long
def test_every_release_counts_and_periods_that_contradict_each_other_are_never_pooled(tmp_path, capsys):
    for number, period in enumerate((2.0, 2.3, 2.0), 1):
        write_releases(tmp_path / f'Versuch_{number}.csv', period, (10, -10, 6), number)
    assert main(['campaign', '--new', str(tmp_path)]) == 0
    assert 'the periods contradict each other' in capsys.readouterr().err.lower()
    text = (tmp_path / 'campaign.yaml').read_text()
    assert "'Versuch_2.csv'   # 3 releases, period 2.3 s" in text and '\naxis: roll' in text
    (tmp_path / 'Versuch_3.csv').unlink()
    head = 'axis: roll\nequations: [linear]\ntrials:\n'
    with pytest.raises(InputError, match=r'2 s \(Versuch_1.csv\), 2.3 s \(Versuch_2.csv\).*give draft_m'):
        work_off(tmp_path, tmp_path / 'asked', text=head + '  - pattern: Versuch_*.csv\n')
    outcome = work_off(
        tmp_path,
        tmp_path / 'told',
        text=head + '  - {file: Versuch_1.csv, draft_m: 0.15}\n  - {file: Versuch_2.csv, draft_m: 0.18}\n',
    )
    assert [(t.record.condition.loading, t.record.condition.initial_angle_deg) for t in outcome.trials] == [
        (draft, angle) for draft in (0.15, 0.18) for angle in (10.0, -10.0, 6.0)
    ]
    write_releases(tmp_path / 'odd.csv', 2.3, (10,), 7)
    outcome = work_off(tmp_path, tmp_path / 'odd', text=head + '  - {file: Versuch_1.csv}\n  - {file: odd.csv}\n')
    assert [t.record is None for t in outcome.trials] == [False, False, False, True]
    assert 'period of 2.3 s contradicts the 2 s of 3 other releases' in outcome.trials[3].reason


@pytest.mark.long
def test_drafts_of_files_are_told_apart_and_refer_to_the_design_draft(tmp_path):
    for repeat, factor in enumerate(DRAFTS, 1):
        made = simulated_trial(hull_at(factor), math.radians(6), 5.0, 20.0, SensorNoise(), repeat)
        write_csv(tmp_path / f'pitch_6deg_repeat{repeat}.csv', replace(made, draft=0.154 * factor))
    text = "axis: pitch\nequations: [linear]\ntrials: [{pattern: 'pitch_{angle}deg_repeat{repeat}.csv'}]\n"
    outcome = work_off(tmp_path, tmp_path / 'out', text=text)
    assert outcome.quantity == 'draft_m'
    assert [t.record.condition.loading for t in outcome.trials] == pytest.approx([0.154 * draft for draft in DRAFTS])
    outcome = work_off(tmp_path, tmp_path / 'out', text=text + 'craft: {draft_m: 0.154}\n')
    assert [t.record.condition.loading for t in outcome.trials] == pytest.approx(DRAFTS)


@pytest.mark.long
def test_drafts_are_converted_where_the_craft_is_known(trials, tmp_path):
    one, other = sorted(trials.glob('*0.9T*.csv'))
    text = (
        'axis: pitch\nequations: [linear]\ntrials:\n'
        f'  - {{file: {one}, draft_m: 0.1386}}\n  - {{file: {other}, draft_factor: 0.9}}\n'
    )
    outcome = work_off(tmp_path, tmp_path / 'out', text=text + 'craft: {draft_m: 0.154}\n')
    assert outcome.quantity == 'draft_m'
    assert {t.record.condition.loading for t in outcome.trials} == {0.1386}
    assert [t.record.repeat for t in outcome.trials] == [1, 2]
    assert 'cannot be converted to draft_m' in work_off(tmp_path, tmp_path / 'out', text=text).trials[1].reason


@pytest.mark.long
def test_the_files_that_are_written(done):
    outcome, output = done
    names = {path.name for path in (output / 'tables').iterdir()}
    assert names == {f'{table.name}.csv' for table in every_table(outcome)}
    assert names >= {'trials.csv', 'fits.csv', 'coefficients.csv', 'ranking_pitch.csv', 'objective_pitch_one-step.csv'}
    rows = rows_of(output / 'tables' / 'objective_pitch_simulation.csv')
    axis = outcome.axes[0]
    for row, index in zip(rows, axis.best.values(), strict=True):
        for name, fit in zip(axis.names, axis.fits['simulation'][index], strict=True):
            assert float(row[name]) == fit.objective_value
    assert read_description(output / 'model.yaml')[1]['pitch'] == axis.schedule
    assert read_model(output / 'model.yaml')['pitch'] == axis.schedule.reference
    figures = list((output / 'figures').glob('*.svg'))
    assert len(figures) > 12 and all(path.read_text().rstrip().endswith('</svg>') for path in figures)


@pytest.mark.long
def test_the_page_needs_nothing_else_and_holds_together(done):
    page = (done[1] / 'report.html').read_text()
    assert_holds_together(page)
    for words in ('A &lt;small&gt; campaign', 'Repeats agree to', 'Within a condition the objective values'):
        assert words in page
    (axis,) = done[0].axes
    first, _, rest = page.partition('<details class="rest">')
    for loading, fits in axis.by_draft.items():
        verdict = fits[axis.choice].verdict
        assert f'the fit of all records at {loading:g} is {verdict}' in rest
        assert (verdict.level != 'adequate') == (escaped(verdict.sentence) in first)
    for row in rows_of(done[1] / 'tables' / 'results.csv'):
        truth = 2.0 * math.pi / math.sqrt(HULL.terms['r1'] / float(row['draft factor']))
        assert float(row['natural period [s]']) == pytest.approx(truth, rel=0.1) and f'>{row["verdict"]}</td>' in first


@pytest.mark.long
def test_the_client_sees_two_sheets_with_the_title_block_of_the_manifest(done, tmp_path):
    outcome, _ = done
    (tmp_path / 'logo.svg').write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    text = MANIFEST + "report: {client: A & B, scale: '1:12.5', date: 2026-11-27, logo: logo.svg}\n"
    (tmp_path / 'm.yaml').write_text(text.replace("'pitch_", "'*pitch_"))
    for each in outcome.trials:
        (tmp_path / each.entry.path.name).write_text('')
    manifest = read_manifest(tmp_path / 'm.yaml')
    first = ''.join(client_pages.cover(replace(outcome, manifest=manifest)))
    for words in ('A &amp; B', 'scale 1:12.5', '2026-11-27', 'data:image/svg+xml;base64,', 'not stated', '+6', ' ± '):
        assert words in first, words
    said = re.sub('<svg.*?</svg>|<[^>]*>', ' ', first + ''.join(client_pages.method(outcome)), flags=re.DOTALL)
    assert not re.search(r'generation|processor|e-0\d|\bNone\b|\bnan\b', said)
    (tmp_path / 'm.yaml').write_text(text.replace('logo.svg', 'logo.gif'))
    with pytest.raises(InputError, match='is no picture'):
        read_manifest(tmp_path / 'm.yaml')


@pytest.mark.long
def test_releases_to_both_sides_are_compared_and_are_no_repeats(done):
    outcome, _ = done
    (axis,) = outcome.axes
    one = next(c for c in axis.together if c.loading == 0.9)
    other = replace(one, initial_angle_deg=-6.0)
    assert campaign_tables.sides_table(outcome, axis).rows == ()
    sides = replace(axis, together={one: axis.together[one], other: axis.together[one]})
    table = campaign_tables.sides_table(outcome, sides)
    assert [row[1] for row in table.rows] == [6.0, 6.0] and table.marks == {}
    assert all(row[5] == 0.0 and row[6] > 0.0 for row in table.rows)
    assert 'at most 0 % in natural period' in campaign_tables.sides_statement(outcome, sides)


@given(value=st.floats(1e-9, 1e9), share=st.floats(1e-7, 10.0))
def test_a_value_and_its_uncertainty_have_the_same_digits(value, share):
    text = in_words(value, share * value)
    found = re.fullmatch(r'\(?([\d.]+) ± ([\d.]+)\)?(?: × 10\^(-?\d+))?', text)
    one, other, power = found[1], found[2], int(found[3] or 0)
    places = [len(each.partition('.')[2]) for each in (one, other)]
    assert places[0] == places[1]
    assert float(other) * 10.0**power == pytest.approx(share * value, rel=0.051)
    assert abs(float(one) * 10.0**power - value) <= 0.51 * 10.0 ** (power - places[0]) + 1e-9 * value


@pytest.mark.long
def test_a_pdf_is_printed_by_a_browser_or_refused_before_any_work(trials, done, tmp_path, monkeypatch, capsys):
    if any(map(shutil.which, BROWSERS)):
        outcome = done[0]
        # B55 makes the page longest
        known = replace(outcome.manifest.craft, inertia_kg_m2=2.0, displacement_kg=43.7, gm_longitudinal_m=1.2)
        uncertain = TypeB(sensor_scale=0.005, time_base=0.001, inertia=0.02)
        manifest = replace(outcome.manifest, craft=known, uncertainty=uncertain)
        write_pdf(write_report(replace(outcome, manifest=manifest), tmp_path), tmp_path / 'report.pdf')
        printed = (tmp_path / 'report.pdf').read_bytes()
        assert printed.startswith(b'%PDF') and len(re.findall(rb'/Type /Page\b', printed)) == 2
    monkeypatch.setattr('shutil.which', lambda name: None)
    words = ['campaign', str(trials / 'campaign.yaml'), '--output', str(tmp_path / 'none'), '--pdf']
    assert main(words) == 2 and 'Chromium, Chrome or Edge' in capsys.readouterr().err
    assert not (tmp_path / 'none').exists()


@pytest.mark.long
def test_the_command_line_scales_there_and_back(done, tmp_path, capsys):
    _, output = done
    there, back = tmp_path / 'full.yaml', tmp_path / 'back.yaml'
    assert main(['scale', str(output / 'model.yaml'), '--ratio', '25', '--output', str(there)]) == 0
    assert 'viscous-scale-effect' in capsys.readouterr().err
    assert main(['scale', str(there), '--ratio', '1/25', '--output', str(back), '--json']) == 0
    assert back.read_text() == (output / 'model.yaml').read_text()
    period = read_model(there)['pitch'].model.natural_period
    assert period == pytest.approx(5.0 * read_model(back)['pitch'].model.natural_period)
    before, after = json.loads(capsys.readouterr().out)['axes']['pitch']['natural_period_s']
    assert before == pytest.approx(5.0 * after)


def test_the_command_line_refuses_what_makes_no_sense(trials, tmp_path, capsys):
    manifest = str(trials / 'campaign.yaml')
    for arguments, words in (
        ([manifest], 'give --output'),
        ([], 'give either a manifest, or --new'),
        ([manifest, '--output', str(tmp_path), '--jobs', '0'], 'at least 1 process (--jobs)'),
        ([str(tmp_path / 'absent.yaml'), '--output', str(tmp_path)], 'cannot read the manifest'),
        (['--new', str(tmp_path / 'absent')], 'there is no folder'),
    ):
        assert main(['campaign', *arguments]) == 2
        assert words in capsys.readouterr().err


def test_a_cluster_that_does_not_answer(monkeypatch):
    pytest.importorskip('distributed')
    config = pytest.importorskip('dask.config')
    monkeypatch.setitem(config.config['distributed']['comm']['timeouts'], 'connect', 1)
    with pytest.raises(InputError, match='no Dask scheduler answers'), executor_of(1, 'tcp://127.0.0.1:9'):
        pass


def future_of(error):
    """As distributed.cfexecutor gives of a lost scheduler: cancelled, or with an error."""
    future = Future()
    if error is None:
        future.cancel()
        future.set_running_or_notify_cancel()
    else:
        future.set_exception(error)
    return future


@pytest.mark.long
def test_a_lost_scheduler_ends_with_one_sentence_and_what_is_done_stays(trials, done, tmp_path, monkeypatch, capsys):
    comm_closed, client_closed = type('CommClosedError', (OSError,), {}), type('ClosedClientError', (Exception,), {})
    comm, client = SimpleNamespace(CommClosedError=comm_closed), SimpleNamespace(ClosedClientError=client_closed)
    monkeypatch.setattr(executors, 'distributed', SimpleNamespace(comm=comm, client=client))
    for tasks, end in (
        (1, client_closed('closed')),
        (0, comm_closed('in <TCP>')),
        (0, future_of(None)),
        (0, future_of(asyncio.CancelledError())),
    ):
        lost = nullcontext(Ending(tasks, end))
        monkeypatch.setattr(kept_work, 'executor_of', lambda *_, lost=lost: lost)
        assert main(['campaign', str(trials / 'campaign.yaml'), '--output', str(tmp_path)]) == 2
        error = capsys.readouterr().err
        assert 'the connection to the Dask scheduler was lost' in error and 'Traceback' not in error
        assert not logging.getLogger('distributed.client').isEnabledFor(logging.ERROR)
        assert not (tmp_path / 'report.html').exists()
    outcome = work_off(trials, tmp_path)
    assert outcome.kept == 1 and tables_of(outcome) == tables_of(done[0])


@pytest.mark.long
def test_on_a_dask_cluster_a_worker_that_dies_costs_nothing(trials, done, tmp_path):
    distributed = pytest.importorskip('distributed')
    killed = []

    def kill_one(progress):
        if progress.done >= 4 and not killed:
            worker = next(iter(cluster.workers.values()))
            os.kill(worker.pid, signal.SIGKILL)
            killed.append(worker.pid)

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with executor_of(1, cluster.scheduler_address) as executor:
            outcome = work_off(trials, tmp_path, executor, progress=kill_one)
    assert killed and outcome.failures == ()
    assert outcome.computed == done[0].computed
    assert tables_of(outcome) == tables_of(done[0])


@pytest.mark.release
def test_measured_trials(data_folder, tmp_path):
    """The smallest and the largest angle of the measured platform: friction is found."""
    text = (
        'craft: {name: FOSWEC}\naxis: pitch\nequations: [linear, odd-cubic, odd-cubic+friction]\ntrials:\n'
        f"  - pattern: '{data_folder}/decay/foswec/pitch_{{angle}}deg_repeat{{repeat}}.csv'\n"
    )
    (axis,) = work_off(tmp_path, tmp_path / 'out', text=text).axes
    assert len(axis.records) == 9 and axis.ranking.choice.name == 'odd-cubic+friction'
    assert axis.ranking.findings[0].code == 'friction-necessary'
    chosen = [fits[axis.choice] for fits in (*axis.fits['simulation'], *axis.by_draft.values())]
    assert min(f.ratio(term)[0] for f in chosen for term in ('b0', 'b1', 'b2')) >= 0.0
    assert axis.by_draft[1.0][axis.choice].r2 > 0.998
    period = [s for s in axis.spreads if s.quantity == 'natural_period_s']
    assert len(period) == 3 and max(s.spread / s.mean for s in period) < 0.01


TANK = """\
craft: {name: model, length_m: 1.2, beam_m: 0.6, draft_m: 0.154, displacement_kg: 30, gm_longitudinal_m: 0.4}
axis: pitch
uncertainty: {metacentric_height: 0.02}
predictions:
  - {method: Ikeda, amplitude_deg: 2, damping_n_m_s: 20}
  - {method: CFD, amplitude_deg: 3, damping_ratio: 0.2}
trials:
  - pattern: 'pitch_{angle}deg_{draft_factor}T_{speed}ms_repeat{repeat}.csv'
"""


@pytest.fixture(scope='module')
def at_two_speeds(tmp_path_factory):
    """Two drafts and two speeds, whose damping grows with speed, without equations; one repeat was in a swell."""
    folder = tmp_path_factory.mktemp('tank')
    for seed, (factor, speed, repeat) in enumerate([(1.0, 0, 1), (1.0, 0, 2), (1.0, 2, 1), (1.1, 0, 1)]):
        hull = DecayModel.from_terms(HULL.equation, HULL.terms | {'b1': 0.5 + 0.3 * speed}, axis='pitch')
        made = simulated_trial(hull, math.radians(6), 12.0, 20.0, SensorNoise(rate=0.002), seed)
        if repeat == 2:
            angle, rate = 0.008 * np.sin(3.3 * made.time), 0.0264 * np.cos(3.3 * made.time)
            made = replace(made, pitch=made.pitch + angle, pitch_rate=made.pitch_rate + rate)
        write_csv(folder / f'pitch_6deg_{factor}T_{speed}ms_repeat{repeat}.csv', made)
    (folder / 'campaign.yaml').write_text(TANK)
    outcome = work_off(folder, folder / 'out')
    write_report(outcome, folder / 'out', with_annex=True)
    return outcome, folder / 'out'


@pytest.mark.release
def test_without_an_equation_one_hull_is_told_with_its_verdicts(at_two_speeds):
    outcome, output = at_two_speeds
    resting, _ = outcome.axes
    (name,) = resting.names
    assert set(equation_named(name).terms) == {t for (fit,) in resting.by_draft.values() for t in fit.model.terms}
    assert name in resting.ranking.reason and 'general hull' in resting.ranking.reason
    models = [identified for axis in outcome.axes for identified in axis.schedule.models]
    assert all(set(m.posterior.equation.terms) >= set(m.model.equation.terms) and m.verdict for m in models)
    levels = {row['fit of']: row['verdict'] for row in rows_of(output / 'tables/verdicts_pitch.csv')}
    assert levels['all at 1.1'] == levels['pitch_6deg_1.1T_0ms_repeat1.csv'] == 'adequate'
    assert levels['pitch_6deg_1.0T_0ms_repeat1.csv'] == 'adequate' != levels['pitch_6deg_1.0T_0ms_repeat2.csv']
    assert 'repeat 2' in resting.ranking.findings[-1].message
    page = (output / 'report.html').read_text()
    assert 'Which equation' not in page and 'No equation fits' not in page and name in page
    assert not list(output.glob('tables/ranking*')) and not list(output.glob('tables/*every_equation*'))


@pytest.mark.release
def test_each_speed_has_its_own_model_and_the_damping_its_dimensions(at_two_speeds):
    outcome, output = at_two_speeds
    assert [axis.axis for axis in outcome.axes] == ['pitch', 'pitch_2m_s']
    assert {path.name for path in output.glob('model*.yaml')} == {'model.yaml', 'model_2m_s.yaml'}
    b1 = [axis.schedule.models[0].model.terms['b1'] for axis in outcome.axes]
    assert b1[0] == pytest.approx(0.5, abs=0.1) and b1[1] == pytest.approx(1.1, abs=0.15)
    speeds = [r['value'] for r in rows_of(output / 'tables/conditions.csv') if r['what'] == 'speed [m/s]']
    assert speeds[1] == f'2, Froude number {2.0 / math.sqrt(9.80665 * 1.2):.3g}'
    # damping in dimensions at the design draft alone
    rows = rows_of(output / 'tables/damping_pitch.csv')
    design = {r['quantity']: r for r in rows if r['draft factor'] == '1.0'}
    other = {r['quantity'] for r in rows if r['draft factor'] == '1.1'}
    assert 'B55' in design and 'B55' not in other
    inertia = 30.0 * 9.80665 * 0.4 / HULL.terms['r1']
    found = float(design['B55']['value'])
    assert found == pytest.approx(inertia * float(design['equivalent damping over inertia']['value']), rel=0.02)
    assert float(design['B55']['type B, GM']) == pytest.approx(0.02 * found)
    assert float(design['B55']['U (k = 2)']) >= 0.04 * found
    assert design['B55']['type A, repeats'] not in ('', 'nan')
    figure = (output / 'figures/damping_pitch_1.svg').read_text()
    assert 'Ikeda' in figure and 'CFD' in figure and 'B55 [N m s]' in figure
