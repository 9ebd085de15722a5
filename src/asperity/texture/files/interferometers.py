"""Heights in the texts of interferometers: Zygo's (MetroPro, Mx) and Wyko's (Vision).

Their numbers have a meaning only with those above them: the wavelength, the size of a pixel.
Of Zygo's 14 lines the 4th holds the map's place and size, the 8th scale factor, wavelength,
obliquity and pixel size, the 11th the resolution of the phase (MetroPro Reference Guide, OMP-0347).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import text_of
from asperity._core.text_table import TextTable
from asperity._core.unpacking import content_of
from asperity.errors import SurfaceError
from asperity.texture.files.stored import Stored, check_size, refuse

_ZYGO, _WYKO = ("Zygo XYZ Data File", "Zygo ASCII Data File"), "Wyko ASCII Data File"
_STEPS = (4096.0, 32768.0, 131072.0)
"""Steps of the phase in a wave, by its resolution."""
_NO_PHASE = 2147483640
"""Phases from here on are missing."""
_TOP = "its first row is the top of the map"


def is_zygo(path: Path) -> bool:
    """Return whether a file is a text by Zygo."""
    return content_of(path, 64).startswith(tuple(name.encode() for name in _ZYGO))


def load_zygo(path: Path) -> Stored:
    """Return the heights of a text by Zygo: phases, or column, row and height in lines.

    Raises
    ------
    SurfaceError
        A file that is damaged, or without heights; one line.
    """
    text = text_of(content_of(path))
    lines = text.split("\n")
    marks = [at for at, line in enumerate(lines) if line.strip() == "#"]
    try:
        left, top, columns, rows = (int(word) for word in lines[3].split()[:4])
        optics = [float(word) for word in lines[7].split()[:7]]
        check_size(path, rows, columns)
        if min(columns, rows) < 2 or not marks or len(optics) < 7:
            raise ValueError
        if text.startswith(_ZYGO[0]):
            end = marks[1] if len(marks) > 1 else len(lines)
            values = _zygo_points(lines[marks[0] + 1 : end], (left, top), (rows, columns))
            scale, what = 1e-6, "heights in um, as Zygo's XYZ files are"
        else:
            values = _zygo_phases(lines, marks, rows * columns).reshape(rows, columns)
            steps = _STEPS[int(lines[10].split()[0])]
            scale = optics[1] * optics[2] * optics[4] / steps
            what = f"phases in steps of {1e9 * scale:.4g} nm"
            if not scale > 0.0:
                raise ValueError
    except SurfaceError:
        raise
    except (ValueError, IndexError, OverflowError):
        refuse(path, "a text by Zygo that is damaged, or has no heights; valid: as it was written")
    pixel = optics[6] if optics[6] > 0.0 else None
    size = None if pixel is None else (pixel, pixel)
    return Stored(np.flipud(values), (what, _TOP), size, scale, "um" if scale == 1e-6 else "phases")


def _zygo_points(lines: list[str], corner: tuple[int, int], shape: tuple[int, int]) -> Array:
    """Return heights from lines of column, row and height, or "No Data"."""
    values = np.full(shape, np.nan)
    for line in lines:
        words = line.split()
        if len(words) == 3:  # "No Data" makes it four
            column, row = int(words[0]) - corner[0], int(words[1]) - corner[1]
            if not (0 <= row < shape[0] and 0 <= column < shape[1]):
                raise ValueError
            values[row, column] = float(words[2])
    return values


def _zygo_phases(lines: list[str], marks: list[int], count: int) -> Array:
    """Return the phases (count,): the last block of numbers of that length; NaN where missing."""
    ends = [*marks[1:], len(lines)]
    for first, end in reversed(list(zip(marks, ends, strict=True))):
        words = " ".join(lines[first + 1 : end]).split()
        if len(words) == count:
            values = np.array(words, dtype=np.float64)
            values[values >= _NO_PHASE] = np.nan
            return values
    raise ValueError


def is_wyko(table: TextTable) -> bool:
    """Return whether a table is of a text by Wyko."""
    return bool(table.header) and table.header[0].startswith(_WYKO)


def load_wyko(table: TextTable) -> Stored:
    """Return the heights of a text by Wyko: the first of its blocks, whose lines are columns.

    In nm, or in wavelengths over a factor, as its first line states; `Pixel_size` is in mm.

    Raises
    ------
    SurfaceError
        A file that is damaged, or states no wavelength; one line.
    """
    found: dict[str, float] = {}
    for line in table.header:
        label, _, value = line.rpartition("\t")
        try:
            found[label.split("\t")[0].strip().lower()] = float(value)
        except ValueError:
            continue
    lines = found.get("x size", 0.0)
    if not 2.0 <= lines < 1e6:
        refuse(table.path, "a text by Wyko without its X Size; valid: as it was written")
    body = "\n".join(table.body.split("\n", int(lines))[: int(lines)])
    values = replace(table, body=body).values()
    flags = table.header[0].rpartition("Format")[2].split()
    size = (1e-3 * found["pixel_size"],) if found.get("pixel_size") else None
    pixel = None if size is None else (size[0], size[0] * found.get("aspect", 1.0))
    if flags[1:2] == ["1"]:
        return Stored(values.T, ("heights in nm, as the file states",), pixel, 1e-9, "nm")
    wave = found.get("wavelength", 0.0) / (found.get("mult") or 1.0)
    if not wave > 0.0:
        refuse(table.path, "a text by Wyko in waves without its Wavelength; valid: as written")
    note = f"heights in waves of {wave:.4g} nm, as the file states"
    return Stored(values.T, (note,), pixel, 1e-9 * wave, "waves")
