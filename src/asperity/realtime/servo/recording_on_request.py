"""Recordings that begin and end while a loop runs.

Whoever takes the loop's ticks, such as a page, passes them to a recorder process through a second
ring; the loop is not involved. If the page's process is killed, the recorder writes what it has and
closes the file, as it does for a session.
"""

from __future__ import annotations

import json
import multiprocessing
import shutil
import time
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict
from pathlib import Path
from typing import Any

from asperity import __version__
from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import TickRing, Ticks
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.process import RING
from asperity.realtime.servo.recorder import record
from asperity.realtime.shared_file import shared_folder
from asperity.scene.scene import Scene

RING_SECONDS = 30.0
"""Capacity of the ring [s]: a new process takes seconds to start, more on a busy machine."""
ENDING = 30.0
"""Time limit for the recorder to finish [s]."""


class RecorderOnRequest:
    """A recording that runs from its creation until `finish`.

    Parameters
    ----------
    path : Path
        The recording. It must not exist; its folder must.
    attributes : mapping
        Strings and numbers to store with it; see `attributes_of`.
    rate : float
        Ticks per second [Hz].
    """

    def __init__(self, path: Path, attributes: Mapping[str, Any], rate: float) -> None:
        if path.exists():
            raise AsperityError(f"{path} exists; give another name")
        self.path = path
        self.ticks = 0
        """Ticks passed to the recorder."""
        self.seconds = 0.0
        """Time from the first to the last of them [s]."""
        self._first: float | None = None
        self._folder = shared_folder()
        self._ring = TickRing(self._folder / RING, int(RING_SECONDS * rate))
        spawn = multiprocessing.get_context("spawn")
        self._report, theirs = spawn.Pipe(duplex=False)
        self.process = spawn.Process(
            target=record, name="asperity-recorder",
            args=(self._folder / RING, path, dict(attributes), theirs),
        )  # fmt: skip
        self.process.start()
        theirs.close()

    def add(self, ticks: Ticks) -> None:
        """Pass on ticks (n,); their times start at 0. Never waits."""
        if not len(ticks):
            return
        if self._first is None:
            self._first = float(ticks["time"][0])
        shifted = ticks.copy()
        shifted["time"] -= self._first
        for tick in shifted:
            self._ring.push(tick)
        self.ticks += len(ticks)
        self.seconds = float(ticks["time"][-1]) - self._first

    @property
    def is_alive(self) -> bool:
        """Whether the recorder still takes ticks."""
        return self.process.is_alive()

    def finish(self) -> dict[str, Any]:
        """Let the recorder write what it has and close the file; return its result.

        Returns
        -------
        dict
            `ticks` written, `ticks_lost` because the ring was full, and `error`, empty if there was
            none.
        """
        self._ring.close()
        result: dict[str, Any] = {"ticks": 0, "error": ""}
        try:
            if self._report.poll(ENDING):
                result = self._report.recv()
            else:
                result["error"] = f"the recorder did not finish within {ENDING:g} s"
        except EOFError:
            result["error"] = "the recorder was killed"
        self.process.join(2.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        result["ticks_lost"] = self._ring.lost
        shutil.rmtree(self._folder, ignore_errors=True)
        return result


def attributes_of(
    scene: Scene, parameters: LiveParameters, *, source: str, device: str = ""
) -> dict[str, Any]:
    """Return the attributes of a recording of a running loop with its present parameters."""
    document = deepcopy(dict(scene.document))
    force = {"stiffness": parameters.stiffness, "friction": parameters.friction}
    document["force"] = {**document.get("force", {}), **force}
    coupling = parameters.coupling
    document["coupling"] = {k: v for k, v in asdict(coupling).items() if v is not None}
    return {
        "scene": scene.name, "source": source, "trajectory": "device", "device": device,
        "dt": parameters.dt, "anti_alias": scene.anti_alias, "coupling": coupling.mode,
        "hand": "device", "contact_lag": int(coupling.mode != "direct"), "version": __version__,
        "document": json.dumps(document), "notes": "\n".join(scene.notes),
        "begun": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }  # fmt: skip
