"""Reading of users' files: what is wrong with one is said in one line that names it."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

_INSIDE = (
    ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, UnicodeError,
    struct.error,
)  # fmt: skip
"""Exceptions of readers whose words are about their own insides."""


def text_of(data: bytes) -> str:
    """Return a text in UTF-8, in UTF-16 or UTF-32 with a byte-order mark, or else in Latin-1.

    Its lines end as Python's do.
    """
    marks = {
        b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\xff\xfe": "utf-16",
        b"\xfe\xff": "utf-16",
    }  # fmt: skip
    encoding = next((name for mark, name in marks.items() if data.startswith(mark)), "utf-8")
    try:
        text = data.decode(encoding, errors="strict" if encoding == "utf-8" else "replace")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


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
    error : type
        Of the error to raise; an `AsperityError` of the reader is left as it is.
    """

    def refuse(reason: str) -> NoReturn:
        raise error(f"{path}: {reason}") from None

    suffix = path.suffix.lower()
    try:
        if not path.exists():
            refuse("there is no such file")
        if path.is_dir():
            refuse(f"this is a folder; valid: a file of {contents}")
        if suffix not in suffixes:
            refuse(f"unknown kind of file {suffix!r}; valid: {valid or ', '.join(suffixes)}")
        if path.stat().st_size == 0:
            refuse("the file is empty")
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
