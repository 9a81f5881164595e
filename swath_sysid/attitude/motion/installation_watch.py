"""Continuous check of a running sensor's installation by its own data."""

from math import ceil
from operator import itemgetter

import numpy as np

from swath_sysid.attitude.motion import sensor_checks
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.intake import FROZEN, NANOSECOND, ConvertedReading, CraftSample
from swath_sysid.attitude.motion.sensor_checks import (
    GRAVITY_CODES,
    PARTS,
    RATE_CODES,
    TILT_CODES,
    Contradiction,
    SensorFindings,
)
from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.common.conditions import CONDITIONS
from swath_sysid.common.row_buffer import RowBuffer

CONFIRMATIONS = 2  #: Successive judgements that must agree on a contradiction, or on its end.

_values_of = itemgetter(*[CraftSample._fields.index(name) for names in PARTS for name in names])


class InstallationCheck:
    """The contradictions of a running sensor, each until it no longer shows."""

    def __init__(self, installation: Installation) -> None:
        self._installation = installation
        self._rows = RowBuffer(ceil(sensor_checks.WINDOW * WindowSettings.max_rate), 10)
        self._origin_ns = self._newest_ns = self._judged_ns = 0
        self._votes: dict[tuple[str, str | None], tuple[int, Contradiction]] = {}
        self._decided: frozenset[str] = frozenset()
        self._repeated: tuple[Contradiction, ...] = ()
        self.contradictions: tuple[Contradiction, ...] = ()
        self.judgements = 0
        self._was_level = False

    def add(self, converted: ConvertedReading) -> None:
        """Add one message, as the intake has converted it."""
        sample, reasons = converted
        self._repeated = (Contradiction(FROZEN, CONDITIONS[FROZEN].cure),) if FROZEN in reasons else ()
        if sample is None:
            return
        stamp_ns = sample.stamp_ns
        if not len(self._rows) or not 0 <= stamp_ns - self._newest_ns <= sensor_checks.FROZEN * 1e9:
            # after a silence, and after a clock that was set back
            self._rows.clear()
            self._origin_ns = self._judged_ns = stamp_ns
        self._newest_ns = stamp_ns
        self._rows.append(((stamp_ns - self._origin_ns) * NANOSECOND, *_values_of(sample)))

    @property
    def described(self) -> str:
        """What could be judged lately, in words."""
        if RATE_CODES <= self._decided:
            also = 'gravity and' if GRAVITY_CODES <= self._decided else 'the'
            return f'{also} rates agree with the attitude'
        if GRAVITY_CODES <= self._decided:
            return 'gravity agrees with the attitude; the rates show when the craft moves'
        return 'not judged yet: it takes 10 s of samples, with orientation or accelerations'

    def judge(self) -> tuple[Contradiction, ...]:
        """The contradictions now, judged anew after `sensor_checks.FROZEN`."""
        if self._newest_ns - self._judged_ns >= sensor_checks.FROZEN * 1e9:
            self._judged_ns = self._newest_ns
            judgement = self._judgement()
            self._weigh(judgement)
            self._decided = judgement.decided
            self.judgements += bool(judgement.decided)
        return self._repeated + self.contradictions

    def _judgement(self) -> SensorFindings:
        """Of the last `WINDOW`, or of `WINDOW_BINS`, if that is longer."""
        rows = self._rows.last()
        interval = float(np.median(np.diff(rows[:, 0])))
        in_time = int(np.count_nonzero(rows[:, 0] > rows[-1, 0] - sensor_checks.WINDOW))
        rows = rows[-max(in_time, sensor_checks.WINDOW_BINS * sensor_checks.samples_a_bin(interval)) :]
        # the mean of less is not accepted as gravity
        if rows[-1, 0] - rows[0, 0] < 2.0 * sensor_checks.FROZEN:
            return SensorFindings()
        parts = sensor_checks.binned(rows[:, 0], np.split(rows[:, 1:], 3, axis=1), interval)
        return sensor_checks.judge(*parts, installation=self._installation, interval=interval)

    def _weigh(self, judgement: SensorFindings) -> None:
        """Report or drop contradictions when `CONFIRMATIONS` judgements agree."""
        found = {(each.code, each.axis): each for each in judgement.contradictions}
        # a craft that has once floated level on its sensor is held, or has a list
        self._was_level |= bool(judgement.decided & TILT_CODES) and not any(code in TILT_CODES for code, _ in found)
        found = {key: each for key, each in found.items() if not (self._was_level and each.code in TILT_CODES)}
        for key, each in found.items():
            votes = self._votes.get(key, (0, None))[0]
            self._votes[key] = min(votes + 1, CONFIRMATIONS), each
        for key, (votes, each) in list(self._votes.items()):
            if key not in found and each.code in judgement.decided:
                self._votes[key] = votes - 1, each
                if votes <= 1:
                    del self._votes[key]
        held = {(each.code, each.axis) for each in self.contradictions}
        self.contradictions = tuple(
            each for key, (votes, each) in self._votes.items() if votes >= CONFIRMATIONS or key in held
        )
