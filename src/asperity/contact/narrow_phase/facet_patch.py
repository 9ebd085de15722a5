"""A facet of a mesh as a surface patch."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.smooth_base import place_at
from asperity.contact.narrow_phase.steep_plane import lower_steep
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR, fill_lateral, fill_properties

_SMOOTH_RELIEF = 0.5
"""What stands for the relief of a smooth facet that drops out, over its size."""


@inner_kernel
def fill_facet_patch(table, geometry, f, rotation, translation, fades, patch):
    """Fill a `PATCH` with a facet.

    Parameters
    ----------
    table : FacetTable
    geometry : Geometry
    f : int
        The facet.
    rotation : (3, 3) array
        From the body's frame to the contact frame, whose z is the direction of contact.
    translation : (3,) array
        Origin of the body's frame in the contact frame [m].
    fades : bool
        Whether the facet drops out gradually where it is steep, though it has no texture.
    """
    clear_record(patch)
    lateral, slope, facet_normal = patch.lateral, patch.slope, stack_array((3,))
    for i in range(3):
        at = translation[i]
        x = y = z = w0 = w1 = w2 = 0.0
        for k in range(3):
            m = rotation[i, k]
            at += m * table.origin[f, k]
            x += m * table.axes[f, 0, k]
            y += m * table.axes[f, 1, k]
            z += m * table.axes[f, 2, k]
            w0 += m * table.w[f, k]
            w1 += m * table.w[f, 3 + k]
            w2 += m * table.w[f, 6 + k]
        patch.origin[i], patch.normal[i], facet_normal[i] = at, w0, z
        patch.normal_from_x[i], patch.normal_from_y[i] = w1, w2
        if i < 2:
            lateral[i, 0], lateral[i, 1] = x, y
        else:
            slope[0], slope[1] = x, y
    fill_lateral(patch, lateral[0, 0], lateral[0, 1], lateral[1, 0], lateral[1, 1])
    is_unit, normal = table.unit[f] == 1.0, patch.normal
    patch.is_unit, patch.aspect, patch.min_root = is_unit, 1.0, 0.5
    patch.is_level = is_unit and abs(normal[0]) < 1e-12 and abs(normal[1]) < 1e-12
    patch.normal_slope, patch.normal_bend = table.bends[f, 0], table.bends[f, 1]
    _fill_extent(table, f, patch)
    _fill_normal_bounds(table, f, patch)
    surface = table.surface[f]
    texture = geometry.texture[surface]
    patch.texture, patch.mapping = texture, int(table.mapping[surface])
    fill_properties(geometry, surface, patch)
    patch.friction = table.friction[f]
    if patch.friction == patch.friction:
        patch.friction_map = -1  # a material's coefficient takes precedence
    stiffness = table.stiffness[f]
    if stiffness == stiffness:
        patch.stiffness_map, patch.compliance = -1, 1.0 / stiffness
    if texture >= 0:
        lower_steep(patch, facet_normal, geometry.texture_size[surface])
    elif fades:
        size = max(table.half[f, 0], table.half[f, 1])
        lower_steep(patch, facet_normal, _SMOOTH_RELIEF * size)
    if texture < 0 and patch.friction_map < 0 and patch.stiffness_map < 0:
        return
    patch.texture_top = table.top[f]
    for k in range(3):
        patch.texture_origin[k], patch.body_normal[k] = table.place[f, k], table.w[f, k]
        patch.texture_from_x[k], patch.texture_from_y[k] = (
            table.place[f, 3 + k],
            table.place[f, 6 + k],
        )
        patch.body_normal_from_x[k], patch.body_normal_from_y[k] = (
            table.w[f, 3 + k],
            table.w[f, 6 + k],
        )
    patch.map_min, patch.map_max = table.spread[f, 0], table.spread[f, 1]
    _fill_fold(geometry, surface, patch)
    if patch.mapping == TRIPLANAR:
        patch.map_start[0], patch.map_start[1] = (
            geometry.origin[surface, 0],
            geometry.origin[surface, 1],
        )


@inner_kernel
def _fill_fold(geometry, surface, patch):
    """Fill the shear of a facet by its texture, including the variation of its normal."""
    square = turn = 0.0
    for i in range(3):
        square += patch.normal[i] ** 2
        turn += patch.normal_from_x[i] ** 2 + patch.normal_from_y[i] ** 2
    sheared = geometry.rms_slope[surface] * patch.map_max * patch.normal_lateral
    sheared += geometry.texture_size[surface] * math.sqrt(turn / max(square, 1e-12))
    patch.fold = sheared / patch.lateral_min


@inner_kernel
def _fill_extent(table, f, patch):
    """Fill rectangle, borders and corners of a facet, and its extent in (u, v)."""
    half_x, half_y, rectangle = table.half[f, 0], table.half[f, 1], patch.rectangle
    rectangle[0], rectangle[1], rectangle[2], rectangle[3] = -half_x, half_x, -half_y, half_y
    count = table.count_rows[f]
    patch.rectangle_is_edge = count == 0
    patch.border_count = count
    for i in range(count):
        border = patch.borders[i]
        border.constant, border.from_x = table.rows[f, i, 0], table.rows[f, i, 1]
        border.from_y, border.is_edge = table.rows[f, i, 2], table.rows[f, i, 3] == 1.0
    patch.corner_count = count
    highest = -math.inf
    u0 = v0 = math.inf
    u1 = v1 = -math.inf
    for i in range(table.sides[f]):
        x, y = table.corners[f, i, 0], table.corners[f, i, 1]
        patch.corners[i, 0], patch.corners[i, 1] = x, y
        u, v = place_at(patch, x, y)
        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
        highest = max(highest, patch.slope[0] * x + patch.slope[1] * y)
    patch.base_top = patch.origin[2] + highest
    extent = patch.extent
    extent[0], extent[1], extent[2], extent[3] = u0, u1, v0, v1


@inner_kernel
def _fill_normal_bounds(table, f, patch):
    """Fill upper bounds of the lateral part and of the z component of a facet's unit normal.

    The normal before normalisation is linear, so both are largest at a corner of the rectangle.
    """
    n, n_x, n_y = patch.normal, patch.normal_from_x, patch.normal_from_y
    lateral, rise, least = 0.0, 0.0, table.least[f]
    for i in range(4):
        x = patch.rectangle[1] if i & 1 else patch.rectangle[0]
        y = patch.rectangle[3] if i & 2 else patch.rectangle[2]
        w_u, w_v = n[0] + n_x[0] * x + n_y[0] * y, n[1] + n_x[1] * x + n_y[1] * y
        lateral = max(lateral, math.sqrt(w_u * w_u + w_v * w_v))
        rise = max(rise, n[2] + n_x[2] * x + n_y[2] * y)
    patch.normal_min = least
    patch.normal_lateral, patch.normal_rise = min(lateral / least, 1.0), min(rise / least, 1.0)
