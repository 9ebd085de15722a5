"""Random surfaces: their spectrum, their slope, and what a seed fixes."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from asperity.errors import AsperityError, SurfaceError
from asperity.texture.files.reading import read_heights
from asperity.texture.patterns.random_surfaces import self_affine, synthesise_like

PIXEL = 20e-6


def wavenumber(heights: np.ndarray, pixel_size: float = PIXEL) -> np.ndarray:
    """|q| of every wave of a full transform."""
    axes = [2 * math.pi * np.fft.fftfreq(n, pixel_size) for n in heights.shape]
    return np.sqrt(sum(q**2 for q in np.meshgrid(*axes, indexing="ij")))


def rms_slope(heights: np.ndarray, pixel_size: float = PIXEL) -> float:
    """The gradient axis by axis: a formulation other than the one in the code."""
    total = 0.0
    for axis, n in enumerate(heights.shape):
        q = 2 * math.pi * np.fft.fftfreq(n, pixel_size)
        q = np.expand_dims(q, [k for k in range(heights.ndim) if k != axis])
        total += np.mean(np.fft.ifft(1j * q * np.fft.fft(heights, axis=axis), axis=axis).real ** 2)
    return math.sqrt(total)


def spectrum_exponent(heights: np.ndarray, shortest: float, longest: float) -> float:
    """Slope of log C over log q between two wavelengths, from means over rings of waves."""
    power = np.abs(np.fft.fftn(heights)) ** 2
    q = wavenumber(heights)
    edges = np.geomspace(2 * math.pi / longest, 2 * math.pi / shortest, 16)
    rings = [(q >= low) & (q < high) for low, high in pairwise(edges)]
    x = [np.log(q[ring]).mean() for ring in rings if ring.any()]
    y = [np.log(power[ring].mean()) for ring in rings if ring.any()]
    return float(np.polyfit(x, y, 1)[0])


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8, 1.0])
def test_the_spectrum_of_a_surface_falls_as_its_hurst_exponent_says(hurst: float) -> None:
    heights = self_affine((512, 512), PIXEL, hurst=hurst, rms_slope=0.3, seed=1)
    measured = -spectrum_exponent(heights, 9 * PIXEL, 100 * PIXEL) / 2 - 1
    # Some 16,000 waves fix the exponent to 0.02.
    assert measured == pytest.approx(hurst, abs=0.05)


@pytest.mark.parametrize("hurst", [0.2, 0.8])
def test_the_spectrum_of_a_profile_falls_as_its_hurst_exponent_says(hurst: float) -> None:
    heights = self_affine(2**16, PIXEL, hurst=hurst, rms_slope=0.3, seed=1)
    measured = (-spectrum_exponent(heights, 9 * PIXEL, 2000 * PIXEL) - 1) / 2
    assert measured == pytest.approx(hurst, abs=0.05)


@pytest.mark.parametrize("shape", [1000, (1001,), (256, 256), (65, 300)])
def test_rms_slope_is_exact_and_the_mean_zero(shape: int | tuple[int, ...]) -> None:
    heights = self_affine(shape, PIXEL, hurst=0.7, rms_slope=0.25, seed=2)
    assert heights.shape == (shape if isinstance(shape, tuple) else (shape,))
    assert rms_slope(heights) == pytest.approx(0.25, rel=1e-9)
    assert abs(heights.mean()) < 1e-12 * heights.std()


def test_nothing_is_shorter_than_the_cutoff_and_it_is_flat_above_the_rolloff() -> None:
    rolloff, cutoff = 64 * PIXEL, 6 * PIXEL
    heights = self_affine(
        (512, 512), PIXEL, hurst=0.8, rms_slope=0.3, rolloff=rolloff, cutoff=cutoff, seed=3
    )
    power, q = np.abs(np.fft.fft2(heights)) ** 2, wavenumber(heights)
    beyond = q > 2 * math.pi / cutoff * (1 + 1e-6)
    assert power[beyond].max() < 1e-20 * power.max()
    flat = spectrum_exponent(heights, 70 * PIXEL, 400 * PIXEL)
    assert abs(flat) < 0.3  # few waves are so long: 160 of them


def test_the_same_in_all_directions() -> None:
    heights = self_affine((512, 512), PIXEL, hurst=0.8, rms_slope=0.3, rolloff=50 * PIXEL)
    along = [np.mean(np.diff(heights, axis=axis) ** 2) for axis in (0, 1)]
    assert along[0] == pytest.approx(along[1], rel=0.05)


@pytest.mark.parametrize("shape", [512, (128, 160)])
def test_it_tiles_without_a_seam(shape: int | tuple[int, int]) -> None:
    heights = self_affine(shape, PIXEL, hurst=0.8, rms_slope=0.3, seed=4)
    for axis in range(heights.ndim):
        inside = np.abs(np.diff(heights, axis=axis)).max()
        seam = np.abs(np.take(heights, 0, axis) - np.take(heights, -1, axis)).max()
        assert seam <= inside


def test_a_seed_fixes_the_surface() -> None:
    def made(seed: int) -> np.ndarray:
        return self_affine((64, 64), PIXEL, hurst=0.8, rms_slope=0.3, seed=seed)

    np.testing.assert_array_equal(made(7), made(7))
    assert abs(np.corrcoef(made(7).ravel(), made(8).ravel())[0, 1]) < 0.5


def test_a_cubic_spline_follows_the_default_cutoff() -> None:
    heights = self_affine(2048, PIXEL, hurst=0.3, rms_slope=0.3, seed=5)
    closed = CubicSpline(PIXEL * np.arange(2049), [*heights, heights[0]], bc_type="periodic")
    slopes = closed(np.linspace(0, 2048 * PIXEL, 40000, endpoint=False), 1)
    # H = 0.3 has the most of its slope near the cut-off, where the spline is at its worst.
    assert np.sqrt(np.mean(slopes**2)) == pytest.approx(0.3, rel=1e-3)


def test_no_slope_gives_a_flat_surface() -> None:
    assert not self_affine((32, 32), PIXEL, hurst=0.8, rms_slope=0.0).any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"shape": (8, 64)}, "16 samples or more"),
        ({"shape": (4, 4, 4)}, "n or (nv, nu)"),
        ({"shape": 100.5}, "n or (nv, nu)"),
        ({"shape": (2**14, 2**14)}, "at most in all"),
        ({"pixel_size": 0.0}, "pixel_size"),
        ({"hurst": 1.2}, "0 to 1"),
        ({"hurst": math.nan}, "0 to 1"),
        ({"rms_slope": -0.1}, "rms_slope"),
        ({"cutoff": 2 * PIXEL}, "above 2 pixels"),
        ({"cutoff": 65 * PIXEL}, "at most rolloff"),
        ({"rolloff": 8 * PIXEL, "cutoff": 9 * PIXEL}, "at most rolloff"),
        ({"rolloff": -1.0}, "rolloff"),
        ({"seed": -1}, "seed"),
    ],
)
def test_values_out_of_range_are_refused_in_one_line(change: dict, words: str) -> None:
    settings = {"shape": (64, 64), "pixel_size": PIXEL, "hurst": 0.8, "rms_slope": 0.3} | change
    with pytest.raises(AsperityError) as caught:
        self_affine(settings.pop("shape"), settings.pop("pixel_size"), **settings)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_like_a_stationary_texture_in_height_slope_and_spectrum() -> None:
    large = self_affine((512, 512), PIXEL, hurst=0.8, rms_slope=0.3, rolloff=40 * PIXEL)
    original = large[:300, :400]  # no longer periodic
    made = synthesise_like(original, seed=1)
    assert made.shape == original.shape
    assert made.std() == pytest.approx(original.std(), rel=0.03)
    for axis in (0, 1):
        steps = [np.diff(heights, axis=axis).std() for heights in (original, made)]
        assert steps[1] == pytest.approx(steps[0], rel=0.03)
    exponent = spectrum_exponent(made, 9 * PIXEL, 30 * PIXEL)
    # The exponent is -2 (0.8 + 1); kinks left at the borders make the spectrum fall less.
    assert exponent == pytest.approx(-3.6, abs=0.4)


def test_like_keeps_the_direction_of_stripes() -> None:
    u = np.arange(256)
    stripes = np.sin(2 * np.pi * u / 16) + np.zeros((128, 1))
    made = synthesise_like(stripes, seed=2)
    assert np.abs(np.diff(made, axis=0)).max() < 1e-6 * made.std()
    assert made.std() == pytest.approx(stripes.std(), rel=0.02)


def test_like_takes_no_roughness_from_a_tilt() -> None:
    tilt = np.add.outer(np.arange(64.0), 2.0 * np.arange(50.0))
    assert synthesise_like(tilt).std() < 0.03 * tilt.std()
    assert not synthesise_like(np.ones(100)).any()


def test_like_is_periodic_and_fixed_by_its_seed() -> None:
    original = self_affine(1024, PIXEL, hurst=0.8, rms_slope=0.3)[:500]
    made = synthesise_like(original, seed=3)
    assert abs(made[0] - made[-1]) <= np.abs(np.diff(made)).max()
    np.testing.assert_array_equal(made, synthesise_like(original, seed=3))
    assert not np.allclose(made, synthesise_like(original, seed=4))


def test_like_real_sandpaper(data: Path) -> None:
    paper = read_heights(
        data / "measured/sandpaper_P120_height16.png", pixel_size=9e-6, height_range=115e-6
    ).samples
    made = synthesise_like(paper)
    assert made.std() == pytest.approx(paper.std(), rel=0.03)
    assert np.diff(made, axis=1).std() == pytest.approx(np.diff(paper, axis=1).std(), rel=0.03)


@pytest.mark.parametrize(
    "heights", [np.full((32, 32), np.nan), np.zeros((4, 4)), np.zeros((16, 16, 16)), ["a", "b"]]
)
def test_like_refuses_what_is_no_surface(heights: object) -> None:
    with pytest.raises(SurfaceError):
        synthesise_like(heights)  # type: ignore[arg-type]
