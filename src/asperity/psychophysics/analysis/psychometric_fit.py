"""Psychometric functions fitted by maximum likelihood, with confidence intervals.

Intervals are by profile likelihood (Venzon & Moolgavkar 1988, Appl. Stat. 37, 87-94): all values
for which the likelihood, with the other parameters at their best, is not significantly less. Where
adaptive levels depend on the answers they would be too narrow with as many trials as people give,
so the fall of the likelihood is larger there by a factor that was found by simulation: `STRETCH`,
`tests/psychophysics/test_coverage.py`. A parametric bootstrap at the presented levels, as in many
programs, covers less still.

The fit itself is judged by such a bootstrap (Wichmann & Hill 2001, Percept. Psychophys. 63,
1293-1313): answers are drawn from the fitted function and fitted again, and their deviances
compared. The width estimated from adaptive data is biased towards steepness (Kaernbach 2001, ibid.
1389-1398).

Implemented here because the Python packages for it are under the GPL.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2, f

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.psychometric import Psychometric, hits_by_level
from asperity.psychophysics.analysis.psychometric_search import QUANTITIES, LikelihoodSearch

STRETCH = {
    ("staircase", 2): (1.2, 1.28, 1.22, 1.27, 0.63),
    ("staircase", 3): (1.1, 1.17, 1.13, 1.17, 0.63),
    ("quest+", 2): (1.31, 1.23, 1.4, 1.42, 0.77),
    ("quest+", 3): (1.16, 1.1, 1.24, 1.24, 0.69),
    ("constant", 2): (1.06, 1.05, 1.1, 1.1, 1.35),
    ("constant", 3): (1.05, 1.04, 1.08, 1.08, 1.35),
    ("constant", None): (1.08, 1.04, 1.0, 1.04, 1.35),
}
"""What the fall of the likelihood is multiplied by, of each of `QUANTITIES`, by the method that
chose the levels and the number of intervals; None where levels lie on both sides of the standard.
With as many trials as people give, and more so where levels depended on the answers, the deviance
at the true value exceeds the quantile of the chi-squared distribution too often, and that of the
lapse rate, which lies near its bounds, too rarely. The factors, Bartlett corrections found by
simulation, are checked by `test_coverage.py`."""


def stretch_of(adaptive: str, guess: float | None) -> dict[str, float]:
    """Return the factors of `STRETCH` by quantity, for a method and its guess rate."""
    intervals = None if guess is None else 3 if guess < 0.4 else 2
    factors = STRETCH.get((adaptive, intervals), STRETCH[adaptive, 2])
    return dict(zip(QUANTITIES, factors, strict=True))


def fall_of(
    confidence: float, adaptive: str, quantity: str = "threshold", freedom: int | None = None,
    guess: float | None = 0.5,
) -> float:  # fmt: skip
    """Return how far the log likelihood falls to the ends of an interval.

    With `freedom` the overdispersion was estimated, from so many degrees of freedom.
    """
    stretch = stretch_of(adaptive, guess)[quantity]
    fall = chi2.ppf(confidence, 1) if freedom is None else f.ppf(confidence, 1, freedom)
    return 0.5 * float(fall) * stretch


class Interval(NamedTuple):
    """A confidence interval."""

    low: float
    high: float


@dataclass(frozen=True)
class Fit:
    """A fitted function with confidence intervals and goodness of fit."""

    function: Psychometric
    threshold: Interval
    width: Interval
    slope: Interval
    """Of psi at the threshold, per unit of intensity."""
    lapse: Interval
    level: Interval | None
    """Of the intensity at which `proportion` are right; None where no proportion was asked for, or
    where no intensity has it."""
    proportion: float | None
    confidence: float
    deviance: float
    """Twice the log likelihood ratio to the saturated model."""
    deviance_p: float
    """Part of bootstrap samples with a larger deviance; a small value speaks against the fit."""
    trials: int
    at_bound: bool
    """Whether the threshold lies at a bound of the search, or the width at its upper one, so that
    neither is determined. A width at the lower bound is that of a step between two levels."""


def fit_psychometric(
    intensities: ArrayLike,
    right: ArrayLike,
    *,
    guess: float | None = 0.5,
    function: str = "weibull",
    lapse: float | None = None,
    samples: int = 1000,
    confidence: float = 0.95,
    seed: int = 0,
    adaptive: str = "staircase",
    proportion: float | None = None,
    quantities: Collection[str] = ("threshold", "width", "slope", "lapse", "level"),
    rho: float = 0.0,
) -> Fit:
    """Fit a psychometric function to answers.

    Parameters
    ----------
    intensities : (n,) array
        Of each trial.
    right : (n,) array of bool
        Whether the answer was right.
    guess : float or None
        As of `Psychometric`.
    function : str
        A key of `FUNCTIONS`.
    lapse : float, optional
        Hold the lapse rate. Default: it is free between 0 and `HIGHEST_LAPSE`.
    samples : int
        Of the bootstrap that judges the fit.
    confidence : float
        Of the intervals. An end that is not within what was searched is the end of that.
    seed : int
        Of the bootstrap.
    adaptive : {"staircase", "quest+", "constant"}
        What chose the levels: see `STRETCH`.
    proportion : float, optional
        Of right answers, lapses among them, at which the level is asked for.
    quantities : collection of str
        Those whose intervals are wanted, of `QUANTITIES`; the others are NaN.
    rho : float
        Overdispersion, of `overdispersion`, by which estimates and intervals are corrected: a level
        with n answers counts as n / (1 + (n - 1) rho) independent ones (Williams 1982, Appl. Stat.
        31, 144-148), and the F distribution takes the place of chi-squared.

    Raises
    ------
    AsperityError
        Fewer than ten answers, or all at one intensity.
    """
    x, count, hits = hits_by_level(intensities, right)
    trials = int(count.sum())
    if trials < 10 or x.size < 2:
        raise AsperityError(
            f"a psychometric function needs at least ten answers at two levels, "
            f"got {trials} at {x.size}"
        )
    search = LikelihoodSearch(x, count, guess, function, lapse, proportion or 0.0)
    best = search.best(hits[None, :])[0]
    rng = np.random.default_rng(seed)
    p = np.clip(search.psi(best[None, :])[0], 0.0, 1.0)
    drawn = rng.binomial(count.astype(np.int64), p, (samples, x.size))
    again = search.best(drawn.astype(np.float64))
    deviance = _deviance(hits[None, :], count, search.psi(best[None, :]))[0]
    deviances = _deviance(drawn.astype(np.float64), count, search.psi(again))
    freedom = None
    if rho > 0.0:
        weights = 1.0 / (1.0 + (count - 1.0) * rho)
        hits, freedom = hits * weights, max(x.size - 3, 1)
        search = LikelihoodSearch(x, count * weights, guess, function, lapse, proportion or 0.0)
        best = search.best(hits[None, :])[0]
    fitted = Psychometric(float(best[0]), float(best[1]), float(best[2]), guess, function)
    level = proportion is not None and np.isfinite(fitted.at(proportion))
    wanted = [name for name in quantities if name != "level" or level]
    spans = {
        name: Interval(
            *search.interval(hits, best, name, fall_of(confidence, adaptive, name, freedom, guess))
        )
        for name in wanted
    }
    nothing = Interval(float("nan"), float("nan"))
    low, high = search.bounds
    return Fit(
        fitted, spans.get("threshold", nothing), spans.get("width", nothing),
        spans.get("slope", nothing), spans.get("lapse", nothing), spans.get("level"),
        proportion, confidence, float(deviance),
        float(np.mean(deviances >= deviance - 1e-9)), trials,
        bool(best[0] <= low[0] + 1e-9 or np.any(best[:2] >= high[:2] - 1e-9)),
    )  # fmt: skip


def _deviance(hits: Array, count: Array, p: Array) -> Array:
    """Return twice the log likelihood ratio between the observed parts and p."""
    p = np.clip(p, 1e-9, 1.0 - 1e-9)
    seen = hits / count
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = np.where(hits > 0.0, hits * np.log(seen / p), 0.0)
        terms += np.where(hits < count, (count - hits) * np.log((1.0 - seen) / (1.0 - p)), 0.0)
    return np.asarray(2.0 * np.sum(terms, axis=1))
