"""The recorder: a process that writes every tick to `recording.h5`.

`Recorder` starts and ends it. A `RecorderOnRequest` records while a loop runs: whoever takes the
loop's ticks, such as a page, passes them on through a second ring; the loop is not involved.

It empties the ring ten times a second, so the loop never waits for a disk. It ends when the ring is
empty and closed, or when its parent is gone. Killed at any moment, it leaves a file that opens and
holds everything up to the last flush, at most about a second before.

A disk that fills up during a flush would leave a file that does not open, because HDF5 cannot undo
half a flush. So the recorder first reserves room on the disk for the next ticks and for closing. If
there is none, it closes the file properly, reports that and ends; the loop continues.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import shutil
import signal
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import RING, TICK, ParentProcess, TickRing, Ticks
from asperity.realtime.shared_file import remove_shared_folder, shared_folder
from asperity.runs.recording import RecordingWriter

PERIOD = 0.1
"""Interval at which the ring is read [s]."""
RESERVE = 4 * 2**20
"""Bytes reserved beyond the ticks: for HDF5's own tables and for closing the file."""
_TICK_BYTES = 1.25 * TICK.itemsize
"""Upper bound of the file's bytes per tick."""


RING_SECONDS = 30.0
"""Capacity of the ring of a `RecorderOnRequest` [s]: a new process takes seconds to start."""
ENDING = 30.0
"""Time limit for a `RecorderOnRequest` to finish [s]."""


class Recorder:
    """The process that records, as seen by the one that starts it.

    Parameters
    ----------
    folder : Path
        Shared folder, in which the ring is the file `RING`.
    ring : TickRing
    path : Path
        The recording; it must not exist.
    attributes : mapping
        Strings and numbers to store with it.
    """

    def __init__(
        self, folder: Path, ring: TickRing, path: Path, attributes: Mapping[str, Any]
    ) -> None:
        self.ring = ring
        spawn = multiprocessing.get_context("spawn")
        self._report, self._their_end = spawn.Pipe(duplex=False)
        self.process = spawn.Process(
            target=record, name="asperity-recorder",
            args=(folder / RING, path, dict(attributes), self._their_end),
        )  # fmt: skip

    def start(self) -> None:
        """Start the process."""
        self.process.start()
        self._their_end.close()

    def finish(self, patience: float) -> dict[str, Any]:
        """Let it write what it has and close the file, within a time [s]; return its result.

        Returns
        -------
        dict
            `ticks` written, `ticks_lost` because the ring was full, and `error`, empty if there was
            none.
        """
        self.ring.close()
        result: dict[str, Any] = {"ticks": 0, "error": ""}
        try:
            if self._report.poll(patience):
                result = self._report.recv()
            else:
                result["error"] = f"the recorder did not finish within {patience:g} s"
        except EOFError:
            result["error"] = "the recorder was killed"
        self.process.join(2.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        return {**result, "ticks_lost": self.ring.lost}


class RecorderOnRequest:
    """A recording that runs from its creation until `finish`.

    If the process that created it is killed, the recorder writes what it has and closes the file.

    Parameters
    ----------
    path : Path
        The recording. It must not exist; its folder must.
    attributes : mapping
        Strings and numbers to store with it; see `parameters.attributes_of`.
    rate : float
        Ticks per second [Hz].
    """

    def __init__(self, path: Path, attributes: Mapping[str, Any], rate: float) -> None:
        if path.exists():
            raise AsperityError(f"{path} exists; give another name")
        self.path = path
        self.ticks = 0
        """Ticks passed to the recorder."""
        self.seconds = 0.0
        """Time from the first to the last of them [s]."""
        self._first: float | None = None
        self._folder = shared_folder()
        ring = TickRing(self._folder / RING, int(RING_SECONDS * rate))
        self._recorder = Recorder(self._folder, ring, path, attributes)
        self._recorder.start()

    def add(self, ticks: Ticks) -> None:
        """Pass on ticks (n,); their times start at 0. Never waits."""
        if not len(ticks):
            return
        if self._first is None:
            self._first = float(ticks["time"][0])
        shifted = ticks.copy()
        shifted["time"] -= self._first
        for tick in shifted:
            self._recorder.ring.push(tick)
        self.ticks += len(ticks)
        self.seconds = float(ticks["time"][-1]) - self._first

    @property
    def is_alive(self) -> bool:
        """Whether the recorder still takes ticks."""
        return self._recorder.process.is_alive()

    def finish(self) -> dict[str, Any]:
        """Let the recorder finish; return as `Recorder.finish`."""
        result = self._recorder.finish(ENDING)
        shutil.rmtree(self._folder, ignore_errors=True)
        return result


def record(
    ring_path: Path, path: Path, attributes: Mapping[str, Any], report: Connection | None = None
) -> None:
    """Write the ticks of a ring to a new file until the ring is closed.

    Parameters
    ----------
    ring_path : Path
    path : Path
        The recording.
    attributes : mapping
        Strings and numbers to store with it.
    report : Connection, optional
        Receives a dict at the end: `ticks` written, and `error`, empty if there was none.
    """
    # Ctrl-C reaches every process of the terminal; the recorder ends when the ring is closed.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    parent = ParentProcess()
    ring = TickRing(ring_path)
    written, error, broken = 0, "", False
    try:
        writer = RecordingWriter(path, attributes)
        while True:
            # Checked before taking the ticks, so that none can arrive in between.
            last = ring.is_closed or parent.is_gone()
            ticks = ring.take()
            error = _reserve(path, RESERVE + int(_TICK_BYTES * (written + len(ticks))))
            if error:
                break
            if len(ticks):
                writer.add_rows({name: ticks[name] for name in TICK.names or ()})
                written += len(ticks)
            if last:
                break
            time.sleep(PERIOD)
        writer.close()
    except Exception as failure:  # h5py raises several kinds when a write fails
        error, broken = f"cannot write to {path}: {_reason(failure)}", True
    if error:
        logging.getLogger(__name__).error("%s; recording stopped after %d ticks", error, written)
    _send(report, {"ticks": written, "error": error})
    if parent.is_gone():
        remove_shared_folder(ring_path.parent)
    if broken:
        # HDF5 would try to write at exit, and hang or abort.
        os._exit(1)


def _reserve(path: Path, size: int) -> str:
    """Reserve room for a file of `size` bytes; return the reason if there is none, else "".

    HDF5 gives back what it does not use when it flushes, so this is repeated before every write.
    """
    if not hasattr(os, "posix_fallocate"):
        free = shutil.disk_usage(path.parent).free
        return "" if free > RESERVE else f"no room for {path}: the disk is full"
    try:
        descriptor = os.open(path, os.O_RDWR)
        try:
            os.posix_fallocate(descriptor, 0, size)
        finally:
            os.close(descriptor)
    except OSError as failure:
        return f"no room for {path}: {_reason(failure)}"
    return ""


def _reason(failure: Exception) -> str:
    """Return the system's message for an error, which HDF5 wraps in a long text."""
    number = getattr(failure, "errno", None)
    return os.strerror(number) if number else " ".join(str(failure).split("(")[0].split())


def _send(report: Connection | None, what: dict[str, Any]) -> None:
    if report is None:
        return
    try:
        report.send(what)
    except OSError:  # the parent is gone
        logging.getLogger(__name__).debug("nobody to report to")
