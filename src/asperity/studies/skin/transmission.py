r"""Transmission of vibration from the grip to the skin.

The soft tissue between what is held and the receptors is a mass on a spring and a damper that is
shaken at its base, the simplest model with a resonance:

    T(f) = (1 + 2 i z r) / (1 - r^2 + 2 i z r) ,    r = f / f_n .

Its natural frequency is from Lundstrom (1984, "Local vibrations: mechanical impedance of the human
hand's glabrous skin", abstract): about 200 Hz in the outermost part of the finger, about 80 Hz in
the palm near the thumb. That source has damping that hardly differs between places, and no number
for it in what could be read: the damping ratio here is asperity's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.errors import require_positive


@dataclass(frozen=True)
class Tissue:
    """Soft tissue between the grip and the receptors."""

    natural_frequency: float = 200.0
    """[Hz], above 0; 200 at the fingertip, 80 in the palm near the thumb (Lundstrom 1984)."""
    damping_ratio: float = 0.5
    """Above 0; asperity's."""

    def __post_init__(self) -> None:
        require_positive("natural_frequency", self.natural_frequency, "[Hz]")
        require_positive("damping_ratio", self.damping_ratio)


FINGERTIP = Tissue(200.0)
PALM = Tissue(80.0)


def transmissibility(frequencies: ArrayLike, tissue: Tissue = FINGERTIP) -> NDArray[np.complex128]:
    """Return the motion at the receptors over the motion of the grip, complex.

    Parameters
    ----------
    frequencies : array
        [Hz], 0 or above.
    tissue : Tissue
    """
    ratio = np.asarray(frequencies, dtype=np.float64) / tissue.natural_frequency
    friction = 2j * tissue.damping_ratio * ratio
    return np.asarray((1.0 + friction) / (1.0 - ratio**2 + friction))
