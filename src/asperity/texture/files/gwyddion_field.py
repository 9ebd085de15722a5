"""Gwyddion's simple fields (`.gsf`): lines of text, and 32-bit floats from the top."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from asperity._core.units import length_of
from asperity.texture.files.stored import NO_UNIT, Stored, check_size, refuse

_MARK = b"Gwyddion Simple Field 1."


def load_field(path: Path) -> Stored:
    """Return the heights of a simple field, its rows from the bottom.

    Lengths are in base units, m, by the format's definition; those that it does not state are not
    known.

    Raises
    ------
    SurfaceError
        A file that is damaged, or whose values are no lengths; one line.
    """
    data = path.read_bytes()
    end = data.find(b"\0")
    if not data.startswith(_MARK) or end < 0:
        refuse(path, "no simple field of Gwyddion, or damaged; valid: the file as it was exported")
    lines = data[:end].decode("utf-8", "replace").split("\n")
    head = dict(re.split(r"\s*=\s*", line.strip(), maxsplit=1) for line in lines if "=" in line)
    unit, places = head.get("ZUnits", ""), head.get("XYUnits", "m")
    metres, across = length_of(unit) if unit else 1.0, length_of(places)
    if metres is None:
        refuse(path, f"its values are in {unit[:20]!r}; valid: a channel of heights, in m")
    try:
        columns, rows = int(head["XRes"]), int(head["YRes"])
        sides = [float(head[key]) for key in ("XReal", "YReal") if key in head]
        check_size(path, rows, columns)
        values = np.frombuffer(data, "<f4", rows * columns, end + 4 - end % 4)
    except (KeyError, ValueError, OverflowError):
        refuse(path, "damaged or cut short; valid: the file as Gwyddion wrote it")
    if min(rows, columns) < 1:
        refuse(path, f"it has {columns} x {rows} samples; valid: 1 or more along each axis")
    size = None
    if len(sides) == 2 and across is not None:
        size = (sides[0] * across / columns, sides[1] * across / rows)
    notes = () if unit else (NO_UNIT,)
    return Stored(np.flipud(values.reshape(rows, columns)), notes, size, metres, unit)
