r"""A crude model of a finger, as a wide and soft probe.

A bare finger codes coarse roughness mostly by the spatial deformation of its skin, which is not
modelled. One property is kept: a fingertip touches many elements at once, and the force on the
finger averages over them. Each element of skin rests on the surface as a ball of diameter `skin`,
and the texture force is that of the mean penetration depth over the contact,

    delta(u) = sum_x w(x) H_skin(u + x) ,   w parabolic over a disk of diameter `contact`,

and Eqs 6 and 7 apply as for a probe. All its numbers are asperity's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.geometry.offsets.sampled import SampledProfile
from asperity.geometry.offsets.surface import Profile
from asperity.studies.otaduy_lin_2004.force_models import minsky

_PIXEL = 0.05e-3
_LEAST_SAMPLES = 32
"""Least number of samples of one period of a plate."""


@dataclass(frozen=True)
class Finger:
    """Sizes of the finger's contact; asperity's."""

    contact: float = 8e-3
    """Diameter of the contact [m]."""
    skin: float = 1e-3
    """Diameter of the balls that represent skin [m]."""
    lines: int = 7
    """Number of lines across the contact over which the mean is taken."""

    def slope_table(self, plate: Profile) -> PiecewiseCubic:
        """Return d(delta)/du along a plate, for a normal force of 1 N in Eq. 6.

        Any plate but dots is taken to be the same across its path.
        """
        samples = max(round(plate.period / _PIXEL), _LEAST_SAMPLES)
        pixel = plate.period / samples
        places = (np.arange(samples) + 0.5) * pixel
        across = (np.arange(self.lines) + 0.5) / self.lines - 0.5
        total, mass = np.zeros(samples), 0.0
        for offset in across * self.contact:
            line = plate
            if isinstance(plate, DotPlate):
                line = replace(plate, line=(plate.line or 0.0) + offset)
            weights = self._weights(samples, pixel, offset)
            heights = line.tracer(self.skin)(places).height
            total += np.fft.irfft(np.fft.rfft(heights) * np.fft.rfft(weights), samples)
            mass += float(np.sum(weights))
        return minsky.texture_force(SampledProfile(total / mass, pixel, "wrap"), 1.0)

    def _weights(self, samples: int, pixel: float, across: float) -> NDArray[np.float64]:
        """Return the weights of a line `across` from the middle, around place 0, periodic."""
        weights = np.zeros(samples)
        reach = int(0.5 * self.contact / pixel) + 1
        along = np.arange(-reach, reach + 1)
        distance = (along * pixel) ** 2 + across**2
        np.add.at(
            weights, along % samples, np.maximum(1.0 - distance / (0.5 * self.contact) ** 2, 0.0)
        )
        return weights
