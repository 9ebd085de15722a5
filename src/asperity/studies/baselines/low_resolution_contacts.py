"""Contacts between the convex pieces of smooth bodies, found by MuJoCo and clustered.

The first stage of Otaduy & Lin (2004): collision detection between low-resolution models, which
gives the places of contact and the directions of penetration. Each pair of pieces that overlap, or
come as near as their textures reach, is a contact; contacts near each other are one
(`convex_pieces.group_contacts`).
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene
from asperity.studies.baselines.convex_pieces import group_contacts

Array = NDArray[np.float64]


class LowContact(NamedTuple):
    """A contact of the low-resolution bodies."""

    place: Array
    """[m], (3,)."""
    normal: Array
    """n: unit, towards the tool, (3,)."""
    depth: float
    """The largest of its pieces [m]; negative where only textures reach."""
    points: Array
    """The points of MuJoCo that belong to it [m], (k, 3)."""


class LowCollider:
    """Finds the contacts of a scene's smooth bodies.

    Parameters
    ----------
    scene : Scene
    size : float
        Radius of a cluster of contacts [m].
    """

    def __init__(self, scene: Scene, size: float) -> None:
        self._model = model = copy.copy(scene.model)
        # Several points of a pair, without which flat on flat is one corner; in 4.0 the default.
        model.opt.enableflags |= int(getattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD", 0))
        model.geom_margin[:] = 0.0
        model.body_margin[:] = 0.0
        for body in scene.bodies:
            reach = max((float(np.abs(f.coefficients).max()) for f in body.fields), default=0.0)
            number = model.body(body.name).id
            model.geom_margin[model.geom_bodyid == number] = reach
            model.body_margin[number] = reach
        self._data = mujoco.MjData(model)
        self._tool = model.body(scene.tool).id
        self._qpos = int(model.jnt_qposadr[model.body(scene.tool).jntadr[0]])
        self._size = size

    def contacts(self, pose: Array) -> list[LowContact]:
        """Return the contacts at a pose (7,) of the tool."""
        model, data = self._model, self._data
        data.qpos[self._qpos : self._qpos + 7] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        pairs = np.array(data.contact.geom[: data.ncon]).reshape(-1, 2)
        of_tool = model.geom_bodyid[pairs] == self._tool
        mine = np.flatnonzero(of_tool[:, 0] != of_tool[:, 1])
        if not len(mine):
            return []
        near, points = data.contact.dist[: data.ncon], np.array(data.contact.pos[: data.ncon])
        # MuJoCo's normal points from the first geom to the second.
        normals = data.contact.frame[: data.ncon, :3] * np.where(of_tool[:, :1], -1.0, 1.0)
        reach = model.geom_margin[pairs].sum(axis=1)
        weights = np.maximum(reach - near, 0.0) + 1e-9
        rows = []
        for pair in np.unique(pairs[mine], axis=0):
            which = mine[(pairs[mine] == pair).all(axis=1)]
            w = weights[which] / weights[which].sum()
            rows.append((w @ points[which], w @ normals[which], weights[which].max(), which))
        places, ways, weight = (np.array([row[k] for row in rows]) for k in range(3))
        ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
        middles, along = _clusters(places, ways, weight, self._size)
        away = np.linalg.norm(places[:, None] - middles, axis=2)
        away[ways @ along.T <= 0.0] = np.inf
        cluster = away.argmin(axis=1)
        found = []
        for i in np.unique(cluster):
            members = np.concatenate([rows[j][3] for j in np.flatnonzero(cluster == i)])
            deepest = float(-near[members].min())
            found.append(LowContact(middles[i], along[i], deepest, points[members]))
        return found


def _clusters(places: Array, ways: Array, weights: Array, size: float) -> tuple[Array, Array]:
    """Return places and unit directions of clusters of contacts, means by weight (Kim et al. 2003).

    `size` [m] as for `group_contacts`.
    """
    where, along = [], []
    for members in group_contacts(places, ways, weights, size):
        mean = weights[members] @ ways[members]
        where.append(weights[members] @ places[members] / weights[members].sum())
        along.append(mean / np.linalg.norm(mean))
    return np.array(where), np.array(along)
