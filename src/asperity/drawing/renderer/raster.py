"""Compiled parts of the picture: displacing sheets, and the nearest surface of each pixel."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel, kernel


@inner_kernel
def _draw_triangle(a, b, c, na, nb, nc, slack, number, depth, normal_out, number_out):
    """Draw a triangle into the buffers where it is nearer than what is there.

    Parameters
    ----------
    a, b, c : (float, float, float)
        Column and row [pixels], distance from the eye [m] of its corners.
    na, nb, nc : (3,) arrays
        Normals at its corners.
    slack : float
        How far beyond its sides it is drawn [pixels].
    number, depth, normal_out, number_out
        As for `draw_sheet`.
    """
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a, b, c
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == 0.0 or not np.isfinite(area):
        return
    rows, columns = depth.shape
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
            if slack > 0.0:  # what is seen is on the triangle, however far the pixel is off it
                u, v = max(u, 0.0), max(v, 0.0)
                total = max(u + v, 1.0)
                u, v = u / total, v / total
            w = 1.0 - u - v
            far = w * az + u * bz + v * cz
            if far < depth[row, column]:
                depth[row, column] = far
                number_out[row, column] = number
                for k in range(3):
                    normal_out[row, column, k] = w * na[k] + u * nb[k] + v * nc[k]


@kernel
def draw_sheet(x, y, z, normals, number, depth, normal_out, number_out):
    """Draw a sheet into the buffers, where it is nearer than what is there.

    Parameters
    ----------
    x, y, z : (a, b) arrays
        Places of the sheet's points: column and row [pixels], distance from the eye [m].
    normals : (a, b, 3) array
    number : int
        What the sheet belongs to.
    depth : (rows, columns) array
        Distance of what is seen in each pixel; changed.
    normal_out : (rows, columns, 3) array
        Its normal; changed.
    number_out : (rows, columns) array
        Its number; changed.
    """
    for i in range(x.shape[0] - 1):
        for j in range(x.shape[1] - 1):
            for half in range(2):
                # Corners (i, j), (i+1, j+1), and one of the two others.
                ci = i + 1 if half == 0 else i
                cj = j if half == 0 else j + 1
                _draw_triangle(
                    (x[i, j], y[i, j], z[i, j]),
                    (x[i + 1, j + 1], y[i + 1, j + 1], z[i + 1, j + 1]),
                    (x[ci, cj], y[ci, cj], z[ci, cj]),
                    normals[i, j], normals[i + 1, j + 1], normals[ci, cj],
                    0.0, number, depth, normal_out, number_out,
                )  # fmt: skip


@kernel
def draw_patches(x, y, z, normals, corners, slack, number, depth, normal_out, number_out):
    """Draw patches of triangles into the buffers, where they are nearer than what is there.

    Parameters
    ----------
    x, y, z : (patches, points) arrays
        Column and row [pixels], distance from the eye [m].
    normals : (patches, points, 3) array
    corners : (triangles, 3) int array
        Points of each triangle, the same in all patches.
    slack : float
        How far triangles are drawn beyond their sides [pixels]: where patches of unlike fineness
        meet, one would see through the seam.
    number, depth, normal_out, number_out
        As for `draw_sheet`.
    """
    for i in range(x.shape[0]):
        for j in range(corners.shape[0]):
            a, b, c = corners[j, 0], corners[j, 1], corners[j, 2]
            _draw_triangle(
                (x[i, a], y[i, a], z[i, a]), (x[i, b], y[i, b], z[i, b]),
                (x[i, c], y[i, c], z[i, c]), normals[i, a], normals[i, b], normals[i, c],
                slack, number, depth, normal_out, number_out,
            )  # fmt: skip


@kernel
def displace(base, w, height, rotation, position, points, normals):
    """Displace a sheet and bring it into world axes; the normals follow from its neighbours.

    Parameters
    ----------
    base, w : (a, b, 3) arrays
        Base points and their unit normals in the body's frame.
    height : (a, b) array
    rotation : (3, 3) array
    position : (3,) array
        Of the body's frame.
    points, normals : (a, b, 3) arrays
        Filled.
    """
    rows, columns = height.shape
    for i in range(rows):
        for j in range(columns):
            for k in range(3):
                total = position[k]
                for m in range(3):
                    total += rotation[k, m] * (base[i, j, m] + height[i, j] * w[i, j, m])
                points[i, j, k] = total
    out = np.empty(3)
    for i in range(rows):
        up, down = min(i + 1, rows - 1), max(i - 1, 0)
        for j in range(columns):
            right, left = min(j + 1, columns - 1), max(j - 1, 0)
            ax = points[up, j, 0] - points[down, j, 0]
            ay = points[up, j, 1] - points[down, j, 1]
            az = points[up, j, 2] - points[down, j, 2]
            bx = points[i, right, 0] - points[i, left, 0]
            by = points[i, right, 1] - points[i, left, 1]
            bz = points[i, right, 2] - points[i, left, 2]
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            for k in range(3):
                out[k] = (
                    rotation[k, 0] * w[i, j, 0]
                    + rotation[k, 1] * w[i, j, 1]
                    + rotation[k, 2] * w[i, j, 2]
                )
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            side = nx * out[0] + ny * out[1] + nz * out[2]
            if length < 1e-30 or side == 0.0:  # the pole of a ball
                nx, ny, nz, length, side = out[0], out[1], out[2], 1.0, 1.0
            scale = np.sign(side) / length
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = (
                nx * scale,
                ny * scale,
                nz * scale,
            )


@kernel
def project(points, frame, pixel, columns, rows, x, y, z):
    """Fill `x`, `y` (a, b) with columns and rows [pixels], and `z` with distances [m].

    `frame` (4, 3) is the camera's centre, right, up and towards.
    """
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            a, b, c = 0.0, 0.0, 0.0
            for k in range(3):
                away = points[i, j, k] - frame[0, k]
                a += away * frame[1, k]
                b += away * frame[2, k]
                c -= away * frame[3, k]
            x[i, j] = a / pixel + 0.5 * (columns - 1)
            y[i, j] = 0.5 * (rows - 1) - b / pixel
            z[i, j] = c


@kernel
def light_pixels(
    depth, normals, reach, pixel, frame, lamp_pixel, lamp_frame, light, open_to, image
):
    """Fill `image` (rows, columns, 3) with key light, light from all over, and gloss.

    Parameters
    ----------
    depth : (rows, columns) array
    normals : (rows, columns, 3) array
    reach : (n, n) array
        Distance of what the lamp sees; what it does not see is lit.
    pixel, lamp_pixel : float
    frame, lamp_frame : (4, 3) arrays
        Centre, right, up and towards, of the eye and of the lamp.
    light : (3,) array
        Direction towards the light.
    open_to : (rows, columns) array
        How open each pixel lies.
    """
    rows, columns = depth.shape
    n = reach.shape[0]
    half = light + frame[3]
    half = half / np.sqrt((half * half).sum())
    for row in range(rows):
        for column in range(columns):
            if depth[row, column] > 1e8:
                continue
            a = (column - 0.5 * (columns - 1)) * pixel
            b = (0.5 * (rows - 1) - row) * pixel
            s, t, far = 0.0, 0.0, 0.0
            facing, gloss, up, length = 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                place = (
                    frame[0, k] + a * frame[1, k] + b * frame[2, k]
                    - depth[row, column] * frame[3, k]
                ) - lamp_frame[0, k]  # fmt: skip
                s += place * lamp_frame[1, k]
                t += place * lamp_frame[2, k]
                far -= place * lamp_frame[3, k]
                m = normals[row, column, k]
                length += m * m
                facing += m * light[k]
                gloss += m * half[k]
                up += m * frame[2, k]
            length = np.sqrt(max(length, 1e-30))
            # A soft edge of the shadow: the mean over 5 x 5 places of the lamp's view.
            s = s / lamp_pixel + 0.5 * (n - 1)
            t = 0.5 * (n - 1) - t / lamp_pixel
            lit = 0.0
            for di in range(-2, 3):
                for dj in range(-2, 3):
                    i, j = int(t + 0.8 * di + 0.5), int(s + 0.8 * dj + 0.5)
                    inside = 0 <= i < n and 0 <= j < n
                    if not inside or far <= reach[i, j] + 3.5 * lamp_pixel:
                        lit += 0.04
            image[row, column, 0] = (0.30 + 0.22 * (0.5 + 0.5 * up / length)) * open_to[row, column]
            image[row, column, 1] = 0.75 * max(facing / length, 0.0) * lit
            image[row, column, 2] = 0.18 * max(gloss / length, 0.0) ** 40 * lit
