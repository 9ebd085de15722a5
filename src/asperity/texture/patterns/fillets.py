"""Building blocks of the patterns: tiles that repeat without a seam, and rounded outlines.

A wave at an angle repeats over a tile only if whole numbers of it fit along both sides. These
numbers are chosen first, near the given direction, and the sides of the tile follow: so wavelength
and direction are both exact, and the pixels only nearly square.

An interpolating cubic spline overshoots a step by 11 % of its height. So steps become ramps, and
every corner is rounded over a length of `fillet`, at least two pixels: `rounded` for outlines
(exactly, by a moving average in closed form), `smoothed` for maps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, SurfaceError, require_positive
from asperity.texture.files.checks import MAX_SAMPLES

FEWEST = 8
"""Fewest samples per wavelength or pitch: with 8, the slope of a cubic spline errs by 0.3 %."""


class Wave(NamedTuple):
    """A plane wave sampled over a tile that contains whole numbers of it."""

    phase: Array
    """Periods since u = v = 0, (nv, nu)."""
    pixel_size: tuple[float, float]
    notes: tuple[str, ...]


def plane_wave(pitch: float, direction: float, periods: int, samples: int) -> Wave:
    """Return a wave of exactly `pitch` [m] along `direction` [rad from u].

    The tile is about `periods` pitches wide and high. Directions closer to an axis than half a
    pitch over the tile are rotated to that axis, with a note.
    """
    pitch = require_positive("pitch", pitch, "[m]")
    require_whole("periods", periods, 1)
    require_whole("samples", samples, FEWEST)
    require_angle("direction", direction)
    cosine, sine = math.cos(direction), math.sin(direction)
    across, along = round(periods * cosine), round(periods * sine)
    side_u = pitch * across / cosine if across else pitch * periods
    side_v = pitch * along / sine if along else pitch * periods
    notes: tuple[str, ...] = ()
    if across == 0 or along == 0:
        side_u, side_v = pitch * periods, pitch * periods
        if min(abs(cosine), abs(sine)) > 1e-9:
            degrees = f"{math.degrees(direction):.4g} degrees"
            notes = (f"direction {degrees} is turned to the nearest axis; more periods allow it",)
        across, along = (periods * int(np.sign(n)) for n in (across, along))
    (u, v), pixel_size = tile((side_u, side_v), pitch / samples)
    return Wave(across * (u / side_u) + along * (v / side_v), pixel_size, notes)


def tile(
    size: tuple[float, float], pixel: float
) -> tuple[tuple[Array, Array], tuple[float, float]]:
    """Return positions u (1, nu) and v (nv, 1) [m] of a tile of `size` [m], and its pixel sizes."""
    counts = [side / pixel for side in size]
    if not all(count >= 3.5 for count in counts) or math.prod(counts) > MAX_SAMPLES:
        raise SurfaceError(
            f"a tile of {size[0]:.4g} x {size[1]:.4g} m with samples {pixel:.4g} m apart; valid: "
            f"4 samples or more along each side, {MAX_SAMPLES} at most in all"
        )
    columns, rows = (round(count) for count in counts)
    pixel_size = size[0] / columns, size[1] / rows
    places: list[Array] = [
        (np.arange(n, dtype=np.float64) + 0.5) * p
        for n, p in zip((columns, rows), pixel_size, strict=True)
    ]
    return (places[0][None, :], places[1][:, None]), pixel_size


def rounded(phase: Array, corners: Sequence[tuple[float, float]], fillet: float) -> Array:
    """Return a periodic polyline whose corners are rounded by parabolas.

    The moving average of a polyline over `fillet` is the polyline itself away from its corners,
    and at a corner a parabola of that length which is tangent to both sides.

    Parameters
    ----------
    phase : array
        Places in periods.
    corners : sequence of (place, height)
        Places in periods, rising, within one period; the line closes from the last to the first.
    fillet : float
        Length of the parabolas in periods, above 0.
    """
    x = np.array([place for place, _ in corners] + [corners[0][0] + 1.0])
    y = np.array([height for _, height in corners] + [corners[0][1]])
    slopes = np.diff(y) / np.diff(x)
    areas = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))])

    def integral(places: Array) -> Array:
        turns = np.floor(places)
        inside = places - turns + x[0]
        side = np.clip(np.searchsorted(x, inside, "right") - 1, 0, slopes.size - 1)
        d = inside - x[side]
        return turns * areas[-1] + areas[side] + (y[side] + 0.5 * slopes[side] * d) * d

    middle = phase - np.floor(phase) - x[0]
    return (integral(middle + 0.5 * fillet) - integral(middle - 0.5 * fillet)) / fillet


def smoothed(sharp: Array, pixel_size: tuple[float, float], fillet: float) -> Array:
    """Return a periodic map whose creases are rounded over about `fillet` [m].

    By a Gaussian weight with the standard deviation of a moving average over `fillet`.
    """
    from scipy import ndimage  # slow to import, and many textures have no fillets

    widths = [fillet / math.sqrt(12.0) / pixel for pixel in pixel_size[::-1]]
    return ndimage.gaussian_filter(sharp, widths, mode="wrap", truncate=6.0)


def checked_fillet(fillet: float | None, pitch: float, samples: int) -> float:
    """Return `fillet` [m], by default a sixteenth of the pitch.

    At least two samples, to prevent overshoot, and at most half the pitch.
    """
    least = 2.0 * pitch / samples
    if fillet is None:
        return max(pitch / 16.0, least)
    require_positive("fillet", fillet, "[m]")
    if not least * (1.0 - 1e-9) <= fillet <= 0.5 * pitch:
        raise AsperityError(
            f"fillet must lie between 2 samples ({least:.4g} m), else the spline overshoots, and "
            f"half the pitch ({0.5 * pitch:.4g} m), got {fillet!r}"
        )
    return float(fillet)


def require_fits(name: str, value: float, whole: float, least: float) -> float:
    """Return `value` [m] if it and the rest of `whole` are `least` [m] or more, else raise."""
    require_positive(name, value, "[m]")
    slack = 1e-9 * abs(whole)
    if not least - slack <= value <= whole - least + slack:
        raise AsperityError(
            f"{name} must lie between {least:.4g} and {whole - least:.4g} m, or fillets overlap; "
            f"got {value!r}"
        )
    return float(value)


def require_whole(name: str, value: Any, least: int) -> int:
    """Return `value` if it is a whole number of at least `least`, else raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise AsperityError(f"{name} must be a whole number, {least} or above, got {value!r}")
    return int(value)


def require_angle(name: str, value: float) -> float:
    """Return `value` [rad] if it is finite, else raise."""
    if not isinstance(value, (int, float, np.number)) or not math.isfinite(value):
        raise AsperityError(f"{name} must be a finite angle [rad], got {value!r}")
    return float(value)
