"""The mapping between a device's workspace and the scene: scale, rotation, clutch, forces.

A position of the device maps to the scene by

    x_scene = anchor + scale * R * (x_device - home)

where R rotates the device's axes to the scene's; orientations are rotated by R and applied after
the tool's own. `begin_at` chooses anchor and tool so that the hand's present pose becomes the
tool's present pose. A clutch does the same whenever it is released, so nothing ever jumps; while it
is pressed, the tool stays where it is, and the hand moves freely without force.

**Forces and power.** A force f of the scene becomes `force_scale * R^T f` at the device. With
`scale` s and `force_scale` c the hand feels a stiffness of `c s k`, and the power it exchanges with
the device is `c / s` times the power that the handle exchanges with the scene. Scaling therefore
keeps the sign of an energy, and what is passive stays passive. For motions that rotate as well,
this holds only if torques have the same power ratio; as angles are not scaled, that means a factor
of `c / s`, the default of `torque_scale`. Any other value is at the user's risk.

Forces and torques that the device cannot render are dropped (`Limits.force_dof`, `torque_dof`: only
the first axes of the device are actuated). This can cost passivity: a dropped torque rotates the
tool while the hand does no work.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.kernels import Repeated, inner_kernel, kernel
from asperity.errors import AsperityError, require_finite, require_positive
from asperity.geometry.poses import NORM_TOLERANCE
from asperity.realtime.devices.protocol import Limits, Reading

MAPPING = np.dtype(
    [
        ("rotation", "f8", 4),  # quaternion wxyz from the device's axes to the scene's
        ("anchor", "f8", 3),  # where `home` lies in the scene [m]
        ("tool", "f8", 4),  # orientation applied before the device's, quaternion wxyz
        ("home", "f8", 3),  # middle of the workspace in the device's axes [m]
        ("radius", "f8"),  # of the workspace [m]
        ("scale", "f8"),  # metres of the scene per metre of the device
        ("force_scale", "f8"),  # newtons at the device per newton of the scene
        ("torque_scale", "f8"),  # newton metres at the device per newton metre of the scene
        ("senses_rotation", "i8"),  # 1 if the device measures its orientation
        ("force_dof", "i8"),  # axes along which it can push, 0 to 3
        ("torque_dof", "i8"),  # axes about which it can twist, 0 to 3
    ]
)
"""A mapping as the kernels see it."""
_IDENTITY = (1.0, 0.0, 0.0, 0.0)


class Mapping:
    """Maps readings to handle poses, and wrenches of the scene to wrenches of the device.

    Parameters
    ----------
    limits : Limits
        Of the device: its workspace's radius, and the axes it can push along and twist about.
    scale : float
        Metres of the scene per metre of the device.
    rotation : array_like (4,)
        Quaternion wxyz from the device's axes to the scene's.
    home : array_like (3,)
        Middle of the workspace, in the device's axes [m].
    force_scale : float
        Newtons at the device per newton of the scene.
    torque_scale : float, optional
        The same for torques. Default: `force_scale / scale`, which keeps the power ratio.
    clutch_button : int, optional
        Number of the button that is the clutch, from 0. Default: no clutch.

    Attributes
    ----------
    clutched : bool
        Whether the clutch is pressed.
    outside : bool
        Whether the end effector was outside the workspace at the last reading.
    refused : bool
        Whether the last reading was not finite; the handle then stays where it was.
    """

    def __init__(
        self,
        limits: Limits,
        *,
        scale: float = 1.0,
        rotation: ArrayLike = _IDENTITY,
        home: ArrayLike = (0.0, 0.0, 0.0),
        force_scale: float = 1.0,
        torque_scale: float | None = None,
        clutch_button: int | None = None,
    ) -> None:
        self._scale = require_positive("scale", scale)
        self._force_scale = require_positive("force_scale", force_scale)
        if torque_scale is None:
            torque_scale = force_scale / scale
        w, x, y, z = require_finite("rotation", rotation, 4)
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1.0) > NORM_TOLERANCE:
            raise AsperityError(f"rotation must be a unit quaternion, its norm is {norm:.9g}")
        # An array of one record: Numba unpacks it from Python faster than a record (0.1 for 2 us).
        self._records = np.zeros(1, MAPPING)
        record = self._records[0]
        record["rotation"] = w / norm, x / norm, y / norm, z / norm
        record["tool"] = _IDENTITY
        record["home"] = require_finite("home", home, 3)
        record["radius"], record["scale"] = limits.radius, scale
        record["force_scale"] = force_scale
        record["torque_scale"] = require_positive("torque_scale", torque_scale)
        record["senses_rotation"] = limits.senses_rotation
        record["force_dof"], record["torque_dof"] = limits.force_dof, limits.torque_dof
        if clutch_button is not None and not 0 <= clutch_button < 32:
            raise AsperityError(f"clutch_button must be 0 to 31, got {clutch_button!r}")
        self._clutch = 0 if clutch_button is None else 1 << clutch_button
        self._pose, self._twist, self._wrench = np.zeros(7), np.zeros(6), np.zeros(6)
        # Copies of the arguments: `Repeated` needs arrays of the same layout in every call.
        self._read_pose, self._read_twist, self._of_scene = np.zeros(7), np.zeros(6), np.zeros(6)
        self._map_reading, self._map_wrench = Repeated(map_reading), Repeated(map_wrench)
        # The first calls compile, which must not happen during a tick.
        self.clutched = False
        self._recentre(Reading.empty(), np.array([0.0, 0.0, 0.0, *_IDENTITY]))
        self.to_device(self._wrench.copy())
        record["anchor"], record["tool"] = 0.0, _IDENTITY
        self.clutched = self.outside = self.refused = False

    @property
    def power_ratio(self) -> float:
        """Power at the device per watt in the scene."""
        return self._force_scale / self._scale

    def begin_at(self, reading: Reading, pose: ArrayLike) -> None:
        """Choose the anchor so that the device's present pose maps to `pose` (7,) of the handle."""
        wanted = np.array(require_finite("handle pose", pose, 7))
        if not _finite(reading):
            raise AsperityError(f"the device's pose is not finite: {reading.pose}")
        self._recentre(reading, wanted)
        self.clutched = False

    def to_scene(self, reading: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the handle's pose (7,) and twist (6,) in the scene.

        The next call overwrites both arrays.
        """
        self.refused = not _finite(reading)
        if self.refused:
            self._twist[:] = 0.0
            return self._pose, self._twist
        if self._clutch and reading.buttons & self._clutch:
            self.clutched = True
            self._twist[:] = 0.0
            return self._pose, self._twist
        if self.clutched:
            self._recentre(reading, self._pose.copy())
            self.clutched = False
        self._map(reading)
        return self._pose, self._twist

    def to_device(self, wrench: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the wrench (6,) for the device, given one about the handle's origin, scene axes.

        Zero while the clutch is pressed. The next call overwrites the array.
        """
        out = self._wrench
        if self.clutched:
            out[:] = 0.0
            return out
        self._of_scene[:] = wrench
        self._map_wrench(self._records, self._of_scene, out)
        return out

    def _recentre(self, reading: Reading, wanted: NDArray[np.float64]) -> None:
        self._map(reading)
        move_anchor(self._records, wanted, self._pose)
        self._twist[:] = 0.0

    def _map(self, reading: Reading) -> None:
        self._read_pose[:], self._read_twist[:] = reading.pose, reading.twist
        self.outside = self._map_reading(
            self._records, self._read_pose, self._read_twist, self._pose, self._twist
        )


def _finite(reading: Reading) -> bool:
    return math.isfinite(sum(reading.pose.tolist()) + sum(reading.twist.tolist()))


@kernel
def map_reading(mappings, pose, twist, pose_out, twist_out):
    """Fill pose (7,) and twist (6,) of the handle; return whether the device was outside.

    Outside the workspace the position is projected onto its surface and the velocity made
    tangential, so that the handle slides along the surface.
    """
    mapping = mappings[0]
    home = mapping.home
    x, y, z = pose[0] - home[0], pose[1] - home[1], pose[2] - home[2]
    vx, vy, vz = twist[0], twist[1], twist[2]
    radius, scale = mapping.radius, mapping.scale
    distance = math.sqrt(x * x + y * y + z * z)
    outside = distance > radius
    if outside:
        ux, uy, uz = x / distance, y / distance, z / distance
        x, y, z = radius * ux, radius * uy, radius * uz
        outwards, shrink = vx * ux + vy * uy + vz * uz, radius / distance
        vx, vy, vz = (
            shrink * (vx - outwards * ux), shrink * (vy - outwards * uy),
            shrink * (vz - outwards * uz),
        )  # fmt: skip
    rotation, tool = _quaternion(mapping.rotation), _quaternion(mapping.tool)
    position, velocity = _rotate(rotation, x, y, z), _rotate(rotation, vx, vy, vz)
    for i in range(3):
        pose_out[i] = mapping.anchor[i] + scale * position[i]
        twist_out[i] = scale * velocity[i]
    if mapping.senses_rotation:
        inverse = _conjugate(rotation)
        device = (pose[3], pose[4], pose[5], pose[6])
        tool = _multiply(_multiply(_multiply(rotation, device), inverse), tool)
        spin = _rotate(rotation, twist[3], twist[4], twist[5])
        twist_out[3], twist_out[4], twist_out[5] = spin
    pose_out[3], pose_out[4], pose_out[5], pose_out[6] = tool
    return outside


@kernel
def move_anchor(mappings, wanted, pose):
    """Change the mapping so that what maps to `pose` (7,) now will map to `wanted` (7,).

    `pose` is set to `wanted`.
    """
    mapping = mappings[0]
    for i in range(3):
        mapping.anchor[i] += wanted[i] - pose[i]
    tool = (wanted[3], wanted[4], wanted[5], wanted[6])
    if mapping.senses_rotation:
        # pose = device * old tool, so the new tool is device^-1 * wanted = old * pose^-1 * wanted.
        inverse = _conjugate((pose[3], pose[4], pose[5], pose[6]))
        tool = _multiply(_multiply(_quaternion(mapping.tool), inverse), tool)
    norm = math.sqrt(tool[0] ** 2 + tool[1] ** 2 + tool[2] ** 2 + tool[3] ** 2)
    for i in range(4):
        mapping.tool[i] = tool[i] / norm
    for i in range(7):
        pose[i] = wanted[i]


@kernel
def map_wrench(mappings, wrench, out):
    """Fill the wrench (6,) for the device; components that it cannot render are zero."""
    mapping = mappings[0]
    inverse = _conjugate(_quaternion(mapping.rotation))
    force = _rotate(inverse, wrench[0], wrench[1], wrench[2])
    torque = _rotate(inverse, wrench[3], wrench[4], wrench[5])
    for i in range(3):
        out[i] = mapping.force_scale * force[i] if i < mapping.force_dof else 0.0
        out[3 + i] = mapping.torque_scale * torque[i] if i < mapping.torque_dof else 0.0


@inner_kernel
def _quaternion(row):
    """Return a quaternion (4,) as a tuple."""
    return row[0], row[1], row[2], row[3]


@inner_kernel
def _conjugate(q):
    """Return the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@inner_kernel
def _multiply(a, b):
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
def _rotate(q, a, b, c):
    """Return a vector rotated by a unit quaternion."""
    w, x, y, z = q
    # v + 2 w (q x v) + 2 q x (q x v)
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * tx + y * tz - z * ty,
        b + w * ty + z * tx - x * tz,
        c + w * tz + x * ty - y * tx,
    )
