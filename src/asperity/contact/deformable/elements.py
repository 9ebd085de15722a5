"""Finite elements of linear elasticity: tetrahedra with linear or quadratic displacements.

Shape functions are polynomials of the barycentric coordinates l of degree 1, `N = l`, or, since the
coordinates sum to 1, homogeneous ones of degree 2, `N = l^T Q l`. So all integrals have closed
forms: over a tetrahedron of volume V the mean of `l_0^a l_1^b l_2^c l_3^d` is
`3! a! b! c! d! / (a + b + c + d + 3)!` (Zienkiewicz & Taylor, The Finite Element Method).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError
from asperity.geometry.mesh.mesh import Mesh

_EDGES = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
"""Pairs of a tetrahedron's corners with its other nodes between them."""


def unknowns_of(cells: Indices, count: int, is_quadratic: bool) -> Indices:
    """Return the numbers of the displacements of each element's nodes (t, 4 or 10, 3).

    Three of each of the `count` corners come first, then three of each edge.
    """
    nodes = cells
    if is_quadratic:
        ends = np.sort(cells[:, _EDGES], axis=2).reshape(-1, 2)
        _, edge = np.unique(ends, axis=0, return_inverse=True)
        nodes = np.concatenate([cells, count + edge.reshape(-1, len(_EDGES))], axis=1)
    return np.asarray(3 * nodes[:, :, None] + np.arange(3), dtype=np.int64)


def held_unknowns(cells: Indices, unknowns: Indices, is_held: Mask) -> Indices:
    """Return the displacements of the nodes that are held, and of edges between two of them."""
    held = [unknowns[:, :4][is_held[cells]]]
    if unknowns.shape[1] > 4:
        held.append(unknowns[:, 4:][is_held[cells[:, _EDGES]].all(axis=2)])
    return np.unique(np.concatenate(held))


def stiffness_and_mass(
    points: Array, cells: Indices, unknowns: Indices, material: tuple[float, float, float]
) -> tuple[Any, Any]:
    """Return sparse matrices of stiffness [N/m] and mass [kg] of all displacements.

    Parameters
    ----------
    points : (n, 3) array
        [m]
    cells : (t, 4) array
        All with the same orientation.
    unknowns : (t, 4 or 10, 3) array
        See `unknowns_of`.
    material : tuple
        Young's modulus [Pa], Poisson's ratio, density [kg/m^3].
    """
    from scipy import sparse

    modulus, poisson, density = material
    shear = modulus / (2.0 * (1.0 + poisson))
    dilation = 2.0 * shear * poisson / (1.0 - 2.0 * poisson)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    volume = np.linalg.det(edges) / 6.0
    rates = np.empty((len(cells), 4, 3))
    rates[:, 1:] = np.swapaxes(np.linalg.inv(edges), 1, 2)
    rates[:, 0] = -rates[:, 1:].sum(axis=1)
    slopes, squares = _reference_means(unknowns.shape[1])
    # Mean of dN_m/dx_a times dN_n/dx_b, and with it Hooke's law.
    product = np.einsum("minj,tia,tjb->tmanb", slopes, rates, rates, optimize=True)
    law = dilation * product + shear * np.swapaxes(product, 2, 4)
    same = np.einsum("tmanb,ab->tmn", product, np.eye(3))
    law += shear * np.einsum("tmn,ab->tmanb", same, np.eye(3))
    inertia = density * np.einsum("mn,ab->manb", squares, np.eye(3))
    rows = unknowns.reshape(len(cells), -1)
    at = (np.repeat(rows, rows.shape[1], axis=1).ravel(), np.tile(rows, rows.shape[1]).ravel())
    size = int(rows.max()) + 1
    made = []
    for blocks in (law, inertia[None]):
        values = volume.reshape(-1, 1, 1, 1, 1) * blocks
        made.append(sparse.csc_matrix((values.ravel(), at), (size, size)))
    return made[0], made[1]


def _reference_means(count: int) -> tuple[Array, Array]:
    """Return means over an element: of `dN_m/dl_i dN_n/dl_j` and of `N_m N_n`."""
    two = (np.ones((4, 4)) + np.eye(4)) / 20.0  # of l_i l_j
    if count == 4:
        return np.einsum("mi,nj->minj", np.eye(4), np.eye(4)), two
    forms = np.zeros((count, 4, 4))
    for k in range(4):  # l_k (2 l_k - 1)
        forms[k, k, :] = forms[k, :, k] = -0.5
        forms[k, k, k] = 1.0
    for k, (one, other) in enumerate(_EDGES, start=4):  # 4 l_i l_j
        forms[k, one, other] = forms[k, other, one] = 2.0
    four = np.empty((4, 4, 4, 4))
    for index in np.ndindex(four.shape):
        powers = np.bincount(index, minlength=4).tolist()
        four[index] = math.prod(map(math.factorial, powers)) * 6.0 / math.factorial(7)
    slopes = 4.0 * np.einsum("mia,njb,ab->minj", forms, forms, two, optimize=True)
    return slopes, np.einsum("mij,nkl,ijkl->mn", forms, forms, four, optimize=True)


def embedding(mesh: Mesh, points: Array, cells: Indices, unknowns: Indices) -> Any:
    """Return the sparse matrix from displacements of nodes to those of a surface's vertices.

    It has three rows for each vertex, which moves with the element that contains it or is nearest.

    Raises
    ------
    AsperityError
        A vertex is far outside of all elements.
    """
    from scipy import sparse
    from scipy.spatial import KDTree

    corners = points[cells]
    nearest = KDTree(corners.mean(axis=1)).query(mesh.vertices, k=min(40, len(cells)))[1]
    nearest = nearest.reshape(len(mesh.vertices), -1)
    base = corners[:, 0]
    axes = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
    local = np.einsum("vkij,vkj->vki", axes[nearest], mesh.vertices[:, None] - base[nearest])
    weights = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
    best = weights.min(axis=2).argmax(axis=1)
    rows = np.arange(len(mesh.vertices))
    weights, cell = weights[rows, best], nearest[rows, best]
    outside = weights.min(axis=1)
    if outside.min() < -1.0:
        raise AsperityError(
            f"vertex {int(outside.argmin())} of {mesh.name!r} is farther from all tetrahedra than "
            "they are large; valid: tetrahedra that fill the mesh"
        )
    columns = unknowns[cell]  # (v, 4 or 10, 3)
    shares = _shape_functions(weights, columns.shape[1])
    row = 3 * rows[:, None, None] + np.arange(3)
    values = np.broadcast_to(shares[:, :, None], columns.shape)
    at = (np.broadcast_to(row, columns.shape).ravel(), columns.ravel())
    return sparse.csc_matrix((values.ravel(), at), (3 * len(rows), int(unknowns.max()) + 1))


def _shape_functions(weights: Array, count: int) -> Array:
    """Return the 4 or 10 shape functions of tetrahedra at barycentric coordinates (v, 4)."""
    if count == len(weights[0]):
        return weights
    one, two = _EDGES.T
    between = 4.0 * weights[:, one] * weights[:, two]
    return np.concatenate([weights * (2.0 * weights - 1.0), between], axis=1)
