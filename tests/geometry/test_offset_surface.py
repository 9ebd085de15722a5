"""offset_surface against SciPy's grey dilation, and what must hold for any offset."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from asperity.geometry.offsets.sampled import offset_surface
from asperity.texture.spline import BORDERS, spline_coefficients

MM = 1e-3
PIXEL = 0.05 * MM
BELOW = 1e-9  # [m] the samples are on the surface, so no dilation of them lies above the offset
ROUNDING = 1e-13  # [m]
CERTIFIED = 2e-12  # [m] of two results: the search polishes its maximum far below its certificate
MODES = {"wrap": "wrap", "mirror": "reflect"}


def _smooth(rows, columns):
    noise = np.random.default_rng(0).normal(size=(rows, columns))
    return ndimage.gaussian_filter(noise, 2.5, mode="wrap") * 100e-6


def _coin(data, first=slice(100, 160)):
    with np.load(data / "measured" / "us_dime_gelsight.npz") as file:
        return file["height_mm"][first, first].astype(float) * MM, float(file["pixel_mm"][0]) * MM


def _finer(samples, border, factor):
    """Return the spline surface of the samples, sampled `factor` times as finely."""
    at = [(np.arange(n * factor) + 0.5) / factor + 1.5 for n in samples.shape]
    return ndimage.map_coordinates(
        spline_coefficients(samples, border), np.meshgrid(*at, indexing="ij"), prefilter=False
    )


def _dilated(samples, pixel, diameter, border):
    """Return the offset over the samples alone, by SciPy."""
    radius = diameter / 2 / pixel
    steps = np.arange(-int(radius), int(radius) + 1)
    inside = radius**2 - steps[:, None] ** 2 - steps**2
    footprint = inside >= 0
    tip = np.where(footprint, (np.sqrt(np.maximum(inside, 0)) - radius) * pixel, 0.0)
    return ndimage.grey_dilation(samples, footprint=footprint, structure=tip, mode=MODES[border])


def _grid_error(samples, pixel, diameter, border):
    """Return by how much a dilation over samples may stay below the offset.

    The contact has a sample within half the diagonal, and there the sum of surface and sphere
    has fallen by at most half its bend times the distance squared.
    """
    c = spline_coefficients(samples, border) / pixel
    second = [np.max(np.abs(np.diff(c, 2, axis=axis))) for axis in (0, 1)]
    mixed = np.max(np.abs(np.diff(np.diff(c, axis=0), axis=1)))
    steep = np.hypot(*(np.max(np.abs(np.diff(c, axis=axis))) for axis in (0, 1)))
    radius = diameter / 2 / pixel
    # The sphere bends the most at the farther end of that distance.
    away = radius * steep / np.hypot(1, steep) + np.sqrt(0.5)
    assert away < radius
    bend = max(second) + mixed + radius**2 / (radius**2 - away**2) ** 1.5
    return 0.5 * bend * 0.5 * pixel


def _check_against_dilation(samples, pixel, diameter, border):
    exact = offset_surface(samples, pixel, diameter, border=border)
    gaps = []
    for factor in (1, 3):  # odd factors keep the old samples among the new
        fine = _finer(samples, border, factor)
        dilated = _dilated(fine, pixel / factor, diameter, border)
        gap = exact - dilated[factor // 2 :: factor, factor // 2 :: factor]
        assert np.min(gap) >= -BELOW
        assert np.max(gap) <= _grid_error(fine, pixel / factor, diameter, border) + BELOW
        gaps.append(gap)
    # 9 on the mean if the samples lie at random about the contacts.
    assert np.mean(gaps[1]) < np.mean(gaps[0]) / 6
    assert np.max(gaps[1]) < np.max(gaps[0]) / 4


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("diameter", [0.6, 1.0, 1.5])
def test_offset_is_dilation_up_to_the_grid_error_which_shrinks_when_refined(diameter, border):
    _check_against_dilation(_smooth(40, 44), PIXEL, diameter * MM, border)


@pytest.mark.parametrize("diameter", [0.8, 1.4, 2.0])
def test_offset_is_dilation_up_to_the_grid_error_on_the_coin(data, diameter):
    _check_against_dilation(*_coin(data), diameter * MM, "mirror")


@pytest.fixture(params=["random", "coin", "profile"])
def heights(request):
    if request.param == "coin":
        return _coin(request.getfixturevalue("data"))
    noise = np.random.default_rng(1).normal(size=(36, 44))
    rough = ndimage.gaussian_filter(noise, 1.2, mode="wrap") * 30e-6
    return (rough if request.param == "random" else rough.ravel()), PIXEL


@pytest.mark.parametrize("border", BORDERS)
def test_offset_lies_between_the_heights_and_their_maximum(heights, border):
    samples, pixel = heights
    offset = offset_surface(samples, pixel, 1 * MM, border=border)
    assert offset.shape == samples.shape
    assert np.all(offset >= samples - ROUNDING)
    assert np.max(offset) <= np.max(spline_coefficients(samples, border)) + ROUNDING


def test_offset_shifts_with_a_constant(heights):
    samples, pixel = heights
    low = offset_surface(samples, pixel, 1 * MM)
    high = offset_surface(samples + 0.7 * MM, pixel, 1 * MM)
    np.testing.assert_allclose(high - 0.7 * MM, low, atol=CERTIFIED)


def test_offset_does_not_fall_where_the_surface_rises(heights):
    samples, pixel = heights
    # Coefficients that are nowhere below zero make a bump that is nowhere below zero.
    bump = np.zeros(samples.shape)
    bump[tuple(n // 2 for n in samples.shape)] = 20e-6
    for axis in range(samples.ndim):
        bump = ndimage.convolve1d(bump, [1 / 6, 4 / 6, 1 / 6], axis=axis)
    low = offset_surface(samples, pixel, 1 * MM)
    high = offset_surface(samples + bump, pixel, 1 * MM)
    assert np.min(high - low) >= -CERTIFIED
    assert np.max(high - low) <= 20e-6
    assert np.max(high - low) >= 1e-6


def test_offset_does_not_fall_with_a_wider_probe(heights):
    samples, pixel = heights
    offsets = [offset_surface(samples, pixel, d * MM) for d in (0.01, 0.3, 0.5, 1.0, 1.8)]
    assert np.min(np.diff(offsets, axis=0)) >= -CERTIFIED


def test_a_vanishing_probe_feels_the_heights(heights):
    # Lift on a slope s: R (sqrt(1 + s^2) - 1), and R / 2 s^2 is above that.
    samples, pixel = heights
    steep = max(np.max(np.abs(np.diff(samples, axis=a))) for a in range(samples.ndim)) / pixel
    offset = offset_surface(samples, pixel, 1e-9)
    assert np.max(np.abs(offset - samples)) <= 0.25e-9 * 2 * (2 * steep) ** 2 + ROUNDING


@pytest.mark.parametrize("border", BORDERS)
def test_offset_turns_with_the_map(border):
    samples = ndimage.gaussian_filter(np.random.default_rng(2).normal(size=(30, 37)), 1.0) * 50e-6
    offset = offset_surface(samples, PIXEL, 1 * MM, border=border)
    for turn in (np.flipud, np.fliplr, np.transpose):
        turned = offset_surface(turn(samples), PIXEL, 1 * MM, border=border)
        np.testing.assert_allclose(turned, turn(offset), atol=CERTIFIED)


def test_a_wrapped_offset_rolls_with_the_map():
    samples = ndimage.gaussian_filter(np.random.default_rng(3).normal(size=(30, 37)), 1.0) * 50e-6
    offset = offset_surface(samples, PIXEL, 1 * MM, border="wrap")
    rolled = offset_surface(np.roll(samples, (7, -11), (0, 1)), PIXEL, 1 * MM, border="wrap")
    np.testing.assert_allclose(rolled, np.roll(offset, (7, -11), (0, 1)), atol=CERTIFIED)


def test_a_mirrored_offset_is_the_wrapped_one_of_the_doubled_map():
    samples = ndimage.gaussian_filter(np.random.default_rng(4).normal(size=(26, 31)), 1.0) * 50e-6
    doubled = np.pad(samples, [(0, 26), (0, 31)], mode="symmetric")
    offset = offset_surface(samples, PIXEL, 1 * MM, border="mirror")
    wrapped = offset_surface(doubled, PIXEL, 1 * MM, border="wrap")[:26, :31]
    np.testing.assert_allclose(offset, wrapped, atol=CERTIFIED)


def test_a_map_of_ridges_is_its_profile():
    profile = ndimage.gaussian_filter(np.random.default_rng(5).normal(size=50), 1.5) * 80e-6
    line = offset_surface(profile, PIXEL, 1 * MM, border="wrap")
    ridges = offset_surface(np.tile(profile, (20, 1)), PIXEL, 1 * MM, border="wrap")
    np.testing.assert_allclose(ridges, np.tile(line, (20, 1)), atol=CERTIFIED)


def test_offset_scales_with_all_lengths(heights):
    samples, pixel = heights
    offset = offset_surface(samples, pixel, 1 * MM)
    large = offset_surface(1000 * samples, 1000 * pixel, 1.0)
    np.testing.assert_allclose(large / 1000, offset, atol=CERTIFIED)
