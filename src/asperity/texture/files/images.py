"""Grey values of image files at full bit depth, and smoothing of coarse grey levels.

Reading a height map like a picture fails silently in three ways: 16-bit colour and 16-bit
grey-alpha PNG are reduced to 8 bits, a palette file yields indices, and the 256 levels of an 8-bit
map remain as steps that a probe feels. Here 16 bits stay 16, palettes are applied, and
`smooth_levels` removes the steps within the file's rounding.
"""

from __future__ import annotations

import importlib
import logging
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.units import length_of
from asperity.errors import SurfaceError
from asperity.texture.files.checks import MAX_SAMPLES
from asperity.texture.files.colours import grey
from asperity.texture.files.levels import smooth_levels as smooth_levels
from asperity.texture.files.picture_heads import as_stored, gwyddion_scale
from asperity.texture.files.png16 import read_png16
from asperity.texture.files.printed_size import printed_size, printed_size_of_tiff
from asperity.texture.files.stored import Stored, check_size
from asperity.texture.files.tiff_scale import (
    ValueScale,
    is_south_up,
    tiff_pixel_size,
    value_scale,
)

IMAGE_SUFFIXES = (
    ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".webp", ".pgm", ".tga", ".dds", ".exr",
)  # fmt: skip
_TURNS = {
    2: (True, 0, "mirrored"),
    3: (False, 2, "turned by 180 degrees"),
    4: (True, 2, "mirrored, top to bottom"),
    5: (True, 1, "mirrored and turned by 90 degrees"),
    6: (False, 3, "turned clockwise by 90 degrees"),
    7: (True, 3, "mirrored and turned clockwise by 90 degrees"),
    8: (False, 1, "turned by 90 degrees"),
}
"""Whether the columns are reversed, quarter turns after that, and the words, by EXIF orientation.

The pixels are stored otherwise than they are seen; this makes them as they are seen.
"""
_NODATA = 42113
"""GDAL's tag for the value of missing pixels."""
_ORIENTATION = 274
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PARK = 50432
"""Tag by which microscopes of Park Systems mark their files."""
_AS_STORED = ("L", "LA", "RGB", "RGBA", "I", "F")
_PNG_COLOURS = {2: "RGB", 4: "LA", 6: "RGBA"}


class PreviewOnlyError(Exception):
    """A TIFF by a microscope of Park Systems, whose picture is not its heights."""


class _Picture(NamedTuple):
    """Pixels, the first row at the top, and which of them have no data."""

    pixels: NDArray[Any]
    notes: tuple[str, ...] = ()
    missing: NDArray[np.bool_] | None = None
    pixel_size: tuple[float, float] | None = None
    """As the file states it [m]"""
    printed_size: tuple[float, float] | None = None
    """By its resolution, which may be that of a print [m]"""
    unit: str = ""
    """Of its values, as the file states it."""
    by: str = ""
    """Which program's words state it."""
    white: float = 0.0
    """Largest value that it may have, if that is not the largest of its type."""
    preview: bool = False
    """Whether the heights stand elsewhere in the file."""


def read_image(path: Path, colour: str | None = None) -> Stored:
    """Return the values of the image file at `path`, row 0 at the bottom of the picture.

    Parameters
    ----------
    path : Path
    colour : str, optional
        What colours mean: a key of `asperity.texture.files.colours.COLOURS`.

    Raises
    ------
    SurfaceError
        A file that is too large, or of a kind that cannot be read with all its bits; colours
        that nothing states the meaning of.
    """
    picture = _read(path)
    if picture.preview and colour is None:
        raise PreviewOnlyError(path)
    stored = grey(path, np.flipud(picture.pixels), picture.notes, colour)
    stored = stored._replace(
        pixel_size=picture.pixel_size, printed_size=picture.printed_size, white=picture.white
    )
    if picture.unit and colour is None:
        metres = length_of(picture.unit)
        said = f"as the file states ({picture.by})" if metres else "which is no length"
        note = f"heights in {picture.unit}, {said}"
        stored = stored._replace(
            scale=metres, unit=picture.unit, notes=(*stored.notes, note), step=0.0
        )
    if picture.missing is None:
        return stored
    with np.errstate(invalid="ignore"):  # NaN of any kind
        values = stored.values.astype(np.float64)
    values[np.flipud(picture.missing)] = np.nan
    return stored._replace(values=values)


def read_pixels(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return the pixels of an image at full bit depth, and notes.

    Returns
    -------
    pixels : (rows, columns) or (rows, columns, channels) array
        As stored, palettes applied, upright by EXIF, the first row at the top of the picture.
    notes : tuple of str
        Conversions made.
    """
    picture = _read(path)
    return picture.pixels, picture.notes


def picture_scale(
    path: Path,
) -> tuple[tuple[int, int], tuple[float, float] | None, float | None]:
    """Return rows and columns of an image, and what it states of its pixel size and unit [m].

    Raises `PreviewOnlyError` where its heights stand elsewhere in the file.
    """
    picture = _read(path)
    if picture.preview:
        raise PreviewOnlyError(path)
    rows, columns = picture.pixels.shape[:2]
    metres = length_of(picture.unit) if picture.unit else None
    return (rows, columns), picture.pixel_size, metres


def _read(path: Path) -> _Picture:
    suffix = path.suffix.lower()
    if suffix == ".exr":
        return _read_exr(path)
    with path.open("rb") as file:
        head = file.read(33)
        if head.startswith(_TIFF):  # whatever its name states
            file.seek(0)
            return _read_tiff(path, file)
    if head.startswith(b"\x89PNG") and len(head) == 33:
        columns, rows, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", head[16:29])
        if depth == 16 and colour in _PNG_COLOURS:
            check_size(path, rows, columns)
            pixels = read_png16(path, (columns, rows), _PNG_COLOURS[colour], interlaced)
            with _opened(path) as image:
                picture = _Picture(pixels, printed_size=printed_size(image.info.get("dpi")))
                return _upright(picture, _orientation(image))
    return _read_pillow(path)


def _upright(picture: _Picture, orientation: int, why: str = "") -> _Picture:
    """Return a picture turned and mirrored as its EXIF orientation states, 1 to 8; or else why."""
    if orientation not in _TURNS:
        return picture
    mirrored, quarters, stated = _TURNS[orientation]

    def turned(pixels: NDArray[Any]) -> NDArray[Any]:
        return np.rot90(np.fliplr(pixels) if mirrored else pixels, quarters)

    missing = None if picture.missing is None else turned(picture.missing)
    note = why or f"the picture is {stated}, as its EXIF orientation {orientation} states"
    size = picture.pixel_size
    if size is not None and quarters % 2:
        size = size[::-1]
    return picture._replace(
        pixels=turned(picture.pixels), notes=(*picture.notes, note), missing=missing,
        pixel_size=size,
    )  # fmt: skip


def _read_pillow(path: Path) -> _Picture:
    with _opened(path) as image:
        frames = getattr(image, "n_frames", 1)
        notes = (f"the first of {frames} pictures in the file is read",) if frames > 1 else ()
        printed = printed_size(image.info.get("dpi"))
        image.load()
        orientation = _orientation(image)  # a TIFF is turned already, and states so now
        if image.mode in ("P", "PA"):
            pixels, notes = np.asarray(image.convert("RGB")), (*notes, "the palette is looked up")
        elif image.mode in _AS_STORED or image.mode.startswith("I;16"):
            pixels = np.asarray(image)
        else:
            if image.mode == "CMYK":
                notes = (*notes, "its inks (CMYK) are turned into red, green and blue")
            pixels = np.asarray(image.convert("L" if image.mode == "1" else "RGB"))
        clear = image.info.get("transparency")
        count = np.count_nonzero(pixels == clear) if pixels.ndim == 2 and clear is not None else 0
        if count:
            notes = (*notes, f"are its {count} clear pixels missing? nodata={clear}")
        pixels, white = as_stored(path, pixels)
        picture = _Picture(pixels, notes, printed_size=printed, white=white)
        picture = _with_gwyddion(path, picture, image.info)
    return _upright(picture, orientation)


def _with_gwyddion(path: Path, picture: _Picture, info: dict[Any, Any]) -> _Picture:
    """Return a picture with the pixel size and the heights that Gwyddion has written into it."""
    found = gwyddion_scale(path, info, picture.pixels)
    if found is None:
        return picture
    return _scaled(picture._replace(pixel_size=found[0]), found[1])


def _opened(path: Path) -> Any:
    """Return an image that Pillow opens, its pixels not yet read."""
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            image = Image.open(path)
        except Image.DecompressionBombError:
            raise SurfaceError(
                f"{path}: the image has too many pixels; valid: at most {MAX_SAMPLES}"
            ) from None
        except UnidentifiedImageError:
            raise SurfaceError(
                f"{path}: cannot be read as a {path.suffix.lower()} file: it holds no image "
                "of a known kind; valid: PNG, TIFF, JPEG, BMP and others"
            ) from None
    check_size(path, image.height, image.width)
    return image


def _orientation(image: Any) -> int:
    """Return the EXIF orientation of an image, 1 where it has none that can be read."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return int(image.getexif().get(_ORIENTATION, 1))
    except Exception:  # EXIF that is damaged states nothing
        return 1


def _read_tiff(path: Path, opened: BinaryIO) -> _Picture:
    with _open_tiff(opened) as file:
        return _tiff_page(path, file)._replace(preview=_PARK in file.pages[0].tags)


@contextmanager
def _open_tiff(opened: BinaryIO) -> Iterator[Any]:
    import tifffile

    log = logging.getLogger("tifffile")
    was, log.disabled = log.disabled, True  # of what it cannot parse; asperity parses that itself
    try:
        # Of a path it would first look for links, which takes as long as opening it.
        with tifffile.TiffFile(opened) as file:
            yield file
    finally:
        log.disabled = was


def _tiff_page(path: Path, file: Any) -> _Picture:
    """Return the first page of an open TIFF, its missing values found."""
    import tifffile

    page = next((page for page in file.pages if not page.is_reduced), file.pages[0])
    check_size(path, page.imagelength, page.imagewidth)
    notes: tuple[str, ...] = ()
    if len(file.pages) > 1:
        which = "the first" if page is file.pages[0] else "the first that is no preview"
        notes = (f"{which} of {len(file.pages)} pictures in the file is read",)
    kinds = tifffile.PHOTOMETRIC
    if page.photometric in (kinds.CIELAB, kinds.ICCLAB, kinds.ITULAB):
        raise SurfaceError(
            f"{path}: its colours are {page.photometric.name} (L*a*b*), whose lightness is no "
            "height; valid: grey, or red, green and blue"
        )
    if page.photometric in (kinds.SEPARATED, kinds.YCBCR):  # inks: Pillow makes colours of them
        return _without_nodata(_read_pillow(path)._replace(pixel_size=tiff_pixel_size(file)), page)
    try:
        pixels = page.asarray()
    except (ImportError, KeyError, ValueError) as error:
        # Some compressions need another package; Pillow reads them, but not with 16 bits.
        if "imagecodecs" not in str(error) and not isinstance(error, ImportError):
            raise
        if page.samplesperpixel > 1 and page.bitspersample > 8:
            raise SurfaceError(
                f"{path}: this compression of 16-bit colour needs a reader that is not "
                "installed; valid: pip install imagecodecs, or save it without compression"
            ) from None
        return _as_stated(_read_pillow(path), file, page)
    if page.photometric == kinds.PALETTE:
        pixels = np.moveaxis(page.colormap[:, pixels], 0, -1)
        notes = (*notes, "the palette is looked up")
    elif page.photometric == kinds.MINISWHITE and pixels.dtype.kind == "u":
        pixels = (2**page.bitspersample - 1 - pixels.astype(np.int64)).astype(pixels.dtype)
        notes = (*notes, "the file stores white as 0; read as its grey values")
    if page.samplesperpixel > 1 and page.planarconfig == tifffile.PLANARCONFIG.SEPARATE:
        pixels = np.moveaxis(pixels, 0, -1)
    orientation = page.tags.get(_ORIENTATION)
    turn = 1 if orientation is None else int(orientation.value)
    return _as_stated(_Picture(pixels, notes), file, page, turn)


def _as_stated(picture: _Picture, file: Any, page: Any, orientation: int = 1) -> _Picture:
    """Return the picture of a TIFF's page with its scale, what is missing, and upright."""
    picture = _without_nodata(picture._replace(pixel_size=tiff_pixel_size(file)), page)
    picture = _scaled(picture, value_scale(file))
    picture = picture._replace(printed_size=printed_size_of_tiff(page))
    if len(file.pages) > 1 and file.pages[1].is_mask and picture.missing is None:
        inside = file.pages[1].asarray()
        if inside.shape == picture.pixels.shape[:2]:
            clear = f"{np.count_nonzero(inside == 0)} pixels are missing, as the file's mask states"
            picture = picture._replace(missing=inside == 0, notes=(*picture.notes, clear))
    if is_south_up(file):
        return _upright(picture, 4, "its rows go northwards (GeoTIFF): the first is at the bottom")
    return _upright(picture, orientation)


def _scaled(picture: _Picture, stated: ValueScale | None) -> _Picture:
    """Return a grey picture with its values as its file states them, in the unit that it states."""
    if stated is None or picture.pixels.ndim != 2:
        return picture
    if (stated.factor, stated.offset) != (1.0, 0.0):
        note = f"values times {stated.factor:g} plus {stated.offset:g}, as the file states"
        values = picture.pixels.astype(np.float64) * stated.factor + stated.offset
        picture = picture._replace(pixels=values, notes=(*picture.notes, f"{note} ({stated.by})"))
    return picture._replace(unit=stated.unit, by=stated.by)


def _without_nodata(picture: _Picture, page: Any) -> _Picture:
    """Return a picture whose pixels of the value that GDAL's tag names are missing."""
    tag = page.tags.get(_NODATA)
    if tag is None:
        return picture
    text = tag.value.decode("ascii", "replace") if isinstance(tag.value, bytes) else str(tag.value)
    try:
        nodata = float(text.strip("\0 ").replace(",", "."))
    except ValueError:
        return picture._replace(notes=(*picture.notes, f"its nodata {text[:20]!r} is no number"))
    grey = picture.pixels if picture.pixels.ndim == 2 else picture.pixels[..., 0]
    # Written with fewer digits than the pixels have, the largest numbers differ in the last ones.
    close = 1e-5 * abs(nodata) if 1e30 < abs(nodata) < np.inf else 0.0
    with np.errstate(invalid="ignore"):
        stored = _as(grey.dtype, nodata)
        missing = (grey == stored) | (np.abs(grey.astype(np.float64) - stored) <= close)
    if not missing.any():
        return picture
    note = f"pixels of {nodata:g} are missing, as the file states (nodata)"
    return picture._replace(notes=(*picture.notes, note), missing=missing)


def _as(dtype: np.dtype[Any], number: float) -> float:
    """Return a number as pixels of a type hold it."""
    with np.errstate(over="ignore"):
        return float(np.array(number).astype(dtype)) if dtype.kind == "f" else number


def _read_exr(path: Path) -> _Picture:
    try:
        openexr = importlib.import_module("OpenEXR")
    except ImportError:
        raise SurfaceError(
            f"{path}: OpenEXR files need a reader that is not installed; "
            "valid: pip install OpenEXR, or convert the file to a 16-bit PNG or a float TIFF"
        ) from None
    low, high = openexr.File(str(path), header_only=True).header()["dataWindow"]
    check_size(path, *(int(n) + 1 for n in high - low))
    channels = openexr.File(str(path)).channels()
    for name in ("Y", "RGB", "RGBA", "Z"):
        if name in channels:
            return _Picture(channels[name].pixels)
    if len(channels) == 1:
        return _Picture(next(iter(channels.values())).pixels)
    raise SurfaceError(
        f"{path}: none of the channels {', '.join(channels)[:100]} is a height; valid: Y, Z, RGB "
        "or one"
    )
