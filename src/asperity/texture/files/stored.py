"""Contents of a file of heights before a scale is chosen, and refusals that name the file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from numpy.typing import NDArray

from asperity.errors import SurfaceError
from asperity.texture.files.checks import MAX_SAMPLES

NO_UNIT = "no unit is stated: heights in m; unit= changes that"
NO_UNITS = "no unit is stated: x, y and heights in m; unit= changes that"
"""Notes on files that do not say what their numbers are."""


class Stored(NamedTuple):
    """Contents of a file: heights in some unit, or grey levels without a scale."""

    values: NDArray[Any]
    notes: tuple[str, ...] = ()
    """Conversions of the file's values."""
    pixel_size: tuple[float, float] | None = None
    """Along u and v [m]"""
    scale: float | None = 1.0
    """Metres in one unit of the values; None for grey levels."""
    unit: str = ""
    """As the file states it; empty where it states none."""
    step: float = 0.0
    """Difference between neighbouring grey levels; 0 for values that are not quantised."""
    sizes_follow: bool = False
    """Whether `pixel_size` is in the unit of the values too, which is not said."""
    printed_size: tuple[float, float] | None = None
    """Pixel size by the resolution of an image, which may be that of a print [m]."""
    white: float = 0.0
    """Largest value that pixels may have, if it is not the largest of their type."""


def check_size(path: Path, *shape: int) -> None:
    """Raise `SurfaceError` if a map of `shape` is larger than `MAX_SAMPLES`."""
    if math.prod(shape) > MAX_SAMPLES:
        size = " x ".join(str(n) for n in shape)
        raise SurfaceError(
            f"{path}: {size} samples are too many; valid: at most {MAX_SAMPLES} (8192 x 16384)"
        )


def refuse(path: Path, reason: str) -> NoReturn:
    """Raise `SurfaceError` with one line that names the file."""
    raise SurfaceError(f"{path}: {reason}") from None


def level_step(values: NDArray[Any]) -> float:
    """Return the difference between neighbouring grey levels of integer values.

    Values of 16 bits that are all multiples of 257 or of 256 are 8-bit values in a wider type.
    """
    if values.dtype.kind not in "ui":
        return 0.0
    if values.dtype.itemsize == 1:
        return 1.0
    few = values.ravel()[:: max(1, values.size // 4096)]
    steps = [s for s in (257, 256) if not (few % s).any()]
    return next((float(s) for s in steps if not (values % s).any()), 1.0)
