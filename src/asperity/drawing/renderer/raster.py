"""Compiled parts of the renderer: projection, rasterisation, and lighting."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel


class Buffers(NamedTuple):
    """Pixels of a camera's image."""

    depth: NDArray[np.float64]
    """Distance of the nearest surface from the eye's plane [m], infinite without one, (rows,
    columns)."""
    normal: NDArray[np.float64]
    """Its interpolated normal, not of unit length, (rows, columns, 3)."""
    number: NDArray[np.int64]
    """Its number, -1 without one, (rows, columns)."""


@kernel
def draw_triangles(places, normals, triangles, slack, number, buffers):
    """Draw triangles into the buffers where they are nearer than their contents.

    Parameters
    ----------
    places : (n, 3) array
        Column and row [pixels] and distance from the eye [m] of the points.
    normals : (n, 3) array
    triangles : (m, 3) int array
        Points of each triangle.
    slack : float
        Distance by which triangles are extended beyond their sides [pixels]: it closes the seams
        between patches of different fineness.
    number : int
        Stored in the pixels that show the triangles.
    buffers : Buffers
        Changed.
    """
    depth = buffers.depth
    rows, columns = depth.shape
    for i in range(triangles.shape[0]):
        a, b, c = triangles[i, 0], triangles[i, 1], triangles[i, 2]
        ax, ay, az = places[a, 0], places[a, 1], places[a, 2]
        bx, by, bz = places[b, 0], places[b, 1], places[b, 2]
        cx, cy, cz = places[c, 0], places[c, 1], places[c, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0 or not np.isfinite(area):
            continue
        left = max(int(np.ceil(min(ax, bx, cx) - slack)), 0)
        right = min(int(np.floor(max(ax, bx, cx) + slack)), columns - 1)
        low = max(int(np.ceil(min(ay, by, cy) - slack)), 0)
        high = min(int(np.floor(max(ay, by, cy) + slack)), rows - 1)
        least_u, least_v, least_w = -1e-9, -1e-9, -1e-9
        if slack > 0.0:
            least_u -= slack * np.hypot(cx - ax, cy - ay) / abs(area)
            least_v -= slack * np.hypot(bx - ax, by - ay) / abs(area)
            least_w -= slack * np.hypot(cx - bx, cy - by) / abs(area)
        for row in range(low, high + 1):
            for column in range(left, right + 1):
                u = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                v = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                if u < least_u or v < least_v or 1.0 - u - v < least_w:
                    continue
                if slack > 0.0:  # a pixel beside the triangle shows its nearest point
                    u, v = max(u, 0.0), max(v, 0.0)
                    total = max(u + v, 1.0)
                    u, v = u / total, v / total
                w = 1.0 - u - v
                far = w * az + u * bz + v * cz
                if far < depth[row, column]:
                    depth[row, column] = far
                    buffers.number[row, column] = number
                    for k in range(3):
                        normal = w * normals[a, k] + u * normals[b, k] + v * normals[c, k]
                        buffers.normal[row, column, k] = normal


@kernel
def project(points, camera, places_out):
    """Fill columns and rows [pixels] and distances from the eye [m] of points (a, b, 3) [m].

    `camera` is a `Projection`; `places_out` has the shape of `points`.
    """
    frame = camera.frame
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            a, b, c = 0.0, 0.0, 0.0
            for k in range(3):
                away = points[i, j, k] - frame[0, k]
                a += away * frame[1, k]
                b += away * frame[2, k]
                c -= away * frame[3, k]
            places_out[i, j, 0] = a / camera.pixel + 0.5 * (camera.columns - 1)
            places_out[i, j, 1] = 0.5 * (camera.rows - 1) - b / camera.pixel
            places_out[i, j, 2] = c


@kernel
def light_pixels(seen, openness, camera, lamp, reach, image_out):
    """Fill an image (rows, columns, 3) with ambient light, directional light, and gloss.

    Parameters
    ----------
    seen : Buffers
        What the camera sees.
    openness : (rows, columns) array
        Share of the ambient light that reaches each pixel, 0 to 1.
    camera, lamp : Projection
        The lamp shines from where its eye is.
    reach : (n, n) array
        Distance of the surfaces that the lamp sees [m]; surfaces farther away are in shadow.
    image_out : (rows, columns, 3) array
    """
    depth, normals, frame, light = seen.depth, seen.normal, camera.frame, lamp.frame[3]
    rows, columns = depth.shape
    n = reach.shape[0]
    half = light + frame[3]
    half = half / np.sqrt((half * half).sum())
    for row in range(rows):
        for column in range(columns):
            if depth[row, column] > 1e8:
                continue
            a = (column - 0.5 * (columns - 1)) * camera.pixel
            b = (0.5 * (rows - 1) - row) * camera.pixel
            s, t, far = 0.0, 0.0, 0.0
            facing, gloss, up, length = 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                place = (
                    frame[0, k] + a * frame[1, k] + b * frame[2, k]
                    - depth[row, column] * frame[3, k]
                ) - lamp.frame[0, k]  # fmt: skip
                s += place * lamp.frame[1, k]
                t += place * lamp.frame[2, k]
                far -= place * lamp.frame[3, k]
                m = normals[row, column, k]
                length += m * m
                facing += m * light[k]
                gloss += m * half[k]
                up += m * frame[2, k]
            length = np.sqrt(max(length, 1e-30))
            # A soft shadow edge: the mean over 5 x 5 points of the lamp's image.
            s = s / lamp.pixel + 0.5 * (n - 1)
            t = 0.5 * (n - 1) - t / lamp.pixel
            lit = 0.0
            for di in range(-2, 3):
                for dj in range(-2, 3):
                    i, j = int(t + 0.8 * di + 0.5), int(s + 0.8 * dj + 0.5)
                    inside = 0 <= i < n and 0 <= j < n
                    if not inside or far <= reach[i, j] + 3.5 * lamp.pixel:
                        lit += 0.04
            ambient = 0.30 + 0.22 * (0.5 + 0.5 * up / length)
            image_out[row, column, 0] = ambient * openness[row, column]
            image_out[row, column, 1] = 0.75 * max(facing / length, 0.0) * lit
            image_out[row, column, 2] = 0.18 * max(gloss / length, 0.0) ** 40 * lit
