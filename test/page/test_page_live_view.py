"""What the page shows, as plain data."""

from contextlib import nullcontext
from dataclasses import replace
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest
from imu_stream import EPOCH_NS, reading
from scipy.stats import norm
from tank_side import TankSide

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.attitude.prediction.sea_state import SeaReport, SeaState
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import read_csv
from swath_sysid.formats.sea_state_yaml import sea_as_yaml, sea_from_yaml
from swath_sysid.page import live_view as view
from swath_sysid.page.charts import curve_options, motion_changes, motion_options, motion_series, release_options
from swath_sysid.page.live_record import LiveRecord, horizon_of
from swath_sysid.page.release import Release
from swath_sysid.page.state import PageState
from swath_sysid.pipeline.health import STALE, Report

LEADS = np.arange(51) * 100_000_000


@pytest.fixture
def tank():
    rested = TankSide(auto_identify=False)
    rested.send(3.0)
    return rested


def forecast(stamp_ns, angle=0.1, std=0.02):
    positions = [value for _ in LEADS for value in (angle, std)]
    return horizon_of(stamp_ns, LEADS.tolist(), ['pitch', 'pitch_std'], positions)


def test_health_names_the_silent_and_the_noise_is_that_of_the_sensor_whether_or_not_the_craft_moves(tank):
    told = {name: told for name, *told in view.health(tank.record.statuses(tank.clock), tank.record.motions())}
    assert told['Sensor'][0] == 0 and told['Sensor'][1].endswith('Hz, receiving /imu/data')
    assert not any('; last: ' in words for _, words in told.values())
    assert view.health({}, {})[0] == ('Sensor', 1, 'no diagnostics from predictor')
    new = TankSide(auto_identify=False)
    new.silence(1.0)
    levels = {name: level for name, level, _ in view.health(new.record.statuses(new.clock), {})}
    unseen = ('Sensor', 'Frame, units, gravity', 'Motion window', 'Noise of the angles')
    assert {levels[name] for name in unseen} == {STALE} and levels['Identification'] == 0
    time = np.arange(0.0, 10.0, 0.04)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, time.size)
    for amplitude in (0.0, 0.05):
        motion = AxisMotion('roll', time, amplitude * np.sin(2.4 * time) + noise, None)
        _, _, said = view.health({}, {'roll': motion})[2]
        assert np.radians(float(said.removeprefix('roll ').removesuffix(' deg'))) == pytest.approx(1e-3, rel=0.25)


def test_the_forecast_stands_behind_now_with_its_intervals_and_is_kept_until_it_is_due(tank):
    for second in range(4):
        tank.record.add_horizon(forecast(tank.stamp_ns + second * 10**8, 0.01 * second))
    chart = view.motion_chart(tank.record, 'pitch', tank.record.motions()['pitch'])
    # what was forecast two seconds before
    assert [value for _, value in chart['checked']] == pytest.approx(np.degrees([0.0, 0.01, 0.02, 0.03]), abs=1e-3)
    assert chart['checked'][0][0] == pytest.approx(2.0, abs=0.05)
    tank.record.add_horizon(forecast(tank.stamp_ns))
    chart = view.motion_chart(tank.record, 'pitch', tank.record.motions()['pitch'])
    times = [time for time, _ in chart['measured']]
    assert times == sorted(times) and -0.05 < times[-1] <= 0.0
    assert [chart['forecast'][0][0], chart['forecast'][-1][0]] == pytest.approx([0.0, 5.0], abs=0.05)
    old = view.motion_chart(tank.record, 'pitch', tank.record.motions()['pitch'], age=20.0)
    assert [old['forecast'][0][0], old['measured'][-1][0]] == pytest.approx([-20.0, times[-1] - 20.0], abs=0.05)
    assert not view.motion_chart(tank.record, 'pitch', tank.record.motions()['pitch'], age=40.0)['forecast']
    for band, width in zip(chart['bands'], norm.ppf((0.75, 0.95, 0.995)), strict=True):
        _, low, high = band[0]
        assert [low, high] == pytest.approx(np.degrees([0.1 - width * 0.02, 0.1 + width * 0.02]), abs=1e-3)
    assert len(motion_series(chart)) == len(motion_options('deg')['series'])


def test_models_are_listed_by_date_and_verdict_and_a_rollback_brings_one_back_to_the_top():
    record, hull = LiveRecord(), hull_named('swath-roll').model
    record.install(Installation())
    verdicts = {'adequate': {'verdict': 'adequate'}, 'doubtful': {'verdict': 'doubtful', 'verdict_sentence': 'again'}}
    models = {name: IdentifiedModel(hull, np.zeros((5, 5)), 0.0, metrics=metrics) for name, metrics in verdicts.items()}
    dates = []
    for day, model in enumerate(models.values()):
        stamp_ns = EPOCH_NS + day * 86_400_000_000_000
        record.add_reading(reading(stamp_ns))
        record.set_models({'roll': model})
        dates.append(f'{datetime.fromtimestamp(stamp_ns / 1e9):%Y-%m-%d %H:%M}')
    shown = view.model_words(record, 'roll', None)
    assert shown[0].startswith(f'{dates[1]}, doubtful, ') and shown[1] == 'again'
    assert shown[2].startswith(f'{dates[0]}, adequate, ')
    record.set_models({'roll': models['adequate']})
    shown = view.model_words(record, 'roll', None)
    assert [line.split(',')[0] for line in shown] == dates
    assert 'b2' in view.equation_words(record, 'roll') and not any('b2' in line for line in shown)


def test_memory_does_not_grow_and_of_a_fast_sensor_25_samples_a_second_are_kept():
    record, step = LiveRecord(), 5_000_000
    record.install(Installation())
    for k in range(1200):
        record.add_horizon(forecast(k * 10**8))
        for name in (f'node {k}: imu', 'predictor: imu'):
            record.add_status(Report(name, 0, ''), 0.0)
    assert len(record.checked['pitch']) == 750
    assert (len(record.statuses(0.0)), len(record.statuses(4.0)), len(record.statuses(6.0))) == (1, 1, 0)
    hull = hull_named('swath-roll').model
    for k in range(9):
        record.set_models({'roll': IdentifiedModel(hull.with_trim(0.01 * k), np.zeros((5, 5)), 0.0)})
    assert len(record.models_before['roll']) == 5
    for k in range(400):
        if record.is_due(EPOCH_NS + k * step, 0.005 * k):
            record.add_reading(reading(EPOCH_NS + k * step))
    time = record.motions()['roll'].time
    assert np.diff(time) == pytest.approx(0.04, abs=1e-6) and time.size == 50


def test_a_chart_shows_half_a_minute_in_few_points_and_does_not_magnify_noise():
    record, time = LiveRecord(), np.arange(-60.0, 0.0, 0.04)
    chart = view.motion_chart(record, 'roll', AxisMotion('roll', time, 1e-4 * np.sin(time), None))
    times = [time for time, _ in chart['measured']]
    assert min(times) == pytest.approx(-30.0, abs=0.5) and 350 <= len(times) <= 400
    assert motion_changes(chart, 'deg')['yAxis']['max'] == 1.0


def test_a_softening_decay_is_drawn_as_softening_with_the_model_over_it():
    hull = DecayModel.of(b1=0.1, b2=0.1, r1=5.8, r3=-120.0)
    time, trim = np.arange(0.0, 25.0, 0.04), 0.02
    angle, rate = simulate(hull, 0.12, 0.0, time)
    release = Release(AxisMotion('roll', EPOCH_NS * 1e-9 + time, angle + trim, rate), 2.8, 9.0, 0.12, trim)
    model = IdentifiedModel(hull, np.zeros((4, 4)), amplitude_range=(0.01, 0.12))
    shown, words = view.release_chart(release, model)
    assert np.abs(np.subtract(shown['fitted'], shown['measured'])[:, 1]).max() < 0.01 and 'off by' in words
    chart = view.model_chart(model, release)
    for name, tolerance in (('period', 0.01), ('damping', 0.15)):
        degrees, curve, low, high = np.array(chart[name]).T
        dots, measured = np.array(chart[f'measured_{name}']).T
        assert measured == pytest.approx(np.interp(dots, degrees, curve), rel=tolerance)
        # of an exact model
        assert np.array_equal(low, curve) and np.array_equal(curve, high)
    periods = np.array(chart['period'])[:, 1]
    assert (np.diff(periods) > 0.0).all() and periods[-1] > 1.1 * periods[0]
    runs_away = DecayModel.from_terms(hull.equation, {'b1': 0.0, 'b2': 0.0, 'r1': -50.0, 'r3': -900.0})
    shown, words = view.release_chart(release, IdentifiedModel(runs_away, np.zeros((4, 4))))
    assert 'runs away' in words and shown['measured']


@pytest.mark.long
def test_each_release_is_listed_with_what_it_added_and_the_last_minute_can_be_taken_along(tank, tmp_path):
    hull = IdentifiedModel.exactly(hull_named('swath-pitch').model)
    for error, releases in ((0.2, 1), (0.05, 2), (None, 0)):
        tank.release(5.0)
        if error is not None:
            provenance = {'segments_s': releases * [[0, 9]]}
            tank.record.set_models({'pitch': replace(hull, metrics={'motion_error': error}, provenance=provenance)})
    last, second, first = view.releases_in_words(tank.record.tried['pitch'])
    assert first.startswith('From 5.') and 'deg: next decay forecast to within 20 %' in first
    assert 'within 5 % of its motion (20 % before)' in second and last.endswith('no new model')
    source = SimpleNamespace(lock=nullcontext(), record=tank.record, description='', sensor='')
    (tmp_path / 'motion.csv').write_text(PageState(source, tmp_path).download('motion.csv'))
    trial = read_csv(tmp_path / 'motion.csv')
    assert np.ptp(trial.channels['pitch']) > np.radians(5.0) and 20.0 < trial.time[-1] < 61.0


def test_calm_is_counted_from_now_and_valid_leads_are_those_of_the_diagnostics(tank):
    assert view.calm_words(tank.record) == 'No calm window forecast yet.'
    tank.record.quiescence, tank.record.calm = 0.25, (tank.record.stamp + 1.0, tank.record.stamp + 4.0, 0.93)
    assert view.calm_words(tank.record).endswith('probability of 25 %. Calm from 1.0 to 4.0 s from now (93 %).')
    tank.record.quiescence = 0.999
    assert 'probability of 99 %' in view.calm_words(tank.record)
    assert view.calm_words(tank.record, age=14.2) == 'No forecast: the newest sample is 14 s old.'
    tank.record.limits = QuiescenceLimits(roll=np.radians(3.0), duration=5.0)
    assert view.calm_words(tank.record).endswith(' Quiet means within ±(roll 3 deg) for 5 s.')
    values = {'published': 3, 'valid_lead_roll_s': '2.74', 'valid_lead_bow.heave_s': 1.0}
    words = view.valid_words({'predictor: forecast': Report('forecast', 0, '', values)})
    assert words == 'Valid lead: roll 2.7 s, bow.heave 1.0 s.'
    assert view.valid_words({}) == view.valid_words({'predictor: forecast': Report('forecast', 0, '', {})}) == ''


def test_the_sea_is_said_in_words_or_why_it_is_not_known(tank):
    assert view.sea_words(tank.record) == 'No sea state yet.'
    tank.record.sea = sea_from_yaml(sea_as_yaml(SeaReport(None, 'two minutes are too few'), 5))
    assert view.sea_words(tank.record) == 'No sea state: two minutes are too few.'
    nothing = np.empty(0)
    state = SeaState(1200.0, 2.51, 0.09, 10.2, 0.1, 19.5, (12.1, 20.9), float('nan'), 0.1, 0.15, nothing, nothing)
    tank.record.sea = sea_from_yaml(sea_as_yaml(SeaReport(state), 5))
    words = view.sea_words(tank.record)
    assert 'Sea: 20 min' in words and '2.51 ± 0.09 m' in words and '19.5 s, 95 % between 12.1 and 20.9 s' in words
    assert 'not known: heave and slope' in words


@pytest.mark.parametrize('text', ['', 'is_known: true', 'nothing', '[1, 2]', 'is_known: true\nduration_s: [a]'])
def test_another_text_is_not_a_sea_state(text):
    with pytest.raises(InputError, match='sea/state'):
        sea_from_yaml(text)


def test_the_last_verdict_is_shown_once(monkeypatch, tmp_path):
    tank = TankSide(auto_identify=False)
    source = SimpleNamespace(lock=nullcontext(), record=tank.record, description='', sensor='')
    monkeypatch.setattr('swath_sysid.page.state.monotonic', lambda: tank.clock)
    state = PageState(source, tmp_path, 'pitch')
    tank.send(8.0)
    state.refresh()
    assert any(line.startswith('Last identification') for line in state.view.model_words)
    tank._identifier.begin()
    tank._identifier.end(False, 'pitch: not fitted, too few waves')
    tank.send(1.0)
    state.refresh()
    assert 'too few waves' in state.view.guidance.cure
    lines = [*state.view.model_words, *(each[2] for each in state.view.health)]
    assert not any('too few waves' in line for line in lines)


@pytest.mark.parametrize('options', [motion_options('deg'), release_options(), curve_options('damping')])
def test_no_legend_touches_the_name_of_its_axis_on_a_narrow_screen(options):
    """ECharts writes in 12 px, the legend 5 px below its top and the name 15 px above the grid."""
    assert options['legend']['top'] + 5 + 12 < options['grid']['top'] - 15 - 12


def test_it_shows_the_trials_that_wings_offer(tmp_path, monkeypatch):
    offers = {'trials_shown': [lambda manifest: ([{'file': manifest}], ['b is missing'])]}
    monkeypatch.setattr('swath_sysid.page.state.offered', offers.get)
    source = SimpleNamespace(lock=nullcontext(), record=LiveRecord(), description='', sensor='')
    page = PageState(source, tmp_path, manifest='a.yaml')
    page.refresh()
    assert (page.view.trials, page.view.missing) == ([{'file': 'a.yaml'}], ['b is missing'])
