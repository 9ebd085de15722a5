"""Meshes from files, read by trimesh, without its losses.

Vertices are neither merged nor reordered, so texture coordinates stay with their corners; normals
are those of the file, never computed by trimesh; parts of a scene are placed by their transforms.
Also handled: negative indices in OBJ count back from their own line; trimesh splits the vertices of
a PLY with texture coordinates but not its normals, drops texture coordinates in glTF without a
material, and reads compressed glTF as zeros.
"""

from __future__ import annotations

import io
import json
import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import reading
from asperity.errors import AsperityError, require_choice
from asperity.geometry.mesh.checks import UNITS, Corners, check_size, count_of
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays

SUFFIXES = (".obj", ".glb", ".gltf", ".ply", ".stl")
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


def read_mesh(
    path: str | os.PathLike[str],
    *,
    unit: str = "m",
    hard_angle: float | None = None,
    name: str | None = None,
) -> Mesh:
    """Return the mesh in a file: OBJ, GLB, glTF, PLY or STL.

    All geometries of a scene are joined, placed by their transforms; polygons are split into fans
    of triangles. Texture coordinates are used if every geometry has them. Normals (OBJ vn, glTF
    NORMAL, PLY nx, ny, nz) are used if every geometry has them and `hard_angle` is not given; the
    facet normals in STL never are.

    Parameters
    ----------
    path : str or path
        The file.
    unit : {"m", "dm", "cm", "mm", "um", "in", "ft"}
        Unit of length of the file. Most formats do not define it; glTF is in metres.
    hard_angle : float, optional
        As for `mesh_from_arrays` [degrees], 0 to 180. 180 ignores the file's normals. Without it
        and without normals, edges that turn by more than 44 are hard.
    name : str, optional
        By default the file's name without its suffix.

    Returns
    -------
    Mesh
        Its `notes` list what was found in the file.

    Raises
    ------
    AsperityError
        A file that is missing, damaged, of an unknown kind, or without triangles; a size that needs
        another unit; what `mesh_from_arrays` refuses; one line.
    """
    path = Path(os.path.expanduser(path))
    require_choice("unit", unit, UNITS)
    name = path.stem if name is None else name
    parts = _load(path)
    notes = []
    if len(parts) > 1:
        notes.append(f"{len(parts)} geometries put together")
    uv, normals = _of_all(parts, "uv", notes), _of_all(parts, "normals", notes)
    vertices = np.concatenate([part.vertices for part in parts])
    first = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([part.faces + n for part, n in zip(parts, first[:-1], strict=True)])
    _check_unit(name, vertices, faces, unit)
    mesh = mesh_from_arrays(
        vertices * UNITS[unit], faces, uv=uv, normals=normals, hard_angle=hard_angle, name=name
    )
    if normals is not None and hard_angle is None:
        notes.append("the file's normals carry the displacement")
    return Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.uv, name, (*notes, *mesh.notes))


def _check_unit(name: str, vertices: Array, faces: Indices, unit: str) -> None:
    """Raise `AsperityError` for a size that needs another unit."""
    if faces.min() < 0 or faces.max() >= len(vertices):
        return
    used = vertices[faces.ravel()]
    if np.isfinite(used).all() and np.ptp(used, axis=0).any():
        check_size(name, used, unit, of_file=True)


def _of_all(parts: list[Corners], what: str, notes: list[str]) -> Array | None:
    """Return an attribute of the corners of all parts, or None if some parts lack it."""
    values = [getattr(part, what) for part in parts]
    having = [value for value in values if value is not None]
    if len(having) == len(values):
        return np.concatenate(having)
    if having:
        what = "texture coordinates" if what == "uv" else "normals"
        lack = count_of(len(values) - len(having), "geometry", "geometries")
        notes.append(f"{lack} of {len(values)} without {what}: those of the others are left out")
    return None


def _load(path: Path) -> list[Corners]:
    """Return the parts of the file at `path`, at least one."""
    with reading(path, "a mesh", SUFFIXES) as suffix:
        if suffix == ".stl":
            _refuse_cut_short(path)
        parts = list(_parts(path, suffix))
    if not parts:
        _refuse(path, "there are no triangles in it (points or lines only?); valid: one at least")
    return parts


def _refuse(path: Path, reason: str) -> Any:
    raise AsperityError(f"{path}: {reason}") from None


def _refuse_cut_short(path: Path) -> None:
    """Refuse a binary STL file that ends before its last triangle: 84 bytes and 50 for each."""
    data = path.read_bytes()
    if data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000]:
        return  # text
    said = int.from_bytes(data[80:84], "little")
    if len(data) < 84 or len(data) < 84 + 50 * said:
        if data and b"\0" not in data:
            _refuse(path, "it is no STL file: it is text, and does not begin with solid")
        needs = (
            f"{said} triangles need {84 + 50 * said}" if len(data) >= 84 else "its head needs 84"
        )
        _refuse(path, f"it is cut short: {needs} bytes, there are {len(data)}")


def _parts(path: Path, suffix: str) -> Iterator[Corners]:
    """Yield the parts of a file in the frame of the whole."""
    scene = _scene(path, suffix)
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        geometry = scene.geometry[key]
        faces = getattr(geometry, "faces", None)
        if faces is None or len(faces) == 0:
            continue
        uv = getattr(geometry.visual, "uv", None)
        normals = _normals(path, suffix, geometry)
        faces = np.array(faces, dtype=np.int64)
        if uv is not None:
            uv = np.asarray(uv, dtype=np.float64)[faces] if len(uv) else None
        part = Corners(np.array(geometry.vertices, dtype=np.float64), faces, uv, normals)
        yield _placed(part, np.asarray(transform, dtype=np.float64))


def _scene(path: Path, suffix: str, **options: Any) -> Any:
    """Return the file as a trimesh scene without merged vertices."""
    import trimesh  # takes a second to import

    if suffix == ".obj":
        text = _absolute(path.read_text(encoding="utf-8", errors="replace"))
        # `maintain_order=True` would keep one texture coordinate per vertex and break the seams.
        options |= {"skip_materials": True}
        file: Any = io.BytesIO(text.encode())
    elif suffix in (".glb", ".gltf"):
        file = io.BytesIO(_with_materials(path, path.read_bytes()))
        options["resolver"] = trimesh.resolvers.FilePathResolver(str(path))
    else:
        file = io.BytesIO(path.read_bytes())
    return trimesh.load_scene(file, file_type=suffix[1:], process=False, **options)


def _normals(path: Path, suffix: str, geometry: Any) -> Array | None:
    """Return the normals of the corners that the file contains, not computed by trimesh."""
    if suffix == ".stl":
        return None
    if suffix == ".ply":
        # Vertices split at texture seams are in another order than their normals.
        (geometry,) = _scene(path, suffix, fix_texture=False).geometry.values()
    # Computed normals enter this cache too, but only on access.
    if "vertex_normals" not in geometry._cache:
        return None
    return np.asarray(geometry.vertex_normals, dtype=np.float64)[np.asarray(geometry.faces)]


def _placed(part: Corners, transform: Array) -> Corners:
    """Return a part moved by a transform (4, 4), which may mirror or shear it."""
    if np.array_equal(transform, np.eye(4)):
        return part
    matrix = transform[:3, :3]
    vertices = part.vertices @ matrix.T + transform[:3, 3]
    # The cofactor matrix is the inverse transpose up to a factor, and needs no inverse.
    cofactors = np.cross(np.roll(matrix, -1, axis=0), np.roll(matrix, -2, axis=0))
    mirrored = np.linalg.det(matrix) < 0.0
    faces, uv, normals = part.faces, part.uv, part.normals
    if normals is not None:
        normals = normals @ (-cofactors.T if mirrored else cofactors.T)
    if mirrored:
        faces = faces[:, ::-1]
        uv = None if uv is None else uv[:, ::-1]
        normals = None if normals is None else normals[:, ::-1]
    return Corners(vertices, faces, uv, normals)


def _absolute(text: str) -> str:
    """Return the text of an OBJ file with relative indices made absolute."""
    if not re.search(r"^f[^\n]*[ /]-\d", text, flags=re.MULTILINE):
        return text
    seen = {"v": 0, "vt": 0, "vn": 0}
    lines = []
    for line in text.replace("\\\n", " ").split("\n"):
        key, *words = line.split() or [""]
        if key in seen:
            seen[key] += 1
        if key == "f":
            corners = []
            for word in words:
                fields = zip(word.split("/"), seen.values(), strict=False)
                absolute = (str(int(i) + n + 1) if i.startswith("-") else i for i, n in fields)
                corners.append("/".join(absolute))
            line = " ".join(["f", *corners])
        lines.append(line)
    return "\n".join(lines)


def _with_materials(path: Path, data: bytes) -> bytes:
    """Return a GLB or glTF file in which every primitive has a material; refuse compressed ones.

    trimesh reads texture coordinates only with a material.
    """
    binary = data[:4] == b"glTF"
    if binary:
        (size,) = struct.unpack("<I", data[12:16])
        text, rest = data[20 : 20 + size], data[20 + size :]
    else:
        text, rest = data, b""
    tree = json.loads(text)
    wrong = [e for e in tree.get("extensionsRequired", []) if e in _COMPRESSED]
    if wrong:
        _refuse(path, f"it is compressed ({', '.join(wrong)}); valid: exported uncompressed")
    bare = [
        primitive
        for mesh in tree.get("meshes", [])
        for primitive in mesh.get("primitives", [])
        if "material" not in primitive
    ]
    if not bare:
        return data
    tree.setdefault("materials", []).append({})
    for primitive in bare:
        primitive["material"] = len(tree["materials"]) - 1
    text = json.dumps(tree).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I", len(text)) + b"JSON" + text + rest
