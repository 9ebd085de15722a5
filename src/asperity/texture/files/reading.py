"""Heights from files: images, arrays, text, and the formats of measuring instruments.

Every reader returns heights [m] on a grid, row 0 at v = 0, and notes on its decisions. What a file
states of itself is read; what it does not say must be given (an image has no scale), missing values
are refused unless filling is requested, and a scale that is hardly right is doubted in a note.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Mask
from asperity._core.units import SHORT
from asperity.errors import require_choice
from asperity.texture.files.checks import PIXEL_SIZES
from asperity.texture.files.colours import COLOURS
from asperity.texture.files.doubts import depth_doubt, doubts, sentinel_note
from asperity.texture.files.levels import smooth_levels
from asperity.texture.files.loading import load_stored
from asperity.texture.files.stored import NO_UNIT, Stored, check_size, refuse

_NEVER = 1e30
"""Programs write larger numbers only for what is missing."""


class Heights(NamedTuple):
    """Heights read from a file.

    Attributes
    ----------
    samples : (nv, nu) or (n,) array
        Heights [m] at `(i + 1/2) * pixel_size`, row 0 at v = 0.
    pixel_size : float or (pu, pv)
        Distance between samples [m]; a pair where it differs along u and v.
    notes : tuple of str
        Choices, conversions, filling, smoothing and doubts, one line each, to be shown to the user.
    """

    samples: Array
    pixel_size: float | tuple[float, float]
    notes: tuple[str, ...]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of damaged numbers
def read_heights(
    path: str | os.PathLike[str],
    *,
    pixel_size: float | Sequence[float] | None = None,
    height_range: float | None = None,
    invert: bool = False,
    missing: str = "refuse",
    array: str | None = None,
    quantised: str = "smooth",
    unit: str | None = None,
    colour: str | None = None,
    nodata: float | None = None,
) -> Heights:
    """Return the heights in a file, in metres.

    Images (PNG, TIFF, JPEG and others; OpenEXR where its reader is installed) are read as grey
    values at full bit depth, palettes applied, turned by EXIF, and flipped so that the bottom of
    the picture is v = 0. Arrays (`.npy`, `.npz`) are in metres, unless the name of the array in the
    `.npz` ends in `_mm`, `_um` or `_nm`; integers in them are grey levels. Text (`.csv`, `.txt`: a
    matrix, a column, x, y, z of points, or place and height of a profile) is in the unit that its
    header or heading names, else in metres; the headers of Gwyddion's export and of others are
    read. Files of instruments are read by SurfaceTopography
    (`pip install 'asperity[surfaces]'`).

    Parameters
    ----------
    path : str or path
        The file.
    pixel_size : float or (pu, pv), optional
        Distance between samples [m], above 0. Required where the file does not contain it, as for
        all images; otherwise it overrides the file's.
    height_range : float, optional
        Height from the lowest to the highest value in the file [m], above 0. Required for images
        and grey levels; heights in metres are rescaled to it. The result has zero mean.
    invert : bool
        For maps of depth: exchanges hills and valleys.
    missing : {"refuse", "fill"}
        Treatment of values that are NaN, infinite, or what the file calls nodata: raise, or fill
        them by harmonic interpolation of their surroundings (a hole gets no new hills or valleys).
    array : str, optional
        Name of the array, for an `.npz` file with several.
    quantised : {"smooth", "keep"}
        Treatment of maps of 256 grey levels or fewer: smooth them within half a level
        (`asperity.texture.files.levels.smooth_levels`), or keep the steps.
    unit : {"m", "mm", "um", "nm"}, optional
        Unit of the file's values; of an image, instead of `height_range`: 0 remains 0.
    colour : str, optional
        What the colours of an image mean: `"luminance"`, `"red"`, `"green"`, `"blue"`, or heights
        packed in bytes, `"packed-rgb"`, `"packed-bgr"`, `"packed-rg"`, `"packed-gr"`,
        `"terrain-rgb"`, `"terrarium"`. Without it a picture that has colours is refused.
    nodata : float, optional
        Value that stands for a missing one, as stored in the file.

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
    path = Path(path)
    if path.parts[:1] and path.parts[0].startswith("~"):
        path = Path(os.path.expanduser(path))
    require_choice("missing", missing, ("refuse", "fill"))
    require_choice("quantised", quantised, ("smooth", "keep"))
    if colour is not None:
        require_choice("colour", colour, COLOURS)
    if unit is not None:
        unit = require_choice("unit", unit, SHORT)
    pixels = None if pixel_size is None else _lengths(path, "pixel_size", pixel_size)
    if height_range is not None:
        _lengths(path, "height_range", height_range)
    stored = load_stored(path, array, colour, pixels)
    if unit is not None:
        stored = _in_unit(path, stored, unit, height_range)
    elif stored.sizes_follow and pixels is not None and stored.pixel_size is not None:
        stored = _as_given(stored, pixels)
    notes = list(stored.notes)
    if height_range is not None and NO_UNIT in notes:
        notes.remove(NO_UNIT)
    size = _pixel_size(path, stored, pixels, height_range, notes)
    values, low, high = _shaped(path, stored.values)
    if nodata is not None or not max(-low, high) < _NEVER:
        values = np.array(values)  # some of them are changed
    if nodata is not None:
        if isinstance(nodata, bool) or not isinstance(nodata, int | float | np.number):
            refuse(path, f"nodata must be a number, got {nodata!r}")
        values[values == nodata] = np.nan
        low, high = float(values.min()), float(values.max())
    if max(-low, high) >= _NEVER and nodata is None:
        never = np.abs(values) >= _NEVER
        if not never.all():
            notes.append(f"values beyond {_NEVER:g} are taken for missing ones")
            values[never] = np.nan
            low, high = float(values.min()), float(values.max())
    if nodata is None and (doubtful := sentinel_note(values, low, high)) is not None:
        notes.append(doubtful)
    if not (math.isfinite(low) and math.isfinite(high)):
        values = _without_missing(path, values, missing, notes)
        low, high = float(values.min()), float(values.max())
    if not invert:
        notes += depth_doubt(path.stem, notes)
    values, scale = _scaled(values, stored, (low, high), height_range, invert, quantised, notes)
    notes += doubts(values, size, scale * (high - low))
    return Heights(values, size[0] if _is_square(size) else size, tuple(notes))


def _is_square(size: tuple[float, float]) -> bool:
    return math.isclose(*size, rel_tol=1e-6)


def _scaled(
    values: Array, stored: Stored, extremes: tuple[float, float], height_range: float | None,
    invert: bool, quantised: str, notes: list[str],
) -> tuple[Array, float]:  # fmt: skip
    """Return stored values as heights [m] in memory of their own, and metres a unit."""
    relief = extremes[1] - extremes[0]
    if relief == 0.0:
        notes.append(f"every value is {values.flat[0]:g}: all heights are zero")
        return np.zeros(values.shape), 0.0
    scale = (stored.scale or 1.0) if height_range is None else height_range / relief
    centre = 0.0 if height_range is None else float(values.mean())
    if stored.step and relief <= 255.0 * stored.step:
        half = f"half a grey level, {0.5e6 * scale * stored.step:.3g} um"
        if quantised == "smooth":
            values = smooth_levels(values, stored.step)
            notes.append(f"256 grey levels or fewer: smoothed, by at most {half}")
        else:
            notes.append(f"256 grey levels or fewer, kept: heights are rounded to {half}")
    own = values if values.flags.writeable else None  # else they are mapped from the file
    if centre:
        values = own = np.subtract(values, centre, out=own)
    return np.multiply(values, -scale if invert else scale, out=own), scale


def _lengths(path: Path, name: str, value: Any) -> tuple[float, float]:
    """Return a length, or a pair of them, as a pair, or refuse it."""
    try:
        alone = isinstance(value, float) or np.ndim(value) == 0
        pair = [float(v) for v in ((value, value) if alone else value)]
        good = len(pair) == 2 and all(math.isfinite(v) and v > 0.0 for v in pair)
    except (TypeError, ValueError):
        good = False
    if not good or (name == "height_range" and not alone):
        refuse(path, f"{name} must be a finite number above 0 [m], got {value!r}")
    return pair[0], pair[1]


def _in_unit(path: Path, stored: Stored, unit: str, height_range: float | None) -> Stored:
    """Return a file's values as heights in `unit`; another unit of the file is noted."""
    if height_range is not None and not stored.unit:
        refuse(path, "unit= and height_range= both give its heights a scale; give one")
    metres = SHORT[unit]
    notes = tuple(n for n in stored.notes if not n.startswith("no unit is stated"))
    size = stored.pixel_size
    if stored.unit and stored.scale != metres:
        notes = (*notes, f"heights in {unit}, as given; the file states {stored.unit}")
    if stored.sizes_follow and size is not None and min(size) * metres >= PIXEL_SIZES[0]:
        size = (size[0] * metres, size[1] * metres)  # else they are in m, as of a map
        notes = (*notes, f"places and heights in {unit}, as given")
    return stored._replace(scale=metres, pixel_size=size, notes=notes, sizes_follow=False)


def _as_given(stored: Stored, given: tuple[float, float]) -> Stored:
    """Return points without a unit in the one in which their distance is the given pixel size."""
    assert stored.pixel_size is not None
    for name, metres in SHORT.items():
        if np.allclose(np.multiply(stored.pixel_size, metres), given, rtol=1e-3, atol=0.0):
            notes = tuple(n for n in stored.notes if not n.startswith("no unit is stated"))
            note = f"places and heights in {name}, in which their distance is the given pixel size"
            return stored._replace(scale=metres, pixel_size=given, notes=(*notes, note))
    return stored


def _shaped(path: Path, stored: NDArray[Any]) -> tuple[Array, float, float]:
    """Return stored values as floats, copied if they must be, and their extremes.

    The last two are NaN if any value is.
    """
    if np.squeeze(stored).ndim > 2:
        refuse(path, f"it holds values of shape {stored.shape}; valid: a line or a matrix")
    check_size(path, *stored.shape)
    source = np.squeeze(stored)
    if source.size < 2:
        refuse(path, f"heights need 2 samples or more along each axis, got {stored.shape}")
    # Extremes are those of the fewer bytes of another type, gone through as they lie.
    stored = source[::-1] if source.strides[0] < 0 else source
    low, high = float(stored.min()), float(stored.max())
    return np.asarray(source, dtype=np.float64, order="C"), low, high


def _pixel_size(
    path: Path,
    stored: Stored,
    given: tuple[float, float] | None,
    height_range: float | None,
    notes: list[str],
) -> tuple[float, float]:
    """Return the pixel size [m], given or from the file, and note the source of the scale."""
    own = stored.pixel_size
    wanted = []
    if given is None and own is None:
        wanted.append("pixel_size [m]")
    if height_range is None and stored.scale is None:
        wanted.append("height_range [m], lowest to highest, or unit")
    if wanted:
        dots = stored.printed_size if given is None and own is None else None
        hint = (
            "" if dots is None else f"; its resolution, of a print or not, is {_um(dots)} a pixel"
        )
        choice = f"choose a value for {' and '.join(wanted)}{hint}"
        refuse(path, f"the file does not hold its scale; {choice}")
    if own is not None and not all(math.isfinite(side) and side > 0.0 for side in own):
        refuse(path, f"the file's pixel size is {list(own)}; valid: above 0 [m]")
    if height_range is not None:
        notes.append(f"height range {height_range * 1e6:.6g} um: chosen, not measured")
    if given is None:
        assert own is not None
        notes.append(f"pixel size {_um(own)}, from the file")
        return own
    dots = None if own is not None else stored.printed_size
    if dots is not None and not np.allclose(given, dots, rtol=0.01, atol=0.0):
        notes.append(f"its resolution, of a print or not, is {_um(dots)} a pixel")
    if own is not None and not np.allclose(given, own, rtol=1e-6, atol=0.0):
        notes.append(f"pixel size {_um(given)}, as given; the file has {_um(own)}")
    return given


def _um(size: tuple[float, float]) -> str:
    if _is_square(size):
        return f"{size[0] * 1e6:.6g} um"
    return f"{size[0] * 1e6:.6g} x {size[1] * 1e6:.6g} um"


def _without_missing(path: Path, values: Array, missing: str, notes: list[str]) -> Array:
    absent = ~np.isfinite(values)
    count = int(np.count_nonzero(absent))
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
