"""Decomposition of planar pieces into convex polygons of few sides."""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array

_STRAIGHT = 1e-9
"""A corner whose turn (sine of its angle) is smaller is not one."""


def convex_parts(triangles: Array, most: int) -> list[tuple[Array, Array]]:
    """Return convex polygons whose union is that of some triangles.

    Parameters
    ----------
    triangles : (m, 3, 2) array
        Counter-clockwise, joined at their sides.
    most : int
        Largest number of corners of a polygon.

    Returns
    -------
    list of (corners (k, 2), hard (k,))
        `hard` is 1 for each side on the border of the piece and 0 for a cut.
    """
    from scipy.spatial import ConvexHull  # slow to import

    area = 0.5 * np.abs(
        _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    )
    hull = ConvexHull(triangles.reshape(-1, 2))
    if abs(hull.volume - area.sum()) <= 1e-9 * hull.volume:
        corners = without_straight(triangles.reshape(-1, 2)[hull.vertices])
        return fan_parts(corners, most)
    return _greedy(triangles, most)


def fan_parts(corners: Array, most: int) -> list[tuple[Array, Array]]:
    """Return a convex polygon cut into fans of at most `most` corners around its first."""
    count, parts, first = len(corners), [], 1
    while first < count - 1:
        last = min(first + most - 2, count - 1)
        hard = np.ones(last - first + 2)
        hard[0] = float(first == 1)
        hard[-1] = float(last == count - 1)
        parts.append((np.concatenate([corners[:1], corners[first : last + 1]]), hard))
        first = last
    return parts


def without_straight(corners: Array) -> Array:
    """Return a convex polygon without collinear corners."""
    return corners[_turns(corners) > _STRAIGHT]


def _turns(corners: Array) -> Array:
    """Return the sine of the angle by which a polygon turns at each corner."""
    before = corners - np.roll(corners, 1, axis=0)
    after = np.roll(corners, -1, axis=0) - corners
    sizes = np.hypot(before[:, 0], before[:, 1]) * np.hypot(after[:, 0], after[:, 1])
    return np.asarray(_cross(before, after) / np.maximum(sizes, 1e-300))


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _greedy(triangles: Array, most: int) -> list[tuple[Array, Array]]:
    """Merge neighbours across their longest common side while the polygon stays convex.

    After Hertel & Mehlhorn (1983), who remove the cuts in arbitrary order.
    """
    places, number = _numbered(triangles)
    polygons: dict[int, list[int]] = {i: list(t) for i, t in enumerate(number)}
    owner = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(number) for k in range(3)}
    inner = [side for side in owner if side[0] < side[1] and side[::-1] in owner]
    inner.sort(key=lambda s: (-float(np.hypot(*(places[s[1]] - places[s[0]]))), s))
    for side in inner:
        one, two = owner.get(side), owner.get(side[::-1])
        if one is None or two is None or one == two:
            continue
        joint = _joined(polygons[one], polygons[two], side)
        kept = _turning(places, joint)
        if kept is None or len(kept) > most:
            continue
        polygons[one] = joint
        merged = polygons.pop(two)
        owner |= dict.fromkeys(zip(merged, merged[1:] + merged[:1], strict=True), one)
    return [_cut_out(places, polygon, set(owner)) for polygon in polygons.values()]


def _cut_out(places: Array, polygon: list[int], sides: set[tuple[int, int]]) -> tuple[Array, Array]:
    """Return the corners of a polygon, and which of its sides border no other triangle."""
    kept = _turning(places, polygon) or polygon
    hard = np.zeros(len(kept))
    k = -1
    start = polygon.index(kept[0])
    for i in range(len(polygon)):
        first = polygon[(start + i) % len(polygon)]
        k += first in kept
        if (polygon[(start + i + 1) % len(polygon)], first) not in sides:
            hard[k] = 1.0
    return places[kept], hard


def _numbered(triangles: Array) -> tuple[Array, list[tuple[int, ...]]]:
    """Return the distinct positions of the corners, and the triangles as indices of them."""
    flat = triangles.reshape(-1, 2)
    span = float(np.max(np.ptp(flat, axis=0)))
    _, first, number = np.unique(
        np.round(flat / (1e-9 * span)), axis=0, return_index=True, return_inverse=True
    )
    return flat[first], [tuple(map(int, row)) for row in np.asarray(number).reshape(-1, 3)]


def _joined(one: list[int], two: list[int], side: tuple[int, int]) -> list[int]:
    """Return the union of two polygons that share `side`, in the direction of `one`."""
    start, turn = one.index(side[1]), two.index(side[0])
    around, beyond = one[start:] + one[:start], two[turn:] + two[:turn]
    return around + beyond[1:-1]


def _turning(places: Array, polygon: list[int]) -> list[int] | None:
    """Return the corners at which a polygon turns, or None if it is not convex."""
    if len(set(polygon)) < len(polygon):
        return None
    turn = _turns(places[polygon])
    if np.any(turn < -_STRAIGHT):
        return None
    return [corner for corner, t in zip(polygon, turn, strict=True) if t > _STRAIGHT]
