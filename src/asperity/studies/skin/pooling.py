r"""Saturating pooling of the channels into one intensity.

Each channel's response x, in thresholds, is compressed and the channels are added:

    I = sum_c  w_c  x_c^n / (x_c^n + s^n) ,

the hyperbolic ratio by which afferent rates saturate (Naka & Rushton 1966, recalled). Weights,
exponent and semi-saturation are asperity's, and were fixed before any outcome was seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from asperity.errors import AsperityError, require_positive
from asperity.studies.skin.channels import CHANNELS


@dataclass(frozen=True)
class Pooling:
    """How the responses of channels become one intensity."""

    exponent: float = 1.0
    semi_saturation: float = 30.0
    """Response at which a channel reaches half of its largest [thresholds]: about 30 dB above."""
    weights: dict[str, float] = field(default_factory=lambda: dict.fromkeys(CHANNELS, 1.0))

    def __post_init__(self) -> None:
        require_positive("exponent", self.exponent)
        require_positive("semi_saturation", self.semi_saturation, "[thresholds]")
        unknown = set(self.weights) - set(CHANNELS)
        if unknown:
            raise AsperityError(
                f"weights name {sorted(unknown)}; the channels are {', '.join(CHANNELS)}"
            )

    def intensity(self, responses: dict[str, float]) -> float:
        """Return the intensity of responses by channel [thresholds], from 0 to the weights' sum."""
        return sum(
            weight * self.compressed(responses[channel]) for channel, weight in self.weights.items()
        )

    def compressed(self, response: float) -> float:
        """Return the response of one channel over its largest, 0 to 1."""
        power = response**self.exponent
        return power / (power + self.semi_saturation**self.exponent)
