"""A recorded hand motion as a device: a session's `recording.h5`, or a file of poses.

The motion follows the clock, not the number of readings, and ignores forces. The poses are those
of the scene, so no mapping is needed.
"""

from __future__ import annotations

import bisect
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_choice
from asperity.geometry.poses import interpolate_pose, mean_twist
from asperity.realtime.devices.protocol import REFUSED, Limits, Reading, finite_wrench
from asperity.scene.document import arguments
from asperity.scene.shorthand import file_table
from asperity.scene.trajectory import Trajectory

End = Literal["hold", "loop"]
_ENDS = ("hold", "loop")
_LOG = logging.getLogger(__name__)


class ReplayedDevice:
    """A device that replays a motion.

    Parameters
    ----------
    source : str or Path
        A `recording.h5` (its handle is replayed), or poses as `.csv`, `.npy` or `.npz`, with
        options of `read_poses` behind it: "poses.csv:order=xyzw,unit=mm".
    end : str
        `hold`: stay at the last pose. `loop`: start again, with a jump unless the motion is closed.
    limits : Limits, optional
        Limits of the forces, which act on nobody. Default: 10 N, 1 N m, and a workspace that
        contains the whole motion.
    clock : callable
        Monotonic time [s].

    Attributes
    ----------
    wrench : tuple
        The wrench written last.
    finished : bool
        Whether the end was reached; never with `loop`.
    """

    name = "replay"
    in_loop = True

    def __init__(
        self,
        source: str | Path,
        *,
        end: End = "hold",
        limits: Limits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._end = require_choice("end of a replay", end, _ENDS)
        motion = _motion(source)
        for note in motion.notes:
            _LOG.warning("%s: %s", motion.name, note)
        self._times = (motion.times - motion.times[0]).tolist()
        self._poses: NDArray[np.float64] = np.asarray(motion.poses)
        self._still = np.zeros(6)
        self._clock = clock
        self._start: float | None = None
        self._error = ""
        self.wrench: tuple[float, ...] = (0.0,) * 6
        self.finished = False
        reach = float(np.linalg.norm(self._poses[:, :3], axis=1).max())
        self.limits = limits or Limits(
            max_force=10.0, max_torque=1.0, max_stiffness=1e5, max_damping=100.0,
            max_rotational_stiffness=100.0, radius=max(0.1, 1.01 * reach), torque_dof=3,
        )  # fmt: skip

    @property
    def seconds(self) -> float:
        """Duration of the motion [s]."""
        return self._times[-1]

    @property
    def first_pose(self) -> NDArray[np.float64]:
        """First pose (7,)."""
        return self._poses[0].copy()

    def open(self) -> None:
        """Start the motion."""
        if self._start is None:
            self._start = self._clock()
            self.finished = False

    def read(self, out: Reading) -> bool:
        """Fill the present pose; while the device is open it is always new."""
        if self._start is None:
            out.age, out.error = float("inf"), "the device is not open"
            return False
        now = self._clock() - self._start
        if self._end == "loop" and self.seconds > 0.0:
            now %= self.seconds
        elif now >= self.seconds:
            now, self.finished = self.seconds, True
        i = min(max(bisect.bisect_right(self._times, now), 1), len(self._times) - 1)
        if len(self._times) == 1 or self.finished:
            out.pose[:], out.twist[:] = self._poses[-1], self._still
        else:
            first, last = self._times[i - 1], self._times[i]
            a, b = self._poses[i - 1], self._poses[i]
            out.pose[:] = interpolate_pose(a, b, (now - first) / (last - first))
            out.twist[:] = mean_twist(a, b, last - first)
        out.buttons, out.age = 0, 0.0
        out.error, self._error = self._error, ""
        return True

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Store the wrench in `wrench`."""
        values = finite_wrench(wrench)
        if values is None:
            self._error = REFUSED
        self.wrench = values or (0.0,) * 6

    def close(self) -> None:
        """End the motion; opening the device again restarts it."""
        self._start = None
        self.wrench = (0.0,) * 6


def _motion(source: str | os.PathLike[str]) -> Trajectory:
    table = file_table(os.fspath(source))
    path = Path(table.pop("file"))
    if path.is_dir() and (path / "recording.h5").is_file():
        path = path / "recording.h5"
    if path.suffix.lower() in (".h5", ".hdf5", ".nc"):
        from asperity.runs.recording import read_recording

        recording = read_recording(path)
        if len(recording.time) == 0:
            raise AsperityError(f"{path} has no ticks to replay")
        return Trajectory(recording.time, recording.handle_pose, str(path))
    from asperity.scene.trajectory_file import read_poses

    return read_poses(path, **arguments(table, f"options of {path.name}", read_poses))
