"""Between the device's workspace and the scene.

A point of the device maps to the scene by

    x_scene = anchor + scale * R * (x_device - home)

with R the rotation from the device's axes to the scene's; orientations are turned by R and come on
top of the tool's own. `begin_at` chooses anchor and tool so that the hand's present pose is the
tool's present pose; a clutch does the same whenever it is let go of, so nothing ever jumps. While
it is held, the tool stays, the hand moves freely and feels nothing.

**Forces and power.** A force of the scene becomes `force_scale * R^T f` at the device. With `scale`
s and `force_scale` c the hand then feels a stiffness of `c s k`, and the power that it exchanges
with the device is `c / s` times that which the handle exchanges with the scene. Scaling therefore
does not change the sign of an energy: what is passive stays so. For motions that move and turn at
once, that holds only if torques are scaled so that their power has the same ratio. Angles are not
scaled, so torques are by `c / s`; this is the default of `torque_scale`, and any other is the
user's risk.

What the device cannot push is left out (`Limits.force_dof`, `torque_dof`: the first so many axes of
the device), which is a loss of feeling, and can be one of passivity: a tool that is turned by a
torque that the hand does not feel.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.kernels import Repeated
from asperity.errors import AsperityError, require_finite, require_positive
from asperity.geometry.poses import NORM_TOLERANCE
from asperity.realtime.devices.mapping_kernels import (
    ANCHOR,
    FORCE_DOF,
    FORCE_SCALE,
    HOME,
    NUMBERS,
    RADIUS,
    SCALE,
    SENSES,
    TOOL,
    TORQUE_DOF,
    TORQUE_SCALE,
    TURN,
    anchor_at,
    map_reading,
    map_wrench,
)
from asperity.realtime.devices.protocol import Limits, Reading

_ONE = (1.0, 0.0, 0.0, 0.0)
_NOWHERE = (0.0, 0.0, 0.0, *_ONE)


class Mapping:
    """From readings to handle poses, and from wrenches of the scene to those of the device.

    Parameters
    ----------
    limits : Limits
        Of the device: the radius of its workspace, and what it can push.
    scale : float
        Metres of the scene for one of the device.
    rotation : array_like (4,)
        Quaternion wxyz that turns the device's axes to the scene's.
    home : array_like (3,)
        Middle of the workspace, in the device's axes [m].
    force_scale : float
        Newtons at the device for one of the scene.
    torque_scale : float, optional
        The same for torques. Default: `force_scale / scale`, which keeps the ratio of powers.
    clutch_button : int, optional
        Number of the button that is the clutch, from 0. None: no clutch.

    Attributes
    ----------
    clutched : bool
        The clutch is held.
    outside : bool
        The end effector was outside the workspace in the last reading.
    refused : bool
        The last reading was not finite numbers; the handle stayed where it was.
    """

    def __init__(
        self,
        limits: Limits,
        *,
        scale: float = 1.0,
        rotation: ArrayLike = _ONE,
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
        numbers = self._numbers = np.zeros(NUMBERS)
        numbers[TURN:ANCHOR] = w / norm, x / norm, y / norm, z / norm
        numbers[TOOL] = 1.0
        numbers[HOME:RADIUS] = require_finite("home", home, 3)
        numbers[RADIUS], numbers[SCALE] = limits.radius, scale
        numbers[SENSES] = float(limits.senses_rotation)
        numbers[FORCE_SCALE] = force_scale
        numbers[TORQUE_SCALE] = require_positive("torque_scale", torque_scale)
        numbers[FORCE_DOF], numbers[TORQUE_DOF] = limits.force_dof, limits.torque_dof
        if clutch_button is not None and not 0 <= clutch_button < 32:
            raise AsperityError(f"clutch_button must be 0 to 31, got {clutch_button!r}")
        self._clutch = 0 if clutch_button is None else 1 << clutch_button
        self._pose, self._twist, self._wrench = np.zeros(7), np.zeros(6), np.zeros(6)
        # Of its own, whatever the device's are like: kernels are told their types only once.
        self._read_pose, self._read_twist, self._of_scene = np.zeros(7), np.zeros(6), np.zeros(6)
        self._map_reading, self._map_wrench = Repeated(map_reading), Repeated(map_wrench)
        # Machine code is made before any hurry.
        self.clutched = False
        self._recentre(Reading.empty(), np.array(_NOWHERE))
        self.to_device(self._wrench.copy())
        numbers[ANCHOR:HOME] = _NOWHERE
        self.clutched = self.outside = self.refused = False

    @property
    def power_ratio(self) -> float:
        """Return the device's power for one watt of the scene's, of force and motion."""
        return self._force_scale / self._scale

    def begin_at(self, reading: Reading, pose: ArrayLike) -> None:
        """Choose the anchor so that the device's present pose is `pose` (7,) of the handle."""
        wanted = np.array(require_finite("handle pose", pose, 7))
        if not _finite(reading):
            raise AsperityError(f"the device's pose is not finite numbers: {reading.pose}")
        self._recentre(reading, wanted)
        self.clutched = False

    def to_scene(self, reading: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the handle's pose (7,) and twist (6,) in the scene.

        Both arrays are the mapping's own and are overwritten by the next call.
        """
        self.refused = not _finite(reading)
        if self.refused:
            self._twist[:] = 0.0
            return self._pose, self._twist
        held = bool(self._clutch and reading.buttons & self._clutch)
        if held:
            self.clutched = True
            self._twist[:] = 0.0
            return self._pose, self._twist
        if self.clutched:
            self._recentre(reading, self._pose.copy())
            self.clutched = False
        self._map(reading)
        return self._pose, self._twist

    def to_device(self, wrench: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the wrench (6,) for the device: of one about the handle's origin, scene axes.

        Zero while the clutch is held. The array is the mapping's own.
        """
        out = self._wrench
        if self.clutched:
            out[:] = 0.0
            return out
        self._of_scene[:] = wrench
        self._map_wrench(self._of_scene, self._numbers, out)
        return out

    def _recentre(self, reading: Reading, wanted: NDArray[np.float64]) -> None:
        self._map(reading)
        anchor_at(wanted, self._numbers, self._pose)
        self._twist[:] = 0.0

    def _map(self, reading: Reading) -> None:
        self._read_pose[:], self._read_twist[:] = reading.pose, reading.twist
        self.outside = self._map_reading(
            self._read_pose, self._read_twist, self._numbers, self._pose, self._twist
        )


def _finite(reading: Reading) -> bool:
    return math.isfinite(sum(reading.pose.tolist()) + sum(reading.twist.tolist()))
