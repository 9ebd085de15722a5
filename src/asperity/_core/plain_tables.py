"""Large tables of plain numbers in text, which NumPy parses from the file itself.

How a table is written is found in the beginning of its file. NumPy's parser then takes nothing but
numbers, as many in each row as in the first: a file that has a comment, a word, a decimal comma or
a row cut short anywhere is left to readers that know what to make of it.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array

HEAD = 2**18
"""Bytes in which a table's form is found; smaller files are not large."""
_PIECE, _AT_ONCE = 2**16, 2**17
_TAIL = 4096
_NEWLINE, _RETURN = 10, 13


def head_of(path: Path, lines: int) -> bytes | None:
    """Return the beginning of a large file, with more than `lines` lines or `HEAD` bytes.

    None of a smaller file.
    """
    if path.stat().st_size < HEAD:
        return None
    with path.open("rb") as file:
        head = file.read(_PIECE)
        return head if head.count(b"\n") > lines else head + file.read(HEAD - _PIECE)


def ends_plainly(lines: bytes) -> bool:
    """Return whether each carriage return has a newline behind it."""
    return b"\r" not in lines or b"\r" not in lines.replace(b"\r\n", b"")


def plain_lines(path: Path, start: int) -> tuple[int, str] | None:
    """Return how many lines a file has from byte `start` on, the start of one, and the last.

    Blank ones at the end are left out, and of the last one, all but 4096 characters. None if a
    character is not ASCII, a carriage return stands alone, 4096 blanks stand at the end, or there
    are comments, at which NumPy's parser would stop late.
    """
    count = returns = pairs = 0
    ended = False
    piece = bytearray(_AT_ONCE)
    codes = np.frombuffer(piece, dtype=np.uint8)
    with path.open("rb", buffering=0) as file:
        file.seek(start)
        while size := file.readinto(piece) or 0:
            if piece.find(b"#", 0, size) >= 0 or not piece.isascii():
                return None
            count += int(np.count_nonzero(codes[:size] == _NEWLINE))
            pairs += ended and piece[0] == _NEWLINE
            if piece.find(b"\r", 0, size) >= 0:
                returns += piece.count(b"\r", 0, size)
                pairs += piece.count(b"\r\n", 0, size)
            ended = piece[size - 1] == _RETURN
        if returns > pairs:
            return None
        file.seek(max(start, file.tell() - _TAIL))
        tail = file.read(_TAIL)
    rows = tail.rstrip()
    if not rows:
        return None
    last = rows[rows.rfind(b"\n") + 1 :]
    return count + 1 - tail.count(b"\n", len(rows)), last.decode("ascii")


def plain_numbers(
    path: Path, above: int, separator: str | None, columns: int, encoding: str = "ascii",
    rows: int | None = None,
) -> Array | None:  # fmt: skip
    """Return the numbers of a text file, (rows, columns); None if it holds anything else.

    Parameters
    ----------
    path : Path
    above : int
        Lines above the numbers.
    separator : str or None
        None where white space separates.
    columns : int
    encoding : str
        Latin-1 where only the lines above the numbers may be other than ASCII.
    rows : int, optional
        How many there are, which saves memory that grows; a blank line among them is refused.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of blank lines
            found = np.loadtxt(
                os.fspath(path), delimiter=separator, comments=None, skiprows=above, ndmin=2,
                encoding=encoding, max_rows=rows,
            )  # fmt: skip
    except Exception:  # whatever it stumbles over, other readers say what is wrong
        return None
    return found if found.shape[1] == columns else None
