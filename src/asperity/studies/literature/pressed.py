"""A finger with compliant skin over the surfaces of the findings: pressure, no vibration."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.surface import Profile
from asperity.studies.literature.plates import Plate
from asperity.studies.skin.pressed_finger import PressedFinger

PIXEL = 0.1e-3
"""Of the patch under the finger [m]."""
HALF_WIDTH = 8e-3
"""Of the patch [m]."""
PLACES = 8
"""Places of the finger along the path."""


@functools.lru_cache(maxsize=4096)
def pressed_roughness(plate: Plate, spacing: float, force: float, finger: PressedFinger) -> float:
    """Return the unevenness of pressure as a plate of a spacing [m] passes below a finger.

    Parameters
    ----------
    plate : Plate
        Any but dots is taken to be the same across the path.
    spacing : float
        [m]
    force : float
        Of the finger [N].
    finger : PressedFinger
    """
    surface = plate.surfaces(spacing)[0]
    # Places over several elements, none at the same phase of a regular texture.
    stride = (1.0 + 1.0 / PLACES) * spacing
    patches = [_patch(surface, place * stride) for place in range(PLACES)]
    return finger.unevenness(patches, PIXEL, force)


def _patch(surface: Profile, place: float) -> NDArray[np.float64]:
    """Return the heights around a place of the path [m]."""
    across = np.arange(-HALF_WIDTH, HALF_WIDTH + 0.5 * PIXEL, PIXEL)
    u = place + across
    if isinstance(surface, DotPlate):
        return np.asarray(surface.heights(u[None, :], across[:, None]))
    return np.tile(surface.heights(u), (across.size, 1))
