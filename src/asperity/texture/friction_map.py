"""Friction that differs from place to place: Coulomb's coefficients on a grid.

Between the samples a map is linear, so that it is nowhere below its least or above its largest
sample: a spline would overshoot at the edges that such patterns are made of.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.errors import (
    AsperityError,
    SurfaceError,
    require_between,
    require_finite,
)
from asperity.texture.files.arrays import ARRAY_SUFFIXES, GREY_LEVELS
from asperity.texture.files.checks import checked_grid, checked_pixel_size
from asperity.texture.files.images import IMAGE_SUFFIXES
from asperity.texture.files.reading import TEXT_SUFFIXES, load_stored
from asperity.texture.files.stored import NO_UNIT, Stored
from asperity.texture.sampled_map import SampledMap

MOST_FRICTION = 100.0
"""Largest coefficient of friction [-]."""
_PAD = {"clamp": "symmetric", "wrap": "wrap"}


@dataclass(frozen=True, eq=False, init=False)
class FrictionMap(SampledMap):
    """Coulomb's coefficient of friction over a plane, linear between samples.

    Parameters
    ----------
    samples : (nv, nu) array
        Coefficients [-] at `(i + 1/2) * pixel_size`, row 0 at v = 0; 0 to 100, at least 4 along
        each axis. A read-only copy is kept.
    pixel_size : float or (pu, pv)
        Distance between samples along u and v [m], 1e-9 to 1; stored as a pair.
    border : {"clamp", "wrap"}
        Beyond its borders the map continues as its border does, or repeats.
    notes : sequence of str
        Choices made on the way here, one line each, to be shown to the user.

    Raises
    ------
    SurfaceError
        Invalid samples, pixel size or border; one line.
    """

    def __init__(
        self,
        samples: ArrayLike,
        pixel_size: float | Sequence[float],
        border: str = "clamp",
        notes: Sequence[str] = (),
    ) -> None:
        coefficients = checked_grid(samples)
        least, most = float(coefficients.min()), float(coefficients.max())
        if least < 0.0 or most > MOST_FRICTION:
            wrong = least if least < 0.0 else most
            raise SurfaceError(
                f"coefficients of friction must lie between 0 and {MOST_FRICTION:g}, got {wrong:g}"
            )
        super().__init__(coefficients, checked_pixel_size(pixel_size), border, notes)

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        pixel_size: float | Sequence[float] | None = None,
        size: Sequence[float] | None = None,
        low: float | None = None,
        high: float | None = None,
        border: str = "clamp",
        array: str | None = None,
    ) -> FrictionMap:
        """Return the map in a file.

        Parameters
        ----------
        path : str or path
            A grey image of 8 or 16 bits, whose bottom is v = 0; or an array or text (`.npy`,
            `.npz`, `.csv`, `.txt`, `.tsv`), or an image of floating point numbers, which hold
            coefficients.
        pixel_size : float or (pu, pv), optional
            Distance between samples [m]. Needed where neither the file nor `size` has it.
        size : (lu, lv), optional
            Size of the whole map [m], instead of `pixel_size`.
        low, high : float, optional
            Coefficients of black, 0, and of white, 255 or 65535; 0 to 100. Both are needed for
            images of 8 or 16 bits, whatever greys they use; other files take none.
        border : {"clamp", "wrap"}
        array : str, optional
            Name of the array, for an `.npz` file with several.

        Raises
        ------
        SurfaceError
            A file that cannot be used; one line that names the file and what is valid.
        """
        path = Path(os.path.expanduser(path))
        try:
            samples, stored = _read(path, array, low, high)
            if size is not None and pixel_size is not None:
                raise SurfaceError("size and pixel_size both give its extent; give one")
            if size is not None:
                lengths, counts = require_finite("size", size, 2), samples.shape[::-1]
                pixel_size = [length / n for length, n in zip(lengths, counts, strict=True)]
            pixels = stored.pixel_size if pixel_size is None else pixel_size
            if pixels is None:
                raise SurfaceError("it does not hold its scale; choose pixel_size or size [m]")
            found = cls(samples, pixels, border)
        except AsperityError as error:
            text = str(error)
            raise SurfaceError(text if str(path) in text else f"{path}: {text}") from None
        extent = " x ".join(f"{1e3 * length:.4g}" for length in found.size)
        note = f"friction {found.lowest:.4g} to {found.highest:.4g}, a map of {extent} mm"
        return replace(found, notes=(*_notes_of(stored), note))

    @property
    def coefficients(self) -> Array:
        """The samples, padded by two on every side as those of splines are, (nv + 4, nu + 4)."""
        return np.pad(self.samples, 2, mode=_PAD[self.border])  # type: ignore[call-overload]


def _read(
    path: Path, array: str | None, low: float | None, high: float | None
) -> tuple[Array, Stored]:
    """Return the coefficients in a file, and what else it holds."""
    suffix = path.suffix.lower()
    if suffix not in (*IMAGE_SUFFIXES, *ARRAY_SUFFIXES):
        valid = ", ".join((*IMAGE_SUFFIXES, *ARRAY_SUFFIXES))
        raise SurfaceError(f"unknown kind of file {suffix!r} for friction; valid: {valid}")
    stored = load_stored(path, array)
    values = stored.values
    is_image, levels = suffix in IMAGE_SUFFIXES, values.dtype.kind in "uib"
    if stored.unit or (is_image and stored.scale is not None):
        raise SurfaceError(f"it holds heights ({stored.unit or 'm'}); valid: coefficients")
    if suffix in TEXT_SUFFIXES and stored.pixel_size is not None:
        raise SurfaceError("it holds points; valid: a matrix of coefficients")
    if not (is_image and levels):
        if is_image and stored.step:
            raise SurfaceError("its colours or missing pixels leave no plain greys; valid: grey "
                               "pixels of 8 or 16 bits, all of them there")  # fmt: skip
        if low is not None or high is not None:
            raise SurfaceError("low and high are for images of 8 or 16 bits; it holds coefficients")
        return values, stored
    if low is None or high is None:
        given = {"low": low, "high": high}.items()
        missing = " and ".join(name for name, value in given if value is None)
        raise SurfaceError(
            f"an image needs low and high, the friction of black and of white; missing: {missing}"
        )
    for name, value in (("low", low), ("high", high)):
        require_between(name, value, 0.0, MOST_FRICTION)
    if low > high:
        raise SurfaceError(f"low must not be above high, got {low:g} and {high:g}")
    white = 1 if values.dtype.kind == "b" else np.iinfo(values.dtype).max
    if white not in (1, 255, 65535):
        raise SurfaceError(f"its pixels are {values.dtype}; valid: 8 or 16 bits, or floats")
    return low + (high - low) * (values / white), stored


def _notes_of(stored: Stored) -> tuple[str, ...]:
    """Return the notes on a file that are true of friction as they are of heights."""
    return tuple(note for note in stored.notes if note not in (NO_UNIT, GREY_LEVELS))
