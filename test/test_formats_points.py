"""The messages of named points and of windows of calm, against rotations of scipy."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.forecaster import ForecastStep
from swath_sysid.attitude.prediction.outlook import Outlook
from swath_sysid.attitude.prediction.point import point_motion
from swath_sysid.attitude.prediction.quiescence import CalmWindow
from swath_sysid.common.errors import InputError
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.messages import typestore
from swath_sysid.formats.topics import type_of
from swath_sysid.nodes.parameters.parameter_files import values_from_file
from swath_sysid.nodes.parameters.settings import pipeline_settings

LEADS = np.array([0.5, 2.0])
PLACE = (2.5, -0.5, 1.0)
STAMP_NS = 1_700_000_000_250_000_000
ROLL, PITCH, ROLL_RATE, PITCH_RATE = np.array([[0.1, -0.2], [-0.05, 0.12], [0.2, 0.1], [-0.1, 0.3]])
MEAN, SPREAD = np.column_stack([ROLL, PITCH, ROLL_RATE, PITCH_RATE]), np.tile(np.eye(4), (2, 1, 1))
CALM = Outlook(0.8, CalmWindow(0.5, 2.25, 0.93), {})


@pytest.fixture(scope='module')
def messages():
    rng = np.random.default_rng(4)
    motion = np.column_stack([[0.4, 0.1], [0.3, -0.6], [0.1, 0.5], [0.0, 0.1], [0.2, 0.0], MEAN])
    root = rng.normal(size=(2, 9, 9)) * 0.05
    covariance = root @ root.transpose(0, 2, 1)
    points = {'bow': point_motion(PLACE, (0.0, 0.0), motion, covariance)}
    forecast = Forecast(STAMP_NS, LEADS, MEAN, SPREAD, points=points)
    sent = dict(ForecastMessages('craft').of(ForecastStep(forecast=forecast, horizon=forecast, outlook=CALM)))
    return {topic: typestore().deserialize_cdr(raw, type_of(topic)) for topic, raw in sent.items()}, points['bow']


def test_a_point_is_where_its_lever_arm_puts_it(messages):
    found, motion = messages
    for k, (lead, name) in enumerate(((0.5, '0_5s'), (2.0, '2_0s'))):
        message = found[f'forecast/bow/lead_{name}']
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == STAMP_NS + round(lead * 1e9)
        assert (message.header.frame_id, message.child_frame_id) == ('craft_level', 'bow')
        turn = Rotation.from_euler('ZYX', (0.0, PITCH[k], ROLL[k]))
        at, q = message.pose.pose.position, message.pose.pose.orientation
        np.testing.assert_allclose([at.x, at.y], turn.apply(PLACE)[:2], atol=1e-12)
        assert at.z == pytest.approx(motion.mean[k, 0])
        assert (turn.inv() * Rotation.from_quat([q.x, q.y, q.z, q.w])).magnitude() < 1e-9
        linear = message.twist.twist.linear
        assert turn.apply([linear.x, linear.y, linear.z])[2] == pytest.approx(motion.mean[k, 1])


def test_covariances_say_what_is_known(messages):
    found, motion = messages
    message = found['forecast/bow/lead_2_0s']
    pose, twist = (np.reshape(part.covariance, (6, 6)) for part in (message.pose, message.twist))
    np.testing.assert_allclose(pose[2:5, 2:5], motion.covariance[1][np.ix_((0, 3, 4), (0, 3, 4))])
    assert pose[0, 0] == pose[1, 1] == 100.0
    turn = Rotation.from_euler('ZYX', (0.0, PITCH[1], ROLL[1])).as_matrix()
    assert (turn @ twist[:3, :3] @ turn.T)[2, 2] == pytest.approx(motion.covariance[1, 1, 1])
    for covariance in (pose, twist):
        np.testing.assert_allclose(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > -1e-9
    acceleration = found['forecast/bow/acceleration_2_0s']
    assert acceleration.accel.accel.linear.z == pytest.approx(motion.mean[1, 2])
    assert acceleration.accel.covariance[14] == pytest.approx(motion.covariance[1, 2, 2])


def test_the_horizon_of_a_point_and_the_window_of_calm(messages):
    found, motion = messages
    second = found['forecast/bow/horizon'].points[1]
    deviation = np.sqrt(np.diag(motion.covariance[1]))
    for values, kind in ((second.positions, 0), (second.velocities, 1), (second.accelerations, 2)):
        np.testing.assert_allclose(values, (motion.mean[1, kind], deviation[kind]))
    calm = found['forecast/calm']
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in calm.points]
    assert times == pytest.approx([0.5, 2.25]) and [p.positions[0] for p in calm.points] == [0.93, 0.93]


def test_points_are_parameters(tmp_path):
    path = tmp_path / 'p.yaml'
    point = 'points.bow: [2.5, 0.0, 0.5], points: [bow]'
    path.write_text(f'/**/predictor: {{ros__parameters: {{{point}, quiet_vertical_velocity_m_s: 0.5}}}}')
    settings = pipeline_settings(values_from_file(path, 'predictor')).forecaster
    assert [(point.name, point.place) for point in settings.points] == [('bow', (2.5, 0.0, 0.5))]
    assert settings.quiescence.points[0].vertical_velocity == 0.5
    # a section for all nodes may say where a point is, and that of the predictor that it is wanted
    where = '/**: {ros__parameters: {points.bow: [2.5, 0.0, 0.5]}}'
    path.write_text(f'{where}\npredictor: {{ros__parameters: {{points: [bow]}}}}')
    assert values_from_file(path, 'predictor')['points.bow'] == [2.5, 0.0, 0.5]
    assert 'points.bow' not in values_from_file(path, 'imu_buffer')
    for text in ('points: [bow, bow]', 'frames_at_s: [0.7]'):
        path.write_text(f'predictor: {{ros__parameters: {{{text}}}}}')
        with pytest.raises(InputError, match=text.partition(':')[0]):
            pipeline_settings(values_from_file(path, 'predictor'))


BOW = 'points.bow: [1.0, 0.0, 0.0]'
NO_PLACE = 'the point {} has no position: '
ADD = 'add the parameter points.{} (m forward, to port and up from the sensor), as in [2.5, 0.0, 0.0]'
POINTS_AND_POSITIONS = [
    ('points: [bow]', NO_PLACE.format('bow') + ADD.format('bow')),
    *(
        (f'points: [bow], points.{name}: [1.0, 0.0, 0.0]', f'points.{name} is given; did you mean points.bow?')
        for name in ('bwo', 'BOW')
    ),
    (f'points: [bow, stern], {BOW}', NO_PLACE.format('stern') + ADD.format('stern')),
    (f'points: [mast], {BOW}', NO_PLACE.format('mast') + ADD.format('mast')),
    (f'points: [sow, bow], points.sow: [0.0, 0.0, 0.0], {BOW}', ''),
    (BOW, 'points.bow is the position of no point: add bow to points, or remove it'),
    (
        f'points: [bow], {BOW}, points.bow2: [1.0, 0.0, 0.0]',
        'points.bow2 is the position of no point (did you mean bow?): add bow2 to points, or remove it',
    ),
    ('points: [bow], points.bow: [1.0, 2.0]', 'the parameter points.bow has 2 numbers: give three (m forward'),
]


@pytest.mark.parametrize('section', ['/**', 'predictor'])
@pytest.mark.parametrize(('text', 'sentence'), POINTS_AND_POSITIONS)
def test_a_point_without_position_and_a_position_without_point_are_named(tmp_path, section, text, sentence):
    path = tmp_path / 'p.yaml'
    path.write_text(f'{section}: {{ros__parameters: {{{text}}}}}')
    if not sentence:
        assert len(pipeline_settings(values_from_file(path, 'predictor')).forecaster.points) == 2
        return
    with pytest.raises(InputError, match=re.escape(sentence)):
        pipeline_settings(values_from_file(path, 'predictor'))
    # other nodes have no points
    if section == '/**':
        values_from_file(path, 'imu_buffer')


@pytest.mark.dds
@pytest.mark.parametrize(('text', 'sentence'), POINTS_AND_POSITIONS)
def test_a_node_says_the_same_of_what_the_command_line_gives_it(text, sentence):
    rclpy = pytest.importorskip('rclpy')
    from rclpy.node import Node

    from swath_sysid.nodes.parameters.declared import NodeParameters

    given = re.findall(r'([\w.]+): (\[.*?\])', text)
    rclpy.init(args=['--ros-args', *(word for name, value in given for word in ('-p', f'{name}:={value}'))])
    node = Node('predictor')
    try:
        if sentence:
            with pytest.raises(InputError, match=re.escape(sentence)):
                NodeParameters(node, 'predictor', pipeline_settings)
        else:
            assert NodeParameters(node, 'predictor', pipeline_settings)['points'] == ['sow', 'bow']
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_predicted_frames_have_names_of_their_own(messages):
    heading, now = 1.2, (0.15, -0.04)
    forecast = Forecast(STAMP_NS, LEADS, MEAN, SPREAD, points={'sensor': replace(messages[1], place=(0.0, 0.0, 0.0))})
    following = Forecast(STAMP_NS, LEADS[:1], np.array([[*now, 0.0, 0.0]]), SPREAD[:1], (heading, 0.0))
    step = ForecastStep(next=following, forecast=forecast, horizon=forecast, outlook=CALM)
    assert '/tf' not in dict(ForecastMessages('craft').of(step))
    raw = dict(ForecastMessages('craft', (2.0,)).of(step))['/tf']
    transforms = typestore().deserialize_cdr(raw, type_of('/tf')).transforms
    assert [each.child_frame_id for each in transforms] == ['craft_now', 'craft_in_2_0s']
    assert {each.header.frame_id for each in transforms} == {'craft_level'}
    for each, (roll, pitch) in zip(transforms, (now, (ROLL[1], PITCH[1])), strict=True):
        q = each.transform.rotation
        turn = Rotation.from_euler('ZYX', (0.0, pitch, roll))
        assert (turn.inv() * Rotation.from_quat([q.x, q.y, q.z, q.w])).magnitude() < 1e-9
    assert transforms[1].transform.translation.z == pytest.approx(messages[1].mean[1, 0])
