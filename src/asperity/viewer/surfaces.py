"""Presets of surfaces, all made by code: sandpaper, brushed steel, wood, cloth, dots, gratings."""

from __future__ import annotations

from typing import Any

from asperity._core.data import table_beside

_GRAINS = {"P40": 425e-6, "P60": 269e-6, "P80": 201e-6, "P120": 125e-6, "P180": 82e-6,
           "P240": 58.5e-6}  # fmt: skip
"""Mean diameters of the grains, FEPA 43-1 [m]."""
_TILE = 256
"""Pixels along a side of a tile of sandpaper."""


def _sandpaper(grain: float) -> dict[str, Any]:
    """Return a rough surface whose bumps are as wide as grains; slopes are a project default."""
    pixel = grain / 8.0
    return {
        "kind": "rough", "size": _TILE * pixel, "pixel_size": pixel, "hurst": 0.6,
        "rms_slope": 0.45, "rolloff": 2.5 * grain, "cutoff": 0.5 * grain, "seed": 1,
    }  # fmt: skip


SURFACES: dict[str, dict[str, Any]] = {
    **{f"sandpaper {name}": _sandpaper(grain) for name, grain in _GRAINS.items()},
    **table_beside(__file__, "surfaces.toml"),
}
"""Texture tables by name. They resemble these surfaces; none has been measured."""
