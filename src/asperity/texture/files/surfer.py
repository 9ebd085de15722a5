"""Grids of Golden Software's Surfer: text (DSAA), and Surfer 6 (DSBB) and 7 (DSRB) in binary.

Rows go upwards. Coordinates and heights have one unit, which no grid states.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_form import decoded
from asperity._core.unpacking import content_of
from asperity.errors import SurfaceError
from asperity.texture.files.stored import NO_UNITS, Stored, check_size, refuse
from asperity.texture.files.text import load_text

_BLANK = 1.70141e38
"""Heights from here on are missing."""
_VALID = "valid: a grid of Surfer (DSAA, DSBB, DSRB)"


def load_grid(path: Path) -> Stored:
    """Return the heights of a grid of Surfer.

    Raises
    ------
    SurfaceError
        A grid that is damaged, or of another program; one line.
    """
    data = content_of(path)
    reader = {b"DSAA": _text, b"DSBB": _surfer_6, b"DSRB": _surfer_7}.get(data[:4])
    if reader is None and decoded(data[:4096]) is not None:
        return load_text(path)  # ESRI's grids have this suffix too
    if reader is None:
        refuse(path, f"no grid of Surfer; {_VALID}")
    try:
        values, size, blank = reader(path, data)
    except SurfaceError:
        raise
    except (ValueError, IndexError, struct.error, UnicodeDecodeError, OverflowError):
        refuse(path, f"damaged or cut short; {_VALID}")
    values = np.where(np.abs(values) >= blank, np.nan, values)
    return Stored(values, (NO_UNITS,), size, 1.0, sizes_follow=True)


def _shape(path: Path, columns: int, rows: int) -> tuple[int, int]:
    if min(columns, rows) < 2:
        raise ValueError(columns, rows)
    check_size(path, rows, columns)
    return rows, columns


def _text(path: Path, data: bytes) -> tuple[Array, tuple[float, float], float]:
    words = data.decode("ascii").replace(",", ".").split()
    shape = _shape(path, int(words[1]), int(words[2]))
    x_low, x_high, y_low, y_high = (float(word) for word in words[3:7])
    values = np.array(words[9:], dtype=np.float64).reshape(shape)
    size = (x_high - x_low) / (shape[1] - 1), (y_high - y_low) / (shape[0] - 1)
    return values, size, _BLANK


def _surfer_6(path: Path, data: bytes) -> tuple[Array, tuple[float, float], float]:
    columns, rows, x_low, x_high, y_low, y_high = struct.unpack_from("<hhdddd", data, 4)
    shape = _shape(path, columns, rows)
    values = np.frombuffer(data, "<f4", rows * columns, 56).reshape(shape)
    size = (x_high - x_low) / (columns - 1), (y_high - y_low) / (rows - 1)
    return values.astype(np.float64), size, _BLANK


def _surfer_7(path: Path, data: bytes) -> tuple[Array, tuple[float, float], float]:
    parts: dict[bytes, int] = {}
    at = 0
    while at + 8 <= len(data) and b"DATA" not in parts:
        name, length = struct.unpack_from("<4si", data, at)
        if length < 0:
            raise ValueError(length)
        parts[name] = at + 8
        at += 8 + length
    if not {b"GRID", b"DATA"} <= {*parts}:
        raise ValueError(*parts)
    rows, columns = struct.unpack_from("<ii", data, parts[b"GRID"])
    step_x, step_y = struct.unpack_from("<dd", data, parts[b"GRID"] + 24)
    (blank,) = struct.unpack_from("<d", data, parts[b"GRID"] + 64)
    shape = _shape(path, columns, rows)
    values = np.frombuffer(data, "<f8", rows * columns, parts[b"DATA"]).reshape(shape)
    return values, (step_x, step_y), min(abs(blank) or _BLANK, _BLANK)
