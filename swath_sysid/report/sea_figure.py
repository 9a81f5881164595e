"""The picture of a sea state: the spectrum of the heave."""
from __future__ import annotations

from typing import TYPE_CHECKING

from swath_sysid.report.figures import BAND, MODEL, RESIDUAL, new_panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swath_sysid.attitude.prediction.sea_state import SeaState


def sea_figure(found: SeaState) -> Figure:
    """Draw a `SeaState`.

    Parameters
    ----------
    found : SeaState

    Returns
    -------
    Figure
    """
    figure, axes = new_panel(8.0, 4.2)
    axes.plot(found.frequency, found.spectrum, color=RESIDUAL, linewidth=1.4)
    low, high = found.peak_period_interval
    axes.axvspan(1.0 / high, 1.0 / low, color=BAND, alpha=0.4, lw=0, label='95 % interval of the peak')
    axes.axvline(1.0 / found.peak_period, color=MODEL, linewidth=1.2, label=f'peak, {found.peak_period:.1f} s')
    axes.set(
        xlabel='frequency of encounter, Hz', ylabel='heave at the sensor, m²/Hz', ylim=(0.0, None),
        xlim=(0.0, min(5.0 / found.mean_period, float(found.frequency[-1]))),
        title=f'significant height {found.significant_height:.3g} ± {found.significant_height_std:.2g} m, '
        f'mean period {found.mean_period:.2f} ± {found.mean_period_std:.2f} s',
    )  # fmt: skip
    axes.legend(fontsize=8, frameon=False)
    return figure
