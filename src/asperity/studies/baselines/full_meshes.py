r"""Penalty contact of the displaced meshes themselves, at full detail, by python-fcl.

Section 3.3 of Otaduy & Lin (2004) names full-resolution models the ideal and puts them aside as
computationally prohibitive. Here they are: both bodies' surfaces displaced for real, as triangles,
in the hierarchies of FCL (Pan, Chitta & Manocha 2012). What FCL says of two meshes that overlap
is their triangles that cross, each with a depth of its own that is no deeper than the triangle; no
directional depth comes out. So the depth is found as it is defined, as the least way along n that
takes the tool off:

    delta = least t >= 0 with  (tool + t n)  free of the body,    F = k delta m,    T = r x F,

by bisection, from the depth of the last tick outwards. n is the mean normal of the crossing
triangles of the *smooth* meshes; m is the common normal of the triangles that touch last, scaled to
m . n = 1, and r the arm of the place where they do, moved back by delta. That is asperity's own
force (see `forces.laws`) by another way, one contact for each body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.studies.baselines.displaced_surfaces import (
    DisplacedSurface,
    displaced_surface,
    finite_reason,
    is_unbounded,
    spacing_for,
)
from asperity.studies.baselines.placement import Standing, placed, require
from asperity.studies.baselines.protocol import NOTHING, MethodWrench

Array = NDArray[np.float64]
_PER_WAVE = 12.0
"""Points to a texture's shortest wave that are fine enough."""
_SMOOTH_POINTS = 4_000
_FIRST = 2e-5
"""How far the first look goes beyond the last tick's depth, and on from there doubling [m]."""
_DEEPEST = 1e-2
"""Beyond which a tool is not followed [m]."""
_LAST = 10_000
"""Most pairs of triangles that are asked for: of some of them the mean would lie to one side."""
_FACING = 0.2
"""Cosine to n from which a triangle that touches is no wall."""


class Meshes:
    """A mesh of full detail and a smooth one of the same body, for FCL."""

    def __init__(self, full: DisplacedSurface, smooth: DisplacedSurface) -> None:
        self.full = full
        self.normals = _face_normals(full)
        self.object, self.smooth = _object(full), _object(smooth)

    def place(self, rotation: Array, position: Array) -> None:
        """Put both there."""
        import fcl

        for mesh in (self.object, self.smooth):
            mesh.setTransform(fcl.Transform(rotation, position))


def _object(surface: DisplacedSurface) -> Any:
    import fcl

    mesh = fcl.BVHModel()
    mesh.beginModel(len(surface.points), len(surface.faces))
    mesh.addSubModel(surface.points, surface.faces)
    mesh.endModel()
    return fcl.CollisionObject(mesh, fcl.Transform())


def _face_normals(surface: DisplacedSurface) -> Array:
    """Return the mean of the normals at each triangle's corners, (m, 3)."""
    mean = surface.normals[surface.faces].sum(axis=1)
    return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12))


class FullMeshRenderer:
    """A tool's meshes and those of the bodies that it meets."""

    def __init__(
        self, tool: Meshes, others: list[tuple[Meshes, Standing]], centre: Array,
        stiffness: float, tolerance: float,
    ) -> None:  # fmt: skip
        self.tool, self.others = tool, others
        self._centre, self._stiffness, self._tolerance = centre, stiffness, tolerance
        for meshes, there in others:
            meshes.place(there.rotation, there.position)
        self.queries = 0
        """How often FCL was asked so far."""
        self.reset()

    def reset(self) -> None:
        """Forget the depths of the last tick."""
        self._last = np.zeros(len(self.others))
        self._normals: list[Array | None] = [None] * len(self.others)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        rotation = rotation_of(pose[3:])
        middle = pose[:3] + rotation @ self._centre
        force, torque, deepest, count = np.zeros(3), np.zeros(3), 0.0, 0
        for i, (other, there) in enumerate(self.others):
            self.tool.place(rotation, pose[:3])
            if not self._ask(self.tool.object, other.object, 1):
                self._last[i], self._normals[i] = 0.0, None
                continue
            n = self._direction(i, other)
            if n is None:
                continue
            depth, found = self._separate(other, rotation, pose[:3], n, self._last[i])
            self._last[i] = depth
            m, place = self._touch(other, there, rotation, n, found)
            push = self._stiffness * depth * m
            force += push
            torque += np.cross(place - depth * n - middle, push)
            deepest, count = max(deepest, depth), count + 1
        return MethodWrench(force, torque, deepest, count) if count else NOTHING

    def _ask(self, one: Any, other: Any, most: int) -> list[Any]:
        import fcl

        self.queries += 1
        found = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=most, enable_contact=most > 1)
        fcl.collide(one, other, request, found)
        return list(found.contacts) if most > 1 else [True] * bool(found.is_collision)

    def _direction(self, i: int, other: Meshes) -> Array | None:
        """Return n: of the smooth meshes where they cross, else of the last tick."""
        found = self._ask(self.tool.smooth, other.smooth, _LAST)
        if found:
            mean = -np.sum([contact.normal for contact in found], axis=0)
            size = float(np.linalg.norm(mean))
            if size > 0.0:
                self._normals[i] = mean / size
        if self._normals[i] is None:
            # Only asperities meet: their own triangles have to do.
            found = self._ask(self.tool.object, other.object, _LAST)
            mean = -np.sum([contact.normal for contact in found], axis=0)
            self._normals[i] = mean / max(float(np.linalg.norm(mean)), 1e-12)
        return self._normals[i]

    def _separate(
        self, other: Meshes, rotation: Array, position: Array, n: Array, guess: float
    ) -> tuple[float, list[Any]]:
        """Return the depth along n, and the pairs of triangles that touch just before it."""

        def meets(t: float, most: int = 1) -> list[Any]:
            self.tool.place(rotation, position + t * n)
            return self._ask(self.tool.object, other.object, most)

        low, high, step = 0.0, guess + _FIRST, _FIRST
        while meets(high) and high < _DEEPEST:
            low, high, step = high, high + 2.0 * step, 2.0 * step
        if low == 0.0 and guess - _FIRST > 0.0:
            # Free beyond the last depth: is it still there a little below?
            step = _FIRST
            low = guess - step
            while low > 0.0 and not meets(low):
                high, low, step = low, low - 2.0 * step, 2.0 * step
            low = max(low, 0.0)
        while high - low > self._tolerance:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if meets(middle) else (low, middle)
        # A little deeper: flat faces that lie in each other meet in no place in particular.
        return low, meets(max(low - 0.5 * self._tolerance, 0.0), _LAST)

    def _touch(
        self, other: Meshes, there: Standing, rotation: Array, n: Array, found: list[Any]
    ) -> tuple[Array, Array]:
        """Return m and the place where the meshes touch."""
        if not found:
            return n, self.tool.object.getTranslation()
        place = np.mean([contact.pos for contact in found], axis=0)
        ours = self.tool.normals[[contact.b1 for contact in found]] @ rotation.T
        theirs = other.normals[[contact.b2 for contact in found]] @ there.rotation.T
        # Walls that end where the bodies touch say nothing of the way off; all may be walls.
        across = _facing(theirs, n) + _facing(-ours, n)
        along = float(across @ n)
        return (across / along if along > 0.0 else n), place


def _facing(normals: Array, n: Array) -> Array:
    """Return the mean of the normals (k, 3) that face along n, zero if none does."""
    those = normals[normals @ n > _FACING]
    return np.asarray(those.mean(axis=0) if len(those) else np.zeros(3))


@dataclass(frozen=True)
class FullMeshMethod:
    """Penalty contact of meshes of full detail.

    Parameters
    ----------
    points : int
        Most points of a body's mesh, about.
    tolerance : float
        Of the depth [m].
    """

    points: int = 150_000
    tolerance: float = 1e-6
    name: str = "full-meshes"
    label: str = "full-detail meshes"
    source: str = "Otaduy & Lin 2004, section 3.3; FCL: Pan, Chitta & Manocha 2012"
    what_it_is_not: str = (
        "Not the constraint-based simulation that the paper calls ideal: a penalty, along one "
        "direction for each body."
    )

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        try:
            import fcl  # noqa: F401
        except ImportError:
            return "python-fcl is not installed: pip install 'asperity[compare]'"
        return next(filter(None, map(finite_reason, scene.bodies)), None)

    def prepare(self, scene: Scene, *, dt: float = 1e-3) -> FullMeshRenderer:
        """Return a renderer of a scene."""
        require(self.can(scene), self.label, scene)
        bodies = placed(scene)
        others = [(self._meshes(there.body), there) for there in bodies.standing]
        tool = self._meshes(bodies.tool)
        stiffness = scene.force.stiffness
        return FullMeshRenderer(tool, others, bodies.centre, stiffness, self.tolerance)

    def _meshes(self, body: Body) -> Meshes:
        spacing = spacing_for(body, self.points)
        if body.texture is not None:
            spacing = max(spacing, body.texture.shortest_wavelength / _PER_WAVE)
        elif body.mesh is None and not is_unbounded(body):
            # A chord of a circle is off it by its square over 8 radii.
            roundest = min(geom.smallest for geom in body.geoms)
            spacing = max(spacing, math.sqrt(8.0 * roundest * self.tolerance))
        coarse = displaced_surface(body, spacing_for(body, _SMOOTH_POINTS), smooth=True)
        return Meshes(displaced_surface(body, spacing), coarse)


FULL_MESHES = FullMeshMethod()
