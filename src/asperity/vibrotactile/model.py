"""A texture as vibration: filters over force and speed, driven by white noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError, require_not_negative, require_positive
from asperity.vibrotactile.lsf import are_stable, coefficients_of
from asperity.vibrotactile.triangles import Triangulation, triangulated, weigh

MOST_MODELS = 5000
HIGHEST_ORDER = 128


class Filter(NamedTuple):
    r"""One filter: `y_n = -sum a_i y_(n-i) + e_n + sum b_i e_(n-i)`, e white of a variance."""

    ar: Array
    """(p + 1,), the first 1."""
    ma: Array
    """(q + 1,): the gain, and the gain times `b`; (1,) holding 1 where there is no such part."""
    variance: float
    """Of the excitation [m^2/s^4]."""

    def density(self, frequencies: Array, rate: float) -> Array:
        """Return the one-sided power spectral density [m^2/s^4/Hz] at frequencies [Hz]."""
        z = np.exp(-2j * np.pi * np.asarray(frequencies) / rate)
        over = np.abs(np.polyval(self.ma[::-1], z)) ** 2
        under = np.abs(np.polyval(self.ar[::-1], z)) ** 2
        return np.asarray(2.0 * self.variance / rate * over / under)


@dataclass(frozen=True, eq=False)
class TextureModel:
    """Vibration of a tool on a texture, for any speed and normal force (Culbertson et al. 2014).

    Noise of a spectrum. It loses what repeats over distance: between speeds, the mix of two line
    spectra is none, and its power is not that of either. `HarmonicModel` keeps both.

    Parameters
    ----------
    name : str
    rate : float
        At which the filters run [Hz].
    speeds, forces : (n,) arrays
        Of the tool along the surface [m/s], and onto it [N].
    ar : (n, p) array
        Line spectral frequencies of each model's filter [rad per sample], see `lsf`.
    variance : (n,) array
        Of the white noise that drives it [m^2/s^4].
    ma : (n, q) array, optional
        Line spectral frequencies of the moving-average part; q may be 0.
    gain : (n,) array, optional
        Of that part.
    friction : float
        Kinetic coefficient.
    triangles : (m, 3) array of int, optional
        Models at the corners of each triangle, counted from 0. Default: Delaunay's.

    Notes
    -----
    Between models, frequencies, variance and gain are mixed barycentrically in the triangle that
    the place lies in. Beyond all triangles the nearest place on their rim counts.
    """

    name: str
    rate: float
    speeds: Array
    forces: Array
    ar: Array
    variance: Array
    ma: Array = field(default_factory=lambda: np.empty((0, 0)))
    gain: Array = field(default_factory=lambda: np.empty(0))
    friction: float = 0.0
    triangles: Indices | None = None
    mesh: Triangulation = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.speeds))
        if not 3 <= n <= MOST_MODELS:
            raise AsperityError(f"a texture model needs 3 to {MOST_MODELS} models, got {n}")
        ma = np.zeros((n, 0)) if np.size(self.ma) == 0 else self.ma
        gain = np.ones(n) if np.size(self.gain) == 0 else self.gain
        arrays = {
            "speeds": self.speeds, "forces": self.forces, "variance": self.variance,
            "gain": gain, "ar": self.ar, "ma": ma,
        }  # fmt: skip
        for name, values in arrays.items():
            array = np.ascontiguousarray(values, dtype=np.float64)
            if array.shape[:1] != (n,) or array.ndim != (2 if name in ("ar", "ma") else 1):
                raise AsperityError(f"{name} of {n} models has the wrong shape {array.shape}")
            if not np.isfinite(array).all():
                raise AsperityError(f"{name} of a texture model must be finite numbers")
            object.__setattr__(self, name, array)
        require_positive("rate of a texture model", self.rate, "Hz")
        require_not_negative("friction of a texture model", self.friction)
        self._check()
        triangles = self.triangles
        if triangles is not None:
            triangles = np.ascontiguousarray(triangles, dtype=np.int64).reshape(-1, 3)
        mesh = triangulated(self.speeds, self.forces, triangles)
        object.__setattr__(self, "mesh", mesh)
        object.__setattr__(self, "triangles", mesh.triangles)

    def _check(self) -> None:
        for name in ("speeds", "forces", "variance"):
            if getattr(self, name).min() < 0.0:
                worst = int(np.argmin(getattr(self, name)))
                raise AsperityError(
                    f"model {worst + 1}: {name} must be 0 or above, "
                    f"got {getattr(self, name)[worst]:g}"
                )
        for name, kind in (("ar", "AR"), ("ma", "MA")):
            values = getattr(self, name)
            if values.shape[1] > HIGHEST_ORDER:
                raise AsperityError(
                    f"{values.shape[1]} {kind} coefficients; valid: {HIGHEST_ORDER} at most"
                )
            for i, row in enumerate(values):
                if not are_stable(row):
                    raise AsperityError(
                        f"model {i + 1}: {kind} line spectral frequencies must increase strictly "
                        "between 0 and pi, or the filter is not stable"
                    )

    @property
    def order(self) -> int:
        """How many AR coefficients there are."""
        return int(self.ar.shape[1])

    def weights(self, speed: float, force: float) -> tuple[Indices, Array]:
        """Return the models (3,) at a speed [m/s] and force [N], and their weights (3,)."""
        corners, shares = np.empty(3, np.int64), np.empty(3)
        weigh(self.mesh, float(speed), float(force), -1, corners, shares)
        return corners, shares

    def filter_at(self, speed: float, force: float) -> Filter:
        """Return the filter at a speed [m/s] and force [N]."""
        corners, shares = self.weights(speed, force)
        ar = coefficients_of(shares @ self.ar[corners])
        ma = np.ones(1)
        if self.ma.shape[1]:
            ma = coefficients_of(shares @ self.ma[corners]) * float(shares @ self.gain[corners])
        return Filter(ar, ma, float(shares @ self.variance[corners]))
