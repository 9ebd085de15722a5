"""Height maps as smooth surfaces with a physical size, borders, and exact derivatives.

Samples alone define nothing between and beyond them; a `HeightField` does. Between the samples it
is the interpolating cubic B-spline (`asperity.texture.spline`), twice continuously differentiable;
beyond its borders the map repeats ("wrap") or continues at the height of its border ("clamp"). The
clamped spline is that of the mirrored map, whose slope across the border is zero, so the surface
outside continues with continuous slope.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.errors import SurfaceError, require_choice, require_finite, require_positive
from asperity.texture.files.checks import (
    check_steepness,
    checked_pixel_size,
    checked_places,
    checked_samples,
)
from asperity.texture.sampled_map import BORDERS, SampledMap
from asperity.texture.spectrum import Spectrum
from asperity.texture.spline import evaluate_2d, spline_coefficients

KINDS = ("height", "normal", "normal-opengl", "normal-directx")
_OF_HEIGHTS = ("refuse", None, "smooth", None, None, None)
"""Defaults of the options that normal maps do not have."""
_ROLL_OFF = 1.25
_SEAM = 3.0


class Derivatives(NamedTuple):
    """A surface and its derivatives: `h` [m], slopes [1], second derivatives [1/m]."""

    h: Array
    h_u: Array
    h_v: Array
    h_uu: Array
    h_uv: Array
    h_vv: Array


@dataclass(frozen=True, eq=False, init=False)
class HeightField(SampledMap):
    """Heights over a plane, as a smooth surface.

    Parameters
    ----------
    samples : (nv, nu) array
        Heights [m] at `(i + 1/2) * pixel_size`, row 0 at v = 0; at least 4 samples along each axis,
        at most 2**27 in all, finite, within 10 m of 0, with slopes of at most 100 between
        neighbours. A read-only copy is kept.
    pixel_size : float or (pu, pv)
        Distance between samples along u and v [m], 1e-9 to 1; stored as a pair.
    border : {"clamp", "wrap"}
        Beyond its borders the surface continues at the height of its border, or repeats.
    notes : tuple of str
        Choices and changes made on the way here, one line each, to be shown to the user.

    Raises
    ------
    SurfaceError
        Invalid samples, pixel size or border; one line.
    """

    def __init__(
        self,
        samples: ArrayLike,
        pixel_size: float | Sequence[float],
        border: str = "clamp",
        notes: Sequence[str] = (),
    ) -> None:
        super().__init__(checked_samples(samples), checked_pixel_size(pixel_size), border, notes)
        check_steepness(self.samples, self.pixel_size, border)

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        pixel_size: float | Sequence[float] | None = None,
        size: Sequence[float] | None = None,
        height_range: float | None = None,
        border: str = "clamp",
        invert: bool = False,
        missing: str = "refuse",
        array: str | None = None,
        quantised: str = "smooth",
        kind: str = "height",
        unit: str | None = None,
        colour: str | None = None,
        nodata: float | None = None,
    ) -> HeightField:
        """Return the height field in a file.

        Parameters
        ----------
        path : str or path
            An image, an array, text or an instrument's file: see
            `asperity.texture.files.reading.read_heights`. A single line of heights becomes a
            surface that is constant along v.
        pixel_size, height_range, invert, missing, array, quantised, unit, colour, nodata
            As for `read_heights`. A normal map needs only `pixel_size`: its heights follow from its
            slopes, unless `height_range` is given.
        size : (lu, lv), optional
            Size of the whole map [m], instead of `pixel_size`; its pixels need not be square. For
            UV mapping this is the size on the body of the unit square of texture coordinates. Not
            for normal maps.
        border : {"clamp", "wrap"}
            See `HeightField`. A map that does not tile gets a step at the seam if wrapped; a note
            gives its height.
        kind : {"height", "normal", "normal-opengl", "normal-directx"}
            Contents of the file: heights, or normals, green up or down as the map itself shows, up,
            or down (`asperity.texture.files.normal_maps.read_normal_map`).

        Raises
        ------
        SurfaceError
            A file that cannot be used; one line that names the file and what is valid.
        """
        # Here, so that an edit of a reader leaves the machine code of kernels valid.
        from asperity.texture.files.doubts import DOUBT, doubts
        from asperity.texture.files.reading import read_heights

        require_choice("border", border, BORDERS)
        require_choice("kind", kind, KINDS)
        if size is not None:
            size = require_finite("size", size, 2)
            for length in size:
                require_positive("size", length, "[m]")
            if pixel_size is not None or kind != "height":
                raise SurfaceError(f"{path}: size goes with a height map, and without pixel_size")
            pixel_size = size[0]  # until the number of samples is known
        scale: dict[str, Any] = {"pixel_size": pixel_size, "height_range": height_range}
        scale["invert"] = invert
        if kind == "height":
            found = read_heights(
                path, **scale, missing=missing, array=array, quantised=quantised, unit=unit,
                colour=colour, nodata=nodata,
            )  # fmt: skip
        elif (missing, array, quantised, unit, colour, nodata) != _OF_HEIGHTS:
            raise SurfaceError(
                f"{path}: missing=, array=, quantised=, unit=, colour= and nodata= are for maps of "
                f"heights; leave them out with kind={kind!r}"
            )
        else:
            from asperity.texture.files.normal_maps import read_normal_map

            convention = "auto" if kind == "normal" else kind.removeprefix("normal-")
            found = read_normal_map(path, convention=convention, border=border, **scale)
        samples, notes = _as_map(found.samples, found.notes)
        if border == "wrap":
            notes = (*notes, *_seam_notes(samples))
        pixels: float | tuple[float, float] = found.pixel_size
        if size is not None:
            pixels = (size[0] / samples.shape[1], size[1] / samples.shape[0])
            taken = ("pixel size", DOUBT)
            notes = tuple(note for note in notes if not note.startswith(taken))
            notes = (*notes, *doubts(samples, pixels, float(np.ptp(samples))))
        try:
            return cls(samples, pixels, border, notes)
        except SurfaceError as error:
            raise SurfaceError(f"{path}: {error}") from None

    @property
    def relief(self) -> float:
        """Height from the lowest to the highest sample [m]."""
        return self.highest - self.lowest

    @cached_property
    def rms(self) -> float:
        """Root mean square of the samples' heights about their mean [m]."""
        return 0.0 if self.relief == 0.0 else float(self.samples.std())

    @cached_property
    def coefficients(self) -> Array:
        """B-spline coefficients [m], (nv + 4, nu + 4): see `spline_coefficients`."""
        if self.relief == 0.0:  # exactly constant, whatever the filter's rounding
            return np.full([n + 4 for n in self.samples.shape], self.lowest)
        border = "wrap" if self.border == "wrap" else "mirror"
        return np.ascontiguousarray(spline_coefficients(self.samples, border))

    @cached_property
    def shortest_wavelength(self) -> float:
        """Shortest wavelength present [m]; infinite for a constant map.

        Shorter waves contribute at most 0.1 % of the variance of the slope. The waves are those of
        the samples over a period ("wrap") or over the mirrored map ("clamp").
        """
        return self._spectrum().shortest() if self._is_rough else math.inf

    def _spectrum(self) -> Spectrum:
        return Spectrum.of(self.samples, self.pixel_size, wraps=self.border == "wrap")

    @property
    def _is_rough(self) -> bool:
        """Whether the relief exceeds the rounding of the heights."""
        return self.relief > max(1e-30, 1e-13 * max(abs(self.lowest), abs(self.highest)))

    def heights(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the heights [m] at positions `u`, `v` [m], which are broadcast."""
        return self.derivatives(u, v).h

    def derivatives(self, u: ArrayLike, v: ArrayLike) -> Derivatives:
        """Return the surface and its exact first and second derivatives.

        Parameters
        ----------
        u, v : array_like
            Positions [m], within 1e6 m of 0, broadcast against each other. Outside a clamped map
            the derivatives across the border are zero.

        Returns
        -------
        Derivatives
            `(h, h_u, h_v, h_uu, h_uv, h_vv)`, each of the broadcast shape.
        """
        us, vs = np.broadcast_arrays(checked_places("u", u), checked_places("v", v))
        out = np.zeros((6, us.size))
        if self.relief == 0.0:
            out[0] = self.lowest
        else:
            wraps = self.border == "wrap"
            _evaluate(self.coefficients, us.ravel(), vs.ravel(), *self.pixel_size, wraps, out)
        return Derivatives(*(row.reshape(us.shape)[()] for row in out))

    def low_passed(self, shortest: float) -> HeightField:
        """Return the surface without its waves shorter than `shortest`.

        Waves longer than 1.25 times `shortest` are unchanged; in between they are attenuated by a
        raised cosine of the wavenumber, which limits ringing at edges.

        Parameters
        ----------
        shortest : float
            Wavelength [m], above 0; in all directions.
        """
        require_positive("shortest", shortest, "[m]")
        spectrum = self._spectrum()
        end = 1.0 / shortest
        fade = np.clip((end - spectrum.wavenumbers) / (end - end / _ROLL_OFF), 0.0, 1.0)
        kept = 0.5 - 0.5 * np.cos(math.pi * fade)
        if not self._is_rough or kept.min() == 1.0:
            return self
        slope = spectrum.slope_power
        lost = max(0.0, 1.0 - math.sqrt(np.sum(slope * kept**2) / np.sum(slope)))
        note = (
            f"low-passed: waves shorter than {shortest * 1e6:.4g} um are taken out, "
            f"and {100 * lost:.2g} % of the rms slope with them"
        )
        if np.count_nonzero(kept) == 1:
            samples = np.full(self.samples.shape, self.samples.mean())
        else:
            samples = spectrum.heights(kept)
        return HeightField(samples, self.pixel_size, self.border, (*self.notes, note))


@kernel
def _evaluate(
    coefficients: Array, u: Array, v: Array, pu: float, pv: float, wraps: bool, out: Array
) -> None:
    """Fill `out`, (6, n), with the surface and its derivatives at `u`, `v` [m]."""
    rows, columns = coefficients.shape[0] - 4, coefficients.shape[1] - 4
    for i in range(u.size):
        x, y = u[i] / pu, v[i] / pv
        inside_u = wraps or 0.0 <= x <= columns
        inside_v = wraps or 0.0 <= y <= rows
        if wraps:
            x -= math.floor(x / columns) * columns
            y -= math.floor(y / rows) * rows
        # Rounding may leave a wrapped position slightly outside.
        x, y = min(max(x, 0.0), columns), min(max(y, 0.0), rows)
        column, row = int(x + 0.5), int(y + 0.5)
        h, h_u, h_v, h_uu, h_uv, h_vv = evaluate_2d(
            coefficients, row, column, y + 0.5 - row, x + 0.5 - column
        )
        out[0, i] = h
        if inside_u:
            out[1, i], out[3, i] = h_u / pu, h_uu / (pu * pu)
        if inside_v:
            out[2, i], out[5, i] = h_v / pv, h_vv / (pv * pv)
        if inside_u and inside_v:
            out[4, i] = h_uv / (pu * pv)


def _as_map(samples: Array, notes: tuple[str, ...]) -> tuple[Array, tuple[str, ...]]:
    """Return a line of heights as a map that is constant along v."""
    if samples.ndim == 2 and min(samples.shape) > 1:
        return samples, notes
    note = "a single line of heights: the surface is the same all along v"
    return np.tile(samples.ravel(), (4, 1)), (*notes, note)


def _seam_notes(samples: Array) -> list[str]:
    """Return a note for each axis along which the map does not tile."""
    notes = []
    for axis, name in enumerate("vu"):
        inside = np.sqrt(np.mean(np.diff(samples, axis=axis) ** 2))
        seam = np.sqrt(np.mean((np.take(samples, 0, axis) - np.take(samples, -1, axis)) ** 2))
        if seam > _SEAM * inside:
            notes.append(
                f"the map does not tile along {name}: a step of {seam * 1e6:.3g} um (rms) "
                "at the seam"
            )
    return notes
