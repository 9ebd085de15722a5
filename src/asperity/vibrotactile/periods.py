"""The spatial periods of a texture, found from slides at several speeds.

A line of a slide's spectrum at frequency f may come from the surface (f grows with speed) or from
the tool (it does not). So spectra are taken over the travelled distance x, and a line is *locked to
position* if it stands at the same wavenumber k at different speeds. Lines whose wavenumbers are
multiples of the lowest belong to one period.

The spectrum over x of a random surface has no lines, but its ordinates scatter like an exponential
distribution about a smooth background: one in e^r is r times the background. A line must stand
`_CLEAR` times above it at two speeds, so chance makes none in a billion ordinates. All limits are
asperity's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize_scalar

from asperity._core.arrays import Array, Indices, Mask
from asperity.vibrotactile.harmonic import Amplitudes

_PAD = 4
"""Ordinates for each that is independent."""
_FEWEST = 6.0
"""Periods that a run must hold to show a line."""
_LOWEST, _HIGHEST = 8.0, 0.45
"""Frequencies at which lines are looked for [Hz], and as a share of the rate."""
_CLEAR = 20.0
"""A line stands so many times above the background, at two speeds."""
_SEEN = 4.0
"""And so many times above it in half of the runs that can show it."""
_APART = 1.25
"""Speeds differ if one is so many times the other."""
_LEAST = 2e-3
"""Share of a run's power that makes a line worth keeping."""
_BACKGROUND = 24
"""Independent ordinates on either side that make the background."""


class Passage(NamedTuple):
    """A part of an exploration in which the tool slides."""

    vibration: Array
    """(n,) without its mean [m/s^2]."""
    distance: Array
    """(n,) travelled since the beginning [m]."""
    rate: float
    """[Hz]"""

    @property
    def length(self) -> float:
        """Travelled in all [m]."""
        return float(self.distance[-1])

    @property
    def speed(self) -> float:
        """Mean [m/s]."""
        return self.length * self.rate / (self.distance.size - 1)


class Periodicity(NamedTuple):
    """The lines of a texture."""

    periods: Array
    """(q,) [m]"""
    harmonics: Indices
    """(h, 2): period, counted from 0, and multiple, counted from 1."""

    @property
    def wavenumbers(self) -> Array:
        """Of the lines, (h,) [1/m]."""
        return np.asarray(self.harmonics[:, 1] / self.periods[self.harmonics[:, 0]])


NO_PERIODS = Periodicity(np.empty(0), np.empty((0, 2), np.int64))


class _Spectrum(NamedTuple):
    """Of one run over distance."""

    wavenumber: Array
    """[1/m], equally spaced."""
    share: Array
    """Of the run's power that a line at each wavenumber would have."""
    clear: Array
    """Power over background."""
    run: Passage

    def near(self, k: float) -> tuple[float, float, float] | None:
        """Return wavenumber, clearness and share of the best ordinate near k; None: unseen."""
        step = self.wavenumber[1]
        half = 0.75 / self.run.length
        first, last = int(np.ceil((k - half) / step)), int((k + half) / step)
        if first < 1 or last >= self.wavenumber.size or not self._shows(k):
            return None
        at = first + int(np.argmax(self.clear[first : last + 1]))
        return float(self.wavenumber[at]), float(self.clear[at]), float(self.share[at])

    def _shows(self, k: float) -> bool:
        run = self.run
        frequency = k * run.speed
        return k * run.length >= _FEWEST and _LOWEST <= frequency <= _HIGHEST * run.rate

    def peaks(self) -> Array:
        """Return the wavenumbers (p,) of clear lines [1/m]."""
        up = np.flatnonzero(
            (self.clear[1:-1] > _CLEAR)
            & (self.share[1:-1] > _LEAST)
            & (self.share[1:-1] >= self.share[:-2])
            & (self.share[1:-1] > self.share[2:])
        )
        k = self.wavenumber[up + 1]
        return np.asarray(k[[self._shows(float(one)) for one in k]]) if k.size else k


def find_periods(runs: Sequence[Passage], most: int = 16) -> Periodicity:
    """Return the periods of a texture, none if nothing repeats or all speeds are the same.

    Parameters
    ----------
    runs : sequence of Passage
        Over one texture, at two speeds at least that differ by a quarter.
    most : int
        Lines that are kept: those with the largest share of power.
    """
    spectra = [_spectrum(run) for run in runs if np.any(run.vibration) and run.length > 0.0]
    spectra.sort(key=lambda one: -one.run.length)
    found: list[tuple[float, float]] = []
    for spectrum in spectra:
        for k in spectrum.peaks():
            width = 1.5 / spectrum.run.length
            if any(abs(k - other) < width for other, _ in found):
                continue
            share = _locked(float(k), spectra)
            if share > 0.0:
                found.append((float(k), share))
    found = sorted(found, key=lambda one: -one[1])[:most]
    if not found:
        return NO_PERIODS
    return _grouped(sorted(k for k, _ in found), [one.run for one in spectra])


def _locked(k: float, spectra: Sequence[_Spectrum]) -> float:
    """Return the largest share of power of a line, 0 if it is not locked to position."""
    seen = [(one.run.speed, here) for one in spectra if (here := one.near(k)) is not None]
    clear = [speed for speed, (_, r, share) in seen if r > _CLEAR and share > _LEAST]
    if not clear or max(clear) < _APART * min(clear):
        return 0.0
    if np.median([r for _, (_, r, _) in seen]) < _SEEN:
        return 0.0
    return max(share for _, (_, _, share) in seen)


def _spectrum(run: Passage) -> _Spectrum:
    """Return the spectrum of a run over distance, from samples at equal steps of it."""
    n = run.distance.size
    even = np.linspace(0.0, run.length, n)
    values = np.interp(even, run.distance, run.vibration)
    window = np.hanning(n)
    power = np.abs(np.fft.rfft((values - values.mean()) * window, _PAD * n)) ** 2
    wavenumber = np.arange(power.size) * (n - 1) / (_PAD * n * run.length)
    # A line of variance s^2 has |X|^2 = s^2 (sum w)^2 / 2 at its top.
    variance = float(np.mean(values**2))
    share = 2.0 * power / (window.sum() ** 2 * max(variance, 1e-300))
    # The median of an exponential distribution is log 2 of its mean.
    background = median_filter(share, 2 * _BACKGROUND * _PAD + 1, mode="nearest") / np.log(2.0)
    return _Spectrum(wavenumber, share, share / np.maximum(background, 1e-9), run)


def _grouped(wavenumbers: Sequence[float], runs: Sequence[Passage]) -> Periodicity:
    """Return lines (upwards) as multiples of as few periods as there are."""
    width = 0.75 / max(run.length for run in runs)
    periods: list[float] = []
    harmonics: list[tuple[int, int]] = []
    left = list(wavenumbers)
    while left:
        base, others = left[0], []
        own = {1: base}
        for k in left[1:]:
            multiple = round(k / base)
            if multiple not in own and abs(k - multiple * base) < width:
                own[multiple] = k
                base = sum(m * one for m, one in own.items()) / sum(m * m for m in own)
            else:
                others.append(k)
        left = others
        harmonics += [(len(periods), m) for m in own]
        periods.append(1.0 / _refined(base, list(own), runs))
    return Periodicity(np.array(periods), np.array(harmonics, np.int64))


def _refined(base: float, multiples: Sequence[int], runs: Sequence[Passage]) -> float:
    """Return the wavenumber [1/m] near `base` whose multiples hold the most power of all runs."""
    longest = max(run.length for run in runs)
    windowed = [np.hanning(run.distance.size) * run.vibration for run in runs]

    def missed(k: float) -> float:
        total = 0.0
        for run, values in zip(runs, windowed, strict=True):
            for m in multiples:
                if m * k * run.speed < _HIGHEST * run.rate:
                    turn = np.exp(-2j * np.pi * m * k * run.distance)
                    total += float(np.abs(turn @ values) ** 2) / float(values @ values)
        return -total

    # The top is as wide as an independent ordinate of the longest run, that of multiples narrower.
    half = 0.5 / longest
    grid = np.linspace(base - half, base + half, 4 * max(multiples) + 5)
    best = float(grid[int(np.argmin([missed(float(k)) for k in grid]))])
    step = float(grid[1] - grid[0])
    found = minimize_scalar(
        missed, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-4 * step}
    )
    return float(found.x)


def lines_of(
    runs: Sequence[Passage], periodicity: Periodicity
) -> tuple[Amplitudes, Mask, list[Array]]:
    """Return what runs at one place of force and speed have of the lines, and their remainder.

    By least squares over the travelled distance; each run begins where it likes, so of phases only
    those relative to the first line of the same period are common to runs.

    Returns
    -------
    amplitudes : (h,) complex array
        [m/s^2]; sizes are root mean squares over the runs, by length.
    seen : (h,) bool array
        Whether a run of `_FEWEST` / 2 periods or more was there to show the line.
    residuals : list of (n_i,) arrays
        Vibration without its lines [m/s^2].
    """
    k, h = periodicity.wavenumbers, len(periodicity.harmonics)
    first = np.array([np.flatnonzero(periodicity.harmonics[:, 0] == p)[0]
                      for p in periodicity.harmonics[:, 0]], np.int64)  # fmt: skip
    multiple = periodicity.harmonics[:, 1] / periodicity.harmonics[first, 1] if h else np.empty(0)
    power, mean, weight = np.zeros(h), np.zeros(h, complex), np.zeros(h)
    residuals = []
    for run in runs:
        own = (k * run.length >= 0.5 * _FEWEST) & (k * run.speed < _HIGHEST * run.rate)
        if not own.any():
            residuals.append(run.vibration)
            continue
        angle = 2.0 * np.pi * np.outer(run.distance, k[own])
        basis = np.hstack([np.cos(angle), np.sin(angle)])
        found, *_ = np.linalg.lstsq(basis, run.vibration, rcond=1e-6)
        residuals.append(run.vibration - basis @ found)
        amplitude = np.zeros(h, complex)
        amplitude[own] = found[: own.sum()] - 1j * found[own.sum() :]
        # Shift the origin so that the first line of each period has phase 0.
        turn = np.exp(-1j * multiple * np.angle(amplitude[first]))
        n = run.vibration.size
        power[own] += n * np.abs(amplitude[own]) ** 2
        mean[own] += n * (amplitude * turn)[own]
        weight[own] += n
    seen = weight > 0.0
    size = np.sqrt(power / np.maximum(weight, 1.0))
    return np.asarray(size * np.exp(1j * np.angle(mean))), seen, residuals
