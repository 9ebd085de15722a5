"""Tetrahedra of a box: six in each of its hexahedra, with a common diagonal (Kuhn, 1960).

Neighbouring hexahedra are divided in the same way, so that the mesh is conforming.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from asperity._core.arrays import Array, Indices


def box_counts(half: Sequence[float], spacing: float) -> tuple[int, int, int]:
    """Return the number of hexahedra, about `spacing` [m] long, along each side of a box."""
    x, y, z = (max(round(2.0 * size / spacing), 1) for size in half)
    return x, y, z


def box_tetrahedra(
    half: Sequence[float], counts: tuple[int, int, int]
) -> tuple[Array, Indices, Indices]:
    """Return the tetrahedra of a box centred at the origin.

    Parameters
    ----------
    half : (3,)
        Half of each side [m].
    counts : (3,) of int
        Hexahedra along each side.

    Returns
    -------
    nodes : (n, 3) array
        [m]
    tetrahedra : (6 hexahedra, 4) array of int
    faces : (m, 3) array of int
        Triangles of the surface, counter-clockwise from outside.
    """
    lines = (np.linspace(-h, h, n + 1) for h, n in zip(half, counts, strict=True))
    nodes = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(nodes)).reshape([n + 1 for n in counts])
    first = number[:-1, :-1, :-1].ravel()
    steps = number[1, 0, 0], number[0, 1, 0], number[0, 0, 1]
    tetrahedra = []
    for order in itertools.permutations(range(3)):  # a path along the sides to the far corner
        path = np.cumsum([0, *(steps[axis] for axis in order)])
        is_even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        tetrahedra.append(first[:, None] + path[[0, 1, 2, 3] if is_even else [0, 2, 1, 3]])
    cells = np.concatenate(tetrahedra)
    # The three corners opposite a fourth one are counter-clockwise from outside.
    faces = np.concatenate([cells[:, [1, 2, 3]], cells[:, [0, 3, 2]],
                            cells[:, [0, 1, 3]], cells[:, [0, 2, 1]]])  # fmt: skip
    _, at, times = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return nodes, cells.astype(np.int64), faces[np.sort(at[times == 1])].astype(np.int64)
