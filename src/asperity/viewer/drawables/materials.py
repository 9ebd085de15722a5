"""What surfaces look like: steel, wood, ceramic, rubber, or an asset's own colour.

The material is guessed from the colour that the scene gives, or from the body's role where it gives
none. Hollows are drawn darker, as less light reaches them.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.parts import GROUND_COLOUR, TOOL_COLOUR
from asperity.viewer.drawables.colours import height_colours

Array = NDArray[np.float64]
Paint = Callable[[Array, Array], Array]
"""Colours (n, 3) of points (n, 3) [m] with heights (n,) [m]."""
_HOLLOW = 0.5
"""Brightness of the lowest point, over that of the highest."""
_RING = 4e-3
"""Distance between the rings of wood [m]."""


@dataclass(frozen=True)
class SurfaceLook:
    """A material.

    Parameters
    ----------
    name : str
        "steel", "wood", "ceramic", "rubber", "own colour".
    colour : tuple of 3 floats
        sRGB, 0 to 1.
    roughness, metallic : float
        0 to 1, as in glTF.
    """

    name: str
    colour: tuple[float, ...]
    roughness: float
    metallic: float

    def paint(self, low: float, high: float) -> Paint:
        """Return what colours a surface whose heights are between `low` and `high` [m]."""

        def paint(points: Array, height: Array) -> Array:
            out = np.tile(np.asarray(self.colour, dtype=np.float64)[:3], (len(points), 1))
            if self.name == "wood":
                out *= _grain(points)[:, None]
            if high > low:
                share = np.clip((np.nan_to_num(height, nan=high) - low) / (high - low), 0.0, 1.0)
                out *= (_HOLLOW + (1.0 - _HOLLOW) * share)[:, None]
            return np.clip(out, 0.0, 1.0)

        return paint


def material_of(colour: tuple[float, ...]) -> SurfaceLook:
    """Return the material of a part with a colour of `scene_parts`."""
    if colour[:3] == TOOL_COLOUR:
        return SurfaceLook("steel", (0.70, 0.72, 0.74), 0.34, 0.75)
    if colour[:3] == GROUND_COLOUR:
        return SurfaceLook("ceramic", (0.93, 0.90, 0.84), 0.38, 0.0)
    hue, light, strong = colorsys.rgb_to_hls(*colour[:3])
    if 0.04 < hue < 0.14 and strong > 0.25 and 0.2 < light < 0.85:
        return SurfaceLook("wood", colour[:3], 0.6, 0.0)
    if light < 0.25:
        return SurfaceLook("rubber", colour[:3], 0.9, 0.0)
    if strong < 0.06 and light < 0.8:
        return SurfaceLook("steel", colour[:3], 0.34, 0.75)
    return SurfaceLook("own colour", colour[:3], 0.55, 0.0)


def by_height(low: float, high: float, plain: tuple[float, ...]) -> Paint:
    """Return what colours a surface by height, of a range [m]; `plain` where there is none."""
    return lambda points, height: height_colours(height, low, high, plain)


def _grain(points: Array) -> Array:
    """Return the brightness (n,) of wood at points (n, 3) [m], whose fibres run along x."""
    x, y, z = points.T
    away = np.hypot(y + 1.3e-2 + 1.5e-3 * np.sin(40.0 * x), z + 2.6e-2 + 1e-3 * np.sin(63.0 * x))
    turns = away / _RING + 0.15 * np.sin(9e2 * y) + 0.1 * np.sin(7e2 * z + 90.0 * x)
    saw = turns - np.floor(turns)
    fine = 0.03 * np.sin(5e3 * y + 40.0 * np.sin(30.0 * x)) * np.sin(6e3 * z)
    return np.asarray(1.04 - 0.22 * saw**3 + fine)
