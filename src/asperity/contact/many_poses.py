"""Compiled loops over many independent poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.structures import by_reference
from asperity.contact.broad_phase.geom_pairs import near_pairs
from asperity.contact.broad_phase.mujoco_pairs import Candidates
from asperity.contact.geom_tick import tick
from asperity.contact.mesh_tick import mesh_tick
from asperity.contact.records import Output, Query
from asperity.geometry.frames import fill_tool_frame


@by_reference
class PoseBatch(NamedTuple):
    """Poses, their candidates, and arrays for the results."""

    poses: NDArray[np.float64]
    """(n, 7)."""
    first: NDArray[np.int64]
    """Row of each pose's first candidate, and the end of the last; (n + 1,)."""
    candidates: Candidates
    """Those of all poses, concatenated."""
    wrench: NDArray[np.float64]
    """(n, 6)."""
    certified: NDArray[np.bool_]
    """Whether all depths are certified, (n,)."""


@inner_kernel
def _is_certified(contacts):
    """Return whether all depths of a pose are certified."""
    is_certified = contacts.count[1] == 0
    for c in range(contacts.count[0]):
        is_certified = is_certified and contacts.status[c] == 0
    return is_certified


@kernel
def solve_geoms(model, pairs, law, batch, memory, workspace, contacts):
    """Fill wrenches and certificates of a batch of poses among geoms.

    `pairs` is a `GeomPairs`; the candidates of the batch are scratch memory for as many.
    """
    near, centre = batch.candidates, np.zeros(3)
    for i in range(batch.poses.shape[0]):
        fill_tool_frame(batch.poses[i], model.centre, model.frames[model.tool], centre)
        count = near_pairs(model, pairs, near.geoms)
        found = Candidates(count, near.geoms, near.points, near.distances, near.margins)
        out = Output(contacts, batch.wrench[i])
        tick(model, law, Query(batch.poses[i], 0.0, found), memory, workspace, out)
        batch.certified[i] = _is_certified(contacts)


@kernel
def solve_meshes(model, mesh, law, batch, memory, workspace, contacts):
    """Fill wrenches and certificates of a batch of poses where a mesh is involved.

    `model` is None if all contact is between facets; `mesh` is (model, memory, space).
    """
    near = batch.candidates
    for i in range(batch.poses.shape[0]):
        start, end = batch.first[i], batch.first[i + 1]
        found = Candidates(
            end - start, near.geoms[start:end], near.points[start:end],
            near.distances[start:end], near.margins[start:end],
        )  # fmt: skip
        query, out = Query(batch.poses[i], 0.0, found), Output(contacts, batch.wrench[i])
        contacts.count[0] = contacts.count[1] = 0
        for k in range(6):
            out.wrench[k] = 0.0
        if model is not None:
            tick(model, law, query, memory, workspace, out)
        mesh_tick(mesh[0], law.parameters, query, mesh[1], mesh[2], workspace, out)
        batch.certified[i] = _is_certified(contacts)
