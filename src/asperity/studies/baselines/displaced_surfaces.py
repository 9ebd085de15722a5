"""Displaced surfaces of bodies as points and triangles, at a given spacing.

The methods of full detail use them: every point of the smooth surface, moved along its normal by
the texture's height. Where geoms of one body overlap or meet, the parts inside are removed, so that
a plate of sixteen boxes has the same surface as a plate of one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body, Geom, covers
from asperity.geometry.displaced.geoms import GeomFace, geom_faces
from asperity.geometry.displaced.meshes import mesh_sheets
from asperity.geometry.displaced.sheet import displace, facing_outwards, grid_triangles
from asperity.geometry.displaced.view import ViewBall
from asperity.geometry.poses import rotation_of

Array = NDArray[np.float64]
_STILL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_FAR = 1.0
"""Half side of an unbounded plane [m]."""
_INSIDE = 1e-9
"""Distance above a face at which it is tested whether another geom covers it [m]."""
_BESIDE = 1e-6
"""Distance beyond a border at which it is tested whether another geom continues it [m]."""


class DisplacedSurface(NamedTuple):
    """A triangulated surface in its body's frame."""

    points: Array
    """[m], (n, 3)."""
    normals: Array
    """Outwards, unit, (n, 3)."""
    faces: NDArray[np.int64]
    """(m, 3)."""


def displaced_surface(body: Body, spacing: float, *, smooth: bool = False) -> DisplacedSurface:
    """Return a body's surface, with its texture unless `smooth`.

    Parameters
    ----------
    body : Body
        An unbounded plane is cut at a metre from its centre.
    spacing : float
        Approximate distance of points [m]. Finer relief is averaged.
    smooth : bool
        Leave the texture out.
    """
    if smooth:
        body = replace(body, texture=None)
    centre, radius = bounding_ball(body)
    view = ViewBall(centre, 1.01 * radius, max(round(2.02 * radius / spacing), 8))
    if body.mesh is not None:
        return _joined([
            DisplacedSurface(
                sheet.points.reshape(-1, 3), sheet.normals.reshape(-1, 3), sheet.triangles()
            )
            for sheet in mesh_sheets(body, _STILL, view)
        ])  # fmt: skip
    parts = []
    if body.texture is None:
        # The renderer samples smooth faces with a third of the points.
        view = view._replace(samples=3 * view.samples)
    for face in geom_faces(body, _STILL, view):
        points, normals = displace(face.base, face.normals, face.heights)
        shown = np.ones(face.base.shape[:2], bool)
        for other in body.geoms:
            if other is not face.geom:
                shown &= ~covers(other, face.base + _INSIDE * face.normals)
        # Normals of `displace` may have either sign; those of the base point outward.
        sign = np.sign(np.sum(normals * face.normals, axis=-1, keepdims=True))
        parts.append(_of_grid(points, normals * np.where(sign == 0.0, 1.0, sign), shown))
        if body.texture is not None:
            parts += _skirts(body, face, points, shown)
    return _joined(parts)


def _skirts(
    body: Body, face: GeomFace, points: Array, shown: NDArray[np.bool_]
) -> Iterator[DisplacedSurface]:
    """Yield strips from the borders of a displaced face down to its base.

    Where two faces meet at an edge, each is displaced along its own normal and the surface opens.
    Their bases meet, so these strips close it. A face that another geom continues, or that is
    periodic, is not open there.
    """
    base, w = face.base, face.normals
    sides = [(base[i], base[j], points[i], w[i], shown[i]) for i, j in ((0, 1), (-1, -2))]
    sides += [
        (base[:, i], base[:, j], points[:, i], w[:, i], shown[:, i]) for i, j in ((0, 1), (-1, -2))
    ]
    for k, (low, inner, high, out, there) in enumerate(sides):
        opposite = sides[k ^ 1][0]
        if np.allclose(low, opposite, atol=1e-9) or np.ptp(low, axis=0).max() < 1e-9:
            continue
        beyond = low - inner
        beyond /= np.maximum(np.linalg.norm(beyond, axis=1, keepdims=True), 1e-12)
        near = low + _BESIDE * (beyond - out)
        open_here = there.copy()
        for other in body.geoms:
            if other is not face.geom:
                open_here &= ~covers(other, near)
        strip = np.stack([low, high])
        surface = _of_grid(strip, np.broadcast_to(beyond, strip.shape), np.stack([open_here] * 2))
        if len(surface.faces):
            yield surface


def _of_grid(points: Array, normals: Array, shown: NDArray[np.bool_]) -> DisplacedSurface:
    """Return a grid of points (a, b, 3) as triangles, without those that are hidden."""
    flat, outwards = points.reshape(-1, 3), normals.reshape(-1, 3)
    faces = facing_outwards(flat, outwards, grid_triangles(*shown.shape))
    faces = faces[shown.ravel()[faces].any(axis=1)]
    used, number = np.unique(faces, return_inverse=True)
    return DisplacedSurface(flat[used], outwards[used], number.reshape(faces.shape))


def _joined(parts: list[DisplacedSurface]) -> DisplacedSurface:
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    return DisplacedSurface(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.faces + k for part, k in zip(parts, first, strict=False)]),
    )


def bounding_ball(body: Body) -> tuple[Array, float]:
    """Return the centre and radius [m] of a ball around a smooth body, in its frame."""
    if body.mesh is not None:
        low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    else:
        boxes = np.array([_box(geom) for geom in body.geoms])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))


def _box(geom: Geom) -> tuple[Array, Array]:
    """Return the corners of the box around a geom along the axes of the body's frame."""
    size = np.asarray(geom.size)
    half = {
        "plane": np.array([size[0] or _FAR, size[1] or _FAR, 0.0]),
        "sphere": np.full(3, size[0]),
        "capsule": np.array([size[0], size[0], size[0] + size[1]]),
        "cylinder": np.array([size[0], size[0], size[1]]),
    }.get(geom.kind, size)
    reach = np.abs(rotation_of(geom.quaternion)) @ half
    place = np.asarray(geom.position)
    return place - reach, place + reach


def area(surface: DisplacedSurface) -> float:
    """Return a surface's area [m^2]."""
    a, b, c = np.moveaxis(surface.points[surface.faces], 1, 0)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def smooth_area(body: Body) -> float:
    """Return the approximate area of the smooth surface of a body [m^2]."""
    return area(displaced_surface(body, bounding_ball(body)[1] / 50.0, smooth=True))


def is_unbounded(body: Body) -> bool:
    """Return whether a body is an unbounded plane."""
    return any(geom.kind == "plane" and 0.0 in geom.size[:2] for geom in body.geoms)


def finite_reason(*bodies: Body) -> str | None:
    """Return why one of the bodies has no surface of finitely many points, or None."""
    for body in bodies:
        if body.texture is not None and is_unbounded(body):
            return f"{body.name} is a textured unbounded plane: it has no finite surface to sample"
    return None


def spacing_for(body: Body, most: int) -> float:
    """Return the finest spacing [m] at which a body's surface has at most about `most` points."""
    # Triangles of a mesh are divided one by one, each into more parts than necessary.
    return math.sqrt(smooth_area(body) * (1.0 if body.mesh is None else 3.0) / most)
