r"""Penetration depth between convex pieces, and clusters of contacts.

Kim, Otaduy, Lin & Manocha, *Six-degree-of-freedom haptic rendering using incremental and localized
computations* (2003). Both bodies are divided into convex pieces; every overlapping pair of pieces
has a penetration depth d, a direction n and a place p. Contacts near each other form one cluster,
whose place, direction and depth are means weighted by depth,

    p = sum d_i p_i / sum d_i,    n = sum d_i n_i / |sum d_i n_i|,    d = sum d_i^2 / sum d_i ,

    F = k d n,    T = (p - centre of mass) x F ,

so that the stiffness does not grow with the number of pieces and forces do not jump when the
deepest pair changes. Textures are ignored; Otaduy & Lin (2004) add them.

As recalled, not read in the source. Asperity's own: pieces and depths are MuJoCo's (GJK and EPA,
with closed forms for simple solids), each query without warm start, whereas the authors continue
from the last tick (DEEP); and clusters are grown from the deepest contact outwards.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.scene.scene import Scene
from asperity.studies.baselines.placement import centre_at
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]


def cluster_contacts(
    places: Array, normals: Array, depths: Array, size: float
) -> tuple[Array, Array, Array]:
    """Return contacts (n, 3), (n, 3), (n,) as clusters: places, unit normals, depths.

    Parameters
    ----------
    places, normals, depths : (n, 3), (n, 3), (n,) arrays
        [m], unit, and [m], above 0.
    size : float
        Contacts within this distance of the deepest of a cluster belong to it [m].
    """
    left = np.argsort(-depths, kind="stable")
    where, along, deep = [], [], []
    while left.size:
        away = np.linalg.norm(places[left] - places[left[0]], axis=1)
        # A contact that pushes the opposite way belongs to another cluster, however near.
        members = left[(away <= size) & (normals[left] @ normals[left[0]] > 0.0)]
        left = np.setdiff1d(left, members, assume_unique=True)
        left = left[np.argsort(-depths[left], kind="stable")]
        weights = depths[members]
        mean = weights @ normals[members]
        where.append(weights @ places[members] / weights.sum())
        along.append(mean / np.linalg.norm(mean))
        deep.append(weights @ weights / weights.sum())
    return np.array(where).reshape(-1, 3), np.array(along).reshape(-1, 3), np.array(deep)


class ConvexRenderer(Renderer):
    """Renders the clustered contacts of MuJoCo between the pieces of a scene."""

    def __init__(self, scene: Scene, size: float) -> None:
        self._model = copy.copy(scene.model)
        self._model.geom_margin[:] = 0.0
        self._model.body_margin[:] = 0.0
        self._data = mujoco.MjData(self._model)
        self._tool = self._model.body(scene.tool).id
        self._qpos = int(self._model.jnt_qposadr[self._model.body(scene.tool).jntadr[0]])
        self._centre = np.array(self._model.body_ipos[self._tool])
        self._stiffness, self._size = scene.force.stiffness, size

    def contacts(self, pose: Array) -> tuple[Array, Array, Array]:
        """Return place, direction (of the force on the tool) and depth of each overlapping pair."""
        model, data = self._model, self._data
        data.qpos[self._qpos : self._qpos + 7] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        pairs, distance = data.contact.geom[: data.ncon], data.contact.dist[: data.ncon]
        of_tool = model.geom_bodyid[pairs] == self._tool
        deepest: dict[tuple[int, ...], int] = {}
        touching = (distance < 0.0) & (of_tool[:, 0] != of_tool[:, 1])
        for i in np.flatnonzero(touching).tolist():
            best = deepest.setdefault(tuple(pairs[i].tolist()), i)
            if distance[i] < distance[best]:
                deepest[tuple(pairs[i].tolist())] = i
        which = np.array(list(deepest.values()), dtype=np.int64)
        # MuJoCo's normal points from the first geom to the second.
        signs = np.where(of_tool[which, 0], -1.0, 1.0)
        normals = data.contact.frame[which, :3] * signs[:, None]
        return np.array(data.contact.pos[which]), normals, -np.array(distance[which])

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        places, normals, depths = self.contacts(pose)
        if not len(depths):
            return NOTHING
        places, normals, depths = cluster_contacts(places, normals, depths, self._size)
        forces = self._stiffness * depths[:, None] * normals
        torque = np.cross(places - centre_at(pose, self._centre), forces).sum(axis=0)
        return MethodWrench(forces.sum(axis=0), torque, float(depths.max()), len(depths))


@dataclass(frozen=True)
class ConvexMethod(Method):
    """Penetration depths of convex pieces, clustered.

    Parameters
    ----------
    size : float
        Radius of a cluster [m], above 0.
    """

    name: str = "convex-pieces"
    label: str = "convex pieces, clustered"
    source: str = "Kim, Otaduy, Lin & Manocha 2003"
    what_it_is_not: str = (
        "Depths are MuJoCo's (GJK and EPA), computed afresh every tick, not the authors' "
        "incremental ones; a piece is a geom of the scene. It never feels a texture."
    )
    size: float = 5e-3

    def __post_init__(self) -> None:
        require_positive("size of a cluster", self.size, "m")

    def renderer(self, scene: Scene, dt: float) -> ConvexRenderer:
        """Return a renderer of a scene."""
        return ConvexRenderer(scene, self.size)


CONVEX_PIECES = ConvexMethod()
