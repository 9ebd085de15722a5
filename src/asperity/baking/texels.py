"""Points of a mesh that the texels of its texture represent, including those beside the charts.

A texel whose centre is in a chart represents the point with its texture coordinates. The spline
through the texels also depends on those around a chart. If these did not continue the surface, they
would distort the spline inside the chart, and both sides of a seam would disagree. So a texel
outside represents the point reached by crossing the chart's border and continuing straight over the
neighbouring triangles, unfolded into one plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices, Mask
from asperity._core.kernels import kernel
from asperity.geometry.mesh.checks import SAME_PLACE, same_places
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import edges_of, next_corner

OUTSIDE, INSIDE, GUTTER = 0, 1, 2
GUTTER_WIDTH = 3.0
"""Margin around charts in which the surface continues [texels]; the spline uses two."""
_SAME_UV = 1e-9
_MOST_CROSSED = 200
"""Largest number of triangles crossed beyond a border."""


@dataclass(frozen=True, eq=False)
class Texels:
    """Points of a mesh represented by the texels of a square texture.

    Attributes
    ----------
    kind : (n, n) uint8 array
        OUTSIDE, INSIDE (the centre is in a chart) or GUTTER, [iv, iu], row 0 at v = 0.
    where : (k, 2) array
        Row and column of those that are not OUTSIDE.
    face : (k,) array
        Triangle of each.
    weights : (k, 3) array
        Weights of its corners.
    """

    kind: NDArray[np.uint8]
    where: Indices
    face: Indices
    weights: Array

    @property
    def inside(self) -> Mask:
        """Which texels have their centre in a chart, (k,)."""
        return np.asarray(self.kind[tuple(self.where.T)] == INSIDE)


def texels_of(mesh: Mesh, size: int) -> Texels:
    """Return the points represented by the texels of a texture.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates within 0..1.
    size : int
        Texels along each side of the texture.
    """
    assert mesh.uv is not None
    places = mesh.uv * size - 0.5  # texel (iv, iu) has its centre at (iu, iv)
    face = np.full((size, size), -1, dtype=np.int64)
    weights = np.zeros((size, size, 3))
    _fill(np.ascontiguousarray(places), face, weights)
    kind = np.where(face >= 0, INSIDE, OUTSIDE).astype(np.uint8)

    opposite, alone = _neighbours(mesh)
    triangles = np.ascontiguousarray(mesh.vertices[mesh.faces])
    nearest = np.full((size, size), np.inf)
    half = np.full((size, size), -1, dtype=np.int64)
    _near_borders(places, np.flatnonzero(alone), GUTTER_WIDTH, kind, nearest, half)
    kind[half >= 0] = GUTTER
    _go_on(triangles, places, opposite, half, face, weights)
    where = np.argwhere(kind != OUTSIDE)
    at = tuple(where.T)
    return Texels(kind, where, face[at], weights[at])


def _neighbours(mesh: Mesh) -> tuple[Indices, Mask]:
    """Return the opposite half-edges (-1: none), and which half-edges are borders of charts."""
    assert mesh.uv is not None
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    at = same_places(mesh.vertices, SAME_PLACE * extent)[mesh.faces]
    edges = edges_of(at)
    h, g = edges.pairs[edges.size[edges.of_half[edges.pairs[:, 0]]] == 2].T
    ways = at.ravel()[h] != at.ravel()[g]  # consistently oriented: they run in opposite directions
    h, g = h[ways], g[ways]
    opposite = np.full(at.size, -1, dtype=np.int64)
    opposite[h], opposite[g] = g, h
    uv = mesh.uv.reshape(-1, 2)
    off = np.abs(uv[h] - uv[next_corner(g)]).max(axis=1)
    off = np.maximum(off, np.abs(uv[next_corner(h)] - uv[g]).max(axis=1))
    alone = np.ones(at.size, dtype=bool)
    alone[h[off <= _SAME_UV]] = alone[g[off <= _SAME_UV]] = False
    return opposite, alone


@kernel
def _fill(places, face_out, weights_out):
    """Fill the triangle that contains each texel's centre, and its weights there."""
    rows, columns = face_out.shape
    for f in range(len(places)):
        (x0, y0), (x1, y1), (x2, y2) = places[f, 0], places[f, 1], places[f, 2]
        twice = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(twice) < 1e-12:
            continue
        low_x, high_x = max(np.ceil(min(x0, x1, x2)), 0.0), min(max(x0, x1, x2), columns - 1.0)
        low_y, high_y = max(np.ceil(min(y0, y1, y2)), 0.0), min(max(y0, y1, y2), rows - 1.0)
        for iv in range(int(low_y), int(np.floor(high_y)) + 1):
            for iu in range(int(low_x), int(np.floor(high_x)) + 1):
                a = ((x1 - iu) * (y2 - iv) - (x2 - iu) * (y1 - iv)) / twice
                b = ((x2 - iu) * (y0 - iv) - (x0 - iu) * (y2 - iv)) / twice
                c = 1.0 - a - b
                if min(a, b, c) < -1e-9:
                    continue
                face_out[iv, iu] = f
                weights_out[iv, iu, 0] = a
                weights_out[iv, iu, 1] = b
                weights_out[iv, iu, 2] = c


@kernel
def _near_borders(places, borders, reach, kind, nearest_out, half_out):
    """Fill the nearest border half-edge of each texel outside the charts."""
    rows, columns = kind.shape
    for h in borders:
        f, c = h // 3, h % 3
        x0, y0 = places[f, c]
        x1, y1 = places[f, (c + 1) % 3]
        dx, dy = x1 - x0, y1 - y0
        square = max(dx * dx + dy * dy, 1e-300)
        for iv in range(
            max(int(np.ceil(min(y0, y1) - reach)), 0),
            min(int(np.floor(max(y0, y1) + reach)), rows - 1) + 1,
        ):
            for iu in range(
                max(int(np.ceil(min(x0, x1) - reach)), 0),
                min(int(np.floor(max(x0, x1) + reach)), columns - 1) + 1,
            ):
                if kind[iv, iu] == INSIDE:
                    continue
                s = ((iu - x0) * dx + (iv - y0) * dy) / square
                s = min(max(s, 0.0), 1.0)
                away = np.hypot(x0 + s * dx - iu, y0 + s * dy - iv)
                if away <= reach and away < nearest_out[iv, iu]:
                    nearest_out[iv, iu] = away
                    half_out[iv, iu] = h


@kernel
def _go_on(triangles, places, opposite, half, face_out, weights_out):
    """Fill the point reached beyond a border for each texel in the gutter."""
    rows, columns = half.shape
    start, way = np.empty(3), np.empty(3)
    for iv in range(rows):
        for iu in range(columns):
            h = half[iv, iu]
            if h < 0:
                continue
            f, c = h // 3, h % 3
            x0, y0 = places[f, c]
            x1, y1 = places[f, (c + 1) % 3]
            x2, y2 = places[f, (c + 2) % 3]
            dx, dy = x1 - x0, y1 - y0
            s = ((iu - x0) * dx + (iv - y0) * dy) / max(dx * dx + dy * dy, 1e-300)
            s = min(max(s, 0.0), 1.0)
            px, py = iu - (x0 + s * dx), iv - (y0 + s * dy)
            # The displacement on the texture, in sides of the triangle, gives that in space.
            twice = dx * (y2 - y0) - dy * (x2 - x0)
            p0, p1, p2 = triangles[f, c], triangles[f, (c + 1) % 3], triangles[f, (c + 2) % 3]
            for k in range(3):
                start[k] = p0[k] + s * (p1[k] - p0[k])
                way[k] = 0.0
            if abs(twice) > 1e-12:
                along = (px * (y2 - y0) - py * (x2 - x0)) / twice
                across = (dx * py - dy * px) / twice
                for k in range(3):
                    way[k] = along * (p1[k] - p0[k]) + across * (p2[k] - p0[k])
            f = _walk(triangles, opposite, h, start, way)
            face_out[iv, iu] = f
            _weights(triangles[f], start, weights_out[iv, iu])


@kernel
def _walk(triangles, opposite, h, start, way):
    """Move from a point on half-edge h across it by a displacement; return the final triangle.

    `way` is the displacement in the plane of h's triangle; triangles are unfolded into one plane.
    `start` is moved to the end.
    """
    f = h // 3
    for _ in range(_MOST_CROSSED):
        g = opposite[h]
        if g < 0:
            return f  # an open border: the surface ends
        # The edge, and the inward direction of either triangle.
        c = h % 3
        p0, p1, p2 = triangles[f, c], triangles[f, (c + 1) % 3], triangles[f, (c + 2) % 3]
        other, d = g // 3, g % 3
        q2 = triangles[other, (d + 2) % 3]
        edge, here, there = p1 - p0, p2 - p0, q2 - p0
        length = np.sqrt(np.sum(edge * edge))
        if length == 0.0:
            return f
        edge = edge / length
        here, there = here - np.sum(here * edge) * edge, there - np.sum(there * edge) * edge
        size, beyond = np.sqrt(np.sum(here * here)), np.sqrt(np.sum(there * there))
        if size == 0.0 or beyond == 0.0:
            return f
        straight, on = np.sum(way * edge), -np.sum(way * here) / size
        if on <= 0.0:
            return f
        way[:] = straight * edge + on / beyond * there
        f = other
        # Where the path leaves this triangle: across the first of its two other sides.
        best, leave = 1.0, -1
        t = triangles[f]
        for k in (1, 2):
            i, j, m = (d + k) % 3, (d + k + 1) % 3, (d + k + 2) % 3
            side = t[j] - t[i]
            inwards = t[m] - t[i]
            inwards = inwards - np.sum(inwards * side) / max(np.sum(side * side), 1e-300) * side
            from_side = np.sum((start - t[i]) * inwards)
            towards = -np.sum(way * inwards)
            if towards > 0.0 and from_side < best * towards:
                best, leave = max(from_side / towards, 0.0), i
        start[:] = start + best * way
        if leave < 0:
            return f
        way[:] = (1.0 - best) * way
        h = 3 * f + leave
    return f


@kernel
def _weights(triangle, point, weights_out):
    """Fill the weights of a triangle's corners at a point in its plane, clamped to 0..1."""
    a, b, p = triangle[1] - triangle[0], triangle[2] - triangle[0], point - triangle[0]
    aa, ab, bb = np.sum(a * a), np.sum(a * b), np.sum(b * b)
    pa, pb = np.sum(p * a), np.sum(p * b)
    det = max(aa * bb - ab * ab, 1e-300)
    s = min(max((bb * pa - ab * pb) / det, 0.0), 1.0)
    t = min(max((aa * pb - ab * pa) / det, 0.0), 1.0 - s)
    weights_out[0], weights_out[1], weights_out[2] = 1.0 - s - t, s, t
