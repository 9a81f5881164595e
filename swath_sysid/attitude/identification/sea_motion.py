"""Motion in waves, its noise, and its spectrum in the bands where it is known."""

from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.attitude.motion.turning_points import split_at_pauses
from swath_sysid.attitude.motion.vertical import vertical_acceleration
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import LOST_SHARE
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import TAPERS, sine_tapers

BAND_RATIO = 1.04  #: Of the frequencies of neighbouring bands, over which spectra are averaged.
ABOVE_NOISE = 4.0  #: A band is used while its spectrum is this many times the noise,
DYNAMIC_RANGE = 1e-5  #: ... and above this part of the peak.
LOWEST_BAND = 0.25  #: ... from this multiple of the peak frequency.
MIN_REACH = 1.3  #: Multiple of the peak frequency up to which the motion must be known.
FASTEST = 0.8  #: ... and below this part of the Nyquist frequency.
LOW_PASS = 2.0  #: Corner over the highest band: there the motion passes whole.

#: Heave must exceed its noise by `ABOVE_NOISE` wherever the angle's spectrum is above this part of its peak.
HEAVE_WANTED = 0.01


@dataclass(frozen=True)
class SeaMotion:
    """A motion in waves on an even grid, its noise and the bands in which it is known."""

    start: float  #: Time of the first sample, s.
    interval: float  #: Between samples, s.
    angle: np.ndarray  #: (N,); about the mean, rad.
    rate: np.ndarray  #: (N,); rad/s.
    mean: float  #: Mean angle, rad; NaN where no angle was measured.
    angle_noise: float  #: One-sided spectral density of the white noise, rad^2 s; infinite where not measured.
    rate_noise: float  #: The same of the rate, (rad/s)^2 s.
    peak: float  #: Frequency at which the angle's spectrum is largest, rad/s.
    lowest: float  #: Lower bound of the bands, rad/s.
    highest: float  #: Upper bound of the bands, rad/s.

    @property
    def duration(self) -> float:
        """s."""
        return self.interval * self.angle.size

    @property
    def slow_share(self) -> float:
        """Of the variance of the angle, what is slower than the bands, as of a heel that changes; zero where that is
        little.
        """
        slow = np.fft.rfftfreq(self.angle.size, self.interval) < self.lowest / (2.0 * np.pi)
        power = np.abs(np.fft.rfft(self.angle)) ** 2
        share = float(power[slow].sum() / power.sum())
        return share if share > LOST_SHARE else 0.0

    def between(self, start: float, end: float) -> 'SeaMotion':
        """The part between two times, s."""
        first, last = (
            int(np.clip(round((each - self.start) / self.interval), 0, self.angle.size)) for each in (start, end)
        )
        part = slice(first, last)
        return replace(self, start=self.start + first * self.interval, angle=self.angle[part], rate=self.rate[part])

    def noise(self, frequency: np.ndarray) -> np.ndarray:
        """Spectral density of the noise in ``angle``, rad^2 s."""
        return 1.0 / (1.0 / self.angle_noise + frequency**2 / self.rate_noise)


@dataclass(frozen=True)
class SeaPart:
    """The spectrum of a part of a motion in bands, one-sided, per rad/s."""

    frequency: np.ndarray  #: (B,); rad/s.
    spectrum: np.ndarray  #: (B,); of the angle, rad^2 s.
    counts: np.ndarray  #: (B,); Independent complex values in each band.
    noise: np.ndarray  #: (B,); of the angle, rad^2 s.
    lines: np.ndarray  #: (F,); frequencies that the tapers average over, band by band, rad/s.
    first_lines: np.ndarray  #: (B,); place of each band's first line.
    rate: float  #: Rms of the angular rate, rad/s.
    heave: np.ndarray | None  #: (B,); Spectrum of the vertical acceleration; None where it does not show the waves.


@dataclass(frozen=True)
class Heave:
    """Vertical acceleration of a craft in waves."""

    time: np.ndarray  #: (N,); s.
    acceleration: np.ndarray  #: (N,); m/s^2; up, without gravity.


def heave_of(trial: Trial) -> Heave | None:
    """Vertical acceleration from a trial's accelerometers, roll and pitch; None where one was not measured."""
    channels = (trial.roll, trial.pitch, trial.accel_x, trial.accel_y, trial.accel_z)
    if any(channel is None for channel in channels):
        return None
    measured = np.array(channels)
    finite = np.all(np.isfinite(measured), axis=0)
    if finite.sum() < 64:
        return None
    roll, pitch, *force = measured[:, finite]
    return Heave(trial.time[finite], vertical_acceleration(roll, pitch, np.transpose(force)))


def sea_motion(motion: AxisMotion) -> SeaMotion:
    """Angle, rate and acceleration of the longest stretch without a pause. Raises `InputError` where the axis does not
    move, or is sampled too slowly for its motion.
    """
    piece = motion if motion.size < 64 else max(split_at_pauses(motion), key=lambda part: part.duration)
    if piece.size < 64:
        short = Advice.of('too-few-waves: samples', axis=motion.axis, samples=piece.size)
        raise InputError(short.message, short.code)
    interval = piece.duration / (piece.size - 1)
    even = piece.time[0] + interval * np.arange(piece.size)
    frequency = 2.0 * np.pi * np.fft.rfftfreq(piece.size, interval)
    angle, angle_noise = _channel(piece, 'angle', even)
    rate, rate_noise = _channel(piece, 'rate', even)
    angles = _from_both(angle, rate, angle_noise, rate_noise, frequency, interval)
    with np.errstate(divide='ignore'):
        noise = 1.0 / (1.0 / angle_noise + frequency**2 / rate_noise)
    peak, highest = _reach(even, angle, rate, noise, frequency)
    spectrum = angles / (1.0 + (frequency / (LOW_PASS * highest)) ** 12)
    size = min(piece.size, int(np.ceil(2.0 * LOW_PASS * highest / np.pi * piece.duration)))
    ramp_rate = 0.0 if angle is None else (angle[-1] - angle[0]) / (even[-1] - even[0])
    step = interval * piece.size / size
    line = 0.0 if angle is None else angle[0] + ramp_rate * step * np.arange(size)
    x, w = (
        np.fft.irfft(each[: size // 2 + 1], size) * size / piece.size for each in (spectrum, 1j * frequency * spectrum)
    )
    # at both ends the derivatives are one-sided
    edge = int(np.ceil(2.0 * np.pi / peak / step))
    inside = slice(edge, -edge)
    x = (x + line)[inside]
    if x.size < 32:
        raise InputError(
            f'the {motion.axis} record is too short for its period of {2 * np.pi / peak:.3g} s: record longer'
        )
    mean = float(x.mean()) if angle is not None else float('nan')
    return SeaMotion(
        float(even[0] + edge * step),
        step,
        x - x.mean(),
        (w + ramp_rate)[inside],
        mean,
        angle_noise,
        rate_noise,
        peak,
        LOWEST_BAND * peak,
        highest,
    )


def _channel(piece: AxisMotion, name: str, even: np.ndarray):
    """A channel on the even grid and the spectral density of its noise."""
    values = getattr(piece, name)
    if values is None:
        return None, np.inf
    values = np.interp(even, piece.time, values)
    if not np.ptp(values) > 0.0:
        raise InputError(f'the {piece.axis} {name} is constant: check the sensor')
    frequency, spectrum = tapered_spectrum(values, float(even[1] - even[0]))
    top = frequency > 0.75 * frequency[-1]
    # the median of a chi-squared variable of 2 K degrees of freedom is about 1 - 1 / (3 K) of its mean
    return values, float(np.median(spectrum[top]) / (1.0 - 1.0 / (3.0 * TAPERS))) or 1e-30


def _from_both(
    angle: np.ndarray | None,
    rate: np.ndarray | None,
    angle_noise: float,
    rate_noise: float,
    frequency: np.ndarray,
    interval: float,
):
    """Fourier transform of the angle less its ramp, each channel weighted by its noise at each frequency."""
    weight = np.full_like(frequency, float(angle is None))
    if angle is not None and rate is not None:
        weight = frequency**2 / (frequency**2 + rate_noise / angle_noise)
    total = np.zeros(frequency.size, dtype=complex)
    if angle is not None:
        total += (1.0 - weight) * np.fft.rfft(angle - np.linspace(angle[0], angle[-1], angle.size))
    if rate is not None:
        slope = rate.mean() if angle is None else (angle[-1] - angle[0]) / (interval * (angle.size - 1))
        turned = np.zeros_like(total)
        turned[1:] = np.fft.rfft(rate - slope)[1:] / (1j * frequency[1:])
        total += weight * turned
    return total


def _reach(
    even: np.ndarray, angle: np.ndarray | None, rate: np.ndarray | None, noise: np.ndarray, frequency: np.ndarray
):
    """Peak frequency of the angle and the highest frequency at which it is known, rad/s."""
    interval = float(even[1] - even[0])
    if angle is not None:
        _, spectrum = tapered_spectrum(angle, interval)
    else:
        assert rate is not None, 'one of the two was measured'
        _, spectrum = tapered_spectrum(rate, interval)
        spectrum[1:] /= frequency[1:] ** 2
    smooth = np.convolve(spectrum, np.ones(15) / 15.0, mode='same')
    # a drift of the mean is not a wave: a record shows at least ten of them
    slowest = 10
    at = slowest + int(smooth[slowest:].argmax())
    # nor is a slow heel, of little variance though its density is the highest
    by_octave = frequency * smooth
    most = slowest + int(by_octave[slowest:].argmax())
    between = int(np.sqrt(at * most))
    if most > 2 * at and smooth[:between].sum() < smooth[between:].sum():
        at = between + int(smooth[between:].argmax())
    peak = float(frequency[at])
    known = (smooth > ABOVE_NOISE * noise) & (smooth > DYNAMIC_RANGE * smooth[at])
    lost = np.flatnonzero(~known[at:])
    last = frequency[at + lost[0] - 1] if lost.size else frequency[-1]
    highest = min(float(last), FASTEST * float(frequency[-1]))
    if highest < MIN_REACH * peak:
        raise InputError(
            f'the motion is known only up to {highest / (2 * np.pi):.3g} Hz, its peak is at '
            f'{peak / (2 * np.pi):.3g} Hz: record at ten samples per wave or more, with a quieter sensor'
        )
    return peak, highest


def tapered_spectrum(values: np.ndarray, interval: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (F,), rad/s, and the one-sided multitaper spectrum (F,) per rad/s of values (N,), mean removed."""
    transformed = np.fft.rfft(sine_tapers(values.size) * (values - values.mean()))
    frequency = 2.0 * np.pi * np.fft.rfftfreq(values.size, interval)
    return frequency, np.mean(np.abs(transformed) ** 2, axis=0) * interval / np.pi


def sea_part(sea: SeaMotion, heave: Heave | None) -> SeaPart:
    """The spectrum of a motion in waves where it is clear of its noise, about its peak."""
    transformed = np.fft.rfft(sine_tapers(sea.angle.size) * (sea.angle - sea.angle.mean()))
    spectrum = np.mean(np.abs(transformed) ** 2, axis=0) * sea.interval / np.pi
    frequency = 2.0 * np.pi * np.fft.rfftfreq(sea.angle.size, sea.interval)
    used = np.flatnonzero((frequency >= sea.lowest) & (frequency <= sea.highest))
    band = np.floor(np.log(frequency[used] / sea.lowest) / np.log(BAND_RATIO)).astype(int)
    starts = np.flatnonzero(np.diff(band, prepend=-1))
    counts = np.diff(np.append(starts, used.size))
    middle, power = (np.add.reduceat(each[used], starts) / counts for each in (frequency, spectrum))
    noise = sea.noise(middle)
    at = int(power.argmax())
    lost = np.flatnonzero((power < ABOVE_NOISE * noise) | (power < DYNAMIC_RANGE * power[at]))
    kept = slice(int(max(lost[lost < at], default=-1)) + 1, int(min(lost[lost > at], default=power.size)))
    middle, power, noise, starts, counts = middle[kept], power[kept], noise[kept], starts[kept], counts[kept]
    # the tapers of orders 1 to K look half of their order to either side
    orders = np.arange(1, TAPERS + 1) / 2.0 * frequency[1]
    centres = frequency[used[starts[0] : starts[-1] + counts[-1]]]
    return SeaPart(
        middle,
        power,
        counts,
        noise,
        (centres[:, None] + np.append(-orders, orders)).ravel(),
        (starts - starts[0]) * 2 * TAPERS,
        float(sea.rate.std()),
        heave_spectrum(heave, sea, middle, power),
    )


def heave_spectrum(heave: Heave | None, sea: SeaMotion, bands: np.ndarray, power: np.ndarray) -> np.ndarray | None:
    """Spectrum of the vertical acceleration at the bands of a motion, shape (B,), (m/s^2)^2 s. In deep water that of
    the wave slope times g^2, for a craft that follows the waves. None where heave is not clear of its noise wherever
    the axis moves.
    """
    if heave is None:
        return None
    end = sea.start + sea.duration
    used = (heave.time >= sea.start) & (heave.time <= end)
    if used.sum() < 64 or np.ptp(heave.time[used]) < 0.9 * sea.duration:
        return None
    # what rounding leaves of gravity is no wave
    if np.std(heave.acceleration[used]) < 1e-6 * STANDARD_GRAVITY:
        return None
    interval = float(np.median(np.diff(heave.time[used])))
    even = np.arange(sea.start, end, interval)
    frequency, spectrum = tapered_spectrum(np.interp(even, heave.time[used], heave.acceleration[used]), interval)
    if bands[-1] > FASTEST * frequency[-1]:
        return None
    noise = np.median(spectrum[frequency > 0.75 * frequency[-1]])
    below, above = (bands * BAND_RATIO**sign for sign in (-1.0, 1.0))
    first = np.searchsorted(frequency, below)
    last = np.maximum(np.searchsorted(frequency, above), first + 1)
    total = np.concatenate([[0.0], np.cumsum(spectrum)])
    smooth = (total[last] - total[first]) / (last - first)
    moving = power > HEAVE_WANTED * power.max()
    return smooth if np.all(smooth[moving] > ABOVE_NOISE * noise) else None
