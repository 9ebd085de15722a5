"""PNG of 16 bits and several channels, which Pillow opens with 8 bits a channel."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_png16(path: Path, size: tuple[int, int], mode: str, interlaced: int) -> NDArray[np.uint16]:
    """Return the pixels of a 16-bit PNG of several channels.

    Pillow opens these files with 8 bits a channel. Its zip decoder yields all bits in two passes,
    for the upper and for the lower byte, or, with two channels, when the four bytes of a pixel are
    declared as RGBA.
    """
    from PIL import Image

    content, place, stream = path.read_bytes(), 8, []
    while place + 8 <= len(content):
        length, name = struct.unpack(">I4s", content[place : place + 8])
        if name == b"IDAT":
            stream.append(content[place + 8 : place + 8 + length])
        place += length + 12
    data = b"".join(stream)

    def decoded(as_mode: str, layout: str) -> NDArray[np.uint16]:
        image = Image.frombytes(as_mode, size, data, "zip", layout, interlaced)
        return np.asarray(image).astype(np.uint16)

    if mode == "LA":
        pixels = decoded("RGBA", "RGBA")
        return pixels[..., 0::2] * np.uint16(256) + pixels[..., 1::2]
    return decoded(mode, f"{mode};16B") * np.uint16(256) + decoded(mode, f"{mode};16L")
