"""Default start and motion of a tool on a target of which only the mesh is known."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from asperity._core.arrays import Array

_PLAIN = 0.05
"""Fraction of a body's height, from above, that counts as its top."""
_SHARE = 0.6
"""Fraction of the top's length that the tool slides over."""
_LEAST = 0.05
"""Least fraction of the target's extent that the tool slides over."""
_STEPS = 200
"""Largest number of steps of lowering."""


def slide_over(ground: Array, above: Array) -> tuple[dict[str, Any], Array]:
    """Return a slide over the target's top, and a start of the tool's frame clear of the target.

    Parameters
    ----------
    ground, above : (n, 3, 3) arrays
        Triangles of the target and of the tool, each in its own frame [m], z upwards.

    Returns
    -------
    dict
        The table `[trajectory]`.
    (3,) array
        Position of the tool's frame at which its lowest point is above the start of the line [m].
    """
    top, tip = _highest(ground), _highest(-above)
    low, high = top.min(axis=0), top.max(axis=0)
    along = int(np.argmax((high - low)[:2]))
    # The top of a peak may be a single point.
    least = _LEAST * float(np.ptp(ground[..., along]))
    length = max(_SHARE * float(high[along] - low[along]), least)
    start = 0.5 * (low + high)
    start[along] -= 0.5 * length
    place = start + 0.5 * (tip.min(axis=0) + tip.max(axis=0))
    place[2] = ground[..., 2].max() - above[..., 2].min() + 1e-3
    slide = {"kind": "slide", "seconds": 2.0, "speed": 0.083, "length": length}
    if along == 1:
        slide["direction"] = 0.5 * math.pi
    return slide, np.asarray(place)


def _highest(triangles: Array) -> Array:
    """Return the vertices (n, 3) of the triangles that lie entirely in the top."""
    level = triangles[..., 2].max() - _PLAIN * np.ptp(triangles[..., 2])
    whole = (triangles[..., 2] >= level).all(axis=1)
    points = triangles[whole] if whole.any() else triangles
    points = points.reshape(-1, 3)
    return np.asarray(points[points[:, 2] >= level])


def fall(model: mujoco.MjModel) -> float:
    """Return the distance by which the tool can be lowered to contact [m], 0 if it misses."""
    data = mujoco.MjData(model)
    groups: list[list[int]] = [[], []]
    for i in range(model.ngeom):
        if model.geom_contype[i]:
            groups[model.body(int(model.geom_bodyid[i])).name == "tool"].append(i)
    low = sum(float(model.geom_rbound[group].max()) for group in groups)
    least = data.qpos[2] - 4.0 * low
    fallen = 0.0
    # A body at this distance in any direction can safely be lowered by it.
    for _ in range(_STEPS):
        mujoco.mj_kinematics(model, data)
        away = min(
            mujoco.mj_geomDistance(model, data, a, b, 10.0, None)
            for a in groups[0]
            for b in groups[1]
        )
        if away < 1e-7:
            break
        data.qpos[2] -= away
        fallen += away
        if data.qpos[2] < least:  # it missed: through a hole, or beside the target
            return 0.0
    return float(fallen)
