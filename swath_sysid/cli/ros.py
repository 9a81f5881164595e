"""ROS where a verb needs it."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from swath_sysid.common.errors import InputError

LAST_DOMAIN = 232  #: Its ports are the last ones below 65536.
MIDDLEWARES = 'librmw_*_cpp.so'  #: Their libraries; rmw_fastrtps_dynamic_cpp is one as well.


@contextmanager
def ros_needed(without: str = '') -> Iterator[None]:
    """Around imports of ROS: `InputError` where it is not installed, with what the verb does ``without`` it."""
    _check_environment()
    try:
        yield
    except ImportError as error:
        raise InputError(
            f'rclpy is not installed ({error}): pip install "swath_sysid[ros]", or source a ROS 2 installation'
            + (without and f'; {without}')
        ) from error


def _check_environment() -> None:
    """Reject what would end this process within the libraries of ROS, with a line of theirs."""
    domain = os.environ.get('ROS_DOMAIN_ID', '')
    if domain.isdecimal() and int(domain) > LAST_DOMAIN:
        raise InputError(f'ROS_DOMAIN_ID is {domain}, which has no ports: give 0 to {LAST_DOMAIN}, best 0 to 101')
    wanted, folders = os.environ.get('RMW_IMPLEMENTATION', ''), os.environ.get('LD_LIBRARY_PATH', '').split(os.pathsep)
    found = {
        path.stem.removeprefix('lib') for folder in filter(None, folders) for path in Path(folder).glob(MIDDLEWARES)
    }
    if wanted and found and wanted not in found:
        names = ', '.join(sorted(name for name in found if not re.search('shared|rosidl', name)))
        raise InputError(f'RMW_IMPLEMENTATION is {wanted}, which is not installed: install it, or give {names}')
