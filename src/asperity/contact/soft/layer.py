"""Pressure of an elastic layer on a rigid base: a Winkler foundation.

A thin layer of thickness h, bonded to its base and without lateral strain, has the pressure

    p = K delta,      K = (1 - nu) E / ((1 + nu) (1 - 2 nu) h)

(K. L. Johnson, *Contact Mechanics*, 1985, section 4.3) at a compression delta. Here this holds up
to half of the thickness. Beyond, the layer stiffens, so that it is never pressed flat (a choice of
this package): with y = delta - h/2 and x = y / (h/2),

    p = K (h/2 + h/2 x / (1 - x)),      energy per area = integral of p.

p and its slope are continuous. From x = 0.95 on, where p is twenty times that at half of the
thickness, it continues along its tangent.
"""

from __future__ import annotations

import math

from asperity._core.kernels import small_kernel

LINEAR = 0.5
"""Strain up to which the pressure is linear [-]."""
_LAST = 0.95


@small_kernel
def layer_pressure(modulus, thickness, compression):
    """Return pressure [Pa], its slope [Pa/m] and energy per area [J/m^2] of a compression [m].

    `modulus` is K [Pa/m].
    """
    straight = LINEAR * thickness
    if compression <= straight:
        pressure = modulus * compression
        return pressure, modulus, 0.5 * pressure * compression
    rest = thickness - straight
    y = compression - straight
    x = min(y / rest, _LAST)
    over = 1.0 / (1.0 - x)
    pressure, slope = straight + rest * x * over, over * over
    energy = straight * (0.5 * straight + x * rest) + rest * rest * (-x - math.log(1.0 - x))
    beyond = y - x * rest
    energy += beyond * (pressure + 0.5 * slope * beyond)
    return modulus * (pressure + slope * beyond), modulus * slope, modulus * energy
