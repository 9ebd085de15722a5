"""Scales of height maps that are hardly right, and values that hardly are heights."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from asperity._core.arrays import Array

_LARGEST_PIXEL = 2e-3
_LARGEST_MAP = 2.0
_LARGEST_RELIEF = 0.1
_SMALLEST_RELIEF = 1e-10
_SMALLEST_PIXEL = 1e-10
"""Beyond these a texture that is touched is not plausible [m]; an atom has 1e-10 m."""
_OFTEN = (0.0, -1.0, -99.0, -999.0, -9999.0, 9999.0, -32767.0, -32768.0, 65535.0)
"""Numbers that stand for missing values."""
_ONCE = (-9999.0, -32767.0, -32768.0)
"""Those that hardly are a height, however seldom they occur."""
_FAR, _OFTEN_FAR = 10.0, 2.0
"""Distance from all others, in their range, from which a value is suspected."""
# Multiples of the golden ratio meet all columns, which even steps through the rows do not.
_PLACES = np.arange(4000) * (0.5 * (np.sqrt(5.0) - 1.0)) % 1.0
_FEW_PLACES = _PLACES[:40]
"""Places of a map, as parts of its length, that are looked at first."""
_DEPTH = re.compile(
    r"(?<![A-Za-z])(?:[Dd]epth|DEPTH|[Tt]iefe|[Pp]rofond\w+)(?![a-z])|(?<=[a-z])Depth(?![a-z])"
)
DOUBT = "is that plausible?"
"""How a note that doubts a scale begins."""
_STEEPEST = 30.0
"""Largest plausible rms slope between neighbouring samples, 88 degrees."""


def doubts(heights: Array, pixel_size: tuple[float, float], relief: float) -> list[str]:
    """Return notes that doubt a relief or a pixel size, none if both are plausible.

    Parameters
    ----------
    heights : (nv, nu) or (n,) array
        [m]
    pixel_size : (pu, pv)
        [m]
    relief : float
        From the lowest to the highest height [m].
    """
    sides = [n * p for n, p in zip(heights.shape[::-1], pixel_size, strict=False)]
    pixel = min(pixel_size) if min(pixel_size) < _SMALLEST_PIXEL else max(pixel_size)
    notes = []
    if pixel < _SMALLEST_PIXEL or pixel > _LARGEST_PIXEL or max(sides) > _LARGEST_MAP:
        notes.append(
            f"{DOUBT} A pixel size of {1e3 * pixel:.4g} mm, a map of {_size(sides)} mm: "
            "check the unit, or give pixel_size"
        )
    if relief == 0.0:
        return notes
    doubtful = not _SMALLEST_RELIEF <= relief <= min(max(sides), _LARGEST_RELIEF)
    if not doubtful and relief > _STEEPEST * pixel_size[0]:  # else no slope is so steep
        doubtful = _rms_slope(heights, pixel_size[0]) > _STEEPEST
    if doubtful:
        notes.append(
            f"{DOUBT} A relief of {1e3 * relief:.4g} mm on a map of {_size(sides)} mm: check "
            "the heights' unit, or give unit or height_range"
        )
    return notes


def depth_doubt(stem: str, notes: Sequence[str]) -> list[str]:
    """Return a note if a file's name, or what a note quotes of it, calls the heights depths."""
    quoted = (note for note in notes if "left out" not in note)
    found = next(filter(None, map(_DEPTH.search, (stem, *quoted))), None)
    if found is None:
        return []
    return [
        f"is it a {found.group().lower()}, downwards? It is read as heights, upwards; invert=True "
        "exchanges hills and valleys"
    ]


def _size(sides: list[float]) -> str:
    return " x ".join(f"{1e3 * side:.4g}" for side in sides)


def _rms_slope(heights: Array, pixel: float) -> float:
    """Return the rms slope between neighbours along u, of about 20,000 of them."""
    every = max(1, heights.size // 20_000) if heights.ndim == 2 else 1
    steps = np.diff(heights[::every], axis=-1)
    return float(np.sqrt(np.mean(steps**2))) / pixel


def sentinel_note(values: Array, low: float, high: float) -> str | None:
    """Return a doubt of a lowest or highest value that looks like one for missing ones.

    It occurs more than once, or is one of `_ONCE`, and lies further from all others than ten times
    their range; twice their range, if it is 0 or a number that programs often take.

    Parameters
    ----------
    values : array
    low, high : float
        Least and largest of them; NaN if some are missing.
    """
    line = values.ravel()
    for places in (_FEW_PLACES, _PLACES):
        some = line[(places * values.size).astype(np.int64)].tolist()
        inner = [value for value in some if low < value < high]
        if inner and (_OFTEN_FAR + 1.0) * (max(inner) - min(inner)) > high - low:
            return None  # most maps: their values fill their range
    finite = values if np.isfinite(low + high) else values[np.isfinite(values)]
    if finite.size < 16:
        return None
    low, high = float(finite.min()), float(finite.max())
    middle = 0.5 * (low + high)
    for extreme, side in ((low, finite > middle), (high, finite < middle)):
        count = int(np.count_nonzero(finite == extreme))
        others = finite[side]
        least_often = 1 if extreme in _ONCE else 2
        if not least_often <= count < finite.size or others.size != finite.size - count:
            continue
        least, most = float(others.min()), float(others.max())
        far = _OFTEN_FAR if extreme in _OFTEN else _FAR
        if min(abs(least - extreme), abs(most - extreme)) > far * (most - least) > 0.0:
            often = "once" if count == 1 else f"{count} times"
            return (
                f"is {extreme:g} a missing value? It occurs {often}, far from all others "
                f"({least:g} to {most:g}): nodata={extreme:g}"
            )
    return None
