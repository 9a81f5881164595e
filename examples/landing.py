"""Landing on deck: the moment to descend, chosen by the forecast of touchdown.

    python examples/landing.py morro_buoy.csv --frame frd --figure landing.png
    python examples/landing.py morro_buoy.csv --frame frd --figure landing.png --live
    python examples/landing.py record.csv --upstream wave_probe_m

A drone touches down this many seconds after it begins to descend.  The deck must then keep the limits of
`landing.yaml`: move no faster than 0.5 m/s up or down, roll no more than 2.5 deg and pitch no more than 3 deg.  The
descent begins where a window of calm is forecast for touchdown; or in that fifth of the moments in which the joint
normal forecast gives touchdown the greatest probability; or, in comparison, where the deck is calm now, in the fifth
that is furthest inside the limits (or least outside) now, or at any time.  Printed: how many of the touchdowns were
inside the limits, %, with 95 % intervals from a bootstrap of blocks of 30 s.  With --live predictor runs as a node of
its own, the record is replayed to it over DDS, and the decisions are made by what it publishes.  With --upstream
the forecast also uses a column of the record that shows waves on their way to the deck.
"""

import sys
from pathlib import Path

import numpy as np
from craft_in_waves import carry_out
from scipy.stats import norm, qmc

from swath_sysid.evaluation.scoring import block_sums, resampled
from swath_sysid.nodes.parameters.parameter_files import values_from_file
from swath_sysid.nodes.parameters.settings import pipeline_settings
from swath_sysid.report.figures import SERIES, new_figure, quiet

PARAMETERS = Path(__file__).with_name('landing.yaml')
SETTINGS = pipeline_settings(values_from_file(PARAMETERS, 'predictor')).forecaster
CALM = SETTINGS.quiescence
LIMITED, LIMITS = [1, 3, 4], np.array([CALM.points[0].vertical_velocity, CALM.roll, CALM.pitch])
"""Vertical velocity, roll and pitch: places in the forecast, and limits in m/s and rad."""

DESCENTS, SHARE = (1.0, 2.0, 3.0), 0.2
DRAWS = norm.ppf(qmc.Sobol(len(LIMITED), seed=0).random(512))


def inside_probability(mean, covariance):
    """Probability that normal quantities keep the limits, shape (N,); from means (N, 3) and covariances (N, 3, 3)."""
    root = np.linalg.cholesky(covariance)
    return np.array(
        [np.mean(np.all(np.abs(m + DRAWS @ r.T) <= LIMITS, axis=1)) for m, r in zip(mean, root, strict=True)]
    )


def best(score):
    """The fifth of the moments with the greatest score."""
    return score >= np.quantile(score, 1.0 - SHARE)


def decisions(calm, mean, covariance, lead):
    """When the forecast says to descend, from what is forecast at the lead of touchdown: {method: shape (N,)}.

    Parameters
    ----------
    calm : ndarray, shape (N, 2)
    mean : ndarray, shape (N, 7)
    covariance : ndarray, shape (N, 7, 7)
        See `craft_in_waves.Voyage`.
    lead : float
        s.
    """
    return {
        'window of calm': (calm[:, 0] <= lead) & (lead <= calm[:, 1]),
        'forecast': best(inside_probability(mean[:, LIMITED], covariance[:, LIMITED][:, :, LIMITED])),
    }


def land(voyage):
    """Share of the touchdowns inside the limits, and its interval: {method: shape (len(DESCENTS), 3)}."""
    now = np.abs(voyage.truth(voyage.stamps)[:, LIMITED]) / LIMITS
    shares = {}
    for lead in DESCENTS:
        came = (np.abs(voyage.truth(voyage.stamps + lead)[:, LIMITED]) <= LIMITS).all(axis=1)
        chosen = decisions(voyage.calm, *voyage.at_lead(lead), lead) | {
            'calm now': (now <= 1.0).all(axis=1),
            'persistence': best(-now.max(axis=1)),
            'any time': np.ones(came.size, dtype=bool),
        }
        for method, when in chosen.items():
            shares.setdefault(method, []).append(share_with_interval(voyage.stamps, came & when, when))
    return {method: np.array(rows) for method, rows in shares.items()}


def share_with_interval(stamps, hits, tries):
    """Hits over tries, and the ends of the central 95 % interval."""
    drawn = resampled(block_sums(stamps, np.stack([hits, tries]).astype(float)[:, :, None]), seed=0)[..., 0]
    ends = np.quantile(drawn[0] / np.maximum(drawn[1], 1.0), (0.025, 0.975))
    return hits.sum() / tries.sum() if tries.any() else np.nan, *ends


def draw(shares):
    """The figure: the shares over the time of descent."""
    figure = new_figure(6.0, 4.0)
    axes = quiet(figure.subplots())
    for k, (method, rows) in enumerate(shares.items()):
        share, low, high = 100.0 * rows.T
        place = np.array(DESCENTS) + 0.04 * (k - 2)
        ends = np.maximum([share - low, high - share], 0.0)
        axes.errorbar(place, share, ends, fmt='o-', color=SERIES[k], capsize=3, label=method)
    axes.set(xlabel='descent, s', ylabel='touchdowns inside the limits, %', ylim=(0.0, 100.0), xticks=DESCENTS)
    axes.legend(frameon=False)
    return figure


def demonstrate(voyage):
    """Print the table; returns the figure."""
    shares, (begin, end) = land(voyage), voyage.calm.T
    print(f'{"touchdowns inside, %":22}' + ''.join(f'{f"after {lead:g} s":>11}{"":9}' for lead in DESCENTS))
    for method, rows in shares.items():
        print(f'{method:22}' + ''.join(as_words(*(100.0 * row)) for row in rows))
    covered = ''.join(f'{100.0 * np.mean((begin <= lead) & (lead <= end)):7.1f}{"":13}' for lead in DESCENTS)
    print(f'{"windows at, %":22}{covered.rstrip()}')
    return draw(shares)


def as_words(share, low, high):
    """A share and its interval, %."""
    interval = f' ({low:3.0f} to {high:3.0f})' if np.isfinite(low) else ''
    return f'{share:7.0f}{interval:13}' if np.isfinite(share) else f'{"-":>7}{"":13}'


def live(trial, warmup, rate):
    """What predictor published while the record was replayed to it."""
    # only here: rclpy is needed
    from landing_live import hear

    return hear(trial, rate, PARAMETERS, DESCENTS).voyage(trial, warmup)


if __name__ == '__main__':
    sys.exit(carry_out('Landing on deck by the forecast of touchdown.', demonstrate, settings=SETTINGS, live=live))
