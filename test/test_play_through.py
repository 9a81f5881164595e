"""Play-through: deterministic, equal to the cores by themselves, and readable by anyone."""

import json
from collections import Counter
from math import radians

import numpy as np
import pytest
import yaml
from bag_messages import STORE, decoded, messages_of, stamp_of
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.refit import AxisVerdict, RefitOutcome
from swath_sysid.attitude.motion.attitude import body_rates, euler_angles, quaternion
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.window import MotionWindow
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings, ForecastStep
from swath_sysid.attitude.prediction.outlook import Outlook
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.cli.main import main
from swath_sysid.formats.bags import opened_bag, read_bag, read_imu, write_imu_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.messages import COLUMNS, WINDOW_COLUMNS, diagnostics_message, imu_reading, stamp_ns
from swath_sysid.formats.model_file import model_from_yaml, read_model, write_model
from swath_sysid.formats.reading import read_readings
from swath_sysid.formats.topics import type_of
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.health import ERROR
from swath_sysid.pipeline.play_through import PlayedHealth, PlayThrough, PlayThroughSettings
from swath_sysid.pipeline.record_run import followed

HULL = IdentifiedModel.exactly(hull_named('swath-roll').model)


@pytest.fixture(scope='module')
def trial():
    """A release: held for 2 s, then 14 s of decay at 50 Hz."""
    return simulated_trial(HULL.model, radians(5.0), 14.0, 50.0, SensorNoise(0.0005, 0.003), seed=3, hold=2.0)


@pytest.fixture(scope='module')
def bag(trial, tmp_path_factory):
    path = tmp_path_factory.mktemp('bag') / 'release.mcap'
    write_imu_bag(path, trial, start_stamp_ns=1_700_000_000_123_456_789)
    return path


@pytest.fixture(scope='module')
def played(bag, tmp_path_factory):
    """What the command line makes of it, with a path for models that has none yet."""
    folder = tmp_path_factory.mktemp('played')
    return play(bag, folder, '--refit-delay', '0.5', model_path=str(folder / 'hull.yaml'))


def play(record, folder, *options, **parameters):
    """The bag that the command line plays a record to, with these parameters of all nodes."""
    path, params = folder / 'out.mcap', folder / 'params.yaml'
    if parameters:
        params.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}))
        options = *options, '--params-file', str(params)
    assert main(['play-through', str(record), '--output', str(path), *options]) == 0
    return path


def stub_fit(calls):
    """A fit that finds the true hull at once and notes what it was given."""

    def fit(request):
        calls.append(request)
        return RefitOutcome((AxisVerdict('roll', HULL, 'stub'),))

    return fit


@pytest.mark.long
def test_two_runs_give_the_same_messages_bit_for_bit_as_a_type_system_writes_them(bag, played, tmp_path, capsys):
    again = play(bag, tmp_path, '--refit-delay', '0.5', '--json')
    told = json.loads(capsys.readouterr().out)
    assert told['published']['forecast/next'] > 100 and told['refits'][0]['verdict']
    first, second = messages_of(played), messages_of(again)
    assert len(first) > 800 and first == second
    for _, kind, _, raw in first:
        assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(raw, kind), kind)) == raw
    kinds = (
        'DiagnosticArray Imu JointState JointTrajectory PointCloud2 String Float32 Float32MultiArray Float64MultiArray'
    )
    assert {kind.rpartition('/')[2] for _, kind, _, _ in first} == set(kinds.split())


@pytest.mark.long
def test_forecasts_are_those_of_the_predictor_core(bag, played):
    pipeline, sent, expected = ForecastPipeline(), ForecastMessages('base_link'), {}
    model_time = decoded(played, '/model/description')[0][0]
    for step in followed(pipeline, read_readings(bag)):
        for _, raw in sent.next_of(step) if step.sample.stamp_ns < model_time else ():
            expected[step.sample.stamp_ns] = raw
    published = [(time, raw) for topic, _, time, raw in messages_of(played) if topic == '/forecast/next']
    assert len(expected) > 300 and {time: raw for time, raw in published if time < model_time} == expected


@pytest.mark.long
@pytest.mark.parametrize('hulls', [(), ('roll',), ('roll', 'pitch')])
def test_each_filter_uses_a_sample_by_one_update_of_filterpys(hulls, tmp_path, monkeypatch):
    """A filter without a hull, and with one a second on which no moment acts; the first sample starts them."""
    updated, update = Counter(), ExtendedKalmanFilter.update

    def counted(self, *arguments, **options):
        updated[id(self)] += 1
        return update(self, *arguments, **options)

    trial = simulated_trial(HULL.model, radians(5.0), 5.0, 50.0, SensorNoise(0.0005, 0.003), seed=3, hold=1.0)
    write_imu_bag(tmp_path / 'short.mcap', trial)
    options = []
    if hulls:
        write_model(tmp_path / 'hull.yaml', dict.fromkeys(hulls, HULL))
        options = ['--model', str(tmp_path / 'hull.yaml')]
    monkeypatch.setattr(ExtendedKalmanFilter, 'update', counted)
    play(tmp_path / 'short.mcap', tmp_path, *options)
    assert list(updated.values()) == [trial.time.size - 1] * (2 + len(hulls))


@pytest.mark.long
def test_the_decay_is_noticed_and_the_model_comes_after_the_delay(bag, played):
    ((window_time, window),) = decoded(played, '/motion/window')
    ((model_time, description),) = decoded(played, '/model/description')
    assert model_time - window_time == 500_000_000
    model = model_from_yaml(description.data)['roll'].model
    assert model.natural_period == pytest.approx(HULL.model.natural_period, rel=0.05)
    rows = np.frombuffer(window.data.tobytes(), '<f8').reshape(window.width, len(WINDOW_COLUMNS))
    assert [field.name for field in window.fields] == list(WINDOW_COLUMNS)
    core = MotionWindow()
    finished = next(filter(None, (core.add(reading).finished for reading in read_readings(bag))))
    np.testing.assert_array_equal(rows[:, : len(COLUMNS)], finished.table.rows)
    assert set(rows[:, len(COLUMNS)]) == {0.0, 1.0}
    ((_, numbers),) = decoded(played, '/model/coefficients')
    assert numbers.layout.dim[0].label == 'roll,roll_std'
    assert numbers.data[numbers.layout.dim[1].label.split(',').index('r1')] == model.terms['r1']


@pytest.mark.release
def test_no_window_of_half_an_hour_of_measured_waves_holds_a_decay(data_folder):
    window = MotionWindow()
    steps = [window.add(reading) for reading in read_readings(data_folder / 'waves/morro_buoy.csv')]
    assert window.samples == len(steps) > 17_000
    assert not any(step.finished for step in steps)


@pytest.mark.long
def test_a_window_that_comes_amid_a_fit_waits_for_it(bag):
    calls = []
    no_waves = PipelineSettings(forecaster=ForecasterSettings(first_refit=1e9))
    pipeline = PlayThrough(PlayThroughSettings(refit_delay=30.0, forecasts=no_waves), fit=stub_fit(calls))
    readings = list(read_readings(bag))
    length = readings[-1].stamp_ns - readings[0].stamp_ns + 1_000_000_000
    took = []
    for turn in range(3):
        steps = [pipeline.add(each._replace(stamp_ns=each.stamp_ns + turn * length)) for each in readings]
        took += [step.stamp_ns for step in steps if step.verdict is not None]
    # the second window in turn was fitted with the model that the first fit had found
    assert [call.current for call in calls] == [{}, {'roll': HULL}]
    assert calls[1].windows[-1].stamp_ns - calls[0].windows[-1].stamp_ns > length / 2
    assert len(took) == 1


@pytest.mark.long
def test_a_clock_that_is_set_back_ends_a_waiting_fit(bag):
    pipeline = PlayThrough(PlayThroughSettings(refit_delay=1e6), fit=stub_fit([]))
    first, *others = read_readings(bag)
    for reading in (first, *others):
        pipeline.add(reading)
    assert pipeline.refitter.models == {}
    pipeline.add(first)
    assert pipeline.refitter.models == {'roll': HULL}


@pytest.mark.long
def test_the_sea_is_fitted_inline_and_nothing_is_identified_where_that_is_off(bag):
    asked, installed, calls = [], [], []

    def note(request):
        asked.append(request.time)
        return fit_sea(request)

    pipeline = PlayThrough(PlayThroughSettings(auto_identify=False), fit=stub_fit(calls), fit_sea=note)
    install = pipeline.forecasts.install
    pipeline.forecasts.install = lambda fit: (installed.append(fit.time), install(fit))
    windows = [played.window for played in map(pipeline.add, read_readings(bag)) if played.window is not None]
    assert len(asked) > 1 and installed == asked
    assert len(windows) == 1 and calls == []


@pytest.mark.long
def test_diagnostics_come_once_a_second_of_stamps_and_are_those_of_the_nodes(bag, played):
    stamps, times, values = read_imu(bag).stamps, {}, {}
    for time, message in decoded(played, '/diagnostics'):
        assert stamp_of(message) == time and time in stamps
        node = message.status[0].name.partition(':')[0]
        times.setdefault(node, []).append(round((time - stamps[0]) / 1e9))
        values |= {status.name: {pair.key: pair.value for pair in status.values} for status in message.status}
    assert times == dict.fromkeys(('imu_buffer', 'identifier', 'predictor'), list(range(1, 16)))
    assert set(values) == {
        *('imu_buffer: imu', 'imu_buffer: window', 'identifier: identification', 'identifier: stability'),
        *('predictor: imu', 'predictor: forecast', 'predictor: installation'),
    }
    stream, identified = values['predictor: imu'], values['identifier: identification']
    assert (stream['rate_hz'], stream['processing_ms_max'], int(stream['received'])) == ('50', '0', 750)
    assert abs(float(stream['stamp_age_s'])) < 1e-9
    assert values['predictor: forecast']['has_model_roll'] == 'True'
    assert values['predictor: installation']['contradictions'] == 'none'
    assert values['imu_buffer: window']['decays_noticed'] == '1'
    assert (identified['refits'], identified['published'], identified['state']) == ('1', '1', 'ready')


@pytest.mark.long
def test_a_gap_is_told_once_and_a_clock_set_back_begins_anew(bag):
    pipeline = PlayThrough(PlayThroughSettings(auto_identify=False))
    health = PlayedHealth(pipeline, 'imu/data', (1.0, 1.0, 1.0))
    readings = list(read_readings(bag))[:300]
    told = []
    for shift in (0, 11, -20):
        for reading in readings:
            played = pipeline.add(reading._replace(stamp_ns=reading.stamp_ns + shift * 10**9))
            for (level, name, _, values), *_ in health.follow(played):
                if name == 'predictor: imu':
                    told.append((round((played.stamp_ns - readings[0].stamp_ns) / 1e9), level, values['sensor-silent']))
    seconds, levels, silences = zip(*told, strict=True)
    assert seconds == (1, 2, 3, 4, 5, 11, 12, 13, 14, 15, 16, -19, -18, -17, -16, -15)
    assert [second for second, level in zip(seconds, levels, strict=True) if level == ERROR] == [11]
    assert silences == ('0',) * 5 + ('1',) * 11


@pytest.mark.long
def test_a_known_model_is_published_first_and_used_and_the_model_path_of_the_nodes_never_written(bag, tmp_path, played):
    model_file = tmp_path / 'hull.yaml'
    write_model(model_file, {'roll': HULL})
    given = {'auto_identify': False, 'frame_id': 'hull', 'leads_s': [0.25, 1.0]}
    out = play(bag, tmp_path, '--model', str(model_file), '--with-imu', **given)
    ((time, description),) = decoded(out, '/model/description')
    assert model_from_yaml(description.data) == read_model(model_file)
    assert time == min(sent for _, _, sent, _ in messages_of(out))
    topics = {topic for topic, _, _, _ in messages_of(out)}
    assert {'/forecast/lead_0_25s', '/forecast/lead_1_0s', '/imu/data'} <= topics
    assert '/forecast/lead_0_5s' not in topics
    assert {m.header.frame_id for _, m in decoded(out, '/forecast/lead_1_0s')} == {'hull'}
    np.testing.assert_array_equal(read_imu(out, '/imu/data').values, read_imu(bag).values)
    model_file = tmp_path / 'hull.yaml'
    assert not played.with_name(model_file.name).exists()
    write_model(model_file, {'roll': HULL})
    before = model_file.read_bytes()
    out = play(bag, tmp_path, model_path=str(model_file))
    assert model_file.read_bytes() == before
    assert model_from_yaml(decoded(out, '/model/description')[0][1].data)['roll'] == HULL


@pytest.mark.long
def test_frames_are_turned_once_whatever_the_record(trial, tmp_path):
    """A CSV trial is turned by its reader, a bag by the cores: both give the same forecasts."""
    angles = []
    for name, write in (('t.csv', write_csv), ('t.mcap', write_imu_bag)):
        write(tmp_path / name, trial)
        out = play(tmp_path / name, tmp_path, frame='frd', auto_identify=False)
        turns = [m.orientation for _, m in decoded(out, '/forecast/lead_0_5s')]
        angles.append([euler_angles(q.x, q.y, q.z, q.w)[:2] for q in turns])
    np.testing.assert_allclose(angles[0], angles[1], rtol=0, atol=1e-6)
    assert np.abs(angles).max() > 0.05


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        (['--output', 'out.db3'], 'end the name in .mcap'),
        (['--output', 'out.mcap', '--refit-delay', '-1'], 'must not be negative'),
        (['--output', 'nowhere/out.mcap'], 'cannot write'),
        (['--output', 'out.mcap', '--topic', '/other'], 'holds no topic /other'),
        (['--output', 'out.mcap', '--model', 'none.yaml'], 'cannot read the model file'),
    ],
)
def test_mistakes_are_told_in_one_sentence(bag, words, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['play-through', str(bag), *words]) == 2
    assert sentence in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_reason_that_holds_for_every_message_has_no_count(tmp_path, capsys):
    record = tmp_path / 'roll.csv'
    rows = (f'{0.05 * k:.2f},{np.sin(0.05 * k):.4f}\n' for k in range(40))
    record.write_text('time_s,roll_deg\n' + ''.join(rows))
    play(record, tmp_path)
    told = capsys.readouterr().err
    assert '\nno-rates: the sensor' in told and '\nunknown-covariance: the sensor' in told and 'times' not in told


@pytest.mark.parametrize('frame_id', ['', 'a', 'base_link', 'hull/imu_7'])
def test_templates_write_what_the_type_system_writes(frame_id):
    """Whatever the length of the strings before the numbers, and so their places."""
    sent, rng = ForecastMessages(frame_id), np.random.default_rng(5)
    for axes in (AXES, AXES[:1], ()):
        mean, variance = rng.normal(size=(3, 4)), rng.uniform(1.0, 2.0, (3, 4))
        mean[:, [name.removesuffix('_rate') not in axes for name in ATTITUDE]] = np.nan
        forecast = Forecast(-5, np.array([0.1, 1.1, 2.0]), mean, variance[:, :, None] * np.eye(4), (0.3, 0.1))
        now = CraftSample(-5, 0.01, 0.02, np.nan, 0.04, *(0.0,) * 7)
        outlook = Outlook(0.75, None, {'roll': 1.5})
        step = ForecastStep(next=forecast.at(0.1), sample=now, forecast=forecast, horizon=forecast, outlook=outlook)
        found = {topic: STORE.deserialize_cdr(raw, type_of(topic)) for topic, raw in sent.of(step)}
        message, table, values = found['forecast/lead_1_1s'], found['forecast/horizon'], np.nan_to_num(mean[1]).tolist()
        imu, shown = imu_reading(message), np.where(np.isnan(mean[1]), [np.pi**2] * 2 + [100.0] * 2, variance[1])
        assert message.header.frame_id == frame_id and imu.stamp_ns == 1_099_999_995
        assert imu.orientation == quaternion(*values[:2], 0.3) and imu.rates == body_rates(*values, 0.1)
        variances = [*imu.orientation_covariance[:5:4], *imu.rates_covariance[:5:4]]
        assert variances == (shown.tolist() if axes else [-1.0, 0.0, -1.0, 0.0])
        assert imu.force == (0.0, 0.0, 0.0) and imu.force_covariance[0] == -1.0
        assert table.joint_names == [f'{axis}{kind}' for axis in axes for kind in ('', '_std')]
        assert [stamp_ns(point.time_from_start) for point in table.points] == [0, 10**8, 11 * 10**8, 20 * 10**8]
        # the sample first, and where it lacks a value the forecast of the next one
        mean = np.vstack([[0.01, 0.02, mean[0, 2], 0.04], mean])
        pairs = np.stack([mean, np.sqrt(variance[[0, 0, 1, 2]])], axis=2)[:, np.isfinite(forecast.mean[0])].reshape(
            4, -1
        )
        stamped = found['forecast/outlook']
        assert dict(zip(stamped.name, stamped.position, strict=True)) == {'valid_lead.roll': 1.5, 'quiescence': 0.75}
        assert stamp_ns(stamped.header.stamp) == -5
        np.testing.assert_array_equal([[*point.positions, *point.velocities] for point in table.points], pairs)


WORDS = st.text(max_size=9)
STATUSES = st.tuples(st.sampled_from([0, 1, 2]), WORDS, WORDS, st.dictionaries(WORDS, WORDS, max_size=4))


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1), st.lists(STATUSES, max_size=3))
def test_the_bytes_of_diagnostics_are_those_of_a_type_system(stamp_ns, statuses):
    types = STORE.types
    status, pair = types['diagnostic_msgs/msg/DiagnosticStatus'], types['diagnostic_msgs/msg/KeyValue']
    message = types['diagnostic_msgs/msg/DiagnosticArray'](
        header=types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 10**9)), ''),
        status=[
            status(level, name, text, '', [pair(key, value) for key, value in values.items()])
            for level, name, text, values in statuses
        ],
    )
    wanted = bytes(STORE.serialize_cdr(message, 'diagnostic_msgs/msg/DiagnosticArray'))
    assert diagnostics_message(stamp_ns, statuses) == wanted


def test_the_output_is_a_bag_of_trials_whose_latched_topics_say_so(played):
    forecast = read_bag(played, '/forecast/next')
    assert forecast.roll.size == forecast.time.size > 700
    with opened_bag(played) as (readers, _):
        durability = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in readers[0].connections}
    assert durability['/model/description'] == durability['/motion/window'] == 'TRANSIENT_LOCAL'
    assert durability['/forecast/next'] == 'VOLATILE'
