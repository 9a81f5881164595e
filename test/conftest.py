"""What every test shares: the real records and a quiet environment."""

import os
import sys
from pathlib import Path

import pytest

# rclpy from PyPI looks for its middleware under this prefix and refuses to start without it
os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
os.environ.setdefault('MPLBACKEND', 'Agg')


@pytest.fixture(scope='session')
def data_folder():
    """The folder of measured records; tests that ask for it skip where it is absent."""
    default = Path(__file__).resolve().parents[2] / 'shared' / 'data'
    folder = Path(os.environ.get('SWATH_SYSID_DATA', default))
    if not folder.is_dir():
        pytest.skip(f'no measured records at {folder}: set SWATH_SYSID_DATA to their folder')
    return folder
