"""The compiled loops of the voxmap: its layers, and the tangent-plane forces of a shell."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import kernel

_DEEPEST = 254


@kernel
def number_layers(inside, codes):
    """Fill `codes` where `inside` with 1 + the distance to the nearest voxel that is not, whole.

    Two sweeps over the neighbours (Borgefors 1986), with steps of 1, sqrt 2 and sqrt 3: off the
    Euclidean distance by about a tenth at most.
    """
    wide, deep, high = inside.shape
    away = np.zeros(inside.shape, np.float32)
    steps = (0.0, 1.0, math.sqrt(2.0), math.sqrt(3.0))
    for sweep in range(2):
        sign = 1 if sweep == 0 else -1
        for a in range(wide):
            i = a if sweep == 0 else wide - 1 - a
            for b in range(deep):
                j = b if sweep == 0 else deep - 1 - b
                for c in range(high):
                    k = c if sweep == 0 else high - 1 - c
                    if not inside[i, j, k]:
                        continue
                    best = away[i, j, k] if sweep == 1 else np.float32(1e9)
                    for di in range(-1, 1):
                        for dj in range(-1, 2):
                            if di == 0 and dj > 0:
                                break
                            for dk in range(-1, 2):
                                if di == 0 and dj == 0 and dk >= 0:
                                    break
                                # Inside never reaches the grid's border.
                                near = away[i + sign * di, j + sign * dj, k + sign * dk]
                                far = steps[abs(di) + abs(dj) + abs(dk)]
                                best = min(best, near + np.float32(far))
                    away[i, j, k] = best
    for i in range(wide):
        for j in range(deep):
            for k in range(high):
                if inside[i, j, k]:
                    codes[i, j, k] = 1 + min(int(away[i, j, k] + 0.5), _DEEPEST)


@kernel
def shell_forces(points, normals, turn, shift, centre, codes, corner, size, out):
    """Fill sums over the points that touch, per unit of stiffness.

    Parameters
    ----------
    points, normals : (n, 3) arrays
        Of the shell, in the tool's frame.
    turn, shift : (3, 3), (3,) arrays
        From the tool's frame into that of the voxels.
    centre : (3,) array
        About which torques are, in the tool's frame.
    codes : (x, y, z) array
        See `Voxmap`; of no voxels: all below z = 0 is inside.
    corner, size
        See `Voxmap`.
    out : (8,) array
        Force [m], torque [m^2] in the voxels' frame, largest depth [m], number of points.
    """
    for k in range(8):
        out[k] = 0.0
    middle = np.empty(3)
    for i in range(3):
        middle[i] = shift[i]
        for j in range(3):
            middle[i] += turn[i, j] * centre[j]
    flat = codes.size == 0
    wide, deep, high = codes.shape
    for n in range(points.shape[0]):
        a, b, c = points[n, 0], points[n, 1], points[n, 2]
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + shift[2]
        iz = math.floor((z - corner[2]) / size)
        if flat:
            # The surface's voxels are those just below 0.
            if iz >= 0:
                continue
            layer = -1.0 - iz
        elif iz < 0 or iz >= high:
            continue
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + shift[0]
        ix = math.floor((x - corner[0]) / size)
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + shift[1]
        iy = math.floor((y - corner[1]) / size)
        if not flat:
            if ix < 0 or ix >= wide or iy < 0 or iy >= deep:
                continue
            code = codes[ix, iy, iz]
            if code == 0:
                continue
            layer = code - 1.0
        a, b, c = normals[n, 0], normals[n, 1], normals[n, 2]
        mx = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
        my = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
        mz = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
        # The tangent plane goes through the voxel's middle, across the point's normal.
        d = layer * size
        d += mx * (x - corner[0] - (ix + 0.5) * size)
        d += my * (y - corner[1] - (iy + 0.5) * size)
        d += mz * (z - corner[2] - (iz + 0.5) * size)
        if d <= 0.0:
            continue
        fx, fy, fz = -d * mx, -d * my, -d * mz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        rx, ry, rz = x - middle[0], y - middle[1], z - middle[2]
        out[3] += ry * fz - rz * fy
        out[4] += rz * fx - rx * fz
        out[5] += rx * fy - ry * fx
        out[6] = max(out[6], d)
        out[7] += 1.0
