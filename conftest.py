"""The environment of every test run: ROS messages checked, kept to this machine and apart from other runs."""

import gc
import os
import random
import signal

from hypothesis import settings

# Read when numpy and rclpy are first imported, so set before any test module is.
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('ROS_PYTHON_CHECK_FIELDS', '1')
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(random.SystemRandom().randint(1, 100)))
if 'PYTEST_XDIST_WORKER' in os.environ:
    # processes that test side by side must not hear each other's nodes
    worker = int(os.environ['PYTEST_XDIST_WORKER'].removeprefix('gw'))
    os.environ['ROS_DOMAIN_ID'] = str((int(os.environ['ROS_DOMAIN_ID']) - 1 + worker) % 100 + 1)

# A shell without job control starts what runs in its background with SIGINT ignored, and children inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Collected tests and loaded modules stay: looking through them for garbage takes a fifth of the processor time.
gc.set_threshold(50_000, 20, 20)


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()


# How long an example takes says how busy the machine is, not whether the code is right.
settings.register_profile('untimed', deadline=None, print_blob=True)
settings.load_profile('untimed')
