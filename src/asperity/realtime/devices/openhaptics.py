"""3D Systems Touch, Touch X and Premium, through the package pyOpenHaptics.

OpenHaptics works by callbacks: a thread of its scheduler calls a function for the force at 1 kHz.
That function takes the newest wrench and stores the newest measurement, as a `PollingThread` does;
`read` and `write` only exchange references with it.

The vendor's axes are x to the right, y up, z towards the user, in millimetres, so a position
(x, y, z) becomes (x, -z, y) / 1000. Torques are in mN m.

Only plain functions of the package (1.0.1) are used. Its ready-made callback ends the scheduler
silently at the first error that it has no name for, warm motors among them; the callback here
reports the error and continues.

*When writes stop*, the callback sends zero after 20 ms, as long as the process lives. What the
driver does when the process is killed is not documented. Never tried on hardware; tested against
a stand-in for libHD.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import time
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.orientation import quaternion_of
from asperity.realtime.devices.polling_thread import Measurement, PolledDevice, PollingThread
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import ZERO, Limits

MODELS = ("touch", "omni", "premium-1.5-6dof", "premium-3.0-6dof")
_CONTINUE = 1
_FARTHEST = 2.0


class OpenHapticsDevice(PolledDevice):
    """A device of 3D Systems.

    Parameters
    ----------
    model : str
        Model whose limits apply: `touch`, `omni`, `premium-1.5-6dof` or `premium-3.0-6dof`.
    device_name : str
        Name given to the device in the driver's setup tool.
    limits : Limits, optional
        Instead of the model's.
    clock : callable
        Monotonic time [s].
    """

    name = "openhaptics"

    def __init__(
        self,
        *,
        model: str = "touch",
        device_name: str = "Default Device",
        limits: Limits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits = limits or PRESETS[require_choice("model", model, MODELS)]
        self._device_name = device_name
        self._clock = clock
        self._hd: Any = None
        self._id: int | None = None
        self._callback: Any = None
        self._ending = False

    def open(self) -> None:
        """Open the device, enable its forces, and start the driver's scheduler."""
        if self._poller is not None:
            return
        hd, scheduling = _import()
        self._ending, self._error = False, ""
        with contextlib.redirect_stdout(io.StringIO()):  # the package prints
            self._id = hd.init_device(self._device_name)
            if self._id is None:
                raise AsperityError(
                    f"OpenHaptics cannot open {self._device_name!r}; check its cable and its name "
                    "in the Touch setup tool"
                )
            self._hd = hd
            hd.enable_force()
            # Not started: the driver's thread calls `step`.
            self._poller = PollingThread(self._transact, clock=self._clock)
            kind = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.POINTER(ctypes.c_void_p))
            self._callback = kind(self._tick)
            scheduling.hdAsyncSheduler(self._callback)
            hd.start_scheduler()

    def close(self) -> None:
        """Send zero for some ticks, stop the scheduler, and release the device."""
        poller, hd = self._poller, self._hd
        if poller is None or hd is None:
            return
        poller.hand_over(ZERO)
        self._ending = True
        time.sleep(0.005)
        with contextlib.suppress(Exception), contextlib.redirect_stdout(io.StringIO()):
            hd.stop_scheduler()
            hd.close_device(self._id)
        self._poller = self._hd = self._callback = None

    def _tick(self, _: Any) -> int:
        """Run one tick of the driver's scheduler, into which nothing may be raised."""
        try:
            poller = self._poller
            if poller is not None:
                poller.step()
        except Exception as error:
            self._error = " ".join(str(error).split()) or type(error).__name__
        return _CONTINUE

    def _transact(self, wrench: tuple[float, ...]) -> Measurement:
        hd = self._hd
        if self._ending:
            wrench = ZERO
        handle = hd.get_current_device()
        hd.begin_frame(handle)
        try:
            fx, fy, fz, tx, ty, tz = wrench
            hd.set_force([fx, fz, -fy])
            if self.limits.torque_dof:
                torque = [tx * 1e3, tz * 1e3, -ty * 1e3]
                hd._set_doublev(hd.HD_CURRENT_TORQUE, torque, hd.hduVector3Dd)
            matrix = hd.get_transform()
            velocity = hd._get_doublev(hd.HD_CURRENT_VELOCITY, hd.hduVector3Dd)
            angular_velocity = hd._get_doublev(hd.HD_CURRENT_ANGULAR_VELOCITY, hd.hduVector3Dd)
            buttons = int(hd.get_buttons())
        finally:
            hd.end_frame(handle)
        code = int(hd._get_error().errorCode)
        if code:
            self._error = f"OpenHaptics reports error 0x{code:04x}"
        return _answer(matrix, velocity, angular_velocity, buttons)


def _answer(matrix: Any, velocity: Any, angular_velocity: Any, buttons: int) -> Measurement:
    # The matrix comes column by column: matrix[3] is the position.
    x, y, z = (matrix[3][i] * 1e-3 for i in range(3))
    if not x * x + y * y + z * z <= _FARTHEST**2:
        raise OSError(f"OpenHaptics reports {x:.3g}, {y:.3g}, {z:.3g} m, out of reach")
    vx, vy, vz = (velocity[i] * 1e-3 for i in range(3))
    wx, wy, wz = angular_velocity[0], angular_velocity[1], angular_velocity[2]
    a, b, c = matrix[0], matrix[1], matrix[2]  # directions of the stylus's x, y, z axes
    rows = (
        (a[0], -c[0], b[0]),
        (-a[2], c[2], -b[2]),
        (a[1], -c[1], b[1]),
    )  # C m C^T with C = (x, -z, y)
    return Measurement((x, -z, y), (vx, -vz, vy), quaternion_of(rows), (wx, -wz, wy), buttons)


def _import() -> tuple[Any, Any]:
    try:
        import pyOpenHaptics.hd as hd
        import pyOpenHaptics.hd_callback as scheduling
    except (ImportError, OSError, NameError) as error:
        raise AsperityError(
            "the OpenHaptics backend needs pyOpenHaptics (pip install 'asperity[openhaptics]') and "
            f"3D Systems' OpenHaptics with the device's driver: {error}"
        ) from None
    return hd, scheduling
