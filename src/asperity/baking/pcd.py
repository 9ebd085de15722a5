"""Points of PCD, the files of the Point Cloud Library: ascii, binary and binary_compressed."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError

_TYPES = {"F": "f", "I": "i", "U": "u"}


def read_pcd(path: Path) -> Array:
    """Return the points (n, 3) of a PCD file, whatever its other fields are.

    Raises
    ------
    AsperityError
        A file that is damaged or cut short; one line.
    """
    data = content_of(path)
    match = re.search(rb"^\s*DATA\s+(\w+)[ \t]*\r?\n", data, re.MULTILINE)
    if match is None:
        raise AsperityError(f"{path}: cannot be read as a .pcd file: its head has no line DATA")
    head = {}
    for line in data[: match.start()].decode("latin-1").splitlines():
        key, *values = line.split() or [""]
        head[key.upper()] = values
    names = [name.lower() for name in head.get("FIELDS", head.get("COLUMNS", []))]
    try:
        sizes = [int(size) for size in head["SIZE"]]
        types = [_TYPES[kind.upper()] for kind in head["TYPE"]]
        counts = [int(count) for count in head.get("COUNT", ["1"] * len(names))]
        points = int((head.get("POINTS") or ["-1"])[0])
        if points < 0:
            points = math.prod(int(head[key][0]) for key in ("WIDTH", "HEIGHT"))
        if not len(names) == len(sizes) == len(types) == len(counts) or min(counts) < 0:
            raise ValueError
        dtype = np.dtype(
            [
                (f"{i}", f"<{kind}{size}", (count,))
                for i, (kind, size, count) in enumerate(zip(types, sizes, counts, strict=True))
            ]
        )
    except (KeyError, ValueError, TypeError, IndexError):
        raise AsperityError(
            f"{path}: cannot be read as a .pcd file: its head needs FIELDS, SIZE, TYPE and POINTS"
        ) from None
    if any(axis not in names for axis in "xyz"):
        raise AsperityError(f"{path}: its fields are {' '.join(names)[:80]}; valid: x, y and z too")
    at = [names.index(axis) for axis in "xyz"]
    body, form = data[match.end() :], match.group(1).lower()
    if form == b"ascii":
        return _as_text(path, body, points, np.cumsum([0, *counts])[at], sum(counts))
    if form == b"binary":
        whole = _whole(path, body, points * dtype.itemsize)
        rows = np.frombuffer(whole, dtype, points)
        return np.stack([rows[f"{k}"][:, 0] for k in at], axis=1, dtype=np.float64)
    if form != b"binary_compressed":
        raise AsperityError(
            f"{path}: its DATA is {form.decode()[:20]!r}; valid: ascii, binary, binary_compressed"
        )
    packed, size = (int.from_bytes(body[k : k + 4], "little") for k in (0, 4))
    if size != points * dtype.itemsize:
        raise AsperityError(
            f"{path}: it is damaged: {points} points need {points * dtype.itemsize} bytes, "
            f"{size} are packed"
        )
    whole = _unpacked(path, _whole(path, body[8:], packed), size)
    # Compressed, each field stands by itself.
    starts = points * np.cumsum([0, *(dtype[i].itemsize for i in range(len(names)))])
    columns = [
        np.frombuffer(whole, dtype[k].base, points * counts[k], starts[k])[:: counts[k]] for k in at
    ]
    return np.stack(columns, axis=1, dtype=np.float64)


def _as_text(path: Path, body: bytes, points: int, at: NDArray[Any], width: int) -> Array:
    words = body.split()
    if len(words) < points * width or max(map(len, words), default=0) > 60:
        raise AsperityError(
            f"{path}: it is cut short or damaged: {points} points need {points * width} numbers, "
            f"there are {len(words)}"
        )
    rows = np.array(words[: points * width], dtype=bytes).reshape(points, width)
    try:
        return rows[:, at].astype(np.float64)
    except ValueError as error:
        raise AsperityError(f"{path}: it is damaged: {str(error)[:80]}") from None


def _whole(path: Path, data: bytes, size: int) -> bytes:
    """Return the first bytes of data; raise if there are fewer."""
    if len(data) < size:
        raise AsperityError(
            f"{path}: it is cut short: its head announces {size} bytes, there are {len(data)}"
        )
    return data[:size]


def _unpacked(path: Path, packed: bytes, size: int) -> bytes:
    """Return data that LZF has compressed, which HDF5 has a filter for."""
    import h5py

    if size == 0 or size > 1000 * max(len(packed), 1):
        raise AsperityError(f"{path}: it is damaged: {len(packed)} bytes cannot hold {size}")
    with h5py.File("unpacked", "w", driver="core", backing_store=False) as file:
        data = file.create_dataset("data", (size,), "u1", chunks=(size,), compression="lzf")
        data.id.write_direct_chunk((0,), packed)
        try:
            return bytes(data[()])
        except (OSError, RuntimeError):
            raise AsperityError(f"{path}: it is damaged: LZF cannot unpack it") from None
