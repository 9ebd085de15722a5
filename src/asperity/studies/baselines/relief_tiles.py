"""The textured top of level boxes as height fields, in tiles.

MuJoCo keeps 50 contacts of two geoms, each with one triangle of a height field, and drops the
others in the order of rows. A flat tool touches more triangles than that, but of no tile of 5 x 5
cells. Where so small tiles would be too many, they are larger; that is enough for a tip.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body, origin_of_map
from asperity.studies.baselines.placement import top_of

Array = NDArray[np.float64]
_PER_WAVE = 20.0
"""Sufficient number of samples per shortest wave of a texture."""
_SMALLEST = 5
"""Cells along the side of a tile that two triangles a cell cannot make too many contacts of."""
_FLAT = 1e-6
"""Height that MuJoCo is given for a tile that is level, since it wants one above 0 [m]."""


class Tile(NamedTuple):
    """A height field as MuJoCo takes it."""

    heights: Array
    """From 0 to 1, rows along y, (rows, columns)."""
    size: tuple[float, float, float, float]
    """Half sides, height of the relief, and thickness of what is below it [m]."""
    position: Array
    """Of its middle, at the lowest point of its relief, in the body's frame [m], (3,)."""


def tiles_of(body: Body, samples: int, tiles: int) -> Iterator[Tile]:
    """Yield the tops of a body's boxes and planes.

    Parameters
    ----------
    body : Body
        Of level boxes and bounded planes, with a planar texture.
    samples : int
        Approximate largest number of samples of all of them.
    tiles : int
        Largest number of tiles of all of them, but one at least of each.
    """
    assert body.texture is not None
    area = sum(4.0 * geom.size[0] * geom.size[1] for geom in body.geoms)
    pitch = max(body.texture.shortest_wavelength / _PER_WAVE, math.sqrt(area / samples))
    side = max(_SMALLEST * pitch, math.sqrt(area / max(tiles, 1)))
    origin = origin_of_map(body)
    for geom in body.geoms:
        thick = 2.0 * geom.size[2] if geom.kind == "box" else abs(body.texture.lowest) + 1e-2
        grids = []
        for k in (0, 1):
            pieces = max(math.floor(2.0 * geom.size[k] / side), 1)
            cells = max(math.ceil(2.0 * geom.size[k] / pieces / pitch), 1)
            edges = np.linspace(-geom.size[k], geom.size[k], pieces + 1) + geom.position[k]
            grids.append([np.linspace(a, b, cells + 1) for a, b in itertools.pairwise(edges)])
        for x, y in itertools.product(*grids):
            heights = body.texture.heights(*np.meshgrid(x - origin[0], y - origin[1]))
            low, relief = float(heights.min()), float(np.ptp(heights))
            yield Tile(
                (heights - low) / relief if relief > _FLAT else np.zeros(heights.shape),
                (0.5 * (x[-1] - x[0]), 0.5 * (y[-1] - y[0]), max(relief, _FLAT), thick + low),
                np.array([0.5 * (x[0] + x[-1]), 0.5 * (y[0] + y[-1]), top_of(geom) + low]),
            )
