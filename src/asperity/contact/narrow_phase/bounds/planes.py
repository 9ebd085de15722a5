"""Quantities shared by all bounds of the overlap of two plane patches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import small_kernel
from asperity.contact.narrow_phase.plane_boxes import lateral_shift, plane_normal, texture_size
from asperity.contact.narrow_phase.smooth_base import parameters_over
from asperity.contact.narrow_phase.surface_patch import entries


class Planes(NamedTuple):
    """Quantities shared by all bounds of the overlap of two plane patches."""

    b0: float
    """The other's first parameter over (x, y): b0 + b1 x + b2 y [m]."""
    b1: float
    b2: float
    c0: float
    """The other's second parameter: c0 + c1 x + c2 y [m]."""
    c1: float
    c2: float
    z_x: float
    """Overlap of the smooth bases: z_0 + z_x x + z_y y [m]."""
    z_y: float
    z_0: float
    lift: float
    """Largest rise of the overlap per height of the texture."""
    other_lift: float
    """The same for the other's texture."""
    valley: float
    """Largest rise by the texture's valleys if it is seen from behind, else -inf [m]."""
    other_valley: float
    """The same for the other's texture."""
    shift: float
    """Largest displacement of points by both textures, in the other's parameters [m]."""
    g1: float
    """Slope of the other's base over (u, v)."""
    g2: float


class Lifts(NamedTuple):
    """Upper bounds of the textures' effect on the overlap of two planes; see `Planes`."""

    lift: float
    other_lift: float
    valley: float
    other_valley: float
    shift: float


@small_kernel
def lifts_within(textures, patch, other, box):
    """Return the `Lifts` of two plane patches within `box`, centre and half sides on `patch`.

    Where normals vary, bounds over the box are tighter than those over a whole large facet.
    """
    i, j, k, m = entries(other.lateral_inverse)
    s_x, s_y = other.slope[0], other.slope[1]
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    lift, least, lateral = bound_lift(patch, box, g1, g2)
    valley = bound_valley_rise(textures, patch, least)
    shift = texture_size(textures, patch) * lateral
    other_lift, lateral = _unit_lift(other, -g1, -g2), other.normal_lateral
    least = other_lift
    if other.texture >= 0 and not other.is_unit:
        moved = (shift + lateral_shift(textures, other)) / other.lateral_min
        under = box_under(parameters_over(patch, other), box, moved)
        other_lift, least, lateral = bound_lift(other, under, -g1, -g2)
    other_valley = bound_valley_rise(textures, other, least)
    shift += 0.0 if other.is_level else texture_size(textures, other) * lateral
    return Lifts(lift, other_lift, valley, other_valley, shift / other.lateral_min)


@small_kernel
def planes_of(patch, other, lifts):
    """Return the `Planes` of two plane patches, for boxes within that of their `Lifts`."""
    i, j, k, m = entries(other.lateral_inverse)
    b0, b1, b2, c0, c1, c2 = parameters_over(patch, other)
    slope, s_x, s_y = patch.slope, other.slope[0], other.slope[1]
    z_x = slope[0] + s_x * b1 + s_y * c1
    z_y = slope[1] + s_x * b2 + s_y * c2
    z_0 = patch.origin[2] + other.origin[2] + s_x * b0 + s_y * c0
    g1, g2 = i * s_x + k * s_y, j * s_x + m * s_y
    return Planes(
        b0, b1, b2, c0, c1, c2, z_x, z_y, z_0, lifts[0], lifts[1], lifts[2], lifts[3], lifts[4],
        g1, g2,
    )  # fmt: skip


@small_kernel
def bound_valley_rise(textures, patch, least):
    """Return the largest rise by valleys of a plane whose lift is at least `least` [m]."""
    return -least * texture_size(textures, patch) if least < 0.0 else -np.inf


@small_kernel
def _unit_lift(patch, g1, g2):
    """Return the lift of `_bound_lift` for a constant normal."""
    return patch.normal[2] + g1 * patch.normal[0] + g2 * patch.normal[1]


@small_kernel
def bound_lift(patch, box, g1, g2):
    """Return the largest and smallest lift, and the largest lateral component of the normal.

    The lift is the rise of the overlap per height of a plane's texture. (g1, g2) is the slope of
    the other plane; all hold within a `box` of centre and half sides.
    """
    if patch.is_unit:
        lift = _unit_lift(patch, g1, g2)
        return lift, lift, 0.0 if patch.is_level else patch.normal_lateral
    x, y, half_x, half_y = box
    u, v, z, change, _, _ = plane_normal(patch, x, y, math.sqrt(half_x * half_x + half_y * half_y))
    # The angle between G = (g1, g2, 1) and w has the cosine along / |G|; `change` bounds the
    # rotation of w.
    square, along = 1.0 + g1 * g1 + g2 * g2, z + g1 * u + g2 * v
    spread = math.sqrt(max(square - along * along, 0.0)) * change
    spread += abs(along) * 0.5 * change * change
    lateral = min(math.sqrt(u * u + v * v) + change, patch.normal_lateral)
    return min(along + spread, math.sqrt(square)), along - spread, lateral


@small_kernel
def box_under(mapping, box, shift):
    """Return the box (x, y, half_x, half_y) of the other's parameters that may be under a box.

    `mapping` is that of `parameters_over`; `shift` widens the box on all sides [m].
    """
    (b0, b1, b2, c0, c1, c2), (x, y, half_x, half_y) = mapping, box
    return (
        b0 + b1 * x + b2 * y,
        c0 + c1 * x + c2 * y,
        abs(b1) * half_x + abs(b2) * half_y + shift,
        abs(c1) * half_x + abs(c2) * half_y + shift,
    )


@small_kernel
def under_box(planes, box):
    """Return `box_under` for the `Planes` of two patches, with their shift."""
    mapping = planes.b0, planes.b1, planes.b2, planes.c0, planes.c1, planes.c2
    return box_under(mapping, box, planes.shift)
