r"""The highest contact of a disk on a sampled profile, certified by branch and bound.

Over a cubic spline `s(x)`, find the maximum of

    f(x) = s(x) + sqrt(r^2 - (x - u)^2) - r,     |x - u| <= r,

for a disk of radius `r` above `u`. Its value is the offset profile at `u`. All lengths are in
samples. There are many local maxima, so an ascent alone proves nothing.

The search is depth-first. A block of cells is bounded by the pyramid plus the disk's height over
the nearest point of the block. Inside a cell, whose curvature is linear and so bounded by its ends,
`f` is either concave, and the tangent at any point bounds it, or bounded by
`f(c) + |f'(c)| h + kappa h^2 / 2` from its middle. An interval is pruned only by such a bound; all
others are halved.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity.texture.spline import evaluate_1d

_STACK_SIZE = 256
_MAX_HALVINGS = 40
_NEWTON_STEPS = 30


@kernel
def cap(distance_squared, radius):
    """Return the height of a disk's or sphere's surface above its equator plane, minus r."""
    inside = radius * radius - distance_squared
    return math.sqrt(inside) - radius if inside > 0.0 else -np.inf


@kernel
def _evaluate(coefficients, x, u, radius):
    """Return f, f' and f'' at `x` (samples); -inf outside the disk."""
    cell = min(max(math.floor(x), 0), coefficients.size - 4)
    value, slope, curvature = evaluate_1d(coefficients, cell, x - cell)
    inside = radius * radius - (x - u) * (x - u)
    if inside <= 0.0:
        return -np.inf, 0.0, 0.0
    root = math.sqrt(inside)
    return (
        value + root - radius,
        slope - (x - u) / root,
        curvature - radius * radius / (inside * root),
    )


@inner_kernel
def _newton_ascent(coefficients, low, high, x, u, radius):
    """Return the maximiser of a concave f over [low, high] by safeguarded Newton from x."""
    for _ in range(_NEWTON_STEPS):
        _, slope, curvature = _evaluate(coefficients, x, u, radius)
        if slope > 0.0:
            low = x
        else:
            high = x
        step = -slope / curvature if curvature < 0.0 else math.inf
        target = x + step
        if not low <= target <= high:
            target = 0.5 * (low + high)
        if abs(target - x) < 1e-13:
            break
        x = target
    return x


@kernel
def _search_cell(coefficients, cell, u, radius, tolerance, best, best_x, spans):
    """Search one cell; return the highest value and its position, given those known so far."""
    left = coefficients[cell] - 2.0 * coefficients[cell + 1] + coefficients[cell + 2]
    right = coefficients[cell + 1] - 2.0 * coefficients[cell + 2] + coefficients[cell + 3]
    edge = radius * (1.0 - 1e-12)
    spans[0, 0] = max(cell + 0.0, u - edge)
    spans[0, 1] = min(cell + 1.0, u + edge)
    top = 1 if spans[0, 0] < spans[0, 1] else 0
    while top > 0:
        top -= 1
        low, high = spans[top, 0], spans[top, 1]
        middle = 0.5 * (low + high)
        ends = left + (right - left) * (low - cell), left + (right - left) * (high - cell)
        ceiling = max(ends[0], ends[1]) - 1.0 / radius
        if ceiling < 0.0:
            middle = _newton_ascent(coefficients, low, high, middle, u, radius)
        value, slope, _ = _evaluate(coefficients, middle, u, radius)
        if value > best:
            best, best_x = value, middle
        half = max(high - middle, middle - low)
        bound = value + max(slope * (high - middle), slope * (low - middle))
        bound += 0.5 * max(ceiling, 0.0) * half * half
        if bound > best + tolerance and half > 1e-12 and top + 2 <= _MAX_HALVINGS:
            spans[top, 0], spans[top, 1] = low, middle
            spans[top + 1, 0], spans[top + 1, 1] = middle, high
            top += 2
    return best, best_x


@inner_kernel
def _polish(coefficients, x, u, radius):
    """Return (value, position) of the local maximum next to `x`, by ascending Newton steps.

    The search stops once the height is certified; the contact, and so the slope, would then be
    known only to the square root of that tolerance.
    """
    value, slope, curvature = _evaluate(coefficients, x, u, radius)
    for _ in range(_NEWTON_STEPS):
        if not curvature < 0.0:
            break
        target = x - slope / curvature
        result = _evaluate(coefficients, target, u, radius)
        if result[0] < value:
            break
        moved = abs(target - x)
        x, (value, slope, curvature) = target, result
        if moved < 1e-13:
            break
    return value, x


@kernel
def search(coefficients, pyramid, u, radius, tolerance, guess, nodes, spans):
    """Return (offset height, position of the contact), both in samples, for a disk above `u`.

    Parameters
    ----------
    coefficients : (n + 4 + 2 margin,) array
        Spline coefficients, padded by at least `radius + 1` cells; divided by the pixel size.
    pyramid : Pyramid
        Bounds of those coefficients.
    u : float
        Position of the disk's centre [samples], counted from the start of the first cell.
    tolerance : float
        The result is at most this far below the true maximum [samples].
    guess : float
        Starting point, for example the previous contact.
    nodes, spans : (>= 256, 2) int64 and (>= 64, 2) float64 arrays
        Working memory.
    """
    count = pyramid.shapes[0, 1]
    best_x = u
    best, _, _ = _evaluate(coefficients, u, u, radius)
    if abs(guess - u) < radius:
        value, _, _ = _evaluate(coefficients, guess, u, radius)
        if value > best:
            best, best_x = value, guess
    nodes[0, 0], nodes[0, 1] = pyramid.offsets.size - 1, 0
    top = 1
    while top > 0:
        top -= 1
        level, index = nodes[top, 0], nodes[top, 1]
        low = float(index << level)
        high = min(float((index + 1) << level), float(count))
        away = max(low - u, u - high, 0.0)
        bound = pyramid.heights[pyramid.offsets[level] + index] + cap(away * away, radius)
        if bound <= best + tolerance:
            continue
        if level == 0:
            best, best_x = _search_cell(
                coefficients, index, u, radius, tolerance, best, best_x, spans
            )
            continue
        first = index << 1
        last = min(first + 1, pyramid.shapes[level - 1, 1] - 1)
        # The child nearer to the best contact so far is searched first (pushed last).
        near = first if best_x < float((first + 1) << (level - 1)) else last
        if last > first:
            nodes[top, 0], nodes[top, 1] = level - 1, first + last - near
            top += 1
        nodes[top, 0], nodes[top, 1] = level - 1, near
        top += 1
    return _polish(coefficients, best_x, u, radius)


@kernel
def search_many(coefficients, pyramid, places, radius, tolerance, heights_out, contacts_out):
    """Fill the offset height and the position of the contact above every place; see `search`."""
    nodes = np.empty((_STACK_SIZE, 2), dtype=np.int64)
    spans = np.empty((_MAX_HALVINGS + 4, 2))
    shift = 0.0
    for i in range(places.size):
        height, contact = search(
            coefficients, pyramid, places[i], radius, tolerance, places[i] + shift, nodes, spans
        )
        heights_out[i] = height
        contacts_out[i] = contact
        shift = contact - places[i]
