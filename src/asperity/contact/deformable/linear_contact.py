"""Forces on the vertices that agree with the displacements they cause, linearised.

Kernels of their own in the place of a library's matrix products: these take threads, which spoil a
loop of 1 kHz, and most of the forces are 0.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, kernel


@kernel
def add_product(matrix, vector, out):
    """Add a symmetric matrix (n, n) times a vector (n,), most of whose numbers are 0, to `out`."""
    for row in range(vector.size):
        if vector[row] != 0.0:
            for k in range(out.size):
                out[k] += vector[row] * matrix[row, k]


@kernel
def displaced(modes, q, out):
    """Fill `out` (n,) with the displacements of modes (n, r) by q (r,)."""
    for i in range(out.size):
        total = 0.0
        for k in range(q.size):
            total += modes[i, k] * q[k]
        out[i] = total


@kernel
def pull_on_modes(modes, force, out):
    """Fill `out` (r,) with the forces on modes (n, r) of forces (n,), most of which are 0."""
    out[:] = 0.0
    for i in range(force.size):
        if force[i] != 0.0:
            for k in range(out.size):
                out[k] += modes[i, k] * force[i]


@inner_kernel
def _eliminate(matrix, right, order):
    """Solve a system (n, n) in place by Gauss with partial pivots; `order` (n,) is overwritten."""
    n = right.size
    for i in range(n):
        order[i] = i
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[order[i], k]) > abs(matrix[order[best], k]):
                best = i
        order[k], order[best] = order[best], order[k]
        row = matrix[order[k]]
        for i in range(k + 1, n):
            other = matrix[order[i]]
            share = other[k] / row[k]
            if share != 0.0:
                other[k] = share
                for j in range(k + 1, n):
                    other[j] -= share * row[j]
                right[order[i]] -= share * right[order[k]]
    # The solution takes the places of the pivots, which are not needed any more.
    for k in range(n - 1, -1, -1):
        row = matrix[order[k]]
        total = right[order[k]]
        for j in range(k + 1, n):
            total -= row[j] * matrix[order[j], j]
        matrix[order[k], k] = total / row[k]


@kernel
def agreeing_forces(faces, springs, compliance, free, place, force, out):
    """Fill `out` with the forces f that agree with the displacements u = free + compliance f.

    About the displacements `place`, at which the contact exerts `force`, it is linear:
    `f = force - K (u - place)`.

    Parameters
    ----------
    faces : (count, 3) array of int
        Vertices of the touched triangles.
    springs : (count, 9, 9) array
        K of each of them [N/m].
    compliance : (3 v, 3 v) array
        [m/N], symmetric.
    free, place, force, out : (3 v,) arrays
        [m], [m], [N], [N]; three numbers a vertex.
    """
    local = np.full(out.size // 3, -1)
    vertex = np.empty(out.size // 3, np.int64)
    count = 0
    for row in range(faces.shape[0]):
        for corner in range(3):
            v = faces[row, corner]
            if local[v] < 0:
                local[v], vertex[count] = count, v
                count += 1
    n = 3 * count
    base = free.copy()
    for i in range(out.size):
        out[i] = 0.0 if local[i // 3] >= 0 else force[i]
    # The normals of neighbours turn, too: what these pull at their vertices is taken as it is.
    for i in range(out.size):
        if out[i] != 0.0:
            for k in range(out.size):
                base[k] += out[i] * compliance[i, k]
    matrix, right, order = np.zeros((n, n)), np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        matrix[i, i] = 1.0
        right[i] = force[3 * vertex[i // 3] + i % 3]
    for row in range(faces.shape[0]):
        for i in range(9):
            at = 3 * local[faces[row, i // 3]] + i % 3
            for j in range(9):
                spring, other = springs[row, i, j], 3 * faces[row, j // 3] + j % 3
                right[at] -= spring * (base[other] - place[other])
                for k in range(count):
                    for axis in range(3):
                        matrix[at, 3 * k + axis] += spring * compliance[other, 3 * vertex[k] + axis]
    _eliminate(matrix, right, order)
    for k in range(n):
        out[3 * vertex[k // 3] + k % 3] = matrix[order[k], k]
