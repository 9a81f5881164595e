"""``swath-sysid mounting``: the mounting of a sensor from rest and a push, as it is stated everywhere."""

from argparse import Namespace

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation, euler_angles, in_degrees, turn_in_craft
from swath_sysid.attitude.motion.mounting_estimate import estimate_mounting
from swath_sysid.cli.progress import print_result
from swath_sysid.cli.sources import read_record


def run(arguments: Namespace) -> int:
    """Print the mounting as parameter, flag and URDF line."""
    # whatever a file or a bag states: the axes of the sensor
    given = Namespace(**vars(arguments), mounting=(0.0, 0.0, 0.0), params_file=None)
    trial = read_record(arguments.record, given)
    found = estimate_mounting(trial, arguments.pushed)
    frame = trial.installation.frame if trial.installation is not None else 'flu'
    angles, turn = in_degrees(found.angles, 1), turn_in_craft(Installation(frame, found.angles))
    urdf = ' '.join(f'{angle:.4f}' for angle in map(float, euler_angles(*turn)))
    data = {
        'mounting_deg': angles,
        'yaw_spread_deg': float(np.degrees(found.yaw_spread)),
        'rest_s': found.rest,
        'push_deg': float(np.degrees(found.push)),
        'urdf_rpy': urdf,
    }
    lines = [
        f'roll {angles[0]:g}, pitch {angles[1]:g}, yaw {angles[2]:g} deg of the sensor in the craft, which is taken to '
        f'float level; the halves of the push differ by {data["yaw_spread_deg"]:.1f} deg in yaw',
        f'parameter  mounting_deg: [{", ".join(f"{float(angle)}" for angle in angles)}]',
        f'flag       --mounting {",".join(f"{angle:g}" for angle in angles)}',
        f'URDF       <origin rpy="{urdf}"/>, in the joint from base_link to the frame_id of the sensor',
    ]
    print_result(arguments.json, data, lines)
    return 0
