r"""Heights from normal maps.

A normal map stores, for every pixel, the unit normal of a surface as a colour. Its slopes are
`h_u = -n_u / n_z` and `h_v = -n_v / n_z`; the heights are those whose slopes fit them best in the
least-squares sense. So the vertical scale follows from the pixel size: unlike an image of heights,
a normal map contains the ratio of the two.

*Wrap.* Each wave of the heights follows from the same wave of both slopes (Frankot & Chellappa
1988), exactly where the slopes are those of a periodic surface.

*Clamp.* The rise from a sample to the next is the integral of the slope, from the cubic spline
through the slopes (exact for slopes of the third degree; the mean of two neighbours would lose 5 %
of a wave of 8 pixels). The heights that fit all rises best solve Poisson's equation with free
borders, which the cosine transform diagonalises (Simchony, Chellappa & Shao 1990).

A normal map does not contain the mean height, nor steps so steep that they fall between two pixels.
Its mean slope is attributed to a tilt of the camera or of the base and removed.

References
----------
Frankot & Chellappa (1988), "A method for enforcing integrability in shape from shading algorithms",
IEEE Trans. Pattern Anal. Mach. Intell. 10, 439-451.
Simchony, Chellappa & Shao (1990), "Direct analytical methods for solving Poisson equations in
computer vision problems", IEEE Trans. Pattern Anal. Mach. Intell. 12, 435-446.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, interpolate

from asperity._core.arrays import Array
from asperity._core.files import reading
from asperity.errors import AsperityError, SurfaceError, require_choice, require_positive
from asperity.texture.files.checks import checked_pixel_size
from asperity.texture.files.doubts import doubts
from asperity.texture.files.images import IMAGE_SUFFIXES, read_pixels
from asperity.texture.files.normal_channels import curl_agreement, normal_vectors
from asperity.texture.files.reading import Heights
from asperity.texture.files.stored import refuse

_GREEN = {"opengl": "up", "directx": "down"}
_IN_NAME = re.compile(
    r"(?:[\W_](?:(o?gl|opengl)|dx|directx)|(?<=[a-z])(?-i:(?:(O?GL|OpenGL)|DX|DirectX)))(?=[\W_\d]|$)",
    re.IGNORECASE,
)
CONVENTIONS = ("opengl", "directx", "auto")
STEEPEST = 20.0
"""Normals with a larger slope (87 degrees), or that point down, are limited to it."""
_TILT = 1e-3
_LEANING = 0.2
"""Mean slope from which it is doubted that colours are normals."""
_SURE = 0.15
"""Agreement of the cross slopes from which the map itself states where green points."""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of damaged numbers
def read_normal_map(
    path: str | os.PathLike[str],
    *,
    pixel_size: float | Sequence[float] | None = None,
    convention: str = "auto",
    border: str = "clamp",
    height_range: float | None = None,
    invert: bool = False,
) -> Heights:
    """Return the heights of the surface whose normals an image contains.

    Parameters
    ----------
    path : str or path
        A colour image of 8 or 16 bits, or of floats (PNG, TIFF, JPEG, OpenEXR): red along u, blue
        along the base's normal. Two channels (BC5) and red in alpha (DXT5) are recognised.
    pixel_size : float or (pu, pv)
        Distance between samples [m], above 0. The heights are proportional to it.
    convention : {"auto", "opengl", "directx"}
        Green points up the picture ("opengl"), or down ("directx"): the wrong one inverts hills and
        valleys along v. The slopes of a surface have no curl, so the map shows by itself which it
        is ("auto"), unless it varies along one axis only; a note states when it does not tell, or
        contradicts what is given.
    border : {"clamp", "wrap"}
        Whether the surface ends at the borders or repeats.
    height_range : float, optional
        Height from the lowest to the highest sample [m], to which the heights are scaled.
    invert : bool
        Exchanges hills and valleys.

    Returns
    -------
    Heights
        `(samples, pixel_size, notes)`, of zero mean, row 0 at v = 0.

    Raises
    ------
    SurfaceError
        A file that is no normal map, or cannot be read; one line.
    """
    path = Path(os.path.expanduser(path))
    require_choice("convention", convention, CONVENTIONS)
    require_choice("border", border, ("clamp", "wrap"))
    if pixel_size is None:
        refuse(path, "a normal map does not hold its scale; choose a value for pixel_size [m]")
    try:
        pu, pv = (require_positive("pixel_size", p, "[m]") for p in _pair(pixel_size))
        if height_range is not None:
            require_positive("height_range", height_range, "[m]")
    except AsperityError as error:
        refuse(path, str(error))
    vectors, notes = _read_vectors(path)
    convention = _convention(vectors, convention, path.stem, notes)
    h_u, h_v = _slopes(vectors, convention, notes)
    notes.append(f"integrated from normals, green {_GREEN[convention]} the picture ({convention})")
    samples = integrate_slopes(h_u, h_v, (pu, pv), border=border)
    tilt = float(np.hypot(h_u.mean(), h_v.mean()))
    if tilt > _TILT:
        doubt = ": is it a normal map?" if tilt > _LEANING else ""
        notes.append(f"a mean slope of {tilt:.3g} is taken for a tilt and left out{doubt}")
    relief = float(np.ptp(samples))
    if height_range is not None and relief > 0.0:
        notes.append(
            f"height range {height_range * 1e6:.6g} um, as given; "
            f"the normals and the pixel size give {relief * 1e6:.6g} um"
        )
        samples = samples * (height_range / relief)
    elif relief > 0.0:
        notes.append(f"height range {relief * 1e6:.6g} um: from the normals and the pixel size")
    notes += doubts(samples, (pu, pv), float(np.ptp(samples)))
    return Heights(-samples if invert else samples, pu if pu == pv else (pu, pv), tuple(notes))


def _pair(pixel_size: float | Sequence[float]) -> tuple[Any, Any]:
    given = pixel_size if isinstance(pixel_size, Sequence) else (pixel_size, pixel_size)
    if len(given) != 2:
        raise AsperityError(f"pixel_size must be one number or two, got {pixel_size!r}")
    return given[0], given[1]


def _convention(vectors: Array, given: str, name: str, notes: list[str]) -> str:
    """Return whether green points up or down, and note how sure that is.

    As the map's curl shows, else as the last part of the file's name states (`wood_nor_dx`).
    """
    agreement = curl_agreement(vectors)
    found = "opengl" if agreement >= 0.0 else "directx"
    sure = abs(agreement) > _SURE
    if given == "auto":
        if sure:
            notes.append(f"green points {_GREEN[found]}, found from the map's own curl")
            return found
        stated = _IN_NAME.search(name)
        if stated:
            found = "opengl" if any(stated.groups()) else "directx"
            notes.append(f"green points {_GREEN[found]}, as the file's name states: the map does "
                         "not tell")  # fmt: skip
            return found
        notes.append(
            "does green point up? The map does not tell; opengl is taken, hills and valleys along "
            "v are inverted if that is wrong: kind='normal-opengl' or 'normal-directx'"
        )
        return "opengl"
    if sure and found != given:
        notes.append(
            f"does green point {_GREEN[given]}? The map's own curl states {_GREEN[found]}: "
            f"kind='normal-{found}'"
        )
    return given


def integrate_slopes(
    h_u: ArrayLike, h_v: ArrayLike, pixel_size: float | Sequence[float], *, border: str = "clamp"
) -> Array:
    """Return the heights whose slopes fit best, by least squares.

    Parameters
    ----------
    h_u, h_v : (nv, nu) array
        Slopes at the samples, finite; 4 samples or more along each axis. Their means are removed.
    pixel_size : float or (pu, pv)
        Distance between samples [m].
    border : {"clamp", "wrap"}
        Whether the surface ends at the borders or repeats.

    Returns
    -------
    (nv, nu) array
        Heights [m] of zero mean.
    """
    require_choice("border", border, ("clamp", "wrap"))
    pixel = checked_pixel_size(pixel_size)
    slopes = [np.asarray(slope, dtype=np.float64) for slope in (h_u, h_v)]
    shape = slopes[0].shape
    if len(shape) != 2 or slopes[1].shape != shape or min(shape) < 4:
        raise SurfaceError(
            "slopes must be two maps of one shape, 4 samples or more along each axis, got "
            f"{shape} and {slopes[1].shape}"
        )
    bad = sum(int(np.count_nonzero(~np.isfinite(slope))) for slope in slopes)
    if bad:
        raise SurfaceError(f"{bad} slopes are NaN or infinite; fill them first")
    if np.ptp(slopes[0]) == np.ptp(slopes[1]) == 0.0:
        return np.zeros(shape)
    level_u, level_v = (slope - slope.mean() for slope in slopes)
    return (_repeating if border == "wrap" else _ending)(level_u, level_v, pixel)


def _repeating(h_u: Array, h_v: Array, pixel: tuple[float, float]) -> Array:
    """Return the heights wave by wave: h = -i (k_u h_u + k_v h_v) / k^2."""
    rows, columns = h_u.shape
    k_u = 2.0 * np.pi * np.fft.rfftfreq(columns, pixel[0])[None, :]
    k_v = 2.0 * np.pi * np.fft.fftfreq(rows, pixel[1])[:, None]
    # The slope of the shortest wave is zero at every sample and does not determine its height.
    if columns % 2 == 0:
        k_u[0, -1] = 0.0
    if rows % 2 == 0:
        k_v[rows // 2] = 0.0
    square = k_u**2 + k_v**2
    square[square == 0.0] = np.inf
    waves = -1j * (k_u * fft.rfft2(h_u) + k_v * fft.rfft2(h_v)) / square
    return fft.irfft2(waves, s=h_u.shape)


def _ending(h_u: Array, h_v: Array, pixel: tuple[float, float]) -> Array:
    """Solve Poisson's equation for the rises between samples by the cosine transform."""
    rows, columns = h_u.shape
    source = np.zeros(h_u.shape)
    rises = _rises(h_u, 1) / pixel[0]  # divided by the squared pixel, as the Laplacian below
    source[:, :-1] += rises
    source[:, 1:] -= rises
    rises = _rises(h_v, 0) / pixel[1]
    source[:-1] += rises
    source[1:] -= rises
    along_u = (2.0 * np.sin(0.5 * np.pi * np.arange(columns) / columns) / pixel[0]) ** 2
    along_v = (2.0 * np.sin(0.5 * np.pi * np.arange(rows) / rows) / pixel[1]) ** 2
    laplacian = -(along_v[:, None] + along_u[None, :])
    laplacian[0, 0] = -np.inf
    return fft.idctn(fft.dctn(source) / laplacian)


def _rises(slopes: Array, axis: int) -> Array:
    """Return the rise from each sample to the next along `axis`, in pixel sizes."""
    integral = interpolate.CubicSpline(np.arange(slopes.shape[axis]), slopes, axis).antiderivative()
    return np.diff(integral(np.arange(slopes.shape[axis])), axis=axis)


def _read_vectors(path: Path) -> tuple[Array, list[str]]:
    """Return the vectors of a normal map, the bottom of the picture first, and notes."""
    valid = f"a colour image ({', '.join(IMAGE_SUFFIXES)})"
    with reading(path, "normals", IMAGE_SUFFIXES, valid=valid, error=SurfaceError):
        pixels, notes = read_pixels(path)
        vectors, note = _checked_vectors(path, np.flipud(pixels))
        return vectors, [*notes, note] if note else list(notes)


def _checked_vectors(path: Path, pixels: NDArray[Any]) -> tuple[Array, str]:
    if pixels.ndim != 3 or pixels.shape[2] not in (2, 3, 4):
        refuse(path, "it has no colours; valid: a normal map, or kind='height'")
    if min(pixels.shape[:2]) < 4:
        refuse(path, f"{pixels.shape[:2]} pixels; valid: 4 or more along each axis")
    if pixels.dtype.kind == "f" and not np.isfinite(pixels[..., :3]).all():
        refuse(path, "some of its normals are NaN or infinite; valid: finite ones")
    vectors, note = normal_vectors(pixels)
    if note == "-":
        refuse(path, "its colours are no unit vectors, blue along the normal; valid: a normal map")
    return vectors, note


def _slopes(vectors: Array, convention: str, notes: list[str]) -> tuple[Array, Array]:
    """Return the slopes along u and v; normals limited to `STEEPEST` are counted in a note."""
    across = np.hypot(vectors[..., 0], vectors[..., 1])
    along = vectors[..., 2]
    leaning = int(np.count_nonzero(across > STEEPEST * along))
    if leaning:
        notes.append(
            f"{leaning} of {along.size} normals lean further than a slope of {STEEPEST:g}, or "
            "point down, and are set to it"
        )
    up = 1.0 if convention == "opengl" else -1.0
    # A normal that points straight down has no slope direction; its slope is set to 0.
    along = np.maximum(np.maximum(along, across / STEEPEST), 1e-6)
    return -vectors[..., 0] / along, -up * vectors[..., 1] / along
