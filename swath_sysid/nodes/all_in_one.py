"""All three nodes in one process."""

from rclpy.executors import SingleThreadedExecutor

from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.identifier import Identifier
from swath_sysid.nodes.imu_buffer import ImuBuffer
from swath_sysid.nodes.predictor import Predictor

#: The predictor first: it gets each sample before the buffer does. The identifier, whose services wait, has a thread of
#: its own.
PLAN: Plan = [(events_executor, [Predictor, ImuBuffer]), (SingleThreadedExecutor, [Identifier])]
