"""The mounting of a sensor that transforms (TF) may still state while its first samples wait."""

from dataclasses import dataclass, field

from swath_sysid.attitude.motion.attitude import FrameTree, in_degrees, mounting_in


@dataclass
class AwaitedMounting:
    """From transforms and the ``frame_id`` of the messages; samples wait for it so many seconds at most."""

    frame: str  #: Of the sensor, as of an `Installation`.
    craft: str  #: The frame of the craft's axes.
    wait: float  #: s.
    sensor: str | None = None  #: None: no sample has come.
    mounting: tuple[float, float, float] | None = None  #: rad; None: not stated yet.
    _frames: dict = field(default_factory=dict)
    _until: float = 0.0

    def hear(self, tree: FrameTree) -> bool:
        """Take transforms; whether the mounting is now another one."""
        self._frames |= tree
        return self._is_new()

    def see(self, frame_id: str, now: float) -> bool:
        """Take the oldest sample that waits, at s of a steady clock; whether the mounting is now another one."""
        if self.sensor is None:
            self._until = now + self.wait
            self.sensor = frame_id.lstrip('/')
            return self._is_new()
        return False

    def is_over(self, now: float) -> bool:
        """Whether samples wait no longer."""
        return self.mounting is not None or now >= self._until

    def _is_new(self) -> bool:
        found = None if self.sensor is None else mounting_in(self._frames, self.sensor, self.craft, self.frame)
        is_new = found is not None and found != self.mounting
        self.mounting = found if is_new else self.mounting
        return is_new

    @property
    def described(self) -> str:
        """What was found, or what is done without, for people."""
        sensor = self.sensor or '(a message without a frame_id)'
        if self.mounting is not None:
            angles = ', '.join(f'{angle:g}' for angle in in_degrees(self.mounting, 2))
            return f'the sensor {sensor} is mounted in {self.craft} at {angles} deg (roll, pitch, yaw)'
        return (
            f"the mounting of the sensor {sensor} in {self.craft} is not stated, so its axes are taken for the craft's"
        )
