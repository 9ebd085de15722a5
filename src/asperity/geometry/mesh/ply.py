"""PLY files, text or binary in either byte order: elements with their properties."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners, count_of
from asperity.geometry.mesh.contents import Contents, FilePart, stated_unit, triangulated
from asperity.geometry.mesh.materials import MapImage, Material

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4",
    "float64": "f8", "long": "i4", "ulong": "u4",
}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_PICTURE = "comment texturefile "
_FACES = "vertex_indices", "vertex_index"
_COORDINATES = "texcoord", "texcoords", "texture_coordinates", "uv"
_AT_VERTICES = re.compile(r"((?:tex(?:ture)?|(?:tex(?:ture)?_?)?coords?|uv|map)?_?)([us])(_?\d?)")
"""Name of the first texture coordinate of vertices: `s`, `u`, `texture_u`, `tex_u`, `s0`."""
_SECOND = {"u": "v", "s": "t"}
_MOST_HEAD = 100_000
_LONGEST_WORD = 60
"""Of a number in a text."""


class Lists(NamedTuple):
    """A property of lists: how long each is, and their values one after the other."""

    lengths: NDArray[np.int64]
    values: NDArray[Any]


class Property(NamedTuple):
    """A property of an element; `counter` is the type of the lengths of lists."""

    name: str
    type: str
    counter: str = ""


Columns = dict[str, Any]
"""Arrays (n,), or `Lists`, by the names of properties."""


class Head(NamedTuple):
    """Head of a PLY file."""

    order: str
    """"<" or ">", "" for text."""
    elements: dict[str, tuple[int, list[Property]]]
    """Count and properties by name, in their order."""
    comments: list[str]
    size: int
    """Bytes before the data."""


def read_head(path: Path) -> Head:
    """Return the head of a PLY file; raise `AsperityError` if it is none."""
    data = content_of(path, _MOST_HEAD)
    ends = re.search(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r)", data)

    def refuse(reason: str) -> AsperityError:
        return AsperityError(f"{path}: cannot be read as a .ply file: {reason}")

    if data[:3].lower() != b"ply" or ends is None:
        raise refuse("it does not begin with ply and a head up to end_header")
    order, comments = "?", []
    elements: dict[str, tuple[int, list[Property]]] = {}
    properties: list[Property] = []
    for line in data[: ends.start() + 1].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if not words:
                continue
            if words[0] == "format":
                order = _FORMATS[words[1]]
            elif words[0] in ("comment", "obj_info"):
                comments.append(line.strip())
            elif words[0] == "element":
                properties = []
                if int(words[2]) < 0:
                    raise ValueError
                elements[words[1]] = (int(words[2]), properties)
            elif words[0] == "property" and words[1] == "list":
                properties.append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[0] == "property":
                properties.append(Property(words[2], _TYPES[words[1]]))
        except (KeyError, IndexError, ValueError):
            raise refuse(f"its head has {line.strip()[:60]!r}") from None
    if order == "?":
        raise refuse("its head names no format")
    return Head(order, elements, comments, ends.end())


def read_elements(path: Path, head: Head, wanted: tuple[str, ...]) -> dict[str, Columns]:
    """Return the elements of a PLY file by name, up to the last of those that are wanted."""
    source: Any = content_of(path)
    at = head.size
    if not head.order:
        split = source[at:].split()
        if max(map(len, split), default=0) > _LONGEST_WORD:
            raise AsperityError(f"{path}: it is damaged: behind its head stand no numbers")
        source, at = np.array(split, dtype=bytes), 0
    out: dict[str, Columns] = {}
    last = max((i for i, name in enumerate(head.elements) if name in wanted), default=-1)
    for name, (count, properties) in list(head.elements.items())[: last + 1]:
        if at + count * _width(properties, not head.order) > len(source):
            raise AsperityError(
                f"{path}: it is cut short: its head counts {count_of(count, name, name + 's')}, "
                "and there is not so much behind it"
            )
        try:
            if head.order:
                out[name], at = _binary(source, at, count, properties, head.order)
            else:
                out[name], at = _text(source, at, count, properties)
        except (ValueError, OverflowError, IndexError):
            raise AsperityError(
                f"{path}: it is damaged or cut short: its {name} elements do not fit its head"
            ) from None
    return out


def _width(properties: list[Property], text: bool) -> int:
    """Return the least number of bytes, or of words, of an element."""
    types = [p.counter or p.type for p in properties]
    return len(types) if text else sum(np.dtype(t).itemsize for t in types)


def _binary(
    data: bytes, at: int, count: int, properties: list[Property], order: str
) -> tuple[Columns, int]:
    """Return the columns of an element that begins at a byte, and the byte behind it."""
    if count == 0:
        return _empty(properties), at
    # As if all lists were as long as the first: so they mostly are.
    lengths: dict[str, int] = {}
    here, fields = at, []
    for p in properties:
        if p.counter:
            counter = np.dtype(order + p.counter)
            lengths[p.name] = n = int(np.frombuffer(data, counter, 1, here)[0])
            if n < 0:
                raise ValueError
            here += counter.itemsize + n * np.dtype(p.type).itemsize
            fields += [(f"{p.name}#", order + p.counter), (p.name, order + p.type, (n,))]
        else:
            here += np.dtype(p.type).itemsize
            fields.append((p.name, order + p.type))
    dtype = np.dtype(fields)
    if at + count * dtype.itemsize <= len(data):
        rows = np.frombuffer(data, dtype, count, at)
        if all((rows[f"{name}#"] == n).all() for name, n in lengths.items()):
            columns: Columns = {}
            for p in properties:
                columns[p.name] = rows[p.name]
                if p.counter:
                    counts = np.broadcast_to(np.int64(lengths[p.name]), count)  # no memory
                    columns[p.name] = Lists(counts, _wide(rows[p.name]).reshape(-1))
            return columns, at + count * dtype.itemsize
    return _uneven(data, at, count, properties, order)


def _wide(values: NDArray[Any]) -> NDArray[Any]:
    """Return values of lists as 64-bit numbers: in one step from where they lie in the file."""
    return values.astype(np.float64 if values.dtype.kind == "f" else np.int64)


def _uneven(
    data: bytes, at: int, count: int, properties: list[Property], order: str
) -> tuple[Columns, int]:
    """Return the columns of an element whose lists differ in length."""
    byteorder: Any = "little" if order == "<" else "big"
    steps = [
        (np.dtype(p.counter).itemsize if p.counter else 0, np.dtype(p.type).itemsize)
        for p in properties
    ]
    places: list[int] = []
    lengths: list[int] = []
    for _ in range(count):
        for counter, size in steps:
            n = 1
            if counter == 1:
                n = data[at]
            elif counter:
                n = int.from_bytes(data[at : at + counter], byteorder)
            at += counter
            places.append(at)
            lengths.append(n)
            at += n * size
    if at > len(data):
        raise ValueError
    starts = np.array(places).reshape(count, -1)
    sizes = np.array(lengths).reshape(count, -1)
    columns: Columns = {}
    for k, p in enumerate(properties):
        dtype = np.dtype(order + p.type)
        # The numbers that begin at every byte, of which some are taken.
        everywhere = np.ndarray((len(data) - dtype.itemsize + 1,), dtype, data, strides=(1,))
        if not p.counter:
            columns[p.name] = everywhere[starts[:, k]]
            continue
        counts = sizes[:, k]
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        values = everywhere[np.repeat(starts[:, k], counts) + within * dtype.itemsize]
        columns[p.name] = Lists(counts, _wide(values))
    return columns, at


def _text(
    words: NDArray[Any], at: int, count: int, properties: list[Property]
) -> tuple[Columns, int]:
    """Return the columns of an element that begins at a word, and the word behind it."""
    if count == 0:
        return _empty(properties), at
    # As if all lists were as long as the first, as above.
    spans: list[tuple[int, int]] = []
    here = 0
    for p in properties:
        n = int(words[at + here]) if p.counter else 1
        here += bool(p.counter)
        if n < 0:
            raise ValueError
        spans.append((here, here + n))
        here += n
    if at + count * here <= len(words):
        rows = words[at : at + count * here].reshape(count, here)
        ends = [start for (start, _), p in zip(spans, properties, strict=True) if p.counter]
        if all((rows[:, k - 1] == rows[0, k - 1]).all() for k in ends):
            columns: Columns = {}
            for (start, end), p in zip(spans, properties, strict=True):
                flat = _values(rows[:, start:end]).reshape(-1)
                counts = np.full(count, end - start, dtype=np.int64)
                columns[p.name] = Lists(counts, flat) if p.counter else flat
            return columns, at + count * here
    return _uneven_text(words, at, count, properties)


def _uneven_text(
    words: NDArray[Any], at: int, count: int, properties: list[Property]
) -> tuple[Columns, int]:
    """Return the columns of an element of text whose lists differ in length."""
    found: dict[str, list[Any]] = {p.name: [] for p in properties}
    counts: dict[str, list[int]] = {p.name: [] for p in properties if p.counter}
    for _ in range(count):
        for p in properties:
            n = 1
            if p.counter:
                n = int(words[at])
                counts[p.name].append(n)
                at += 1
            if n < 0 or at + n > len(words):
                raise ValueError
            found[p.name].append(words[at : at + n])
            at += n
    columns: Columns = {}
    for p in properties:
        flat = _values(np.concatenate(found[p.name]))
        columns[p.name] = Lists(np.array(counts[p.name]), flat) if p.counter else flat
    return columns, at


def _values(words: NDArray[Any]) -> Array:
    """Return words as numbers of 64 bits, whatever the head has: a text holds all its digits."""
    return words.astype(np.float64)


def _empty(properties: list[Property]) -> Columns:
    none = np.zeros(0, dtype=np.int64)
    return {p.name: Lists(none, np.zeros(0)) if p.counter else np.zeros(0) for p in properties}


def positions(
    path: Path, elements: dict[str, Columns], names: Sequence[str] = ("x", "y", "z")
) -> Array:
    """Return x, y and z (or others) of the vertices, (n, len(names))."""
    columns = elements.get("vertex", {})
    for name in names:
        if not isinstance(columns.get(name), np.ndarray):
            raise AsperityError(f"{path}: its vertices have no {name}")
    return _beside([columns[name] for name in names])


def _beside(columns: Sequence[Any]) -> Array:
    """Return columns (n,) of any type as one array (n, k), which are copied once."""
    out = np.empty((len(columns[0]), len(columns)))
    for k, column in enumerate(columns):
        out[:, k] = column
    return out


def read_ply(path: Path) -> Contents:
    """Return the polygons of a PLY file as triangles."""
    head = read_head(path)
    elements = read_elements(path, head, ("vertex", "face", "tristrips"))
    out = Contents(unit=stated_unit("\n".join(head.comments)))
    named = [c.split(None, 2)[2] for c in head.comments if c.lower().startswith(_PICTURE)]
    if named:
        picture = MapImage(path.parent / named[0], named[0])
        out.materials.append(Material(path.stem, {"colour": picture}))
    face, vertex = elements.get("face", {}), elements.get("vertex", {})
    lists = next((face[name] for name in _FACES if isinstance(face.get(name), Lists)), None)
    if lists is None:  # another name, as some programs have it
        properties = head.elements.get("face", (0, []))[1]
        other = next((p.name for p in properties if p.counter and p.type[0] != "f"), "")
        lists = face.get(other)
    if lists is None and "tristrips" in elements:
        lists = _strips(elements["tristrips"])
    if lists is None or not len(lists.values):
        return out
    vertices = positions(path, elements)
    if lists.values.dtype.kind == "f" and not np.isfinite(lists.values).all():
        raise AsperityError(f"{path}: a face names no vertex; valid: indices of vertices")
    at = lists.values.astype(np.int64, copy=False)
    if at.view(np.uint64).max() >= len(vertices):  # negative ones are large then
        wrong = at.min() if at.min() < 0 else at.max()
        raise AsperityError(f"{path}: a face names vertex {wrong}; valid: 0 to {len(vertices) - 1}")
    corner: Indices | None = None  # those of the lists
    if (lists.lengths == 3).all():
        faces = at.reshape(-1, 3)
    else:
        corner, _ = triangulated(vertices[at], lists.lengths)
        if not len(corner):
            return out
        faces = at[corner]
    normals = None
    if all(name in vertex for name in ("nx", "ny", "nz")):
        normals = positions(path, elements, ("nx", "ny", "nz"))[faces]
    uv = _coordinates(face, vertex, lists, corner, faces, out.notes)
    out.parts.append(FilePart(Corners(vertices, faces, uv, normals), 0 if named else -1))
    return out


def _coordinates(
    face: Columns, vertex: Columns, lists: Lists, corner: Indices | None, faces: Indices,
    notes: list[str],
) -> Array | None:  # fmt: skip
    """Return the texture coordinates (m, 3, 2) of corners, of faces or else of vertices."""
    there = next((face[name] for name in _COORDINATES if name in face), None)
    if isinstance(there, Lists):
        if (there.lengths == 2 * lists.lengths).all():
            values = np.asarray(there.values, dtype=np.float64).reshape(-1, 2)
            return values.reshape(-1, 3, 2) if corner is None else values[corner]
        notes.append("texture coordinates of its faces are left out: some corners have none")
    for name, values in vertex.items():
        first = _AT_VERTICES.fullmatch(name.lower())
        if first is None:
            continue
        prefix, letter, end = first.groups()
        other = f"{prefix}{_SECOND[letter]}{end}"
        second = next((vertex[key] for key in vertex if key.lower() == other), None)
        if second is not None:
            return _beside([values, second])[faces]
    return None


def _strips(element: Columns) -> Lists | None:
    """Return the triangles of strips, which -1 separates."""
    lists = next((value for value in element.values() if isinstance(value, Lists)), None)
    if lists is None:
        return None
    out = []
    start = 0
    for count in lists.lengths:
        strip = lists.values[start : start + count].astype(np.int64)
        start += count
        for run in np.split(strip, np.flatnonzero(strip < 0)):
            run = run[run >= 0]
            out.append(strip_triangles(run))
    triangles = np.concatenate(out) if out else np.zeros((0, 3), dtype=np.int64)
    return Lists(np.full(len(triangles), 3), triangles.ravel())


def strip_triangles(run: Any) -> Any:
    """Return the triangles (n - 2, 3) of a strip of n vertices; every second is turned round."""
    if len(run) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    triangles = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
    triangles[1::2] = triangles[1::2][:, [1, 0, 2]]
    return triangles
