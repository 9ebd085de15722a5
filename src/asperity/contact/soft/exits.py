"""Exit of a ray from a textured solid.

A solid is an intersection of sheets, so a ray leaves it at the first exit from one of its sheets.
The exit from a sheet is the last zero of `f` along the ray, between the exits from the sheet
lowered and raised by the texture's largest heights. It is found by Newton's method within a bracket
if f increases along the ray, else in steps from the far end within which f, by bounds of its slope,
has no zero.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.sheets import (
    BOX,
    CAPSULE,
    CURVED,
    CYLINDER,
    ELLIPSOID,
    PLANAR,
    PLANE,
    half_length,
    sheet_at,
)
from asperity.texture.packed import texture_slope

_CLOSE = 1e-13
"""Largest error of a zero [m]."""
STEPS = 400
PARALLEL = 1e-12
"""Sine below which a ray is parallel to a plane."""


@inner_kernel
def _chord(a, b, c):
    """Return both roots of a s^2 + 2 b s + c, (inf, -inf) without any."""
    square = b * b - a * c
    if a <= 0.0 or square < 0.0:
        return np.inf, -np.inf
    root = math.sqrt(square)
    return (-b - root) / a, (-b + root) / a


@inner_kernel
def _ball_chord(x, d, middle, radius):
    """Return where a ray enters and leaves a ball around (0, 0, middle)."""
    z = x[2] - middle
    along = x[0] * d[0] + x[1] * d[1] + z * d[2]
    return _chord(1.0, along, x[0] * x[0] + x[1] * x[1] + z * z - radius * radius)


@inner_kernel
def _tube_chord(x, d, radius):
    """Return where a ray enters and leaves an infinite cylinder around z."""
    across = d[0] * d[0] + d[1] * d[1]
    square = x[0] * x[0] + x[1] * x[1] - radius * radius
    if across < PARALLEL:
        return (-np.inf, np.inf) if square <= 0.0 else (np.inf, -np.inf)
    return _chord(across, x[0] * d[0] + x[1] * d[1], square)


@inner_kernel
def _curved_chord(kind, size, x, d, offset):
    """Return where a ray enters and leaves the curved sheet offset outwards by `offset`.

    An ellipsoid is scaled instead, to enclose its offset surface.
    """
    if kind == ELLIPSOID:
        grown = 1.0 + offset / min(size[0], size[1], size[2])
        a = b = c = 0.0
        for i in range(3):
            over = 1.0 / (size[i] * size[i])
            a += d[i] * d[i] * over
            b += x[i] * d[i] * over
            c += x[i] * x[i] * over
        return _chord(a, b, c - grown * grown)
    radius = size[0] + offset
    if kind == CYLINDER:
        return _tube_chord(x, d, radius)
    if kind != CAPSULE:
        return _ball_chord(x, d, 0.0, radius)
    first, last = np.inf, -np.inf
    for end in (-size[1], size[1]):
        one, two = _ball_chord(x, d, end, radius)
        first, last = min(first, one), max(last, two)
    one, two = _tube_chord(x, d, radius)
    if abs(x[2] + one * d[2]) <= size[1]:
        first = min(first, one)
    if abs(x[2] + two * d[2]) <= size[1]:
        last = max(last, two)
    return first, last


@small_kernel
def advance(s, value, rate, low, high, search):
    """Return the next s, the bracket, and whether s is the zero; s falls below `low` without one.

    `search` is whether f increases between `low` and `high`, and bounds of its second derivative
    and its slope along the ray.
    """
    is_bracket, bend, fastest = search
    if is_bracket:
        if value > 0.0:
            high = s
        else:
            low = s
        step = value / rate if rate > 0.0 else np.inf
        if not low <= s - step <= high:
            middle = 0.5 * (low + high)
            return middle, low, high, high - low < _CLOSE
        return s - step, low, high, bend * step * step < _CLOSE * rate
    if rate > 0.0 and 4.0 * bend * value <= rate * rate:
        # Kantorovich: the nearest zero is the only one within twice this step.
        step = value / rate
        return s - step, low, high, bend * step * step < _CLOSE * rate
    # By its largest slope, or by its slope here and its largest second derivative, f has no zero
    # within this step. If the ray touches the surface from outside, the search continues.
    ahead = (math.sqrt(rate * rate + 2.0 * bend * value) - rate) / bend if bend > 0.0 else 0.0
    return s - max(value / fastest, ahead, _CLOSE), low, high, False


@small_kernel
def _start(low, high, search):
    """Return the start of the search for a zero."""
    return max(0.5 * (low + high), low, 0.0) if search[0] else high


@inner_kernel
def _last_zero(solids, g, face, x, d, ends, search):
    """Return the last s between `ends` at which a ray leaves a sheet; -inf without one above 0.

    f is not negative at the far end.
    """
    at, normal = stack_array((3,)), stack_array((3,))
    low, high = ends
    s, floor = _start(low, high, search), low
    for _ in range(STEPS):
        for i in range(3):
            at[i] = x[i] + s * d[i]
        value = sheet_at(solids, g, face, at, normal)
        if value > 0.0 and s <= 0.0:
            return -np.inf  # the last zero is behind the start of the ray
        rate = normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2]
        s, low, high, is_found = advance(s, value, rate, low, high, search)
        if is_found:
            return s
        if s < floor:
            return -np.inf
    return s


@inner_kernel
def _last_zero_planar(textures, k, line, low, high, search):
    """Return `_last_zero` for a flat sheet with a planar map, several times faster.

    `line` has the distance from the smooth sheet, u and v at the ray's start, and their rates.
    """
    gap, u, v, straight, du, dv = line
    s, floor = _start(low, high, search), low
    for _ in range(STEPS):
        t, t_u, t_v = texture_slope(textures, k, u + s * du, v + s * dv)
        value, rate = gap + s * straight - t, straight - t_u * du - t_v * dv
        if value > 0.0 and s <= 0.0:
            return -np.inf  # the last zero is behind the start of the ray
        s, low, high, is_found = advance(s, value, rate, low, high, search)
        if is_found:
            return s
        if s < floor:
            return -np.inf
    return s


@inner_kernel
def _exit_flat_sheet(solids, g, face, x, d, gap, rate):
    """Return where a ray leaves a flat sheet; its height over the smooth one is gap + rate s."""
    geometry, reach = solids.geometry, solids.reach[g]
    surface, slope = geometry.surface[g], reach.slope
    k = geometry.texture[surface]
    low, high = (reach.lowest - gap) / rate, (reach.highest - gap) / rate
    if k < 0:
        return high
    aside = math.sqrt(max(1.0 - rate * rate, 0.0))
    search = (rate > slope * aside, reach.bend * aside * aside, rate + slope * aside)
    if geometry.mapping[surface] != PLANAR:
        return _last_zero(solids, g, face, x, d, (low, high), search)
    turn, at, origin = geometry.rotation[g], geometry.position[g], geometry.origin[surface]
    axis = face >> 1
    u, v = at[0] - origin[0], at[1] - origin[1]
    du = dv = 0.0
    for i in range(3):
        # The texture is read at the foot of the ray's point.
        foot = x[i] if i != axis else (x[i] - gap if face & 1 else x[i] + gap)
        u, v = u + turn[0, i] * foot, v + turn[1, i] * foot
        if i != axis:
            du, dv = du + turn[0, i] * d[i], dv + turn[1, i] * d[i]
    line = (gap, u, v, rate, du, dv)
    return _last_zero_planar(solids.textures, k, line, low, high, search)


@inner_kernel
def _exit_curved_sheet(solids, g, x, d):
    """Return where a ray leaves the curved sheet; -inf if it misses it."""
    geometry, reach = solids.geometry, solids.reach[g]
    kind, size = geometry.kind[g], geometry.size[g]
    enters, leaves = _curved_chord(kind, size, x, d, reach.highest)
    if geometry.texture[geometry.surface[g]] < 0:
        return leaves
    begins, low = _curved_chord(kind, size, x, d, reach.lowest)
    if low < begins:  # it misses the lowered sheet: search the far half of the chord
        low = 0.5 * (enters + leaves)
    search = (False, reach.bend, 1.1 * math.sqrt(1.0 + reach.slope**2))
    return _last_zero(solids, g, CURVED, x, d, (low, leaves), search)


@inner_kernel
def exit_of(solids, g, x, d, layer):
    """Return the distance along a ray to its exit from a solid [m], and the sheet; 0 for none.

    Parameters
    ----------
    solids : Solids
    g : int
        The geom.
    x, d : (3,) arrays
        Start of the ray and its unit direction, in the geom's frame.
    layer : float
        Thickness of the layer [m]. A solid that the ray enters beyond its start counts only if the
        exit is within the layer: else the solid is behind the layer.
    """
    kind, size = solids.geometry.kind[g], solids.geometry.size[g]
    low, high = solids.reach[g].lowest, solids.reach[g].highest
    begins, ends = -np.inf, np.inf
    first = 5 if kind == PLANE else (4 if kind == CYLINDER else 0)
    has_flats = kind in (PLANE, CYLINDER, BOX)
    if has_flats:
        for face in range(first, 6):
            sign = 1.0 if face & 1 else -1.0
            rate = sign * d[face >> 1]
            gap = sign * x[face >> 1] - half_length(kind, size, face >> 1) - high
            if rate > PARALLEL:
                ends = min(ends, -gap / rate)
            elif rate < -PARALLEL:
                begins = max(begins, -gap / rate)
            elif gap > 0.0:
                return 0.0, first
        if ends <= 0.0 or begins >= ends:
            return 0.0, first
    if kind != PLANE and kind != BOX:
        enters, leaves = _curved_chord(kind, size, x, d, high)
        begins, ends = max(begins, enters), min(ends, leaves)
        if ends <= 0.0 or begins >= ends:
            return 0.0, first
    if begins > 0.0 and ends > layer + (high - low):
        return 0.0, first
    found, by = np.inf, CURVED
    if has_flats:
        for face in range(first, 6):
            axis, sign = face >> 1, 1.0 if face & 1 else -1.0
            rate, gap = sign * d[axis], sign * x[axis] - half_length(kind, size, axis)
            if rate <= PARALLEL or (low - gap) / rate > min(found, ends) + _CLOSE:
                continue
            s = _exit_flat_sheet(solids, g, face, x, d, gap, rate)
            if s < found:
                found, by = s, face
    if kind != PLANE and kind != BOX:
        s = _exit_curved_sheet(solids, g, x, d)
        if s < found:
            found, by = s, CURVED
    if not found > max(begins, 0.0) or (begins > 0.0 and found > layer):
        return 0.0, by
    if kind == PLANE:
        for axis in range(2):
            if size[axis] > 0.0 and abs(x[axis] + found * d[axis]) > size[axis]:
                return 0.0, by
    return found, by
