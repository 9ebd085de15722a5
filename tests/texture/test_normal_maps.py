"""Normal maps: the surface that made one comes back, and what is none is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image
from scipy import ndimage

from asperity.errors import AsperityError, SurfaceError
from asperity.texture.files.normal_maps import integrate_slopes, read_normal_map
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import rough

PIXEL = 1e-5


def surface(border: str) -> HeightField:
    """Roughness on a tile, or a piece of it that does not tile."""
    tile = rough(size=128 * PIXEL, pixel_size=PIXEL, hurst=0.8, rms_slope=0.3, seed=4)
    samples = tile.samples if border == "wrap" else tile.samples[:90, 11:112]
    return HeightField(samples - samples.mean(), PIXEL, border)


def slopes(border: str) -> tuple[np.ndarray, np.ndarray]:
    """Slopes at the samples of `surface`; in both cases those of the whole tile."""
    tile = surface("wrap")
    middles = (np.arange(128) + 0.5) * PIXEL
    found = tile.derivatives(middles, middles[:, None])
    cut = (slice(None),) * 2 if border == "wrap" else (slice(0, 90), slice(11, 112))
    return found.h_u[cut], found.h_v[cut]


def write(path: Path, h_u: np.ndarray, h_v: np.ndarray, largest: int, green: float) -> Path:
    """Write a normal map as a picture, its first row at the top; TIFF, Pillow's PNG has 8 bits."""
    normals = np.stack([-h_u, -green * h_v, np.ones_like(h_u)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    colours = np.round((0.5 + 0.5 * normals[::-1]) * largest)
    if largest == 255:
        Image.fromarray(colours.astype(np.uint8)).save(path)
    else:
        tifffile.imwrite(path, colours.astype(np.uint16), photometric="rgb")
    return path


def level(samples: np.ndarray) -> np.ndarray:
    """Samples less their plane of least squares."""
    v, u = np.indices(samples.shape)
    base = np.stack([np.ones(samples.size), u.ravel(), v.ravel()], axis=1)
    plane = np.linalg.lstsq(base, samples.ravel(), rcond=None)[0]
    return samples - (base @ plane).reshape(samples.shape)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_exact_slopes_give_the_surface_back(border: str) -> None:
    known = surface(border)
    found = integrate_slopes(*slopes(border), PIXEL, border=border)
    # The spline's slopes are not quite those of the waves: 0.3 % at 8 pixels, the shortest here.
    error = level(found) - level(known.samples)
    assert np.abs(error).max() < 2e-3 * known.rms


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_pixels_need_not_be_square(border: str) -> None:
    h_u, h_v = slopes(border)
    square = integrate_slopes(h_u, h_v, PIXEL, border=border)
    long = integrate_slopes(h_u / 3.0, h_v, (3.0 * PIXEL, PIXEL), border=border)
    # Other weights of u and v; the same surface where the slopes are those of one.
    np.testing.assert_allclose(level(long), level(square), atol=2e-3 * square.std())


def test_clamped_slopes_of_the_third_degree_are_integrated_exactly() -> None:
    u = (np.arange(20) - 9.5) * PIXEL
    v = (np.arange(15)[:, None] - 7.0) * PIXEL
    heights = 1e3 * (u**2 - 2 * u * v) + 1e11 * (u**4 - v**4)
    h_u = 1e3 * (2 * u - 2 * v) + 4e11 * u**3
    h_v = 1e3 * (-2 * u + 0 * v) - 4e11 * v**3
    found = integrate_slopes(h_u, h_v, PIXEL)
    np.testing.assert_allclose(found, heights - heights.mean(), atol=1e-12 * np.ptp(heights))


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_no_heights_of_least_squares_fit_better(border: str) -> None:
    # Slopes of no surface: the fit's residual is orthogonal to the slopes of every other.
    h_u, h_v = np.random.default_rng(5).normal(size=(2, 9, 12))
    best = integrate_slopes(h_u, h_v, 1.0, border=border)

    def misfit(heights: np.ndarray) -> float:
        if border == "wrap":
            waves = np.fft.fft2(heights)
            k_u, k_v = np.fft.fftfreq(12)[None, :], np.fft.fftfreq(9)[:, None]
            k_u = np.where(np.abs(k_u) == 0.5, 0.0, k_u)
            found = [np.fft.ifft2(2j * math.pi * k * waves).real for k in (k_u, k_v)]
            return sum(
                np.sum((f - s + s.mean()) ** 2) for f, s in zip(found, (h_u, h_v), strict=True)
            )
        from scipy.interpolate import CubicSpline

        total = 0.0
        for axis, slope in ((1, h_u), (0, h_v)):
            x = np.arange(slope.shape[axis])
            integral = CubicSpline(x, slope - slope.mean(), axis).antiderivative()(x)
            total += np.sum(np.diff(heights - integral, axis=axis) ** 2)
        return total

    rng = np.random.default_rng(6)
    for _ in range(5):
        other = 1e-2 * rng.normal(size=best.shape)
        assert misfit(best) < misfit(best + other)
        assert misfit(best) < misfit(best - other)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
@pytest.mark.parametrize("convention", ["opengl", "directx"])
@pytest.mark.parametrize(("largest", "error"), [(255, 0.02), (65535, 2.5e-3)])
def test_a_known_surface_comes_back_within_quantisation(
    tmp_path: Path, border: str, convention: str, largest: int, error: float
) -> None:
    green = {"opengl": 1.0, "directx": -1.0}[convention]
    path = tmp_path / ("a.png" if largest == 255 else "a.tif")
    write(path, *slopes(border), largest, green)
    found = read_normal_map(path, pixel_size=PIXEL, convention=convention, border=border)
    known = level(surface(border).samples)
    assert np.std(level(found.samples) - known) < error * known.std()
    wrong = {"opengl": "directx", "directx": "opengl"}[convention]
    other = read_normal_map(path, pixel_size=PIXEL, convention=wrong, border=border)
    assert np.std(level(other.samples) - known) > 0.5 * known.std()
    assert convention in " ".join(found.notes)


def test_scale_and_sign_as_asked(tmp_path: Path) -> None:
    path = write(tmp_path / "a.png", *slopes("wrap"), 255, 1.0)
    options = {"border": "wrap", "kind": "normal-opengl"}
    plain = HeightField.from_file(path, pixel_size=PIXEL, **options)
    wide = HeightField.from_file(path, pixel_size=3 * PIXEL, **options)
    np.testing.assert_allclose(wide.samples, 3 * plain.samples, atol=1e-18)
    tall = HeightField.from_file(path, pixel_size=PIXEL, height_range=5e-5, invert=True, **options)
    np.testing.assert_allclose(tall.samples, plain.samples * (-5e-5 / plain.relief), atol=1e-18)
    assert tall.relief == pytest.approx(5e-5)
    assert any("50 um, as given" in note for note in tall.notes)
    assert not any("tile" in note for note in plain.notes)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_a_flat_or_tilted_normal_map_is_flat(tmp_path: Path, border: str) -> None:
    flat = np.zeros((12, 17))
    path = write(tmp_path / "a.png", flat + 0.2, flat - 0.1, 255, 1.0)
    found = read_normal_map(path, pixel_size=PIXEL, border=border)
    assert not found.samples.any()
    assert any("taken for a tilt" in note for note in found.notes)


def test_floats_are_read_from_minus_one_or_from_zero(tmp_path: Path) -> None:
    h_u, h_v = slopes("wrap")
    normals = np.stack([-h_u, -h_v, np.ones_like(h_u)], axis=-1)[::-1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    for name, values in (("a.tif", normals), ("b.tif", 0.5 + 0.5 * normals)):
        tifffile.imwrite(tmp_path / name, values.astype(np.float32), photometric="rgb")
        found = read_normal_map(tmp_path / name, pixel_size=PIXEL, border="wrap")
        known = surface("wrap").samples
        assert np.std(found.samples - known) < 2e-3 * known.std()


def test_a_blue_from_0_to_1_is_known(tmp_path: Path) -> None:
    h_u, h_v = slopes("wrap")
    normals = np.stack([-h_u, -h_v, np.ones_like(h_u)], axis=-1)[::-1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[..., 2] = 2.0 * normals[..., 2] - 1.0
    colours = np.round((0.5 + 0.5 * normals) * 255).astype(np.uint8)
    Image.fromarray(colours).save(tmp_path / "a.png")
    found = read_normal_map(tmp_path / "a.png", pixel_size=PIXEL, border="wrap")
    known = surface("wrap").samples
    assert np.std(found.samples - known) < 0.02 * known.std()
    assert any("blue is z from 0 to 1" in note for note in found.notes)


def test_normals_that_lean_too_far_are_counted(tmp_path: Path) -> None:
    h_u, h_v = (slope.copy() for slope in slopes("wrap"))
    h_u[3, 4], h_u[50, 60] = 1e4, -1e4
    path = write(tmp_path / "a.tif", h_u, h_v, 65535, 1.0)
    found = read_normal_map(path, pixel_size=PIXEL, border="wrap")
    assert any(note.startswith("2 of 16384 normals lean") for note in found.notes)
    assert np.isfinite(found.samples).all()


def test_a_real_fabric(data: Path) -> None:
    path = data / "heights/fabric_pattern_07_nor_gl_1k.jpg"
    other = data / "heights/derived_fabric_pattern_07_height16.png"
    if not (path.exists() and other.exists()):
        pytest.skip("the fabric's normal and height maps are not in shared/data")
    found = HeightField.from_file(path, pixel_size=2e-5, kind="normal-opengl", border="wrap")
    others = HeightField.from_file(other, pixel_size=2e-5, height_range=1e-4).samples
    # That map was integrated by others from this one, and its long waves taken out.
    short = found.samples - ndimage.gaussian_filter(found.samples, 24.0, mode="wrap")
    assert np.corrcoef(short.ravel(), others.ravel())[0, 1] > 0.999
    wrong = HeightField.from_file(path, pixel_size=2e-5, kind="normal-directx", border="wrap")
    short = wrong.samples - ndimage.gaussian_filter(wrong.samples, 24.0, mode="wrap")
    assert np.corrcoef(short.ravel(), others.ravel())[0, 1] < 0.7


GREY = np.full((8, 8), 99, np.uint8)
BLUE = np.full((8, 8, 3), (128, 128, 255), np.uint8)
RED = np.full((8, 8, 3), (255, 0, 0), np.uint8)


@pytest.mark.parametrize(
    ("pixels", "change", "words"),
    [
        (GREY, {}, "no colours"),
        (RED, {}, "no unit vectors"),
        (BLUE[:3], {}, "4 or more"),
        (BLUE, {"pixel_size": None}, "choose a value for pixel_size"),
        (BLUE, {"pixel_size": 0.0}, "pixel_size"),
        (BLUE, {"height_range": -1.0}, "height_range"),
        (BLUE, {"convention": "open-gl"}, "'opengl'"),
        (BLUE, {"border": "mirror"}, "clamp"),
    ],
)
def test_what_is_no_normal_map_is_refused_in_one_line(
    tmp_path: Path, pixels: np.ndarray, change: dict, words: str
) -> None:
    Image.fromarray(pixels).save(tmp_path / "a.png")
    with pytest.raises(AsperityError, match=words) as caught:
        read_normal_map(tmp_path / "a.png", **{"pixel_size": PIXEL} | change)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "words"), [("no.png", "no such file"), ("a.csv", "colour image")])
def test_files_that_are_no_pictures(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "a.csv").write_text("1\n")
    with pytest.raises(SurfaceError, match=words):
        read_normal_map(tmp_path / name, pixel_size=PIXEL)


def test_a_damaged_picture_and_infinite_normals(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n and no more")
    with pytest.raises(SurfaceError, match=r"a\.png: cannot be read"):
        read_normal_map(tmp_path / "a.png", pixel_size=PIXEL)
    tifffile.imwrite(tmp_path / "b.tif", np.full((8, 8, 3), np.nan, np.float32), photometric="rgb")
    with pytest.raises(SurfaceError, match="NaN"):
        read_normal_map(tmp_path / "b.tif", pixel_size=PIXEL)


@pytest.mark.parametrize("choice", [{"missing": "fill"}, {"array": "z"}, {"quantised": "keep"}])
def test_choices_that_a_normal_map_does_not_have(data: Path, choice: dict) -> None:
    path = data / "heights/fabric_pattern_07_nor_gl_1k.jpg"
    with pytest.raises(SurfaceError, match="leave them out"):
        HeightField.from_file(path, pixel_size=2e-5, kind="normal-opengl", **choice)


@pytest.mark.parametrize(
    ("h_u", "h_v", "words"),
    [
        (np.zeros((4, 4)), np.zeros((4, 5)), "one shape"),
        (np.zeros((3, 4)), np.zeros((3, 4)), "4 samples"),
        (np.zeros((4, 4)), np.full((4, 4), np.nan), "16 slopes"),
    ],
)
def test_slopes_that_are_none_are_refused(h_u: np.ndarray, h_v: np.ndarray, words: str) -> None:
    with pytest.raises(SurfaceError, match=words):
        integrate_slopes(h_u, h_v, PIXEL)
