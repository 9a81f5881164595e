"""The guided bring-up, step by step, and every fault named with its cure; the nodes' part is done by their cores."""

from dataclasses import replace

import numpy as np
import pytest
from tank_side import TankSide

from swath_sysid.page.bring_up import CONNECT, DECAY, IDENTIFY, JUDGE, PUSH, REST, SENSOR, BringUp, Facts, judgement
from swath_sysid.page.model_words import gain, reference
from swath_sysid.page.state import refusals
from swath_sysid.pipeline.health import Report

REST_S = 20.0


@pytest.fixture(scope='module')
def identified():
    tank = TankSide()
    tank.send(REST_S)
    tank.release(5.0)
    return tank


@pytest.mark.long
def test_the_steps_come_in_their_order_and_the_bands_hold_the_truth(identified):
    steps = list(dict.fromkeys(guidance.step for guidance in identified.guidances))
    assert steps == [SENSOR, REST, PUSH, DECAY, JUDGE] or steps == [SENSOR, REST, PUSH, DECAY, IDENTIFY, JUDGE]
    assert identified.faults == {}
    # the motion is that of a linear hull: of 2.6 s undamped period and damping ratio 0.08
    _, bands = reference(identified.record.models['pitch'])
    frequency, damping = 2.0 * np.pi / 2.6, 0.08
    assert abs(bands.curves.frequency[0] - frequency) < 4.0 * bands.frequency_std[0] < 0.1
    assert abs(bands.curves.damping_ratio[0] - damping) < 4.0 * bands.damping_ratio_std[0] < 0.02


def with_metrics(model, releases=1, **metrics):
    spans = {'segments_s': [[0.0, 20.0]] * releases}
    return replace(model, metrics={**model.metrics, **metrics}, provenance={**model.provenance, **spans})


@pytest.mark.parametrize(
    ('metrics', 'action', 'fault', 'cure'),
    [
        (
            {'verdict': 'adequate', 'motion_error': 0.04},
            'accept',
            '',
            'Next decay forecast to within 4 % of its motion. The forecasts use it already. Keep it',
        ),
        ({'verdict': 'doubtful', 'verdict_sentence': 'from 8 deg'}, 'push', 'doubtful', 'from 8 deg'),
        ({'verdict': 'rejected', 'verdict_sentence': None}, 'push', 'rejected', 'release again'),
        ({'verdict': None, 'verdict_sentence': None}, 'push', 'not judged', 'release again'),
    ],
)
def test_only_what_its_file_calls_adequate_is_recommended(identified, metrics, action, fault, cure):
    model = with_metrics(identified.record.models['pitch'], **metrics)
    guidance = judgement([model], '')
    assert (guidance.action, guidance.fault) == (action, fault) and cure in guidance.cure
    assert ('accept' in refusals(Facts(identified.record.statuses(identified.clock), models=(model,)))) == (
        metrics['verdict'] == 'rejected'
    )


def test_a_further_release_is_said_to_have_added_what_it_did(identified):
    model = identified.record.models['pitch']
    first, second = with_metrics(model, 1, motion_error=0.08), with_metrics(model, 2, motion_error=0.03)
    assert gain([first, second]) == 'next decay forecast to within 3 % of its motion (8 % before)'
    # the way back is no release
    assert 'before' not in gain([second, first])
    assert gain([with_metrics(model, motion_error=float('nan'))]) == ''


def in_g(each):
    return each._replace(force=tuple(value / 9.80665 for value in each.force))


def turned_over(each):
    """About its x axis, with everything it measures."""
    x, y, z, w = each.orientation
    p, q, r = each.rates
    return each._replace(orientation=(w, z, -y, -x), rates=(p, -q, -r), force=(0.0, 0.0, -9.81))


def repeating(first):
    kept = []

    def wrong(each):
        kept.append(each)
        return each if len(kept) < first else kept[first - 1]._replace(stamp_ns=each.stamp_ns)

    return wrong


def without_orientation(each):
    return each._replace(orientation_covariance=(-1.0, *8 * (0.0,)))


def waves(t):
    angle = np.radians(2.0) * (np.sin(2.1 * t) + 0.7 * np.sin(2.6 * t + 1.0))
    rate = np.radians(2.0) * (2.1 * np.cos(2.1 * t) + 1.82 * np.cos(2.6 * t + 1.0))
    return {'pitch': angle, 'pitch_rate': rate}


def wrongly(wrong):
    """The whole bring-up with a sensor that is wrong in this way."""
    return lambda tank: (tank.send(REST_S, wrong=wrong), tank.release(5.0, wrong=wrong))


def rest_then(play):
    return lambda tank: (tank.send(REST_S), play(tank))


def release(**how):
    return rest_then(lambda tank: tank.release(5.0, **how))


FAULTS = {
    # what is wrong: (how the tank is made, what happens, code, step, what the cure must name)
    'upside down': ({}, wrongly(turned_over), 'sensor-turned', SENSOR, 'set mounting_deg to [180, 0, 0]'),
    'g for m/s^2': ({}, wrongly(in_g), 'accelerations-in-g', SENSOR, 'they are in g'),
    'frozen': ({}, wrongly(repeating(300)), 'sensor-frozen', SENSOR, 'restart its driver'),
    'never heard': ({}, lambda tank: tank.silence(8.0), 'no-sensor', SENSOR, 'check that the sensor publishes there'),
    'silence': ({'rate': 50.0}, rest_then(lambda tank: tank.silence(4.0)), 'silence', SENSOR, 'driver and cable'),
    'slow': ({'rate': 5.0}, lambda tank: tank.send(10.0), 'low-rate', SENSOR, 'publish at 20 Hz or more'),
    'no orientation': ({}, wrongly(without_orientation), 'no-orientation', SENSOR, 'press Identify'),
    'waves': (
        {},
        lambda tank: tank.send(40.0, waves),
        'waves',
        REST,
        'usual options and --ros-args -p window_s:=600.0',
    ),
    'waves after rest': ({}, rest_then(lambda tank: tank.send(70.0, waves)), 'waves', DECAY, 'wait for calm water'),
    'held': ({}, release(hold=30.0), 'held', PUSH, 'let go at once'),
    'lowered by hand': ({}, release(damping=0.95), 'no-decay', PUSH, 'instead of lowering it'),
    'other axis': ({}, release(axis='roll'), 'other-axis', PUSH, 'or choose roll above'),
    'not noticed': ({'auto_identify': False}, release(duration=45.0), 'not-noticed', IDENTIFY, 'press Identify'),
}


@pytest.mark.long
@pytest.mark.parametrize('fault', FAULTS)
def test_every_fault_is_named_with_its_cure(fault):
    made, play, code, step, cure = FAULTS[fault]
    tank = TankSide(**made)
    play(tank)
    assert code in tank.faults, [guidance.sentence for guidance in tank.guidances[-3:]]
    guidance = tank.faults[code][0]
    assert guidance.step == step and cure in guidance.cure
    # nothing else is blamed before
    assert list(tank.faults)[0] == code
    # two lines of a phone
    assert max(len(guidance.sentence) for guidance in tank.guidances) <= 76


@pytest.mark.long
def test_a_simulated_craft_is_released_by_the_page_and_after_a_fault_the_next_push_is_judged_by_itself():
    tank = TankSide()
    tank.record.can_push = True
    tank.send(REST_S)
    assert tank.guidances[-1].action == 'push' and 'press Push and release' in tank.guidances[-1].sentence
    tank.release(5.0, axis='roll')
    assert (tank.guidances[-1].fault, tank.guidances[-1].action) == ('other-axis', 'push')
    tank.release(5.0)
    assert tank.guidances[-1].step == JUDGE and tank.guidances[-1].fault != 'other-axis'


@pytest.mark.long
def test_a_heavily_damped_craft_is_found_once_it_has_rested_as_long_as_it_was_held():
    tank = TankSide()
    tank.send(REST_S)
    tank.release(5.0, damping=0.95)
    assert [*tank.faults] == ['no-decay'] and tank.guidances[-1].step == JUDGE
    assert 'damping ratio 0.9' in tank.guidances[-1].sentence


@pytest.mark.long
def test_a_push_below_what_the_buffer_reports_is_asked_for_again():
    tank = TankSide()
    tank.send(REST_S)
    tank.release(0.8)
    assert any('0.8 of 5 degrees: further' in guidance.sentence for guidance in tank.guidances)
    assert tank.guidances[-1].step == PUSH and not tank.faults


def test_missing_nodes_are_named():
    guidance = BringUp('roll').look(Facts({'predictor: imu': Report('predictor: imu', 0, '')}))
    assert guidance.step == CONNECT and guidance.fault == 'nodes-missing'
    assert guidance.sentence == 'Waiting for imu_buffer, identifier.' and 'swath-sysid run' in guidance.cure


@pytest.mark.long
@pytest.mark.parametrize(
    ('known', 'verdict', 'fault', 'cure'),
    [
        (False, 'not fitted, the fit runs away', 'not-identified', 'the fit runs away; release again'),
        (True, 'not published, the current model explains it', '', 'model stays: not published, the current model'),
    ],
)
def test_a_window_that_gives_no_model_is_reported_with_the_verdict(identified, known, verdict, fault, cure):
    tank = TankSide(auto_identify=False)
    if known:
        tank.record.set_models(identified.record.models)
    tank.send(REST_S)
    assert tank.guidances[-1].step == PUSH and tank.guidances[-1].cure.startswith('A model is known: 2.6') is known
    tank.release(5.0)
    tank._identifier.begin()
    tank._identifier.end(False, f'pitch: {verdict}')
    tank.send(1.0)
    assert cure in (tank.faults[fault][0] if fault else tank.guidances[-1]).cure
    assert tank.guidances[-1].step == JUDGE or not known


def test_after_a_restart_at_sea_the_known_model_is_named_and_no_fault(identified):
    tank = TankSide(auto_identify=False)
    tank.record.set_models(identified.record.models)
    tank.send(40.0, waves)
    guidance = tank.guidances[-1]
    assert guidance.step == REST and 'does not come to rest' in guidance.sentence and not tank.faults
    assert 'known model: 2.6' in guidance.cure


def test_a_rollback_and_one_that_is_undone_list_each_model_once(identified):
    record, (model,) = TankSide().record, identified.record.models.values()
    later = replace(model, metrics={**model.metrics, 'r2': 0.5})
    for published in (model, later, model, later):
        record.set_models({'pitch': published})
        assert record.models_before['pitch'][-1] == published
    assert len(record.models_before['pitch']) == 2


def test_a_clock_that_is_set_back_begins_anew():
    tank = TankSide()
    tank.send(REST_S)
    assert tank.guidances[-1].step == PUSH
    tank.clock -= 15.0
    tank._next_report = 0.0
    tank.send(1.0)
    assert tank.guidances[-1].step in (REST, SENSOR)


def test_a_release_of_which_samples_were_lost_is_not_blamed_on_the_hull():
    tank = TankSide(auto_identify=False)
    tank.send(REST_S)
    tank.release(5.0, duration=4.0)
    tank.silence(6.0)
    tank.send(8.0)
    assert tank.guidances[-1].fault == 'samples-lost' and 'press Identify' in tank.guidances[-1].cure
