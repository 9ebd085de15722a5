r"""From where a tool was to how it shook: accelerations of a recorded or running motion.

Positions come once a tick, but for ticks that were left out. Accelerations are second differences
over the times there are,

    a_i = (v_{i+1/2} - v_{i-1/2}) / ((t_{i+1} - t_{i-1}) / 2),   v_{i+1/2} = dx_i / dt_i.

`along_motion` is the studies' u'': the part along the way the tool goes. `one_signal` makes one
wave of the three axes that has the spectrum of all of them (DFT321: Landin, Romano, McMahan &
Kuchenbecker 2010, "Dimensional reduction of high-frequency accelerations for haptic rendering"):
what ears, and actuators that shake along one axis, are given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_rms, spectrum

HEADING = 0.1
"""The direction of motion is that of the mean velocity over this time [s]."""
STANDING = 1e-3
"""Slower than this [m/s] a tool goes nowhere, and has no direction of motion."""


def last_run(time: Array) -> int:
    """Return where the last stretch of times (n,) begins that only grow: a loop's last start."""
    back = np.flatnonzero(np.diff(time) <= 0.0)
    return int(back[-1]) + 1 if len(back) else 0


def velocities(time: Array, position: Array) -> Array:
    """Return the velocity (n, 3) [m/s] at growing times (n,) [s] of positions (n, 3) [m]."""
    if len(time) < 2:
        return np.zeros_like(position)
    return np.asarray(np.gradient(position, time, axis=0))


def accelerations(time: Array, position: Array) -> Array:
    """Return the acceleration (n, 3) [m/s^2]; its ends are those of their neighbours."""
    if len(time) < 3:
        return np.zeros_like(position)
    step = np.diff(time)
    velocity = np.diff(position, axis=0) / step[:, None]
    out = np.empty_like(position)
    out[1:-1] = np.diff(velocity, axis=0) / (0.5 * (step[1:] + step[:-1]))[:, None]
    out[0], out[-1] = out[1], out[-2]
    return out


def along_motion(time: Array, position: Array, acceleration: Array) -> Array:
    """Return u'' (n,) [m/s^2]: the acceleration along the motion, 0 while the tool stands.

    The direction is that of the mean velocity over `HEADING` around each tick, which the shaking
    does not turn; where the tool turns back it has none for a moment.
    """
    if len(time) < 3:
        return np.zeros(len(time))
    half = 0.5 * HEADING
    before = np.searchsorted(time, time - half)
    after = np.minimum(np.searchsorted(time, time + half, side="right"), len(time)) - 1
    apart = np.maximum(time[after] - time[before], 1e-12)
    mean = (position[after] - position[before]) / apart[:, None]
    speed = np.linalg.norm(mean, axis=1)
    going = speed > STANDING
    out = np.einsum("ij,ij->i", acceleration, mean) / np.where(going, speed, 1.0)
    return np.where(going, out, 0.0)


def evenly(time: Array, values: Array, step: float) -> Array:
    """Return values (n, ...) at equal steps [s] from the first time to the last, by lines."""
    count = int(np.floor((time[-1] - time[0]) / step + 1e-6)) + 1
    at = time[0] + step * np.arange(count)
    if values.ndim == 1:
        return np.interp(at, time, values)
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def one_signal(acceleration: Array) -> Array:
    """Return one wave (n,) of three axes (n, 3) at equal steps, with the power of all (DFT321).

    The amplitude at each frequency is the root of the sum of the axes' squares, the phase that of
    their sum. The mean is left out: it is the way's, not the texture's.
    """
    if len(acceleration) < 2:
        return np.zeros(len(acceleration))
    parts = np.fft.rfft(acceleration - acceleration.mean(axis=0), axis=0)
    size = np.sqrt((np.abs(parts) ** 2).sum(axis=1))
    phase = np.exp(1j * np.angle(parts.sum(axis=1)))
    return np.asarray(np.fft.irfft(size * phase, len(acceleration)))


def joint_spectrum(acceleration: Array, step: float) -> tuple[Array, Array]:
    """Return frequencies (m,) [Hz] and amplitudes (m,) [m/s^2] of three axes (n, 3) together.

    As `perception.metrics.spectrum` of each axis under a Hann window, with their powers added.
    Of fewer than 8 samples there is none: empty arrays.
    """
    if len(acceleration) < 8:
        return np.zeros(0), np.zeros(0)
    lines = [spectrum(axis, step, periodic=False) for axis in acceleration.T]
    return lines[0][0], np.sqrt(sum(amplitude**2 for _, amplitude in lines))


class Traces(NamedTuple):
    """What is plotted of a stretch of a recording, or of the last seconds of a running loop."""

    time: Array
    """(n,) growing [s]"""
    force: Array
    """(n, 3) [N], world axes"""
    torque: Array
    """(n, 3) about the tool's centre of mass [N m]"""
    acceleration: Array
    """(n, 3) of the tool's frame [m/s^2]"""
    depth: Array
    """(n,) of the deepest contact [m]; NaN where it is not known"""

    @property
    def step(self) -> float:
        """The tick [s], as most ticks have it."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 1e-3

    def spectrum(self) -> tuple[Array, Array]:
        """Return frequencies [Hz] and amplitudes [m/s^2] of the acceleration's axes together."""
        if len(self.time) < 8:
            return np.zeros(0), np.zeros(0)
        return joint_spectrum(evenly(self.time, self.acceleration, self.step), self.step)

    def wave(self) -> Array:
        """Return the acceleration as one wave at equal steps [m/s^2]; see `one_signal`."""
        return one_signal(evenly(self.time, self.acceleration, self.step))


def traces(time: Array, tool_position: Array, wrench: Array, depth: Array) -> Traces:
    """Return the traces of ticks: times (n,), places of the tool (n, 3), wrenches (n, 6), depths.

    Of a stretch whose times begin anew, only what comes after the last beginning.
    """
    first = last_run(time)
    time, tool_position = time[first:], tool_position[first:]
    wrench, depth = wrench[first:], depth[first:]
    return Traces(time, wrench[:, :3], wrench[:, 3:], accelerations(time, tool_position), depth)


class Roughness(NamedTuple):
    """What the studies' metrics make of a stretch of a tool's motion; see `roughness`."""

    max_along: float
    """max u'': largest acceleration along the motion [m/s^2]; the paper's metric."""
    band_rms: float
    """RMS of the acceleration in the band [m/s^2]; asperity's, found after the fact."""
    speed: float
    """Mean speed over the stretch [m/s]."""


def roughness(
    time: Array, position: Array, *, band: tuple[float, float] = DEFAULT_BAND
) -> Roughness:
    """Return the studies' metrics of vibration over a stretch of a tool's motion.

    The studies move a hand in one dimension, at constant speed and force, over one texture. The
    motion here is arbitrary, so the numbers are comparable with those of a study only as far as it
    is similar. Neither metric was derived from judgements of roughness; see
    `runs.vibration_metrics`.

    Parameters
    ----------
    time : (n,) array
        Growing [s].
    position : (n, 3) array
        Of the tool [m].
    band : (float, float)
        Of the band metric [Hz].
    """
    if len(time) < 8:
        return Roughness(0.0, 0.0, 0.0)
    step = float(np.median(np.diff(time)))
    shaking = accelerations(time, position)
    along = along_motion(time, position, shaking)
    way = float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum())
    lines = joint_spectrum(evenly(time, shaking, step), step)
    return Roughness(
        max(float(along.max()), 0.0), band_rms(*lines, band), way / float(time[-1] - time[0])
    )


def thinned(time: Array, values: Array, count: int) -> tuple[Array, Array]:
    """Return at most `count` points that show what all of them do: least and largest of each part.

    Parameters
    ----------
    time : (n,) array
    values : (n, k) array
    count : int
        Even, 4 or more.

    Returns
    -------
    times : (m,) array
    values : (m, k) array
        Each pair of rows holds the extremes of a part, in the order in which they came.
    """
    n = len(time)
    if n <= count:
        return time, values
    parts = count // 2
    edges = np.linspace(0, n, parts + 1).astype(np.int64)
    size = int(np.diff(edges).max())
    at = np.minimum(edges[:-1, None] + np.arange(size), edges[1:, None] - 1)
    blocks = values[at]
    least, largest = np.argmin(blocks, axis=1), np.argmax(blocks, axis=1)
    first, last = np.minimum(least, largest), np.maximum(least, largest)
    out = np.empty((2 * parts, values.shape[1]))
    out[0::2] = np.take_along_axis(blocks, first[:, None, :], 1)[:, 0]
    out[1::2] = np.take_along_axis(blocks, last[:, None, :], 1)[:, 0]
    times = np.empty(2 * parts)
    times[0::2], times[1::2] = time[edges[:-1]], time[(edges[:-1] + edges[1:]) // 2]
    return times, out
