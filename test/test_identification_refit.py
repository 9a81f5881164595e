"""Refits, the model that is published, the way back, and the watch on stability."""

import copy
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from imu_stream import EPOCH_NS, decay_stream, reading

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import COEFFICIENT_NAMES, IdentifiedModel, coefficients
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.live_decays import LiveDecay, newest
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.refit import (
    AxisVerdict,
    RefitOutcome,
    RefitSettings,
    Refitter,
    misfit,
    reason_to_keep,
    refit,
)
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilitySettings, StabilityWatch
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.window import COLUMNS, MotionWindow, NoticedDecay, WindowSettings
from swath_sysid.attitude.prediction.sea_fit import SeaFit
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml
from swath_sysid.pipeline.health import OK, WARN, stability_report
from swath_sysid.pipeline.play_through import PlayThrough, PlayThroughSettings

LINEAR = IdentificationSettings('linear', search=SearchSettings(generations=2))
QUICK = RefitSettings(axes=('pitch',), identification=LINEAR)


def table_of(seed=1, **motion):
    """A window of a craft released in pitch, in the minute of that number."""
    window = MotionWindow(WindowSettings(detect_decay=False))
    for one in decay_stream(20.0, 28.0, seed=seed, first_ns=EPOCH_NS + seed * 60 * 10**9, **motion):
        window.add(one)
    return window.table()


def after(*tables, settings=QUICK, **origin):
    """A refitter that has taken what was found on windows, one after the other, and the last outcome."""
    refitter = Refitter(settings)
    for table in tables:
        refitter.take(outcome := refit(refitter.request(table, **origin)))
    return refitter, outcome


@pytest.fixture(scope='module')
def table():
    return table_of()


@pytest.fixture(scope='module')
def first(table):
    """The outcome of the first refit."""
    return refit(Refitter(QUICK).request(table, source={'topic': 'here'}))


@pytest.fixture(scope='module')
def twice(table):
    """A refitter that has taken two releases, and the outcome of the second."""
    return after(table, table_of(2))


@pytest.mark.long
def test_the_first_refit_is_believed(first):
    refitter = Refitter(QUICK)
    assert refitter.take(first) and set(refitter.models) == {'pitch'} and refitter.version == 1
    model = refitter.models['pitch'].model
    assert model.natural_period == pytest.approx(2.6, rel=0.01)
    assert model.damping_ratio == pytest.approx(0.08, rel=0.1)
    assert first.message.startswith('pitch: adequate: ') and '; 1 release (' in first.message
    assert '\n' not in first.message
    (source,) = refitter.models['pitch'].provenance['sources']
    assert source['topic'] == 'here' and len(source['sha256']) == 64
    assert model_from_yaml(model_to_yaml(first.models)) == first.models


def test_a_refit_names_the_axis_of_a_sensor_whose_mounting_is_not_stated(table, first):
    about = ', about the y axis of the sensor, whose mounting is not stated'
    assert first.message.endswith(about)
    stated = replace(table, installation=Installation('flu', (0.0, 0.0, 0.0)))
    # models of a sensor that was mounted otherwise are of other axes
    other = replace(first.models['pitch'], provenance={'mounting_deg': [0, 0, 90]})
    roll = replace(IdentifiedModel.exactly(hull_named('swath-roll').model), provenance=other.provenance)
    refitter = Refitter(QUICK, {'roll': roll, 'pitch': other})
    request = refitter.request(stated)
    outcome = refit(request)
    assert outcome.message == first.message.removesuffix(about) and request.current == {}
    assert refitter.take(outcome) and refitter.models == outcome.models and refitter.rollback()
    assert set(refitter.models) == {'roll', 'pitch'}


def test_a_window_whose_rates_are_reversed_is_not_fitted(table):
    column = COLUMNS.index('pitch_rate')
    rows = table.rows.copy()
    rows[:, column] *= -1.0
    outcome = refit(Refitter(QUICK).request(replace(table, rows=rows)))
    assert not outcome.succeeded
    assert 'not fitted' in outcome.message and 'derivative of the pitch angle with the opposite sign' in outcome.message


@pytest.mark.long
def test_the_same_decay_in_another_window_counts_once(table, first):
    refitter = Refitter(QUICK)
    refitter.take(first)
    shifted = replace(table, rows=table.rows[40:])
    again = refit(refitter.request(shifted))
    assert not again.succeeded and not refitter.take(again) and refitter.version == 1
    assert 'the current model knows the next release as well' in again.message
    assert len(refitter.decays['pitch'].decays) == 1
    # decays that were forgotten stay so when a refit ends afterwards
    refitter.request(table)
    refitter.forget_decays()
    assert refitter.take(first) and refitter.models and not refitter.decays


@pytest.mark.long
def test_a_longer_view_takes_the_place_of_the_shorter_and_its_tail_is_no_release_of_its_own(table, first):
    since = table.rows[:, 0] - table.rows[0, 0]
    short, tail = (replace(table, rows=table.rows[chosen]) for chosen in (since < 14.0, since > 14.5))
    refitter, outcome = after(short, tail)
    assert refitter.version == 1 and 'as well' in outcome.message
    (held,) = refitter.decays['pitch'].decays
    assert held.end < tail.rows[0, 0]
    alone = Refitter(QUICK)
    alone.take(first)
    refitter.take(refit(refitter.request(table)))
    assert [each.end for each in refitter.decays['pitch'].decays] == [each.end for each in alone.decays['pitch'].decays]


@pytest.mark.long
def test_several_releases_are_one_fit_as_several_records_are(table, twice):
    refitter, outcome = twice
    assert outcome.succeeded and '; 2 releases, the next one known to ' in outcome.message
    assert '% before (linear, period 2.' in outcome.message
    problem = prepare([each.trial().axis('pitch') for each in (table, table_of(2))])
    ratios = identify_problem(problem, QUICK.identification).model.ratios
    np.testing.assert_allclose(refitter.models['pitch'].model.ratios, ratios, rtol=1e-6)


def test_five_decays_are_held_the_newest():
    segment = DecaySegment(1.0, 9.0, 2.0, 4.0, 0.1, 0.01, 0.0)
    motion = AxisMotion('roll', np.arange(0.0, 10.0, 0.1), np.zeros(100), None)
    decays = tuple(LiveDecay(motion, segment, 60.0 * minute, {}) for minute in (3, 0, 6, 1, 5, 2, 4))
    assert [each.origin for each in newest(decays)] == [120.0, 180.0, 240.0, 300.0, 360.0]


@pytest.mark.long
def test_releases_of_one_craft_do_not_contradict_each_other():
    refitter, outcome = after(table_of(1, amplitude=0.05), table_of(2, amplitude=0.12))
    assert len(refitter.decays['pitch'].decays) == 2 and refitter.version == 2, outcome.message


@pytest.mark.long
@pytest.mark.parametrize('change', [{'period': 2.65}, pytest.param({'damping': 0.1}, marks=pytest.mark.long)])
def test_a_changed_craft_starts_anew_and_rollback_leads_back(twice, change):
    refitter, _ = copy.deepcopy(twice)
    before, decays = refitter.models['pitch'], refitter.decays
    outcome = refit(refitter.request(table_of(3, **change)))
    assert 'the decays before contradict this one and are forgotten; adequate' in outcome.message
    assert refitter.take(outcome) and len(refitter.decays['pitch'].decays) == 1
    assert refitter.models['pitch'].model.natural_period == pytest.approx(change.get('period', 2.6), rel=0.01)
    assert refitter.steps_back == 3
    after_change = refitter.models['pitch']
    assert refitter.rollback() and refitter.models['pitch'] is before and refitter.decays is decays
    assert refitter.undo_rollback() and refitter.models['pitch'] is after_change and not refitter.undo_rollback()
    assert refitter.rollback() and refitter.models['pitch'] is before
    assert refitter.rollback() and refitter.rollback() and refitter.models == refitter.decays == {}
    assert not refitter.rollback() and refitter.version == 8


@pytest.mark.long
def test_by_itself_only_the_axis_whose_decay_was_noticed_is_fitted(table):
    told, settings = [], replace(QUICK, axes=('roll', 'pitch'))
    outcome = refit(Refitter(settings).request(table), progress=told.append)
    assert outcome.message.startswith('pitch: adequate') and outcome.message.endswith('; roll: no free decay')
    assert told == sorted(told) and told[0] >= 0.0 and told[-1] == 1.0
    # now the same rows in both axes
    rows = table.rows.copy()
    rows[:, [1, 3]] = rows[:, [2, 4]]
    both = replace(table, rows=rows)
    noticed = replace(both, noticed=NoticedDecay('roll', rows[0, 0], rows[-1, 0]))
    assert set(refit(Refitter(settings).request(noticed, is_asked=False)).models) == {'roll'}
    assert set(refit(Refitter(settings).request(both)).models) == {'roll', 'pitch'}
    assert not refit(Refitter(settings).request(both, is_asked=False)).models
    outcome = refit(Refitter(QUICK).request(noticed, is_asked=False))
    assert not outcome.verdicts and 'see the parameter axes' in outcome.message


def test_the_verdict_decides_what_replaces_what(first):
    (found,) = first.models.values()

    def kept(held, new, error=0.05, contradicts=False):
        held, new = (
            replace(found, metrics={**found.metrics, 'verdict': level, 'motion_error': each}) if level else None
            for level, each in ((held, error and 0.05), (new, error))
        )
        return reason_to_keep(held, new, contradicts)

    pairs = itertools.product(('doubtful', 'adequate'), ('rejected', 'doubtful', 'adequate'))
    replaces = [pair for pair in pairs if not kept(*pair, contradicts=True)]
    assert replaces == [('doubtful', 'doubtful'), ('doubtful', 'adequate'), ('adequate', 'adequate')]
    assert kept(None, 'rejected').startswith('rejected: ')
    assert kept(None, 'doubtful') == kept('doubtful', 'adequate', 0.06) == kept('adequate', 'adequate', 0.04) == ''
    assert 'as well' in kept('adequate', 'adequate', 0.06) and 'as well' in kept('adequate', 'adequate', None)
    endless = replace(found, model=DecayModel(found.model.equation, 0.0 * found.model.ratios))
    assert reason_to_keep(None, endless, False)


def test_the_misfit_is_that_of_the_best_initial_state(table, first):
    """The fitted model's is hardly above the least of its equation; a worse one's larger, a wild one's huge."""
    (found,) = first.models.values()
    problem = prepare([table.trial().axis('pitch')])
    model, least = found.model, found.metrics['objective_value']
    assert least * (1.0 - 1e-9) <= misfit(problem, model) < 1.003 * least
    slower = DecayModel(model.equation, model.ratios * np.where(model.ratios == model.ratios.max(), 0.9, 1.0))
    assert misfit(problem, slower) > 1.5 * least
    wild = DecayModel(model.equation, -100.0 * model.ratios)
    assert misfit(problem, wild) > 100.0


def test_coefficients_are_rows_of_values_and_deviations(first):
    other = IdentifiedModel.exactly(first.models['pitch'].model.with_trim(0.02))
    found = replace(first.models['pitch'], metrics={'verdict': 'doubtful'})
    rows, values = coefficients({'pitch': found, 'roll': other})
    assert rows == ('roll', 'roll_std', 'pitch', 'pitch_std') and values.shape == (4, len(COEFFICIENT_NAMES))
    roll, roll_std, pitch, pitch_std = (dict(zip(COEFFICIENT_NAMES, row, strict=True)) for row in values)
    assert roll['offset'] == 0.02 and roll['verdict'] == -1.0 and pitch['verdict'] == 1.0
    assert (pitch['smallest_amplitude'], pitch['largest_amplitude']) == found.amplitude_range
    assert math.isnan(roll_std['offset']) and not any(v for k, v in roll_std.items() if k != 'offset')
    np.testing.assert_array_equal(values[2, : len(TERM_NAMES)], found.model.ratios)
    for number, name in enumerate(found.model.equation.terms):
        assert pitch_std[name] == np.sqrt(found.covariance[number, number]) > 0.0
    for name in set(TERM_NAMES) - set(found.model.equation.terms):
        assert pitch[name] == pitch_std[name] == 0.0
    adequate = coefficients({'pitch': replace(found, metrics={'verdict': 'adequate'})})[1]
    assert adequate[0, COEFFICIENT_NAMES.index('verdict')] == 2.0


WINDOW, PERIOD = 600.0, 4.0


def watched(periods, std=0.04, amplitudes=None, settings=None):
    """A watch that was given periods by windows one after another, and what it said after each."""
    watch, said = StabilityWatch(settings), []
    amplitudes = np.full(len(periods), 0.05) if amplitudes is None else amplitudes
    for k, (period, amplitude) in enumerate(zip(periods, amplitudes, strict=True)):
        watch.add(PeriodEstimate(WINDOW * k, WINDOW * (k + 1), period, std, amplitude))
        said.append(watch.newest)
    return watch, said


def drawn(seed, changes_after, count):
    """Periods of windows, GM smaller by a tenth after some of them."""
    gm = np.where(np.arange(count) < changes_after, 1.0, 0.9)
    return PERIOD / np.sqrt(gm) + np.random.default_rng(seed).normal(0.0, 0.04, count)


@pytest.mark.long
def test_a_tenth_of_the_height_is_found_within_half_an_hour_and_nothing_is_cried_without_change():
    found = []
    for seed in range(100):
        _, said = watched(drawn(seed, 12, 15))
        found.append(said[-1].changed_at is not None)
        assert all(each is None or each.changed_at is None for each in said[:12])
    assert np.mean(found) > 0.9
    one_freak = watched([4.0, 4.0, 4.0, 4.0, 4.4, 4.0, 4.0, 4.0], std=0.02)
    for _, said in (one_freak, *(watched(drawn(seed, 36, 36)) for seed in range(100))):
        assert not any(each is not None and each.advice for each in said)


@pytest.mark.long
def test_the_interval_holds_the_truth():
    for changes_after, truth in ((40, 1.0), (12, 0.9)):
        held = []
        for seed in range(150):
            _, said = watched(drawn(seed, changes_after, 20))
            if truth == 1.0 or said[-1].changed_at is not None:
                held.append(said[-1].interval[0] <= truth <= said[-1].interval[1])
        assert 0.9 < np.mean(held) <= 0.99


@pytest.mark.parametrize('known_height', [0.0, 0.5])
def test_the_ratio_is_the_square_of_the_periods(known_height):
    _, said = watched([4.0, 4.0, 4.4, 4.4], std=0.01, settings=StabilitySettings(known_height=known_height))
    assert said[-1].relative == pytest.approx((4.0 / 4.4) ** 2)
    assert (said[-1].period_before, said[-1].period) == pytest.approx((4.0, 4.4))
    assert said[-1].changed_at == 3 * WINDOW
    assert said[-1].height == pytest.approx((known_height or math.nan) * (4.0 / 4.4) ** 2, nan_ok=True)


def test_a_higher_sea_explains_a_longer_period_and_a_limit_warns_before_chance_is_ruled_out():
    periods = [4.0] * 6 + [4.15] * 6
    _, calm = watched(periods, std=0.02)
    _, rough = watched(periods, std=0.02, amplitudes=[0.07] * 6 + [0.21] * 6)
    assert calm[-1].advice and not rough[-1].advice
    _, plain = watched([4.0, 4.0, 4.0, 4.1, 4.1])
    _, limited = watched([4.0, 4.0, 4.0, 4.1, 4.1, 4.1, 4.1], settings=StabilitySettings(limit=0.03))
    assert plain[-1].advice == ()
    assert limited[-1].changed_at is None and 'of its earlier value' in limited[-1].advice[0].message


def test_motion_is_used_once_and_a_clock_that_is_set_back_begins_anew():
    watch, _ = watched([4.0] * 3)
    watch.add(PeriodEstimate(2.5 * WINDOW, 3.5 * WINDOW, 4.4, 0.04, 0.05))
    assert watch.count == 3
    watch.add(PeriodEstimate(2.9 * WINDOW, 3.9 * WINDOW, 4.0, 0.04, 0.05))
    assert watch.count == 4
    watch.add(PeriodEstimate(0.0, WINDOW, 4.0, 0.04, 0.05))
    assert watch.count == 1 and watch.newest is None


def test_it_is_a_diagnostic():
    assert stability_report(StabilityWatch()).level == OK
    watch, _ = watched([4.0] * 5)
    report = stability_report(watch)
    assert report.level == OK and report.values['relative_gm'] == pytest.approx(1.0)
    watch, _ = watched([4.0, 4.0, 4.4, 4.4], std=0.01)
    report = stability_report(watch)
    assert report.level == WARN and 'went from 4 to 4.4 s' in report.message and report.values['gm_m'] == 'not known'


def test_play_through_identifies_at_its_interval():
    def fit(request):
        begin, end = request.windows[-1].rows[[0, -1], 0].tolist()
        found = PeriodEstimate(begin, end, PERIOD, 0.01, 0.05)
        return RefitOutcome((AxisVerdict('roll', None, 'not published', estimate=found),))

    settings = PlayThroughSettings(window=WindowSettings(window=5.0), identify_interval=5.0)
    played = PlayThrough(settings, fit=fit, fit_sea=lambda request: SeaFit(request.time, {}, {}))
    for k in range(230):
        played.add(reading(EPOCH_NS + 100_000_000 * k, 0.1 * math.sin(0.1 * k), roll_rate=0.1 * math.cos(0.1 * k)))
    assert played.refits == played.refitter.stability.count == 4
    assert played.refitter.stability.newest.relative == pytest.approx(1.0)
