"""What a node tells about itself: counts by reason, and what to do about each. Without ROS."""
from collections import deque
from dataclasses import dataclass, field
from math import isnan

from swath_sysid.attitude.motion import intake, stamps
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction import forecaster

OK, WARN, ERROR = range(3)
"""Levels of diagnostic_msgs/DiagnosticStatus."""

SEVERAL_PUBLISHERS = 'several-publishers'
QOS_MISMATCH = 'qos-mismatch'
SILENT = 'sensor-silent'
BAD_MODEL = 'bad-model'
BAD_LOADING = 'bad-loading'
LOADING_ADVICE = 'loading-advice'
BAD_WINDOW = 'bad-window'
BAD_MODEL_FILE = 'bad-model-file'
PASSED_OVER = 'passed-over'
LATE_FIT = 'late-fit'
NOT_FITTED = 'waves-not-fitted'
IDENTIFICATION_WORKER_DIED = 'identification-worker-died'
WAVE_WORKER_DIED = 'wave-worker-died'
NOT_SAVED = 'model-not-saved'
FRAME_CHANGED = 'frame-id-changed'

NODE_REASONS = {
    SEVERAL_PUBLISHERS: 'more than one node publishes the IMU topic: stop one, or remap them apart',
    QOS_MISMATCH: 'a publisher and a subscription have incompatible QoS and do not connect: compare both with '
    '`ros2 topic info --verbose`',
    SILENT: 'the sensor stopped publishing: check its driver and cable',
    BAD_MODEL: 'a model description could not be read, the model before it stays: publish what `identify` writes',
    BAD_MODEL_FILE: 'the model file cannot be used and is not written over: correct it or move it away, and start '
    'again',
    BAD_LOADING: 'a draft or displacement that is no positive number came in, the one before it stays: look at what '
    'publishes it',
    LOADING_ADVICE: 'the craft floats where its model was not identified: see the log, and add trials at this draft',
    BAD_WINDOW: 'a motion window could not be read: publish what imu_buffer publishes',
    PASSED_OVER: 'samples had waited in a queue: the filters used them, forecasts were issued from newer ones only; '
    'look at the load of the machine',
    LATE_FIT: 'a fit of the waves came later than 0.5 s after its samples, and was used from then on: forecasts differ '
    'a little from those of play-through; look at the load of the machine if that matters',
    NOT_FITTED: 'the waves could not be fitted, forecasts go on with the fit before, or with none: see the log',
    IDENTIFICATION_WORKER_DIED: 'the process that identifies died and was started again: look for a lack of memory',
    WAVE_WORKER_DIED: 'the process that fits the waves died and was started again: look for a lack of memory',
    NOT_SAVED: 'the model file could not be written: check model_path or manoeuvre_model_path, its folder and its '
    'permissions',
    FRAME_CHANGED: 'the frame_id of the messages changed: two sensors may share the topic, or the driver was set anew; '
    'give each sensor a topic of its own, and look whether the mounting is still right',
}

REASON_ADVICE = {
    stamps.DUPLICATE: 'samples with the stamp of one before were left out: if many, let the driver stamp its messages',
    stamps.OUT_OF_ORDER: 'late samples were left out: look at the transport, or for a second publisher',
    stamps.STRAY: 'single samples with a stamp far away were left out: look at what stamps them',
    stamps.JUMPED_BACK: 'the clock was set back (a bag that looped?): the window and the state of motion began anew, '
    'hull and sea are kept',
    stamps.GAP: 'samples are missing: look at the load of the machine and of the network',
    stamps.LONG_GAP: 'the sensor was silent for long and came back: look at its driver and cable',
    stamps.RATE_CHANGED: 'the sample rate changed and is followed: look at the driver if that was not meant',
    intake.NOT_FINITE: 'NaN or infinite values were left out: look at the driver',
    intake.ABSURD: 'values that no craft reaches were left out: check that rates are rad/s and accelerations m/s^2',
    intake.BAD_QUATERNION: 'invalid quaternions were left out, rates were used: if the sensor has no '
    'orientation, let the driver set orientation_covariance[0] to -1',
    intake.NO_ORIENTATION: 'the sensor gives no orientation, rates alone are used',
    intake.UNKNOWN_COVARIANCE: 'the sensor does not tell its noise, which is therefore measured',
    intake.ABSURD_COVARIANCE: 'covariances of more than half a turn, or 35 rad/s, were taken as unknown: let the '
    'driver give them in rad^2 and rad^2/s^2, or all zero where it does not know them',
    intake.NEAR_VERTICAL: 'samples with pitch beyond 80 deg were left out, where roll and yaw cannot be told apart: if '
    'there are more and more, the sensor stands on end: set mounting_deg to [0, 90, 0] or [0, -90, 0]',
    intake.EMPTY: 'messages with nothing usable in them were left out: look at the driver',
    **{reason: 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance'
       for reason in forecaster.REJECTED.values()},
    **{reason: 'the sensor contradicted the filter until that began anew: identify again if this repeats'
       for reason in forecaster.RESTARTED.values()},
    **NODE_REASONS,
}
"""Every reason that is counted in /diagnostics, and what to do about it."""

HARMLESS = {intake.NO_ORIENTATION, intake.UNKNOWN_COVARIANCE, LATE_FIT}

LONGEST_SILENCE = 1.0
STARTING_TIME = 5.0
"""s; a sensor that has never been heard is an error after so long: discovery takes up to three."""

LARGEST_STAMP_AGE = 1.0
"""s between the stamp of a message and its arrival; more means that clocks differ, or a replay without /clock."""

REMEMBERED_AGES = 60
"""Reports; stamps that are older than the best of these by more than `LARGEST_STAMP_AGE` have waited in a queue."""


@dataclass(frozen=True)
class Report:
    """One status, as diagnostic_msgs/DiagnosticStatus has it.

    Attributes
    ----------
    name : str
    level : int
        `OK`, `WARN` or `ERROR`.
    message : str
        What is wrong and what to do; else what goes on.
    values : dict of str to object
    """

    name: str
    level: int
    message: str
    values: dict = field(default_factory=dict)

    def told_by(self, node):
        """As /diagnostics has it.

        Parameters
        ----------
        node : str
            Its full name without the first slash.

        Returns
        -------
        level : int
        name, message : str
        values : dict of str to str
        """
        texts = {key: f'{value:.6g}' if isinstance(value, float) else str(value) for key, value in self.values.items()}
        return self.level, f'{node}: {self.name}', self.message, texts


class Reasons:
    """Counts by reason, and which of them still hold.

    Parameters
    ----------
    reasons : sequence of str
        Of `NODE_REASONS`.
    """

    def __init__(self, reasons):
        self.counts = dict.fromkeys(reasons, 0)
        self._holding = {}

    def note(self, reason, about=None, sentence=''):
        """Count one more of a reason; one about something, in a sentence of its own, holds until that is settled."""
        self.counts[reason] += 1
        if about is not None:
            advice = REASON_ADVICE[reason]
            self._holding[about] = f'{reason}: {sentence}; {advice}' if sentence else f'{reason}: {advice}'

    def settle(self, about):
        """What was noted about something is over."""
        self._holding.pop(about, None)

    @property
    def holding(self):
        """What to do about all that still holds; empty where nothing does."""
        return '; '.join(dict.fromkeys(self._holding.values()))


class StreamHealth(Reasons):
    """How the messages of one topic come in; time is what the caller says.

    Parameters
    ----------
    topic : str
        Its name for people.
    """

    def __init__(self, topic):
        super().__init__((SEVERAL_PUBLISHERS, QOS_MISMATCH, SILENT, FRAME_CHANGED))
        self.topic = topic
        self._ages = deque(maxlen=REMEMBERED_AGES)
        self.received = 0
        self._stamp_ns = None
        self._arrival = None
        self._spent = self._longest = 0.0
        self._since_report = 0
        self._silent = self._several = False
        self._frame_id = None
        self._reported_counts = {}
        self._begun = self._reported_at = None

    def note_message(self, stamp_ns, begun, ended):
        """A message was handled between two readings of the same clock, s."""
        spent = ended - begun
        self.received += 1
        self._since_report += 1
        self._stamp_ns, self._arrival = stamp_ns, begun
        self._spent += spent
        if spent > self._longest:
            self._longest = spent

    def note_frame_id(self, frame_id):
        """A message was in this frame."""
        if frame_id != self._frame_id:
            if self._frame_id is not None:
                self.note(FRAME_CHANGED)
            self._frame_id = frame_id

    def note_publishers(self, count):
        """So many nodes publish the topic now."""
        if count > 1 and not self._several:
            self.note(SEVERAL_PUBLISHERS)
        self._several = count > 1

    def report(self, now, now_ns, core_counts, used, interval=None):
        """What to tell now, and begin a new period.

        Parameters
        ----------
        now : float
            Of the clock of `note_message`, s.
        now_ns : int
            Of the clock that stamps are compared with.
        core_counts : dict of str to int
            By the node's core, since its start.
        used : int
            Messages the core used.
        interval : float, optional
            Usual time between messages, s, once it is known.

        Returns
        -------
        Report
        """
        if self._begun is None:
            self._begun = now
        silence = now - (self._begun if self._arrival is None else self._arrival)
        is_silent = self.received > 0 and silence > max(LONGEST_SILENCE, 5.0 * (interval or 0.0))
        if is_silent and not self._silent:
            self.note(SILENT)
        self._silent = is_silent
        age = None
        if self._arrival is not None:
            age = (now_ns - self._stamp_ns) * 1e-9 - silence
            self._ages.append(age)
        counts = {**core_counts, **self.counts}
        fresh = {
            reason: count - self._reported_counts.get(reason, 0)
            for reason, count in counts.items()
            if count > self._reported_counts.get(reason, 0) and reason not in HARMLESS
        }
        level, message = self._verdict(silence, age, fresh)
        period = None if self._reported_at is None else now - self._reported_at
        values = {
            'rate_hz': self._since_report / period if period else 0.0,
            'received': self.received,
            'used': used,
            **counts,
            'stamp_age_s': 'unknown' if age is None else age,
            'processing_ms_mean': 1e3 * self._spent / max(self._since_report, 1),
            'processing_ms_max': 1e3 * self._longest,
        }
        self._reported_counts, self._reported_at = counts, now
        self._spent = self._longest = 0.0
        self._since_report = 0
        return Report('imu', level, message, values)

    def _verdict(self, silence, age, fresh):
        if self.received == 0:
            level = ERROR if silence > STARTING_TIME else WARN
            return level, f'no message on {self.topic} yet: check that the sensor publishes there, or remap the topic'
        if self._silent:
            return ERROR, f'no message on {self.topic} for {silence:.1f} s: {REASON_ADVICE[SILENT]}'
        if self._several:
            return WARN, REASON_ADVICE[SEVERAL_PUBLISHERS]
        if fresh:
            reason = max(fresh, key=fresh.get)
            return WARN, f'{reason} ({fresh[reason]} times lately): {REASON_ADVICE[reason]}'
        if self.holding:
            return WARN, self.holding
        late = age - min(self._ages)
        if late > LARGEST_STAMP_AGE:
            return WARN, (
                f'messages come {late:.1f} s later than they can: they wait in a queue, look at the load of the '
                f'machine, the driver and the network; or a clock was set'
            )
        if abs(age) > LARGEST_STAMP_AGE:
            return WARN, (
                f'stamps differ from the clock by {age:.1f} s: synchronise the clocks, or replay with --clock and set '
                f'use_sim_time'
            )
        return OK, f'receiving {self.topic}'


class BufferHealth(StreamHealth):
    """How imu_buffer does.

    Parameters
    ----------
    topic : str
    window : MotionWindow
    """

    def __init__(self, topic, window):
        super().__init__(topic)
        self.decays = 0
        self._window = window

    def reports(self, now, now_ns):
        """The statuses of now; see `StreamHealth.report`."""
        window = self._window
        level, message = OK, window.described
        if window.is_short_of_memory:
            level = WARN
            message += ': samples come faster than max_rate_hz, which makes the window shorter: raise max_rate_hz'
        values = {
            'samples': window.size, 'duration_s': window.duration, 'recording': window.recording,
            'decays_noticed': self.decays,
        }
        return [
            self.report(now, now_ns, window.counts, window.samples, window.interval),
            Report('window', level, message, values),
        ]


class PredictorHealth(StreamHealth):
    """How predictor does.

    Parameters
    ----------
    topic : str
    pipeline : ForecastPipeline
    """

    def __init__(self, topic, pipeline):
        super().__init__(topic)
        for reason in (BAD_MODEL, BAD_LOADING, LOADING_ADVICE, PASSED_OVER, LATE_FIT, NOT_FITTED, WAVE_WORKER_DIED):
            self.counts[reason] = 0
        self._pipeline = pipeline
        self._model_arrival = None
        self._refusal = ''

    def note_model(self, now):
        """A model came, s of the clock of `note_message`."""
        self._model_arrival = now
        self._refusal = ''

    def note_refused_model(self, sentence):
        """A model came that cannot be used, for this reason; it is told until a good one comes."""
        self.note(BAD_MODEL)
        self._refusal = sentence

    def reports(self, now, now_ns):
        """The statuses of now; see `StreamHealth.report`."""
        state = self._pipeline.diagnostics()
        interval = None if isnan(state.sample_interval) else state.sample_interval
        level, message = OK, 'forecasting with the identified model'
        refused = [f'{self._refusal}; the model before it stays'] if self._refusal else []
        if refused or state.advice:
            level, message = WARN, '; '.join([*refused, *(advice.message for advice in state.advice)])
        values = {
            **{f'has_model_{axis}': state.has_model[axis] for axis in AXES},
            'model_age_s': 'no model' if self._model_arrival is None else now - self._model_arrival,
            'refused_model': self._refusal,
            'has_waves': state.has_waves,
            **{f'nis_ratio_{axis}': ratio for axis, ratio in state.nis_ratio.items()},
        }
        for a, axis in enumerate(AXES):
            for number, lead in enumerate(self._pipeline.settings.forecaster.leads):
                values[f'nrmse_{axis}_{lead}s'] = float(state.nrmse[a, number])
                values[f'coverage90_{axis}_{lead}s'] = float(state.coverage[a, number])
                names = tuple(forecaster.CANDIDATES)
                values[f'speaking_{axis}_{lead}s'] = names[int(state.weights[:, a, number].argmax())]
                for k, candidate in enumerate(names):
                    values[f'nrmse_{axis}_{lead}s_{candidate}'] = float(state.candidate_nrmse[k, a, number])
        return [
            self.report(now, now_ns, self._pipeline.counts, self._pipeline.used, interval),
            Report('forecast', level, message, values),
            installation_report(self._pipeline.installation),
        ]


def installation_report(check):
    """Whether the sensor sits as was said.

    Parameters
    ----------
    check : InstallationCheck

    Returns
    -------
    Report
    """
    contradictions = check.judge()
    level, message = OK, check.described
    if contradictions:
        level, message = WARN, '; '.join(each.message for each in contradictions)
    codes = ' '.join(dict.fromkeys(each.code for each in contradictions))
    return Report('installation', level, message, {'contradictions': codes or 'none', 'judgements': check.judgements})


class IdentifierHealth(Reasons):
    """How identification goes."""

    def __init__(self):
        super().__init__((BAD_WINDOW, IDENTIFICATION_WORKER_DIED, NOT_SAVED, BAD_MODEL_FILE, QOS_MISMATCH))
        self.progress = 0.0
        self.refits = self.published = 0
        self.last = 'none yet'
        self._reported_counts = dict(self.counts)

    def begin(self):
        """A refit begins."""
        self.progress = 0.0
        self.refits += 1

    def end(self, published, message):
        """It has ended: whether a model was published, and one line about it."""
        self.published += published
        self.last = message

    def report(self, models, steps_back, is_busy):
        """What to tell now, and begin a new period; see `StreamHealth.report`."""
        fresh = [reason for reason, count in self.counts.items() if count > self._reported_counts[reason]]
        self._reported_counts = dict(self.counts)
        doing = f'identifying, {100.0 * self.progress:.0f} % done' if is_busy else f'ready; last: {self.last}'
        level, message = OK, doing
        if fresh or self.holding:
            level, message = WARN, self.holding or f'{fresh[0]}: {REASON_ADVICE[fresh[0]]}'
        values = {
            'state': 'identifying' if is_busy else 'ready', 'progress': self.progress, 'models': models,
            'rollbacks_kept': steps_back, 'refits': self.refits, 'published': self.published, 'last_verdict': self.last,
            **self.counts,
        }
        return Report('identification', level, message, values)


class PlayedHealth:
    """What the three nodes would tell in a play-through, where the stamps are the clock.

    Nothing takes time there: processing times are zero.

    Parameters
    ----------
    pipeline : PlayThrough
    periods : tuple of 3 floats
        s between the diagnostics of imu_buffer, identifier and predictor.
    """

    def __init__(self, pipeline, periods):
        self._pipeline = pipeline
        self._buffer = BufferHealth('imu/data', pipeline.window)
        self._identifier = IdentifierHealth()
        self._predictor = PredictorHealth('imu/data', pipeline.forecasts)
        nodes = 'imu_buffer', 'identifier', 'predictor'
        self._periods_ns = {node: round(1e9 * period) for node, period in zip(nodes, periods, strict=True)}
        self._due_ns = {}
        self._begun_ns = self._now_ns = self._next_ns = None

    def follow(self, played):
        """Take notice of one step.

        Parameters
        ----------
        played : Played

        Returns
        -------
        list of list
            Where diagnostics are due: those of each node, every one as `Report.told_by` gives it.
        """
        told, stamp_ns = [], played.stamp_ns
        # a stray stamp must not be taken for the time
        if played.step.used or self._now_ns is None:
            if self._now_ns is None or not self._now_ns <= stamp_ns < self._next_ns:
                told = self._reports_at(stamp_ns)
            self._now_ns = stamp_ns
        now = (self._now_ns - self._begun_ns) * 1e-9
        self._buffer.note_message(stamp_ns, now, now)
        self._predictor.note_message(stamp_ns, now, now)
        if played.models is not None:
            self._predictor.note_model(now)
        if played.window is not None:
            self._buffer.decays += 1
        while self._identifier.refits < self._pipeline.refits:
            self._identifier.begin()
        if played.verdict is not None:
            self._identifier.end(played.models is not None, played.verdict)
        return told

    def _reports_at(self, stamp_ns):
        """What is due at a stamp, which begins time anew where it lies before the last."""
        if self._now_ns is None or stamp_ns < self._now_ns:
            self._begun_ns = stamp_ns
            self._due_ns = {node: stamp_ns + period for node, period in self._periods_ns.items()}
        told = []
        for node, due_ns in self._due_ns.items():
            if stamp_ns >= due_ns:
                following = due_ns + self._periods_ns[node]
                self._due_ns[node] = following if following > stamp_ns else stamp_ns + self._periods_ns[node]
                told.append([report.told_by(node) for report in self._reports(node, stamp_ns)])
        self._next_ns = min(self._due_ns.values())
        return told

    def _reports(self, node, now_ns):
        now = (now_ns - self._begun_ns) * 1e-9
        if node == 'imu_buffer':
            return self._buffer.reports(now, now_ns)
        if node == 'predictor':
            return self._predictor.reports(now, now_ns)
        refitter = self._pipeline.refitter
        return [self._identifier.report(refitter.described, refitter.steps_back, self._pipeline.is_refitting)]


def reasons_table():
    """Every reason that is counted and what to do about it, as a Markdown table."""
    rows = [f'| `{reason}` | {advice.replace("|", "/")} |' for reason, advice in sorted(REASON_ADVICE.items())]
    return '\n'.join(['| counted as | what it means, and what to do |', '|---|---|', *rows]) + '\n'
