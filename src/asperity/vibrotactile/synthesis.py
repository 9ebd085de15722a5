"""From speed and force to vibration, sample by sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.errors import AsperityError
from asperity.vibrotactile.lsf import fill_coefficients
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.triangles import Triangulation, weigh


class Synthesiser:
    """Vibration of a texture at the model's own rate.

    The filter is mixed anew at every sample; what has come out and what went in is kept from
    sample to sample, also across models, so that the vibration has no seams. At another rate: make
    the model of that rate first, with `rates.at_rate`.

    Parameters
    ----------
    model : TextureModel
    seed : int
        Of the white noise.
    """

    def __init__(self, model: TextureModel, *, seed: int = 0) -> None:
        self.model = model
        self.seed = seed
        self.reset()

    def reset(self) -> None:
        """Forget all that has been, and begin the noise again."""
        self._noise = np.random.default_rng(self.seed)
        self._out = np.zeros(self.model.order)
        self._in = np.zeros(self.model.ma.shape[1])
        self._triangle = -1

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
        model, out = self.model, np.empty(v.size)
        noise = self._noise.standard_normal(v.size)
        filters = FilterBank(model.mesh, model.ar, model.ma, model.variance, model.gain)
        self._triangle = synthesise(
            filters, Drive(v, f, noise), History(self._out, self._in), self._triangle, out
        )
        return out


class FilterBank(NamedTuple):
    """The filters of a `TextureModel`, whose fields these are."""

    mesh: Triangulation
    ar: Array
    ma: Array
    variance: Array
    gain: Array


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
    """(p,) [m/s^2]"""
    excitations: Array
    """(q,) [m/s^2]"""


@kernel
def synthesise(filters, drive, history, triangle, out):
    """Fill samples (n,) [m/s^2]; return the triangle of the last one.

    `filters` is a `FilterBank`, `drive` a `Drive`, `history` a `History`; `triangle` is where the
    search for the first sample's triangle starts.
    """
    mesh, ar, ma, variance, gain = filters
    speeds, forces, noise = drive
    before, excited = history
    p, q = ar.shape[1], ma.shape[1]
    a, b = np.empty(p + 1), np.empty(q + 1)
    mixed_a, mixed_b = np.empty(p), np.empty(q)
    room = np.empty((2, max(p, q) + 3))
    corners, weights = np.empty(3, np.int64), np.empty(3)
    last_speed, last_force = -1.0, -1.0
    power, level = 0.0, 1.0
    for i in range(out.size):
        if speeds[i] != last_speed or forces[i] != last_force:
            last_speed, last_force = speeds[i], forces[i]
            triangle = weigh(mesh, last_speed, last_force, triangle, corners, weights)
            power, level = 0.0, 0.0
            mixed_a[:] = 0.0
            mixed_b[:] = 0.0
            for k in range(3):
                m, w = corners[k], weights[k]
                power += w * variance[m]
                level += w * gain[m]
                for j in range(p):
                    mixed_a[j] += w * ar[m, j]
                for j in range(q):
                    mixed_b[j] += w * ma[m, j]
            fill_coefficients(mixed_a, room[:, : p + 3], a)
            if q > 0:
                fill_coefficients(mixed_b, room[:, : q + 3], b)
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
        out[i] = total
    return triangle
