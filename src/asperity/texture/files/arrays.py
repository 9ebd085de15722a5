"""Heights from arrays, text and the files of measuring instruments.

Every loader returns the contents of its file as `Stored`: values in metres, with a pixel size where
the file gives one, or grey levels without a scale.
"""

from __future__ import annotations

import importlib
import math
import re
import zipfile
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from asperity.errors import SurfaceError
from asperity.texture.files.images import Stored, check_size, level_step

ARRAY_SUFFIXES = (".npy", ".npz", ".csv", ".txt")
_INSTRUMENTS = """
    001 002 003 004 005 al3d apx asc bcr bcrf cur dat datx ezd frt gwy h5 hfm hgt ibw jpk lext
    mat mdt mi mnt nc nid nms oir opd opdx os3d plu plux poir qep sdf spm stp sur tmd tom top
    vk3 vk4 vk6 vk7 x3p xlsx xyz zmg zon
"""
INSTRUMENT_SUFFIXES = tuple(f".{name}" for name in _INSTRUMENTS.split())
"""Extensions that SurfaceTopography reads and the other readers do not."""
UNITS = {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "m": 1.0}
"""Of heights [m]."""
_PIXEL_KEY = re.compile(r"pixel(_?size)?(_(nm|um|mm|m))?")
_HEIGHT_KEY = re.compile(r".+_(nm|um|mm|m)")
_MISSING_WORDS = ("", "na", "n/a", "null", "none", "-")


def refuse(path: Path, reason: str) -> NoReturn:
    """Raise `SurfaceError` with one line that names the file."""
    raise SurfaceError(f"{path}: {reason}") from None


def load_npy(path: Path) -> Stored:
    """Return the array of a `.npy` file."""
    return _numbers(np.load(path, allow_pickle=False))


def _numbers(values: Any, unit: float = 1.0, notes: tuple[str, ...] = ()) -> Stored:
    """Return an array as heights if its type is a float, as grey levels if an integer."""
    if values.dtype.kind in "ui":
        notes = (*notes, "whole numbers are read as grey levels")
        return Stored(values, notes, in_metres=False, step=level_step(values))
    if values.dtype.kind != "f":
        raise ValueError(f"it holds {values.dtype} values; valid: real numbers")
    return Stored(values.astype(np.float64) * unit, notes)


def load_npz(path: Path, array: str | None = None) -> Stored:
    """Return one array of an archive, in metres, and the pixel size if the archive has it."""
    with zipfile.ZipFile(path) as members:
        check_size(path, sum(member.file_size for member in members.infolist()) // 8)
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = _choose_array(path, arrays, array)
    unit = _unit_of(name)
    if unit != "m" and arrays[name].dtype.kind in "ui":
        stored = Stored(arrays[name] * UNITS[unit])
    else:
        stored = _numbers(arrays[name], UNITS[unit])
    if stored.in_metres:
        stored = stored._replace(notes=(f"array {name!r}, in {unit}",))
    for key, sizes in arrays.items():
        found = _PIXEL_KEY.fullmatch(key)
        if found and sizes.dtype.kind in "iuf" and sizes.size in (1, 2):
            sizes_m = np.ravel(sizes) * UNITS[found.group(3) or "m"]
            return stored._replace(pixel_size=_square(path, sizes_m))
    return stored


def _unit_of(name: str) -> str:
    """Return the unit by which the name of some heights ends, by default metres."""
    match = _HEIGHT_KEY.fullmatch(name)
    return match.group(1) if match else "m"


def _choose_array(path: Path, arrays: dict[str, Any], array: str | None) -> str:
    if array is not None:
        if array not in arrays:
            refuse(path, f"no array {array!r}; valid: {', '.join(arrays)}")
        return array
    numeric = {
        name: values
        for name, values in arrays.items()
        if values.dtype.kind in "iuf" and not _PIXEL_KEY.fullmatch(name)
    }
    maps = [n for n, values in numeric.items() if values.ndim == 2] or [
        n for n, values in numeric.items() if values.ndim == 1 and values.size > 3
    ]
    if len(maps) != 1:
        how_many = "several arrays" if maps else "no array"
        refuse(path, f"{how_many} of heights; choose with array= from: {', '.join(arrays)}")
    return maps[0]


def _square(path: Path, sizes: Any) -> float:
    if not np.all(np.isfinite(sizes)) or np.min(sizes) <= 0.0:
        refuse(path, f"the file's pixel size is {list(sizes)}; valid: above 0 [m]")
    if np.ptp(sizes) > 1e-6 * np.max(sizes):
        sides = " x ".join(f"{size * 1e6:g}" for size in sizes)
        refuse(path, f"the pixels are {sides} um; valid: square pixels")
    return float(sizes[0])


def load_text(path: Path) -> Stored:
    """Return a column or a matrix of numbers; the first line may name the columns."""
    check_size(path, path.stat().st_size // 16)
    text = path.read_text(encoding="utf-8-sig")
    lines = [line.split("#")[0].strip(" \r") for line in text.splitlines()]
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    separator = next((s for s in (";", "\t", ",") if any(s in line for _, line in numbered)), None)
    rows: list[list[float]] = []
    notes: tuple[str, ...] = ()
    unit = "m"
    for number, line in numbered:
        # Where semicolons separate the columns, a comma is a decimal mark.
        words = line.replace(",", ".") if separator == ";" else line
        try:
            rows.append([_number(word) for word in words.split(separator)])
        except ValueError as error:
            if rows or notes:
                refuse(path, f"line {number}: {error}; valid: numbers")
            unit = _unit_of(line.strip())
            notes = (f"the first line is a heading: {line[:60].strip()}; heights in {unit}",)
        if rows and len(rows[-1]) != len(rows[0]):
            refuse(path, f"line {number} has {len(rows[-1])} columns, the first {len(rows[0])}")
    if not rows:
        refuse(path, "there are no numbers in it")
    if len(rows[0]) == 2 and len(rows) > 2:
        refuse(path, "two columns, place and height?; valid: one column of heights or a matrix")
    return Stored(np.array(rows) * UNITS[unit], notes)


def _number(word: str) -> float:
    return math.nan if word.strip().lower() in _MISSING_WORDS else float(word)


def load_instrument(path: Path) -> Stored:
    """Return the default channel of an instrument's file, through SurfaceTopography."""
    try:
        surfaces = importlib.import_module("SurfaceTopography")
    except ImportError:
        refuse(
            path,
            f"{path.suffix} files need SurfaceTopography, which is not installed; "
            "valid: pip install 'asperity[surfaces]'",
        )
    with surfaces.open_topography(str(path)) as reader:
        check_size(path, *reader.channels[0].nb_grid_pts)
        topography, channels = reader.topography(), len(reader.channels)
    notes = (f"the default channel of {channels} is read",) if channels > 1 else ()
    if not topography.is_uniform:
        refuse(path, "its points are not evenly spaced; valid: heights on a grid")
    if topography.unit is None:
        heights, pixel_size = topography.heights(), None
        notes = (*notes, "the file names no unit")
    else:
        notes = (*notes, f"heights in the file's unit, {topography.unit}, are turned into m")
        topography = topography.to_unit("m")
        heights, pixel_size = topography.heights(), _square(path, topography.pixel_size)
    # Its first index runs along u.
    values = np.ma.filled(np.ma.asarray(heights, dtype=np.float64), np.nan).T
    return Stored(values, notes, pixel_size, topography.unit is not None)
