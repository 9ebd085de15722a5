"""Colours of the page: heights, forces, and states from good to wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rgb = tuple[int, int, int]

FORCE: Rgb = (213, 94, 0)
TORQUE: Rgb = (148, 82, 170)
CONTACT: Rgb = (230, 30, 60)
HANDLE: Rgb = (0, 158, 115)
WELL, DOUBTFUL, WRONG, HELD = "#1b7f4d", "#b87700", "#c62828", "#3b4cc0"
"""Colours of numbers that are good, doubtful, wrong, and of what is not the present."""

_HEIGHTS = np.array(
    [
        (0.10, 0.20, 0.42), (0.12, 0.38, 0.58), (0.26, 0.57, 0.66), (0.58, 0.76, 0.71),
        (0.90, 0.88, 0.74), (0.96, 0.76, 0.46), (0.91, 0.55, 0.26),
    ]
)  # fmt: skip
"""From the lowest to the highest: dark blue, teal, sand, orange.

Lightness increases over most of the range, so that the scale can also be read in greyscale and by
colour-blind people.
"""


def height_colours(height: Array, low: float, high: float, plain: Sequence[float]) -> Array:
    """Return the sRGB colours (n, 3), 0 to 1, of heights (n,) [m] between `low` and `high`.

    NaN has the colour `plain`, and so have all heights if `low` equals `high`.
    """
    out = np.tile(np.asarray(plain, dtype=np.float64)[:3], (len(height), 1))
    known = np.isfinite(height)
    if high > low:
        share = np.clip((height[known] - low) / (high - low), 0.0, 1.0)
        places = np.linspace(0.0, 1.0, len(_HEIGHTS))
        out[known] = np.stack([np.interp(share, places, c) for c in _HEIGHTS.T], axis=-1)
    return out


def css_gradient() -> str:
    """Return the colours of heights as a CSS gradient from left to right."""
    stops = (f"rgb({','.join(str(round(255 * c)) for c in row)})" for row in _HEIGHTS)
    return f"linear-gradient(to right, {', '.join(stops)})"
