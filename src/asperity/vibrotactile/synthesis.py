"""From speed and force to vibration, sample by sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.errors import AsperityError
from asperity.vibrotactile.harmonic import FADES_FROM, HarmonicModel
from asperity.vibrotactile.high_pass import sections
from asperity.vibrotactile.lsf import fill_coefficients
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.triangles import Triangulation, weigh


class Synthesiser:
    """Vibration of a texture at the model's own rate.

    The filter is mixed anew at every sample; what has come out and what went in is kept from
    sample to sample, also across models, so that the vibration has no seams. The lines of a
    `HarmonicModel` follow the travelled distance, the sum of speed over rate. At another rate: make
    the model of that rate first, with `rates.at_rate`.

    Parameters
    ----------
    model : TextureModel or HarmonicModel
    seed : int
        Of the white noise.
    """

    def __init__(self, model: TextureModel, *, seed: int = 0) -> None:
        self.model = model
        self.seed = seed
        self._filters, self._lines = _bank(model), _lines_of(model)
        self.reset()

    def reset(self) -> None:
        """Forget all that has been, and begin the noise again."""
        self._noise = np.random.default_rng(self.seed)
        self._out = np.zeros(self.model.order)
        self._in = np.zeros(self.model.ma.shape[1])
        self._triangle = -1
        self._passed = np.zeros((len(self._filters.sections), 2))
        self._turns = np.zeros(self._lines.turns.size)

    def next(self, speed: float, force: float) -> float:
        """Return one sample [m/s^2] at a speed [m/s] and a normal force [N]."""
        return float(self.block([speed], [force])[0])

    def block(self, speeds: ArrayLike, forces: ArrayLike) -> Array:
        """Return samples (n,) [m/s^2] at speeds [m/s] and normal forces [N], (n,) each.

        Signs do not matter; a force below zero is none.
        """
        v = np.abs(np.ascontiguousarray(speeds, dtype=np.float64))
        f = np.maximum(np.ascontiguousarray(forces, dtype=np.float64), 0.0)
        if v.ndim != 1 or v.shape != f.shape:
            raise AsperityError(f"speeds and forces must be (n,) each, got {v.shape}, {f.shape}")
        if not (np.isfinite(v).all() and np.isfinite(f).all()):
            raise AsperityError("speeds and forces must be finite numbers")
        out = np.empty(v.size)
        noise = self._noise.standard_normal(v.size)
        history = History(self._out, self._in, self._passed, self._turns)
        self._triangle = synthesise(
            self._filters, self._lines, Drive(v, f, noise), history, self._triangle, out
        )
        return out


def _bank(model: TextureModel) -> FilterBank:
    # Without RMS of their own, models are mixed by the variance of the excitation.
    rms, full, passes = np.empty(0), (0.0, 0.0), np.empty((0, 6))
    if isinstance(model, HarmonicModel):
        rms, full = model.noise_rms, (float(model.slowest), float(model.lightest))
        passes = sections(model.noise_high_pass, model.rate)
    return FilterBank(model.mesh, model.ar, model.ma, model.variance, model.gain, rms, full, passes)


def _lines_of(model: TextureModel) -> Lines:
    if not isinstance(model, HarmonicModel):
        nothing = np.empty((len(model.speeds), 0))
        return Lines(nothing, nothing, np.empty(0), np.empty(0))
    k = model.wavenumbers
    below = k / model.high_pass if model.high_pass > 0.0 else np.full(k.size, np.inf)
    real, imaginary = np.ascontiguousarray(model.lines.real), np.ascontiguousarray(model.lines.imag)
    return Lines(real, imaginary, k / model.rate, below)


class FilterBank(NamedTuple):
    """The filters of a `TextureModel`, whose fields these are."""

    mesh: Triangulation
    ar: Array
    ma: Array
    variance: Array
    gain: Array
    rms: Array
    """(n,) of each filter's output [m/s^2], or (0,) to mix the variance instead."""
    full: tuple[float, float]
    """Speed [m/s] and force [N] from which on nothing is faded."""
    sections: Array
    """(s, 6) second-order sections that the noise passes behind the filter; (0, 6) for none."""


class Lines(NamedTuple):
    """The lines of a `HarmonicModel`."""

    real: Array
    """(n, h) of each model's amplitudes, without the high-pass [m/s^2]."""
    imaginary: Array
    """(n, h)"""
    turns: Array
    """(h,) turns of a line in a sample, over the speed [s/m]."""
    below: Array
    """(h,) frequency over the corner of the high-pass, over the speed [s/m]."""


class Drive(NamedTuple):
    """Input of the filters at n samples, (n,) each."""

    speeds: Array
    """[m/s]"""
    forces: Array
    """[N]"""
    noise: Array
    """White, of variance 1."""


class History(NamedTuple):
    """Last samples, the newest first; changed in place."""

    outputs: Array
    """(p,) of the AR filter [m/s^2]; where `FilterBank.rms` is given, states of its lattice"""
    excitations: Array
    """(q,) [m/s^2]"""
    passed: Array
    """(s, 2) of the sections, whose transposed direct form II this is [m/s^2]"""
    phases: Array
    """(h,) of the lines [turns]"""


_ROUND = 1.0 - 1e-12
"""The largest reflection coefficient: rounding may take one of a near-line to 1."""


@kernel
def synthesise(filters, lines, drive, history, triangle, out):
    """Fill samples (n,) [m/s^2]; return the triangle of the last one.

    `filters` is a `FilterBank`, `lines` are `Lines`, `drive` a `Drive`, `history` a `History`;
    `triangle` is where the search for the first sample's triangle starts.
    """
    mesh, ar, ma, variance, gain, rms, full, passes = filters
    speeds, forces, noise = drive
    before, excited, passed, phases = history
    p, q, h = ar.shape[1], ma.shape[1], phases.size
    a, b, reflections = np.empty(p + 1), np.empty(q + 1), np.empty(p)
    mixed_a, mixed_b = np.empty(p), np.empty(q)
    room = np.empty((2, max(p, q) + 3))
    cosines, sines = np.empty(h), np.empty(h)
    corners, weights = np.empty(3, np.int64), np.empty(3)
    last_speed, last_force = -1.0, -1.0
    power, level, size = 0.0, 1.0, 0.0
    for i in range(out.size):
        if speeds[i] != last_speed or forces[i] != last_force:
            last_speed, last_force = speeds[i], forces[i]
            triangle = weigh(mesh, last_speed, last_force, triangle, corners, weights)
            power, level, size = 0.0, 0.0, 0.0
            mixed_a[:] = 0.0
            mixed_b[:] = 0.0
            for k in range(3):
                m, w = corners[k], weights[k]
                power += w * variance[m]
                level += w * gain[m]
                if rms.size > 0:
                    size += w * rms[m]
                for j in range(p):
                    mixed_a[j] += w * ar[m, j]
                for j in range(q):
                    mixed_b[j] += w * ma[m, j]
            fill_coefficients(mixed_a, room[:, : p + 3], a)
            if q > 0:
                fill_coefficients(mixed_b, room[:, : q + 3], b)
            light = min(last_force / full[1], 1.0) if full[1] > 0.0 else 1.0
            if rms.size > 0:
                size *= light * (min(last_speed / full[0], 1.0) if full[0] > 0.0 else 1.0)
                reflect(a, room[0], reflections)
            mix_lines(lines, corners, weights, last_speed, cosines, sines)
            cosines *= light
            sines *= light
        if rms.size > 0:
            total = size * through_lattice(noise[i], reflections, before)
        else:
            fresh = np.sqrt(max(power, 0.0)) * noise[i]
            total = fresh
            if q > 0:
                for j in range(q):
                    total += b[j + 1] * excited[j]
                total *= level
                for j in range(q - 1, 0, -1):
                    excited[j] = excited[j - 1]
                excited[0] = fresh
            for j in range(p):
                total -= a[j + 1] * before[j]
            for j in range(p - 1, 0, -1):
                before[j] = before[j - 1]
            if p > 0:
                before[0] = total
        for j in range(passes.shape[0]):
            s, entering = passes[j], total
            total = s[0] * entering + passed[j, 0]
            passed[j, 0] = s[1] * entering - s[4] * total + passed[j, 1]
            passed[j, 1] = s[2] * entering - s[5] * total
        for j in range(h):
            turned = phases[j] + lines.turns[j] * speeds[i]
            phases[j] = turned - math.floor(turned)
            if cosines[j] != 0.0 or sines[j] != 0.0:
                angle = 2.0 * math.pi * phases[j]
                total += cosines[j] * math.cos(angle) - sines[j] * math.sin(angle)
        out[i] = total
    return triangle


@kernel
def reflect(a, room, out):
    """Fill the reflection coefficients (p,) of a stable filter; `room` holds (p + 1,)."""
    for i in range(a.size):
        room[i] = a[i]
    for i in range(a.size - 1, 0, -1):
        k = min(max(room[i], -_ROUND), _ROUND)
        out[i - 1] = k
        rest = 1.0 - k * k
        for j in range(1, i // 2 + 1):
            low, high = room[j], room[i - j]
            room[j] = (low - k * high) / rest
            if i - j > j:
                room[i - j] = (high - k * low) / rest


@kernel
def through_lattice(noise, reflections, states):
    """Return the next output of 1 / A, of variance 1, for white noise of variance 1.

    The normalised lattice (Gray & Markel 1975): each of its stages turns two numbers, so what is in
    `states` (p,) stays white and of variance 1 whatever the filter, and however fast it changes. A
    filter in direct form may grow without bounds if it changes.
    """
    forward = noise
    p = reflections.size
    for i in range(p - 1, -1, -1):
        k = reflections[i]
        c = math.sqrt(1.0 - k * k)
        backward = states[i]
        if i + 1 < p:
            states[i + 1] = k * forward + c * backward
        forward = c * forward - k * backward
    if p > 0:
        states[0] = forward
    return forward


@kernel
def mix_lines(lines, corners, weights, speed, cosines, sines):
    """Fill the amplitudes (h,) of cosine and sine of all lines at a speed [m/s].

    Sizes and phases are mixed apart, so that lines of unlike phases do not cancel.
    """
    for j in range(cosines.size):
        size, x, y = 0.0, 0.0, 0.0
        for k in range(3):
            real, imaginary = lines.real[corners[k], j], lines.imaginary[corners[k], j]
            size += weights[k] * math.hypot(real, imaginary)
            x += weights[k] * real
            y += weights[k] * imaginary
        r = (lines.below[j] * speed) ** 4 if speed > 0.0 else 0.0
        gain = r / (1.0 + r) if r < 1e9 else 1.0
        fade = (0.5 - lines.turns[j] * speed) / (0.5 - FADES_FROM)
        size *= gain * min(max(fade, 0.0), 1.0)
        length = math.hypot(x, y)
        cosines[j] = size * x / length if length > 0.0 else size
        sines[j] = size * y / length if length > 0.0 else 0.0
