"""The tool's motion from the options of a command: `asperity run` and `asperity compare`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity._core.unpacking import suffix_of
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.scene.scene import Scene
    from asperity.scene.trajectory import ScriptedMotion, Trajectory

POSE_FILES = (".csv", ".txt", ".tsv", ".tum", ".json", ".jsonl", ".ndjson", ".npy", ".npz")


def motion_of(
    scene: Scene, option: str, kind: str | None, changes: dict[str, Any]
) -> ScriptedMotion | Trajectory:
    """Return the scene's motion with what the options change.

    Parameters
    ----------
    scene : Scene
    option : str
        Name of the option that gives the kind, for messages.
    kind : str, optional
        A kind of scripted motion, or a file of poses. Default: the scene's.
    changes : dict
        Fields of `ScriptedMotion` in SI units; None for those that are not given. A press force
        takes the place of the scene's press depth.
    """
    from asperity.scene.document import arguments
    from asperity.scene.shorthand import file_table
    from asperity.scene.trajectory import KINDS, ScriptedMotion
    from asperity.scene.trajectory_file import read_poses

    given = {name: value for name, value in changes.items() if value is not None}
    if kind is not None and kind not in KINDS:
        table = file_table(kind)
        if suffix_of(Path(table["file"]), POSE_FILES) in POSE_FILES:
            if given:
                raise AsperityError(
                    f"{option} {kind} is a file of poses, which fixes {', '.join(given)}; "
                    "leave these options out"
                )
            rest = {key: value for key, value in table.items() if key != "file"}
            return read_poses(table["file"], **arguments(rest, option, read_poses))
        require_choice(option, kind, [*KINDS, "FILE.csv, .json, .npy or .npz"])
    motion = scene.motion
    if not isinstance(motion, ScriptedMotion):
        if kind is None and not given:
            return motion
        motion = ScriptedMotion()
    if "press_force" in given:
        motion = replace(motion, press_depth=None)
    return replace(motion, **given, kind=kind or motion.kind)
