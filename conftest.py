"""The environment of every test run: ROS messages checked and kept to this machine, DDS tests one after another."""
import os
import random

import pytest
from hypothesis import settings

# Read when numpy and rclpy are first imported, so set before any test module is.
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('ROS_PYTHON_CHECK_FIELDS', '1')
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(random.SystemRandom().randint(1, 100)))

# How long an example takes says how busy the machine is, not whether the code is right.
settings.register_profile('untimed', deadline=None, print_blob=True)
settings.load_profile('untimed')


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Nodes of two tests at once would hear each other: one pytest-xdist group keeps them in one process."""
    for item in items:
        if item.get_closest_marker('dds'):
            item.add_marker(pytest.mark.xdist_group('dds'))
