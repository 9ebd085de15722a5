"""Slow, obvious twins of the compiled kernels: dense maxima, dense collocation, solve_ivp."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, ndimage

from asperity.texture.spline import evaluate_1d, evaluate_2d

Array = NDArray[np.float64]


def spline(samples: Array, border: str, *places: Array) -> Array:
    """Return SciPy's cubic spline through the samples, at places counted as we count them."""
    if border == "mirror":
        samples = np.pad(samples, [(0, n) for n in samples.shape], mode="symmetric")
    at = [place - 0.5 for place in np.broadcast_arrays(*places)]
    return ndimage.map_coordinates(samples, at, order=3, mode="grid-wrap")


def kernel_values(coefficients: Array, *places: Array) -> Array:
    """Return what the kernels make of spline coefficients, at places counted as we count them."""
    evaluate = (evaluate_1d, evaluate_2d)[coefficients.ndim - 1]
    values = []
    for at in zip(*(np.ravel(place) + 0.5 for place in places), strict=True):
        cells = [min(max(int(x), 0), n - 4) for x, n in zip(at, coefficients.shape, strict=True)]
        inside = [x - cell for x, cell in zip(at, cells, strict=True)]
        values.append(evaluate(coefficients, *cells, *inside)[0])
    return np.reshape(values, np.shape(places[0]))


def collocation_coefficients(samples: Array, border: str) -> Array:
    """Return 1-D spline coefficients by solving the dense interpolation equations."""
    n = samples.size
    matrix = np.zeros((n, n))
    for i in range(n):
        for k, weight in ((-1, 1 / 6), (0, 4 / 6), (1, 1 / 6)):
            j = i + k
            j = j % n if border == "wrap" else min(max(j, 0), n - 1)
            matrix[i, j] += weight
    return np.linalg.solve(matrix, samples)


def rest_on_points(x: Array, z: Array, diameter: float, u: Array) -> Array:
    """Return how high a disk's lowest point lies above each `u`, resting on the points (x, z)."""
    radius = 0.5 * diameter
    heights = []
    for place in np.atleast_1d(u):
        near = np.abs(x - place) < radius
        across = x[near] - place
        heights.append(np.max(z[near] + np.sqrt(radius**2 - across**2) - radius))
    return np.array(heights)


def rest_on_map(
    heights: Callable[[Array, Array], Array], diameter: float, u: float, v: float, pitch: float
) -> float:
    """Return how high a sphere's lowest point lies above (u, v): all points, then ever finer."""
    radius = 0.5 * diameter
    steps = np.arange(-radius, radius, pitch)
    across = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    best = -np.inf
    for _ in range(5):
        across = across[np.sum(across**2, axis=1) < radius**2]
        z = heights(u + across[:, 0], v + across[:, 1])
        z = z + np.sqrt(radius**2 - np.sum(across**2, axis=1)) - radius
        best = max(best, float(np.max(z)))
        finest = across[np.argsort(z)[-24:]]
        around = np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 11)]), axis=-1).reshape(-1, 2)
        across = (finest[:, None, :] + pitch * around[None]).reshape(-1, 2)
        pitch *= 0.2
    return best


class Ride(NamedTuple):
    """A dragged hand, sampled; `extremes` are of u'', both sides of every jump included."""

    place: Array
    speed: Array
    acceleration: Array
    extremes: tuple[float, float]


def ride(
    force: Callable[[float], float],
    jumps: Array,
    period: float,
    hand: tuple[float, float, float],
    drive: float,
    times: Array,
    start: tuple[float, float],
) -> Ride:
    """Integrate Eq. 7 from (u, u') = start by DOP853, stopped and started anew at every jump.

    `force` is asked only inside the stretch between jumps that the hand is in. The drive stands
    at `drive * t`; time runs from 0.
    """
    mass, stiffness, damping = hand
    if jumps.size:
        walls = np.concatenate([jumps - period, jumps, jumps + period])
    else:
        walls = np.array([-np.inf, np.inf])
    inset = 1e-9 * period  # jumps are known to 1e-10 of it; the force is asked on the right side

    def bounds(u: float) -> tuple[float, float]:
        if not jumps.size:
            return -np.inf, np.inf
        base = np.floor(u / period) * period
        k = int(np.searchsorted(walls + base, u))
        return walls[k - 1] + base, walls[k] + base

    def acceleration(t: float, u: float, s: float, low: float, high: float) -> float:
        at = min(max(u, low + inset), high - inset) if np.isfinite(low) else u
        pull = stiffness * (drive * t - u) + damping * (drive - s)
        return (pull - force(at % period)) / mass

    t, state = 0.0, np.array(start)
    low, high = bounds(start[0] + inset)
    rows: list[Array] = []
    extremes = [np.inf, -np.inf]
    while t < times[-1]:
        ends = (low, high)

        def leave(t: float, y: Array, ends: tuple[float, float] = ends) -> float:
            return y[0] - ends[1]

        def back(t: float, y: Array, ends: tuple[float, float] = ends) -> float:
            return y[0] - ends[0]

        leave.terminal = back.terminal = True  # type: ignore[attr-defined]
        leave.direction, back.direction = 1.0, -1.0  # type: ignore[attr-defined]
        answer = integrate.solve_ivp(
            lambda t, y, ends=ends: (y[1], acceleration(t, y[0], y[1], *ends)),
            (t, times[-1]),
            state,
            method="DOP853",
            rtol=1e-10,
            atol=1e-13,
            max_step=0.02 * period / drive,
            events=[leave, back] if jumps.size else None,
            dense_output=True,
        )
        end = answer.t[-1]
        inside = times[(times >= t) & (times < end)] if end < times[-1] else times[times >= t]
        for moment in inside:
            u, s = answer.sol(moment)
            rows.append(np.array([u, s, acceleration(moment, u, s, *ends)]))
        count = 2 + int(2000 * (end - t) * drive / period)
        for moment in np.linspace(t, end, count):
            value = acceleration(moment, *answer.sol(moment), *ends)
            extremes = [min(extremes[0], value), max(extremes[1], value)]
        t, state = end, answer.y[:, -1].copy()
        if answer.status == 1:
            forward = answer.t_events[0].size > 0
            low, high = bounds(high + inset if forward else low - inset)
            state[0] = low if forward else high
    place, speed, accelerations = np.array(rows).T
    return Ride(place, speed, accelerations, (extremes[0], extremes[1]))
