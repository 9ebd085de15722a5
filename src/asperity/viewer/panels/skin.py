"""Pressure and shear as a coloured map: on a soft body, or on a rigid tool on request.

The loop passes on where the tool is, not the tractions of thousands of taxels. They follow from
the pose, and friction from the motion, so the page computes them, in a thread: with the mean
velocity since its last update.
"""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.realtime.servo.snapshot import Snapshot
from asperity.runs.tool_taxels import field_engine
from asperity.scene.scene import Scene
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.panels.taxel_map import SteadyScale, taxel_map
from asperity.viewer.server.pace import step_back
from asperity.viewer.servo_client import ServoClient

_EVERY = 8
"""Page updates between two maps."""
_LONGEST = 0.2
"""Time between two updates beyond which they are no motion, as in a recording that leaps [s]."""
_SHOWN = 97.0
"""Percentile of the pressed taxels that the scale reaches: a few, on steep flanks, bear far more.
"""
_NONE = 1e-9
"""Shear over pressure that counts as none."""
NOTHING, PRESSURE = "nothing", "pressure"
SHEAR, RIGHT, UP = "shear: size, direction", "shear to the right", "shear up"
SHOWN = (NOTHING, PRESSURE, SHEAR, RIGHT, UP)
"""What the map can show."""


class Moved(NamedTuple):
    """Two poses of the tool (7,), and the time between them [s]; 0: at rest."""

    before: NDArray[np.float64]
    pose: NDArray[np.float64]
    seconds: float

    @property
    def moves(self) -> bool:
        """Whether the poses differ."""
        return self.seconds > 0.0 and not np.array_equal(self.before, self.pose)


class SkinMap(NamedTuple):
    """A map, and what is written below it."""

    image: NDArray[np.uint8]
    pressure: float
    """The largest [Pa]."""
    shear: float
    """The largest [Pa]."""
    area: float
    """Of the contact [m^2]."""
    size: tuple[float, float]
    """Of what is shown, along columns and along rows [m]."""


def skin_map(engine: Any, motion: Moved, shown: str, scales: dict[bool, SteadyScale]) -> SkinMap:
    """Return the map of a motion of the tool.

    Parameters
    ----------
    engine
        As `field_engine` returns it.
    motion : Moved
    shown : str
        One of `SHOWN`.
    scales : dict
        Of pressures (False), and of shears (True).
    """
    engine.reset()
    if motion.moves:  # else friction would be that of the last motion
        engine.wrench(motion.before, motion.seconds)
    engine.wrench(motion.pose, motion.seconds if motion.moves else 0.0)
    pressure, shear = engine.skin.pressure, engine.skin.shear
    size = np.hypot(shear[..., 0], shear[..., 1])
    values = pressure if shown == PRESSURE else size
    touched = values[values > 0.0]
    usual = float(np.percentile(touched, _SHOWN)) if touched.size else 0.0
    end = scales[shown != PRESSURE].update(usual)
    if shown in (PRESSURE, SHEAR):
        image = taxel_map(values, end, arrows=shear if shown == SHEAR else None)
    else:
        image = taxel_map(shear[..., int(shown == UP)], end, signed=True)
    first, last, low, high = engine.grid.extent
    return SkinMap(
        image, float(pressure.max()), float(size.max()), engine.skin.contact_area,
        (last - first, high - low),
    )  # fmt: skip


class SkinPanel(Panel):
    """The map, while a browser looks."""

    title = "Plots"

    def __init__(self) -> None:
        self._generation = -1
        self._scene: Scene | None = None
        self._engine: tuple[Scene, Any] | None = None
        self._last: Snapshot | None = None
        self._drawn: tuple[Any, ...] = ()
        self._scales: dict[bool, SteadyScale] = {}
        self._making: Future[SkinMap] | None = None
        self._worker = ThreadPoolExecutor(1, "asperity-skin", initializer=step_back)

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the map, hidden."""
        self._server, self._servo = server, servo
        black = np.zeros((256, 256, 3), np.uint8)
        self._kind: Any = server.gui.add_dropdown(
            "Map", SHOWN, visible=False,
            hint="Shear is what the other surface does to the skin; an arrow is the mean of a "
            "square. Right is along the columns of taxels, up along the rows.",
        )  # fmt: skip
        self._image: Any = server.gui.add_image(black, label="on what touches", visible=False)
        self._text: Any = server.gui.add_markdown("", visible=False)

    def update(self, frame: Frame) -> None:
        """Show the map that has been made, and have the next one made."""
        if frame.generation != self._generation:
            self._begin(frame.generation)
        self._show()
        self._image.visible = self._text.visible = self._kind.value != NOTHING
        last, self._last = self._last, frame.snapshot
        waits = frame.number % _EVERY or self._making is not None or frame.snapshot is None
        if self._scene is None or waits or not self._server.get_clients():
            return
        if self._kind.value == NOTHING:
            return
        motion = _motion(last, frame.snapshot)  # type: ignore[arg-type]
        shown = self._kind.value
        drawn = (shown, motion.moves, *motion.pose)
        if motion.moves or drawn != self._drawn:
            self._drawn = drawn
            self._making = self._worker.submit(self._made, self._scene, motion, shown)

    def _begin(self, generation: int) -> None:
        scene = self._servo.config.scene
        self._generation, self._scene = generation, scene
        self._last, self._drawn = None, ()
        self._scales = {False: SteadyScale(), True: SteadyScale()}
        # The area of a rigid contact is chosen, and a map of it costs a second search.
        self._kind.value = PRESSURE if scene.soft is not None else NOTHING
        self._kind.visible = True

    def _made(self, scene: Scene, motion: Moved, shown: str) -> SkinMap:
        if self._engine is None or self._engine[0] is not scene:
            self._engine = scene, field_engine(scene)
        if scene.elastic is not None:  # as it is at rest under the tool
            motion = Moved(motion.pose, motion.pose, 0.0)
        return skin_map(self._engine[1], motion, shown, self._scales)

    def _show(self) -> None:
        job = self._making
        if job is None or not job.done():
            return
        self._making = None
        try:
            made = job.result()
        except Exception:  # the page goes on without the map
            logging.getLogger(__name__).exception("what is on the skin cannot be drawn")
            self._scene = None
            return
        self._image.image = made.image
        # Less is what rounding leaves.
        shear = made.shear if made.shear > _NONE * made.pressure else 0.0
        wide, high = (1e3 * size for size in made.size)
        now = (
            f"Now at most {1e-3 * made.pressure:.3g} kPa pressure, {1e-3 * shear:.3g} kPa "
            f"shear, on {1e6 * made.area:.3g} mm²."
            if made.pressure > 0.0
            else "No contact."
        )
        self._text.content = f"{now} The map is {wide:.3g} x {high:.3g} mm large."

    def close(self) -> None:
        """End the thread."""
        self._worker.shutdown(wait=False, cancel_futures=True)


def _motion(last: Snapshot | None, now: Snapshot) -> Moved:
    """Return the motion from the last update's snapshot to this one's."""
    pose = np.array(now.tool_pose)
    seconds = now.time - last.time if last is not None else 0.0
    if last is None or not 0.0 < seconds < _LONGEST:
        return Moved(pose, pose, 0.0)
    return Moved(np.array(last.tool_pose), pose, seconds)
