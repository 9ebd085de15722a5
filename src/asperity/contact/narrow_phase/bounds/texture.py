"""Bounds of a chart's texture and of its normal over a box of its parameters."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity.contact.narrow_phase.bounds.triplanar import (
    MIX_1,
    MIX_2,
    mixing,
    triplanar_slopes,
    triplanar_top,
)
from asperity.contact.narrow_phase.displaced_surface import root_at
from asperity.contact.narrow_phase.surface_patch import (
    B0,
    B1,
    B2,
    B3,
    BEND_1,
    BEND_2,
    CYLINDRICAL,
    E_MOST,
    LEAST_ROOT,
    LEVEL,
    MAPPING,
    PLANAR,
    ROUND,
    SIDE,
    STRETCH,
    TEXTURE,
    TRIPLANAR,
    UNIT,
    UV_LEAST,
    UV_MOST,
    UV_ROOT,
    V0,
    V1,
    V2,
    V3,
    C,
    E,
)
from asperity.texture.highest import texture_top
from asperity.texture.packed import slope_bounds, texture_bounds


@small_kernel
def roots_over(chart, x, y, radius):
    """Return the least and the largest root within `radius` of (x, y); the least may be -1."""
    if chart[C] == 0.0:
        return 1.0, 1.0
    square = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
    out, reach = math.sqrt(max(square, 0.0)), math.sqrt(chart[E_MOST]) * radius
    near, far = max(out - reach, 0.0), out + reach
    most = math.sqrt(1.0 - near * near) if near < 1.0 else -1.0
    return (math.sqrt(1.0 - far * far) if far < 1.0 else -1.0), most


@small_kernel
def sideways(textures, chart):
    """Return how far a chart's texture moves points sideways at most [m]."""
    if chart[TEXTURE] < 0.0 or chart[LEVEL] == 1.0:
        return 0.0
    return textures.maps[int(chart[TEXTURE])].max_abs_height * chart[SIDE]


@small_kernel
def on_texture(chart, x, y, half_x, half_y):
    """Return the rectangle u0, u1, v0, v1 of a planar map that a box of a plane chart lies on."""
    ru = abs(chart[B1]) * half_x + abs(chart[B2]) * half_y
    rv = abs(chart[B1 + 1]) * half_x + abs(chart[B2 + 1]) * half_y
    u = chart[B0] + chart[B1] * x + chart[B2] * y
    v = chart[B0 + 1] + chart[B1 + 1] * x + chart[B2 + 1] * y
    return u - ru, u + ru, v - rv, v + rv


@small_kernel
def slopes_on_plane(textures, chart, x, y, half_x, half_y):
    """Return size of t', largest t'' and its size over a box of a plane chart with a planar map."""
    k, speed = int(chart[TEXTURE]), chart[UV_MOST]
    u0, u1, v0, v1 = on_texture(chart, x, y, half_x, half_y)
    slope, bend = slope_bounds(textures, k, u0, u1, v0, v1)
    least = chart[UV_LEAST] if bend < 0.0 else speed
    return slope * speed, bend * least * least, textures.maps[k].max_curvature * speed * speed


@small_kernel
def slopes_on_three(textures, chart, x, y, half_x, half_y, w1, w2):
    """Do `slopes_on_plane` for a triplanar map; `w1`, `w2`: sizes of w' and w''."""
    k = int(chart[TEXTURE])
    slope, bend = triplanar_slopes(textures, chart, x, y, half_x, half_y)
    size_bend = textures.maps[k].max_curvature
    if chart[UNIT] == 1.0:
        return slope, bend, size_bend
    mix_1, mix_2 = mixing(chart, x, y, half_x, half_y)
    size = textures.maps[k].max_abs_height
    more = 2.0 * mix_1 * w1 * slope + (mix_2 * w1 * w1 + mix_1 * w2) * size
    return slope + mix_1 * w1 * size, bend + more, size_bend + more


@small_kernel
def level_texture(textures, chart, x, y, half_x, half_y):
    """Do `texture_over` for a level chart with a planar map, where w is constant."""
    u0, u1, v0, v1 = on_texture(chart, x, y, half_x, half_y)
    high = texture_top(textures, int(chart[TEXTURE]), u0, u1, v0, v1)
    slope, bend, size_bend = slopes_on_plane(textures, chart, x, y, half_x, half_y)
    return high, slope, bend, size_bend


@small_kernel
def plane_normal(chart, x, y, radius):
    """Return a plane chart's unit normal at (x, y), and bounds within `radius`.

    They are how much the normal changes, and the sizes of w' and w''.
    """
    v_u, v_v, v_z = chart[V0], chart[V0 + 1], chart[V0 + 2]
    if chart[UNIT] == 1.0:
        return v_u, v_v, v_z, 0.0, 0.0, 0.0
    slopes = 0.0
    for i in range(3):
        slopes += chart[V1 + i] * chart[V1 + i] + chart[V2 + i] * chart[V2 + i]
    slopes = math.sqrt(slopes)
    v_u += chart[V1] * x + chart[V2] * y
    v_v += chart[V1 + 1] * x + chart[V2 + 1] * y
    v_z += chart[V1 + 2] * x + chart[V2 + 2] * y
    size = math.sqrt(v_u * v_u + v_v * v_v + v_z * v_z)
    w1, w2 = chart[BEND_1], chart[BEND_2]
    # Before it is made a unit vector w is linear: in the box not much shorter than here.
    shortest = size - slopes * radius
    if slopes < w1 * shortest:
        w1 = slopes / shortest
        w2 = 3.0 * w1 * w1
    over = 1.0 / size
    return v_u * over, v_v * over, v_z * over, w1 * radius, w1, w2


@inner_kernel
def texture_over(textures, chart, x0, x1, y0, y1):
    """Return bounds of a chart's texture and normal over a box of its parameters.

    Returns
    -------
    tuple of 12 floats
        Highest t; size of t'; largest t'' and its size; w along u, v and z at the middle, and
        how much it changes over the box; sizes of w' and w''; least and most root. Derivatives
        are along unit directions of the chart's parameters. Roots are -1 outside the ellipse.
    """
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    radius = math.sqrt(half_x * half_x + half_y * half_y)
    least, most = roots_over(chart, x, y, radius)
    if most <= 0.0:
        return -np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0
    textured = chart[TEXTURE] >= 0.0
    if not textured:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, least, most
    k = int(chart[TEXTURE])
    mapping = chart[MAPPING]
    curved = chart[C] > 0.0
    low = max(least, 0.5 * chart[LEAST_ROOT])
    if chart[LEVEL] == 1.0 and mapping == PLANAR:
        high, slope, bend, size_bend = level_texture(textures, chart, x, y, half_x, half_y)
        return high, slope, bend, size_bend, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0
    if mapping == TRIPLANAR and not curved:
        side_u, side_v, up, change, w1, w2 = plane_normal(chart, x, y, radius)
        slope, bend, size_bend = slopes_on_three(textures, chart, x, y, half_x, half_y, w1, w2)
        high = triplanar_top(textures, chart, x, y, half_x, half_y)
        return high, slope, bend, size_bend, side_u, side_v, up, change, w1, w2, 1.0, 1.0
    r1 = r2 = 0.0
    if curved:
        # The root's first and second derivative, and the normal's.
        r1 = math.sqrt(chart[E_MOST] * max(1.0 - low * low, 0.0)) / low
        r2 = chart[E_MOST] / (low * low * low)
        w1 = chart[STRETCH] * math.sqrt(chart[E_MOST]) / low
        w2 = chart[STRETCH] * r2
        if chart[UNIT] == 0.0:
            w2 += 3.0 * w1 * w1
        # A place to take the normal at; its change over the box is bounded.
        scale = 1.0
        if least < 0.0:
            out = x * (chart[E] * x + chart[E + 1] * y) + y * (chart[E + 1] * x + chart[E + 2] * y)
            scale = min(1.0, math.sqrt((1.0 - low * low) / max(out, 1e-300)))
        wx, wy = x * scale, y * scale
        root = root_at(chart, wx, wy)[0]
        side_u = chart[V0] + chart[V1] * wx + chart[V2] * wy + chart[V3] * root
        side_v = chart[V0 + 1] + chart[V1 + 1] * wx + chart[V2 + 1] * wy + chart[V3 + 1] * root
        up = chart[V0 + 2] + chart[V1 + 2] * wx + chart[V2 + 2] * wy + chart[V3 + 2] * root
        size = math.sqrt(side_u * side_u + side_v * side_v + up * up)
        change = w1 * (radius + (1.0 - scale) * math.sqrt(x * x + y * y))
        side_u, side_v, up = side_u / size, side_v / size, up / size
    else:
        side_u, side_v, up, change, w1, w2 = plane_normal(chart, x, y, radius)
    if mapping == CYLINDRICAL:
        radius_of, stretch = chart[ROUND], chart[ROUND + 5]
        a0 = stretch * radius_of * math.asin(min(max(y0 / radius_of, -1.0), 1.0))
        a1 = stretch * radius_of * math.asin(min(max(y1 / radius_of, -1.0), 1.0))
        if chart[ROUND + 2] < 0.0:
            a0, a1 = -a1, -a0
        low_root = max(least, 0.0)
        lean0, lean1 = chart[ROUND + 4] * low_root, chart[ROUND + 4] * most
        v = chart[ROUND + 3]
        high, slope, bend = texture_bounds(
            textures, k, chart[ROUND + 1] + a0, chart[ROUND + 1] + a1,
            v + x0 + min(lean0, lean1), v + x1 + max(lean0, lean1),
        )  # fmt: skip
        reach = 1.0 + chart[UV_ROOT] * r1
        speed = math.sqrt((stretch / low) ** 2 + reach * reach)
        turn = math.sqrt(max(1.0 - low * low, 0.0)) * stretch / (radius_of * low * low * low)
        turn += chart[UV_ROOT] * r2
        slowest = 0.0
    else:
        high, slope, bend = -np.inf, 0.0, -np.inf
        middle = 0.5 * (most + max(least, 0.0))
        half_root = 0.5 * (most - max(least, 0.0))
        for i in range(3 if mapping != PLANAR else 1):
            one, two = (0, 1) if mapping == PLANAR else ((i + 1) % 3, (i + 2) % 3)
            u = chart[B0 + one] + chart[B1 + one] * x + chart[B2 + one] * y
            u += chart[B3 + one] * middle - (chart[ROUND] if mapping != PLANAR else 0.0)
            v = chart[B0 + two] + chart[B1 + two] * x + chart[B2 + two] * y
            v += chart[B3 + two] * middle - (chart[ROUND + 1] if mapping != PLANAR else 0.0)
            ru = abs(chart[B1 + one]) * half_x + abs(chart[B2 + one]) * half_y
            ru += abs(chart[B3 + one]) * half_root
            rv = abs(chart[B1 + two]) * half_x + abs(chart[B2 + two]) * half_y
            rv += abs(chart[B3 + two]) * half_root
            h, s, b = texture_bounds(textures, k, u - ru, u + ru, v - rv, v + rv)
            high, slope, bend = max(high, h), max(slope, s), max(bend, b)
        speed = chart[UV_MOST] + chart[UV_ROOT] * r1
        turn = chart[UV_ROOT] * r2
        slowest = max(chart[UV_LEAST] - chart[UV_ROOT] * r1, 0.0)
    bend = bend * (speed * speed if bend > 0.0 else slowest * slowest) + slope * turn
    size_bend = textures.maps[k].max_curvature * speed * speed + slope * turn
    slope *= speed
    if mapping == TRIPLANAR:
        size = textures.maps[k].max_abs_height
        more = 2.0 * MIX_1 * w1 * slope + (MIX_2 * w1 * w1 + MIX_1 * w2) * size
        bend += more
        size_bend += more
        slope += MIX_1 * w1 * size
    return high, slope, bend, size_bend, side_u, side_v, up, change, w1, w2, least, most
