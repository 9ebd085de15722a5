"""Where a tool begins on a target that nothing is known of but its mesh, and how it slides."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_PLAIN = 0.05
"""What lies within this share of a body's height from its top is its top."""
_SHARE = 0.6
"""Of the target's top that the tool slides over."""
_LEAST = 0.05
"""Of the target's extent that it slides over at least."""
_STEPS = 200
"""Of the fall, at most."""


def slide_over(ground: Array, above: Array) -> tuple[dict[str, Any], Array]:
    """Return a slide over the target's top, and where the tool's frame begins, surely above it.

    Parameters
    ----------
    ground, above : (n, 3, 3) arrays
        Triangles of the target and of the tool, each in its frame [m], z upwards.

    Returns
    -------
    dict
        What stands under `[trajectory]`.
    (3,) array
        With the tool's lowest place over the line's beginning [m].
    """
    top, tip = _highest(ground), _highest(-above)
    low, high = top.min(axis=0), top.max(axis=0)
    along = int(np.argmax((high - low)[:2]))
    # A peak has no top to speak of.
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
    """Return the points (n, 3) of the triangles that lie wholly at the top."""
    level = triangles[..., 2].max() - _PLAIN * np.ptp(triangles[..., 2])
    whole = (triangles[..., 2] >= level).all(axis=1)
    points = triangles[whole] if whole.any() else triangles
    points = points.reshape(-1, 3)
    return np.asarray(points[points[:, 2] >= level])


def fall(model: mujoco.MjModel) -> float:
    """Return how far the body "tool" can be lowered until it meets another [m]; 0 if never."""
    data = mujoco.MjData(model)
    groups: list[list[int]] = [[], []]
    for i in range(model.ngeom):
        if model.geom_contype[i]:
            groups[model.body(int(model.geom_bodyid[i])).name == "tool"].append(i)
    low = sum(float(model.geom_rbound[group].max()) for group in groups)
    least = data.qpos[2] - 4.0 * low
    fallen = 0.0
    # What is farther away than that in any direction can be approached by that along z.
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
        if data.qpos[2] < least:  # it passes by: through a hole, or beside
            return 0.0
    return float(fallen)
