"""The page's link to the servo process: reads what it tells, writes what it shall do.

The page never takes part in a tick. It reads the snapshot and the ring, and writes parameters and
where the mouse's hand shall go, all of them in shared files; so it may be as slow as it likes, and
whoever looks at it may come, go, or be killed.

What the mailbox does not carry (another texture, law, device, scene) needs another engine. The link
has a second servo process made ready beside the first, with its own engine compiled and tried, and
only then lets the first one end and the second begin, where the hand is. Nothing of that making
happens in the process that ticks, so its ticks do not wait for it. The hand feels nothing for as
long as opening the device takes, and then what it feels comes up softly.
"""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.devices.pointer_file import Pointed
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.snapshot import Snapshot
from asperity.realtime.servo.tick_row import slices
from asperity.realtime.shared_file import shared_folder
from asperity.viewer.history import History
from asperity.viewer.motions import CannedMotion, motion_table
from asperity.viewer.session_config import SessionConfig

READ_RATE = 60.0
"""How often rows are fetched, a second."""
_TIME = slices()["time"].start
_GAP = 1e-3
_FIRST_TICK = 30.0
"""How long the first tick of a loop that has opened its device is waited for [s]."""


class ServoClient:
    """A servo process that is looked at and told things, and another one when it dies.

    Parameters
    ----------
    choice : Choice
        What to begin with.

    Attributes
    ----------
    state : str
        "starting", "running", "changing" (still running, with another being made ready), "ended".
    told : str
        Why it ended, or what came of the last change; one line, fit to be shown.
    generation : int
        How many servo processes have begun to tick.
    """

    def __init__(self, choice: SessionConfig) -> None:
        self.choice = choice
        self.state, self.told, self.generation = "starting", "", 0
        self.device = ""
        """What the device calls itself."""
        self.history = History()
        self.result: dict[str, Any] = {}
        """What the last servo process that ended had to say."""
        self._folder = shared_folder()
        self.pointed = Pointed(self._folder / "pointed", choice.first_pose)
        self.target = choice.first_pose
        """Where the mouse's hand shall be (7,)."""
        self._servo: Servo | None = None
        self._seen: tuple[Servo | None, Snapshot | None] = None, None
        """The last moment that was read, and whose."""
        self._lock = threading.RLock()
        self._taps: list[Callable[[NDArray[np.float64]], None]] = []
        self._shift = 0.0
        self._kept: dict[str, Any] = {}
        self._restarting = ThreadPoolExecutor(1, "asperity-restart")
        self._closing = threading.Event()
        self._reader = threading.Thread(target=self._read, name="asperity-rows", daemon=True)

    # -- what there is to see ------------------------------------------------------------------

    def latest(self) -> Snapshot | None:
        """Return the latest moment, or None before the first."""
        servo = self._servo
        if servo is None or self.generation == 0:
            return None
        moment = None
        with contextlib.suppress(AsperityError):
            moment = servo.snapshot()
        if moment is None:
            # The loop was held up while it wrote, or has been killed there: the one before.
            of, seen = self._seen
            return seen if of is servo else None
        self._seen = servo, moment
        return moment

    def rows_since(self, number: int) -> tuple[NDArray[np.float64], int]:
        """Return the rows (n, 30) from a number on, as far as they are kept, and the next number.

        Columns are `servo.rows.FIELDS`. Time goes on from one servo process to the next.
        """
        return self.history.since(number)

    def tap(self, take: Callable[[NDArray[np.float64]], None]) -> Callable[[], None]:
        """Have `take` called with all new rows (n, 30), from the reader's thread; return the end.

        It must be quick, and must not raise.
        """
        self._taps.append(take)
        return lambda: self._taps.remove(take)

    @property
    def is_alive(self) -> bool:
        """Whether a loop ticks."""
        servo = self._servo
        return servo is not None and self.state in ("running", "changing") and servo.is_alive

    @property
    def parameters(self) -> LiveParameters:
        """What the loop was told last."""
        servo = self._servo
        if servo is not None:
            return servo.parameters
        return LiveParameters.of(self.choice.scene, self.choice.rate)

    # -- what it shall do ----------------------------------------------------------------------

    def start(self) -> None:
        """Start the first servo process; return when it ticks.

        Raises
        ------
        AsperityError
            What kept it from beginning.
        """
        self._reader.start()
        self._replace(self.choice)

    def change(self, **changes: Any) -> None:
        """Change stiffness, friction, coupling or rate: all of them at once, between two ticks.

        Raises
        ------
        AsperityError
            A value out of range, or no loop that could take it.
        """
        servo = self._servo
        if servo is None or not self.is_alive:
            raise AsperityError("no servo loop is running; restart it")
        servo.set(**changes)
        self._kept |= changes

    def restart(self, choice: SessionConfig | None = None) -> Future[None]:
        """Have another servo process made ready, and swapped for the one there is.

        Returns at once. If it cannot begin, what there is goes on, the future has the error, and
        `told` says so.
        """
        return self._restarting.submit(self._replace_and_tell, choice or self.choice)

    def move(self, motion: CannedMotion, press: float | None = None) -> None:
        """Have the mouse's hand go through a motion, from where it shall be now, and again."""
        with self._lock:
            table = motion_table(motion, self.target)
            self.pointed.move(
                table.poses, loop=table.loop, step=table.step, begun=time.perf_counter(),
                press=press,
            )  # fmt: skip

    def point(self, pose: NDArray[np.float64], press: float | None = None) -> None:
        """Have the mouse's hand go to a pose (7,), pressing with a force [N] or as it comes."""
        with self._lock:
            self.target = np.array(pose, dtype=np.float64)
            self.pointed.point(self.target, press)

    def close(self) -> None:
        """End everything."""
        self._closing.set()
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

    def _replace_and_tell(self, choice: SessionConfig) -> None:
        before, was_alive = self.choice, self.is_alive
        try:
            self._replace(choice)
        except AsperityError as error:
            if was_alive and self.state == "ended":
                # A device can be opened only when the old loop has let go: back to that one.
                with contextlib.suppress(AsperityError):
                    self._replace(before)
            self.told = str(error)
            raise

    def _replace(self, choice: SessionConfig) -> None:
        old = self._servo
        self.state = "changing" if old is not None and old.is_alive else "starting"
        new: Servo | None = None
        try:
            new = Servo(choice.spec(self._folder / "pointed", self._start_of(choice)), rows=True)
            new.start()
            self._swap(old, new, choice)
        except BaseException:
            if new is not None:
                self._end(new)
            # A loop that was let go has said how it ended before its process is gone.
            servo = self._servo
            goes_on = servo is not None and servo.is_alive and not servo.wait(0.0)
            self.state = "running" if goes_on else "ended"
            raise

    def _start_of(self, choice: SessionConfig) -> NDArray[np.float64] | None:
        """Return where a hand goes on: where it is, if the scene is the same."""
        moment = self.latest()
        if moment is None or choice.scene.xml != self.choice.scene.xml:
            return None
        return moment.handle_pose.copy()

    def _swap(self, old: Servo | None, new: Servo, choice: SessionConfig) -> None:
        """Let the old loop end and the new one begin."""
        with self._lock:
            if self._closing.is_set():
                raise AsperityError("the page is being closed")
            if choice.scene.xml != self.choice.scene.xml:
                self.point(choice.first_pose)
                self._kept.clear()
            elif choice.rate != self.choice.rate:
                self._kept.pop("rate", None)
            if old is not None:
                old.stop()
                old.wait(2.0)
                self._take(old)
            ready = new.go()
            _wait_for_a_tick(new)
            self.device = str(ready["device"])
            rows, count = self.history.since(self.history.count - 1)
            self._shift = float(rows[-1, _TIME]) + _GAP if count else 0.0
            self._servo, self.choice = new, choice
            self.generation += 1
            self.state, self.told = "running", ""
            if self._kept:
                # What was changed while it ran holds on; the first ticks are without, and soft.
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
        rows = servo.take_rows()
        if not len(rows):
            return
        rows[:, _TIME] += self._shift
        self.history.add(rows)
        for take in tuple(self._taps):
            take(rows)

    def _ended(self, servo: Servo) -> None:
        """Say how a loop ended that nobody asked to end."""
        self.state = "ended"
        try:
            result = servo.finish()
        except AsperityError as error:
            self.told = str(error)
        else:
            self.result, self.told = result, f"the loop ended: {result['ended']}"


def _wait_for_a_tick(servo: Servo) -> None:
    """Wait until a loop that was let go has told of a tick, or has ended already.

    Until then there is no latest moment, and what is to follow upon it would find none.
    """
    until = time.monotonic() + _FIRST_TICK
    while time.monotonic() < until and not servo.wait(0.0):
        with contextlib.suppress(AsperityError):
            if servo.snapshot() is not None:
                return
        time.sleep(1e-3)
