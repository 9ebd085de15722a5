"""Normal maps that store x and y alone: in red and green, or in alpha and green."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

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
