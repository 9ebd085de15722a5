"""Grey values of image files at full bit depth, and smoothing of coarse grey levels.

Reading a height map like a picture fails silently in three ways: 16-bit colour and 16-bit
grey-alpha PNG are reduced to 8 bits, a palette file yields indices, and the 256 levels of an 8-bit
map remain as steps that a probe feels. Here 16 bits stay 16, palettes are applied, and
`smooth_levels` removes the steps within the file's rounding.
"""

from __future__ import annotations

import importlib
import struct
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.errors import SurfaceError

IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".exr")
MAX_SAMPLES = 2**27
"""Largest map that is read [samples]: 8192 x 16384, 1 GiB as heights."""

_LUMINANCE = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
_SMOOTHING_STEPS = 40
_PNG_COLOURS = {2: "RGB", 4: "LA", 6: "RGBA"}


class Stored(NamedTuple):
    """Contents of a file: values in metres, or grey levels without a scale."""

    values: NDArray[Any]
    notes: tuple[str, ...] = ()
    """Conversions of the file's values."""
    pixel_size: float | None = None
    """[m]"""
    in_metres: bool = True
    step: float = 0.0
    """Difference between neighbouring grey levels; 0 for values that are not quantised."""


def read_image(path: Path) -> Stored:
    """Return the grey values of the image file at `path`, row 0 at the bottom of the picture.

    Raises
    ------
    SurfaceError
        A file that is too large, or of a kind that cannot be read with all its bits.
    """
    pixels, notes = read_pixels(path)
    return _grey(np.flipud(pixels), notes)


def read_pixels(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return the pixels of an image at full bit depth, and notes.

    Returns
    -------
    pixels : (rows, columns) or (rows, columns, channels) array
        As stored, palettes applied, the first row at the top of the picture.
    notes : tuple of str
        Conversions made.
    """
    suffix = path.suffix.lower()
    if suffix == ".exr":
        return _read_exr(path)
    if suffix in (".tif", ".tiff"):
        return _read_tiff(path)
    with path.open("rb") as file:
        head = file.read(33)
    if head.startswith(b"\x89PNG") and len(head) == 33:
        columns, rows, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", head[16:29])
        if depth == 16 and colour in _PNG_COLOURS:
            check_size(path, rows, columns)
            return _png16(path, (columns, rows), _PNG_COLOURS[colour], interlaced), ()
    return _read_pillow(path)


def check_size(path: Path, *shape: int) -> None:
    """Raise `SurfaceError` if a map of `shape` is larger than `MAX_SAMPLES`."""
    if np.prod(shape, dtype=float) > MAX_SAMPLES:
        size = " x ".join(str(n) for n in shape)
        raise SurfaceError(
            f"{path}: {size} samples are too many; valid: at most {MAX_SAMPLES} (8192 x 16384)"
        )


def level_step(values: NDArray[Any]) -> float:
    """Return the difference between neighbouring grey levels of integer values.

    Values of 16 bits that are all multiples of 257 or of 256 are 8-bit values in a wider type.
    """
    if values.dtype.kind not in "ui":
        return 0.0
    if values.dtype.itemsize == 1:
        return 1.0
    return next((float(s) for s in (257, 256) if not (values % s).any()), 1.0)


def _grey(pixels: NDArray[Any], notes: tuple[str, ...]) -> Stored:
    """Return `pixels`, (rows, columns) or (rows, columns, channels), as grey values."""
    if pixels.ndim == 3 and pixels.shape[2] in (2, 4):
        pixels, notes = pixels[..., :-1], (*notes, "the alpha channel is ignored")
    if pixels.ndim == 3 and pixels.shape[2] == 3:
        if (pixels == pixels[..., :1]).all():
            pixels = pixels[..., :1]
        else:
            _refuse_normal_map(pixels)
            notes = (*notes, "colour is read as its luminance (ITU-R BT.601)")
            step = 1.0 if pixels.dtype.kind in "ui" else 0.0
            luminance = pixels.astype(np.float64) @ _LUMINANCE
            return Stored(luminance, notes, in_metres=False, step=step)
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim != 2:
        raise ValueError(f"pixels of shape {pixels.shape} are neither grey nor colour")
    step = level_step(pixels)
    return Stored(pixels.astype(np.float64), notes, in_metres=False, step=step)


def unit_vectors(pixels: NDArray[Any]) -> tuple[Array, bool]:
    """Return colours as vectors, -1 to 1, and whether they are unit normals with blue along z.

    Integers are scaled from 0 to the largest of their type, floats from 0 to 1, or unscaled if some
    are negative.
    """
    if pixels.dtype.kind == "u":
        vectors = pixels[..., :3] * (2.0 / np.iinfo(pixels.dtype).max) - 1.0
    else:
        vectors = pixels[..., :3].astype(np.float64)
        if vectors.min() >= 0.0:
            vectors = 2.0 * vectors - 1.0
    off_unit = np.abs(np.linalg.norm(vectors, axis=2) - 1.0).mean()
    return vectors, bool(off_unit < 0.05 and vectors[..., 2].mean() > 0.5)


def _refuse_normal_map(pixels: NDArray[Any]) -> None:
    """Raise if the colours are unit vectors: the image is a normal map, not a height map."""
    if pixels.dtype.kind == "u" and unit_vectors(pixels)[1]:
        raise ValueError(
            "its colours are unit vectors: a normal map; valid: a map of heights, or "
            "HeightField.from_file with kind='normal-opengl' (green up) or 'normal-directx'"
        )


def _png16(path: Path, size: tuple[int, int], mode: str, interlaced: int) -> NDArray[np.uint16]:
    """Return the pixels of a 16-bit PNG of several channels.

    Pillow opens these files with 8 bits a channel. Its zip decoder yields all bits in two passes,
    for the upper and for the lower byte, or, with two channels, when the four bytes of a pixel are
    declared as RGBA.
    """
    from PIL import Image

    content, place, stream = path.read_bytes(), 8, []
    while place + 8 <= len(content):
        length, name = struct.unpack(">I4s", content[place : place + 8])
        if name == b"IDAT":
            stream.append(content[place + 8 : place + 8 + length])
        place += length + 12
    data = b"".join(stream)

    def decoded(as_mode: str, layout: str) -> NDArray[np.uint16]:
        image = Image.frombytes(as_mode, size, data, "zip", layout, interlaced)
        return np.asarray(image).astype(np.uint16)

    if mode == "LA":
        pixels = decoded("RGBA", "RGBA")
        return pixels[..., 0::2] * np.uint16(256) + pixels[..., 1::2]
    return decoded(mode, f"{mode};16B") * np.uint16(256) + decoded(mode, f"{mode};16L")


def _read_pillow(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
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
    with image:
        check_size(path, image.height, image.width)
        notes: tuple[str, ...] = ()
        frames = getattr(image, "n_frames", 1)
        if frames > 1:
            notes = (f"the first of {frames} pictures in the file is read",)
        if image.mode == "1":
            return np.asarray(image.convert("L")), notes
        if image.mode in ("P", "PA"):
            return np.asarray(image.convert("RGB")), (*notes, "the palette is looked up")
        if image.mode in ("L", "LA", "RGB", "RGBA", "I", "F") or image.mode.startswith("I;16"):
            return np.asarray(image), notes
        return np.asarray(image.convert("RGB")), notes


def _read_tiff(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        check_size(path, page.imagelength, page.imagewidth)
        notes: tuple[str, ...] = ()
        if len(file.pages) > 1:
            notes = (f"the first of {len(file.pages)} pictures in the file is read",)
        try:
            pixels = page.asarray()
        except ValueError as error:
            # Some compressions need another package; Pillow reads them, but not with 16 bits.
            if "imagecodecs" not in str(error):
                raise
            if page.samplesperpixel > 1 and page.bitspersample > 8:
                raise SurfaceError(
                    f"{path}: this compression of 16-bit colour needs a reader that is not "
                    "installed; valid: pip install imagecodecs, or save it without compression"
                ) from None
            return _read_pillow(path)
        if page.photometric == tifffile.PHOTOMETRIC.PALETTE:
            pixels = np.moveaxis(page.colormap[:, pixels], 0, -1)
            notes = (*notes, "the palette is looked up")
        elif page.photometric == tifffile.PHOTOMETRIC.MINISWHITE and pixels.dtype.kind == "u":
            pixels = (2**page.bitspersample - 1 - pixels.astype(np.int64)).astype(pixels.dtype)
            notes = (*notes, "the file stores white as 0; read as its grey values")
        if page.samplesperpixel > 1 and page.planarconfig == tifffile.PLANARCONFIG.SEPARATE:
            pixels = np.moveaxis(pixels, 0, -1)
    return pixels, notes


def _read_exr(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
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
            return channels[name].pixels, ()
    if len(channels) == 1:
        return next(iter(channels.values())).pixels, ()
    raise SurfaceError(
        f"{path}: none of the channels {', '.join(channels)} is a height; valid: Y, Z, RGB or one"
    )


def smooth_levels(values: Array, step: float) -> Array:
    r"""Return the smoothest surface that rounds to the same grey levels as `values`.

    Rounding to levels turns a slope into a staircase, and a cubic spline follows every step. Of all
    surfaces within half a level of the file this is the one of least curvature,

        minimise  sum (laplacian h)^2    with  |h - values| <= step / 2,

    by 40 steps of the accelerated projected gradient method. So no height changes by more than half
    a level, and edges are preserved. On waves 25 to 250 samples long that fill 8 bits, the noise in
    the slope falls by 8 to 15 dB; on surfaces whose detail is only a few samples wide it rises by 1
    to 2 dB: keep the levels of those.

    Parameters
    ----------
    values : (n,) or (nv, nu) array
        Grey values.
    step : float
        Difference between neighbouring levels, above 0.

    References
    ----------
    Beck & Teboulle (2009), SIAM J. Imaging Sciences 2, 183-202 (the method, FISTA).
    """
    levels = np.atleast_2d(values / step)
    smooth = _least_curvature(levels, 16.0 if values.ndim == 1 else 64.0, _SMOOTHING_STEPS)
    return (smooth * step).reshape(values.shape)


@kernel
def _laplacian(h: Array, laplacian_out: Array) -> None:
    """Return the five-point Laplacian of `h`, mirrored at its borders."""
    rows, columns = h.shape
    for i in range(rows):
        above, below = max(i - 1, 0), min(i + 1, rows - 1)
        for j in range(columns):
            left, right = max(j - 1, 0), min(j + 1, columns - 1)
            around = h[above, j] + h[below, j] + h[i, left] + h[i, right]
            laplacian_out[i, j] = around - 4.0 * h[i, j]


@kernel
def _least_curvature(levels: Array, lipschitz: float, steps: int) -> Array:
    """Minimise the squared Laplacian within half a level of `levels`."""
    best, ahead = levels.copy(), levels.copy()
    first, second = np.empty_like(levels), np.empty_like(levels)
    inertia = 1.0
    for _ in range(steps):
        _laplacian(ahead, first)
        _laplacian(first, second)
        inertia_next = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * inertia * inertia))
        push = (inertia - 1.0) / inertia_next
        for i in range(levels.shape[0]):
            for j in range(levels.shape[1]):
                moved = ahead[i, j] - second[i, j] / lipschitz
                moved = min(max(moved, levels[i, j] - 0.5), levels[i, j] + 0.5)
                ahead[i, j] = moved + push * (moved - best[i, j])
                best[i, j] = moved
        inertia = inertia_next
    return best
