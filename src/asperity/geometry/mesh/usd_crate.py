"""A look at binary USD (crate) files before usd-core opens them.

usd-core believes the sizes in a damaged file: it reserves memory for all that they count. So the
table of contents and the counts of its sections are compared with the file's size first.
"""

from __future__ import annotations

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


def is_damaged(path: Path) -> bool:
    """Return whether a crate file, alone or in a package, counts more than it can hold."""
    data = path.read_bytes()
    if data.startswith(_MAGIC):
        return _is_damaged(data)
    if not zipfile.is_zipfile(path):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                # Files in a package are stored as they are.
                if member.compress_type != zipfile.ZIP_STORED or member.file_size > len(data):
                    return True
                if member.filename.lower().endswith((".usd", ".usdc")):
                    inside = archive.read(member)
                    if inside.startswith(_MAGIC) and _is_damaged(inside):
                        return True
    except Exception:  # whatever zipfile raises on a damaged package
        return True
    return False


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
    except struct.error:
        return True
    return False


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
