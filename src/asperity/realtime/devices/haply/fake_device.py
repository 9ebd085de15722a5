"""The device `haply-fake`: a simulated service and the real client of it, to try without hardware.

The service runs in its own process, as the real one does, so that it takes no time from the servo
loop. It ends when this process does, in whatever way, because its standard input is closed then.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Literal

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.haply.service import HaplyServiceDevice
from asperity.realtime.devices.presets import PRESETS
from asperity.realtime.devices.protocol import Limits

Motion = Literal["stroke", "still"]
MOTIONS = ("stroke", "still")


class HaplyFakeDevice(HaplyServiceDevice):
    """A simulated Inverse3 behind a simulated service.

    Parameters
    ----------
    motion : str
        What the simulated hand does: `stroke` (to and fro, pressing at times) or `still`.
    spelling : str
        Of forces, `vector` or `values`.
    limits : Limits
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
        super().__init__(spelling=spelling, limits=limits, clock=clock)
        self._motion = require_choice("motion", motion, MOTIONS)
        self._process: subprocess.Popen[str] | None = None

    def open(self) -> None:
        """Start the service and connect to it."""
        if self._process is not None:
            return
        if find_spec("websockets") is None:
            raise AsperityError(
                "the fake Haply service needs websockets: pip install 'asperity[haply]'"
            )
        self._process = subprocess.Popen(
            [sys.executable, "-m", "asperity.realtime.devices.haply.fake_service", self._motion],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C ends this process, which then ends the service
        )
        assert self._process.stdout is not None
        self._uri = self._process.stdout.readline().strip()
        try:
            if not self._uri:
                raise AsperityError("the fake Haply service did not start")
            super().open()
        except AsperityError:
            self.close()
            raise

    def close(self) -> None:
        """Send zero, disconnect, and end the service."""
        super().close()
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
