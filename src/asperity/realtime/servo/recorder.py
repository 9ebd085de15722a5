"""The recorder: a process that writes every tick to `recording.h5`.

It takes what is in the ring ten times a second, so that the loop never waits for a disk. It ends
when the ring is empty and closed, or when its parent is gone. Killed at any moment it leaves a file
that opens, up to what was flushed last, at most about a second before.

A disk that runs full amid a flush would leave a file that does not open: HDF5 cannot take back half
of one. So room for the next rows and for closing is asked of the system first. If there is none,
the file is closed in order and the recorder says so and ends; the loop goes on.
"""

from __future__ import annotations

import logging
import os
import shutil
import signal
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from asperity.realtime.servo.parent_watch import Parent, clear_up
from asperity.realtime.servo.ring import TickRing
from asperity.realtime.servo.tick_row import WIDTH, columns
from asperity.runs.recording import RecordingWriter

PERIOD = 0.1
"""How often it looks into the ring [s]."""
ROOM = 4 * 2**20
"""Bytes beyond the rows that have to be there: for HDF5's own tables, and for closing."""
_ROW_BYTES = 1.25 * 8 * WIDTH
"""Of the file, for each tick; less in truth."""


def record(
    ring_path: Path, path: Path, attributes: Mapping[str, Any], report: Connection | None = None
) -> None:
    """Write the rows of a ring to a new file until it is closed.

    Parameters
    ----------
    ring_path : Path
    path : Path
        The recording.
    attributes : mapping
        Texts and numbers to keep with it.
    report : Connection, optional
        Told, at the end, how many ticks were written, and what went wrong: a dict.
    """
    # Ctrl-C goes to every process of the terminal; this one ends when the ring is closed.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    parent = Parent()
    ring = TickRing(ring_path)
    written, error, broken = 0, "", False
    try:
        writer = RecordingWriter(path, attributes)
        while True:
            # Asked before the rows are taken: none can come in between.
            last = ring.is_closed or parent.is_gone()
            rows = ring.take()
            error = _no_room(path, ROOM + int(_ROW_BYTES * (written + len(rows))))
            if error:
                break
            if len(rows):
                writer.add_rows(columns(rows))
                written += len(rows)
            if last:
                break
            time.sleep(PERIOD)
        writer.close()
    except Exception as failure:  # h5py raises several kinds when a write fails
        error, broken = f"cannot write to {path}: {_reason(failure)}", True
    if error:
        logging.getLogger(__name__).error("%s; recording stopped after %d ticks", error, written)
    _tell(report, {"ticks": written, "error": error})
    if parent.is_gone():
        clear_up(ring_path.parent)
    if broken:
        # HDF5 would try to write on the way out, and hang or abort.
        os._exit(1)


def _no_room(path: Path, size: int) -> str:
    """Have the system keep room for a file of `size` bytes; return why it does not, or nothing.

    When it flushes, HDF5 gives back what it does not use; so this is asked before every writing.
    """
    if not hasattr(os, "posix_fallocate"):
        free = shutil.disk_usage(path.parent).free
        return "" if free > ROOM else f"no room for {path}: the disk is full"
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
    """Return what the system says; HDF5 wraps that in pages of its own."""
    number = getattr(failure, "errno", None)
    return os.strerror(number) if number else " ".join(str(failure).split("(")[0].split())


def _tell(report: Connection | None, what: dict[str, Any]) -> None:
    if report is None:
        return
    try:
        report.send(what)
    except OSError:  # nobody is left to be told
        logging.getLogger(__name__).debug("nobody to report to")
