"""OBJ files: vertices, texture coordinates and normals of each corner, materials."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import columns_of, find_named, text_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners, count_of
from asperity.geometry.mesh.contents import Contents, FilePart, stated_unit, triangulated
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.mtl import read_mtl

_KEYS = ("v", "vt", "vn")
_REGIONS = ("usemtl ", "g ", "o ")
_READ = ("v ", "vt ", "vn ", "f ", "fo ")
_SPACE, _NEWLINE, _SLASH = map(ord, " \n/")
_CONTINUED = re.compile(r"\\[ \t]*\n")
_CALLED = re.compile(r"(?:call|csh)\s+(.*)")
"""A line that takes in another file, or runs a program."""
_LEFT_OUT = {"l": "line", "p": "point", "curv": "curve", "surf": "free-form surface"}


class _Faces(NamedTuple):
    """Lines of polygons of one material, and what stood before each."""

    lines: list[str]
    seen: Indices
    """Vertices, texture coordinates and normals before each (n, 3): negative indices count back."""


def read_obj(path: Path) -> Contents:
    """Return the polygons of an OBJ file as triangles, a part for each material.

    In a file without materials its groups, or else its objects, stand for them.
    """
    out = Contents()
    text = _CONTINUED.sub(" ", text_of(content_of(path))).replace("\t", " ")
    lines = text.splitlines()
    if "\n " in text or text.startswith(" "):
        lines = [line.lstrip() for line in lines]
    heads = np.array([line[:3] for line in lines] or [""], dtype="U3")
    at = {key: np.flatnonzero(heads.astype(f"U{len(key)}") == key) for key in _READ}
    rows = {key: [lines[i][len(key) :] for i in at[f"{key} "].tolist()] for key in _KEYS}
    rest, faces = _by_material(lines, at)
    v, vt, vn = (
        _numbers(path, key, rows[key], least, most, out)
        for key, least, most in (("v", 3, 3), ("vt", 1, 2), ("vn", 3, 3))
    )
    _divide(path, v, rows["v"], out)
    out.unit = stated_unit("\n".join(line for line in rest if line.startswith("#"))[:20_000])
    counts = Counter(line.split(" ", 1)[0] for line in rest)
    out.notes += [
        f"{count_of(counts[key], name)} left out: only polygons are read"
        for key, name in _LEFT_OUT.items()
        if counts[key]
    ]
    called = [found[1].strip() for found in map(_CALLED.match, rest) if found]
    if called:
        out.notes.append(f"what it calls is not read: {', '.join(called)[:120]}")
    libraries = [line[6:].strip() for line in rest if line.startswith("mtllib ")]
    materials = _materials(path, libraries, faces, out, named=counts["usemtl"] > 0)
    numbers = {material.name: i for i, material in enumerate(materials)}
    out.materials = materials
    for name, found in faces.items():
        corners = _corners(path, found, v, vt, vn, out)
        if len(corners.faces):
            out.parts.append(FilePart(corners, numbers.get(name, -1)))
    return out


def _by_material(lines: list[str], at: dict[str, Indices]) -> tuple[list[str], dict[str, _Faces]]:
    """Return the lines that are no numbers and no polygons, and the polygons of each material.

    `at` are the numbers of the lines of each kind.
    """
    polygons = np.sort(np.concatenate([at["f "], at["fo "]]))
    left = np.ones(len(lines), dtype=bool)
    for numbers in at.values():
        left[numbers] = False
    other = np.flatnonzero(left).tolist()
    texts = [lines[i].partition(" ")[2] for i in polygons.tolist()]
    if any("#" in text for text in texts):
        texts = [text.partition("#")[0] for text in texts]
    seen = np.zeros((len(polygons), 3), dtype=np.int64)
    if any("-" in text for text in texts):
        for column, key in enumerate(_KEYS):
            seen[:, column] = np.searchsorted(at[f"{key} "], polygons)
    changes = next(filter(None, (_changes(lines, other, key) for key in _REGIONS)), [])
    starts = np.searchsorted(polygons, [i for i, _ in changes]).tolist()
    names = ["", *(name for _, name in changes)]
    pieces: dict[str, list[slice]] = {}
    for name, start, end in zip(names, [0, *starts], [*starts, len(polygons)], strict=True):
        if end > start:
            pieces.setdefault(name, []).append(slice(start, end))
    faces = {
        name: _Faces(
            [text for piece in own for text in texts[piece]],
            np.concatenate([seen[piece] for piece in own]),
        )
        for name, own in pieces.items()
    }
    return [lines[i] for i in other], faces


def _changes(lines: list[str], other: list[int], key: str) -> list[tuple[int, str]]:
    """Return where a material, a group or an object begins: the line's number, and its name."""
    return [(i, lines[i][len(key) :].strip()) for i in other if lines[i].startswith(key)]


def _materials(
    path: Path, libraries: list[str], faces: dict[str, _Faces], out: Contents, *, named: bool
) -> list[Material]:
    """Return the materials that are used, of the libraries beside the file."""
    found: dict[str, Material] = {}
    for line in libraries:
        # A name may contain spaces; several files may stand in one line.
        for name in library_names(path.parent, line):
            library = find_named(path.parent, name)
            if not library.is_file():
                out.notes.append(f"its material library {name} is not there")
                continue
            for material in read_mtl(library, out.notes):
                found.setdefault(material.name, material)
    own = {name: found.get(name, found.get(name.partition(" #")[0].rstrip())) for name in faces}
    lost = [name for name, material in own.items() if name and material is None]
    if named and found and lost:
        out.notes.append(f"materials that its library does not have: {', '.join(lost)[:120]}")
    return [replace(own[name] or Material(name), name=name) for name in faces if name]


def library_names(folder: Path, line: str) -> list[str]:
    """Return the names of material libraries that stand behind mtllib."""
    for whole in (line.strip().strip('"'), line.partition(" #")[0].strip().strip('"')):
        if find_named(folder, whole).is_file():
            return [whole]
    return [word.strip('"') for word in line.partition(" #")[0].split()]


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
                f"{path}: {key} {wrong + 1} is {rows[wrong].strip()[:40]!r}; valid: {least} numbers"
            )
        words = [[*row, "0"][:most] for row in words]
    try:
        values = np.array(words, dtype=np.float64)[:, :most]
    except ValueError:
        wrong = next(i for i, row in enumerate(words) if not _are_numbers(row))
        raise AsperityError(
            f"{path}: {key} {wrong + 1} is {rows[wrong].strip()[:40]!r}; valid: numbers"
        ) from None
    return values if values.shape[1] == most else np.pad(values, ((0, 0), (0, 1)))


def _divide(path: Path, v: Array, rows: list[str], out: Contents) -> None:
    """Divide the vertices of rows of four numbers by the fourth, their weight w, in place.

    Rows of six and seven numbers have colours, without a weight.
    """
    # Three numbers at least are behind a space each: that many spaces are three in each row.
    if "".join(rows).count(" ") == 3 * len(rows):
        return
    if len(" ".join(rows).split()) in (3 * len(rows), 6 * len(rows)):
        return
    words = [row.partition("#")[0].split() for row in rows]
    at = [i for i, row in enumerate(words) if len(row) == 4]
    w = _numbers(path, "w", [words[i][3] for i in at], 1, 1, out)[:, 0]
    if not (np.isfinite(w) & (w != 0.0)).all():
        wrong = at[int(np.argmin(np.isfinite(w) & (w != 0.0)))]
        raise AsperityError(
            f"{path}: v {wrong + 1} is {rows[wrong].strip()[:40]!r}; valid: a weight w other than 0"
        )
    if (w != 1.0).any():
        v[at] /= w[:, None]
        out.notes.append(f"{count_of(int(np.count_nonzero(w != 1.0)), 'vertex', 'vertices')} "
                         "divided by a weight w")  # fmt: skip


def _are_numbers(words: list[str]) -> bool:
    try:
        np.array(words, dtype=np.float64)
    except ValueError:
        return False
    return True


def _corners(
    path: Path, found: _Faces, v: Array, vt: Array, vn: Array, out_of_file: Contents
) -> Corners:
    """Return the polygons of a material as triangles."""
    indices, counts = _indices(path, found.lines)
    before = found.seen
    if counts.size and counts.min() < 3:
        few = count_of(int(np.count_nonzero(counts < 3)), "polygon")
        out_of_file.notes.append(f"{few} of fewer than three corners left out")
        indices = indices[np.repeat(counts > 2, counts)]
        before, counts = before[counts > 2], counts[counts > 2]
    written = indices
    if indices.size and indices.min() < 0:
        seen = np.repeat(before, counts, axis=0)
        indices = np.where(indices < 0, seen + indices + 1, indices)
    of_line = np.repeat(np.arange(len(counts)), counts)
    out: list[Indices | None] = []
    for column, (key, values) in enumerate((("v", v), ("vt", vt), ("vn", vn))):
        at = indices[:, column]
        if column and (at == 0).any():
            if at.any():
                what = "texture coordinates" if key == "vt" else "normals"
                note = f"some of its corners have no {what}: those of the others are left out"
                out_of_file.notes += [note] if note not in out_of_file.notes else []
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
    triangles, _ = triangulated(v[at_v], counts)
    faces = at_v[triangles]
    uv = None if at_vt is None else vt[at_vt[triangles]]
    normals = None if at_vn is None else vn[at_vn[triangles]]
    used, numbered = np.unique(faces, return_inverse=True)
    return Corners(v[used], numbered.reshape(faces.shape).astype(np.int64), uv, normals)


def _indices(path: Path, lines: list[str]) -> tuple[Indices, Indices]:
    """Return the indices (n, 3) of vertex, texture coordinate and normal of words like 1/2/3.

    0 stands for those that are not there. And the number of corners of each line.
    """
    found = _alike(lines)
    if found is not None:
        return found
    corners = [line.split() for line in lines]
    words = [word for line in corners for word in line]
    counts = np.array([len(line) for line in corners], dtype=np.int64)
    try:
        fields = [[*word.split("/"), "", ""][:3] for word in words]
        values = [[int(i) if i else 0 for i in row] for row in fields]
        return np.array(values, dtype=np.int64).reshape(-1, 3), counts
    except (ValueError, OverflowError):
        wrong = next(word for word in words if not _is_corner(word))
        raise AsperityError(
            f"{path}: cannot be read as an .obj file: a face names {wrong[:40]!r}; "
            "valid: indices such as 1, 1/2 or 1/2/3"
        ) from None


def _alike(lines: list[str]) -> tuple[Indices, Indices] | None:
    """Return what `_indices` does, fast, if all words are made alike; else None."""
    text = " " + "\n ".join(lines)
    try:
        data = np.frombuffer(text.encode("ascii"), dtype=np.uint8)
    except UnicodeEncodeError:
        return None
    blank = (data == _SPACE) | (data == _NEWLINE)
    starts = np.flatnonzero(blank[:-1] & ~blank[1:]) + 1
    if not len(starts):
        return None
    counts = np.diff(np.searchsorted(starts, np.flatnonzero(data == _NEWLINE)), prepend=0)
    counts = np.append(counts, len(starts) - counts.sum())
    slashes = np.add.reduceat(data == _SLASH, starts, dtype=np.int64)
    width = int(slashes[0]) + 1
    if width > 3 or (slashes != width - 1).any():
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # on what is no number
            flat = np.fromstring(text.replace("//", "/0/").replace("/", " "), np.int64, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    if flat.size != width * len(starts):
        return None
    return np.pad(flat.reshape(-1, width), ((0, 0), (0, 3 - width))), counts


def _is_corner(word: str) -> bool:
    try:
        return all(abs(int(i)) < 2**62 for i in word.split("/") if i)
    except ValueError:
        return False
