"""A model part of a 3MF file: its objects, property groups and build, as its XML states them.

Read by expat as it goes by, so a million triangles need no tree.
"""

from __future__ import annotations

import xml.parsers.expat
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError

_KNOWN = ("/material/", "/production/", "/slice/", "/trianglesets/", "bambulab", "slic3r")
"""Parts of the namespaces of extensions that a file may require."""
_CORNERS = ("v1", "v2", "v3")
_AXES = ("x", "y", "z")


def refused(path: Path, reason: str) -> AsperityError:
    """Return the error that states why a 3MF file cannot be read."""
    return AsperityError(f"{path}: cannot be read as a .3mf file: {reason}")


class ObjectPlace(NamedTuple):
    """An object that a component or an item of the build places.

    Attributes
    ----------
    part : str or None
        The model part that has it, None: the same.
    number : str
        Its id.
    transform : (4, 4) array
    printable : bool
    """

    part: str | None
    number: str
    transform: Array
    printable: bool


class Look(NamedTuple):
    """A property of a triangle: its group, and the entries at its three corners."""

    group: str
    at: tuple[int, int, int]


@dataclass
class Object:
    """An object: a mesh, or components.

    Attributes
    ----------
    kind : str
        "model", or what it is beside: "support", "other".
    look : Look or None
        Of triangles that have none themselves.
    vertices, faces : list of str
        Numbers as they are written, three a row.
    looks : dict of int to Look
        Of triangles by their numbers.
    components : list of ObjectPlace
    """

    kind: str = "model"
    look: Look | None = None
    vertices: list[str] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    looks: dict[int, Look] = field(default_factory=dict)
    components: list[ObjectPlace] = field(default_factory=list)


@dataclass
class PropertyGroup:
    """A group of properties: texture coordinates of a picture, colours, or materials.

    Attributes
    ----------
    kind : str
        "texture2dgroup", "colorgroup", "basematerials", or one that is not used.
    picture : str
        Id of the texture.
    uv : list of (u, v)
    colours : list of str
        As `#RRGGBB` or `#RRGGBBAA`.
    names : list of str
        Of materials.
    """

    kind: str
    picture: str = ""
    uv: list[tuple[float, float]] = field(default_factory=list)
    colours: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


class ModelPart:
    """What a model part states.

    Attributes
    ----------
    unit : str or None
        As it is written.
    objects : dict of str to Object
    groups : dict of str to PropertyGroup
    pictures : dict of str to str
        Names of textures within the archive, by id.
    items : list of ObjectPlace
        Of the build.

    Raises
    ------
    AsperityError
        An extension that is required and not known; numbers that are none; one line.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.unit: str | None = None
        self.objects: dict[str, Object] = {}
        self.groups: dict[str, PropertyGroup] = {}
        self.pictures: dict[str, str] = {}
        self.items: list[ObjectPlace] = []
        self._spaces: dict[str, str] = {}
        self._object: Object | None = None
        self._group: PropertyGroup | None = None
        self._mesh = False
        parser = xml.parsers.expat.ParserCreate(namespace_separator="}")
        parser.StartNamespaceDeclHandler = self._namespace
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.Parse(data, True)

    def _namespace(self, prefix: str | None, uri: str) -> None:
        self._spaces[prefix or ""] = uri

    def _start(self, tag: str, at: dict[str, str]) -> None:
        name = tag.rpartition("}")[2]
        if self._mesh:
            if name == "vertex" and self._object is not None:
                self._object.vertices += [at[axis] for axis in _AXES]
            elif name == "triangle" and self._object is not None:
                look = self._look(at)
                if look is not None:
                    self._object.looks[len(self._object.faces) // 3] = look
                self._object.faces += [at[corner] for corner in _CORNERS]
        elif name == "mesh":
            self._mesh = True
        elif name == "object":
            pid, index = at.get("pid"), int(at.get("pindex", 0))
            look = None if pid is None else Look(pid, (index, index, index))
            self._object = self.objects[at["id"]] = Object(at.get("type", "model"), look)
        elif name == "component" and self._object is not None:
            self._object.components.append(self._placed(at))
        elif name == "item":
            self.items.append(self._placed(at))
        elif name == "model":
            self.unit = at.get("unit")
            self._check_required(at.get("requiredextensions", "").split())
        elif name == "texture2d":
            self.pictures[at["id"]] = at["path"]
        elif name in ("texture2dgroup", "colorgroup", "basematerials", "multiproperties",
                      "compositematerials"):  # fmt: skip
            self._group = self.groups[at["id"]] = PropertyGroup(name, at.get("texid", ""))
        elif self._group is not None:
            self._property(self._group, name, at)

    def _end(self, tag: str) -> None:
        name = tag.rpartition("}")[2]
        if name == "mesh":
            self._mesh = False
        elif name == "object":
            self._object = None
        elif self._group is not None and name == self._group.kind:
            self._group = None

    def _property(self, group: PropertyGroup, name: str, at: dict[str, str]) -> None:
        if name == "tex2coord":
            group.uv.append((float(at["u"]), float(at["v"])))
        elif name == "color":
            group.colours.append(at["color"])
        elif name == "base":
            group.names.append(at.get("name", ""))
            group.colours.append(at.get("displaycolor", ""))

    def _look(self, at: dict[str, str]) -> Look | None:
        first = at.get("p1")
        if first is None:
            return None
        group = at.get("pid") or (self._object and self._object.look and self._object.look.group)
        corners = (int(first), int(at.get("p2", first)), int(at.get("p3", first)))
        return Look(group, corners) if group else None

    def _placed(self, at: dict[str, str]) -> ObjectPlace:
        own = {key.rpartition("}")[2]: value for key, value in at.items()}
        transform = np.eye(4)
        if "transform" in own:
            numbers = self.numbers("transform", own["transform"].split())
            if len(numbers) != 12:
                raise self.refused(f"a transform has {len(numbers)} numbers; valid: 12")
            transform[:3] = numbers.reshape(4, 3).T  # of rows, for places as rows
        printable = own.get("printable", "1").strip().lower() not in ("0", "false")
        return ObjectPlace(own.get("path"), own["objectid"], transform, printable)

    def _check_required(self, prefixes: Sequence[str]) -> None:
        names = [self._spaces.get(prefix, prefix) for prefix in prefixes]
        unknown = [name for name in names if not any(known in name.lower() for known in _KNOWN)]
        if unknown:
            raise AsperityError(
                f"{self.path}: it requires the extension {', '.join(unknown)[:160]}, which is not "
                "known here; valid: exported without it"
            )

    def refused(self, reason: str) -> AsperityError:
        """Return the error that states why the file cannot be read."""
        return refused(self.path, reason)

    def numbers(self, what: str, words: Sequence[str]) -> Array:
        """Return words as finite numbers."""
        try:
            values = np.array([float(word) for word in words])
        except ValueError:
            values = np.array([])
        if len(values) != len(words) or not np.isfinite(values).all():
            wrong = next(word for word in words if not _is_finite(word))
            raise self.refused(f"a {what} has {wrong[:40]!r}; valid: finite numbers")
        return values

    def mesh(self, number: str) -> tuple[Array, Indices]:
        """Return the vertices (n, 3) and triangles (m, 3) of an object."""
        own = self.objects[number]
        vertices = self.numbers("vertex", own.vertices).reshape(-1, 3)
        try:
            faces = np.array([int(word) for word in own.faces], dtype=np.int64).reshape(-1, 3)
        except (ValueError, OverflowError):
            raise self.refused(f"object {number} has triangles of no whole numbers") from None
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            wrong = faces.max() if faces.max() >= len(vertices) else faces.min()
            raise self.refused(
                f"object {number} has a triangle of vertex {wrong}; valid: 0 to {len(vertices) - 1}"
            )
        return vertices, faces


def _is_finite(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
