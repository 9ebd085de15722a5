"""Shaded orthographic images of sheets.

The light is a lamp at the upper left with shadows (the sheets are drawn once more as seen from the
lamp), ambient light that is weaker in hollows, and a dull gloss.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.raster import Buffers, draw_triangles, light_pixels, project
from asperity.geometry.displaced.sheet import Sheet
from asperity.geometry.displaced.view import Camera

Array = NDArray[np.float64]
_LIGHT = np.array([-0.62, 0.3, 0.55])
"""Direction towards the light: to the right, towards the eye, upwards."""

_STEEPEST = 4.0
"""Steepest descent away from the eye within one body."""
_SLACK = 0.3
"""Distance by which patches are extended beyond their sides [pixels]."""


def camera_at(
    centre: Array, vertical: Array, along: Array, *, azimuth: float, elevation: float,
    width: float, columns: int, rows: int,
) -> Camera:  # fmt: skip
    """Return a camera that shows `vertical` upright and `along` towards the right.

    Parameters
    ----------
    centre, vertical, along : (3,) arrays
        `along` is perpendicular to `vertical`, both of unit length.
    azimuth, elevation : float
        Rotation of the eye around the vertical, and its elevation over the horizon [rad].
    width, columns, rows
        As for `Camera`.
    """
    aside = np.cross(vertical, along)
    right = np.cos(azimuth) * along + np.sin(azimuth) * aside
    level = np.cross(right, vertical)  # horizontal, towards the eye
    towards = np.cos(elevation) * level + np.sin(elevation) * vertical
    up = np.cos(elevation) * vertical - np.sin(elevation) * level
    return Camera(np.asarray(centre), right, up, towards, width, columns, rows)


def look(sheets: Sequence[tuple[int, Sheet]], camera: Camera) -> Buffers:
    """Return the camera's view of numbered sheets."""
    shape = (camera.rows, camera.columns)
    out = Buffers(np.full(shape, np.inf), np.zeros((*shape, 3)), np.full(shape, -1))
    for number, sheet in sheets:
        places = np.empty(sheet.points.shape)
        project(sheet.points, camera.projection, places)
        slack = 0.0 if sheet.corners is None else _SLACK
        draw_triangles(
            places.reshape(-1, 3), sheet.normals.reshape(-1, 3), sheet.triangles(), slack, number,
            out,
        )  # fmt: skip
    return out


@dataclass(frozen=True, eq=False)
class Lamp:
    """A directional lamp, and the distances of the surfaces that it illuminates."""

    camera: Camera
    reach: Array

    @classmethod
    def over(
        cls, sheets: Sequence[tuple[int, Sheet]], camera: Camera, vertical: Array, fine: int
    ) -> Lamp:
        """Return a lamp at the upper left of the camera's view, with `fine` pixels a side."""
        level = np.cross(camera.right, vertical)
        light = _LIGHT[0] * camera.right + _LIGHT[1] * level + _LIGHT[2] * vertical
        light /= np.linalg.norm(light)
        right = np.cross(camera.up, light)
        right /= np.linalg.norm(right)
        width = 1.7 * max(camera.width, camera.rows * camera.pixel)
        eye = Camera(camera.centre, right, np.cross(light, right), light, width, fine, fine)
        return cls(eye, look(sheets, eye).depth)


def hollows(seen: Buffers, camera: Camera) -> Array:
    """Return the share of ambient light that reaches each pixel, about 0.35 to 1.

    It is estimated in the image: a point farther away than the mean of two points on opposite sides
    is in a hollow. A point much nearer or farther than its neighbours belongs to another body.
    """
    from scipy.ndimage import gaussian_filter, shift, zoom

    coarse = 4
    far = seen.depth[::coarse, ::coarse]
    far = np.where(np.isfinite(far), far, np.nan)
    out = np.ones(far.shape)
    for size in (0.006, 0.02):
        spread = size * camera.columns / coarse
        lower = np.zeros(far.shape)
        for radius, turn in itertools.product((0.8, 1.4, 2.0), range(4)):
            angle = 0.25 * np.pi * turn
            rows, columns = (round(radius * spread * f(angle)) for f in (np.sin, np.cos))
            steepest = _STEEPEST * radius * size * camera.width
            one, two = (
                far - shift(far, (k * rows, k * columns), order=0, cval=np.nan) for k in (1, -1)
            )
            near = (np.abs(one) < steepest) & (np.abs(two) < steepest)
            lower += np.where(near, 0.5 * (one + two), 0.0) / (12.0 * size * camera.width)
        out -= 0.35 * np.clip(gaussian_filter(lower, 0.3 * spread), 0.0, 1.0)
    rows, columns = seen.depth.shape
    fine = zoom(np.clip(out, 0.35, 1.0), coarse, order=1)[:rows, :columns]
    return np.ascontiguousarray(fine)


def shade(
    seen: Buffers,
    camera: Camera,
    lamp: Lamp,
    colours: Sequence[Sequence[float]],
    open_to: Array | None = None,
) -> Array:
    """Return the image (rows, columns, 4): red, green, blue and opacity, 0 to 1.

    `open_to` are the `hollows`, if already computed; `colours` are those of the numbered sheets.
    """
    if open_to is None:
        open_to = hollows(seen, camera)
    lights = np.zeros((*seen.depth.shape, 3))
    light_pixels(seen, open_to, camera.projection, lamp.camera.projection, lamp.reach, lights)
    colour = np.asarray(colours)[np.maximum(seen.number, 0)]
    image = colour * (lights[..., 0] + lights[..., 1])[..., None] + lights[..., 2:]
    return np.dstack([np.clip(image, 0.0, 1.0), np.isfinite(seen.depth).astype(np.float64)])


def halved(image: Array) -> Array:
    """Return an image of half the size, each pixel the mean of four, weighted by opacity."""
    rows, columns = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
    parts = image[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2, 4)
    opacity = parts[..., 3:].mean(axis=(1, 3))
    colour = (parts[..., :3] * parts[..., 3:]).mean(axis=(1, 3)) / np.maximum(opacity, 1e-9)
    return np.dstack([colour, opacity])
