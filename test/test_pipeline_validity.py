"""Whether a model holds for what the craft does: its verdict, and the amplitude of the motion."""

from dataclasses import replace
from math import nan, pi, radians, sin

import pytest
from imu_stream import EPOCH_NS, reading

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.intake import ConvertedReading
from swath_sysid.attitude.motion.stamps import BURSTS
from swath_sysid.attitude.prediction.axis_filter import AxisFilter, Reach
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import FACTORS, HullFilter, HullFilterSettings
from swath_sysid.attitude.prediction.hull_state import HULL_STATES, RATIOS
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.health import WARN

HULL = IdentifiedModel.exactly(hull_named('swath-pitch').model)
PERIOD = HULL.model.natural_period
FOUND = replace(HULL, amplitude_range=(radians(0.5), radians(6.0)))


def swung(model, degrees, periods=6.0, rate=50.0):
    """The codes of what is wrong after a motion of this amplitude about some trim."""
    followed = AxisFilter(HullFilterSettings(), 60.0)
    followed.set_model(model)
    for k in range(round(periods * PERIOD * rate)):
        angle = 0.03 + radians(degrees) * sin(2.0 * pi * k / rate / PERIOD)
        followed.reach.add(k / rate, angle)
    return [each.code for each in followed.advice()]


@pytest.mark.parametrize(('degrees', 'is_outside'), [(0.1, False), (6.3, False), (7.3, True), (20.0, True)])
def test_motion_beyond_the_amplitudes_of_the_record_is_told(degrees, is_outside):
    assert swung(FOUND, degrees) == is_outside * ['outside-valid-amplitude']


@pytest.mark.parametrize('is_free', [True, False])
@pytest.mark.parametrize(('name', 'share', 'is_told'), [('damping', 0.6, False), ('stiffness', 0.8, True),
                                                        ('stiffness', 0.93, None)])  # fmt: skip
def test_a_hull_given_as_exact_is_contradicted_by_much_and_its_damping_by_free_motion(is_free, name, share, is_told):
    hull = HullFilter()
    hull.set_hull(HULL)
    hull.start(0.05, 0.0, 1e-8, 1e-6)
    hull.is_free = is_free
    for track in (hull.driven, hull.free):
        track.x[RATIOS:HULL_STATES][FACTORS[name]] *= share
    told = [each.code for each in hull.advice()]
    assert told == ['model-contradicted'] * (is_told is not None and (is_told or is_free))


def test_limits_that_were_changed_live_survive_bursts():
    limits, others = QuiescenceLimits(roll=0.1, duration=1.0), QuiescenceLimits(roll=0.2, duration=1.0)
    pipeline = ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(quiescence=limits)))
    pipeline.forecaster.set_quiescence(others)
    pipeline.begin(ConvertedReading(None, (BURSTS,)))
    assert pipeline.forecaster.quiescence is others


def test_an_amplitude_is_that_of_the_last_two_periods():
    reach, seen = Reach(PERIOD), {}
    for k in range(1500):
        time = 0.02 * k
        reach.add(time, 0.1 * sin(2.0 * pi * time / PERIOD) if time < 10.0 else nan)
        seen[time] = reach.amplitude
    for time, amplitude in seen.items():
        if 2.0 * PERIOD < time < 10.0 + 0.8 * PERIOD:
            assert amplitude == pytest.approx(0.1, rel=0.02)
        elif time > 10.0 + 2.15 * PERIOD:
            assert amplitude == 0.0


def test_what_no_amplitude_is_known_of_is_not_judged():
    assert swung(HULL, 40.0) == []
    # at sea: an equivalent of one amplitude, which is none of the crests'
    assert swung(replace(HULL, amplitude_range=(radians(2.0), radians(2.0))), 5.0) == []


@pytest.mark.long
def test_the_predictor_tells_verdict_and_sentence():
    pipeline = ForecastPipeline()
    health = PredictorHealth('imu/data', pipeline)
    metrics = {'verdict': 'doubtful', 'verdict_sentence': 'too few cycles: release it from a larger angle'}
    each = {'pitch': metrics, 'roll': {'verdict': 'adequate'}}
    pipeline.set_models({axis: replace(FOUND, metrics=known) for axis, known in each.items()})
    for k in range(400):
        pipeline.add(reading(EPOCH_NS + k * 10_000_000, 0.0, radians(12.0) * sin(k / 30)))
    _, told, _ = health.reports(1.0, EPOCH_NS)
    assert told.level == WARN and 'the pitch model is doubtful: too few cycles: release it' in told.message
    assert 'pitch reaches 12.0 deg, but its model was identified at 6.0 deg and less' in told.message
    assert 'roll' not in told.message
    assert told.values['verdict_pitch'] == 'doubtful' and told.values['verdict_roll'] == 'adequate'
    assert told.values['verdict_sentence_pitch'] == metrics['verdict_sentence'] and told.values['published'] == 0
