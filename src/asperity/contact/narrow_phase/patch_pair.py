"""Pairs of surface patches: the one that is searched, the window, and the kind of search."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.plane_boxes import lateral_shift
from asperity.contact.narrow_phase.smooth_base import parameters_at, place_at
from asperity.contact.narrow_phase.sphere_on_plane import is_sphere_on_plane
from asperity.contact.narrow_phase.surface_patch import entries

GENERAL, SPHERE_ON_PLANE, PLANES = 0, 1, 2
"""Kinds of pairs: general; a sphere over a level plane; two planes in a best-first search."""


class PatchPair(NamedTuple):
    """Two patches of which one is searched."""

    patch: Any
    """PATCH record whose parameters are searched."""
    other: Any
    """PATCH record whose height is looked up."""
    number: int
    """A's patch * stride + B's patch."""
    kind: int
    """GENERAL, SPHERE_ON_PLANE or PLANES."""
    base_x: float
    """Estimate of the parameters at which the smooth bases overlap most [m]."""
    base_y: float
    shift: float
    """Upper bound of the textures' lateral displacement of points [m]."""
    window: tuple[float, float, float, float]
    """x0, x1, y0, y1 of the part that is searched [m]."""


@inner_kernel
def _is_implicit(patch):
    """Return whether the height at (u, v) has to be found by iteration."""
    return patch.texture >= 0 and not patch.is_level


@inner_kernel
def searches_a(a, b):
    """Return whether A's patch is searched: the one whose height at (u, v) is costlier.

    If either patch has a stiffness map, that one is searched. An overhanging surface has no unique
    height; by searching its points the highest is found.
    """
    if a.stiffness_map >= 0 or b.stiffness_map >= 0:
        return a.stiffness_map >= 0
    if _is_implicit(a) != _is_implicit(b):
        return _is_implicit(a)
    if _is_implicit(a):
        return a.fold >= b.fold
    if b.texture >= 0 or a.texture >= 0:
        return b.texture < 0
    return a.bulge == 0.0


@inner_kernel
def _extent(patch):
    """Return centre and half sides of a patch's extent in (u, v)."""
    rectangle = patch.rectangle
    if patch.bulge == 0.0 or patch.ellipse[0] == 0.0:
        x = 0.5 * (rectangle[0] + rectangle[1])
        y = 0.5 * (rectangle[2] + rectangle[3])
        half_x, half_y = rectangle[1] - x, rectangle[3] - y
    else:
        x = y = 0.0
        half_x, half_y = rectangle[1], rectangle[3]
    u, v = place_at(patch, x, y)
    a, b, c, d = entries(patch.lateral)
    return u, v, abs(a) * half_x + abs(b) * half_y, abs(c) * half_x + abs(d) * half_y


@inner_kernel
def middle_of(other, patch):
    """Return the parameters of `patch` at the middle of `other`."""
    u, v, _, _ = _extent(other)
    return parameters_at(patch, u, v)


@inner_kernel
def window_of(patch, other, shift):
    """Return the box of a patch's parameters that the other covers, within its rectangle."""
    u, v, half_u, half_v = _extent(other)
    half_u, half_v = half_u + shift, half_v + shift
    x, y = parameters_at(patch, u, v)
    i, j, k, m = entries(patch.lateral_inverse)
    half_x, half_y = abs(i) * half_u + abs(j) * half_v, abs(k) * half_u + abs(m) * half_v
    rectangle = patch.rectangle
    return (
        max(x - half_x, rectangle[0]), min(x + half_x, rectangle[1]),
        max(y - half_y, rectangle[2]), min(y + half_y, rectangle[3]),
    )  # fmt: skip


@small_kernel
def pair_shift(textures, patch, other):
    """Return an upper bound of the lateral displacement by the textures of two patches [m]."""
    return lateral_shift(textures, patch) + lateral_shift(textures, other)


@small_kernel
def pair_roughness(textures, patch, other):
    """Return an upper bound of the height of two patches' textures above the smooth bases [m]."""
    rough = 0.0
    for either in (patch, other):
        if either.texture >= 0:
            rough += max(min(textures.maps[either.texture].highest, either.texture_top), 0.0)
    return rough


@small_kernel
def kind_and_base(patch, other, base_x, base_y):
    """Return the kind of a pair that is searched depth first, and its base point."""
    if is_sphere_on_plane(patch, other):
        x, y = parameters_at(patch, other.origin[0], other.origin[1])
        return np.int64(SPHERE_ON_PLANE), x, y
    return np.int64(GENERAL), base_x, base_y


@small_kernel
def sides_of(patch):
    """Return x0, x1, y0, y1 of a patch's rectangle."""
    sides = patch.rectangle
    return sides[0], sides[1], sides[2], sides[3]


@small_kernel
def window_under_sphere(textures, pair, threshold):
    """Return the part of the window where a sphere can be deeper in a plane than `threshold`.

    Farther from the sphere's lowest point even the highest texture is below the sphere.
    """
    patch, other = pair.patch, pair.other
    high = textures.maps[patch.texture].max_abs_height
    root = (threshold - patch.origin[2] - other.origin[2] - high) / other.bulge
    if not root > 0.0:
        return pair.window
    reach = math.sqrt(max(1.0 - root * root, 0.0) / other.ellipse[0])
    x0, x1, y0, y1 = pair.window
    x, y = pair.base_x, pair.base_y
    return max(x0, x - reach), min(x1, x + reach), max(y0, y - reach), min(y1, y + reach)
