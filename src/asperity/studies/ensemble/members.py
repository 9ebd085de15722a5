"""The members of the ensemble: hands, and the surfaces that they are dragged over.

No paper prints the hand that it has in mind, so a verdict on one hand is worth little. The ranges
are those that a hand holding a probe can have by the literature's order of magnitude; the grid in
them is asperity's, equally spaced in log.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.literature.plates import Dots, Sinusoids

MASSES = (0.02, 0.05, 0.1, 0.2)
"""[kg]"""
STIFFNESSES = (100.0, 300.0, 1000.0)
"""[N/m]"""
DAMPINGS = (1.0, 3.0, 10.0)
"""[N s/m]"""
AMPLITUDES = (0.02e-3, 0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3)
"""Of the sinusoids [m]."""
HEIGHTS = (0.02e-3, 0.1e-3, 0.2e-3, 0.4e-3)
"""Of the dots [m]."""
SEEDS = (0, 1)
"""Of the jitter of the dots."""
PATHS = 2
"""Paths over each plate of dots; a metric is that of both as consecutive strokes."""


def ensemble_hands() -> list[Hand]:
    """Return the 36 hands."""
    return [Hand(*values) for values in itertools.product(MASSES, STIFFNESSES, DAMPINGS)]


@dataclass(frozen=True)
class EnsembleSettings:
    """What the ensemble spans; every value is asperity's."""

    hands: tuple[Hand, ...] = tuple(ensemble_hands())
    amplitudes: tuple[float, ...] = AMPLITUDES
    """Of the sinusoids [m]."""
    heights: tuple[float, ...] = HEIGHTS
    """Of the dots [m]."""
    seeds: tuple[int, ...] = SEEDS
    sinusoid_spacings: int = 16
    """Number of spacings of a curve over sinusoids."""
    dot_spacings: int = 12
    """Number of spacings of a curve over dots."""

    def __post_init__(self) -> None:
        if not self.hands:
            raise AsperityError("an ensemble needs at least one hand")
        if min(self.sinusoid_spacings, self.dot_spacings) < 5:
            raise AsperityError(
                "spacings must be at least 5 for a fit, got "
                f"{self.sinusoid_spacings} and {self.dot_spacings}"
            )

    def sinusoids(self) -> list[Sinusoids]:
        """Return the plates of question (a)."""
        return [Sinusoids(amplitude) for amplitude in self.amplitudes]

    def dots(self) -> list[Dots]:
        """Return the plates of question (b)."""
        return [
            Dots(height=height, seed=seed, lines=PATHS)
            for height in self.heights
            for seed in self.seeds
        ]
