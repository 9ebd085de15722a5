"""What point-based methods know of a contact: one point of the tool, and the surface over it.

A point-based method feels the world with a point, the *haptic interface point* p. Here it is the
place of the tool's smooth surface that lies deepest in a smooth body, found by the contact solver
on the scene without its textures. The tool's size, texture and orientation are felt only in where p
is; of several contacts the deepest counts.

Where the relief itself is touched, p must be known before it reaches the smooth surface: then the
surfaces are moved outwards by the height of the highest point of their textures, which is
subtracted from the depth again.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.broad_phase.mujoco_pairs import touchable
from asperity.contact.solver import ContactSolver
from asperity.geometry.bodies import Body, origin_of_map
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.simulation.tool_contact import announce_compiling
from asperity.studies.baselines.placement import (
    Standing,
    centre_at,
    place_bodies,
    tool_and_others,
)
from asperity.studies.baselines.protocol import NOTHING, MethodWrench

Array = NDArray[np.float64]


class Relief(NamedTuple):
    """A texture's height at a place of a smooth surface, and its derivatives along it."""

    height: float
    """h over the smooth surface [m]."""
    gradient: Array
    """Of h along the two tangents [-], (2,)."""
    hessian: Array
    """Of h along the two tangents [1/m], (2, 2)."""


class PointTouch(NamedTuple):
    """The point p at a pose. Vectors are in world axes."""

    there: Standing
    """The body that it touches."""
    point: Array
    """p [m], (3,)."""
    normal: Array
    """n, unit normal of the smooth body, (3,)."""
    tangents: Array
    """Two unit vectors perpendicular to n and to each other, (2, 3)."""
    depth: float
    """Of p below the smooth surface along n [m]; below 0 above it."""
    stiffness: float
    """k of the contact [N/m]."""
    friction: float
    """Coulomb's coefficient of the two surfaces [-]."""

    @property
    def foot(self) -> Array:
        """The place of the smooth surface over p [m], (3,)."""
        return self.point + self.depth * self.normal

    def relief(self, place: Array) -> Relief:
        """Return the body's texture at a `place` (3,) [m] of its smooth surface."""
        body = self.there.body
        field = body.texture
        if field is None:
            return Relief(0.0, np.zeros(2), np.zeros((2, 2)))
        u, v = ((place - self.there.position) @ self.there.rotation)[:2] - origin_of_map(body)
        h, h_u, h_v, h_uu, h_uv, h_vv = map(float, field.derivatives(u, v))
        # From steps along the tangents to steps on the map.
        on_map = (self.tangents @ self.there.rotation)[:, :2]
        slopes, bend = np.array([h_u, h_v]), np.array([[h_uu, h_uv], [h_uv, h_vv]])
        return Relief(h, on_map @ slopes, on_map @ bend @ on_map.T)

    def across(self, vector: Array) -> Array:
        """Return the part of a vector (3,) perpendicular to n."""
        return np.asarray(vector - (vector @ self.normal) * self.normal)


def point_reason(scene: Scene) -> str | None:
    """Return why a point-based method cannot render a scene, or None."""
    for body in scene.bodies:
        if body.mesh is not None:
            return f"a law of one point on simple solids, and {body.name} is a mesh"
    _, others = tool_and_others(scene)
    for body in others:
        if body.texture is not None and body.mapping != "planar":
            return f"made for planar maps, and that of {body.name} is {body.mapping}"
    return None


class PointProbe:
    """Finds the tool's point p at a pose.

    Parameters
    ----------
    scene : Scene
        Its textures count only if `raised`.
    raised : bool
        Whether p is found wherever it may touch the relief, not only below the smooth surface.
    """

    def __init__(self, scene: Scene, *, raised: bool) -> None:
        announce_compiling()
        placed = place_bodies(scene)
        self.centre = placed.centre
        """The tool's centre of mass in its frame [m], (3,)."""
        self._standing = {there.body.name: there for there in placed.standing}
        self._names = [body.name for body in scene.bodies]
        self._lifts = [0.0] * len(scene.bodies)
        bodies, model = [], copy.copy(scene.model)
        for i, body in enumerate(scene.bodies):
            if raised and body.texture is not None and body.name != scene.tool:
                # A spline is bounded by its coefficients, which exceed the samples.
                self._lifts[i] = max(float(body.texture.coefficients.max()), 0.0)
            bodies.append(_raised(body, self._lifts[i]))
            for geom, name in touchable(model):
                if name == body.name:
                    # The solver takes from MuJoCo which geoms are near.
                    model.geom_margin[geom] += self._lifts[i]
        force = scene.changed(force={"law": "otaduy-lin", "gradient": None}).force
        self._stiffness = force.stiffness
        self._solver = ContactSolver(model, bodies, scene.tool, force)

    def touch(self, pose: Array) -> PointTouch | None:
        """Return p at a pose (7,), None if it is nowhere near."""
        self._solver.wrench(pose, 0.0)
        contacts = self._solver.contacts
        count = int(contacts.count[0])
        if count == 0:
            return None
        i = int(np.argmax(contacts.depth[:count]))
        number = int(contacts.body[i])
        normal = contacts.normal[i].copy()
        return PointTouch(
            self._standing[self._names[number]],
            contacts.point[i].copy(),
            normal,
            _tangents(normal),
            float(contacts.depth[i]) - self._lifts[number],
            float(contacts.weight[i]) * self._stiffness,
            float(contacts.friction[i]),
        )

    def wrench(self, pose: Array, touch: PointTouch, force: Array, depth: float) -> MethodWrench:
        """Return a force (3,) [N] at p as a wrench; nothing if its depth [m] is not above 0."""
        if depth <= 0.0:
            return NOTHING
        arm = touch.point - centre_at(pose, self.centre)
        return MethodWrench(force, np.cross(arm, force), depth, 1)

    def reset(self) -> None:
        """Forget all previous poses."""
        self._solver.reset()


def _raised(body: Body, by: float) -> Body:
    """Return a smooth body, its surface moved outwards by a distance [m]."""
    geoms = []
    for geom in body.geoms:
        if geom.kind == "plane":
            up = rotation_of(geom.quaternion)[:, 2]
            geoms.append(replace(geom, position=(geom.position + by * up).tolist()))
        else:
            size = [side + by if side > 0.0 else side for side in geom.size]
            # The half length of a capsule is that of its axis.
            size[1] -= by if geom.kind == "capsule" else 0.0
            geoms.append(replace(geom, size=size))
    return replace(body, texture=None, geoms=geoms)


def _tangents(normal: Array) -> Array:
    """Return two unit vectors (2, 3) perpendicular to a unit vector and to each other."""
    # Of a level surface they are x and y.
    along = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])
