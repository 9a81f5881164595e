"""All three nodes in one process."""

from rclpy.executors import SingleThreadedExecutor

from swath_sysid.nodes.executor_loop import Plan, events_executor

#: The buffer first: it subscribes while the others are still being imported. The identifier, whose services wait, has a
#: thread of its own.
PLAN: Plan = [
    (events_executor, ['nodes.imu_buffer ImuBuffer', 'nodes.predictor Predictor']),
    (SingleThreadedExecutor, ['nodes.identifier Identifier']),
]
