"""Locks of files against a second process, released by the operating system when a process ends."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from asperity._core.file_lock import lock_file
from asperity._core.output import output_errors
from asperity.errors import OutputError


@contextmanager
def locked(path: Path, taken: str) -> Iterator[None]:
    """Hold the name `path`, which need not exist yet, through a file `.NAME.lock` beside it.

    The file is made, and locked, before anything else is written; so of several processes that
    begin at once one goes on. It is removed at the end. Where the file system has no locks, the
    file's existence is the lock, which is atomic everywhere; a killed process then leaves it, and
    the message names it.

    Parameters
    ----------
    path : Path
    taken : str
        The message if another process holds it.

    Raises
    ------
    OutputError
        Another process holds it, or the lock cannot be written.
    """
    file = path.with_name(f".{path.name}.lock")
    with output_errors(file):
        descriptor, made = _opened(file, taken)
    try:
        yield
    finally:
        # Removed while they are locked: who opened one meanwhile sees that it no longer is the
        # file of this name.
        for name in made:
            with suppress(OSError):
                name.unlink()
        os.close(descriptor)


def _opened(file: Path, taken: str) -> tuple[int, list[Path]]:
    """Return a descriptor that holds the lock, and the files to remove at the end."""
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            state = lock_file(descriptor)
            if state is False:
                raise OutputError(taken)
            if state is None:
                return descriptor, [file, _created(file.with_suffix(".owner"), taken)]
            if file.exists() and os.path.samestat(os.fstat(descriptor), file.stat()):
                return descriptor, [file]
        except FileNotFoundError:  # its owner removed it between two calls
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _created(owner: Path, taken: str) -> Path:
    """Take a name by making a file with it, which fails if it is there."""
    try:
        descriptor = os.open(owner, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        raise OutputError(
            f"{taken} ({owner.read_text('utf-8').strip()}); this file system has no locks: "
            f"if that process is gone, remove {owner}"
        ) from None
    os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
    os.close(descriptor)
    return owner
