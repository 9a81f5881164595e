"""Released once live, how well is the next release known? Nodes with their defaults over DDS, four hulls.

    python benchmark/live_releases.py [--angles 6 3] [--hulls swath-roll swath-pitch]

Prints the error of a release from 5 deg, simulated with the published model, against the true hull: root mean square
over the standard deviation of the motion; beside it what the model's own verdict says.
"""

import os
import subprocess
import tempfile
import time
from typing import Annotated

import numpy as np

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, hull_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.cli.run import craft_command
from swath_sysid.common.processes import verb_command
from swath_sysid.evaluation.cli.benchmark import Benchmark

NEXT = np.radians(5.0)
TIME = np.arange(0.0, 12.0, 0.01)
PATIENCE_S = 240.0
DECAY_S = 25.0  #: Of stamps after which a decay that was not noticed is identified on demand.


def next_release_error(model, truth):
    """Of the motion from 5 deg, over its standard deviation; infinite where it runs away."""
    expected, _ = simulate(truth, NEXT, 0.0, TIME)
    found, _ = simulate(model.with_trim(0.0), NEXT, 0.0, TIME)
    error = np.sqrt(np.mean((found - expected) ** 2)) / np.std(expected)
    return float(error) if np.isfinite(error) else float('inf')


def live_run(hull, angle_deg):
    """The model that one release leads to, how it came, and what the identifier said last."""
    import rclpy
    from std_srvs.srv import Trigger

    from swath_sysid.nodes.demo_monitor import Listener

    axis = hull_named(hull).model.axis
    craft = craft_command(hull=hull, angle_deg=float(angle_deg))
    rclpy.init(args=['live_releases'])
    listener = Listener(axis, ())
    received = listener.received
    identify = listener.create_client(Trigger, 'identifier/identify')

    def wait(done):
        deadline = time.monotonic() + PATIENCE_S
        while not done():
            if time.monotonic() > deadline:
                raise SystemExit(f'{hull} from {angle_deg:g} deg: nothing came for {PATIENCE_S:g} s')
            rclpy.spin_once(listener, timeout_sec=0.1)

    with tempfile.TemporaryFile() as log:
        processes = [subprocess.Popen(each, stdout=log, stderr=log) for each in (craft, verb_command('run'))]
        try:
            wait(listener.is_ready)
            wait((answer := listener.release()).done)
            end = int(answer.result().message) + round(DECAY_S * 1e9)
            wait(lambda: received.model_ns is not None or received.angles[-1][0] > end)
            how, said = 'noticed', ''
            if received.model_ns is None:
                wait((answer := identify.call_async(Trigger.Request())).done)
                how, said = 'on demand', answer.result().message
                if answer.result().success:
                    wait(lambda: received.model_ns is not None)
            return received.models.get(axis), how, said
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait()
            listener.destroy_node()
            rclpy.shutdown()


def lines(
    *,
    hulls: Annotated[str, PUBLISHED_HULLS] = tuple(PUBLISHED_HULLS),
    angles: Annotated[float, 'deg'] = (6.0, 3.0),
    domain: str = '77',
):
    """One line for each run."""
    os.environ.update(ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST', OMP_NUM_THREADS='1', ROS_DOMAIN_ID=domain)
    for angle_deg in angles:
        errors = []
        for hull in hulls:
            held, how, said = live_run(hull, angle_deg)
            if held is None:
                yield f'{hull} {angle_deg:g} deg: nothing published, {said}'
                continue
            errors.append(next_release_error(held.model, hull_named(hull).model))
            verdict = f'{held.metrics["verdict"]}, {held.metrics["motion_error"]:.3f} stated'
            yield f'{hull} {angle_deg:g} deg: {errors[-1]:.3f} ({held.model.equation.name}; {verdict}; {how})'
        yield f'from {angle_deg:g} deg: mean {np.mean(errors):.3f}, largest {np.max(errors):.3f}'


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
