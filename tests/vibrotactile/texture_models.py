"""Small models for tests."""

import numpy as np

from asperity.vibrotactile.lsf import frequencies_of
from asperity.vibrotactile.model import TextureModel


def resonance(frequency, rate=1000.0, radius=0.95):
    w = 2 * np.pi * frequency / rate
    return [1.0, -2 * radius * np.cos(w), radius**2]


def model_of(rate=1000.0, **changes):
    """Return four models on the corners of a square; the resonance goes with the speed."""
    speeds = np.array([0.02, 0.1, 0.02, 0.1])
    forces = np.array([0.2, 0.2, 1.0, 1.0])
    values = {
        "name": "test", "rate": rate, "speeds": speeds, "forces": forces, "friction": 0.25,
        "ar": np.array([frequencies_of(resonance(50 + 2000 * v, rate)) for v in speeds]),
        "variance": 0.1 * forces**2,
    }  # fmt: skip
    return TextureModel(**(values | changes))
