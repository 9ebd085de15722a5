"""Coulomb's coefficient at the deepest points, where it is given by a map.

A friction map has the mapping of a texture, and is read at the same texture coordinates.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.body_arrays import pair_friction
from asperity.contact.narrow_phase.displaced_surface import (
    NO_WEIGHT,
    cylindrical_place,
    planar_place,
)
from asperity.contact.narrow_phase.smooth_base import root_at
from asperity.contact.narrow_phase.surface_patch import CYLINDRICAL, PLANAR
from asperity.texture.packed import linear_at


@small_kernel
def _read(textures, patch, u, v):
    """Return the coefficient at texture coordinates (u, v) of a patch [-]."""
    scale, shift = patch.friction_scale, patch.friction_shift
    return linear_at(textures, patch.friction_map, scale[0] * u + shift[0], scale[1] * v + shift[1])


@inner_kernel
def _friction_at(textures, patch, x, y):
    """Return Coulomb's coefficient of a surface at (x, y) of its patch [-]; nan if it has none."""
    if patch.friction_map < 0:
        return patch.friction
    r = root_at(patch, x, y)[0]
    if patch.mapping == CYLINDRICAL:
        u, v = cylindrical_place(patch, x, y, r)
        return _read(textures, patch, u, v)
    if patch.mapping == PLANAR:
        u, v = planar_place(patch, (np.int64(0), np.int64(1)), (0.0, 0.0), x, y, r)
        return _read(textures, patch, u, v)
    start, total, friction = (patch.map_start[0], patch.map_start[1]), 0.0, 0.0
    for k in range(3):
        w = patch.body_normal[k] + patch.body_normal_from_x[k] * x
        w += patch.body_normal_from_y[k] * y + patch.body_normal_from_root[k] * r
        weight = w * w * w * w
        if weight < NO_WEIGHT:
            continue
        u, v = planar_place(patch, ((k + 1) % 3, (k + 2) % 3), start, x, y, r)
        total += weight
        friction += weight * _read(textures, patch, u, v)
    return friction / total


@inner_kernel
def friction_of_tie(textures, stride, tie, is_a, memory):
    """Return Coulomb's coefficient of two surfaces at a tie, and whether either has a map.

    It is nan if neither has a coefficient. `is_a` is whether A's patch was searched.
    """
    a, b = memory.patches_a[tie.pair // stride], memory.patches_b[tie.pair % stride]
    patch, other = (a, b) if is_a else (b, a)
    one = _friction_at(textures, patch, tie.x, tie.y)
    two = _friction_at(textures, other, tie.other_x, tie.other_y)
    return pair_friction(one, two, np.nan), a.friction_map >= 0 or b.friction_map >= 0


@small_kernel
def contact_friction(result, usual, without_maps):
    """Return Coulomb's coefficient of the contact with this `PENETRATION` [-].

    `usual` is that of the force law, `without_maps` that of the two surfaces if neither has a map.
    """
    if result.friction == result.friction:
        return result.friction + result.unknown * usual
    return without_maps
