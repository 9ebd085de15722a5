"""Normal maps that store x and y alone: in red and green, or in alpha and green."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image
from scipy import ndimage

from asperity.errors import SurfaceError
from asperity.texture.files.normal_maps import read_normal_map

V, U = np.mgrid[0:48, 0:64] / 10.0
H_U, H_V = 0.3 * np.cos(U) * np.cos(0.7 * V), -0.21 * np.sin(U) * np.sin(0.7 * V)
PIXEL = 1e-5
HEIGHTS = 10.0 * PIXEL * 0.3 * np.sin(U) * np.cos(0.7 * V)
"""The waves of 63 and 90 pixels whose slopes those are."""
NORMALS = np.stack([-H_U, -H_V, np.ones_like(H_U)], axis=-1)
NORMALS /= np.linalg.norm(NORMALS, axis=-1, keepdims=True)
X, Y = (np.round(127.5 + 127.5 * NORMALS[::-1, :, k]).astype(np.uint8) for k in (0, 1))
FULL, NONE = np.full_like(X, 255), np.zeros_like(X)
RNG = np.random.default_rng(0)


def save(path: Path, *channels: np.ndarray) -> Path:
    Image.fromarray(np.stack(channels, axis=-1)).save(path)
    return path


def likeness(found) -> float:
    return float(np.corrcoef(found.samples.ravel(), HEIGHTS.ravel())[0, 1])


def check(found, words: str, *, relief: float = 0.03) -> None:
    assert likeness(found) > 0.99
    assert np.ptp(found.samples) == pytest.approx(np.ptp(HEIGHTS), rel=relief)
    assert any(words in note for note in found.notes), found.notes


@pytest.mark.parametrize("others", [(FULL, FULL), (NONE, NONE), (Y, Y), (FULL, NONE), (NONE, FULL)])
@pytest.mark.parametrize("kind", ["png", "tga", "webp"])
def test_x_in_alpha_and_y_in_green(tmp_path: Path, others: tuple, kind: str) -> None:
    path = tmp_path / f"wood_normal.{kind}"
    image = Image.fromarray(np.stack([others[0], Y, others[1], X], axis=-1))
    image.save(path, **({"lossless": True, "exact": True} if kind == "webp" else {}))
    check(read_normal_map(path, pixel_size=PIXEL), "x is in alpha and y in green (DXT5)")


def test_masks_beside_x_in_alpha_are_doubted(tmp_path: Path) -> None:
    masks = [RNG.integers(0, 256, X.shape, dtype=np.uint8) for _ in range(2)]
    path = save(tmp_path / "a.png", masks[0], Y, masks[1], X)
    check(read_normal_map(path, pixel_size=PIXEL), "are x and y in alpha and green (DXT5)?")
    noise = save(
        tmp_path / "b.png", masks[0], masks[1], X, RNG.integers(90, 160, X.shape, np.uint8)
    )
    with pytest.raises(SurfaceError, match="its colours are no unit vectors"):
        read_normal_map(noise, pixel_size=PIXEL)


def test_alpha_beside_whole_normals_is_something_else(tmp_path: Path) -> None:
    z = np.round(127.5 + 127.5 * NORMALS[::-1, :, 2]).astype(np.uint8)
    heights = RNG.integers(0, 256, X.shape, dtype=np.uint8)
    found = read_normal_map(save(tmp_path / "a.png", X, Y, z, heights), pixel_size=PIXEL)
    assert likeness(found) > 0.99
    assert not any("DXT5" in note for note in found.notes)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_two_channels_of_a_tiff(tmp_path: Path, dtype: type) -> None:
    largest = 1.0 if dtype is np.float32 else np.iinfo(dtype).max
    two = (0.5 + 0.5 * NORMALS[::-1, :, :2]) * largest
    two = two if dtype is np.float32 else np.round(two)
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, two.astype(dtype), photometric="minisblack", planarconfig="contig")
    check(read_normal_map(path, pixel_size=PIXEL), "two channels are x and y (BC5)")


def test_grey_and_alpha_are_told_apart_by_the_curl(tmp_path: Path) -> None:
    straight = save(tmp_path / "a.png", X, Y)
    check(read_normal_map(straight, pixel_size=PIXEL), "two channels are x and y (BC5)")
    swapped = save(tmp_path / "b.png", Y, X)
    check(read_normal_map(swapped, pixel_size=PIXEL), "is x in the second channel")
    ridge = np.tile(X[:1], (48, 1))
    untold = save(tmp_path / "c.png", ridge, np.full_like(X, 128))
    notes = read_normal_map(untold, pixel_size=PIXEL).notes
    assert any("are they? The map does not tell" in note for note in notes)
    picture = save(tmp_path / "d.png", NONE, X)
    with pytest.raises(SurfaceError, match="no unit vectors"):
        read_normal_map(picture, pixel_size=PIXEL)


@pytest.mark.parametrize("blocks", ["BC5", "DXT5"])
def test_compressed_blocks_of_games(tmp_path: Path, blocks: str) -> None:
    channels = (X, Y, NONE) if blocks == "BC5" else (FULL, Y, FULL, X)
    image = Image.fromarray(np.stack(channels, axis=-1))
    image.save(tmp_path / "a.dds", pixel_format=blocks)
    found = read_normal_map(tmp_path / "a.dds", pixel_size=PIXEL)
    assert likeness(found) > 0.98
    assert any("blue is" in note for note in found.notes)


Z = np.round(127.5 + 127.5 * NORMALS[::-1, :, 2]).astype(np.uint8)


@pytest.mark.parametrize("convention", ["opengl", "directx"])
def test_red_and_green_that_are_exchanged_are_doubted_and_put_back(
    tmp_path: Path, convention: str
) -> None:
    y = Y if convention == "opengl" else 255 - Y
    found = read_normal_map(save(tmp_path / "a.png", y, X, Z), pixel_size=PIXEL)
    check(found, "are red and green exchanged?")
    assert any(f"({convention})" in note for note in found.notes)


def test_an_exchange_that_is_not_clear_is_doubted_and_left(tmp_path: Path) -> None:
    """Beside noise, nothing is changed on a guess."""
    rng = np.random.default_rng(1)
    h_v, h_u = np.gradient(ndimage.gaussian_filter(rng.normal(size=(96, 96)), 4.0) * 12.0)
    levels = np.stack([-h_v, -h_u, np.ones_like(h_u)]) / np.sqrt(1.0 + h_u**2 + h_v**2)
    levels = 127.5 + 127.5 * levels + rng.normal(0.0, 5.0, levels.shape)
    path = save(tmp_path / "a.png", *np.uint8(np.clip(levels, 0, 255)))
    notes = "\n".join(read_normal_map(path, pixel_size=PIXEL).notes)
    assert "are red and green exchanged? So they fit a surface better; read as they are" in notes


@pytest.mark.parametrize("exchanged", [False, True])
def test_blue_that_is_first_is_doubted(tmp_path: Path, exchanged: bool) -> None:
    pair = (X, Y) if exchanged else (Y, X)
    found = read_normal_map(save(tmp_path / "a.png", Z, *pair), pixel_size=PIXEL)
    check(found, "is blue first (BGR)?")
    assert any("exchanged" in note for note in found.notes) == exchanged


def test_grooves_with_blue_first_are_known_by_their_lengths(tmp_path: Path) -> None:
    lean = 0.3 * np.cos(U)
    length = np.hypot(lean, 1.0)
    channels = [np.round(127.5 + 127.5 * c).astype(np.uint8) for c in (lean / length, 1 / length)]
    path = save(tmp_path / "a.png", channels[1], np.full_like(X, 128), channels[0])
    assert any("(BGR)" in note for note in read_normal_map(path, pixel_size=PIXEL).notes)


def test_colours_of_photographs_are_no_normals_in_any_order(tmp_path: Path) -> None:
    """Skin: red is high, and green and blue vary together about the middle."""
    light = 110.0 + 25.0 * np.cos(U) * np.cos(0.7 * V)
    path = save(tmp_path / "a.png", *(np.uint8(light + more) for more in (115, 15, 0)))
    with pytest.raises(SurfaceError, match="its colours are no unit vectors"):
        read_normal_map(path, pixel_size=PIXEL)


@pytest.mark.parametrize("seed", range(8))
def test_normals_of_surfaces_of_every_kind_are_not_doubted(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:96, 0:96].astype(np.float64)
    rough = ndimage.gaussian_filter(rng.normal(size=u.shape), rng.uniform(0.5, 6.0, 2))
    surfaces = [
        rough, np.sin(u / 5.0), np.sin((u + v) / 7.0), np.sin(u / 6.0) * np.sin(v / 6.0),
        np.abs((u + v) % 40 - 20) + np.abs((u - v) % 40 - 20),
        np.maximum(0.0, 8.0 - np.hypot(u % 32 - 16, v % 32 - 16)),
    ]  # fmt: skip
    for heights in surfaces:
        slopes = np.stack(np.gradient(heights))
        h_v, h_u = slopes * rng.uniform(0.03, 0.6) / np.sqrt(np.mean(slopes**2))
        normals = np.stack([-h_u, -h_v, np.ones_like(h_u)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        levels = 127.5 + 127.5 * normals + rng.normal(0.0, rng.uniform(0.0, 8.0), normals.shape)
        save(tmp_path / "a.png", *np.moveaxis(np.uint8(np.clip(levels, 0, 255)), -1, 0))
        notes = read_normal_map(tmp_path / "a.png", pixel_size=PIXEL).notes
        assert not any("exchanged" in note or "BGR" in note for note in notes), notes


def test_the_real_map_is_not_doubted_and_known_when_blue_is_first(
    data: Path, tmp_path: Path
) -> None:
    file = data / "heights" / "fabric_pattern_07_nor_gl_1k.jpg"
    assert not any("exchanged" in n for n in read_normal_map(file, pixel_size=PIXEL).notes)
    with Image.open(file) as image:
        pixels = np.asarray(image)[:256, :256]
    path = save(tmp_path / "a.png", *np.moveaxis(pixels[..., ::-1], -1, 0))
    notes = read_normal_map(path, pixel_size=PIXEL).notes
    assert any("is blue first (BGR)?" in note for note in notes)
