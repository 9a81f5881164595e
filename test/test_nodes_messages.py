"""Between ROS messages and plain values."""

import sys

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import imu_message  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from rclpy.task import Future  # noqa: E402
from sensor_msgs.msg import PointCloud2, PointField  # noqa: E402

from swath_sysid.attitude.motion.window import COLUMNS, MotionTable, NoticedDecay  # noqa: E402
from swath_sysid.common.errors import InputError  # noqa: E402
from swath_sysid.formats.messages import (  # noqa: E402
    LONGEST_WINDOW,
    WINDOW_COLUMNS,
    imu_reading,
    stamp_ns,
    window_message,
    window_table,
)
from swath_sysid.nodes.parameters.table import table_of  # noqa: E402
from swath_sysid.nodes.qos import message_class, time_message  # noqa: E402
from swath_sysid.nodes.window_client import WindowClient  # noqa: E402
from swath_sysid.pipeline.health import IdentifierHealth  # noqa: E402


def a_table(rows=20):
    values = np.random.default_rng(1).normal(size=(rows, len(COLUMNS)))
    values[:, 0] = np.arange(rows)
    values[3:4, 2] = np.nan
    return MotionTable(values, EPOCH_NS, NoticedDecay('pitch', 4.0, 9.0) if rows else None)


@pytest.mark.parametrize('stamp', [0, 1, EPOCH_NS + 999_999_999, -1, -(2**31) * 10**9])
def test_stamps_go_both_ways(stamp):
    assert stamp_ns(time_message(stamp)) == stamp


def test_an_imu_message_is_read_as_it_was_filled():
    def plain(found):
        return [list(part) if isinstance(part, tuple) else part for part in found]

    given = reading(EPOCH_NS + 123, 0.1, 0.2, 0.3, 0.4)
    assert plain(imu_reading(imu_message(given))) == plain(given)


def test_a_window_goes_both_ways():
    message = deserialize_message(window_message(a_table(), 'base_link'), PointCloud2)
    found = window_table(message)
    np.testing.assert_array_equal(found.rows, a_table().rows)
    assert found.stamp_ns == EPOCH_NS and found.noticed == a_table().noticed and message.header.frame_id == 'base_link'
    assert (message.height, message.width, message.point_step) == (1, 20, 96) and not message.is_dense
    assert [field.name for field in message.fields] == list(WINDOW_COLUMNS)
    nothing = deserialize_message(window_message(a_table(0), ''), PointCloud2)
    assert window_table(nothing).rows.shape == (0, len(COLUMNS))


def test_a_window_of_another_maker_is_read():
    names, is_little = ['extra', *reversed(WINDOW_COLUMNS)], sys.byteorder == 'little'
    table = np.zeros(20, dtype=[(name, '>f8' if is_little else '<f8') for name in names])
    for index, name in enumerate(COLUMNS):
        table[name] = a_table().rows[:, index]
    fields = [PointField(name=n, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, n in enumerate(names)]
    layout = {'height': 4, 'width': 5, 'point_step': 8 * len(names), 'is_bigendian': is_little}
    message = PointCloud2(**layout, data=table.tobytes(), fields=fields)
    np.testing.assert_array_equal(window_table(message).rows, a_table().rows)


@pytest.mark.parametrize(
    ('spoil', 'sentence'),
    [
        (lambda m: m.data.pop(), '1919 of 1920 bytes'),
        (lambda m: setattr(m.fields[3], 'datatype', PointField.FLOAT32), 'no FLOAT64 column'),
        (lambda m: m.fields.pop(2), 'no FLOAT64 column pitch'),
        (lambda m: setattr(m.fields[1], 'offset', 92), 'reaches beyond'),
    ],
)
def test_a_window_that_is_none_is_refused_by_a_sentence(spoil, sentence):
    message = deserialize_message(window_message(a_table(), ''), PointCloud2)
    spoil(message)
    with pytest.raises(InputError, match=sentence):
        window_table(message)


def with_stamps(change):
    table = a_table()
    table.rows[:, 0] = change(table.rows[:, 0])
    return deserialize_message(window_message(table, ''), PointCloud2)


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        (lambda t: 0.0 * t, '19 of 20 rows of the window are not later than the previous row: fill its column t'),
        (lambda t: np.nan * t, '20 of 20 rows of the window have no stamp'),
        (lambda t: np.where(t == t[7], np.nan, t), '1 of 20 rows of the window have no stamp'),
        (lambda t: np.where(t == t[-1], np.inf, t), '1 of 20 rows'),
        (lambda t: t[::-1], '19 of 20 rows of the window are not later'),
        (lambda t: np.where(t == t[7], t[6], t), '1 of 20 rows of the window are not later'),
        (lambda t: np.where(t > t[7], t + 1e9, t), r'jump by 1e\+09 s'),
        (lambda t: np.where(t == t[0], -1.7e9, t), r'jump by 1.7e\+09 s'),
        (lambda t: t - t[0] + 1e300 * np.arange(t.size), r'jump by 1e\+300 s'),
    ],
)
def test_stamps_that_are_none_are_refused_before_anything_is_sized_by_them(change, sentence):
    with pytest.raises(InputError, match=sentence) as refused:
        window_table(with_stamps(change))
    assert str(refused.value).endswith('increasing times in s, as imu_buffer does')


def test_a_pause_that_fits_into_a_window_is_none_of_the_stamps_faults():
    (longest,) = (max(p.range) for p in table_of('imu_buffer') if p.name == 'window_s')
    assert longest == LONGEST_WINDOW
    assert window_table(with_stamps(lambda t: np.where(t > t[7], t + 0.9 * longest, t))).rows.shape == (
        20,
        len(COLUMNS),
    )


@pytest.mark.dds
def test_whoever_asks_for_a_fit_is_told_why_the_window_was_refused():
    rclpy.init()
    node = rclpy.create_node('identifier')
    try:
        windows = WindowClient(node, 'nobody/publish_window', IdentifierHealth(), lambda table: None)

        def problem():
            with pytest.raises(StopIteration) as ended:
                windows.fetch(60.0).send(None)  # it has nothing to wait for
            return ended.value.value

        assert problem().startswith('there is no window: start imu_buffer')
        windows._receive(with_stamps(lambda t: t))
        assert problem() == ''
        windows._awaited = Future()
        windows._receive(with_stamps(lambda t: 0.0 * t))
        assert windows._awaited.result() == problem() and problem().startswith('19 of 20 rows of the window')
        windows._receive(with_stamps(lambda t: t))
        assert problem() == ''
    finally:
        node.destroy_node()
        rclpy.shutdown()


OTHERS = ['/msg/Imu', '__main__/msg/Imu', 'json/msg/Imu', 'os.path/msg/Imu', 'sensor_msgs/msg/X']


@pytest.mark.parametrize('name', ['antigravity/msg/X', 'sensor_msgs/msg/__name__', *OTHERS])
def test_a_type_that_a_bag_or_another_node_names_imports_nothing_but_messages(name):
    """The package antigravity, of Python itself, would open a browser."""
    assert message_class(name) is None and 'antigravity' not in sys.modules


def test_the_class_of_an_installed_message_is_found():
    assert message_class('sensor_msgs/msg/PointCloud2') is PointCloud2
