"""Reading of users' files: what is wrong with one is said in one line that names it."""

from __future__ import annotations

import codecs
import stat
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np

from asperity._core.arrays import Array
from asperity._core.unpacking import suffix_of
from asperity.errors import AsperityError

_INSIDE = (
    ArithmeticError, AttributeError, EOFError, LookupError, RecursionError, TypeError, UnicodeError,
    struct.error,
)  # fmt: skip
"""Exceptions of readers whose words are about their own insides."""


_LFS, _POINTER = b"version https://git-lfs.github.com/spec/", 1024
"""How a file begins that stands for one that was not fetched, and its largest size [bytes]."""
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_ZEROS = 0.6
"""Share of every second byte that is zero in a Western text of UTF-16, at least."""


def encodings_of(data: bytes) -> tuple[str, ...]:
    """Return the encodings that a text may have, the likeliest first."""
    for mark, name in _MARKS:
        if data.startswith(mark):
            return (name,)
    head = data[:4096]
    if len(head) > 3:
        for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[0::2])):
            if zeros.count(0) > _ZEROS * (len(head) // 2):
                return (name,)
    # Bytes that Windows' Western texts cannot have are in most Japanese ones.
    return "utf-8", "cp1252", "cp932", "latin-1"


def text_of(data: bytes) -> str:
    """Return a text in UTF-8, in UTF-16 or UTF-32 with or without a byte-order mark, or Latin-1.

    Its lines end as Python's do.
    """
    encoding = encodings_of(data)[0]
    try:
        text = data.decode(encoding, errors="strict" if encoding == "utf-8" else "replace")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_named(folder: Path, name: str) -> Path:
    """Return the path of a file that another one in `folder` names, possibly on another computer.

    It is there as it is named, or with backslashes as slashes, in another case, or without the
    folders in which it was elsewhere; else it is in `folder`, where it is not.
    """
    exact = folder / name
    if exact.is_file():
        return exact
    parts = [part for part in name.replace("\\", "/").split("/") if part not in ("", ".")]
    for first in range(len(parts)):
        found = folder if ".." not in parts[first:] else None
        for part in parts[first:]:
            found = None if found is None else _in_any_case(found, part)
        if found is not None and found.is_file():
            return found
    return folder / (parts[-1] if parts else name)


def _in_any_case(folder: Path, name: str) -> Path | None:
    """Return the path of a file or folder of this name, in any case."""
    if (folder / name).exists():
        return folder / name
    if not folder.is_dir():
        return None
    alike = (path for path in sorted(folder.iterdir()) if path.name.lower() == name.lower())
    return next(alike, None)


def columns_of(
    lines: Sequence[str], columns: Sequence[int], delimiter: str | None = None
) -> Array | None:
    """Return columns (n, k) of lines of numbers, None if some line does not have them.

    Blank lines, and what stands behind a #, are left out.
    """
    if not any(line.strip() for line in lines[:1]):
        return None
    try:
        return np.loadtxt(lines, delimiter=delimiter, usecols=columns, comments="#", ndmin=2)
    except (ValueError, OverflowError):
        return None


@contextmanager
def reading(
    path: Path,
    contents: str,
    suffixes: Sequence[str],
    *,
    valid: str = "",
    packed: Sequence[str] = (),
    error: type[AsperityError] = AsperityError,
) -> Iterator[str]:
    """Check that `path` is a file of a known kind; turn what its reader raises into one line.

    Parameters
    ----------
    path : Path
    contents : str
        What the file should hold, for messages.
    suffixes : sequence of str
        In lower case; the context is the one that the file has.
    valid : str
        Description of the valid kinds of file; by default the suffixes.
    packed : sequence of str
        Suffixes that may have `.gz` behind them.
    error : type
        Of the error to raise; an `AsperityError` of the reader is left as it is.
    """

    def refuse(reason: str) -> NoReturn:
        raise error(f"{path}: {reason}") from None

    suffix = suffix_of(path, packed)
    try:
        try:
            status = path.stat()
        except PermissionError:
            raise
        except (OSError, ValueError):  # nothing of that name, or a name that nothing can have
            refuse("there is no such file")
        if stat.S_ISDIR(status.st_mode):
            refuse(f"this is a folder; valid: a file of {contents}")
        if suffix not in suffixes:
            refuse(f"unknown kind of file {suffix!r}; valid: {valid or ', '.join(suffixes)}")
        if status.st_size == 0:
            refuse("the file is empty")
        if status.st_size < _POINTER and path.read_bytes().startswith(_LFS):
            refuse("it is a pointer of Git LFS, not the file; valid: after `git lfs pull`")
        yield suffix
    except AsperityError:
        raise
    except MemoryError:
        refuse("too large for this computer's memory")
    except _INSIDE:
        refuse(f"cannot be read as a {suffix} file: it is damaged, or of another kind")
    except Exception as caught:  # any exception of a reader on a damaged file
        reason = " ".join(str(caught).split())[:200] or type(caught).__name__
        refuse(f"cannot be read as a {suffix} file: {reason}")
