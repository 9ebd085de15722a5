"""Heights from NumPy's arrays: `.npy` and `.npz`."""

from __future__ import annotations

import io
import os
import re
import zipfile
from pathlib import Path
from typing import Any, Literal

import numpy as np

from asperity._core.units import SHORT, length_of
from asperity._core.unpacking import content_of
from asperity.errors import SurfaceError
from asperity.texture.files.checks import MAX_SAMPLES
from asperity.texture.files.stored import (
    NO_UNIT,
    Stored,
    check_size,
    level_step,
    refuse,
)

ARRAY_SUFFIXES = (".npy", ".npz", ".csv", ".txt", ".tsv")
"""Of arrays and text."""
GREY_LEVELS = "whole numbers are read as grey levels"
"""Note on arrays of integers."""
_PIXEL_KEY = re.compile(r"(?:pixel(_?(?:size|pitch|spacing))?|spacing)(_(nm|um|mm|m))?")
_STEP_KEYS = tuple(
    re.compile(
        rf"(?:d{axis}|{axis}_(?:step|spacing|pixel_size)|pixel_?size_{axis})(_(nm|um|mm|m))?"
    )
    for axis in "xy"
)
_PLACE_KEYS = tuple(re.compile(rf"{axis}(_(nm|um|mm|m))?", re.IGNORECASE) for axis in "xy")
_UNIT_KEYS = ("unit", "units", "height_unit", "height_units", "z_unit", "z_units", "unit_z")
"""Names of an array of one text, the unit of the heights."""
_HEIGHT_KEY = re.compile(r".+_(nm|um|mm|m)")
_FEW, _LONG = 8, 16
"""Columns of points at most, and rows a column from which an array is suspected to hold them."""
_ARE_POINTS = "are they points, x, y and z in each row? Valid as text, or as heights on their grid"
_VALID = "valid: an array of numbers, saved by numpy.save or numpy.savez"


def load_npy(path: Path) -> Stored:
    """Return the array of a `.npy` file."""
    packed = path.suffix.lower() == ".gz"
    # Reading is faster than mapping; in a larger file there may be too many samples.
    mapped = not packed and path.stat().st_size > MAX_SAMPLES
    mode: Literal["r"] | None = "r" if mapped else None
    # A path as text, which NumPy does not resolve: that takes as long as all else.
    file = io.BytesIO(content_of(path)) if packed else os.fspath(path)
    try:
        array = np.load(file, mmap_mode=mode, allow_pickle=False)
    except Exception:  # whatever NumPy raises on a damaged header
        refuse(path, f"cannot be read as a .npy file: damaged, or no numbers; {_VALID}")
    check_size(path, *array.shape)
    return _numbers(path, np.asarray(array))


def _numbers(path: Path, values: Any, unit: str = "") -> Stored:
    """Return an array as heights if its type is a float or a unit is said, else as grey levels."""
    if values.dtype.kind not in "uif":
        refuse(path, f"it holds {values.dtype} values; valid: real numbers")
    scale = SHORT[unit or "m"]
    notes: tuple[str, ...] = ()
    if values.ndim == 2 and values.shape[1] <= _FEW and len(values) > _LONG * values.shape[1]:
        notes = (f"a map of {values.shape[1]} columns and {len(values)} rows: {_ARE_POINTS}",)
    if values.dtype.kind in "ui" and not unit:
        return Stored(values, (*notes, GREY_LEVELS), scale=None, step=level_step(values))
    return Stored(values, notes if unit else (*notes, NO_UNIT), None, scale, unit)


def load_npz(path: Path, array: str | None = None) -> Stored:
    """Return one array of an archive, and the pixel size if the archive has it."""
    try:
        with zipfile.ZipFile(path) as members:
            check_size(path, sum(member.file_size for member in members.infolist()) // 8)
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except SurfaceError:
        raise
    except Exception:  # whatever NumPy and zipfile raise on a damaged archive
        refuse(path, f"cannot be read as a .npz file: damaged, or no arrays; {_VALID}")
    name = _choose_array(path, arrays, array)
    found = _HEIGHT_KEY.fullmatch(name)
    stored = _numbers(path, arrays[name], found.group(1) if found else "")
    if stored.scale is not None:
        said = f", in {stored.unit}" if stored.unit else ""
        stored = stored._replace(notes=(f"array {name!r}{said}", *stored.notes))
    stored = _in_stated_unit(stored, arrays)
    left = [key for key, values in arrays.items() if key != name and values.size > 2]
    left = [key for key in left if not any(of.fullmatch(key) for of in _PLACE_KEYS)]
    if left:
        stored = stored._replace(
            notes=(
                *stored.notes,
                f"arrays left out: {', '.join(left)[:80]}; nan marks what is missing",
            )
        )
    placed = _placed(stored, arrays)
    if placed is not None:
        return placed
    steps = [next(filter(None, map(of.fullmatch, arrays)), None) for of in _STEP_KEYS]
    if all(step and arrays[step.group()].size == 1 for step in steps):
        pu, pv = (float(arrays[m.group()].flat[0]) * SHORT[m.group(2) or "m"] for m in steps if m)
        return stored._replace(pixel_size=(pu, pv))
    for key, sizes in arrays.items():
        named = _PIXEL_KEY.fullmatch(key)
        if named and sizes.dtype.kind in "iuf" and sizes.size in (1, 2):
            pu, pv = np.broadcast_to(np.ravel(sizes), 2) * SHORT[named.group(3) or "m"]
            if not named.group(3) and stored.unit not in ("", "m"):
                doubt = f"is {key} in {stored.unit} too? Its name states none: read in m"
                stored = stored._replace(notes=(*stored.notes, doubt))
            return stored._replace(pixel_size=(float(pu), float(pv)))
    return stored


def _placed(stored: Stored, arrays: dict[str, Any]) -> Stored | None:
    """Return heights with the pixel size of even places x and y beside them, None without."""
    size, values = [], stored.values
    for axis, of in zip((1, 0), _PLACE_KEYS, strict=True):
        named = next(filter(None, map(of.fullmatch, arrays)), None)
        places = arrays[named.group()] if named else None
        if places is not None and places.shape == values.shape:
            places = _of_mesh_grid(places, axis)
        if values.ndim != 2 or places is None or places.dtype.kind not in "iuf":
            return None
        if places.shape != values.shape[axis : axis + 1] or len(places) < 3:
            return None
        steps = np.diff(places.astype(np.float64))
        if steps[0] == 0.0 or not np.allclose(steps, steps.mean(), rtol=1e-3, atol=0.0):
            return None
        values = np.flip(values, axis) if steps[0] < 0.0 else values
        size.append(abs(float(steps.mean())) * SHORT[(named and named.group(2)) or "m"])
    notes = (*stored.notes, "its pixel size is that of the places x and y beside the heights")
    return stored._replace(values=values, pixel_size=(size[0], size[1]), notes=notes)


def _of_mesh_grid(places: Any, axis: int) -> Any:
    """Return the places along an axis of an array that repeats them, as meshgrid makes it."""
    line = places[0] if axis else places[:, 0]
    repeated = line[None, :] if axis else line[:, None]
    return line if places.ndim == 2 and (places == repeated).all() else None


def _in_stated_unit(stored: Stored, arrays: dict[str, Any]) -> Stored:
    """Return heights in the unit that an array of one text states, if their name states none."""
    texts = (arrays[key] for key in _UNIT_KEYS if key in arrays)
    said = next((str(text.flat[0]) for text in texts if text.dtype.kind == "U" and text.size), "")
    if not said or stored.unit:
        return stored
    notes = tuple(note for note in stored.notes if note not in (NO_UNIT, GREY_LEVELS))
    metres = length_of(said)
    is_length = "as the file states" if metres else "which is no length"
    return stored._replace(
        notes=(*notes, f"heights in {said}, {is_length}"), scale=metres, unit=said, step=0.0
    )


def _choose_array(path: Path, arrays: dict[str, Any], array: str | None) -> str:
    if array is not None:
        if array not in arrays:
            refuse(path, f"no array {array!r}; valid: {', '.join(arrays)[:200]}")
        return array
    numeric = {
        name: values
        for name, values in arrays.items()
        if values.dtype.kind in "iuf" and not _PIXEL_KEY.fullmatch(name)
    }
    maps = [n for n, values in numeric.items() if values.ndim == 2]
    maps = (
        [n for n in maps if not any(of.fullmatch(n) for of in _PLACE_KEYS)]
        or maps
        or [n for n, values in numeric.items() if values.ndim == 1 and values.size > 3]
    )
    if len(maps) != 1:
        how_many = "several arrays" if maps else "no array"
        refuse(path, f"{how_many} of heights; choose with array= from: {', '.join(arrays)[:200]}")
    return maps[0]
