"""What the command line adds to the advice of the core: its flags, by the code of the advice."""

FLAGS = {
    'late-start': '--start',
    'disturbed-tail': '--end',
    'several-decays': '--start and --end',
    'forced-motion': '--at-sea, or --start and --end',
    'no-decay': '--start and --end',
    'poor-fit': '--start and --end',
    'sea-not-fitted': '--start and --end',
    'taken-as-commands': '--thrust-input force',
    'thrust-input-differs': '--thrust-input',
    'several-topics': '--odometry-topic, --imu-topic, --port-topic, --starboard-topic',
    'no-inertia': '--inertia AXIS=KG_M2',
    'no-function-name': '--output',
    'added-mass-diverges': '--fix m=KG',
    'output-over-input': '--output',
    'no-process': '--jobs',
    'no-distributed': '--scheduler',
    'store-in-use': '--output',
    'worker-killed': '--jobs',
    'not-a-manifest': '--new FOLDER',
    'manifest-exists': '--output',
    'lever-assumed': '--lever',
    'length-assumed': '--length',
    'scale-not-given': '--mass or --thrust-per-command',
    'surge-inertia-assumed': '--thrust-per-command',
    'mass-not-given': '--mass',
    'inertia-includes-added': '--inertia',
    'sway-scale-assumed': '--fix Yv_dot=KG',
    'lag-like-surge': '--fix lag=S',
    'current-by-run': '--current shared',
    'times-of-trial': '--duration, --rate, --hold',
    'thrust-gaps': '--gap-means-zero',
}


def worded(code: str, message: str) -> str:
    """A neutral sentence of the core with the flags, by its code, that do what it advises."""
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message
