"""MTL files: the materials of OBJ files, and the maps that they name."""

from __future__ import annotations

import re
from pathlib import Path

from asperity._core.files import find_named, text_of
from asperity._core.text_form import is_number
from asperity.geometry.mesh.materials import FELT, MapImage, Material, Placing

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
            rest = line.split(None, 1)[1]
            materials[-1] = _with_map(materials[-1], _MTL[key], rest, path, notes)
        elif key == "kd" and len(words) == 4 and all(map(is_number, words[1:])):
            colour = tuple(min(max(float(word), 0.0), 1.0) for word in words[1:])
            materials[-1] = _changed(materials[-1], colour=colour)
    return materials


def _changed(material: Material, **values: object) -> Material:
    fields = {name: getattr(material, name) for name in ("name", "maps", "colour", "placing")}
    return Material(**(fields | values))


def _with_map(
    material: Material, kind: str, rest: str, library: Path, notes: list[str]
) -> Material:
    """Return a material with the map that the rest of a line names, after its options."""
    words = rest.split()
    given: dict[str, list[float]] = {}
    at, clamped, channel = 0, False, ""
    while at < len(words) - 1 and words[at].startswith("-"):
        option = words[at].lower()
        at += 1
        if option in _WORDS:
            clamped |= option == "-clamp" and words[at].lower() == "on"
            channel = f"-imfchan {words[at]}" if option == "-imfchan" else channel
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
        return _with_map(material, kind, before + name[: behind.start()], library, notes)
    border = "clamp" if clamped else "wrap"
    picture = MapImage(path, Path(name.replace("\\", "/")).name, border=border)
    if kind == "displacement" and len(given.get("-mm", [])) == 2:
        low, gain = given["-mm"]
        picture = picture._replace(height_range=gain, low=low)
    if kind in ("normal", "bump") and "-bm" in given:  # a bump map may be one of normals
        picture = picture._replace(scale=given["-bm"][0])
    ignored = [channel, "-t" if any(given.get("-t", [])) else ""]
    ignored.append("-mm" if "-mm" in given and picture.height_range is None else "")
    if kind in FELT and any(ignored):
        options = ", ".join(filter(None, ignored))
        notes.append(f"{picture.name}: its options {options} change what is felt, and are not used")
    placing = material.placing
    if kind in FELT and (kind == material.felt or material.felt is None):
        scale = tuple((*given.get("-s", []), 1.0, 1.0)[:2])
        offset = tuple((*given.get("-o", []), 0.0, 0.0)[:2])
        placing = Placing(scale, offset)  # type: ignore[arg-type]
    return _changed(material, maps={**material.maps, kind: picture}, placing=placing)
