r"""How far raters agree: the ceiling for any model of their mean.

*Reliability* is that of the mean over raters: raters are split into halves at random, the halves'
means are correlated over the cells, and the correlation is stepped up to all raters by Spearman
and Brown, r' = 2 r / (1 + r). A model that knew the true means would correlate with the observed
ones by the square root of the reliability, on average: the *ceiling*. *Agreement* is the mean
correlation of each rater with the mean of the others: what a typical person reaches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity._core.arrays import Array

SPLITS = 200
_LEAST_CELLS = 3


@dataclass(frozen=True)
class Reliability:
    """Agreement of raters over cells; None where it cannot be found."""

    raters: int
    reliability: float | None
    """Of the mean over raters, 0 to 1."""
    ceiling: float | None
    """Square root of the reliability."""
    agreement: float | None
    """Mean correlation of a rater with the mean of the others."""


def rater_reliability(matrix: Array, *, seed: int = 0) -> Reliability:
    """Return the reliability of the mean of ratings (raters, cells), NaN where there is none."""
    raters = len(matrix)
    if raters < 2:
        return Reliability(raters, None, None, None)
    others = [
        _correlation(matrix[i], mean_over_raters(np.delete(matrix, i, axis=0)))
        for i in range(raters)
    ]
    agreement = _mean(others)
    if raters < 4:
        # Halves of one rater each: the same formula, from pairs.
        pairs = [_correlation(matrix[i], matrix[j]) for i in range(raters) for j in range(i)]
        single = _mean(pairs)
        if single is None:
            return Reliability(raters, None, None, agreement)
        whole = raters * single / (1.0 + (raters - 1.0) * single) if single > 0.0 else 0.0
    else:
        rng = np.random.default_rng(seed)
        halves = []
        for _ in range(SPLITS):
            order = rng.permutation(raters)
            one, other = order[: raters // 2], order[raters // 2 :]
            halves.append(
                _correlation(mean_over_raters(matrix[one]), mean_over_raters(matrix[other]))
            )
        half = _mean(halves)
        if half is None:
            return Reliability(raters, None, None, agreement)
        whole = 2.0 * half / (1.0 + half) if half > 0.0 else 0.0
    return Reliability(raters, whole, float(np.sqrt(whole)), agreement)


def mean_over_raters(matrix: Array) -> Array:
    """Return the mean over raters of each cell; NaN where no rater has it."""
    count = np.sum(np.isfinite(matrix), axis=0)
    total = np.nansum(matrix, axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _correlation(one: Array, other: Array) -> float | None:
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < _LEAST_CELLS or not (np.ptp(one[both]) > 0.0 and np.ptp(other[both]) > 0.0):
        return None
    return float(np.corrcoef(one[both], other[both])[0, 1])


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
