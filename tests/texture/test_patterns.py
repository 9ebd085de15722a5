"""Patterns: their shape and size, that they tile, that their splines do not overshoot."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.fillets import rounded
from asperity.texture.patterns.patterns import (
    EXAMPLES,
    PATTERNS,
    brushed,
    cross_cut,
    grating,
    jittered_dots,
    knurl,
    rough,
    sin_product,
    sinusoid,
    step,
    stripes,
)

SPAN = {"size": 2e-3, "pixel_size": 2e-5}
# Of each pattern a usual one, and the sharpest that its ranges allow, where it has fillets.
USUAL: dict[str, dict[str, Any]] = EXAMPLES | {
    "sinusoid": {"wavelength": 1e-3, "amplitude": 1e-4, "direction": 0.5},
    "sin_product": {"wavelength": 1e-3, "amplitude": 1e-4},
    "grating": {"pitch": 1e-3, "height": 2e-4},
    "stripes": {"pitch": 1e-3, "depth": 2e-4},
    "step": {"height": 2e-4, "size": 5e-3},
    "jittered_dots": {"pitch": 2e-3, "height": 4e-4, "diameter": 5e-4},
    "cross_cut": {"pitch": 8e-4, "height": 2e-4},
    "knurl": {"pitch": 1e-3, "height": 3e-4},
    "brushed": SPAN | {"rms": 2e-6, "length": 1e-3, "width": 1.2e-4},
    "rough": SPAN | {"hurst": 0.8, "rms_slope": 0.3},
}
SHARPEST = {
    "grating": {"fillet": 2e-3 / 64, "direction": 0.3, "width": 2e-4},
    "stripes": {"fillet": 2e-3 / 64, "direction": -1.0},
    "step": {"fillet": 1e-2 / 256},
    "jittered_dots": {"fillet": 4e-3 / 48, "jitter": 1.0},
    "cross_cut": {"fillet": 1.6e-3 / 48, "face": 0.1},
    "knurl": {"fillet": 2e-3 / 48, "flat": 0.0},
    "brushed": {"coverage": 0.5},
}
CASES = [(name, options) for name, options in USUAL.items()]
CASES += [(name, USUAL[name] | options) for name, options in SHARPEST.items()]


def between(heights: HeightField, many: int = 4) -> np.ndarray:
    """The surface at `many` places a sample along u and v, over the tile."""
    rows, columns = heights.samples.shape
    pu, pv = heights.pixel_size
    u, v = (np.arange(n * many) / many for n in (columns, rows))
    return heights.heights(u * pu, v[:, None] * pv)


def test_every_pattern_is_tested() -> None:
    assert set(PATTERNS) == set(USUAL)


@pytest.mark.parametrize("name", PATTERNS)
def test_every_pattern_is_documented(name: str) -> None:
    docs = Path(__file__).parents[2] / "docs"
    assert f"| `{name}` |" in (docs / "textures.md").read_text("utf-8")
    listed = (docs / "api" / "texture.md").read_text("utf-8")
    assert re.search(rf"(members:.*\b|patterns\.){name}\b", listed), name


@pytest.mark.parametrize(("name", "options"), CASES)
def test_the_spline_overshoots_by_a_hundredth_of_the_relief_at_most(
    name: str, options: dict
) -> None:
    heights = PATTERNS[name](**options)
    surface = between(heights)
    over = max(surface.max() - heights.highest, heights.lowest - surface.min())
    assert over <= 0.01 * heights.relief


def test_an_edge_without_fillets_would_overshoot_by_a_tenth() -> None:
    # So the test above can fail.
    smooth = grating(pitch=1e-3, height=2e-4)
    sharp = HeightField(np.where(smooth.samples > 1e-4, 2e-4, 0.0), smooth.pixel_size, "wrap")
    assert between(sharp).max() > 1.1 * 2e-4


@pytest.mark.parametrize("name", USUAL)
def test_it_tiles_without_a_seam(name: str) -> None:
    heights = PATTERNS[name](**USUAL[name])
    assert heights.border == "wrap"
    for axis in (0, 1):
        # Third differences tell the seam from the pattern better than first ones.
        ring = np.concatenate([heights.samples] * 2, axis)
        n = heights.samples.shape[axis]
        bends = np.abs(np.diff(ring, 3, axis))
        at_seam = bends.take(range(n - 3, n), axis).max()
        inside = bends.take(range(n - 3), axis).max()
        assert at_seam <= 1.2 * inside + 1e-18


@pytest.mark.parametrize("name", ["jittered_dots", "brushed", "rough"])
def test_a_seed_fixes_it(name: str) -> None:
    first, again, other = (PATTERNS[name](**USUAL[name], seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.samples, again.samples)
    assert np.abs(first.samples - other.samples).max() > 0.1 * first.relief


@pytest.mark.parametrize("direction", [0.0, 0.3, 1.0, math.pi / 2, 2.5, -2.0])
def test_a_sinusoid_has_exactly_its_wavelength_and_direction(direction: float) -> None:
    heights = sinusoid(wavelength=1.5e-3, amplitude=1e-4, direction=direction, periods=5)
    assert not heights.notes
    u, v = np.random.default_rng(0).uniform(-1e-2, 1e-2, (2, 400))
    along = u * math.cos(direction) + v * math.sin(direction)
    k = 2 * math.pi / 1.5e-3
    found = heights.derivatives(u, v)
    # At 64 samples a period the spline follows a wave to 1e-7, its slope to 3e-6.
    np.testing.assert_allclose(found.h, 1e-4 * np.cos(k * along), atol=1e-10)
    expected = -1e-4 * k * math.cos(direction) * np.sin(k * along)
    np.testing.assert_allclose(found.h_u, expected, atol=1e-5 * 1e-4 * k)


def test_a_direction_too_near_an_axis_is_turned_to_it_and_said() -> None:
    wave = {"wavelength": 1e-3, "amplitude": 1e-4, "direction": 0.05}
    turned = sinusoid(**wave, periods=4)
    assert "2.865 degrees is turned" in turned.notes[0]
    assert np.ptp(turned.samples, axis=0).max() == 0.0
    assert not sinusoid(**wave, periods=12).notes


def test_a_product_of_sines() -> None:
    heights = sin_product(wavelength=1e-3, amplitude=1e-4, periods=3)
    assert heights.size == pytest.approx((3e-3, 3e-3))
    assert heights.heights(0.25e-3, 1.25e-3) == pytest.approx(1e-4, rel=1e-6)
    assert heights.heights(0.25e-3, 1.75e-3) == pytest.approx(-1e-4, rel=1e-6)
    assert heights.heights(0.5e-3, 0.1e-3) == pytest.approx(0.0, abs=1e-15)


def test_a_rounded_outline_is_the_moving_average_of_its_polyline() -> None:
    corners = [(-0.3, 0.2), (-0.1, 1.0), (0.15, 1.0), (0.2, -0.5), (0.6, 0.0)]
    xs, ys = zip(*corners, strict=True)
    fine = (np.arange(20000) + 0.5) / 20000 - 0.3
    line = np.interp(fine, [*xs, 0.7], [*ys, 0.2])
    half = 400  # of a fillet of 0.04
    averages = np.convolve(np.concatenate([line[-half:], line, line[:half]]), np.ones(2 * half))
    averages = averages[2 * half - 1 : -2 * half + 1] / (2 * half)
    edges = np.arange(averages.size) / 20000 - 0.3
    for shift in (0.0, 3.0, -7.0):
        np.testing.assert_allclose(rounded(edges + shift, corners, 0.04), averages, atol=1e-6)


def test_a_grating_has_its_height_and_its_width_at_half_of_it() -> None:
    heights = grating(pitch=2e-3, height=3e-4, width=0.6e-3, samples=256)
    u = np.array([0.0, 0.2e-3, 0.3e-3, 0.5e-3, 1e-3, 2e-3])
    expected = [3e-4, 3e-4 - 3e-4 * (2.5e-5 / 1.25e-4) ** 2 / 2, 1.5e-4, 0.0, 0.0, 3e-4]
    np.testing.assert_allclose(heights.heights(u, 1e-3), expected, atol=1e-7)
    steepest = np.abs(heights.derivatives(np.linspace(0, 2e-3, 999), 0.0).h_u).max()
    assert steepest == pytest.approx(3e-4 / 1.25e-4, rel=0.02)


def test_stripes_are_round_grooves_in_a_flat_plate() -> None:
    heights = stripes(pitch=2e-3, depth=3e-4, width=1e-3)
    u = np.array([0.0, 0.25e-3, 0.75e-3, 1e-3])
    bottom = 3e-4 / (1 - 0.125**2 / 3)
    expected = [-3e-4, -3e-4 + bottom * 0.25, 0.0, 0.0]
    np.testing.assert_allclose(heights.heights(u, 0.0), expected, atol=3e-7)


def test_a_step_stands_on_half_of_its_tile() -> None:
    heights = step(height=1e-4, size=1e-2)
    np.testing.assert_allclose(
        heights.heights([0.0, 2e-3, 2.5e-3, 3e-3, 7e-3, 7.5e-3, 8e-3], 0.0),
        [1e-4, 1e-4, 0.5e-4, 0.0, 0.0, 0.5e-4, 1e-4],
        atol=1e-10,
    )


def test_dots_are_cones_with_flat_tops_that_do_not_overlap() -> None:
    plain = jittered_dots(pitch=2e-3, height=4e-4, diameter=6e-4, flank=2e-4, jitter=0.0)
    at = 1e-3 + np.array([0.0, 0.2e-3, 0.3e-3, 0.4e-3, 0.6e-3, 1e-3])
    expected = np.array([4e-4, 4e-4, 4e-4 - 1.25e-4 / 8 * 2, 2e-4, 0.0, 0.0])
    np.testing.assert_allclose(plain.heights(at, 1e-3), expected, atol=3e-6)
    np.testing.assert_allclose(plain.heights(5e-3, at + 6e-3), expected, atol=3e-6)
    moved = jittered_dots(pitch=2e-3, height=4e-4, diameter=6e-4, flank=2e-4, jitter=1.0)
    # Equal volumes: none is lost at the seam, or under another dot.
    assert moved.samples.mean() == pytest.approx(plain.samples.mean(), rel=1e-3)
    assert moved.highest == pytest.approx(4e-4, rel=1e-12)
    assert np.abs(moved.samples - plain.samples).max() > 3.9e-4


def test_dots_move_by_the_jitter_at_most() -> None:
    options = {"pitch": 2e-3, "height": 4e-4, "diameter": 5e-4, "periods": 10}
    for jitter in (0.3, 1.0):
        heights = jittered_dots(**options, jitter=jitter)
        cells = heights.samples.reshape(10, 48, 10, 48).swapaxes(1, 2).reshape(100, 48, 48)
        mass = cells / cells.sum(axis=(1, 2), keepdims=True)
        x = (np.arange(48) + 0.5) / 48 * 2e-3
        moves = np.stack([mass.sum(axis=1) @ x, mass.sum(axis=2) @ x]) - 1e-3
        most = jitter * (1e-3 - 0.25e-3 - 1.5 * 0.125e-3)
        assert 0.9 * most < np.abs(moves).max() <= most * 1.01
        assert moves.std() == pytest.approx(most / math.sqrt(3.0), rel=0.1)


@pytest.mark.parametrize("name", ["cross_cut", "knurl"])
@pytest.mark.parametrize("samples", [16, 48])
def test_teeth_and_knurls_have_exactly_their_height(name: str, samples: int) -> None:
    heights = PATTERNS[name](**USUAL[name], samples=samples)
    assert (heights.lowest, heights.relief) == (0.0, pytest.approx(USUAL[name]["height"]))


def test_a_files_teeth_point_to_its_tip() -> None:
    heights = cross_cut(pitch=8e-4, height=2e-4)
    slopes = heights.derivatives(*np.random.default_rng(0).uniform(0, 1e-2, (2, 20000)))
    # A long back that rises, a face three times as steep that falls.
    # Rounded creases take some of the back's share.
    assert 0.65 < np.mean(slopes.h_u > 0.0) < 0.75
    assert -np.quantile(slopes.h_u, 0.05) > 2.0 * np.quantile(slopes.h_u, 0.95)


def test_a_files_cuts_run_at_their_angles() -> None:
    angles = math.radians(45), math.radians(70)
    heights = cross_cut(pitch=8e-4, height=2e-4, angles=angles, second_pitch=7e-4, periods=24)
    waves = np.abs(np.fft.rfft2(heights.samples - heights.samples.mean()))
    rows = heights.samples.shape[0]
    found = []
    for sign in (1, -1):  # cuts that lean to either side lie in either half of the spectrum
        half = waves.copy()
        half[(np.fft.fftfreq(rows) * sign) <= 0] = 0.0
        row, column = np.unravel_index(np.argmax(half), half.shape)
        k = column / heights.size[0], np.fft.fftfreq(rows, 1 / rows)[row] / heights.size[1]
        found.append((1 / math.hypot(*k), math.atan2(abs(k[0]), abs(k[1]))))
    (pitch, angle), (second, second_angle) = found
    assert (pitch, angle) == (pytest.approx(8e-4), pytest.approx(angles[0]))
    assert (second, second_angle) == (pytest.approx(7e-4, rel=0.02), pytest.approx(angles[1], 0.03))
    assert f"{second * 1e6:.4g} um" in heights.notes[0]


def test_a_knurl_has_pyramids_at_the_middles_of_its_diamonds() -> None:
    angle = math.radians(30)
    heights = knurl(pitch=1e-3, height=3e-4, angle=angle)
    across, along = 1e-3 / math.cos(angle), 1e-3 / math.sin(angle)
    tops = heights.derivatives([across / 2, 0.0], [0.0, along / 2])
    np.testing.assert_allclose(tops.h, 3e-4, rtol=0.01)
    np.testing.assert_allclose([tops.h_u, tops.h_v], 0.0, atol=5e-3)
    assert heights.heights(0.0, 0.0) == pytest.approx(0.0, abs=0.02 * 3e-4)
    # A face is plane: its slope is the groove's, along the groove's normal.
    face = heights.derivatives(across * 0.28, 0.0 + 0.05 * along)
    assert math.hypot(face.h_u, face.h_v) == pytest.approx(2 * 3e-4 / 0.9e-3, rel=0.1)
    assert abs(face.h_v / face.h_u) == pytest.approx(math.tan(angle), rel=0.01)


def test_brushed_metal_is_rough_across_and_smooth_along() -> None:
    heights = brushed(**USUAL["brushed"] | {"size": 4e-3, "length": 2e-3, "spread": 0.0})
    assert heights.rms == pytest.approx(2e-6)
    slopes = [np.diff(heights.samples, axis=axis).std() for axis in (0, 1)]
    assert slopes[0] > 4.0 * slopes[1]
    skewness = np.mean(((heights.samples - heights.samples.mean()) / heights.rms) ** 3)
    assert skewness < 0.0  # scratches are cut in


def test_roughness_is_that_of_self_affine() -> None:
    heights = rough(**USUAL["rough"], seed=3)
    assert heights.samples.shape == (100, 100)
    found = heights.derivatives(*np.random.default_rng(0).uniform(0, 2e-3, (2, 20000)))
    assert math.sqrt(np.mean(found.h_u**2 + found.h_v**2)) == pytest.approx(0.3, rel=0.03)


@pytest.mark.parametrize("name", USUAL)
def test_no_height_gives_a_flat_surface(name: str) -> None:
    tall = next(n for n in ("amplitude", "height", "depth", "rms", "rms_slope") if n in USUAL[name])
    assert PATTERNS[name](**USUAL[name] | {tall: 0.0}).relief == 0.0
    with pytest.raises(AsperityError, match=tall):
        PATTERNS[name](**USUAL[name] | {tall: -1e-5})


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("sinusoid", {"wavelength": 0.0}, "wavelength"),
        ("sinusoid", {"direction": math.nan}, "direction"),
        ("sinusoid", {"periods": 0}, "periods must be a whole number, 1"),
        ("sinusoid", {"samples": 7}, "samples must be a whole number, 8"),
        ("sinusoid", {"samples": 64.5}, "samples"),
        ("sinusoid", {"periods": 1000, "samples": 1000}, "at most in all"),
        ("sinusoid", {"amplitude": 1.0}, "too steep"),
        ("sin_product", {"periods": -1}, "periods"),
        ("grating", {"fillet": 1e-5}, "2 samples"),
        ("grating", {"width": 0.95e-3}, "width must lie between"),
        ("grating", {"width": math.nan}, "width"),
        ("stripes", {"width": 1e-4}, "width must lie between"),
        ("step", {"size": 0.0}, "size"),
        ("step", {"samples": 8}, "16"),
        ("jittered_dots", {"jitter": 1.1}, "jitter"),
        ("jittered_dots", {"diameter": 2e-3}, "diameter must lie between"),
        ("jittered_dots", {"flank": 1e-6}, "flank"),
        ("jittered_dots", {"seed": -1}, "seed"),
        ("cross_cut", {"angles": (0.1, 1.0)}, "angles"),
        ("cross_cut", {"angles": 0.5}, "two angles"),
        ("cross_cut", {"face": 0.0}, "face"),
        ("cross_cut", {"fillet": 5e-4}, "half the pitch"),
        ("knurl", {"angle": 0.0}, "angle"),
        ("knurl", {"flat": 1.0}, "flat"),
        ("brushed", {"width": 1e-5}, "width"),
        ("brushed", {"length": 5e-3}, "length"),
        ("brushed", {"size": 1.0}, "too many"),
        ("rough", {"size": 1e-4}, "16 samples"),
        ("rough", {"size": 1e3}, "16384 pixels"),
    ],
)
def test_values_out_of_range_are_refused_in_one_line(name: str, change: dict, words: str) -> None:
    with pytest.raises(AsperityError, match=words) as caught:
        PATTERNS[name](**USUAL[name] | change)
    assert "\n" not in str(caught.value)
