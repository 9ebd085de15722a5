"""A map of the taxels of a skin as an image, with a bar of its colours that keeps its scale."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

_STEPS = (1.0, 2.0, 5.0, 10.0)
"""A scale ends at one of these, times a power of ten."""
_LOW = 0.3
"""Part of a scale below which the largest value is too little for it."""
_WAIT = 20
"""Maps in a row that are too little for their scale before it shrinks."""
_LEAST_WIDTH = 256
_BAR, _TEXT, _GAP = 12, 18, 6
"""Heights of the bar, of the text below it, and of the gap above it [pixels]."""
_SIZE = 14.0
"""Of the text [pixels]."""
_SEEN = 360
"""Width of the page's panel, to which a wider map is shrunk, with its text [pixels]."""
_ARROWS = 16
"""Most arrows along a side of the map."""
_SHORTEST = 0.1
"""Shear of the smallest arrow, over the largest."""


class SteadyScale:
    """The end of a scale of colours [Pa]: round, and changed rarely.

    It grows at once where the values exceed it, and shrinks when they have been far below it for
    `_WAIT` maps.
    """

    def __init__(self) -> None:
        self.end = 0.0
        self._idle = 0
        self._seen = 0.0

    def update(self, largest: float) -> float:
        """Take the largest value of a map [Pa], and return the end."""
        if largest > self.end:
            self._grow(largest)
        elif 0.0 < largest < _LOW * self.end:
            self._idle += 1
            self._seen = max(self._seen, largest)
            if self._idle >= _WAIT:
                self._grow(self._seen)
        elif largest > 0.0:  # without contact all stays as it is
            self._idle, self._seen = 0, 0.0
        return max(self.end, 1.0)

    def _grow(self, largest: float) -> None:
        power = 10.0 ** math.floor(math.log10(largest))
        self.end = next(step * power for step in _STEPS if step * power >= largest * (1.0 - 1e-9))
        self._idle, self._seen = 0, 0.0


def taxel_map(
    values: NDArray[np.float64], end: float, *, signed: bool = False,
    arrows: NDArray[np.float64] | None = None,
) -> NDArray[np.uint8]:  # fmt: skip
    """Return an image of values (rows, columns) [Pa], with a bar of colours below it.

    Parameters
    ----------
    values : (rows, columns) array
        [Pa]; rows go upwards.
    end : float
        Value of the last colour, and what is more has it too [Pa]; that of the first is 0, or of
        signed values `-end`.
    signed : bool
    arrows : (rows, columns, 2) array, optional
        To be drawn over it [Pa]: to the right, and upwards. Each is the mean of a square.
    """
    # Not before there is a map: Matplotlib takes as long to load as the rest of the page.
    from asperity.runs.pressure_figure import taxel_image

    chart = taxel_image(values, end, signed=signed)
    enlarged = max(-(-_LEAST_WIDTH // chart.shape[1]), 1)
    chart = chart.repeat(enlarged, axis=0).repeat(enlarged, axis=1)
    width = chart.shape[1]
    ramp = np.linspace(-end if signed else 0.0, end, width // 4)[None, :]
    bar = taxel_image(ramp, end, signed=signed)
    bar = np.pad(bar, ((0, 0), (0, width - bar.shape[1]), (0, 0)), mode="edge")
    shrunk = max(width / _SEEN, 1.0)
    bar = bar[:1].repeat(round(_BAR * shrunk), axis=0)
    white = [np.full((round(h * shrunk), width, 3), 255, np.uint8) for h in (_GAP, _TEXT)]
    image = Image.fromarray(np.concatenate([chart, white[0], bar, white[1]]))
    pen = ImageDraw.Draw(image)
    _label(pen, image.size, end, signed, shrunk)
    if arrows is not None:
        _draw_arrows(pen, arrows, chart.shape[0] / values.shape[0])
    return np.asarray(image)


def _label(
    pen: ImageDraw.ImageDraw, size: tuple[int, int], end: float, signed: bool, shrunk: float
) -> None:  # fmt: skip
    """Write both ends of the scale and its middle below the bar [kPa]."""
    font = ImageFont.load_default(size=_SIZE * shrunk)
    first = -end if signed else 0.0
    for part, anchor in ((0.0, "ls"), (0.5, "ms"), (1.0, "rs")):
        text = f"{1e-3 * (first + part * (end - first)):g}{'+ kPa' if part == 1.0 else ''}"
        at = part * (size[0] - 1), size[1] - 4 * shrunk
        pen.text(at, text, fill=(40, 40, 40), font=font, anchor=anchor)


def _draw_arrows(pen: ImageDraw.ImageDraw, shear: NDArray[np.float64], taxel: float) -> None:
    """Draw the means of squares of taxels, which are `taxel` pixels large, as arrows."""
    rows, columns = shear.shape[:2]
    side = max(-(-max(rows, columns) // _ARROWS), 1)
    means = {
        (row, column): shear[row : row + side, column : column + side].mean(axis=(0, 1))
        for row in range(0, rows, side)
        for column in range(0, columns, side)
    }
    largest = max(math.hypot(*mean) for mean in means.values())
    for (row, column), mean in means.items():
        size = math.hypot(*mean)
        if size <= _SHORTEST * largest:
            continue
        middle = np.array([column + 0.5 * side, rows - row - 0.5 * side]) * taxel
        along = np.array([mean[0], -mean[1]]) / size
        half = along * side * taxel * (0.3 + 0.6 * size / largest)
        across = np.array([-along[1], along[0]]) * 3.0
        tip, neck = middle + half, middle + half - along * 6.0
        pen.line([*(middle - half), *neck], fill=(255, 255, 255), width=1)
        pen.polygon([tuple(tip), tuple(neck + across), tuple(neck - across)], fill=(255, 255, 255))
