"""The servo process: it alone opens the device, and it sends zero before it ends.

The parent starts the process and watches it; the process watches its parent in turn. It sends zero,
closes the device and ends on `Mailbox.stop`, when its time is over, when the parent is gone, on
SIGINT, SIGTERM or SIGHUP, and after any exception. It checks for all of these after each tick, so
zero is sent within two ticks. After SIGKILL or a power failure nothing is sent; what a device does
when writes stop is in its maker's documentation.
"""

from __future__ import annotations

import logging
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.cores import usable_cores
from asperity.dynamics.passivity.controller import MOST_DAMPING, PassivityController
from asperity.errors import AsperityError
from asperity.realtime.devices.catalogue import device
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.devices.protocol import Device, Limits
from asperity.realtime.devices.simulated import SimulatedDevice
from asperity.realtime.servo import scheduling
from asperity.realtime.servo.contact_worker import SEARCHED, WITHIN, WITHIN_SHARED, ContactWorker
from asperity.realtime.servo.deadlines import SystemClock
from asperity.realtime.servo.ipc import MAILBOX, RING, SNAPSHOT, Mailbox, ParentProcess, TickRing
from asperity.realtime.servo.loop import GUARD, ServoLoop
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.safety import SafeDevice, SafetySettings
from asperity.realtime.servo.snapshot import SHOWN_RATE, SnapshotWriter
from asperity.realtime.shared_file import remove_shared_folder
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory
from asperity.simulation.press import touching_pose
from asperity.simulation.simulation import Simulation
from asperity.simulation.tool_contact import ToolContact

_GO_POLLING = 1e-3
"""Interval at which a held loop checks for its release [s]."""
_CLEARANCE = 2e-3
"""Height of the tool above the surface when a session begins [m]."""
_QUICK = 0.5
"""Largest share of a tick for a contact to run on the loop's core; project default."""


@dataclass(frozen=True, kw_only=True)
class LoopSettings:
    """How a servo loop runs, whatever the scene and the device.

    Parameters
    ----------
    rate : float
        Ticks per second [Hz].
    seconds : float, optional
        Duration [s]. Default: until stopped.
    passivity : bool
        Whether the passivity controller may change the wrench; it keeps its energy account anyway.
    mapping : dict
        Options of `Mapping`.
    safety : SafetySettings
    real_time : RealTime
    """

    rate: float = 1000.0
    seconds: float | None = None
    passivity: bool = True
    mapping: dict[str, Any] = field(default_factory=dict)
    safety: SafetySettings = field(default_factory=SafetySettings)
    real_time: scheduling.RealTime = field(default_factory=scheduling.RealTime)

    def loop_settings(self) -> dict[str, Any]:
        """Return these settings by name."""
        return {setting.name: getattr(self, setting.name) for setting in fields(LoopSettings)}


@dataclass(frozen=True)
class ServoSpec(LoopSettings):
    """Everything that a servo process needs; pickled to be sent there.

    Besides these parameters it has those of `LoopSettings`, by name.

    Parameters
    ----------
    scene : Scene
    make_device : callable
        Returns the device, not opened. It has to be importable: a module-level function, or a
        `functools.partial` of one.
    in_scene : bool
        Whether the device's poses are already those of the scene, as a replay's are. Otherwise the
        hand's first pose is mapped to the tool's, just above the surface.
    start : tuple of 7 floats, optional
        Where the hand's first pose is mapped to, unless `in_scene`. Default: just above the
        surface.
    held : bool
        Wait for `Servo.go`, with everything ready, before opening the device.
    folders : tuple of Path
        Other shared folders of the parent, to be removed if it is gone.
    guard : float
        Share of a tick kept free after the contact in the direct mode; see `loop.GUARD`.
    """

    scene: Scene
    make_device: Callable[[], Device]
    in_scene: bool = False
    start: tuple[float, ...] | None = None
    held: bool = False
    folders: tuple[Path, ...] = ()
    guard: float = GUARD


def named_device(name: str, options: dict[str, Any]) -> Device:
    """Return a device of the catalogue; deprecated: use `functools.partial(device, name)`."""
    warnings.warn("named_device is deprecated: use device", DeprecationWarning, stacklevel=2)
    return device(name, **options)


def simulated_device(scene: Scene, motion: ScriptedMotion | Trajectory, dt: float) -> Device:
    """Return a device in a simulated hand that follows a motion through a scene.

    The hand lowers its press force in step with the device's soft start: a hand that leans on a
    surface which does not push back yet would fall through it.
    """
    hand = Simulation(scene, dt=dt).hand(motion, press_in=SafetySettings().soft_start)
    return SimulatedDevice(hand)


def serve(spec: ServoSpec, folder: Path, report: Connection, recorded: bool) -> None:
    """Run the loop: the main function of the process.

    Sends ("held", {}) to `report` when a held loop is ready, ("ready", {...}) when ticking begins,
    and finally ("done", summary) or ("failed", text). If the session is `recorded`, the recorder
    removes the shared folder of a parent that is gone.
    """
    signals: list[str] = []
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_, name=name: signals.append(name))
    parent = ParentProcess()
    ring = TickRing(folder / RING) if (folder / RING).exists() else None

    def stop_reason() -> str:
        if signals:
            return signals[0]
        return "the parent process is gone" if parent.is_gone() else ""

    try:
        summary = _run(spec, folder, ring, report, stop_reason)
    except AsperityError as error:
        _send(report, ("failed", str(error)))
    except BaseException as error:
        text = " ".join(traceback.format_exception_only(error)).strip()
        logging.getLogger(__name__).debug("in the servo process", exc_info=True)
        _send(report, ("failed", f"the servo loop failed: {text}"))
    else:
        _send(report, ("done", summary))
    finally:
        if ring is not None:
            ring.close()
        if parent.is_gone():
            for orphan in (*([] if recorded else [folder]), *spec.folders):
                remove_shared_folder(orphan)


def _run(
    spec: ServoSpec,
    folder: Path,
    ring: TickRing | None,
    report: Connection,
    stop_reason: Callable[[], str],
) -> dict[str, Any]:
    """Build the loop, run it, and return its summary."""
    clock = SystemClock()
    parameters = LiveParameters.of(spec.scene, spec.rate)
    granted = scheduling.request(replace(spec.real_time, core=None))
    stage = ToolContact(spec.scene, dt=parameters.dt)
    start, contact_seconds = _warm_up(stage, spec.scene.start)
    if spec.start is not None:
        start = np.array(spec.start, dtype=np.float64)
    device = SafeDevice(spec.make_device(), dt=parameters.dt, settings=spec.safety)
    # In the direct mode the contact has to be done when `guard` of the tick is left; a tenth of
    # the tick is kept for handing it over.
    share = 0.9 - spec.guard if spec.scene.coupling.mode == "direct" else 1.0
    worker = ContactWorker(stage, clock, min(WITHIN, share), min(SEARCHED, share - 0.1))
    # Only now, as threads inherit the affinity: the worker may run on any other core.
    granted |= scheduling.request(replace(scheduling.RealTime(), core=spec.real_time.core))
    quick = contact_seconds < _QUICK * parameters.dt
    core, busy = _shared_core(spec.real_time, quick, in_loop=device.in_loop)
    granted["between_ticks"] = "its core is kept busy" if busy else "asleep"
    loop = ServoLoop(
        device,
        Mapping(device.limits, **spec.mapping),
        parameters.tool(spec.scene, _in_scene(spec, device.limits)),
        worker,
        PassivityController(
            parameters.dt,
            active=spec.passivity,
            max_damping=min(MOST_DAMPING, device.limits.max_damping),
        ),
        dt=parameters.dt,
        clock=clock,
        guard=spec.guard,
        ring=ring,
        snapshot=SnapshotWriter(folder / SNAPSHOT),
        snapshot_every=max(1, round(spec.rate / SHOWN_RATE)),
        shares=core is not None,
        busy=busy,
    )
    mailbox = Mailbox(folder / MAILBOX)
    between = _BetweenTicks(spec, loop, mailbox, stop_reason)
    ticks = None if spec.seconds is None else round(spec.seconds * spec.rate)
    try:
        if spec.held:
            _send(report, ("held", {}))
            while not mailbox.may_go:
                if stop_reason() or mailbox.must_stop:
                    raise AsperityError("the loop was stopped before it began")
                clock.sleep(_GO_POLLING)
        if busy:
            device.open()  # before the loop is bound to the core, which its threads would inherit
        if core is not None:
            granted["contacts"] = scheduling.share_core(core, [0, worker.thread])
            worker.within = min(worker.within, WITHIN_SHARED)
        if not busy:
            device.open()  # its threads share the loop's core: no other has to be woken
        loop.begin(None if spec.in_scene else start)
        _send(report, ("ready", {"limits": device.limits, "device": device.name, "core": core}))
        loop.run(ticks=ticks, between=between)
    finally:
        device.close()
        worker.stop()
    return {
        "timing": loop.stats.summary(),
        "safety": device.summary(),
        "passivity": loop.passivity.summary(),
        "device": device.name,
        "tool_resets": loop.tool.resets,
        "status": worker.statuses.tolist(),
        "real_time": granted,
        "ended": between.reason or "its time was over",
        "lost_by_recorder": ring.lost if ring is not None else 0,
    }


def _shared_core(
    wanted: scheduling.RealTime, quick: bool, *, in_loop: bool
) -> tuple[int | None, bool]:
    """Return the core that loop and contacts share, if any, and whether to keep it busy.

    Parameters
    ----------
    wanted : RealTime
    quick : bool
        Whether a contact takes little of a tick.
    in_loop : bool
        Whether no thread, process or service works for the device.
    """
    if not (wanted.share_core and quick) or wanted.priority or wanted.core is not None:
        return None, False
    core = scheduling.pick_core()
    # The recorder needs a core besides the loop's, and so does a device's thread or service.
    needed = 2 if in_loop else 3
    busy = core is not None and wanted.busy_wait and usable_cores() >= needed
    return core, busy


def _in_scene(spec: ServoSpec, limits: Limits) -> Limits:
    """Return a device's limits with its largest force as one of the scene."""
    return replace(limits, max_force=limits.max_force / spec.mapping.get("force_scale", 1.0))


class _BetweenTicks:
    """Checked by the loop after each tick: takes new parameters, and returns whether to stop."""

    def __init__(
        self, spec: ServoSpec, loop: ServoLoop, mailbox: Mailbox, stop_reason: Callable[[], str]
    ) -> None:
        self._spec, self._loop, self._mailbox = spec, loop, mailbox
        self._stop_reason = stop_reason
        self.reason = ""

    def __call__(self) -> bool:
        self.reason = self._stop_reason() or ("stopped" if self._mailbox.must_stop else "")
        news = self._mailbox.news()
        if news is not None and not self.reason:
            self._change(LiveParameters.from_plain(news))
        return bool(self.reason)

    def _change(self, parameters: LiveParameters) -> None:
        """Replace all parameters between two ticks."""
        loop, scene = self._loop, self._spec.scene
        tool = parameters.tool(scene, _in_scene(self._spec, loop.device.limits))
        tool.reset(loop.tool.pose)
        loop.contacts.stage.change(
            force=parameters.force(scene.force), dt=parameters.dt, coupling=parameters.coupling
        )
        loop.tool = tool
        if parameters.dt != loop.dt:
            loop.passivity.dt = parameters.dt
            loop.set_tick(parameters.dt)


def _warm_up(stage: ToolContact, drawn: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Compile and load everything that a contact needs.

    Returns
    -------
    start : (7,) array
        Pose in free air just above the surface, for the tool to begin at.
    seconds : float
        Median duration of a contact [s].
    """
    start = touching_pose(stage.engine, drawn)
    stage.reset()
    pose = start.copy()
    for step in range(8):
        pose[2] = start[2] - 1e-5 * step
        pose[0] = start[0] + 1e-4 * step
        stage.evaluate(pose)
    seconds = []
    for _ in range(9):
        begun = time.perf_counter()
        stage.evaluate(pose, jumped=True)
        seconds.append(time.perf_counter() - begun)
    stage.reset()
    start[2] += _CLEARANCE
    return start, float(np.median(seconds))


def _send(report: Connection, message: tuple[str, Any]) -> None:
    """Send a message to the parent, if it is still there."""
    try:
        report.send(message)
    except OSError:
        logging.getLogger(__name__).debug("the parent is gone; nobody receives reports")
