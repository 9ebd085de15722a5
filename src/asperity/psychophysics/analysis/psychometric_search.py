"""Maximum of the likelihood of a psychometric function, and its profiles.

Threshold, width and lapse rate are free within bounds, the lapse rate between 0 and 0.06 (Wichmann
& Hill 2001, Percept. Psychophys. 63, 1293-1313). The likelihood is evaluated on a coarse grid and
then on ever smaller ones around the maximum, for many samples, or many values of one quantity
that is held, at once. A held quantity that is no parameter itself, such as the slope, stands in
for one: the parameter follows from it and the other two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.psychophysics.analysis.psychometric import STEEPNESS, place, probability

HIGHEST_LAPSE = 0.06
QUANTITIES = {"threshold": 0, "level": 0, "width": 1, "slope": 1, "lapse": 2}
"""Quantities that can be held, and the column of the parameter (threshold, width, lapse) for which
each stands in. "level" is the intensity at `LikelihoodSearch.proportion` of right answers."""
_POSITIVE = ("width", "slope")
"""Searched by their logarithms."""
_ROUNDS = 24
_SHRINK = 0.72
_GRID = (41, 21, 4)
_LOCAL = (3, 3, 3)
_STEPS = 33
_FINER = 3
"""Number of refinements of an interval's end."""
_MOST = 2_000_000
"""Largest number of probabilities in memory at once."""


def profile_end(
    profile: Callable[[Array], Array], spaced: Callable[[float, float], Array],
    ends: tuple[float, float], level: float,
) -> float:  # fmt: skip
    """Return where a profile likelihood first falls below a level, or the far end of the search.

    Parameters
    ----------
    profile : callable
        Returns the log likelihood (k,) of values (k,).
    spaced : callable
        Returns values (k,) from one to another, both included.
    ends : (float, float)
        The value of most likelihood, and the far end.
    level : float
        Of the log likelihood.
    """
    near, far = ends
    for _ in range(_FINER):
        values = spaced(near, far)
        below = profile(values) < level
        below[0] = False
        if not below.any():
            return far
        first = int(np.argmax(below))
        near, far = float(values[first - 1]), float(values[first])
    return 0.5 * (near + far)


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
    proportion : float
        Of right answers, for the quantity "level".
    """

    def __init__(
        self, x: Array, count: Array, guess: float | None, function: str, lapse: float | None,
        proportion: float = 0.75,
    ) -> None:  # fmt: skip
        self._x, self._count, self._guess, self._function = x, count, guess, function
        self.proportion = proportion
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

    def profile(self, hits: Array, quantity: str, values: Array) -> Array:
        """Return the most log likelihood (k,) with one quantity held, for hits (x,).

        Parameters
        ----------
        quantity : str
            One of `QUANTITIES`.
        values : (k,) array
            Of that quantity. Where no parameters within the bounds have it, the result is -inf.
        """
        column = QUANTITIES[quantity]
        shape = tuple(1 if i == column else n for i, n in enumerate(_GRID))
        rest = self._lattice(shape, self._low, self._high)
        grid = self._held(np.repeat(rest[None], len(values), axis=0), quantity, values)
        likely = self._of_grid(grid.reshape(-1, 3), hits[None, :])[0].reshape(grid.shape[:2])
        likely[~self._inside(grid)] = -np.inf
        at = grid[np.arange(len(values)), np.argmax(likely, axis=1)]
        reach = self._pitch.copy()
        reach[column] = 0.0
        found = self._climbed(
            at, np.repeat(hits[None, :], len(values), axis=0), reach, (quantity, values)
        )
        return np.where(
            self._inside(found), self.likelihood(hits, _plain(found)), -np.inf
        )  # fmt: skip

    def of(self, quantity: str, parameters: Array) -> Array:
        """Return a quantity (n,) of parameters (n, 3)."""
        threshold, width, lapse = parameters.T
        if quantity == "level":
            return np.asarray(
                threshold + width * place(self.proportion, lapse, self._guess, self._function)
            )
        if quantity == "slope":
            return np.asarray(self._height(lapse) / width)
        return np.asarray(parameters[:, QUANTITIES[quantity]])

    def interval(self, hits: Array, best: Array, quantity: str, fall: float) -> tuple[float, float]:
        """Return between which values of a quantity the profile is less than `fall` below best.

        An end that is not found within the bounds is the bound.

        Parameters
        ----------
        hits : (x,) array
        best : (3,) array
            Of `best`.
        quantity : str
        fall : float
            Of the log likelihood.
        """
        middle = float(self.of(quantity, best[None, :])[0])
        if not np.isfinite(middle):
            return (float("nan"), float("nan"))
        level = float(self.likelihood(hits, best[None, :])[0]) - fall
        steps = np.geomspace if quantity in _POSITIVE else np.linspace
        low, high = (
            profile_end(
                lambda values: self.profile(hits, quantity, values),
                lambda near, beyond: np.asarray(steps(near, beyond, _STEPS)),
                (middle, far), level,
            )
            for far in self._reach(quantity)
        )  # fmt: skip
        return low, high

    def _reach(self, quantity: str) -> tuple[float, float]:
        """Return the smallest and the largest value of a quantity that is searched."""
        low, high = self.bounds
        if quantity == "slope":
            return float(self._height(high[2]) / high[1]), float(self._height(low[2]) / low[1])
        column = QUANTITIES[quantity]
        return float(low[column]), float(high[column])

    def _height(self, lapse: Array) -> Array:
        """Return the slope at the threshold, where the width is 1."""
        chance = lapse if self._guess is None else self._guess
        return np.asarray((1.0 - chance - lapse) * STEEPNESS[self._function])

    def _held(self, grid: Array, quantity: str, values: Array) -> Array:
        """Return points (k, n, 3) with the parameter that gives the quantity its value (k,)."""
        out, value = np.array(grid), values[:, None]
        if quantity == "level":
            z = place(self.proportion, grid[..., 2], self._guess, self._function)
            value = value - np.exp(grid[..., 1]) * z
        elif quantity == "slope":
            value = np.log(self._height(grid[..., 2]) / value)
        elif quantity == "width":
            value = np.log(value)
        out[..., QUANTITIES[quantity]] = value
        return out

    def _inside(self, points: Array) -> NDArray[np.bool_]:
        """Return which points are within the bounds."""
        small = 1e-9 * (1.0 + np.abs(self._high - self._low))
        return np.asarray(
            ((points >= self._low - small) & (points <= self._high + small)).all(axis=-1)
        )

    def _of_grid(self, grid: Array, hits: Array) -> Array:
        """Return the log likelihood (n, k) of k points for hits (n, x)."""
        p = np.clip(self.psi(_plain(grid)), 1e-9, 1.0 - 1e-9)
        # Linear in the hits: one product of matrices for all samples.
        return np.asarray(hits @ (np.log(p) - np.log1p(-p)).T + self._count @ np.log1p(-p).T)

    def _climbed(
        self, at: Array, hits: Array, reach: Array, held: tuple[str, Array] | None = None
    ) -> Array:
        """Return the best points (n, 3) near points, for hits (n, x)."""
        offsets = self._lattice(_LOCAL, -np.ones(3), np.ones(3))
        offsets = offsets[(offsets[:, reach == 0.0] == 0.0).all(axis=1)]
        out, chunk = np.array(at), max(1, _MOST // (len(offsets) * self._x.size))
        for first in range(0, len(at), chunk):
            part = slice(first, first + chunk)
            kept = None if held is None else (held[0], held[1][part])
            out[part] = self._refined(at[part], hits[part], offsets, reach, kept)
        return out

    def _refined(
        self, at: Array, hits: Array, offsets: Array, reach: Array,
        held: tuple[str, Array] | None,
    ) -> Array:  # fmt: skip
        for _ in range(_ROUNDS):
            near = np.clip(at[:, None, :] + offsets * reach, self._low, self._high)
            near = near if held is None else self._held(near, *held)
            p = self.psi(_plain(near.reshape(-1, 3))).reshape(*near.shape[:2], -1)
            p = np.clip(p, 1e-9, 1.0 - 1e-9)
            likely = np.einsum("nx,nox->no", hits, np.log(p))
            likely += np.einsum("nx,nox->no", self._count - hits, np.log1p(-p))
            likely[~self._inside(near)] = -np.inf
            at = near[np.arange(len(at)), np.argmax(likely, axis=1)]
            reach = _SHRINK * reach
        return at

    def _lattice(self, shape: tuple[int, ...], low: Array, high: Array) -> Array:
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
