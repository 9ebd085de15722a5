"""Bounds of a texture over a rectangle: nothing in it exceeds them, and they are not far above."""

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.texture.height_field import HeightField
from asperity.texture.packed import texture_at, texture_bounds, texture_slope
from asperity.texture.packing import pack

PIXEL = 1e-4


@kernel
def bounds_of(textures, rectangles, out):
    for i in range(len(rectangles)):
        u0, u1, v0, v1 = rectangles[i]
        out[i] = texture_bounds(textures, 0, u0, u1, v0, v1)


@kernel
def largest_of(textures, rectangles, samples, out):
    """Fill highest point, largest slope, largest second derivative among samples."""
    for i in range(len(rectangles)):
        u0, u1, v0, v1 = rectangles[i]
        for k in range(3):
            out[i, k] = -np.inf
        for a in range(samples):
            for b in range(samples):
                u, v = u0 + (u1 - u0) * a / (samples - 1), v0 + (v1 - v0) * b / (samples - 1)
                h, h_u, h_v, h_uu, h_uv, h_vv = texture_at(textures, 0, u, v)
                middle, off = 0.5 * (h_uu + h_vv), np.hypot(0.5 * (h_uu - h_vv), h_uv)
                out[i, 0] = max(out[i, 0], h)
                out[i, 1] = max(out[i, 1], np.hypot(h_u, h_v))
                out[i, 2] = max(out[i, 2], middle + off)


def rough(rows, columns, border):
    heights = np.random.default_rng(5).normal(size=(rows, columns)) * 1e-5
    return HeightField(heights, PIXEL, border)


def rectangles(field, count, largest):
    """Return rectangles of all sizes, inside the map and across its border."""
    rng = np.random.default_rng(7)
    size = largest * PIXEL * 10.0 ** rng.uniform(-2.0, 0.0, (count, 2))
    rows, columns = field.coefficients.shape
    start = rng.uniform(-0.3, 1.1, (count, 2)) * PIXEL * np.array([columns, rows])
    return np.stack(
        [start[:, 0], start[:, 0] + size[:, 0], start[:, 1], start[:, 1] + size[:, 1]], 1
    )


@pytest.mark.parametrize("border", ["wrap", "clamp"])
@pytest.mark.parametrize("shape", [(12, 17), (200, 150), (520, 600)])
def test_nothing_exceeds_its_bounds(shape, border):
    field = rough(*shape, border)
    textures, some = pack([field]), rectangles(field, 1500, 20.0)
    bounds, found = np.empty((1500, 3)), np.empty((1500, 3))
    bounds_of(textures, some, bounds)
    largest_of(textures, some, 25, found)
    slack = 1e-6 * np.abs(bounds) + 1e-15
    assert (found <= bounds + slack).all()


def test_a_coarse_map_is_bounded_within_its_cells():
    """Over a quarter of a cell the bound of a wave with 8 samples is near its highest point."""
    heights = np.sin(2.0 * np.pi * (np.arange(64) + 0.5) / 8.0) * np.ones((64, 1)) * 1e-4
    field = HeightField(heights, PIXEL, "wrap")
    textures, some = pack([field]), rectangles(field, 1500, 0.25)
    assert textures.maps["parts"][0] == 4
    bounds, found = np.empty((1500, 3)), np.empty((1500, 3))
    bounds_of(textures, some, bounds)
    largest_of(textures, some, 25, found)
    excess = bounds[:, 0] - found[:, 0]
    assert excess.max() < 0.6e-4  # the steepest slope over three quarters of a cell
    assert np.median(excess) < 0.2e-4


@kernel
def heights_at(textures, places, out):
    for i in range(len(places)):
        out[i] = texture_at(textures, 0, places[i, 0], places[i, 1])


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_a_place_that_is_no_number_is_no_index(border):
    """Beyond the rim of a round body there is no place; nothing outside the map may be read."""
    field = rough(12, 17, border)
    textures = pack([field])
    nothing = [np.nan, np.inf, -np.inf]
    places = np.array([[a, b] for a in (*nothing, 1e-4) for b in (*nothing, 2e-4)][:-1])
    out = np.full((len(places), 6), -1.0)
    heights_at(textures, places, out)
    assert (out == 0.0).all()
    bounds = np.empty((len(places), 3))
    bounds_of(textures, np.repeat(places, 2, axis=1), bounds)
    whole = np.empty((1, 3))
    bounds_of(textures, np.array([[-1.0, 1.0, -1.0, 1.0]]), whole)
    assert (bounds == whole).all()


@kernel
def slopes_at(textures, places, out):
    for i in range(len(places)):
        out[i] = texture_slope(textures, 0, places[i, 0], places[i, 1])


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_height_and_slope_are_the_same_without_the_bends(border):
    """Within the map, beyond its border, and where a place is no number."""
    textures = pack([rough(12, 17, border)])
    places = np.random.default_rng(8).uniform(-1.0, 2.0, (400, 2)) * [17 * PIXEL, 12 * PIXEL]
    places[0] = np.nan, 1e-4
    all_of_it, found = np.full((len(places), 6), -1.0), np.full((len(places), 3), -1.0)
    heights_at(textures, places, all_of_it)
    slopes_at(textures, places, found)
    np.testing.assert_allclose(found, all_of_it[:, :3], rtol=1e-12, atol=1e-18)
