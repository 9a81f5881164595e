"""What to do about every reason that is counted in /diagnostics."""

from swath_sysid.attitude.motion import intake, stamps
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.pipeline import health

#: Every reason that is counted in /diagnostics, and what to do about it.
REASON_ADVICE = {
    stamps.DUPLICATE: 'samples with the stamp of one before were left out: if many, have the driver stamp its messages',
    stamps.OUT_OF_ORDER: 'late samples were left out: check the transport, and look for a second publisher',
    stamps.STRAY: 'single samples with a stamp far away were left out: check what stamps them',
    stamps.JUMPED_BACK: 'the clock was set back (a bag that looped?): the window and the state of motion '
    'were restarted, hull and sea are kept',
    stamps.GAP: 'samples are missing: check the load of the machine and of the network',
    stamps.LONG_GAP: 'the sensor was silent for long and came back: check its driver and cable',
    stamps.RATE_CHANGED: 'the sample rate changed, and the new one is used: check the driver if this was not intended',
    intake.NOT_FINITE: 'NaN or infinite values were left out: check the driver',
    intake.ABSURD: 'values that no craft reaches were left out: check that rates are rad/s and accelerations m/s^2',
    intake.BAD_QUATERNION: 'invalid quaternions were left out, rates were used: if the sensor has no orientation, let '
    'the driver set orientation_covariance[0] to -1',
    intake.NO_ORIENTATION: 'the sensor gives no orientation, rates alone are used',
    intake.NO_RATES: 'the sensor gives no rates, forecasts are less certain, most of all in the first seconds: let the '
    'driver publish angular_velocity, if the sensor has it',
    intake.UNKNOWN_COVARIANCE: 'the sensor does not report its noise, which is therefore measured',
    intake.ABSURD_COVARIANCE: 'covariances of more than half a turn, or 35 rad/s, were taken as unknown: let the '
    'driver give them in rad^2 and rad^2/s^2, or all zero where they are unknown',
    intake.NEAR_VERTICAL: 'samples with pitch beyond 80 deg were left out, where roll and yaw cannot be distinguished: '
    'if there are more and more, the sensor stands on end: set mounting_deg to [0, 90, 0] or [0, -90, 0]',
    intake.EMPTY: 'messages with nothing usable in them were left out: check the driver',
    **{
        f'outlier-{axis}': 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance'
        for axis in AXES
    },
    **{
        f'gate-restarted-{axis}': 'the sensor contradicted the filter until the filter was restarted: identify again '
        'if this repeats'
        for axis in AXES
    },
    health.SEVERAL_PUBLISHERS: 'more than one node publishes the IMU topic: stop one, or remap them apart',
    health.QOS_MISMATCH: 'a publisher and a subscription have incompatible QoS and do not connect: compare both with '
    '`ros2 topic info --verbose`',
    health.SILENT: 'the sensor stopped publishing: check its driver and cable',
    health.BAD_MODEL: 'a model description could not be read, the model before it stays: publish what `identify` '
    'writes',
    health.BAD_MODEL_FILE: 'the model file cannot be used and is not written over: correct it or move it away, and '
    'start again',
    health.BAD_LOADING: 'a draft or displacement that is not a positive number came in, the one before it stays: check '
    'what publishes it',
    health.LOADING_ADVICE: 'the draft is outside the range of its model: see the log, and add trials at this draft',
    health.BAD_WINDOW: 'a motion window could not be read: publish what imu_buffer publishes',
    health.PASSED_OVER: 'samples had waited in a queue: the filters used them, forecasts were issued from newer ones '
    'only; check the load of the machine',
    health.LATE_FIT: 'a fit of the waves came later than 0.5 s after its samples, and was used only from then on: '
    'forecasts differ a little from those of play-through; check the load of the machine if that matters',
    health.NOT_FITTED: 'the waves could not be fitted, forecasts go on with the fit before, or with none: see the log',
    health.IDENTIFICATION_WORKER_DIED: 'the process that identifies died and was started again: look for a lack of '
    'memory',
    health.WAVE_WORKER_DIED: 'the process that fits the waves died and was started again: look for a lack of memory',
    health.NOT_SAVED: 'the model file could not be written: check model_path, its folder and its permissions',
    health.FRAME_CHANGED: 'the frame_id of the messages changed: two sensors may share the topic, or the driver was '
    'reconfigured; give each sensor a topic of its own, and check whether the mounting is still right',
}


#: What to do about a state that is reported but not counted.
STREAM_ADVICE = {
    health.NO_MESSAGE_YET: 'check that the sensor publishes there, or remap the topic',
    health.QUEUED: 'they wait in a queue, check the load of the machine, the driver and the network; or a clock was '
    'set',
    health.SHORT_OF_MEMORY: 'samples come faster than max_rate_hz, which makes the window shorter: raise max_rate_hz',
    health.CLOCK_STANDS: 'the replay is paused, or nothing publishes /clock',
    health.CLOCKS_DIFFER: 'synchronise the clocks, or replay with --clock and set use_sim_time',
}

ADVICE = {**REASON_ADVICE, **STREAM_ADVICE}


def reasons_table() -> str:
    """Every reason that is counted and what to do about it, as a Markdown table."""
    rows = [f'| `{reason}` | {advice.replace("|", "/")} |' for reason, advice in sorted(REASON_ADVICE.items())]
    return '\n'.join(['| counted as | what it means, and what to do |', '|---|---|', *rows]) + '\n'
