"""Motion of a rigid body about its centre of mass: compiled pieces of the integrators.

Orientations move by the exponential map. The gyroscopic term has no term of its own: what is kept
from tick to tick is angular *momentum*, in world axes, and the velocity follows from it and the
inertia as it is turned. Free of torque the momentum stays what it is, so that the velocity is
bounded by it over the least moment of inertia, however fast the body turns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel


class RigidBody(NamedTuple):
    """What a held tool weighs."""

    mass: float
    """[kg]"""
    centre: NDArray[np.float64]
    """Of mass, in the tool's frame [m], (3,)."""
    moments: NDArray[np.float64]
    """Principal moments of inertia [kg m^2], (3,)."""
    axes: NDArray[np.float64]
    """The principal axes, as columns, in the tool's frame (3, 3)."""


def rotation_matrix(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) of a pose (7,)."""
    out = np.empty((3, 3))
    _fill_rotation(pose, out)
    return out


def centre_of_mass(pose: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the centre of mass is in the world (3,), `centre` (3,) in the tool's frame."""
    out = np.empty(3)
    _fill_centre(pose, centre, out)
    return out


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the cross product of the first three of each; `np.cross` takes 20 times as long."""
    ax, ay, az = a[:3].tolist()
    bx, by, bz = b[:3].tolist()
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def _fill_rotation(pose, out):
    fill_rotation(pose, out)


@kernel
def _fill_centre(pose, centre, out):
    lever(pose, centre, out)
    for i in range(3):
        out[i] += pose[i]


@kernel
def shift_wrench(wrench, reach, out):
    """Fill a wrench (6,) as it is about another point, from which this one is `reach` (3,) away."""
    fx, fy, fz = wrench[0], wrench[1], wrench[2]
    out[3] = wrench[3] + reach[1] * fz - reach[2] * fy
    out[4] = wrench[4] + reach[2] * fx - reach[0] * fz
    out[5] = wrench[5] + reach[0] * fy - reach[1] * fx
    out[0], out[1], out[2] = fx, fy, fz


@inner_kernel
def fill_rotation(pose, out):
    """Fill the rotation (3, 3) of a pose (7,)."""
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    out[0, 0], out[0, 1], out[0, 2] = (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    )  # fmt: skip
    out[1, 0], out[1, 1], out[1, 2] = (
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    )  # fmt: skip
    out[2, 0], out[2, 1], out[2, 2] = (
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip


@inner_kernel
def lever(pose, centre, out):
    """Fill the way (3,) from the frame's origin to the centre of mass, world axes."""
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    a, b, c = centre[0], centre[1], centre[2]
    # v + 2 w (q x v) + 2 q x (q x v)
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    out[0] = a + 2.0 * (w * p + y * r - z * q)
    out[1] = b + 2.0 * (w * q + z * p - x * r)
    out[2] = c + 2.0 * (w * r + x * q - y * p)


@inner_kernel
def way(first, last, centre, room, out):
    """Fill the way (6,) from one pose to another: of the centre of mass, and the short turn.

    `room` (3,) is overwritten.
    """
    lever(last, centre, room)
    for i in range(3):
        out[i] = last[i] - first[i] + room[i]
    lever(first, centre, room)
    for i in range(3):
        out[i] -= room[i]
    aw, ax, ay, az = first[3], first[4], first[5], first[6]
    bw, bx, by, bz = last[3], last[4], last[5], last[6]
    # last * conjugate(first)
    w = bw * aw + bx * ax + by * ay + bz * az
    x = -bw * ax + bx * aw - by * az + bz * ay
    y = -bw * ay + bx * az + by * aw - bz * ax
    z = -bw * az - bx * ay + by * ax + bz * aw
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 0.0
    if sine > 1e-15:
        scale = 2.0 * math.atan2(sine, abs(w)) / sine
        if w < 0.0:
            scale = -scale
    out[3], out[4], out[5] = x * scale, y * scale, z * scale


@inner_kernel
def move(pose, step, centre, room):
    """Move a pose (7,) in place by `step` (6,): of its centre of mass [m], and its turn [rad]."""
    lever(pose, centre, room)
    for i in range(3):
        pose[i] += room[i] + step[i]
    turn(pose, step[3], step[4], step[5])
    lever(pose, centre, room)
    for i in range(3):
        pose[i] -= room[i]


@inner_kernel
def turn(pose, x, y, z):
    """Turn a pose in place by a rotation vector [rad] in world axes: the exponential map."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < 1e-12 else math.sin(0.5 * angle) / angle
    w, x, y, z = math.cos(0.5 * angle), scale * x, scale * y, scale * z
    aw, ax, ay, az = pose[3], pose[4], pose[5], pose[6]
    bw = w * aw - x * ax - y * ay - z * az
    bx = w * ax + x * aw + y * az - z * ay
    by = w * ay - x * az + y * aw + z * ax
    bz = w * az + x * ay - y * ax + z * aw
    norm = math.sqrt(bw * bw + bx * bx + by * by + bz * bz)
    pose[3], pose[4], pose[5], pose[6] = bw / norm, bx / norm, by / norm, bz / norm


@inner_kernel
def about_axes(rotation, axes, values, out):
    """Fill the matrix (3, 3), world axes, that has `values` (3,) along a body's principal axes."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                p = q = 0.0
                for a in range(3):
                    p += rotation[i, a] * axes[a, k]
                    q += rotation[j, a] * axes[a, k]
                total += p * values[k] * q
            out[i, j] = total


@inner_kernel
def solve(matrix, values):
    """Solve `matrix` x = `values` (6,) in place, the matrix symmetric and positive definite.

    By Cholesky's factors, which overwrite its lower half. Returns whether it was definite.
    """
    for j in range(6):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] ** 2
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        matrix[j, j] = pivot
        for i in range(j + 1, 6):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / pivot
    for i in range(6):
        total = values[i]
        for k in range(i):
            total -= matrix[i, k] * values[k]
        values[i] = total / matrix[i, i]
    for i in range(5, -1, -1):
        total = values[i]
        for k in range(i + 1, 6):
            total -= matrix[k, i] * values[k]
        values[i] = total / matrix[i, i]
    return True
