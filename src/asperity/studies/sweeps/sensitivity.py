"""Sensitivity: the share of a result's variance that one parameter alone explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_BINS = 12
_LEAST_IN_BIN = 8


class Groups:
    """Results grouped by one parameter: by its values, or into bins of equal size.

    Parameters
    ----------
    values : (n,) array
        Of the parameter: numbers, or labels.
    results : (n,) array
        Finite.
    """

    def __init__(self, values: NDArray[np.generic], results: NDArray[np.float64]) -> None:
        levels, places = np.unique(values, return_inverse=True)
        if levels.size > max(_BINS, 2) and values.dtype.kind == "f" and levels.size > 40:
            bins = int(min(max(results.size // _LEAST_IN_BIN, 2), _BINS))
            order = np.argsort(values, kind="stable")
            places = np.empty(results.size, np.int64)
            places[order] = np.arange(results.size) * bins // results.size
            self.centres: NDArray[np.generic] = np.array(
                [np.median(values[places == i].astype(np.float64)) for i in range(bins)]
            )
        else:
            self.centres = levels
        self.places = places.ravel()
        self.parts = [results[self.places == i] for i in range(len(self.centres))]

    def quantiles(self, *parts: float) -> NDArray[np.float64]:
        """Return quantiles (len(parts), groups) of the results in each group."""
        return np.array([np.quantile(part, parts) for part in self.parts]).T


def share(values: NDArray[np.generic], results: NDArray[np.float64]) -> float:
    """Return the share of the variance of results that one parameter alone explains, 0 to 1.

    The variance of the groups' means over the whole variance (the correlation ratio; of a sampled
    design an estimate of the first-order Sobol index, Sobol 1993), less what groups of that size
    explain of pure noise.
    """
    groups = Groups(values, results)
    total = float(np.sum((results - results.mean()) ** 2))
    n, k = results.size, len(groups.parts)
    if not total > 0.0 or n <= k:
        return 0.0
    between = sum(part.size * (part.mean() - results.mean()) ** 2 for part in groups.parts)
    within = (total - between) / (n - k)
    return float(np.clip((between - (k - 1) * within) / total, 0.0, 1.0))
