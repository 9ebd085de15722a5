"""Pairs of geoms that may touch by their bounding spheres, for poses in compiled code."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.records import SceneModel
from asperity.geometry.bodies import KINDS

_PLANE = KINDS.index("plane")


@by_reference
class GeomPairs(NamedTuple):
    """Pairs of a geom of the tool and one of another body whose collision masks allow contact."""

    geoms: NDArray[np.int32]
    """Numbers in the MuJoCo model, the tool's first; (n, 2)."""
    radius: NDArray[np.float64]
    """Of the bounding sphere of each of `Geometry`'s geoms with its texture [m], (geoms,)."""


def geom_pairs(scene: SceneModel, pairs: NDArray[np.int32]) -> GeomPairs:
    """Return the `GeomPairs` of pairs (n, 2) of a scene's geoms."""
    geometry = scene.geometry
    radius = np.array(
        [radius_around(KINDS[k], *s) for k, s in zip(geometry.kind, geometry.size, strict=True)]
    )
    texture = geometry.texture[geometry.surface]
    for g in np.flatnonzero(texture >= 0).tolist():
        radius[g] += scene.textures.maps["max_abs_height"][texture[g]]
    return GeomPairs(pairs, radius)


def radius_around(kind: str, a: float, b: float, c: float) -> float:
    """Return the radius of a geom's bounding sphere from MuJoCo's sizes [m]; 0 for a plane."""
    by_kind = {
        "plane": 0.0, "sphere": a, "capsule": a + b, "ellipsoid": max(a, b, c),
        "cylinder": math.hypot(a, b), "box": math.hypot(a, b, c), "mesh": math.inf,
    }  # fmt: skip
    return by_kind[kind]


@inner_kernel
def _fill_centre(scene, g, centre_out):
    """Fill the centre (3,) of a geom in world axes [m]."""
    frame, at = scene.frames[scene.geometry.body[g]], scene.geometry.position[g]
    for i in range(3):
        centre_out[i] = frame[i, 3]
        for k in range(3):
            centre_out[i] += frame[i, k] * at[k]


@inner_kernel
def _height_over(scene, plane, point):
    """Return the height of a point (3,) over a plane [m]."""
    frame, turn = scene.frames[scene.geometry.body[plane]], scene.geometry.rotation[plane]
    origin, height = stack_array((3,)), 0.0
    _fill_centre(scene, plane, origin)
    for i in range(3):
        normal = 0.0
        for k in range(3):
            normal += frame[i, k] * turn[k, 2]
        height += normal * (point[i] - origin[i])
    return height


@inner_kernel
def near_pairs(scene, pairs, geoms_out):
    """Fill the pairs that may touch (n, 2), given the bodies' frames; return their number."""
    one, two, count = stack_array((3,)), stack_array((3,)), 0
    for p in range(pairs.geoms.shape[0]):
        g = scene.geom_number[pairs.geoms[p, 0]]
        h = scene.geom_number[pairs.geoms[p, 1]]
        reach = pairs.radius[g] + pairs.radius[h]
        _fill_centre(scene, g, one)
        if scene.geometry.kind[h] == _PLANE:
            is_near = _height_over(scene, h, one) <= reach
        else:
            _fill_centre(scene, h, two)
            if scene.geometry.kind[g] == _PLANE:
                is_near = _height_over(scene, g, two) <= reach
            else:
                off = (one[0] - two[0]) ** 2 + (one[1] - two[1]) ** 2 + (one[2] - two[2]) ** 2
                is_near = off <= reach * reach
        if is_near:
            geoms_out[count, 0], geoms_out[count, 1] = pairs.geoms[p, 0], pairs.geoms[p, 1]
            count += 1
    return count
