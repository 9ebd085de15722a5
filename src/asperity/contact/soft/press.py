"""All taxels of a skin at one pose: compressions, forces, wrench, stiffness and damping.

With X the exit of a taxel's ray from the other body, N the normal of the surface there and d the
ray's direction, the compression has the derivatives

    d(delta)/d(translation) = -m,   d(delta)/d(rotation) = -(r x m),   m = N / (N.d),   r = X - c,

so that the energy `U = sum a w(delta)` gives the force `p a m` at X, along the other surface's
normal. Its component along the ray is p a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel, kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.soft.blocks import BLOCK, NONE, near_geom
from asperity.contact.soft.exits import exit_of
from asperity.contact.soft.flat_blocks import RAY, fill_across, fill_sheet, leave_sheet
from asperity.contact.soft.mesh_exits import leave_mesh, normal_of_mesh
from asperity.contact.soft.sheets import CURVED, GRAZING, MESH, lift, sheet_at
from asperity.contact.soft.taxel_sums import add_taxel, clear_sums, complete_sums


@by_reference
class TaxelArrays(NamedTuple):
    """The taxels of a skin in the frame of its body; rows are taxels."""

    point: Array
    """On the textured surface [m], (n, 3)."""
    inwards: Array
    """Unit vector of the ray, (n, 3)."""
    along: Array
    """Unit vectors along columns and rows, perpendicular to the ray; (n, 2, 3)."""
    area: Array
    """Of the smooth surface [m^2], (n,)."""
    thickness: Array
    """Of the layer, along the ray [m], (n,)."""
    modulus: Array
    """K [Pa/m], (n,)."""
    block: NDArray[np.void]
    """`RAYS` records, one for each block of `BLOCK` taxels."""


@small_kernel
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
    """Fill the frame `pose` (3, 4) relative to each of the `frames` (n, 3, 4)."""
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
    """Return a taxel's compression, the geom, -1 for none, and its sheet, or facet of a mesh.

    Fills the ray's exit from that geom, and its direction, in the geom's frame (3,).
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
    """Fill a ray's exit from a geom, and m = N / (N.d) there, world axes, (3,) both.

    `ray` has the exit and the ray's direction in the geom's frame.
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
def _point_on_ray(taxels, t, depth, pose, point_out):
    """Fill the point on a taxel's ray at a depth, world axes (3,)."""
    point, inwards = taxels.point[t], taxels.inwards[t]
    for i in range(3):
        point_out[i] = pose[i, 3]
        for j in range(3):
            point_out[i] += pose[i, j] * (point[j] + depth * inwards[j])


@kernel
def press(solids, taxels, friction, pose, centre, twist, out):
    """Fill `out` at a pose of the skin's body.

    Parameters
    ----------
    solids : Solids
        The other bodies.
    taxels : TaxelArrays
    friction : float
        Coulomb's coefficient [-].
    pose : (3, 4) array
        Rotation and position of the skin's body.
    centre : (3,) array
        Reference point of torques, in the body's frame [m].
    twist : (6,) array
        Velocity of the centre [m/s] and angular velocity [rad/s], world axes.
    out : SkinOutput
    """
    frames = solids.frames
    origin = np.empty(3)
    relative = np.empty((frames.shape[0], 3, 4))
    m, best_x, best_d = np.empty(3), np.empty(3), np.empty(3)
    rows, gradients = np.empty((3, 4)), np.empty((3, 3))
    rays, active = np.empty(BLOCK + 1, RAY), np.empty(BLOCK, np.int64)
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
        geom, sheet = near_geom(solids, relative, taxels.block[block])
        if geom == NONE:
            continue
        first, last = block * BLOCK, min((block + 1) * BLOCK, total)
        many = last - first
        if sheet != CURVED:
            fill_sheet(solids, relative, geom, sheet, pose, rows, gradients)
            many = leave_sheet(solids, geom, rows, taxels, first, last, rays, active)
        for i in range(many):
            t = first + i
            if sheet != CURVED:
                ray = rays[active[i]]
                t, depth = ray.taxel, ray.s
                fill_across(ray, gradients, m)
                _point_on_ray(taxels, t, depth, pose, out.point[t])
            else:
                depth, hit, face = deepest(solids, relative, taxels, t, best_x, best_d)
                if hit < 0:
                    continue
                fill_exit(solids, hit, face, (best_x, best_d), out.point[t], m)
            out.pressed[count], out.compression[t] = t, depth
            count += 1
            out.energy[0] += add_taxel(t, taxels, friction, pose, origin, m, twist, out)
    out.pressed[total] = count
    complete_sums(out)


@kernel
def lay(solids, smooth, starts, facing, point_out, normal_out):
    """Fill the outermost point along `facing` of a body's textured surface over each start.

    Parameters
    ----------
    solids, smooth : Solids
        The geoms of the body, in its frame, with and without texture.
    starts : (n, 3) array
        Points behind the body, starts of lines along `facing`, its frame [m].
    facing : (3,) array
        Unit vector.
    point_out, normal_out : (n, 3) arrays
        The point, and the outward normal of the smooth surface; nan if there is none.
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
