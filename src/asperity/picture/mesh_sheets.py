"""A body's mesh as patches of triangles, displaced, fine where it is looked at.

A triangle in view is halved along its longest side until it is a few points of a sheet long, and
then divided evenly. What is out of view, or faces away from the eye, stays coarse: it is drawn
only for its shadow. Normals follow from the corners' normals and the slope of the texture, so
that a coarse round mesh looks round.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.flat import rotation_of
from asperity.geometry.bodies import Body
from asperity.geometry.mesh import Mesh
from asperity.geometry.placing import places_on_texture
from asperity.picture.view import Sheet, View, coarsened

Array = NDArray[np.float64]
_DIVISIONS = 16
"""A triangle is divided into this many along each side, at most."""
_AT_ONCE = 200_000
"""Points that are displaced at once."""
_FACES_AWAY = -0.25
"""Cosine of the angle between normal and eye below which a triangle is hidden by others."""


class _Parts(NamedTuple):
    """Parts of a mesh's triangles."""

    face: NDArray[np.int64]
    """Which triangle each is a part of, (n,)."""
    corners: Array
    """Weights of the triangle's corners at those of the part, (n, 3, 3)."""
    divisions: NDArray[np.int64]
    """Of each side, (n,)."""


def mesh_sheets(body: Body, pose: Array, view: View) -> Iterator[Sheet]:
    """Yield the displaced surface of a body with a mesh as sheets of patches.

    Parameters
    ----------
    body : Body
    pose : (7,) array
        Of the body's frame.
    view : View
    """
    mesh = body.mesh
    assert mesh is not None
    rotation = rotation_of(pose[3:])
    parts = _parts(mesh, _in_body(view, rotation, pose[:3]))
    relief = _Relief(body, view.spacing)
    for divisions in np.unique(parts.divisions):
        template, corners = _template(int(divisions))
        chosen = np.flatnonzero(parts.divisions == divisions)
        for some in np.array_split(chosen, 1 + len(chosen) * len(template) // _AT_ONCE):
            points, normals = _displaced(
                mesh, relief, parts.face[some], template @ parts.corners[some]
            )
            yield Sheet(points @ rotation.T + pose[:3], normals @ rotation.T, corners)


def _in_body(view: View, rotation: Array, position: Array) -> View:
    towards = None if view.towards is None else view.towards @ rotation
    return view._replace(centre=(view.centre - position) @ rotation, towards=towards)


def _parts(mesh: Mesh, view: View) -> _Parts:
    """Return what each triangle is divided into; `view` in the body's frame."""
    triangles = mesh.vertices[mesh.faces]
    hidden = np.zeros(len(triangles), bool)
    if view.towards is not None:
        hidden = (mesh.normals @ view.towards).max(axis=1) < _FACES_AWAY
    done = []
    face, corners = np.arange(len(triangles)), np.tile(np.eye(3), (len(triangles), 1, 1))
    while len(face):
        points = corners @ triangles[face]
        sides = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
        longest = sides.max(axis=1)
        fine = ~hidden[face] & _in_view(points, view)
        wanted = np.where(fine, np.ceil(longest / view.spacing), 1.0)
        whole = wanted <= _DIVISIONS
        divisions = np.maximum(wanted[whole], 1.0).astype(np.int64)
        done.append(_Parts(face[whole], corners[whole], divisions))
        face, corners = _halved(face[~whole], corners[~whole], sides[~whole])
    return _Parts(*(np.concatenate(column) for column in zip(*done, strict=True)))


def _in_view(points: Array, view: View) -> NDArray[np.bool_]:
    """Return whether triangles (n, 3, 3) may reach into the view."""
    middle = points.mean(axis=1)
    reach = np.linalg.norm(points - middle[:, None], axis=2).max(axis=1)
    away = middle - view.centre
    if view.towards is not None:  # also what lies before or behind the ball
        away -= (away @ view.towards)[:, None] * view.towards
    return np.asarray(np.linalg.norm(away, axis=1) <= view.radius + reach)


def _halved(
    face: NDArray[np.int64], corners: Array, sides: Array
) -> tuple[NDArray[np.int64], Array]:
    """Return the two halves of triangles that are cut across their longest sides."""
    turn = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, turn[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    halves = [np.stack(corner, axis=1) for corner in ((a, middle, c), (middle, b, c))]
    return np.tile(face, 2), np.concatenate(halves)


def _template(divisions: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the points (k, 3) of an evenly divided triangle, by weights, and its triangles."""
    n = divisions
    number = {}
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


def _displaced(
    mesh: Mesh, relief: _Relief, face: NDArray[np.int64], weights: Array
) -> tuple[Array, Array]:
    """Return displaced points and unit normals, (n, k, 3), at places given by weights."""
    points = weights @ mesh.vertices[mesh.faces[face]]
    w = weights @ mesh.normals[face]
    w /= np.maximum(np.linalg.norm(w, axis=-1, keepdims=True), 1e-12)
    found = relief.at(points, w, face, weights)
    if found is None:
        return points, w
    height, slope = found
    points += height[..., None] * w
    normals = w - slope + np.sum(slope * w, axis=-1, keepdims=True) * w
    return points, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


class _Relief:
    """Height and slope of a body's texture, at places on its mesh."""

    def __init__(self, body: Body, spacing: float) -> None:
        self._places = places_on_texture(body)
        self._field = body.texture
        self._origin = np.asarray(body.offset, dtype=np.float64)
        if body.texture is None or body.mesh is None:
            return
        if body.texture.border == "clamp":
            self._origin = self._origin - 0.5 * np.asarray(body.texture.size)
        if self._places is not None:
            self._by = _gradients(body.mesh, self._places)
            # How far a place on the texture moves with one on the body.
            size = np.sqrt(np.linalg.norm(np.cross(self._by[:, 0], self._by[:, 1]), axis=1))
            spacing *= float(np.median(size))
        self._field = coarsened(body.texture, spacing)

    def at(
        self, points: Array, w: Array, face: NDArray[np.int64], weights: Array
    ) -> tuple[Array, Array] | None:
        """Return heights (n, k) [m] and their gradients (n, k, 3); None without texture."""
        if self._field is None:
            return None
        if self._places is None:
            return self._triplanar(points, w)
        place = weights @ self._places[face]
        found = self._field.derivatives(place[..., 0], place[..., 1])
        slopes = np.stack([found.h_u, found.h_v], axis=-1)
        return np.asarray(found.h), slopes @ self._by[face]

    def _triplanar(self, points: Array, w: Array) -> tuple[Array, Array]:
        assert self._field is not None
        share = np.abs(w) ** 4
        share /= share.sum(axis=-1, keepdims=True)
        height, slope = np.zeros(points.shape[:-1]), np.zeros(points.shape)
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            there = share[..., axis] > 1e-6
            part = share[..., axis][there]
            u, v = points[there][:, i] - self._origin[0], points[there][:, j] - self._origin[1]
            found = self._field.derivatives(u, v)
            height[there] += part * found.h
            slope[there, i] += part * found.h_u
            slope[there, j] += part * found.h_v
        return height, slope


def _gradients(mesh: Mesh, places: Array) -> Array:
    """Return the gradients of places (m, 3, 2) over each triangle, (m, 2, 3)."""
    points = mesh.vertices[mesh.faces]
    p, q = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    normal = np.cross(p, q)
    square = np.maximum(np.sum(normal**2, axis=1), 1e-300)[:, None]
    dual = np.stack([np.cross(q, normal) / square, np.cross(normal, p) / square], axis=1)
    steps = places[:, 1:] - places[:, :1]  # along p and q
    return np.asarray(np.swapaxes(steps, 1, 2) @ dual)
