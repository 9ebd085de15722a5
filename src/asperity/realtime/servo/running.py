"""A servo process and its recorder, as their parent sees them."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.mailbox import Mailbox
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.process import MAILBOX, RING, SNAPSHOT, ServoSpec, serve
from asperity.realtime.servo.recorder import record
from asperity.realtime.servo.ring import SECONDS, TickRing
from asperity.realtime.servo.scheduling import keep_off
from asperity.realtime.servo.snapshot import Snapshot, SnapshotReader
from asperity.realtime.servo.tick_row import WIDTH
from asperity.realtime.shared_file import shared_folder

STARTING = 180.0
"""How long a servo process may take to begin [s]: it may have to compile."""
ENDING = 5.0
"""How long it may take to end [s]."""


class Servo:
    """A loop in a process of its own. A context manager: leaving it ends everything.

    Parameters
    ----------
    spec : ServoSpec
    recording : Path, optional
        Where to record every tick; must not exist. Default: nothing is recorded.
    attributes : mapping
        Texts and numbers to keep with the recording.
    rows : bool
        Where nothing is recorded: have every tick's row for `take_rows`.

    Examples
    --------
    >>> spec = ServoSpec(scene, functools.partial(device, "haply"))
    >>> with Servo(spec, Path("recording.h5")) as servo:
    ...     servo.start()
    ...     while servo.is_alive:
    ...         moment = servo.snapshot()  # as often as you like
    """

    def __init__(
        self,
        spec: ServoSpec,
        recording: Path | None = None,
        attributes: Mapping[str, Any] | None = None,
        *,
        rows: bool = False,
    ) -> None:
        self.spec = spec
        self.parameters = LiveParameters.of(spec.scene, spec.rate)
        self._folder = shared_folder()
        self._mailbox = Mailbox(self._folder / MAILBOX, create=True)
        spawn = multiprocessing.get_context("spawn")
        self._report, theirs = spawn.Pipe(duplex=False)
        self._ring = self._recorder = None
        self._recorded: dict[str, Any] = {"ticks": 0, "error": ""}
        if recording is not None or rows:
            self._ring = TickRing(self._folder / RING, int(SECONDS * spec.rate))
        if recording is not None:
            self._recorder_report, told = spawn.Pipe(duplex=False)
            self._recorder = spawn.Process(
                target=record, name="asperity-recorder",
                args=(self._folder / RING, recording, dict(attributes or {}), told),
            )  # fmt: skip
            self._recorder_end = told
        self.process = spawn.Process(
            target=serve,
            name="asperity-servo",
            args=(spec, self._folder, theirs, self._recorder is not None),
        )
        self._servo_end = theirs
        self._reader: SnapshotReader | None = None
        self._result: tuple[str, Any] | None = None
        self._asked: dict[str, str] = {}
        """What came of what was asked for the recorder; the rest the servo process tells."""
        self._finished = False

    @property
    def recorder(self) -> Any:
        """The recorder's process, or None."""
        return self._recorder

    @property
    def snapshot_path(self) -> Path:
        """The file that viewers look into."""
        return self._folder / SNAPSHOT

    def start(self) -> dict[str, Any]:
        """Start both processes; return when the loop ticks, with what the device says of itself.

        If the spec says that it is `held`: when all is ready for `go`.

        Raises
        ------
        AsperityError
            What kept the loop from beginning.
        """
        return self._or_finished(self._start)

    def go(self) -> dict[str, Any]:
        """Let a loop that is held open its device and tick; return as `start` does."""
        return self._or_finished(self._go)

    def _or_finished(self, begin: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        try:
            return begin()
        except AsperityError:
            with suppress(AsperityError):
                self.finish()
            raise

    def _start(self) -> dict[str, Any]:
        if self._recorder is not None:
            self._recorder.start()
            self._recorder_end.close()
        self.process.start()
        self._servo_end.close()
        return self._told("held" if self.spec.held else "ready")

    def _go(self) -> dict[str, Any]:
        self._mailbox.go()
        return self._told("ready")

    def _told(self, wanted: str) -> dict[str, Any]:
        """Wait for word of the servo process that it is so far."""
        until = time.monotonic() + STARTING
        while not self._report.poll(0.05):
            if not self.process.is_alive() and not self._report.poll(0.0):
                raise AsperityError(f"the servo process ended ({self._exit()}) before it began")
            if time.monotonic() > until:
                raise AsperityError(f"the servo process did not begin within {STARTING:g} s")
        kind, what = self._receive()
        if kind != wanted:
            self._result = (kind, what)
            raise AsperityError(str(what))
        told: dict[str, Any] = what
        core = told.get("core")
        if core is not None and self._recorder is not None and self._recorder.pid is not None:
            self._asked["recorder"] = keep_off(core, self._recorder.pid)
        return told

    @property
    def is_alive(self) -> bool:
        """Whether the loop goes on."""
        return self.process.is_alive()

    def snapshot(self) -> Snapshot | None:
        """Return the latest moment, or None before the first."""
        if self._reader is None:
            self._reader = SnapshotReader(self.snapshot_path)
        return self._reader.read()

    def take_rows(self) -> NDArray[np.float64]:
        """Return the rows (n, 30) of all ticks since the last call; see `rows.FIELDS`."""
        if self._ring is None or self.process.pid is None:
            return np.empty((0, WIDTH))
        return self._ring.take()

    def set(self, **changes: Any) -> None:
        """Change `LiveParameters`: all of them are swapped at once, between two ticks.

        >>> servo.set(stiffness=300.0, friction=0.2)
        """
        parameters = replace(self.parameters, **changes)
        parameters.force(self.spec.scene.force)  # refuses here what would be refused there
        self._mailbox.send(parameters.plain())
        self.parameters = parameters

    def stop(self) -> None:
        """Let the loop stop, with zero at the device."""
        self._mailbox.stop()

    def wait(self, seconds: float) -> bool:
        """Wait for the loop to end, at most so long [s]; return whether it has."""
        if self._result is None and self._report.poll(seconds):
            self._result = self._receive()
        return self._result is not None

    def finish(self) -> dict[str, Any]:
        """Stop the loop, let the recorder finish, and return what both have to say.

        Raises
        ------
        AsperityError
            The loop failed, or was killed.
        """
        self._finished = True
        self.stop()
        if self.process.pid is not None:
            self.wait(ENDING)
            self.process.join(ENDING)
            if self.process.is_alive():
                self.process.kill()
                self.process.join()
        recorded = self._finish_recorder()
        kind: str
        what: Any
        kind, what = self._result or ("failed", f"the servo process ended ({self._exit()})")
        if kind == "failed":
            raise AsperityError(str(what))
        real_time = {**what["real_time"], **self._asked}
        return {**what, "recorder": recorded, "real_time": real_time}

    def __enter__(self) -> Servo:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if not self._finished:
                with suppress(*([AsperityError] if kind is not None else [])):
                    self.finish()
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _receive(self) -> tuple[str, Any]:
        try:
            kind, what = self._report.recv()
        except EOFError:
            self.process.join(1.0)
            return "failed", f"the servo process ended ({self._exit()})"
        return kind, what

    def _finish_recorder(self) -> dict[str, Any]:
        if self._recorder is None or self._ring is None or self._recorder.pid is None:
            return self._recorded
        # The servo does so itself, unless it was killed.
        self._ring.close()
        if self._recorder_report.poll(4 * ENDING):
            try:
                self._recorded = self._recorder_report.recv()
            except EOFError:
                self._recorded["error"] = "the recorder was killed"
        self._recorder.join(ENDING)
        if self._recorder.is_alive():
            self._recorder.kill()
            self._recorder.join()
        self._recorder, lost = None, self._ring.lost
        self._recorded = {**self._recorded, "ticks_lost": lost}
        return self._recorded

    def _exit(self) -> str:
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return f"exit code {code}"
