"""The picture of a record: what it shades, marks and leaves out."""

import numpy as np
import pytest
from repository import RECORDS

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.formats.reading import read_trial
from swath_sysid.report.figures import save_figure
from swath_sysid.report.record_report import record_figure


def decaying(duration=30.0, rate_hz=50.0):
    time = np.arange(0.0, duration, 1 / rate_hz)
    noise = 0.0005 * np.random.default_rng(0).normal(size=time.size)
    return AxisMotion('roll', time, 0.1 * np.exp(-0.1 * time) * np.cos(3.0 * time) + noise, None, 'folder/roll.csv')


def shaded(axes):
    paths = [span.get_patch_transform().transform_path(span.get_path()) for span in axes.patches]
    return [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in paths]


def test_a_record_is_drawn_with_its_decays_gaps_and_the_peak_of_its_spectrum(tmp_path):
    trial = read_trial(RECORDS / 'kvlcc2_roll_decay.csv')
    figure = record_figure([trial.axis('roll'), trial.axis('pitch')])
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert any('cycles of 2.54 s' in w for w in words)
    (span,) = shaded(figure.axes[0])
    assert span == pytest.approx((10.8, 100.0), abs=0.5)
    assert shaded(figure.axes[2]) == []
    save_figure(figure, tmp_path / 'record.png')
    assert (tmp_path / 'record.png').stat().st_size > 20_000
    motion = decaying()
    figure = record_figure([motion.only((motion.time < 10.0) | (motion.time > 12.0))])
    assert any(span == pytest.approx((10.0, 12.0), abs=0.03) for span in shaded(figure.axes[0]))
    spectrum, natural = figure.axes[1].lines
    assert spectrum.get_xdata()[np.argmax(spectrum.get_ydata())] == pytest.approx(3.0 / (2 * np.pi), abs=0.02)
    assert natural.get_xdata()[0] == pytest.approx(3.0 / (2 * np.pi), rel=0.01)


@pytest.mark.parametrize('size', [1, 2, 3, 20])
def test_records_too_short_for_anything(size, tmp_path):
    time = np.arange(size) * 0.1
    save_figure(record_figure([AxisMotion('pitch', time, None, np.zeros(size))]), tmp_path / 'short.png')
    assert (tmp_path / 'short.png').stat().st_size > 1000
