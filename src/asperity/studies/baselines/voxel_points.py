"""Kernels of the voxmap: numbering of its layers, and tangent-plane forces on a pointshell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel

_DEEPEST = 254
"""Largest layer that a voxel's code can hold."""


class Voxmap(NamedTuple):
    """A stationary body as voxels in its own frame."""

    codes: NDArray[np.uint8]
    """0 free, 1 on the surface, 1 + l in layer l below it, (x, y, z). Empty for an unbounded
    plane, which is z = 0 of its frame and needs no voxels."""
    corner: NDArray[np.float64]
    """Low corner of the first voxel [m], (3,)."""
    size: float
    """Side of a voxel [m]."""


class Pointshell(NamedTuple):
    """Points of the tool's surface in its own frame."""

    points: NDArray[np.float64]
    """[m], (n, 3)."""
    normals: NDArray[np.float64]
    """Outward, unit, (n, 3)."""


class ShellWrench(NamedTuple):
    """Sums over the points of a shell that touch, per unit of stiffness."""

    force: NDArray[np.float64]
    """In the frame of the voxels [m], (3,)."""
    torque: NDArray[np.float64]
    """About the tool's centre of mass, in the frame of the voxels [m^2], (3,)."""


@kernel
def number_layers(inside, codes):
    """Fill `codes` where `inside` with 1 + the rounded distance to the nearest voxel outside.

    Two passes over the neighbours (Borgefors 1986) with steps of 1, sqrt 2 and sqrt 3: within
    about a tenth of the Euclidean distance.
    """
    wide, deep, high = inside.shape
    away = np.zeros(inside.shape, np.float32)
    steps = (0.0, 1.0, math.sqrt(2.0), math.sqrt(3.0))
    for backward in range(2):
        sign = 1 if backward == 0 else -1
        for a in range(wide):
            i = a if backward == 0 else wide - 1 - a
            for b in range(deep):
                j = b if backward == 0 else deep - 1 - b
                for c in range(high):
                    k = c if backward == 0 else high - 1 - c
                    if not inside[i, j, k]:
                        continue
                    best = away[i, j, k] if backward == 1 else np.float32(1e9)
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
def shell_forces(shell, voxmap, rotation, translation, centre, out):
    """Fill the wrench of a shell in a voxmap; return its largest depth [m] and number of contacts.

    Parameters
    ----------
    shell : Pointshell
    voxmap : Voxmap
    rotation, translation : (3, 3), (3,) arrays
        From the tool's frame into that of the voxels.
    centre : (3,) array
        The tool's centre of mass in its frame [m].
    out : ShellWrench
    """
    points, normals, codes, corner, size = (
        shell.points, shell.normals, voxmap.codes, voxmap.corner, voxmap.size
    )  # fmt: skip
    deepest, contacts = 0.0, 0
    out.force[:] = 0.0
    out.torque[:] = 0.0
    middle = np.empty(3)
    for i in range(3):
        middle[i] = translation[i]
        for j in range(3):
            middle[i] += rotation[i, j] * centre[j]
    flat = codes.size == 0
    wide, deep, high = codes.shape
    for n in range(points.shape[0]):
        a, b, c = points[n, 0], points[n, 1], points[n, 2]
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
        iz = math.floor((z - corner[2]) / size)
        if flat:
            # Surface voxels are those just below z = 0.
            if iz >= 0:
                continue
            layer = -1.0 - iz
        elif iz < 0 or iz >= high:
            continue
        x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]
        ix = math.floor((x - corner[0]) / size)
        y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]
        iy = math.floor((y - corner[1]) / size)
        if not flat:
            if ix < 0 or ix >= wide or iy < 0 or iy >= deep:
                continue
            code = codes[ix, iy, iz]
            if code == 0:
                continue
            layer = code - 1.0
        a, b, c = normals[n, 0], normals[n, 1], normals[n, 2]
        mx = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c
        my = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c
        mz = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c
        # The tangent plane contains the voxel's centre and is normal to the point's normal.
        d = layer * size
        d += mx * (x - corner[0] - (ix + 0.5) * size)
        d += my * (y - corner[1] - (iy + 0.5) * size)
        d += mz * (z - corner[2] - (iz + 0.5) * size)
        if d <= 0.0:
            continue
        fx, fy, fz = -d * mx, -d * my, -d * mz
        out.force[0] += fx
        out.force[1] += fy
        out.force[2] += fz
        rx, ry, rz = x - middle[0], y - middle[1], z - middle[2]
        out.torque[0] += ry * fz - rz * fy
        out.torque[1] += rz * fx - rx * fz
        out.torque[2] += rx * fy - ry * fx
        deepest = max(deepest, d)
        contacts += 1
    return deepest, contacts
