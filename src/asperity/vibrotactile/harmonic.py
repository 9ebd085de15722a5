"""A texture as vibration that keeps what is periodic: lines locked to position, and noise.

The noise of `model` repeats a spectrum. A grating's vibration is not noise: it repeats with the
travelled distance. So its part is kept as sines over distance, and only the remainder is noise:

    y_n = sum_j A_j(v, F) G(k_j v) cos(2 pi m_j x_n / lambda_j + phi_j(v, F)) + noise_n ,

x the travelled distance, lambda_j one of the texture's periods, m_j = 1, 2, ... a harmonic of it,
k_j = m_j / lambda_j. G is the known gain of the high-pass filter behind every recording
(`signals.explored`), which is divided out of the amplitudes so that they may be mixed over speed;
the noise passes it as a filter, behind the AR filter (`high_pass`).
Sines plus filtered noise are the "spectral modelling" of sounds (Serra & Smith 1990); that such a
model of a texture follows the position is asperity's. See `docs/methods/recorded-vibration.md`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError, require_between, require_not_negative
from asperity.vibrotactile.ar import damped, levinson
from asperity.vibrotactile.high_pass import sections, spectral_grid
from asperity.vibrotactile.lsf import coefficients_of, frequencies_of, power_gain
from asperity.vibrotactile.model import Filter, TextureModel
from asperity.vibrotactile.triangles import rim_places

Amplitudes = NDArray[np.complex128]
MOST_LINES = 64
FADES_FROM = 0.45
"""Lines fade out from this share of the rate up to half of it."""


@dataclass(frozen=True, eq=False)
class HarmonicModel(TextureModel):
    """Vibration of a tool on a texture: lines locked to position, and noise beside them.

    Parameters
    ----------
    periods : (q,) array
        Lengths after which the texture repeats [m]; none (0,) if it does not.
    harmonics : (h, 2) array of int
        Of each line: its period, counted from 0, and its multiple, counted from 1.
    lines : (n, h) complex array
        Amplitudes of the lines of each model [m/s^2], without the high-pass filter. The angle is
        the phase relative to the first line of the same period.
    high_pass : float
        Corner of the filter behind the recordings [Hz], 0 if there was none.
    noise_high_pass : float
        Corner of the filter that the noise passes behind its AR filter [Hz], below a quarter of the
        rate; 0 if there is none, and the AR filters have all of the spectrum.
    slowest, lightest : float
        Below this speed [m/s] the noise, and below this force [N] all, fade in proportion: to
        silence at rest and in the air. 0 where models themselves stand there.

    Notes
    -----
    Line spectral frequencies, amplitudes of lines, and the *RMS* of the noise before its high-pass
    filter are mixed barycentrically, where `TextureModel` mixes the variance of the excitation: a
    mix of two filters may ring more than either, so a mixed excitation does not keep the RMS.
    """

    periods: Array = field(default_factory=lambda: np.empty(0))
    harmonics: Indices = field(default_factory=lambda: np.empty((0, 2), np.int64))
    lines: Amplitudes = field(default_factory=lambda: np.empty((0, 0), np.complex128))
    high_pass: float = 20.0
    noise_high_pass: float = 0.0
    slowest: float = 0.0
    lightest: float = 0.0
    noise_rms: Array = field(init=False, repr=False)
    """(n,) of the noise alone, before its high-pass filter [m/s^2]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ma.shape[1]:
            raise AsperityError("the noise beside lines has no moving-average part; drop it")
        n = len(self.speeds)
        periods = np.atleast_1d(np.asarray(self.periods, dtype=np.float64))
        harmonics = np.asarray(self.harmonics, dtype=np.int64).reshape(-1, 2)
        h = len(harmonics)
        lines = np.zeros((n, 0), complex) if h == 0 else np.asarray(self.lines, np.complex128)
        if h > MOST_LINES:
            raise AsperityError(f"{h} lines; valid: {MOST_LINES} at most")
        if lines.shape != (n, h) or not np.isfinite(lines).all():
            raise AsperityError(f"lines must be finite, ({n}, {h}), got shape {lines.shape}")
        if not (np.isfinite(periods).all() and (periods > 0.0).all()):
            raise AsperityError(f"periods must be above 0 m, got {periods.tolist()}")
        if h and not (
            harmonics[:, 0].min() >= 0
            and harmonics[:, 0].max() < len(periods)
            and harmonics[:, 1].min() >= 1
        ):
            raise AsperityError(
                f"a line names a period from 0 to {len(periods) - 1} and a multiple from 1, got "
                f"{harmonics.tolist()}"
            )
        for name in ("high_pass", "slowest", "lightest"):
            require_not_negative(f"{name} of a harmonic model", getattr(self, name))
        require_between("noise_high_pass", self.noise_high_pass, 0.0, 0.25 * self.rate, "Hz")
        gains = [power_gain(coefficients_of(row)) for row in self.ar]
        for name, value in {
            "periods": periods, "harmonics": harmonics, "lines": lines,
            "noise_rms": np.sqrt(self.variance * gains),
        }.items():  # fmt: skip
            object.__setattr__(self, name, np.ascontiguousarray(value))

    @property
    def wavenumbers(self) -> Array:
        """Of the lines, (h,) [1/m]."""
        return np.asarray(self.harmonics[:, 1] / self.periods[self.harmonics[:, 0]])

    def filter_at(self, speed: float, force: float) -> Filter:
        """Return the filter of the noise, high-pass and all, at a speed [m/s] and force [N]."""
        corners, shares = self.weights(speed, force)
        ar, ma = coefficients_of(shares @ self.ar[corners]), np.ones(1)
        level = fade(speed, self.slowest) * fade(force, self.lightest)
        power = (level * float(shares @ self.noise_rms[corners])) ** 2
        variance = power / power_gain(ar)
        for section in sections(self.noise_high_pass, self.rate):
            ma, ar = np.convolve(ma, section[:3]), np.convolve(ar, section[3:])
        return Filter(ar, ma, variance)

    def amplitudes_at(self, speed: float, force: float) -> Array:
        """Return the amplitudes (h,) [m/s^2] of the lines at a speed [m/s] and force [N]."""
        corners, shares = self.weights(speed, force)
        size = fade(force, self.lightest) * (shares @ np.abs(self.lines[corners]))
        return np.asarray(size * line_gain(self.wavenumbers * speed, self.high_pass, self.rate))


def fade(value: float, full: float) -> float:
    """Return 1 from `full` on, and the ratio below it."""
    return value / full if value < full else 1.0


def high_pass_gain(frequency: Array, corner: float) -> Array:
    """Return the gain of a vibration at frequencies [Hz] (n,) after `signals.explored`.

    Two passes of a Butterworth filter of order 2.
    """
    if corner == 0.0:
        return np.ones(np.shape(frequency))
    r = (np.asarray(frequency, dtype=np.float64) / corner) ** 4
    return np.asarray(r / (1.0 + r))


def line_gain(frequency: Array, corner: float, rate: float) -> Array:
    """Return the gain of lines at frequencies [Hz] (n,): the high-pass, and the end of the band."""
    fade = (0.5 - np.asarray(frequency) / rate) / (0.5 - FADES_FROM)
    return np.asarray(high_pass_gain(frequency, corner) * np.clip(fade, 0.0, 1.0))


def as_noise(model: HarmonicModel, bandwidth: float = 4.0) -> tuple[TextureModel, float]:
    """Return the noise model nearest to a harmonic one, and the share of power it cannot keep.

    Every line becomes a resonance of the same power: the AR filter of the sum of both
    autocovariances, by Levinson's recursion. What is lost is the phase: the share is that of the
    lines in all power, the mean over the models. Of a model without lines nothing is lost but the
    mixing by RMS, and how sharply a high-pass filter behind the noise ends it.

    Parameters
    ----------
    model : HarmonicModel
    bandwidth : float
        No resonance becomes narrower [Hz].
    """
    order, grid = model.order, spectral_grid(model.rate)
    speeds, forces, triangles = model.speeds, model.forces, model.triangles
    if speeds.min() > 0.0:  # noise alone does not fade by itself
        top = np.array([speeds.max(), forces.max()])
        places = np.column_stack([speeds, forces]) / top
        speeds, forces = (np.vstack([places, *rim_places(places)]) * top).T
        triangles = None
    lsf, variance = np.empty((speeds.size, order)), np.zeros(speeds.size)
    shares = []
    lags = np.arange(order + 1)
    for i, (speed, force) in enumerate(zip(speeds, forces, strict=True)):
        frequency = model.wavenumbers * speed
        powers = 0.5 * model.amplitudes_at(speed, force) ** 2
        density = model.filter_at(speed, force).density(grid, model.rate)
        noise = 0.5 * model.rate * np.fft.irfft(density)[: order + 1]
        total = float(noise[0] + powers.sum())
        if total == 0.0 or speed == 0.0:
            corners, weights = model.weights(speed, force)
            lsf[i] = weights @ model.ar[corners]
            continue
        shares.append(float(powers.sum()) / total)
        tones = np.cos(2.0 * np.pi * np.outer(lags, frequency) / model.rate) @ powers
        covariance = noise + tones
        covariance[0] *= 1.0 + 1e-9
        fresh = damped(levinson(covariance), total, model.rate, bandwidth)
        lsf[i] = frequencies_of(fresh.coefficients)
        variance[i] = total / power_gain(fresh.coefficients)
    plain = TextureModel(
        model.name, model.rate, speeds, forces, lsf, variance,
        friction=model.friction, triangles=triangles,
    )  # fmt: skip
    return plain, float(np.mean(shares)) if shares else 0.0
