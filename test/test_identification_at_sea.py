"""Natural period and equivalent damping from motion in waves, against hulls and seas that are known."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from craft_at_sea import KnownSea, driven, jonswap, known_sea, moment_of, scale_for

from swath_sysid.attitude.hull.catalogue import EQUATIONS, hull_named
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.at_sea import (
    PERIOD_USABLE,
    SeaRecord,
    identify_seas,
    is_at_sea,
    parts_of,
    prior_of,
    sea_of,
    turns_of,
)
from swath_sysid.attitude.identification.fit_quality import rate_mismatch
from swath_sysid.attitude.identification.problem import decays_or_waves
from swath_sysid.attitude.identification.refit import RefitSettings, Refitter, refit
from swath_sysid.attitude.identification.sea_likelihood import jonswap_shape
from swath_sysid.attitude.identification.sea_motion import Heave, sea_motion, tapered_spectrum
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.attitude.motion.window import COLUMNS, MotionTable
from swath_sysid.attitude.prediction.hull_watch import HullChange, HullLook, HullWatch, Ratio, hull_change
from swath_sysid.cli.main import main
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError
from swath_sysid.formats.identify_records import identify_at_sea, write_model
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml, read_model
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline
from swath_sysid.pipeline.health import WARN
from swath_sysid.pipeline.record_run import followed, samples_of
from swath_sysid.report.fit_summary import at_sea_as_data, at_sea_in_words

ROLL = hull_named('swath-roll').model
ROLL_ONLY = RefitSettings(axes=('roll',))
LINEAR = DecayModel.of(b1=0.5, r1=6.25, axis='roll')


def measured(sea):
    """As an IMU would have recorded it."""
    noise = np.random.default_rng(7).normal(size=(2, sea.time.size)) * [[1e-3], [1.65e-2]]
    return AxisMotion('roll', sea.time, sea.angle[:, 0] + noise[0], sea.rate[:, 0] + noise[1])


def table(motion, **columns):
    """A motion window that holds this motion."""
    rows = np.full((motion.size, len(COLUMNS)), np.nan)
    rows[:, 0] = motion.time
    for name, values in {motion.axis: motion.angle, f'{motion.axis}_rate': motion.rate, **columns}.items():
        rows[:, COLUMNS.index(name)] = values
    return MotionTable(rows, 1)


@pytest.fixture(scope='module')
def linear_motion():
    return measured(known_sea(LINEAR, [3], 1.4, np.radians(2.0), 400.0))


@pytest.fixture(scope='module')
def found(linear_motion):
    return identify_at_sea(linear_motion)


def test_spectra_are_jonswaps_and_hold_the_variance():
    frequency = np.linspace(0.6, 6.0, 200)
    expected = np.log(jonswap(frequency, 1.3, 3.3) / jonswap(np.array([1.3]), 1.3, 3.3))
    shapes = np.array([[np.log(1.3), np.log(3.3), 5.0]]) + 1e-6 * np.vstack([np.zeros(3), np.eye(3)])
    values, slopes = jonswap_shape(frequency, shapes)
    assert np.allclose(values[0], expected, rtol=1e-12)
    assert np.allclose((values[1:] - values[0]).T / 1e-6, slopes[0], rtol=1e-3, atol=1e-3)
    values = np.random.default_rng(1).normal(size=8192)
    frequency, spectrum = tapered_spectrum(values, 0.05)
    assert spectrum.sum() * frequency[1] == pytest.approx(values.var(), rel=0.05)
    assert np.mean(spectrum) == pytest.approx(0.05 / np.pi, rel=0.05)


@pytest.mark.parametrize('missing', [{}, {'rate': None}, {'angle': None}])
def test_derivatives_of_a_motion_are_exact(missing):
    time = np.arange(6000) * 0.05
    noise = 1e-6 * np.random.default_rng(2).normal(size=(2, time.size))
    angle, rate = 0.1 * np.sin(1.7 * time) + 0.05, 0.17 * np.cos(1.7 * time)
    sea = sea_motion(replace(AxisMotion('pitch', time, angle + noise[0], rate + noise[1]), **missing))
    at = sea.start + sea.interval * np.arange(sea.angle.size)
    middle = slice(50, -50)
    assert np.allclose(sea.rate[middle], 0.17 * np.cos(1.7 * at)[middle], atol=2e-3)
    assert np.isnan(sea.mean) if 'angle' in missing else sea.mean == pytest.approx(0.05, abs=1e-3)
    assert sea.peak == pytest.approx(1.7, rel=0.02)


@pytest.mark.release
@pytest.mark.parametrize(
    'peak_ratio, by_slope, seed',
    [(0.7, False, 1), (1.5, True, 2)],
)
def test_a_sea_that_hides_the_published_roll_hull_is_said_to(peak_ratio, by_slope, seed):
    sea = known_sea(ROLL, [seed], peak_ratio, np.radians(1.2), 600.0, by_slope=by_slope)
    found = identify_at_sea(measured(sea))
    period, damping = sea.truth()
    assert found.amplitude == pytest.approx(2.0 * sea.angle.std(), rel=0.02)
    assert abs(found.natural_period - period) < 2.5 * found.natural_period_std
    assert abs(found.damping_ratio - damping) < 2.5 * found.damping_ratio_std
    # a fifth of critical damping: its peak is as broad as that of the waves
    assert found.sea == 'jonswap' and not found.is_usable and 'sea-hides-hull' in {a.code for a in found.advice}


@pytest.mark.long
def test_what_is_told_of_a_linear_hull(found):
    assert found.natural_period == pytest.approx(LINEAR.natural_period, rel=0.02)
    assert found.damping_ratio == pytest.approx(0.1, rel=0.25)
    assert found.model.equation == EQUATIONS['linear']
    assert found.model.natural_period == pytest.approx(found.natural_period)
    assert found.model.damping_ratio == pytest.approx(found.damping_ratio)
    assert found.roughness < 0.3
    assert {'equivalent-linear'} <= {a.code for a in found.advice}
    # the uncertainty of the ratios is that of period and damping
    r1 = found.model.terms['r1']
    assert found.std['r1'] / r1 == pytest.approx(2.0 * found.natural_period_std / found.natural_period, rel=1e-6)
    identified = found.identified_model({'source': 'here'})
    back = model_from_yaml(model_to_yaml({'roll': identified}))['roll']
    assert back == identified and is_at_sea(back) and not is_at_sea(IdentifiedModel.exactly(ROLL))
    assert back.amplitude_range == (pytest.approx(found.amplitude),) * 2


@pytest.mark.long
@pytest.mark.parametrize('faster, larger', [(10.0, -1.0), pytest.param(0.2, 0.01, marks=pytest.mark.release)])
def test_units_of_time_and_angle_do_not_matter(linear_motion, found, faster, larger):
    motion = larger * linear_motion.angle, larger * faster * linear_motion.rate
    other = identify_at_sea(AxisMotion('roll', linear_motion.time / faster, *motion))
    assert other.natural_period * faster == pytest.approx(found.natural_period, rel=2e-3)
    assert other.damping_ratio == pytest.approx(found.damping_ratio, rel=2e-2)
    assert other.amplitude == pytest.approx(abs(larger) * found.amplitude, rel=1e-3)


@pytest.mark.long
def test_less_information_gives_more_uncertainty(found):
    # long waves: what little there is near the natural period could be the sea's own
    far = identify_at_sea(measured(known_sea(LINEAR, [4], 5.0, np.radians(1.0), 400.0, by_slope=True)))
    assert far.natural_period_std > 1.5 * found.natural_period_std and not far.is_usable
    assert far.natural_period == pytest.approx(LINEAR.natural_period, abs=3.0 * far.natural_period_std)
    assert 'sea-hides-hull' in {a.code for a in far.advice}


@pytest.mark.release
def test_heave_tells_two_seas_apart():
    rng, time = np.random.default_rng(11), np.arange(0.0, 600.0, 0.1)
    frequency = np.sort(rng.uniform(0.4, 8.0, 500))
    spectrum = jonswap(frequency, 0.75, 5.0) + 0.4 * jonswap(frequency, 1.9, 2.0)
    amplitude = np.sqrt(spectrum * 7.6 / 500.0)
    amplitude *= 0.3 / np.sqrt(0.5 * np.sum(amplitude**2))
    phase = np.outer(time, frequency) + rng.uniform(0.0, 2.0 * np.pi, 500)
    slope = amplitude * frequency**2 / 9.81
    response = 6.25 / (6.25 - frequency**2 + 0.5j * frequency)
    turning = np.exp(1j * phase)
    angle = (turning @ (slope * response)).real
    rate = (turning @ (1j * frequency * slope * response)).real
    up = -(turning @ (1j * amplitude * frequency**2)).real + 9.81
    noise = rng.normal(size=(3, time.size)) * [[1e-3], [1e-2], [0.02]]
    motion = AxisMotion('roll', time, angle + noise[0], rate + noise[1])
    found = identify_seas([SeaRecord(motion, Heave(time, up + noise[2]))])
    assert found.sea == 'heave'
    assert found.natural_period == pytest.approx(LINEAR.natural_period, rel=0.03)
    assert found.damping_ratio == pytest.approx(0.1, rel=0.25)
    # an accelerometer that only gravity acts on tells nothing of the sea
    still = identify_seas([SeaRecord(motion.between(None, 300.0), Heave(time, 9.81 + noise[2]))])
    assert still.sea == 'jonswap'


@pytest.mark.long
def test_a_record_that_will_not_do_is_refused_in_one_sentence(linear_motion):
    time = linear_motion.time
    regular = 0.06 * np.sin(0.9 * time) + 0.06 * np.sin(1.02 * time + 1.0)
    regular += 1e-3 * np.random.default_rng(1).normal(size=time.size)
    for motion, words in (
        (linear_motion.only(slice(0, 20)), 'samples'),
        (replace(linear_motion, angle=np.zeros(time.size)), 'constant'),
        (AxisMotion('roll', time, regular, None), 'regular waves'),
    ):
        with pytest.raises(InputError, match=words):
            identify_at_sea(motion)
    with pytest.raises(Cancelled):
        identify_at_sea(linear_motion, should_cancel=lambda: True)
    with pytest.raises(InputError, match='at least one trial'):
        identify_at_sea([])


def test_a_slow_heel_is_no_wave_and_accuses_no_unit(linear_motion):
    """A heel of a quarter of the variance has the largest density, and a wandering gyroscope the largest slope."""
    slow = np.sin(2.0 * np.pi / 33.0 * linear_motion.time)
    heeled = replace(linear_motion, angle=linear_motion.angle + 0.8 * linear_motion.angle.std() * slow)
    assert sea_motion(heeled).peak == pytest.approx(sea_motion(linear_motion).peak, rel=0.05)
    # 0.8^2 / 2 of the variance of the waves
    assert (
        sea_motion(heeled).slow_share == pytest.approx(0.32 / 1.32, rel=0.1)
        and not sea_motion(linear_motion).slow_share
    )
    wandering = replace(linear_motion, rate=linear_motion.rate + 3.0 * linear_motion.rate.std() * slow)
    assert rate_mismatch(wandering, 2.5) < 0.1
    assert rate_mismatch(replace(linear_motion, rate=np.degrees(linear_motion.rate)), 2.5) > 0.35


@pytest.mark.long
def test_calm_before_the_waves_is_left_out(linear_motion):
    count = int(0.6 * linear_motion.size)
    noise = np.random.default_rng(5).normal(size=(2, count)) * [[1e-3], [1.65e-2]]
    angle, rate = linear_motion.angle.copy(), linear_motion.rate.copy()
    angle[:count], rate[:count] = noise
    motion = replace(linear_motion, angle=angle, rate=rate)
    found = identify_seas([SeaRecord(motion)], searched=True)
    assert len(found.spectra) == 1
    assert found.natural_period == pytest.approx(LINEAR.natural_period, abs=3.0 * found.natural_period_std)


@pytest.mark.release
def test_a_refit_on_waves_believes_what_is_better(linear_motion):
    refitter, shares = Refitter(ROLL_ONLY), []
    first = refit(refitter.request(table(linear_motion), source={'topic': 'here'}), progress=shares.append)
    assert len(shares) > 4 and shares == sorted(shares) and shares[-1] == 1.0
    assert refitter.take(first) and is_at_sea(refitter.models['roll'])
    assert 'at sea, equivalent linear at 3' in first.message and '\n' not in first.message
    again = refit(refitter.request(table(measured(known_sea(LINEAR, [9], 1.2, np.radians(2.0), 300.0)))))
    assert not again.succeeded and 'explains the window as well' in again.message
    slower = DecayModel.of(b1=0.5, r1=4.0, axis='roll')
    changed = refit(refitter.request(table(measured(known_sea(slower, [9], 1.2, np.radians(2.0), 300.0)))))
    assert refitter.take(changed) and 'log-likelihood' in changed.message
    assert refitter.models['roll'].model.natural_period == pytest.approx(slower.natural_period, rel=0.04)


def test_a_refit_on_waves_never_replaces_the_model_of_a_decay(linear_motion):
    held = IdentifiedModel.exactly(LINEAR)
    outcome = refit(Refitter(ROLL_ONLY, {'roll': held}).request(table(linear_motion)))
    assert not outcome.succeeded
    assert 'the model of the free decay stays, which there has period 2.' in outcome.message
    assert 'at sea, equivalent linear' in outcome.message
    # a window too short is reported with the length that it needs
    outcome = refit(Refitter(ROLL_ONLY).request(table(linear_motion.between(100.0, 160.0))))
    assert not outcome.succeeded and 'record at least' in outcome.message and 'window_s' in outcome.message


@pytest.fixture(scope='module')
def sea_file(linear_motion, tmp_path_factory):
    path = tmp_path_factory.mktemp('sea') / 'beam_sea.csv'
    columns = np.column_stack([linear_motion.time, linear_motion.angle, linear_motion.rate])
    np.savetxt(path, columns, delimiter=',', header='time_s,roll_rad,roll_rate_rad_s', comments='', fmt='%.6f')
    return path


def test_the_command_line_takes_waves_for_waves(sea_file, tmp_path, capsys):
    model, picture = tmp_path / 'model.yaml', tmp_path / 'sea.png'
    assert main(['identify', str(sea_file), '--output', str(model), '--plot', str(picture)]) == 0
    told = capsys.readouterr()
    assert 'identified at sea, the equivalent linear hull at 3' in told.out and 'equivalent-linear' in told.err
    assert 'no verdict' in told.out
    assert is_at_sea(read_model(model)['roll']) and picture.stat().st_size > 20_000
    assert main(['identify', str(sea_file), '--at-sea', '--json']) == 0
    data = json.loads(capsys.readouterr().out)
    assert data['identified_from'] == 'motion in waves' and data['equation'] == 'linear'
    assert data['natural_period_s'] == pytest.approx(LINEAR.natural_period, rel=0.03)
    assert {'natural_period_std_s', 'damping_ratio_std', 'reference_amplitude_rad'} <= set(data)
    assert data['natural_period_std_s'] > 0.0 and data['ratios']['r1']['std'] > 0.0


@pytest.mark.long
def test_what_is_not_usable_has_no_standard_deviations_but_reasons(found):
    """The deviations of a result that fails a condition are not to be trusted; each condition says what would do."""
    assert found.is_usable and not found.shortcomings
    hidden = replace(found, natural_period_std=1.5 * PERIOD_USABLE * found.natural_period)
    short = hidden.shortcomings[0].message
    assert f'Record about {np.ceil(1.5**2 * found.duration / 60):.0f} minutes' in short and '% (needed 3.5%)' in short
    far = replace(found, damping_ratio_std=3.0 * found.damping_ratio)
    assert 'nearer to its period' in far.shortcomings[0].message
    rough, apart = replace(found, is_smooth=False), replace(found, apart=2.5)
    codes = [[each.code for each in bad.shortcomings] for bad in (hidden, far, rough, apart)]
    assert codes == [['sea-hides-hull'], ['sea-hides-hull'], ['sea-not-fitted'], ['parts-disagree']]
    for bad in (hidden, far, rough, apart):
        assert not bad.is_usable and all(each in bad.advice for each in bad.shortcomings)
        data, words = at_sea_as_data(bad), at_sea_in_words(bad)
        assert data['natural_period_std_s'] is data['damping_ratio_std'] is data['ratios']['b1']['std'] is None
        assert 'not usable' in words[0] and '+-' not in words[-1]
        assert not any(line.startswith('  r1') and '+-' in line for line in words)


@pytest.mark.parametrize(
    'arguments, sentence',
    [
        (['--decay'], 'oscillates from start to end'),
        (['--at-sea', '--equation', 'odd-cubic'], '--equation cannot be used with motion in waves'),
        (['--at-sea', '--end', '60'], 'record at least'),
    ],
)
def test_the_command_line_refuses_with_a_sentence(sea_file, capsys, arguments, sentence):
    assert main(['identify', str(sea_file), *arguments]) == 2
    assert sentence in capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.long
def test_a_hull_that_is_known_too_poorly_is_told_but_not_written(sea_file, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('swath_sysid.attitude.identification.at_sea.UNCERTAIN', 1e-3)
    model = tmp_path / 'model.yaml'
    command = ['identify', str(sea_file), '--output', str(model)]
    assert main(command) == 1
    assert f'{model} was not written' in capsys.readouterr().err
    assert not model.exists()
    assert main([*command, '--force']) == 0 and model.exists()


@pytest.mark.release
def test_thirds_of_a_measured_record_agree(data_folder):
    trial = read_trial(data_folder / 'waves' / 'morro_buoy.csv', frame='frd')
    thirds = [identify_at_sea(trial.between(600.0 * k, 600.0 * (k + 1)), axis='pitch') for k in range(3)]
    periods, dampings = (np.array([getattr(t, name) for t in thirds]) for name in ('natural_period', 'damping_ratio'))
    spread = np.array([[t.natural_period_std, t.damping_ratio_std] for t in thirds]).mean(axis=0)
    assert [t.sea for t in thirds] == ['heave'] * 3
    assert np.ptp(periods) < 4.0 * spread[0] and np.ptp(dampings) < 4.0 * spread[1]
    assert np.all((periods > 2.2) & (periods < 2.8))


SMALL = DecayModel.of(b1=0.0838, b2=0.8, r1=(2.0 * np.pi / 3.0) ** 2, r3=2.0, axis='roll')


def turned_sea(ratios, seed, duration=600.0, interval=0.05):
    """The small hull in a sea of one peak period, then of another, over its natural one, as from another heading."""
    steps = round(duration / interval)
    halves = np.arange(2 * steps + 1) * 0.5 * interval
    natural = SMALL.natural_frequency
    first, second = (moment_of(halves, natural / ratio, 3.3, True, natural, seed + k) for k, ratio in enumerate(ratios))
    turned = 0.5 * (1.0 + np.tanh((halves - 0.5 * duration) / 5.0))
    moments = (first * (1.0 - turned) + second * turned)[:, None]
    angle, rate = driven(SMALL, scale_for(SMALL, moments, np.radians(3.0), interval) * moments, interval)
    return KnownSea(halves[:-1:2], angle, rate, SMALL)


def equivalent(sea):
    """Period and damping ratio of the small hull by statistical linearisation."""
    stiffness = SMALL.terms['r1'] + 3.0 * SMALL.terms['r3'] * sea.angle.var()
    damping = SMALL.terms['b1'] + np.sqrt(8.0 / np.pi) * SMALL.terms['b2'] * sea.rate.std()
    return 2.0 * np.pi / np.sqrt(stiffness), 0.5 * damping / np.sqrt(stiffness)


@pytest.fixture(scope='module')
def turned():
    return [turned_sea(ratios, seed) for ratios, seed in (((1.4, 1.2), 31), ((1.6, 1.3), 33), ((0.8, 0.95), 35))]


@pytest.fixture(scope='module')
def alone(turned):
    """What one of these seas tells by itself."""
    return cache(lambda k: identify_at_sea(measured(turned[k])))


@pytest.mark.release
@pytest.mark.parametrize('k', [0, 1, 2])
def test_a_hull_is_found_in_seas_from_two_headings(turned, alone, k):
    found, (period, damping) = alone(k), equivalent(turned[k])
    assert found.is_usable and found.natural_period == pytest.approx(period, rel=0.03)
    assert abs(found.natural_period - period) < 2.5 * found.natural_period_std
    assert abs(found.damping_ratio - damping) < 2.5 * found.damping_ratio_std


@pytest.mark.release
def test_several_records_know_the_hull_better_than_one(turned, alone, tmp_path):
    found = identify_at_sea([measured(sea) for sea in turned])
    assert found.natural_period_std < 0.75 * np.mean([alone(k).natural_period_std for k in range(3)])
    assert abs(found.natural_period - np.mean([equivalent(sea)[0] for sea in turned])) < 2.5 * found.natural_period_std
    assert len(found.motions) == 3 and len(found.spectra) == 6
    write_model(tmp_path / 'hull.yaml', found)
    assert is_at_sea(read_model(tmp_path / 'hull.yaml')['roll'])


@pytest.mark.release
def test_a_peak_of_the_waves_is_no_hull():
    swell = known_sea(LINEAR, [5], 2.0, np.radians(2.0), 600.0, gamma=60.0)
    found = identify_at_sea(measured(swell))
    # the swell's is twice as long
    assert found.natural_period == pytest.approx(LINEAR.natural_period, rel=0.03)
    assert abs(found.natural_period - LINEAR.natural_period) < 2.0 * found.natural_period_std


@pytest.mark.release
def test_records_that_disagree_are_not_usable(turned):
    slower = replace(measured(turned[1]), time=1.25 * turned[1].time, rate=None)
    found = identify_seas([SeaRecord(replace(measured(turned[0]), rate=None)), SeaRecord(slower)], searched=True)
    assert found.apart > 3.0 and not found.is_usable and 'parts-disagree' in {a.code for a in found.advice}


@pytest.mark.long
def test_turns_are_found_by_the_yaw_rate():
    time = np.arange(0.0, 600.0, 0.1)
    noise = 0.05 * np.sin(1.3 * time) + 0.002 + 0.01 * np.random.default_rng(3).normal(size=time.size)
    straight = Trial(time, roll=np.sin(time), yaw_rate=noise)
    assert turns_of(straight) == () == turns_of(replace(straight, yaw_rate=None))
    turn = 0.02 * (np.abs(time - 200.0) < 20.0) - 0.03 * (np.abs(time - 430.0) < 15.0)
    assert turns_of(replace(straight, yaw_rate=noise + turn)) == pytest.approx((200.0, 430.0), abs=12.0)
    record = SeaRecord(measured(known_sea(LINEAR, [3], 1.4, np.radians(2.0), 400.0)), bounds=(150.0, 1e6))
    ends = [part.counts.sum() for part in parts_of(sea_of(record.motion), record)]
    assert len(ends) == 2 and ends[1] > 1.5 * ends[0]


def watched(model, *motions):
    """The watch over a model after a look at the newest part of each motion and at the whole of it."""
    watch = HullWatch()
    for motion in motions:
        for is_newest in (True, False):
            change = hull_change(HullLook('roll', IdentifiedModel.exactly(model), is_newest), motion, 3.0)
            assert change is not None
            watch.take(change)
    return watch


@pytest.mark.long
@pytest.mark.parametrize(
    'slower, damped',
    [
        (1.0, 1.0),
        (1.13, 1.0),
        pytest.param(0.87, 1.0, marks=pytest.mark.release),
        pytest.param(1.0, 2.0, marks=pytest.mark.long),
    ],
)
def test_a_changed_hull_is_told_and_no_other(turned, slower, damped):
    motion, (period, damping) = measured(turned[0]), equivalent(turned[0])
    motion = replace(motion, time=motion.time * slower, rate=motion.rate / slower)
    model = DecayModel.of(b1=4.0 * np.pi * damping / damped / period, r1=(2.0 * np.pi / period) ** 2, axis='roll')
    watch = watched(model, *(motion.between(None, motion.time[-1] - before) for before in (40.0, 0.0)))
    told = {'hull-changed': watch.of_stiffness(), 'damping-changed': watch.of_damping()}
    for name, ratio, found in zip(('stiffness', 'damping'), (slower**-2.0, damped), told.values(), strict=True):
        assert (found is not None) == (ratio != 1.0)
        assert found is None or getattr(found, name).log == pytest.approx(np.log(ratio), rel=0.4)
    assert {each.code for each in watch.advice()} == {code for code, found in told.items() if found is not None}


@pytest.mark.long
def test_a_change_shows_at_once_though_the_whole_past_hides_it(turned):
    (period, damping), motion, slower = equivalent(turned[0]), measured(turned[0]), 1.13
    model = DecayModel.of(b1=4.0 * np.pi * damping / period, r1=(2.0 * np.pi / period) ** 2, axis='roll')
    time = np.append(motion.time, 600.0 + slower * motion.time)
    rate = np.append(motion.rate, motion.rate / slower)
    changed = AxisMotion('roll', time, np.tile(motion.angle, 2), rate)
    watch = watched(model, changed.between(None, 600.0 + 260.0), changed.between(None, 600.0 + 280.0))
    told = watch.of_stiffness()
    assert told is not None
    found = told.stiffness
    # a longer part would dilute it, a shorter one would know it less well
    assert found.log == pytest.approx(-2.0 * np.log(slower), rel=0.2) and found.std < 0.045
    assert 'less stiffness' in watch.advice()[0].message


def test_a_change_is_told_once_it_is_beyond_what_changing_seas_deceive_by():
    def after(*looks):
        watch = HullWatch()
        for is_newest, stiffness, damping in looks:
            watch.take(HullChange('roll', is_newest, Ratio(stiffness, 0.1), Ratio(damping, 0.1), 3.0, 3.0))
        return [each.code for each in watch.advice()]

    # as in hours of simulated seas that change: one look 4.3 standard deviations off, and two in a row 2.7 and 3.5
    assert after((True, 0.43, 0.0), (True, 0.28, 0.0)) == [] == after((False, 0.27, 0.35), (False, 0.31, 0.26))
    assert after((True, -0.34, 0.0), (True, 0.34, 0.0)) == [] == after((True, -0.34, 0.5))
    assert after(*[(True, -0.34, 0.5)] * 2) == ['hull-changed'] == after(*[(False, 0.34, 0.1)] * 2)
    assert after(*[(False, 0.0, -0.34)] * 2) == ['damping-changed']
    # the whole past still shows what is over
    assert after(*[(False, 0.4, 0.1)] * 2, (True, 0.05, 0.0)) == []


@pytest.mark.release
def test_the_status_reports_a_changed_stiffness_within_minutes():
    motion, faster = measured(known_sea(LINEAR, [3], 1.3, np.radians(3.0), 240.0)), 2.5
    trial = Trial(motion.time / faster, roll=motion.angle, roll_rate=motion.rate * faster, pitch=0.0 * motion.time)
    damping, frequency = 0.5 * faster, LINEAR.natural_frequency * faster * 1.13
    pipeline = ForecastPipeline()
    pipeline.set_models({'roll': IdentifiedModel.exactly(DecayModel.of(b1=damping, r1=frequency**2, axis='roll'))})
    for _ in followed(pipeline, samples_of(trial.between(None, trial.time[0] + 95.0))):
        pass
    (report,) = (r for r in PredictorHealth('imu', pipeline).reports(95.0, pipeline.newest_ns) if r.name == 'forecast')
    assert 'hull-changed' in report.codes and report.level == WARN and 'less stiffness' in report.message


@pytest.mark.long
def test_a_release_is_the_prior_of_a_short_record(turned):
    motion = measured(turned[0]).between(None, 200.0)
    held = IdentifiedModel.exactly(SMALL)
    alone, known = identify_at_sea(motion), identify_seas([SeaRecord(motion)], prior_of(held, motion))
    assert known.damping_ratio_std / known.damping_ratio < alone.damping_ratio_std / alone.damping_ratio
    assert abs(known.natural_period - equivalent(turned[0])[0]) < 2.5 * known.natural_period_std


def test_the_decays_are_still_decays(data_folder):
    for name in ('kvlcc2/run2_0kn.csv', 'kvlcc2/run3_15kn.csv', 'foswec/pitch_3deg_repeat1.csv'):
        trial = read_trial(data_folder / 'decay' / name)
        assert decays_or_waves([trial.axis('roll' if 'kvlcc2' in name else 'pitch')]).segments
