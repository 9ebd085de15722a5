"""Forces on the vertices that are consistent with the displacements they cause, linearised.

Kernels instead of a library's matrix products: these use threads, which disturb a loop of 1 kHz,
and do not exploit that most of the forces are 0.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, kernel


@kernel
def add_product(matrix, vector, out):
    """Add a symmetric matrix (n, n) times a sparse vector (n,) to `out`."""
    for row in range(vector.size):
        if vector[row] != 0.0:
            for k in range(out.size):
                out[k] += vector[row] * matrix[row, k]


@kernel
def farthest(one, two):
    """Return the largest difference of two vectors (n,); inf if an entry is not finite."""
    most = 0.0
    for i in range(one.size):
        apart = abs(one[i] - two[i])
        most = max(most, apart if apart - apart == 0.0 else np.inf)
    return most


@kernel
def first_turned(pressed, normal, at_rest):
    """Return the first triangle of `pressed` whose normal is opposite to that at rest, or -1.

    `pressed` (m + 1,) as in `SurfaceState`; the normals (m, 3).
    """
    for row in range(pressed[-1]):
        f, along = pressed[row], 0.0
        for i in range(3):
            along += normal[f, i] * at_rest[f, i]
        if not along > 0.0:
            return f
    return -1


@kernel
def disagreement(free, compliance, force, u, found):
    """Return the largest difference of u and `found = free + compliance force`, filled; all (n,).

    `compliance` is symmetric; most of the forces are 0.
    """
    for i in range(found.size):
        found[i] = free[i]
    add_product(compliance, force, found)
    return farthest(u, found)


@kernel
def stored(matrix, vector):
    """Return v M v of a matrix (n, n) and a sparse vector v (n,)."""
    places, count, total = np.empty(vector.size, np.int64), 0, 0.0
    for i in range(vector.size):
        if vector[i] != 0.0:
            places[count] = i
            count += 1
    for i in places[:count]:
        part = 0.0
        for k in places[:count]:
            part += matrix[i, k] * vector[k]
        total += vector[i] * part
    return total


@kernel
def displaced(modes, q, out):
    """Fill `out` (n,) with the displacements of modes (r, n) by q (r,)."""
    for i in range(out.size):
        out[i] = 0.0
    for k in range(q.size):
        for i in range(out.size):
            out[i] += modes[k, i] * q[k]


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
    """Solve a system (n, n) for right sides (n, m) in place, by elimination with partial pivoting.

    Row `order[k]` of `right` becomes unknown k.
    """
    n, m = right.shape
    for i in range(n):
        order[i] = i
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[order[i], k]) > abs(matrix[order[best], k]):
                best = i
        order[k], order[best] = order[best], order[k]
        row, at = matrix[order[k]], right[order[k]]
        for i in range(k + 1, n):
            other, there = matrix[order[i]], right[order[i]]
            share = other[k] / row[k]
            if share != 0.0:
                for j in range(k + 1, n):
                    other[j] -= share * row[j]
                for c in range(m):
                    there[c] -= share * at[c]
    for k in range(n - 1, -1, -1):
        row, at = matrix[order[k]], right[order[k]]
        for c in range(m):
            total = at[c]
            for j in range(k + 1, n):
                total -= row[j] * right[order[j], c]
            at[c] = total / row[k]


@inner_kernel
def _number_vertices(faces, local, vertex):
    """Assign numbers to the vertices of triangles, by first use; return how many there are.

    `local` (v,) has the number of a vertex, or -1; `vertex` the vertex of a number.
    """
    count = 0
    local[:] = -1
    for row in range(faces.shape[0]):
        for corner in range(3):
            v = faces[row, corner]
            if local[v] < 0:
                local[v], vertex[count] = count, v
                count += 1
    return count


@inner_kernel
def _fill_system(faces, springs, compliance, local, vertex, part, matrix):
    """Fill `I + K C` of the numbered vertices, three rows each, and their part of C, `part`."""
    n = matrix.shape[0]
    for i in range(n):
        row = compliance[3 * vertex[i // 3] + i % 3]
        for j in range(n):
            part[i, j] = row[3 * vertex[j // 3] + j % 3]
            matrix[i, j] = 1.0 if i == j else 0.0
    for row in range(faces.shape[0]):
        for i in range(9):
            filled = matrix[3 * local[faces[row, i // 3]] + i % 3]
            for j in range(9):
                spring, other = springs[row, i, j], part[3 * local[faces[row, j // 3]] + j % 3]
                for k in range(n):
                    filled[k] += spring * other[k]


@kernel
def agreeing_forces(faces, springs, compliance, free, place, force, out):
    """Fill `out` with the forces f that are consistent with u = free + compliance f.

    The contact is linearised about the displacements `place`, where it exerts `force`:
    `f = force - K (u - place)`.

    Parameters
    ----------
    faces : (count, 3) array of int
        Vertices of the triangles in contact.
    springs : (count, 9, 9) array
        K of each of them [N/m].
    compliance : (3 v, 3 v) array
        [m/N], symmetric.
    free, place, force, out : (3 v,) arrays
        [m], [m], [N], [N]; three numbers a vertex.
    """
    local, vertex = np.empty(out.size // 3, np.int64), np.empty(out.size // 3, np.int64)
    n = 3 * _number_vertices(faces, local, vertex)
    base = free.copy()
    for i in range(out.size):
        out[i] = 0.0 if local[i // 3] >= 0 else force[i]
    # The normals of neighbours turn too: the resulting forces on their vertices are kept constant.
    for i in range(out.size):
        if out[i] != 0.0:
            for k in range(out.size):
                base[k] += out[i] * compliance[i, k]
    matrix, part = np.empty((n, n)), np.empty((n, n))
    right, order = np.empty((n, 1)), np.empty(n, np.int64)
    for i in range(n):
        right[i, 0] = force[3 * vertex[i // 3] + i % 3]
    for row in range(faces.shape[0]):
        for i in range(9):
            at = 3 * local[faces[row, i // 3]] + i % 3
            for j in range(9):
                other = 3 * faces[row, j // 3] + j % 3
                right[at, 0] -= springs[row, i, j] * (base[other] - place[other])
    _fill_system(faces, springs, compliance, local, vertex, part, matrix)
    _eliminate(matrix, right, order)
    for k in range(n):
        out[3 * vertex[k // 3] + k % 3] = right[order[k], 0]


@kernel
def yielding_stiffness(faces, springs, compliance, arms, out):
    """Fill `out` (6, 6) with the stiffness of contact and compliant body for the other body.

    With R the rigid motion of the vertices in contact, it is
    `R^T (K^-1 + C)^-1 R = R^T (I + K C)^-1 K R`: a motion of the other body deforms the springs as
    the opposite motion of their vertices does.

    Parameters
    ----------
    faces : (count, 3) array of int
    springs : (count, 9, 9) array
        K of each triangle [N/m].
    compliance : (3 v, 3 v) array
        C [m/N].
    arms : (v, 3) array
        From the centre of the motion to each vertex [m].
    """
    v = arms.shape[0]
    local, vertex = np.empty(v, np.int64), np.empty(v, np.int64)
    n = 3 * _number_vertices(faces, local, vertex)
    matrix, part = np.empty((n, n)), np.empty((n, n))
    right, order = np.zeros((n, 6)), np.empty(n, np.int64)
    for row in range(faces.shape[0]):
        for i in range(9):
            at = 3 * local[faces[row, i // 3]] + i % 3
            for j in range(9):
                spring, axis, arm = springs[row, i, j], j % 3, arms[faces[row, j // 3]]
                one, two = (axis + 1) % 3, (axis + 2) % 3
                right[at, axis] += spring
                right[at, 3 + one] += spring * arm[two]  # (rotation x arm) along the axis
                right[at, 3 + two] -= spring * arm[one]
    _fill_system(faces, springs, compliance, local, vertex, part, matrix)
    _eliminate(matrix, right, order)
    out[:] = 0.0
    for k in range(n):
        axis, arm = k % 3, arms[vertex[k // 3]]
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for c in range(6):
            force = right[order[k], c]
            out[axis, c] += force
            out[3 + one, c] += arm[two] * force
            out[3 + two, c] -= arm[one] * force
