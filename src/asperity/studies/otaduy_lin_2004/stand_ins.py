"""Surfaces made by code that stand in for a measured coin and for measured sandpaper.

They resemble what they stand for in what a probe meets: the coin is smooth, with a rim, raised
letters and a raised numeral; sandpaper is angular grains of the width that FEPA 43-1 gives for its
grit. None of them was measured.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage, spatial

from asperity._core.arrays import Array

GRAINS = {"P40": 425e-6, "P120": 125e-6}
"""Median diameter of the grains of a grit, FEPA 43-1 [m]."""
RELIEF = 0.3
"""Height of a sandpaper from the lowest to the highest point, in diameters of a grain."""
_APART = 0.9
"""Least distance between two grains, in diameters: as near as unequal grains can lie."""
_REACH = 1.5
"""Half the side of the square in which a grain is drawn, in diameters."""
_FACETS = 6
_LEGEND = "ASPERITY • COIN MADE BY CODE • STAND-IN • "
_FIELD, _RIM = 8.1e-3, 8.8e-3
"""Radius of a coin's field, and of the outside of its rim [m]."""
_FINE = 3
"""Pixels of the drawing of a coin to one of its map."""


def sandpaper(shape: tuple[int, int], pixel_size: float, *, grain: float, seed: int) -> Array:
    """Return the heights of sandpaper, which tile without a seam.

    Grains are polyhedra of about the same size, at random places and more or less sunk in wavy
    resin that rounds their edges. The height is scaled to `RELIEF`, as
    is chosen for measured sandpaper whose file has no scale.

    Parameters
    ----------
    shape : (rows, columns)
        Samples of the map.
    pixel_size : float
        Distance between samples [m].
    grain : float
        Median diameter of the grains [m].
    seed : int

    Returns
    -------
    (rows, columns) array
        Heights [m] with zero mean.
    """
    rng = np.random.default_rng(seed)
    size = np.array(shape) * pixel_size
    heights = np.zeros(shape)
    reach = int(np.ceil(_REACH * grain / pixel_size))
    window = np.arange(-reach, reach + 1)
    for place in _places(size, _APART * grain, rng):
        middle = np.round(place / pixel_size).astype(int)
        offsets = (middle[0] + window)[:, None], (middle[1] + window)[None, :]
        y = (offsets[0] * pixel_size - place[0]) / grain
        x = (offsets[1] * pixel_size - place[1]) / grain
        at = np.ix_(*(np.ravel(part) % n for part, n in zip(offsets, shape, strict=True)))
        heights[at] = np.maximum(heights[at], _grain(x, y, rng))
    resin = ndimage.gaussian_filter(
        rng.standard_normal(shape), 0.8 * grain / pixel_size, mode="wrap"
    )
    heights = np.maximum(heights, 0.05) + 0.05 / resin.std() * resin
    rounded = ndimage.gaussian_filter(heights, 0.1 * grain / pixel_size, mode="wrap")
    rounded *= RELIEF * grain / np.ptp(rounded)
    return np.asarray(rounded - rounded.mean())


def _grain(x: Array, y: Array, rng: np.random.Generator) -> Array:
    """Return the height of a grain above the resin around its middle; lengths in diameters."""
    scale = 0.5 * np.exp(0.15 * rng.standard_normal())
    top, sunk = scale * rng.uniform(0.7, 1.0), rng.uniform(0.0, 0.25)
    turn = 2.0 * np.pi * (np.arange(_FACETS) + rng.uniform(-0.3, 0.3, _FACETS)) / _FACETS
    steepness = rng.uniform(0.35, 0.9, _FACETS)
    height = np.full(np.broadcast_shapes(x.shape, y.shape), top)
    for angle, steep in zip(turn + rng.uniform(0.0, 2.0 * np.pi), steepness, strict=True):
        across = np.cos(angle) * x + np.sin(angle) * y
        height = np.minimum(height, steep * (1.6 * scale - across))
    return np.maximum(height - sunk, 0.0)


def _places(size: Array, apart: float, rng: np.random.Generator) -> Array:
    """Return random places (n, 2) on a torus, none nearer than `apart` to another [m]."""
    found = np.zeros((0, 2))
    count = int(np.prod(size / apart)) + 1
    for _ in range(24):
        drawn = rng.uniform(0.0, 1.0, (count, 2)) * size
        if len(found):
            drawn = drawn[spatial.cKDTree(found, boxsize=size).query(drawn)[0] >= apart]
        if not len(drawn):
            continue
        near = spatial.cKDTree(drawn, boxsize=size).query_pairs(apart, output_type="ndarray")
        kept = np.ones(len(drawn), bool)
        kept[near.max(axis=1)] = False  # of two that are too near, the one drawn first is kept
        found = np.concatenate([found, drawn[kept]])
    return found


def coin(shape: tuple[int, int], pixel_size: float) -> Array:
    """Return the heights of a coin of 17.9 mm: a rim, letters around, leaves, and a numeral.

    Heights are about those of a US dime as a gel sensor shows it: the field 150 to 185 um below
    the rim, letters 70 um and the numeral 110 um above the field, edges rounded over 75 um.

    Parameters
    ----------
    shape : (rows, columns)
        Samples of the map, the coin in its middle.
    pixel_size : float
        Distance between samples [m].

    Returns
    -------
    (rows, columns) array
        Heights [m] with zero mean.
    """
    rows, columns = shape
    v = (np.arange(rows) - 0.5 * (rows - 1)) * pixel_size
    u = (np.arange(columns) - 0.5 * (columns - 1)) * pixel_size
    radius = np.hypot(v[:, None], u[None, :])
    # The field is hollow, as it is struck; outside, the gel hangs from the rim.
    field = 35e-6 * (np.minimum(radius, _FIELD) / _FIELD) ** 2 - 35e-6
    field += 150e-6 * (radius > _FIELD) - 70e-6 * np.clip((radius - _RIM) / 0.5e-3, 0.0, 1.0)
    letters, emblem = _drawn(shape, pixel_size)
    field += 70e-6 * letters + 110e-6 * ndimage.gaussian_filter(emblem, 200e-6 / pixel_size)
    heights = ndimage.gaussian_filter(field, 75e-6 / pixel_size)
    return np.asarray(heights - heights.mean())


def _drawn(shape: tuple[int, int], pixel_size: float) -> tuple[Array, Array]:
    """Return how much of each pixel the letters cover, and how much numeral and leaves do."""
    import matplotlib
    from PIL import Image, ImageDraw, ImageFont

    font = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"
    fine = pixel_size / _FINE
    size = (_FINE * shape[1], _FINE * shape[0])
    middle = (0.5 * size[0], 0.5 * size[1])
    letters = Image.new("L", size)
    type_of_legend = ImageFont.truetype(str(font), int(1.5e-3 / fine))
    for i, letter in enumerate(_LEGEND):
        ring = Image.new("L", size)
        ImageDraw.Draw(ring).text(
            (middle[0], middle[1] - 7.0e-3 / fine), letter, 255, type_of_legend, anchor="mm"
        )
        turned = ring.rotate(90.0 - 360.0 * i / len(_LEGEND), Image.Resampling.BILINEAR)
        letters.paste(255, mask=turned)
    emblem = Image.new("L", size)
    pen = ImageDraw.Draw(emblem)
    numeral = ImageFont.truetype(str(font), int(6.0e-3 / fine))
    pen.text(middle, "10", 255, numeral, anchor="mm")
    for i in range(-4, 5):  # two sprays of leaves, left and right of the numeral
        for side in (-1, 1):
            leaf = Image.new("L", size)
            x, y = middle[0] + side * 5.4e-3 / fine, middle[1]
            half = (0.75e-3 / fine, 0.28e-3 / fine)
            ImageDraw.Draw(leaf).ellipse((x - half[0], y - half[1], x + half[0], y + half[1]), 255)
            leaf = leaf.rotate(side * 14.0 * i, Image.Resampling.BILINEAR, center=middle)
            emblem.paste(255, mask=leaf)
    out = []
    for picture in (letters, emblem):
        covered = np.asarray(picture, dtype=np.float64)[::-1] / 255.0
        out.append(covered.reshape(shape[0], _FINE, shape[1], _FINE).mean(axis=(1, 3)))
    return out[0], out[1]
