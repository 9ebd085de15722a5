"""Scans of Nanonis (`.sxm`): a head of text, and 32-bit floats of each channel and direction."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from asperity._core.units import length_of
from asperity.errors import SurfaceError
from asperity.texture.files.stored import Stored, check_size, refuse

_MARK, _END, _START = b":NANONIS_VERSION:", b":SCANIT_END:", b"\x1a\x04"
_HEIGHTS = re.compile(r"z|topo|height", re.IGNORECASE)


def load_scan(path: Path) -> Stored:
    """Return the heights of a scan of Nanonis: forward, of the channel Z, else of one in m.

    Raises
    ------
    SurfaceError
        A file that is damaged, or without a channel of heights; one line.
    """
    data = path.read_bytes()
    start = data.find(_START, data.find(_END))
    if not data.startswith(_MARK) or start < 0:
        refuse(path, "no scan of Nanonis, or damaged; valid: the file as Nanonis wrote it")
    head = _head(data[:start].decode("latin-1"))
    try:
        columns, rows = (int(word) for word in head["SCAN_PIXELS"].split())
        width, height = (float(word) for word in head["SCAN_RANGE"].split())
        lines = [line.split("\t") for line in head["DATA_INFO"].splitlines()[1:] if line.strip()]
        channels = [[cell.strip() for cell in line if cell.strip()] for line in lines]
        before, name, unit = _channel(path, channels)
        check_size(path, rows, columns)
        size = rows * columns
        values = np.frombuffer(data, ">f4", size, start + 2 + 4 * size * before)
    except SurfaceError:
        raise
    except (KeyError, ValueError, IndexError, OverflowError):
        refuse(path, "damaged or cut short; valid: the file as Nanonis wrote it")
    values = values.reshape(rows, columns)
    notes = [f"channel {name!r}, forward, of {len(channels)}"]
    if head.get("SCAN_DIR", "").strip() != "up":  # the first line is then the top
        values = np.flipud(values)
    if abs(float(head.get("SCAN_ANGLE", "0") or 0.0)) > 0.0:
        notes.append(f"the scan is turned by {float(head['SCAN_ANGLE']):g} degrees: left as it is")
    metres = length_of(unit)
    return Stored(values, tuple(notes), (width / columns, height / rows), metres, unit)


def _head(text: str) -> dict[str, str]:
    """Return the parts of the head by name; each is a line between colons and those below it."""
    parts = re.split(r"^:([^:\n]+(?:>[^\n]+?)?):[ \t]*\r?$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], (part.strip("\r\n") for part in parts[2::2]), strict=True))


def _channel(path: Path, lines: list[list[str]]) -> tuple[int, str, str]:
    """Return how many maps stand before the heights, their channel's name and its unit."""
    before, found = 0, []
    for _, name, unit, ways, *_ in lines:
        if length_of(unit) is not None:
            found.append((before, name, unit))
        before += 2 if ways.lower() == "both" else 1
    if not found:
        names = ", ".join(f"{line[1]} [{line[2]}]" for line in lines)
        refuse(path, f"no channel of heights among {names[:150] or 'none'}; valid: one in m")
    return next((c for c in found if _HEIGHTS.match(c[1])), found[0])
