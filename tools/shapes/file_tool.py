"""A flat hand file with a turned handle: the tool of colour plate 6.

The paper prints a picture and no sizes; its low-resolution file has 632 triangles. All sizes here
were chosen for this package.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.shapes.shape import Shape
from tools.shapes.charts import banded, dome, unrolled
from tools.shapes.patchwork import CURVED, ROUND, Patchwork
from tools.shapes.sections import closed, convex_pieces, lathe, loft

Array = NDArray[np.float64]

PITCH = 1.55e-3
"""Distance between teeth [m], as in the texture of the built-in scene."""
UV_SIZE = (8 * math.sqrt(2.0) * PITCH, 8 * math.sqrt(2.0) * PITCH)
"""Size of the texture's tile [m]: what `cross_cut` makes of 12 periods at 45 degrees."""

LENGTH, WIDTH, THICKNESS = 0.120, 0.020, 0.0040
"""Of the blade [m]."""
BELLY = 1.5e-4
"""By how much each broad face is lower at the ends than in the middle [m], as on real files."""
ARCH = 5e-5
"""By how much each broad face is lower at its edges than along its middle line, and each edge at
its ends than in the middle [m]."""
CHAMFER = 4e-4
TAPER = (0.075, 0.0115)
"""Where the blade begins to narrow, and how wide it is at the point [m]."""
STATIONS = (0.0, 0.015, 0.03, 0.045, 0.06, 0.075, 0.09, 0.105, 0.1185)
TANG = ((-0.0220, 0.0060, 0.0030), (-0.0090, 0.0080, 0.0034))
"""Rings of the tang (x, width, thickness) [m]."""
TURNED_CORNERS = 16
FERRULE = ((-0.0340, 0.0074), (-0.0220, 0.0070))
WOOD = (
    (-0.1325, 0.0066), (-0.1285, 0.0104), (-0.1130, 0.0124), (-0.0880, 0.0114),
    (-0.0550, 0.0088), (-0.0365, 0.0104), (-0.0340, 0.0096),
)  # fmt: skip
"""Rings of the handle (x, radius) [m]."""
WOOD_TIP = -0.1338

CUT_FACES = slice(0, 28 * (len(STATIONS) - 1))
"""The triangles of the blade that are cut: both broad faces, edges and chamfers."""


def file_tool() -> Shape:
    """Return the file: 622 triangles, the paper's 632 to 2 %; `CUT_FACES` come first.

    The blade lies along x from the shoulder at x = 0 to the point at x = 120 mm, its broad faces
    towards +z and -z; tang, ferrule and handle are at x < 0. The blade is convex: its belly is
    0.15 mm along each face and 0.05 mm across. On the blade u runs along the file to its point and
    v across, as `cross_cut` wants it; a broad face, its two chamfers and one edge are one chart,
    so the texture is torn along one corner of each edge, and round the point.
    """
    mesh = Patchwork()
    pieces = _blade(mesh)
    pieces += _handle(mesh)
    return mesh.shape(pieces, UV_SIZE)


def _section(width: float, thickness: float) -> Array:
    """Return a section (14, 2) [m]; its sides are parallel for all widths and thicknesses.

    From the lower corner of the edge at +y: that edge, a chamfer, four strips of the arched upper
    face, a chamfer; then the same from the edge at -y, below.
    """
    half = 0.5 * width
    y = half - CHAMFER
    # The arch is a parabola over the full width; narrower sections keep its slopes, not its shape.
    drops = np.array([1.0, 0.25, 0.0, 0.25, 1.0]) * ARCH * y / (0.5 * WIDTH - CHAMFER)
    top = 0.5 * thickness - drops
    places = np.array([y, 0.5 * y, 0.0, -0.5 * y, -y])
    edge = top[0] - CHAMFER
    upper = [(half, -edge), (half, edge), *zip(places, top, strict=True)]
    return np.array([*upper, *(-np.array(upper))])


def _width(x: float) -> float:
    start, end = TAPER
    share = max(0.0, (x - start) / (LENGTH - start))
    return WIDTH - 2.0 * ARCH * (2.0 * x / LENGTH - 1.0) ** 2 - (WIDTH - end) * share * share


def _thickness(x: float) -> float:
    return THICKNESS - 2.0 * BELLY * (2.0 * x / LENGTH - 1.0) ** 2


def _blade(mesh: Patchwork) -> list[Array]:
    """Add blade, point, shoulder and tang; return their pieces."""
    blade = loft([(x, _section(_width(x), _thickness(x))) for x in STATIONS], "x")
    point = loft([(LENGTH, _section(_width(LENGTH) - 2e-3, _thickness(LENGTH) - 2e-3))], "x")
    tang = loft([(x, _section(width, thickness)) for x, width, thickness in TANG], "x")
    around, uv = closed(blade), _blade_uv(blade)
    for first, chart in ((0, "upper"), (7, "lower")):
        for k in range(7):
            rank = ROUND if k in (1, 6) else CURVED
            columns = slice(first + k, first + k + 2)
            mesh.grid(around[:, columns], uv[first // 7, :, k : k + 2], chart,
                      smooth="blade", rank=rank)  # fmt: skip
    ends = {
        "point": (blade[-1:], point),
        "shoulder": (tang[-1:], blade[:1]),
        "tang": (tang[:1], tang[1:]),
    }
    for chart, rings in ends.items():
        strip = closed(np.concatenate(rings))
        rank = CURVED if chart == "tang" else ROUND
        mesh.grid(strip, unrolled(*strip), chart, smooth="blade", rank=rank)
    mesh.flat([point[0]], (1.0, 0.0, 0.0), "tip", smooth="blade")
    return convex_pieces(np.concatenate([tang, blade, point]), "x")


def _blade_uv(blade: Array) -> Array:
    """Return where the corners of both charts lie [m], (2, s, 8, 2)."""
    steps = np.diff(closed(blade), axis=1)[:, :7]
    lengths = np.linalg.norm(steps, axis=2)
    v = np.concatenate([np.zeros((len(blade), 1)), -np.cumsum(lengths, axis=1)], axis=1)
    v -= v[:, 4:5]  # 0 on the middle line of the broad face
    u = np.broadcast_to(blade[:, :1, 0], v.shape)
    # The lower face is the upper one turned over about x: the same chart again.
    return np.stack([np.stack([u, v], axis=-1)] * 2)


def _handle(mesh: Patchwork) -> list[Array]:
    """Add ferrule and wood, turned; return their pieces."""
    ferrule, wood = (lathe(profile, TURNED_CORNERS, "x") for profile in (FERRULE, WOOD))
    tang = loft([(TANG[0][0], _section(*TANG[0][1:]))], "x")[0]
    mesh.flat([ferrule[1], tang], (1.0, 0.0, 0.0), "ferrule's end", smooth="ferrule's end")
    mesh.grid(closed(ferrule), unrolled(*closed(ferrule)), "ferrule", smooth="ferrule", rank=CURVED)
    mesh.flat([wood[-1], ferrule[0]], (1.0, 0.0, 0.0), "wood's end", smooth="wood's end")
    around = closed(wood)
    for first, uv in banded(around):
        mesh.grid(around[first : first + len(uv)], uv, f"wood {first}", smooth="wood")
    tip = np.array([WOOD_TIP, 0.0, 0.0])
    end = wood[:1, ::-1]
    uv = dome(end, tip, np.array([-1.0, 0.0, 0.0]))
    mesh.fan(tip, end[0], uv[0], "wood's dome", smooth="wood", rank=ROUND)
    return [*convex_pieces(wood, "x", [tip]), *convex_pieces(ferrule, "x")]
