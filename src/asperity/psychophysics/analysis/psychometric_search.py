"""Maximum of the likelihood of a psychometric function, and its profiles.

Threshold, width and lapse rate are free within bounds, the lapse rate between 0 and 0.06 (Wichmann
& Hill 2001, Percept. Psychophys. 63, 1293-1313). The likelihood is evaluated on a coarse grid, from
whose best point Fisher scoring goes on (damped after Marquardt 1963, J. Soc. Ind. Appl. Math. 11,
431-441), for many sessions or samples, or many values of one quantity that is held, at once. A held
quantity that is no parameter itself, such as the slope, stands in for one: the parameter follows
from it and the other two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.psychophysics.analysis.psychometric import STEEPNESS, place, probability
from asperity.psychophysics.analysis.scoring import Climb, plain

HIGHEST_LAPSE = 0.06
QUANTITIES = {"threshold": 0, "level": 0, "width": 1, "slope": 1, "lapse": 2}
"""Quantities that can be held, and the column of the parameter (threshold, width, lapse) for which
each stands in. "level" is the intensity at `LikelihoodSearch.proportion` of right answers."""
_POSITIVE = ("width", "slope")
"""Searched by their logarithms."""
_STARTS = 4
_GRID = (21, 13, 3)
_STEPS = 13
_FINER = 3
"""Number of refinements of an interval's end."""
_MOST = 200_000
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
    part = 0.5
    for _ in range(_FINER):
        values = spaced(near, far)
        heights = profile(values)
        below = heights < level
        below[0] = False
        if not below.any():
            return far
        last = int(np.argmax(below)) - 1
        near, far = float(values[last]), float(values[last + 1])
        if np.isfinite(heights[last + 1]):
            above, drop = heights[last] - level, heights[last] - heights[last + 1]
            part = float(np.clip(above / drop, 0.0, 1.0))
    return near + part * (far - near)


class LikelihoodSearch:
    """The likelihood over threshold, log width and lapse rate, and its maximum.

    Of one session, or of many (n) whose levels differ.

    Parameters
    ----------
    x : (m,) or (n, m) array
        Intensities, rising.
    count : (m,) or (n, m) array
        Trials at each; 0 where a session has fewer levels than others.
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
        self._x, self._count = np.atleast_2d(x), np.atleast_2d(count)
        self._guess, self._function = guess, function
        self.proportion = proportion
        self._levels, self._at_level = np.unique(self._x, return_inverse=True)
        self._at_level = self._at_level.reshape(self._x.shape)
        ends = [_ends(*row) for row in zip(self._x, self._count, strict=True)]
        first, last, finest = np.array(ends).T
        span = last - first
        lapses = (0.0, HIGHEST_LAPSE) if lapse is None else (lapse, lapse)
        held = np.ones_like(span)
        self._low = np.stack([first - 0.5 * span, np.log(0.5 * finest), lapses[0] * held], 1)
        self._high = np.stack([last + 0.5 * span, np.log(4.0 * span), lapses[1] * held], 1)
        self._corners = self._low.min(axis=0), self._high.max(axis=0)
        self._free = self._corners[1] > self._corners[0]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest threshold, width, lapse (3,) of one session."""
        return plain(self._low[0]), plain(self._high[0])

    def psi(self, parameters: Array) -> Array:
        """Return the probabilities (n, m) of parameters (n, 3): threshold, width, lapse."""
        return self.psi_at(self._x, parameters)

    def psi_at(self, x: Array, parameters: Array) -> Array:
        """Return the probabilities (..., m) at intensities of parameters (..., 3), not 0 nor 1."""
        t, w, lapse = (parameters[..., i, None] for i in range(3))
        p = probability(x, t, w, lapse, self._guess, self._function)
        return np.clip(p, 1e-9, 1.0 - 1e-9)

    def best(self, hits: Array) -> Array:
        """Return threshold, width, lapse (n, 3) of most likelihood for hits (n, m)."""
        grid = self._lattice(None)
        likely = self._of_grid(grid, hits)
        likely = np.where(self.inside(grid, self._low, self._high), likely, -np.inf)
        return plain(self._highest(grid[None], likely, hits, self._free))

    def likelihood(self, hits: Array, parameters: Array) -> Array:
        """Return the log likelihood (n,) of parameters (n, 3), for hits (n, m) or (m,)."""
        p = self.psi(parameters)
        out = (hits * np.log(p) + (self._count - hits) * np.log1p(-p)).sum(axis=1)
        return np.asarray(out)

    def profile(self, hits: Array, quantity: str, values: Array) -> Array:
        """Return the most log likelihood with one quantity held.

        Parameters
        ----------
        hits : (m,) or (n, m) array
        quantity : str
            One of `QUANTITIES`.
        values : (k,) array
            Of that quantity; one value for hits of many sessions. Where no parameters within the
            bounds have it, the result is -inf.

        Returns
        -------
        (k,) or (n,) array
        """
        hits = np.atleast_2d(hits)
        rest = self._lattice(QUANTITIES[quantity])
        grid = self.with_held(np.repeat(rest[None], len(values), axis=0), quantity, values)
        likely = self._of_grid(grid.reshape(-1, 3), hits)
        inside = self.inside(grid.reshape(-1, 3), self._low, self._high)
        likely = np.where(inside, likely, -np.inf).reshape(len(hits), *grid.shape[:2])
        # One row for each value, or for each session.
        likely = likely.reshape(-1, grid.shape[1])
        every = np.broadcast_to(hits, (len(likely), hits.shape[1]))
        held = quantity, np.broadcast_to(values, len(likely))
        free = self._free & (np.arange(3) != QUANTITIES[quantity])
        found = self._highest(grid, likely, every, free, held)
        inside = self.inside(found[:, None], self._low, self._high)[:, 0]
        return np.where(inside, self.likelihood(every, plain(found)), -np.inf)

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

    def with_held(self, grid: Array, quantity: str, values: Array) -> Array:
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

    @staticmethod
    def inside(points: Array, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which points (k, 3) or (n, k, 3) are within bounds (n, 3), as (n, k)."""
        low, high = low[:, None], high[:, None]
        small = 1e-9 * (1.0 + np.abs(high - low))
        return np.asarray(((points >= low - small) & (points <= high + small)).all(axis=-1))

    def _of_grid(self, grid: Array, hits: Array) -> Array:
        """Return the log likelihood (n, k) of k points for hits (n, m)."""
        p = self.psi_at(self._levels, plain(grid))
        # Linear in the hits: one product of matrices for all samples.
        right, wrong = np.log(p), np.log1p(-p)
        return np.asarray(
            self._spread(hits) @ (right - wrong).T + self._spread(self._count) @ wrong.T
        )

    def _spread(self, numbers: Array) -> Array:
        """Return numbers (n, m) of each session's levels as those (n, k) of all levels."""
        if len(self._x) == 1:
            return numbers
        out = np.zeros((len(self._x), self._levels.size))
        np.add.at(out, (np.arange(len(self._x))[:, None], self._at_level), numbers)
        return out

    def _highest(
        self, grid: Array, likely: Array, hits: Array, free: NDArray[np.bool_],
        held: tuple[str, Array] | None = None,
    ) -> Array:  # fmt: skip
        """Return the points (n, 3) of most likelihood uphill of the best points of a grid.

        There may be several maxima, such as that of a step between two levels: the best points of
        narrow, middle and wide functions are gone on from.

        Parameters
        ----------
        grid : (k, g, 3) array
            k is n, or 1 for all.
        likely : (n, g) array
        hits : (n, m) array
        free : (3,) array
            Which parameters may change.
        held : (str, (n,) array), optional
            A quantity and its values, from which the parameter follows for which it stands in.
        """
        by = grid[0, :, 1 if free[1] else 0]
        parts = np.linspace(by.min(), by.max(), _STARTS + 1)[1:-1]
        rows, part = np.arange(len(likely)), np.searchsorted(parts, by)
        starts = [np.argmax(np.where(part == i, likely, -np.inf), 1) for i in range(_STARTS)]
        at = np.stack([grid[rows % len(grid), start] for start in starts], axis=1)
        found = self._climbed(at, hits, free, held)
        out, most = np.zeros((len(likely), 3)), np.full(len(likely), -np.inf)
        for i in range(_STARTS):
            now = self.likelihood(hits, plain(found[:, i]))
            out = np.where((now > most)[:, None], found[:, i], out)
            most = np.maximum(most, now)
        return out

    def _climbed(
        self, at: Array, hits: Array, free: NDArray[np.bool_], held: tuple[str, Array] | None
    ) -> Array:
        """Return the points (n, s, 3) to which scoring leads from s points for each of n."""
        out, chunk = np.array(at), max(1, _MOST // (at.shape[1] * self._x.shape[1]))
        for first in range(0, len(at), chunk):
            rows = np.repeat(np.arange(first, min(first + chunk, len(at))), at.shape[1])
            kept = None if held is None else (held[0], held[1][rows])
            own = rows if len(self._x) > 1 else slice(None)
            sessions = self._x[own], self._count[own], self._low[own], self._high[own]
            climb = Climb(self, sessions, hits[rows], np.flatnonzero(free), kept)
            ends = climb.from_points(at[first : first + chunk].reshape(-1, 3))
            out[first : first + chunk] = ends.reshape(-1, *at.shape[1:])
        return out

    def _lattice(self, held: int | None) -> Array:
        """Return points (n, 3) between the bounds; one value of what is held or not free."""
        (low, high), axes = self._corners, []
        for i, count in enumerate(_GRID):
            if i == held or not self._free[i]:
                axes.append(np.array([0.5 * (low[i] + high[i])]))
            else:
                axes.append(np.linspace(low[i], high[i], count))
        if len(axes[0]) > 1:  # a step lies between two levels
            between = 0.5 * (self._levels[1:] + self._levels[:-1])
            axes[0] = np.union1d(axes[0], between)
        return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def _ends(x: Array, count: Array) -> tuple[float, float, float]:
    """Return the lowest and the highest level of a session, and the least distance of two."""
    used = x[count > 0.0]
    return float(used[0]), float(used[-1]), float(np.min(np.diff(used)))
