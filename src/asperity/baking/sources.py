"""Input of baking: a mesh, a height map or points from a file, and the unit of length.

Most files do not state their unit. If none is given, the first unit is chosen that makes the
largest extent that of a hand-held object, and the first note reports it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity._core.unpacking import suffix_of
from asperity.baking.points import PACKED, POINTS, TEXTS, holds_points
from asperity.errors import AsperityError, require_choice
from asperity.geometry.mesh.checks import LARGEST, SMALLEST, UNITS
from asperity.geometry.mesh.contents import Contents
from asperity.geometry.mesh.files import PACKED as PACKED_MESHES
from asperity.geometry.mesh.files import SUFFIXES, mesh_of, read_contents
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.ply import read_head
from asperity.texture.files.arrays import ARRAY_SUFFIXES
from asperity.texture.files.images import IMAGE_SUFFIXES
from asperity.texture.files.instruments import INSTRUMENT_SUFFIXES
from asperity.texture.files.loading import PACKED as PACKED_HEIGHTS

HAND = (5e-3, 0.5)
"""Smallest and largest extent of a hand-held object [m], for guessing the unit."""
_GUESSES = ("m", "mm", "cm", "in", "um", "dm")


def kind_of(path: Path) -> str:
    """Return "mesh", "points" or "heights", the kind of a file; refuse others."""
    suffix = suffix_of(path, (*PACKED, *PACKED_HEIGHTS, *PACKED_MESHES))
    if not path.exists():
        raise AsperityError(f"{path}: there is no such file")
    if path.is_dir():
        raise AsperityError(f"{path}: this is a folder; valid: a file of a mesh, points or heights")
    if suffix == ".ply":
        elements = read_head(path).elements
        has_faces = any(elements.get(name, (0, []))[0] for name in ("face", "tristrips"))
        return "mesh" if has_faces else "points"
    if suffix in SUFFIXES:
        return "mesh"
    if suffix in POINTS or (suffix in TEXTS and holds_points(path)):
        return "points"
    if suffix in (*IMAGE_SUFFIXES, *ARRAY_SUFFIXES, *INSTRUMENT_SUFFIXES):
        return "heights"
    raise AsperityError(
        f"{path}: unknown kind of file {suffix!r}; valid: a mesh ({', '.join(SUFFIXES)}), points "
        f"({', '.join(POINTS)}, .ply without faces), or a height map (an image, .npy, .npz, ...)"
    )


def mesh_to_bake(
    path: Path, unit: str | None, up: str | None = None
) -> tuple[Mesh, str, tuple[str, ...]]:
    """Return the mesh in a file, in metres and upright, its unit, and notes on guesses.

    Parameters
    ----------
    path : Path
    unit : str or None
        One of `UNITS`; None: guessed, except that glTF is in metres.
    up : {"x", "y", "z"} or None
        Axis of the file that points upwards; None: as the file states, y for glTF, else z.
    """
    if unit is not None:
        unit = require_choice("unit", unit, UNITS)
    if up is not None:
        require_choice("up", up, ("x", "y", "z"))
    notes: tuple[str, ...] = ()
    contents = read_contents(path)
    up = up or contents.up or "z"
    if unit is None:
        unit = contents.unit
        if unit is None:
            unit, notes = guessed_unit(_extents(contents))
    return upright(mesh_of(path, contents, unit=unit, hard_angle=180.0), up), unit, notes


def upright(mesh: Mesh, up: str) -> Mesh:
    """Return a mesh rotated so that its axis `up` is along z; axes are permuted cyclically."""
    order = np.roll(np.arange(3), 2 - "xyz".index(up))
    return replace(mesh, vertices=mesh.vertices[:, order], normals=mesh.normals[:, :, order])


def _extents(contents: Contents) -> Array:
    """Return the extents (3,) of the parts of a file, in its own unit."""
    used = [part.corners.vertices[np.unique(part.corners.faces)] for part in contents.parts]
    points = np.concatenate(used)
    return np.asarray(np.ptp(points[np.isfinite(points).all(axis=1)], axis=0))


def guessed_unit(extents: Any) -> tuple[str, tuple[str, ...]]:
    """Return a unit that makes extents (3,) those of a hand-held object, and a note."""
    largest = float(np.max(extents))
    fit = [u for u in _GUESSES if HAND[0] <= largest * UNITS[u] <= HAND[1]]
    fit += [u for u in _GUESSES if SMALLEST <= largest * UNITS[u] <= LARGEST]
    if not fit:
        raise AsperityError(
            f"its largest extent is {largest:.4g}, too small or too large for a hand in any unit; "
            "valid: 0.1 mm to 2 m"
        )
    size = " x ".join(f"{1e3 * e * UNITS[fit[0]]:.4g}" for e in extents)
    return fit[0], (
        f"unit guessed: {fit[0]}, which makes it {size} mm; if that is wrong give the unit",
    )
