"""Smooth surfaces of bodies as few triangles, and spheres and capsules as points and segments.

A face of a box, and of a convex mesh, is as few triangles as its corners allow. Only cylinders and
ellipsoids are sampled; other meshes are taken as they are given.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.geometry.convex.pieces import is_convex
from asperity.geometry.poses import rotation_of
from asperity.studies.baselines.convex_solids import (
    ConvexSolid,
    pieces_of,
    solid_of_kind,
    solid_of_points,
)
from asperity.studies.baselines.displaced_surfaces import (
    DisplacedSurface,
    displaced_surface,
    spacing_for,
)
from asperity.studies.baselines.normal_cones import Tree, tree_of

Array = NDArray[np.float64]
_CONVEX = 1e-7
"""How deep a convex mesh may lie under its hull, in its sizes."""
_ROUND = ("cylinder", "ellipsoid")


def tree_of_body(body: Body, points: int) -> Tree:
    """Return the tree of a body's surface, with its texture if it has one.

    Parameters
    ----------
    body : Body
        An unbounded plane is cut at 2 m from its centre; it must be smooth.
    points : int
        Approximate largest number of points at which what is round or textured is sampled.
    """
    if body.mesh is not None and body.texture is None:
        faces = body.mesh.faces
        if is_convex(body.mesh.vertices, faces, _CONVEX):
            return _tree_of_solids([solid_of_points(body.mesh.vertices)])
        surface = DisplacedSurface(body.mesh.vertices, np.zeros_like(body.mesh.vertices), faces)
        return tree_of(surface, closed=False)
    if body.texture is None:
        solids = _solids(body, points)
        if solids is not None:
            return _tree_of_solids(solids)
    return tree_of(displaced_surface(body, spacing_for(body, points)), closed=body.mesh is None)


def _solids(body: Body, points: int) -> list[ConvexSolid] | None:
    """Return the solids of a smooth body; None if a face of one is partly inside another.

    The triangles of such a face would continue inside the body.
    """
    spacing = math.inf
    if any(geom.kind in _ROUND for geom in body.geoms):
        round_ones = replace(body, geoms=[g for g in body.geoms if g.kind != "plane"])
        spacing = spacing_for(round_ones, points)
    solids = []
    for geom in body.geoms:
        size = np.asarray(geom.size, dtype=np.float64)
        sides = int(np.clip(2.0 * math.pi * max(size[:2]) / spacing, 16, 256))
        solid = solid_of_kind(geom.kind, size, 2 * (sides // 2))
        solids.append(solid.placed(rotation_of(geom.quaternion), np.asarray(geom.position)))
    pieces = pieces_of(solids)
    for i, solid in enumerate(pieces.solids):
        if len(solid.normals) and solid.real.all() and np.count_nonzero(pieces.joined[i]) > 1:
            return None
    return list(pieces.solids)


def _tree_of_solids(solids: list[ConvexSolid]) -> Tree:
    """Return the tree of the real faces of solids, and of points and segments."""
    faces, thick, first = [], [], 0
    for solid in solids:
        if not len(solid.normals):
            faces.append([first, first, first + len(solid.vertices) - 1])
            thick.append(solid.radius)
        for f in np.flatnonzero(solid.real):
            corners = solid.face_corners[solid.face_first[f] : solid.face_first[f + 1]] + first
            faces += [[corners[0], *corners[k : k + 2]] for k in range(1, len(corners) - 1)]
            thick += [0.0] * (len(corners) - 2)
        first += len(solid.vertices)
    points = np.concatenate([solid.vertices for solid in solids])
    surface = DisplacedSurface(points, np.zeros_like(points), np.array(faces, dtype=np.int64))
    return tree_of(surface, np.array(thick))
