"""Force Dimension omega, delta, sigma and lambda, through the package forcedimension-core.

The package binds Force Dimension's library libdrd, which comes with their SDK (3.16 or later) and
has to be installed by hand. Its calls go over USB and are made from a `PollingThread`.

The vendor's axes are x towards the user, y to the right, z up, so a vector (x, y, z) becomes
(y, -x, z). An omega.6 reports its orientation in a frame rotated by 45 degrees about y (SDK
documentation); this is not corrected: use `asperity devices check`.

*When writes stop*, the thread sends zero after 20 ms, and the controller's own watchdog, where
there is one, is set to 25 ms: it disables forces if the process is gone. Never tried on hardware;
tested against the mock that the package contains.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.orientation import quaternion_of
from asperity.realtime.devices.polling_thread import Measurement, PolledDevice, PollingThread
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import ZERO, Limits

MODELS = ("omega.6", "sigma.7", "lambda.7")
_WATCHDOG = 200  # of 125 us
_FARTHEST = 2.0


class ForceDimensionDevice(PolledDevice):
    """The first free Force Dimension device.

    Parameters
    ----------
    model : str
        Model whose limits apply: `omega.6`, `sigma.7` or `lambda.7`.
    limits : Limits, optional
        Instead of the model's.
    clock : callable
        Monotonic time [s].
    """

    name = "force-dimension"

    def __init__(
        self,
        *,
        model: str = "omega.6",
        limits: Limits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits = limits or PRESETS[require_choice("model", model, MODELS)]
        self._clock = clock
        self._dhd: Any = None
        self._position, self._velocity = [0.0] * 3, [0.0] * 3
        self._angular_velocity = [0.0] * 3
        self._frame = [[0.0] * 3 for _ in range(3)]
        self._wrist = self._torques = False

    def open(self) -> None:
        """Open the device, enable its forces, and start the polling thread."""
        if self._poller is not None:
            return
        dhd = _import()
        if dhd.open() == -1:
            raise AsperityError(
                f"no Force Dimension device could be opened: {dhd.errorGetLastStr()}; is it "
                "switched on and calibrated, and is no other program using it?"
            )
        self._dhd = dhd
        try:
            self._wrist = bool(dhd.hasWrist())
            self._torques = bool(dhd.hasActiveWrist()) and self.limits.torque_dof > 0
            with contextlib.suppress(Exception):  # not every controller has one
                dhd.expert.setWatchdog(_WATCHDOG)
            if dhd.enableForce(True) == -1:
                raise OSError(dhd.errorGetLastStr())
            self._transact(ZERO)
        except (OSError, ValueError) as error:
            self._shut()
            raise AsperityError(f"the Force Dimension device does not answer: {error}") from None
        self._poller = PollingThread(self._transact, reopen=self._reopen, clock=self._clock)
        self._poller.start()

    def close(self) -> None:
        """Send zero, brake, and release the device."""
        poller, self._poller = self._poller, None
        if poller is not None:
            poller.stop()
        self._shut()

    def _transact(self, wrench: tuple[float, ...]) -> Measurement:
        dhd = self._dhd
        fx, fy, fz, tx, ty, tz = wrench
        if self._torques:
            state = dhd.setForceAndTorque((-fy, fx, fz), (-ty, tx, tz))
        else:
            state = dhd.setForce((-fy, fx, fz))
        if state == -1:
            raise OSError(f"Force Dimension: {dhd.errorGetLastStr()}")
        if self._wrist:
            state = dhd.getPositionAndOrientationFrame(self._position, self._frame)
        else:
            state = dhd.getPosition(self._position)
        if state == -1:
            raise OSError(f"Force Dimension: {dhd.errorGetLastStr()}")
        # The velocity estimators fail until they have two positions.
        if dhd.getLinearVelocity(self._velocity) == -1:
            self._velocity[:] = (0.0, 0.0, 0.0)
        x, y, z = self._position
        if not x * x + y * y + z * z <= _FARTHEST**2:
            raise OSError(f"Force Dimension reports {x:.3g}, {y:.3g}, {z:.3g} m, out of reach")
        vx, vy, vz = self._velocity
        orientation, angular_velocity = None, (0.0, 0.0, 0.0)
        if self._wrist:
            if dhd.getAngularVelocityRad(self._angular_velocity) == -1:
                self._angular_velocity[:] = (0.0, 0.0, 0.0)
            wx, wy, wz = self._angular_velocity
            orientation, angular_velocity = (
                quaternion_of(_to_workspace_axes(self._frame)),
                (wy, -wx, wz),
            )
        return Measurement(
            (y, -x, z),
            (vy, -vx, vz),
            orientation,
            angular_velocity,
            int(dhd.getButtonMask()) & 0xFFFFFFFF,
        )

    def _reopen(self) -> None:
        dhd = self._dhd
        dhd.close()
        if dhd.open() == -1:
            raise OSError(f"Force Dimension: {dhd.errorGetLastStr()}")
        with contextlib.suppress(Exception):
            dhd.expert.setWatchdog(_WATCHDOG)
        dhd.enableForce(True)

    def _shut(self) -> None:
        if self._dhd is not None:
            with contextlib.suppress(Exception):
                self._dhd.stop()
            with contextlib.suppress(Exception):
                self._dhd.close()
        self._dhd = None


def attached() -> list[str]:
    """Return the number of connected devices without opening one; ImportError without the SDK."""
    import forcedimension_core.dhd as dhd

    count = int(dhd.getDeviceCount())
    return [str(count)] if count > 0 else []


def _import() -> Any:
    try:
        import forcedimension_core.dhd as dhd
        import forcedimension_core.dhd.expert  # noqa: F401
    except ImportError as error:
        raise AsperityError(
            "the Force Dimension backend needs forcedimension-core (pip install "
            "'asperity[forcedimension]', Python below 3.13) and Force Dimension's SDK 3.16 or "
            f"later with FDSDK set to its folder: {error}"
        ) from None
    return dhd


def _to_workspace_axes(m: list[list[float]]) -> tuple[tuple[float, float, float], ...]:
    """Return C m C^T, where C maps (x, y, z) to (y, -x, z)."""
    return (
        (m[1][1], -m[1][0], m[1][2]),
        (-m[0][1], m[0][0], -m[0][2]),
        (m[2][1], -m[2][0], m[2][2]),
    )
