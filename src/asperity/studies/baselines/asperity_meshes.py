"""Asperity's mesh contact on the displaced surfaces themselves, without low resolution and texture.

Full-resolution models are what section 3.3 of Otaduy & Lin (2004) calls ideal. They are here the
meshes of `full_meshes`, at the resolution that asperity affords: its mesh contact is made for some
hundreds of triangles with a texture on them, and looks at every pair of facets that may touch.
Depth, directions and force are those of `contact`; facets in place of splines let m leap from facet
to facet.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.solver import ContactSolver
from asperity.errors import require_between
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.mesh.topology import crosses
from asperity.scene.scene import Scene
from asperity.simulation.tool_contact import announce_compiling
from asperity.studies.baselines.asperity_laws import SolverRenderer
from asperity.studies.baselines.constraint import add_geoms, quaternion_of
from asperity.studies.baselines.displaced_surfaces import (
    displaced_surface,
    finite_reason,
    spacing_for,
)
from asperity.studies.baselines.placement import place_bodies
from asperity.studies.baselines.protocol import Method

_PER_WAVE = 12.0
"""Sufficient number of points per shortest wave of a texture."""
_NARROW = 2e-6
"""Triangles at seams that are narrower have no normal to speak of, and are left out [m]."""


def meshed_body(body: Body, points: int) -> Body:
    """Return a body whose displaced surface, of about so many points, is a mesh without texture.

    For the broad phase it has one geom: the box around it. A simple solid without texture stays.
    """
    mesh = body.mesh
    if body.texture is not None:
        finest = body.texture.shortest_wavelength / _PER_WAVE
        surface = displaced_surface(body, max(spacing_for(body, points), finest))
        faces = surface.faces[_widths(surface.points[surface.faces]) > _NARROW]
        mesh = mesh_from_arrays(surface.points, faces, hard_angle=0.0, name=body.name)
    if mesh is None:
        return body
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    box = Geom("mesh", np.maximum(0.5 * (high - low), 1e-6), 0.5 * (low + high))
    return Body(body.name, [box], mesh=mesh)


def _widths(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return twice the areas of triangles (n, 3, 3) over their longest sides [m], (n,)."""
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    return np.asarray(np.linalg.norm(crosses(triangles), axis=1) / sides.max(axis=1))


def meshed_model(scene: Scene, bodies: tuple[Body, ...]) -> mujoco.MjModel:
    """Return a model of meshed bodies at their places, with the corners of each mesh's box."""
    placed = place_bodies(scene)
    poses = {there.body.name: there for there in placed.standing}
    spec = mujoco.MjSpec()
    for body in bodies:
        made = spec.worldbody.add_body(name=body.name)
        if body.name == scene.tool:
            made.add_freejoint()
            made.explicitinertial, made.mass, made.ipos = True, 1e-2, placed.centre
            made.inertia = [1e-6] * 3
        else:
            there = poses[body.name]
            made.pos, made.quat = there.position, quaternion_of(there.rotation)
        if body.mesh is None:
            add_geoms(made, body, {})
            continue
        (box,) = body.geoms
        # In single precision a corner may come to lie inside.
        half = (1.0 + 1e-6) * np.asarray(box.size)
        corners = np.array([*itertools.product((-1.0, 1.0), repeat=3)]) * half + box.position
        spec.add_mesh(name=body.name, uservert=corners.ravel())
        made.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=body.name)
    return spec.compile()


class MeshedRenderer(SolverRenderer):
    """Renders a scene by a `ContactSolver` of its meshed bodies."""

    def __init__(self, scene: Scene, points: int, dt: float) -> None:
        announce_compiling()
        bodies = tuple(meshed_body(body, points) for body in scene.bodies)
        model = meshed_model(scene, bodies)
        self.solver = ContactSolver(model, bodies, scene.tool, scene.force)
        self._dt = dt


@dataclass(frozen=True)
class MeshedMethod(Method):
    """Asperity's contact of plain meshes of full detail.

    Parameters
    ----------
    points : int
        Approximate largest number of points of a body's mesh, 100 to 200,000.
    """

    name: str = "asperity-meshes"
    label: str = "asperity on full-detail meshes"
    source: str = "Otaduy & Lin 2004, section 3.3"
    what_it_is_not: str = (
        "Not the constraint-based simulation that the paper calls ideal: asperity's penalty on "
        "flat facets, no finer than 15,000 points a body."
    )
    points: int = 15_000

    def __post_init__(self) -> None:
        require_between("points", self.points, 100, 200_000)

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        for body in scene.bodies:
            if any(geom.surface is not None for geom in body.geoms):
                return f"made for one texture on a body, and geoms of {body.name} have their own"
        return finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> MeshedRenderer:
        """Return a renderer of a scene."""
        return MeshedRenderer(scene, self.points, dt)


MESHED = MeshedMethod()
