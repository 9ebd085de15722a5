"""Which channels of a picture hold a normal: red, green and blue, two of them, or green and alpha.

Programs of games store x and y alone, as z follows: in red and green (BC5), or, for compression by
DXT5, in alpha and green. Some exchange red and green, or store blue first (BGR). The slopes of a
surface have no curl, which shows what is what.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.texture.files.colours import unit_vectors

_SURE = 0.15
"""Agreement of the cross slopes from which channels are known to be those of normals."""
_MORE = 0.1
"""By how much the agreement has to be larger than that of exchanged channels."""
_CLEAR, _CLEARLY = 0.5, 0.2
"""The same two, from which red and green are exchanged; smaller ones are doubted.

Exchanged, the normals of an isotropic surface agree by a third: 2 E[h_uu h_vv] = 2/3 E[h_uu^2]. Of
480 maps of normals made from surfaces of 20 kinds none has come near to these numbers.
"""
_LONGEST = 1.05
"""Squared length of x and y, of which 8 bits can be, at most."""


def normal_vectors(pixels: NDArray[Any]) -> tuple[Array, str]:
    """Return pixels as unit vectors and a note on what it took; the note is "-" for no normals.

    Parameters
    ----------
    pixels : (rows, columns, channels) array
        Two, three or four channels, the bottom of the picture first.
    """
    if pixels.shape[2] == 2:
        return _of_two(pixels)
    vectors, note = _of_four(pixels)
    first = ""
    if note == "-":
        vectors, note = unit_vectors(pixels[..., 2::-1])
        exact = note == "" and np.ptp(vectors[..., :2]) > 0.0  # no photograph's colours are
        if note == "-" or not (exact or max(_agreements(vectors)) > _SURE):
            return vectors, "-"
        first = "is blue first (BGR)? Red, green and blue are no normals, in that order they are"
    doubts = [note, f"{first}: taken so" if first else "", ""]
    fit, other = _agreements(vectors)
    if other > max(_CLEAR, fit + _CLEARLY):
        vectors = vectors[..., [1, 0, 2]]
        doubts[2] = (
            "are red and green exchanged? The slopes of a surface are those: taken so, x is in "
            "green and y in red"
        )
    elif other > max(_SURE, fit + _MORE):
        doubts[2] = "are red and green exchanged? So they fit a surface better; read as they are"
    return vectors, "; ".join(filter(None, doubts))


def _of_four(pixels: NDArray[Any]) -> tuple[Array, str]:
    """Return the vectors of red, green and blue, or of alpha and green."""
    vectors, note = unit_vectors(pixels)
    if pixels.shape[2] == 3 or np.ptp(pixels[..., 3]) == 0 or np.ptp(pixels[..., 1]) == 0:
        return vectors, note
    red, green = pixels[..., 0], pixels[..., 1]
    empty = np.ptp(red) == 0 or (red == green).all()
    if not empty and note != "-":
        return vectors, note  # alpha is something else, as a height
    found = _completed(pixels[..., 3], green)
    if found is None:
        return vectors, note
    if empty:
        return found, "x is in alpha and y in green (DXT5): blue is found from them"
    if abs(curl_agreement(found)) > _SURE:
        return found, (
            "are x and y in alpha and green (DXT5)? Red, green and blue are no normals, and these "
            "are the slopes of a surface: taken so"
        )
    return vectors, note


def _of_two(pixels: NDArray[Any]) -> tuple[Array, str]:
    """Return the vectors of two channels, x and y, or y and x if these are without curl."""
    straight = _completed(pixels[..., 0], pixels[..., 1])
    if straight is None:
        return np.zeros((*pixels.shape[:2], 3)), "-"
    swapped = straight[..., [1, 0, 2]]
    fit, other = _agreements(straight)
    if other > max(_SURE, fit + _MORE):
        return swapped, (
            "is x in the second channel and y in the first (alpha and grey of DXT5)? The slopes "
            "of a surface are those: taken so, blue is found from them"
        )
    sure = fit > max(_SURE, other + _MORE)
    doubt = "" if sure else "; are they? The map does not tell"
    return straight, f"two channels are x and y (BC5), blue is found from them{doubt}"


def _completed(x: NDArray[Any], y: NDArray[Any]) -> Array | None:
    """Return unit vectors of two channels, z above 0; None if they are too long."""
    both = np.stack([x, y, np.zeros_like(x)], axis=2)
    if both.dtype.kind == "u":
        vectors = both * (2.0 / np.iinfo(both.dtype).max) - 1.0
    else:
        vectors = both.astype(np.float64)
        if not np.isfinite(vectors).all():
            return None
        if vectors.min() >= 0.0:
            vectors = 2.0 * vectors - 1.0
    across = vectors[..., 0] ** 2 + vectors[..., 1] ** 2
    if across.max() > _LONGEST:
        return None
    vectors[..., 2] = np.sqrt(np.maximum(1.0 - across, 0.0))
    return vectors


def _agreements(vectors: Array) -> tuple[float, float]:
    """Return how well vectors, and those with x and y exchanged, are normals of a surface."""
    return abs(curl_agreement(vectors)), abs(curl_agreement(vectors[..., [1, 0, 2]]))


def curl_agreement(vectors: Array) -> float:
    """Return how well normals are those of a surface with green up: 1 fully, -1 with green down.

    It is the correlation of the two cross derivatives of the heights, dh_u/dv and dh_v/du, which
    are equal on a surface; about 0 where neither convention fits better than the other.

    Parameters
    ----------
    vectors : (rows, columns, 3) array
        Unit vectors, the bottom of the picture first.
    """
    along = np.maximum(vectors[..., 2], 0.05)
    h_u, h_v = -vectors[..., 0] / along, -vectors[..., 1] / along
    across_u = (h_v[1:-1, 2:] - h_v[1:-1, :-2]).ravel()
    across_v = (h_u[2:, 1:-1] - h_u[:-2, 1:-1]).ravel()
    power = float(across_u @ across_u + across_v @ across_v)
    return 2.0 * float(across_u @ across_v) / power if power > 0.0 else 0.0
