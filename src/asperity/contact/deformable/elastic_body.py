"""A linear-elastic body in modal form, with the compliance that its modes leave out.

From tetrahedra, by finite elements (scikit-fem). With stiffness K and mass M of all nodes that are
not held, the modes are `K phi = omega^2 M phi`, `phi^T M phi = 1`. A few dozen of them say how the
body swings, but hardly how it yields under a small contact. So what they leave out of the static
compliance is kept (residual flexibility: R. H. MacNeal, Computers & Structures 1, 581 (1971)):

    u = Phi q + G f,      G = E K^-1 E^T - Phi omega^-2 Phi^T,

with f the forces on the vertices of the surface, and E from nodes to vertices.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError, require_between, require_positive
from asperity.geometry.mesh.mesh import Mesh

MOST_VERTICES = 1500
"""Of the surface: the compliance has nine numbers for each pair of them."""
MOST_TETRAHEDRA = 60_000
_QUADRATIC = 8000
"""Number of tetrahedra up to which elements are quadratic."""
_FLAT = 1e-6
"""Least volume of a tetrahedron, over the cube of its longest edge."""


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A linear-elastic body; made by `elastic_body`.

    Attributes
    ----------
    mesh : Mesh
        Its surface at rest, with v vertices.
    modes : (3 v, r) array
        Displacements of the vertices in each mode, normalised by mass [kg^-1/2]; three rows a
        vertex.
    frequencies : (r,) array
        Angular frequencies [rad/s].
    compliance : (3 v, 3 v) array
        Static displacement of the vertices over forces on them [m/N], of all that is not held.
    mass : float
        [kg]
    """

    mesh: Mesh
    modes: Array
    frequencies: Array
    compliance: Array
    mass: float

    @property
    def residual(self) -> Array:
        """G, the part of the compliance that the modes leave out [m/N], (3 v, 3 v)."""
        return self.compliance - (self.modes / self.frequencies**2) @ self.modes.T


def tetrahedra_in(mesh: Mesh, edge_length: float) -> tuple[Array, Indices]:
    """Return nodes (n, 3) [m] and tetrahedra (t, 4) that fill a closed mesh.

    By fTetWild, in the envelope of a thousandth of the diagonal (Hu et al., Fast Tetrahedral
    Meshing in the Wild, ACM TOG 39, 117 (2020)). Needs `pip install 'asperity[soft]'`.

    Parameters
    ----------
    mesh : Mesh
    edge_length : float
        Wanted length of edges [m], above a hundredth of the mesh's diagonal.

    Raises
    ------
    AsperityError
        The length is outside its range, or the mesh is not closed enough to be filled.
    """
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    require_between("edge_length", edge_length, 0.01 * diagonal, diagonal, "m")
    pytetwild = _soft_package("pytetwild")
    points, tetrahedra = pytetwild.tetrahedralize(
        np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32),
        edge_length_fac=edge_length / diagonal, quiet=True,
    )[:2]  # fmt: skip
    if not len(tetrahedra):
        raise AsperityError(f"mesh {mesh.name!r} encloses no volume that tetrahedra could fill")
    return np.asarray(points, dtype=np.float64), np.asarray(tetrahedra, dtype=np.int64)


def elastic_body(
    mesh: Mesh,
    nodes: ArrayLike,
    tetrahedra: ArrayLike,
    *,
    modulus: float,
    density: float,
    held: Callable[[Array], Mask] | ArrayLike,
    poisson: float = 0.45,
    modes: int = 40,
) -> ElasticBody:
    """Return a linear-elastic body with a surface.

    Needs `pip install 'asperity[soft]'`. Up to 8,000 tetrahedra are quadratic elements, more are
    linear ones, which are too stiff for Poisson's ratios near 0.5.

    Parameters
    ----------
    mesh : Mesh
        The surface, at most 1500 vertices. It need not be that of the tetrahedra: each vertex moves
        with the tetrahedron that it is in or next to.
    nodes : (n, 3)
        Corners of the tetrahedra [m].
    tetrahedra : (t, 4) of int
        At most 60,000.
    modulus : float
        Young's modulus [Pa], 1 to 1e13.
    density : float
        [kg/m^3]
    held : callable or (n,) of bool
        Which nodes do not move; a callable takes the nodes (n, 3).
    poisson : float
        Poisson's ratio, 0 to below 0.5.
    modes : int
        How many, from 1.

    Raises
    ------
    AsperityError
        A value is outside its range; an element is flat, or some are inverted; fewer than three
        nodes are held; a vertex is far outside of all elements.
    """
    require_between("modulus", modulus, 1.0, 1e13, "Pa")
    require_positive("density", density, "kg/m^3")
    if not 0.0 <= poisson < 0.5:
        raise AsperityError(
            f"poisson must be 0 or above and below 0.5 (at 0.5 a body cannot be compressed, and "
            f"elements lock), got {poisson!r}"
        )
    if len(mesh.vertices) > MOST_VERTICES:
        raise AsperityError(
            f"mesh {mesh.name!r} has {len(mesh.vertices)} vertices; valid: at most "
            f"{MOST_VERTICES}. Take a coarser mesh: detail belongs in its texture"
        )
    points, cells = _checked_elements(nodes, tetrahedra)
    is_held = np.asarray(held(points) if callable(held) else held)
    if is_held.shape != (len(points),) or is_held.dtype != bool:
        raise AsperityError(
            f"held must be {len(points)} values True or False, one for each node, got an array of "
            f"{is_held.dtype} of shape {is_held.shape}"
        )
    fixed = points[is_held]
    if len(fixed) < 3 or np.linalg.matrix_rank(fixed - fixed[0], 1e-9) < 2:
        raise AsperityError(
            f"{len(fixed)} nodes are held; valid: three or more that are not on one "
            "line, else the body could move away"
        )
    stiffness, mass, unknowns, free = _assembled(
        points, cells, (modulus, poisson, density), is_held
    )
    onto = _embedding(mesh, points, cells, unknowns, stiffness.shape[0])[:, free]
    shapes, frequencies, compliance = _reduced(
        stiffness[free][:, free], mass[free][:, free], onto, int(modes)
    )
    whole = float(density * _volumes(points, cells).sum())
    return ElasticBody(mesh, shapes, frequencies, compliance, whole)


def _soft_package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise AsperityError(
            f"elastic bodies need the package {name}: pip install 'asperity[soft]'"
        ) from None


def _volumes(points: Array, cells: Indices) -> Array:
    """Return the signed volume of each tetrahedron [m^3]."""
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def _checked_elements(nodes: ArrayLike, tetrahedra: ArrayLike) -> tuple[Array, Indices]:
    """Return nodes and tetrahedra, all wound alike, or refuse them."""
    points, cells = np.asarray(nodes, dtype=np.float64), np.asarray(tetrahedra)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise AsperityError(f"nodes must be finite, of shape (n, 3), got shape {points.shape}")
    if cells.ndim != 2 or cells.shape[1] != 4 or not np.issubdtype(cells.dtype, np.integer):
        raise AsperityError(
            f"tetrahedra must be whole numbers of shape (t, 4), got {cells.dtype} of shape "
            f"{cells.shape}"
        )
    if not 0 < len(cells) <= MOST_TETRAHEDRA:
        raise AsperityError(f"there are {len(cells)} tetrahedra; valid: 1 to {MOST_TETRAHEDRA}")
    if cells.min() < 0 or cells.max() >= len(points):
        raise AsperityError(
            f"tetrahedra name nodes {cells.min()} to {cells.max()}; valid: 0 to {len(points) - 1}"
        )
    used, cells = np.unique(cells, return_inverse=True)
    if len(used) != len(points):
        raise AsperityError(
            f"{len(points) - len(used)} of {len(points)} nodes belong to no tetrahedron; leave "
            "them out"
        )
    cells = cells.reshape(-1, 4).astype(np.int64)
    volume = _volumes(points, cells)
    corners = points[cells]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    flat = np.abs(volume) < _FLAT * longest**3
    if flat.any():
        raise AsperityError(
            f"tetrahedron {int(np.flatnonzero(flat)[0])} is flat: its volume is less than "
            f"{_FLAT:g} of the cube of its longest edge ({np.count_nonzero(flat)} such)"
        )
    backwards = volume < 0.0  # files wind tetrahedra as they like
    cells[backwards] = cells[backwards][:, [0, 2, 1, 3]]
    _refuse_inverted(points, cells)
    return points, cells


def _refuse_inverted(points: Array, cells: Indices) -> None:
    """Refuse tetrahedra that lie on the same side of a face as their neighbour over it."""
    opposite = np.arange(4).repeat(len(cells))
    cell = np.tile(np.arange(len(cells)), 4)
    faces = np.concatenate([np.delete(cells, k, axis=1) for k in range(4)])
    faces = np.sort(faces, axis=1)
    order = np.lexsort(faces.T)
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    if (same[1:] & same[:-1]).any():
        row = order[1:][np.flatnonzero(same[1:] & same[:-1])[0]]
        raise AsperityError(
            f"more than two tetrahedra share the face of nodes {faces[row].tolist()}"
        )
    one, two = order[:-1][same], order[1:][same]
    a, b, c = (points[faces[one, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    sides = [
        np.einsum("ij,ij->i", points[cells[cell[half], opposite[half]]] - a, normal)
        for half in (one, two)
    ]
    folded = sides[0] * sides[1] > 0.0
    if folded.any():
        row = int(np.flatnonzero(folded)[0])
        raise AsperityError(
            f"tetrahedron {cell[two[row]]} is inverted: it overlaps its neighbour "
            f"{cell[one[row]]} ({np.count_nonzero(folded)} such pairs)"
        )


def _assembled(
    points: Array, cells: Indices, material: tuple[float, float, float], is_held: Mask
) -> tuple[Any, Any, Indices, Indices]:
    """Return stiffness, mass, the unknowns of each element (t, 4 or 10, 3), and the free ones."""
    skfem = _soft_package("skfem")
    elasticity = _soft_package("skfem.models.elasticity")
    modulus, poisson, density = material
    is_quadratic = len(cells) <= _QUADRATIC
    element = skfem.ElementTetP2() if is_quadratic else skfem.ElementTetP1()
    mesh = skfem.MeshTet(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T))
    basis = skfem.Basis(mesh, skfem.ElementVector(element))
    lame = elasticity.lame_parameters(modulus, poisson)
    stiffness = elasticity.linear_elasticity(*lame).assemble(basis)

    @skfem.BilinearForm
    def inertia(u: Any, v: Any, _: Any) -> Any:
        return density * sum(u[i] * v[i] for i in range(3))

    mass = inertia.assemble(basis)
    unknowns = basis.nodal_dofs.T[cells]
    held = basis.nodal_dofs[:, is_held].ravel()
    if is_quadratic:
        unknowns = np.concatenate([unknowns, basis.edge_dofs.T[mesh.t2e.T]], axis=1)
        between = is_held[mesh.edges].all(axis=0)
        held = np.concatenate([held, basis.edge_dofs[:, between].ravel()])
    free = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    return stiffness.tocsc(), mass.tocsc(), unknowns.astype(np.int64), free


def _embedding(mesh: Mesh, points: Array, cells: Indices, unknowns: Indices, count: int) -> Any:
    """Return the matrix from unknowns to displacements of the surface's vertices (3 v, count)."""
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
    return sparse.csc_matrix((values.ravel(), at), (3 * len(rows), count))


def _shape_functions(weights: Array, count: int) -> Array:
    """Return the 4 or 10 shape functions of tetrahedra at barycentric coordinates (v, 4)."""
    if count == len(weights[0]):
        return weights
    one, two = np.transpose([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])  # as in scikit-fem
    between = 4.0 * weights[:, one] * weights[:, two]
    return np.concatenate([weights * (2.0 * weights - 1.0), between], axis=1)


def _reduced(stiffness: Any, mass: Any, onto: Any, count: int) -> tuple[Array, Array, Array]:
    """Return modes at the vertices, their angular frequencies, and the static compliance."""
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    size = stiffness.shape[0]
    if not 1 <= count < size:
        raise AsperityError(f"modes must be 1 to {size - 1}, got {count!r}")
    factor = splu(
        stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    inverse = LinearOperator(stiffness.shape, factor.solve, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(size)
    squares, shapes = eigsh(stiffness, count, mass, sigma=0.0, OPinv=inverse, v0=start)
    rows = onto.shape[0]
    compliance = np.empty((rows, rows))
    for first in range(0, rows, 128):
        block = slice(first, first + 128)
        compliance[:, block] = onto @ factor.solve(onto[block].T.toarray())
    return np.ascontiguousarray(onto @ shapes), np.sqrt(squares), 0.5 * (compliance + compliance.T)
