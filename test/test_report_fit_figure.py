"""The picture of a fit: where its curves end."""

import numpy as np

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.formats.identify_records import identify
from swath_sysid.report.fit_figure import fit_figure


def test_curves_end_with_the_largest_half_cycle_and_have_a_band_all_the_way():
    hull = hull_named('swath-roll')
    trial = simulated_trial(hull.model, np.radians(8.0), 15.0, 100.0, SensorNoise(rate=hull.rate_noise), 81)
    found = identify([trial.axis('roll')])
    motion = np.degrees(found.records[0].motion.angle)
    *_, period, damping = fit_figure(found).axes
    for axes in (period, damping):
        (curve,), (shade,) = axes.lines, axes.collections
        end = curve.get_xdata()[-1]
        assert 0.8 * 0.5 * np.ptp(motion) < end < 0.51 * np.ptp(motion) < 0.7 * np.abs(motion).max()
        assert np.isfinite(curve.get_ydata()).all()
        assert shade.get_paths()[0].vertices[:, 0].max() == end
