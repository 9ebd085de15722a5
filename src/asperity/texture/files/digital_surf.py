"""Files of MountainsMap with compressed heights, made such that SurfaceTopography reads them.

The first 512 bytes are those of an uncompressed file but for the mark at the beginning; then come
a comment, private data, the number of parts, their sizes unpacked and packed, and the parts (zlib).
"""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

from asperity._core.units import length_of
from asperity.errors import SurfaceError
from asperity.texture.files.stored import check_size, refuse

_HEAD = 512
_COMPRESSED, _PLAIN = b"DSCOMPRESSED", b"DIGITAL SURF"
_BITS, _SHAPE, _ZONES = 98, 108, 334
"""Where the bits of a value stand, the two numbers of points, and the sizes of both zones."""
_UNIT = slice(212, 228)
_MOST_PARTS = 1000


def uncompressed(path: Path) -> io.BytesIO | None:
    """Return a compressed file as an uncompressed one, None if it is not compressed.

    Raises
    ------
    SurfaceError
        A damaged file, one of several layers, or of other values than heights; one line.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
        if not head.startswith((_COMPRESSED, _PLAIN)):
            return None
        # The micro sign of MS-DOS is another one in Latin-1.
        unit = head[_UNIT].split(b"\0")[0].decode("latin-1").replace("\xe6", "µ").strip()
        if length_of(unit) is None:
            refuse(path, f"its values are in {unit!r}; valid: heights, in a unit of length")
        if head.startswith(_PLAIN):
            return None
        data = head + file.read()
    try:
        (bits,) = struct.unpack_from("<H", data, _BITS)
        columns, rows = struct.unpack_from("<ii", data, _SHAPE)
        start = _HEAD + sum(struct.unpack_from("<HH", data, _ZONES))
        (count,) = struct.unpack_from("<I", data, start)
        if not 0 < count <= _MOST_PARTS or columns <= 0 or rows <= 0:
            raise ValueError(count)
        sizes = struct.unpack_from(f"<{2 * count}I", data, start + 4)
        wanted = columns * rows * bits // 8
        check_size(path, rows, columns)
        if sum(sizes[::2]) > wanted:
            refuse(path, "it has several layers, such as colours; valid: one surface of heights")
        at, parts = start + 4 + 8 * count, []
        for size, packed in zip(sizes[::2], sizes[1::2], strict=True):
            parts.append(zlib.decompressobj().decompress(data[at : at + packed], size))
            at += packed
        heights = b"".join(parts)
        if len(heights) != wanted:
            raise ValueError(len(heights))
    except SurfaceError:
        raise
    except (struct.error, zlib.error, ValueError):
        refuse(path, "damaged: its compressed heights cannot be read; valid: the file as written")
    return io.BytesIO(_PLAIN + data[len(_PLAIN) : start] + heights)
