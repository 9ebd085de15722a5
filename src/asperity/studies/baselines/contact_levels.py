r"""Contact levels of detail: each contact on the coarsest meshes within a tolerance.

Otaduy & Lin, *Sensation preserving simplification for haptic rendering* (SIGGRAPH 2003) and *CLODs:
dual hierarchies for multiresolution collision detection* (SGP 2003). Both bodies are hierarchies of
meshes (`mesh_levels`). A query begins at the coarsest level of both and refines a contact, one
level of one body at a time, until the finer level would not be noticed. By the haptic metric, that
is when the surface deviation s, weighted by the size of the features that the level lacks and
averaged over the contact's area D, is below a tolerance:

    s* = s / (r^2 D) < s_0,     r = 1 / (size of the features)

so fine detail is dropped where the contact is wide. Two other metrics may accept a level as well:

    velocity:  s < C_v v          v the relative speed at the contact
    view:      s < C_p x          x the distance of the contact from the eye

A contact is pushed with F = k d n at the mean place of its overlap; n is the mean normal of both
surfaces there, weighted by overlap, and d the largest overlap along n. Contacts of one pair of
bodies whose directions are within 60 degrees are one.

What is read in the sources, what is recalled, and what is asperity's own: docs/methods.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_not_negative, require_positive
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.studies.baselines.asperity_laws import SolverRenderer
from asperity.studies.baselines.displaced_surfaces import finite_reason
from asperity.studies.baselines.local_minima import RigidMotion
from asperity.studies.baselines.mesh_levels import (
    LevelTree,
    MeshLevels,
    build_levels,
    full_mesh,
)
from asperity.studies.baselines.placement import (
    Standing,
    centre_at,
    place_bodies,
    without_textures,
)
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer
from asperity.studies.baselines.triangle_overlap import near_pairs, overlap_along, pair_directions

Array = NDArray[np.float64]
Pairs = NDArray[np.int64]
_NO_WAYS = np.empty((0, 3))
_CONE = 0.5
"""Least cosine between directions of one contact."""


@dataclass(frozen=True)
class Metrics:
    """When a level of a contact is fine enough: when one of these metrics accepts it.

    All default values are asperity's.

    Parameters
    ----------
    tolerance : float
        s_0 [m], of the haptic metric.
    gap_time : float
        C_v [s]: the deviation that may be left is what the surfaces move in this time.
    eye : (3,) tuple of float, optional
        Place from which the contact is seen, world axes [m]; without it, the view does not count.
    pixel_angle : float
        C_p [rad]: the deviation that may be left is what covers this angle for the eye.
    """

    tolerance: float = 50e-6
    gap_time: float = 2e-4
    eye: tuple[float, float, float] | None = None
    pixel_angle: float = 3e-4

    def __post_init__(self) -> None:
        require_not_negative("tolerance", self.tolerance, "[m]")
        require_not_negative("gap time", self.gap_time, "[s]")
        require_positive("angle of a pixel", self.pixel_angle, "[rad]")

    def accept(self, deviation: float, weighted: float, speed: float, place: Array) -> bool:
        """Return whether a level is fine enough.

        Parameters
        ----------
        deviation, weighted : float
            s and s* [m].
        speed : float
            [m/s]
        place : (3,) array
            World axes [m].
        """
        if weighted <= self.tolerance or deviation <= self.gap_time * speed:
            return True
        if self.eye is None:
            return False
        away = float(np.linalg.norm(place - np.asarray(self.eye)))
        return deviation <= self.pixel_angle * away


@dataclass(frozen=True, eq=False)
class LevelContact:
    """A contact at the levels at which it was accepted; 0 is the finest."""

    body: str
    levels: tuple[int, int]
    """Of the tool, and of the body."""
    area: float
    """D [m^2]."""
    depth: float
    """d [m]."""
    normal: Array
    """n, the direction of the force on the tool, world axes, (3,)."""
    place: Array
    """World axes [m], (3,)."""
    deviations: tuple[float, float]
    """s of the tool, and of the body: mean over the contact [m]."""
    weighted: tuple[float, float]
    """s* of the tool, and of the body [m]."""


@dataclass(eq=False)
class LevelsRenderer(Renderer):
    """Renders each contact of a tool with other bodies at its own levels."""

    tool: MeshLevels
    others: list[tuple[MeshLevels, Standing]]
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    stiffness: float
    """k [N/m]."""
    metrics: Metrics
    dt: float
    """Tick [s]."""
    contacts: list[LevelContact] = field(default_factory=list, init=False)
    """Contacts at the last pose."""
    _last: Array | None = field(default=None, init=False)

    def reset(self) -> None:
        """Forget all previous poses."""
        self._last = None

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        self.contacts = [
            contact for levels, there in self.others for contact in self._touch(levels, there, pose)
        ]
        self._last = np.array(pose)
        if not self.contacts:
            return NOTHING
        middle = centre_at(pose, self.centre)
        force, torque = np.zeros(3), np.zeros(3)
        for one in self.contacts:
            push = self.stiffness * one.depth * one.normal
            force += push
            torque += np.cross(one.place - middle, push)
        depth = max(one.depth for one in self.contacts)
        return MethodWrench(force, torque, depth, len(self.contacts))

    def _touch(self, other: MeshLevels, there: Standing, pose: Array) -> Iterator[LevelContact]:
        """Yield the contacts with a body, each at the coarsest levels that are accepted."""
        trees = (self.tool.tree, other.tree)
        motion = RigidMotion(*map(np.ascontiguousarray, there.relative(pose)))
        levels = [self.tool.count - 1, other.count - 1]
        cap = min(self.tool.thickness, other.thickness) / 2.0
        coarsest = [np.arange(*m.starts[-2:]) for m in (self.tool, other)]
        pairs = np.stack(np.meshgrid(*coarsest, indexing="ij"), axis=-1).reshape(-1, 2)
        pairs = pairs[near_pairs(*trees, motion, pairs, _NO_WAYS, cap)]
        accepted: list[Array] = []
        while len(pairs):
            found = pair_directions(*trees, motion, pairs, cap)
            left = np.array([self.tool.deviations[levels[0]], other.deviations[levels[1]]])
            ways, wanted, deepest = [], np.zeros(2), 0.0
            for n in _directions(found):
                within = found[:, :3] @ n > _CONE
                if any(n @ one > _CONE for one in accepted):
                    # A rim of that contact, whose coarse triangles faced another way.
                    pairs, found = pairs[~within], found[~within]
                    continue
                sums = overlap_along(*trees, motion, pairs[within], n, cap)
                if sums[1] <= 0.0:
                    continue
                contact = _contact(there, (levels[0], levels[1]), n, sums)
                fine = self._fine_enough(contact, pose)
                if all(fine):
                    yield contact
                    accepted.append(n)
                    pairs, found = pairs[~within], found[~within]
                else:
                    wanted = np.maximum(wanted, np.where(fine, 0.0, contact.weighted))
                    ways.append(n)
                    deepest = max(deepest, contact.depth)
            if not ways:
                # Nothing is left that overlaps at these levels; at finer ones something may.
                wanted = left
            if not wanted.any():
                return
            side = int(np.argmax(wanted))
            levels[side] -= 1
            pairs = _finer(trees[side], pairs, side)
            reach = min(deepest + left.sum(), cap)
            pairs = pairs[
                near_pairs(*trees, motion, pairs, np.array(ways) if ways else _NO_WAYS, reach)
            ]

    def _fine_enough(self, contact: LevelContact, pose: Array) -> list[bool]:
        """Return whether the tool's and the body's level of a contact are accepted."""
        speed = self._speed(pose, contact.place)
        return [
            self.metrics.accept(deviation, weighted, speed, contact.place)
            for deviation, weighted in zip(contact.deviations, contact.weighted, strict=True)
        ]

    def _speed(self, pose: Array, place: Array) -> float:
        """Return how fast the tool's point at a place moves [m/s]; 0 at the first pose."""
        if self._last is None:
            return 0.0
        on_tool = rotation_of(pose[3:]).T @ (place - pose[:3])
        before = self._last[:3] + rotation_of(self._last[3:]) @ on_tool
        return float(np.linalg.norm(place - before)) / self.dt


def _directions(found: Array) -> list[Array]:
    """Return the mean directions (3,) of contacts, none within 60 degrees of a larger one.

    `found` are the directions and volumes of pairs of triangles, (n, 4).
    """
    left, out = found[found[:, 3] > 0.0], []
    while len(left):
        seed = left[np.argmax(left[:, 3]), :3]
        near = left[left[:, :3] @ seed > _CONE]
        mean = near[:, 3] @ near[:, :3]
        n = mean / np.linalg.norm(mean)
        out.append(n)
        left = left[(left[:, :3] @ n <= _CONE) & (left[:, :3] @ seed <= _CONE)]
    return out


def _contact(there: Standing, levels: tuple[int, int], n: Array, sums: Array) -> LevelContact:
    """Return the contact of `overlap_along`'s sums."""
    place = there.position + there.rotation @ (sums[2:5] / sums[1])
    area = float(sums[0])
    deviations = (float(sums[6] / area), float(sums[8] / area))
    weighted = (float(sums[7] / area**2), float(sums[9] / area**2))
    normal = there.rotation @ n
    return LevelContact(
        there.body.name, levels, area, float(sums[5]), normal, place, deviations, weighted
    )


def _finer(tree: LevelTree, pairs: Pairs, side: int) -> Pairs:
    """Return pairs of nodes with those of one side replaced by their children."""
    first, past = tree.first[pairs[:, side]], tree.first[pairs[:, side] + 1]
    counts = past - first
    out = np.repeat(pairs, counts, axis=0)
    before = np.repeat(np.cumsum(counts) - counts, counts)
    place = np.repeat(first, counts) + np.arange(len(out)) - before
    out[:, side] = tree.children[place]
    return out


@dataclass(frozen=True)
class LevelsMethod(Method):
    """Contact levels of detail.

    Parameters
    ----------
    metrics : Metrics
    points : int
        Approximate largest number of points of a body's full-detail mesh.
    """

    name: str = "contact-levels"
    label: str = "contact levels of detail"
    source: str = "Otaduy & Lin 2003"
    what_it_is_not: str = (
        "Nodes of the hierarchy are triangles, not hulls of convex patches; the overlap of meshes "
        "along a mean normal replaces the depth of convex pieces. The criterion is recalled, and "
        "its tolerances are asperity's."
    )
    metrics: Metrics = Metrics()
    points: int = 50_000

    def __post_init__(self) -> None:
        require_positive("number of points", self.points)

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        for body in scene.bodies:
            if body.mesh is not None and body.fields:
                return (
                    f"{body.name} is a textured mesh: displaced, it opens at its hard edges, "
                    "and its levels stay at thousands of triangles"
                )
        return finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> LevelsRenderer:
        """Return a renderer of a scene."""
        bodies = place_bodies(scene)
        tool, *others = (
            build_levels(full_mesh(body, self.points), filters=bool(body.fields))
            for body in (bodies.tool, *(there.body for there in bodies.standing))
        )
        pairs = list(zip(others, bodies.standing, strict=True))
        return LevelsRenderer(
            tool, pairs, bodies.centre, scene.force.stiffness, self.metrics, dt
        )  # fmt: skip


@dataclass(frozen=True)
class SmoothMethod(Method):
    """The low-resolution bodies alone, without texture: the limit of filtering."""

    name: str = "low-resolution"
    label: str = "low resolution alone"
    source: str = "the base of Otaduy & Lin 2003 and 2004"
    what_it_is_not: str = "No texture at all: the contact of the base bodies, for comparison."

    def renderer(self, scene: Scene, dt: float) -> SolverRenderer:
        """Return a renderer of a scene."""
        return SolverRenderer(without_textures(scene), scene.force, dt)


CONTACT_LEVELS = LevelsMethod()
LOW_RESOLUTION = SmoothMethod()
