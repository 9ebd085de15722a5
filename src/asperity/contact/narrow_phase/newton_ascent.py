"""Newton ascent from a point to a local maximum of the overlap within the limits of both patches.

Each step maximises the second-order Taylor expansion of the overlap within a box and the linearised
limits (sequential quadratic programming). With two unknowns no solver is needed: the maximum is in
the interior, on one line, or at the intersection of two, and all of these are tried.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.records import copy_record
from asperity.contact.narrow_phase.overlap import limits_at, overlap_at
from asperity.contact.narrow_phase.sphere_on_plane import ascend_sphere, is_sphere_on_plane

FEASIBLE = 1e-11
"""Distance beyond a limit up to which a point counts as feasible [m]."""
_STEPS = 40
_SHORTEST = 1e-14
"""Step length at which the ascent ends [m]."""
_CLOSE = 1e-10
"""Step length below which a step that does not halve the last one is rounding [m]."""
_ACTIVE = 1e-8
"""Distance of a point from a limit below which the limit is active [m]."""
_ALMOST = 1e-9
"""Step length below which a step a thousandth of the last one is the final one [m]."""
_ROUNDING = 1e-15
"""Precision to which limits are kept [m]."""
_LEVEL = 1e-12
"""Slope below which a quadratic counts as level."""
_CORRECTIONS = 3


@inner_kernel
def _level_step(g_x, g_y, h_xx, h_xy, h_yy):
    """Return the shortest step to the ridge or plateau of a quadratic, and whether it has one.

    A ridge curves down along one direction and is level along the other; a plateau is level.
    """
    half, gap = 0.5 * (h_xx + h_yy), 0.5 * (h_xx - h_yy)
    root = math.sqrt(gap * gap + h_xy * h_xy)
    low, high = half - root, half + root
    if high > 1e-9 * max(abs(low), 1.0):
        return 0.0, 0.0, False
    # The direction of least curvature.
    e_x, e_y = (h_xy, high - h_xx) if abs(h_xy) > 1e-12 * root else (1.0, 0.0)
    if abs(h_xy) <= 1e-12 * root and h_xx < h_yy:
        e_x, e_y = 0.0, 1.0
    size = math.sqrt(e_x * e_x + e_y * e_y)
    e_x, e_y = e_x / size, e_y / size
    if abs(g_x * e_x + g_y * e_y) > _LEVEL:
        return 0.0, 0.0, False
    across = g_y * e_x - g_x * e_y
    if low > -1e-9:
        return 0.0, 0.0, abs(across) <= _LEVEL
    step = -across / low
    return -step * e_y, step * e_x, True


@inner_kernel
def _best_step(at, hessian, lines, count):
    """Return the step that maximises a quadratic within half planes, and whether there is one.

    The quadratic has the gradient of `at` and the Hessian (xx, xy, yy) given.
    """
    h_xx, h_xy, h_yy = hessian
    g_x, g_y = at.f_x, at.f_y
    det = h_xx * h_yy - h_xy * h_xy
    if h_xx < 0.0 and det > 0.0:
        dx, dy = -(h_yy * g_x - h_xy * g_y) / det, -(h_xx * g_y - h_xy * g_x) / det
        fits = True
        for i in range(count):
            if lines[i].n_x * dx + lines[i].n_y * dy > lines[i].limit:
                fits = False
                break
        if fits:
            return dx, dy, True
    dx, dy, fits = _level_step(g_x, g_y, h_xx, h_xy, h_yy)
    if fits:
        for i in range(count):
            fits = fits and lines[i].n_x * dx + lines[i].n_y * dy <= lines[i].limit
        if fits:
            return dx, dy, True
    best, best_x, best_y, found = -np.inf, 0.0, 0.0, False
    for i in range(count):
        a, b, r = lines[i].n_x, lines[i].n_y, lines[i].limit
        square = a * a + b * b
        if square == 0.0:
            continue
        base_x, base_y = a * r / square, b * r / square
        along_x, along_y = -b, a
        bend = h_xx * along_x * along_x + 2.0 * h_xy * along_x * along_y + h_yy * along_y * along_y
        rise = (g_x + h_xx * base_x + h_xy * base_y) * along_x
        rise += (g_y + h_xy * base_x + h_yy * base_y) * along_y
        for j in range(i, count):
            if j == i:
                if bend >= 0.0:
                    continue
                s = -rise / bend
            else:
                cross = lines[j].n_x * along_x + lines[j].n_y * along_y
                if abs(cross) <= 1e-14 * square:
                    continue
                s = (lines[j].limit - lines[j].n_x * base_x - lines[j].n_y * base_y) / cross
            dx, dy = base_x + s * along_x, base_y + s * along_y
            value = g_x * dx + g_y * dy
            value += 0.5 * (h_xx * dx * dx + 2.0 * h_xy * dx * dy + h_yy * dy * dy)
            if value <= best:
                continue
            fits = True
            for k in range(count):
                if k != i and k != j:
                    over = lines[k].n_x * dx + lines[k].n_y * dy - lines[k].limit
                    if over > 1e-15 + 1e-12 * abs(lines[k].limit):
                        fits = False
                        break
            if fits:
                best, best_x, best_y, found = value, dx, dy, True
    return best_x, best_y, found


@inner_kernel
def _lagrangian_hessian(at, limits, count):
    """Return the Hessian (xx, xy, yy) of the Lagrangian: the overlap minus the active limits.

    Without the curvature of the limits, steps along a curved one converge slowly.
    """
    h_xx, h_xy, h_yy = at.f_xx, at.f_xy, at.f_yy
    for i in range(count):
        if limits[i].g > -_ACTIVE:
            a, b = limits[i].g_x, limits[i].g_y
            multiplier = (at.f_x * a + at.f_y * b) / max(a * a + b * b, 1e-300)
            if multiplier > 0.0:
                h_xx -= multiplier * limits[i].g_xx
                h_xy -= multiplier * limits[i].g_xy
                h_yy -= multiplier * limits[i].g_yy
    return h_xx, h_xy, h_yy


@inner_kernel
def _violation(limits, count):
    """Return the largest violation of the limits at a point [m]."""
    worst = 0.0
    for i in range(count):
        worst = max(worst, limits[i].g)
    return worst


@inner_kernel
def is_within(patch, other, at, search):
    """Return whether a point of `overlap_at` is within the limits of both patches."""
    limits = search.limits
    return _violation(limits, limits_at(patch, other, at, limits)) <= FEASIBLE


@inner_kernel
def _projected(limits, count, x, y, box):
    """Return (x, y) moved back onto the limit that it violates most."""
    worst = 0
    for i in range(1, count):
        if limits[i].g > limits[worst].g:
            worst = i
    a, b = limits[worst].g_x, limits[worst].g_y
    share = limits[worst].g / max(a * a + b * b, 1e-300)
    x0, x1, y0, y1 = box
    return min(max(x - share * a, x0), x1), min(max(y - share * b, y0), y1)


@inner_kernel
def constrained_step(at, x, y, box, stride, count, search):
    """Return the best step from (x, y) within a box and `count` limits, and whether there is one.

    Neither component is longer than `stride`. The limits are those of `search`.
    """
    limits, lines = search.limits, search.half_planes
    x0, x1, y0, y1 = box
    near = np.int64(0)
    for i in range(count):
        # Ignore limits that no step of this length can reach.
        if stride * (abs(limits[i].g_x) + abs(limits[i].g_y)) > -limits[i].g:
            lines[near].limit = -limits[i].g
            lines[near].n_x, lines[near].n_y = limits[i].g_x, limits[i].g_y
            near += 1
    for side in range(4):
        sign = 1.0 if side & 1 else -1.0
        lines[near].n_x, lines[near].n_y = (sign, 0.0) if side < 2 else (0.0, sign)
        near += 1
    lines[near - 4].limit = min(x - x0, stride)
    lines[near - 3].limit = min(x1 - x, stride)
    lines[near - 2].limit = min(y - y0, stride)
    lines[near - 1].limit = min(y1 - y, stride)
    return _best_step(at, _lagrangian_hessian(at, limits, count), lines, near)


@inner_kernel
def newton_ascent(textures, patch, other, box, x, y, stride, search):
    """Ascend from (x, y) to a local maximum within `box` and the limits, and fill `search.at`.

    Returns whether the point is within the limits. `box` is (x0, x1, y0, y1); no step is longer
    than `stride` along an axis [m].
    """
    x0, x1, y0, y1 = box
    x, y = min(max(x, x0), x1), min(max(y, y0), y1)
    if is_sphere_on_plane(patch, other):
        x, y = ascend_sphere(textures, patch, other, box, x, y, stride)
    at, trial, limits = search.at, search.trial, search.limits
    overlap_at(textures, patch, other, x, y, search, at)
    if at.f == -np.inf:
        return False
    count = limits_at(patch, other, at, limits)
    over = _violation(limits, count)
    length = np.inf
    for _ in range(_STEPS):
        dx, dy, found = constrained_step(at, x, y, box, stride, count, search)
        if not found:
            # No step reaches the limits: the violation can only be reduced.
            return over <= FEASIBLE
        length, last = abs(dx) + abs(dy), length
        if length < _SHORTEST or (length < _CLOSE and length > 0.5 * last):
            break
        penalty = 10.0 * (1.0 + abs(at.f_x) + abs(at.f_y))
        new_x, new_y = min(max(x + dx, x0), x1), min(max(y + dy, y0), y1)
        overlap_at(textures, patch, other, new_x, new_y, search, trial)
        better = False
        if trial.f > -np.inf:
            trial_count = limits_at(patch, other, trial, limits)
            trial_over = _violation(limits, trial_count)
            for _ in range(_CORRECTIONS):
                if trial_over <= _ROUNDING:
                    break
                # A step along a curved limit ends beyond it: project it back, or the penalty would
                # hide the gain along the limit.
                new_x, new_y = _projected(limits, trial_count, new_x, new_y, box)
                overlap_at(textures, patch, other, new_x, new_y, search, trial)
                if trial.f == -np.inf:
                    break
                trial_count = limits_at(patch, other, trial, limits)
                trial_over = _violation(limits, trial_count)
            gain = trial.f - at.f - penalty * (max(trial_over, _ROUNDING) - max(over, _ROUNDING))
            # Rounding beyond a limit raises a point by as much. Short, shrinking steps are in the
            # quadratic regime and are accepted without a gain.
            trusted = length < _ACTIVE and length < 0.5 * last
            better = gain >= (-penalty * _ROUNDING if trusted else -1e-17)
        if better:
            copy_record(at, trial)
            x, y, over, count = new_x, new_y, trial_over, trial_count
            if length < _ALMOST and length < 1e-3 * last:
                # Quadratic convergence: the next step is below rounding.
                break
        else:
            stride = 0.25 * max(abs(dx), abs(dy))
            if stride < _SHORTEST:
                break
            length = np.inf
            count = limits_at(patch, other, at, limits)
    return over <= FEASIBLE
