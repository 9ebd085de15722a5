"""The load of two bodies, one with a stiffness map, by Newton's method: see `compliance`.

Local steps from the deepest point of the last search alternate with searches for a deeper point
under the new load.
"""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity._core.records import copy_record
from asperity.contact.narrow_phase.compliance import compliance_at
from asperity.contact.narrow_phase.newton_ascent import newton_ascent
from asperity.contact.narrow_phase.patch_pair import pair_shift, searches_a, window_of

FOUND = 1e-13
"""Size of the largest lowered overlap below which the load has converged [m]."""
MOST_SEARCHES = 12
_STEPS = 20
_ROUNDING = 1e-15
"""Relative size of the last local step."""


@inner_kernel
def _patches_of(stride, number, memory):
    """Return the searched patch of a pair, and the other one."""
    a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
    return (a, b) if searches_a(a, b) else (b, a)


@inner_kernel
def scale_of_tie(textures, stride, tie, memory):
    """Return the square root of the stiffness at a tie over the default one."""
    patch, other = _patches_of(stride, tie.pair, memory)
    usual = memory.search[0].usual
    return math.sqrt(usual / compliance_at(textures, patch, other, tie.x, tie.y, usual)[0])


@inner_kernel
def scale_of(result):
    """Return the factor by which a stiffness map scales a depth; 1 without a map."""
    return result.scale if result.scale > 0.0 else 1.0


@inner_kernel
def patches_have_map(memory, made_a, made_b):
    """Return whether any of the patches of two bodies has a stiffness map that counts."""
    found = False
    for i in range(made_a):
        found = found or memory.patches_a[i].stiffness_map >= 0
    for i in range(made_b):
        found = found or memory.patches_b[i].stiffness_map >= 0
    return found and memory.search[0].usual > 0.0


@inner_kernel
def raise_load(textures, stride, memory):
    """Set the load to that of the local maximum at the deepest point; fill `search.at` with it."""
    search = memory.search[0]
    number, at = search.best.pair, search.at
    patch, other = _patches_of(stride, number, memory)
    window = window_of(patch, other, pair_shift(textures, patch, other))
    stride_length = 0.1 * max(window[1] - window[0], window[3] - window[2])
    copy_record(at, search.best)
    for _ in range(_STEPS):
        c = compliance_at(textures, patch, other, at.x, at.y, search.usual)[0]
        step = at.f / math.sqrt(c)
        search.load += step
        if abs(step) <= _ROUNDING * search.load:
            break
        if not newton_ascent(textures, patch, other, window, at.x, at.y, stride_length, search):
            break


@inner_kernel
def settle_load(textures, stride, memory):
    """Raise the load by the lowered overlap that remains at the deepest point."""
    search = memory.search[0]
    patch, other = _patches_of(stride, search.best.pair, memory)
    best = search.best
    c = compliance_at(textures, patch, other, best.x, best.y, search.usual)[0]
    search.load += search.incumbent / math.sqrt(c)
