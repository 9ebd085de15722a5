"""The page's client of the servo process: reads its ticks and snapshots, sends it changes.

The page takes no part in a tick. It reads the snapshot and the ring, and writes parameters and the
mouse's target, all of them in shared files. So the page may be slow, and browsers may
come, go, or be killed.

A texture, force law, device or scene cannot be changed through the mailbox: it needs a new contact
solver. The client then starts a second servo process beside the first, which compiles and warms up;
only when that is ready does the first end and the second begin, where the hand is. The ticking
process is not involved, so its ticks are not delayed. While the device is opened again the hand
feels nothing; after that the force rises softly.
"""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.devices.pointer_file import PointerFile
from asperity.realtime.servo.ipc import Ticks
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.snapshot import Snapshot
from asperity.realtime.shared_file import shared_folder
from asperity.viewer.change_history import ChangeHistory, State, changed_parameters
from asperity.viewer.motions import CannedMotion, motion_table
from asperity.viewer.session_config import SessionConfig
from asperity.viewer.tick_buffer import TickBuffer

READ_RATE = 60.0
"""Rate at which ticks are fetched [Hz]."""
_GAP = 1e-3
_FIRST_TICK = 30.0
"""Time limit for the first tick of a loop that has opened its device [s]."""


class ServoClient:
    """A client of a servo process, which it replaces when that is needed.

    Parameters
    ----------
    config : SessionConfig
        Of the first servo process.

    Attributes
    ----------
    state : str
        "starting", "running", "changing" (running, while another process is made ready), "ended".
    message : str
        Why the loop ended, or why the last change failed; one line for the user.
    generation : int
        Number of servo processes that have begun to tick.
    """

    def __init__(self, config: SessionConfig) -> None:
        self.config = config
        self.state, self.message, self.generation = "starting", "", 0
        self.device = ""
        """Name of the device."""
        self.history = TickBuffer()
        self.result: dict[str, Any] = {}
        """Summary of the last servo process that ended."""
        self._folder = shared_folder()
        self.pointer = PointerFile(self._folder / "pointed", config.first_pose)
        self.target = config.first_pose
        """Target of the mouse's hand (7,)."""
        self._servo: Servo | None = None
        self._seen: tuple[Servo | None, Snapshot | None] = None, None
        """The last snapshot that was read, and the servo process it came from."""
        self._lock = threading.RLock()
        self._subscribers: list[Callable[[Ticks], None]] = []
        self._shift = 0.0
        self._kept: dict[str, Any] = {}
        self.changes = ChangeHistory()
        """States before the user's changes, which `undo` returns to."""
        self._first = config
        self._restarting = ThreadPoolExecutor(1, "asperity-restart")
        self._begun, self._closing = threading.Event(), threading.Event()
        self._reader = threading.Thread(target=self._read, name="asperity-ticks", daemon=True)

    # -- reading -------------------------------------------------------------------------------

    def latest(self) -> Snapshot | None:
        """Return the snapshot to be shown: the loop's latest, or None before the first."""
        return self.live()

    def live(self) -> Snapshot | None:
        """Return the loop's latest snapshot, or None before the first."""
        servo = self._servo
        if servo is None or self.generation == 0:
            return None
        snapshot = None
        with contextlib.suppress(AsperityError):
            snapshot = servo.snapshot()
        if snapshot is None:
            # The loop was interrupted or killed during a write: return the one before.
            of, seen = self._seen
            return seen if of is servo else None
        self._seen = servo, snapshot
        return snapshot

    def ticks_since(self, number: int) -> tuple[Ticks, int]:
        """Return the kept ticks (n,) from a number on, and the number of the next tick to come.

        The records have dtype `ipc.TICK`. Their time continues from one servo process to the next.
        """
        return self.history.since(number)

    def subscribe(self, take: Callable[[Ticks], None]) -> Callable[[], None]:
        """Call `take` with all new ticks (n,) in the reader's thread; return how to unsubscribe.

        `take` must be quick and must not raise.
        """
        self._subscribers.append(take)
        return lambda: self._subscribers.remove(take)

    @property
    def is_alive(self) -> bool:
        """Whether a loop ticks."""
        servo = self._servo
        return servo is not None and self.state in ("running", "changing") and servo.is_alive

    @property
    def parameters(self) -> LiveParameters:
        """The loop's present parameters."""
        servo = self._servo
        if servo is not None:
            return servo.parameters
        return LiveParameters.of(self.config.scene, self.config.rate)

    # -- changing ------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the first servo process; return when it ticks.

        A change that a page requests meanwhile waits for that or is refused.

        Raises
        ------
        AsperityError
            The loop could not begin.
        """
        self._reader.start()
        try:
            self._replace(self.config)
        finally:
            self._begun.set()

    def change(self, **changes: Any) -> None:
        """Change stiffness, friction, coupling or rate: all of them at once, between two ticks.

        Raises
        ------
        AsperityError
            A value is out of range, or no loop is running.
        """
        servo = self._ticking()
        before = self._state(", ".join(changes))
        servo.set(**changes)
        self.changes.note(before, time.monotonic())
        self._kept |= changes
        if "stiffness" in self._kept:  # another may act with another coupling
            self._kept["stiffness"] = servo.parameters.stiffness

    def restart(self, config: SessionConfig | None = None) -> Future[None]:
        """Start another servo process to replace the present one when ready. Returns at once.

        If the new one cannot begin, the present one continues; the future holds the error, and
        `message` shows it.
        """
        before = self._state("")
        future = self._restarting.submit(self._replace_or_report, config or self.config)
        if config is not None:
            future.add_done_callback(
                lambda done: None if done.exception() else self.changes.note(before)
            )
        return future

    def undo(self) -> str:
        """Return to the state before the last change; return its name.

        Raises
        ------
        AsperityError
            There is nothing to undo, or the loop could not begin.
        """
        state = self.changes.pop()
        self._go_to(state)
        return state.before

    def reset(self) -> None:
        """Return to the settings with which the scene was opened; the device stays."""
        first, now = self._first, self.config
        if (first.device, first.options) != (now.device, now.options):
            first = replace(first, device=now.device, options=now.options)
        before = self._state("reset")
        self._go_to(State("", first, LiveParameters.of(first.scene, first.rate)))
        self.changes.note(before)

    def _ticking(self) -> Servo:
        """Return the servo process; AsperityError if no loop runs."""
        servo = self._servo
        if servo is None or not self.is_alive:
            starts = self.state == "starting"
            raise AsperityError(
                "the loop is still starting" if starts else "no servo loop is running; restart it"
            )
        return servo

    def _state(self, before: str) -> State:
        return State(before, self.config, self.parameters)

    def _go_to(self, state: State) -> None:
        wanted = state.parameters
        if state.config is self.config:
            self._ticking().set(**changed_parameters(self.parameters, wanted))
        else:
            job = self._restarting.submit(self._replace_or_report, state.config, wanted)
            job.result()
        own = LiveParameters.of(state.config.scene, state.config.rate)
        self._kept = changed_parameters(own, wanted)

    def move(self, motion: CannedMotion, press: float | None = None) -> None:
        """Repeat a canned motion from the present target, pressing with a force [N] if given."""
        with self._lock:
            table = motion_table(motion, self.target)
            self.pointer.move(
                table.poses, loop=table.loop, step=table.step, begun=time.perf_counter(),
                press=press,
            )  # fmt: skip

    def point(self, pose: NDArray[np.float64], press: float | None = None) -> None:
        """Move the mouse's hand to a pose (7,), pressing with a force [N] if given."""
        with self._lock:
            self.target = np.array(pose, dtype=np.float64)
            self.pointer.point(self.target, press)

    def close(self) -> None:
        """End all processes and threads."""
        self._closing.set()
        self._begun.set()
        self._restarting.shutdown(wait=True, cancel_futures=True)
        with self._lock:
            servo, self._servo = self._servo, None
            if servo is not None:
                self._end(servo)
        if self._reader.is_alive():
            self._reader.join(2.0)
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> ServoClient:
        try:
            self.start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- inside --------------------------------------------------------------------------------

    def _replace_or_report(
        self, config: SessionConfig, parameters: LiveParameters | None = None
    ) -> None:
        self._begun.wait()
        before, was_alive = self.config, self.is_alive
        try:
            self._replace(config, parameters)
        except AsperityError as error:
            if was_alive and self.state == "ended":
                # The device could be opened only after the old loop had released it: start that
                # loop again.
                with contextlib.suppress(AsperityError):
                    self._replace(before)
            self.message = str(error)
            raise

    def _replace(self, config: SessionConfig, parameters: LiveParameters | None = None) -> None:
        old = self._servo
        self.state = "changing" if old is not None and old.is_alive else "starting"
        new: Servo | None = None
        try:
            new = Servo(config.spec(self._folder / "pointed", self._start_of(config)), rows=True)
            new.start()
            self._swap(old, new, config, parameters)
        except BaseException:
            if new is not None:
                self._end(new)
            # A loop that has ended reports so before its process is gone.
            servo = self._servo
            goes_on = servo is not None and servo.is_alive and not servo.wait(0.0)
            self.state = "running" if goes_on else "ended"
            raise

    def _start_of(self, config: SessionConfig) -> NDArray[np.float64] | None:
        """Return the pose at which the hand continues: where it is, if the scene is the same."""
        snapshot = self.latest()
        if snapshot is None or config.scene.xml != self.config.scene.xml:
            return None
        return snapshot.handle_pose.copy()

    def _swap(
        self, old: Servo | None, new: Servo, config: SessionConfig,
        parameters: LiveParameters | None = None,
    ) -> None:  # fmt: skip
        """End the old loop and let the new one begin, with its own parameters or those given."""
        with self._lock:
            if self._closing.is_set():
                raise AsperityError("the page is being closed")
            if config.scene.xml != self.config.scene.xml:
                self.point(config.first_pose)
                self._kept.clear()
                self._first = config
            elif config.rate != self.config.rate:
                self._kept.pop("rate", None)
            if parameters is not None:
                own = LiveParameters.of(config.scene, config.rate)
                self._kept = changed_parameters(own, parameters)
            if old is not None:
                old.stop()
                old.wait(2.0)
                self._take(old)
            ready = new.go()
            _wait_for_a_tick(new)
            self.device = str(ready["device"])
            ticks, count = self.history.since(self.history.count - 1)
            self._shift = float(ticks["time"][-1]) + _GAP if count else 0.0
            self._servo, self.config = new, config
            self.generation += 1
            self.state, self.message = "running", ""
            if self._kept:
                # Changes made during the old loop persist, except in the first, soft ticks.
                new.set(**self._kept)
        if old is not None:
            self._end(old)

    def _end(self, servo: Servo) -> None:
        try:
            with servo:
                self.result = servo.finish()
        except AsperityError as error:
            logging.getLogger(__name__).debug("a servo process ended: %s", error)

    def _read(self) -> None:
        while not self._closing.wait(1.0 / READ_RATE):
            with self._lock:
                servo = self._servo
                if servo is None:
                    continue
                self._take(servo)
                if self.state == "running" and servo.wait(0.0):
                    self._ended(servo)

    def _take(self, servo: Servo) -> None:
        if servo is not self._servo:
            return
        ticks = servo.take_ticks()
        if not len(ticks):
            return
        ticks["time"] += self._shift
        self.history.add(ticks)
        for take in tuple(self._subscribers):
            take(ticks)

    def _ended(self, servo: Servo) -> None:
        """Note how a loop ended that was not stopped by the page."""
        self.state = "ended"
        try:
            result = servo.finish()
        except AsperityError as error:
            self.message = str(error)
        else:
            self.result, self.message = result, f"the loop ended: {result['ended']}"


def _wait_for_a_tick(servo: Servo) -> None:
    """Wait until a released loop has made its first snapshot, or has ended.

    Until then there is no latest snapshot, which the caller of the change may need.
    """
    until = time.monotonic() + _FIRST_TICK
    while time.monotonic() < until and not servo.wait(0.0):
        with contextlib.suppress(AsperityError):
            if servo.snapshot() is not None:
                return
        time.sleep(1e-3)
