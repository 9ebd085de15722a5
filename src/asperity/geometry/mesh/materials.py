"""Materials of mesh files, and the pictures that they name.

What a texture renderer shows as bumps can be felt: *displacement* is a map of heights, *normal* one
of normals, *bump* heights without a scale. *colour* and *roughness* are only seen.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from asperity._core.files import find_named, text_of
from asperity._core.text_table import is_number
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


_MTL = {
    "disp": "displacement", "map_disp": "displacement", "norm": "normal", "map_kn": "normal",
    "map_norm": "normal", "map_normal": "normal", "map_bump": "bump", "bump": "bump",
    "map_kd": "colour", "map_pr": "roughness",
}  # fmt: skip
"""Keywords of MTL files in lower case, and the kinds of maps that they name."""
_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1}
"""Options of maps that numbers follow, and how many at most."""
_WORDS = ("-blendu", "-blendv", "-cc", "-clamp", "-imfchan", "-type")
"""Options of maps that one word follows."""
_BEHIND = re.compile(rf"\s(?:(?:{'|'.join((*_NUMBERS, *_WORDS))})\s|#).*$", re.IGNORECASE)
"""Options, which some programs write behind the name, and comments."""


def read_mtl(path: Path, notes: list[str]) -> list[Material]:
    """Return the materials of an MTL file; notes say what of them cannot be used."""
    materials: list[Material] = []
    for line in text_of(path.read_bytes()).splitlines():
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        key = words[0].lower()
        if key == "newmtl":
            materials.append(Material(line.split(None, 1)[1].strip() if len(words) > 1 else ""))
        elif not materials:
            continue
        elif key in _MTL and len(words) > 1:
            materials[-1] = _with_map(materials[-1], _MTL[key], line.split(None, 1)[1], path)
        elif key == "kd" and len(words) == 4 and all(map(is_number, words[1:])):
            colour = tuple(min(max(float(word), 0.0), 1.0) for word in words[1:])
            materials[-1] = _changed(materials[-1], colour=colour)
    return materials


def _changed(material: Material, **values: object) -> Material:
    fields = {name: getattr(material, name) for name in ("name", "maps", "colour", "placing")}
    return Material(**(fields | values))


def _with_map(material: Material, kind: str, rest: str, library: Path) -> Material:
    """Return a material with the map that the rest of a line names, after its options."""
    words = rest.split()
    given: dict[str, list[float]] = {}
    at, clamped = 0, False
    while at < len(words) - 1 and words[at].startswith("-"):
        option = words[at].lower()
        at += 1
        if option in _WORDS:
            clamped |= option == "-clamp" and words[at].lower() == "on"
            at += 1
        for _ in range(_NUMBERS.get(option, 0)):
            if at >= len(words) - 1 or not is_number(words[at]):
                break
            given.setdefault(option, []).append(float(words[at]))
            at += 1
    # What follows is the name, which may contain spaces.
    name = rest.strip()
    for _ in range(at):
        name = name.split(None, 1)[1]
    name = name.strip().strip('"')
    path = find_named(library.parent, name)
    behind = _BEHIND.search(name)
    if behind is not None and not path.is_file():  # options and comments behind it
        options = behind.group().strip()
        before = f"{options} " if options.startswith("-") else ""
        return _with_map(material, kind, before + name[: behind.start()], library)
    border = "clamp" if clamped else "wrap"
    picture = MapImage(path, Path(name.replace("\\", "/")).name, border=border)
    if kind == "displacement" and len(given.get("-mm", [])) == 2:
        low, gain = given["-mm"]
        picture = picture._replace(height_range=gain, low=low)
    if kind in ("normal", "bump") and "-bm" in given:  # a bump map may be one of normals
        picture = picture._replace(scale=given["-bm"][0])
    placing = material.placing
    if kind in FELT and (kind == material.felt or material.felt is None):
        scale = tuple((*given.get("-s", []), 1.0, 1.0)[:2])
        offset = tuple((*given.get("-o", []), 0.0, 0.0)[:2])
        placing = Placing(scale, offset)  # type: ignore[arg-type]
    return _changed(material, maps={**material.maps, kind: picture}, placing=placing)
