"""Free decays are found in what surrounds them and checked; none is found in waves."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from craft_at_sea import jonswap
from hypothesis import example, given, settings
from hypothesis import strategies as st
from repository import ROOT
from scipy.ndimage import gaussian_filter1d

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import CraftSettings, SensorNoise, SimulatedCraft, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.identification.problem import to_be_fitted
from swath_sysid.attitude.motion.decay_candidates import bridged_half_cycles
from swath_sysid.attitude.motion.intake import ConvertedReading, CraftSample
from swath_sysid.attitude.motion.quality import check_decay, check_motion, clipped_extremes, without_spikes
from swath_sysid.attitude.motion.segmentation import (
    decays_or_absence,
    explain_absence,
    find_decays,
    is_finished,
    keeps_oscillating,
)
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import (
    EvenSignal,
    centre_of_decay,
    even_signal,
    find_turning_points,
    mean_period,
    split_at_pauses,
    turning_points_of,
)
from swath_sysid.attitude.motion.window import MotionWindow, rests_after
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial


def find_decay(motion, start=None, end=None):
    """The best decay of a record, or the one between bounds."""
    found = decays_or_absence(motion, start, end)
    if isinstance(found, Advice):
        raise InputError(found.message, found.code)
    return found[0]


RATE_HZ = 100.0
ANGLE_NOISE, RATE_NOISE = 0.001, 0.0165
PERIOD = 2.0


def released(time, amplitude, damping_ratio, period=PERIOD):
    """Angle and rate of a linear hull let go from rest at time 0 (closed form); at the angle before."""
    natural = 2 * np.pi / period
    damped = natural * np.sqrt(1 - damping_ratio**2)
    after = np.maximum(time, 0.0)
    envelope = amplitude * np.exp(-damping_ratio * natural * after)
    angle = envelope * (np.cos(damped * after) + damping_ratio * natural / damped * np.sin(damped * after))
    rate = -envelope * natural**2 / damped * np.sin(damped * after)
    return angle, rate


def motion_of(time, angle=None, rate=None, seed=0, noise=1.0):
    random = np.random.default_rng(seed)
    if angle is not None:
        angle = angle + noise * ANGLE_NOISE * random.normal(size=time.size)
    if rate is not None:
        rate = rate + noise * RATE_NOISE * random.normal(size=time.size)
    return AxisMotion('roll', time, angle, rate, 'a record')


def held_then_released(seed, damping_ratio, amplitude_deg=6.0, duration=25.0, trim_deg=0.5):
    """At rest, inclined within a second, held for four, released at 8 s."""
    time = np.arange(0.0, 8.0 + duration, 1 / RATE_HZ)
    amplitude = np.radians(amplitude_deg)
    angle, _ = released(time - 8.0, amplitude, damping_ratio)
    inclined = np.clip(time - 3.0, 0.0, 1.0)
    angle = np.where(time < 8.0, amplitude * 0.5 * (1 - np.cos(np.pi * inclined)), angle)
    return motion_of(time, angle + np.radians(trim_deg), seed=seed)


def sea(seed, duration=300.0, rate_hz=10.0):
    """Roll of a hull of random period and damping in a JONSWAP sea."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1 / rate_hz)
    circular = 2 * np.pi * np.fft.rfftfreq(time.size, 1 / rate_hz)[1:]
    natural = 2 * np.pi / random.uniform(1.5, 8.0)
    damping_ratio = 10 ** random.uniform(-1.8, -0.4)
    peak = natural / random.uniform(0.7, 1.8)
    spectrum = jonswap(circular, peak, random.choice([1.0, 3.3, 7.0]))
    response = natural**2 * circular**2 / (natural**2 - circular**2 + 2j * damping_ratio * natural * circular)
    phases = random.normal(size=circular.size) + 1j * random.normal(size=circular.size)
    angle = np.fft.irfft(np.concatenate([[0.0], response * np.sqrt(spectrum) * phases]), time.size)
    return motion_of(time, angle * np.radians(random.uniform(1.0, 6.0)) / angle.std(), seed=seed)


@pytest.mark.parametrize('uneven', [False, True])
def test_turning_points_of_a_linear_decay(uneven):
    zeta, amplitude = 0.05, 0.1
    time = np.arange(0.0, 12.0, 1 / RATE_HZ)
    if uneven:
        time = time + np.random.default_rng(1).uniform(-0.003, 0.003, time.size)
    angle, _ = released(time, amplitude, zeta)
    points = find_turning_points(motion_of(time, angle), PERIOD)
    half = 0.5 * PERIOD / np.sqrt(1 - zeta**2)
    number = np.arange(1, points.time.size + 1)
    assert points.time.size >= 10
    np.testing.assert_allclose(points.time, half * number, atol=0.03)
    fall = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    np.testing.assert_allclose(points.value, amplitude * (-fall) ** number, atol=0.0015)
    assert mean_period(points) == pytest.approx(2 * half, rel=0.003)


@given(st.floats(-1.0, 1.0), st.floats(0.01, 2.0), st.floats(0.1, 0.99), st.integers(3, 30))
def test_centre_of_a_geometric_decay_is_exact(centre, amplitude, ratio, number):
    value = centre + amplitude * (-ratio) ** np.arange(number)
    assert centre_of_decay(value) == pytest.approx(centre, abs=1e-6)


@pytest.mark.parametrize('damping_ratio', [0.03, 0.05, 0.13, 0.24])
@pytest.mark.parametrize('seed', range(3))
def test_released_after_being_held(seed, damping_ratio):
    decay = find_decay(held_then_released(seed, damping_ratio))
    assert decay.beginning == 'released'
    assert decay.start == pytest.approx(8.0, abs=0.015)
    assert decay.period == pytest.approx(PERIOD / np.sqrt(1 - damping_ratio**2), rel=0.03)
    assert np.degrees(decay.trim) == pytest.approx(0.5, abs=0.1)
    assert np.degrees(decay.initial_amplitude) == pytest.approx(6.0, rel=0.03)
    assert decay.ending in ('noise-floor', 'record-end', 'faded')
    assert decay.final_amplitude < 0.15 * decay.initial_amplitude
    assert decay.advice == ()


@pytest.mark.long
def test_a_release_is_timed_although_the_hand_wobbles(benchmark_module):
    made, off, intervals = benchmark_module('decays'), [], []
    for hull, angle_deg, seed in product(made.HULLS, (2.0, 4.0, 8.0), range(3)):
        release = made.released_again(hull, angle_deg, 1, seed)
        (decay,) = find_decays(release.motion)
        off.append(abs(decay.start - release.releases[0]))
        intervals.append(release.motion.sample_interval)
    assert np.mean(off < np.maximum(made.NEAR_S, intervals)) > 0.95
    assert np.median(off) < 0.007 and np.quantile(off, 0.9) < 0.025


@pytest.mark.long
def test_a_strongly_wobbling_hand_does_not_hide_the_release_of_a_heavily_damped_hull(benchmark_module):
    made, off = benchmark_module('basin'), []
    hulls = 'hydrofoil-pitch 3', 'swath-usv-pitch 5'
    for hull, scene, seed in product(hulls, ('all', 'wobble-trim'), (0, 1, 3, 5, 8, 9)):
        trial = made.made_trial(hull, made.SCENES[scene], seed)
        off.append(abs(find_decay(AxisMotion(trial.axis, trial.time, trial.angle, trial.rate)).start - trial.release))
    assert max(off) < 0.1


def test_rate_only():
    time = np.arange(-5.0, 25.0, 1 / RATE_HZ)
    rate = released(time, np.radians(6.0), 0.05)[1]
    decay = find_decay(motion_of(time, rate=rate))
    assert (decay.quantity, decay.beginning) == ('rate', 'released') and abs(decay.start) < 0.02 * PERIOD
    assert decay.period == pytest.approx(PERIOD, rel=0.02)
    # a steady push until the largest rate
    peak = PERIOD / 4 * 0.97
    pushed = np.where(time < peak, np.clip(time / peak, 0.0, 1.0) * rate[np.argmin(np.abs(time - peak))], rate)
    decay = find_decay(motion_of(time, rate=pushed))
    assert decay.beginning == 'pushed' and 0.2 * PERIOD <= decay.start <= 1.6 * PERIOD


@pytest.mark.parametrize('seed', range(3))
def test_two_releases_in_one_record(seed):
    first = held_then_released(seed, 0.1, 6.0)
    second = held_then_released(seed + 10, 0.1, 4.0)
    later = second.time + first.time[-1] + 0.01
    both = AxisMotion('roll', np.append(first.time, later), np.append(first.angle, second.angle), None)
    decays = find_decays(both)
    assert [d.start for d in decays] == pytest.approx([8.0, later[0] + 8.0], abs=0.3)


@pytest.mark.parametrize('scale', [1.0, 10.0])
@pytest.mark.parametrize(('waves_after', 'rests'), [(None, True), (2.5, True), (1.5, False)])
def test_a_craft_rests_after_a_push_if_no_waves_come_within_two_periods(scale, waves_after, rests):
    time = np.arange(0.0, 60.0, 1 / RATE_HZ)
    angle = -released(time - 10.0, np.radians(6.0), 0.2)[1] * (time >= 10.0) / np.pi
    (decay,) = find_decays(motion_of(time, angle))
    if waves_after is not None:
        since = time - decay.end - waves_after * decay.period
        angle = angle + np.radians(3.0) * np.sin(2 * np.pi * since / PERIOD) * (since > 0.0)
    stretched = replace(decay, start=scale * decay.start, end=scale * decay.end, period=scale * decay.period)
    until = time <= decay.end + 2.2 * decay.period
    assert rests_after(stretched, AxisMotion('roll', scale * time[until], angle[until], None, 'a record')) == rests
    early = time <= decay.end + 1.8 * decay.period
    assert not rests_after(decay, AxisMotion('roll', time[early], angle[early], None, 'a record'))


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_three_releases_by_hand_that_only_a_gyroscope_has_recorded(sign):
    """Each is amid the motion of the others, and the hand stops the craft in its swing and turns it back."""
    time = np.arange(0.0, 35.0, 1 / RATE_HZ)
    rate = np.zeros(time.size)
    for start in (3.0, 15.0, 27.0):
        swing = (time >= start) & (time < start + 8.2)
        rate[swing] = sign * released(time[swing] - start, np.radians(6.0), 0.02)[1]
        hand = (time >= start + 8.2) & (time < start + 10.2)
        rate[hand] = sign * 0.04 * np.sin(np.pi / 2.0 * (time[hand] - start - 8.2))
    found = find_decays(motion_of(time, rate=rate, noise=0.1))
    assert sorted(round(each.start) for each in found) == [3, 15, 27]
    assert {each.beginning for each in found} == {'released'}


@pytest.mark.parametrize('scale', [1.0, 10.0])
def test_slow_noise_does_not_hide_that_a_released_craft_loses_motion_to_friction(scale):
    """Double amplitudes are out of order by 2 %, as with an attitude filter; before, the craft was held."""
    period, first, whole = 2.0 * scale, np.radians(5.0), 0
    time = np.arange(0.0, 24.0 * period, period / 50.0)
    after = np.maximum(time - 3.0 * period, 0.0)
    angle = (first - 0.02 * first * after / period) * np.cos(2.0 * np.pi * after / period)
    for seed in range(10):
        white = np.random.default_rng(seed).normal(size=time.size)
        slow = np.convolve(white, np.exp(-np.arange(60) / 12.0))[: time.size]
        found = find_decays(AxisMotion('roll', time, angle + 0.015 * first * slow / slow.std(), None, 'a record'))
        whole += len(found) == 1 and found[0].beginning == 'released' and found[0].end > 20.0 * period
    assert whole >= 8


@pytest.mark.parametrize('scale', [1.0, 10.0])
def test_the_rate_shows_a_decay_that_the_slow_noise_of_an_attitude_filter_hides(scale):
    """It is a tenth of the angle and turns the order of half-cycles, which lose 5 % each."""
    time, known = np.arange(0.0, 46.0, 1 / 25.0), {'rate': 0, 'angle': 0}
    angle, rate = released(time - 3.0, np.radians(2.0), 0.016)
    for seed in range(6):
        white = np.random.default_rng(seed).normal(size=time.size)
        slow = np.convolve(white, np.exp(-np.arange(60) / 7.0))[: time.size]
        hidden = angle + 0.1 * angle[0] * slow / slow.std()
        for name, given_rate in (('rate', rate / scale), ('angle', None)):
            found = find_decays(AxisMotion('roll', scale * time, hidden, given_rate))
            known[name] += [each.beginning for each in found] == ['released']
    assert known == {'rate': 6, 'angle': 3}


@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_where_a_hand_holds_the_craft_last_is_not_its_trim(sign):
    """Light damping and long holds to one side: the last third of the record is mostly held there."""
    time, angle = np.arange(0.0, 68.0, 1 / 25.0), np.empty(1700)
    for start, size in ((0.0, -12.0), (17.0, 9.0), (34.0, 9.0), (51.0, -10.0)):
        part = (time >= start) & (time < start + 17.0)
        swing = released(time[part] - start - 8.0, np.radians(size), 0.011)[0]
        angle[part] = np.where(time[part] < start + 2.0, swing * (time[part] - start) / 2.0, swing)
    found = find_decays(motion_of(time, sign * angle, noise=0.1))
    assert {8.0, 59.0} <= {float(np.round(each.start)) for each in found}


@pytest.mark.parametrize('hull', ['swath-pitch', 'swath-usv-pitch', 'hydrofoil-pitch'])
@pytest.mark.parametrize('rate_hz', [5.0, 10.0])
def test_a_small_sparse_release_at_the_start_of_the_record(hull, rate_hz):
    """Of few half-cycles, after which a sample's noise may hide that the craft is at rest."""
    for seed in (1, 2, 3):
        trial = simulated_trial(hull_named(hull).model, np.radians(2.0), 15.0, rate_hz, SensorNoise(1e-3, 0.0165), seed)
        (decay,) = find_decays(trial.axis('pitch'))
        assert decay.start <= 2.0 / rate_hz


def test_the_hand_that_releases_again_is_no_disturbance_to_tell_of():
    craft = SimulatedCraft(CraftSettings(hull_named('swath-roll').model, np.radians(6.0), rate_hz=50.0))
    angle = []
    for number in range(2000):
        if number in (500, 1000):
            craft.release()
        angle.append(craft.next_reading().roll)
    decays = find_decays(AxisMotion('roll', np.arange(2000) / 50.0, np.array(angle), None))
    assert sorted(d.ending for d in decays) == ['disturbed', 'record-end']
    assert [d.advice for d in decays] == [(), ()]


@pytest.mark.parametrize('scale', [1.0, 0.1])
def test_the_quiet_after_a_decay_is_left_out_where_a_hand_soon_releases_again(scale):
    phase = 2.0 * np.pi * np.arange(0.0, 4.5, 0.01)
    decay = np.exp(-0.2 * phase) * np.cos(phase)
    lift = decay[-1] + (0.8 - decay[-1]) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 100)))
    angle = 0.2 * np.concatenate([np.full(150, 1.0), decay, lift, np.full(150, 0.8), 0.8 * decay])
    angle += 1e-3 * np.random.default_rng(0).normal(size=angle.size)
    time = 0.01 * scale * PERIOD * np.arange(angle.size)
    first, _ = sorted(find_decays(AxisMotion('roll', time, angle, None)), key=lambda found: found.start)
    end = first.start + first.cycles * first.period
    assert first.ending == 'noise-floor' and first.end == pytest.approx(end)


@pytest.mark.parametrize('seed', range(3))
def test_ends_before_a_reflected_wave_and_before_the_craft_is_stopped(seed):
    motion = held_then_released(seed, 0.02, trim_deg=0.0)
    wave = 0.05 * np.sin(2 * np.pi * motion.time / 1.7) * np.exp(-(((motion.time - 24.0) / 2.5) ** 2))
    reflected = find_decay(replace(motion, angle=motion.angle + wave))
    assert 16.0 < reflected.end < 24.0
    assert [a.code for a in reflected.advice] == ['disturbed-tail']
    assert f'{reflected.end:.1f} s' in reflected.advice[0].message
    braked = find_decay(replace(motion, angle=motion.angle * np.exp(-np.maximum(motion.time - 20.0, 0.0) / 0.4)))
    assert 17.0 < braked.end <= 20.2
    assert reflected.ending == braked.ending == 'disturbed'


@pytest.mark.parametrize(('decrement', 'number'), [(0.0036, 0), (0.005, 1)])
def test_motion_that_hardly_loses_anything_is_sustained(decrement, number):
    assert len(find_decays(held_then_released(0, decrement / np.pi, duration=60.0))) == number


@pytest.mark.parametrize(('duration', 'number'), [(4.5, 0), (5.5, 1)])
def test_a_record_that_begins_at_the_release_needs_six_half_cycles(duration, number):
    time = np.arange(0.0, duration, 0.02)
    assert len(find_decays(motion_of(time, released(time, 0.1, 0.05)[0]))) == number


@pytest.mark.parametrize(('samples', 'beginning'), [(3, 'released'), (4, 'pushed')])
def test_a_rise_faster_than_the_craft_oscillates_is_a_cut_in_the_record(samples, beginning):
    time = np.arange(0.0, 40.0, 0.05)
    rising = 0.1 * np.clip(1.0 + (time - 10.0) / (0.05 * samples), 0.0, 1.0)
    angle = np.where(time < 10.0, rising, released(time - 10.0, 0.1, 0.05)[0])
    (decay,) = find_decays(motion_of(time, angle, noise=0.2))
    assert decay.beginning == beginning


def test_what_breaks_a_decay_is_none_but_a_push_five_periods_later_is():
    motion = held_then_released(0, 0.02, trim_deg=0.0)
    wave = 0.05 * np.sin(2 * np.pi * motion.time / 1.7) * np.exp(-(((motion.time - 20.0) / 2.5) ** 2))
    assert len(find_decays(replace(motion, angle=motion.angle + wave))) == 1
    time = np.arange(0.0, 60.0, 1 / RATE_HZ)
    stopped = np.where(time < 8.0, 0.1 * np.clip(time - 3.0, 0.0, 1.0), released(time - 8.0, 0.1, 0.02)[0])
    stopped *= np.exp(-np.maximum(time - 14.0, 0.0) / 0.4)
    natural, since = 2 * np.pi / PERIOD, np.maximum(time - 24.0, 0.0)
    pushed = 0.06 * np.exp(-0.06 * natural * since) * np.sin(natural * since)
    assert [d.beginning for d in find_decays(motion_of(time, stopped + pushed))] == ['released', 'pushed']


@pytest.mark.parametrize(('lull', 'keeps'), [(0.2, True), (0.3, False)])
def test_waves_may_have_a_lull_of_a_quarter_of_the_record(lull, keeps):
    time = np.arange(0.0, 200.0, 0.05)
    waves = np.where(np.abs(time - 100.0) < 100.0 * lull, 0.0, 0.1 * np.sin(np.pi * time))
    assert keeps_oscillating(motion_of(time, waves, noise=0.1)) == keeps


@pytest.mark.parametrize(('part', 'number'), [(0.15, 1), (0.25, 2)])
def test_a_long_pause_splits_a_record(part, number):
    time = np.arange(0.0, 20.0, 0.05)
    assert len(split_at_pauses(motion_of(time + 20.0 * part * (time > 8.0), np.sin(time)))) == number


@pytest.mark.parametrize(('gap', 'is_hidden'), [(0.12, False), (0.2, True)])
def test_a_gap_of_a_sixth_of_a_half_cycle_may_hide_a_turning_point(gap, is_hidden):
    signal = EvenSignal('angle', 0.0, 0.001, np.zeros(3000), 0.0, 0.0, np.array([[1.4, 1.4 + gap]]))
    assert bridged_half_cycles(np.array([0.0, 1.0, 2.0, 3.0]), signal).tolist() == [False, is_hidden, False]


@pytest.mark.parametrize(('ripple', 'number'), [(0.0016, 1), (0.0026, 3)])
def test_trifles_of_a_record_without_noise_are_no_turning_points(ripple, number):
    value = np.interp(np.arange(2001), [0, 800, 1000, 1200, 2000], [0.0, 1.0, 1.0 - ripple, 1.0, 0.0])
    signal = EvenSignal('angle', 0.0, 0.0005, value, 0.0, 0.0, np.empty((0, 2)))
    assert turning_points_of(signal).time.size == number


def test_the_grid_of_a_long_record_is_bounded():
    """20 samples per period suffice in an hour of 1 s periods."""
    sizes = [even_signal(motion_of(np.arange(count) / 20.0, np.zeros(count))).value.size for count in (60_000, 90_000)]
    assert sizes[0] == 60_000 and sizes[1] < 90_000


@pytest.mark.parametrize(
    'spoil',
    [
        lambda motion, random: replace(motion, angle=motion.angle + 2.0 * (random.random(motion.size) < 0.006)),
        lambda motion, _: replace(motion, angle=np.radians(0.5) * np.round(motion.angle / np.radians(0.5))),
        lambda motion, _: replace(motion, angle=np.repeat(motion.angle[::10], 10)[: motion.size]),
        lambda motion, _: motion.only(slice(None, None, 20)),
        lambda motion, random: motion.only(random.random(motion.size) < 0.5),
        lambda motion, _: motion.only((motion.time <= 14.0) | (motion.time >= 15.3)),
    ],
    ids=['spikes', 'rounded', 'repeated', 'sparse', 'thinned', 'gap'],
)
def test_spoilt_records(spoil):
    decay = find_decay(spoil(held_then_released(2, 0.03), np.random.default_rng(0)))
    assert decay.start == pytest.approx(8.15, abs=0.25)
    assert decay.period == pytest.approx(PERIOD, rel=0.01)
    assert decay.end > 25.0


@pytest.mark.long
def test_no_decay_in_the_sea_nor_in_regular_waves_nor_where_waves_set_in_after_rest():
    for seed in range(30):
        motion = sea(seed)
        assert find_decays(motion) == (), f'sea {seed}'
        assert explain_absence(motion).code == 'forced-motion', f'sea {seed}'
    time = np.arange(0.0, 60.0, 1 / RATE_HZ)
    for noise in (0.0, 1.0):
        assert find_decays(motion_of(time, 0.1 * np.sin(2.5 * time), noise=noise)) == ()
    for seed in range(8):
        motion = sea(seed, duration=180.0)
        rising = np.clip((motion.time - 60.0) / 3.0, 0.0, 1.0)
        assert find_decays(replace(motion, angle=motion.angle * rising + 1e-4)) == (), f'sea {seed}'


def narrow_sea(seed, scale, rate_hz=10.0, minutes=30.0):
    """Times and roll of a lightly damped hull of 4 s in waves of its natural period, slower by a factor."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0 * minutes, 1 / rate_hz)
    circular, natural = 2 * np.pi * np.fft.rfftfreq(time.size, 1 / rate_hz)[1:], 0.5 * np.pi
    response = natural**2 * circular**2 / (natural**2 - circular**2 + 0.06j * natural * circular)
    phases = random.normal(size=circular.size) + 1j * random.normal(size=circular.size)
    spectrum = np.concatenate([[0.0], response * np.sqrt(jonswap(circular, natural, 7.0)) * phases])
    angle = np.fft.irfft(spectrum, time.size)
    return scale * time, 0.06 * angle / angle.std() + random.normal(0.0, 3e-4, time.size)


@pytest.mark.long
@pytest.mark.parametrize('scale', [0.1, 1.0, 10.0])
def test_a_wave_group_in_a_record_of_a_minute_is_no_decay(scale):
    for seed in range(4):
        time, angle = narrow_sea(seed, scale)
        for part in np.split(np.arange(time.size), 30):
            assert find_decays(AxisMotion('roll', time[part], angle[part], None)) == (), f'sea {seed}, row {part[0]}'


@pytest.mark.parametrize(('resting', 'number'), [(0.2, 0), (0.32, 1)])
def test_a_pushed_craft_rests_for_a_quarter_of_the_time_around_its_decay(resting, number):
    # three periods: more half-cycles and a rest after them would tell the decay by themselves
    time = np.arange(0.0, 86.0, 1 / RATE_HZ)
    natural, since = 2 * np.pi / PERIOD, np.maximum(time - 80.0, 0.0)
    pushed = 0.06 * np.exp(-0.1 * natural * since) * np.sin(natural * since)
    waves = 0.012 * np.sin(natural * time) * (time < 80.0 * (1.0 - resting))
    assert len(find_decays(motion_of(time, pushed + waves))) == number


@pytest.mark.parametrize(('damping_ratio', 'cycles'), [(0.05, 15.0), (0.012, 12.0)], ids=['died-out', 'cut'])
@pytest.mark.parametrize('pace', [0.1, 1.0])
def test_a_craft_that_is_rocked_from_the_first_sample_and_let_go(damping_ratio, cycles, pace):
    """Rocked at its natural period, which ends without a hold, with the growing motion of a resonance."""
    natural = 2 * np.pi / PERIOD
    time = np.arange(0.0, (3.0 + cycles) * PERIOD, 1 / RATE_HZ)
    let_go = 3.0 * PERIOD
    rocked = 0.12 * np.minimum(time, let_go) / let_go * np.cos(natural * time)
    angle = rocked * np.exp(-damping_ratio * natural * np.maximum(time - let_go, 0.0))
    noisy = angle + 1e-4 * np.random.default_rng(3).normal(size=time.size)
    decay = max(find_decays(AxisMotion('roll', time * pace, noisy, None)), key=lambda each: each.duration)
    assert abs(decay.start - let_go * pace) < 1.6 * PERIOD * pace and decay.cycles > 8.0
    assert decay.period == pytest.approx(PERIOD * pace, rel=0.01)


@pytest.mark.parametrize(('inclined', 'periods'), [(-0.15, 1.25), (0.18, 1.0)])
def test_the_last_move_of_a_hand_is_no_part_of_the_decay(inclined, periods):
    """A hand inclines the craft, moves it on to another angle, on the other side or the same, and lets go there."""
    time, way = np.arange(0.0, 18.0 * PERIOD, 1 / RATE_HZ), [0.0, inclined, 0.1]
    let_go, hand = 5.0 * PERIOD, np.zeros_like(time)
    for place, begin in enumerate((let_go - (1.5 + periods) * PERIOD, let_go - periods * PERIOD)):
        part = np.clip((time - begin) / PERIOD / (1.5, periods)[place], 0.0, 1.0)
        hand += (way[place + 1] - way[place]) * 0.5 * (1.0 - np.cos(np.pi * part))
    free, _ = released(time - let_go, 0.1, 0.07)
    (decay,) = find_decays(motion_of(time, np.where(time < let_go, hand, free)))
    assert -0.3 * PERIOD < decay.start - let_go < 1.7 * PERIOD and decay.cycles > 6.0
    assert decay.period == pytest.approx(PERIOD, rel=0.02)


def test_what_the_user_calls_a_decay_is_no_waves_and_slow_noise_breaks_none():
    """Half-cycles that shrink by less than the noise of a trim that wanders, in a record that shows nothing else."""
    random, whole = np.random.default_rng(0), 0
    time = np.arange(0.0, 14.0 * PERIOD, 1 / RATE_HZ)
    for _ in range(4):
        wander = np.interp(time, 0.5 * PERIOD * np.arange(29), random.normal(0.0, 0.003, 29))
        found = find_decays(AxisMotion('roll', time, released(time, 0.2, 0.006)[0] + wander, None))
        whole += bool(found and found[0].cycles > 12.0)
    assert whole >= 3
    time = np.arange(0.0, 60.0, 1 / RATE_HZ)
    amid = released(time, 0.1, 0.02)[0] * (time < 14.0) + 0.1 * np.sin(2 * np.pi * time / 3.1) * (time >= 14.0)
    waves = motion_of(time, amid)
    assert find_decays(waves) == () and decays_or_absence(waves, is_decay=True)[0].cycles > 5.5


@pytest.mark.parametrize(('seed', 'sign', 'pace'), [(3, 1.0, 1.0), (3, -1.0, 10.0), (1, 1.0, 1.0), (28, 1.0, 0.1)])
def test_slow_noise_breaks_no_decay_whose_half_cycles_shrink_in_the_mean(seed, sign, pace):
    """Noise of 1 % of the release, about as slow as the motion, in a lightly damped decay: one decay to the end."""
    random = np.random.default_rng([5, seed])
    period, damping_ratio = np.exp(random.uniform(0, np.log(6))), np.exp(random.uniform(np.log(0.003), np.log(0.02)))
    cycles, hold = random.uniform(12, 30), random.uniform(1, 3) * period
    time = np.arange(0.0, hold + cycles * period, period / 30.0)
    white = random.normal(size=time.size + 400)
    noise = gaussian_filter1d(white, random.uniform(0.3, 1.5) * 30.0)[200:-200]
    angle = released(time - hold, 0.15, damping_ratio, period)[0] + 0.0015 * noise / np.std(noise)
    decay = max(find_decays(AxisMotion('roll', time * pace, sign * angle, None)), key=lambda each: each.duration)
    assert decay.cycles > 0.9 * min(cycles, np.log(8.0) / (2.0 * np.pi * damping_ratio))


@pytest.mark.parametrize(('period', 'damping_ratio'), [(5.2, 0.015), (4.7, 0.02)])
def test_a_decay_that_outlasts_the_window_is_noticed_before_its_start_leaves_it(period, damping_ratio):
    """Rocked and let go, cut after ten cycles, long before it has fallen to a tenth."""
    time = np.arange(0.0, 14.0 * period, 0.2)
    let_go = 3.0 * period
    angle = np.minimum(time, let_go) / let_go * released(time - let_go, 0.12, damping_ratio, period)[0]
    angle[time < let_go] *= np.cos(2.0 * np.pi * time[time < let_go] / period)
    window, found = MotionWindow(), []
    unknown = (np.nan,) * 4
    for stamp, roll in zip(time, angle + 2e-4 * np.random.default_rng(8).normal(size=time.size), strict=True):
        sample = CraftSample(round(1e18 + 1e9 * stamp), roll, np.nan, np.nan, np.nan, 0.0, 0.0, 9.8, *unknown)
        step = window.add_converted(ConvertedReading(sample, ()))
        found += [step.finished] if step.finished else []
    assert len(found) == 1 and found[0].segment.cycles > 6.0
    assert found[0].segment.period == pytest.approx(period, rel=0.01)


def test_a_boat_that_tacks_is_not_released_and_unlike_releases_are_not_fitted_together():
    motion = held_then_released(2, 0.03)
    (decay,) = find_decays(motion)
    for turned, biased, number in ((80.0, 0.0, 0), (-80.0, 0.3, 0), (0.0, 0.5, 1), (4.0, -0.5, 1), (0.0, 10.0, 1)):
        heading = 0.5 * turned * np.tanh((motion.time - decay.start) / PERIOD) + biased * motion.time
        with_heading = replace(motion, heading=np.column_stack([motion.time, np.radians(heading)]))
        assert len(find_decays(with_heading)) == number, (turned, biased)
        if not number:
            absence = explain_absence(with_heading)
            # over two periods about the middle
            assert absence.code == 'craft-turned' and f'by {80.0 * np.tanh(1.0):.0f} deg within' in absence.message
    quick, soft = (replace(decay, start=90.0, end=99.0, period=ratio * PERIOD) for ratio in (0.3, 1.2))
    assert to_be_fitted((decay, soft)) == (decay, soft)
    (kept,) = to_be_fitted((decay, quick))
    assert replace(kept, advice=()) == replace(decay, advice=())
    assert kept.advice[-1].code == 'unlike-releases' and f'{quick.period:.3g} s from 90.0 s' in kept.advice[-1].message


def test_absence_says_what_was_seen_and_what_to_do():
    time = np.arange(0.0, 60.0, 1 / RATE_HZ)
    still, drift = (explain_absence(motion_of(time, slope * time)) for slope in (0.0, 0.01))
    assert (still.code, drift.code) == ('too-small', 'no-decay') and 'release' in still.message
    assert 'give start and end' in explain_absence(sea(3)).message
    with pytest.raises(InputError, match='waves'):
        find_decay(sea(3))


def test_given_bounds_are_taken_as_they_are():
    motion = held_then_released(0, 0.05)
    whole, both = find_decay(motion), find_decay(motion, 10.0, 20.0)
    assert (both.start, both.end, both.beginning, both.ending) == (10.0, 20.0, 'given', 'given')
    assert (both.period, both.cycles) == pytest.approx((PERIOD, 10.0 / PERIOD), rel=0.02)
    start, end = find_decay(motion, start=12.0), find_decay(motion, end=15.0)
    assert (start.start, start.beginning, start.ending) == (12.0, 'given', whole.ending)
    assert start.end == pytest.approx(whole.end, abs=1.1 * PERIOD)
    assert (end.end, end.ending) == (15.0, 'given')
    assert end.start == pytest.approx(whole.start, abs=0.05)
    # even in waves a given start is accepted
    assert find_decay(sea(4), start=30.0).start == 30.0


def test_impossible_bounds():
    motion = held_then_released(0, 0.03)
    motion = replace(motion, angle=np.where(motion.time < 2.0, 0.0, motion.angle))
    for *bounds, words in ((20.0, 10.0, 'before'), (10.0, 10.03, 'too few samples'), (1.0, 1.9, 'constant')):
        with pytest.raises(InputError, match=words):
            find_decay(motion, *bounds)


def test_a_decay_is_finished_once_and_stays_where_it_is():
    motion = held_then_released(5, 0.1)
    ends = np.arange(9.0, 33.0, 1.0)
    found = [(end, find_decays(motion.between(None, end))) for end in ends]
    finished = [end for end, decays in found if any(is_finished(d, motion.between(None, end)) for d in decays)]
    # A tenth of critical damping leaves 10 % after 3.7 periods, at 15.4 s.
    assert 13.0 <= finished[0] <= 18.0
    assert finished == [end for end in ends if end >= finished[0]]
    starts = [decays[0].start for end, decays in found if end in finished]
    assert max(starts) - min(starts) < 0.05


@pytest.mark.long
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 400),
    st.sampled_from(['noise', 'walk', 'constant', 'steps', 'huge', 'decay']),
    st.booleans(),
    st.sampled_from([1e-6, 0.01, 1.0, 1e5]),
)
@example(33555787, 259, 'walk', False, 0.01)  # whose kink lies before the first sample
@pytest.mark.filterwarnings('error')
def test_never_anything_but_segments_or_one_sentence(seed, size, kind, as_rate, interval):
    random = np.random.default_rng(seed)
    time = np.cumsum(interval * random.exponential(size=size) + 1e-9) + random.normal()
    value = {
        'noise': lambda: random.normal(size=size),
        'walk': lambda: np.cumsum(random.normal(size=size)),
        'constant': lambda: np.full(size, random.normal()),
        'steps': lambda: np.repeat(random.normal(size=size), 7)[:size],
        'huge': lambda: 1e100 * random.normal(size=size),
        'decay': lambda: np.exp(-np.arange(size) / 60.0) * np.cos(np.arange(size) / random.uniform(0.5, 10.0)),
    }[kind]()
    motion = AxisMotion('pitch', time, *((None, value) if as_rate else (value, None)))
    for decay in find_decays(motion):
        assert time[0] <= decay.start < decay.end <= time[-1]
        assert decay.period > 0.0
        assert np.isfinite([decay.cycles, decay.initial_amplitude, decay.final_amplitude, decay.trim]).all()
    assert all(a.message for a in check_motion(motion))
    for bounds in ((), (time[size // 4], time[-1])):
        try:
            decay = find_decay(motion, *bounds)
        except InputError as problem:
            assert len(str(problem)) > 20
        else:
            assert all(a.message for a in check_decay(motion, decay))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 100), st.sampled_from([-1.0, 1.0]), st.floats(-1e5, 1e9), st.floats(-0.5, 0.5))
def test_sign_clock_and_trim_do_not_matter(seed, sign, clock, trim):
    motion = held_then_released(seed, 0.06)
    plain = find_decay(motion)
    changed = find_decay(replace(motion, time=motion.time + clock, angle=sign * motion.angle + trim))
    assert changed.start - clock == pytest.approx(plain.start, abs=0.02)
    assert changed.end - clock == pytest.approx(plain.end, abs=0.2)
    assert changed.initial_amplitude == pytest.approx(plain.initial_amplitude, rel=0.01)
    assert changed.trim == pytest.approx(sign * plain.trim + trim, abs=1e-3)


def test_measured_decays_in_tanks(data_folder):
    names = [
        *(f'kvlcc2/{name}.csv' for name in ('run3_15kn', 'run2_0kn')),
        *(data_folder / 'decay/foswec').glob('*.csv'),
    ]
    trials = [read_trial(data_folder / 'decay' / name) for name in names]
    motions = [trial.axis('roll' if n < 2 else 'pitch') for n, trial in enumerate(trials)]
    braked, light, *platform = [find_decay(motion) for motion in motions]
    assert 24.0 <= braked.start <= 30.0 and 70.0 <= braked.end < 77.0
    assert (braked.beginning, braked.ending) == ('pushed', 'disturbed')
    assert 9.0 <= light.start <= 12.0 and light.duration >= 165.0 and light.advice == ()
    assert 2.54 <= braked.period <= 2.55 and 2.54 <= light.period <= 2.55
    assert len(platform) == 9
    for path, decay in zip(names[2:], platform, strict=True):
        assert -0.15 <= decay.start <= 0.1, path.name
        assert decay.cycles >= 3.8, path.name
        assert decay.period == pytest.approx(1.81, abs=0.05), path.name
        assert decay.advice == (), path.name
    # the checks are silent on all
    for motion, decay in zip(motions, (braked, light, *platform), strict=True):
        assert check_motion(motion) == check_decay(motion, decay) == ()


HULL = DecayModel.of(b1=0.25, r1=9.0, axis='roll')


def quality_decay(rate_hz=100.0, angle_deg=8.0, angle_noise=0.0005):
    noise = SensorNoise(angle_noise, 0.002)
    trial = simulated_trial(HULL, np.radians(angle_deg), 25.0, rate_hz, noise, seed=1, hold=2.0)
    return replace(trial.axis('roll'), rate=None)


def codes(motion, start=2.2, end=20.0):
    segment = find_decay(motion, start, end)
    return {a.code for a in (*check_motion(motion), *check_decay(motion, segment))}


def test_good_simulated_records_pass_even_with_lone_losses():
    motion = quality_decay()
    lost = np.arange(motion.size) % 37 == 0
    assert codes(motion) == codes(motion, None, None) == codes(motion.only(~lost)) == set()
    assert check_motion(motion, find_decays(motion)) == check_motion(motion)
    assert 'low-rate' not in codes(quality_decay(rate_hz=12.0))
    for rate_hz in (3.0, 5.0, 10.0):  # the kink of a release is no spike
        motion = simulated_trial(HULL, np.radians(8.0), 25.0, rate_hz, SensorNoise(0.0, 0.0), seed=1).axis('roll')
        assert 'spikes' not in {a.code for a in check_decay(motion, find_decay(motion))}


@pytest.mark.parametrize(
    ('made', 'bounds', 'code'),
    [
        ({}, (2.2, 5.0), 'too-few-cycles'),
        ({'angle_deg': 0.4, 'angle_noise': 0.0001}, (2.2, 10.0), 'too-small'),
        ({'rate_hz': 6.0}, (), 'low-rate'),
    ],
)
def test_simulated_records_are_told_what_they_lack(made, bounds, code):
    assert code in codes(quality_decay(**made), *bounds)


@pytest.mark.parametrize(
    ('name', 'code'),
    [
        ('records/morro_buoy', 'forced-motion'),
        ('waves/nbp1406_ship', 'forced-motion'),
        ('faults/oahu_static_bad_packets', 'too-small'),
    ],
)
def test_records_without_a_decay_say_why(name, code, request):
    folder = ROOT if name.startswith('records') else request.getfixturevalue('data_folder')
    trial = read_trial(folder / f'{name}.csv')
    for motion in map(trial.axis, trial.axes):
        assert find_decays(motion) == () and [a.code for a in check_motion(motion)] == [code]
        assert code == 'too-small' or code in [a.code for a in check_decay(motion, find_decay(motion, 100.0, 300.0))]


def test_gaps_and_spikes():
    motion = quality_decay()
    holed = motion.only(~((motion.time > 4.0) & (motion.time < 4.6)))
    angle = motion.angle.copy()
    angle[[500, 900, 1300]] += 0.3
    for spoilt, code, words in ((holed, 'gaps', '0.6'), (replace(motion, angle=angle), 'spikes', '3 samples')):
        (found,) = check_decay(spoilt, find_decay(spoilt if code == 'gaps' else motion, 2.2, 20.0))
        assert found.code == code and words in found.message


@pytest.mark.parametrize(('part', 'number'), [(0.04, 0), (0.065, 1)])
def test_a_spike_of_a_twentieth_of_the_range_bends_a_fit(part, number):
    motion = quality_decay(angle_noise=1e-5)
    angle = motion.angle.copy()
    angle[900] += part * np.ptp(angle)
    assert motion.size - without_spikes(replace(motion, angle=angle)).size == number


def test_saturation_is_told_from_rounding():
    motion = quality_decay(angle_noise=0.0)
    assert codes(replace(motion, angle=np.clip(motion.angle, -0.08, 0.08)), 2.4, 20.0) == {'saturation'}
    assert codes(replace(motion, angle=np.round(motion.angle, 4))) == set()
    assert codes(replace(motion, angle=np.round(motion.angle / 0.005) * 0.005)) == set()
    whole = simulated_trial(HULL, np.radians(8.0), 25.0, 100.0, SensorNoise(0.0005, 0.002), seed=1).axis('roll')
    motion = replace(whole, rate=np.clip(whole.rate, -0.2, 0.2))
    (found,) = (a for a in check_decay(motion, find_decay(motion)) if a.code == 'saturation')
    assert '11.5 deg/s' in found.message


def test_being_held_is_not_saturation_and_clipped_swings_are_counted():
    time = np.arange(0.0, 40.0, 0.01)
    angle = np.full(time.size, 0.1)
    for release in (5.0, 25.0):
        free = (time >= release) & (time < release + 15.0)
        angle[free] = 0.1 * np.exp(-0.3 * (time[free] - release)) * np.cos(3.0 * (time[free] - release))
    assert clipped_extremes(angle, 100) == (0, 0.0)
    # swings that are clipped are counted
    time = np.arange(0.0, 30.0, 0.01)
    swing = 0.1 * np.exp(-0.05 * time) * np.cos(2 * np.pi * time / 3.0 + 1.0)
    turns = 1.5 * np.arange(1, 20) - 3.0 / (2 * np.pi)
    count, level = clipped_extremes(np.clip(swing, -0.07, 0.07), 150)
    assert level == pytest.approx(0.07)
    assert count == np.count_nonzero(0.1 * np.exp(-0.05 * turns) > 0.07)


def test_given_bounds_that_reach_too_far(data_folder):
    motion = read_trial(data_folder / 'decay/kvlcc2/run3_15kn.csv').axis('roll')

    def told(start, end):
        return [a.code for a in check_decay(motion, find_decay(motion, start, end))]

    assert told(26.0, 75.0) == []
    assert told(26.0, 87.0) == ['disturbed-tail']
    assert told(10.0, 75.0) == ['late-start']
