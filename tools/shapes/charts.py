"""Texture coordinates [m] for lofts, area-true to a few per cent.

A strip of flat trapezoids between two sections unrolls without any distortion, as a cone does.
Strips whose girth hardly changes share one chart, so that the texture runs on over them; a dome
gets a round chart of its own area.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tools.shapes.patchwork import cells, plane_axes

Array = NDArray[np.float64]
DISTORTION = 1.07
"""How far areas in a chart of several strips may be from the true ones, either way. Ours."""


def unrolled(lower: Array, upper: Array) -> Array:
    """Return the strip between two rings (n, 3), laid flat as it is, (2, n, 2) [m].

    The strip of n - 1 trapezoids starts at u = 0, runs to the right, and lies about level.
    """
    uv = np.zeros((2, len(lower), 2))
    uv[1, 0] = 0.0, np.linalg.norm(upper[0] - lower[0])
    for k in range(len(lower) - 1):
        up = (upper[k] - lower[k]) / np.linalg.norm(upper[k] - lower[k])
        ahead = lower[k + 1] - lower[k]
        right = ahead - (ahead @ up) * up
        right /= np.linalg.norm(right)
        up_flat = (uv[1, k] - uv[0, k]) / np.linalg.norm(uv[1, k] - uv[0, k])
        flat = np.stack([np.array([up_flat[1], -up_flat[0]]), up_flat])
        for row, ring in enumerate((lower, upper)):
            reach = ring[k + 1] - lower[k]
            uv[row, k + 1] = uv[0, k] + np.array([reach @ right, reach @ up]) @ flat
    chord = uv[0, -1] - uv[0, 0]
    turn = np.array([[chord[0], -chord[1]], [chord[1], chord[0]]]) / np.linalg.norm(chord)
    return uv @ turn


def banded(rings: Array) -> list[tuple[int, Array]]:
    """Return charts for a loft of rings (s, n, 3): as many strips in each as fit together.

    Returns
    -------
    list of (first, uv)
        The first ring of each chart, and the places (k, n, 2) [m] of its k rings.
    """
    charts, first = [], 0
    while first < len(rings) - 1:
        uv = unrolled(rings[first], rings[first + 1])
        for last in range(first + 2, len(rings)):
            wider = _straightened(rings[first : last + 1])
            if _distortion(rings[first : last + 1], wider) > DISTORTION:
                break
            uv = wider
        charts.append((first, uv))
        first += len(uv) - 1
    return charts


def dome(rings: Array, centre: Array, outwards: Array) -> Array:
    """Return a round chart for a fan and strips round it, seen from outside, (s, n, 2) [m].

    Parameters
    ----------
    rings : (s, n, 3)
        From the innermost outwards [m].
    centre : (3,)
        Apex of the fan, at uv = (0, 0).
    outwards : (3,)
        Unit axis of the dome; areas are true on average over each ring.
    """
    flat = (rings - centre) @ plane_axes(outwards).T
    tip = np.broadcast_to(centre, rings[:1].shape)
    true = np.array(
        [_area(cells(closed)).sum() for closed in _strips(np.concatenate([tip, rings]))]
    )
    shadow = np.array([abs(_cross(loop, np.roll(loop, -1, axis=0)).sum()) / 2 for loop in flat])
    return flat * np.sqrt(np.cumsum(true) / shadow)[:, None, None]


def _strips(rings: Array) -> list[Array]:
    around = np.concatenate([rings, rings[:, :1]], axis=1)
    return [around[i : i + 2] for i in range(len(rings) - 1)]


def _straightened(rings: Array) -> Array:
    """Return a rectangular chart: u the mean arc length, v by the strips' areas."""
    sides = np.linalg.norm(np.diff(rings, axis=1), axis=2)
    u = np.concatenate([[0.0], np.cumsum(sides.mean(axis=0))])
    heights = [_area(cells(rings[i : i + 2])).sum() / u[-1] for i in range(len(rings) - 1)]
    v = np.concatenate([[0.0], np.cumsum(heights)])
    return np.stack(np.meshgrid(u, v), axis=-1)


def _distortion(points: Array, uv: Array) -> float:
    ratios = _area(cells(uv)) / _area(cells(points))
    return float(max(ratios.max(), 1.0 / ratios.min()))


def _area(triangles: Array) -> Array:
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    if triangles.shape[2] == 2:
        return 0.5 * _cross(first, second)
    return 0.5 * np.linalg.norm(np.cross(first, second), axis=1)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
