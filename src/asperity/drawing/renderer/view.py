"""What is looked at, and what is drawn of it: sheets and patches of points, no finer than seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.raster import Projection
from asperity.texture.height_field import HeightField

Array = NDArray[np.float64]


class Sheet(NamedTuple):
    """Points (a, b, 3) [m] with unit normals (a, b, 3), in world axes.

    Without `corners` they are a grid. With `corners` (n, 3) each row of points is a patch of n
    triangles, whose corners are these points.
    """

    points: Array
    normals: Array
    corners: NDArray[np.int64] | None = None
    height: Array | None = None
    """Of the texture at the points [m]; None: there is none."""
    face: NDArray[np.int64] | None = None
    weights: Array | None = None
    """Of a mesh: which triangle each row of points lies on, (n,), and the weights of its corners at
    them, (n, k, 3)."""


@dataclass(frozen=True, eq=False)
class Camera:
    """An eye at infinity.

    Parameters
    ----------
    centre : (3,) array
        What is in the middle of the image [m].
    right, up, towards : (3,) arrays
        Unit vectors of the image, and towards the eye; a right-handed frame.
    width : float
        Of the image [m].
    columns, rows : int
        Of the image [pixels].
    """

    centre: Array
    right: Array
    up: Array
    towards: Array
    width: float
    columns: int
    rows: int

    @property
    def pixel(self) -> float:
        """Size of a pixel [m]."""
        return self.width / self.columns

    @property
    def projection(self) -> Projection:
        """The camera as kernels need it."""
        frame = np.array([self.centre, self.right, self.up, self.towards])
        return Projection(frame, self.pixel, self.columns, self.rows)

    def turned(self, rotation: Array, position: Array) -> Camera:
        """Return the camera in the frame that has this pose: columns of `rotation` its axes."""
        return Camera(
            (self.centre - position) @ rotation, self.right @ rotation, self.up @ rotation,
            self.towards @ rotation, self.width, self.columns, self.rows,
        )  # fmt: skip

    def sees(self, points: Array) -> NDArray[np.bool_]:
        """Return which triangles (n, 3, 3) may reach into the image, whatever stands before."""
        away = points - self.centre
        seen = np.ones(len(points), bool)
        for axis, size in ((self.right, self.width), (self.up, self.rows * self.pixel)):
            # A little more: the texture moves them.
            across, half = away @ axis, 0.53 * size
            seen &= (across.min(axis=1) <= half) & (across.max(axis=1) >= -half)
        return seen

    def place(self, point: Array) -> tuple[float, float]:
        """Return column and row (from the top) of a point (3,)."""
        away = point - self.centre
        column = away @ self.right / self.pixel + 0.5 * (self.columns - 1)
        row = 0.5 * (self.rows - 1) - away @ self.up / self.pixel
        return float(column), float(row)


class ViewBall(NamedTuple):
    """What is looked at: a ball."""

    centre: Array
    radius: float
    """[m]."""
    samples: int
    """Points of a sheet across the ball."""
    camera: Camera | None = None
    """If what lies before and behind the ball is seen, too."""

    @property
    def spacing(self) -> float:
        """From point to point of a sheet [m]."""
        return 2.0 * self.radius / self.samples


def coarsened(field: HeightField, spacing: float) -> HeightField:
    """Return a field averaged over blocks of about `spacing` [m], or as it is if that is finer.

    Relief finer than a pixel would be seen as patterns that are not there.
    """
    sizes = field.pixel_size[::-1]
    blocks = [
        _block(n, spacing / size, field.border)
        for n, size in zip(field.samples.shape, sizes, strict=True)
    ]
    if blocks == [1, 1]:
        return field
    rows, columns = (n // b for n, b in zip(field.samples.shape, blocks, strict=True))
    samples = field.samples[: rows * blocks[0], : columns * blocks[1]]
    samples = samples.reshape(rows, blocks[0], columns, blocks[1]).mean(axis=(1, 3))
    return HeightField(samples, (blocks[1] * sizes[1], blocks[0] * sizes[0]), field.border)


def _block(samples: int, wanted: float, border: str) -> int:
    """Return how many samples to average: a divisor of all, so that a map still repeats."""
    largest = min(int(wanted), samples // 4)
    if border == "clamp":
        return max(largest, 1)
    return max((b for b in range(1, largest + 1) if samples % b == 0), default=1)
