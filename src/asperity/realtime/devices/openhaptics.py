"""3D Systems Touch, Touch X and Premium through the package pyOpenHaptics.

OpenHaptics calls back: its scheduler asks a function of ours for the force at 1 kHz from a thread
of its own. That function takes the newest wrench and puts down the newest pose, as the thread of
`exchange` does; `read` and `write` only exchange references with it.

Axes there: x to the right, y up, z towards the user; millimetres. So ours are (x, -z, y) / 1000.
Torques are told in mN m.

The package (1.0.1) is used by its plain functions. Its ready-made callback ends the scheduler for
good, without a word, at the first error that it has no name for, warm motors among them; the one
here tells the error and goes on.

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
from asperity.realtime.devices.polling_thread import Answer, Exchange, Exchanging
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import Limits
from asperity.realtime.devices.wrench_check import ZERO

MODELS = ("touch", "omni", "premium-1.5-6dof", "premium-3.0-6dof")
_GOES_ON = 1
_FARTHEST = 2.0


class OpenHapticsDevice(Exchanging):
    """A device of 3D Systems.

    Parameters
    ----------
    model : str
        Whose limits hold: `touch`, `omni`, `premium-1.5-6dof` or `premium-3.0-6dof`.
    device_name : str
        As set up with the driver's tool.
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
        if self._exchange is not None:
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
            # Not started: the driver's thread takes the steps.
            self._exchange = Exchange(self._ask, clock=self._clock)
            kind = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.POINTER(ctypes.c_void_p))
            self._callback = kind(self._tick)
            scheduling.hdAsyncSheduler(self._callback)
            hd.start_scheduler()

    def close(self) -> None:
        """Send zero for some ticks, stop the scheduler, and let go of the device."""
        exchange, hd = self._exchange, self._hd
        if exchange is None or hd is None:
            return
        exchange.hand_over(ZERO)
        self._ending = True
        time.sleep(0.005)
        with contextlib.suppress(Exception), contextlib.redirect_stdout(io.StringIO()):
            hd.stop_scheduler()
            hd.close_device(self._id)
        self._exchange = self._hd = self._callback = None

    def _tick(self, _: Any) -> int:
        """Do one tick of the driver's scheduler. Nothing may be raised into it."""
        try:
            exchange = self._exchange
            if exchange is not None:
                exchange.step()
        except Exception as error:
            self._error = " ".join(str(error).split()) or type(error).__name__
        return _GOES_ON

    def _ask(self, wrench: tuple[float, ...]) -> Answer:
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
            turning = hd._get_doublev(hd.HD_CURRENT_ANGULAR_VELOCITY, hd.hduVector3Dd)
            buttons = int(hd.get_buttons())
        finally:
            hd.end_frame(handle)
        code = int(hd._get_error().errorCode)
        if code:
            self._error = f"OpenHaptics tells of error 0x{code:04x}"
        return _answer(matrix, velocity, turning, buttons)


def _answer(matrix: Any, velocity: Any, turning: Any, buttons: int) -> Answer:
    # Column by column: matrix[3] is the position.
    x, y, z = (matrix[3][i] * 1e-3 for i in range(3))
    if not x * x + y * y + z * z <= _FARTHEST**2:
        raise OSError(f"OpenHaptics tells of {x:.3g}, {y:.3g}, {z:.3g} m, which cannot be")
    vx, vy, vz = (velocity[i] * 1e-3 for i in range(3))
    wx, wy, wz = turning[0], turning[1], turning[2]
    a, b, c = matrix[0], matrix[1], matrix[2]  # where x, y, z of the stylus point
    rows = (
        (a[0], -c[0], b[0]),
        (-a[2], c[2], -b[2]),
        (a[1], -c[1], b[1]),
    )  # C m C^T with C = (x, -z, y)
    return Answer((x, -z, y), (vx, -vz, vy), quaternion_of(rows), (wx, -wz, wy), buttons)


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
