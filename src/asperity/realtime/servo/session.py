"""A session: a scene felt through a device, and what it leaves on disk.

`recording.h5` grows in its final place during the session, so nothing is lost however the session
ends. `summary.json` and the figures are written afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import growing_folder
from asperity.drawing.renderer.contact import ContactMoment
from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters, attributes_of
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.snapshot import Snapshot
from asperity.runs.recording import Recording, read_recording
from asperity.runs.run_scene import Run, summary_of, take_pictures, write_figures, write_summary
from asperity.scene.scene import Scene
from asperity.simulation.simulation import Rollout
from asperity.simulation.tool_contact import ToolContact

POLLING = 0.1
"""Interval at which the parent checks the loop [s]."""
_TICK_US = ("p95", "p99", "p999", "max")
_RESULTS = ("timing", "safety", "recorder", "real_time", "ended", "passivity")


def run_session(
    spec: ServoSpec,
    out: Path,
    *,
    source: str = "",
    figures: bool = True,
    overwrite: bool = False,
    on_moment: Callable[[Snapshot], None] = lambda _: None,
    on_start: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Run a scene on a device until its time is over or Ctrl-C; return the summary.

    Parameters
    ----------
    spec : ServoSpec
    out : Path
        Folder for the results.
    source : str
        Name or folder of the scene for `load_scene`; stored for `replay`.
    figures : bool
        Draw the figures of a run afterwards.
    overwrite : bool
        Replace what is in the folder.
    on_moment, on_start : callable
        Called a few times a second with the latest snapshot; and once, when ticking begins.

    Raises
    ------
    AsperityError
        The loop failed, or ended before its first tick.
    """
    folder = growing_folder(out, overwrite=overwrite)
    recording = folder / "recording.h5"
    recording.unlink(missing_ok=True)
    with Servo(spec, recording, recording_attributes(spec, source)) as servo:
        try:
            on_start(servo.start())
            while not servo.wait(POLLING):
                snapshot = servo.snapshot()
                if snapshot is not None:
                    on_moment(snapshot)
        except KeyboardInterrupt:
            # Ctrl-C is the normal end of a session that has begun.
            if servo.snapshot_path.exists():
                servo.stop()
            else:
                raise
        result = servo.finish()
    return _write(spec, folder, result, figures)


def recording_attributes(spec: ServoSpec, source: str) -> dict[str, Any]:
    """Return the attributes of a session's recording; `source` names the scene for `load_scene`."""
    return attributes_of(spec.scene, LiveParameters.of(spec.scene, spec.rate), source=source)


def _write(spec: ServoSpec, folder: Path, result: dict[str, Any], figures: bool) -> dict[str, Any]:
    """Write the summary and figures of a session that has ended."""
    recording = read_recording(folder / "recording.h5")
    if len(recording.time) == 0:
        raise AsperityError("the session ended before its first tick was recorded")
    rollout = _rollout(recording, np.array(result["status"]))
    motion = {
        "kind": "device", "device": result["device"], "rate_hz": spec.rate,
        "seconds": float(recording.time[-1]),
    }  # fmt: skip
    summary = summary_of(spec.scene, motion, rollout)
    tick = result["timing"]["stages_us"]["tick"]
    summary["tick_seconds"] = 1.0 / spec.rate
    summary["tick_us"] = {"median": tick["p50"], **{name: tick[name] for name in _TICK_US}}
    summary |= {name: result[name] for name in _RESULTS}
    run = Run(rollout, _moment(spec.scene, rollout), summary)
    write_summary(run, folder / "summary.json")
    if figures:
        write_figures(run, take_pictures(run, spec.scene), folder)
    return summary


def _rollout(recording: Recording, statuses: Any) -> Rollout:
    names = ("time", "handle_pose", "tool_pose", "contact_wrench", "device_wrench")
    arrays = {name: getattr(recording, name) for name in (*names, "contact_count", "flags")}
    none = np.zeros(len(recording.time))
    return Rollout(**arrays, tick_seconds=none, statuses=statuses)


def _moment(scene: Scene, rollout: Rollout) -> ContactMoment:
    """Return the contact at the instant of the largest force, recomputed."""
    hardest = int(np.argmax(np.linalg.norm(rollout.contact_wrench[:, :3], axis=1)))
    stage = ToolContact(scene)
    pose = rollout.tool_pose[hardest]
    stage.evaluate(pose)
    return ContactMoment.of(float(rollout.time[hardest]), pose, stage.contacts, stage.displacements)
