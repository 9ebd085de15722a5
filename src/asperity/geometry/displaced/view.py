"""The region in view, the camera, and textures no finer than a picture resolves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Mask
from asperity.texture.height_field import HeightField


class Projection(NamedTuple):
    """An orthographic camera, as kernels need it."""

    frame: Array
    """Centre [m], and unit vectors to the right, up and towards the eye, in rows, (4, 3)."""
    pixel: float
    """Size of a pixel [m]."""
    columns: int
    rows: int


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic camera.

    Parameters
    ----------
    centre : (3,) array
        Point in the middle of the image [m].
    right, up, towards : (3,) arrays
        Unit vectors along the image and towards the eye; a right-handed frame.
    width : float
        Of the image [m].
    columns, rows : int
        Size of the image [pixels].
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

    def in_frame(self, rotation: Array, position: Array) -> Camera:
        """Return the camera as seen from the frame with these axes (columns) and this position."""
        return Camera(
            (self.centre - position) @ rotation, self.right @ rotation, self.up @ rotation,
            self.towards @ rotation, self.width, self.columns, self.rows,
        )  # fmt: skip

    def sees(self, points: Array) -> Mask:
        """Return which triangles (n, 3, 3) may reach into the image, occluded or not."""
        away = points - self.centre
        seen = np.ones(len(points), bool)
        for axis, size in ((self.right, self.width), (self.up, self.rows * self.pixel)):
            # Slightly more than half, since the texture displaces them.
            across, half = away @ axis, 0.53 * size
            seen &= (across.min(axis=1) <= half) & (across.max(axis=1) >= -half)
        return seen

    def place(self, point: Array) -> tuple[float, float]:
        """Return the column and the row (from the top) of a point (3,) [pixels]."""
        away = point - self.centre
        column = away @ self.right / self.pixel + 0.5 * (self.columns - 1)
        row = 0.5 * (self.rows - 1) - away @ self.up / self.pixel
        return float(column), float(row)


class ViewBall(NamedTuple):
    """A ball in which surfaces are sampled finely."""

    centre: Array
    """[m], (3,)."""
    radius: float
    """[m]."""
    samples: int
    """Points of a sheet across the ball."""
    camera: Camera | None = None
    """With a camera, surfaces before and behind the ball are in view too."""

    @property
    def spacing(self) -> float:
        """Distance between neighbouring points of a sheet [m]."""
        return 2.0 * self.radius / self.samples


def coarsened(field: HeightField, spacing: float) -> HeightField:
    """Return a field averaged over blocks of about `spacing` [m], if its pixels are smaller.

    Relief finer than the sampling would alias.
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
    """Return the number of samples to average; it divides those of a wrapped map."""
    largest = min(int(wanted), samples // 4)
    if border == "clamp":
        return max(largest, 1)
    return max((b for b in range(1, largest + 1) if samples % b == 0), default=1)
