"""A linear-elastic body in modal form, with residual flexibility.

From tetrahedra, by finite elements (`elements`). With stiffness K and mass M of all nodes that are
not held, the modes are `K phi = omega^2 M phi`, `phi^T M phi = 1`. A few dozen of them describe
vibrations, but hardly the deformation under a small contact. So the part of the static compliance
that they lack is kept (residual flexibility: R. H. MacNeal, Computers & Structures 1, 581 (1971)):

    u = Phi q + G f,      G = E K^-1 E^T - Phi omega^-2 Phi^T,

with f the forces on the vertices of the surface, and E from nodes to vertices.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Indices, Mask
from asperity.contact.deformable.elements import (
    embedding,
    held_unknowns,
    stiffness_and_mass,
    unknowns_of,
)
from asperity.errors import AsperityError, require_between, require_positive
from asperity.geometry.mesh.mesh import Mesh

MOST_VERTICES = 1500
"""Of the surface: the compliance has nine entries for each pair of them."""
MOST_TETRAHEDRA = 60_000
_QUADRATIC = 8000
"""Number of tetrahedra up to which elements are quadratic."""
_TOGETHER = 4
"""Right-hand sides solved in one call. SuperLU multiplies many small blocks; from 8 columns on,
OpenBLAS uses threads for each of them, which takes three to ten times as long."""
_LEFT = Path("__tracked_surface.stl")
"""File that fTetWild leaves in the working folder."""
_FLAT = 1e-6
"""Smallest volume of a tetrahedron, over the cube of its longest edge."""


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A linear-elastic body; made by `elastic_body`.

    Attributes
    ----------
    mesh : Mesh
        Its surface at rest, with v vertices.
    modes : (3 v, r) array
        Displacements of the vertices in each mode, normalised by mass [kg^-1/2]; three rows for
        each vertex.
    frequencies : (r,) array
        Angular frequencies [rad/s].
    compliance : (3 v, 3 v) array
        Static displacements of the vertices over forces on them [m/N].
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
        """G, the residual flexibility [m/N], (3 v, 3 v)."""
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
    pytetwild = require_tetrahedra()
    was_there = _LEFT.exists()
    try:
        points, tetrahedra = pytetwild.tetrahedralize(
            np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32),
            edge_length_fac=edge_length / diagonal, quiet=True,
        )[:2]  # fmt: skip
    finally:
        if not was_there:
            _LEFT.unlink(missing_ok=True)
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

    Up to 8,000 tetrahedra are quadratic elements, more are linear ones, which are too stiff for
    Poisson's ratios near 0.5.

    Parameters
    ----------
    mesh : Mesh
        The surface, at most 1500 vertices. It need not be that of the tetrahedra: each vertex moves
        with the tetrahedron which contains it or is nearest.
    nodes : (n, 3)
        Corners of the tetrahedra [m].
    tetrahedra : (t, 4) of int
        At most 60,000.
    modulus : float
        Young's modulus [Pa], 1 to 1e13.
    density : float
        [kg/m^3]
    held : callable or (n,) of bool
        Whether each node is held; a callable takes the nodes (n, 3).
    poisson : float
        Poisson's ratio, 0 to below 0.5.
    modes : int
        Number of modes, 1 or more.

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
    unknowns = unknowns_of(cells, len(points), len(cells) <= _QUADRATIC)
    stiffness, mass = stiffness_and_mass(points, cells, unknowns, (modulus, poisson, density))
    free = np.setdiff1d(np.arange(stiffness.shape[0]), held_unknowns(cells, unknowns, is_held))
    onto = embedding(mesh, points, cells, unknowns)[:, free]
    shapes, frequencies, compliance = _reduce(
        stiffness[free][:, free], mass[free][:, free], onto, int(modes)
    )
    whole = float(density * _volumes(points, cells).sum())
    return ElasticBody(mesh, shapes, frequencies, compliance, whole)


def require_tetrahedra() -> Any:
    """Return the package that fills meshes with tetrahedra, or refuse."""
    try:
        return importlib.import_module("pytetwild")
    except ImportError:
        raise AsperityError(
            "a mesh is filled with tetrahedra by pytetwild: pip install 'asperity[soft]'"
        ) from None


def _volumes(points: Array, cells: Indices) -> Array:
    """Return the signed volume of each tetrahedron [m^3]."""
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def _checked_elements(nodes: ArrayLike, tetrahedra: ArrayLike) -> tuple[Array, Indices]:
    """Return nodes and tetrahedra, all with the same orientation, or refuse them."""
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
    backwards = volume < 0.0  # files have either orientation
    cells[backwards] = cells[backwards][:, [0, 2, 1, 3]]
    _refuse_inverted(points, cells)
    return points, cells


def _refuse_inverted(points: Array, cells: Indices) -> None:
    """Refuse tetrahedra on the same side of a face as their neighbour across it."""
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


def _reduce(stiffness: Any, mass: Any, onto: Any, count: int) -> tuple[Array, Array, Array]:
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
    rows = np.flatnonzero(np.diff(onto.tocsr().indptr))  # without held vertices
    compliance = np.zeros((onto.shape[0], onto.shape[0]))
    for first in range(0, len(rows), _TOGETHER):
        block = rows[first : first + _TOGETHER]
        compliance[:, block] = onto @ factor.solve(onto[block].T.toarray())
    return np.ascontiguousarray(onto @ shapes), np.sqrt(squares), 0.5 * (compliance + compliance.T)
