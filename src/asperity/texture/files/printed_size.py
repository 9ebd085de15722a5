"""The size of pixels that the resolution of a picture states, of a print or of a surface."""

from __future__ import annotations

from typing import Any

from asperity.texture.files.tiff_scale import RESOLUTIONS

_RESOLUTION_UNIT = 296
_SCREENS = (1.0, 72.0, 90.0, 96.0, 100.0, 120.0, 144.0, 150.0, 180.0, 200.0, 240.0, 300.0, 350.0,
            360.0, 400.0, 600.0)  # fmt: skip
"""Dots per inch of screens and prints, which programs write without knowing."""


def printed_size(dots: Any) -> tuple[float, float] | None:
    """Return the pixel size [m] by dots per inch, of a print or of a surface.

    None for those of screens and usual prints, and for what is no pair of numbers above 0.
    """
    try:
        found = [float(value) for value in dots]
        if all(any(abs(dot - usual) < 0.01 * usual for usual in _SCREENS) for dot in found):
            return None
        pu, pv = (0.0254 / dot for dot in found)
    except (TypeError, ValueError, ZeroDivisionError):  # none, or damaged: it states nothing
        return None
    return pu, pv


def printed_size_of_tiff(page: Any) -> tuple[float, float] | None:
    """Return the pixel size [m] by the resolution of a TIFF's page, as `printed_size`."""
    tags = [page.tags.get(number) for number in (*RESOLUTIONS, _RESOLUTION_UNIT)]
    if tags[0] is None or tags[1] is None:
        return None
    inches = {2: 1.0, 3: 1.0 / 2.54}.get(2 if tags[2] is None else int(tags[2].value))
    try:
        return printed_size([above / (below * (inches or 0.0)) for above, below in
                         (tag.value for tag in tags[:2])])  # fmt: skip
    except (TypeError, ValueError, ZeroDivisionError):  # no unit, or damaged
        return None
