"""Surface patches: the parts of a geom's textured surface that face the direction of contact.

The contact frame has its origin near the contact and axes (u, v, z); z points out of the body
under consideration: along n for the body B, along -n for the tool A. Seen along z, a convex geom
has one to three *patches* (up to three faces of a box), all of the same form:

    base(a) = O + P a + C r(a) z,      r(a) = sqrt(1 - a^T E a),      a = (x, y)  [m]
    w(a)    = V0 + V1 x + V2 y + V3 r(a)      outward normal, not always of unit length

Planes have C = 0. The side of a cylinder has E of rank one and `a` measures along and across its
axis; an ellipsoid has E of rank two and `a` is the lateral offset from its centre. So the base is
a height over (u, v) in closed form, and (u, v) is an affine function of `a`. The textured surface
is `p(a) = base(a) + t(a) w(a) / |w(a)|`, t the height of the texture.

A patch ends at the sides of a rectangle of (x, y) and at its borders,

    k0 + k1 x + k2 y + k3 r + k4 (x^2 + y^2) <= 0.

A border is either an edge of the body or a limit of the patch alone. Parts of the surface whose
normal has a z component below `FLATTEST` belong to no patch; textured planes: see `steep_plane`.

Patches are `PATCH` records, filled in every tick without allocation.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.steep_plane import FLATTEST, STEEPEST, lower_steep

PLANAR, CYLINDRICAL, TRIPLANAR = 0, 1, 2
"""Mappings of a texture onto a body."""

_UNBOUNDED = 1e3
"""Half side of a plane without a size [m]."""


@small_kernel
def entries(matrix):
    """Return the four entries of a (2, 2) matrix, row by row."""
    return matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1]


@inner_kernel
def singular_values(a, b, c, d):
    """Return the smallest and the largest singular value of [[a, b], [c, d]]."""
    s = 0.5 * (a * a + b * b + c * c + d * d)
    p = 0.5 * (a * a + b * b - c * c - d * d)
    r = math.sqrt(p * p + (a * c + b * d) ** 2)
    return math.sqrt(max(s - r, 0.0)), math.sqrt(s + r)


@inner_kernel
def fill_lateral(patch, a, b, c, d):
    """Fill the lateral map [[a, b], [c, d]] of a patch, its inverse and its singular values."""
    det = a * d - b * c
    lateral, inverse = patch.lateral, patch.lateral_inverse
    lateral[0, 0], lateral[0, 1], lateral[1, 0], lateral[1, 1] = a, b, c, d
    inverse[0, 0], inverse[0, 1] = d / det, -b / det
    inverse[1, 0], inverse[1, 1] = -c / det, a / det
    patch.lateral_min, patch.lateral_max = singular_values(a, b, c, d)


@small_kernel
def _along(axis, vector):
    """Return the component of a vector along an axis, a tuple."""
    return axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]


@inner_kernel
def _fill_texture_map(patch, frame, body, origin):
    """Fill a patch's base point and normal in the frame of its texture, and the map's bounds."""
    slope = patch.slope
    a, b, c, d = entries(patch.lateral)
    for axis in range(3):
        # An axis of the body in the contact frame.
        along_u = along_v = along_z = away = 0.0
        for world in range(3):
            along_u += body[world, axis] * frame[0, world]
            along_v += body[world, axis] * frame[1, world]
            along_z += body[world, axis] * frame[2, world]
            away += body[world, axis] * body[world, 3]
        turn = (along_u, along_v, along_z)
        patch.texture_origin[axis] = _along(turn, patch.origin)
        patch.texture_origin[axis] -= away
        if patch.mapping == PLANAR:
            patch.texture_origin[axis] -= origin[axis]
        patch.texture_from_x[axis] = along_u * a + along_v * c + along_z * slope[0]
        patch.texture_from_y[axis] = along_u * b + along_v * d + along_z * slope[1]
        patch.texture_from_root[axis] = along_z * patch.bulge
        patch.body_normal[axis] = _along(turn, patch.normal)
        patch.body_normal_from_x[axis] = _along(turn, patch.normal_from_x)
        patch.body_normal_from_y[axis] = _along(turn, patch.normal_from_y)
        patch.body_normal_from_root[axis] = _along(turn, patch.normal_from_root)
    from_x, from_y, from_root = patch.texture_from_x, patch.texture_from_y, patch.texture_from_root
    if patch.mapping == PLANAR:
        least, most = singular_values(from_x[0], from_y[0], from_x[1], from_y[1])
        patch.map_root = math.hypot(from_root[0], from_root[1])
    elif patch.mapping == TRIPLANAR:
        patch.map_start[0], patch.map_start[1] = origin[0], origin[1]
        # The largest singular value of the derivative of all three coordinates.
        xx = from_x[0] ** 2 + from_x[1] ** 2 + from_x[2] ** 2
        yy = from_y[0] ** 2 + from_y[1] ** 2 + from_y[2] ** 2
        xy = from_x[0] * from_y[0] + from_x[1] * from_y[1] + from_x[2] * from_y[2]
        half, gap = 0.5 * (xx + yy), 0.5 * (xx - yy)
        least, most = 0.0, math.sqrt(half + math.sqrt(gap * gap + xy * xy))
        patch.map_root = abs(patch.bulge)
    else:
        least, most = 0.0, max(1.0, patch.map_stretch)
        patch.map_root = abs(patch.lean)
    patch.map_min, patch.map_max = least, most


@inner_kernel
def _fill_derived(patch, frame, body, mapping, origin):
    """Fill the derived fields of a patch.

    `frame` (3, 3) has the axes u, v, z in its rows; `body` (3, 4) is the rotation of the body and,
    in its last column, its position relative to the contact frame's origin, both in world axes;
    `origin` (3,) is where the texture's (u, v) are zero, in the body's frame.
    """
    e11, e12, e22 = patch.ellipse[0], patch.ellipse[1], patch.ellipse[2]
    half, gap = 0.5 * (e11 + e22), 0.5 * (e11 - e22)
    root = math.sqrt(gap * gap + e12 * e12)
    patch.ellipse_min, patch.ellipse_max = max(half - root, 0.0), half + root
    i, j, k, m = entries(patch.lateral_inverse)
    q11 = i * (e11 * i + e12 * k) + k * (e12 * i + e22 * k)
    q12 = i * (e11 * j + e12 * m) + k * (e12 * j + e22 * m)
    q22 = j * (e11 * j + e12 * m) + m * (e12 * j + e22 * m)
    patch.ellipse_uv[0], patch.ellipse_uv[1], patch.ellipse_uv[2] = q11, q12, q22
    half, gap = 0.5 * (q11 + q22), 0.5 * (q11 - q22)
    patch.ellipse_uv_min = max(half - math.sqrt(gap * gap + q12 * q12), 0.0)
    is_plane, normal = patch.bulge == 0.0, patch.normal
    patch.is_level = (
        is_plane and abs(normal[0]) < 1e-12 and abs(normal[1]) < 1e-12 and patch.is_unit
    )
    patch.mapping = mapping
    patch.texture_top, patch.normal_min, patch.normal_rise = np.inf, 1.0, 1.0
    patch.normal_lateral = math.hypot(normal[0], normal[1]) if is_plane else 1.0
    if patch.texture >= 0 or patch.friction_map >= 0 or patch.stiffness_map >= 0:
        _fill_texture_map(patch, frame, body, origin)


@inner_kernel
def fill_properties(geometry, surface, patch):
    """Fill friction and stiffness of a patch from those of a surface."""
    laid = geometry.friction_map[surface]
    patch.friction, patch.friction_map = geometry.friction[surface], laid.map
    for k in range(2):
        patch.friction_scale[k], patch.friction_shift[k] = laid.scale[k], laid.shift[k]
    stiffness = geometry.stiffness[surface]
    patch.stiffness_map = geometry.stiffness_map[surface]
    patch.compliance = 1.0 / stiffness if stiffness == stiffness else 0.0


@inner_kernel
def _fill_round_properties(geometry, g, patch):
    """Fill friction and stiffness of a patch of a cylinder or capsule with a cylindrical map.

    Like textures, maps cover the side alone, and are stretched to close round it.
    """
    surface, stretch = geometry.surface[g], geometry.friction_around[g]
    fill_properties(geometry, surface, patch)
    patch.friction_scale[0] = stretch
    patch.friction_shift[0] += (stretch - 1.0) * geometry.origin[surface, 0]
    if patch.radius == 0.0:
        patch.friction_map = patch.stiffness_map = -1


@inner_kernel
def _set_rectangle(patch, half_x, half_y, is_edge):
    rectangle = patch.rectangle
    rectangle[0], rectangle[1], rectangle[2], rectangle[3] = -half_x, half_x, -half_y, half_y
    patch.rectangle_is_edge = is_edge


@inner_kernel
def add_border(patch, constant, from_x, from_y, from_root, from_square, is_edge):
    """Add a border to a patch; see `BORDER`."""
    border = patch.borders[patch.border_count]
    border.constant, border.from_x, border.from_y = constant, from_x, from_y
    border.from_root, border.from_square, border.is_edge = from_root, from_square, is_edge
    patch.border_count += 1


@inner_kernel
def stretch_plane(patch, reach):
    """Extend a level plane patch, a rectangle or a disc, beyond its edges by `reach` [m]."""
    rectangle = patch.rectangle
    for side in range(4):
        rectangle[side] += reach if side & 1 else -reach
    if patch.border_count == 1:
        radius = rectangle[1]
        patch.borders[0].constant, patch.borders[0].from_square = -0.5 * radius, 0.5 / radius


@inner_kernel
def _fill_plane(patch, centre, x, y, normal, half_x, half_y, is_edge):
    """Fill a flat patch: centre, axes and unit normal in the contact frame."""
    clear_record(patch)
    for i in range(3):
        patch.origin[i] = centre[i]
        patch.normal[i] = normal[i]
    fill_lateral(patch, x[0], y[0], x[1], y[1])
    patch.slope[0], patch.slope[1] = x[2], y[2]
    patch.is_unit, patch.aspect = True, 1.0
    patch.min_root = 0.5
    patch.base_top = centre[2] + abs(x[2]) * half_x + abs(y[2]) * half_y
    _set_rectangle(patch, half_x, half_y, is_edge)


@inner_kernel
def _fill_ellipsoid(patch, centre, axes, semi):
    """Fill the upper half of an ellipsoid; `axes` (3, 3) has its axes in columns.

    With `A = axes diag(semi^2) axes^T` its surface is `x^T A^-1 x = 1` round the centre.
    """
    clear_record(patch)
    a = stack_array((3, 3))
    inverse = stack_array((3, 3))
    for i in range(3):
        for j in range(3):
            total = reverse = 0.0
            for k in range(3):
                total += axes[i, k] * axes[j, k] * semi[k] * semi[k]
                reverse += axes[i, k] * axes[j, k] / (semi[k] * semi[k])
            a[i, j], inverse[i, j] = total, reverse
    det = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    e11, e12, e22 = a[1, 1] / det, -a[0, 1] / det, a[0, 0] / det
    g1, g2 = e11 * a[0, 2] + e12 * a[1, 2], e12 * a[0, 2] + e22 * a[1, 2]
    cap = math.sqrt(max(a[2, 2] - g1 * a[0, 2] - g2 * a[1, 2], 0.0))
    patch.ellipse[0], patch.ellipse[1], patch.ellipse[2] = e11, e12, e22
    patch.slope[0], patch.slope[1], patch.bulge = g1, g2, cap
    fill_lateral(patch, 1.0, 0.0, 0.0, 1.0)
    least, most = min(semi[0], semi[1], semi[2]), max(semi[0], semi[1], semi[2])
    for i in range(3):
        patch.origin[i] = centre[i]
        # The gradient of x^T A^-1 x, times a length that makes it unit length on a sphere.
        patch.normal_from_x[i] = most * (inverse[i, 0] + inverse[i, 2] * g1)
        patch.normal_from_y[i] = most * (inverse[i, 1] + inverse[i, 2] * g2)
        patch.normal_from_root[i] = most * inverse[i, 2] * cap
    patch.base_top = centre[2] + math.sqrt(a[2, 2])
    patch.is_unit = most - least <= 1e-12 * most
    patch.aspect = most / least
    patch.min_root = FLATTEST
    reach = math.sqrt(1.0 - FLATTEST * FLATTEST)
    half_u, half_v = reach * math.sqrt(a[0, 0]), reach * math.sqrt(a[1, 1])
    _set_rectangle(patch, half_u, half_v, False)


@inner_kernel
def _fill_cylinder_side(patch, centre, radius, half, is_edge, axes):
    """Fill the side of a cylinder or capsule around its third axis; `axes` (3, 3) has columns.

    The map's angle is from the first axis towards the second. Returns whether the side faces z.
    """
    ref_x, ref_y, k = axes[:, 0], axes[:, 1], axes[:, 2]
    cosine = math.sqrt(max(1.0 - k[2] * k[2], 0.0))
    if cosine <= FLATTEST:
        return False
    clear_record(patch)
    e_r = (-k[2] * k[0] / cosine, -k[2] * k[1] / cosine, cosine)
    e_y = (-k[1] / cosine, k[0] / cosine, 0.0)  # perpendicular to both, and level
    lean = radius * k[2] / cosine
    for i in range(3):
        patch.origin[i] = centre[i]
        patch.normal_from_y[i], patch.normal_from_root[i] = e_y[i] / radius, e_r[i]
    fill_lateral(patch, k[0], e_y[0], k[1], e_y[1])
    patch.slope[0] = k[2]
    patch.bulge = radius / cosine
    patch.ellipse[2] = 1.0 / (radius * radius)
    patch.is_unit, patch.aspect = True, 1.0
    patch.min_root = FLATTEST / cosine
    patch.base_top = centre[2] + abs(k[2]) * half + radius * cosine
    reach = radius * math.sqrt(max(1.0 - patch.min_root**2, 0.0))
    _set_rectangle(patch, half + abs(lean), reach, False)
    add_border(patch, -half, 1.0, 0.0, lean, 0.0, is_edge)
    add_border(patch, -half, -1.0, 0.0, -lean, 0.0, is_edge)
    # The angle of e_r around the axis, where y = 0, and the sense in which it grows with y.
    along_x = _along(e_r, ref_x)
    along_y = _along(e_r, ref_y)
    turned_x = e_y[0] * ref_x[0] + e_y[1] * ref_x[1]
    turned_y = e_y[0] * ref_y[0] + e_y[1] * ref_y[1]
    patch.radius, patch.map_start[0] = radius, radius * math.atan2(along_y, along_x)
    patch.map_sense = 1.0 if along_x * turned_y - along_y * turned_x > 0.0 else -1.0
    patch.lean = lean
    return True


@small_kernel
def _fill_fold(patch, rms_slope):
    """Fill the shear of a patch by its texture at its least inclination, where contact occurs."""
    lean = patch.normal_lateral
    if patch.bulge > 0.0:  # a cylinder's side, or part of an ellipsoid
        lean = abs(patch.slope[0]) if patch.ellipse[0] == 0.0 else 0.0
    patch.fold = rms_slope * lean / patch.lateral_min


@inner_kernel
def fill_patches(geometry, g, place, axes, frame, body, patches_out, first):
    """Fill the patches of one geom into `patches_out[first:]`; return the new number of patches.

    Parameters
    ----------
    geometry : Geometry
    g : int
        The geom.
    place : (3,) array
        Its centre in the contact frame [m].
    axes : (3, 3) array
        Its axes in the contact frame, in columns.
    frame : (3, 3) array
        Axes u, v, z of the contact frame in its rows, world axes.
    body : (3, 4) array
        Rotation of its body, and position relative to the contact frame's origin, world axes.
    """
    kind, size, surface = geometry.kind[g], geometry.size[g], geometry.surface[g]
    texture, mapping = geometry.texture[surface], geometry.mapping[surface]
    origin = geometry.origin[surface]
    x, y, z = axes[:, 0], axes[:, 1], axes[:, 2]
    at = first
    if kind == 0 and z[2] >= FLATTEST:
        half_x = size[0] if size[0] > 0.0 else _UNBOUNDED
        half_y = size[1] if size[1] > 0.0 else _UNBOUNDED
        _fill_plane(patches_out[at], place, x, y, z, half_x, half_y, True)
        patches_out[at].texture = texture
        at += 1
    elif kind == 1 or kind == 3:
        semi = (size[0], size[0], size[0]) if kind == 1 else (size[0], size[1], size[2])
        _fill_ellipsoid(patches_out[at], place, axes, semi)
        patches_out[at].texture = texture
        at += 1
    elif kind == 2 or kind == 4:
        # A cylindrical map covers the side alone, which then ends in an edge on a capsule too.
        on_ends = -1 if mapping == CYLINDRICAL else texture
        has_map = texture >= 0 or geometry.stiffness_map[surface] >= 0
        is_edge = kind == 4 or (mapping == CYLINDRICAL and has_map)
        if _fill_cylinder_side(patches_out[at], place, size[0], size[1], is_edge, axes):
            patch, around = patches_out[at], geometry.around[g]
            patch.map_start[0] = patch.map_start[0] * around - origin[0]
            patch.map_start[1] -= origin[1]
            patch.map_stretch = around
            patch.texture = texture
            at += 1
        for end in (-1.0, 1.0):
            centre = stack_array((3,))
            for i in range(3):
                centre[i] = place[i] + end * size[1] * z[i]
            if kind == 4 and end * z[2] >= (STEEPEST if on_ends >= 0 else FLATTEST):
                normal = stack_array((3,))
                for i in range(3):
                    normal[i] = end * z[i]
                _fill_plane(patches_out[at], centre, x, y, normal, size[0], size[0], False)
                add_border(patches_out[at], -0.5 * size[0], 0.0, 0.0, 0.0, 0.5 / size[0], True)
                patches_out[at].base_top = centre[2] + size[0] * math.hypot(x[2], y[2])
                patches_out[at].texture = on_ends
                at += 1
            elif kind == 2:
                semi = (size[0], size[0], size[0])
                _fill_ellipsoid(patches_out[at], centre, axes, semi)
                add_border(
                    patches_out[at], 0.0, -end * z[0], -end * z[1], -end * z[2] * size[0], 0.0,
                    is_edge,
                )  # fmt: skip
                if end * z[2] < 0.0:  # the top of the sphere is beyond the border
                    rim = size[0] * math.sqrt(max(1.0 - z[2] * z[2], 0.0))
                    patches_out[at].base_top = centre[2] + rim
                patches_out[at].texture = on_ends
                at += 1
    elif kind == 5:
        for axis in range(3):
            up = axes[2, axis]
            if abs(up) >= (STEEPEST if texture >= 0 else FLATTEST):
                sign = 1.0 if up > 0.0 else -1.0
                normal, centre = stack_array((3,)), stack_array((3,))
                for i in range(3):
                    normal[i] = sign * axes[i, axis]
                    centre[i] = place[i] + size[axis] * normal[i]
                one, two = (axis + 1) % 3, (axis + 2) % 3
                _fill_plane(
                    patches_out[at], centre, axes[:, one], axes[:, two], normal, size[one],
                    size[two], True,
                )  # fmt: skip
                patches_out[at].texture = texture
                at += 1
    for i in range(first, at):
        if mapping == CYLINDRICAL:
            _fill_round_properties(geometry, g, patches_out[i])
        else:
            fill_properties(geometry, surface, patches_out[i])
        _fill_derived(patches_out[i], frame, body, mapping, origin)
        _fill_fold(patches_out[i], geometry.rms_slope[surface])
        if patches_out[i].bulge == 0.0 and patches_out[i].texture >= 0:
            lower_steep(patches_out[i], patches_out[i].normal, geometry.texture_size[surface])
    return at
