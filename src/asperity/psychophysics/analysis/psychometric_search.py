"""Maximum of the likelihood of a psychometric function, and its profiles.

Threshold, width and lapse rate are free within bounds, the lapse rate between 0 and 0.06 (Wichmann
& Hill 2001, Percept. Psychophys. 63, 1293-1313). The likelihood is evaluated on a coarse grid and
then on ever smaller ones around the maximum, for many samples, or many values of one parameter
that is held, at once.
"""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array
from asperity.psychophysics.analysis.psychometric import probability

HIGHEST_LAPSE = 0.06
THRESHOLD, WIDTH = 0, 1
"""Of a row of parameters: threshold, width, lapse."""
_ROUNDS = 24
_SHRINK = 0.72
_GRID = (41, 21, 4)
_LOCAL = (3, 3, 3)
_STEPS = 33
_FINER = 3
"""Number of refinements of an interval's end, each by `_STEPS` steps."""
_MOST = 2_000_000
"""Largest number of probabilities in memory at once."""


class LikelihoodSearch:
    """The likelihood over threshold, log width and lapse rate, and its maximum.

    Parameters
    ----------
    x : (m,) array
        Intensities, rising.
    count : (m,) array
        Trials at each.
    guess, function
        See `Psychometric`.
    lapse : float, optional
        Held; otherwise free.
    """

    def __init__(
        self, x: Array, count: Array, guess: float | None, function: str, lapse: float | None
    ) -> None:
        self._x, self._count, self._guess, self._function = x, count, guess, function
        span = float(x[-1] - x[0])
        finest = float(np.min(np.diff(x)))
        lapses = (0.0, HIGHEST_LAPSE) if lapse is None else (lapse, lapse)
        widths = (0.5 * finest, 4.0 * span)
        self._low = np.array([x[0] - 0.5 * span, np.log(widths[0]), lapses[0]])
        self._high = np.array([x[-1] + 0.5 * span, np.log(widths[1]), lapses[1]])
        self._free = self._high > self._low
        self._pitch = (self._high - self._low) / (np.array(_GRID) - 1)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest threshold, width, lapse."""
        return _plain(self._low), _plain(self._high)

    def psi(self, parameters: Array) -> Array:
        """Return the probabilities (n, x) of parameters (n, 3): threshold, width, lapse."""
        t, w, lapse = (parameters[:, i, None] for i in range(3))
        return probability(self._x, t, w, lapse, self._guess, self._function)

    def best(self, hits: Array) -> Array:
        """Return threshold, width, lapse (n, 3) of most likelihood for hits (n, x)."""
        grid = self._lattice(_GRID, self._low, self._high)
        at = grid[np.argmax(self._of_grid(grid, hits), axis=1)]
        return _plain(self._climbed(at, hits, self._pitch))

    def likelihood(self, hits: Array, parameters: Array) -> Array:
        """Return the log likelihood (n,) of parameters (n, 3), for hits (n, x) or (x,)."""
        p = np.clip(self.psi(parameters), 1e-9, 1.0 - 1e-9)
        out = (hits * np.log(p) + (self._count - hits) * np.log1p(-p)).sum(axis=1)
        return np.asarray(out)

    def profile(self, hits: Array, which: int, values: Array) -> Array:
        """Return the most log likelihood (k,) with one parameter held, for hits (x,).

        Parameters
        ----------
        which : int
            `THRESHOLD` or `WIDTH`.
        values : (k,) array
            Of that parameter; the width's logarithm.
        """
        shape = (1, *_GRID[1:]) if which == THRESHOLD else (_GRID[0], 1, _GRID[2])
        rest = self._lattice(shape, self._low, self._high)
        grid = np.repeat(rest[None], len(values), axis=0)
        grid[..., which] = values[:, None]
        likely = self._of_grid(grid.reshape(-1, 3), hits[None, :])[0].reshape(grid.shape[:2])
        at = grid[np.arange(len(values)), np.argmax(likely, axis=1)]
        reach = self._pitch.copy()
        reach[which] = 0.0
        found = self._climbed(at, np.repeat(hits[None, :], len(values), axis=0), reach)
        return self.likelihood(hits, _plain(found))

    def interval(self, hits: Array, best: Array, which: int, fall: float) -> tuple[float, float]:
        """Return between which values of a parameter the profile is less than `fall` below best.

        An end that is not found within the bounds is the bound.

        Parameters
        ----------
        hits : (x,) array
        best : (3,) array
            Of `best`.
        which : int
        fall : float
            Of the log likelihood.
        """
        middle = float(np.log(best[which])) if which == WIDTH else float(best[which])
        level = float(self.likelihood(hits, best[None, :])[0]) - fall
        low, high = (
            self._end(hits, which, middle, float(side[which]), level)
            for side in (self._low, self._high)
        )
        return (float(np.exp(low)), float(np.exp(high))) if which == WIDTH else (low, high)

    def _end(self, hits: Array, which: int, near: float, far: float, level: float) -> float:
        """Return where the profile, from a value towards a bound, falls below a level first."""
        for _ in range(_FINER):
            values = np.linspace(near, far, _STEPS)
            below = self.profile(hits, which, values) < level
            below[0] = False
            if not below.any():
                return far
            first = int(np.argmax(below))
            near, far = float(values[first - 1]), float(values[first])
        return 0.5 * (near + far)

    def _of_grid(self, grid: Array, hits: Array) -> Array:
        """Return the log likelihood (n, k) of k points for hits (n, x)."""
        p = np.clip(self.psi(_plain(grid)), 1e-9, 1.0 - 1e-9)
        # Linear in the hits: one product of matrices for all samples.
        return np.asarray(hits @ (np.log(p) - np.log1p(-p)).T + self._count @ np.log1p(-p).T)

    def _climbed(self, at: Array, hits: Array, reach: Array) -> Array:
        """Return the best points (n, 3) near points, for hits (n, x)."""
        offsets = self._lattice(_LOCAL, -np.ones(3), np.ones(3))
        offsets = offsets[(offsets[:, reach == 0.0] == 0.0).all(axis=1)]
        out, chunk = np.array(at), max(1, _MOST // (len(offsets) * self._x.size))
        for first in range(0, len(at), chunk):
            part = slice(first, first + chunk)
            out[part] = self._refined(at[part], hits[part], offsets, reach)
        return out

    def _refined(self, at: Array, hits: Array, offsets: Array, reach: Array) -> Array:
        for _ in range(_ROUNDS):
            near = np.clip(at[:, None, :] + offsets * reach, self._low, self._high)
            p = self.psi(_plain(near.reshape(-1, 3))).reshape(*near.shape[:2], -1)
            p = np.clip(p, 1e-9, 1.0 - 1e-9)
            likely = np.einsum("nx,nox->no", hits, np.log(p))
            likely += np.einsum("nx,nox->no", self._count - hits, np.log1p(-p))
            at = near[np.arange(len(at)), np.argmax(likely, axis=1)]
            reach = _SHRINK * reach
        return at

    def _lattice(self, shape: tuple[int, int, int], low: Array, high: Array) -> Array:
        """Return points (n, 3) between two corners; one value where nothing is free."""
        axes = [
            np.linspace(a, b, n) if free else np.array([0.5 * (a + b)])
            for a, b, n, free in zip(low, high, shape, self._free, strict=True)
        ]
        return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def _plain(points: Array) -> Array:
    """Return points with the width in place of its logarithm."""
    out = np.array(points)
    out[..., 1] = np.exp(out[..., 1])
    return out
