"""Between the device's axes and the scene's, compiled; see `mapping`."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel, kernel

# Places in `numbers`: the rotation from the device's axes to the scene's; where the workspace's
# middle lies in the scene; the orientation that comes after the device's; that middle in the
# device's axes; its radius; metres of the scene for one of the device; whether it senses rotation;
# newtons, and newton metres, at the device for one of the scene; how many axes it can push, turn.
TURN, ANCHOR, TOOL, HOME, RADIUS, SCALE, SENSES = 0, 4, 7, 11, 14, 15, 16
FORCE_SCALE, TORQUE_SCALE, FORCE_DOF, TORQUE_DOF, NUMBERS = 17, 18, 19, 20, 21


@kernel
def map_reading(pose, twist, numbers, pose_out, twist_out):
    """Fill pose (7,) and twist (6,) of the handle; return whether the device was outside.

    Position and velocity are held back to the workspace: on its border they slide.
    """
    x, y, z = pose[0] - numbers[HOME], pose[1] - numbers[HOME + 1], pose[2] - numbers[HOME + 2]
    vx, vy, vz = twist[0], twist[1], twist[2]
    radius, scale = numbers[RADIUS], numbers[SCALE]
    distance = math.sqrt(x * x + y * y + z * z)
    outside = distance > radius
    if outside:
        ux, uy, uz = x / distance, y / distance, z / distance
        x, y, z = radius * ux, radius * uy, radius * uz
        # What leads outwards is taken off, and the rest shrinks.
        outwards, shrink = vx * ux + vy * uy + vz * uz, radius / distance
        vx, vy, vz = (
            shrink * (vx - outwards * ux), shrink * (vy - outwards * uy),
            shrink * (vz - outwards * uz),
        )  # fmt: skip
    turn = (numbers[TURN], numbers[TURN + 1], numbers[TURN + 2], numbers[TURN + 3])
    tool = (numbers[TOOL], numbers[TOOL + 1], numbers[TOOL + 2], numbers[TOOL + 3])
    place, velocity = _rotated(turn, x, y, z), _rotated(turn, vx, vy, vz)
    for i in range(3):
        pose_out[i] = numbers[ANCHOR + i] + scale * place[i]
        twist_out[i] = scale * velocity[i]
    if numbers[SENSES] == 1.0:
        back = (turn[0], -turn[1], -turn[2], -turn[3])
        turned = _times(_times(turn, (pose[3], pose[4], pose[5], pose[6])), back)
        tool = _times(turned, tool)
        spin = _rotated(turn, twist[3], twist[4], twist[5])
        twist_out[3], twist_out[4], twist_out[5] = spin
    pose_out[3], pose_out[4], pose_out[5], pose_out[6] = tool
    return outside


@kernel
def anchor_at(wanted, numbers, pose):
    """Change `numbers` so that what is mapped to `pose` (7,) now will be mapped to `wanted` (7,).

    `pose` becomes that.
    """
    for i in range(3):
        numbers[ANCHOR + i] += wanted[i] - pose[i]
    tool = (wanted[3], wanted[4], wanted[5], wanted[6])
    if numbers[SENSES] == 1.0:
        # The device turns by pose * tool^-1; the new tool is what wanted is after that.
        old = (numbers[TOOL], numbers[TOOL + 1], numbers[TOOL + 2], numbers[TOOL + 3])
        back = _times(old, (pose[3], -pose[4], -pose[5], -pose[6]))
        tool = _times(back, tool)
    norm = math.sqrt(tool[0] ** 2 + tool[1] ** 2 + tool[2] ** 2 + tool[3] ** 2)
    for i in range(4):
        numbers[TOOL + i] = tool[i] / norm
    for i in range(7):
        pose[i] = wanted[i]


@kernel
def map_wrench(wrench, numbers, out):
    """Fill the wrench (6,) for the device: what it cannot push is left out."""
    back = (numbers[TURN], -numbers[TURN + 1], -numbers[TURN + 2], -numbers[TURN + 3])
    force = _rotated(back, wrench[0], wrench[1], wrench[2])
    torque = _rotated(back, wrench[3], wrench[4], wrench[5])
    for i in range(3):
        out[i] = numbers[FORCE_SCALE] * force[i] if i < numbers[FORCE_DOF] else 0.0
        out[3 + i] = numbers[TORQUE_SCALE] * torque[i] if i < numbers[TORQUE_DOF] else 0.0


@inner_kernel
def _times(a, b):
    """Return the product of two quaternions."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@inner_kernel
def _rotated(q, a, b, c):
    """Return a vector turned by a unit quaternion."""
    w, x, y, z = q
    # v + 2 w (q x v) + 2 q x (q x v)
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * tx + y * tz - z * ty,
        b + w * ty + z * tx - x * tz,
        c + w * tz + x * ty - y * tx,
    )
