r"""Piecewise cubics: a fast, compiled approximation of a periodic function with kinks and jumps.

A dragged hand evaluates the texture force a million times in seconds, and an exact offset costs
microseconds. The force jumps where the probe's contact switches from one asperity to the next; a
table that smooths the jumps has an error that no step size removes.

So the jumps are located first, by subdivision on the exact function, and each becomes an edge of
the table. Between jumps the function is smooth, and intervals are halved until the cubic through
four Chebyshev nodes agrees with the exact function at four other points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array

Function = Callable[[Array], Array]

_NODES = 0.5 - 0.5 * np.cos(np.pi * (np.arange(4) + 0.5) / 4)
_CHECKS = np.array([0.01, 0.35, 0.8, 0.99])
_FIRST_CHECKS = np.array([1e-8, 0.35, 0.8, 1.0 - 1e-8])
"""Used while jumps are located: a jump beside an edge would be placed on that edge."""
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_MAX_HALVINGS = 8
_QUARTERS = np.linspace(0.0, 1.0, 5)
_LEAST_JUMP = 1e-4
"""Smallest jump, relative to the largest value."""
_JUMP_WIDTH = 1e-3
"""Width to which a jump is bracketed, in tolerances and cells."""


class PiecewiseCubic(NamedTuple):
    """A periodic function of cubics that compiled kernels accept."""

    edges: Array
    """Starts of the cubics, then the period; shape (n + 1,), from 0."""
    coefficients: Array
    """Coefficients of 1, t, t^2, t^3 with t in [0, 1] over the interval; shape (n, 4)."""
    jumps: Array
    """Positions of the jumps, increasing, each an edge; may be empty."""
    error: float
    """Largest deviation from the function at the check points."""

    @property
    def period(self) -> float:
        """Distance after which the function repeats."""
        return float(self.edges[-1])

    def __call__(self, u: Array) -> Array:
        """Return the values at `u` (any shape), for plots and tests."""
        place = np.mod(u, self.period)
        i = np.clip(np.searchsorted(self.edges, place, side="right") - 1, 0, self.edges.size - 2)
        t = (place - self.edges[i]) / (self.edges[i + 1] - self.edges[i])
        c = self.coefficients[i]
        return c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))

    def scaled(self, factor: float) -> PiecewiseCubic:
        """Return `factor` times the function."""
        return self._replace(
            coefficients=self.coefficients * factor, error=self.error * abs(factor)
        )


def tabulate(
    function: Function, period: float, *, cells: int = 64, tolerance: float = 1e-6
) -> PiecewiseCubic:
    """Return `function` as cubics that agree with it to `tolerance` times its largest value.

    Parameters
    ----------
    function : callable
        Array of places in [0, period] to array of values; smooth but for isolated jumps.
    period : float
        Distance after which the function repeats.
    cells : int
        Intervals to start from: fine enough that each feature of the function meets a few.
    tolerance : float
        Relative to the largest absolute value.
    """
    start = np.linspace(0.0, period, cells + 1)
    largest = float(np.max(np.abs(function(start))))
    limit, least = tolerance * largest, max(_LEAST_JUMP, 2.0 * tolerance) * largest
    edges, coefficients, bad, error = _refine(
        function, start[:-1], start[1:], limit, 4, _FIRST_CHECKS
    )
    if bad.size:
        width = max(_JUMP_WIDTH * tolerance / cells, 1e-14) * period  # above rounding
        jumps = _bracket_jumps(function, bad, width, least)
        low, high = _split(bad, jumps, 100.0 * width)
        more = _refine(function, low, high, limit, _MAX_HALVINGS, _CHECKS)
        # Intervals still inaccurate are kept: they are too narrow to matter; see `error`.
        rest = _cubics(function, more[2][:, 0], more[2][:, 1], _CHECKS) if more[2].size else None
        for extra in (more, rest):
            if extra is not None:
                edges = np.concatenate([edges, extra[0]])
                coefficients = np.concatenate([coefficients, extra[1]])
                error = max(error, extra[3])
    order = np.argsort(edges)
    edges, coefficients = edges[order], coefficients[order]
    # A jump exactly on an edge was never inside an interval: the table shows it.
    leaps = np.abs(coefficients[:, 0] - np.roll(np.sum(coefficients, axis=1), 1))
    return PiecewiseCubic(np.append(edges, period), coefficients, edges[leaps > least], error)


def mirrored(half: PiecewiseCubic) -> PiecewiseCubic:
    """Return the odd continuation of a table of [0, l] over the period 2 l: f(2 l - u) = -f(u)."""
    c0, c1, c2, c3 = half.coefficients[::-1].T
    back = -np.stack([c0 + c1 + c2 + c3, -c1 - 2.0 * c2 - 3.0 * c3, c2 + 3.0 * c3, -c3], axis=1)
    length = half.period
    edges = np.concatenate([half.edges, 2.0 * length - half.edges[-2::-1]])
    inside = half.jumps[half.jumps > 0.0]
    jumps = [inside, np.sort(2.0 * length - inside)]
    # The continuation is odd about both ends: it jumps there unless it is zero.
    least = _LEAST_JUMP * float(np.max(np.abs(half.coefficients[:, 0])))
    if 2.0 * abs(c0[-1]) > least:
        jumps.insert(0, np.zeros(1))
    if 2.0 * abs(half.coefficients[-1].sum()) > least:
        jumps.insert(-1, np.array([length]))
    return PiecewiseCubic(
        edges, np.concatenate([half.coefficients, back]), np.concatenate(jumps), half.error
    )


_Cubics = tuple[Array, Array, Array, float]


def _cubics(function: Function, low: Array, high: Array, checks: Array) -> _Cubics:
    """Return starts, coefficients, errors and the largest error of one cubic per interval."""
    width = (high - low)[:, None]
    samples = function(low[:, None] + width * np.concatenate([_NODES, checks]))
    powers = samples[:, :4] @ _TO_POWERS.T
    expected = powers @ np.vander(checks, 4, increasing=True).T
    error = np.max(np.abs(expected - samples[:, 4:]), axis=1, initial=0.0)
    return low, powers, error, float(np.max(error, initial=0.0))


def _refine(
    function: Function, low: Array, high: Array, limit: float, halvings: int, checks: Array
) -> _Cubics:
    """Return starts and coefficients of accurate cubics, the others (k, 2), the largest error."""
    starts, cubics, worst = [np.empty(0)], [np.empty((0, 4))], 0.0
    for level in range(halvings + 1):
        _, powers, error, _ = _cubics(function, low, high, checks)
        good = error <= limit
        worst = max(worst, float(np.max(error[good], initial=0.0)))
        starts.append(low[good])
        cubics.append(powers[good])
        low, high = low[~good], high[~good]
        if level == halvings or not low.size:
            break
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return np.concatenate(starts), np.concatenate(cubics), np.stack([low, high], axis=1), worst


def _split(intervals: Array, jumps: Array, sliver: float) -> tuple[Array, Array]:
    """Return starts and ends of the intervals, cut at jumps that leave more than a sliver."""
    low, high = [], []
    for start, stop in intervals[np.argsort(intervals[:, 0])]:
        inside = jumps[(jumps > start + sliver) & (jumps < stop - sliver)]
        cuts = np.concatenate([[start], inside, [stop]])
        low.append(cuts[:-1])
        high.append(cuts[1:])
    return np.concatenate(low), np.concatenate(high)


def _bracket_jumps(function: Function, suspects: Array, width: float, least: float) -> Array:
    """Return the positions in the given intervals where the function jumps by over `least`."""
    low, high = suspects[:, 0], suspects[:, 1]
    at_low, at_high = function(low), function(high)
    row = np.arange(low.size)
    while np.max(high - low) > width:
        places = low[:, None] + (high - low)[:, None] * _QUARTERS
        values = np.column_stack([at_low, function(places[:, 1:4]), at_high])
        # All quarters share a smooth change: the outlier contains the jump,
        # also where the function falls steeply towards an upward jump.
        changes = np.diff(values, axis=1)
        odd = np.argmax(np.abs(changes - np.median(changes, axis=1, keepdims=True)), axis=1)
        low, high = places[row, odd], places[row, odd + 1]
        at_low, at_high = values[row, odd], values[row, odd + 1]
    places = np.sort(0.5 * (low + high)[np.abs(at_high - at_low) > least])
    return places[np.diff(places, prepend=-np.inf) > 4.0 * width]
