"""The sea from own motion: closed forms, simulated seas, and a buoy's own processing."""

import numpy as np
import pytest
from craft_at_sea import jonswap
from records_at_sea import evenly
from scipy import signal

from swath_sysid.attitude.motion.vertical import WITHOUT_RATES, even_stretches
from swath_sysid.attitude.prediction.sea_state import cross_spectra, sea_report, sea_state
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial
from swath_sysid.report.sea_report import sea_in_words

STEP, COUNT = 0.1, 12_000


def jonswap_record(height, period, direction, seed):
    """Twenty minutes of vertical acceleration, roll and pitch of a craft that lies on the water; the mean period."""
    rng, frequency = np.random.default_rng(seed), np.fft.rfftfreq(2 * COUNT, STEP)[1:]
    density = np.where((frequency < 0.04) | (frequency > 1.5), 0.0, jonswap(frequency, 1.0 / period, 3.3))
    density *= (height / 4.0) ** 2 / (density.sum() * frequency[0])
    parts = np.sqrt(density * frequency[0] / 4.0) * (rng.normal(size=(2, frequency.size)).T @ (1.0, 1j))
    squares = (2.0 * np.pi * frequency) ** 2

    def series(spectrum):
        return np.fft.irfft(np.concatenate([[0.0], spectrum]), 2 * COUNT)[:COUNT] * 2 * COUNT

    along, across = (series(1j * squares / 9.81 * part * parts) for part in (np.cos(direction), np.sin(direction)))
    mean_period = np.sqrt(density.sum() / (density * frequency**2).sum())
    return (series(-squares * parts), across, -along), mean_period


@pytest.mark.parametrize('rows', [2000, 1999])
def test_the_spectra_are_those_of_scipy(rows):
    channels = np.random.default_rng(4).normal(size=(3, COUNT)) + 5.0
    frequency, spectra = cross_spectra(channels, STEP, rows)
    expected = [[signal.csd(a, b, fs=1.0 / STEP, nperseg=rows) for b in channels] for a in channels]
    np.testing.assert_allclose(frequency, expected[0][0][0])
    np.testing.assert_allclose(spectra, [[pair[1] for pair in row] for row in expected], atol=1e-12)


def test_one_wave_has_its_own_height_and_period():
    w = 2.0 * np.pi * 0.1
    found = sea_state(-(w**2) * 0.5 * np.sin(w * STEP * np.arange(COUNT)), *np.zeros((2, COUNT)), STEP)
    assert found.significant_height == pytest.approx(4.0 * 0.5 / np.sqrt(2.0), rel=5e-3)
    assert [found.mean_period, found.peak_period] == pytest.approx([10.0, 10.0], rel=5e-3)


def test_intervals_hold_in_simulated_seas():
    held = []
    for seed in range(40):
        period = (4.0, 6.0, 9.0, 14.0)[seed % 4]
        record, mean_period = jonswap_record(2.0, period, 0.6, seed)
        found = sea_state(*record, STEP)
        is_height = abs(found.significant_height - 2.0) < 1.96 * found.significant_height_std
        is_mean = abs(found.mean_period - mean_period) < 1.96 * found.mean_period_std
        held.append((is_height, is_mean, found.peak_period_interval[0] <= period <= found.peak_period_interval[1]))
    share = np.mean(held, axis=0)
    assert (share >= 0.9).all(), share


def test_the_axis_is_that_of_the_waves():
    for degrees in (0.0, 40.0, -75.0):
        record, _ = jonswap_record(1.0, 7.0, np.radians(degrees), 4)
        found = sea_state(*record, STEP)
        assert np.degrees(found.axis) == pytest.approx(degrees, abs=1.0)
        side = 'to port of the bow' if degrees > 0.0 else 'to starboard of the bow'
        assert degrees == 0.0 or side in sea_in_words(found, 'a record')[1]
    unrelated = np.random.default_rng(0).normal(size=(2, COUNT))
    assert np.isnan(sea_state(record[0], *unrelated, STEP).axis)


def test_a_buoy_agrees_with_its_own_processing(data_folder):
    """Morro Bay's own wave file gives 2.59 m and 18.2 to 20.0 s."""
    trial = read_trial(data_folder / 'waves' / 'morro_buoy.csv', frame='frd')
    _, acceleration, channels = evenly(trial, STEP, 1200.0)
    found = sea_state(acceleration, channels['roll'], channels['pitch'], STEP)
    assert found.significant_height == pytest.approx(2.59, rel=0.07)
    assert 18.2 <= found.peak_period <= 20.0
    assert found.peak_period_interval[0] <= found.peak_period <= found.peak_period_interval[1]


def test_a_short_record_and_one_at_rest_are_refused():
    with pytest.raises(InputError, match='too few waves'):
        sea_state(*np.zeros((3, 1000)), STEP)
    with pytest.raises(InputError, match='below the noise floor'):
        sea_state(*np.zeros((3, COUNT)), STEP)


def sensor_noise(seed, flicker):
    """Vertical acceleration of a sensor on land: white noise of 1 mg and, by power at 0.1 Hz, so much 1/f noise."""
    rng = np.random.default_rng(seed)
    frequency = np.fft.rfftfreq(COUNT, STEP)
    shape = np.sqrt(1.0 + flicker * 0.1 / np.maximum(frequency, frequency[1]))
    return np.fft.irfft(np.fft.rfft(rng.normal(0.0, 0.01, COUNT)) * shape, COUNT)


def test_a_sensor_on_land_measures_no_sea_and_a_small_sea_shows_above_its_noise():
    for seed in range(60):
        size = (COUNT, 6000, 3000)[seed // 20]
        noise = sensor_noise(seed, flicker=(0.0, 1.0, 10.0)[seed % 3])[:size]
        with pytest.raises(InputError, match='below the noise floor'):
            sea_state(noise, *np.zeros((2, size)), STEP)
    record, _ = jonswap_record(0.2, 6.0, 0.6, 3)
    found = sea_state(record[0] + sensor_noise(0, flicker=1.0), *record[1:], STEP)
    assert found.significant_height == pytest.approx(0.2, rel=0.1)
    assert 0.01 < found.least_height < 0.2


def test_a_buoy_ashore_measures_no_sea(data_folder):
    trial = read_trial(data_folder / 'faults' / 'oahu_static_bad_packets.csv', frame='frd')
    longest = max(even_stretches(trial, WITHOUT_RATES), key=lambda stretch: stretch.time.size)
    found = sea_report(longest.acceleration, longest.channels['roll'], longest.channels['pitch'], longest.step)
    assert found.state is None and 'below the noise floor' in found.reason
