"""A ball-pein hammer: the textured tool of colour plate 5.

The paper prints a picture and no sizes; its low-resolution hammer has 518 triangles. All sizes
here were chosen for this package, after a common hammer of about half a kilogram.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.shapes.shape import Shape
from tools.shapes.charts import banded, dome
from tools.shapes.patchwork import CURVED, FLAT, ROUND, Patchwork
from tools.shapes.sections import (
    circle,
    closed,
    convex_pieces,
    lathe,
    loft,
    oval,
    placed,
    polygon,
)

Array = NDArray[np.float64]

UV_SIZE = (0.036, 0.036)
"""Size of the texture's tile [m]."""

CORNERS = 12
"""Of every section: sides every 30 degrees, so that two lie across the head and two along it."""
FACE = ((0.0477, 0.0060), (0.0470, 0.0117))
"""Rings of the striking face (x, radius) [m]; a crown 0.95 mm high, of about 80 mm radius."""
FACE_TIP = 0.0479
BELL = ((0.0195, 0.0098), (0.0245, 0.0098), (0.0315, 0.0130), (0.0456, 0.0130))
PEIN_CENTRE, PEIN_RADIUS = -0.0375, 0.0125
PEIN_ANGLES = (30.0, 62.0, 98.0, 139.0)
"""Of the ball's rings from its pole [degrees]."""
NECK = (-0.0195, 0.0086)
EYE = 0.0135
"""Half the length of the cheek along the head [m]."""
CHEEK = ((0.0120, 0.0096), (0.0086, 0.0130))
"""Corners of the cheek's section (y, z) [m] between which its edges are rounded."""
SHAFT = (
    (-0.2850, 0.0120, 0.0092), (-0.2805, 0.0158, 0.0122), (-0.2620, 0.0155, 0.0118),
    (-0.2250, 0.0128, 0.0098), (-0.1700, 0.0146, 0.0110), (-0.0900, 0.0108, 0.0082),
    (-0.0130, 0.0105, 0.0074),
)  # fmt: skip
"""Rings of the handle (z, half widths along x and y) [m], up to the cheek."""
STUB = 0.0155
"""How high the handle's end stands in the eye [m]."""


def hammer() -> Shape:
    """Return the hammer: 528 triangles, the paper's 518 to 2 %.

    The origin is the middle of the eye. The head lies along x, its striking face (26 mm across,
    crowned) at +x and its ball at -x, 98 mm in all; the oval handle hangs down to z = -285 mm.
    Normals are smooth but where the handle meets the head. The texture runs on over the face and
    its chamfer; it is torn where charts meet: behind the face's chamfer, round the neck, and along
    one line of the handle.
    """
    mesh = Patchwork()
    pieces = _striking_side(mesh) + _ball_side(mesh)
    cheek = _cheek(mesh)
    pieces.insert(1, cheek)
    pieces += _handle(mesh)
    return mesh.shape(pieces, UV_SIZE)


def _neck(x: float, radius: float) -> Array:
    return placed(circle(radius, CORNERS), x, "x")


def _eye(x: float) -> Array:
    """Return a ring of the cheek: flat on top, below and at both sides, rounded between."""
    angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
    corners = np.array([(sy * y, sz * z) for y, z in CHEEK for sy in (-1, 1) for sz in (-1, 1)])
    reach = corners @ np.stack([np.cos(angles), np.sin(angles)])
    return placed(polygon(angles, reach.max(axis=0)), x, "x")


def _striking_side(mesh: Patchwork) -> list[Array]:
    """Add flare, neck, bell and face; return the neck and the bell with the face."""
    bell = lathe(BELL, CORNERS, "x")
    body = np.concatenate([_eye(EYE)[None], bell])
    _banded(mesh, body, "striking side", {1: CURVED, 3: CURVED})
    tip = np.array([FACE_TIP, 0.0, 0.0])
    face = lathe((*FACE, BELL[-1]), CORNERS, "x")
    _dome(mesh, face, tip, 1.0, "face", {0: CURVED, 1: CURVED, 2: ROUND})
    rings = np.concatenate([bell, face[1::-1]])
    return convex_pieces(rings, "x", [tip])


def _ball_side(mesh: Patchwork) -> list[Array]:
    """Add flare, neck and ball; return the neck and the ball."""
    angles = np.radians(PEIN_ANGLES)
    stations, radii = PEIN_CENTRE - PEIN_RADIUS * np.cos(angles), PEIN_RADIUS * np.sin(angles)
    ball = lathe(list(zip(stations, radii, strict=True)), CORNERS, "x")
    body = np.stack([*ball[1:], _neck(*NECK), _eye(-EYE)])
    _banded(mesh, body, "ball side", {2: CURVED})
    tip = np.array([PEIN_CENTRE - PEIN_RADIUS, 0.0, 0.0])
    _dome(mesh, ball[:2], tip, -1.0, "ball", {0: CURVED, 1: CURVED})
    return convex_pieces(np.concatenate([ball, body[-2:-1]]), "x", [tip])


def _cheek(mesh: Patchwork) -> Array:
    """Add the cheek, with the eye for the handle; return it with the flares to both necks."""
    rings = np.stack([_eye(-EYE), _eye(EYE)])
    around = closed(rings)
    side = CORNERS // 4
    for start, stop, chart in ((side, 3 * side - 1, "cheek -y"), (3 * side, 5 * side - 1, "+y")):
        columns = np.arange(start, stop + 1) % CORNERS
        points = rings[:, columns]
        ((_, uv),) = banded(points)
        for k in range(len(columns) - 1):
            flat = (columns[k] + 1) % (2 * side) == 0
            normal = np.array([0.0, 1.0 if columns[k] > 2 * side else -1.0, 0.0])
            mesh.grid(points[:, k : k + 2], uv[:, k : k + 2], chart, smooth="head",
                      rank=FLAT if flat else ROUND, normal=normal if flat else None)  # fmt: skip
    for k, z, height in ((side - 1, 1.0, CHEEK[1][1]), (3 * side - 1, -1.0, -CHEEK[1][1])):
        corners = np.concatenate([around[0, k : k + 2], around[1, k + 1 : k - 1 : -1]])
        hole = placed(oval(*SHAFT[-1][1:], CORNERS), height, "z")
        mesh.flat([corners, hole], (0.0, 0.0, z), f"eye {z}", smooth="head", u_axis=(1.0, 0.0, 0.0))
    ends = np.concatenate([_neck(*NECK), _neck(*BELL[0])])
    return np.concatenate([rings.reshape(-1, 3), ends])


def _handle(mesh: Patchwork) -> list[Array]:
    """Add the handle and its end in the eye; return their pieces."""
    rings = loft([(z, oval(a, b, CORNERS)) for z, a, b in SHAFT], "z")
    _banded(mesh, rings, "handle", dict.fromkeys(range(1, len(SHAFT)), CURVED), "handle")
    mesh.flat([rings[0]], (0.0, 0.0, -1.0), "handle's end", smooth="handle")
    section = oval(*SHAFT[-1][1:], CORNERS)
    stub = loft([(CHEEK[1][1], section), (STUB, section)], "z")
    _banded(mesh, stub, "stub", {0: CURVED}, "stub")
    mesh.flat([stub[1]], (0.0, 0.0, 1.0), "stub's end", smooth="stub's end")
    return [*convex_pieces(rings, "z"), stub.reshape(-1, 3)]


def _banded(
    mesh: Patchwork, rings: Array, chart: str, ranks: dict[int, int], smooth: str = "head"
) -> None:
    """Add a loft strip by strip, each of its rank, ROUND where none is given."""
    around = closed(rings)
    for first, uv in banded(around):
        for i in range(len(uv) - 1):
            strip = first + i
            mesh.grid(around[strip : strip + 2], uv[i : i + 2], f"{chart} {first}",
                      smooth=smooth, rank=ranks.get(strip, ROUND))  # fmt: skip


def _dome(
    mesh: Patchwork, rings: Array, tip: Array, x: float, chart: str, ranks: dict[int, int]
) -> None:
    """Add a fan round `tip` and the strips outside it, of rings from the innermost on."""
    uv = dome(rings, tip, np.array([x, 0.0, 0.0]))
    if x < 0.0:
        rings, uv = rings[:, ::-1], uv[:, ::-1]
    mesh.fan(tip, rings[0], uv[0], chart, smooth="head", rank=ranks[0])
    outer, outer_uv = closed(rings)[::-1], closed(uv)[::-1]
    for i in range(1, len(rings)):
        row = len(rings) - 1 - i
        mesh.grid(outer[row : row + 2], outer_uv[row : row + 2], chart,
                  smooth="head", rank=ranks[i])  # fmt: skip
