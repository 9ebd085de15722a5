"""What is doubted of the poses of a file: order, units, leaps, gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, row_lengths

TURN = 45.0
"""Turn between neighbours from which the order of the quaternion is doubted [degrees]."""
ROUNDED = 0.02
"""Largest deviation of a quaternion's norm from 1 that is taken for rounding."""
_EXACT = 1e-6
_AT_ONCE = 4096
_HARDLY_TURNED = 0.93
"""Product of neighbouring quaternions, above that of this turn."""
_FARTHEST, _FASTEST, _LONGEST_STEP = 3.0, 10.0, 0.5
"""Places [m], speeds [m/s] and times between poses [s] beyond which a unit is doubted."""


class Extremes(NamedTuple):
    """What lies farthest out among poses; all but the speed are NaN if a pose is."""

    off: float
    """Largest deviation of a quaternion's norm from 1."""
    least: float
    """Least product of neighbouring quaternions, without its sign."""
    far: float
    """Largest coordinate [m]."""
    fastest: float
    """[m/s]"""


def pose_doubts(times: Array, poses: Array, named: bool, extremes: Extremes) -> list[str]:
    """Return notes that doubt the order or the units of poses, or that they hang together.

    Parameters
    ----------
    times : (n,) array
        [s]
    poses : (n, 7) array
    named : bool
        Whether names state the order of the quaternion.
    extremes : Extremes
        Of these poses.
    """
    notes = []
    _, least, far, fastest = extremes
    if not least > _HARDLY_TURNED:
        turns = np.abs(np.einsum("ij,ij->i", poses[1:, 3:], poses[:-1, 3:]))
        angles = np.degrees(2.0 * np.arccos(np.clip(turns, 0.0, 1.0)))
        if np.nanmax(angles, initial=0.0) > TURN:
            row = int(np.nanargmax(angles))
            notes.append(
                f"is the order of qw, qx, qy, qz right? The tool turns by {angles[row]:.0f} "
                f"degrees from pose {row} to {row + 1} (more than {TURN:g}); order= changes it"
            )
    if not named:
        tilts = [_tilt(poses[0, 3:], at) for at in (0, 3)]
        if tilts[0] > 90.0 > 2.0 * tilts[1]:
            notes.append(
                "is the order x, y, z, w? The first pose is turned by "
                f"{tilts[0]:.0f} degrees, with order='xyzw' by {tilts[1]:.0f}"
            )
    steps, fast = np.diff(times), 0.0
    if far > _FARTHEST or fastest > _FASTEST:  # else their median is no larger
        with np.errstate(all="ignore"):
            speeds = row_lengths(np.diff(poses[:, :3], axis=0)) / steps
        fast = float(np.median(speeds)) if speeds.size else 0.0
    if far > _FARTHEST or fast > _FASTEST:
        notes.append(
            f"are x, y, z in m? They reach {far:.4g} m, at {fast:.3g} m/s; unit= changes that"
        )
    elif fastest > _FASTEST:
        row = int(np.nanargmax(speeds))
        leap = 1e3 * float(np.linalg.norm(poses[row + 1, :3] - poses[row, :3]))
        notes.append(
            f"was tracking lost? The tool leaps by {leap:.4g} mm from pose {row + 1} to {row + 2}, "
            f"at {speeds[row]:.3g} m/s"
        )
    lost = poses[:, 0] == 0.0
    if lost.any():
        lost &= (poses[:, 1:3] == 0.0).all(axis=1) & (np.abs(poses[:, 3]) == 1.0)
        lost[: int(np.argmin(lost))] = False  # a motion may begin there
    if 0 < np.count_nonzero(lost) < 0.5 * len(poses):
        notes.append(
            f"was tracking lost? {np.count_nonzero(lost)} of {len(poses)} poses are at 0, 0, 0 "
            f"without a turn, the first is pose {int(np.argmax(lost)) + 1}: leave them out, if so"
        )
    longest = float(np.fmax.reduce(steps, initial=0.0))
    if longest > _LONGEST_STEP and float(np.median(steps)) > _LONGEST_STEP:
        notes.append(
            f"are the times in s? There are {np.median(steps):.4g} s between poses; time_unit= "
            "changes that"
        )
    elif longest > _LONGEST_STEP:
        row = int(np.nanargmax(steps))
        notes.append(f"there are {steps[row]:.4g} s without a pose behind pose {row + 1}: the path "
                     "across is that of the neighbours")  # fmt: skip
    return notes


def unit_poses(times: Array, poses: Array) -> tuple[Array, Extremes]:
    """Return a copy of poses (n, 7) with unit quaternions, and what of them lies farthest out.

    Few poses at a time, so that they stay in the cache.

    Parameters
    ----------
    times : (n,) array
        [s]
    poses : (n, 7) array
        Only for those whose `off` is within rounding the result is of use.
    """
    found, out = [], np.empty(poses.shape)
    block = np.empty((7, min(_AT_ONCE, len(poses)) + 1))
    with np.errstate(all="ignore"):
        for first in range(0, len(poses), _AT_ONCE):
            rows = slice(first, first + _AT_ONCE + 1)  # the last is also the next ones' first
            columns = block[:, : len(poses[rows])]
            columns[:] = poses[rows].T
            places, quaternions = columns[:3], columns[3:]
            norms = np.sqrt(np.einsum("ij,ij->j", quaternions, quaternions))
            quaternions /= norms
            out[rows] = columns.T
            norms -= 1.0
            off = max(norms.max(), -norms.min())
            products = np.einsum("ij,ij->j", quaternions[:, 1:], quaternions[:, :-1])
            steps = places[:, 1:] - places[:, :-1]
            speeds = np.sqrt(np.einsum("ij,ij->j", steps, steps)) / np.diff(times[rows])
            far = max(places.max(), -places.min())
            fastest = np.fmax.reduce(speeds, initial=0.0)
            found.append((off, -np.abs(products).min(initial=1.0), far, fastest))
    off, least, far, fastest = np.max(found, axis=0).tolist()
    return out, Extremes(off, -least, far, fastest)


def note_rounded(poses: Array, normalised: Array, extremes: Extremes, notes: list[str]) -> None:
    """Note quaternions whose norm rounding has changed, and replace those poses; others stay."""
    if extremes.off <= _EXACT:
        return
    norms = row_lengths(poses[:, 3:])
    off = np.abs(norms - 1.0)
    rounded = (off > _EXACT) & (off < ROUNDED)
    if rounded.any():
        poses[rounded] = normalised[rounded]
        notes.append(
            f"{np.count_nonzero(rounded)} of {len(poses)} quaternions are rounded, their norm off "
            f"1 by up to {off[rounded].max():.2g}: normalised"
        )


def _tilt(quaternion: Array, scalar: int) -> float:
    """Return the angle [degrees] of a quaternion whose scalar part is at a place."""
    return float(np.degrees(2.0 * np.arccos(min(abs(float(quaternion[scalar])), 1.0))))
