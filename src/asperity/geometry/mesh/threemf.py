"""3MF: the objects of a build, placed by its items and components, with colours and pictures.

Read are the core of the format and its extensions of materials and production. Volumes of slicers
that are no solid (modifiers, supports, what is to be cut out) are left out with a note.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as Tree
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np

from asperity._core.arrays import Array, Mask
from asperity.geometry.mesh.checks import Corners
from asperity.geometry.mesh.contents import Contents, FilePart
from asperity.geometry.mesh.gltf import placed
from asperity.geometry.mesh.materials import MapImage, Material
from asperity.geometry.mesh.threemf_model import (
    Look,
    ModelPart,
    ObjectPlace,
    PropertyGroup,
    refused,
)

_UNITS = {
    "micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft",
    "meter": "m",
}  # fmt: skip
_ROOT = "3D/3dmodel.model"
_STARTS = re.compile(r"<[^<>]*Relationship\s[^<>]*3dmodel\"[^<>]*>")
_TARGET = re.compile(r"\bTarget=\"([^\"]+)\"")
_COLOUR = re.compile(r"#([0-9a-f]{6})([0-9a-f]{2})?$", re.IGNORECASE)
_SOLIDS = ("model", "surface", "")
_VOLUMES = ("modelpart", "normal_part", "")
_CONFIGS = ("Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config")
"""Of PrusaSlicer, and of Bambu Studio and OrcaSlicer."""
_DEEPEST, _MOST_PARTS, _MOST_BYTES = 100, 100_000, 2**31
_MOST_TRIANGLES = 10_000_000


def read_3mf(path: Path) -> Contents:
    """Return the triangles of a 3MF file, a part for each object that is placed and material."""
    with zipfile.ZipFile(path) as archive:
        return _Reader(path, archive).contents()


class _Reader:
    """An archive whose parts are read."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self.archive = path, archive
        self.names = {info.filename.lower().strip("/"): info for info in archive.infolist()}
        self.out = Contents(up="z")
        self.models: dict[str, ModelPart] = {}
        self.parts: dict[tuple[str, str], list[FilePart]] = {}
        self.materials: dict[tuple[str, str, int], int] = {}
        self.places, self.triangles = 0, 0
        self.volumes = self._volumes()

    def contents(self) -> Contents:
        """Return all parts in the frame of the build, and the materials."""
        root = self._root()
        model = self.model(root)
        if model.unit is not None and model.unit.lower() not in _UNITS:
            raise model.refused(f"its unit is {model.unit[:40]!r}; valid: {', '.join(_UNITS)}")
        self.out.unit = _UNITS[(model.unit or "millimeter").lower()]
        if model.unit is None:
            self._note("it states no unit: mm, the default of 3MF")
        items = model.items
        if not items:
            used = {c.number for o in model.objects.values() for c in o.components}
            items = [ObjectPlace(None, i, np.eye(4), True) for i in model.objects if i not in used]
            self._note("its build is empty: all its objects are read as they stand")
        printed = [item for item in items if item.printable] or items
        if len(printed) < len(items):
            self._note(f"{len(items) - len(printed)} of its {len(items)} items, not to be printed, "
                       "left out")  # fmt: skip
        for item in printed:
            self._place(root, item, np.eye(4), 0)
        return self.out

    def _note(self, text: str) -> None:
        if text not in self.out.notes:
            self.out.notes.append(text)

    def _read(self, name: str) -> bytes | None:
        """Return the content of a part of the archive, None if it is not there."""
        info = self.names.get(name.lower().strip("/"))
        if info is None:
            return None
        if info.file_size > _MOST_BYTES:
            raise refused(
                self.path, f"{name} has {info.file_size} bytes; valid: at most {_MOST_BYTES}"
            )
        return self.archive.read(info)

    def _root(self) -> str:
        """Return the name of the model part from which to start."""
        relations = (self._read("_rels/.rels") or b"").decode("utf-8", "replace")
        for relation in _STARTS.findall(relations):
            target = _TARGET.search(relation)
            if target is not None and target.group(1).lower().strip("/") in self.names:
                return target.group(1)
        if _ROOT.lower() in self.names:
            return _ROOT
        found = [name for name in self.names if name.endswith(".model")]
        if len(found) != 1:
            raise refused(self.path, f"there is no {_ROOT} in it")
        return found[0]

    def model(self, name: str) -> ModelPart:
        """Return a model part of the archive."""
        key = name.lower().strip("/")
        if key not in self.models:
            data = self._read(name)
            if data is None:
                raise refused(self.path, f"its part {name[:80]} is not there")
            self.models[key] = ModelPart(self.path, data)
        return self.models[key]

    def _place(self, name: str, place: ObjectPlace, above: Array, depth: int) -> None:
        """Add the parts of an object that is placed, and of its components."""
        name = place.part or name
        model = self.model(name)
        own = model.objects.get(place.number)
        if own is None:
            raise model.refused(f"it has no object {place.number[:20]}")
        if own.kind not in _SOLIDS:
            self._note(f"objects that are no part of the solid left out ({own.kind})")
            return
        self.places += 1
        if depth > _DEEPEST or self.places > _MOST_PARTS:
            raise model.refused("its components contain themselves, or are too many")
        transform = above @ place.transform
        key = (name.lower().strip("/"), place.number)
        if key not in self.parts:
            self.parts[key] = list(self._parts(name, place.number))
        self.triangles += sum(len(part.corners.faces) for part in self.parts[key])
        if self.triangles > _MOST_TRIANGLES:
            raise model.refused(f"it places more than {_MOST_TRIANGLES} triangles")
        self.out.parts += [
            part._replace(corners=placed(part.corners, transform)) for part in self.parts[key]
        ]
        for component in own.components:
            volume = self.volumes.get((place.number, component.number), "")
            if volume in _VOLUMES:
                self._place(name, component, transform, depth + 1)
            else:
                self._leave_out(volume)

    def _leave_out(self, volume: str) -> None:
        self._note(f"volumes of the slicer that are no part of the solid left out ({volume})")

    def _volumes(self) -> dict[tuple[str, str], str]:
        """Return what slicers say volumes are, by object and part, or first and last triangle."""
        out = {}
        for config in _CONFIGS:
            data = self._read(config)
            if data is None:
                continue
            try:
                objects = Tree.fromstring(data).iter("object")
            except Tree.ParseError:
                self._note(f"{config} in it cannot be read: all its volumes are taken as solids")
                continue
            for found in objects:
                number = found.get("id", "")
                for part in found.iter("part"):
                    out[number, part.get("id", "")] = part.get("subtype", "")
                for volume in found.iter("volume"):
                    kinds = [m.get("value", "") for m in volume.iter("metadata")
                             if m.get("key") == "volume_type"]  # fmt: skip
                    span = f"{volume.get('firstid')}-{volume.get('lastid')}"
                    out[number, span] = kinds[0].lower() if kinds else ""
        return out

    def _solid(self, number: str, count: int) -> Mask:
        """Return which triangles of an object are no modifier of a slicer."""
        out = np.ones(count, dtype=bool)
        for (own, span), volume in self.volumes.items():
            ends = re.fullmatch(r"(\d+)-(\d+)", span)
            if own == number and ends is not None and volume not in _VOLUMES:
                out[int(ends.group(1)) : int(ends.group(2)) + 1] = False
                self._leave_out(volume)
        return out

    def _parts(self, name: str, number: str) -> Iterator[FilePart]:
        """Yield the triangles of an object, a part for each material."""
        model = self.model(name)
        own = model.objects[number]
        vertices, faces = model.mesh(number)
        if not len(faces):
            return
        of = np.full(len(faces), self._material(name, model, own.look))
        for triangle, look in own.looks.items():
            of[triangle] = self._material(name, model, look)
        solid = self._solid(number, len(faces))
        for material in np.unique(of[solid]):
            which = np.flatnonzero(solid & (of == material))
            looks = [own.looks.get(i, own.look) for i in which.tolist()]
            uv = self._uv(model, looks) if self._has_picture(material) else None
            yield FilePart(Corners(vertices, faces[which], uv), int(material))

    def _has_picture(self, material: int) -> bool:
        return material >= 0 and bool(self.out.materials[material].maps)

    def _uv(self, model: ModelPart, looks: list[Look | None]) -> Array:
        """Return the texture coordinates of triangles of one group (m, 3, 2)."""
        group = next(look.group for look in looks if look is not None)
        uv = np.asarray(model.groups[group].uv, dtype=np.float64).reshape(-1, 2)
        at = np.array([look.at for look in looks if look is not None])
        if at.min() < 0 or at.max() >= len(uv):
            raise model.refused(
                f"a triangle names texture coordinate {at.max()} of group {group}, which has "
                f"{len(uv)}"
            )
        return uv[at]

    def _material(self, name: str, model: ModelPart, look: Look | None) -> int:
        """Return the number of the material of a look, -1 without."""
        group = None if look is None else model.groups.get(look.group)
        if look is None or group is None:
            return -1
        entry = look.at[0] if group.kind == "basematerials" else -1
        key = (name.lower(), look.group, entry)
        if key not in self.materials:
            made = self._made(model, look.group, group, entry)
            self.materials[key] = -1 if made is None else len(self.out.materials)
            self.out.materials += [] if made is None else [made]
        return self.materials[key]

    def _made(
        self, model: ModelPart, number: str, group: PropertyGroup, entry: int
    ) -> Material | None:
        """Return the material of a group, or of an entry of it; None if it cannot be used."""
        if group.kind == "texture2dgroup":
            inside = model.pictures.get(group.picture, "")
            data = self._read(inside) if inside else None
            if data is None:
                self._note(f"its picture {inside[:80] or group.picture[:20]} is not there")
                return None
            picture = MapImage(None, PurePosixPath(inside).name, data)
            return Material(f"texture {number}", {"colour": picture})
        if group.kind == "basematerials" and 0 <= entry < len(group.names):
            title = group.names[entry] or f"material {number}-{entry}"
            return Material(title, colour=_mean(group.colours[entry : entry + 1]))
        if group.kind == "colorgroup":
            return Material(f"colours {number}", colour=_mean(group.colours))
        if group.kind != "basematerials":
            self._note(f"{group.kind} in it is left out")
        return None


def _mean(colours: list[str]) -> tuple[float, float, float] | None:
    """Return the mean of colours, 0 to 1 (sRGB); None if none is a colour."""
    found = [match for match in map(_COLOUR.match, colours) if match is not None]
    if not found:
        return None
    rows = [list(bytes.fromhex(match.group(1))) for match in found]
    return tuple(float(x) for x in np.mean(rows, axis=0) / 255.0)  # type: ignore[return-value]
