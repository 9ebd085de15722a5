r"""Penetration depth between convex pieces, and clusters of contacts.

Kim, Otaduy, Lin & Manocha, *Six-degree-of-freedom haptic rendering using incremental and localized
computations* (2003). Both bodies are divided into convex pieces; every overlapping pair of pieces
has a penetration depth d, a direction n and a place p, found by a walk from the last tick's
features (`minkowski_walk`). Contacts near each other form one cluster, whose place, direction and
depth are weighted means,

    p = sum w_i p_i / sum w_i,    n = sum w_i n_i / |sum w_i n_i|,    d = sum w_i d_i / sum w_i ,

    F = k d n,    T = (p - centre of mass) x F ,

so that the stiffness does not grow with the number of pieces. Textures are ignored; Otaduy & Lin
(2004) add them.

The paper could not be read; its method is known from its title and abstract and from what Otaduy
and Lin (2004) write about it, the walk from a public Java program after Kim, Lin & Manocha's DEEP
(`docs/methods/kim.md`). The authors weight by depth, as recalled; asperity's weight is
w = d (A + w_0^2), with the area A of the region of contact, so that a seam through a flat contact
does not move its place; a contact on an edge has the area of a strip of width w_0, a thousandth
of a cluster's radius. Asperity's own: MuJoCo finds which pieces overlap, clusters are grown from
the deepest contact outwards, and the parts of a contact that a seam between joined pieces divides
are one.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.studies.baselines.convex_solids import (
    ConvexSolid,
    PieceSet,
    pieces_of,
    solid_of_geom,
)
from asperity.studies.baselines.placement import centre_at
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer
from asperity.studies.baselines.solid_contacts import solid_contact

Array = NDArray[np.float64]
_SIDES = 64
"""Sides of a cylinder."""
_SAME_WAY, _SAME_DEPTH = 0.999, 0.1
"""Least cosine, and largest difference in depths, of the parts of a contact that a seam divides."""
_WIDTH = 1e-3
"""Width w_0 of a contact on an edge, in radii of a cluster."""


class PieceContacts(NamedTuple):
    """Contacts, a row each."""

    places: Array
    """[m], (n, 3)."""
    normals: Array
    """Unit directions of the force on the tool, (n, 3)."""
    depths: Array
    """[m], above 0, (n,)."""
    areas: Array
    """Of the regions of contact [m^2], (n,)."""

    @staticmethod
    def empty() -> PieceContacts:
        """Return no contacts."""
        return PieceContacts(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0))


def _means(contacts: PieceContacts, groups: list[NDArray[np.intp]], width: float) -> PieceContacts:
    """Return each group of contacts as one, weighted by w = d (A + `width`^2)."""
    weights = contacts.depths * (contacts.areas + width**2)
    rows = []
    for members in groups:
        w = weights[members]
        along = w @ contacts.normals[members]
        rows.append((
            w @ contacts.places[members] / w.sum(), along / np.linalg.norm(along),
            w @ contacts.depths[members] / w.sum(), contacts.areas[members].sum(),
        ))  # fmt: skip
    return PieceContacts(*map(np.array, zip(*rows, strict=True)))


def group_contacts(
    places: Array, normals: Array, depths: Array, size: float
) -> list[NDArray[np.int64]]:
    """Return the members of each cluster of contacts, grown from the deepest outwards.

    Parameters
    ----------
    places, normals, depths : (n, 3), (n, 3), (n,) arrays
        [m], unit, and [m].
    size : float
        Contacts within this distance of the deepest of a cluster belong to it [m].
    """
    left = np.argsort(-depths, kind="stable")
    groups = []
    while left.size:
        away = np.linalg.norm(places[left] - places[left[0]], axis=1)
        # A contact that pushes the opposite way belongs to another cluster, however near.
        near = (away <= size) & (normals[left] @ normals[left[0]] > 0.0)
        groups.append(left[near])
        left = left[~near]
    return groups


def cluster_contacts(contacts: PieceContacts, size: float) -> PieceContacts:
    """Return contacts as clusters, with `size` [m] as for `group_contacts`."""
    groups = group_contacts(contacts.places, contacts.normals, contacts.depths, size)
    return _means(contacts, groups, _WIDTH * size) if groups else contacts


class ConvexRenderer(Renderer):
    """Renders the clustered contacts between the convex pieces of a scene."""

    def __init__(self, scene: Scene, size: float, share: float) -> None:
        # Without margins: only real overlap is a contact.
        self._model = copy.copy(scene.model)
        self._model.geom_margin[:] = 0.0
        self._model.body_margin[:] = 0.0
        self._data = mujoco.MjData(self._model)
        self._tool = self._model.body(scene.tool).id
        self._qpos = int(self._model.jnt_qposadr[self._model.body(scene.tool).jntadr[0]])
        self._centre = np.array(self._model.body_ipos[self._tool])
        self._stiffness, self._size = scene.force.stiffness, size
        self._limits = np.array([share, _WIDTH * size])
        mujoco.mj_kinematics(self._model, self._data)
        self._piece: dict[int, tuple[PieceSet, int]] = {}
        self._placed: dict[int, ConvexSolid] = {}
        for body in range(self._model.nbody):
            geoms = [i for i in range(self._model.ngeom) if self._collides(body, i)]
            if geoms:
                pieces = pieces_of([solid_of_geom(self._model, i, _SIDES) for i in geoms])
                self._piece |= {geom: (pieces, i) for i, geom in enumerate(geoms)}
                if body != self._tool:
                    pose = self._data.xmat[body].reshape(3, 3), self._data.xpos[body]
                    solids = zip(geoms, pieces.solids, strict=True)
                    self._placed |= {geom: solid.placed(*pose) for geom, solid in solids}
        self.reset()

    def _collides(self, body: int, geom: int) -> bool:
        active = self._model.geom_contype[geom] or self._model.geom_conaffinity[geom]
        return bool(self._model.geom_bodyid[geom] == body and active)

    def reset(self) -> None:
        """Forget the features at which the walks ended."""
        self._hubs: dict[tuple[int, int], NDArray[np.int64]] = {}

    def _overlapping(self, pose: Array) -> list[tuple[int, int]]:
        """Return the overlapping pairs of geoms of the tool and of other bodies."""
        model, data = self._model, self._data
        data.qpos[self._qpos : self._qpos + 7] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        pairs = data.contact.geom[: data.ncon][data.contact.dist[: data.ncon] < 0.0]
        of_tool = model.geom_bodyid[pairs] == self._tool
        one = of_tool[:, 0] != of_tool[:, 1]
        pairs = np.where(of_tool[:, :1], pairs, pairs[:, ::-1])[one]
        return list(dict.fromkeys(map(tuple, pairs.tolist())))

    def contacts(self, pose: Array) -> PieceContacts:
        """Return the contact of each overlapping pair of pieces, seams closed."""
        hubs, rows, pairs = {}, [], []
        rotation, placed = rotation_of(pose[3:]), dict[int, ConvexSolid]()
        for own, other in self._overlapping(pose):
            if own not in placed:
                pieces, i = self._piece[own]
                placed[own] = pieces.solids[i].placed(rotation, pose[:3])
            hub = self._hubs.get((own, other), np.full(2, -1))
            found, place = np.empty(4), np.empty(3)
            area = solid_contact(placed[own], self._placed[other], hub, self._limits, found, place)
            hubs[own, other] = hub
            if area >= 0.0:
                rows.append((place, found[1:], found[0], area))
                pairs.append((own, other))
        self._hubs = hubs
        if not rows:
            return PieceContacts.empty()
        contacts = PieceContacts(*map(np.array, zip(*rows, strict=True)))
        return _means(contacts, list(self._seamless(contacts, pairs)), _WIDTH * self._size)

    def _seamless(
        self, contacts: PieceContacts, pairs: list[tuple[int, int]]
    ) -> Iterator[NDArray[np.intp]]:
        """Yield groups of contacts that a seam between joined pieces divides."""
        from scipy.sparse.csgraph import connected_components

        if len(pairs) == 1:
            yield np.zeros(1, np.intp)
            return
        deep = contacts.depths
        same = contacts.normals @ contacts.normals.T > _SAME_WAY
        same &= np.abs(deep[:, None] - deep) <= _SAME_DEPTH * np.maximum(deep[:, None], deep)
        for k in (0, 1):
            geoms = [pair[k] for pair in pairs]
            bodies = self._model.geom_bodyid[geoms]
            same &= bodies[:, None] == bodies
            for i, j in zip(*np.nonzero(np.triu(same, 1)), strict=True):
                pieces, one = self._piece[geoms[i]]
                same[i, j] = same[j, i] = pieces.joined[one, self._piece[geoms[j]][1]]
        count, label = connected_components(same)
        for k in range(count):
            yield np.flatnonzero(label == k)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        found = cluster_contacts(self.contacts(pose), self._size)
        if not len(found.depths):
            return NOTHING
        forces = self._stiffness * found.depths[:, None] * found.normals
        torque = np.cross(found.places - centre_at(pose, self._centre), forces).sum(axis=0)
        deepest = float(found.depths.max())
        return MethodWrench(forces.sum(axis=0), torque, deepest, len(found.depths))


@dataclass(frozen=True)
class ConvexMethod(Method):
    """Penetration depths of convex pieces, clustered.

    Parameters
    ----------
    size : float
        Radius of a cluster [m], above 0.
    share : float
        A place of a region of contact counts if its depth is within this share of the largest [-],
        above 0.
    """

    name: str = "convex-pieces"
    label: str = "convex pieces, clustered"
    source: str = "Kim, Otaduy, Lin & Manocha 2003"
    what_it_is_not: str = (
        "A piece is a geom of the scene, and MuJoCo finds which of them overlap; weights of a "
        "cluster include the area of contact. It never feels a texture."
    )
    size: float = 5e-3
    share: float = 0.1

    def __post_init__(self) -> None:
        require_positive("size of a cluster", self.size, "m")
        require_positive("share", self.share, "")

    def renderer(self, scene: Scene, dt: float) -> ConvexRenderer:
        """Return a renderer of a scene."""
        return ConvexRenderer(scene, self.size, self.share)


CONVEX_PIECES = ConvexMethod()
