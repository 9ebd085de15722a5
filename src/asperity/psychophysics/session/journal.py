r"""The journal of a session: one line per event, flushed to disk before the session continues.

An answer is given once and must survive any failure afterwards, even a power cut between writes.

So the journal is an append-only file: each line is written by one write and flushed by `fsync`
before `append` returns, and only then does the session continue. Each line ends in its checksum:

    {"event": "answer", "number": 7, "answer": 12.5, ...} #1c291ca3\n

A line that was cut short by a crash can only be the last one. It lacks its end, so it is known, put
aside into `journal.torn`, and cut off; it was never acknowledged. If only the line feed is missing
the line is whole and is kept. A wrong checksum anywhere else is damage, not a crash: then nothing
is touched and the journal is refused.
"""

from __future__ import annotations

import io
import json
import os
import zlib
from pathlib import Path
from typing import Any

from asperity._core.file_lock import lock_file
from asperity.errors import AsperityError, OutputError

FILE = "journal.jsonl"
TORN = "journal.torn"


class Journal:
    """A journal, open for appending. A context manager.

    Parameters
    ----------
    folder : Path
        Where it stands; made if need be, for the owner alone.

    Raises
    ------
    OutputError
        It cannot be written, or another process has it open.
    AsperityError
        It is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        self._failed = ""
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        except OSError as error:
            raise OutputError(f"cannot write to {self.path}: {error.strerror or error}") from None
        try:
            self._lock()
            self.events, self._size = self._recovered()
            # The name of a new file is sure only when its folder is.
            _sync_folder(folder)
            _sync_folder(folder.parent)
        except BaseException:
            os.close(self._file)
            raise

    def append(self, event: str, **fields: Any) -> dict[str, Any]:
        """Append an event; return it when it is on the disk.

        Raises
        ------
        OutputError
            The event could not be flushed. It is not in the journal, which accepts no more events.
        """
        if self._failed:
            raise OutputError(self._failed)
        entry = {"event": event, **fields}
        line = encoded(entry)
        try:
            written = 0
            while written < len(line):
                written += os.write(self._file, line[written:])
            os.fsync(self._file)
        except OSError as error:
            self._failed = f"cannot write to {self.path}: {error.strerror or error}"
            # What is there of the line is taken back, as far as the system lets us.
            try:
                os.ftruncate(self._file, self._size)
            except OSError:
                self._failed += "; its last line may be torn"
            raise OutputError(self._failed) from None
        self._size += len(line)
        self.events.append(entry)
        return entry

    def close(self) -> None:
        """Close the file; it is whole at any time."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _lock(self) -> None:
        """Lock the file against other processes, where the system supports it."""
        if lock_file(self._file) is False:
            raise OutputError(
                f"{self.path} is in use by another process, in which the session is running"
            )

    def _recovered(self) -> tuple[list[dict[str, Any]], int]:
        """Return the events so far and the size; put aside what is torn."""
        data = self.path.read_bytes()
        events, torn = decoded(data, self.path)
        size = len(data) - len(torn)
        if torn:
            aside = os.open(self.path.parent / TORN, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            try:
                os.write(aside, torn + b"\n")
                os.fsync(aside)
            finally:
                os.close(aside)
            os.ftruncate(self._file, size)
            os.fsync(self._file)
        elif data and not data.endswith(b"\n"):
            # Only the line feed of the last event is missing.
            size += os.write(self._file, b"\n")
            os.fsync(self._file)
        return events, size


def read_journal(folder: Path) -> list[dict[str, Any]]:
    """Return the events of a session without touching it; a torn end is left out."""
    path = folder / FILE
    if not path.is_file():
        raise AsperityError(f"no journal of a session in {folder}; give a folder that has one")
    return decoded(path.read_bytes(), path)[0]


def encoded(entry: dict[str, Any]) -> bytes:
    """Return an event as a line."""
    text = json.dumps(entry, allow_nan=False, ensure_ascii=True)
    return f"{text} #{zlib.crc32(text.encode()):08x}\n".encode()


def decoded(data: bytes, path: Path) -> tuple[list[dict[str, Any]], bytes]:
    """Return the events of all whole lines, and the last line if it is torn."""
    lines = io.BytesIO(data).readlines()
    events: list[dict[str, Any]] = []
    for line in lines:
        entry = _parsed(line.removesuffix(b"\n"))
        if entry is not None:
            events.append(entry)
        elif len(events) + 1 == len(lines):
            # A crash may leave any part of the last line unwritten, its end being there.
            return events, line
        else:
            raise AsperityError(
                f"{path}: line {len(events) + 1} is damaged; nothing was changed. "
                "Keep a copy of the folder, and restore the file"
            )
    return events, b""


def _parsed(line: bytes) -> dict[str, Any] | None:
    """Return the event of a line without its end, or None if it is not whole."""
    text, mark, check = line.rpartition(b" #")
    if not mark or len(check) != 8:
        return None
    try:
        if int(check, 16) != zlib.crc32(text):
            return None
        entry: dict[str, Any] = json.loads(text)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None


def _sync_folder(folder: Path) -> None:
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
