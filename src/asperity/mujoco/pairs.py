"""Pairs of bodies of a MuJoCo model whose contacts asperity computes.

A pair is one body, the tool, and all bodies of another rigid group: bodies that are welded together
are one solid, with one potential (`contact.multibody`). The contact of a pair is prepared at its
first touch, since most pairs of a robot's bodies never touch.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.body_arrays import flatten_bodies
from asperity.contact.body_contact import BodyArrays, BodyContact
from asperity.contact.broad_phase.facet_bvh import facet_table
from asperity.contact.broad_phase.mujoco_pairs import Candidates, rigid_groups
from asperity.contact.manifold.covered import covered_faces
from asperity.contact.manifold.inside import with_thickness
from asperity.contact.response.settings import ForceSettings
from asperity.contact.search_room import SearchRoom, search_room
from asperity.mujoco.bodies import Carried, CarriedBodies
from asperity.mujoco.rows import Found, Tables

_CAVITY = 2e-3
"""Limit on the depth of MuJoCo's contact with a textured mesh, which is that of the hull [m]."""


@dataclass(frozen=True, eq=False)
class Pair:
    """A body and a rigid group that it may touch; numbers refer to asperity's bodies."""

    tool: int
    others: tuple[int, ...]
    by_facets: bool
    """Whether contact is split into patches: if both may touch over an area."""
    carriers: NDArray[np.int64]
    """Bodies of the model that carry the tool and the first of the others, (2,)."""
    locals: NDArray[np.float64]
    """Their frames in these, (2, 3, 4)."""
    home: NDArray[np.float64]
    """First frame of the first of the others, (3, 4)."""
    wave: float
    """The shortest wavelength of their textures, at most 4 mm [m]."""

    @property
    def slip(self) -> float:
        """Slip after which points of contact are discarded [m]."""
        return self.wave / 20.0


class PairPlan:
    """All pairs of a model, and the arrays of their bodies; the same for all `MjData`.

    Attributes
    ----------
    pairs : tuple of Pair
    by_facets : (pairs,) array of bool
        Whether they touch over an area.
    tables : Tables
    carried : CarriedBodies
    stiffness : float
        Of a contact of weight 1 [N/m].
    """

    def __init__(
        self, model: mujoco.MjModel, carried: CarriedBodies, settings: ForceSettings
    ) -> None:
        self.carried, self._settings = carried, settings
        self.stiffness = settings.stiffness
        bodies = [one.body for one in carried.bodies]
        carrier = np.array([one.carrier for one in carried.bodies], np.int64)
        frames = _first_frames(model, carried)
        groups = rigid_groups(model)[carrier] if len(carrier) else carrier
        self.tables = _tables(model, carried)
        self.pairs: tuple[Pair, ...] = ()
        self.by_facets = np.zeros(0, bool)
        if not bodies:
            return
        textures, geometry = flatten_bodies(bodies)
        geometry = geometry._replace(covered=covered_faces(geometry, frames, groups))
        starts = np.cumsum([0, *(len(body.geoms) for body in bodies)])
        number = np.full(max(model.ngeom, 1), -1, np.int64)
        for i, one in enumerate(carried.bodies):
            for k, geom in enumerate(one.geoms):
                number[geom] = starts[i] + (k if len(one.geoms) == len(one.body.geoms) else 0)
        is_mesh = np.array([body.mesh is not None for body in bodies])
        pairs = _pairs(carried, groups, frames)
        facets = None
        if is_mesh.any() or any(pair.by_facets for pair in pairs):
            facets = with_thickness(facet_table(bodies, textures, geometry))
        self._arrays = BodyArrays(
            textures, geometry, facets, frames, number, np.zeros((len(bodies), 3)), is_mesh, {}
        )
        self.pairs = tuple(pairs)
        self.by_facets = np.array([pair.by_facets for pair in pairs], bool)
        for i, pair in enumerate(pairs):
            for other in pair.others:
                self.tables.pair[pair.tool, other] = self.tables.pair[other, pair.tool] = i

    @staticmethod
    def candidates(found: Found, count: int) -> Candidates:
        """Return contacts removed from MuJoCo's list as candidates of a search."""
        return Candidates(count, found.geoms, found.points, found.distances, found.margins)

    def least_distance(self, number: int) -> float:
        """Return the least distance between two points of contact over an area [m].

        A fraction of the shortest wavelength, but large enough that a few dozen points are spread
        over the whole smaller body.
        """
        pair, facets = self.pairs[number], self._arrays.facets
        assert facets is not None
        sides = [2.0 * float(facets.reach[facets.root[i]].max()) for i in (pair.tool, *pair.others)]
        return max(pair.wave / 4.0, min(sides) / 20.0)

    def room(self) -> SearchRoom:
        """Allocate the scratch memory of searches, one for each thread."""
        return search_room(self._arrays.geometry, self._arrays.facets)

    def contact(self, number: int, room: SearchRoom) -> BodyContact:
        """Prepare the contact of a pair."""
        pair, arrays = self.pairs[number], self._arrays
        if pair.by_facets:
            arrays = arrays._replace(is_mesh=np.ones_like(arrays.is_mesh))
        return BodyContact(arrays, pair.tool, pair.others, self._settings, room)


def _first_frames(model: mujoco.MjModel, carried: CarriedBodies) -> NDArray[np.float64]:
    """Return the frames of all bodies in the model's first pose, (bodies, 3, 4)."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frames = np.zeros((len(carried.bodies), 3, 4))
    for i, one in enumerate(carried.bodies):
        turn = data.xmat[one.carrier].reshape(3, 3)
        frames[i] = turn @ one.local
        frames[i, :, 3] += data.xpos[one.carrier]
    return frames


def _tables(model: mujoco.MjModel, carried: CarriedBodies) -> Tables:
    count, bodies = max(model.ngeom, 1), max(len(carried.bodies), 1)
    owner, least = np.full(count, -1, np.int64), np.full(count, -np.inf)
    for i, one in enumerate(carried.bodies):
        owner[list(one.geoms)] = i
        if one.body.mesh is not None and one.is_textured:
            least[list(one.geoms)] = -_CAVITY
    none = np.full((bodies, bodies), -1, np.int64)
    return Tables(owner, carried.is_textured, none, least, carried.friction)


def _pairs(
    carried: CarriedBodies, groups: NDArray[np.int64], frames: NDArray[np.float64]
) -> list[Pair]:
    """Return the pairs of bodies that can move relative to each other, at least one textured."""
    bodies = carried.bodies
    members = {int(group): np.flatnonzero(groups == group).tolist() for group in np.unique(groups)}
    # Round bodies are better tools, small groups cheaper ones; the static group is last.
    order = sorted(
        members, key=lambda g: (g == 0, any(bodies[i].is_flat for i in members[g]), len(members[g]))
    )
    pairs = []
    for at, one in enumerate(order):
        for two in order[at + 1 :]:
            for tool in members[one]:
                others = [
                    i for i in members[two] if bodies[i].is_textured or bodies[tool].is_textured
                ]
                if not others:
                    continue
                flat = bodies[tool].is_flat and any(bodies[i].is_flat for i in others)
                first = bodies[others[0]]
                pairs.append(
                    Pair(
                        tool, tuple(others), flat,
                        np.array([bodies[tool].carrier, first.carrier], np.int64),
                        np.array([bodies[tool].local, first.local]), frames[others[0]].copy(),
                        _wave([bodies[tool], *(bodies[i] for i in others)]),
                    )
                )  # fmt: skip
    return pairs


def _wave(bodies: list[Carried]) -> float:
    """Return the shortest wavelength of some bodies' textures, at most 4 mm [m]."""
    waves = [f.shortest_wavelength for one in bodies if one.is_textured for f in one.body.fields]
    return min([4e-3, *waves])
