"""What the nodes tell about themselves, without ROS."""

import pytest
from imu_stream import EPOCH_NS, reading

from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline
from swath_sysid.pipeline.health import (
    ERROR,
    OK,
    SILENT,
    WARN,
    Arrivals,
    Changes,
    IdentifierHealth,
    StreamHealth,
)

COUNTS = {'gap': 0, 'no-orientation': 0}


def report(health, now, age=0.0, counts=COUNTS, used=0, interval=0.01):
    return health.report(now, EPOCH_NS + round((now + age) * 1e9), counts, used, interval)


def receive(health, begin, end, rate=100.0, spent=1e-3, age=0.0):
    for k in range(round((end - begin) * rate)):
        now = begin + k / rate
        health.note_message(EPOCH_NS + round(now * 1e9), EPOCH_NS + round((now + age) * 1e9), now, now + spent)


def test_a_sensor_never_heard_is_waited_for_and_then_an_error():
    health = StreamHealth('imu/data')
    assert [report(health, now).level for now in (0.0, 1.0, 4.0, 6.0)] == [OK, OK, OK, ERROR]
    assert 'remap' in report(health, 7.0).message


def test_silence_is_an_error_counted_once_each_time():
    health = StreamHealth('imu/data')
    counted = []
    for second in range(12):
        if second % 6 < 2:
            receive(health, second, second + 1.0)
        told = report(health, second + 1.0)
        counted.append((told.level, health.counts[SILENT]))
        if second == 1:
            assert told.values['rate_hz'] == 100.0 and told.values['processing_ms_max'] == pytest.approx(1.0)
            assert told.values['stamp_age_s'] == pytest.approx(0.0, abs=1e-6)
    assert counted[1] == (OK, 0) and counted[4] == (ERROR, 1) and counted[7] == (OK, 1) and counted[10] == (ERROR, 2)
    slow = StreamHealth('imu/data')
    for second in range(0, 30, 2):
        receive(slow, second, second + 1, rate=1.0)
        for later in (1.0, 2.0):
            report(slow, second + later, interval=2.0)
    assert slow.counts[SILENT] == 0


@pytest.mark.parametrize('speed', [1, 5])
def test_a_paused_clock_is_no_silent_sensor_and_nothing_is_late_afterwards(speed):
    health = StreamHealth('imu/data')
    told, clock = [], EPOCH_NS
    for second in range(90):
        is_playing = not 20 <= second < 80
        for k in range(10):
            if is_playing and not (19, 5) <= (second, k) < (80, 0):
                clock += speed * 10**8
                health.note_message(clock, clock, second + k / 10, second + k / 10)
        told.append(health.report(second + 1.0, clock, COUNTS, 0, 0.1))
    assert {each.level for each in told} == {OK} and health.counts[SILENT] == 0
    assert 'the clock stands still: the replay is paused' in told[50].message
    assert told[85].message.startswith('receiving')
    # while the clock goes on without messages, the sensor is silent
    assert health.report(95.0, clock + 5 * 10**9, COUNTS, 0, 0.1).level == ERROR


def test_new_counts_warn_once_and_harmless_ones_never():
    health, told = StreamHealth('imu/data'), []
    for second in range(4):
        receive(health, second, second + 1.0)
        counts = {'no-orientation': 100 * second, 'no-rates': 100 * min(second + 1, 3)}
        told.append(report(health, second + 1.0, counts=counts))
    assert [each.level for each in told] == [WARN, OK, OK, OK]
    assert all('less certain' in each.message for each in told[:3]) and 'less certain' not in told[3].message
    assert told[1].message.startswith('receiving imu/data; no-rates: the sensor gives no rates')


def test_a_single_stall_warns_nobody_and_lasting_load_does():
    health = PredictorHealth('imu/data', ForecastPipeline())
    told = []
    for second, passed_over in enumerate([0, 23, 0, 0, 7, 9, 0]):
        receive(health, second, second + 1.0)
        for _ in range(passed_over):
            health.note('passed-over')
        told.append(report(health, second + 1.0).level)
    assert told == [OK, OK, OK, OK, OK, WARN, OK]


def test_a_second_predictor_is_warned_of_while_it_is_there():
    health = PredictorHealth('imu/data', ForecastPipeline())
    told = []
    for second, predictors in enumerate([1, 2, 2, 1]):
        receive(health, second, second + 1.0)
        health.note_predictors(predictors)
        told.append(report(health, second + 1.0))
    assert [each.level for each in told] == [OK, WARN, WARN, OK]
    assert 'ROS_DOMAIN_ID' in told[2].message and health.counts['several-predictors'] == 1


def test_a_log_is_told_once_of_a_warning_that_comes_and_goes():
    changes, told = Changes(), []
    for second in range(200):
        comes_and_goes = second < 100 and second % 5 < 2
        level = WARN if comes_and_goes else ERROR if 150 <= second < 153 else OK
        if changes.is_news(level, float(second)):
            told.append((second, level))
    # the first recovery at once, as of a sensor that was waited for; an error and its end always
    assert told == [(0, WARN), (2, OK), (5, WARN), (127, OK), (150, ERROR), (153, OK)]


def test_a_backlog_is_none_of_the_clocks():
    health = StreamHealth('/imu/data')
    receive(health, 0.0, 1.0)
    assert report(health, 1.0, age=0.01).level == OK
    receive(health, 1.0, 2.0, age=7.0)
    told = report(health, 2.0, age=7.0)
    assert told.level == WARN and 'wait in a queue' in told.message and 'synchronise' not in told.message
    # what stays so long was no queue, nor is what begins so
    for second in range(3, 64):
        receive(health, second - 1.0, float(second), age=7.0)
        told = report(health, float(second), age=7.0)
    assert told.level == WARN and 'synchronise' in told.message
    other = StreamHealth('imu/data')
    receive(other, 0.0, 1.0, age=86400.0)
    assert 'use_sim_time' in report(other, 1.0, age=86400.0).message


@pytest.mark.parametrize('age, side', [(3600.0, '3600.0 s behind'), (-3600.0, '3600.0 s ahead of')])
def test_stamps_are_behind_the_clock_or_ahead_of_it(age, side):
    health = StreamHealth('imu/data')
    receive(health, 0.0, 1.0, age=age)
    assert f'stamps are {side} the clock' in report(health, 1.0, age=age).message


def test_no_condition_hides_another_in_the_message_or_in_the_log():
    health, changes = StreamHealth('imu/data'), Changes()
    logged = []
    for second in range(60):
        receive(health, second, second + 1.0, age=7.0)
        health.note_publishers(2)
        counts = COUNTS | {'out-of-order': 100 * max(second - 40, 0), 'gap': 3 * max(second - 50, 0)}
        told = report(health, second + 1.0, age=7.0, counts=counts)
        if changes.is_news(told.level, second + 1.0, told.codes):
            logged.append(second)
    for what in ('more than one node publishes', 'out-of-order (100 times', 'gap (3 times', 'behind the clock'):
        assert what in told.message
    assert told.level == WARN and logged == [0, 41, 51]


def test_a_node_without_the_simulated_clock_reports_that_and_a_sensor_that_stops():
    health, told = StreamHealth('imu/data'), []
    for second in range(12):
        if second < 8:
            for k in range(10):
                health.note_message(EPOCH_NS + (10 * second + k) * 10**8, 0, second + 0.1 * k, second + 0.1 * k)
        told.append(health.report(second + 1.0, 0, COUNTS, 0, 0.1))
    assert told[1].level == OK and told[7].level == WARN and 'nothing publishes /clock' in told[7].message
    assert told[11].level == ERROR and 'no message on imu/data for' in told[11].message
    assert 'nothing publishes /clock' in told[11].message and 'the clock of this machine' not in told[11].message


def test_a_topic_that_does_not_connect_or_is_of_another_type_is_reported_as_such():
    health = StreamHealth('/imu/data')
    report(health, 0.0)
    health.note_mismatch('/imu/data')
    assert 'incompatible QoS' in report(health, 1.0).message
    told = [report(health, now) for now in (3.0, 5.0, 7.0)][-1]
    assert told.level == ERROR and 'incompatible QoS' in told.message and 'remap' not in told.message
    other = StreamHealth('/imu/data')
    report(other, 0.0)
    other.note_publishers(0, ['sensor_msgs/msg/MagneticField'])
    told = [report(other, now) for now in (3.0, 5.0)][-1]
    assert told.level == ERROR and 'is published as sensor_msgs/msg/MagneticField' in told.message


@pytest.mark.parametrize('age, level', [(0.8, OK), (1.2, WARN)])
def test_stamps_may_differ_from_the_clock_by_a_second(age, level):
    health = StreamHealth('imu/data')
    receive(health, 0.0, 1.0, age=age)
    assert report(health, 1.0, age=age).level == level


def test_a_silence_is_held_against_the_longest_gap_of_the_last_hundred_messages():
    arrivals, now = Arrivals(), 0
    for interval in (1.0, 1.0, *99 * (0.1,)):
        now += round(interval * 1e9)
        arrivals.note(now)
    assert arrivals.silence(now + 4 * 10**9) == 0.0
    arrivals.note(now + 10**8)
    now += 10**8
    assert arrivals.silence(now + 9 * 10**8) == 0.0 and arrivals.silence(now + 12 * 10**8) == pytest.approx(1.2)


def test_what_holds_warns_until_it_is_settled():
    health = IdentifierHealth()

    def report():
        return health.report('pitch odd-cubic', 1, False)

    health.note('model-not-saved', 'model_path')
    health.note('model-not-saved', 'manoeuvre_model_path', 'b.yaml is a folder')
    assert [report().level for _ in range(3)] == [WARN] * 3
    health.settle('model_path')
    assert 'model-not-saved: b.yaml is a folder' in report().message
    health.settle('manoeuvre_model_path')
    assert report().level == OK and health.counts['model-not-saved'] == 2


def test_a_frame_id_that_changes_is_counted_and_warned_of():
    health = StreamHealth('imu/data')
    report(health, 0.0)
    receive(health, 0.0, 1.0)
    for name in ('imu_link', 'imu_link', 'imu_raw', 'imu_link'):
        health.note_frame_id(name)
    told = report(health, 1.0)
    assert (
        told.values['frame-id-changed'] == 2
        and told.level == WARN
        and 'two sensors may share the topic' in told.message
    )


@pytest.mark.long
def test_a_wrong_installation_is_a_warning_within_20_s_and_stays_one():
    pipeline = ForecastPipeline()
    health, levels = PredictorHealth('imu/data', pipeline), []
    for second in range(40):
        for k in range(20):
            stamp = EPOCH_NS + second * 10**9 + k * 50_000_000
            pipeline.add(reading(stamp, 1e-3 * (k % 3), force=(0.0, 0.01 * (k % 3), -9.81)))
        *_, told = health.reports(float(second), EPOCH_NS)
        levels.append(told.level)
    assert told.name == 'installation' and 'set frame to frd' in told.message
    first = levels.index(WARN)
    assert first <= 20 and set(levels[first:]) == {WARN} and set(levels[:first]) == {OK}


def test_the_share_of_messages_that_are_lost_for_one_cause_is_reported():
    health, counts = StreamHealth('imu/data'), {'duplicate-stamp': 0, 'gap': 0}
    for second, (lost, said) in enumerate([(0, 'receiving'), (4, '(4 times lately): '), (6, '(6 times lately, 6% of')]):
        receive(health, second, second + 1.0)
        counts['duplicate-stamp'] += lost
        assert said in report(health, second + 1.0, counts=dict(counts)).message
