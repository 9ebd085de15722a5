"""A designed surface on a given closed mesh, as a watertight STL.

The mesh is divided, all triangles alike, until no edge is longer than a pixel or the number of
triangles allows no more, and its vertices are moved along their normals by the map, projected along
three axes (triplanar), so that no seam opens.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from asperity.designing.plate_stl import write_stl
from asperity.designing.process import ManufactureProcess
from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField

NAME = "object.stl"
_MOST_TRIANGLES = 4_000_000


def write_on_mesh(
    mesh: Path, field: HeightField, process: ManufactureProcess, folder: Path
) -> dict[str, Any]:
    """Write `object.stl` [mm]; return what was done.

    Parameters
    ----------
    mesh : Path
        A closed mesh in millimetres, in any format of trimesh.
    field : HeightField
        The map to make.
    process : ManufactureProcess
        Gives the pixel.
    folder : Path
    """
    import trimesh

    if not mesh.is_file():
        raise AsperityError(f"no such file: {mesh}")
    loaded = trimesh.load(mesh, force="mesh")
    if not loaded.is_watertight:
        raise AsperityError(f"{mesh}: the mesh is open; valid: a closed one, to be printed")
    vertices, faces = np.asarray(loaded.vertices) * 1e-3, np.asarray(loaded.faces)
    while True:
        edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
        if edges.max() <= process.pixel or 4 * len(faces) > _MOST_TRIANGLES:
            break
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    fine = trimesh.Trimesh(vertices, faces, process=False)
    normals = np.asarray(fine.vertex_normals)
    weights = normals**4
    weights /= weights.sum(axis=1, keepdims=True)
    heights = sum(
        weights[:, axis] * field.heights(vertices[:, i], vertices[:, j])
        for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1)))
    )
    moved = vertices + np.asarray(heights - field.lowest)[:, None] * normals
    write_stl(moved[faces], folder / NAME)
    return {"triangles": len(faces), "longest_edge": float(edges.max())}
