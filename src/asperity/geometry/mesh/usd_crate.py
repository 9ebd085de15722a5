"""A look at binary USD (crate) files before usd-core opens them.

usd-core believes the sizes in a damaged file: it reserves memory for all that they count. So the
table of contents, the counts of its sections, and those of the values that its fields name are
compared with the file's size first. The format is that of `pxr/usd/sdf/crateFile.h` of OpenUSD.
"""

from __future__ import annotations

import re
import struct
import zipfile
from pathlib import Path

_MAGIC = b"PXR-USDC"
_MOST_SECTIONS = 64
_PACKED = 256
"""Bytes that LZ4 unpacks from one, at most."""
_INTEGERS = 4 * _PACKED
"""Whole numbers, of 2 bits or more before LZ4, that a byte stands for at most."""
_COUNTED = (b"FIELDS", b"FIELDSETS", b"SPECS")
_PACKED_SECTIONS = 4
"""Minor version from which sections are packed."""
_ARRAY, _INLINED = 1 << 63, 1 << 62
"""Marks of a value: an array; one that is in its mark."""
_OFFSET_BITS = (1 << 48) - 1
"""Bits of the place of a value in the file."""
_LISTS = (*range(32, 40), 54, 55)
"""Types of values that edit lists: a byte before the count of the first list."""
_VECTORS = (31, 40, 41, 45, 48, 49, 50)
"""Types of values that begin with a count: a dictionary, vectors, a map."""


def is_damaged(path: Path) -> bool:
    """Return whether a crate file, alone or in a package, counts more than it can hold."""
    data = path.read_bytes()
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                for member in archive.infolist():
                    # Files in a package are stored as they are.
                    if member.compress_type != zipfile.ZIP_STORED or member.file_size > len(data):
                        return True
    except Exception:  # whatever zipfile raises on a damaged package
        return True
    # Wherever one begins: usd-core finds files in packages that zipfile takes for none, and at
    # other places.
    return any(_is_damaged(data[found.start() :]) for found in re.finditer(_MAGIC, data))


def _is_damaged(data: bytes) -> bool:
    try:
        (contents,) = struct.unpack_from("<q", data, 16)
        (count,) = struct.unpack_from("<Q", data, contents)
        if contents < 24 or count > _MOST_SECTIONS:
            return True
        for k in range(count):
            name, start, size = struct.unpack_from("<16sqq", data, contents + 8 + 32 * k)
            if start < 24 or size < 8 or start + size > len(data):
                return True
            if _counts_too_much(data, name.rstrip(b"\0"), start, size):
                return True
            if name.startswith(b"FIELDS\0") and _values_are_damaged(data, start, size):
                return True
    except (struct.error, IndexError):
        return True
    return False


def _values_are_damaged(data: bytes, start: int, size: int) -> bool:
    """Return whether a value that a field names counts more than the rest of the file can hold."""
    minor = data[9]
    if data[8] or minor < _PACKED_SECTIONS:
        return False
    count, packed = struct.unpack_from("<QQ", data, start)
    (length,) = struct.unpack_from("<Q", data, start + 16 + packed)
    first = start + 24 + packed
    if first + length > start + size or (length and data[first]):
        return bool(first + length > start + size)  # of more chunks: 250 million fields
    marks = _unpacked(data[first + 1 : first + length], 8 * count)
    for (mark,) in struct.iter_unpack("<Q", marks):
        kind, at = mark >> 48 & 0xFF, mark & _OFFSET_BITS
        if mark & _INLINED or at == 0:
            continue
        if mark & _ARRAY:
            wide = minor >= 7  # before it, a count of 4 bytes, and before 5 a rank before it
            (items,) = struct.unpack_from("<Q" if wide else "<I", data, at + 4 * (minor < 5))
            if items > _INTEGERS * (len(data) - at):
                return True
        elif kind in _LISTS or kind in _VECTORS:
            (items,) = struct.unpack_from("<Q", data, at + (kind in _LISTS))
            # A list that is not there has no count: the byte states which are.
            if items > len(data) - at and (kind in _VECTORS or data[at] & 0x7E):
                return True
    return False


def _unpacked(block: bytes, most: int) -> bytes:
    """Return the bytes of a block of LZ4; raise `IndexError` if it is damaged, or has more."""
    out, at = bytearray(), 0

    def length(of: int) -> int:
        nonlocal at
        more = 255 if of == 15 else 0
        while more == 255:
            more = block[at]
            at, of = at + 1, of + more
        return of

    while at < len(block):
        token = block[at]
        at += 1
        literals = length(token >> 4)
        out += block[at : at + literals]
        at += literals
        if at >= len(block):
            break
        back = block[at] | block[at + 1] << 8
        at += 2
        copied = length(token & 15) + 4
        if not 0 < back <= len(out) or len(out) + copied > most:
            raise IndexError
        again = bytes(out[-back:])
        out += (again * (copied // back + 1))[:copied]
    if len(out) != most:
        raise IndexError
    return bytes(out)


def _counts_too_much(data: bytes, name: bytes, start: int, size: int) -> bool:
    """Return whether a section counts more than its bytes can hold."""
    (count,) = struct.unpack_from("<Q", data, start)
    if name == b"STRINGS":
        return bool(8 + 4 * count > size)
    if name == b"TOKENS":
        unpacked, packed = struct.unpack_from("<QQ", data, start + 8)
        return bool(packed > size or unpacked > _PACKED * size or count > unpacked)
    if name == b"PATHS":
        again, packed = struct.unpack_from("<QQ", data, start + 8)
        return bool(max(count, again) > _INTEGERS * size or packed > size)
    if name in _COUNTED:
        (packed,) = struct.unpack_from("<Q", data, start + 8)
        return bool(count > _INTEGERS * size or packed > size)
    return False
