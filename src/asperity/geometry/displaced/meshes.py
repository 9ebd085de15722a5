"""The displaced surface of a mesh as patches of triangles, fine in the region in view.

A triangle in view is halved along its longest side until it is a few points of a sheet long, and
then subdivided evenly. Triangles out of view or facing away from the eye stay coarse: they only
cast shadows. Along edges where texture coordinates or normals are discontinuous the displaced
surface opens; strips close the gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.geometry.bodies import Body
from asperity.geometry.displaced.relief import MeshRelief
from asperity.geometry.displaced.sheet import Sheet
from asperity.geometry.displaced.view import ViewBall
from asperity.geometry.poses import rotation_of

_DIVISIONS = 16
"""Largest number of divisions of a triangle's side."""
_AT_ONCE = 100_000
"""Points displaced in one NumPy call."""
_FACES_AWAY = -0.25
"""Cosine of the angle between normal and eye below which a triangle is treated as hidden."""


class _Parts(NamedTuple):
    """Parts of a mesh's triangles, made by halving."""

    face: Indices
    """Triangle to which each part belongs, (n,)."""
    corners: Array
    """Weights of the triangle's corners at the corners of the part, (n, 3, 3)."""
    divisions: Indices
    """Divisions of each side, (n,)."""
    fine: Mask
    """Which parts are in view, (n,)."""


def mesh_sheets(
    body: Body, pose: Array, view: ViewBall, faces: Mask | None = None,
    *, closed: bool = True,
) -> Iterator[Sheet]:  # fmt: skip
    """Yield the displaced surface of a body with a mesh as sheets of patches, in world axes.

    Parameters
    ----------
    body : Body
    pose : (7,) array
        Of the body's frame.
    view : ViewBall
    faces : (m,) array of bool, optional
        Triangles to include; by default all.
    closed : bool
        Whether strips close the edges at which the surface opens.
    """
    assert body.mesh is not None
    rotation = rotation_of(pose[3:])
    chosen = np.ones(len(body.mesh.faces), bool) if faces is None else faces
    relief = MeshRelief(body, view.spacing)
    view = view._replace(
        centre=(view.centre - pose[:3]) @ rotation,
        camera=None if view.camera is None else view.camera.in_frame(rotation, pose[:3]),
    )
    sheets = [*_patches(relief, view, np.flatnonzero(chosen))]
    if closed:
        sheets += _strips(relief, view, chosen)
    yield from (sheet.placed(pose) for sheet in sheets)


def _patches(relief: MeshRelief, view: ViewBall, faces: Indices) -> Iterator[Sheet]:
    """Yield the displaced triangles, in the body's frame."""
    parts = _parts(relief, view, faces)
    for divisions in np.unique(parts.divisions):
        template, corners = _template(int(divisions))
        chosen = np.flatnonzero(parts.divisions == divisions)
        for some in np.array_split(chosen, 1 + len(chosen) * len(template) // _AT_ONCE):
            weights = template @ parts.corners[some]
            points, normals, height = relief.displaced(parts.face[some], weights)
            if view.camera is None:
                # Slopes of the texture between points far apart would alias.
                coarse = ~parts.fine[some]
                normals[coarse] = relief.smooth_normals(parts.face[some][coarse], weights[coarse])
            yield Sheet(points, normals, corners, height, parts.face[some], weights)


def _parts(relief: MeshRelief, view: ViewBall, face: Indices) -> _Parts:
    """Return the parts into which triangles are divided."""
    triangles = relief.triangles
    hidden = np.zeros(len(triangles), bool)
    if view.camera is not None:
        hidden = (relief.normals @ view.camera.towards).max(axis=1) < _FACES_AWAY
    done = []
    corners = np.tile(np.eye(3), (len(face), 1, 1))
    while True:
        points = corners @ triangles[face]
        sides = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
        fine = ~hidden[face] & _in_view(points, view)
        wanted = np.where(fine, np.ceil(sides.max(axis=1) / view.spacing), 1.0)
        whole = wanted <= _DIVISIONS
        divisions = np.maximum(wanted[whole], 1.0).astype(np.int64)
        done.append(_Parts(face[whole], corners[whole], divisions, fine[whole]))
        if whole.all():
            return _Parts(*(np.concatenate(column) for column in zip(*done, strict=True)))
        face, corners = _halved(face[~whole], corners[~whole], sides[~whole])


def _in_view(points: Array, view: ViewBall) -> Mask:
    """Return which triangles (n, 3, 3) may reach into the view."""
    if view.camera is not None:
        return view.camera.sees(points)
    middle = points.mean(axis=1)
    reach = np.linalg.norm(points - middle[:, None], axis=2).max(axis=1)
    away = np.linalg.norm(middle - view.centre, axis=1)
    return np.asarray(away <= view.radius + reach)


def _halved(face: Indices, corners: Array, sides: Array) -> tuple[Indices, Array]:
    """Return both halves of triangles bisected at their longest sides."""
    turn = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, turn[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    halves = [np.stack(corner, axis=1) for corner in ((a, middle, c), (middle, b, c))]
    return np.tile(face, 2), np.concatenate(halves)


def _template(divisions: int) -> tuple[Array, Indices]:
    """Return the weights (k, 3) of the points of an evenly divided triangle, and its triangles."""
    n = divisions
    number: dict[tuple[int, int], int] = {}
    for i in range(n + 1):
        for j in range(n + 1 - i):
            number[i, j] = len(number)
    weights = np.array([((n - i - j) / n, i / n, j / n) for i, j in number])
    corners = []
    for i, j in number:
        if i + j < n:
            corners.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < n - 1:
            corners.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return weights, np.array(corners, dtype=np.int64)


def _strips(relief: MeshRelief, view: ViewBall, faces: Mask) -> Iterator[Sheet]:
    """Yield strips between the two sides of open edges in view, in the body's frame."""
    edges = relief.open_edges
    edges = edges[faces[edges[:, 0, 0]]]
    ends = [relief.triangles[edges[:, 0, 0], edges[:, 0, k]] for k in (1, 2)]
    seen = _in_view(np.stack([*ends, ends[0]], axis=1), view)
    lengths = np.linalg.norm(ends[1] - ends[0], axis=1)
    wanted = np.ceil(np.where(seen, lengths / view.spacing, 1.0))
    # Powers of two, so that there are few sheets.
    divisions = 2 ** np.ceil(np.log2(np.maximum(wanted, 1.0))).astype(np.int64)
    for n in np.unique(divisions):
        some = edges[divisions == n]
        share = np.linspace(0.0, 1.0, n + 1)[:, None]
        ends_at = np.eye(3)[some[:, :, 1:]]
        weights = ends_at[:, :, None, 0] * (1.0 - share) + ends_at[:, :, None, 1] * share
        a, b = (relief.displaced(some[:, side, 0], weights[:, side]) for side in (0, 1))
        points, normals = (np.concatenate([a[k], b[k]], axis=1) for k in (0, 1))
        height = None if a[2] is None or b[2] is None else np.concatenate([a[2], b[2]], axis=1)
        i = np.arange(n)
        corners = np.stack([i, i + 1, i + n + 1, i + 1, i + n + 2, i + n + 1], axis=1)
        yield Sheet(
            points, normals, corners.reshape(-1, 3), height, some[:, 0, 0],
            np.tile(weights[:, 0], (1, 2, 1)),  # of one side, or it would span the whole texture
        )  # fmt: skip
