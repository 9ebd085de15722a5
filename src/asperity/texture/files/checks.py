"""Valid samples, pixel sizes and positions of a height field, and refusal of others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.errors import AsperityError, SurfaceError

MAX_SAMPLES = 2**27
"""Largest map [samples]: 8192 x 16384, 1 GiB as heights."""
MAX_SLOPE = 100.0
"""Largest slope (89.4 degrees); steeper maps have a scale in the wrong unit."""
MAX_HEIGHT = 10.0
"""Largest absolute height [m]: of a texture, not of a landscape."""
MAX_PLACE = 1e6
"""Largest coordinate that is evaluated [m]."""
_AT_ONCE = 2**20
"""Samples whose steps are looked at together."""
PIXEL_SIZES = (1e-9, 1.0)
"""Smallest and largest pixel size [m]."""


def checked_pixel_size(pixel_size: float | Sequence[float]) -> tuple[float, float]:
    """Return a pixel size [m] as a pair (pu, pv), or raise `SurfaceError`."""
    try:
        given = np.asarray(pixel_size)
        pu, pv = np.broadcast_to(given if given.dtype.kind in "iuf" else np.nan, 2)
    except (TypeError, ValueError):
        pu = pv = np.float64(np.nan)
    low, high = PIXEL_SIZES
    if not (low <= pu <= high and low <= pv <= high):
        raise SurfaceError(
            f"pixel_size must be one number or two, {low:g} to {high:g} [m], got {pixel_size!r}"
        )
    return float(pu), float(pv)


def checked_grid(samples: ArrayLike) -> Array:
    """Return a copy of `samples` (nv, nu) if they are finite numbers, or raise `SurfaceError`."""
    try:
        given = np.asarray(samples)
        if given.dtype.kind not in "iuf":
            raise TypeError(f"{given.dtype} values")
        values = np.array(given, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise SurfaceError(f"samples must be an array of real numbers, got {error}") from None
    if values.ndim != 2 or min(values.shape) < 4 or values.size > MAX_SAMPLES:
        raise SurfaceError(
            "samples must be of shape (nv, nu), 4 or more along each axis and "
            f"{MAX_SAMPLES} at most in all, got {values.shape}"
        )
    if not (np.isfinite(values.min()) and np.isfinite(values.max())):
        bad = int(np.count_nonzero(~np.isfinite(values)))
        raise SurfaceError(f"{bad} of {values.size} samples are NaN or infinite; fill them first")
    return values


def checked_samples(samples: ArrayLike) -> Array:
    """Return a copy of `samples` if they are valid heights, or raise `SurfaceError`."""
    heights = checked_grid(samples)
    farthest = max(-float(heights.min()), float(heights.max()))
    if farthest > MAX_HEIGHT:
        raise SurfaceError(f"samples must lie within {MAX_HEIGHT:g} m of 0, got {farthest:g} m")
    return heights


def checked_heights(heights: ArrayLike, dimensions: tuple[int, ...] = (1, 2)) -> Array:
    """Return `heights` as a float array, or raise `SurfaceError` naming the invalid value."""
    try:
        array = np.asarray(heights, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SurfaceError(f"heights must be an array of numbers: {error}") from None
    if array.ndim not in dimensions:
        wanted = " or ".join(f"{d}-D" for d in dimensions)
        raise SurfaceError(f"heights must be {wanted}, got shape {array.shape}")
    if min(array.shape) < 2:
        raise SurfaceError(f"heights need 2 samples or more along each axis, got {array.shape}")
    bad = int(np.count_nonzero(~np.isfinite(array)))
    if bad:
        raise SurfaceError(f"heights hold {bad} NaN or infinite values of {array.size}; fill them")
    return array


def check_steepness(heights: Array, pixel_size: tuple[float, float], border: str) -> None:
    """Raise `SurfaceError` where neighbouring samples are too steep, the seam included."""
    for axis, (name, pixel) in enumerate(zip("vu", pixel_size[::-1], strict=True)):
        steepest = max(_largest_step(part, axis) for part in _parts(heights))
        if border == "wrap":
            seam = np.take(heights, 0, axis) - np.take(heights, -1, axis)
            steepest = max(steepest, float(np.abs(seam).max()))
        if steepest > MAX_SLOPE * pixel:
            raise SurfaceError(
                f"too steep: a slope of {steepest / pixel:.3g} along {name}; valid: at most "
                f"{MAX_SLOPE:g}. Are heights and pixel size both in metres?"
            )


def _parts(heights: Array) -> Iterator[Array]:
    """Yield rows of a map in parts that share their first and last row, to save memory."""
    rows = max(2, _AT_ONCE // heights.shape[1])
    for first in range(0, heights.shape[0] - 1, rows - 1):
        yield heights[first : first + rows]


def _largest_step(part: Array, axis: int) -> float:
    steps = np.diff(part, axis=axis)
    return max(-float(steps.min()), float(steps.max()))


def checked_places(name: str, places: ArrayLike) -> Array:
    """Return positions [m] as an array if they are finite and not too far, or raise."""
    values = np.asarray(places, dtype=np.float64)
    if not np.all(np.abs(values) <= MAX_PLACE):  # NaN compares false
        raise AsperityError(f"{name} must be finite and within {MAX_PLACE:g} m of 0")
    return values
