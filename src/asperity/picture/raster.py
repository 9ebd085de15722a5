"""Compiled parts of the picture: displacing sheets, and the nearest surface of each pixel."""

from __future__ import annotations

import numpy as np

from asperity.compiled import kernel


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
    rows, columns = depth.shape
    for i in range(x.shape[0] - 1):
        for j in range(x.shape[1] - 1):
            for half in range(2):
                # Corners (i, j), (i+1, j+1), and one of the two others.
                ci = i + 1 if half == 0 else i
                cj = j if half == 0 else j + 1
                ax, ay = x[i, j], y[i, j]
                bx, by = x[i + 1, j + 1], y[i + 1, j + 1]
                cx, cy = x[ci, cj], y[ci, cj]
                area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
                if area == 0.0 or not np.isfinite(area):
                    continue
                left = max(int(np.ceil(min(ax, bx, cx))), 0)
                right = min(int(np.floor(max(ax, bx, cx))), columns - 1)
                low = max(int(np.ceil(min(ay, by, cy))), 0)
                high = min(int(np.floor(max(ay, by, cy))), rows - 1)
                for row in range(low, high + 1):
                    for column in range(left, right + 1):
                        u = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                        v = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                        if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
                            continue
                        w = 1.0 - u - v
                        far = w * z[i, j] + u * z[i + 1, j + 1] + v * z[ci, cj]
                        if far < depth[row, column]:
                            depth[row, column] = far
                            number_out[row, column] = number
                            for k in range(3):
                                normal_out[row, column, k] = (
                                    w * normals[i, j, k]
                                    + u * normals[i + 1, j + 1, k]
                                    + v * normals[ci, cj, k]
                                )


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
