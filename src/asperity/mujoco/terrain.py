"""Height fields of MuJoCo as textures: the terrain plus its texture."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from asperity.errors import AsperityError
from asperity.geometry.bodies import Surface
from asperity.texture.height_field import HeightField

_SAMPLES_A_WAVE = 8.0
_MOST_SAMPLES = 4096 * 4096
"""Maximum number of samples of a terrain with a texture."""


def terrain_surface(model: mujoco.MjModel, number: int, laid: Surface | None) -> Surface:
    """Return a MuJoCo height field as the surface of a plane at its lowest level.

    Parameters
    ----------
    model : mujoco.MjModel
    number : int
        Of the height field.
    laid : Surface, optional
        A texture to add to the terrain; its offset is from the middle.

    Raises
    ------
    AsperityError
        The terrain with the texture would have more than 4096^2 samples, or is too steep.
    """
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    start = int(model.hfield_adr[number])
    half_u, half_v, top, _ = model.hfield_size[number]
    data = model.hfield_data[start : start + rows * columns].reshape(rows, columns)
    # MuJoCo's outermost samples are on the borders, HeightField's half a pixel inside them.
    pixel = (2.0 * half_u / (columns - 1), 2.0 * half_v / (rows - 1))
    field = HeightField(top * data.astype(np.float64), pixel, "clamp")
    if laid is None:
        return Surface(field)
    texture = laid.texture
    if texture is not None and (texture.lowest or texture.highest):
        field = _with_texture(field, texture, (half_u, half_v), laid.offset)
    return Surface(field, friction=laid.friction, stiffness=laid.stiffness)


def _with_texture(
    terrain: HeightField, texture: HeightField, half: tuple[float, float], offset: object
) -> HeightField:
    """Return the sum of a terrain and a texture, at the resolution that the texture needs."""
    enough = texture.shortest_wavelength / _SAMPLES_A_WAVE
    finest = [
        min(a, max(b, enough)) for a, b in zip(terrain.pixel_size, texture.pixel_size, strict=True)
    ]
    counts = [math.ceil(2.0 * h / p) for h, p in zip(half, finest, strict=True)]
    if counts[0] * counts[1] > _MOST_SAMPLES:
        raise AsperityError(
            f"this texture of {finest[0] * 1e6:.4g} um samples on a height field of "
            f"{2e3 * half[0]:.4g} x {2e3 * half[1]:.4g} mm needs {counts[0]} x {counts[1]} "
            "samples; valid: 4096 x 4096 in all"
        )
    pixel = [2.0 * h / n for h, n in zip(half, counts, strict=True)]
    u, v = ((np.arange(n) + 0.5) * p - h for n, p, h in zip(counts, pixel, half, strict=True))
    shift = np.asarray(offset, dtype=np.float64)
    base = 0.5 * np.asarray(texture.size) if texture.border == "clamp" else np.zeros(2)
    middle = 0.5 * np.asarray(terrain.size)
    heights = terrain.heights(u + middle[0], (v + middle[1])[:, None])
    heights = heights + texture.heights(u - shift[0] + base[0], (v - shift[1] + base[1])[:, None])
    return HeightField(heights, (pixel[0], pixel[1]), "clamp")
