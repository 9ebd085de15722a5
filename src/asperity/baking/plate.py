"""A height map as a plate: a slab whose top carries the map unchanged.

Only the top is rough. Its normals are the plane's, so its edges are declared hard, and the lowest
sample of the map is in the slab's plane, so that no step stands around the rim. The sides and the
bottom show a strip of zeros beside the map. In between are the map's mirror image, which leaves the
spline on the map unchanged, and a few texels of transition.
"""

from __future__ import annotations

import numpy as np

from asperity.baking.folder import Texture
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.texture.height_field import HeightField

HARD_ANGLE = 45.0
"""Angle beyond which edges are hard [degrees]."""
THICKNESS = 0.1
"""Thickness, in longer sides of the map."""
_MIRRORED, _PASSAGE, _ZERO = 14, 6, 8
"""Rows of each strip; the influence of a sample on the spline falls to 1e-8 over 14 samples."""


def plate_of(field: HeightField, name: str) -> tuple[Mesh, Texture]:
    """Return a slab with texture coordinates, and its texture.

    Parameters
    ----------
    field : HeightField
        Treated as clamped.
    name : str
    """
    rows = len(field.samples)
    heights = field.samples - field.lowest
    mirrored = heights[::-1][: min(_MIRRORED, rows)]
    fade = np.linspace(1.0, 0.0, _PASSAGE + 2)[1:-1, None]
    passage, zeros = fade * mirrored[-1], np.zeros((_ZERO, heights.shape[1]))
    whole = np.concatenate([heights, mirrored, passage, zeros]).astype(np.float32)
    size = (field.size[0], len(whole) * field.pixel_size[1])
    mesh = _slab(field.size, rows / len(whole), (len(whole) - 0.5 * _ZERO) / len(whole), name)
    return mesh, Texture(whole, size)


def _slab(size: tuple[float, float], top: float, zero: float, name: str) -> Mesh:
    """Return the slab: its top, at z = 0, shows v from 0 to `top`, all other faces v = `zero`."""
    x, y = 0.5 * size[0], 0.5 * size[1]
    thick = THICKNESS * max(size)
    corners = [(sx * x, sy * y, z) for z in (0.0, -thick) for sy in (-1, 1) for sx in (-1, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (1, 5, 7, 3), (3, 7, 6, 2), (2, 6, 4, 0)]
    faces = np.array([(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)])
    uv = np.tile([0.5, zero], (len(faces), 3, 1))
    places = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, top), (1.0, top)])
    uv[:2] = places[faces[:2]]
    return mesh_from_arrays(corners, faces, uv=uv, hard_angle=HARD_ANGLE, name=name)
