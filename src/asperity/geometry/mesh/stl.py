"""STL files: binary in either byte order, and text in either case."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import columns_of, text_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners, count_of
from asperity.geometry.mesh.contents import Contents, FilePart, stated_unit

_HEAD, _RECORD = 84, 50
_UNKNOWN = (0, 0xFFFFFFFF)
"""Counts that programs write before they know how many triangles follow."""
_VERTEX = re.compile(r"^[ \t]*vertex[ \t]+([^\n]+)", flags=re.IGNORECASE | re.MULTILINE)
_WORD = re.compile(r"[ \t]+((?:end)?(?:solid|facet|loop)\b|outer\b|vertex\b)", flags=re.IGNORECASE)


def read_stl(path: Path) -> Contents:
    """Return the triangles of an STL file; facet normals and colours are left out."""
    data = content_of(path)
    out = Contents()
    beginning = data[:2000].lstrip(b"\xef\xbb\xbf \t\r\n")
    counted = [int.from_bytes(data[80:84], order) for order in ("little", "big")]
    whole = [len(data) == _HEAD + _RECORD * count for count in counted]
    text = data.startswith((b"\xff\xfe", b"\xfe\xff")) or (
        beginning[:5].lower() == b"solid" and b"\0" not in beginning and not any(whole)
    )
    if text:
        triangles = _text(path, text_of(data), out)
    else:
        triangles = _binary(path, data, counted, whole, out)
        out.unit = stated_unit(data[:80].decode("latin-1"))
    vertices = triangles.reshape(-1, 3)
    if len(vertices):
        faces = np.arange(len(vertices)).reshape(-1, 3)
        out.parts.append(FilePart(Corners(vertices, faces)))
    return out


def _text(path: Path, text: str, out: Contents) -> Array:
    found = _VERTEX.findall(text)
    if not found:  # several of its words stand in a line
        text = _WORD.sub(r"\n\1", text)
        found = _VERTEX.findall(text)
    if not found:
        return np.zeros((0, 3, 3))
    solids, ends = (
        len(re.findall(rf"^\s*{word}\b", text, flags=re.IGNORECASE | re.MULTILINE))
        for word in ("solid", "end[ \t]*solid")
    )
    cut = len(found) % 3 or ends < solids
    if cut and not _is_place(found[-1]):  # within the last of its lines
        found.pop()
    vertices = columns_of(found, (0, 1, 2)) if found else np.zeros((0, 3))
    if vertices is None:
        vertices = columns_of([row.replace(",", ".") for row in found], (0, 1, 2))
        if vertices is None or len(vertices) != len(found):
            wrong = next((row for row in found if not _is_place(row)), found[0]).strip()
            raise AsperityError(f"{path}: a vertex is {wrong[:60]!r}; valid: 3 numbers")
        out.notes.append("its numbers have decimal commas")
    if cut:
        raise AsperityError(
            f"{path}: it is cut short after {count_of(len(vertices), 'vertex', 'vertices')}; "
            "valid: endsolid at its end, three vertices a triangle"
        )
    out.unit = stated_unit(text[:1000])
    return vertices.reshape(-1, 3, 3)


def _is_place(row: str) -> bool:
    found = columns_of([row.replace(",", ".")], (0, 1, 2))
    return found is not None and len(found) == 1


def _binary(path: Path, data: bytes, counted: list[int], whole: list[bool], out: Contents) -> Array:
    order, count = "<", counted[0]
    if whole[1] and not whole[0]:
        order, count = ">", counted[1]
        out.notes.append("its numbers are stored with the highest byte first")
    there = max(len(data) - _HEAD, 0) // _RECORD
    if b"\0" not in data:
        raise AsperityError(f"{path}: it is no STL file: it is text, and does not begin with solid")
    if len(data) < _HEAD:
        raise AsperityError(
            f"{path}: it is cut short: its head needs {_HEAD} bytes, there are {len(data)}"
        )
    if count in _UNKNOWN and there and (len(data) - _HEAD) % _RECORD == 0:
        out.notes.append(f"its head does not count its triangles: {there} follow and are read")
        count = there
    needed = _HEAD + _RECORD * count
    if len(data) < needed:
        raise AsperityError(
            f"{path}: it is cut short: {count} triangles need {needed} bytes, there are {len(data)}"
        )
    if len(data) > needed:
        if count == 0:
            raise AsperityError(
                f"{path}: its head counts 0 triangles, but {len(data) - needed} bytes follow; "
                "valid: a count of the triangles, 50 bytes each"
            )
        out.notes.append(f"{len(data) - needed} bytes behind its last triangle are left out")
    record = np.dtype([("normal", order + "f4", 3), ("at", order + "f4", (3, 3)), ("more", "u2")])
    return np.frombuffer(data, record, count, _HEAD)["at"].astype(np.float64)
