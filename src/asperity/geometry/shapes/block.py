"""Blocks with chamfered edges, to be striped: what the hammer of colour plate 5 strikes.

The paper prints neither sizes nor stripes; all of them here are ours.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_positive
from asperity.geometry.shapes.patchwork import FLAT, ROUND, Patchwork, Shape

Array = NDArray[np.float64]


class StripedBlock(NamedTuple):
    """What one of the blocks is made of."""

    size: tuple[float, float, float]
    """Length, width, height [m]."""
    texture: dict[str, Any]
    """As `scene.toml` says it."""
    uv_size: tuple[float, float]
    """Of the texture's tile [m]."""


BLOCKS = (
    StripedBlock(
        (0.060, 0.040, 0.030),
        {"kind": "grating", "pitch": 3e-3, "height": 3e-4, "width": 1.5e-3, "fillet": 3e-4},
        (0.024, 0.024),
    ),
    StripedBlock(
        (0.040, 0.040, 0.020),
        {"kind": "grating", "pitch": 2e-3, "height": 3e-4, "width": 1e-3, "fillet": 2.5e-4},
        (0.016, 0.016),
    ),
    StripedBlock(
        (0.080, 0.030, 0.015),
        {"kind": "stripes", "pitch": 4e-3, "depth": 3e-4, "width": 2.4e-3, "fillet": 4e-4},
        (0.032, 0.032),
    ),
)
"""Three blocks of different size and pitch; the stripes run across their length."""


def block(
    length: float,
    width: float,
    height: float,
    *,
    chamfer: float = 1e-3,
    uv_size: tuple[float, float] = (0.024, 0.024),
) -> Shape:
    """Return a block whose edges are chamfered: 44 triangles, one convex piece.

    The texture lies on it as on a box cut open and folded out round its top, so it runs on from
    the top over all four chamfers and down the sides, and onto the bottom from the side at -y.
    It is torn along the upright edges and three edges of the bottom.

    Parameters
    ----------
    length, width, height : float
        Along x, y and z [m], above two chamfers; the middle is the origin.
    chamfer : float
        Cut off on either side of an edge [m], above 0; it carries the turn of the normals.
    uv_size : (float, float)
        What one unit of u and v spans [m].
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
    mesh = Patchwork()
    _belt(mesh, half, chamfer)
    for sign in (-1.0, 1.0):
        _end(mesh, half, chamfer, sign)
    shape = mesh.shape((), uv_size)
    return shape._replace(pieces=(shape.vertices,))


def _belt(mesh: Patchwork, half: Array, chamfer: float) -> None:
    """Add what runs round the x axis: top, sides, bottom and the chamfers between them."""
    slant = math.sqrt(2.0) * chamfer
    (_, y, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    # From the bottom's edge at +y round by -y and the top to where it began; v is 0 in the middle
    # of the top.
    around = [(inner_y, -z), (-inner_y, -z), (-y, -inner_z), (-y, inner_z), (-inner_y, z)]
    around += [(inner_y, z), (y, inner_z), (y, -inner_z), (inner_y, -z)]
    lengths = [2 * inner_y, slant, 2 * inner_z, slant, 2 * inner_y, slant, 2 * inner_z, slant]
    v = np.concatenate([[0.0], np.cumsum(lengths)])
    v -= 0.5 * (v[4] + v[5])
    normals = {0: (0, 0, -1), 2: (0, -1, 0), 4: (0, 0, 1), 6: (0, 1, 0)}
    for row in range(8):
        points = [[(side, *around[row + i]) for side in (-inner_x, inner_x)] for i in (0, 1)]
        uv = [[(side, v[row + i]) for side in (-inner_x, inner_x)] for i in (0, 1)]
        _quad(mesh, np.array(points), np.array(uv), normals.get(row))


def _end(mesh: Patchwork, half: Array, chamfer: float, sign: float) -> None:
    """Add one end, its chamfers and its corners, hung on the top's edge."""
    slant = math.sqrt(2.0) * chamfer
    (x, _, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    down = [(inner_x, z), (x, inner_z), (x, -inner_z), (inner_x, -z)]
    u = inner_x + np.cumsum([0.0, slant, 2.0 * inner_z, slant])
    columns = list(zip(down, u, strict=True))
    for left, right in itertools.pairwise(columns):
        pair = (left, right) if sign > 0.0 else (right, left)
        points = [[(sign * at[0], row, at[1]) for at, _ in pair] for row in (-inner_y, inner_y)]
        uv = [[(sign * place, row) for _, place in pair] for row in (-inner_y, inner_y)]
        flat = (int(sign), 0, 0) if left[0][0] == right[0][0] else None
        _quad(mesh, np.array(points), np.array(uv), flat)
    for side in (-1.0, 1.0):
        _upright(mesh, half, chamfer, np.array([sign, side, 1.0]))


def _upright(mesh: Patchwork, half: Array, chamfer: float, signs: Array) -> None:
    """Add the chamfer of an upright edge and the corners above and below, hung on the end."""
    slant = math.sqrt(2.0) * chamfer
    (x, y, z), (inner_x, inner_y, inner_z) = half, half - chamfer
    u = inner_x + np.cumsum([0.0, slant, 2.0 * inner_z, slant])
    at_end = np.array([(x, inner_y, inner_z), (x, inner_y, -inner_z)])
    at_side = np.array([(inner_x, y, inner_z), (inner_x, y, -inner_z)])
    points = [at_end[0], at_end[1], at_side[1], at_side[0]]
    outer = inner_y + slant
    uv = [(u[1], inner_y), (u[2], inner_y), (u[2], outer), (u[1], outer)]
    _facet(mesh, signs * points, signs[:2] * uv)
    # The corners are equilateral.
    tip = inner_y + math.sqrt(0.75) * slant
    for row, (end, face, height) in enumerate(((1, 0, z), (2, 3, -z))):
        points = [np.array([inner_x, inner_y, height]), at_end[row], at_side[row]]
        uv = [(u[face], inner_y), (u[end], inner_y), (0.5 * (u[face] + u[end]), tip)]
        _facet(mesh, signs * points, signs[:2] * uv)


def _quad(mesh: Patchwork, points: Array, uv: Array, normal: tuple[int, int, int] | None) -> None:
    if normal is None:
        mesh.grid(points, uv, "block", rank=ROUND)
    else:
        mesh.grid(points, uv, "block", rank=FLAT, normal=np.array(normal, dtype=np.float64))


def _facet(mesh: Patchwork, points: Array, uv: Array) -> None:
    """Add a small facet of three or four corners, turned outwards: the origin lies inside."""
    if np.cross(points[1] - points[0], points[2] - points[0]) @ points[0] < 0.0:
        points, uv = points[::-1], uv[::-1]
    triangles = np.array([[0, 1, 2], [0, 2, 3]])[: len(points) - 2]
    mesh.add(points[triangles], uv[triangles], "block", rank=ROUND)
