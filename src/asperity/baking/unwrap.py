"""Texture coordinates with a margin around every chart for the texture's spline."""

from __future__ import annotations

import dataclasses

import numpy as np

from asperity.baking.texels import GUTTER_WIDTH
from asperity.errors import AsperityError
from asperity.geometry.mesh.atlas import with_atlas
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import crosses
from asperity.geometry.mesh.uv import overlap

_SHARE = 0.72
"""Side of a square with the mesh's area, in sides of the texture; charts leave gaps."""
_BETWEEN = 2
"""Texels of transition between the gutters of two charts."""
_MOST_SHARED = 1e-3


def unwrapped(mesh: Mesh, size: int) -> Mesh:
    """Return the mesh with texture coordinates for a texture of `size` by `size` texels.

    Existing texture coordinates are kept if they are within 0..1 and do not overlap; otherwise
    xatlas makes new ones.
    """
    if mesh.uv is not None and usable(mesh):
        return mesh
    margin = 2 * int(np.ceil(GUTTER_WIDTH)) + _BETWEEN
    texels = max(int(_SHARE * size), 8)
    made = with_atlas(dataclasses.replace(mesh, uv=None), texels=texels, padding=margin)
    assert made.uv is not None
    # The spline is mirrored at the texture's border, so charts keep a distance from it too.
    room = (GUTTER_WIDTH + _BETWEEN) / size
    low, high = made.uv.min(axis=(0, 1)), made.uv.max(axis=(0, 1))
    uv = room + (made.uv - low) * ((1.0 - 2.0 * room) / (high - low).max())
    if room > 0.25:
        raise AsperityError(
            f"a texture of {size} texels has no room for charts; ask for 32 or more"
        )
    uv.setflags(write=False)
    return dataclasses.replace(made, uv=uv)


def usable(mesh: Mesh) -> bool:
    """Return whether texture coordinates are within 0..1 and do not overlap."""
    assert mesh.uv is not None
    if mesh.uv.min() < 0.0 or mesh.uv.max() > 1.0:
        return False
    flat = np.concatenate([mesh.uv, np.zeros((*mesh.uv.shape[:2], 1))], axis=2)
    laid = np.linalg.norm(crosses(flat), axis=1)
    return bool((laid > 1e-12).all()) and overlap(mesh.uv) < _MOST_SHARED


def texture_span(mesh: Mesh) -> float:
    """Return the length that one unit of texture coordinates spans [m], averaged over the area."""
    assert mesh.uv is not None
    flat = np.concatenate([mesh.uv, np.zeros((*mesh.uv.shape[:2], 1))], axis=2)
    area = np.linalg.norm(crosses(mesh.vertices[mesh.faces]), axis=1).sum()
    return float(np.sqrt(area / np.linalg.norm(crosses(flat), axis=1).sum()))
