"""Units of a file of poses, stated or given, and its times: since an epoch, or since a start."""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array
from asperity._core.units import TIMES

EPOCH = 1e8
"""Times beyond it are since an epoch, in s, ms, us or ns by their size."""
_BY_SIZE = (
    (1e11, 1.0, ""), (1e14, 1e-3, "ms"), (1e17, 1e-6, "us"), (9e17, 1e-7, "100 ns (ticks)"),
    (np.inf, 1e-9, "ns"),
)  # fmt: skip
"""Units of times since an epoch: seconds since 1970 have 10 digits until 2286, the ticks of .NET
and Windows, since the years 1 and 1601, 18 digits, nanoseconds 19 since 2001."""
_FINER = ((1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
_FASTEST, _SLOWEST = 4e-4, 0.4
"""Times between poses that are taken for usual, by which of these units one is [s]."""
_NEVER = 100.0
_DATES = (9e8, 4.2e9)
"""Time between poses that is none, and seconds since 1970 of dates, 1998 to 2103."""


def unit_of(
    given: float | None, stated: float | None, what: str, option: str, units: dict[str, float],
    notes: list[str],
) -> float:  # fmt: skip
    """Return the unit of some columns, given or stated by their names, and note it."""
    if (given, stated) == (None, None):
        return 1.0
    names = {value: name for name, value in reversed(units.items())}
    if given is not None and stated is not None and given != stated:
        notes.append(f"{what} in {names[given]}, as given; the file states {names[stated]}")
    elif given is None and stated not in (None, 1.0):
        notes.append(f"{what} in {names[stated]}, as the file states")
    return given or stated or 1.0


def since_the_first(
    times: Array, start: float, stated: float | None, given: float | None, notes: list[str]
) -> Array:
    """Return times [s]; of times since an epoch, those since the first.

    Parameters
    ----------
    times : (n,) array
        As in the file, less `start`.
    start : float
    stated, given : float, optional
        Unit [s] by the file, and by an option.
    notes : list of str
        To which what is taken is appended.
    """
    first = start + (float(times[0]) if times.size and np.isfinite(times[0]) else 0.0)
    if given is None and abs(first) > EPOCH and (stated in (None, 1.0)):
        scale, word = next((s, w) for most, s, w in _BY_SIZE if abs(first) <= most)
        why, step = "size", float(np.median(np.diff(times))) if times.size > 1 else 0.0
        dated = _DATES[0] < abs(first) * scale < _DATES[1]
        if step * scale > (_NEVER if dated else _SLOWEST):  # since a start, as of OpenXR
            finer = ((s, w) for s, w in _FINER if _FASTEST < step * s <= _SLOWEST)
            scale, word = next(finer, (scale, word))
            why = "steps"
        notes += [f"times in {word}, by their {why}"] if word else []
    else:
        scale = unit_of(given, stated, "times", "time_unit", TIMES, notes)
    if abs(first) > EPOCH:
        notes.append("times are since an epoch; the first is 0")
        times = times - times[0]
    return times * scale
