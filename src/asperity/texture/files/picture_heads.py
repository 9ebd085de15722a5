"""What the heads of PGM and PNG pictures state: the largest grey value, and Gwyddion's scale."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.units import length_of
from asperity.texture.files.tiff_scale import ValueScale

_PGM = re.compile(rb"P[25](?:\s+#[^\n]*\n|\s)+(\d+)(?:\s+#[^\n]*\n|\s)+(\d+)"
                  rb"(?:\s+#[^\n]*\n|\s)+(\d+)\s")  # fmt: skip
_GWYDDION = re.compile(r"#\s*(Gwy::\w+)[ \t]+(\S[^\n]*)")
"""Comments of Gwyddion in PGM; in PNG they are chunks of text with these keys."""
_HEAD = 4096


def as_stored(path: Path, pixels: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """Return pixels of a PGM as the file has them, and what is white; others as they are, and 0.

    Pillow stretches them from the largest value that the head states, as 4095, to 255 or 65535.
    """
    with path.open("rb") as file:
        head = _PGM.match(file.read(_HEAD))
    white = int(head.group(3)) if head is not None else 0
    stretched = 255 if white < 256 else 65535
    if not 0 < white < stretched or pixels.ndim != 2:
        return pixels, 0.0
    restored = np.rint(pixels * (white / stretched))
    return restored.astype(np.uint8 if white < 256 else np.uint16), float(white)


def gwyddion_scale(
    path: Path, info: dict[Any, Any], pixels: NDArray[Any]
) -> tuple[tuple[float, float], ValueScale] | None:
    """Return the pixel size [m] and the heights that Gwyddion states in a 16-bit PNG or PGM.

    Parameters
    ----------
    path : Path
    info : dict
        Of the picture, as Pillow has it.
    pixels : (rows, columns) array
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    texts = info
    if head.startswith(b"P5"):
        texts = dict(_GWYDDION.findall(head.decode("latin-1")))
    try:
        width, height, low, high = (
            float(texts[f"Gwy::{key}"]) for key in ("XReal", "YReal", "ZMin", "ZMax")
        )
        metres = length_of(str(texts.get("Gwy::XYUnit", "m")))
        unit = str(texts.get("Gwy::ZUnit", "m"))
    except (KeyError, TypeError, ValueError):
        return None
    good = pixels.ndim == 2 and metres is not None and math.isfinite(low + high) and low < high
    if not good or not (0.0 < width < math.inf and 0.0 < height < math.inf):
        return None
    rows, columns = pixels.shape
    step = (high - low) / (65535.0 if pixels.max() > 255 else 255.0)
    size = (width * (metres or 0.0) / columns, height * (metres or 0.0) / rows)
    return size, ValueScale(step, low, unit, "Gwyddion")
