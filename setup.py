"""Installs swath_sysid, with pip as with colcon; package.xml holds its name, version and description."""

import re
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

MANIFEST = ElementTree.parse(Path(__file__).with_name('package.xml')).getroot()
NAME = MANIFEST.findtext('name')
MAINTAINER = MANIFEST.find('maintainer')


def installed(folder, destination):
    """Every file below a folder, as setuptools wants it: ``(destination folder, [files])``."""
    files = {}
    for path in sorted(Path(folder).rglob('*')):
        if path.is_file() and '__pycache__' not in path.parts:
            files.setdefault(destination / path.parent.relative_to(folder), []).append(path.as_posix())
    return [(target.as_posix(), paths) for target, paths in files.items()]


def long_description():
    """The README with links that lead somewhere from an index of packages, too: to the repository's main branch."""
    text = Path(__file__).resolve().with_name('README.md').read_text(encoding='utf-8')
    of_links = re.sub(
        r'(!?)\[([^]]*)\]\((?!\w+:)',
        lambda m: f'{m[1]}[{m[2]}]({URLS["repository"]}/{m[1] and "raw" or "blob"}/main/',
        text,
    )
    return re.sub(r'\b(src|srcset)="(?!\w+:)', rf'\1="{URLS["repository"]}/raw/main/', of_links)


URLS = {url.get('type'): url.text for url in MANIFEST.findall('url')}
SHARE = Path('share', NAME)
TANK = ['h5py>=3.7', 'npTDMS>=1.7', 'openpyxl>=3.0', 'pyarrow>=12.0']

setup(
    name=NAME,
    version=MANIFEST.findtext('version'),
    description=MANIFEST.findtext('description'),
    long_description=long_description(),
    long_description_content_type='text/markdown',
    author=MAINTAINER.text,
    author_email=MAINTAINER.get('email'),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    license=MANIFEST.findtext('license'),
    url=URLS['website'],
    project_urls={**URLS, 'changelog': f'{URLS["repository"]}/blob/main/CHANGELOG.rst'},
    # ROS 2 Jazzy exists for these
    python_requires='>=3.11,<3.13',
    keywords='ROS 2, ship motion, roll, pitch, forecast, system identification, decay, EKF, Kalman filter, SWATH, USV',
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3 :: Only',
        'Topic :: Scientific/Engineering :: Physics',
        'Typing :: Typed',
    ],
    # named, so that `pip install -e` puts the checkout on the path: setuptools' import hook, its other way, comes after
    # what an earlier version may have left of the package's folder in site-packages
    package_dir={'': '.'},
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed',
            *(f'{room}/*.yaml' for room in ('cli', 'common', 'formats', 'nodes/parameters')),
            *(f'{wing}/*.yaml' for wing in ('evaluation', 'page', 'tank', 'manoeuvring')),
            *(f'{room}/*.yaml' for room in ('tank/campaign', 'tank/papers', 'manoeuvring/paper')),
            'manoeuvring/formats/export/*.txt',
            'report/*.css',
        ]
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (SHARE.as_posix(), ['package.xml']),
        *installed('config', SHARE / 'config'),
        *installed('launch', SHARE / 'launch'),
        *installed('environment', SHARE / 'environment'),
        *installed('records', SHARE / 'records'),
        # `ros2 run` and launch look in lib/<package>, where only colcon puts the console script; names such as
        # identifier are too general for the user's PATH
        *installed('scripts', Path('lib', NAME)),
    ],
    install_requires=[
        'argcomplete>=3.1',
        'filterpy>=1.4.5',
        'matplotlib>=3.6',
        'numpy>=1.26',
        'PyYAML>=6.0',
        'rich>=13.0',
        # bags that were cut off, and recordings on their way to the disk, need parts of it that may change with a
        # version: see formats/bags.py, formats/mcap_checksums.py and formats/output_bag.py
        'rosbags>=0.11.9,<0.12',
        'scipy>=1.11',
    ],
    extras_require={
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'fast': ['numba>=0.59'],
        'cluster': ['distributed'],
        'benchmark': ['scikit-learn'],
        'benchmark-networks': ['torch>=2.3'],
        'docs': ['furo>=2024.1', 'latex2mathml>=3.77', 'myst-parser>=2.0', 'sphinx>=7.0', 'sphinx-copybutton>=0.5'],
        'page': ['fastapi>=0.109.1', 'nicegui>=3.0,<4', 'uvicorn>=0.22'],
        # each reads one format of data acquisition: .mat of version 7.3 and .h5, .tdms, .xlsx, .parquet
        'tank': TANK,
        # PX4 and ArduPilot logs
        'logs': ['pymavlink', 'pyulog'],
        'test': [
            'hypothesis',
            'mypy',
            'pytest>=7.4',
            'pytest-timeout',
            'pytest-xdist>=3.8',
            'ruff>=0.17,<0.18',
            'setuptools>=70.1',  # builds wheels by itself
            *TANK,
        ],
    },
    entry_points={
        'console_scripts': ['swath-sysid = swath_sysid.start:command_line'],
    },
)
