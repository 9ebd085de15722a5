"""Conversion of user-given textures of geoms to surfaces."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity.errors import AsperityError, require_choice
from asperity.geometry.bodies import MAPPINGS, Surface
from asperity.scene import shorthand
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import EXAMPLES, PATTERNS

_SHOWN = 60
"""Maximum length of a wrong value in a message."""
_VALID = (
    "a HeightField, a Surface, pattern(...), texture(...), a text such as 'knurl:0.8mm', "
    "or the path of a file"
)


def pattern(name: str, **parameters: Any) -> HeightField:
    """Return the texture of a pattern.

    Parameters
    ----------
    name : str
        Of a function of `asperity.texture.patterns.patterns`; also "ridges" (grating), "dots"
        (jittered_dots) and "waves" (sinusoid).
    parameters
        Those of the function [m, rad]. Others have the pattern's defaults, scaled with the first
        length: `pattern("ridges", pitch=0.5e-3)` has ridges of 80 um.

    Raises
    ------
    AsperityError
        A pattern or a parameter that does not exist, or a value out of range; one line.
    """
    known = shorthand.OTHER_NAMES.get(name, name)
    require_choice("pattern", known, [*PATTERNS, *shorthand.OTHER_NAMES])
    defaults = EXAMPLES[known]
    require_names(known, parameters)
    first = next(iter(defaults))
    ratio = float(parameters.get(first, defaults[first])) / defaults[first]
    filled = {
        key: value if key in shorthand.NO_LENGTHS else float(f"{value * ratio:.6g}")
        for key, value in defaults.items()
        if key not in parameters
    }
    return PATTERNS[known](**filled, **parameters)


def require_names(name: str, parameters: dict[str, Any]) -> None:
    """Refuse parameters that a pattern does not have."""
    known = shorthand.parameters_of(name)
    for key in parameters:
        require_choice(f"parameter of {name}", key, known)


def texture(
    source: Any,
    *,
    mapping: str | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
    friction: float | None = None,
    stiffness: float | None = None,
    **options: Any,
) -> Surface | PlacedTexture:
    """Return a texture with its mapping, friction and stiffness.

    Parameters
    ----------
    source : HeightField, array, str or path, or None
        An array (rows, columns) of heights [m] needs `pixel_size` [m] among the options; a file
        what `HeightField.from_file` needs. None: smooth, for another friction or stiffness.
    mapping : {"planar", "cylindrical", "triplanar", "uv"}, optional
        See `asperity.Body`; by default planar on planes, boxes and height fields, cylindrical on
        the sides of cylinders, triplanar on other geoms.
    offset : (2,)
        Of the map on the geom [m].
    friction : float, optional
        Coulomb's coefficient [-]; by default that of MuJoCo's pair of geoms.
    stiffness : float, optional
        Of contact with this surface [N/m]; by default that of `attach`.
    options
        Of `HeightField` for an array, of `HeightField.from_file` for a file.
    """
    field = None if source is None else height_field(source, options)
    placed = Surface(field, mapping or "planar", offset, friction, stiffness)
    return placed if mapping is not None else PlacedTexture(placed)


@dataclass(frozen=True)
class Layer:
    """The texture of a flex, and the elastic layer between its elements and its surface.

    Parameters
    ----------
    texture
        As for a geom, see `texture`, but without a stiffness. None: smooth.
    thickness : float, optional
        Of the layer [m]. By default the flex's radius; without one a quarter of its edges' median.
    modulus, poisson : float, optional
        Young's modulus [Pa] and Poisson's ratio [-] of the layer. By default those of the flex's
        elasticity (a sheet counts as two radii thick), the ratio at most 0.45; without elasticity
        1e5 Pa and 0.3.
    pitch : float, optional
        Distance between the taxels [m]. By default an eighth of the edges' median, or a quarter of
        the shortest wavelength in contact if this is less, but for at most 100,000 taxels.
    """

    texture: Any = None
    thickness: float | None = None
    modulus: float | None = None
    poisson: float | None = None
    pitch: float | None = None


class PlacedTexture:
    """A surface with the default mapping of its geom."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface


def height_field(source: Any, options: dict[str, Any] | None = None) -> HeightField:
    """Return the texture of a `source`; `options` are for arrays and files."""
    given = options or {}
    if isinstance(source, HeightField):
        if given:
            raise AsperityError(f"a HeightField takes no {', '.join(given)}; leave it out")
        return source
    if isinstance(source, str):
        found = shorthand.pattern(source)
        if found is not None:
            table, _ = found
            kind = table.pop("kind")
            return PATTERNS[kind](**table)
        known = shorthand.OTHER_NAMES.get(source, source)
        if known in PATTERNS:
            return pattern(known)
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if not path.exists():
            raise AsperityError(f"no texture {str(source)!r}: neither a file nor a pattern")
        return HeightField.from_file(path, **given)
    if isinstance(source, tuple) and len(source) == 2 and np.ndim(source[0]) == 2:
        return HeightField(source[0], source[1], **given)
    if isinstance(source, np.ndarray | list):
        if "pixel_size" not in given:
            raise AsperityError(
                "an array of heights needs a pixel_size: texture(heights, pixel_size=1e-5) [m]"
            )
        return HeightField(source, **given)
    shown = " ".join(repr(source).split())
    shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}..."
    raise AsperityError(f"no texture: {shown}; valid: {_VALID}")


def surface_of(value: Any, default_mapping: str) -> Surface:
    """Return the surface of a geom with this default mapping from a user's value."""
    if isinstance(value, PlacedTexture):
        old = value.surface
        return Surface(old.texture, default_mapping, old.offset, old.friction, old.stiffness)
    if isinstance(value, Surface):
        return value
    if isinstance(value, Layer):
        raise AsperityError("a Layer is for flexes; give a geom its texture alone")
    return Surface(height_field(value), default_mapping)


assert set(MAPPINGS) >= {"planar", "triplanar", "cylindrical"}
