"""Pictures of heights as map programs, painters and phones write them: right, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, PngImagePlugin, TiffImagePlugin

from asperity.errors import SurfaceError
from asperity.texture.files import levels
from asperity.texture.files.colours import COLOURS, suspected
from asperity.texture.files.images import read_pixels
from asperity.texture.files.normal_maps import read_normal_map
from asperity.texture.files.reading import read_heights
from asperity.texture.friction_map import FrictionMap
from asperity.texture.height_field import HeightField

PIXEL, RELIEF = 1e-5, 4e-5
V, U = np.mgrid[0:44, 0:60]
TURN = 2.0 * np.pi
SHARE = np.sin(TURN * (2 * U / 60 + V / 44)) + 0.5 * np.sin(TURN * 3 * V / 44 + 1.0)
SHARE = (SHARE - SHARE.min()) / np.ptp(SHARE)
"""A surface, 0 to 1, the first row at the top; no turn or mirror of it is like it."""
SCALED = {"pixel_size": PIXEL, "height_range": RELIEF}


def like(found, *, relief: float = RELIEF, off: float = 0.02) -> None:
    assert found.samples.shape == SHARE.shape
    assert np.corrcoef(found.samples.ravel(), np.flipud(SHARE).ravel())[0, 1] > 0.99
    assert np.ptp(found.samples) == pytest.approx(relief, rel=off)


def save8(values: np.ndarray, path: Path, **options) -> Path:
    Image.fromarray(np.round(255 * np.clip(values, 0, 1)).astype(np.uint8)).save(path, **options)
    return path


# --- nodata -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dtype", "value", "tag"),
    [
        (np.float32, -9999, "-9999"),
        (np.float32, -3.4028234663852886e38, "-3.40282346638529e+38"),
        (np.float64, 1e20, "1e20"),
        (np.int16, -32768, "-32768"),
        (np.uint16, 65535, "65535 "),
        (np.uint8, 0, "0"),
        (np.float32, np.nan, "nan"),
    ],
)
@pytest.mark.parametrize("compression", [None, "zlib"])
def test_geotiff_s_nodata_is_missing(tmp_path, capsys, dtype, value, tag, compression) -> None:
    heights = (200 * SHARE + 20).astype(dtype)
    heights[10:14, 20:25] = value
    path = tmp_path / "a.tif"
    tags = [(42113, "s", 0, tag, True)]
    tifffile.imwrite(path, heights, extratags=tags, compression=compression)
    options = {"pixel_size": PIXEL, "unit": "um"}
    with pytest.raises(SurfaceError, match="20 of 2640 values are missing"):
        read_heights(path, **options)
    like(read_heights(path, **options, missing="fill"), relief=200e-6)
    assert capsys.readouterr() == ("", "")


def test_a_value_may_be_named_missing(tmp_path) -> None:
    heights = (40 * SHARE).astype(np.float32)
    heights[3:5, 3:5] = -1e4
    tifffile.imwrite(tmp_path / "a.tif", heights)
    options = {"pixel_size": PIXEL, "unit": "um"}
    found = read_heights(tmp_path / "a.tif", **options)
    assert any("is -10000 a missing value? It occurs 4 times" in note for note in found.notes)
    like(read_heights(tmp_path / "a.tif", **options, nodata=-1e4, missing="fill"))


def test_pixels_outside_a_mask_are_missing(tmp_path) -> None:
    path, inside = tmp_path / "a.tif", np.ones(SHARE.shape, dtype=bool)
    inside[3:5, 7:10] = False
    with tifffile.TiffWriter(path) as file:
        file.write((1e6 * RELIEF * SHARE).astype(np.float32))
        file.write(inside, subfiletype=4, photometric="minisblack")
    with pytest.raises(SurfaceError, match="6 of 2640 values are missing"):
        read_heights(path, pixel_size=PIXEL, unit="um")
    like(read_heights(path, pixel_size=PIXEL, unit="um", missing="fill"))


def test_factor_and_offset_of_gdal_are_applied(tmp_path) -> None:
    items = "".join(
        f'<Item name="{name}" sample="0" role="{name.lower()}">{value}</Item>'
        for name, value in (("SCALE", 0.002), ("OFFSET", -7.5))
    )
    tags = [(42112, "s", 0, f"<GDALMetadata>{items}</GDALMetadata>", True)]
    tags += [(42113, "s", 0, "-32768", True)]
    stored = np.round((1e6 * RELIEF * SHARE + 7.5) / 0.002).astype(np.int16)
    stored[5, 6] = -32768
    tifffile.imwrite(tmp_path / "a.tif", stored, extratags=tags)
    found = read_heights(tmp_path / "a.tif", pixel_size=PIXEL, unit="um", missing="fill")
    like(found)
    assert found.samples.min() == pytest.approx(0.0, abs=5e-9)


def test_nodata_may_be_infinite_and_pixels_compressed(tmp_path) -> None:
    heights = (200 * SHARE).astype(np.float32)
    heights[3, 4] = -np.inf
    tifffile.imwrite(tmp_path / "a.tif", heights, extratags=[(42113, "s", 0, "-inf", True)])
    Image.fromarray(np.where(np.isinf(heights), -9999, heights)).save(
        tmp_path / "b.tif", compression="tiff_adobe_deflate", tiffinfo={317: 3, 42113: "-9999"}
    )
    for name in ("a.tif", "b.tif"):
        with pytest.raises(SurfaceError, match="1 of 2640 values are missing"):
            read_heights(tmp_path / name, pixel_size=PIXEL, unit="um")


@pytest.mark.parametrize(("level", "suspected"), [(0, True), (29999, False)])
def test_depth_of_0_among_others_is_suspected(tmp_path, level: int, suspected: bool) -> None:
    depth = np.round(30000 + 2000 * SHARE).astype(np.uint16)
    depth[4:9, 7:9] = level
    Image.fromarray(depth).save(tmp_path / "a.png")
    notes = read_heights(tmp_path / "a.png", **SCALED).notes
    assert any("is 0 a missing value? It occurs 10 times" in note for note in notes) == suspected


def test_clear_pixels_are_suspected(tmp_path) -> None:
    alpha = np.where((U > 20) & (U < 30), 0.0, 1.0)
    path = save8(np.stack([SHARE, SHARE, SHARE, alpha], axis=-1), tmp_path / "a.png")
    notes = read_heights(path, **SCALED).notes
    assert any("are its 396 clear pixels missing?" in note for note in notes)


# --- pixel sizes --------------------------------------------------------------------------------


def test_a_tiff_may_state_its_pixel_size(tmp_path) -> None:
    heights = (40 * SHARE).astype(np.float32)
    path = tmp_path / "imagej.tif"
    tifffile.imwrite(path, heights, imagej=True, resolution=(0.1, 0.05), metadata={"unit": "um"})
    found = read_heights(path, unit="um")
    assert found.pixel_size == pytest.approx((1e-5, 2e-5))
    assert any("pixel size 10 x 20 um, from the file" in note for note in found.notes)
    sizes = {"PhysicalSizeX": 5000, "PhysicalSizeXUnit": "nm", "PhysicalSizeY": 5.0}
    tifffile.imwrite(tmp_path / "a.ome.tif", heights, metadata={"axes": "YX", **sizes})
    assert read_heights(tmp_path / "a.ome.tif", unit="um").pixel_size == pytest.approx(5e-6)
    keys = (1, 1, 0, 1, 1024, 0, 1, 1)
    tags = [(33550, "d", 3, (0.5, 0.5, 0.0), True), (34735, "H", 8, keys, True)]
    tifffile.imwrite(tmp_path / "geo.tif", heights, extratags=tags)
    found = read_heights(tmp_path / "geo.tif", unit="m")
    assert found.pixel_size == 0.5
    assert any("is that plausible? A pixel size of 500 mm" in note for note in found.notes)
    feet = (1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9002)
    tags = [(33550, "d", 3, (0.01, 0.02, 0.0), True), (34735, "H", 12, feet, True)]
    tifffile.imwrite(tmp_path / "feet.tif", heights, extratags=tags)
    found = read_heights(tmp_path / "feet.tif", unit="um")
    assert found.pixel_size == pytest.approx((0.003048, 0.006096))
    turned = [0.0, 2e-3, 0.0, 5e5, 1e-3, 0.0, 0.0, 4e6, *[0.0] * 7, 1.0]
    tags = [(34264, "d", 16, turned, True), (34735, "H", 8, keys, True)]
    tifffile.imwrite(tmp_path / "turned.tif", heights, extratags=tags)
    found = read_heights(tmp_path / "turned.tif", unit="um")
    assert found.pixel_size == pytest.approx((1e-3, 2e-3))
    tifffile.imwrite(tmp_path / "inch.tif", heights, resolution=(72, 72), resolutionunit="INCH")
    with pytest.raises(SurfaceError, match="choose a value for pixel_size"):
        read_heights(tmp_path / "inch.tif", unit="um")


# --- colours ------------------------------------------------------------------------------------


def packed(colour: str) -> tuple[np.ndarray, float]:
    """A picture of the surface in one packing, and the metres of relief that it holds."""
    weights = np.array(COLOURS[colour].weights)
    used = np.argsort(-weights)[: np.count_nonzero(weights)]
    whole = np.round(SHARE * (256 ** len(used) - 1)).astype(np.int64)
    relief = 1.0
    if colour == "terrain-rgb":
        whole = np.round((500 * SHARE + 10000) / 0.1).astype(np.int64)
        relief = 500.0
    elif colour == "terrarium":
        whole = np.round((500 * SHARE + 32768) * 256).astype(np.int64)
        relief = 500.0
    pixels = np.zeros((*SHARE.shape, 3), np.uint8)
    for place, channel in enumerate(used):
        pixels[..., channel] = whole >> 8 * (len(used) - 1 - place) & 255
    return pixels, relief


@pytest.mark.parametrize(
    "colour", ["packed-rgb", "packed-bgr", "packed-rg", "packed-gr", "terrain-rgb", "terrarium"]
)
def test_packed_heights_are_suspected_and_unpacked(tmp_path, colour: str) -> None:
    pixels, relief = packed(colour)
    path = tmp_path / "a.png"
    Image.fromarray(pixels).save(path)
    with pytest.raises(SurfaceError, match=rf"they look packed: colour='{colour}'"):
        read_heights(path, **SCALED)
    like(read_heights(path, **SCALED, colour=colour))
    if COLOURS[colour].metres:
        found = read_heights(path, pixel_size=30.0, colour=colour)
        like(found, relief=relief)
        assert any("is that plausible?" in note for note in found.notes)
    wrong = read_heights(path, **SCALED, colour="luminance")
    assert any(f"colour={colour!r}?" in note for note in wrong.notes)


def test_colours_are_refused_unless_their_meaning_is_given(tmp_path) -> None:
    rainbow = 1.5 - np.abs(4 * SHARE[..., None] - [3, 2, 1])
    path = save8(rainbow, tmp_path / "a.png")
    with pytest.raises(SurfaceError, match="it has colours") as refused:
        read_heights(path, **SCALED)
    assert len(str(refused.value).replace(str(path), "")) <= 300
    photo = np.random.default_rng(0).integers(0, 256, (40, 40, 3)).astype(np.uint8)
    assert suspected(photo) is None
    red = np.stack([SHARE, 0 * SHARE, 1 - SHARE], axis=-1)
    like(read_heights(save8(red, tmp_path / "b.png"), **SCALED, colour="red"))
    with pytest.raises(SurfaceError, match="leave them out"):
        HeightField.from_file(path, pixel_size=PIXEL, kind="normal", colour="red")


@pytest.mark.parametrize("form", ["png", "jpg", "tif", "rgba.png", "bmp", "webp"])
def test_grey_stored_as_colours_is_grey(tmp_path, form: str) -> None:
    channels = 4 if "rgba" in form else 3
    pixels = np.stack([SHARE] * 3 + [np.ones_like(SHARE)] * (channels - 3), axis=-1)
    like(read_heights(save8(pixels, tmp_path / f"a.{form}"), **SCALED))


def test_nearly_grey_is_read_with_a_note(tmp_path) -> None:
    tinted = np.stack([SHARE, SHARE, np.clip(SHARE + 0.01, 0, 1)], axis=-1)
    found = read_heights(save8(tinted, tmp_path / "a.png"), **SCALED)
    like(found)
    assert any("nearly grey" in note for note in found.notes)


# --- orientation --------------------------------------------------------------------------------

STORED = {
    1: lambda seen: seen,
    2: np.fliplr,
    3: lambda seen: np.rot90(seen, 2),
    4: np.flipud,
    5: np.transpose,
    6: lambda seen: np.rot90(seen, 1),
    7: lambda seen: np.rot90(seen, 2).T,
    8: lambda seen: np.rot90(seen, -1),
}
"""How a picture is stored that is seen upright, by orientation (TIFF 6.0, page 36)."""


@pytest.mark.parametrize("orientation", STORED)
@pytest.mark.parametrize("form", ["jpg", "png", "16.png", "tif", "lzw.tif"])
def test_pictures_are_turned_as_exif_states(tmp_path, form: str, orientation: int) -> None:
    stored = np.ascontiguousarray(STORED[orientation](SHARE))
    path = tmp_path / f"a.{form}"
    exif = Image.Exif()
    exif[0x0112] = orientation
    if form == "tif":
        tags = [(274, "H", 1, orientation, True)]
        tifffile.imwrite(path, np.round(65535 * stored).astype(np.uint16), extratags=tags)
    elif form == "lzw.tif":
        image = Image.fromarray(np.round(65535 * stored).astype(np.uint16))
        image.save(path, compression="tiff_lzw", tiffinfo={274: orientation})
    elif form == "16.png":
        Image.fromarray(np.round(65535 * stored).astype(np.uint16)).save(path, exif=exif)
    else:
        save8(stored, path, exif=exif, **({"quality": 98} if form == "jpg" else {}))
    found = read_heights(path, **SCALED)
    like(found)
    assert any("EXIF" in note for note in found.notes) == (orientation > 1 and form != "lzw.tif")
    assert read_pixels(path)[0].shape[:2] == SHARE.shape


# --- normal maps --------------------------------------------------------------------------------

STEEP = 2.0
H_V, H_U = np.gradient(STEEP * RELIEF * SHARE, PIXEL)
NORMAL = np.stack([-H_U, H_V, np.ones_like(H_U)], axis=-1)
"""Green up the picture, whose rows run down."""
UNIT = NORMAL / np.linalg.norm(NORMAL, axis=-1, keepdims=True)
DOWN = np.array([1.0, -1.0, 1.0])


@pytest.mark.parametrize("length", [1.0, 0.88, 0.7, 1.15])
@pytest.mark.parametrize("green", ["opengl", "directx"])
@pytest.mark.parametrize("form", ["png", "jpg"])
def test_a_normal_map_shows_where_green_points(tmp_path, length, green, form) -> None:
    vectors = length * UNIT * (1.0 if green == "opengl" else DOWN)
    options = {"quality": 95, "subsampling": 0} if form == "jpg" else {}
    path = save8(0.5 * (vectors + 1), tmp_path / f"a.{form}", **options)
    found = read_normal_map(path, pixel_size=PIXEL)
    assert any("found from the map's own curl" in note for note in found.notes)
    assert any("normalised to 1" in note for note in found.notes) == (abs(length - 1) > 0.05)
    if length <= 1.0:  # longer ones are clipped by the colours' range
        like(found, relief=STEEP * RELIEF, off=0.05)
    other = {"opengl": "directx", "directx": "opengl"}[green]
    contradicted = read_normal_map(path, pixel_size=PIXEL, convention=other)
    assert any(f"kind='normal-{green}'" in note for note in contradicted.notes)
    agreed = HeightField.from_file(path, pixel_size=PIXEL, kind=f"normal-{green}")
    assert not any("curl" in note for note in agreed.notes)


def test_ridges_along_one_axis_do_not_show_where_green_points(tmp_path) -> None:
    slope = 0.5 * np.cos(U / 4.0)
    normal = np.stack([-slope, 0 * slope, np.ones_like(slope)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    path = save8(0.5 * (normal + 1), tmp_path / "a.png")
    found = HeightField.from_file(path, pixel_size=PIXEL, kind="normal")
    assert any(note.startswith("does green point up?") for note in found.notes)
    for name, way in (("a-normal-ogl.png", "up"), ("a_nor_dx.png", "down")):
        path = save8(0.5 * (normal + 1), tmp_path / name)
        found = HeightField.from_file(path, pixel_size=PIXEL, kind="normal")
        assert any(f"green points {way}, as the file's name" in note for note in found.notes)


def test_a_blue_that_is_constant_is_found_from_red_and_green(tmp_path) -> None:
    flat = np.stack([UNIT[..., 0], UNIT[..., 1], -np.ones_like(H_U)], axis=-1)
    found = read_normal_map(save8(0.5 * (flat + 1), tmp_path / "a.png"), pixel_size=PIXEL)
    like(found, relief=STEEP * RELIEF, off=0.05)
    assert any("blue is constant" in note for note in found.notes)


def test_pixels_of_a_normal_map_may_be_oblong(tmp_path) -> None:
    normal = np.stack([-H_U, H_V / 1.5, np.ones_like(H_U)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    path = save8(0.5 * (normal + 1), tmp_path / "a.png")
    found = HeightField.from_file(path, pixel_size=(PIXEL, 1.5 * PIXEL), kind="normal")
    assert found.pixel_size == (PIXEL, 1.5 * PIXEL)
    like(found, relief=STEEP * RELIEF, off=0.05)


def test_colours_that_are_no_normals_are_refused(tmp_path) -> None:
    rainbow = save8(1.5 - np.abs(4 * SHARE[..., None] - [3, 2, 1]), tmp_path / "a.png")
    noise = np.random.default_rng(0).random((40, 40, 3))
    for path in (rainbow, save8(noise, tmp_path / "b.png")):
        with pytest.raises(SurfaceError, match="no unit vectors"):
            read_normal_map(path, pixel_size=PIXEL)


# --- large maps ---------------------------------------------------------------------------------


def test_tiles_are_smoothed_as_the_whole_map(monkeypatch) -> None:
    grey = np.round(255 * np.kron(SHARE, np.ones((5, 7))))
    whole = levels.smooth_levels(grey, 1.0)
    monkeypatch.setattr(levels, "_TILE", 64)
    assert np.abs(levels.smooth_levels(grey, 1.0) - whole).max() < 1e-3
    line = np.round(255 * SHARE.ravel())
    assert np.abs(levels.smooth_levels(line, 1.0) - line).max() <= 0.5


def test_inks_are_colours(tmp_path: Path) -> None:
    grey = np.tile(np.linspace(0, 255, 40).astype(np.uint8), (20, 1))
    picture = Image.fromarray(np.stack([grey] * 3, axis=-1)).convert("CMYK")
    for name in ("a.tif", "a.jpg"):
        picture.save(tmp_path / name)
        found = read_heights(tmp_path / name, pixel_size=1e-5, height_range=1e-4)
        assert found.samples[5, -1] - found.samples[5, 0] == pytest.approx(1e-4, rel=0.02)
        assert any("inks (CMYK)" in note for note in found.notes)


@pytest.mark.parametrize("blue", [0, 128, 255])
def test_a_constant_blue_is_no_component_of_the_normals(tmp_path: Path, blue: int) -> None:
    phase = 2 * np.pi * np.arange(64) / 32
    slope = np.tile(0.8 * np.cos(phase), (64, 1))
    normals = np.stack([-slope, 0 * slope, 1 + 0 * slope], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    colours = np.round(127.5 * (normals + 1)).astype(np.uint8)
    colours[..., 2] = blue
    Image.fromarray(colours).save(tmp_path / "a.png")
    found = HeightField.from_file(tmp_path / "a.png", pixel_size=1e-5, kind="normal", border="wrap")
    assert found.relief == pytest.approx(2 * 0.8 * 32e-5 / (2 * np.pi), rel=0.03)
    assert any("blue is constant: it is found from red and green" in n for n in found.notes)


def test_a_full_blue_beside_slopes_is_normalised(tmp_path: Path) -> None:
    tall = 2.0
    h_v, h_u = np.gradient(tall * RELIEF * SHARE, PIXEL)
    slopes = np.stack([-h_u, h_v, np.ones_like(h_u)], axis=-1)  # green is up, rows run down
    path = save8(0.5 * (slopes + 1.0), tmp_path / "a.png")
    found = read_normal_map(path, pixel_size=PIXEL)
    like(found, relief=tall * RELIEF, off=0.05)
    assert any("normalised to 1" in note for note in found.notes)


def test_a_picture_is_read_by_what_it_is_and_not_by_its_name(tmp_path: Path) -> None:
    levels = (np.arange(48, dtype=np.uint16).reshape(6, 8) ** 2) * 27
    Image.fromarray(levels).save(tmp_path / "a.png")
    tifffile.imwrite(tmp_path / "b.tif", levels)
    (tmp_path / "a.png").rename(tmp_path / "c.tif")
    (tmp_path / "b.tif").rename(tmp_path / "d.png")
    found = [
        read_heights(tmp_path / name, pixel_size=1e-5, height_range=1e-4).samples
        for name in ("c.tif", "d.png")
    ]
    np.testing.assert_array_equal(*found)
    assert len(np.unique(found[0])) == 48


@pytest.mark.parametrize("name", ["a.tif", "a.csv", "a.npy", "a.x3p"])
def test_a_pointer_of_git_lfs_is_named(tmp_path: Path, name: str) -> None:
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0a\nsize 12345\n"
    (tmp_path / name).write_text(pointer)
    with pytest.raises(SurfaceError, match=r"a pointer of Git LFS.*`git lfs pull`"):
        read_heights(tmp_path / name)


@pytest.mark.parametrize("kind", ["cielab", "icclab"])
def test_lightness_is_no_height(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.full((8, 8, 3), 128, "u1"), photometric=kind)
    for colour in (None, "luminance"):
        with pytest.raises(SurfaceError, match=r"its colours are .*LAB \(L\*a\*b\*\)"):
            read_heights(path, colour=colour, **SCALED)


def test_the_resolution_of_a_picture_is_named_unless_it_is_a_screen_s(tmp_path: Path) -> None:
    fine = save8(SHARE, tmp_path / "a.png", dpi=(2540, 2540))
    with pytest.raises(SurfaceError, match=r"pixel_size \[m\]; its resolution.* is 10 um a pixel"):
        read_heights(fine, height_range=RELIEF)
    like(read_heights(fine, **SCALED))
    assert not any("resolution" in n for n in read_heights(fine, **SCALED).notes)
    given = read_heights(fine, pixel_size=2 * PIXEL, height_range=RELIEF)
    assert any("its resolution, of a print or not, is 10 um" in note for note in given.notes)
    screen = save8(SHARE, tmp_path / "b.png", dpi=(72, 72))
    assert not any("resolution" in n for n in read_heights(screen, **SCALED).notes)


def test_the_unit_of_gdal_is_that_of_the_heights(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"

    def write(unit: str) -> None:
        text = f'<GDALMetadata>\n<Item name="UNITTYPE" sample="0" role="unittype">{unit}</Item>\n'
        tag = [(42112, 2, 0, text + "</GDALMetadata>", True)]
        tifffile.imwrite(path, (1e3 * RELIEF * SHARE).astype("f4"), extratags=tag)

    write("mm")
    found = read_heights(path, pixel_size=PIXEL)
    like(found)
    assert "heights in mm, as the file states (GDAL)" in found.notes
    given = read_heights(path, pixel_size=PIXEL, unit="um")
    assert any("in um, as given; the file states mm" in note for note in given.notes)
    write("degC")
    with pytest.raises(SurfaceError, match="height_range"):
        read_heights(path, pixel_size=PIXEL)


# --- what stands beside the picture ---------------------------------------------------------------


def test_a_preview_before_the_picture_is_not_read(tmp_path: Path) -> None:
    grey = np.round(65535 * SHARE).astype(np.uint16)
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        small = np.stack([grey[::4, ::4] >> 8] * 3, axis=-1).astype(np.uint8)
        file.write(small, photometric="rgb", subfiletype=1)
        file.write(grey)
    found = read_heights(tmp_path / "a.tif", **SCALED)
    like(found)
    assert any("the first that is no preview of 2" in note for note in found.notes)


def test_luminance_beside_chrominance_is_grey(tmp_path: Path) -> None:
    grey = Image.fromarray(np.round(255 * SHARE).astype(np.uint8))
    grey.convert("YCbCr").save(tmp_path / "a.tif")
    like(read_heights(tmp_path / "a.tif", **SCALED))


def test_a_compression_that_python_lacks_is_read_by_pillow(tmp_path: Path, monkeypatch) -> None:
    Image.fromarray(SHARE.astype(np.float32)).save(tmp_path / "a.tif", compression="tiff_lzw")

    def lacking(*_: object, **__: object) -> None:
        raise ModuleNotFoundError("No module named 'compression'")

    monkeypatch.setattr(tifffile.TiffPage, "asarray", lacking)
    like(read_heights(tmp_path / "a.tif", **SCALED))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_grey_that_a_png_calls_clear_is_suspected(tmp_path: Path, dtype: type) -> None:
    grey = np.round(200 * SHARE + 20).astype(dtype)
    grey[3:5, 3:5] = 0
    Image.fromarray(grey).save(tmp_path / "a.png", transparency=0)
    found = read_heights(tmp_path / "a.png", **SCALED)
    assert "are its 4 clear pixels missing? nodata=0" in found.notes


# --- values that the file's head states ----------------------------------------------------------


@pytest.mark.parametrize("white", [100, 4095, 65535])
@pytest.mark.parametrize("kind", ["P5", "P2"])
def test_the_values_of_a_pgm_are_those_in_the_file(tmp_path, white, kind) -> None:
    values = np.round(0.9 * white * SHARE).astype(">u2" if white > 255 else "u1")
    body = values.tobytes() if kind == "P5" else " ".join(map(str, values.ravel())).encode()
    path = tmp_path / "a.pgm"
    path.write_bytes(f"{kind}\n# a camera\n60 44\n{white}\n".encode() + body)
    found = read_heights(path, pixel_size=PIXEL, unit="um", quantised="keep")
    like(found, relief=1e-6 * values.max())
    if white == 100:
        friction = FrictionMap.from_file(path, pixel_size=PIXEL, low=0.0, high=1.0)
        assert friction.highest == pytest.approx(0.9)


def test_the_calibration_of_imagej_is_read(tmp_path) -> None:
    head = "ImageJ=1.53t\nunit=um\nyunit=mm\ncf=0\nc0=-5.0\nc1=0.001\nvunit=\\u00B5m\n"
    path, values = tmp_path / "a.tif", np.round(40000 * SHARE).astype(np.uint16)
    tifffile.imwrite(path, values, description=head, metadata=None, resolution=(1 / 10, 1 / 0.01))
    for options in ({}, {"unit": "um"}):
        found = read_heights(path, **options)
        like(found)
        assert found.samples.min() == pytest.approx(-5e-6, rel=1e-6)
        assert found.pixel_size == pytest.approx(PIXEL)


def test_gwyddion_s_pictures_have_their_scale(tmp_path) -> None:
    said = {"XReal": 60 * PIXEL, "YReal": 44 * PIXEL, "ZMin": 1e-6, "ZMax": 41e-6}
    values, text = np.round(65535 * SHARE).astype(np.uint16), PngImagePlugin.PngInfo()
    for key, value in {**said, "XYUnit": "m", "ZUnit": "m"}.items():
        text.add_text(f"Gwy::{key}", str(value))
    Image.fromarray(values).save(tmp_path / "a.png", pnginfo=text)
    head = "".join(f"# Gwy::{key} {value:g}\n" for key, value in said.items())
    pgm = f"P5\n{head}# Gwy::Title Height\n60\n44\n65535\n".encode()
    (tmp_path / "a.pgm").write_bytes(pgm + values.astype(">u2").tobytes())
    for name in ("a.png", "a.pgm"):
        found = read_heights(tmp_path / name)
        like(found, off=1e-4)
        assert found.pixel_size == pytest.approx(PIXEL)


def test_a_geotiff_whose_rows_go_northwards(tmp_path) -> None:
    keys = (1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9001)
    placed = (PIXEL, 0, 0, 0, 0, PIXEL, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1)
    tags = [(34264, "d", 16, placed), (34735, "H", len(keys), keys)]
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.flipud(RELIEF * SHARE).astype(np.float32), extratags=tags)
    found = read_heights(path, unit="m")
    like(found)
    assert any("northwards" in note for note in found.notes)


def test_what_a_tiff_states_is_read_whatever_its_compression(tmp_path) -> None:
    head = TiffImagePlugin.ImageFileDirectory_v2()
    items = {"SCALE": "0.001", "OFFSET": "5", "UNITTYPE": "um"}
    head[42112] = "".join(f'<Item name="{k}" sample="0">{v}</Item>' for k, v in items.items())
    head.tagtype[42112] = 2
    image, path = Image.fromarray(np.round(40000 * SHARE).astype(np.uint16)), tmp_path / "a.tif"
    for compression in (None, "tiff_lzw", "tiff_adobe_deflate"):
        image.save(path, compression=compression, tiffinfo=head)
        found = read_heights(path, pixel_size=PIXEL)
        like(found)
        assert found.samples.min() == pytest.approx(5e-6)
