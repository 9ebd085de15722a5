"""Broad phase for blocks of neighbouring taxels.

A block without a near solid is skipped. If all its rays leave the only near solid by the same flat
sheet, the sheet need not be searched for (`flat_blocks`).
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.sheets import BOX, CURVED, PLANAR, PLANE, half_length

BLOCK = 64
"""Number of taxels of a block."""
RAYS = np.dtype([
    ("middle", "f8", 3), ("along", "f8", 3), ("radius", "f8"), ("height", "f8"),
    ("spread", "f8"), ("reach", "f8"),
])  # fmt: skip
"""The rays of a block. Their starts are within `radius` of `middle`, and within `height` along the
unit vector `along` [m]; their directions are within `spread` of `along` [-], their length is
`reach` [m]."""
NONE, SEVERAL = -1, -2
"""Values in place of a geom's number."""
_STEEP = 0.05
"""Smallest cosine between a lone sheet's normal and a ray."""


@small_kernel
def _half(rays, cosine):
    """Return a bound of the starts' distance from their middle along a direction.

    `cosine` is that of its angle to `rays.along`.
    """
    aside = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return min(rays.radius, abs(cosine) * rays.height + aside * rays.radius)


@inner_kernel
def _may_meet(solids, g, x, d, rays):
    """Return whether rays may meet a geom; `x`, `d` (3,) are their middle in its frame."""
    along = far = 0.0
    for i in range(3):
        along += x[i] * d[i]
    s = min(max(-along, 0.0), rays.reach)
    for i in range(3):
        far += (x[i] + s * d[i]) ** 2
    if far > (solids.bound[g] + rays.radius + rays.reach * rays.spread) ** 2:
        return False
    for face in range(5 if solids.geometry.kind[g] == PLANE else 0, 6):
        axis, sign = face >> 1, 1.0 if face & 1 else -1.0
        gap = sign * x[axis] - solids.extent[g, axis] - _half(rays, d[axis])
        if gap + min((sign * d[axis] - rays.spread) * rays.reach, 0.0) > 0.0:
            return False
    return True


@inner_kernel
def _lone_sheet(solids, g, x, d, rays):
    """Return the only flat sheet by which rays may leave a geom; `CURVED` if there is none."""
    geometry, reach = solids.geometry, solids.reach[g]
    kind, size, surface = geometry.kind[g], geometry.size[g], geometry.surface[g]
    is_endless = kind == PLANE and size[0] <= 0.0 and size[1] <= 0.0
    is_planar = geometry.texture[surface] < 0 or geometry.mapping[surface] == PLANAR
    if not (is_endless or kind == BOX) or not is_planar:
        return CURVED
    lone = CURVED
    for face in range(5 if kind == PLANE else 0, 6):
        axis, sign = face >> 1, 1.0 if face & 1 else -1.0
        gap, rate = sign * x[axis] - half_length(kind, size, axis), sign * d[axis]
        if gap + _half(rays, rate) + max((rate + rays.spread) * rays.reach, 0.0) < reach.lowest:
            continue  # completely behind it
        if lone != CURVED or rate - rays.spread < _STEEP:
            return CURVED
        lone = face
    return lone


@inner_kernel
def near_geom(solids, relative, rays):
    """Return the geom that a block's rays may meet, and the flat sheet by which they leave it.

    Parameters
    ----------
    solids : Solids
    relative : (geoms, 3, 4) array
        The frame of the rays relative to each geom.
    rays : RAYS record

    Returns
    -------
    geom : int
        Its number, `NONE` or `SEVERAL`.
    sheet : int
        Its number, `CURVED` if another sheet may count.
    """
    geom, sheet = NONE, CURVED
    x, d = stack_array((3,)), stack_array((3,))
    for g in range(relative.shape[0]):
        for i in range(3):
            x[i], d[i] = relative[g, i, 3], 0.0
            for j in range(3):
                x[i] += relative[g, i, j] * rays.middle[j]
                d[i] += relative[g, i, j] * rays.along[j]
        if not _may_meet(solids, g, x, d, rays):
            continue
        if geom != NONE:
            return SEVERAL, CURVED
        geom, sheet = g, _lone_sheet(solids, g, x, d, rays)
    return geom, sheet
