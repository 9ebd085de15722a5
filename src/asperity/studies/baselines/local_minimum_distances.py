r"""Local minimum distances, and repulsion before contact.

Johnson & Willemsen, *Six degree-of-freedom haptic rendering of complex polygonal models* (2003);
Johnson, Willemsen & Cohen (2005). Every local minimum of the distance between the two surfaces
repels the tool if it is less than a stand-off distance s:

    F = sum_i k (s - d_i) n_i   where d_i < s,    T = sum_i (p_i - centre of mass) x F_i ,

p_i and q_i are the nearest points on tool and body, d_i = |p_i - q_i|, n_i = (p_i - q_i) / d_i. The
minima are found by traversing two trees of spheres and normal cones (`normal_cones`): a pair of
nodes is pruned if it is farther apart than s, or if no line between its spheres lies within both
cones. A remaining pair of triangles counts if no neighbour of either is nearer to the other.

Quoted from memory and from the beginning of the paper of 2005; the formulas of the paper of 2003
were not available. Asperity's own: the linear repulsion; local minima nearer to each other than
`merged` count as one, because otherwise a face on a face would push once for each triangle; and
surfaces that cross push with k s along their normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.geometry.bodies import Body
from asperity.scene.scene import Scene
from asperity.studies.baselines.displaced_surfaces import (
    displaced_surface,
    finite_reason,
    is_unbounded,
    spacing_for,
)
from asperity.studies.baselines.normal_cones import Tree, crossing, local_minima, tree_of
from asperity.studies.baselines.placement import Standing, centre_at, place_bodies
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
_MOST = 4096
"""Largest number of local minima of one body."""
_SAME_WAY = 0.9
"""Least cosine between the directions of local minima that count as one."""


@dataclass(eq=False)
class LmdRenderer(Renderer):
    """Renders the tree of the tool against those of the bodies around it."""

    tool: Tree
    others: list[tuple[Tree, Standing]]
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    stiffness: float
    """k [N/m]."""
    stand_off: float
    """s [m]."""
    merged: float
    """Local minima within this distance of one with a smaller distance are dropped [m]."""

    def __post_init__(self) -> None:
        self._points, self._distances = np.empty((_MOST, 3, 3)), np.empty(_MOST)
        self._crossing = np.empty((2, 3))
        self.looked = np.zeros(2, np.int64)
        """Numbers of visited pairs of nodes and of triangles."""

    def reset(self) -> None:
        """Reset the counts `looked`; the wrench depends on the pose alone."""
        self.looked[:] = 0

    def minima(self, pose: Array) -> tuple[Array, Array]:
        """Return the local minima at a pose (7,), the nearest first.

        Points (n, 3, 3): on the tool, on the body, and the unit direction from there to the tool,
        world axes; and distances (n,) [m]. Surfaces that cross add one at distance 0.
        """
        points, distances = [np.empty((0, 3, 3))], [np.empty(0)]
        for tree, there in self.others:
            rotation, shift = there.relative(pose)
            found = local_minima(
                self.tool, tree, rotation, shift, self.stand_off, self._points, self._distances,
                self.looked,
            )  # fmt: skip
            own = self._points[:found] @ there.rotation.T
            own[:, :2] += there.position
            points.append(own)
            distances.append(self._distances[:found].copy())
            if crossing(self.tool, tree, rotation, shift, self._crossing):
                place, direction = self._crossing @ there.rotation.T
                size = float(np.linalg.norm(direction))
                if size > 0.0:
                    place = place + there.position
                    points.append(np.array([[place, place, direction / size]]))
                    distances.append(np.zeros(1))
        return _merged(np.concatenate(points), np.concatenate(distances), self.merged)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        points, distances = self.minima(pose)
        if not len(distances):
            return NOTHING
        forces = self.stiffness * (self.stand_off - distances)[:, None] * points[:, 2]
        arms = points[:, 0] - centre_at(pose, self.centre)
        torque = np.cross(arms, forces).sum(axis=0)
        deepest = self.stand_off - float(distances[0])
        return MethodWrench(forces.sum(axis=0), torque, deepest, len(distances))


def _merged(points: Array, distances: Array, near: float) -> tuple[Array, Array]:
    """Return the local minima without those close to a smaller one of the same direction."""
    order = np.argsort(distances, kind="stable")
    points, distances = points[order], distances[order]
    kept: list[int] = []
    for i in range(len(distances)):
        if kept:
            away = np.linalg.norm(points[kept, 0] - points[i, 0], axis=1)
            same = points[kept, 2] @ points[i, 2] > _SAME_WAY
            if (same & (away < near)).any():
                continue
        kept.append(i)
    return points[kept], distances[kept]


@dataclass(frozen=True)
class LmdMethod(Method):
    """Local minimum distances between two surfaces.

    Parameters
    ----------
    detail : bool
        Use the displaced surfaces; otherwise the smooth ones.
    points : int
        Approximate largest number of points of a body's surface.
    stand_off : float
        Distance at which repulsion begins [m], above 0.
    """

    detail: bool
    points: int
    stand_off: float = 2e-3

    def __post_init__(self) -> None:
        require_positive("stand_off", self.stand_off, "m")

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        for body in scene.bodies:
            if is_unbounded(body):
                return f"{body.name} is an unbounded plane: no tree of triangles"
        return finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> LmdRenderer:
        """Return a renderer of a scene."""
        bodies = place_bodies(scene)
        others = [(self._tree(there.body), there) for there in bodies.standing]
        merged = max(self._spacing(there.body) for there in bodies.standing)
        return LmdRenderer(
            self._tree(bodies.tool), others, bodies.centre, stiffness=scene.force.stiffness,
            stand_off=self.stand_off, merged=2.0 * max(merged, self._spacing(bodies.tool)),
        )  # fmt: skip

    def _spacing(self, body: Body) -> float:
        return spacing_for(body, self.points)

    def _tree(self, body: Body) -> Tree:
        return tree_of(displaced_surface(body, self._spacing(body), smooth=not self.detail))


LOW = LmdMethod(
    "lmd", "local minimum distances", "Johnson & Willemsen 2003",
    "Of the smooth surfaces: it never feels a texture. Repulsion is linear from a stand-off of "
    "2 mm, so that nothing touches while less than k s presses.",
    detail=False, points=4000,
)  # fmt: skip
DETAIL = LmdMethod(
    "lmd-detail", "local minimum distances, displaced", "Johnson & Willemsen 2003",
    "Of the displaced surfaces, no finer than 60,000 points each; the authors had models of tens "
    "of thousands of triangles. Local minima come and go, and the force jumps where one does.",
    detail=True, points=60_000,
)  # fmt: skip
