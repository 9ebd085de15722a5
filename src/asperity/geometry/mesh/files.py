"""Meshes from files: OBJ, GLB, glTF, PLY, STL, OFF, 3MF and USD, some of them packed.

Vertices are neither merged nor reordered, so texture coordinates stay with their corners; normals
are those of the file; parts of a scene are placed by their transforms. What a file states of itself
is read: its unit, its materials. What of it is left out is noted.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import find_named, reading, text_of
from asperity._core.unpacking import content_of, stem_and_ending, suffix_of, unzipped
from asperity.errors import AsperityError, require_choice
from asperity.geometry.mesh.checks import UNITS, Corners, check_size, count_of, extents_of
from asperity.geometry.mesh.contents import Contents, FilePart, coarse_note
from asperity.geometry.mesh.gltf import read_gltf
from asperity.geometry.mesh.gltf_file import GltfFile
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.obj import library_names, read_obj
from asperity.geometry.mesh.off import read_off
from asperity.geometry.mesh.ply import read_ply
from asperity.geometry.mesh.stl import read_stl
from asperity.geometry.mesh.threemf import read_3mf
from asperity.geometry.mesh.usd import USD_SUFFIXES, read_usd, usd_layers

_READERS = {
    ".obj": read_obj, ".glb": read_gltf, ".gltf": read_gltf, ".ply": read_ply, ".stl": read_stl,
    ".off": read_off, ".3mf": read_3mf, **dict.fromkeys(USD_SUFFIXES, read_usd),
}  # fmt: skip
PACKED = (".obj", ".glb", ".gltf", ".ply", ".stl", ".off")
"""Suffixes that may have `.gz` behind them."""
SUFFIXES = (*_READERS, ".zip")


def read_mesh(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    hard_angle: float | None = None,
    name: str | None = None,
) -> Mesh:
    """Return the mesh in a file: OBJ, GLB, glTF, PLY, STL, OFF, 3MF, or USD (`asperity[usd]`).

    OBJ, PLY, STL, OFF and glTF may be packed by gzip; a zip holds one mesh, and the files that it
    names.

    All geometries of a scene are joined, placed by their transforms; polygons are split into fans
    of triangles. Texture coordinates are used if every geometry has them. Normals (OBJ vn, glTF
    NORMAL, PLY nx, ny, nz) are used if every geometry has them and `hard_angle` is not given; the
    facet normals in STL never are.

    Parameters
    ----------
    path : str or path
        The file.
    unit : {"m", "dm", "cm", "mm", "um", "in", "ft"}, optional
        Unit of length of the file; by default the one that it states, else m. Most formats do not
        define it; glTF is in metres.
    hard_angle : float, optional
        As for `mesh_from_arrays` [degrees], 0 to 180. 180 ignores the file's normals. Without it
        and without normals, edges that turn by more than 44 are hard.
    name : str, optional
        By default the file's name without its suffix.

    Returns
    -------
    Mesh
        Its `notes` list what was found in the file, its `materials` the pictures that it names.

    Raises
    ------
    AsperityError
        A file that is missing, damaged, of an unknown kind, or without triangles; a size that needs
        another unit; what `mesh_from_arrays` refuses; one line.
    """
    path = Path(os.path.expanduser(path))
    if unit is not None:
        unit = require_choice("unit", unit, UNITS)
    contents = read_contents(path)
    return mesh_of(path, contents, unit=unit, hard_angle=hard_angle, name=name)


def mesh_of(
    path: Path, contents: Contents, *, unit: str | None, hard_angle: float | None,
    name: str | None = None,
) -> Mesh:  # fmt: skip
    """Return the mesh of what a file holds; parameters as for `read_mesh`."""
    name = stem_and_ending(path)[0] if name is None else name
    parts = [part.corners for part in contents.parts]
    notes = list(contents.notes)
    if len(parts) > 1:
        notes.append(f"{len(parts)} geometries put together")
    unit = _unit(path, contents, unit, notes)
    parts = _with_uv(parts, contents, notes)
    uv, normals = _of_all(parts, "uv", notes), _of_all(parts, "normals", notes)
    vertices = np.concatenate([part.vertices for part in parts])
    first = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([part.faces + n for part, n in zip(parts, first[:-1], strict=True)])
    _check_unit(name, vertices, faces, unit)
    materials, numbers = _used(contents)
    is_whole = faces.min() >= 0 and faces.max() < len(vertices)
    used = np.unique(faces)
    coarse = coarse_note(vertices[used], UNITS[unit]) if is_whole else None
    if is_whole and len(used) < len(vertices) and np.isfinite(vertices[used]).all():
        vertices[~np.isin(np.arange(len(vertices)), used)] = 0.0  # scanners have NaN there
    try:
        mesh = mesh_from_arrays(
            vertices * UNITS[unit], faces, uv=uv, normals=normals, hard_angle=hard_angle,
            name=name, material=np.repeat(numbers, [len(part.faces) for part in parts]),
        )  # fmt: skip
    except AsperityError as error:
        raise AsperityError(f"{error}; {coarse}" if coarse else str(error)) from None
    if coarse is not None:
        notes.append(coarse)
    if normals is not None and hard_angle is None:
        notes.append("the file's normals carry the displacement")
    materials = tuple(_in_metres(material, UNITS[unit]) for material in materials)
    return replace(mesh, notes=(*notes, *mesh.notes), materials=materials, up=contents.up or "")


def read_contents(path: Path) -> Contents:
    """Return the parts and materials of a mesh file, in its own unit; at least one part."""
    with reading(path, "a mesh", SUFFIXES, packed=PACKED) as suffix:
        if suffix == ".zip":
            return _contents_of_zip(path)
        contents = _READERS[suffix](path)
    if not contents.parts:
        why = "; ".join(contents.notes)[:150] or "points or lines only?"
        raise AsperityError(f"{path}: there are no triangles in it ({why}); valid: one at least")
    contents.parts = [_laid(part, contents) for part in contents.parts]
    return contents


def _contents_of_zip(path: Path) -> Contents:
    folder = unzipped(path)
    try:
        return read_contents(mesh_file(path))
    except AsperityError as error:  # of the mesh within
        raise AsperityError(str(error).replace(str(folder), str(path))) from None


def mesh_file(path: Path) -> Path:
    """Return the file of a mesh: as it is, or the only mesh in a zip, unpacked.

    Raises
    ------
    AsperityError
        A zip of several meshes, or of none; one line with their names.
    """
    if path.suffix.lower() != ".zip":
        return path
    folder = unzipped(path)
    files = [file.relative_to(folder) for file in sorted(folder.rglob("*")) if file.is_file()]
    shown = [file for file in files if not file.parts[0].startswith(("__MACOSX", "."))]
    meshes = [file for file in shown if suffix_of(file, PACKED) in _READERS]
    if len(meshes) != 1:
        held = f"{len(meshes)} meshes" if meshes else "no mesh"
        names = ", ".join(map(str, meshes or shown))[:160]
        raise AsperityError(
            f"{path}: there is {held} in it ({names}); valid: one of {', '.join(_READERS)}"
        )
    return folder / meshes[0]


def companions(path: Path) -> list[Path]:
    """Return the files that a mesh file names and that lie beside or below it.

    Buffers and pictures of glTF, material libraries of OBJ; none for a file that cannot be read.
    """
    suffix = suffix_of(path, PACKED)
    named: list[Path] = []
    try:
        if suffix == ".gltf":
            named = GltfFile(path).files()
        elif suffix in USD_SUFFIXES:
            named = usd_layers(path)
        elif suffix == ".obj":
            text = text_of(content_of(path))
            lines = re.findall(r"^\s*mtllib\s+(.+?)\s*$", text, flags=re.MULTILINE)
            names = [name for line in lines for name in library_names(path.parent, line)]
            named = [find_named(path.parent, name) for name in names]
    except (AsperityError, OSError):
        return []
    below = [file for file in named if file.is_file() and ".." not in file.parts]
    return [file for file in dict.fromkeys(below) if file.is_relative_to(path.parent)]


def _laid(part: FilePart, contents: Contents) -> FilePart:
    """Return a part with its texture coordinates as its material lays its pictures."""
    if part.material < 0 or part.corners.uv is None:
        return part
    material = contents.materials[part.material]
    (scale, offset) = placing = material.placing
    if placing == type(placing)():
        return part
    note = f"texture coordinates of material {material.name!r} times {scale} plus {offset} (-s, -o)"
    if note not in contents.notes:
        contents.notes.append(note)
    return FilePart(part.corners._replace(uv=part.corners.uv * scale + offset), part.material)


def _in_metres(material: Material, metres: float) -> Material:
    """Return a material whose heights, in the file's unit, are in metres."""
    maps = {}
    for kind, picture in material.maps.items():
        relief = None if picture.height_range is None else picture.height_range * metres
        maps[kind] = picture._replace(height_range=relief, low=picture.low * metres)
    return replace(material, maps=maps)


def _with_uv(parts: list[Corners], contents: Contents, notes: list[str]) -> list[Corners]:
    """Return the parts; if maps can be felt on others, those that have none get coordinates of 0.

    A texture of all would be smooth there, and the maps of the others are not lost.
    """
    felt = [
        part.material >= 0 and contents.materials[part.material].felt is not None
        for part in contents.parts
    ]
    bare = [part.uv is None for part in parts]
    if not any(bare) or not any(felt) or any(b and f for b, f in zip(bare, felt, strict=True)):
        return parts
    lack = count_of(sum(bare), "geometry", "geometries")
    notes.append(f"{lack} of {len(parts)} without texture coordinates, and without maps: smooth")
    return [
        part._replace(uv=np.zeros((*part.faces.shape, 2))) if part.uv is None else part
        for part in parts
    ]


def _used(contents: Contents) -> tuple[tuple[Material, ...], list[int]]:
    """Return the materials that parts have, no two of one name, and the number of each part's."""
    used = sorted({part.material for part in contents.parts if part.material >= 0})
    places = {number: place for place, number in enumerate(used)}
    names: list[str] = []
    for number in used:
        name, count = contents.materials[number].name, 1
        while name in names:
            count += 1
            name = f"{contents.materials[number].name}-{count}"
        names.append(name)
    materials = tuple(
        replace(contents.materials[number], name=name)
        for number, name in zip(used, names, strict=True)
    )
    return materials, [places.get(part.material, -1) for part in contents.parts]


def _unit(path: Path, contents: Contents, unit: str | None, notes: list[str]) -> str:
    """Return the unit of length: as given, or else as the file states, or else metres."""
    stated = contents.unit
    gltf = suffix_of(path, PACKED) in (".glb", ".gltf")
    if unit is None:
        if stated is not None and not gltf:
            notes.append(f"its unit is {stated}, as it states")
        return stated or "m"
    if stated is not None and stated != unit:
        stated_by = "glTF is in m" if gltf else f"it states that its unit is {stated}"
        notes.append(f"{stated_by}, but it is read in {unit}, as unit= asks")
    return unit


def _check_unit(name: str, vertices: Array, faces: Indices, unit: str) -> None:
    """Raise `AsperityError` for a size that needs another unit."""
    if faces.min() < 0 or faces.max() >= len(vertices):
        return
    used = vertices[faces.ravel()]
    if np.isfinite(used).all() and extents_of(used).any():
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
