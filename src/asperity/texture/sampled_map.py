"""Numbers on a grid over a plane: what maps of heights and of properties have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from asperity._core.arrays import Array
from asperity.errors import require_choice

BORDERS = ("wrap", "clamp")


@dataclass(frozen=True, eq=False, init=False)
class SampledMap:
    """Samples at `(i + 1/2) * pixel_size`, row 0 at v = 0; of checked values."""

    samples: Array = field(repr=False)
    pixel_size: tuple[float, float]
    border: str
    notes: tuple[str, ...]

    def __init__(
        self, samples: Array, pixel_size: tuple[float, float], border: str, notes: Sequence[str]
    ) -> None:
        require_choice("border", border, BORDERS)
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "pixel_size", pixel_size)
        object.__setattr__(self, "border", border)
        object.__setattr__(self, "notes", tuple(notes))

    @property
    def size(self) -> tuple[float, float]:
        """Extent of the map along u and v [m]."""
        rows, columns = self.samples.shape
        return columns * self.pixel_size[0], rows * self.pixel_size[1]

    @cached_property
    def lowest(self) -> float:
        """Lowest sample; a spline between samples may be slightly lower."""
        return float(self.samples.min())

    @cached_property
    def highest(self) -> float:
        """Highest sample; a spline between samples may be slightly higher."""
        return float(self.samples.max())
