"""The taxels of a surface with moving vertices: compressions, and forces on vertices and bodies.

A taxel has fixed barycentric coordinates beta in a triangle. With q = sum beta_i x_i, nu the unit
vector along `sum beta_i nu_i` of the normals at the corners, and h its texture's height, its ray
starts at q + h nu and goes along -nu. At its exit from the other body, X = q + (h - delta) nu, that
body's normal is N. With m = N / (N.(-nu)),

    d(delta) = -m . (sum beta_i dx_i + (h - delta) dnu),

so that the energy `U = sum a w(delta)`, a the area at rest, gives each vertex the force

    -dU/dx_i = sum p a (beta_i m + (h - delta) m . dnu/dx_i).

The normal of a corner is `a e1 + b e2 + c n`, e1 and e2 edges and n the normal of its triangle,
with coefficients from the state at rest; corners with a common normal at rest have the mean.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.layer import layer_pressure
from asperity.contact.soft.press import deepest, fill_exit, fill_relative, reaches
from asperity.contact.soft.taxel_sums import (
    SLIP_SPEED,
    add_taxel,
    clear_sums,
    complete_sums,
    take_across,
)

COLLAPSED = 1e-4
"""Smallest area of a triangle, as a fraction of that at rest."""


@inner_kernel
def _fill_triangle(surface, state, x, f):
    """Fill the normal of a triangle and its gradients, once a tick."""
    if state.known[f] == state.tick[0]:
        return
    state.known[f] = state.tick[0]
    n, side = state.normal[f], stack_array((3,))
    a, b, c = surface.faces[f, 0], surface.faces[f, 1], surface.faces[f, 2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        n[i] = (x[b, j] - x[a, j]) * (x[c, k] - x[a, k])
        n[i] -= (x[b, k] - x[a, k]) * (x[c, j] - x[a, j])
    twice = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if not twice > 2.0 * COLLAPSED * surface.area[f]:
        state.tick[1] = f
        twice = max(twice, 1e-300)
    for i in range(3):
        n[i] /= twice
    for corner in range(3):
        one, two = surface.faces[f, (corner + 1) % 3], surface.faces[f, (corner + 2) % 3]
        for i in range(3):
            side[i] = (x[two, i] - x[one, i]) / twice
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            state.hat[f, corner, i] = n[j] * side[k] - n[k] * side[j]


@inner_kernel
def _fill_shared(surface, state, x, g):
    """Fill a shared normal, once a tick."""
    if state.blended[g] == state.tick[0]:
        return
    state.blended[g] = state.tick[0]
    total, last = state.blend[g], state.used.size - 1
    state.used[state.used[last]] = g
    state.used[last] += 1
    for i in range(3):
        total[i] = state.pull[g, i] = 0.0
    for k in range(surface.first_member[g], surface.first_member[g + 1]):
        f, corner = divmod(surface.members[k], 3)
        _fill_triangle(surface, state, x, f)
        a, b, c = surface.faces[f, 0], surface.faces[f, 1], surface.faces[f, 2]
        tilt = surface.tilt[f, corner]
        for i in range(3):
            total[i] += tilt[0] * (x[b, i] - x[a, i]) + tilt[1] * (x[c, i] - x[a, i])
            total[i] += tilt[2] * state.normal[f, i]
    length = math.sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2])
    state.length[g] = max(length, 1e-12)
    for i in range(3):
        total[i] /= state.length[g]


@inner_kernel
def _is_near(solids, relative, surface, x, f):
    """Return whether a solid may touch a triangle."""
    middle = stack_array((3,))
    a, b, c = surface.faces[f, 0], surface.faces[f, 1], surface.faces[f, 2]
    one = two = three = 0.0
    for i in range(3):
        middle[i] = (x[a, i] + x[b, i] + x[c, i]) * (1.0 / 3.0)
        one += (x[a, i] - middle[i]) ** 2
        two += (x[b, i] - middle[i]) ** 2
        three += (x[c, i] - middle[i]) ** 2
    radius = math.sqrt(max(one, two, three))
    return reaches(solids, relative, middle, radius + surface.highest[f])


@inner_kernel
def _fill_ray(surface, state, x, f, t):
    """Fill ray and point of a taxel of triangle `f`; the point is on the smooth triangle before.

    Returns the length of its blended normal.
    """
    point, inwards = state.taxels.point[t], state.taxels.inwards[t]
    for i in range(3):
        inwards[i] = 0.0
        for corner in range(3):
            share = surface.weight[t, corner]
            inwards[i] -= share * state.blend[surface.shared[f, corner], i]
    length = math.sqrt(inwards[0] * inwards[0] + inwards[1] * inwards[1] + inwards[2] * inwards[2])
    length = max(length, 1e-12)
    for i in range(3):
        inwards[i] /= length
        point[i] -= surface.height[t] * inwards[i]
    return length


@inner_kernel
def _fill_shear_axes(surface, state, x, f, t):
    """Fill the axes of a taxel's shear: the first edge's part normal to the ray, and another."""
    along, d = state.taxels.along[t], state.taxels.inwards[t]
    a, b = surface.faces[f, 0], surface.faces[f, 1]
    part = square = 0.0
    for i in range(3):
        part += (x[b, i] - x[a, i]) * d[i]
    for i in range(3):
        along[0, i] = x[b, i] - x[a, i] - part * d[i]
        square += along[0, i] ** 2
    square = max(square, 1e-300)
    for i in range(3):
        along[0, i] /= math.sqrt(square)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        along[1, i] = along[0, j] * d[k] - along[0, k] * d[j]


@inner_kernel
def _slip(surface, motion, f, t, body, x, slip_out):
    """Fill the velocity of a taxel relative to the body at a point x, and zeros; (6,)."""
    twist, centre = motion.twists[body], motion.centres[body]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        slip_out[3 + i] = 0.0
        slip_out[i] = (
            -twist[i] - twist[3 + j] * (x[k] - centre[k]) + twist[3 + k] * (x[j] - centre[j])
        )
        for corner in range(3):
            slip_out[i] += (
                surface.weight[t, corner] * motion.velocities[surface.faces[f, corner], i]
            )


@inner_kernel
def _push_body(motion, state, out, t, body):
    """Add the force of a taxel to the wrench on a body."""
    force, x, centre = out.force[t], out.point[t], motion.centres[body]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        state.wrench[body, i] -= force[i]
        state.wrench[body, 3 + i] -= (x[j] - centre[j]) * force[k] - (x[k] - centre[k]) * force[j]


@inner_kernel
def _push_vertices(surface, state, out, f, t, m, length):
    """Add the force of a taxel to the vertices, and to the normals of the corners."""
    square = along = turned = 0.0
    for i in range(3):
        square += m[i] * m[i]
        along += out.force[t, i] * m[i]
        turned -= m[i] * state.taxels.inwards[t, i]
    # Friction is perpendicular to m.
    pushed = along / square * (surface.height[t] - out.compression[t]) / length
    for corner in range(3):
        share, g = surface.weight[t, corner], surface.shared[f, corner]
        for i in range(3):
            state.force[surface.faces[f, corner], i] += share * out.force[t, i]
            across = m[i] + turned * state.taxels.inwards[t, i]
            state.pull[g, i] += share * pushed * across


@small_kernel
def _add_product(one, two, factor, matrix_out):
    """Add `factor` a b^T of two rows of nine numbers to a matrix (9, 9)."""
    for i in range(9):
        part = factor * one[i]
        for j in range(9):
            matrix_out[i, j] += part * two[j]


@inner_kernel
def _add_blocks(surface, state, row, t, m, slip, springs):
    """Add stiffness and damping of a taxel to those of its triangle's vertices.

    `slip` (3,) is the slip velocity normal to m. `springs` has the stiffness along m [N/m],
    friction over the slip velocity [N s/m], and its relative increase with compression [1/m].
    """
    slope, drag, growth = springs
    square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    speed = SLIP_SPEED**2 + slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]
    across, along = stack_array((9,)), stack_array((9,))
    for corner in range(3):
        share = surface.weight[t, corner]
        for i in range(3):
            across[3 * corner + i], along[3 * corner + i] = share * m[i], share * slip[i]
    _add_product(across, across, slope, state.stiffness[row])
    if drag > 0.0:
        _add_product(along, across, -drag * growth, state.growing[row])
        _add_product(along, along, drag / speed, state.slipping[row])
        _add_product(across, across, -drag / square, state.damping[row])
        for one in range(3):
            for two in range(3):
                share = drag * surface.weight[t, one] * surface.weight[t, two]
                for i in range(3):
                    state.damping[row, 3 * one + i, 3 * two + i] += share


@inner_kernel
def _add_normal_forces(surface, state):
    """Add the forces on the vertices that are due to the normals."""
    last = state.used.size - 1
    for k in range(state.used[last]):
        g = state.used[k]
        pull, normal = state.pull[g], state.blend[g]
        along = pull[0] * normal[0] + pull[1] * normal[1] + pull[2] * normal[2]
        for i in range(3):
            pull[i] = (pull[i] - along * normal[i]) / state.length[g]
        for at in range(surface.first_member[g], surface.first_member[g + 1]):
            f, corner = divmod(surface.members[at], 3)
            a, b, c = (
                surface.tilt[f, corner, 0],
                surface.tilt[f, corner, 1],
                surface.tilt[f, corner, 2],
            )
            for one in range(3):
                hat, vertex = state.hat[f, one], surface.faces[f, one]
                turn = c * (pull[0] * hat[0] + pull[1] * hat[1] + pull[2] * hat[2])
                edge = -(a + b) if one == 0 else (a if one == 1 else b)
                for i in range(3):
                    state.force[vertex, i] += edge * pull[i] - turn * state.normal[f, i]


@inner_kernel
def _clear(surface, state, out):
    """Clear the forces of the last tick."""
    last = state.pressed.size - 1
    for row in range(state.pressed[last]):
        f = state.pressed[row]
        for t in range(surface.first[f], surface.first[f + 1]):
            out.compression[t] = 0.0
            for i in range(3):
                out.force[t, i] = out.traction[t, i] = 0.0
        for i in range(9):
            for j in range(9):
                state.stiffness[row, i, j] = state.damping[row, i, j] = 0.0
                state.slipping[row, i, j] = state.growing[row, i, j] = 0.0
    state.force[:] = 0.0
    state.wrench[:] = 0.0
    state.pressed[last] = 0
    state.used[state.used.size - 1] = 0
    state.tick[0] += 1
    state.tick[1] = -1
    clear_sums(out)
    out.pressed[out.pressed.size - 1] = 0


@kernel
def press_surface(solids, surface, friction, motion, state, out):
    """Fill `state` and `out` at a configuration of vertices and bodies.

    Parameters
    ----------
    solids : Solids
        The other bodies.
    surface : SurfaceArrays
    friction : float
        Coulomb's coefficient [-].
    motion : SurfaceMotion
    state : SurfaceState
    out : SkinOutput
        Wrench, stiffness and damping are those of the surface about the first of the bodies'
        centres.
    """
    x, taxels = motion.vertices, state.taxels
    relative, still = np.empty((solids.frames.shape[0], 3, 4)), np.zeros((3, 4))
    m, best_x, best_d = np.empty(3), np.empty(3), np.empty(3)
    slip = np.empty(6)
    for i in range(3):
        still[i, i] = 1.0
    fill_relative(solids.frames, still, relative)
    _clear(surface, state, out)
    last, count = state.pressed.size - 1, 0
    for f in range(surface.faces.shape[0]):
        if not _is_near(solids, relative, surface, x, f):
            continue
        row = -1
        for corner in range(3):
            _fill_shared(surface, state, x, surface.shared[f, corner])
        for t in range(surface.first[f], surface.first[f + 1]):
            point = taxels.point[t]
            for i in range(3):
                point[i] = 0.0
                for corner in range(3):
                    point[i] += surface.weight[t, corner] * x[surface.faces[f, corner], i]
            if not reaches(solids, relative, point, surface.highest[f]):
                continue
            length = _fill_ray(surface, state, x, f, t)
            depth, hit, face = deepest(solids, relative, taxels, t, best_x, best_d)
            if hit < 0:
                continue
            if row < 0:
                row = state.pressed[last]
                state.pressed[row] = f
                state.pressed[last] += 1
            out.pressed[count], out.compression[t] = t, depth
            count += 1
            _fill_shear_axes(surface, state, x, f, t)
            fill_exit(solids, hit, face, (best_x, best_d), out.point[t], m)
            body = solids.geometry.body[hit]
            _slip(surface, motion, f, t, body, out.point[t], slip)
            out.energy[0] += add_taxel(t, taxels, friction, still, motion.centres[0], m, slip, out)
            _push_body(motion, state, out, t, body)
            pressure, slope, _ = layer_pressure(taxels.modulus[t], taxels.thickness[t], depth)
            area = taxels.area[t]
            drag = take_across(slip, m, friction * pressure * area)
            _push_vertices(surface, state, out, f, t, m, length)
            springs = (slope * area, drag, slope / pressure)
            _add_blocks(surface, state, row, t, m, slip, springs)
    out.pressed[out.pressed.size - 1] = count
    _add_normal_forces(surface, state)
    complete_sums(out)
