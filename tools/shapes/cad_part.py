"""A machined flange with a boss: what the file of colour plate 6 scrubs.

The paper prints a picture and no sizes; its low-resolution part has 720 triangles. All sizes here
were chosen for this package.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.shapes.shape import Shape
from tools.shapes.charts import banded, unrolled
from tools.shapes.clip import clipped
from tools.shapes.patchwork import CURVED, FLAT, ROUND, Patchwork
from tools.shapes.sections import circle, closed, lathe, loft, polygon

Array = NDArray[np.float64]

UV_SIZE = (0.033, 0.033)
"""Size of the texture's tile [m]."""

THICKNESS = 0.009
"""Of the plate, from z = 0 [m]."""
MIDDLE, END = 0.024, 0.012
"""Radii of the plate's outline round the boss and round the bolt holes [m]."""
EDGE = 8e-4
"""Chamfer of the plate, and of the boss, on either side of an edge [m]."""
TURNS = (0.0, 21.5, 43.0)
"""Directions of the sides round a bolt hole [degrees]; the tangents to the middle follow."""
BOLT_X, BOLT_RADIUS, BOLT_CORNERS = 0.028, 0.004, 12
"""Two holes, at +x and -x."""
BORE_RADIUS, BORE_CORNERS = 0.008, 16
RIM = 6e-4
"""Chamfer of the holes' rims [m]."""
BOSS_RADIUS, BOSS_TOP, BOSS_CORNERS = 0.015, 0.022, 24
FILLET = 0.003
"""Radius of the fillet at the boss's foot, in two steps [m]."""
CELL = 0.0205
"""Beyond this |x| the plate is cut into pieces round the bolt holes [m]."""
CORE = 0.0092
"""Half the square round the bore that the boss's pieces fill [m]."""


def cad_part() -> Shape:
    """Return the flange: 712 triangles, the paper's 720 to 2 %.

    An 80 mm x 48 mm x 9 mm plate, its underside on z = 0, with two holes of 8 mm at x = +-28 mm,
    and a boss of 30 mm, 22 mm high with a bore of 16 mm through all. The holes' polygons stray
    from their circles by less than 0.08 mm. Every edge has a chamfer that carries the turn of the
    normals. Upper face, its chamfers and the fillet are one chart, the underside likewise; the
    texture is torn at the upper border of the outer wall, within the holes and on the boss.
    """
    mesh = Patchwork()
    _plate(mesh)
    _boss(mesh)
    for x in (-BOLT_X, BOLT_X):
        _wall(mesh, _hole_rings(x, BOLT_RADIUS, BOLT_CORNERS, THICKNESS), f"hole {x}")
    _wall(mesh, _hole_rings(0.0, BORE_RADIUS, BORE_CORNERS, BOSS_TOP), "bore")
    return mesh.shape([*_plate_pieces(), *_boss_pieces()], UV_SIZE)


def _outline(inset: float) -> Array:
    """Return the plate's outline (18, 2), its sides moved in by `inset` [m]."""
    tangent = math.degrees(math.acos((MIDDLE - END) / BOLT_X))
    arc = np.linspace(tangent, 180.0 - tangent, 4)[1:3]
    half = [*TURNS, tangent, *arc, *(180.0 - np.array([tangent, *TURNS[:0:-1]]))]
    angles = np.radians([*half, *(180.0 + np.array(half))])
    reach = np.maximum(MIDDLE, END + BOLT_X * np.abs(np.cos(angles)))
    return polygon(angles, reach - inset)


def _outer_rings() -> Array:
    sections = [(0.0, EDGE), (EDGE, 0.0), (THICKNESS - EDGE, 0.0), (THICKNESS, EDGE)]
    return loft([(z, _outline(inset)) for z, inset in sections], "z")


def _hole_rings(x: float, radius: float, corners: int, top: float) -> Array:
    """Return the rings of a hole from its upper rim down, as a wall seen from within (4, n, 3)."""
    profile = [(top, radius + RIM), (top - RIM, radius), (RIM, radius), (0.0, radius + RIM)]
    return lathe(profile, corners, "z") + np.array([x, 0.0, 0.0])


def _boss_rings() -> Array:
    """Return the rings of fillet and boss from the foot upwards, (5, n, 3)."""
    step = FILLET * (1.0 - math.sqrt(0.5))
    profile = [
        (THICKNESS, BOSS_RADIUS + FILLET), (THICKNESS + step, BOSS_RADIUS + step),
        (THICKNESS + FILLET, BOSS_RADIUS), (BOSS_TOP - EDGE, BOSS_RADIUS),
        (BOSS_TOP, BOSS_RADIUS - EDGE),
    ]  # fmt: skip
    return lathe(profile, BOSS_CORNERS, "z")


def _plate(mesh: Patchwork) -> None:
    """Add upper face and underside with the chamfers round them, and the outer wall."""
    outer, foot = _outer_rings(), _boss_rings()[:2]
    bolts = [_hole_rings(x, BOLT_RADIUS, BOLT_CORNERS, THICKNESS) for x in (-BOLT_X, BOLT_X)]
    bore = _hole_rings(0.0, BORE_RADIUS, BORE_CORNERS, BOSS_TOP)
    _face(mesh, [outer[3], foot[0], *(bolt[0] for bolt in bolts)], 1.0, "upper")
    _face(mesh, [outer[0], bore[3], *(bolt[3] for bolt in bolts)], -1.0, "under")
    _border(mesh, outer[3], outer[2], "upper")
    _border(mesh, outer[0], outer[1], "under")
    _border(mesh, foot[0], foot[1], "upper")
    for bolt in bolts:
        _border(mesh, bolt[0], bolt[1], "upper", hole=True)
        _border(mesh, bolt[3], bolt[2], "under", hole=True)
    _border(mesh, bore[3], bore[2], "under", hole=True)
    _outer_wall(mesh, outer[1:3])


def _boss(mesh: Patchwork) -> None:
    """Add the rest of the fillet, the wall and the top with its chamfers."""
    rings = _boss_rings()
    bore = _hole_rings(0.0, BORE_RADIUS, BORE_CORNERS, BOSS_TOP)
    around = closed(rings[1:4])
    ((_, uv),) = banded(around)
    mesh.grid(around[:2], uv[:2], "boss", rank=ROUND)
    mesh.grid(around[1:], uv[1:], "boss", rank=CURVED)
    _face(mesh, [rings[4], bore[0]], 1.0, "top")
    _border(mesh, rings[4], rings[3], "top")
    _border(mesh, bore[0], bore[1], "top", hole=True)


def _face(mesh: Patchwork, loops: list[Array], up: float, chart: str) -> None:
    mesh.flat(loops, (0.0, 0.0, up), chart, u_axis=(1.0, 0.0, 0.0))


def _border(mesh: Patchwork, flat: Array, beyond: Array, chart: str, *, hole: bool = False) -> None:
    """Add the strip between a ring of a flat face and the next, folded out into its chart."""
    up = -1.0 if chart == "under" else 1.0
    mirror = np.array([1.0, up])  # v runs so that u, v and the outward normal are right-handed
    side, step = flat[1] - flat[0], beyond[0] - flat[0]
    across = abs(float(step[0] * side[1] - step[1] * side[0])) / float(np.linalg.norm(side))
    steep = math.hypot(1.0, float(step[2]) / across)
    places = flat[:, :2] * mirror, (flat[:, :2] + steep * (beyond - flat)[:, :2]) * mirror
    rows = [(flat, places[0]), (beyond, places[1])]
    rows.sort(key=lambda row: float(row[0][0, 2]))
    points, uv = (np.stack([row[i] for row in rows]) for i in (0, 1))
    if hole:
        points, uv = points[:, ::-1], uv[:, ::-1]
    mesh.grid(closed(points), closed(uv), chart, rank=ROUND)


def _outer_wall(mesh: Patchwork, rings: Array) -> None:
    around = closed(rings)
    uv = unrolled(*around)
    sides = np.diff(around[0, :, :2], axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    for k, (length, side) in enumerate(zip(lengths, sides, strict=True)):
        # The four tangents are truly flat; what lies between them stands for arcs.
        flat = length > 2.0 * float(np.median(lengths))
        normal = np.array([side[1], -side[0], 0.0]) / length
        mesh.grid(around[:, k : k + 2], uv[:, k : k + 2], "outer wall",
                  rank=FLAT if flat else CURVED, normal=normal if flat else None)  # fmt: skip


def _wall(mesh: Patchwork, rings: Array, chart: str) -> None:
    """Add the wall of a hole between its rims."""
    within = closed(rings[2:0:-1, ::-1])
    mesh.grid(within, unrolled(*within), chart, rank=CURVED)


def _plate_pieces() -> list[Array]:
    """Return the plate in pieces: one at each side of a bolt hole, four round the boss."""
    solid = _outer_rings().reshape(-1, 3)
    pieces = []
    for sign in (-1.0, 1.0):
        cell = np.array([-sign, 0.0, 0.0]), -CELL
        for k in range(BOLT_CORNERS):
            wedge = _wedge(sign * BOLT_X, BOLT_RADIUS, BOLT_CORNERS, THICKNESS, k)
            pieces.append(clipped(solid, [cell, *wedge]))
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    middle = [(x, CELL), (-x, CELL)]
    pieces += [clipped(solid, [*middle, (-beyond, -CORE)]) for beyond in (x, -x, y, -y)]
    return pieces


def _boss_pieces() -> list[Array]:
    """Return boss and fillet in pieces: one at each side of the bore, four for each fillet step."""
    rings = _boss_rings()
    foot = rings[2] * np.array([1.0, 1.0, 0.0])
    solid = np.concatenate([foot, *rings[3:]])
    wedges = [_wedge(0.0, BORE_RADIUS, BORE_CORNERS, BOSS_TOP, k) for k in range(BORE_CORNERS)]
    pieces = [clipped(solid, wedge) for wedge in wedges]
    for step in (0, 1):
        # Down into the plate, so that no piece is a thin sliver.
        low = rings[step] * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, 0.5 * THICKNESS])
        stack = closed(np.stack([low, *rings[step : step + 2]]))
        quarter = BOSS_CORNERS // 4
        # The chord of a quarter stays clear of the bore: 11 mm from the axis.
        pieces += [stack[:, i * quarter : (i + 1) * quarter + 1].reshape(-1, 3) for i in range(4)]
    return pieces


def _wedge(x: float, radius: float, corners: int, top: float, k: int) -> list[tuple[Array, float]]:
    """Return the planes round what lies behind side `k` of a hole: neighbours, wall, rims."""
    start, stop = 2.0 * math.pi / corners * (k + np.array([-0.5, 0.5]))
    middle = 0.5 * (start + stop)
    wall = float(circle(radius, corners)[:, 0].max())
    inwards = -np.array([math.cos(middle), math.sin(middle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    # A rim's slope, which the polygon makes a little steeper than 45 degrees.
    slope = (float(circle(radius + RIM, corners)[:, 0].max()) - wall) / RIM
    planes = [
        (np.array([math.sin(start), -math.cos(start), 0.0]), 0.0),
        (np.array([-math.sin(stop), math.cos(stop), 0.0]), 0.0),
        (inwards, -wall),
        (inwards + slope * up, slope * (top - RIM) - wall),
        (inwards - slope * up, -slope * RIM - wall),
    ]
    shift = np.array([x, 0.0, 0.0])
    return [(normal, offset + float(normal @ shift)) for normal, offset in planes]
