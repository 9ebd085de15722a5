"""Materials of mesh files, and the pictures that they name.

What a texture renderer shows as bumps can be felt: *displacement* is a map of heights, *normal* one
of normals, *bump* heights without a scale. *colour* and *roughness* are only seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from asperity.errors import require_between

FELT = ("displacement", "normal", "bump")
"""Kinds of maps that can be felt, the first that is there is used."""
SEEN = ("colour", "roughness")


class MapImage(NamedTuple):
    """A picture that a material names.

    Attributes
    ----------
    path : Path or None
        Its file, which may be missing; None: it is within the mesh file.
    name : str
        As the file names it.
    data : bytes
        Its content, if it has no file.
    height_range : float or None
        Height of white above black [m]; displacement only. In the file's unit until a mesh has it.
    low : float
        Height of black, likewise.
    scale : float
        By which slopes of a normal map are multiplied.
    border : {"wrap", "clamp", "other"}
        What it does beyond its edges; *other*: it is mirrored, or its axes differ.
    """

    path: Path | None
    name: str
    data: bytes = b""
    height_range: float | None = None
    low: float = 0.0
    scale: float = 1.0
    border: str = "wrap"

    @property
    def is_there(self) -> bool:
        """Whether it can be read."""
        return bool(self.data) or (self.path is not None and self.path.is_file())


class Placing(NamedTuple):
    """How a material lays its pictures: at scale * uv + offset, v upwards."""

    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


_AS_IT_IS = Placing()


@dataclass(frozen=True)
class Material:
    """A named material.

    Attributes
    ----------
    name : str
    maps : mapping of str to MapImage
        By kind: those of `FELT` and `SEEN`.
    colour : tuple of float or None
        Red, green, blue, 0 to 1 (sRGB), by which a picture of colours is multiplied.
    placing : Placing
        Of OBJ; glTF's is applied when the file is read.
    friction, stiffness : float or None
        Of contact with its triangles, in place of the body's: Coulomb's coefficient [-], 0 to 100,
        and stiffness [N/m], 1e-6 to 1e9.
    """

    name: str
    maps: Mapping[str, MapImage] = field(default_factory=dict)
    colour: tuple[float, float, float] | None = None
    placing: Placing = _AS_IT_IS
    friction: float | None = None
    stiffness: float | None = None

    def __post_init__(self) -> None:
        if self.friction is not None:
            require_between("friction", self.friction, 0.0, 100.0)
        if self.stiffness is not None:
            require_between("stiffness", self.stiffness, 1e-6, 1e9, "N/m")

    @property
    def felt(self) -> str | None:
        """The kind of map that is felt, None without."""
        return next((kind for kind in FELT if kind in self.maps), None)
