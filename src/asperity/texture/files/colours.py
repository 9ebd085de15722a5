"""What the colours of a picture mean: grey values, heights packed in bytes, normals, or a picture.

A photograph's luminance is no height, and heights that are packed in the bytes of a colour are
noise when read as luminance. So colours are refused until `colour=` states what they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.texture.files.stored import Stored, level_step, refuse


class _Meaning(NamedTuple):
    """Values are `weights` times red, green, blue, plus `offset`."""

    weights: tuple[float, float, float]
    offset: float = 0.0
    metres: bool = False
    stated: str = ""


COLOURS = {
    "luminance": _Meaning((0.299, 0.587, 0.114), stated="as its luminance (ITU-R BT.601)"),
    "red": _Meaning((1.0, 0.0, 0.0), stated="by its red alone"),
    "green": _Meaning((0.0, 1.0, 0.0), stated="by its green alone"),
    "blue": _Meaning((0.0, 0.0, 1.0), stated="by its blue alone"),
    "packed-rgb": _Meaning((65536.0, 256.0, 1.0), stated="as 24 bits, red first"),
    "packed-bgr": _Meaning((1.0, 256.0, 65536.0), stated="as 24 bits, blue first"),
    "packed-rg": _Meaning((256.0, 1.0, 0.0), stated="as 16 bits, red first"),
    "packed-gr": _Meaning((1.0, 256.0, 0.0), stated="as 16 bits, green first"),
    "terrain-rgb": _Meaning(
        (6553.6, 25.6, 0.1), -10000.0, True, "as terrain-RGB (Mapbox), steps of 0.1 m"
    ),
    "terrarium": _Meaning(
        (256.0, 1.0, 1.0 / 256.0), -32768.0, True, "as terrarium tiles (Mapzen), steps of 1/256 m"
    ),
}
"""What colours may mean, by the value of `colour=`."""
_PACKED = ("packed-rg", "packed-gr", "packed-rgb", "packed-bgr")
"""Packings that are suspected: of those that fit equally, the first."""
_NEARLY_GREY = 0.03
"""Largest difference between the colours of a grey picture, of the full range."""
_NOISE = 0.45
"""Mean step between neighbours of a byte that wraps, of that of noise (85), at least."""
_CALMER = 0.25
"""Steps of the unpacked value, of those of noise, at most."""


def grey(path: Path, pixels: NDArray[Any], notes: tuple[str, ...], colour: str | None) -> Stored:
    """Return `pixels`, (rows, columns) or (rows, columns, channels), as one value a pixel."""
    if pixels.dtype.kind not in "uifb":
        refuse(path, f"its pixels are {pixels.dtype}; valid: real numbers")
    if pixels.ndim == 3 and pixels.shape[2] in (2, 4):
        clear = int(np.count_nonzero(pixels[..., -1] == 0))
        what = f"; are its {clear} clear pixels missing?" if 0 < clear < pixels[..., 0].size else ""
        pixels, notes = pixels[..., :-1], (*notes, f"the alpha channel is ignored{what}")
    if pixels.ndim == 3 and pixels.shape[2] == 3:
        if colour is not None:
            return _decoded(path, pixels, notes, colour)
        first = pixels[..., :1]
        if (pixels == first).all():
            pixels = first
        elif pixels.dtype.kind == "u" and _spread(pixels) < _NEARLY_GREY:
            return _decoded(path, pixels, (*notes, "its colours are nearly grey"), "luminance")
        else:
            _refuse_colours(path, pixels)
    elif colour is not None:
        notes = (*notes, f"it has no colours: colour={colour!r} changes nothing")
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim != 2:
        refuse(path, f"pixels of shape {pixels.shape} are neither grey nor colour")
    return Stored(pixels, notes, scale=None, step=level_step(pixels))


def _spread(pixels: NDArray[Any]) -> float:
    """Return the largest difference between the colours of a pixel, of the full range."""
    wide = pixels.max(axis=2) - pixels.min(axis=2)
    return float(wide.max() / np.iinfo(pixels.dtype).max)


def _decoded(path: Path, pixels: NDArray[Any], notes: tuple[str, ...], colour: str) -> Stored:
    meaning = COLOURS[colour]
    integers = pixels.dtype.kind in "ui"
    if max(meaning.weights) > 1.0 and pixels.dtype != np.uint8:
        refuse(
            path,
            f"colour={colour!r} unpacks bytes, but its colours are {pixels.dtype}; valid: 8 bits",
        )
    values = pixels.astype(np.float64) @ np.array(meaning.weights) + meaning.offset
    notes = (*notes, f"colour is read {meaning.stated}")
    packed = suspected(pixels) if colour == "luminance" else None
    if packed:
        notes = (*notes, f"the colours look like packed heights: colour={packed!r}?")
    step = 1.0 if integers and not meaning.metres else 0.0
    return Stored(values, notes, None, 1.0 if meaning.metres else None, step=step)


def suspected(pixels: NDArray[Any]) -> str | None:
    """Return the packing that the bytes of colours look like, None if they look like none.

    The lowest byte of a packed height wraps, so its neighbours differ like noise, while the
    unpacked heights are calm: their steps are small beside their range.
    """
    if pixels.dtype != np.uint8 or min(pixels.shape[:2]) < 4:
        return None
    part = pixels[: 1 << 10, : 1 << 10, :3].astype(np.float64)
    steps = np.abs(np.diff(part, axis=1)).mean(axis=(0, 1)) / 85.3
    found: list[tuple[float, int]] = []
    for name in _PACKED:
        weights = np.array(COLOURS[name].weights)
        # The lowest byte that is not constant, and the next above it.
        used = [int(i) for i in np.argsort(weights) if weights[i] and np.ptp(part[..., i]) > 0]
        if len(used) < 2 or steps[used[0]] < _NOISE * (steps[used[0]] > 0):
            continue
        values = part @ weights
        noise = np.ptp(values) / 3.0
        calm = np.abs(np.diff(values, axis=1)).mean() / max(noise, 1e-12)
        if calm < _CALMER and steps[used[0]] > 2.0 * calm:
            found.append((calm, _PACKED.index(name)))
    if not found:
        return None
    name = _PACKED[min(found)[1]]
    red = part[..., 0].min(), part[..., 0].max()
    if name == "packed-rgb":
        # Land has 1, 2 or 3 in the red of Mapbox's tiles, 126 to 163 in Mapzen's.
        known = {"terrain-rgb": (1, 3), "terrarium": (126, 163)}
        name = next((n for n, (a, b) in known.items() if a <= red[0] <= red[1] <= b), name)
    return name


def unit_vectors(pixels: NDArray[Any]) -> tuple[Array, str]:
    """Return colours as unit vectors, and a note on what it took; the note is "-" for no normals.

    Integers are scaled from 0 to the largest of their type, floats from 0 to 1, or unscaled if some
    are negative. Blue is along the normal; a constant blue is found from red and green.
    """
    if pixels.dtype.kind == "u":
        vectors = pixels[..., :3] * (2.0 / np.iinfo(pixels.dtype).max) - 1.0
    else:
        vectors = pixels[..., :3].astype(np.float64)
        if vectors.min() >= 0.0:
            vectors = 2.0 * vectors - 1.0
    across = vectors[..., 0] ** 2 + vectors[..., 1] ** 2
    # Two channels alone, as BC5 stores: blue is 0, its middle, or 1 beside normals that lean.
    blue = vectors[..., 2]
    alone = np.ptp(blue) == 0.0 and (
        blue.max() < 0.5 or (blue.min() > 0.99 and across.max() > 0.02)
    )
    # A full blue may also be of slopes, which are normals before they are normalised.
    slopes = bool(alone and blue.min() > 0.99) and _are_slopes(vectors)
    if alone and across.max() < 1.05 and not slopes:
        vectors[..., 2] = np.sqrt(np.maximum(1.0 - across, 0.0))
        return vectors, "blue is constant: it is found from red and green"
    length = np.linalg.norm(vectors, axis=2)
    off = np.abs(length - 1.0)
    upright = vectors[..., 2].mean() > 0.5
    if off.mean() < 0.03 and upright:
        return vectors, ""
    # Some programs store blue from 0 to 1, as it is never below 0.
    from_0 = np.stack([vectors[..., 0], vectors[..., 1], 0.5 * vectors[..., 2] + 0.5], axis=2)
    if upright and np.quantile(np.abs(np.linalg.norm(from_0, axis=2) - 1.0), 0.99) < 0.02:
        return from_0, "its blue is z from 0 to 1: so read, its normals are of length 1"
    # Scaled, averaged or clipped normals: none is far from a unit vector, few lie on their side.
    near = np.mean(off < 0.45) > 0.98 and np.mean(vectors[..., 2] > 0.0) > 0.98
    leans = np.abs(vectors[..., :2].mean(axis=(0, 1))).max()
    if not (upright and (near or slopes) and leans < 0.25):
        return vectors, "-"
    vectors /= np.maximum(length, 1e-6)[..., None]
    return vectors, (
        f"its normals have lengths of {length.min():.2f} to {length.max():.2f}: normalised to 1"
    )


_CURL = 0.5
"""Largest curl of slopes, of that of noise."""


def _are_slopes(vectors: Array) -> bool:
    """Return whether red and green are slopes rather than components of unit vectors.

    The slopes of a surface have no curl, whichever way green points.
    """
    z = np.sqrt(np.maximum(1.0 - vectors[..., 0] ** 2 - vectors[..., 1] ** 2, 1e-4))
    curls = []
    for slopes in (vectors[..., :2], vectors[..., :2] / z[..., None]):
        a = np.diff(slopes[..., 0], axis=0)[:, 1:] + np.diff(slopes[..., 0], axis=0)[:, :-1]
        b = np.diff(slopes[..., 1], axis=1)[1:] + np.diff(slopes[..., 1], axis=1)[:-1]
        size = float(np.sum(a**2) + np.sum(b**2))
        least = min(float(np.sum((a - b) ** 2)), float(np.sum((a + b) ** 2)))
        curls.append(least / size if size > 0.0 else 1.0)
    return curls[0] < min(curls[1], _CURL)


def _refuse_colours(path: Path, pixels: NDArray[Any]) -> NoReturn:
    """Raise: a picture in colours is no height map until something states what they mean."""
    if pixels.dtype.kind == "u" and unit_vectors(pixels)[1] != "-":
        refuse(
            path,
            "its colours are unit vectors: a normal map; valid: a map of heights, or "
            "HeightField.from_file with kind='normal'",
        )
    packed = suspected(pixels)
    hint = f"they look packed: colour={packed!r}; " if packed else ""
    refuse(
        path,
        f"it has colours, which are no heights; {hint}valid: a grey picture, or colour= one of "
        f"{', '.join(COLOURS)}",
    )
