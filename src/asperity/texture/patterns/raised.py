"""Raised lines and symbols, as on a tactile map: drawn by their distance to strokes and points."""

from __future__ import annotations

import itertools
import math

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_not_negative, require_positive
from asperity.texture.height_field import HeightField

WIDTH, DEPTH = 0.06, 0.04
"""Sides of the drawing at a scale of 1 [m]."""
_STROKES: tuple[tuple[tuple[float, float], ...], ...] = (
    ((2, 9), (20, 9), (31, 15), (58, 15)),  # a street
    ((20, 38), (20, 9), (20, 2)),
    ((44, 2), (44, 15), (38, 28), (38, 38)),
    ((26, 21), (34, 21), (34, 29), (26, 29), (26, 21)),  # a building
    ((48, 22), (56, 22), (52, 29), (48, 22)),  # a symbol
)
"""Corners of lines [mm], from the lower left corner."""
_RINGS = ((10.0, 21.0, 4.0),)
"""Middle and radius of circles [mm]."""
_WORD, _WORD_AT = ("134", "1", "1234"), (5.0, 31.0)
"""Raised dots of three letters, m, a, p, numbered as in Braille, and where the first one stands."""
_DOT, _APART, _CELL = 1.44, 2.34, 6.2
"""Base of a dot, distance of dots, and of letters [mm]: usual values of Braille on paper."""


def tactile_map(
    *, height: float, scale: float = 1.0, line: float = 1.2e-3, pixel_size: float = 1e-4
) -> HeightField:
    """Return a tactile map: streets, a building, symbols and a word in Braille, all raised.

    Lines have the profile of a raised cosine, dots that of a dome. The drawing, 60 mm by 40 mm,
    is asperity's; its dots have the usual sizes of Braille, whatever the scale of the rest.

    Parameters
    ----------
    height : float
        Of lines and dots above the ground [m], 0 or above; about 0.5 mm on maps for the blind.
    scale : float
        By which the drawing is larger, 0.5 to 10.
    line : float
        Width of a line at half of its height [m], eight pixels or more.
    pixel_size : float
        Distance between samples [m].
    """
    require_not_negative("height", height, "[m]")
    require_positive("line", line, "[m]")
    require_positive("pixel_size", pixel_size, "[m]")
    if not 0.5 <= scale <= 10.0:
        raise AsperityError(f"scale must lie between 0.5 and 10, got {scale!r}")
    if line < 8.0 * pixel_size:
        raise AsperityError(
            f"line must be eight pixels or more, {8.0 * pixel_size:.3g} m, got {line:.3g}"
        )
    columns, rows = (round(scale * side / pixel_size) for side in (WIDTH, DEPTH))
    if columns * rows > 2**26:
        raise AsperityError(
            f"pixel_size {pixel_size:g} m makes {columns} x {rows} samples; valid: 2**26 in all"
        )
    u, v = (np.linspace(0.5, n - 0.5, n) * pixel_size for n in (columns, rows))
    away = np.full((rows, columns), np.inf)
    for stroke in _STROKES:
        corners = [(scale * 1e-3 * x, scale * 1e-3 * y) for x, y in stroke]
        for begin, end in itertools.pairwise(corners):
            np.minimum(away, _to_line(u, v, begin, end), out=away)
    for x, y, radius in _RINGS:
        middle = scale * 1e-3 * np.array([x, y, radius])
        ring = np.abs(np.hypot(u[None, :] - middle[0], v[:, None] - middle[1]) - middle[2])
        np.minimum(away, ring, out=away)
    out = np.cos(0.5 * np.pi * np.minimum(away / line, 1.0)) ** 2
    for number, letter in enumerate(_WORD):
        for dot in letter:
            column, row = divmod(int(dot) - 1, 3)
            x = scale * 1e-3 * _WORD_AT[0] + 1e-3 * (number * _CELL + column * _APART)
            y = scale * 1e-3 * _WORD_AT[1] + 1e-3 * (2 - row) * _APART
            far = np.hypot(u[None, :] - x, v[:, None] - y) / (1e-3 * _DOT)
            np.maximum(out, np.cos(np.pi * np.minimum(far, 0.5)) ** 2, out=out)
    return HeightField(height * out, pixel_size, "wrap")


def _to_line(u: Array, v: Array, begin: tuple[float, float], end: tuple[float, float]) -> Array:
    """Return the distance of each sample from a stretch of line [m], (rows, columns)."""
    along = (end[0] - begin[0], end[1] - begin[1])
    square = math.hypot(*along) ** 2
    x, y = u[None, :] - begin[0], v[:, None] - begin[1]
    share = np.clip((x * along[0] + y * along[1]) / square, 0.0, 1.0)
    return np.asarray(np.hypot(x - share * along[0], y - share * along[1]))
