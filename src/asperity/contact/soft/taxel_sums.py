"""Sums over the taxels in contact: wrench, stiffness, damping and energy.

A taxel's compression changes by `-J . motion`, J = (m, r x m), so its stiffness is `p' a J J^T`.
Friction is perpendicular to m. With q, friction over slip velocity, its damping is that in all
directions minus that along m,

    q (sum over axes e of E E^T) - q / m^2 J J^T,    E = (e, r x e).

The first sum follows from those of q, q r and q r r^T over all taxels, ten numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import clear, inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.soft.layer import layer_pressure

SLIP_SPEED = 5e-3
"""Speed v0 of the regularised friction [m/s]; project default."""


@by_reference
class SkinOutput(NamedTuple):
    """Results at a pose; rows are taxels."""

    compression: Array
    """[m], (n,)"""
    traction: Array
    """Force over area: along the ray, and along columns and rows [Pa], (n, 3)."""
    force: Array
    """[N], world axes, (n, 3)."""
    point: Array
    """Point of application of the force [m], world axes, (n, 3); valid for taxels in contact."""
    pressed: Indices
    """Numbers of the taxels in contact; the last entry is their count, (n + 1,)."""
    push: Array
    """Sum of the forces' magnitudes [N], of these times their points [N m], the largest compression
    [m] and the largest strain [-], (6,)."""
    wrench: Array
    """(6,) [N, N m]"""
    stiffness: Array
    """(6, 6)"""
    damping: Array
    """(6, 6)"""
    damped: Array
    """Friction's part of the wrench, (6,)."""
    energy: Array
    """U [J], (1,)."""
    drag: Array
    """Sums of q [N s/m], of x, y, z of q r and xx, xy, yy, xz, yz, zz of q r r^T, (10,)."""


def empty_output(taxels: int) -> SkinOutput:
    """Allocate the results of a number of taxels."""
    n = taxels
    return SkinOutput(
        np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)),
        np.zeros(n + 1, np.int64), np.zeros(6), np.zeros(6), np.zeros((6, 6)),
        np.zeros((6, 6)), np.zeros(6), np.zeros(1), np.zeros(10),
    )  # fmt: skip


@inner_kernel
def take_across(slip, m, most):
    """Project a slip velocity (3,) perpendicular to m; return friction over it [N s/m].

    `most` is the coefficient times p a [N].
    """
    square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    along = (slip[0] * m[0] + slip[1] * m[1] + slip[2] * m[2]) / square
    speed = SLIP_SPEED * SLIP_SPEED
    for i in range(3):
        slip[i] -= along * m[i]
        speed += slip[i] * slip[i]
    return most * math.sqrt(square / speed)


@small_kernel
def _add_square(jacobian, share, matrix_out):
    """Add `share` J J^T to the lower triangle of a matrix (6, 6)."""
    for i in range(6):
        part = share * jacobian[i]
        for j in range(i + 1):
            matrix_out[i, j] += part * jacobian[j]


@inner_kernel
def _friction_damping(most, m, arm, twist, slip):
    """Return the friction of a taxel over its slip velocity [N s/m]; fill that velocity (3,)."""
    rx, ry, rz = arm
    slip[0] = twist[0] + twist[4] * rz - twist[5] * ry
    slip[1] = twist[1] + twist[5] * rx - twist[3] * rz
    slip[2] = twist[2] + twist[3] * ry - twist[4] * rx
    return take_across(slip, m, most)


@small_kernel
def _add_drag(drag, arm, sums_out):
    """Add the drag of a taxel to `SkinOutput.drag`."""
    rx, ry, rz = arm
    qx, qy, qz = drag * rx, drag * ry, drag * rz
    sums_out[0] += drag
    sums_out[1] += qx
    sums_out[2] += qy
    sums_out[3] += qz
    sums_out[4] += qx * rx
    sums_out[5] += qx * ry
    sums_out[6] += qy * ry
    sums_out[7] += qx * rz
    sums_out[8] += qy * rz
    sums_out[9] += qz * rz


@inner_kernel
def add_taxel(t, taxels, friction, pose, origin, m, twist, out):
    """Add the pressure and friction of a taxel in contact; return its energy [J].

    `origin` (3,) is the reference point of torques, world axes.
    """
    jacobian, slip = stack_array((6,)), stack_array((3,))
    area = taxels.area[t]
    pressure, slope, stored = layer_pressure(
        taxels.modulus[t], taxels.thickness[t], out.compression[t]
    )
    x, y, z = out.point[t, 0], out.point[t, 1], out.point[t, 2]
    rx, ry, rz = x - origin[0], y - origin[1], z - origin[2]
    jacobian[0], jacobian[1], jacobian[2] = m[0], m[1], m[2]
    jacobian[3] = ry * m[2] - rz * m[1]
    jacobian[4] = rz * m[0] - rx * m[2]
    jacobian[5] = rx * m[1] - ry * m[0]
    push = pressure * area
    for i in range(6):
        out.wrench[i] += push * jacobian[i]
    _add_square(jacobian, slope * area, out.stiffness)
    fx, fy, fz = push * m[0], push * m[1], push * m[2]
    if friction > 0.0:
        drag = _friction_damping(friction * push, m, (rx, ry, rz), twist, slip)
        sx, sy, sz = -drag * slip[0], -drag * slip[1], -drag * slip[2]
        fx, fy, fz = fx + sx, fy + sy, fz + sz
        out.damped[0] += sx
        out.damped[1] += sy
        out.damped[2] += sz
        out.damped[3] += ry * sz - rz * sy
        out.damped[4] += rz * sx - rx * sz
        out.damped[5] += rx * sy - ry * sx
        square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
        _add_square(jacobian, -drag / square, out.damping)
        _add_drag(drag, (rx, ry, rz), out.drag)
    out.force[t, 0], out.force[t, 1], out.force[t, 2] = fx, fy, fz
    # Over the area, in the skin's frame.
    over = 1.0 / area
    qx = over * (pose[0, 0] * fx + pose[1, 0] * fy + pose[2, 0] * fz)
    qy = over * (pose[0, 1] * fx + pose[1, 1] * fy + pose[2, 1] * fz)
    qz = over * (pose[0, 2] * fx + pose[1, 2] * fy + pose[2, 2] * fz)
    inwards, along = taxels.inwards[t], taxels.along[t]
    out.traction[t, 0] = inwards[0] * qx + inwards[1] * qy + inwards[2] * qz
    for j in range(2):
        out.traction[t, 1 + j] = along[j, 0] * qx + along[j, 1] * qy + along[j, 2] * qz
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    out.push[0] += size
    out.push[1] += size * x
    out.push[2] += size * y
    out.push[3] += size * z
    out.push[4] = max(out.push[4], out.compression[t])
    out.push[5] = max(out.push[5], out.compression[t] / taxels.thickness[t])
    return area * stored


@inner_kernel
def clear_sums(out):
    """Set wrench, stiffness, damping, energy and push to 0."""
    for i in range(6):
        clear(out.stiffness[i])
        clear(out.damping[i])
    clear(out.wrench)
    clear(out.damped)
    clear(out.push)
    clear(out.drag)
    out.energy[0] = 0.0


@inner_kernel
def complete_sums(out):
    """Add friction to the wrench, its isotropic part to the damping; symmetrise both matrices."""
    drag, damping = out.drag, out.damping
    xx, yy, zz = drag[4], drag[6], drag[9]
    for i in range(3):
        damping[i, i] += drag[0]
        damping[3 + i, 3 + i] += xx + yy + zz
        for j in range(i + 1):
            damping[3 + i, 3 + j] -= drag[4 + (i * (i + 1)) // 2 + j]
    damping[4, 0] += drag[3]
    damping[5, 0] -= drag[2]
    damping[3, 1] -= drag[3]
    damping[5, 1] += drag[1]
    damping[3, 2] += drag[2]
    damping[4, 2] -= drag[1]
    for i in range(6):
        out.wrench[i] += out.damped[i]
        for j in range(i):
            out.stiffness[j, i] = out.stiffness[i, j]
            damping[j, i] = damping[i, j]
