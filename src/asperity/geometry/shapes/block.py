"""Blocks with chamfered edges, of any size."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_positive
from asperity.geometry.shapes.shape import Shape

Polygon = tuple[Array, Array]
"""Corners (k, 3), counter-clockwise from outside, and their texture coordinates (k, 2), all [m]."""


def block(
    length: float,
    width: float,
    height: float,
    *,
    chamfer: float = 1e-3,
    uv_size: tuple[float, float] = (0.024, 0.024),
) -> Shape:
    """Return a block whose edges are chamfered: 44 triangles, one convex piece.

    The texture covers it as it would a box cut open and unfolded around its top: it continues from
    the top over all four chamfers and down the sides, and onto the bottom from the side at -y. It
    has seams along the upright edges and along three edges of the bottom.

    Parameters
    ----------
    length, width, height : float
        Along x, y and z [m], above two chamfers; the middle is the origin.
    chamfer : float
        Length cut off on either side of an edge [m], above 0. The normals turn over the chamfer.
    uv_size : (float, float)
        Length that one unit of u and of v spans [m].
    """
    half = 0.5 * np.array(
        [
            require_positive(name, value, "[m]")
            for name, value in (("length", length), ("width", width), ("height", height))
        ]
    )
    if not 0.0 < chamfer < half.min():
        raise AsperityError(
            f"chamfer must be above 0 and below {half.min():.4g} m, got {chamfer!r}"
        )
    polygons = [*_belt(half, chamfer), *_end(half, chamfer, -1.0), *_end(half, chamfer, 1.0)]
    corners, uv = (
        np.array([p[i][[0, k, k + 1]] for p in polygons for k in range(1, len(p[0]) - 1)])
        for i in (0, 1)
    )
    uv = (uv - uv.min(axis=(0, 1))) / np.asarray(uv_size)
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    # Each vertex is a corner of exactly one of the six flat faces and has that face's normal.
    normals = np.where(np.abs(corners) == half, np.sign(corners), 0.0)
    faces = faces.reshape(-1, 3).astype(np.int64)
    return Shape(vertices, faces, normals, uv, (vertices,), uv_size)


def _belt(half: Array, chamfer: float) -> Iterator[Polygon]:
    """Yield top, bottom, the sides at +-y and the chamfers between them."""
    slant = math.sqrt(2.0) * chamfer
    (_, y, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    # From the bottom's edge at +y by -y and the top back to where it began; v is 0 in the middle
    # of the top.
    around = [(inner_y, -z), (-inner_y, -z), (-y, -inner_z), (-y, inner_z), (-inner_y, z)]
    around += [(inner_y, z), (y, inner_z), (y, -inner_z), (inner_y, -z)]
    lengths = [2 * inner_y, slant, 2 * inner_z, slant, 2 * inner_y, slant, 2 * inner_z, slant]
    v = np.concatenate([[0.0], np.cumsum(lengths)])
    v -= 0.5 * (v[4] + v[5])
    for row in range(8):
        ring = ((-inner_x, row), (inner_x, row), (inner_x, row + 1), (-inner_x, row + 1))
        yield (np.array([(x, *around[i]) for x, i in ring]), np.array([(x, v[i]) for x, i in ring]))


def _end(half: Array, chamfer: float, sign: float) -> Iterator[Polygon]:
    """Yield the end at `sign` x, its chamfers and its corners, unfolded from the top's edge."""
    slant = math.sqrt(2.0) * chamfer
    (x, _, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    down = [(inner_x, z), (x, inner_z), (x, -inner_z), (inner_x, -z)]
    u = inner_x + np.cumsum([0.0, slant, 2.0 * inner_z, slant])
    for pair in itertools.pairwise(zip(down, u, strict=True)):
        left, right = pair if sign > 0.0 else pair[::-1]
        ring = ((left, -inner_y), (right, -inner_y), (right, inner_y), (left, inner_y))
        yield (
            np.array([(sign * at[0], row, at[1]) for (at, _), row in ring]),
            np.array([(sign * place, row) for (_, place), row in ring]),
        )
    for side in (-1.0, 1.0):
        yield from _upright_edge(half, chamfer, np.array([sign, side, 1.0]))


def _upright_edge(half: Array, chamfer: float, signs: Array) -> Iterator[Polygon]:
    """Yield the chamfer of an upright edge and the corners above and below it."""
    slant = math.sqrt(2.0) * chamfer
    (x, y, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    u = inner_x + np.cumsum([0.0, slant, 2.0 * inner_z, slant])
    at_end = np.array([(x, inner_y, inner_z), (x, inner_y, -inner_z)])
    at_side = np.array([(inner_x, y, inner_z), (inner_x, y, -inner_z)])
    outer = inner_y + slant
    yield _outwards(
        signs * [at_end[0], at_end[1], at_side[1], at_side[0]],
        signs[:2] * [(u[1], inner_y), (u[2], inner_y), (u[2], outer), (u[1], outer)],
    )
    # The corners are equilateral triangles.
    tip = inner_y + math.sqrt(0.75) * slant
    for row, (end, face, top) in enumerate(((1, 0, z), (2, 3, -z))):
        yield _outwards(
            signs * [np.array([inner_x, inner_y, top]), at_end[row], at_side[row]],
            signs[:2] * [(u[face], inner_y), (u[end], inner_y), (0.5 * (u[face] + u[end]), tip)],
        )


def _outwards(points: Array, uv: Array) -> Polygon:
    """Return a polygon turned counter-clockwise as seen from outside; the origin lies inside."""
    if np.cross(points[1] - points[0], points[2] - points[0]) @ points[0] < 0.0:
        return points[::-1], uv[::-1]
    return points, uv
