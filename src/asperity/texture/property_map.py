"""Properties of a surface that differ from place to place: numbers on a grid, and their files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.unpacking import suffix_of
from asperity.errors import (
    AsperityError,
    SurfaceError,
    require_between,
    require_finite,
)
from asperity.texture.files.checks import checked_grid, checked_pixel_size
from asperity.texture.sampled_map import SampledMap

if TYPE_CHECKING:
    from asperity.texture.files.stored import Stored

_PAD = {"clamp": "symmetric", "wrap": "wrap"}


@dataclass(frozen=True, eq=False, init=False)
class PropertyMap(SampledMap):
    """What maps of friction and of stiffness have in common."""

    what: ClassVar[str]
    """The property."""
    values: ClassVar[str]
    """What a file of it holds."""
    limits: ClassVar[tuple[float, float]]
    """Its least and its largest value."""

    def __init__(
        self,
        samples: ArrayLike,
        pixel_size: float | Sequence[float],
        border: str = "clamp",
        notes: Sequence[str] = (),
    ) -> None:
        checked, (low, high) = checked_grid(samples), self.limits
        least, most = float(checked.min()), float(checked.max())
        if least < low or most > high:
            wrong = least if least < low else most
            raise SurfaceError(
                f"{self.values} must lie between {low:g} and {high:g}, got {wrong:g}"
            )
        super().__init__(checked, checked_pixel_size(pixel_size), border, notes)

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
    ) -> Self:
        """Return the map in a file.

        Parameters
        ----------
        path : str or path
            A grey image of 8 or 16 bits, whose bottom is v = 0; or an array or text (`.npy`,
            `.npz`, `.csv`, `.txt`, `.tsv`), or an image of floating point numbers, which hold
            the values themselves.
        pixel_size : float or (pu, pv), optional
            Distance between samples [m]. Needed where neither the file nor `size` has it.
        size : (lu, lv), optional
            Size of the whole map [m], instead of `pixel_size`.
        low, high : float, optional
            Values of black, 0, and of white, 255 or 65535. Both are needed for images of 8 or 16
            bits, whatever greys they use; other files take none.
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
            samples, stored = cls._read(path, array, low, high)
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
        note = f"{cls.what} {found.lowest:.4g} to {found.highest:.4g}, a map of {extent} mm"
        return replace(found, notes=(*_notes_of(stored), note))

    @property
    def coefficients(self) -> Array:
        """The samples, padded by two on every side as those of splines are, (nv + 4, nu + 4)."""
        return np.pad(self.samples, 2, mode=_PAD[self.border])  # type: ignore[call-overload]

    @classmethod
    def _read(
        cls, path: Path, array: str | None, low: float | None, high: float | None
    ) -> tuple[Array, Stored]:
        """Return the values in a file, and what else it holds."""
        # Here, so that an edit of a reader leaves the machine code of kernels valid.
        from asperity.texture.files.arrays import ARRAY_SUFFIXES
        from asperity.texture.files.images import IMAGE_SUFFIXES
        from asperity.texture.files.loading import PACKED, TEXT_SUFFIXES, load_stored

        suffix = suffix_of(path, PACKED)
        if suffix not in (*IMAGE_SUFFIXES, *ARRAY_SUFFIXES):
            valid = ", ".join((*IMAGE_SUFFIXES, *ARRAY_SUFFIXES))
            raise SurfaceError(f"unknown kind of file {suffix!r} for {cls.what}; valid: {valid}")
        stored = load_stored(path, array)
        values = stored.values
        is_image, levels = suffix in IMAGE_SUFFIXES, values.dtype.kind in "uib"
        if stored.unit or (is_image and stored.scale is not None):
            raise SurfaceError(f"it holds heights ({stored.unit or 'm'}); valid: {cls.values}")
        if suffix in TEXT_SUFFIXES and stored.pixel_size is not None:
            raise SurfaceError(f"it holds points; valid: a matrix of {cls.values}")
        if not (is_image and levels):
            if is_image and stored.step:
                raise SurfaceError(
                    "its colours or missing pixels leave no plain greys; valid: grey pixels of 8 "
                    "or 16 bits, all of them there"
                )
            if low is not None or high is not None:
                raise SurfaceError(
                    f"low and high are for images of 8 or 16 bits; it holds {cls.values}"
                )
            return values, stored
        if low is None or high is None:
            given = {"low": low, "high": high}.items()
            missing = " and ".join(name for name, value in given if value is None)
            raise SurfaceError(
                f"an image needs low and high, the {cls.what} of black and of white; missing: "
                f"{missing}"
            )
        for name, value in (("low", low), ("high", high)):
            require_between(name, value, *cls.limits)
        if low > high:
            raise SurfaceError(f"low must not be above high, got {low:g} and {high:g}")
        white = 1 if values.dtype.kind == "b" else np.iinfo(values.dtype).max
        if white not in (1, 255, 65535):
            raise SurfaceError(f"its pixels are {values.dtype}; valid: 8 or 16 bits, or floats")
        return low + (high - low) * (values / (stored.white or white)), stored


def _notes_of(stored: Stored) -> tuple[str, ...]:
    """Return the notes on a file that are true of properties as they are of heights."""
    from asperity.texture.files.arrays import GREY_LEVELS
    from asperity.texture.files.stored import NO_UNIT

    return tuple(note for note in stored.notes if note not in (NO_UNIT, GREY_LEVELS))
