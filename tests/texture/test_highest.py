"""The highest point over a rectangle: never too low, and of little more than the rectangle."""

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.texture.height_field import HeightField
from asperity.texture.highest import texture_top, top_over, windows_for
from asperity.texture.packing import pack

PIXEL = (1e-4, 2e-4)


@kernel
def tops_of(textures, rectangles, out):
    for i in range(len(rectangles)):
        u0, u1, v0, v1 = rectangles[i]
        out[i] = texture_top(textures, 0, u0, u1, v0, v1)


@kernel
def tops_by_size(textures, rectangles, out):
    for i in range(len(rectangles)):
        u0, u1, v0, v1 = rectangles[i]
        out[i] = top_over(textures, 0, windows_for(textures, 0, u1 - u0, v1 - v0), u0, v0)


def cells_of(textures):
    """Return the highest point of every part of a cell: the first level of windows."""
    first, columns, shift = textures.windows[0]
    parts = textures.maps["parts"][0]
    rows, cells = textures.maps["rows"][0] * parts, textures.maps["columns"][0] * parts
    assert shift == 0
    after = textures.windows["first"][1]
    return textures.tops[first:after].reshape(-1, columns)[:rows, :cells]


def over(cells, low, high, wraps, more):
    """Return the highest of the cells that a rectangle touches, grown by so many on each side."""
    lines = []
    for k, count in enumerate(cells.shape[::-1]):
        first, last = np.floor(low[k] + 1e-6) - more, np.ceil(high[k] - 1e-6) - 1 + more
        places = np.arange(first, max(last, first) + 1).astype(int)
        lines.append(np.unique(places % count if wraps else np.clip(places, 0, count - 1)))
    return cells[np.ix_(lines[1], lines[0])].max()


@pytest.mark.parametrize("border", ["wrap", "clamp"])
@pytest.mark.parametrize("shape", [(37, 53), (5, 6), (64, 64), (200, 7), (13, 100), (300, 520)])
@pytest.mark.parametrize("asked", [tops_of, tops_by_size])
def test_the_highest_point_is_that_of_the_rectangle_and_a_quarter_more(shape, border, asked):
    rng = np.random.default_rng(1)
    heights = rng.standard_normal(shape) * 1e-5
    textures = pack([HeightField(heights, pixel_size=PIXEL, border=border)])
    cells, parts = cells_of(textures), textures.maps["parts"][0]
    size = np.array(cells.shape[::-1])
    # Near squares, as boxes are, of all sizes, in parts of cells; on and beyond the borders.
    side = np.exp(rng.uniform(np.log(0.01), np.log(0.4 * size.min()), 800))
    wide = side[:, None] * rng.uniform(0.7, 1.0, (800, 2))
    low = rng.uniform(-0.4, 1.2, (800, 2)) * size
    if border == "clamp":
        low = np.clip(low, 0.5 * parts, size - 0.5 * parts)
        wide = np.minimum(wide, size - 0.5 * parts - low)
    high = low + wide
    cell = np.array(PIXEL) / parts
    places = np.stack([low, high], axis=-1) - 0.5 * parts
    rectangles = (places * cell[:, None]).reshape(-1, 4)
    found = np.empty(len(rectangles))
    asked(textures, rectangles, found)
    for top, a, b in zip(found, low, high, strict=True):
        assert top >= over(cells, a, b, border == "wrap", 0)
        # Windows begin after a quarter of their side, and are up to twice as long as the short one.
        # By size alone, windows are those of a stretch that begins anywhere: a cell longer.
        more = (1 if asked is tops_of else 3) + np.ceil((b - a).max())
        assert top <= over(cells, a, b, border == "wrap", more)
    exact = [over(cells, a, b, border == "wrap", 0) for a, b in zip(low, high, strict=True)]
    assert np.mean(found == exact) > (0.45 if asked is tops_of else 0.4)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_long_rectangles_of_one_size_are_covered_wherever_they_begin(border):
    rng = np.random.default_rng(3)
    field = HeightField(rng.standard_normal((90, 70)) * 1e-5, pixel_size=PIXEL, border=border)
    textures = pack([field])
    cells, parts = cells_of(textures), textures.maps["parts"][0]
    size = np.array(cells.shape[::-1])
    wide = np.exp(rng.uniform(np.log(0.1), np.log(0.9 * size), (2000, 2)))
    low = rng.uniform(-1.5, 1.5, (2000, 2)) * size
    if border == "clamp":
        low = np.clip(low, 0.5 * parts, size - 0.5 * parts)
        wide = np.minimum(wide, size - 0.5 * parts - low)
    # On the very border of a cell, of the map, and a hair beside it.
    low[:300] = np.round(low[:300]) + rng.choice([0.0, 1e-9, -1e-9, 1e-6, -1e-6], (300, 2))
    places = np.stack([low, low + wide], axis=-1) - 0.5 * parts
    rectangles = (places * (np.array(PIXEL) / parts)[:, None]).reshape(-1, 4)
    found = np.empty(len(rectangles))
    tops_by_size(textures, rectangles, found)
    for top, a, b in zip(found, low, low + wide, strict=True):
        # An edge of a cell is nobody's: a hair of it does not count.
        assert top >= over(cells, a + 3e-6, np.maximum(b - 3e-6, a + 4e-6), border == "wrap", 0)


def test_what_is_no_number_or_larger_than_the_map_has_the_highest_point_of_all():
    field = HeightField(np.random.default_rng(2).standard_normal((12, 17)) * 1e-5, 1e-4, "wrap")
    textures = pack([field])
    rectangles = np.array([[0.0, 1.0, 0.0, 1.0], [np.nan, 1.0, 0.0, 1.0], [0.0, np.inf, 0.0, 0.0]])
    found = np.empty(3)
    tops_of(textures, rectangles, found)
    assert (found == cells_of(textures).max()).all()
    tops_by_size(textures, rectangles, found)
    assert (found == cells_of(textures).max()).all()
