"""OFF files of Geomview in text: vertices and polygons, one a line (OFF, COFF, NOFF, STOFF)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import columns_of, text_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners, count_of
from asperity.geometry.mesh.contents import Contents, FilePart, stated_unit, triangulated

_HEAD = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF\b|(ST)?(C)?(N)?(4)?(n)?OFF(?=\d)")
"""Its first word; some programs write the counts right behind it."""
_COLOURS = (0, 1, 3, 4)
"""How many numbers the colour of a face may have."""
_COMMENT = re.compile(r"#.*")


def read_off(path: Path) -> Contents:
    """Return the polygons of an OFF file as triangles; colours are left out."""
    text = text_of(content_of(path))
    out = Contents(unit=stated_unit("\n".join(_COMMENT.findall(text[:20_000]))))
    lines = [line for line in map(str.strip, _COMMENT.sub("", text).split("\n")) if line]
    head = _HEAD.match(lines[0]) if lines else None
    if head is None:
        raise _refused(path, "it does not begin with OFF, COFF, NOFF or STOFF")
    letters = head.group().removesuffix("OFF")
    if "4" in letters or "n" in letters:
        raise _refused(path, f"it begins with {head.group()}, of other dimensions; valid: 3")
    lines[0] = lines[0][head.end() :].strip()
    if lines[0].upper().startswith("BINARY"):
        raise _refused(path, "it is a binary one; valid: text")
    lines = lines if lines[0] else lines[1:]
    counts = lines[0].split() if lines else []
    if len(counts) not in (2, 3) or not all(word.isascii() and word.isdigit() for word in counts):
        shown = lines[0][:40] if lines else ""
        raise _refused(path, f"its counts are {shown!r}; valid: those of vertices, faces and edges")
    vertices, faces = int(counts[0]), int(counts[1])
    if len(lines) - 1 != vertices + faces:
        less = "it is cut short, or " if len(lines) - 1 < vertices + faces else ""
        raise AsperityError(
            f"{path}: {less}its counts are wrong: {count_of(vertices, 'vertex', 'vertices')} and "
            f"{count_of(faces, 'face')}, {count_of(len(lines) - 1, 'line')}; valid: a line for each"
        )
    places = _vertices(path, lines[1 : vertices + 1], letters, out)
    corners, sizes = _faces(path, lines[vertices + 1 :], vertices, out)
    few = int(np.count_nonzero(sizes < 3))
    if few:
        out.notes.append(f"{count_of(few, 'polygon')} of fewer than three corners left out")
    triangles, _ = triangulated(places[corners, :3], sizes)
    if len(triangles):
        at = corners[triangles]
        uv = places[at, -2:] if "ST" in letters else None
        normals = places[at, 3:6] if "N" in letters else None
        out.parts.append(FilePart(Corners(places[:, :3], at, uv, normals)))
    return out


def _refused(path: Path, reason: str) -> AsperityError:
    return AsperityError(f"{path}: cannot be read as an .off file: {reason}")


def _vertices(path: Path, lines: list[str], letters: str, out: Contents) -> Array:
    """Return the numbers of all vertices (n, k): places, then normals, colours, coordinates."""
    if not lines:
        return np.zeros((0, 3))
    width = len(lines[0].split())
    least = 3 + 3 * ("N" in letters) + 2 * ("ST" in letters)
    if width < least + ("C" in letters):
        raise AsperityError(
            f"{path}: vertex 1 is {lines[0][:60]!r}; valid: {least + 3 * ('C' in letters)} numbers"
        )
    wrong = next((i for i, line in enumerate(lines) if len(line.split()) != width), None)
    values = columns_of(lines, range(width)) if wrong is None else None
    if values is None:
        if wrong is None:
            wrong = next(i for i, line in enumerate(lines) if columns_of([line], [0]) is None
                         or columns_of([line], range(width)) is None)  # fmt: skip
        raise AsperityError(
            f"{path}: vertex {wrong + 1} is {lines[wrong][:60]!r}; valid: {width} numbers, as the "
            "first has"
        )
    if width > least and "C" not in letters:
        out.notes.append(f"{count_of(width - least, 'number')} behind each vertex left out")
    return values


def _faces(path: Path, lines: list[str], vertices: int, out: Contents) -> tuple[Indices, Indices]:
    """Return the vertices of all faces, one face after the other, and how many each has.

    Behind them may stand a colour: an index, three numbers or four.
    """
    words = [line.split() for line in lines]
    sizes = np.zeros(len(lines), dtype=np.int64)
    at = 0
    try:
        flat: list[int] = []
        for at, row in enumerate(words):
            size = int(row[0])
            if size < 0 or len(row) - 1 - size not in _COLOURS:
                raise ValueError
            flat += map(int, row[1 : size + 1])
            sizes[at] = size
    except (ValueError, OverflowError):
        raise AsperityError(
            f"{path}: face {at + 1} is {lines[at][:60]!r}; valid: how many vertices, and which"
        ) from None
    if flat and not 0 <= min(flat) <= max(flat) < vertices:
        wrong = min(flat) if min(flat) < 0 else max(flat)
        raise AsperityError(f"{path}: a face names vertex {wrong}; valid: 0 to {vertices - 1}")
    one = sum(len(row) == size + 2 for row, size in zip(words, sizes.tolist(), strict=True))
    if one:
        out.notes.append(f"one number behind {count_of(one, 'face')}: taken for a colour")
    return np.array(flat, dtype=np.int64), sizes
