r"""Penalty contact of the displaced meshes themselves, at full detail, by python-fcl.

Section 3.3 of Otaduy & Lin (2004) calls full-resolution models the ideal, but computationally
prohibitive. Here they are: the displaced surfaces of both bodies, as triangles, in the hierarchies
of FCL (Pan, Chitta & Manocha 2012). For overlapping meshes FCL returns the pairs of triangles that
cross, each with a depth no larger than the triangle, but no directional depth. So the depth is
computed from its definition, as the least translation along n that separates the tool:

    delta = least t >= 0 with  (tool + t n)  free of the body,    F = k delta m,    T = r x F,

by bisection, starting from the depth of the last tick. n is the mean normal, weighted by area, of
the part of the body's *smooth* surface that is inside the tool (see `crossing_curve`); m is the
common normal of the triangles that touch last, scaled to m . n = 1, and r is the lever arm of the
middle of where they do, moved back by delta. This is asperity's force (see `contact.response`)
computed in another way, with one contact for each body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.studies.baselines.crossing_curve import crossing_segments, middle_of, vector_area
from asperity.studies.baselines.displaced_surfaces import (
    DisplacedSurface,
    displaced_surface,
    finite_reason,
    is_unbounded,
    spacing_for,
)
from asperity.studies.baselines.placement import Standing, centre_at, place_bodies
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
_PER_WAVE = 12.0
"""Sufficient number of points per shortest wave of a texture."""
_SMOOTH_POINTS = 4_000
_FIRST = 2e-5
"""First step of the search beyond the last tick's depth; later steps double [m]."""
_DEEPEST = 1e-2
"""Largest depth that is searched [m]."""
_LAST = 10_000
"""Largest number of pairs of triangles requested; only some of them would be a curve with gaps."""
_FACING = 0.2
"""Least cosine to n of the normal of a touching triangle that is not a side wall."""


class Meshes:
    """The full-detail mesh and the smooth mesh of a body, for FCL."""

    def __init__(self, full: DisplacedSurface, smooth: DisplacedSurface) -> None:
        mean = full.normals[full.faces].sum(axis=1)
        self.normals = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
        """Means of the normals at each triangle's corners, (m, 3)."""
        self.object, self.smooth = _object(full), _object(smooth)
        self._corners = {id(self.object): full.points[full.faces]}
        self._corners[id(self.smooth)] = smooth.points[smooth.faces]

    def place(self, rotation: Array, position: Array) -> None:
        """Set the pose of both meshes."""
        import fcl

        for mesh in (self.object, self.smooth):
            mesh.setTransform(fcl.Transform(rotation, position))

    def triangles(self, mesh: Any, which: list[int]) -> Array:
        """Return the corners (k, 3, 3) of triangles of `object` or `smooth` in the world [m]."""
        corners = self._corners[id(mesh)][which]
        return np.asarray(corners @ mesh.getRotation().T + mesh.getTranslation())


def _object(surface: DisplacedSurface) -> Any:
    import fcl

    mesh = fcl.BVHModel()
    mesh.beginModel(len(surface.points), len(surface.faces))
    mesh.addSubModel(surface.points, surface.faces)
    mesh.endModel()
    return fcl.CollisionObject(mesh, fcl.Transform())


@dataclass(eq=False)
class FullMeshRenderer(Renderer):
    """Renders the meshes of a tool against those of the other bodies."""

    tool: Meshes
    others: list[tuple[Meshes, Standing]]
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    stiffness: float
    """k [N/m]."""
    tolerance: float
    """Tolerance of the depth [m]."""
    queries: int = field(default=0, init=False)
    """Number of queries to FCL."""

    def __post_init__(self) -> None:
        for meshes, there in self.others:
            meshes.place(there.rotation, there.position)
        self.reset()

    def reset(self) -> None:
        """Forget the depths and normals of the last tick."""
        self._last = np.zeros(len(self.others))
        self._normals: list[Array | None] = [None] * len(self.others)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        rotation = rotation_of(pose[3:])
        middle = centre_at(pose, self.centre)
        force, torque, deepest, count = np.zeros(3), np.zeros(3), 0.0, 0
        for i, (other, there) in enumerate(self.others):
            self.tool.place(rotation, pose[:3])
            if not self._collide(self.tool.object, other.object, 1):
                self._last[i], self._normals[i] = 0.0, None
                continue
            n = self._direction(i, other)
            if n is None:
                continue
            depth, found = self._separate(other, rotation, pose[:3], n, self._last[i])
            self._last[i] = depth
            m, place = self._touch(other, there, rotation, n, found)
            push = self.stiffness * depth * m
            force += push
            torque += np.cross(place - depth * n - middle, push)
            deepest, count = max(deepest, depth), count + 1
        return MethodWrench(force, torque, deepest, count) if count else NOTHING

    def _collide(self, one: Any, other: Any, most: int) -> list[Any]:
        import fcl

        self.queries += 1
        found = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=most, enable_contact=most > 1)
        fcl.collide(one, other, request, found)
        return list(found.contacts) if most > 1 else [True] * bool(found.is_collision)

    def _direction(self, i: int, other: Meshes) -> Array | None:
        """Return n: from the smooth meshes if they cross, otherwise that of the last tick."""
        found = self._curve(other, self.tool.smooth, other.smooth)
        if not found.any() and self._normals[i] is None:
            # Only asperities touch: use their triangles.
            found = self._curve(other, self.tool.object, other.object)
        size = float(np.linalg.norm(found))
        if size > 0.0:
            self._normals[i] = found / size
        return self._normals[i]

    def _curve(self, other: Meshes, one: Any, two: Any) -> Array:
        """Return the vector area of `two` inside `one`, (3,) [m^2]; zero without contact."""
        found = self._collide(one, two, _LAST)
        return vector_area(self._segments(other, one, two, found))

    def _segments(self, other: Meshes, one: Any, two: Any, found: list[Any]) -> Array:
        """Return the segments (k, 2, 3) along which pairs of triangles cross."""
        pairs = sorted({(contact.b1, contact.b2) for contact in found})
        return crossing_segments(
            self.tool.triangles(one, [i for i, _ in pairs]),
            other.triangles(two, [j for _, j in pairs]),
        )

    def _separate(
        self, other: Meshes, rotation: Array, position: Array, n: Array, guess: float
    ) -> tuple[float, list[Any]]:
        """Return the depth along n, and the pairs of triangles that touch just before it."""

        def meets(t: float, most: int = 1) -> list[Any]:
            self.tool.place(rotation, position + t * n)
            return self._collide(self.tool.object, other.object, most)

        low, high, step = 0.0, guess + _FIRST, _FIRST
        while meets(high) and high < _DEEPEST:
            low, high, step = high, high + 2.0 * step, 2.0 * step
        if low == 0.0 and guess - _FIRST > 0.0:
            # Free beyond the last depth: step back until the meshes cross.
            step = _FIRST
            low = guess - step
            while low > 0.0 and not meets(low):
                high, low, step = low, low - 2.0 * step, 2.0 * step
            low = max(low, 0.0)
        while high - low > self.tolerance:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if meets(middle) else (low, middle)
        # Slightly deeper: coplanar faces touch in no particular place.
        return low, meets(max(low - 0.5 * self.tolerance, 0.0), _LAST)

    def _touch(
        self, other: Meshes, there: Standing, rotation: Array, n: Array, found: list[Any]
    ) -> tuple[Array, Array]:
        """Return m and the place where the meshes touch."""
        if not found:
            return n, self.tool.object.getTranslation()
        curve = self._segments(other, self.tool.object, other.object, found).reshape(-1, 3)
        points = curve if len(curve) else np.array([contact.pos for contact in found])
        place = middle_of(points, n)
        of_tool = self.tool.normals[[contact.b1 for contact in found]] @ rotation.T
        of_other = other.normals[[contact.b2 for contact in found]] @ there.rotation.T
        # Side walls that end at the contact do not count; all triangles may be such walls.
        across = _facing(of_other, n) + _facing(-of_tool, n)
        along = float(across @ n)
        return (across / along if along > 0.0 else n), place


def _facing(normals: Array, n: Array) -> Array:
    """Return the mean of those normals (k, 3) that face along n; zero if none does."""
    those = normals[normals @ n > _FACING]
    return np.asarray(those.mean(axis=0) if len(those) else np.zeros(3))


@dataclass(frozen=True)
class FullMeshMethod(Method):
    """Penalty contact of meshes of full detail.

    Parameters
    ----------
    points : int
        Approximate largest number of points of a body's mesh.
    tolerance : float
        Tolerance of the depth [m].
    """

    name: str = "full-meshes"
    label: str = "full-detail meshes"
    source: str = "Otaduy & Lin 2004, section 3.3; FCL: Pan, Chitta & Manocha 2012"
    what_it_is_not: str = (
        "Not the constraint-based simulation that the paper calls ideal: a penalty, along one "
        "direction for each body."
    )
    points: int = 150_000
    tolerance: float = 1e-6

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        try:
            import fcl  # noqa: F401
        except ImportError:
            return "python-fcl is not installed: pip install 'asperity[compare]'"
        return finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> FullMeshRenderer:
        """Return a renderer of a scene."""
        bodies = place_bodies(scene)
        others = [(self._meshes(there.body), there) for there in bodies.standing]
        tool = self._meshes(bodies.tool)
        stiffness = scene.force.stiffness
        return FullMeshRenderer(tool, others, bodies.centre, stiffness, self.tolerance)

    def _meshes(self, body: Body) -> Meshes:
        spacing = spacing_for(body, self.points)
        if body.texture is not None:
            spacing = max(spacing, body.texture.shortest_wavelength / _PER_WAVE)
        elif body.mesh is None and not is_unbounded(body):
            # The sagitta of a chord of a circle is its square over 8 radii.
            roundest = min(geom.smallest for geom in body.geoms)
            spacing = max(spacing, math.sqrt(8.0 * roundest * self.tolerance))
        coarse = displaced_surface(body, spacing_for(body, _SMOOTH_POINTS), smooth=True)
        return Meshes(displaced_surface(body, spacing), coarse)


FULL_MESHES = FullMeshMethod()
