"""Force laws for the contact of two textured bodies.

*Otaduy & Lin* (2004, Eqs 2 and 3): `F = k w delta m`, with k the stiffness, w the contact's weight,
delta the penetration depth of the textured surfaces and m their common normal. It acts at the
deepest point, which gives the torque.

The other laws use the penetration depth d of the smooth bodies, and height h and gradient of the
scene body's texture at one point, where the smooth tool is deepest. The tool's texture and size
have no effect. n is the unit normal.

*Minsky* (1995): `F = k d (n - grad h)`, her lateral force with the normal force as its gain.

*Ho et al.* (1999): a perturbed normal `M = (n - grad h) / |n - grad h|`, with h measured from the
lowest point of the map: `F = k ((d - K h) n + K h M)` if `d >= K h`, else `k d M`.

*Siira & Pai* (1996): `F = k d (n + e)`, e low-passed Gaussian noise perpendicular to n, while the
tool slides.

These three are implemented as later work quotes them; see the modules of the 1-D laws.

*Friction* (`friction`) is added to each of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.geom_depth import BodyGeoms, smooth_texture_under
from asperity.contact.response.settings import LAWS

OTADUY_LIN = LAWS.index("otaduy-lin")
MINSKY = LAWS.index("minsky")
HO = LAWS.index("ho")
SIIRA_PAI = LAWS.index("siira-pai")
"""Indices into `settings.LAWS`."""
_SLIDING = 1e-24
"""Square of the displacement in one tick above which the tool slides [m^2]."""


class PointContact(NamedTuple):
    """Inputs of a point law at one contact. Vectors are in world axes."""

    normal: NDArray[np.float64]
    """n, (3,)."""
    push: float
    """Normal force k w d [N]."""
    depth: float
    """d, of the smooth bodies [m]."""
    height: float
    """h, the texture's height above the lowest point of its map [m]."""
    gradient: NDArray[np.float64]
    """Gradient of h, perpendicular to n [-]; (3,)."""
    noise: NDArray[np.float64]
    """e, perpendicular to n [-]; (3,)."""


class PointQuery(NamedTuple):
    """Point at which a point law reads the texture. Vectors are in world axes."""

    body: BodyGeoms
    """Geoms of the scene body that belong to the patch."""
    normal: NDArray[np.float64]
    """n, (3,)."""
    point: NDArray[np.float64]
    """The smooth tool's deepest point relative to its centre [m], (3,)."""
    displacement: NDArray[np.float64]
    """Of the tool's material at that point since the last tick [m], (3,)."""
    push: float
    """Normal force k w d [N]."""
    depth: float
    """d, of the smooth bodies [m]."""


@inner_kernel
def minsky_force(contact, force_out):
    """Fill the force (3,) of Minsky (1995) [N]."""
    for i in range(3):
        force_out[i] = contact.push * (contact.normal[i] - contact.gradient[i])


@inner_kernel
def ho_force(contact, gain, force_out):
    """Fill the force (3,) of Ho et al. (1999) with their gain K [N]."""
    n, gradient, depth = contact.normal, contact.gradient, contact.depth
    size = 0.0
    for i in range(3):
        size += (n[i] - gradient[i]) ** 2
    size = math.sqrt(size)
    share = min(gain * contact.height / depth, 1.0) if depth > 0.0 else 1.0
    for i in range(3):
        perturbed = share * (n[i] - gradient[i]) / size
        force_out[i] = contact.push * ((1.0 - share) * n[i] + perturbed)


@inner_kernel
def siira_pai_force(contact, force_out):
    """Fill the force (3,) of Siira & Pai (1996) [N]."""
    for i in range(3):
        force_out[i] = contact.push * (contact.normal[i] + contact.noise[i])


@inner_kernel
def point_force(model, law, query, noise, workspace, force_out):
    """Fill the force (3,) of a point law [N].

    Parameters
    ----------
    model : SceneModel
    law : PointLaw
    query : PointQuery
    noise : NOISE
        State of the noise of Siira & Pai.
    workspace : Workspace
    """
    gradient, error = stack_array((3,)), stack_array((3,))
    clear(gradient)
    clear(error)
    n, height = query.normal, 0.0
    if law.law == SIIRA_PAI:
        moved = query.displacement
        along = moved[0] * n[0] + moved[1] * n[1] + moved[2] * n[2]
        slid = moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2 - along * along
        if slid > _SLIDING:
            tangential_noise(noise, n, law.noise_level, error)
    else:
        height = smooth_texture_under(
            model.textures, model.geometry, query.body, n, query.point, workspace, gradient
        )
    contact = PointContact(n, query.push, query.depth, height, gradient, error)
    if law.law == MINSKY:
        minsky_force(contact, force_out)
    elif law.law == HO:
        ho_force(contact, law.ho_gain, force_out)
    elif law.law == SIIRA_PAI:
        siira_pai_force(contact, force_out)
    else:
        clear(force_out)


@inner_kernel
def advance_noise(noise, law, dt):
    """Advance the noise of Siira & Pai by one tick of `dt` [s]."""
    if law.law == SIIRA_PAI:
        filter_noise(noise, math.exp(-2.0 * math.pi * law.noise_bandwidth * dt))


@inner_kernel
def filter_noise(noise, share):
    """Draw three Gaussian values of unit variance and low-pass them.

    Parameters
    ----------
    noise : NOISE
        Changed.
    share : float
        Weight of the last value in the first-order low-pass, 0 to 1.
    """
    fresh = math.sqrt(1.0 - share * share)
    for i in range(3):
        # Two uniform numbers from a counter (Steele et al. 2014, splitmix64), Box and Muller.
        a, b = _uniform(noise), _uniform(noise)
        value = math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)
        noise.value[i] = share * noise.value[i] + fresh * value


@inner_kernel
def tangential_noise(noise, n, level, out):
    """Fill the part (3,) of the noise perpendicular to n, with standard deviation `level`."""
    value = noise.value
    along = value[0] * n[0] + value[1] * n[1] + value[2] * n[2]
    for i in range(3):
        out[i] = level * (value[i] - along * n[i])


@inner_kernel
def _uniform(noise):
    """Return the next uniform random number in (0, 1)."""
    noise.counter += 1.0
    z = np.uint64(noise.counter) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0
