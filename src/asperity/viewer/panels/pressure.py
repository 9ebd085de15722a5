"""The pressure on a soft body as a coloured map, of scenes that have one.

The loop passes on where the tool is, not the pressure of thousands of taxels. It follows from the
pose, so the page computes it, in a thread: without the friction, which depends on the motion, and
of an elastic body as it is at rest under the tool.
"""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene
from asperity.simulation.soft_engine import soft_engine
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.server.pace import step_back
from asperity.viewer.servo_client import ServoClient

_EVERY = 8
"""Page updates between two maps."""
_FADING = 0.98
"""Of the pressure that is lightest, from map to map: one scale for a while."""


class PressureMap(NamedTuple):
    """A map, and what is written below it."""

    image: NDArray[np.uint8]
    lightest: float
    """Pressure of the lightest colour [Pa]."""
    largest: float
    """Largest pressure [Pa]."""
    area: float
    """Of the contact [m^2]."""


def pressure_map(engine: Any, pose: NDArray[np.float64], lightest: float) -> PressureMap:
    """Return the map at a pose of the tool (7,), on a scale up to `lightest` [Pa] or more.

    `engine` is that of a soft body; see `soft_engine`.
    """
    from asperity.runs.pressure_figure import pressure_image  # slow to import

    engine.wrench(pose, 0.0)
    pressure = engine.skin.pressure
    largest = float(pressure.max())
    lightest = max(_FADING * lightest, largest, 1.0)
    return PressureMap(
        pressure_image(pressure, lightest), lightest, largest, engine.skin.contact_area
    )


class PressurePanel(Panel):
    """The map, while the scene has a soft body and a browser looks."""

    title = "Plots"

    def __init__(self) -> None:
        self._generation = -1
        self._scene: Scene | None = None
        self._engine: tuple[Scene, Any] | None = None
        self._pose: NDArray[np.float64] = np.zeros(7)
        self._lightest = 0.0
        self._making: Future[PressureMap] | None = None
        self._worker = ThreadPoolExecutor(1, "asperity-pressure", initializer=step_back)

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the map, hidden."""
        self._server, self._servo = server, servo
        black = np.zeros((256, 256, 3), np.uint8)
        self._image: Any = server.gui.add_image(black, label="pressure", visible=False)
        self._text: Any = server.gui.add_markdown("", visible=False)

    def update(self, frame: Frame) -> None:
        """Show the map that has been made, and have the next one made."""
        if frame.generation != self._generation:
            self._begin(frame.generation)
        self._show()
        waits = frame.number % _EVERY or self._making is not None or frame.snapshot is None
        if self._scene is None or waits or not self._server.get_clients():
            return
        pose = np.array(frame.snapshot.tool_pose)  # type: ignore[union-attr]
        if not np.array_equal(pose, self._pose):
            self._pose = pose
            self._making = self._worker.submit(self._made, self._scene, pose)

    def _begin(self, generation: int) -> None:
        scene = self._servo.config.scene
        self._generation, self._scene = generation, scene if scene.soft is not None else None
        self._lightest, self._pose = 0.0, np.zeros(7)
        self._image.visible = self._text.visible = self._scene is not None

    def _made(self, scene: Scene, pose: NDArray[np.float64]) -> PressureMap:
        if self._engine is None or self._engine[0] is not scene:
            self._engine = scene, soft_engine(scene)
        return pressure_map(self._engine[1], pose, self._lightest)

    def _show(self) -> None:
        job = self._making
        if job is None or not job.done():
            return
        self._making = None
        try:
            shown = job.result()
        except Exception:  # the page goes on without the map
            logging.getLogger(__name__).exception("the pressure cannot be drawn")
            self._scene = None
            return
        self._lightest = shown.lightest
        self._image.image = shown.image
        self._text.content = (
            f"black 0, light {1e-3 * shown.lightest:.3g} kPa; now at most "
            f"{1e-3 * shown.largest:.3g} kPa on {1e6 * shown.area:.3g} mm²"
            if shown.largest > 0.0
            else "no contact"
        )

    def close(self) -> None:
        """End the thread."""
        self._worker.shutdown(wait=False, cancel_futures=True)
