"""Pressure and shear of a rigid tool on a grid over the side that it touches with.

A rigid contact is a point: it is spread over the cells near it (`contact.taxel_forces`), so that
their forces add up to the wrench. How far is chosen, not computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.contact.contacts import Contacts
from asperity.contact.soft.skin import grid_axes
from asperity.contact.solver import ContactSolver
from asperity.contact.taxel_forces import TaxelForces
from asperity.drawing.renderer.raster import Buffers, draw_triangles
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.geometry.facets.tessellate import geom_triangles
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.simulation.press import touching_pose
from asperity.simulation.soft_engine import soft_engine

_NEAR, _NEAR_PART = 2e-3, 0.1
"""The grid covers what is as high as the first contact, but for this [m], or this part of the
tool's height."""
_COARSE = 96
"""Cells along a side of the grid that finds it."""


def field_engine(scene: Scene) -> Any:
    """Return what computes the fields of a scene at a pose: for its soft body, or its rigid tool.

    It has `reset()`, `wrench(pose, dt)`; `grid` with `taxels` and `extent`; and `skin` with the
    last pose's `pressure`, `shear` and `contact_area`.
    """
    return soft_engine(scene) or ToolTaxels(scene)


class ToolTaxels:
    """Taxels on the side of a scene's rigid tool that faces down in its first pose.

    They cover what is as high as the place that touches when the tool is let down there.

    Parameters
    ----------
    scene : Scene
    solver : ContactSolver, optional
        Of the scene, by which the first contact is found; it is reset. By default a new one.
    taxels : (2,) of int
        Rows and columns of the grid.

    Attributes
    ----------
    taxels : (2,) of int
    extent : (4,) of float
        Ends of the grid along columns, and along rows, in the tool's frame [m]: first, last, first,
        last.
    pressure : (rows, columns) array
        Force against the direction that the grid faces, over a cell's area [Pa]. Below 0 where a
        torque has to be matched.
    shear : (rows, columns, 2) array
        Force along columns and rows, over a cell's area [Pa].
    """

    def __init__(
        self,
        scene: Scene,
        solver: ContactSolver | None = None,
        *,
        taxels: tuple[int, int] = (32, 32),
    ) -> None:
        self.taxels = taxels
        self._axes = grid_axes(-rotation_of(scene.start[3:])[2])
        self._solver = solver or ContactSolver(
            scene.model, scene.bodies, scene.tool, scene.acting_force
        )
        body = next(body for body in scene.bodies if body.name == scene.tool)
        points, triangles = _triangles(body)
        points = points @ self._axes.T
        (first, low, bottom), (last, high, top) = points.min(axis=0), points.max(axis=0)
        cells, reach = _reach(points, triangles, (first, last, low, high), (_COARSE, _COARSE))
        off = np.abs(reach - self._level(scene, top))
        near = cells[off <= max(_NEAR, _NEAR_PART * (top - bottom))]
        if not len(near):
            raise AsperityError(f"{scene.name}: no side of the tool {scene.tool!r} faces down")
        half = 0.5 * np.array([last - first, high - low]) / _COARSE
        one, two = near.min(axis=0) - half, near.max(axis=0) + half
        self.extent = (float(one[0]), float(two[0]), float(one[1]), float(two[1]))
        cells, reach = _reach(points, triangles, self.extent, taxels)
        self._cells = np.flatnonzero(np.isfinite(reach))
        places = np.column_stack([cells, reach])[self._cells] @ self._axes
        first, last, low, high = self.extent
        self._area = (last - first) * (high - low) / (taxels[0] * taxels[1])
        self._forces = TaxelForces(places, 1.5 * float(np.sqrt(self._area)))
        self.pressure, self.shear = np.zeros(taxels), np.zeros((*taxels, 2))

    @property
    def grid(self) -> ToolTaxels:
        """Where the fields are."""
        return self

    @property
    def skin(self) -> ToolTaxels:
        """The fields of the last pose."""
        return self

    @property
    def spread(self) -> float:
        """Standard deviation of the bell over which a contact is spread [m]."""
        return self._forces.spread

    @property
    def contact_area(self) -> float:
        """Area of the cells that bear more than a hundredth of the largest pressure [m^2]."""
        return float(np.count_nonzero(self.pressure > 0.01 * self.pressure.max()) * self._area)

    def _level(self, scene: Scene, lowest: float) -> float:
        """Return how far down the first contact is along the grid's third axis [m].

        The tool's lowest point where it meets nothing.
        """
        solver = self._solver
        try:
            pose = touching_pose(solver, scene.start)
        except AsperityError:
            return lowest
        point = solver.contacts.point[0] - pose[:3]
        solver.reset()
        return float(self._axes[2] @ (point @ rotation_of(pose[3:])))

    def fill(self, pose: Array, contacts: Contacts, wrench: Array, centre: Array) -> None:
        """Fill `pressure` and `shear` with what `TaxelForces.of_tool` gives; see there."""
        forces = self._forces.of_tool(pose, contacts, wrench, centre)
        traction = forces @ (rotation_of(pose[3:]) @ self._axes.T) / self._area
        self.pressure.ravel()[self._cells] = -traction[:, 2]
        self.shear.reshape(-1, 2)[self._cells] = traction[:, :2]

    def reset(self) -> None:
        """Forget the last pose."""
        self._solver.reset()

    def wrench(self, pose: Array, dt: float) -> Array:
        """Solve the contact at a pose, fill the fields, and return the wrench (6,)."""
        wrench = self._solver.wrench(pose, dt)
        self.fill(pose, self._solver.contacts, wrench, self._solver.centre)
        return wrench


def _triangles(body: Body) -> tuple[Array, Indices]:
    """Return the points (n, 3) and triangles (m, 3) of a body's smooth surface, in its frame."""
    if body.mesh is not None:
        return body.mesh.vertices, body.mesh.faces
    points, triangles, count = [], [], 0
    for geom in body.geoms:
        vertices, faces, _, _ = geom_triangles(geom)
        points.append(vertices @ rotation_of(geom.quaternion).T + np.asarray(geom.position))
        triangles.append(faces + count)
        count += len(vertices)
    return np.concatenate(points), np.concatenate(triangles)


def _reach(
    points: Array, triangles: Indices, extent: Sequence[float], shape: tuple[int, int]
) -> tuple[Array, Array]:
    """Return the middles of cells, row by row (n, 2), and how far towards z triangles reach there.

    [m], (n,); -inf where there are none.
    """
    first, last, low, high = extent
    rows, columns = shape
    width, length = (last - first) / columns, (high - low) / rows
    places = np.column_stack([
        (points[:, 0] - first) / width - 0.5, (points[:, 1] - low) / length - 0.5, -points[:, 2]
    ])  # fmt: skip
    seen = Buffers(np.full(shape, np.inf), np.zeros((*shape, 3)), np.full(shape, -1))
    draw_triangles(places, np.zeros_like(points), triangles.astype(np.int64), 0.0, 0, seen)
    v, u = np.mgrid[0:rows, 0:columns]
    cells = np.column_stack([first + (u.ravel() + 0.5) * width, low + (v.ravel() + 0.5) * length])
    return cells, -seen.depth.ravel()
