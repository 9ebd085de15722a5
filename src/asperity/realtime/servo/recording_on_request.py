"""Recording for a while, begun and ended while the loop runs.

Whoever has the rows of the loop, as a page does, hands them on to a recorder process of its own by
a ring of its own. The loop knows nothing of it. If the one who hands on is killed, the recorder
writes what it has and closes the file, as it does for a session.
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

import numpy as np
from numpy.typing import NDArray

from asperity import __version__
from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.process import RING
from asperity.realtime.servo.recorder import record
from asperity.realtime.servo.ring import TickRing
from asperity.realtime.shared_file import shared_folder
from asperity.scene.scene import Scene

ROOM = 30.0
"""Of rows in the ring [s]: a new process takes seconds to begin, on a busy machine more."""
ENDING = 30.0
"""How long the recorder may take to finish [s]."""


class RecorderOnRequest:
    """A recording that goes on from now until `finish`.

    Parameters
    ----------
    path : Path
        The recording; must not exist, but its folder must.
    attributes : mapping
        Texts and numbers to keep with it; see `attributes_of`.
    rate : float
        Ticks a second.
    """

    def __init__(self, path: Path, attributes: Mapping[str, Any], rate: float) -> None:
        if path.exists():
            raise AsperityError(f"{path} exists; give another name")
        self.path = path
        self.ticks = 0
        """So many were handed on."""
        self.seconds = 0.0
        """From the first of them to the last [s]."""
        self._first: float | None = None
        self._folder = shared_folder()
        self._ring = TickRing(self._folder / RING, int(ROOM * rate))
        spawn = multiprocessing.get_context("spawn")
        self._report, told = spawn.Pipe(duplex=False)
        self.process = spawn.Process(
            target=record, name="asperity-recorder",
            args=(self._folder / RING, path, dict(attributes), told),
        )  # fmt: skip
        self.process.start()
        told.close()

    def add(self, rows: NDArray[np.float64]) -> None:
        """Hand on rows (n, 30); their times become those since the first. Never waits."""
        if not len(rows):
            return
        if self._first is None:
            self._first = float(rows[0, 0])
        for row in rows:
            mine = row.copy()
            mine[0] -= self._first
            self._ring.push(mine)
        self.ticks += len(rows)
        self.seconds = float(rows[-1, 0]) - self._first

    @property
    def is_alive(self) -> bool:
        """Whether the recorder still takes rows."""
        return self.process.is_alive()

    def finish(self) -> dict[str, Any]:
        """Let the recorder write what there is and close the file; return what it has to say.

        `ticks` that were written, `ticks_lost` for want of room, and `error`, empty if all went
        well.
        """
        self._ring.close()
        told: dict[str, Any] = {"ticks": 0, "error": ""}
        try:
            if self._report.poll(ENDING):
                told = self._report.recv()
            else:
                told["error"] = f"the recorder did not finish within {ENDING:g} s"
        except EOFError:
            told["error"] = "the recorder was killed"
        self.process.join(2.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        told["ticks_lost"] = self._ring.lost
        shutil.rmtree(self._folder, ignore_errors=True)
        return told


def attributes_of(
    scene: Scene, parameters: LiveParameters, *, source: str, device: str = ""
) -> dict[str, Any]:
    """Return what is kept with a recording of a running loop, as its parameters are now."""
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
