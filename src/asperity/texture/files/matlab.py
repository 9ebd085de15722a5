"""Check of MATLAB's files before SciPy reads them: a damaged one makes it crash.

Of level 5 (MathWorks, "MAT-File Format", 2024); others are left to their readers.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from asperity.texture.files.checks import MAX_SAMPLES
from asperity.texture.files.stored import refuse

_KINDS = {"array": 14, "compressed": 15}
"""Types of elements that hold others."""
_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
"""Types of the numbers in an element."""
_NUMERIC = range(6, 16)
"""Classes of arrays of numbers, from double to uint64."""
_MOST = 16 * MAX_SAMPLES
"""Bytes of a variable, unpacked."""


def check_mat(path: Path) -> None:
    """Raise `SurfaceError` for a damaged `.mat` file of level 5; one line."""
    data = path.read_bytes()
    if 0 in data[:4] or b"\2" in data[124:126]:
        return  # of level 4, or 7.3, which is HDF5
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128], "")
    try:
        if not order:
            raise ValueError
        for kind, body in _elements(data[128:], order):  # behind the head
            if kind == _KINDS["compressed"]:
                unpacked = zlib.decompressobj().decompress(body, _MOST)
                ((kind, body),) = _elements(unpacked, order)
            if kind != _KINDS["array"] or not _is_sound(body, order):
                raise ValueError
    except (ValueError, struct.error, zlib.error):
        refuse(path, "cannot be read as a .mat file: it is damaged, or cut short")


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield the types and the bytes of elements; `ValueError` for one that is cut short."""
    place = 0
    while place < len(data):
        (word,) = struct.unpack_from(f"{order}I", data, place)
        if word >> 16:  # a small one, with its bytes beside it
            kind, count, start, step = word & 0xFFFF, word >> 16, place + 4, 8
            if count > 4:
                raise ValueError
        else:
            (count,) = struct.unpack_from(f"{order}I", data, place + 4)
            kind, start = word, place + 8
            step = 8 + (count if kind == _KINDS["compressed"] else -(-count // 8) * 8)
        if start + count > len(data):
            raise ValueError
        yield kind, data[start : start + count]
        place += step


def _is_sound(body: bytes, order: str) -> bool:
    """Return whether an array has flags, sizes, a name, and as many numbers as they state."""
    parts = list(_elements(body, order))
    if not parts:
        return True  # an empty one
    if parts[0][0] != 6 or len(parts[0][1]) != 8:
        return False
    (flags,) = struct.unpack(f"{order}I", parts[0][1][:4])
    if (flags & 0xFF) not in _NUMERIC:
        return True  # of text, cells and others, which are not read
    is_complex = bool(flags & 0x800)
    return len(parts) == 4 + is_complex and all(kind in _NUMBERS for kind, _ in parts)
