"""The contacts at poses of a recording, which holds none: computed again, when they are looked at.

In a thread of its own, so that the page never waits for them; until they are there, the moment is
shown without. A contact of the recording was one to first order at times; here it is the whole one.
"""

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.contact_worker import SHOWN
from asperity.realtime.servo.snapshot import FIELDS, Snapshot
from asperity.realtime.servo.tick_row import slices

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.simulation.tool_contact import ToolContact
    from asperity.viewer.row_buffer import Kept

_TOOL = slices()["tool_pose"]
_NEAR = 50
"""Ticks; while it plays, the contacts of so many ticks before are shown rather than none."""


def empty_moment() -> Snapshot:
    """Return a moment in which nothing is and nothing was."""
    values = {
        name: np.zeros((0, *shape[1:])) if shape[0] == SHOWN else np.zeros(shape)
        for name, shape in FIELDS.items()
        if name != "shown"
    }
    return Snapshot(
        **{  # type: ignore[arg-type]
            name: (
                float(value[0]) if name in ("time", "tick_p99", "contact_p99") else int(value[0])
            )
            if value.shape == (1,)
            else value
            for name, value in values.items()
        }
    )


class ContactsAgain:
    """Moments with the contacts of kept rows, as soon as they are computed.

    Parameters
    ----------
    scene : Scene
    kept : Kept
    """

    def __init__(self, scene: Scene, kept: Kept) -> None:
        self._scene, self._kept = scene, kept
        self._none = empty_moment()
        self._wanted = -1
        self._done: tuple[int, Snapshot] = (-1, self._none)
        self._news = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="asperity-contacts", daemon=True)
        self._thread.start()

    def moment_at(self, i: int) -> Snapshot:
        """Return a moment with the contacts of a row, or without, as long as they are not known."""
        at, moment = self._done
        if i != self._wanted:
            self._wanted = i
            self._news.set()
        return moment if abs(at - i) < _NEAR else self._none

    def close(self) -> None:
        """End the thread."""
        self._closing = True
        self._news.set()

    def _work(self) -> None:
        from asperity.simulation.tool_contact import ToolContact

        try:
            stage = ToolContact(self._scene)
            while True:
                self._news.wait()
                self._news.clear()
                if self._closing:
                    return
                i = self._wanted
                self._done = i, self._evaluated(stage, self._kept.rows(i, i + 1)[0, _TOOL])
        except Exception:  # a recording can be looked at without
            logging.getLogger(__name__).exception("no contacts of the recording are shown")

    def _evaluated(self, stage: ToolContact, pose: NDArray[np.float64]) -> Snapshot:
        stage.reset()
        n = min(stage.evaluate(pose.copy(), jumped=True).count, SHOWN)
        contacts = stage.contacts
        return self._none._replace(
            point=contacts.point[:n].copy(), normal=contacts.normal[:n].copy(),
            force=contacts.force[:n].copy(), depth=contacts.depth[:n].copy(),
        )  # fmt: skip
