"""All three nodes in one process."""

from rclpy.executors import SingleThreadedExecutor

from swath_sysid.nodes.executor_loop import events_executor, run
from swath_sysid.nodes.identifier import Identifier
from swath_sysid.nodes.imu_buffer import ImuBuffer
from swath_sysid.nodes.predictor import Predictor


def main(args: list[str] | None = None) -> int:
    """Run the three nodes until a signal comes; the identifier, whose services wait, has a thread of its own."""
    # the predictor first: it gets each sample before the buffer does
    return run([(events_executor, [Predictor, ImuBuffer]), (SingleThreadedExecutor, [Identifier])], args)
