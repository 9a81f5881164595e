"""The state of running nodes as plain data: health in words, charts, the model, calm windows, a campaign's trials."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.fit_quality import amplitude_bands
from swath_sysid.attitude.motion.trial import AXES, AxisMotion
from swath_sysid.attitude.prediction.forecast import LEVELS, NORMAL_QUANTILES
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.common.signals import noise_level
from swath_sysid.page.live_record import SHOWN_S, LiveRecord
from swath_sysid.page.model_words import FAINTEST, amplitudes, described, gain, history, of_axis, verdict_of
from swath_sysid.page.release import Release
from swath_sysid.pipeline.health import OK, STALE, WARN, Report
from swath_sysid.report.sea_report import sea_in_words

SHOWN_POINTS = 300  #: Of a motion: a chart has hardly more pixels, and every browser gets them twice a second.
#: Half widths in standard deviations.
INTERVALS = {f'{100.0 * level:.0f} %': width for level, width in zip(LEVELS, NORMAL_QUANTILES, strict=True)}


VALID_LEAD = 'valid_lead_'  #: How the values of a status begin that are valid leads; they end with the unit, ``_s``.

#: Name of each status, and its value that counts what it has seen; empty where it can be well before anything was.
STATUSES = {
    'predictor: imu': ('Sensor', 'received'),
    'predictor: installation': ('Frame, units, gravity', 'judgements'),
    'imu_buffer: window': ('Motion window', 'samples'),
    'identifier: identification': ('Identification', ''),
    'predictor: forecast': ('Forecast', 'published'),
}


def health(statuses: Mapping[str, Report], motions: Mapping[str, AxisMotion]) -> list[tuple[str, int, str]]:
    """Name, level and sentence of each health item; stale is what nothing is known of yet."""
    lines = []
    for status, (name, counter) in STATUSES.items():
        report = statuses.get(status)
        if report is None:
            lines.append((name, WARN, f'no diagnostics from {status.partition(":")[0]}'))
            continue
        rate = f'{shown_number(report.values["rate_hz"])} Hz, ' if 'rate_hz' in report.values else ''
        # the card of the model shows the last verdict
        is_known = report.level != OK or str(report.values.get(counter, 1)) != '0'
        lines.append((name, report.level if is_known else STALE, rate + report.message.partition('; last: ')[0]))
    noises = [
        f'{axis} {np.degrees(noise_level(motion.angle)):.2g} deg'
        for axis, motion in motions.items()
        if motion.angle is not None
    ]
    lines.insert(2, ('Noise of the angles', OK if noises else STALE, ', '.join(noises) or 'not known yet'))
    return lines


def shown_number(value: object) -> str:
    """A number of a status with one decimal; another program may have sent anything in its place."""
    try:
        return f'{float(str(value)):.1f}'
    except ValueError:
        return '(no number)'


def motion_chart(record: LiveRecord, quantity: str, motion: AxisMotion | None, age: float = 0.0) -> dict[str, list]:
    """Measured motion, the forecast with its intervals and the earlier forecast, against the time from now, ``age``
    s after the newest sample. Lists of (s, deg or m), and for each interval of (s, lower, upper).
    """
    now = record.stamp + age
    scale = np.degrees(1.0) if motion is not None or quantity in ('roll', 'pitch') else 1.0
    chart: dict[str, list] = {'measured': [], 'forecast': [], 'checked': [], 'bands': [[] for _ in INTERVALS]}
    if motion is not None and motion.angle is not None:
        late = motion.time > now - SHOWN_S
        step = max(1, int(np.count_nonzero(late)) // SHOWN_POINTS)
        chart['measured'] = _points(motion.time[late][::-step][::-1] - now, motion.angle[late][::-step][::-1] * scale)
    horizon = record.horizons.get(quantity)
    if horizon is None or abs(now - horizon.stamp) > SHOWN_S:
        return chart
    time = horizon.leads + horizon.stamp - now
    mean, std = horizon.mean[quantity] * scale, horizon.std[quantity] * scale
    chart['forecast'] = _points(time, mean)
    chart['bands'] = [_points(time, mean - width * std, mean + width * std) for width in INTERVALS.values()]
    checked = np.array(record.checked[quantity])
    shown = checked[checked[:, 0] > now - SHOWN_S]
    chart['checked'] = _points(shown[:, 0] - now, shown[:, 1] * scale)
    return chart


def release_chart(release: Release, model: IdentifiedModel | None) -> tuple[dict[str, list], str]:
    """A measured decay and a model's motion over it, lists of (s from the release, deg), and its caption."""
    elapsed, angle = release.motion.time - release.motion.time[0], np.asarray(release.motion.angle)
    chart = {'measured': _points(elapsed, np.degrees(angle)), 'fitted': []}
    words = f'From {np.degrees(release.amplitude):.1f} deg, {release.cycles:.1f} cycles'
    if model is None:
        return chart, f'{words}; no model yet.'
    fitted = release.simulated(model.model)
    chart['fitted'] = _points(elapsed, np.degrees(fitted))
    misses = float(np.sqrt(np.mean((fitted - angle) ** 2)))
    if not np.isfinite(misses):
        return chart, f'{words}; the motion of the model runs away.'
    return chart, f'{words}; model off by {np.degrees(misses):.2g} deg rms.'


def releases_in_words(tried: Iterable[tuple[Release, Sequence[IdentifiedModel]]]) -> list[str]:
    """The releases of an axis, the newest first, with what each added to the model."""
    return [
        f'From {np.degrees(release.amplitude):.1f} deg: '
        + (gain(models) or described(models[-1]) if models else 'no new model')
        for release, models in reversed(list(tried))
    ]


def model_chart(model: IdentifiedModel | None, release: Release | None) -> dict[str, list]:
    """Natural period, s, and equivalent damping as lists of (deg, value, lower, upper), two standard deviations wide;
    the same from each cycle of the last release as lists of (deg, value).
    """
    chart: dict[str, list] = {name: [] for name in ('period', 'damping', 'measured_period', 'measured_damping')}
    if model is not None:
        amplitude = np.linspace(*amplitudes(model), 25)
        bands = amplitude_bands(model.model, model.covariance, amplitude, model.posterior)
        period = 2.0 * np.pi / bands.curves.frequency
        spread = 2.0 * period * bands.frequency_std / bands.curves.frequency
        damping, wide, degrees = bands.curves.damping_ratio, 2.0 * bands.damping_ratio_std, np.degrees(amplitude)
        # where the restoring moment vanishes the period has no bounds
        known = spread < period
        chart['period'] = _points(*(each[known] for each in (degrees, period, period - spread, period + spread)))
        chart['damping'] = _points(*(each[known] for each in (degrees, damping, damping - wide, damping + wide)))
    if release is not None and release.peaks.time.size > 2:
        peaks, faintest = release.peaks, FAINTEST * release.amplitude
        clear = peaks.mean_amplitude > (faintest if model is None else max(faintest, amplitudes(model)[0]))
        degrees = np.degrees(peaks.mean_amplitude[clear])
        chart['measured_period'] = _points(degrees, peaks.period[clear])
        chart['measured_damping'] = _points(degrees, peaks.logarithmic_decrement[clear] / (2.0 * np.pi))
    return chart


def model_words(record: LiveRecord, axis: str, verdict: str | None) -> list[str]:
    """The models of an axis, the newest first with its verdict, and the identifier's last sentence about it, if any."""
    last = [] if verdict is None else [f'Last identification: {of_axis(verdict, axis) or "none yet"}']
    models = list(record.models_before.get(axis, ()))
    if not models:
        return ['No model yet.', *last]
    (_, cure), lines = verdict_of(models[-1]), history(models, record.stamps_of_models[axis])[::-1]
    return [lines[0], *filter(None, [cure]), *lines[1:], *last]


def equation_words(record: LiveRecord, axis: str) -> str:
    """The equation of the newest model of an axis, and the amplitudes that it was seen at."""
    models = record.models_before.get(axis, ())
    if not models:
        return 'No model yet.'
    low, high = np.degrees(amplitudes(models[-1]))
    equation = models[-1].model.equation
    # the name of an equation without a published one is its terms
    terms = '' if equation.terms[0] in equation.name else f' ({", ".join(equation.terms)})'
    return f'{equation.name}{terms}, seen from {low:.2g} to {high:.2g} deg'


def calm_words(record: LiveRecord, age: float = 0.0) -> str:
    """The next calm window, the probability of staying quiet, and the limits, ``age`` s after the newest sample."""
    if age > 0.0:
        return f'No forecast: the newest sample is {age:.0f} s old.'

    def shown(probability: float):
        # no count of forecasts that came true proves certainty
        return f'{min(100.0 * probability, 99.0):.0f} %'

    words = []
    if record.quiescence is not None:
        words.append(f'The craft stays within its quiet limits with a probability of {shown(record.quiescence)}.')
    if record.calm is not None:
        begin, end, probability = record.calm
        if end > record.stamp:
            words.append(
                f'Calm from {max(begin - record.stamp, 0.0):.1f} to {end - record.stamp:.1f} s from now '
                f'({shown(probability)}).'
            )
    return ' '.join(words or ['No calm window forecast yet.']) + limits_in_words(record.limits)


def limits_in_words(limits: QuiescenceLimits | None) -> str:
    """The limits of quiet; empty where not known."""
    if limits is None:
        return ''
    point = limits.points[0] if limits.points else None
    bounds = [
        *((name, np.degrees(getattr(limits, name)), 'deg') for name in AXES),
        *((f'{name} rate', np.degrees(getattr(limits, f'{name}_rate')), 'deg/s') for name in AXES),
        ('heave', point.heave if point else np.inf, 'm'),
        ('vertical velocity', point.vertical_velocity if point else np.inf, 'm/s'),
    ]
    named = [f'{name} {bound:g} {unit}' for name, bound, unit in bounds if np.isfinite(bound)]
    about = ' about the present trim' if limits.about_trim else ''
    return f' Quiet means within ±({", ".join(named) or "any motion"}){about} for {limits.duration:g} s.'


def valid_words(statuses: Mapping[str, Report]) -> str:
    """How far ahead the forecast can be trusted; empty where it is not known."""
    report = statuses.get('predictor: forecast')
    leads = {} if report is None else {k: v for k, v in report.values.items() if k.startswith(VALID_LEAD)}
    named = [f'{key.removeprefix(VALID_LEAD)[:-2]} {shown_number(value)} s' for key, value in leads.items()]
    return f'Valid lead: {", ".join(named)}.' if named else ''


def sea_words(record: LiveRecord) -> str:
    """The sea state shown by the craft's own motion."""
    if record.sea is None:
        return 'No sea state yet.'
    if record.sea.state is None:
        return f'No sea state: {record.sea.reason}.'
    return '\n'.join(sea_in_words(record.sea.state, 'Sea'))


def _points(*columns: np.ndarray, decimals: int = 4) -> list[list[float]]:
    """Rows of finite numbers, rounded for transmission."""
    table = np.column_stack(columns)
    return np.round(table[np.isfinite(table).all(axis=1)], decimals).tolist()
