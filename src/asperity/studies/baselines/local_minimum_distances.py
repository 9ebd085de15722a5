r"""Local minimum distances, and repulsion before contact.

Johnson & Willemsen, *Six degree-of-freedom haptic rendering of complex polygonal models* (2003);
*Accelerated haptic rendering of polygonal models through local descent* (2004); Johnson, Willemsen
& Cohen, *6-DOF haptic rendering using spatialized normal cone search* (2005). Every local minimum
of the distance between the two surfaces repels the tool if it is less than a stand-off distance s:

    F = sum_i k (s - d_i) n_i   where d_i < s,    T = sum_i (p_i - centre of mass) x F_i ,

with the nearest points p_i on the tool and q_i on the body, d_i = |p_i - q_i| and
n_i = (p_i - q_i) / d_i. The minima are found by traversing two trees of spheres and normal cones
(`normal_cones`): a pair of nodes is pruned if it is farther apart than s, or if no line between its
spheres lies within both cones. A remaining pair of triangles counts if its nearest points, on a
face, an edge or a vertex, are a local minimum (`local_minima`).

Read: title and abstract of the papers, and the beginning of that of 2005; the rest of the papers
was not available (`docs/methods/johnson-willemsen.md`). Asperity's own: the linear repulsion; one
minimum, in the middle of the overlap, for each connected set of pairs that are equally distant
within a band (`minimum_regions`); a push by k s, in the middle of the line in which they cross, of
surfaces that cross; no descent from the minima of the last tick, as that of 2004: every tick is a
full search.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.geometry.bodies import Body, covers
from asperity.scene.scene import Scene
from asperity.studies.baselines.displaced_surfaces import finite_reason
from asperity.studies.baselines.local_minima import RigidMotion, crossing, near_pairs, room_for
from asperity.studies.baselines.minimum_regions import minima_of
from asperity.studies.baselines.normal_cones import Tree
from asperity.studies.baselines.placement import Standing, centre_at, place_bodies
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer
from asperity.studies.baselines.smooth_surfaces import tree_of_body

Array = NDArray[np.float64]
_TOUCHING = 1e-8
"""Surfaces nearer than this touch, and need not cross to push with k s [m]."""
_OUT = 1e-6
"""Distance over the surface at which it is tested whether another geom covers it [m]."""


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
    band: float = 5e-6
    """Distances that differ by less count as equal [m]."""
    tool_body: Body | None = None
    """The body of the tool, if its geoms may cover each other's surfaces."""

    def __post_init__(self) -> None:
        self._room = room_for(1024)
        self._crossing = np.empty((2, 3))
        self.looked = np.zeros(2, np.int64)
        """Numbers of visited pairs of nodes and of triangles."""

    def reset(self) -> None:
        """Reset the counts `looked`; the wrench depends on the pose alone."""
        self.looked[:] = 0

    def minima(self, pose: Array) -> tuple[Array, Array, Array]:
        """Return the local minima at a pose (7,), the nearest first.

        Places on the tool and on the body (n, 2, 3) [m] and unit directions (n, 3) from there to
        the tool, world axes; and distances (n,) [m], below 0 where spheres or capsules overlap the
        other surface. Surfaces that cross add one at distance 0.
        """
        found = [(np.empty((0, 2, 3)), np.empty((0, 3)), np.empty(0))]
        for tree, there in self.others:
            motion = RigidMotion(*map(np.ascontiguousarray, there.relative(pose)))
            places, directions, distances = self._of_pair(tree, there.body, motion)
            touching = (np.abs(distances) < _TOUCHING).any()
            if not touching and self._crosses(tree, motion):
                size = float(np.linalg.norm(self._crossing[1]))
                if size > 0.0:
                    places = np.concatenate([places, np.tile(self._crossing[0], (1, 2, 1))])
                    directions = np.vstack([directions, self._crossing[1] / size])
                    distances = np.append(distances, 0.0)
            places = places @ there.rotation.T + there.position
            found.append((places, directions @ there.rotation.T, distances))
        places, directions, distances = map(np.concatenate, zip(*found, strict=True))
        order = np.argsort(distances, kind="stable")
        return places[order], directions[order], distances[order]

    def _crosses(self, tree: Tree, motion: RigidMotion) -> bool:
        """Return whether the tool's surface crosses or touches another; fill the line's middle."""
        return any(crossing(self.tool, tree, motion, side, self._crossing) for side in (1.0, -1.0))

    def _of_pair(
        self, tree: Tree, body: Body | None, motion: RigidMotion
    ) -> tuple[Array, Array, Array]:
        """Return the local minima between the tool and a body, in the body's frame."""
        most = self._room.distances.size
        count = near_pairs(self.tool, tree, motion, self.stand_off, self._room, self.looked)
        if count > most:
            self._room = room_for(2 * count)
            near_pairs(self.tool, tree, motion, self.stand_off, self._room, self.looked)
        places, directions, distances = minima_of(
            self.tool, tree, motion, self._room, count, self.band
        )
        shown = np.ones(len(distances), bool)
        if body is not None:
            shown &= ~_covered(body, tree, places[:, 1] + _OUT * directions)
        if self.tool_body is not None:
            own = (places[:, 0] - _OUT * directions - motion.translation) @ motion.rotation
            shown &= ~_covered(self.tool_body, self.tool, own)
        return places[shown], directions[shown], distances[shown]

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        places, directions, distances = self.minima(pose)
        if not len(distances):
            return NOTHING
        forces = self.stiffness * (self.stand_off - distances)[:, None] * directions
        torque = np.cross(places[:, 0] - centre_at(pose, self.centre), forces).sum(axis=0)
        deepest = self.stand_off - float(distances[0])
        return MethodWrench(forces.sum(axis=0), torque, deepest, len(distances))


def _covered(body: Body, tree: Tree, places: Array) -> NDArray[np.bool_]:
    """Return which places (n, 3) over a body's surface lie in one of its spheres or capsules.

    The surfaces of these are whole, also within one another; those of other solids are not.
    """
    inside = np.zeros(len(places), bool)
    if len(body.geoms) > 1 and tree.thick.any():
        for geom in body.geoms:
            if geom.kind in ("sphere", "capsule"):
                inside |= covers(geom, places)
    return inside


@dataclass(frozen=True)
class LmdMethod(Method):
    """Local minimum distances between two surfaces.

    Parameters
    ----------
    detail : bool
        Use the displaced surfaces; otherwise the smooth ones.
    points : int
        Approximate largest number of points of a body's surface, where it is round or textured.
    points_of_two : int
        The same where the tool and a body are both textured, whose pairs are many more.
    stand_off : float
        Distance at which repulsion begins [m], above 0.
    band : float
        Distances that differ by less count as equal [m], above 0.
    """

    detail: bool
    points: int
    points_of_two: int = 10_000
    stand_off: float = 2e-3
    band: float = 5e-6

    def __post_init__(self) -> None:
        require_positive("stand_off", self.stand_off, "m")
        require_positive("band", self.band, "m")

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        return finite_reason(*scene.bodies) if self.detail else None

    def renderer(self, scene: Scene, dt: float) -> LmdRenderer:
        """Return a renderer of a scene."""
        bodies = place_bodies(scene)
        textured = bodies.tool.texture and any(there.body.texture for there in bodies.standing)
        points = self.points_of_two if self.detail and textured else self.points
        others = [(self._tree(there.body, points), there) for there in bodies.standing]
        return LmdRenderer(
            self._tree(bodies.tool, points), others, bodies.centre, stiffness=scene.force.stiffness,
            stand_off=self.stand_off, band=self.band, tool_body=bodies.tool,
        )  # fmt: skip

    def _tree(self, body: Body, points: int) -> Tree:
        return tree_of_body(body if self.detail else replace(body, texture=None), points)


LOW = LmdMethod(
    "lmd", "local minimum distances", "Johnson & Willemsen 2003",
    "Of the smooth surfaces: it never feels a texture. Repulsion is linear from a stand-off of "
    "2 mm, so that nothing touches while less than k s presses; every tick is a full search.",
    detail=False, points=4000,
)  # fmt: skip
DETAIL = LmdMethod(
    "lmd-detail", "local minimum distances, displaced", "Johnson & Willemsen 2003",
    "Of the displaced surfaces, no finer than 60,000 points each, 10,000 where both are textured; "
    "the authors had models of tens of thousands of triangles. Local minima come and go, and the "
    "force jumps where one does.",
    detail=True, points=60_000,
)  # fmt: skip
