"""Haply Inverse3 on its serial port, through the package HaplyHardwareAPI, without the service.

`end_effector_force` sends a force and waits for position and velocity, so it is called from a
`PollingThread`. The vendor's axes are those of `protocol`: x right, y forward, z up, from the
device's base.

Behaviour of the package (0.1.13), observed with a stand-in for the firmware on a pseudo-terminal:

- A device that does not answer raises nothing: after the timeout the position is exactly (0, 0, 0),
  inside the device's base. Such an answer is treated as a failure.
- A port that cannot be opened is no error either, and a stream that is garbage-collected while the
  device uses it crashes the process. So the port is tried beforehand, and the stream is kept.
- It sends a force of NaN to the device; `write` lets none through.

*When writes stop*, the thread sends zero after 20 ms. If the process is killed, nothing is sent;
what the firmware does then is not documented. Never tried on hardware.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError
from asperity.realtime.devices.orientation import TurnRate, unit_quaternion
from asperity.realtime.devices.polling_thread import Measurement, PolledDevice, PollingThread
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import ZERO, Limits, Reading

_TIMEOUT = 0.05
_FARTHEST = 2.0


class HaplyHardwareDevice(PolledDevice):
    """An Inverse3 on a serial port, with a VerseGrip on another port if there is one.

    Parameters
    ----------
    port : str, optional
        Serial port of the Inverse3. Default: the first that the package detects.
    grip_port : str, optional
        Serial port of the VerseGrip's receiver. Default: the first detected. Empty: none.
    limits : Limits
    clock : callable
        Monotonic time [s].
    """

    name = "haply-serial"

    def __init__(
        self,
        *,
        port: str | None = None,
        grip_port: str | None = None,
        limits: Limits = PRESETS["inverse3"],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits = limits
        self._port, self._grip_port = port, grip_port
        self._clock = clock
        self._api: Any = None
        self._streams: list[Any] = []  # kept alive: see the module's docstring
        self._device: Any = None
        self._grip: Any = None
        self._grip_poller: PollingThread | None = None
        self._grip_reading = Reading.empty()
        self._rate = TurnRate()
        self._gone = False

    def open(self) -> None:
        """Find the ports, wake the device, and start the polling thread."""
        if self._poller is not None:
            return
        try:
            import HaplyHardwareAPI as api  # noqa: N813
        except ImportError as error:
            raise AsperityError(
                f"the serial Haply backend needs HaplyHardwareAPI ({error}): "
                "pip install 'asperity[haply]'"
            ) from None
        self._api = api
        port = self._port or next(iter(api.detect_inverse3s()), None)
        if port is None:
            raise AsperityError(
                "no Inverse3 found on a serial port; plug it in, or give port=; on Linux your user "
                "has to be in the group dialout"
            )
        try:
            self._device = self._opened(port, api.Inverse3)
            self._device.set_read_timeout(_TIMEOUT)
            self._transact(ZERO)
            grip_port = (
                next(iter(api.detect_handles()), "") if self._grip_port is None else self._grip_port
            )
            if grip_port:
                self._grip = self._opened(grip_port, api.Handle)
        except (OSError, RuntimeError, ValueError) as error:
            self._drop()
            raise AsperityError(f"the Inverse3 on {port} does not answer: {error}") from None
        self._poller = PollingThread(
            self._transact, reopen=lambda: self._reopen(port), clock=self._clock
        )
        self._poller.start()
        if self._grip is not None:
            self._grip_poller = PollingThread(lambda _: self._read_grip(), clock=self._clock)
            self._grip_poller.start()

    def read(self, out: Reading) -> bool:
        """Fill the newest reading of the device and its grip; return whether it is new."""
        new = super().read(out)
        grip = self._grip_poller
        if self._poller is not None and grip is not None:
            held = self._grip_reading
            grip.take(held)
            out.pose[3:], out.twist[3:], out.buttons = held.pose[3:], held.twist[3:], held.buttons
            out.error = out.error or held.error
        return new

    def close(self) -> None:
        """Send zero and release the ports."""
        for poller in (self._poller, self._grip_poller):
            if poller is not None:
                poller.stop()
        self._poller = self._grip_poller = None
        self._drop()

    def _opened(self, port: str, kind: Callable[[Any], Any]) -> Any:
        _require_port(port)
        stream = self._api.SerialStream(port)
        self._streams.append(stream)
        return kind(stream)

    def _reopen(self, port: str) -> None:
        """Open the port again if it was gone; a device that is only silent is called again."""
        try:
            _require_port(port)
        except OSError:
            self._gone = True
            raise
        if self._gone:
            self._device = self._opened(port, self._api.Inverse3)
            self._device.set_read_timeout(_TIMEOUT)
            self._gone = False

    def _drop(self) -> None:
        # The device has to go before the stream that it uses.
        self._device = self._grip = None
        with contextlib.suppress(Exception):
            self._streams.clear()

    def _transact(self, wrench: tuple[float, ...]) -> Measurement:
        position, velocity = self._device.end_effector_force(list(wrench[:3]))
        x, y, z = position
        if x == 0.0 and y == 0.0 and z == 0.0:
            raise OSError("the Inverse3 does not answer")
        if not math.hypot(x, y, z) <= _FARTHEST or not all(map(math.isfinite, velocity)):
            raise OSError(f"the Inverse3 reports {x:.3g}, {y:.3g}, {z:.3g} m, out of reach")
        return Measurement((x, y, z), tuple(velocity))

    def _read_grip(self) -> Measurement:
        status = self._grip.GetVersegripStatus()
        orientation = unit_quaternion(*status["quaternion"])
        self._rate.add(self._clock(), orientation)
        nowhere = (0.0, 0.0, 0.0)
        return Measurement(nowhere, nowhere, orientation, self._rate.rate, int(status["buttons"]))


def attached() -> list[str]:
    """Return the ports of the connected Inverse3 devices; ImportError without the package."""
    import HaplyHardwareAPI as api  # noqa: N813

    return list(api.detect_inverse3s())


def _require_port(port: str) -> None:
    """Raise OSError if a port cannot be opened; the package reports nothing."""
    if os.name == "posix":
        os.close(os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
