"""The fake Haply service and the real client of it, as one device to try asperity with.

The fake runs in a process of its own, as the real service does, so that it takes no time from the
servo. It ends when this process does, however that ends: its standard input is closed then.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.haply.service import HaplyServiceDevice
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import Limits, Reading

Motion = Literal["stroke", "still"]
MOTIONS = ("stroke", "still")


class HaplyFakeDevice:
    """An Inverse3 that is simulated behind a simulated service.

    Parameters
    ----------
    motion : str
        What the simulated hand does: `stroke` (to and fro, pressing by turns) or `still`.
    spelling : str
        Of forces, `vector` or `values`.
    limits : Limits
        As of the real one.
    clock : callable
        Monotonic time [s].
    """

    name = "haply-fake"

    def __init__(
        self,
        *,
        motion: Motion = "stroke",
        spelling: str = "vector",
        limits: Limits = PRESETS["inverse3"],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits = limits
        self._motion = require_choice("motion", motion, MOTIONS)
        self._make = lambda uri: HaplyServiceDevice(
            uri=uri, spelling=spelling, limits=limits, clock=clock
        )
        self._make("ws://127.0.0.1:1")  # refuses wrong options before anything is started
        self._process: subprocess.Popen[str] | None = None
        self._device: HaplyServiceDevice | None = None

    def open(self) -> None:
        """Start the service and connect to it."""
        if self._device is not None:
            return
        if find_spec("websockets") is None:
            raise AsperityError(
                "the fake Haply service needs websockets: pip install 'asperity[haply]'"
            )
        command = [
            sys.executable,
            "-m",
            "asperity.realtime.devices.haply.fake_service",
            self._motion,
        ]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for us; we then end it
        )
        assert self._process.stdout is not None
        uri = self._process.stdout.readline().strip()
        if not uri:
            self.close()
            raise AsperityError("the fake Haply service did not start")
        device = self._make(uri)
        try:
            device.open()
        except AsperityError:
            self.close()
            raise
        self._device = device

    def read(self, out: Reading) -> bool:
        """Fill the newest reading; return whether there was a new one."""
        if self._device is None:
            out.age, out.error = float("inf"), "the device is not open"
            return False
        return self._device.read(out)

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Send the force [N]."""
        if self._device is not None:
            self._device.write(wrench)

    def close(self) -> None:
        """Send zero, disconnect, and end the service."""
        device, self._device = self._device, None
        if device is not None:
            device.close()
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
