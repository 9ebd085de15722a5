"""OBJ files: vertices, texture coordinates and normals of each corner, materials."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import columns_of, text_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners, count_of
from asperity.geometry.mesh.contents import Contents, FilePart, stated_unit, triangulated
from asperity.geometry.mesh.materials import Material, read_mtl

_KEYS = ("v", "vt", "vn")
_LEFT_OUT = {"l": "line", "p": "point", "curv": "curve", "surf": "free-form surface"}


class _Faces:
    """Polygons of one material: words of their corners, and what stood before each."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.counts: list[int] = []
        self.seen: list[tuple[int, int, int]] = []
        """Vertices, texture coordinates and normals before each: negative indices count back."""


def read_obj(path: Path) -> Contents:
    """Return the polygons of an OBJ file as triangles, a part for each material."""
    out = Contents()
    rows: dict[str, list[str]] = {key: [] for key in _KEYS}
    faces: dict[str, _Faces] = defaultdict(_Faces)
    libraries, comments, material = [], [], ""
    left_out: dict[str, int] = defaultdict(int)
    text = text_of(path.read_bytes()).replace("\\\n", " ")
    for line in text.splitlines():
        key, _, rest = line.strip().partition(" ")
        if "\t" in key:
            key, _, rest = line.strip().partition("\t")
        if key in rows:
            rows[key].append(rest)
        elif key == "f" or key == "fo":
            words = rest.partition("#")[0].split()
            found = faces[material]
            found.words += words
            found.counts.append(len(words))
            found.seen.append((len(rows["v"]), len(rows["vt"]), len(rows["vn"])))
        elif key == "usemtl":
            material = rest.strip()
        elif key == "mtllib":
            libraries.append(rest.strip())
        elif key.startswith("#"):
            comments.append(line)
        elif key in _LEFT_OUT:
            left_out[key] += 1
    v, vt, vn = (
        _numbers(path, key, rows[key], least, most, out)
        for key, least, most in (("v", 3, 3), ("vt", 1, 2), ("vn", 3, 3))
    )
    out.unit = stated_unit("\n".join(comments[:200]))
    out.notes += [
        f"{count_of(n, _LEFT_OUT[key])} left out: only polygons are read"
        for key, n in left_out.items()
    ]
    materials = _materials(path, libraries, faces, out)
    numbers = {material.name: i for i, material in enumerate(materials)}
    out.materials = materials
    for name, found in faces.items():
        corners = _corners(path, found, v, vt, vn)
        if len(corners.faces):
            out.parts.append(FilePart(corners, numbers.get(name, -1)))
    return out


def _materials(
    path: Path, libraries: list[str], faces: dict[str, _Faces], out: Contents
) -> list[Material]:
    """Return the materials that are used, of the libraries beside the file."""
    found: dict[str, Material] = {}
    for line in libraries:
        # A name may contain spaces; several files may stand in one line.
        names = [line] if (path.parent / line.replace("\\", "/")).is_file() else line.split()
        for name in names:
            library = path.parent / name.strip('"').replace("\\", "/")
            if not library.is_file():
                out.notes.append(f"its material library {name} is not there")
                continue
            for material in read_mtl(library, out.notes):
                found.setdefault(material.name, material)
    return [found.get(name, Material(name)) for name in faces if name]


def _numbers(path: Path, key: str, rows: list[str], least: int, most: int, out: Contents) -> Array:
    """Return rows of numbers as an array (n, most); missing ones are 0."""
    if not rows:
        return np.zeros((0, most))
    if "," in rows[0] and "." not in rows[0]:
        rows = [row.replace(",", ".") for row in rows]
        if key == "v":
            out.notes.append("its numbers have decimal commas")
    found = columns_of(rows, range(most))
    if found is not None and len(found) == len(rows):
        return found
    words = [row.partition("#")[0].split() for row in rows]
    width = len(words[0])
    if width < least or any(len(row) != width for row in words):
        wrong = next((i for i, row in enumerate(words) if len(row) < least), None)
        if wrong is not None:
            raise AsperityError(
                f"{path}: {key} {wrong + 1} is {rows[wrong][:40]!r}; valid: {least} numbers"
            )
        words = [[*row, "0"][:most] for row in words]
    try:
        values = np.array(words, dtype=np.float64)[:, :most]
    except ValueError:
        wrong = next(i for i, row in enumerate(words) if not _are_numbers(row))
        raise AsperityError(
            f"{path}: {key} {wrong + 1} is {rows[wrong][:40]!r}; valid: numbers"
        ) from None
    return values if values.shape[1] == most else np.pad(values, ((0, 0), (0, 1)))


def _are_numbers(words: list[str]) -> bool:
    try:
        np.array(words, dtype=np.float64)
    except ValueError:
        return False
    return True


def _corners(path: Path, found: _Faces, v: Array, vt: Array, vn: Array) -> Corners:
    """Return the polygons of a material as triangles."""
    if not found.words:
        return Corners(v, np.zeros((0, 3), dtype=np.int64))
    indices = written = _indices(path, found)
    if "-" in "".join(found.words):
        seen = np.repeat(np.array(found.seen, dtype=np.int64), found.counts, axis=0)
        indices = np.where(indices < 0, seen + indices + 1, indices)
    of_line = np.repeat(np.arange(len(found.counts)), found.counts)
    out: list[Indices | None] = []
    for column, (key, values) in enumerate((("v", v), ("vt", vt), ("vn", vn))):
        at = indices[:, column]
        if column and (at == 0).any():
            out.append(None)
            continue
        wrong = (at < 1) | (at > len(values))
        if wrong.any():
            first = int(np.argmax(wrong))
            what = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}[key]
            raise AsperityError(
                f"{path}: face {of_line[first] + 1} names {what} {written[first, column]}; "
                f"valid: 1 to {len(values)}"
            )
        out.append(at - 1)
    at_v, at_vt, at_vn = out
    assert at_v is not None
    triangles, _ = triangulated(v[at_v], found.counts)
    faces = at_v[triangles]
    uv = None if at_vt is None else vt[at_vt[triangles]]
    normals = None if at_vn is None else vn[at_vn[triangles]]
    used, numbered = np.unique(faces, return_inverse=True)
    return Corners(v[used], numbered.reshape(faces.shape).astype(np.int64), uv, normals)


def _indices(path: Path, found: _Faces) -> Indices:
    """Return the indices (n, 3) of vertex, texture coordinate and normal of words like 1/2/3.

    0 stands for those that are not there.
    """
    words = found.words
    slashes = words[0].count("/")
    text = " ".join(words).replace("//", "/0/")
    try:
        if all(word.count("/") == slashes for word in words) and "/ " not in text + " ":
            flat = np.array(text.replace("/", " ").split(), dtype=np.int64)
            values = flat.reshape(len(words), -1)
            if values.shape[1] <= 3:
                return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
        fields = [[*word.split("/"), "", ""][:3] for word in words]
        return np.array([[int(i) if i else 0 for i in row] for row in fields], dtype=np.int64)
    except (ValueError, OverflowError):
        wrong = next(word for word in words if not _is_corner(word))
        raise AsperityError(
            f"{path}: cannot be read as an .obj file: a face names {wrong[:40]!r}; "
            "valid: indices such as 1, 1/2 or 1/2/3"
        ) from None


def _is_corner(word: str) -> bool:
    try:
        return all(abs(int(i)) < 2**62 for i in word.split("/") if i)
    except ValueError:
        return False
