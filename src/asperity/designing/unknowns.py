"""What is searched for: the parameters of a pattern. Free height maps are in `free_map`."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_choice
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import PATTERNS

USUAL_FREE: dict[str, dict[str, tuple[float, float]]] = {
    "sinusoid": {"amplitude": (5e-6, 5e-4), "wavelength": (5e-4, 5e-3)},
    "sin_product": {"amplitude": (5e-6, 5e-4), "wavelength": (5e-4, 5e-3)},
    "grating": {"height": (1e-5, 6e-4), "pitch": (8e-4, 5e-3)},
    "stripes": {"depth": (1e-5, 6e-4), "pitch": (8e-4, 5e-3)},
    "jittered_dots": {"height": (1e-5, 6e-4), "pitch": (1e-3, 4e-3)},
    "knurl": {"height": (1e-5, 6e-4), "pitch": (8e-4, 4e-3)},
    "cross_cut": {"height": (1e-5, 6e-4), "pitch": (8e-4, 4e-3)},
    "rough": {"rms_slope": (0.01, 1.0), "rolloff": (8e-4, 6e-3)},
}
"""Parameters that are free if nobody names others, and their ranges, in SI units."""
_SHARES: dict[str, dict[str, tuple[str, float]]] = {
    "jittered_dots": {"diameter": ("pitch", 0.4), "flank": ("pitch", 0.125)},
}
"""Parameters that follow another one, as a share of it, unless they are given."""
_FIXED: dict[str, dict[str, Any]] = {
    "rough": {"size": 12.8e-3, "pixel_size": 5e-5, "hurst": 0.8, "cutoff": 4e-4},
    "jittered_dots": {"periods": 6, "samples": 32},
    "grating": {"periods": 6, "samples": 32},
    "sinusoid": {"periods": 8, "samples": 32},
    "stripes": {"periods": 6, "samples": 32},
    "sin_product": {"periods": 8, "samples": 32},
    "knurl": {"periods": 5, "samples": 40},
    "cross_cut": {"periods": 6, "samples": 32},
}
PITCHES = ("pitch", "wavelength", "rolloff")
HEIGHTS = ("height", "amplitude", "depth", "rms_slope")
"""Names of the parameter that scales a pattern along the surface, and of that across it."""


@dataclass(frozen=True)
class PatternUnknown:
    """A pattern, of which some parameters are searched for.

    Parameters
    ----------
    kind : str
        A pattern with a usual free parameter, a key of `USUAL_FREE`.
    free : mapping of str to (low, high)
        Searched parameters and their ranges, all above 0, in SI units.
    fixed : mapping
        Others, as for the pattern.
    """

    kind: str
    free: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_choice("pattern", self.kind, USUAL_FREE)
        if not self.free:
            usual = {k: v for k, v in USUAL_FREE[self.kind].items() if k not in self.fixed}
            object.__setattr__(self, "free", usual)
        known = inspect.signature(PATTERNS[self.kind]).parameters
        for name in (*self.free, *self.fixed):
            require_choice(f"parameter of {self.kind}", name, known)
        for name, ends in self.free.items():
            if name in ("periods", "samples", "seed", "direction"):
                raise AsperityError(f"{name} cannot be searched for; fix it")
            try:
                low, high = map(float, ends)
            except (TypeError, ValueError):
                raise AsperityError(f"{name} needs a range (low, high), got {ends!r}") from None
            if not 0.0 < low < high < np.inf:
                raise AsperityError(f"the range of {name} must rise from above 0, got {ends!r}")
        if not self.free:
            raise AsperityError(f"{self.kind}: every parameter is fixed; leave one free")

    @property
    def names(self) -> list[str]:
        """Of the free parameters, in the order of the unknowns."""
        return list(self.free)

    def parameters(self, x: Array) -> dict[str, float]:
        """Return the free parameters at unknowns `x`, 0 to 1 each, equally spaced in log."""
        return {
            name: float(low * (high / low) ** value)
            for value, (name, (low, high)) in zip(x, self.free.items(), strict=True)
        }

    def unknowns(self, parameters: Mapping[str, float]) -> Array:
        """Return the unknowns, 0 to 1, of free parameters within their ranges."""
        return np.array([
            np.log(parameters[name] / low) / np.log(high / low)
            for name, (low, high) in self.free.items()
        ])  # fmt: skip

    def table(
        self, parameters: Mapping[str, float], spacing: float | None = None
    ) -> dict[str, Any]:
        """Return all arguments of the pattern; `spacing` [m] takes the place of its pitch."""
        known = inspect.signature(PATTERNS[self.kind]).parameters
        table = {**_FIXED.get(self.kind, {}), **self.fixed, **parameters}
        if spacing is not None:
            table[next(name for name in PITCHES if name in known)] = spacing
        for name, (of, share) in _SHARES.get(self.kind, {}).items():
            if name not in table:
                table[name] = share * table[of]
        return table

    def field(self, x: Array, spacing: float | None = None) -> HeightField:
        """Return the surface at unknowns `x`, one tile that repeats."""
        return PATTERNS[self.kind](**self.table(self.parameters(x), spacing))


def square_samples(field: HeightField) -> tuple[Array, float]:
    """Return a tile's heights on square pixels, and the pixel [m].

    Across the strokes the nearest whole number of pixels is taken, and the tile stretched to it.
    """
    pixel, other = field.pixel_size
    if abs(other / pixel - 1.0) < 1e-9:
        return np.array(field.samples), pixel
    rows = round(field.size[1] / pixel)
    columns = field.samples.shape[1]
    u = (np.arange(columns) + 0.5) * pixel
    v = (np.arange(rows) + 0.5) * (field.size[1] / rows)
    return field.heights(u[None, :], v[:, None]), pixel
