"""From a recording to what a vibration model is fitted to: vibration, speed and normal force."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError, require_positive
from asperity.runs.tool_motion import one_signal

HIGH_PASS = 20.0
"""Below it is the hand's motion, above it the texture's vibration [Hz] (Culbertson et al. 2014)."""
_SHORTEST = 64
"""Ticks that can be filtered at all."""


@dataclass(frozen=True, eq=False)
class Exploration:
    """A tool on a surface, over time: (n,) each."""

    name: str
    rate: float
    """[Hz]"""
    vibration: Array
    """Acceleration [m/s^2] of a mass that the texture's force moves: one axis for all three."""
    speed: Array
    """Along the surface [m/s]."""
    force: Array
    """Across it [N]."""
    drag: Array
    """Against the motion [N]."""
    touching: Mask

    def part(self, begin: int, end: int) -> Exploration:
        """Return a stretch of it."""
        cut = slice(begin, end)
        return Exploration(
            self.name, self.rate, self.vibration[cut], self.speed[cut], self.force[cut],
            self.drag[cut], self.touching[cut],
        )  # fmt: skip


def explored(
    time: Array, tool_pose: Array, wrench: Array, contact_count: Indices, *,
    mass: float, name: str = "run",
) -> Exploration:  # fmt: skip
    """Return the exploration in a run.

    Parameters
    ----------
    time : (n,) array
        At equal steps [s].
    tool_pose : (n, 7) array
        Of the tool; its speed is that of its frame, so that mere turning counts as rest.
    wrench : (n, 6) array
        Of the contact on the tool [N, N m].
    contact_count : (n,) array
    mass : float
        By which the texture's force is divided to be an acceleration [kg]: the effective mass of
        the hand and the tool, or of the tool, whose vibration the device shall give.

    Notes
    -----
    Below 20 Hz, the component of the force along the velocity is drag; the remainder is the
    normal force.
    The force above 20 Hz, over the mass, is the vibration; its three axes become one by DFT321.
    """
    require_positive("mass", mass, "kg")
    n = len(time)
    if n < _SHORTEST:
        raise AsperityError(f"{name} has {n} ticks; valid: {_SHORTEST} or more")
    steps = np.diff(time)
    dt = float(np.median(steps))
    if not dt > 0.0 or np.max(np.abs(steps - dt)) > 0.01 * dt:
        raise AsperityError(f"{name}: its ticks are not at equal steps of time")
    # Times are whole steps, and their differences are not: 1e4 Hz would come out a little above.
    rate = round(1.0 / dt, 6)
    if rate < 4.0 * HIGH_PASS:
        raise AsperityError(
            f"{name} has {rate:g} ticks a second; vibration above {HIGH_PASS:g} Hz needs "
            f"{4.0 * HIGH_PASS:g} or more"
        )
    force = wrench[:, :3]
    if not (np.isfinite(force).all() and np.isfinite(tool_pose).all()):
        raise AsperityError(f"{name} holds NaN or infinite values")
    slow = _filtered(force, rate, "low")
    velocity = _filtered(np.gradient(tool_pose[:, :3], dt, axis=0), rate, "low")
    speed = np.linalg.norm(velocity, axis=1)
    heading = velocity / np.maximum(speed, 1e-9)[:, None]
    drag = -np.einsum("ij,ij->i", slow, heading)
    normal = np.linalg.norm(slow + drag[:, None] * heading, axis=1)
    vibration = one_signal(_filtered(force, rate, "high")) / mass
    return Exploration(name, rate, vibration, speed, normal, drag, contact_count > 0)


def _filtered(values: Array, rate: float, kind: Literal["low", "high"]) -> Array:
    """Return values (n, k) below or above 20 Hz, forwards and backwards: nothing is delayed."""
    from scipy import signal

    order = signal.butter(2, HIGH_PASS, kind, fs=rate, output="sos")
    room = min(len(values) - 1, math.ceil(3.0 * rate / HIGH_PASS))
    return np.asarray(signal.sosfiltfilt(order, values, axis=0, padlen=room), dtype=np.float64)


def true_stretches(mask: Mask) -> tuple[Indices, Indices]:
    """Return where the runs of true values of a mask (n,) begin and end."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
