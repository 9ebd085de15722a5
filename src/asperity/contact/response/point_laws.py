r"""From a contact to a force on the tool, in six directions.

*Otaduy & Lin* (2004, Eqs 2 and 3): `F = k w delta m` at the deepest place of the two textured
surfaces, so that the torque follows from where that is.

The baselines take the smooth bodies' depth d, and height h and slope of B's texture at one point,
where the smooth tool is deepest; the tool's own texture and size do not enter.

*Minsky* (1995): `F = k d (n - grad h)`, her lateral force with the normal force as its gain.

*Ho et al.* (1999): a perturbed normal `M = (n - grad h) / |n - grad h|`, h counted from the
lowest point of the map: `F = k ((d - K h) n + K h M)` if `d >= K h`, else `k d M`.

*Siira & Pai* (1996): `F = k d (n + e)`, e Gaussian noise across n, low-passed, while sliding.

The three are quoted as other work gives them (see the modules of the 1-D laws).

*Friction* comes on top of any of them: an elastic bristle that moves with the tool, its force
limited by Coulomb's coefficient times the normal force; the patch sticks until then.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel

OTADUY_LIN, MINSKY, HO, SIIRA_PAI = 0, 1, 2, 3


@inner_kernel
def textured_point_force(law, push, n, gradient, height, depth, gain, noise, out):
    """Fill the force (3,) of a baseline.

    `push` is the normal force k w d [N]; `gradient` (3,) of B's height, across n; `height` over
    the map's lowest point and `depth` d [m]; `noise` (3,) across n.
    """
    if law == MINSKY:
        for i in range(3):
            out[i] = push * (n[i] - gradient[i])
    elif law == HO:
        size = 0.0
        for i in range(3):
            size += (n[i] - gradient[i]) ** 2
        size = math.sqrt(size)
        share = min(gain * height / depth, 1.0) if depth > 0.0 else 1.0
        for i in range(3):
            out[i] = push * ((1.0 - share) * n[i] + share * (n[i] - gradient[i]) / size)
    else:
        for i in range(3):
            out[i] = push * (n[i] + noise[i])


@inner_kernel
def bristle_force(bristle, moved, across, stiffness, limit, out):
    """Move a bristle by `moved` (3,) [m]; fill its force (3,) [N], at most `limit`.

    `across` (3,) is the direction, not of unit length, that the bristle is perpendicular to. The
    bristle's deflection [m] is kept in `bristle`: it sticks, and slips when at its limit.
    """
    square = across[0] ** 2 + across[1] ** 2 + across[2] ** 2
    along = 0.0
    for i in range(3):
        bristle[i] += moved[i]
        along += bristle[i] * across[i]
    length = 0.0
    for i in range(3):
        bristle[i] -= along * across[i] / square
        length += bristle[i] * bristle[i]
    length = math.sqrt(length)
    scale = 1.0
    if stiffness * length > limit:
        scale = limit / (stiffness * length)
    for i in range(3):
        bristle[i] *= scale
        out[i] = -stiffness * bristle[i]


@inner_kernel
def filter_noise(state, share):
    """Draw three Gaussian values of unit variance and low-pass them.

    `state` (4,): the three filtered values, and the generator's counter. `share` is what a
    first-order low-pass keeps of the last value.
    """
    fresh = math.sqrt(1.0 - share * share)
    for i in range(3):
        # Two uniform numbers from a counter (Steele et al. 2014, splitmix64), Box and Muller.
        a, b = _uniform(state), _uniform(state)
        value = math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)
        state[i] = share * state[i] + fresh * value


@inner_kernel
def noise_across(state, n, level, out):
    """Fill the part across n of the noise, of standard deviation `level` along each axis."""
    along = state[0] * n[0] + state[1] * n[1] + state[2] * n[2]
    for i in range(3):
        out[i] = level * (state[i] - along * n[i])


@inner_kernel
def _uniform(state):
    """Return a number in (0, 1), and count on."""
    state[3] += 1.0
    z = np.uint64(state[3]) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0
