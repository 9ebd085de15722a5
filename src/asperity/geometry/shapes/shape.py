"""Closed meshes with normals, texture coordinates and convex pieces, read from shipped files.

The files hold float64 values exactly. `python -m tools.shapes` generates them from the dimensions
in `tools/shapes/`.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices


class Shape(NamedTuple):
    """A closed mesh with normals, texture coordinates and the convex pieces that make it up."""

    vertices: Array
    """[m], (n, 3)."""
    faces: Indices
    """Vertices of each triangle, counter-clockwise as seen from outside, (m, 3)."""
    normals: Array
    """Unit normals at the corners, (m, 3, 3); equal on all triangles of a flat face."""
    uv: Array
    """Texture coordinates of the corners [-], (m, 3, 2), not mirrored; beyond 0..1 they wrap."""
    pieces: tuple[Array, ...]
    """Corners of convex solids whose union is the body [m], each (k, 3)."""
    uv_size: tuple[float, float]
    """Length that one unit of u and of v spans [m]."""


def shipped_file(name: str) -> Path:
    """Return the path of a shipped mesh."""
    return Path(__file__).with_name(f"{name}.npz")


def read_shape(path: Path) -> Shape:
    """Read a shape that `write_shape` wrote."""
    with np.load(path) as data:
        pieces = np.split(data["piece_points"], np.cumsum(data["piece_sizes"])[:-1])
        u, v = data["uv_size"].tolist()
        return Shape(
            data["vertices"], data["faces"].astype(np.int64), data["normals"], data["uv"],
            tuple(pieces), (u, v),
        )  # fmt: skip


def write_shape(path: Path, shape: Shape) -> None:
    """Write a shape as compressed arrays that keep every bit."""
    np.savez_compressed(
        path,
        vertices=shape.vertices,
        faces=shape.faces.astype(np.uint16),
        normals=shape.normals,
        uv=shape.uv,
        piece_points=np.concatenate(shape.pieces),
        piece_sizes=np.array([len(piece) for piece in shape.pieces], dtype=np.uint16),
        uv_size=np.array(shape.uv_size),
    )


def hammer() -> Shape:
    """Return a ball-pein hammer of 528 triangles and about half a kilogram.

    The origin is the middle of the eye. The head lies along x, its striking face (26 mm across,
    crowned) at +x and its ball at -x, 98 mm in all; the oval handle reaches down to z = -285 mm.
    Normals are smooth except where the handle meets the head.
    """
    return read_shape(shipped_file("hammer"))


def file_tool() -> Shape:
    """Return a flat hand file with a turned handle: 622 triangles.

    The blade lies along x from the shoulder at x = 0 to the point at x = 120 mm, its broad faces
    towards +z and -z; tang, ferrule and handle are at x < 0. On the blade u runs along the file
    to its point and v across it.
    """
    return read_shape(shipped_file("file_tool"))


def cad_part() -> Shape:
    """Return a machined flange with a boss: 712 triangles.

    A plate of 80 mm x 48 mm x 9 mm, its underside on z = 0, with two holes of 8 mm at
    x = +-28 mm, and a boss of 30 mm, 22 mm high, with a through bore of 16 mm. Every edge has a
    chamfer over which the normals turn.
    """
    return read_shape(shipped_file("cad_part"))
