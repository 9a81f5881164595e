"""The stability watch: what it finds of changed periods, and that it does not cry wolf."""

import math

import numpy as np
import pytest
from imu_stream import EPOCH_NS, reading

from swath_sysid.attitude.identification.refit import AxisVerdict, RefitOutcome
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilitySettings, StabilityWatch
from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.attitude.prediction.sea_fit import SeaFit
from swath_sysid.pipeline.health import OK, WARN, stability_report
from swath_sysid.pipeline.play_through import PlayThrough, PlayThroughSettings

WINDOW, PERIOD = 600.0, 4.0


def watched(periods, std=0.04, amplitudes=None, settings=None):
    """A watch that was given periods by windows one after another, and what it said after each."""
    watch, said = StabilityWatch(settings), []
    amplitudes = np.full(len(periods), 0.05) if amplitudes is None else amplitudes
    for k, (period, amplitude) in enumerate(zip(periods, amplitudes, strict=True)):
        watch.add(PeriodEstimate(WINDOW * k, WINDOW * (k + 1), period, std, amplitude))
        said.append(watch.newest)
    return watch, said


def drawn(seed, changes_after, count, change=0.1, std=0.04):
    """Periods of windows, GM smaller by a tenth after some of them."""
    gm = np.where(np.arange(count) < changes_after, 1.0, 1.0 - change)
    return PERIOD / np.sqrt(gm) + np.random.default_rng(seed).normal(0.0, std, count)


def test_a_tenth_of_the_height_is_found_within_half_an_hour():
    """With standard deviations of 1 % of the period, as ten minutes of a sea give them."""
    found = []
    for seed in range(100):
        _, said = watched(drawn(seed, 12, 15))
        found.append(said[-1].changed_at is not None)
        assert all(each is None or each.changed_at is None for each in said[:12])
    assert np.mean(found) > 0.9


def test_nothing_is_cried_where_nothing_changes():
    alarms = 0
    for seed in range(100):
        _, said = watched(drawn(seed, 36, 36))
        alarms += any(each is not None and each.advice for each in said)
    _, said = watched([4.0, 4.0, 4.0, 4.0, 4.4, 4.0, 4.0, 4.0], std=0.02)
    alarms += any(each is not None and each.advice for each in said)
    assert alarms == 0


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


def test_a_higher_sea_explains_a_longer_period():
    """The same change warns where the amplitude stays, not where the craft rolls three times as far."""
    periods = [4.0] * 6 + [4.15] * 6
    _, calm = watched(periods, std=0.02)
    _, rough = watched(periods, std=0.02, amplitudes=[0.07] * 6 + [0.21] * 6)
    assert calm[-1].advice and not rough[-1].advice


def test_a_limit_warns_before_chance_is_ruled_out():
    periods = [4.0, 4.0, 4.0, 4.1, 4.1]
    _, plain = watched(periods)
    _, limited = watched([*periods, 4.1, 4.1], settings=StabilitySettings(limit=0.03))
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
    """What a refit tells of the period reaches the watch, whether or not it publishes a model."""

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
