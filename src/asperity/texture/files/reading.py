"""Heights from files: images, arrays, text, and the formats of measuring instruments.

Every reader returns heights [m] on a square grid, row 0 at v = 0, and notes on its decisions.
Nothing is guessed: an image has no scale, so the scale must be given; missing values are refused
unless filling is requested.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Mask
from asperity._core.files import reading
from asperity.errors import SurfaceError, require_choice
from asperity.texture.files.arrays import (
    ARRAY_SUFFIXES,
    INSTRUMENT_SUFFIXES,
    UNITS,
    load_instrument,
    load_npy,
    load_npz,
    load_text,
    refuse,
)
from asperity.texture.files.images import (
    IMAGE_SUFFIXES,
    Stored,
    check_size,
    read_image,
    smooth_levels,
)

_KNOWN = (
    f"an image ({', '.join(IMAGE_SUFFIXES)}); an array or text ({', '.join(ARRAY_SUFFIXES)}); "
    f"an instrument's file ({', '.join(INSTRUMENT_SUFFIXES)})"
)


class Heights(NamedTuple):
    """Heights read from a file.

    Attributes
    ----------
    samples : (nv, nu) or (n,) array
        Heights [m] at `(i + 1/2) * pixel_size`, row 0 at v = 0.
    pixel_size : float
        Distance between samples [m].
    notes : tuple of str
        Choices, conversions, filling and smoothing, one line each, to be shown to the user.
    """

    samples: Array
    pixel_size: float
    notes: tuple[str, ...]


def read_heights(
    path: str | os.PathLike[str],
    *,
    pixel_size: float | None = None,
    height_range: float | None = None,
    invert: bool = False,
    missing: str = "refuse",
    array: str | None = None,
    quantised: str = "smooth",
    unit: str | None = None,
) -> Heights:
    """Return the heights in a file, in metres.

    Images (PNG, TIFF, JPEG; OpenEXR where its reader is installed) are read as grey values at full
    bit depth, palettes applied, colour converted to luminance, and flipped so that the bottom of
    the picture is v = 0. Arrays (`.npy`, `.npz`) and text (`.csv`, `.txt`: one column, or a matrix)
    are in metres, unless the name of the array in the `.npz` ends in `_mm`, `_um` or `_nm`;
    integers in `.npy` and `.npz` are grey levels. Files of instruments are read by
    SurfaceTopography (`pip install 'asperity[surfaces]'`).

    Parameters
    ----------
    path : str or path
        The file.
    pixel_size : float, optional
        Distance between samples [m], above 0. Required where the file does not contain it, as for
        all images; otherwise it overrides the file's.
    height_range : float, optional
        Height from the lowest to the highest value in the file [m], above 0. Required for images
        and grey levels; heights in metres are rescaled to it. The result has zero mean.
    invert : bool
        For maps of depth: exchanges hills and valleys.
    missing : {"refuse", "fill"}
        Treatment of values that are NaN or infinite: raise, or fill them by harmonic interpolation
        of their surroundings (a hole gets no new hills or valleys).
    array : str, optional
        Name of the array, for an `.npz` file with several.
    quantised : {"smooth", "keep"}
        Treatment of maps of 256 grey levels or fewer: smooth them within half a level
        (`asperity.texture.files.images.smooth_levels`), or keep the steps.
    unit : {"m", "mm", "um", "nm"}, optional
        Unit of an image's values, instead of `height_range`, for images that contain heights: 0
        remains 0. Without it they are grey values.

    Returns
    -------
    Heights
        `(samples, pixel_size, notes)`. A map of one single value gives heights of exactly zero.

    Raises
    ------
    SurfaceError
        A file that is missing, empty, damaged, of unknown kind, larger than 2**27 samples, or
        without a scale; one line that names the file and what is valid.
    """
    path = Path(os.path.expanduser(path))
    require_choice("missing", missing, ("refuse", "fill"))
    require_choice("quantised", quantised, ("smooth", "keep"))
    for name, value in (("pixel_size", pixel_size), ("height_range", height_range)):
        if value is not None:
            _require_length(path, name, value)
    stored = _load(path, array)
    if unit is not None:
        stored = _in_unit(path, stored, unit, height_range)
    values = _shaped(path, stored.values)
    notes = list(stored.notes)
    pixel_size = _pixel_size(path, stored, pixel_size, height_range, notes)
    values = _without_missing(path, values, missing, notes)

    relief = float(values.max() - values.min())
    if relief == 0.0:
        notes.append(f"every value is {values.flat[0]:g}: all heights are zero")
        return Heights(np.zeros_like(values), pixel_size, tuple(notes))
    scale = 1.0 if height_range is None else height_range / relief
    centre = 0.0 if height_range is None else float(values.mean())
    if stored.step and relief <= 255.0 * stored.step:
        half = f"half a grey level, {0.5e6 * scale * stored.step:.3g} um"
        if quantised == "smooth":
            values = smooth_levels(values, stored.step)
            notes.append(f"256 grey levels or fewer: smoothed, by at most {half}")
        else:
            notes.append(f"256 grey levels or fewer, kept: heights are rounded to {half}")
    values = (values - centre) * (-scale if invert else scale)
    return Heights(values, pixel_size, tuple(notes))


def _require_length(path: Path, name: str, value: Any) -> None:
    try:
        good = math.isfinite(value) and value > 0.0
    except TypeError:
        good = False
    if not good:
        refuse(path, f"{name} must be a finite number above 0 [m], got {value!r}")


def _in_unit(path: Path, stored: Stored, unit: str, height_range: float | None) -> Stored:
    """Return an image's values, given in `unit`, in metres."""
    require_choice("unit", unit, UNITS)
    if stored.in_metres:
        refuse(path, "its heights have a unit already; unit= is for images: leave it out")
    if height_range is not None:
        refuse(path, "unit= and height_range= both give its heights a scale; give one")
    values = np.asarray(stored.values, dtype=np.float64) * UNITS[unit]
    return stored._replace(values=values, in_metres=True, step=stored.step * UNITS[unit])


def _load(path: Path, array: str | None) -> Stored:
    """Return the contents of the file at `path`, whatever its format."""
    if array is not None and path.suffix.lower() != ".npz":
        refuse(path, "array= chooses among the arrays of an .npz file; leave it out")
    with reading(path, "heights", [*_LOADERS], valid=_KNOWN, error=SurfaceError) as suffix:
        return _LOADERS[suffix](path) if array is None else load_npz(path, array)


_LOADERS: dict[str, Callable[[Path], Stored]] = {
    **dict.fromkeys(INSTRUMENT_SUFFIXES, load_instrument),
    **dict.fromkeys(IMAGE_SUFFIXES, read_image),
    ".npy": load_npy,
    ".npz": load_npz,
    ".csv": load_text,
    ".txt": load_text,
}


def _shaped(path: Path, stored: NDArray[Any]) -> Array:
    values = np.squeeze(np.ascontiguousarray(stored, dtype=np.float64))
    if values.ndim > 2:
        refuse(path, f"it holds values of shape {stored.shape}; valid: a line or a matrix")
    if values.size < 2:
        refuse(path, f"heights need 2 samples or more along each axis, got {stored.shape}")
    check_size(path, *values.shape)
    return values


def _pixel_size(
    path: Path,
    stored: Stored,
    pixel_size: float | None,
    height_range: float | None,
    notes: list[str],
) -> float:
    """Return the pixel size [m], given or from the file, and note the source of the scale."""
    wanted = []
    if pixel_size is None and stored.pixel_size is None:
        wanted.append("pixel_size [m]")
    if height_range is None and not stored.in_metres:
        wanted.append("height_range [m], lowest to highest")
    if wanted:
        refuse(path, f"the file does not hold its scale; choose a value for {' and '.join(wanted)}")
    if pixel_size is None:
        assert stored.pixel_size is not None
        notes.append(f"pixel size {stored.pixel_size * 1e6:.6g} um, from the file")
        return stored.pixel_size
    if stored.pixel_size is not None and not math.isclose(pixel_size, stored.pixel_size):
        notes.append(
            f"pixel size {pixel_size * 1e6:.6g} um, as given; "
            f"the file has {stored.pixel_size * 1e6:.6g} um"
        )
    if height_range is not None:
        notes.append(f"height range {height_range * 1e6:.6g} um: chosen, not measured")
    return float(pixel_size)


def _without_missing(path: Path, values: Array, missing: str, notes: list[str]) -> Array:
    absent = ~np.isfinite(values)
    count = int(np.count_nonzero(absent))
    if count == 0:
        return values
    missing_values = f"{count} of {values.size} values are missing (NaN or infinite)"
    if count == values.size:
        refuse(path, f"all {count} values are missing (NaN or infinite)")
    if missing == "refuse":
        refuse(path, f"{missing_values}; valid: missing='fill', or a file without gaps")
    notes.append(f"{missing_values} and are filled from their surroundings")
    return _filled(values, absent)


def _filled(values: Array, absent: Mask) -> Array:
    """Return `values` with missing ones replaced by the solution of Laplace's equation.

    The border is insulated, so gaps at it level out towards it.
    """
    from scipy import sparse  # slow to import, and rarely needed
    from scipy.sparse import linalg

    unknowns = np.full(values.shape, -1)
    unknowns[absent] = np.arange(np.count_nonzero(absent))
    size = int(unknowns.max()) + 1
    degree, known = np.zeros(size), np.zeros(size)
    pairs: list[tuple[NDArray[np.int_], NDArray[np.int_]]] = []
    for axis in range(values.ndim):
        for here, there in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            at = tuple(here if k == axis else slice(None) for k in range(values.ndim))
            beside = tuple(there if k == axis else slice(None) for k in range(values.ndim))
            inside = absent[at]
            row, column = unknowns[at][inside], unknowns[beside][inside]
            degree[row] += 1.0
            free = column >= 0
            known[row[~free]] += values[beside][inside][~free]
            pairs.append((row[free], column[free]))
    rows = np.concatenate([row for row, _ in pairs])
    columns = np.concatenate([column for _, column in pairs])
    links = sparse.csr_matrix((np.ones(rows.size), (rows, columns)), shape=(size, size))
    matrix = (sparse.diags(degree) - links).tocsc()
    filled = values.copy()
    filled[absent] = linalg.spsolve(matrix, known)
    return filled
