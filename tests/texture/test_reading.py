"""Files of heights: all their bits, their scale, their gaps, and one line where they are wrong."""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from asperity.errors import AsperityError, SurfaceError
from asperity.texture.files import images, stored
from asperity.texture.files.reading import Heights, read_heights
from asperity.texture.height_field import HeightField

SCALE = {"pixel_size": 1e-5, "height_range": 1e-3}
RNG = np.random.default_rng(0)


def chunk(name: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + name
        + content
        + struct.pack(">I", zlib.crc32(name + content))
    )


def scanlines(pixels: np.ndarray) -> bytes:
    return b"".join(b"\0" + row.astype(pixels.dtype.newbyteorder(">")).tobytes() for row in pixels)


def write_png(path: Path, pixels: np.ndarray, colour: int, *, interlaced: bool = False) -> Path:
    """A PNG of any depth and colour type: Pillow writes no 16-bit colour."""
    rows, columns = pixels.shape[:2]
    depth = 8 * pixels.dtype.itemsize
    head = struct.pack(">IIBBBBB", columns, rows, depth, colour, 0, 0, int(interlaced))
    if interlaced:  # Adam7: first row, row step, first column, column step of each pass
        passes = ((0, 8, 0, 8), (0, 8, 4, 8), (4, 8, 0, 4), (0, 4, 2, 4), (2, 4, 0, 2))
        passes += ((0, 2, 1, 2), (1, 2, 0, 1))
        parts = (pixels[v::dv, u::du] for v, dv, u, du in passes)
        body = b"".join(scanlines(part) for part in parts if part.size)
    else:
        body = scanlines(pixels)
    half = len(body := zlib.compress(body)) // 2
    content = chunk(b"IHDR", head) + chunk(b"IDAT", body[:half]) + chunk(b"IDAT", body[half:])
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + content + chunk(b"IEND", b""))
    return path


def levels(path: Path, **changes: object) -> np.ndarray:
    """The file's own values above the lowest, first row at the top, via a scale of 1 a level."""
    raw = images.read_image(path).values
    relief = raw.max() - raw.min()
    read = read_heights(path, pixel_size=1.0, height_range=relief, quantised="keep", **changes)
    return np.flipud(read.samples - read.samples.min() + raw.min())


# --- images: bits, palettes, colour -------------------------------------------------------------


def test_row_0_is_the_bottom_of_the_picture(tmp_path: Path) -> None:
    grey = np.zeros((3, 4), np.uint8)
    grey[-1] = 200
    Image.fromarray(grey).save(tmp_path / "a.png")
    heights = read_heights(tmp_path / "a.png", **SCALE, quantised="keep").samples
    assert heights.shape == (3, 4)
    assert heights[0].min() > heights[1].max()
    assert heights.flags.c_contiguous


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_grey_keeps_its_bits(tmp_path: Path, suffix: str, depth: type) -> None:
    grey = RNG.integers(0, np.iinfo(depth).max, (20, 30), endpoint=True).astype(depth)
    path = tmp_path / f"a{suffix}"
    Image.fromarray(grey).save(path)
    np.testing.assert_allclose(levels(path), grey, atol=1e-9)


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize(("colour", "channels"), [(2, 3), (4, 2), (6, 4)])
def test_16_bit_png_of_several_channels_keeps_16_bits(
    tmp_path: Path, colour: int, channels: int, interlaced: bool
) -> None:
    grey = RNG.integers(0, 65536, (13, 17)).astype(np.uint16)
    pixels = np.stack([grey] * channels, axis=2)
    if channels in (2, 4):
        pixels[..., -1] = RNG.integers(0, 65536, grey.shape)
    path = write_png(tmp_path / "a.png", pixels, colour, interlaced=interlaced)
    np.testing.assert_allclose(levels(path), grey, atol=1e-9)


def test_16_bit_colour_becomes_luminance_with_16_bits(tmp_path: Path) -> None:
    pixels = RNG.integers(0, 65536, (13, 17, 3)).astype(np.uint16)
    path = write_png(tmp_path / "a.png", pixels, 2)
    with pytest.raises(SurfaceError, match="it has colours"):
        read_heights(path, **SCALE)
    raw = images.read_image(path, "luminance").values
    np.testing.assert_allclose(np.flipud(raw), pixels @ [0.299, 0.587, 0.114], atol=1e-9)
    found = read_heights(path, **SCALE, colour="luminance")
    assert any("luminance" in note for note in found.notes)


@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_16_bit_colour_tiff_keeps_16_bits(tmp_path: Path, planar: str) -> None:
    grey = RNG.integers(0, 65536, (13, 17)).astype(np.uint16)
    pixels = np.stack([grey] * 3, axis=0 if planar == "separate" else 2)
    path = tmp_path / "a.tiff"
    tifffile.imwrite(path, pixels, photometric="rgb", planarconfig=planar)
    np.testing.assert_allclose(levels(path), grey, atol=1e-9)


def test_compressed_tiff(tmp_path: Path) -> None:
    grey = RNG.integers(0, 65536, (13, 17)).astype(np.uint16)
    Image.fromarray(grey).save(tmp_path / "a.tif", compression="tiff_lzw")
    np.testing.assert_allclose(levels(tmp_path / "a.tif"), grey, atol=1e-9)


def test_tiff_with_white_as_zero_is_read_as_grey(tmp_path: Path) -> None:
    grey = RNG.integers(0, 65536, (13, 17)).astype(np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", 65535 - grey, photometric="miniswhite")
    np.testing.assert_allclose(levels(tmp_path / "a.tif"), grey, atol=1e-9)


def test_float_tiff_and_its_gaps(tmp_path: Path) -> None:
    grey = RNG.random((13, 17)).astype(np.float32)
    tifffile.imwrite(tmp_path / "a.tif", grey)
    np.testing.assert_allclose(levels(tmp_path / "a.tif"), grey, atol=1e-6)
    grey[3, 4] = np.nan
    tifffile.imwrite(tmp_path / "b.tif", grey)
    with pytest.raises(SurfaceError, match="1 of 221"):
        read_heights(tmp_path / "b.tif", **SCALE)
    assert np.isfinite(read_heights(tmp_path / "b.tif", **SCALE, missing="fill").samples).all()


def test_an_image_may_hold_heights_in_a_unit(tmp_path: Path) -> None:
    values = np.array([[1.0, 2.0, 3.5], [0.25, -4.0, 0.5]], dtype=np.float32)
    tifffile.imwrite(tmp_path / "a.tiff", values)
    for unit, scale in (("m", 1.0), ("um", 1e-6)):
        found = read_heights(tmp_path / "a.tiff", pixel_size=1e-5, unit=unit)
        # Neither centred nor scaled; the picture's bottom row is v = 0.
        np.testing.assert_array_equal(found.samples, values[::-1].astype(np.float64) * scale)
    for options, told in (
        ({"unit": "furlong"}, "unknown unit 'furlong'"),
        ({"unit": "m", "height_range": 1e-4}, "give one"),
    ):
        with pytest.raises(AsperityError, match=told):
            read_heights(tmp_path / "a.tiff", pixel_size=1e-5, **options)
    np.save(tmp_path / "a.npy", values)
    found = read_heights(tmp_path / "a.npy", pixel_size=1e-5, unit="um")
    np.testing.assert_allclose(found.samples, values * 1e-6)


def test_of_several_pictures_the_first_is_read(tmp_path: Path) -> None:
    stack = RNG.integers(0, 65536, (3, 13, 17)).astype(np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", stack, photometric="minisblack")
    np.testing.assert_allclose(levels(tmp_path / "a.tif"), stack[0], atol=1e-9)
    assert any("first of 3" in note for note in read_heights(tmp_path / "a.tif", **SCALE).notes)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_palette_is_looked_up(tmp_path: Path, suffix: str) -> None:
    indices = RNG.integers(0, 256, (20, 30)).astype(np.uint8)
    image = Image.frombytes("P", (30, 20), indices.tobytes())
    table = RNG.permutation(256)
    image.putpalette(np.repeat(table, 3).tolist())
    image.save(tmp_path / f"a{suffix}")
    found = levels(tmp_path / f"a{suffix}")
    found = found / (256.0 if found.max() > 255 else 1.0)  # Pillow's TIFF palettes hold 16 bits
    np.testing.assert_allclose(found, table[indices], atol=1e-9)


def test_jpeg_and_one_bit_png(tmp_path: Path) -> None:
    grey = np.add.outer(np.arange(32), 4 * np.arange(40)).astype(np.uint8)
    Image.fromarray(grey).save(tmp_path / "a.JPG", quality=95)
    assert np.abs(levels(tmp_path / "a.JPG") - grey).max() <= 4
    Image.fromarray(grey > 80).save(tmp_path / "b.png")
    assert set(np.unique(levels(tmp_path / "b.png"))) == {0.0, 255.0}


def test_a_normal_map_is_refused(data: Path) -> None:
    with pytest.raises(SurfaceError, match="normal map"):
        read_heights(data / "heights/fabric_pattern_07_nor_gl_1k.jpg", **SCALE)


def test_exr_needs_its_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    (tmp_path / "a.exr").write_bytes(b"v/1\x01")
    with pytest.raises(SurfaceError, match="pip install OpenEXR"):
        read_heights(tmp_path / "a.exr", **SCALE)


def test_exr_where_its_reader_is_installed(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    grey = RNG.random((13, 17)).astype(np.float32)
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    for name, pixels in (("Y", grey), ("RGB", np.stack([grey] * 3, axis=2))):
        openexr.File(header, {name: pixels}).write(str(tmp_path / "a.exr"))
        np.testing.assert_allclose(levels(tmp_path / "a.exr"), grey, atol=1e-6)


# --- scale --------------------------------------------------------------------------------------


def test_the_height_range_is_that_of_the_data(tmp_path: Path) -> None:
    grey = RNG.integers(1000, 30000, (20, 30)).astype(np.uint16)
    Image.fromarray(grey).save(tmp_path / "a.png")
    read = read_heights(tmp_path / "a.png", pixel_size=2e-5, height_range=0.4e-3)
    assert isinstance(read, Heights)
    assert np.ptp(read.samples) == pytest.approx(0.4e-3, rel=1e-12)
    assert read.samples.mean() == pytest.approx(0.0, abs=1e-15)
    assert read.pixel_size == 2e-5
    assert any("chosen, not measured" in note for note in read.notes)
    turned = read_heights(tmp_path / "a.png", pixel_size=2e-5, height_range=0.4e-3, invert=True)
    np.testing.assert_array_equal(turned.samples, -read.samples)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({}, "pixel_size [m] and height_range [m]"),
        ({"pixel_size": 1e-5}, "a value for height_range [m]"),
        ({"height_range": 1e-3}, "a value for pixel_size [m]"),
    ],
)
def test_an_image_has_no_scale(tmp_path: Path, given: dict, wanted: str) -> None:
    Image.fromarray(np.eye(4, dtype=np.uint8)).save(tmp_path / "a.png")
    with pytest.raises(SurfaceError) as caught:
        read_heights(tmp_path / "a.png", **given)
    assert wanted in str(caught.value)
    assert "choose" in str(caught.value)


def test_a_constant_map_has_no_height(tmp_path: Path) -> None:
    Image.fromarray(np.full((20, 30), 127, np.uint8)).save(tmp_path / "a.png")
    np.save(tmp_path / "a.npy", np.full((20, 30), 0.1))
    for path in (tmp_path / "a.png", tmp_path / "a.npy"):
        read = read_heights(path, **SCALE)
        assert not read.samples.any()
        assert any("all heights are zero" in note for note in read.notes)


# --- grey levels --------------------------------------------------------------------------------


def slope_noise(found: np.ndarray, true: np.ndarray) -> float:
    """Noise of the slope along u against the slope [dB]."""
    turn = 2j * np.pi * np.fft.fftfreq(true.shape[1])
    slopes = [np.fft.ifft(turn * np.fft.fft(h, axis=1), axis=1).real for h in (true, found - true)]
    return float(10 * np.log10(np.mean(slopes[1] ** 2) / np.mean(slopes[0] ** 2)))


@pytest.mark.parametrize("period", [26, 52, 104])
def test_smoothing_takes_slope_noise_away_and_half_a_level_at_most(period: int) -> None:
    u = np.arange(2 * 104)
    wave = np.sin(2 * np.pi * u / period)
    true = 127.5 + 127.5 * np.outer(np.cos(2 * np.pi * u / 208), wave)
    rounded = np.round(true)
    smooth = images.smooth_levels(rounded, 1.0)
    assert np.abs(smooth - rounded).max() <= 0.5
    assert slope_noise(smooth, true) < slope_noise(rounded, true) - 7.0


def test_smoothing_of_a_profile_and_of_an_edge() -> None:
    ramp = np.round(np.arange(300) * 0.13)
    smooth = images.smooth_levels(ramp, 1.0)
    assert np.abs(smooth - ramp).max() <= 0.5
    assert np.diff(smooth)[20:-20].std() < 0.1 * np.diff(ramp).std()
    edge = np.repeat([0.0, 2.55], 50) * np.ones((40, 1))
    assert np.abs(images.smooth_levels(edge, 0.01) - edge).max() <= 0.005 + 1e-12


@pytest.mark.parametrize("name", ["Ground054_1K_Displacement.jpg", "godot_wool_depth.png"])
def test_real_8_bit_maps_move_by_half_a_level_at_most(data: Path, name: str) -> None:
    smooth = read_heights(data / "heights" / name, **SCALE)
    kept = read_heights(data / "heights" / name, **SCALE, quantised="keep")
    half = 0.5e-3 / np.ptp(images.read_image(data / "heights" / name).values)
    assert 0.5 * half < np.abs(smooth.samples - kept.samples).max() <= half * (1 + 1e-9)
    assert any("smoothed" in note for note in smooth.notes)
    assert any("kept" in note for note in kept.notes)


@pytest.mark.parametrize("factor", [257, 256])
def test_8_bits_in_a_16_bit_file_are_found_out(tmp_path: Path, factor: int) -> None:
    grey = RNG.integers(0, 256, (20, 30)).astype(np.uint16)
    Image.fromarray(grey * np.uint16(factor)).save(tmp_path / "a.png")
    Image.fromarray(grey.astype(np.uint8)).save(tmp_path / "b.png")
    wide, narrow = (read_heights(tmp_path / name, **SCALE) for name in ("a.png", "b.png"))
    np.testing.assert_allclose(wide.samples, narrow.samples, atol=1e-12)
    assert wide.notes == narrow.notes


# --- arrays and text ----------------------------------------------------------------------------


def test_npy_holds_metres(tmp_path: Path) -> None:
    heights = RNG.normal(size=(20, 30)) * 1e-5
    np.save(tmp_path / "a.npy", heights)
    read = read_heights(tmp_path / "a.npy", pixel_size=1e-5)
    np.testing.assert_array_equal(read.samples, heights)
    assert read.notes == ("no unit is stated: heights in m; unit= changes that",)
    scaled = read_heights(tmp_path / "a.npy", **SCALE).samples
    assert np.ptp(scaled) == pytest.approx(1e-3)
    np.save(tmp_path / "b.npy", heights[0])
    assert read_heights(tmp_path / "b.npy", pixel_size=1e-5).samples.shape == (30,)
    with pytest.raises(SurfaceError, match=r"choose a value for pixel_size \[m\]$"):
        read_heights(tmp_path / "a.npy")


def test_whole_numbers_are_grey_levels(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", RNG.integers(0, 200, (20, 30)))
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(tmp_path / "a.npy", pixel_size=1e-5)
    assert any("grey levels" in note for note in read_heights(tmp_path / "a.npy", **SCALE).notes)


def test_npz_names_its_units(tmp_path: Path) -> None:
    heights = RNG.normal(size=(20, 30))
    np.savez(tmp_path / "a.npz", height_um=heights, pixel_mm=[0.01, 0.01], source="a lab")
    read = read_heights(tmp_path / "a.npz")
    np.testing.assert_allclose(read.samples, heights * 1e-6)
    assert read.pixel_size == pytest.approx(1e-5)
    assert read.notes == ("array 'height_um', in um", "pixel size 10 um, from the file")
    other = read_heights(tmp_path / "a.npz", pixel_size=3e-5)
    assert other.pixel_size == 3e-5
    assert any("the file has 10 um" in note for note in other.notes)


def test_npz_states_its_unit_and_its_steps_in_arrays_of_their_own(tmp_path: Path) -> None:
    path, heights = tmp_path / "a.npz", 1e-6 * np.arange(20.0).reshape(4, 5)
    mask = heights > 0.0
    np.savez(path, z=1e6 * heights, unit="µm", dx_um=10.0, dy_um=20.0, mask=mask)
    found = read_heights(path)
    np.testing.assert_allclose(found.samples, heights)
    assert found.pixel_size == pytest.approx((1e-5, 2e-5))
    assert "heights in µm, as the file states" in found.notes
    assert any("arrays left out: mask" in note for note in found.notes)
    np.savez(path, z=1e6 * heights, units="V", pixel_size=1e-5)
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(path)


def test_npz_of_several_arrays_asks_which(tmp_path: Path) -> None:
    first, second = RNG.normal(size=(2, 20, 30))
    np.savez(tmp_path / "a.npz", first=first, second=second)
    with pytest.raises(SurfaceError, match="choose with array= from: first, second"):
        read_heights(tmp_path / "a.npz", pixel_size=1e-5)
    with pytest.raises(SurfaceError, match="no array 'third'; valid: first, second"):
        read_heights(tmp_path / "a.npz", pixel_size=1e-5, array="third")
    read = read_heights(tmp_path / "a.npz", pixel_size=1e-5, array="second")
    np.testing.assert_array_equal(read.samples, second)


def test_npz_of_a_profile_and_of_oblong_pixels(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", z=np.arange(50.0), pixel_size=1e-5)
    assert read_heights(tmp_path / "a.npz").samples.shape == (50,)
    np.savez(tmp_path / "b.npz", z=1e-5 * np.eye(4), pixel_size=[1e-5, 2e-5])
    assert read_heights(tmp_path / "b.npz").pixel_size == (1e-5, 2e-5)
    assert HeightField.from_file(tmp_path / "b.npz").size == pytest.approx((4e-5, 8e-5))


@pytest.mark.parametrize(
    ("text", "heights"),
    [
        ("1e-4\n2e-4\n4e-4\n", [1e-4, 2e-4, 4e-4]),
        ("# made\n1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("1 2 3\r\n4  5 6\r\n", [[1, 2, 3], [4, 5, 6]]),
        ("1\t2\n\n3\t4\n", [[1, 2], [3, 4]]),
        ("0,1;0,2\n0,3;0,4\n", [[0.1, 0.2], [0.3, 0.4]]),
        ("height_um\n1\n2\n", [1e-6, 2e-6]),
        ("\ufeff1\n2\n", [1, 2]),
    ],
)
def test_text(tmp_path: Path, text: str, heights: list) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    read = read_heights(tmp_path / "a.csv", pixel_size=1e-5)
    np.testing.assert_allclose(read.samples, heights)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,2\n3\n", "line 2 has 1 columns, the first 2"),
        ("1\nx\n", "line 2: 'x' is no number"),
        ("a\nb\n1\n", "2 samples or more"),
        ("# only\n", "no numbers"),
        ("0,1\n1,5\n2,7\n", "two columns"),
        ("1,,3\n4,5,6\n", "1 of 6 values are missing"),
        ("1\ninf\n3\n", "1 of 3 values are missing"),
        ("5\n", "2 samples or more"),
    ],
)
def test_text_that_is_wrong(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(SurfaceError) as caught:
        read_heights(tmp_path / "a.txt", pixel_size=1e-5)
    assert words in str(caught.value)


# --- missing values -----------------------------------------------------------------------------


def test_filling_follows_the_surroundings(tmp_path: Path) -> None:
    plane = np.add.outer(np.arange(40.0), 2 * np.arange(50.0))
    holed = plane.copy()
    holed[10:30, 20:35] = np.nan
    holed[5, 5] = np.inf
    np.save(tmp_path / "a.npy", holed)
    with pytest.raises(SurfaceError, match="301 of 2000 values are missing"):
        read_heights(tmp_path / "a.npy", pixel_size=1.0)
    read = read_heights(tmp_path / "a.npy", pixel_size=1.0, missing="fill")
    np.testing.assert_allclose(read.samples, plane, atol=1e-9)  # a plane is harmonic
    assert any("301 of 2000" in note and "filled" in note for note in read.notes)


def test_filling_makes_no_hills(tmp_path: Path) -> None:
    heights = RNG.normal(size=(60, 70))
    heights[RNG.random(heights.shape) < 0.4] = np.nan
    heights[:, :20] = np.nan
    np.save(tmp_path / "a.npy", heights)
    filled = read_heights(tmp_path / "a.npy", pixel_size=1.0, missing="fill").samples
    known = np.isfinite(heights)
    np.testing.assert_array_equal(filled[known], heights[known])
    assert np.nanmin(heights) <= filled.min()
    assert filled.max() <= np.nanmax(heights)


def test_filling_a_profile(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan]))
    filled = read_heights(tmp_path / "a.npy", pixel_size=1.0, missing="fill").samples
    np.testing.assert_allclose(filled, [1, 1, 2, 3, 4, 4])


# --- files that cannot be used ------------------------------------------------------------------


def refusal(path: Path, **settings: object) -> str:
    with pytest.raises(AsperityError) as caught:
        read_heights(path, **settings)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    assert isinstance(caught.value, SurfaceError)
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    return message


def test_files_that_are_not_there(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "a.png")
    assert "folder" in refusal(tmp_path)
    (tmp_path / "a.png").touch()
    assert "empty" in refusal(tmp_path / "a.png", **SCALE)
    (tmp_path / "a.docx").write_text("1 2")
    message = refusal(tmp_path / "a.docx")
    assert all(known in message for known in (".png", ".npz", ".csv", ".tmd"))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".npy", ".npz", ".csv"])
def test_damaged_files(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(RNG.bytes(500))
    assert f"cannot be read as a {suffix} file" in refusal(path, **SCALE)


def test_files_cut_short(tmp_path: Path) -> None:
    pixels = RNG.integers(0, 65536, (60, 70, 3)).astype(np.uint16)
    write_png(tmp_path / "colour.png", pixels, 2)
    Image.fromarray(pixels[..., 0]).save(tmp_path / "grey.png")
    Image.fromarray(pixels[..., 0].astype(np.uint8)).save(tmp_path / "grey.jpg")
    tifffile.imwrite(tmp_path / "grey.tif", pixels[..., 0])
    np.save(tmp_path / "a.npy", pixels[..., 0] / 1e6)
    np.savez_compressed(tmp_path / "a.npz", z=pixels[..., 0] / 1e6)
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        assert "cannot be read" in refusal(path, **SCALE)


def test_a_pickle_is_not_opened(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{"a": 1}, None], dtype=object), allow_pickle=True)
    assert "no numbers" in refusal(tmp_path / "a.npy", pixel_size=1.0)


@pytest.mark.parametrize(
    "values", [np.zeros((3, 4, 5)), np.zeros((1, 1)), np.ones((4, 4), complex), np.array(["a"] * 4)]
)
def test_arrays_that_are_no_map(tmp_path: Path, values: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", values)
    assert "valid" in refusal(tmp_path / "a.npy", pixel_size=1.0) or values.size < 2


def test_nothing_but_gaps(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.full((4, 4), np.nan))
    assert "all 16 values" in refusal(tmp_path / "a.npy", pixel_size=1.0, missing="fill")


@pytest.mark.parametrize("side", [12000, 50000, 2**31 - 1])
@pytest.mark.parametrize(("depth", "colour"), [(8, 0), (16, 2)])
def test_images_too_large_are_refused_unread(
    tmp_path: Path, side: int, depth: int, colour: int
) -> None:
    head = struct.pack(">IIBBBBB", side, side, depth, colour, 0, 0, 0)
    content = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 1000))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + content + chunk(b"IEND", b""))
    assert "too many" in refusal(tmp_path / "a.png", **SCALE)


def test_other_files_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((20, 30), np.uint8))
    np.save(tmp_path / "a.npy", np.zeros((20, 30)))
    np.savez_compressed(tmp_path / "a.npz", z=np.zeros((20, 30)))
    (tmp_path / "a.csv").write_text("0.00000000000000\n" * 600)
    monkeypatch.setattr(stored, "MAX_SAMPLES", 500)
    for path in tmp_path.iterdir():
        assert "too many" in refusal(path, **SCALE)


@pytest.mark.parametrize("name", ["pixel_size", "height_range"])
@pytest.mark.parametrize("value", [0.0, -1e-3, np.nan, np.inf, "1 mm"])
def test_lengths_that_are_none(tmp_path: Path, name: str, value: object) -> None:
    np.save(tmp_path / "a.npy", np.eye(4))
    assert f"{name} must be a finite number above 0" in refusal(tmp_path / "a.npy", **{name: value})


def test_choices_are_listed(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.eye(4))
    with pytest.raises(AsperityError, match="refuse, fill"):
        read_heights(tmp_path / "a.npy", pixel_size=1.0, missing="ignore")
    with pytest.raises(AsperityError, match="smooth, keep"):
        read_heights(tmp_path / "a.npy", pixel_size=1.0, quantised="no")
    assert "leave it out" in refusal(tmp_path / "a.npy", pixel_size=1.0, array="z")


# --- instruments --------------------------------------------------------------------------------


def test_instruments_need_their_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    (tmp_path / "a.x3p").write_bytes(b"PK")
    assert "pip install 'asperity[surfaces]'" in refusal(tmp_path / "a.x3p")


def test_a_real_instruments_file(data: Path) -> None:
    pytest.importorskip("SurfaceTopography")
    coin = read_heights(data / "measured/tmd-1.tmd")
    assert coin.pixel_size == pytest.approx(63.189e-6, rel=1e-4)
    assert np.ptp(coin.samples) == pytest.approx(351e-6, rel=1e-3)
    level = read_heights(data / "measured/us_dime_gelsight.npz").samples  # the same, less a plane
    plane = np.stack([np.ones(level.shape), *np.indices(level.shape)], axis=-1).reshape(-1, 3)
    rest = (np.flipud(coin.samples) - level).ravel()  # its rows go from the top
    rest = rest - plane @ np.linalg.lstsq(plane, rest, rcond=None)[0]
    assert np.abs(rest).max() < 1e-9


# --- all the real files -------------------------------------------------------------------------

IMAGES = {
    "heights/Bricks102_1K_Displacement.jpg": (512, 1024),
    "heights/Ground054_1K_Displacement.jpg": (1024, 1024),
    "heights/Rocks07_disp.jpg": (2048, 2048),
    "heights/derived_fabric_pattern_07_height16.png": (1024, 1024),
    "heights/godot_wool_depth.png": (1024, 1024),
    "heights/hterrain_sand_depth.png": (1024, 1024),
    "measured/mdf_stripes_1_height16.png": (1004, 1500),
    "measured/sandpaper_P120_height16.png": (1004, 1500),
    "measured/sandpaper_P40_height16.png": (1004, 1500),
}


@pytest.mark.parametrize("name", IMAGES)
def test_real_images(data: Path, name: str) -> None:
    read = read_heights(data / name, **SCALE)
    assert read.samples.shape == IMAGES[name]
    assert np.isfinite(read.samples).all()
    level = 1e-3 / np.ptp(images.read_image(data / name).values)
    assert np.ptp(read.samples) == pytest.approx(1e-3, abs=1.001 * level)
    assert any("smoothed" in note for note in read.notes) == ("16" not in name)


def test_real_sand_is_grey_not_indices(data: Path) -> None:
    path = data / "heights/hterrain_sand_depth.png"
    grey = np.asarray(Image.open(path).convert("L")).astype(float)
    np.testing.assert_allclose(levels(path), grey, atol=1e-9)


def test_real_constant_metal(data: Path) -> None:
    read = read_heights(data / "heights/Metal049A_1K_Displacement.jpg", **SCALE)
    assert read.samples.shape == (1024, 1024)
    assert not read.samples.any()


@pytest.mark.parametrize(
    ("name", "shape", "pixel_um", "relief_mm", "gaps"),
    [
        ("bullet_land_striae.npz", (256, 918), 2.58, 0.13561, 25292),
        ("rock_fracture_0p1mm.npz", (257, 198), 100.0, 1.73137, 7816),
        ("us_dime_gelsight.npz", (300, 300), 63.18867, 0.35109, 0),
    ],
)
def test_real_measurements(
    data: Path, name: str, shape: tuple[int, int], pixel_um: float, relief_mm: float, gaps: int
) -> None:
    path = data / "measured" / name
    if gaps:
        assert f"{gaps} of " in refusal(path)
    read = read_heights(path, missing="fill")
    assert read.samples.shape == shape
    assert read.pixel_size == pytest.approx(pixel_um * 1e-6)
    assert np.ptp(read.samples) == pytest.approx(relief_mm * 1e-3, rel=1e-3)
    assert any(f"{gaps} of" in note for note in read.notes) == bool(gaps)


def test_every_real_file_is_read_or_refused_in_one_line(data: Path) -> None:
    refused = {}
    for path in sorted((*(data / "heights").iterdir(), *(data / "measured").iterdir())):
        try:
            read = read_heights(path, **SCALE, missing="fill", quantised="keep")
            assert np.isfinite(read.samples).all()
        except SurfaceError as error:
            refused[path.name] = str(error)
    # A coin in an instrument's format is read only where its reader is installed.
    assert refused.keys() - {"tmd-1.tmd"} == {"LICENSE", "fabric_pattern_07_nor_gl_1k.jpg"}
    assert all(name in line and "valid" in line for name, line in refused.items())


def test_arrays_of_points_and_sizes_without_a_unit_are_doubted(tmp_path):
    points = np.random.default_rng(0).random((200, 4))
    np.save(tmp_path / "a.npy", points)
    notes = read_heights(tmp_path / "a.npy", pixel_size=1e-3, unit="mm").notes
    assert any("are they points" in note for note in notes)
    np.savez(tmp_path / "a.npz", heights=points[:20], unit="mm", pixel_size=0.2)
    notes = read_heights(tmp_path / "a.npz").notes
    assert any("is pixel_size in mm too?" in note for note in notes)


def test_places_of_a_mesh_grid_and_steps_by_their_names_in_npz(tmp_path):
    heights = np.random.default_rng(0).random((20, 30))
    v, u = np.mgrid[0:20, 0:30]
    np.savez(tmp_path / "a.npz", X_um=5.0 * u, Y_um=4.0 * v, Z_um=heights)
    np.savez(tmp_path / "b.npz", z_um=heights, pixel_size_x_um=5.0, pixel_size_y_um=4.0)
    for name in ("a.npz", "b.npz"):
        found = read_heights(tmp_path / name)
        np.testing.assert_allclose(found.samples, 1e-6 * heights)
        assert found.pixel_size == pytest.approx((5e-6, 4e-6))
