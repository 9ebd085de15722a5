r"""Overdispersion: whether answers at one level scatter more than independent ones would.

With beta-binomial answers the probability at a level is itself drawn anew, and the number of hits
among n answers has the variance n p (1 - p) (1 + (n - 1) rho). rho is 0 for independent answers; it
is the correlation between two answers at one level, and the square of psignifit's eta (Schuett et
al. 2016, Vision Res. 122, 105-123).

The estimate is the rho at which Pearson's statistic equals its degrees of freedom (Williams 1982,
Appl. Stat. 31, 144-148), its interval those at which the statistic is no quantile beyond the
confidence. A maximum of the likelihood would be biased towards 0: three parameters were fitted to
few levels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.stats import chi2

from asperity._core.arrays import Array
from asperity.psychophysics.analysis.psychometric import Psychometric, hits_by_level

LEAST_TRIALS = 8
"""Levels with fewer answers say nothing of overdispersion, and are left out."""
HIGHEST = 0.9


def overdispersion(
    intensities: ArrayLike, right: ArrayLike, function: Psychometric, confidence: float = 0.95
) -> tuple[float, float, float] | None:
    """Return rho and its interval, 0 to `HIGHEST`.

    None where fewer than four levels have `LEAST_TRIALS` answers.

    Parameters
    ----------
    intensities : (n,) array
        Of each trial.
    right : (n,) array of bool
        Whether the answer was right.
    function : Psychometric
        That was fitted to them.
    confidence : float
    """
    x, count, hits = hits_by_level(intensities, right)
    used = count >= LEAST_TRIALS
    if np.count_nonzero(used) < 4:
        return None
    count, hits = count[used], hits[used]
    p = np.clip(function(x[used]), 1e-3, 1.0 - 1e-3)
    squares = (hits - count * p) ** 2 / (count * p * (1.0 - p))
    # The lapse rate counts as fitted only where it is not held by its bound.
    free = max(len(p) - (3 if function.lapse > 1e-6 else 2), 1)
    tail = 0.5 * (1.0 - confidence)
    low, high = (float(chi2.ppf(part, free)) for part in (1.0 - tail, tail))
    return tuple(_rho(squares, count, value) for value in (float(free), low, high))  # type: ignore[return-value]


def _rho(squares: Array, count: Array, wanted: float) -> float:
    """Return the rho at which Pearson's statistic has a value."""

    def beyond(rho: float) -> float:
        return float(np.sum(squares / (1.0 + (count - 1.0) * rho))) - wanted

    if beyond(0.0) <= 0.0:
        return 0.0
    return HIGHEST if beyond(HIGHEST) >= 0.0 else float(brentq(beyond, 0.0, HIGHEST))
