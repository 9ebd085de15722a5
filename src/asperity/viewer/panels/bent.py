"""An elastic body as the tool bends it, computed in the background from where the tool is.

The loop passes on where the tool is, not how the body is bent: the page finds the body at rest
under the tool. Its surface is drawn in one colour, so that its vertices alone need be sent.
"""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.deformable.bent_shape import BentShape
from asperity.scene.scene import Scene
from asperity.viewer.drawables.shapes import Drawable
from asperity.viewer.server.pace import step_back

Array = NDArray[np.float64]


class Bent:
    """The shapes of a scene's elastic body, and where their vertices are."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._shapes: list[Drawable] = []
        self._pose: Array = np.zeros(7)
        self._parts: tuple[Scene, Any, dict[str, BentShape]] | None = None
        self._making: Future[dict[str, Array]] | None = None
        self._worker = ThreadPoolExecutor(1, "asperity-bent", initializer=step_back)

    def begin(self, scene: Scene, shapes: list[Drawable]) -> None:
        """Begin with another scene, and what is drawn of it."""
        self._scene, self._pose, self._making = scene, np.zeros(7), None
        self._shapes = [s for s in shapes if self.bends(s) and len(s.faces)]

    def bends(self, shape: Drawable) -> bool:
        """Return whether a shape is one of the elastic body."""
        solid = self._scene.elastic if self._scene is not None else None
        return solid is not None and shape.name.rpartition("-")[0] == solid.body.name

    def follow(self, scene: Scene, tool_pose: Array) -> None:
        """Have the body found at rest under the tool, unless that is being done."""
        waits = self._making is not None or not self._shapes or scene is not self._scene
        if waits or np.array_equal(tool_pose, self._pose):
            return
        self._pose = tool_pose.copy()
        self._making = self._worker.submit(self._found, scene, self._shapes, self._pose)

    def moved(self) -> dict[str, Array]:
        """Return the vertices (n, 3) [m] of shapes, by name, that have been found since."""
        job = self._making
        if job is None or not job.done():
            return {}
        self._making = None
        try:
            return job.result()
        except Exception:  # the body is shown as it is at rest
            logging.getLogger(__name__).exception("the elastic body cannot be drawn as it is bent")
            self._shapes = []
            return {}

    def _found(self, scene: Scene, shapes: list[Drawable], pose: Array) -> dict[str, Array]:
        if self._parts is None or self._parts[0] is not scene:
            from asperity.simulation.elastic_engine import ElasticEngine  # slow to import

            assert scene.elastic is not None
            data = mujoco.MjData(scene.model)
            mujoco.mj_kinematics(scene.model, data)
            at = data.body(scene.elastic.body.name)
            home, surface = np.concatenate([at.xpos, at.xquat]), scene.elastic.surface
            made = {s.name: BentShape(surface, home, s.vertices, s.normals) for s in shapes}
            self._parts = scene, ElasticEngine(scene, scene.elastic), made
        _, engine, bent = self._parts
        engine.wrench(pose, 0.0)
        return {name: shape.moved(engine.displacements)[0] for name, shape in bent.items()}

    def close(self) -> None:
        """End the thread."""
        self._worker.shutdown(wait=False, cancel_futures=True)
