"""The recorder: a process that writes every tick to `recording.h5`.

It takes what is in the ring ten times a second, so that the loop never waits for a disk. It ends
when the ring is empty and closed, or when its parent is gone. Killed at any moment it leaves a file
that opens, up to what was flushed last, at most about a second before.

A disk that runs full would leave a file in pieces: HDF5 cannot take back half a flush. So it stops
while `KEPT_FREE` bytes are left, closes the file in order, and says so; the loop goes on.
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

from asperity.recording import RecordingWriter
from asperity.servo.ring import Ring
from asperity.servo.rows import columns

PERIOD = 0.1
"""How often it looks into the ring [s]."""
KEPT_FREE = 16 * 2**20
"""So many bytes stay free on the disk."""


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
    parent = os.getppid()
    ring = Ring(ring_path)
    written, error, broken = 0, "", False
    try:
        writer = RecordingWriter(path, attributes)
        while True:
            # Asked before the rows are taken: none can come in between.
            last = ring.is_closed or os.getppid() != parent
            rows = ring.take()
            if shutil.disk_usage(path.parent).free < KEPT_FREE + rows.nbytes:
                error = f"the disk of {path.parent} is full"
                break
            if len(rows):
                writer.add_rows(columns(rows))
                written += len(rows)
            if last:
                break
            time.sleep(PERIOD)
        writer.close()
    except OSError as failure:
        error, broken = f"cannot write to {path}: {failure.strerror or failure}", True
    except Exception as failure:  # h5py raises other kinds, too, when a write fails
        error, broken = f"cannot write to {path}: {' '.join(str(failure).split())}", True
    if error:
        logging.getLogger(__name__).error("%s; recording stopped after %d ticks", error, written)
    _tell(report, {"ticks": written, "error": error})
    if broken:
        # HDF5 would try to write on the way out, and hang or abort.
        os._exit(1)


def _tell(report: Connection | None, what: dict[str, Any]) -> None:
    if report is None:
        return
    try:
        report.send(what)
    except OSError:  # nobody is left to be told
        logging.getLogger(__name__).debug("nobody to report to")
