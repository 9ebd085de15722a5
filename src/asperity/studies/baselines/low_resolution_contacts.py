"""Contacts between the convex pieces of smooth bodies, found by MuJoCo and clustered.

The first stage of Otaduy & Lin (2004): collision detection between low-resolution models, which
gives the places of contact and the directions of penetration. Each pair of pieces that overlap, or
come as near as their textures reach, is a contact; contacts near each other are one
(`convex_pieces.group_contacts`).

The direction is that of a contact of the *bodies*. Pieces have faces and edges inside the body, and
a tool that overlaps a piece less sideways than in depth would be pushed out through one of them:
such a pair counts only if nothing else of the body touches.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene
from asperity.studies.baselines.convex_pieces import group_contacts
from asperity.studies.baselines.convex_solids import ConvexSolid, inside_solid, solid_of_geom

Array = NDArray[np.float64]
_SIDES = 64
"""Sides of a cylinder."""
_NEAR, _RISE = 1e-4, 0.01
"""Distance from a contact at which the other pieces of a body are looked for [m], and the slope by
which the body may rise there above the plane across the contact's normal."""
_AROUND = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)


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
        self._beside = _other_pieces(model)

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
        rows, real = [], []
        for pair in np.unique(pairs[mine], axis=0):
            which = mine[(pairs[mine] == pair).all(axis=1)]
            w = weights[which] / weights[which].sum()
            rows.append((w @ points[which], w @ normals[which], weights[which].max(), which))
            i = which[np.argmax(w)]
            geoms = pair[np.argsort(of_tool[i])]  # the body's, then the tool's
            real.append(all(
                self._bounds(geom, points[i] - side * 0.5 * near[i] * normals[i], side * normals[i])
                for geom, side in zip(geoms, (1.0, -1.0), strict=True)
            ))  # fmt: skip
        rows = self._without_virtual(rows, np.array(real), np.unique(pairs[mine], axis=0))
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

    def _without_virtual(self, rows: list, real: NDArray[np.bool_], pairs: NDArray) -> list:
        """Return the rows that are `real`; of a body that has no such row, all."""
        bodies = self._model.geom_bodyid[pairs]
        other = np.where(bodies[:, 0] == self._tool, bodies[:, 1], bodies[:, 0])
        keep = real | ~np.isin(other, other[real])
        return [row for row, kept in zip(rows, keep, strict=True) if kept]

    def _bounds(self, geom: int, place: Array, outwards: Array) -> bool:
        """Return whether the plane across a direction (3,) bounds a geom's body around a place."""
        others = self._beside[geom]
        if not others:
            return True
        body = self._model.geom_bodyid[geom]
        rotation = self._data.xmat[body].reshape(3, 3)
        frame = frame_along(outwards @ rotation)
        ring = np.stack([np.cos(_AROUND), np.sin(_AROUND), np.full(len(_AROUND), _RISE)], axis=1)
        points = (place - self._data.xpos[body]) @ rotation + _NEAR * ring @ frame
        return not any(inside_solid(solid, points, 0.0).any() for solid in others)


def _other_pieces(model: mujoco.MjModel) -> list[list[ConvexSolid]]:
    """Return the other pieces of the body of each geom, in its frame."""
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    out: list[list[ConvexSolid]] = [[] for _ in range(model.ngeom)]
    for body in range(model.nbody):
        geoms = np.flatnonzero(collides & (model.geom_bodyid == body)).tolist()
        if len(geoms) > 1:
            solids = {geom: solid_of_geom(model, geom, _SIDES) for geom in geoms}
            for geom in geoms:
                out[geom] = [solid for one, solid in solids.items() if one != geom]
    return out


def frame_along(n: Array) -> Array:
    """Return u, v and a unit vector n in rows: right-handed, u chosen arbitrarily."""
    u = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(n, u), n])


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
