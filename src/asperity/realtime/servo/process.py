"""The servo process: it alone opens the device, and it sends zero before it ends.

Whoever starts it, the parent, watches it; it watches its parent in turn. It ends, having sent zero
and closed the device, when it is told to (`Mailbox.stop`), when its time is over, when its parent
is gone, on SIGINT, SIGTERM or SIGHUP, and after any exception. All of these are looked for after
each tick, so that zero is on its way within two ticks. After SIGKILL, or when the machine stops,
nobody is left to send anything: what a device does when it is written to no more, its documentation
says.
"""

from __future__ import annotations

import logging
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.passivity.controller import MOST_DAMPING, PassivityController
from asperity.errors import AsperityError
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.devices.protocol import Device
from asperity.realtime.servo import scheduling
from asperity.realtime.servo.contact_worker import SEARCHED, WITHIN, WITHIN_SHARED, ContactWorker
from asperity.realtime.servo.deadlines import SystemClock
from asperity.realtime.servo.loop import GUARD, ServoLoop
from asperity.realtime.servo.mailbox import Mailbox
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.parent_watch import Parent, clear_up
from asperity.realtime.servo.publish import SHOWN_RATE, Publisher
from asperity.realtime.servo.ring import TickRing
from asperity.realtime.servo.safety import SafeDevice, SafetySettings
from asperity.realtime.servo.snapshot import SnapshotWriter
from asperity.scene.scene import Scene
from asperity.simulation.press import touching_pose
from asperity.simulation.tool_contact import ToolContact

RING, SNAPSHOT, MAILBOX = "ring", "snapshot", "mailbox"
"""Names of the files in the shared folder."""
_LOOKED = 1e-3
"""How often a loop that is held looks whether it may go [s]."""
_CLEARANCE = 2e-3
"""How far above the surface the tool is when a session begins [m]."""
_QUICK = 0.5
"""Part of a tick that a contact may take to share the loop's core; ours."""


@dataclass(frozen=True)
class ServoSpec:
    """Everything a servo process needs to know; it is pickled to get there.

    Parameters
    ----------
    scene : Scene
    make_device : callable
        Returns the device, not opened. Has to be importable: a function of a module, or a
        `functools.partial` of one.
    in_scene : bool
        The device's poses are those of the scene already, as a replay's are. Otherwise the hand's
        first pose becomes the tool's, just above the surface.
    start : tuple of 7 floats, optional
        Where the hand's first pose is to be, unless `in_scene`. Default: just above the surface.
    held : bool
        Wait for `Servo.go`, with everything ready, before the device is opened.
    folders : tuple of Path
        Other shared folders of the parent's, to be removed when it is gone.
    rate : float
        Ticks a second.
    seconds : float, optional
        How long. Default: until it is stopped.
    guard : float
        See `loop.GUARD`.
    passivity : bool
        Whether the passivity controller may change the wrench; it keeps its account anyway.
    mapping : dict
        Options of `Mapping`.
    safety : SafetySettings
    real_time : RealTime
    """

    scene: Scene
    make_device: Callable[[], Device]
    in_scene: bool = False
    start: tuple[float, ...] | None = None
    held: bool = False
    folders: tuple[Path, ...] = ()
    rate: float = 1000.0
    seconds: float | None = None
    guard: float = GUARD
    passivity: bool = True
    mapping: dict[str, Any] = field(default_factory=dict)
    safety: SafetySettings = field(default_factory=SafetySettings)
    real_time: scheduling.RealTime = field(default_factory=scheduling.RealTime)


def serve(spec: ServoSpec, folder: Path, report: Connection, recorded: bool) -> None:
    """Run the loop; this is what the process does.

    Tells `report` ("ready", {...}) when ticking begins, then ("done", summary) or ("failed", text);
    before all that ("held", {}), if it is. If it is `recorded`, the recorder clears up.
    """
    stopped: list[str] = []
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_, name=name: stopped.append(name))
    parent = Parent()
    ring = TickRing(folder / RING) if (folder / RING).exists() else None
    try:
        summary = _served(spec, folder, ring, report, lambda: _why(stopped, parent))
    except AsperityError as error:
        _tell(report, ("failed", str(error)))
    except BaseException as error:
        told = " ".join(traceback.format_exception_only(error)).strip()
        logging.getLogger(__name__).debug("in the servo process", exc_info=True)
        _tell(report, ("failed", f"the servo loop failed: {told}"))
    else:
        _tell(report, ("done", summary))
    finally:
        if ring is not None:
            ring.close()
        if parent.is_gone():
            for gone in (*([] if recorded else [folder]), *spec.folders):
                clear_up(gone)


def _served(
    spec: ServoSpec, folder: Path, ring: TickRing | None, report: Connection, why: Callable[[], str]
) -> dict[str, Any]:
    """Make the loop, run it, and return what there is to say of it."""
    clock = SystemClock()
    parameters = LiveParameters.of(spec.scene, spec.rate)
    told = scheduling.ask(replace(spec.real_time, core=None))
    stage = ToolContact(spec.scene, dt=parameters.dt)
    start, took = _warmed_up(stage, spec.scene.start)
    if spec.start is not None:
        start = np.array(spec.start, dtype=np.float64)
    made = spec.make_device()
    device = SafeDevice(made, dt=parameters.dt, settings=spec.safety)
    # In the direct mode the loop waits for the contact, but for `guard`; a tenth hands it over.
    left = 0.9 - spec.guard if spec.scene.coupling.mode == "direct" else 1.0
    worker = ContactWorker(stage, clock, min(WITHIN, left), min(SEARCHED, left - 0.1))
    # The core is the loop's alone: the worker, begun before, may be on any other.
    told |= scheduling.ask(replace(scheduling.RealTime(), core=spec.real_time.core))
    asked = spec.real_time
    alone = asked.priority or asked.core is not None
    core = None
    if asked.share_core and not alone and took < _QUICK * parameters.dt:
        core = scheduling.any_core()
    # The recorder needs a core, and so does who else works for the device.
    needed = 2 if getattr(made, "in_loop", False) else 3
    busy = core is not None and asked.busy_wait and scheduling.usable_cores() >= needed
    told["between_ticks"] = "its core is kept busy" if busy else "asleep"
    loop = ServoLoop(
        device,
        Mapping(device.limits, **spec.mapping),
        parameters.tool(spec.scene, device.limits),
        worker,
        PassivityController(
            parameters.dt,
            active=spec.passivity,
            max_damping=min(MOST_DAMPING, device.limits.max_damping),
        ),
        dt=parameters.dt,
        clock=clock,
        guard=spec.guard,
        publisher=Publisher(
            ring,
            SnapshotWriter(folder / SNAPSHOT),
            every=max(1, round(spec.rate / SHOWN_RATE)),
        ),
        shares=core is not None,
        busy=busy,
    )
    mailbox = Mailbox(folder / MAILBOX)
    between = _Between(spec, loop, mailbox, why)
    ticks = None if spec.seconds is None else round(spec.seconds * spec.rate)
    try:
        if spec.held:
            _tell(report, ("held", {}))
            while not mailbox.may_go:
                if why() or mailbox.must_stop:
                    raise AsperityError("the loop was told to stop before it began")
                clock.sleep(_LOOKED)
        if busy:
            device.open()  # any threads of its stay off the core that the loop keeps busy
        if core is not None:
            told["contacts"] = scheduling.share_core(core, [0, worker.thread])
            worker.within = min(worker.within, WITHIN_SHARED)
        if not busy:
            device.open()  # they are on the loop's core too: handing over wakes no other
        loop.begin(None if spec.in_scene else start)
        ready = {"limits": device.limits, "device": device.name, "core": core}
        _tell(report, ("ready", ready))
        loop.run(ticks=ticks, between=between)
    finally:
        device.close()
        worker.stop()
    return {
        "timing": loop.stats.told(),
        "safety": device.told(),
        "passivity": loop.passivity.told(),
        "device": device.name,
        "tool_resets": loop.tool.resets,
        "status": worker.statuses.tolist(),
        "real_time": told,
        "ended": between.why or "its time was over",
        "lost_by_recorder": ring.lost if ring is not None else 0,
    }


def _why(stopped: list[str], parent: Parent) -> str:
    """Return what ends the loop from outside, or nothing."""
    if stopped:
        return stopped[0]
    return "the parent process is gone" if parent.is_gone() else ""


class _Between:
    """What the loop looks at after each tick; returns whether to stop."""

    def __init__(
        self, spec: ServoSpec, loop: ServoLoop, mailbox: Mailbox, ask: Callable[[], str]
    ) -> None:
        self._spec, self._loop, self._mailbox, self._ask = spec, loop, mailbox, ask
        self.why = ""

    def __call__(self) -> bool:
        self.why = self._ask() or ("told to stop" if self._mailbox.must_stop else "")
        news = self._mailbox.news()
        if news is not None and not self.why:
            self._change(LiveParameters.from_plain(news))
        return bool(self.why)

    def _change(self, parameters: LiveParameters) -> None:
        """Swap all parameters, between two ticks."""
        loop, scene = self._loop, self._spec.scene
        tool = parameters.tool(scene, loop.device.limits)
        tool.reset(loop.tool.pose)
        stage = loop.contacts.stage  # type: ignore[attr-defined]
        stage.change(force=parameters.force(scene.force), dt=parameters.dt)
        loop.tool = tool
        if parameters.dt != loop.dt:
            loop.passivity.dt = parameters.dt
            loop.set_tick(parameters.dt)


def _warmed_up(stage: ToolContact, drawn: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Compile and load all that a contact needs.

    Return where the tool begins, in free air, and how long a contact takes [s].
    """
    start = touching_pose(stage.engine, drawn)
    stage.reset()
    pose = start.copy()
    for step in range(8):
        pose[2] = start[2] - 1e-5 * step
        pose[0] = start[0] + 1e-4 * step
        stage.evaluate(pose)
    took = []
    for _ in range(9):
        begun = time.perf_counter()
        stage.evaluate(pose, jumped=True)
        took.append(time.perf_counter() - begun)
    stage.reset()
    start[2] += _CLEARANCE
    return start, float(np.median(took))


def _tell(report: Connection, what: tuple[str, Any]) -> None:
    try:
        report.send(what)
    except OSError:  # the parent is gone
        logging.getLogger(__name__).debug("nobody to report to")
