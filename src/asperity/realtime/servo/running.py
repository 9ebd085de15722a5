"""A running servo loop and its recorder, from the parent's side."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import threading
import time
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import (
    MAILBOX,
    RING,
    RING_SECONDS,
    SNAPSHOT,
    TICK,
    Mailbox,
    TickRing,
    Ticks,
)
from asperity.realtime.servo.parameters import LiveParameters
from asperity.realtime.servo.process import ServoSpec, serve
from asperity.realtime.servo.recorder import Recorder
from asperity.realtime.servo.scheduling import keep_off_core
from asperity.realtime.servo.snapshot import Snapshot, SnapshotReader
from asperity.realtime.shared_file import shared_folder

STARTING = 180.0
"""Time limit for a servo process to start [s]: it may have to compile."""
ENDING = 5.0
"""Time limit for it to end [s]."""


class Servo:
    """A servo loop in a separate process. A context manager: leaving the block ends everything.

    Parameters
    ----------
    spec : ServoSpec
    recording : Path, optional
        File to record every tick to; it must not exist. Default: no recording.
    attributes : mapping
        Strings and numbers to store with the recording.
    rows : bool
        Without a recording: make every tick available to `take_ticks`.

    Examples
    --------
    >>> spec = ServoSpec(scene, functools.partial(device, "haply"))
    >>> with Servo(spec, Path("recording.h5")) as servo:
    ...     servo.start()
    ...     while servo.is_alive:
    ...         snapshot = servo.snapshot()  # as often as you like
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
        self._setting = threading.Lock()
        self._folder = shared_folder()
        self._mailbox = Mailbox(self._folder / MAILBOX, create=True)
        spawn = multiprocessing.get_context("spawn")
        self._report, theirs = spawn.Pipe(duplex=False)
        self._ring: TickRing | None = None
        self._recorder: Recorder | None = None
        self._recorded: dict[str, Any] = {"ticks": 0, "error": ""}
        if recording is not None or rows:
            self._ring = TickRing(self._folder / RING, int(RING_SECONDS * spec.rate))
            if recording is not None:
                self._recorder = Recorder(self._folder, self._ring, recording, attributes or {})
        self.process = spawn.Process(
            target=serve,
            name="asperity-servo",
            args=(spec, self._folder, theirs, self._recorder is not None),
        )
        self._servo_end = theirs
        self._reader: SnapshotReader | None = None
        self._result: tuple[str, Any] | None = None
        self._recorder_core: dict[str, str] = {}
        """Outcome of keeping the recorder off the loop's core, for the summary."""
        self._finished = False

    @property
    def recorder(self) -> Any:
        """The recorder's process, or None."""
        return self._recorder.process if self._recorder is not None else None

    @property
    def snapshot_path(self) -> Path:
        """The snapshot file, for a `SnapshotReader`."""
        return self._folder / SNAPSHOT

    def start(self) -> dict[str, Any]:
        """Start the processes; return when the loop ticks or, if `held`, is ready for `go`.

        Returns
        -------
        dict
            `limits`, `device` (its name) and `core` (the loop's, or None); empty if held.

        Raises
        ------
        AsperityError
            The loop could not begin; the message explains why.
        """
        if self._recorder is not None:
            self._recorder.start()
        self.process.start()
        self._servo_end.close()
        return self._wait_until("held" if self.spec.held else "ready")

    def go(self) -> dict[str, Any]:
        """Let a held loop open its device and tick; return as `start` does."""
        self._mailbox.go()
        return self._wait_until("ready")

    def _wait_until(self, wanted: str) -> dict[str, Any]:
        """Wait for the servo process to report "held" or "ready"; return what it sent."""
        try:
            ready = self._reported(wanted)
        except AsperityError:
            with suppress(AsperityError):
                self.finish()
            raise
        core, recorder = ready.get("core"), self.recorder
        if core is not None and recorder is not None and recorder.pid is not None:
            self._recorder_core["recorder"] = keep_off_core(core, recorder.pid)
        return ready

    def _reported(self, wanted: str) -> dict[str, Any]:
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
        return dict(what)

    @property
    def is_alive(self) -> bool:
        """Whether the servo process runs."""
        return self.process.is_alive()

    def snapshot(self) -> Snapshot | None:
        """Return the latest snapshot, or None before the first."""
        if self._reader is None:
            self._reader = SnapshotReader(self.snapshot_path)
        return self._reader.read()

    def take_ticks(self) -> Ticks:
        """Return all ticks since the last call: records (n,) of dtype `ipc.TICK`."""
        if self._ring is None or self.process.pid is None:
            return np.empty(0, TICK)
        return self._ring.take()

    def take_rows(self) -> NDArray[np.float64]:
        """Return the ticks since the last call as rows (n, 30); use `take_ticks`."""
        warnings.warn("take_rows is deprecated: use take_ticks", DeprecationWarning, stacklevel=2)
        return self.take_ticks().view(np.float64).reshape(-1, TICK.itemsize // 8)

    def set(self, **changes: Any) -> None:
        """Change `LiveParameters`: all of them are replaced at once, between two ticks.

        Several threads may do so at the same time: none takes back what another has set.

        Raises
        ------
        AsperityError
            A value is out of range.

        Examples
        --------
        >>> servo.set(stiffness=2e4, friction=0.2)
        """
        with self._setting:
            parameters = self.parameters.changed(self.spec.scene, changes)
            parameters.force(self.spec.scene.force)  # raises what would fail in the servo process
            self._mailbox.send(parameters.plain())
            self.parameters = parameters

    def stop(self) -> None:
        """Stop the loop, which sends zero to the device."""
        self._mailbox.stop()

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds` for the loop to end; return whether it has."""
        if self._result is None and self._report.poll(seconds):
            self._result = self._receive()
        return self._result is not None

    def finish(self) -> dict[str, Any]:
        """Stop the loop, let the recorder finish, and return the summary of both.

        Raises
        ------
        AsperityError
            The loop failed, or its process was killed.
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
        what: Any
        kind, what = self._result or ("failed", f"the servo process ended ({self._exit()})")
        if kind == "failed":
            raise AsperityError(str(what))
        real_time = {**what["real_time"], **self._recorder_core}
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
        recorder, self._recorder = self._recorder, None
        if recorder is not None and recorder.process.pid is not None:
            # The servo process closes the ring itself, unless it was killed.
            self._recorded = recorder.finish(4 * ENDING)
        return self._recorded

    def _exit(self) -> str:
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return f"exit code {code}"
