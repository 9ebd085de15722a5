"""All taxels of a skin at one pose: compressions, forces, wrench, stiffness and damping.

With X the place where a taxel's ray leaves the other surface, N the normal of that surface there
and d the ray's direction, a motion of the skin changes the compression by

    d(delta)/d(translation) = -m,   d(delta)/d(rotation) = -(r x m),   m = N / (N.d),   r = X - c,

so that the energy `U = sum a w(delta)` gives the force `p a m` at X: along the other surface's
normal, and p a along the ray.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import inner_kernel, kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.exits import exit_of
from asperity.contact.soft.layer import layer_pressure
from asperity.contact.soft.mesh_exits import leave_mesh, normal_of_mesh
from asperity.contact.soft.sheets import MESH, lift, sheet_at

SLIP_SPEED = 5e-3
"""Speed v0 of the regularised friction [m/s]; project default."""
GRAZING = 1e-3
"""Least cosine between a ray and a normal with which a force is computed."""


BLOCK = 64
"""Taxels that are left out together, where no solid is near them."""


class TaxelArrays(NamedTuple):
    """The taxels of a skin in the frame of its body; a row a taxel."""

    point: Array
    """On the textured surface [m], (n, 3)."""
    inwards: Array
    """Unit vector of the ray, (n, 3)."""
    along: Array
    """Unit vectors along columns and rows, across the ray; (n, 2, 3)."""
    area: Array
    """Of the smooth surface [m^2], (n,)."""
    thickness: Array
    """Of the layer, along the ray [m], (n,)."""
    modulus: Array
    """K [Pa/m], (n,)."""
    block: Array
    """Middle and radius of a ball round the rays of each `BLOCK` taxels [m], (blocks, 4)."""


class SkinOutput(NamedTuple):
    """What is computed at a pose; rows are taxels."""

    compression: Array
    """[m], (n,)"""
    traction: Array
    """Force over area: along the ray, and along columns and rows [Pa], (n, 3)."""
    force: Array
    """[N], world axes, (n, 3)."""
    point: Array
    """Where the force acts [m], world axes, (n, 3); only of taxels in contact."""
    pressed: Indices
    """Numbers of the taxels in contact, and as the last entry how many there are, (n + 1,)."""
    push: Array
    """Sum of the forces' sizes [N], of these times their places [N m], and the largest compression
    [m], (5,)."""
    wrench: Array
    """(6,) [N, N m]"""
    stiffness: Array
    """(6, 6)"""
    damping: Array
    """(6, 6)"""
    damped: Array
    """Part of the wrench that is friction, (6,)."""
    energy: Array
    """U [J], (1,)."""


def empty_output(taxels: int) -> SkinOutput:
    """Allocate room for what is computed of a number of taxels."""
    n = taxels
    return SkinOutput(
        np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)),
        np.zeros(n + 1, np.int64), np.zeros(5), np.zeros(6), np.zeros((6, 6)),
        np.zeros((6, 6)), np.zeros(6), np.zeros(1),
    )  # fmt: skip


@inner_kernel
def take_across(slip, m, most):
    """Leave of a slip velocity (3,) what is across m; return friction over it [N s/m].

    `most` is the coefficient times p a [N].
    """
    square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    along = (slip[0] * m[0] + slip[1] * m[1] + slip[2] * m[2]) / square
    speed = SLIP_SPEED * SLIP_SPEED
    for i in range(3):
        slip[i] -= along * m[i]
        speed += slip[i] * slip[i]
    return most * math.sqrt(square / speed)


@inner_kernel
def _add_friction(t, most, m, arm, twist, out):
    """Add the friction of a taxel and its damping; `most` is the coefficient times p a [N]."""
    slip, jacobian = stack_array((3,)), stack_array((6,))
    rx, ry, rz = arm
    square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    slip[0] = twist[0] + twist[4] * rz - twist[5] * ry
    slip[1] = twist[1] + twist[5] * rx - twist[3] * rz
    slip[2] = twist[2] + twist[3] * ry - twist[4] * rx
    drag = take_across(slip, m, most)
    fx, fy, fz = -drag * slip[0], -drag * slip[1], -drag * slip[2]
    out.force[t, 0] += fx
    out.force[t, 1] += fy
    out.force[t, 2] += fz
    out.damped[0] += fx
    out.damped[1] += fy
    out.damped[2] += fz
    out.damped[3] += ry * fz - rz * fy
    out.damped[4] += rz * fx - rx * fz
    out.damped[5] += rx * fy - ry * fx
    # In all directions less that of the normal.
    _add_spring(m, arm, -drag / square, jacobian, out.damping)
    for axis in range(3):
        for i in range(3):
            slip[i] = 1.0 if i == axis else 0.0
        _add_spring(slip, arm, drag, jacobian, out.damping)


@small_kernel
def _add_spring(direction, arm, stiffness, jacobian, matrix_out):
    """Add `stiffness` J J^T to the lower triangle of a matrix, J = (direction, arm x direction)."""
    rx, ry, rz = arm
    for i in range(3):
        jacobian[i] = direction[i]
    jacobian[3] = ry * direction[2] - rz * direction[1]
    jacobian[4] = rz * direction[0] - rx * direction[2]
    jacobian[5] = rx * direction[1] - ry * direction[0]
    for i in range(6):
        for j in range(i + 1):
            matrix_out[i, j] += stiffness * jacobian[i] * jacobian[j]


@inner_kernel
def reaches(solids, relative, x, radius):
    """Return whether a solid may come within a distance of a point (3,) of the skin's frame [m]."""
    for g in range(relative.shape[0]):
        far = 0.0
        for i in range(3):
            along = relative[g, i, 3]
            for j in range(3):
                along += relative[g, i, j] * x[j]
            far += along * along
        if far <= (solids.bound[g] + radius) ** 2:
            return True
    return False


@inner_kernel
def fill_relative(frames, pose, relative_out):
    """Fill the frame `pose` (3, 4) as it is seen from each of the `frames` (n, 3, 4)."""
    for g in range(frames.shape[0]):
        for i in range(3):
            for j in range(4):
                total = 0.0
                for k in range(3):
                    value = pose[k, j] - (frames[g, k, 3] if j == 3 else 0.0)
                    total += frames[g, k, i] * value
                relative_out[g, i, j] = total


@inner_kernel
def deepest(solids, relative, taxels, t, x_out, d_out):
    """Return how far a taxel is pressed in, by which geom, -1 for none, and by which sheet of it.

    Of a mesh: by which facet.

    Fills where the ray leaves that geom, and the ray's direction, in the geom's frame (3,).
    """
    depth, hit, face, thickness = 0.0, -1, 0, taxels.thickness[t]
    x, d = stack_array((3,)), stack_array((3,))
    for g in range(relative.shape[0]):
        for i in range(3):
            x[i], d[i] = relative[g, i, 3], 0.0
            for j in range(3):
                x[i] += relative[g, i, j] * taxels.point[t, j]
                d[i] += relative[g, i, j] * taxels.inwards[t, j]
        if solids.geometry.kind[g] == MESH:
            s, by = leave_mesh(solids.meshes, solids, g, x, d, thickness)
        else:
            s, by = exit_of(solids, g, x, d, thickness)
        if s > depth and s < 2.0 * thickness:
            depth, hit, face = s, g, by
            for i in range(3):
                x_out[i], d_out[i] = x[i] + s * d[i], d[i]
    return depth, hit, face


@inner_kernel
def fill_exit(solids, g, face, ray, point_out, m_out):
    """Fill the place where a ray leaves a geom, and m = N / (N.d) there, world axes, (3,) both.

    `ray`: that place and the ray's direction in the geom's frame.
    """
    x, d = ray
    normal, frame = stack_array((3,)), solids.frames[g]
    if solids.geometry.kind[g] == MESH:
        normal_of_mesh(solids.meshes, solids, g, face, x, normal)
    else:
        sheet_at(solids, g, face, x, normal)
    rate = max(normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2], GRAZING)
    for i in range(3):
        m_out[i], point_out[i] = 0.0, frame[i, 3]
        for j in range(3):
            m_out[i] += frame[i, j] * normal[j] / rate
            point_out[i] += frame[i, j] * x[j]


@inner_kernel
def clear_sums(out):
    """Set wrench, stiffness, damping, energy and push to 0."""
    for i in range(6):
        out.wrench[i] = out.damped[i] = 0.0
        for j in range(6):
            out.stiffness[i, j] = out.damping[i, j] = 0.0
    for i in range(5):
        out.push[i] = 0.0
    out.energy[0] = 0.0


@inner_kernel
def complete_sums(out):
    """Add friction to the wrench, and mirror the lower triangles of stiffness and damping."""
    for i in range(6):
        out.wrench[i] += out.damped[i]
        for j in range(i):
            out.stiffness[j, i] = out.stiffness[i, j]
            out.damping[j, i] = out.damping[i, j]


@inner_kernel
def add_taxel(t, taxels, friction, pose, origin, m, twist, out):
    """Add the pressure and friction of a taxel that is pressed in; return its energy [J].

    `origin` (3,) is the point about which torques are, world axes.
    """
    jacobian = stack_array((6,))
    area, thickness = taxels.area[t], taxels.thickness[t]
    pressure, slope, stored = layer_pressure(taxels.modulus[t], thickness, out.compression[t])
    rx = out.point[t, 0] - origin[0]
    ry = out.point[t, 1] - origin[1]
    rz = out.point[t, 2] - origin[2]
    _add_spring(m, (rx, ry, rz), slope * area, jacobian, out.stiffness)
    for i in range(6):
        out.wrench[i] += pressure * area * jacobian[i]
    for i in range(3):
        out.force[t, i] = pressure * area * m[i]
    if friction > 0.0:
        _add_friction(t, friction * pressure * area, m, (rx, ry, rz), twist, out)
    size = 0.0
    for i in range(3):
        size += out.force[t, i] ** 2
        for j in range(3):
            turned = (
                pose[i, 0] * taxels.inwards[t, 0] + pose[i, 1] * taxels.inwards[t, 1]
                + pose[i, 2] * taxels.inwards[t, 2]
                if j == 0
                else pose[i, 0] * taxels.along[t, j - 1, 0]
                + pose[i, 1] * taxels.along[t, j - 1, 1]
                + pose[i, 2] * taxels.along[t, j - 1, 2]
            )  # fmt: skip
            out.traction[t, j] += out.force[t, i] * turned / area
    size = math.sqrt(size)
    out.push[0] += size
    for i in range(3):
        out.push[1 + i] += size * out.point[t, i]
    out.push[4] = max(out.push[4], out.compression[t])
    return area * stored


@kernel
def press(solids, taxels, friction, pose, centre, twist, out):
    """Fill `out` at a pose of the skin's body.

    Parameters
    ----------
    solids : Solids
        What the skin meets.
    taxels : TaxelArrays
    friction : float
        Coulomb's coefficient [-].
    pose : (3, 4) array
        Rotation and position of the skin's body.
    centre : (3,) array
        About which torques are, in the body's frame [m].
    twist : (6,) array
        Velocity of the centre [m/s] and angular velocity [rad/s], world axes.
    out : SkinOutput
    """
    frames = solids.frames
    origin = np.empty(3)
    relative = np.empty((frames.shape[0], 3, 4))
    m, best_x, best_d = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        origin[i] = pose[i, 3]
        for j in range(3):
            origin[i] += pose[i, j] * centre[j]
    fill_relative(frames, pose, relative)
    clear_sums(out)
    total = taxels.area.size
    for i in range(out.pressed[total]):
        t = out.pressed[i]
        out.compression[t] = 0.0
        for k in range(3):
            out.traction[t, k] = out.force[t, k] = 0.0
    count = 0
    for block in range(taxels.block.shape[0]):
        if not reaches(solids, relative, taxels.block[block, :3], taxels.block[block, 3]):
            continue
        for t in range(block * BLOCK, min((block + 1) * BLOCK, total)):
            depth, hit, face = deepest(solids, relative, taxels, t, best_x, best_d)
            if hit < 0:
                continue
            out.pressed[count], out.compression[t] = t, depth
            count += 1
            fill_exit(solids, hit, face, (best_x, best_d), out.point[t], m)
            out.energy[0] += add_taxel(t, taxels, friction, pose, origin, m, twist, out)
    out.pressed[total] = count
    complete_sums(out)


@kernel
def lay(solids, smooth, starts, facing, point_out, normal_out):
    """Find the outermost point along `facing` of a body's textured surface over each start.

    Parameters
    ----------
    solids, smooth : Solids
        The geoms of the body, in its frame, with and without texture.
    starts : (n, 3) array
        Points behind the body, from which lines along `facing` go, its frame [m].
    facing : (3,) array
        Unit vector.
    point_out, normal_out : (n, 3) arrays
        The point, and the outward normal of the smooth surface; nan where there is none.
    """
    x, d, normal, frames = np.empty(3), np.empty(3), np.empty(3), solids.frames
    for t in range(starts.shape[0]):
        farthest = -np.inf
        for i in range(3):
            point_out[t, i] = normal_out[t, i] = np.nan
        for g in range(frames.shape[0]):
            for i in range(3):
                x[i] = d[i] = 0.0
                for j in range(3):
                    d[i] += frames[g, j, i] * facing[j]
                    x[i] += frames[g, j, i] * (starts[t, j] - frames[g, j, 3])
            s, face = exit_of(smooth, g, x, d, np.inf)
            if s <= max(farthest, 0.0):
                continue
            farthest = s
            for i in range(3):
                x[i] += s * d[i]
            lift(solids, g, face, x, normal)
            for i in range(3):
                point_out[t, i], normal_out[t, i] = frames[g, i, 3], 0.0
                for j in range(3):
                    point_out[t, i] += frames[g, i, j] * x[j]
                    normal_out[t, i] += frames[g, i, j] * normal[j]
