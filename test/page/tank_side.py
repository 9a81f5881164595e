"""A craft in a tank for the tests of the page: what the nodes would report of it, by their own cores, without ROS."""

import numpy as np
from imu_stream import EPOCH_NS, reading, released

from swath_sysid.attitude.identification.refit import RefitSettings, Refitter, refit
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import Intake
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.attitude.motion.window import MotionWindow, WindowSettings
from swath_sysid.page.bring_up import BringUp
from swath_sysid.page.live_record import LiveRecord
from swath_sysid.pipeline.forecast_health import installation_report
from swath_sysid.pipeline.health import BufferHealth, IdentifierHealth, Report, StreamHealth

#: s between the diagnostics, and between looks at the guide
REPORT_S = 0.5


class TankSide:
    """Sensor, nodes and the record of the page, whose guide is to identify one axis."""

    def __init__(self, axis='pitch', installation=None, rate=25.0, auto_identify=True):
        self.rate = rate
        installation = installation or Installation()
        self.clock = self._next_report = 0.0
        self.record, self.guide = LiveRecord(), BringUp(axis)
        self.guidances = []
        # of the equation by which `imu_stream` makes its releases
        self.refitter = Refitter(RefitSettings(identification=IdentificationSettings('linear')))
        self.auto_identify = auto_identify
        self.steps_back = self.steps_forward = 0
        self._intake, self._check = Intake(installation, StampSettings()), InstallationCheck(installation)
        self._window = MotionWindow(WindowSettings(installation=installation))
        self._stream = StreamHealth('/imu/data')
        self._buffer, self._identifier = BufferHealth('/imu/data', self._window), IdentifierHealth()
        self._rng = np.random.default_rng(1)
        self.record.install(installation)

    def send(self, duration, motion=lambda t: {}, wrong=lambda each: each):
        """Let the sensor measure a motion for so long: angles and rates by name at times from now."""
        for k in range(round(duration * self.rate)):
            self.clock += 1.0 / self.rate
            now = motion(k / self.rate)
            noisy = {
                name: now.get(name, 0.0) + size * self._rng.normal()
                for name, size in (('roll', 5e-4), ('pitch', 5e-4), ('roll_rate', 3e-3), ('pitch_rate', 3e-3))
            }
            self._take(wrong(reading(self.stamp_ns, **noisy)))
            self._report_when_due()

    def silence(self, duration):
        end = self.clock + duration
        while self.clock < end:
            self.clock += REPORT_S
            self._report_when_due()

    def release(self, amplitude_deg=5.0, axis='pitch', damping=0.08, hold=1.0, duration=25.0, **others):
        def motion(t):
            angle, rate = released(t, 2.0 + hold, np.radians(amplitude_deg), damping=damping, hold=hold)
            return {axis: angle, f'{axis}_rate': rate}

        self.send(duration, motion, **others)

    @property
    def stamp_ns(self):
        return EPOCH_NS + round(self.clock * 1e9)

    @property
    def faults(self):
        found = {}
        for guidance in self.guidances:
            if guidance.fault:
                found.setdefault(guidance.fault, []).append(guidance)
        return found

    def _take(self, each):
        self._check.add(self._intake.take(each))
        finished = self._window.add(each).finished
        for stream in (self._stream, self._buffer):
            stream.note_message(each.stamp_ns, self.stamp_ns, self.clock, self.clock)
        if self.record.is_due(each.stamp_ns, self.clock):
            self.record.add_reading(each)
        if finished is not None and self.auto_identify:
            self.identify(finished.table)

    def identify(self, table=None):
        self._identifier.begin()
        outcome = refit(self.refitter.request(table or self._window.table(), is_asked=table is None))
        is_published = self.refitter.take(outcome)
        self._identifier.end(is_published, outcome.message)
        if is_published:
            self.record.set_models(self.refitter.models)

    def reports(self):
        undone = {'rollbacks_undone': self.steps_forward}
        return {
            'predictor': [
                self._stream.report(self.clock, self.stamp_ns, self._window.counts, self._stream.received),
                installation_report(self._check),
                Report('forecast', 0, 'forecasting'),
            ],
            'imu_buffer': self._buffer.reports(self.clock, self.stamp_ns),
            'identifier': [self._identifier.report(self.refitter.described, self.steps_back, False, undone)],
        }

    def _report_when_due(self):
        if self.clock < self._next_report:
            return
        self._next_report = self.clock + REPORT_S
        for node, reports in self.reports().items():
            for report in reports:
                level, name, message, values = report.status_of(node)
                self.record.add_status(Report(name, level, message, values), self.clock)
        self.guidances.append(self.look())

    def look(self):
        return self.guide.look(self.record.facts(self.guide.axis, self.clock))
