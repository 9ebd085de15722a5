"""Baking: from a scan to a haptic object.

    mesh --> simplify --> unwrap --> cast rays --> heights --> scene
    (full)   (low-res)    (UV)       (low -> full)  (texture)   (folder)

The low-resolution mesh is written and read back before rays are cast, so heights refer to exactly
the surface that the renderer will displace. Finally the scene is read back as well: no folder that
cannot be loaded is left behind.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Mask
from asperity._core.output import result_folder, write_json
from asperity.baking.cloud import map_of_points
from asperity.baking.error import BakeError, bake_error, plate_error, statistics
from asperity.baking.folder import HEIGHTS, OBJECT, Texture, write_heights, write_mesh, write_scene
from asperity.baking.heights import bake_heights
from asperity.baking.picture import draw_bake
from asperity.baking.place import stroke_over
from asperity.baking.plate import HARD_ANGLE, plate_of
from asperity.baking.points import read_points
from asperity.baking.rays import FullSurface
from asperity.baking.simplify import simplified
from asperity.baking.sources import guessed_unit, kind_of, mesh_to_bake
from asperity.baking.unwrap import texture_span, unwrapped
from asperity.errors import AsperityError, require_choice
from asperity.geometry.convex.pieces import convex_pieces
from asperity.geometry.mesh.checks import UNITS, length
from asperity.geometry.mesh.contents import coarse_note
from asperity.geometry.mesh.mesh import Mesh
from asperity.scene.scene import Scene, read_scene
from asperity.texture.files.points import on_grid
from asperity.texture.height_field import HeightField

Progress = Callable[[str, float], None]
SMALLEST, LARGEST = 32, 8192
"""Smallest and largest texture [texels a side]."""
FEWEST = 4
_FAR = 10.0
"""Distance from the origin beyond which a mesh is moved there, in its sizes."""
SMOOTH = 180.0
"""`hard_angle` of a baked mesh [degrees]: heights are along normals that triangles share."""
_SHARES = {"read": 0.03, "simplify": 0.06, "unwrap": 0.05, "rays": 0.35, "error": 0.15,
           "pieces": 0.2, "scene": 0.04, "picture": 0.12}  # fmt: skip
"""Approximate share of the time of each stage, for the progress bar."""


@dataclass(frozen=True, eq=False)
class BakeResult:
    """Result of `bake`.

    Attributes
    ----------
    folder : Path
    report : dict
        Contents of `bake.json`.
    scene : Scene
    """

    folder: Path
    report: dict[str, Any]
    scene: Scene


def bake(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    faces: int = 500,
    size: int = 1024,
    unit: str | None = None,
    up: str | None = None,
    base: str | os.PathLike[str] | None = None,
    pixel_size: float | None = None,
    height_range: float | None = None,
    kind: str = "height",
    colour: str | None = None,
    nodata: float | None = None,
    picture: bool = True,
    overwrite: bool = False,
    on_progress: Progress | None = None,
) -> BakeResult:
    """Make a haptic object of a scan: a mesh of few triangles and a texture of heights.

    A mesh is simplified, unwrapped, and compared with the original along the interpolated unit
    vertex normals of the simplified mesh, along which the renderer displaces it. A height map
    becomes a plate that carries it unchanged; points that cover one side of an object are first
    converted to a height map.

    Parameters
    ----------
    source : path
        A mesh (OBJ, GLB, glTF, PLY, STL, 3MF), points (PLY without faces, XYZ), or a height map
        (an image, an array, an instrument's file).
    out : path
        Folder to create.
    faces : int
        Triangles of the simplified mesh, from 4 to the number in the source. It has more if fewer
        would open it; the notes report that.
    size : int
        Texels along each side of the texture, 32 to 8192.
    unit : {"m", "dm", "cm", "mm", "um", "in", "ft"}, optional
        Unit of length of the file. By default it is guessed, and the guess is noted.
    up : {"x", "y", "z"}, optional
        Axis of the file that points upwards, towards the probe; by default z, for glTF y. In the
        baked object it is z.
    base : path, optional
        Low-resolution mesh to use instead of simplification, in the same unit and frame. Its
        texture coordinates are kept if they do not overlap.
    pixel_size, height_range : float, optional
        Of height maps whose file does not contain them [m], as for `HeightField.from_file`.
    kind, colour, nodata
        What a height map holds, as for `HeightField.from_file`: heights or normals; what its
        colours mean; which value is a missing one.
    picture : bool
        Whether to draw `picture.png`.
    overwrite : bool
        Whether files in `out` may be replaced.
    on_progress : callable, optional
        Called with the name of the stage and the share of the whole work that is done, 0 to 1.

    Returns
    -------
    BakeResult

    Raises
    ------
    AsperityError
        Input that cannot be baked, a value out of range, a package that is not installed, a
        folder that cannot be written; one line.

    Examples
    --------
    >>> baked = asperity.bake("scan.ply", "rock", faces=500, size=1024, unit="mm")
    >>> baked.report["error_um"]["rms"]
    >>> asperity.Simulation(baked.scene).run()
    """
    source = Path(os.path.expanduser(source))
    began = time.perf_counter()
    _check(faces, size)
    if unit is not None:
        unit = require_choice("unit", unit, UNITS)
    file_kind = kind_of(source)
    given = {"pixel_size": pixel_size, "height_range": height_range, "kind": kind,
             "colour": colour, "nodata": nodata}  # fmt: skip
    of_map = [name for name, value in given.items() if value not in (None, "height")]
    if of_map and file_kind != "heights":
        raise AsperityError(f"{source}: {', '.join(of_map)}: for height maps; leave it out")
    stages = _Stages(on_progress)
    with result_folder(Path(out), overwrite=overwrite) as folder:
        if file_kind == "mesh":
            work = _mesh(source, faces, size, unit, up, base, folder, stages)
        else:
            for name, value in (("base", base), ("up", up)):
                if value is not None:
                    raise AsperityError(f"{source}: {name}= is for meshes; leave it out")
            work = _plate(source, file_kind, size, unit, given, folder, stages)
        stages.at("pieces")
        pieces = convex_pieces(work.low)
        stages.at("scene")
        stroke = stroke_over(FullSurface(work.full), work.full)
        write_scene(source.stem, work.low, pieces, work.texture, stroke, folder, work.hard_angle)
        scene = read_scene(folder)
        stages.at("picture")
        report = work.report | {"pieces": len(pieces)}
        if picture:
            body = next(body for body in scene.bodies if body.name == OBJECT)
            draw_bake(work.full, body, report, folder / "picture.png", rough=work.rough)
        report["seconds"] = round(time.perf_counter() - began, 3)
        write_json(folder / "bake.json", report)
        stages.at("done")
    return BakeResult(Path(out), report, read_scene(Path(out)))


@dataclass(frozen=True, eq=False)
class _Work:
    """State of the work before the convex pieces are made."""

    full: Array
    low: Mesh
    texture: Texture
    report: dict[str, Any]
    hard_angle: float
    """Of the edges of `low` [degrees]: heights are along its normals."""
    rough: Mask | None = None
    """Triangles of `low` that represent `full`; None: all."""


class _Stages:
    """Progress over all stages, reported to a callback."""

    def __init__(self, on_progress: Progress | None) -> None:
        self._report, self._stage, self._before = on_progress, "", 0.0

    def at(self, stage: str) -> None:
        """Begin a stage."""
        self._before += _SHARES.get(self._stage, 0.0)
        self._stage = stage
        self.done(0.0)

    def done(self, share: float) -> None:
        """Report the share of this stage that is done, 0 to 1."""
        if self._report is not None:
            whole = self._before + share * _SHARES.get(self._stage, 0.0)
            self._report(self._stage, 1.0 if self._stage == "done" else min(whole, 1.0))


def _check(faces: int, size: int) -> None:
    if not isinstance(faces, int) or faces < FEWEST:
        raise AsperityError(f"faces must be a whole number from {FEWEST}, got {faces!r}")
    if not isinstance(size, int) or not SMALLEST <= size <= LARGEST:
        raise AsperityError(f"size must lie between {SMALLEST} and {LARGEST} texels, got {size!r}")


def _mesh(
    source: Path, faces: int, size: int, unit: str | None, up: str | None, base: Any,
    folder: Path, stages: _Stages,
) -> _Work:  # fmt: skip
    """Bake a mesh."""
    stages.at("read")
    mesh, unit, guesses = mesh_to_bake(source, unit, up)
    low_base = None
    if base is not None:
        low_base = _base(Path(os.path.expanduser(base)), mesh, unit, up)
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    if np.abs(middle).max() > _FAR * np.ptp(mesh.vertices, axis=0).max():
        # Files of the result have nine digits.
        mesh = replace(mesh, vertices=mesh.vertices - middle)
        if low_base is not None:
            low_base = replace(low_base, vertices=low_base.vertices - middle)
        far = length(float(np.abs(middle).max()))
        guesses = (*guesses, f"it lies {far} from the origin: moved there")
    full = mesh.vertices[mesh.faces]
    if base is None and faces > len(mesh.faces):
        raise AsperityError(
            f"{source}: faces = {faces}, but the mesh has {len(mesh.faces)} triangles; "
            f"valid: {FEWEST} to {len(mesh.faces)}"
        )
    FullSurface(full[:1])  # fails early if embreex is not installed
    stages.at("simplify")
    low = simplified(mesh, faces) if low_base is None else low_base
    stages.at("unwrap")
    laid = unwrapped(low, size)
    low = write_mesh(laid, folder, SMOOTH)
    stages.at("rays")
    baked = bake_heights(low, full, size, on_progress=stages.done)
    if baked.coverage == 0.0:
        raise AsperityError(f"{source}: no line from the low-resolution mesh meets the full one")
    span = texture_span(low)
    texture = Texture(baked.heights, (span, span))
    write_heights(texture, folder)
    stages.at("error")
    field = HeightField(baked.heights, span / size)
    error = bake_error(low, field, full)
    notes = [*guesses, *(f"full mesh: {note}" for note in mesh.notes), *laid.notes]
    if baked.mended:
        notes.append(f"{baked.mended} texels stood out of all round them and were mended")
    report = _report(source, "mesh", len(mesh.faces), low, texture, notes) | {
        "coverage": round(baked.coverage, 6),
        "error_um": _in_micrometres(error),
        "closed": not any("open" in note for note in laid.notes),
        "texel_um": round(1e6 * span / size, 3),
    }
    return _Work(full, low, texture, report, SMOOTH)


def _base(path: Path, mesh: Mesh, unit: str, up: str | None) -> Mesh:
    """Return the given low-resolution mesh, in metres."""
    low, _, _ = mesh_to_bake(path, unit, up)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    for end in (np.min, np.max):
        if np.abs(end(low.vertices, axis=0) - end(mesh.vertices, axis=0)).max() > 0.25 * size:
            raise AsperityError(
                f"{path}: it does not lie where the full mesh does; valid: the same unit and frame"
            )
    return low


def _plate(
    source: Path, kind: str, size: int, unit: str | None, given: dict[str, Any], folder: Path,
    stages: _Stages,
) -> _Work:  # fmt: skip
    """Bake a height map or points to a plate."""
    stages.at("read")
    notes: list[str] = []
    left_out = None
    if kind == "points":
        points = read_points(source)
        notes += points.notes
        unit = unit or points.unit
        if unit is None:
            unit, guesses = guessed_unit(np.ptp(points.places, axis=0))
            notes += guesses
        elif unit == points.unit:
            notes.append(f"its unit is {unit}, as it states")
        coarse = coarse_note(points.places, UNITS[unit])
        if coarse is not None:
            notes.append(coarse)
        field, left_out = _map_of(points.places * UNITS[unit], size)
    else:
        if unit is not None:
            raise AsperityError(f"{source}: unit= is for meshes and points; valid: pixel_size=")
        missing = "fill" if given["kind"] == "height" else "refuse"
        field = HeightField.from_file(source, **given, missing=missing)
    notes += field.notes
    mesh, texture = plate_of(field, source.stem)
    low = write_mesh(mesh, folder, HARD_ANGLE)
    write_heights(texture, folder)
    error = plate_error(low, folder / HEIGHTS, texture, field)
    if left_out is not None:
        error = statistics(left_out)
    # The map as triangles between samples, for the picture.
    full = _map_triangles(field)
    report = _report(source, "plate", len(full), low, texture, notes) | {
        "coverage": 1.0,
        "error_um": _in_micrometres(error),
        "closed": False,
        "texel_um": round(1e6 * field.pixel_size[0], 3),
    }
    return _Work(full, low, texture, report, HARD_ANGLE, np.arange(len(low.faces)) < 2)


def _map_of(points: Array, size: int) -> tuple[HeightField, Array | None]:
    """Return a height map of points, and its error at points left out; None on a full grid."""
    grid = on_grid(*points.T)
    if grid is not None and np.isfinite(grid.values).all() and min(grid.values.shape) >= FEWEST:
        notes = [grid.note, "it is used as it is, and not levelled"]
        return HeightField(grid.values, grid.pixel_size, "clamp", notes), None
    field, left_out = map_of_points(points, size=size)
    return field, left_out


def _map_triangles(field: HeightField) -> Array:
    """Return the samples of a height map as triangles, in the plate's frame."""
    step = max(1, int(np.ceil(max(field.samples.shape) / 700)))
    heights = field.samples[::step, ::step] - field.lowest
    u, v = (
        (np.arange(0, n, step) + 0.5) * p - 0.5 * s
        for n, p, s in zip(field.samples.shape[::-1], field.pixel_size, field.size, strict=True)
    )
    points = np.stack([*np.meshgrid(u, v), heights], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    both = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)])
    return both.reshape(-1, 3, 3)


def _in_micrometres(error: BakeError) -> dict[str, float]:
    return {key: round(1e6 * value, 3) for key, value in error._asdict().items()}


def _report(
    source: Path, kind: str, full: int, low: Mesh, texture: Texture, notes: list[str]
) -> dict[str, Any]:
    rows, columns = texture.heights.shape
    extents = np.ptp(low.vertices, axis=0)
    return {
        "schema": 1,
        "kind": kind,
        "source": source.name,
        "full_faces": full,
        "faces": len(low.faces),
        "texture_size": [columns, rows],
        "texture_covers_mm": [round(1e3 * s, 4) for s in texture.size],
        "extents_mm": [round(1e3 * float(e), 4) for e in extents],
        "heights_um": [round(1e6 * float(f(texture.heights)), 3) for f in (np.min, np.max)],
        "notes": notes,
    }
