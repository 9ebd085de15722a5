"""Local polynomials through scattered points: moving least squares.

At each place a polynomial is fitted to the points around it, with weights that decrease with
distance (Levin, Math. Comp. 67, 1517 (1998)). A low degree and a long reach average noise; a high
degree and a short reach keep short waves. `best_fit` chooses by leaving one point out at a time:
the polynomial that predicts it best is the one that the points call for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from asperity._core.arrays import Array

_FARTHEST = 3.0
"""A place with no points within this distance has no height [mean distances between points]."""
_AT_ONCE = 50_000
_TRIED = 4000
"""Points that are left out, one at a time, to choose a fit."""
_BETTER = 0.99
"""A rougher fit has to predict points better than a smoother one by this factor."""
_BEYOND = 0.5
"""How far heights may leave the range of the points around, in that range."""
_RIDGE = 1e-7


class LocalFit(NamedTuple):
    """A polynomial fitted to the points around each place.

    Attributes
    ----------
    degree : int
        1 to 3.
    reach : float
        Length scale of a point's weight [mean distances between points].
    neighbours : int
        Number of points to which each is fitted.
    """

    degree: int
    reach: float
    neighbours: int

    def heights(self, flat: Array, places: Array, apart: float, *, skip: int = 0) -> Array:
        """Return heights at places, NaN where no point is near.

        Parameters
        ----------
        flat : (n, 3) array
            Points: position on the plane and height [m].
        places : (k, 2) array
            [m].
        apart : float
            Mean distance between points [m].
        skip : int
            Nearest points to leave out: 1 where the places are those of the points.
        """
        tree = KDTree(flat[:, :2])
        out = np.full(len(places), np.nan)
        count = min(self.neighbours + skip, len(flat))
        for start in range(0, len(places), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            found = tree.query(places[part], k=np.arange(1, count + 1))
            away, near = (np.asarray(values)[:, skip:] for values in found)
            out[part] = self._at(flat, places[part], away / apart, near, apart)
        return out

    def _at(self, flat: Array, places: Array, away: Array, near: Array, apart: float) -> Array:
        weight = np.exp(-((away / self.reach) ** 2)) + 1e-9
        u, v = np.moveaxis((flat[near, :2] - places[:, None]) / apart, 2, 0)
        terms = [u ** (n - k) * v**k for n in range(self.degree + 1) for k in range(n + 1)]
        basis = np.stack(terms, axis=2)
        weighted = weight[..., None] * basis
        left = np.swapaxes(weighted, 1, 2) @ basis
        # Terms that the points do not determine vanish.
        ridge = _RIDGE * np.trace(left, axis1=1, axis2=2)
        left += ridge[:, None, None] * np.diag([0.0] + [1.0] * (len(terms) - 1))
        around = flat[near, 2]
        right = np.swapaxes(weighted, 1, 2) @ around[..., None]
        heights = np.linalg.solve(left, right)[:, 0, 0]
        low, high = around.min(axis=1), around.max(axis=1)
        slack = _BEYOND * (high - low)
        heights = np.clip(heights, low - slack, high + slack)
        return np.where(away[:, 0] <= _FARTHEST, heights, np.nan)


SMOOTH = LocalFit(1, 1.2, 16)
"""A plane: averages most, and is misled least by points astray."""
_FITS = (
    LocalFit(1, 2.4, 36), LocalFit(1, 1.7, 24), SMOOTH, LocalFit(2, 1.7, 32), LocalFit(2, 1.2, 20),
    LocalFit(2, 1.0, 18), LocalFit(2, 0.8, 16), LocalFit(3, 1.0, 28), LocalFit(3, 0.8, 24),
)  # fmt: skip
"""From the smoothest to the roughest."""


def best_fit(flat: Array, apart: float, *, seed: int = 0) -> LocalFit:
    """Return the fit that predicts points best that are left out, one at a time.

    Parameters
    ----------
    flat : (n, 3) array
        Points: position on the plane and height [m].
    apart : float
        Mean distance between points [m].
    seed : int
        Of the choice of the points that are tried.
    """
    rng = np.random.default_rng(seed)
    tried = flat[rng.permutation(len(flat))[:_TRIED]]
    best, least = SMOOTH, np.inf
    for fit in _FITS:
        off = fit.heights(flat, tried[:, :2], apart, skip=1) - tried[:, 2]
        error = float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else np.inf
        if error < _BETTER * least:
            best, least = fit, error
    return best
