"""Displaced surfaces of bodies as sheets, fine in the region in view.

The faces of simple geoms are grids of points `p = base + t w`: base point, height of the texture
there, unit normal of the base. Meshes are patches of triangles (`meshes`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Mask
from asperity.geometry.bodies import Body, Geom, origin_of_map
from asperity.geometry.displaced.meshes import mesh_sheets
from asperity.geometry.displaced.sheet import Sheet, displace
from asperity.geometry.displaced.view import ViewBall, coarsened
from asperity.geometry.poses import rotation_of
from asperity.texture.height_field import HeightField


class GeomFace(NamedTuple):
    """A face of a geom as a grid of points."""

    geom: Geom
    base: Array
    """Points of the smooth face in the body's frame [m], (a, b, 3)."""
    normals: Array
    """Of the smooth face, unit, (a, b, 3)."""
    heights: Array
    """Of the texture [m], (a, b)."""


def body_sheets(
    body: Body, pose: Array, view: ViewBall, faces: Mask | None = None
) -> Iterator[Sheet]:
    """Yield the displaced surface of a body, in world axes, where it is in view.

    Parameters
    ----------
    body : Body
    pose : (7,) array
        Of the body's frame.
    view : ViewBall
    faces : (m,) array of bool, optional
        Triangles of the body's mesh to include; by default all.
    """
    if body.mesh is not None:
        yield from mesh_sheets(body, pose, view, faces)
        return
    for face in geom_faces(body, pose, view):
        points, normals = displace(face.base, face.normals, face.heights)
        if body.texture is None:
            yield Sheet(points, normals).placed(pose)
            continue
        edges = _edges(face)
        sheet = Sheet(
            _bordered(points, face.base, edges),
            _bordered(normals, normals, edges),
            height=_bordered(face.heights, face.heights, edges),
        )
        yield sheet.placed(pose)


def _edges(face: GeomFace) -> tuple[bool, bool, bool, bool]:
    """Return which sides of a face are edges of its geom: first and last row, and column."""
    size = np.asarray(face.geom.size)
    local = (face.base - face.geom.position) @ rotation_of(face.geom.quaternion)

    def is_edge(line: Array) -> bool:
        if face.geom.kind == "box":
            return bool((np.isclose(np.abs(line), size).sum(axis=1) >= 2).all())
        radii = np.hypot(line[:, 0], line[:, 1])
        at_rim = np.isclose(radii, size[0]) & np.isclose(np.abs(line[:, 2]), size[1])
        return face.geom.kind == "cylinder" and bool(at_rim.all())

    return is_edge(local[0]), is_edge(local[-1]), is_edge(local[:, 0]), is_edge(local[:, -1])


def _bordered(values: Array, border: Array, edges: tuple[bool, bool, bool, bool]) -> Array:
    """Return a grid with the outermost rows and columns of another one added at its edges.

    Where two faces meet, each is displaced along its own normal, and a crack opens: strips from
    the displaced points down to the edge close it.
    """
    first, last, left, right = map(int, edges)
    out = np.pad(border, ((first, last), (left, right), (0, 0))[: border.ndim], mode="edge")
    out[first : first + len(values), left : left + values.shape[1]] = values
    return out


def geom_faces(body: Body, pose: Array, view: ViewBall) -> Iterator[GeomFace]:
    """Yield the faces of a body of simple geoms as grids in its frame, where they are in view."""
    rotation = rotation_of(pose[3:])
    field = None if body.texture is None else coarsened(body.texture, view.spacing)
    if field is None:
        view = view._replace(samples=max(view.samples // 3, 60))
    for geom in body.geoms:
        turn = rotation_of(geom.quaternion)
        place = np.asarray(geom.position)
        middle = view.centre
        if geom.kind == "plane":
            middle = _ahead(view, pose[:3] + rotation @ place, rotation @ turn[:, 2])
        centre = turn.T @ (rotation.T @ (middle - pose[:3]) - place)
        for base, w in _grids(geom, centre, view):
            if min(base.shape[:2]) < 2:
                continue
            in_body = base @ turn.T + place
            w_body = w @ turn.T
            heights = _heights(body, field, geom, base, in_body, w_body)
            yield GeomFace(geom, in_body, w_body, heights)


def _ahead(view: ViewBall, place: Array, normal: Array) -> Array:
    """Return the point of a plane in the middle of the image; without a camera, below the view."""
    towards = normal if view.camera is None else view.camera.towards
    slope = float(towards @ normal)
    if abs(slope) < 0.05:
        return view.centre
    return np.asarray(view.centre - towards * (float((view.centre - place) @ normal) / slope))


def _heights(
    body: Body, field: HeightField | None, geom: Geom, base: Array, in_body: Array, w: Array
) -> Array:
    """Return the texture's height [m] at base points, given in the geom's and the body's frame."""
    if field is None:
        return np.zeros(base.shape[:2])
    origin = origin_of_map(body)

    def at(u: Array, v: Array) -> Array:
        return np.asarray(field.heights(u - origin[0], v - origin[1]))

    x, y, z = np.moveaxis(in_body, -1, 0)
    if body.mapping == "planar":
        return at(x, y)
    if body.mapping == "cylindrical":
        angle = np.arctan2(base[..., 1], base[..., 0])
        radius, half = geom.size[0], geom.size[1]
        side = np.abs(np.hypot(base[..., 0], base[..., 1]) - radius) < 1e-9 * radius
        side &= np.abs(base[..., 2]) <= half * (1.0 + 1e-9)
        return np.where(side, at(radius * angle, base[..., 2]), 0.0)
    weights = np.abs(w) ** 4
    weights /= weights.sum(axis=-1, keepdims=True)
    return weights[..., 0] * at(y, z) + weights[..., 1] * at(z, x) + weights[..., 2] * at(x, y)


def _grids(geom: Geom, centre: Array, view: ViewBall) -> Iterator[tuple[Array, Array]]:
    """Yield base points and unit normals of a geom's faces, all in its frame like `centre`."""
    size, reach = geom.size, view.radius
    if geom.kind in ("plane", "box"):
        yield from _flat_grids(geom, centre, view)
    elif geom.kind in ("sphere", "ellipsoid"):
        axes = np.full(3, size[0]) if geom.kind == "sphere" else np.asarray(size)
        yield _ball(axes, -0.5, 0.5, view)
    else:
        radius, half = size[0], size[1]
        low, high = max(-half, centre[2] - reach), min(half, centre[2] + reach)
        if high > low:
            z = np.linspace(low, high, _count(high - low, view))
            yield _turned((radius, z), (1.0, 0.0), _round(radius, view))
        for sign in (-1.0, 1.0):
            if abs(sign * half - centre[2]) > reach + radius:
                continue
            if geom.kind == "capsule":
                turns = (-0.5, 0.0) if sign < 0 else (0.0, 0.5)
                base, w = _ball(np.array([radius] * 3), *turns, view)
                yield base + np.array([0.0, 0.0, sign * half]), w
            else:
                r = np.linspace(0.0, radius, _count(radius, view))
                yield _turned((r, sign * half), (0.0, sign), _round(radius, view))


def _flat_grids(geom: Geom, centre: Array, view: ViewBall) -> Iterator[tuple[Array, Array]]:
    half = [s if s > 0.0 else math.inf for s in geom.size]
    faces = [(2, 1.0)] if geom.kind == "plane" else [(i, s) for i in range(3) for s in (-1.0, 1.0)]
    for axis, sign in faces:
        level = 0.0 if geom.kind == "plane" else sign * half[axis]
        if abs(centre[axis] - level) > view.radius:
            continue
        i, j = (axis + 1) % 3, (axis + 2) % 3
        lines = []
        for k in (i, j):
            ends = np.array([-half[k], half[k]])
            low, high = np.clip(ends, centre[k] - view.radius, centre[k] + view.radius)
            lines.append(np.linspace(low, high, _count(high - low, view) if high > low else 0))
        a, b = np.meshgrid(lines[0], lines[1], indexing="ij")
        base = np.empty((*a.shape, 3))
        base[..., i], base[..., j], base[..., axis] = a, b, level
        w = np.zeros_like(base)
        w[..., axis] = sign
        yield base, w


def _ball(axes: Array, low: float, high: float, view: ViewBall) -> tuple[Array, Array]:
    """Return an ellipsoid from latitude `low` to `high`, in half turns."""
    around = _round(float(axes.max()), view)
    latitude = np.linspace(low * np.pi, high * np.pi, max(int(around * (high - low) / 2), 8))
    profile = np.cos(latitude), np.sin(latitude)
    unit, _ = _turned(profile, profile, around)
    w = unit / axes
    return unit * axes, w / np.linalg.norm(w, axis=-1, keepdims=True)


def _turned(
    profile: tuple[ArrayLike, ArrayLike], normal: tuple[ArrayLike, ArrayLike], around: int
) -> tuple[Array, Array]:
    """Return a surface of revolution around z and its normals, from radii and heights of both."""
    r, z, out, up = np.broadcast_arrays(*profile, *normal)
    angle = np.linspace(0.0, 2.0 * np.pi, around)
    x, y, level = np.cos(angle), np.sin(angle), np.ones(around)
    base = np.stack([np.outer(r, x), np.outer(r, y), np.outer(z, level)], axis=-1)
    return base, np.stack([np.outer(out, x), np.outer(out, y), np.outer(up, level)], axis=-1)


def _count(length: float, view: ViewBall) -> int:
    return int(np.clip(length / (2.0 * view.radius) * view.samples, 2, 1.5 * view.samples))


def _round(radius: float, view: ViewBall) -> int:
    return max(_count(2.0 * np.pi * radius, view), 96)
