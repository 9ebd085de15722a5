"""Elasticity of a flex of a MuJoCo model, recovered from its stiffness.

A model does not store the modulus. Each element has a matrix K for its energy by the changes of its
edges' squared lengths, `W = sum_ij K_ij s_i s_j / 4`. A Green strain E changes an edge d by
`s = 2 d.E d` and stores `V (mu tr(E^2) + lambda / 2 tr(E)^2)`: two strains give mu and lambda.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def flex_material(
    model: mujoco.MjModel, flex: int, vertices: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Return Young's modulus [Pa] and Poisson's ratio [-] of a flex.

    A sheet counts as two radii thick. None for a flex without such elements.

    Parameters
    ----------
    model : mujoco.MjModel
    flex : int
    vertices : (v, 3)
        At rest [m].
    """
    dim, count = int(model.flex_dim[flex]), int(model.flex_elemnum[flex])
    stiffness = None if model.flex_interp[flex] else _stiffness(model, flex)
    if stiffness is None:
        return None
    edges, start = dim * (dim + 1) // 2, int(model.flex_elemedgeadr[flex])
    own = model.flex_elemedge[start : start + edges * count].reshape(count, edges)
    first = int(model.flex_edgeadr[flex])
    ends = model.flex_edge[first : first + int(model.flex_edgenum[flex])][own]
    sides = vertices[ends[..., 1]] - vertices[ends[..., 0]]
    begin = int(model.flex_elemdataadr[flex])
    corners = vertices[model.flex_elem[begin : begin + (dim + 1) * count].reshape(count, dim + 1)]
    spans = corners[:, 1:] - corners[:, :1]
    size = np.sqrt(np.abs(np.linalg.det(spans @ spans.transpose(0, 2, 1)))) / (2.0, 6.0)[dim - 2]
    if dim == 2:
        size = size * 2.0 * float(model.flex_radius[flex])
    matrix = np.zeros((count, edges, edges))
    rows, columns = np.triu_indices(edges)
    matrix[:, rows, columns] = matrix[:, columns, rows] = stiffness[:, : len(rows)]
    # Axes along the first side and in the element: an axial strain, and a pure shear of these two.
    one = spans[:, 0] / np.linalg.norm(spans[:, 0], axis=1, keepdims=True)
    two = spans[:, 1] - (spans[:, 1] * one).sum(axis=1, keepdims=True) * one
    two /= np.linalg.norm(two, axis=1, keepdims=True)
    u, v = (np.einsum("nij,nj->ni", sides, axis) for axis in (one, two))
    energies = [
        0.25 * np.einsum("ni,nij,nj->n", s, matrix, s).sum() / size.sum()
        for s in (2.0 * u * u, 2.0 * (u * u - v * v))
    ]
    mu, first_lame = energies[1] / 2.0, 2.0 * energies[0] - energies[1]
    if not mu > 0.0:
        return None
    if dim == 2:
        poisson = first_lame / (first_lame + 2.0 * mu)
    else:
        poisson = first_lame / (2.0 * (first_lame + mu))
    return 2.0 * mu * (1.0 + poisson), poisson


def _stiffness(model: mujoco.MjModel, flex: int) -> NDArray[np.float64] | None:
    """Return the upper triangles of the elements' matrices, and what is stored after each."""
    count = int(model.flex_elemnum[flex])
    if not hasattr(model, "flex_stiffnessadr"):  # up to MuJoCo 3.6 or so
        start = int(model.flex_elemadr[flex])
        return np.asarray(model.flex_stiffness[start : start + count])
    start = int(model.flex_stiffnessadr[flex])
    if start < 0:
        return None
    later = model.flex_stiffnessadr[model.flex_stiffnessadr > start]
    end = int(later.min()) if later.size else model.flex_stiffness.size
    return np.asarray(model.flex_stiffness[start:end]).reshape(count, -1)
