"""The relief near the contact, drawn finely in the background while it is looked at."""

from __future__ import annotations

import logging
import time
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene
from asperity.viewer.drawables.shapes import Drawable, detail_of
from asperity.viewer.server.pace import step_back

_WIDER = 1.9
"""Radius of the detail when zoomed, over that of what is coloured."""
_MOVED, _EVERY = 0.35, 0.6
"""Way of the contact, over the radius, after which the detail is drawn again, and the least time
between two drawings [s].
"""


class Detail:
    """What is drawn finely near the contact: if zoomed or coloured by height, else nothing."""

    def __init__(self) -> None:
        self.zoomed, self.heights = False, False
        self.radius = 5e-3
        """[m]."""
        self.at: NDArray[np.float64] = np.full(3, np.inf)
        """Middle of the last request [m]."""
        self._scene: Scene | None = None
        self._of: tuple[bool, bool] = (False, False)
        self._requested = -np.inf
        self._shown: list[str] = []
        self._making: Future[list[Drawable]] | None = None
        self._worker = ThreadPoolExecutor(1, "asperity-detail", initializer=step_back)

    @property
    def wanted(self) -> bool:
        """Whether there is anything to show."""
        return self.zoomed or self.heights

    def begin(self, scene: Scene, radius: float) -> None:
        """Begin with another scene, and the radius of what is drawn finely [m]."""
        self._scene, self.radius = scene, radius
        self.at, self._making = np.full(3, np.inf), None

    def follow(self, scene: Scene, tool_pose: NDArray[np.float64], at: NDArray[np.float64]) -> None:
        """Have the detail drawn again if the contact, at (3,) [m], has moved."""
        of, now = (self.zoomed, self.heights), time.monotonic()
        moved = float(np.linalg.norm(at - self.at)) > _MOVED * self.radius
        if not self.wanted or self._making is not None or not (moved or of != self._of):
            return
        if now - self._requested < _EVERY or scene is not self._scene:
            return
        self.at, self._of, self._requested = at, of, now
        self._making = self._worker.submit(
            detail_of,
            scene,
            tool_pose.copy(),
            at,
            (_WIDER if self.zoomed else 1.0) * self.radius,
            heights=self.heights,
        )

    def gone(self) -> list[str]:
        """Return the names of the nodes to remove: what is not wanted any more."""
        if self.wanted or not self._shown:
            return []
        gone, self._shown = self._shown, []
        self._of, self.at = (False, False), np.full(3, np.inf)
        return gone

    def drawn(self) -> list[Drawable]:
        """Return what has been drawn since; its nodes replace those of the same names."""
        job = self._making
        if job is None or not job.done():
            return []
        self._making = None
        try:
            shapes = job.result()
        except Exception:  # the scene is shown without detail
            logging.getLogger(__name__).exception("the relief near the contact cannot be drawn")
            return []
        if not self.wanted:
            return []
        names = [f"{'/tool' if s.is_tool else '/scene'}/{s.name}" for s in shapes]
        self._shown = list({*self._shown, *names})
        return shapes

    def close(self) -> None:
        """End the thread."""
        self._worker.shutdown(wait=False, cancel_futures=True)
