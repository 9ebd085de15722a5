"""The maps that a mesh brings: of its material, or beside it by their names.

A displacement or normal map becomes the texture that is felt. What is only seen, or cannot be used,
is noted.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.files import reading
from asperity._core.kernels import cache_folder
from asperity._core.unpacking import stem_and_ending
from asperity.errors import AsperityError
from asperity.geometry.mesh.files import mesh_file
from asperity.geometry.mesh.map_names import maps_by_name
from asperity.geometry.mesh.materials import FELT, SEEN, MapImage, Material
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import crosses
from asperity.scene.mesh import has_area
from asperity.texture.files.colours import unit_vectors
from asperity.texture.files.images import IMAGE_SUFFIXES, read_pixels
from asperity.texture.files.normal_channels import normal_vectors

_FLATTEST = 1e-4
"""RMS slope under which a normal map is flat."""


def own_textures(
    path: Path, mesh: Mesh, notes: list[str]
) -> dict[str, tuple[dict[str, Any], Mapping[str, MapImage]]]:
    """Return the texture tables of the maps that a mesh's file brings, and its maps.

    By name of the material that has them, or "" for the whole mesh.

    Parameters
    ----------
    path : Path
        The mesh's file.
    mesh : Mesh
    notes : list of str
        Gets notes on what is used and what is not.
    """
    path = mesh_file(path)
    files, stem = list(path.parent.iterdir()), stem_and_ending(path)[0]
    found = {
        material.name: dict(material.maps) if material.felt else _beside(files, material)
        for material in mesh.materials
    }
    found = {name: maps for name, maps in found.items() if any(kind in maps for kind in FELT)}
    if not found:
        maps = maps_by_name(files, stem)
        found = {"": maps} if any(kind in maps for kind in FELT) else {}
    elif len(mesh.materials) == 1 and mesh.material is not None and mesh.material.min() >= 0:
        found = {"": next(iter(found.values()))}
    if not found and (unused := _unused(files, stem, mesh)):
        notes.append(f"pictures beside it that are not used: {', '.join(unused)[:160]}")
    if mesh.uv is None and found:
        names = [picture.name for maps in found.values() for picture in maps.values()]
        notes.append(
            "it has no texture coordinates, so its maps are not used: " + ", ".join(names)[:200]
        )
        return {}
    out: dict[str, tuple[dict[str, Any], Mapping[str, MapImage]]] = {}
    for name, maps in found.items():
        own: list[str] = []
        table = None
        if has_area(part_of(mesh, name)):
            table = texture_of(maps, own)
        else:
            own.append(
                "its texture coordinates cover no area, so its maps are not used: "
                + ", ".join(picture.name for picture in maps.values())[:200]
            )
        notes += [f"material {name!r}: {note}" for note in own] if name else own
        if table is not None:
            out[name] = table, maps
    smooth = [material.name for material in mesh.materials if material.name not in out]
    if out and "" not in out and smooth:
        notes.append(f"smooth, since no map is there for them: {', '.join(smooth)[:200]}")
    return out


def _unused(files: list[Path], stem: str, mesh: Mesh) -> list[str]:
    """Return the pictures beside a mesh with its name in theirs that no material names."""
    named = {m.name for material in mesh.materials for m in material.maps.values()}
    return [
        file.name
        for file in sorted(files)
        if file.suffix.lower() in IMAGE_SUFFIXES
        and stem.lower() in file.stem.lower()
        and file.name not in named
    ]


def part_of(mesh: Mesh, name: str) -> Mesh:
    """Return the triangles of a material, or the whole mesh for ""."""
    if not name or mesh.material is None:
        return mesh
    which = mesh.material == [material.name for material in mesh.materials].index(name)
    uv = None if mesh.uv is None else mesh.uv[which]
    return replace(
        mesh, faces=mesh.faces[which], normals=mesh.normals[which], uv=uv,
        material=mesh.material[which],
    )  # fmt: skip


def _beside(files: list[Path], material: Material) -> dict[str, MapImage]:
    """Return maps beside a mesh by their names: those of a material's picture of colours."""
    colour = material.maps.get("colour")
    stem = _common(colour.path.stem) if colour is not None and colour.path is not None else ""
    return maps_by_name(files, stem) if stem else {}


def _common(stem: str) -> str:
    """Return a name of a picture without the last word, which states what it shows."""
    for mark in ("_", "-", "."):
        if mark in stem:
            return stem.rpartition(mark)[0]
    return ""


def texture_of(maps: Mapping[str, MapImage], notes: list[str]) -> dict[str, Any] | None:
    """Return the texture table of maps, None if none that can be felt is there.

    Parameters
    ----------
    maps : mapping of str to MapImage
        By kind.
    notes : list of str
        Gets notes on what is used and what is not.
    """
    for lost in FELT:
        if lost in maps and not maps[lost].is_there:
            notes.append(f"its {lost} map {maps[lost].name} is not there")
        elif lost in maps and Path(maps[lost].name).suffix.lower() not in IMAGE_SUFFIXES:
            notes.append(
                f"its {lost} map {maps[lost].name} is not used: of a kind that is not read; "
                f"valid: {', '.join(IMAGE_SUFFIXES)}"
            )
    usable = [k for k in FELT if k in maps and maps[k].is_there]
    usable = [k for k in usable if Path(maps[k].name).suffix.lower() in IMAGE_SUFFIXES]
    kind = usable[0] if usable else None
    if kind is None:
        return None
    picture = maps[kind]
    path = _file_of(picture)
    table: dict[str, Any] = {"file": str(path.absolute()), "mapping": "uv"}
    if kind == "bump" and _holds_normals(path):  # as some programs export normal maps
        kind = "normal"
    if kind == "normal":
        table["kind"] = "normal"
        if picture.scale != 1.0:
            notes.append(f"{picture.name}: its scale of {picture.scale:.4g} is not used")
    elif picture.height_range is not None and picture.height_range != 0.0:
        table["height_range"] = abs(picture.height_range)
        table["invert"] = picture.height_range < 0.0
        if picture.low != 0.0:
            notes.append(f"{picture.name}: the height of black, {picture.low:.4g} m, is not used")
    others = [f"{maps[k].name} ({k})" for k in (*FELT, *SEEN) if k in maps and maps[k] != picture]
    rest = f"; only seen, or not used: {', '.join(others)}" if others else ""
    notes.append(f"its own {kind} map is the texture: {picture.name}{rest}")
    return table


def seen_colour(mesh: Mesh, maps: Mapping[str, MapImage], notes: list[str]) -> str | None:
    """Return the colour in which a mesh is shown, as MJCF has it; None if it states none.

    It is that of its materials, weighted by their areas: the material's colour times the mean of
    its picture of colours.
    """
    alone = mesh.materials if len(mesh.materials) > 1 else [*mesh.materials, Material("")][:1]
    colours, weights = [], []
    area = np.linalg.norm(crosses(mesh.vertices[mesh.faces]), axis=1)
    for number, material in enumerate(alone):
        extra = maps if len(alone) == 1 else {}
        colour = _colour(material, extra.get("colour") or material.maps.get("colour"), notes)
        which = mesh.material == number if len(alone) > 1 else np.ones(len(area), dtype=bool)
        if colour is not None:
            colours.append(colour)
            weights.append(float(area[which].sum()))
    return _rgba(np.average(colours, axis=0, weights=weights)) if colours else None


def _colour(material: Material, picture: MapImage | None, notes: list[str]) -> Array | None:
    """Return the mean colour of a material (3,), 0 to 1; None if it states none."""
    own = None if material.colour is None else np.asarray(material.colour)
    if picture is None or not picture.is_there:
        return own
    try:
        pixels = _pixels(_file_of(picture))
    except AsperityError:
        notes.append(f"its picture of colours cannot be read: {picture.name}")
        return None
    most = np.iinfo(pixels.dtype).max if pixels.dtype.kind in "ui" else 1.0
    mean = pixels.reshape(*pixels.shape[:2], -1)[..., :3].mean(axis=(0, 1)) / most
    notes.append(f"it is shown in the mean colour of {picture.name}")
    return np.clip((np.ones(3) if own is None else own) * mean, 0.0, 1.0)


def _rgba(colour: Any) -> str:
    return " ".join(f"{float(x):.3g}" for x in colour) + " 1"


def range_from_normals(
    maps: Mapping[str, MapImage], table: Mapping[str, Any], pixel_size: tuple[float, float],
    notes: list[str],
) -> float | None:  # fmt: skip
    """Return the height range of a displacement map that its normal map calls for [m].

    The root mean square slopes of both are the same.

    Parameters
    ----------
    maps : mapping of str to MapImage
    table : mapping
        The texture table of the displacement map.
    pixel_size : (pu, pv)
        Of the displacement map [m].
    notes : list of str
        Gets a note on a normal map that cannot be read.
    """
    normal = maps.get("normal")
    if normal is None or not normal.is_there:
        return None
    try:
        colours, heights = _pixels(_file_of(normal)), _pixels(Path(table["file"]))
    except AsperityError as error:
        reason = str(error).partition(normal.name)[2].lstrip(": ") or "it cannot be read"
        notes.append(f"the relief is not found from {normal.name}: {reason}")
        return None
    if colours.ndim != 3 or colours.shape[2] < 3:
        return None
    (vectors, said), heights = normal_vectors(colours), heights.astype(np.float64)
    if said == "-":
        notes.append(f"the relief is not found from {normal.name}: its colours are no normals")
        return None
    if heights.ndim == 3:
        heights = heights[..., 0]
    if np.ptp(heights) == 0.0:
        return None
    slopes = vectors[..., :2] / np.maximum(vectors[..., 2:], 0.05)
    of_normals = float(np.sqrt(np.mean(np.sum((slopes - slopes.mean(axis=(0, 1))) ** 2, axis=2))))
    shares = heights / np.ptp(heights)
    along = [np.diff(shares, axis=axis) / pixel_size[1 - axis] for axis in (0, 1)]
    of_heights = float(np.sqrt(sum(np.mean(step**2) for step in along)))
    if of_normals < _FLATTEST or of_heights == 0.0:
        return None
    return of_normals / of_heights


def _file_of(picture: MapImage) -> Path:
    """Return the file of a picture; one within a mesh's file is kept in the user's cache folder."""
    if picture.path is not None:
        return picture.path
    name = hashlib.sha256(picture.data).hexdigest()[:24]
    path = cache_folder().parent / "pictures" / name / (Path(picture.name).name or "picture.png")
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture.data)
    return path


def _holds_normals(path: Path) -> bool:
    """Return whether a picture holds unit normals."""
    try:
        pixels = _pixels(path)
    except AsperityError:
        return False
    return pixels.ndim == 3 and pixels.shape[2] >= 3 and unit_vectors(pixels)[1] != "-"


def _pixels(path: Path) -> NDArray[Any]:
    """Return the pixels of a picture; raise `AsperityError` if it cannot be read."""
    with reading(path, "an image", IMAGE_SUFFIXES):
        return read_pixels(path)[0]
