r"""Piecewise cubics: a fast, compiled stand-in for a periodic function with kinks and jumps.

The problem: a hand that is dragged for seconds asks for the texture force a million times, and
an exact offset costs microseconds each time. The force has jumps, where the probe's contact
leaps from one asperity to the next; a table that smooths over them has an error that no step
size removes.

The idea: find the jumps first, by bisection on the exact function, and put an edge of the table
on each. Between jumps the function is smooth, and the intervals are halved until the cubic
through four Chebyshev nodes agrees with the exact function at three other places.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.compiled import kernel

Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]

_NODES = 0.5 - 0.5 * np.cos(np.pi * (np.arange(4) + 0.5) / 4)
_CHECKS = np.array([0.01, 0.35, 0.8])
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_HALVINGS_TO_SUSPECT = 4
_MAX_HALVINGS = 12
_JUMP_WIDTH = 2.0**-36
"""A jump is bracketed to this fraction of the period."""


class PiecewiseCubic(NamedTuple):
    """A periodic function made of cubics; passes into compiled kernels as it is."""

    edges: NDArray[np.float64]
    """Where the cubics begin, then the period; shape (n + 1,), from 0."""
    coefficients: NDArray[np.float64]
    """Of 1, t, t^2, t^3 with t in [0, 1] over the interval; shape (n, 4)."""
    jumps: NDArray[np.float64]
    """Where the function jumps, rising, each one an edge; may be empty."""
    error: float
    """Largest difference seen from the function at the places of the check."""

    @property
    def period(self) -> float:
        """Distance after which the function repeats."""
        return float(self.edges[-1])

    def __call__(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
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
    limit = tolerance * float(np.max(np.abs(function(start))))
    _, _, suspects, _ = _refine(function, start, limit, _HALVINGS_TO_SUSPECT)
    least = 100.0 * limit
    jumps = _bracket_jumps(function, suspects, period * _JUMP_WIDTH, least)
    clear = np.ones(start.size, dtype=bool)
    if jumps.size:
        # A regular edge next to a jump would leave a sliver; the jump takes its place.
        nearest = np.min(np.abs(start[:, None] - jumps[None, :]), axis=1)
        clear = nearest > 1e-6 * period / cells
        clear[[0, -1]] = True
    edges = np.union1d(start[clear], jumps)
    edges, coefficients, _, error = _refine(function, edges, limit, _MAX_HALVINGS)
    # A jump that happened to lie on an edge was never inside a suspect interval: ask the table.
    leaps = np.abs(coefficients[:, 0] - np.roll(np.sum(coefficients, axis=1), 1))
    return PiecewiseCubic(edges, coefficients, edges[:-1][leaps > least], error)


def _refine(
    function: Function, edges: NDArray[np.float64], limit: float, halvings: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Return edges, coefficients, the intervals that stayed bad (k, 2), and the worst error."""
    low, high = edges[:-1], edges[1:]
    done_low: list[NDArray[np.float64]] = []
    done: list[NDArray[np.float64]] = []
    worst = 0.0
    bad = np.empty((0, 2))
    for level in range(halvings + 1):
        width = (high - low)[:, None]
        samples = function(low[:, None] + width * np.concatenate([_NODES, _CHECKS]))
        powers = samples[:, :4] @ _TO_POWERS.T
        expected = powers @ np.vander(_CHECKS, 4, increasing=True).T
        error = np.max(np.abs(expected - samples[:, 4:]), axis=1, initial=0.0)
        good = error <= limit
        if level == halvings:
            bad = np.stack([low[~good], high[~good]], axis=1)
            good[:] = True
        worst = max(worst, float(np.max(error[good], initial=0.0)))
        done_low.append(low[good])
        done.append(powers[good])
        low, high = low[~good], high[~good]
        if not low.size:
            break
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    starts = np.concatenate(done_low)
    order = np.argsort(starts)
    all_edges = np.append(starts[order], edges[-1])
    return all_edges, np.concatenate(done)[order], bad, worst


def _bracket_jumps(
    function: Function, suspects: NDArray[np.float64], width: float, least: float
) -> NDArray[np.float64]:
    """Return the places inside the suspect intervals where the function jumps by over `least`."""
    if not suspects.size:
        return np.empty(0)
    low, high = suspects[:, 0].copy(), suspects[:, 1].copy()
    at_low, at_high = function(low), function(high)
    while np.max(high - low) > width:
        middle = 0.5 * (low + high)
        value = function(middle)
        left = np.abs(value - at_low) > np.abs(at_high - value)
        high, at_high = np.where(left, middle, high), np.where(left, value, at_high)
        low, at_low = np.where(left, low, middle), np.where(left, at_low, value)
    places = 0.5 * (low + high)[np.abs(at_high - at_low) > least]
    if not places.size:
        return places
    places = np.sort(places)
    return places[np.concatenate([[True], np.diff(places) > 4.0 * width])]


@kernel
def locate(edges, place, hint):
    """Return the interval that holds `place`, found by walking from `hint`."""
    last = edges.size - 2
    i = min(max(hint, 0), last)
    while i > 0 and place < edges[i]:
        i -= 1
    while i < last and place >= edges[i + 1]:
        i += 1
    return i


@kernel
def value_and_slope(edges, coefficients, i, place):
    """Return the cubic of interval `i` and its derivative at `place`, inside it or just beyond."""
    width = edges[i + 1] - edges[i]
    t = (place - edges[i]) / width
    c = coefficients[i]
    value = c[0] + t * (c[1] + t * (c[2] + t * c[3]))
    return value, (c[1] + t * (2.0 * c[2] + 3.0 * t * c[3])) / width
