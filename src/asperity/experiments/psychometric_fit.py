"""Psychometric functions fitted by maximum likelihood, with confidence intervals.

Threshold, width and lapse rate are free within bounds, the lapse rate between 0 and 0.06 (Wichmann
& Hill 2001, Percept. Psychophys. 63, 1293-1313). The likelihood is looked at on a coarse grid and
then on ever smaller ones about the best place, for all bootstrap samples at once.

Intervals are by parametric bootstrap (Wichmann & Hill 2001b, ibid. 1314-1329): answers are drawn
from the fitted function at the levels that were presented, and fitted again. Those levels came of
the answers where they were adaptive, so the width of adaptive data is biased towards steepness
(Kaernbach 2001, Percept. Psychophys. 63, 1389-1398) and not to be taken at its word.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.errors import AsperityError
from asperity.experiments.psychometric import Psychometric, probability

HIGHEST_LAPSE = 0.06
_ROUNDS = 24
_SHRINK = 0.72
_GRID = (41, 21, 4)
_LOCAL = (3, 3, 3)
_MOST = 2_000_000
"""Probabilities that are held at once."""


class Interval(NamedTuple):
    """A confidence interval."""

    low: float
    high: float


@dataclass(frozen=True)
class Fit:
    """A fitted function and how sure it is."""

    function: Psychometric
    threshold: Interval
    width: Interval
    confidence: float
    deviance: float
    """Twice the log likelihood ratio to the saturated model."""
    deviance_p: float
    """Part of the bootstrap samples with a larger deviance: a small one speaks against the fit."""
    trials: int
    at_bound: bool
    """Whether threshold or width lies at an end of what was searched: then nothing is found."""


def fit_psychometric(
    intensities: ArrayLike,
    right: ArrayLike,
    *,
    guess: float = 0.5,
    function: str = "weibull",
    lapse: float | None = None,
    samples: int = 1000,
    confidence: float = 0.95,
    seed: int = 0,
) -> Fit:
    """Fit a psychometric function to answers.

    Parameters
    ----------
    intensities : (n,) array
        Of each trial.
    right : (n,) array of bool
        Whether the answer was right.
    guess : float
    function : str
        A key of `FUNCTIONS`.
    lapse : float, optional
        Hold the lapse rate. Default: it is free between 0 and `HIGHEST_LAPSE`.
    samples : int
        Of the bootstrap.
    confidence : float
    seed : int
        Of the bootstrap.

    Raises
    ------
    AsperityError
        Fewer than ten answers, or all at one intensity.
    """
    x, inverse = np.unique(np.asarray(intensities, dtype=np.float64), return_inverse=True)
    count = np.bincount(inverse).astype(np.float64)
    weights = np.asarray(right, dtype=np.float64)
    hits = np.asarray(np.bincount(inverse, weights=weights), dtype=np.float64)
    trials = int(count.sum())
    if trials < 10 or x.size < 2:
        raise AsperityError(
            f"a psychometric function needs ten answers at two levels, got {trials} at {x.size}"
        )
    search = _Search(x, count, guess, function, lapse)
    best = search.best(hits[None, :])[0]
    fitted = Psychometric(float(best[0]), float(best[1]), float(best[2]), guess, function)
    rng = np.random.default_rng(seed)
    drawn = rng.binomial(count.astype(np.int64), np.clip(fitted(x), 0.0, 1.0), (samples, x.size))
    again = search.best(drawn.astype(np.float64))
    deviance = _deviance(hits[None, :], count, search.psi(best[None, :]))[0]
    deviances = _deviance(drawn.astype(np.float64), count, search.psi(again))
    tails = 50.0 * (1.0 - confidence)
    spans = [
        Interval(*map(float, np.percentile(again[:, i], [tails, 100.0 - tails]))) for i in (0, 1)
    ]
    low, high = search.bounds
    return Fit(
        fitted, spans[0], spans[1], confidence, float(deviance),
        float(np.mean(deviances >= deviance - 1e-9)), trials,
        bool(np.any((best[:2] <= low[:2] + 1e-9) | (best[:2] >= high[:2] - 1e-9))),
    )  # fmt: skip


class _Search:
    """The likelihood over threshold, log width and lapse, and where it is largest."""

    def __init__(
        self, x: NDArray[np.float64], count: NDArray[np.float64], guess: float, function: str,
        lapse: float | None,
    ) -> None:  # fmt: skip
        self._x, self._count, self._guess, self._function = x, count, guess, function
        span = float(x[-1] - x[0])
        finest = float(np.min(np.diff(x)))
        lapses = (0.0, HIGHEST_LAPSE) if lapse is None else (lapse, lapse)
        widths = (0.5 * finest, 4.0 * span)
        self._low = np.array([x[0] - 0.5 * span, np.log(widths[0]), lapses[0]])
        self._high = np.array([x[-1] + 0.5 * span, np.log(widths[1]), lapses[1]])
        self._free = self._high > self._low

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest threshold, width, lapse."""
        return _plain(self._low), _plain(self._high)

    def psi(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probabilities (n, x) of parameters (n, 3): threshold, width, lapse."""
        t, w, lapse = (parameters[:, i, None] for i in range(3))
        return probability(self._x, t, w, lapse, self._guess, self._function)

    def best(self, hits: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return threshold, width, lapse (n, 3) of most likelihood for hits (n, x)."""
        grid = self._lattice(_GRID, self._low, self._high)
        p = np.clip(self.psi(_plain(grid)), 1e-9, 1.0 - 1e-9)
        # Linear in the hits: one product of matrices for all samples.
        likely = hits @ (np.log(p) - np.log1p(-p)).T + self._count @ np.log1p(-p).T
        at = grid[np.argmax(likely, axis=1)]
        reach = (self._high - self._low) / np.maximum(np.array(_GRID) - 1, 1)
        offsets = self._lattice(_LOCAL, -np.ones(3), np.ones(3))
        chunk = max(1, _MOST // (len(offsets) * self._x.size))
        for first in range(0, len(at), chunk):
            part = slice(first, first + chunk)
            at[part] = self._refined(at[part], hits[part], offsets, reach)
        return _plain(at)

    def _refined(
        self, at: NDArray[np.float64], hits: NDArray[np.float64], offsets: NDArray[np.float64],
        reach: NDArray[np.float64],
    ) -> NDArray[np.float64]:  # fmt: skip
        for _ in range(_ROUNDS):
            near = np.clip(at[:, None, :] + offsets * reach, self._low, self._high)
            p = self.psi(_plain(near.reshape(-1, 3))).reshape(*near.shape[:2], -1)
            p = np.clip(p, 1e-9, 1.0 - 1e-9)
            likely = np.einsum("nx,nox->no", hits, np.log(p))
            likely += np.einsum("nx,nox->no", self._count - hits, np.log1p(-p))
            at = near[np.arange(len(at)), np.argmax(likely, axis=1)]
            reach = _SHRINK * reach
        return at

    def _lattice(
        self, shape: tuple[int, int, int], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return points (n, 3) between two corners; one value where nothing is free."""
        axes = [
            np.linspace(a, b, n) if free else np.array([0.5 * (a + b)])
            for a, b, n, free in zip(low, high, shape, self._free, strict=True)
        ]
        return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def _plain(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points with the width in place of its logarithm."""
    out = np.array(points)
    out[..., 1] = np.exp(out[..., 1])
    return out


def _deviance(
    hits: NDArray[np.float64], count: NDArray[np.float64], p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return twice the log likelihood ratio between the observed parts and p."""
    p = np.clip(p, 1e-9, 1.0 - 1e-9)
    seen = hits / count
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = np.where(hits > 0.0, hits * np.log(seen / p), 0.0)
        terms += np.where(hits < count, (count - hits) * np.log((1.0 - seen) / (1.0 - p)), 0.0)
    return np.asarray(2.0 * np.sum(terms, axis=1))
