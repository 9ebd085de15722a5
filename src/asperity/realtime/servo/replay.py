"""Replay of a recorded session: its handle moves through its scene again, in simulated time.

In a replay nothing is late, no safety limit acts and every contact is computed, so the differences
from the recording are the effects of these. A recording of `asperity run` without a device is
reproduced exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.errors import AsperityError
from asperity.runs.recording import Recording
from asperity.runs.run_scene import Run, run_scene
from asperity.scene.builtin import load_scene
from asperity.scene.scene import Scene, scene_of
from asperity.scene.trajectory import Trajectory
from asperity.simulation.simulation import Rollout
from asperity.simulation.tool_contact import CUT_SHORT, FALLBACK, LATE, LIMITED, PASSIVITY, SILENT

TOUCHED = FALLBACK | LATE | LIMITED | PASSIVITY | SILENT | CUT_SHORT
"""Flags of ticks whose wrench was altered."""
SCENE_BESIDE = "scene"
"""Name of the folder beside a recording that holds its scene."""
_SECTIONS = ("bodies", "force", "coupling")
"""Sections of a scene's document that are restored from the recording."""


def scene_of_recording(
    attributes: Mapping[str, Any], scene: str | None = None, *, beside: Path | None = None
) -> Scene:
    """Return the scene in which a recording was made.

    Parameters
    ----------
    attributes : mapping
        Attributes of the recording.
    scene : str, optional
        Name or folder of a scene. Default: the folder `scene` beside the recording, if there is
        one, else the scene that the recording names.
    beside : Path, optional
        Folder of the recording.

    Raises
    ------
    AsperityError
        The recording names no scene, or that scene is not found.
    """
    import json

    source = scene or attributes.get("source") or attributes.get("scene")
    if scene is None and beside is not None and (beside / SCENE_BESIDE).is_dir():
        source = str(beside / SCENE_BESIDE)
    if not source:
        raise AsperityError("the recording does not say its scene; give it with --scene")
    try:
        found = load_scene(str(source))
    except AsperityError as error:
        raise AsperityError(f"{error}; or give the scene with --scene") from None
    try:
        document = json.loads(str(attributes["document"]))
    except (KeyError, json.JSONDecodeError):
        return found
    if scene is not None:
        return found
    # Whole sections, because the keys depend on the kind of texture.
    sections = {key: document[key] for key in _SECTIONS if key in document}
    restored = {**found.document, **sections}
    return replace(
        scene_of(found.xml, restored, name=found.name, folder=found.folder), notes=found.notes
    )


def replay(
    recording: Recording,
    scene: Scene,
    path: Path,
    *,
    on_tick: Callable[[int, Rollout], None] = lambda _, __: None,
) -> Run:
    """Move the recorded handle through a scene; write a new recording to `path`.

    The run's summary gets `replay`: the largest and the RMS difference between the wrenches, over
    all ticks and over the unaltered ones.
    """
    if len(recording.time) < 2:
        raise AsperityError(f"the recording has {len(recording.time)} ticks; 2 are needed")
    name = str(recording.attributes.get("scene", "recording"))
    dt = float(recording.attributes.get("dt", np.median(np.diff(recording.time))))
    trajectory = Trajectory(
        recording.time - recording.time[0], recording.handle_pose, f"replay of {name}"
    )
    run = run_scene(scene, path, motion=trajectory, dt=dt, on_tick=on_tick)
    run.summary["replay"] = differences(recording, run.rollout, dt)
    return run


def differences(recording: Recording, rollout: Rollout, dt: float) -> dict[str, Any]:
    """Return how far a replay's wrenches are from the recorded ones, for the summary."""
    row = np.rint((recording.time - recording.time[0]) / dt).astype(np.int64)
    # The servo loop records the contact that a tick used: except in the direct mode, the last one.
    lag = int(recording.attributes.get("contact_lag", 0))
    there = (row < len(rollout.time)) & (row >= lag)
    untouched = there & (recording.flags & TOUCHED == 0)
    out: dict[str, Any] = {"ticks": int(there.sum()), "ticks_untouched": int(untouched.sum())}
    for what, shift in (("contact_wrench", lag), ("device_wrench", 0)):
        apart = np.zeros((len(row), 6))
        apart[there] = getattr(rollout, what)[row[there] - shift] - getattr(recording, what)[there]
        force = np.linalg.norm(apart[:, :3], axis=1)
        torque = np.linalg.norm(apart[:, 3:], axis=1)
        at = int(np.argmax(np.where(there, force, -1.0)))
        out[what] = {
            "largest_force_n": float(force[there].max(initial=0.0)),
            "at_s": float(recording.time[at]),
            "rms_force_n": _rms(force[there]),
            "largest_torque_n_m": float(torque[there].max(initial=0.0)),
            "largest_force_untouched_n": float(force[untouched].max(initial=0.0)),
            "rms_force_untouched_n": _rms(force[untouched]),
        }
    return out


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
