"""Height fields: exact derivatives, borders, spectra, what is refused; and every real map."""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import naive
from asperity.errors import AsperityError, SurfaceError
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import rough, sinusoid

PIXEL = (20e-6, 30e-6)
ROUNDING = 1e-13  # of heights of the order 1e-4 m, and a handful of operations
STEP = 1e-8  # [m], for central differences


def noise(rows: int = 13, columns: int = 22, border: str = "wrap") -> HeightField:
    samples = 1e-4 * np.random.default_rng(rows * columns).normal(size=(rows, columns))
    return HeightField(samples, PIXEL, border)


def places(heights: HeightField, far: float) -> tuple[np.ndarray, np.ndarray]:
    """Places over the map and `far` times its size around it."""
    rng = np.random.default_rng(1)
    lu, lv = heights.size
    return rng.uniform(-far * lu, (1 + far) * lu, 500), rng.uniform(-far * lv, (1 + far) * lv, 500)


# --- surface ------------------------------------------------------------------------------------


@pytest.mark.parametrize("border", ["wrap", "clamp"])
@pytest.mark.parametrize("shape", [(4, 4), (5, 40), (32, 7)])
def test_it_passes_through_its_samples_at_the_middles_of_pixels(
    border: str, shape: tuple[int, int]
) -> None:
    heights = noise(*shape, border)
    u, v = (np.arange(n) + 0.5 for n in shape[::-1])
    found = heights.heights(u * PIXEL[0], v[:, None] * PIXEL[1])
    np.testing.assert_allclose(found, heights.samples, atol=1e-16)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_it_is_scipys_spline_on_and_off_the_map(border: str) -> None:
    heights = noise(border=border)
    u, v = places(heights, 2.0)
    x, y = u / PIXEL[0], v / PIXEL[1]
    if border == "clamp":
        x, y = np.clip(x, 0, 22), np.clip(y, 0, 13)
    expected = naive.spline(heights.samples, {"clamp": "mirror"}.get(border, border), y, x)
    np.testing.assert_allclose(heights.heights(u, v), expected, atol=ROUNDING * 1e-3)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_derivatives_are_those_of_the_surface_on_and_off_the_map(border: str) -> None:
    heights = noise(border=border)
    u, v = places(heights, 1.5)
    _, h_u, h_v, h_uu, h_uv, h_vv = heights.derivatives(u, v)
    ahead, behind = heights.derivatives(u + STEP, v), heights.derivatives(u - STEP, v)
    slope, curvature = 50.0, 50.0 / PIXEL[0]  # of these maps, about
    np.testing.assert_allclose((ahead.h - behind.h) / (2 * STEP), h_u, atol=1e-6 * slope)
    # Second derivatives are linear between knots; a knot within the step costs a part of 1e-3.
    np.testing.assert_allclose((ahead.h_u - behind.h_u) / (2 * STEP), h_uu, atol=1e-3 * curvature)
    np.testing.assert_allclose((ahead.h_v - behind.h_v) / (2 * STEP), h_uv, atol=1e-3 * curvature)
    ahead, behind = heights.derivatives(u, v + STEP), heights.derivatives(u, v - STEP)
    np.testing.assert_allclose((ahead.h - behind.h) / (2 * STEP), h_v, atol=1e-6 * slope)
    np.testing.assert_allclose((ahead.h_v - behind.h_v) / (2 * STEP), h_vv, atol=1e-3 * curvature)


def test_outside_a_clamped_map_the_border_goes_on_without_a_kink() -> None:
    heights = noise(border="clamp")
    lu, lv = heights.size
    v = np.linspace(-0.5 * lv, 1.5 * lv, 201)
    for edge, beyond in ((0.0, -1e-3), (lu, lu + 1e-3)):
        border, outside = heights.derivatives(edge, v), heights.derivatives(beyond, v)
        np.testing.assert_allclose(outside.h, border.h, atol=1e-18)
        np.testing.assert_allclose(outside.h_v, border.h_v, atol=1e-12)
        assert not np.any([outside.h_u, outside.h_uu, outside.h_uv])
        np.testing.assert_allclose(border.h_u, 0.0, atol=1e-11)


def test_a_wrapped_map_repeats_after_n_pixels() -> None:
    heights = noise()
    u, v = places(heights, 0.0)
    here, there = heights.derivatives(u, v), heights.derivatives(u - 7 * heights.size[0], v)
    np.testing.assert_allclose(there, here, rtol=1e-7, atol=1e-9)


def test_places_broadcast_and_single_places_give_numbers() -> None:
    heights = noise()
    assert heights.heights(np.zeros(5), np.zeros((3, 1))).shape == (3, 5)
    assert heights.derivatives(0.0, 1e-4).h_uv.shape == ()
    assert heights.heights([], 0.0).shape == (0,)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
@pytest.mark.parametrize("height", [0.0, 1e-3 / 3, -2.7e-5])
def test_a_constant_map_has_no_slope_at_all(border: str, height: float) -> None:
    flat = HeightField(np.full((5, 9), height), PIXEL, border)
    h, *derivatives = flat.derivatives(*places(flat, 3.0))
    assert (h == height).all()
    assert not np.any(derivatives)
    assert (flat.coefficients == height).all()
    assert flat.shortest_wavelength == math.inf
    assert flat.relief == flat.rms == 0.0
    assert flat.low_passed(1e-3) is flat


def test_its_sizes_are_those_of_its_samples() -> None:
    heights = noise()
    assert heights.size == pytest.approx((22 * 20e-6, 13 * 30e-6))
    assert heights.lowest == heights.samples.min()
    assert heights.relief == np.ptp(heights.samples)
    assert heights.rms == pytest.approx(heights.samples.std())
    assert heights.coefficients.shape == (17, 26)
    assert HeightField(np.zeros((4, 4)), 1e-5).pixel_size == (1e-5, 1e-5)


def test_it_keeps_a_copy_that_cannot_be_written_to() -> None:
    mine = np.zeros((4, 4))
    heights = HeightField(mine, 1e-5)
    mine[0, 0] = 1e-5
    assert heights.highest == 0.0
    with pytest.raises(ValueError, match="read-only"):
        heights.samples[0, 0] = 1.0


# --- spectra ------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [0.0, 0.5])
def test_the_shortest_wavelength_of_a_wave_is_its_own(direction: float) -> None:
    wave = sinusoid(wavelength=2e-3, amplitude=1e-4, direction=direction, samples=16)
    assert wave.shortest_wavelength == pytest.approx(2e-3, rel=1e-9)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_shorter_waves_hold_a_thousandth_of_the_slopes_variance(border: str) -> None:
    heights = HeightField(noise(40, 30).samples, PIXEL, border)
    samples = heights.samples
    if border == "clamp":  # the slow way: mirror, and transform all of it
        samples = np.pad(samples, [(0, n) for n in samples.shape], mode="symmetric")
    k = np.hypot(
        np.fft.fftfreq(samples.shape[0], PIXEL[1])[:, None],
        np.fft.fftfreq(samples.shape[1], PIXEL[0]),
    )
    power = np.abs(np.fft.fft2(samples)) ** 2 * k**2
    shortest = 1.0 / heights.shortest_wavelength
    assert power[k > shortest * (1 + 1e-9)].sum() <= 1e-3 * power.sum()
    assert power[k > shortest * (1 - 1e-9)].sum() > 1e-3 * power.sum()


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_low_passing_takes_out_the_short_waves_only(border: str) -> None:
    n, pixel = 64, 1e-5
    x = (np.arange(n) + 0.5) / n
    long = 1e-5 * np.cos(4 * math.pi * x) + 2e-5  # even at the borders: fits both of them
    short = 1e-6 * np.cos(2 * math.pi * 16 * x)
    heights = HeightField(long + short + np.zeros((n, 1)), pixel, border, ("a note",))
    passed = heights.low_passed(0.1 * n * pixel)
    np.testing.assert_allclose(passed.samples, long + np.zeros((n, 1)), atol=1e-18)
    assert passed.shortest_wavelength >= 0.1 * n * pixel
    assert passed.notes[0] == "a note"
    assert "64 um" in passed.notes[1]
    assert (passed.border, passed.pixel_size) == (heights.border, heights.pixel_size)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_low_passing_at_any_wavelength_keeps_the_mean_and_what_it_says(border: str) -> None:
    heights = rough(size=64e-5, pixel_size=1e-5, hurst=0.5, rms_slope=0.3)
    heights = HeightField(heights.samples + 1e-3, 1e-5, border)
    for shortest in (1e-5, 9e-5, 2e-4, 6e-4, 1e-2):
        passed = heights.low_passed(shortest)
        assert passed.samples.mean() == pytest.approx(1e-3, rel=1e-12)
        assert passed.shortest_wavelength >= min(shortest, heights.shortest_wavelength)
    assert heights.low_passed(1e-2).relief == 0.0
    assert heights.low_passed(1e-6) is heights


# --- refusals -----------------------------------------------------------------------------------

BAD_SAMPLES = {
    "no numbers": ([["a"] * 4] * 4, "real numbers"),
    "complex": (np.zeros((4, 4), complex), "real numbers"),
    "ragged": ([[0.0], [0.0, 1.0]], "real numbers"),
    "a line": (np.zeros(16), "4 or more"),
    "too few": (np.zeros((3, 16)), "4 or more"),
    "a NaN": (np.where(np.eye(5), np.nan, 0.0), "5 of 25 samples"),
    "infinite": (np.full((4, 4), np.inf), "16 of 16 samples"),
    "far": (np.full((4, 4), 1e300), "within 10 m"),
    "millimetres": (0.3 * np.eye(8), "too steep"),
    "steep at the seam": (np.linspace(0, 6e-3, 8)[:, None] + np.zeros(8), "too steep"),
}


@pytest.mark.parametrize("name", BAD_SAMPLES)
def test_samples_that_are_no_surface_are_refused_in_one_line(name: str) -> None:
    samples, words = BAD_SAMPLES[name]
    with pytest.raises(SurfaceError, match=words) as caught:
        HeightField(samples, 5e-5, "wrap")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("pixel_size", [0.0, -1e-5, math.nan, "1", (1e-5, 0.0), (1e-5,) * 3, 2.0])
def test_pixel_sizes_out_of_range_are_refused(pixel_size: object) -> None:
    with pytest.raises(SurfaceError, match="pixel_size"):
        HeightField(np.zeros((4, 4)), pixel_size)  # type: ignore[arg-type]


def test_a_border_is_wrap_or_clamp() -> None:
    with pytest.raises(AsperityError, match="'clamp'"):
        HeightField(np.zeros((4, 4)), 1e-5, "clam")


@pytest.mark.parametrize("place", [math.nan, math.inf, [0.0, 1e7]])
def test_places_have_to_be_finite_and_near(place: object) -> None:
    with pytest.raises(AsperityError, match="v must be finite"):
        noise().heights(0.0, place)  # type: ignore[arg-type]


@pytest.mark.parametrize("shortest", [0.0, -1.0, math.nan, "long"])
def test_low_passing_needs_a_wavelength(shortest: object) -> None:
    with pytest.raises(AsperityError, match="shortest"):
        noise().low_passed(shortest)  # type: ignore[arg-type]


# --- files --------------------------------------------------------------------------------------


def test_a_file_that_does_not_tile_says_so_when_wrapped(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", 1e-5 * np.linspace(0, 1, 40)[:, None] + np.zeros(30))
    wrapped = HeightField.from_file(tmp_path / "a.npy", pixel_size=1e-5, border="wrap")
    assert [note for note in wrapped.notes if "tile" in note] == [
        "the map does not tile along v: a step of 10 um (rms) at the seam"
    ]
    clamped = HeightField.from_file(tmp_path / "a.npy", pixel_size=1e-5)
    assert not any("tile" in note for note in clamped.notes)


def test_a_line_of_heights_is_the_same_all_along_v(tmp_path: Path) -> None:
    line = 1e-6 * np.random.default_rng(2).normal(size=50)
    (tmp_path / "a.csv").write_text("\n".join(str(h) for h in line))
    heights = HeightField.from_file(tmp_path / "a.csv", pixel_size=1e-5)
    found = heights.derivatives((np.arange(50) + 0.5) * 1e-5, np.array([[-1.0], [1e-5], [1.0]]))
    np.testing.assert_allclose(found.h, np.tile(line, (3, 1)), atol=1e-20)
    np.testing.assert_allclose(found.h_v, 0.0, atol=1e-15)
    assert any("along v" in note for note in heights.notes)


def test_a_scale_in_the_wrong_unit_names_the_file(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.random.default_rng(3).normal(size=(8, 8)))
    with pytest.raises(SurfaceError, match=r"a\.npy: too steep"):
        HeightField.from_file(tmp_path / "a.npy", pixel_size=1e-5)


IMAGE = {"pixel_size": 20e-6, "height_range": 0.5e-3}
NORMALS = {"pixel_size": 20e-6, "kind": "normal-opengl", "border": "wrap"}
PAPER = {"pixel_size": 9e-6}
# What each map of ../shared/data needs, and the relief [m] that it then has.
REAL = {
    "heights/Bricks102_1K_Displacement.jpg": (IMAGE, 0.5e-3),
    "heights/Ground054_1K_Displacement.jpg": (IMAGE | {"border": "wrap"}, 0.5e-3),
    "heights/Metal049A_1K_Displacement.jpg": (IMAGE, 0.0),
    "heights/Rocks07_disp.jpg": (IMAGE, 0.5e-3),
    "heights/derived_fabric_pattern_07_height16.png": (IMAGE | {"border": "wrap"}, 0.5e-3),
    "heights/fabric_pattern_07_nor_gl_1k.jpg": (NORMALS, 187e-6),
    "heights/godot_wool_depth.png": (IMAGE | {"invert": True}, 0.5e-3),
    "heights/hterrain_sand_depth.png": (IMAGE, 0.5e-3),
    "measured/us_dime_gelsight.npz": ({}, 351e-6),
    "measured/tmd-1.tmd": ({}, 351e-6),
    "measured/sandpaper_P40_height16.png": (PAPER | {"height_range": 425e-6}, 425e-6),
    "measured/sandpaper_P120_height16.png": (PAPER | {"height_range": 115e-6}, 115e-6),
    "measured/mdf_stripes_1_height16.png": (PAPER | {"height_range": 0.3e-3}, 0.3e-3),
    "measured/rock_fracture_0p1mm.npz": ({"missing": "fill"}, 1.73e-3),
    "measured/bullet_land_striae.npz": ({"missing": "fill"}, None),
}


@pytest.mark.parametrize("name", REAL)
def test_every_real_map_is_a_surface_with_a_sensible_scale(data: Path, name: str) -> None:
    choices, relief = REAL[name]
    if name.endswith(".tmd") and find_spec("SurfaceTopography") is None:
        with pytest.raises(SurfaceError, match="SurfaceTopography"):
            HeightField.from_file(data / name, **choices)
        return
    heights = HeightField.from_file(data / name, **choices)
    if relief is not None:
        # Smoothing of 8-bit maps moves each end by half of one of its 100 to 255 levels at most.
        assert heights.relief == pytest.approx(relief, rel=0.02)
    assert heights.notes
    found = heights.derivatives(*places(heights, 0.3))
    assert all(np.isfinite(part).all() for part in found)
    if relief == 0.0:
        assert not np.any(found[1:])
        assert heights.shortest_wavelength == math.inf
    else:
        assert 2e-6 < heights.shortest_wavelength < 1e-3
        assert 0.0 < np.std(found.h_u) < 10.0


def test_every_real_map_is_in_the_list_above(data: Path) -> None:
    present = {
        f"{folder}/{path.name}"
        for folder in ("heights", "measured")
        for path in (data / folder).iterdir()
        if path.name != "LICENSE"
    }
    assert present <= set(REAL)


@pytest.mark.parametrize(
    ("name", "choices", "words"),
    [
        ("heights/Rocks07_disp.jpg", {}, "does not hold its scale"),
        ("heights/fabric_pattern_07_nor_gl_1k.jpg", IMAGE, "kind='normal'"),
        ("heights/Rocks07_disp.jpg", NORMALS, "no colours"),
        ("measured/bullet_land_striae.npz", {}, "missing='fill'"),
        ("measured/bullet_land_striae.npz", {"kind": "normal-opengl", "pixel_size": 1e-6}, "image"),
        ("heights/no.png", IMAGE, "no such file"),
        ("heights/Rocks07_disp.jpg", {"kind": "normals"}, "normal-opengl"),
        ("heights/Rocks07_disp.jpg", IMAGE | {"border": "mirror"}, "clamp"),
    ],
)
def test_real_maps_read_wrongly_are_refused_with_the_reason(
    data: Path, name: str, choices: dict, words: str
) -> None:
    with pytest.raises(AsperityError, match=words) as caught:
        HeightField.from_file(data / name, **choices)
    assert "\n" not in str(caught.value)


def test_a_map_can_be_laid_over_an_extent_as_uv_coordinates_have_it(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(8, 16)) * 1e-5
    np.save(tmp_path / "map.npy", heights)
    field = HeightField.from_file(tmp_path / "map.npy", size=(32e-3, 8e-3), border="wrap")
    assert field.size == pytest.approx((32e-3, 8e-3))
    assert field.pixel_size == pytest.approx((2e-3, 1e-3))
    assert field.heights(3e-3, 2.5e-3) == pytest.approx(heights[2, 1], abs=1e-15)
    for wrong in (
        {"size": (1e-3,)},
        {"size": (1e-3, -1.0)},
        {"size": (1e-3, 1e-3), "pixel_size": 1.0},
    ):
        with pytest.raises(AsperityError, match="size"):
            HeightField.from_file(tmp_path / "map.npy", **wrong)
