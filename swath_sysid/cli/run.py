"""The verb ``run``: imu_buffer, identifier and predictor in one process."""
import argparse

from swath_sysid.errors import InputError


def add_arguments(parser):
    """Arguments of the verb."""
    parser.add_argument('--params-file', metavar='FILE', help='ROS parameter file for all three nodes')
    parser.add_argument('--model', metavar='FILE', help='model file: read at the start, replaced by refits')
    parser.add_argument('--namespace', metavar='NAME', help='namespace of nodes and topics')
    parser.add_argument('--imu-topic', metavar='TOPIC', help='topic of the sensor (default imu/data)')
    parser.add_argument('--use-sim-time', action='store_true', help='time from /clock')
    parser.add_argument(
        '--ros-args', nargs=argparse.REMAINDER, default=[], metavar='...', help='anything else, as ROS 2 nodes take it'
    )


def run(arguments):
    """Run the nodes until a signal comes; returns the exit code."""
    try:
        import rclpy  # noqa: F401 - only to say what to do where it is missing
    except ImportError as error:
        raise InputError(
            f'rclpy is not installed ({error}): pip install swath_sysid[ros], or source a ROS 2 installation'
        ) from error
    from swath_sysid.nodes.together import run_together

    return run_together(['swath-sysid', '--ros-args', *ros_arguments(arguments)])


def ros_arguments(arguments):
    """What stands behind ``--ros-args`` for the nodes."""
    given = []
    if arguments.params_file:
        given += ['--params-file', arguments.params_file]
    if arguments.model:
        given += ['-p', f'identifier:model_path:={arguments.model}']
    if arguments.namespace:
        given += ['-r', f'__ns:=/{arguments.namespace.strip("/")}']
    if arguments.imu_topic:
        given += ['-r', f'imu/data:={arguments.imu_topic}']
    if arguments.use_sim_time:
        given += ['-p', 'use_sim_time:=true']
    return [*given, *arguments.ros_args]
