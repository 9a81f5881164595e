"""A sea state in words, and the picture of its spectrum."""

import math

from swath_sysid.attitude.prediction.sea_state import SeaState
from swath_sysid.formats.sea_state_yaml import REMARKS
from swath_sysid.report.figures import BAND, MODEL, RESIDUAL, Figure, panel


def sea_in_words(found: SeaState, name: str, bow: str = 'the bow') -> list[str]:
    """Lines for a reader, with the name of the record; the axis of the waves is stated from the bow."""
    low, high = found.peak_period_interval
    if math.isfinite(found.axis):
        side = 'to port' if found.axis > 0.0 else 'to starboard'
        axis = (
            f'along a line {abs(math.degrees(found.axis)):.0f} ± {math.degrees(found.axis_std):.1f} deg {side} of '
            f'{bow}, either way'
        )
    else:
        axis = 'not known: heave and slope are not coherent'
    return [
        f'{name}: {found.duration / 60.0:.0f} min of motion',
        f'  the waves run        {axis}',
        f'  least height         {found.least_height:.2g} m: the noise of this sensor may show as much',
        *REMARKS,
        f'  significant height   {found.significant_height:.3g} ± {found.significant_height_std:.2g} m',
        f'  mean period          {found.mean_period:.2f} ± {found.mean_period_std:.2f} s (zero crossings)',
        f'  peak period          {found.peak_period:.1f} s, 95 % between {low:.1f} and {high:.1f} s (of the heave)',
    ]


def sea_figure(found: SeaState) -> Figure:
    """Draw a `SeaState`."""
    figure, axes = panel(8.0, 4.2)
    axes.plot(found.frequency, found.spectrum, color=RESIDUAL, linewidth=1.4)
    low, high = found.peak_period_interval
    axes.axvspan(1.0 / high, 1.0 / low, color=BAND, alpha=0.4, lw=0, label='95 % interval of the peak')
    axes.axvline(1.0 / found.peak_period, color=MODEL, linewidth=1.2, label=f'peak, {found.peak_period:.1f} s')
    axes.set(
        xlabel='frequency of encounter, Hz',
        ylabel='heave at the sensor, m²/Hz',
        ylim=(0.0, None),
        xlim=(0.0, min(5.0 / found.mean_period, float(found.frequency[-1]))),
        title=f'significant height {found.significant_height:.3g} ± {found.significant_height_std:.2g} m, '
        f'mean period {found.mean_period:.2f} ± {found.mean_period_std:.2f} s',
    )
    axes.legend(fontsize=8, frameon=False)
    return figure
