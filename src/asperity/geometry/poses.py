"""Poses: a position [m] and a unit quaternion wxyz, checked, interpolated and differentiated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.errors import AsperityError

Pose = Array
NORM_TOLERANCE = 1e-6
"""Largest deviation of a quaternion's norm from 1; smaller ones are normalised."""


def require_pose(pose: ArrayLike, name: str = "handle pose") -> Pose:
    """Return a pose (7,): x, y, z [m], qw, qx, qy, qz, with its quaternion normalised.

    Raises
    ------
    AsperityError
        `pose` is not seven finite numbers, or the norm of its quaternion differs from 1 by more
        than `NORM_TOLERANCE`.
    """
    try:
        out = np.array(pose, dtype=np.float64)
    except (TypeError, ValueError):
        out = np.empty(0)
    if out.shape != (7,):
        raise AsperityError(
            f"{name} must be 7 numbers (x, y, z in m, then qw, qx, qy, qz), got {_shown(pose)}"
        )
    x, y, z, qw, qx, qy, qz = out.tolist()
    square = qw * qw + qx * qx + qy * qy + qz * qz
    if not math.isfinite(x + y + z + square):
        raise AsperityError(f"{name} must be finite numbers, got {_shown(out)}")
    norm = math.sqrt(square)
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise AsperityError(
            f"{name}: the quaternion must have norm 1 (to {NORM_TOLERANCE:g}), its norm is "
            f"{norm:.9g}; divide qw, qx, qy, qz by it"
        )
    out[3:] /= norm
    return out


def _shown(pose: Any) -> str:
    shape = np.shape(pose) if isinstance(pose, np.ndarray) else ()
    pose = pose.tolist() if shape == (7,) else pose
    text = f"an array of shape {shape}" if shape not in ((), (7,)) else repr(pose)
    return " ".join(text.split())[:120]


def interpolate_pose(first: Pose, last: Pose, s: float) -> Pose:
    """Return the pose at a fraction `s` (0 to 1) between two poses.

    The position is interpolated linearly, the orientation spherically along the shorter arc.
    """
    out = first + s * (last - first)
    a, b = first[3:].tolist(), last[3:].tolist()
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    sign = -1.0 if cosine < 0.0 else 1.0
    angle = math.acos(min(abs(cosine), 1.0))
    if angle < 1e-9:
        p, q = 1.0 - s, s
    else:
        sine = math.sin(angle)
        p, q = math.sin((1.0 - s) * angle) / sine, math.sin(s * angle) / sine
    mixed = [p * u + sign * q * v for u, v in zip(a, b, strict=True)]
    norm = math.sqrt(sum(value * value for value in mixed))
    out[3:] = [value / norm for value in mixed]
    return out


def mean_twist(first: Pose, last: Pose, seconds: float) -> Array:
    """Return the constant velocity (6,) that moves a body from one pose to another in `seconds`.

    Linear velocity of the body's origin [m/s], then angular velocity [rad/s], world axes.
    """
    x, y, z, *one = first.tolist()
    to_x, to_y, to_z, *other = last.tolist()
    turn_x, turn_y, turn_z = _rotation(one, other)
    moved = (to_x - x, to_y - y, to_z - z, turn_x, turn_y, turn_z)
    return np.array([part / seconds for part in moved])


def rotation_between(first: Pose, last: Pose) -> Array:
    """Return the rotation vector (3,) [rad], world axes, from one orientation to another.

    Of the two rotations that lead there, the one by at most pi.
    """
    return np.array(_rotation(first[3:].tolist(), last[3:].tolist()))


def _rotation(first: list[float], last: list[float]) -> tuple[float, float, float]:
    """Return the rotation vector between two unit quaternions; lists are faster than arrays."""
    aw, ax, ay, az = first
    bw, bx, by, bz = last
    # last * conjugate(first)
    w = bw * aw + bx * ax + by * ay + bz * az
    x = -bw * ax + bx * aw - by * az + bz * ay
    y = -bw * ay + bx * az + by * aw - bz * ax
    z = -bw * az - bx * ay + by * ax + bz * aw
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-15:
        return 0.0, 0.0, 0.0
    angle = 2.0 * math.atan2(sine, abs(w))
    scale = math.copysign(angle / sine, w) if w != 0.0 else angle / sine
    return x * scale, y * scale, z * scale


def rotated(pose: Pose, rotation: ArrayLike) -> Pose:
    """Return a pose rotated about its own origin by a rotation vector [rad] in world axes."""
    vector = np.asarray(rotation, dtype=np.float64)
    angle = float(np.linalg.norm(vector))
    out = pose.copy()
    if angle == 0.0:
        return out
    w, (x, y, z) = math.cos(angle / 2), (vector / angle * math.sin(angle / 2)).tolist()
    aw, ax, ay, az = pose[3:].tolist()
    out[3:] = (
        w * aw - x * ax - y * ay - z * az,
        w * ax + x * aw + y * az - z * ay,
        w * ay - x * az + y * aw + z * ax,
        w * az + x * ay - y * ax + z * aw,
    )
    return out


def rotation_of(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion wxyz; columns are the body's axes."""
    w, x, y, z = np.asarray(quaternion, dtype=np.float64).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
