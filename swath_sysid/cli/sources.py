"""Arguments and reading of records, shared by the verbs that take them."""

import math

from swath_sysid import __version__
from swath_sysid.errors import InputError
from swath_sysid.files.reading import read_trial, source_hash
from swath_sysid.motion.trial import AXES


def add_source_arguments(parser, many=True):
    """The records, the axis, and how to read them."""
    parser.add_argument(
        'trials' if many else 'trial', metavar='TRIAL', nargs='+' if many else None,
        help='CSV file, rosbag2 bag (folder, .mcap or .db3) or MTi text export',
    )  # fmt: skip
    parser.add_argument('--axis', help='roll or pitch (default: the one that moves more)')
    parser.add_argument('--topic', help='IMU topic, for bags that hold several')
    parser.add_argument(
        '--frame',
        choices=('flu', 'frd'),
        help='axes of the sensor: x forward, y port, z up, or x forward, y starboard, z down',
    )
    parser.add_argument(
        '--start', type=finite, metavar='S', help="begin of the decay, in the record's time (default: found)"
    )
    parser.add_argument('--end', type=finite, metavar='S', help='end of the decay (default: found)')


def finite(text):
    """A number for argparse that is neither NaN nor infinite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f'{text} is not finite')
    return value


def read_trials(paths, arguments):
    """Read the trials of the command line."""
    return [read_trial(path, topic=arguments.topic, frame=arguments.frame) for path in paths]


def chosen_axis(trials, asked):
    """The axis asked for, or the one that moves more in the first trial."""
    if asked is not None:
        return asked
    return max(trials[0].axes or AXES[:1], key=lambda axis: _excursion(trials[0].axis(axis)))


def _excursion(motion):
    values = motion.rate if motion.angle is None else motion.angle
    return float(values.max() - values.min())


def motions_of(trials, axis):
    """The motion about one axis of each trial.

    Raises
    ------
    InputError
        A trial appears twice: it would count twice in a joint fit.
    """
    sources = [t.source for t in trials]
    twice = {s for s in sources if sources.count(s) > 1}
    if twice:
        raise InputError(f'{sorted(twice)[0]} is given twice: name each trial once')
    return [trial.axis(axis) for trial in trials]


def provenance_of(paths):
    """Sources with their hashes, and the software version."""
    return {
        'software': f'swath_sysid {__version__}',
        'sources': [{'file': str(path), 'sha256': source_hash(path)} for path in paths],
    }
