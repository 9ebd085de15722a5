"""Combinations of kind "scene": each is one run of a scene in simulated time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.data import table_beside
from asperity.contact.response.settings import ForceSettings
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.virtual_coupling.settings import CouplingSettings
from asperity.errors import AsperityError, require_between, require_choice
from asperity.runs.run_scene import Run, run_scene
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_rms, spectrum
from asperity.scene.builtin import PROBE_PLATES, SCENES, load_scene, probe_plate
from asperity.scene.document import arguments, at, beside, require_keys
from asperity.scene.scene import Scene
from asperity.scene.sections import ANTI_ALIAS_MODES
from asperity.scene.texture import body_texture, with_seed
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.sweeps.study import Runner, flatten, hash_content, nest, seed_of

_INNER = ("trajectory.", "force.", "coupling.", "hand", "dt")
"""Prefixes of parameters that leave the bodies of the scene as they are."""
_WHOLE = ("repeat",)
_BATCH = (1, 4)
"""Least and largest number of combinations in a block; each takes seconds."""
SEEDS = ("scene", "content")


@dataclass
class _Own:
    """Parameters that `scene.toml` does not have."""

    scene: str = ""
    seeds: str = "scene"
    hand: bool = False
    dt: float = 1e-3
    repeat: int = 0


_OWN = tuple(f.name for f in fields(_Own))
_SECTIONS: dict[str, Any] = {
    "force": ForceSettings, "coupling": CouplingSettings, "trajectory": ScriptedMotion,
}  # fmt: skip
_MAKES = _SECTIONS | {"hand": Hand, "probe": probe_plate}
"""What checks a value, by the section of its key."""
_EXTRA = {"force": ("anti_alias",), "trajectory": ("file",), "coupling": ()}
PROBE = "probe.diameter"
"""Diameter of the tip in the built-in scenes `PROBE_PLATES`."""
_HAND = tuple(f"hand.{f.name}" for f in fields(Hand))
_KEYS = (
    *_OWN,
    PROBE,
    *_HAND,
    *(
        f"{section}.{name}"
        for section, makes in _SECTIONS.items()
        for name in (*(f.name for f in fields(makes)), *_EXTRA[section])
    ),
)
"""Valid keys; those under `bodies` depend on the scene."""
_TABLES = table_beside(__file__, "parameters.toml")["scene"]
_UNITS: dict[str, str] = _TABLES["units"]
"""Of the last part of a key."""

_NUMBERS = {name: (unit, label) for name, (unit, label) in _TABLES["numbers"].items()}
"""What can be kept of a run: name -> (unit, label). No times, because they do not repeat."""
_DEFAULT_KEEP = (
    "mean_force_n", "largest_force_n", "largest_torque_n_m", "vibration_rms_n", "band_rms_n",
    "contacts.mean", "status.certified", "status.budget_spent",
)  # fmt: skip


def _checked(values: Mapping[str, Any], where: str, folder: Path) -> dict[str, Any]:
    """Return values with dotted keys in the types of their parameters; refuse invalid ones.

    Values under `bodies` are checked with their scene, in `_check_together`.
    """
    plain = {k: v for k, v in values.items() if not k.startswith("bodies.")}
    require_keys(plain, where, [*_KEYS, "bodies.NAME.texture.KEY"])
    out = dict(values)
    for key, value in plain.items():
        section, dot, name = key.partition(".")
        place = f"{where}.{key}"
        if key == "force.anti_alias":
            at(place, partial(require_choice, "mode", value, ANTI_ALIAS_MODES))
        elif key == "trajectory.file":
            if not isinstance(value, str) or not beside(folder, value).is_file():
                raise AsperityError(f"{place}: no such file: {value!r}")
        elif dot:
            makes = _MAKES[section]
            options = arguments({name: value}, f"{where}.{section}", makes)
            at(place, partial(makes, **options))
            out[key] = list(options[name]) if isinstance(options[name], tuple) else options[name]
        else:
            out |= arguments({key: value}, where, _Own)
    if "seeds" in out:
        at(f"{where}.seeds", partial(require_choice, "seeds", out["seeds"], SEEDS))
    if "dt" in out:
        require_between(f"{where}.dt", out["dt"], 1e-5, 0.1, "s")
    if "scene" in out:
        at(f"{where}.scene", partial(_scene, out["scene"], folder))
    return out


def _scene(name: str, folder: Path) -> Scene:
    """Return a built-in scene, or the scene in a folder beside the study."""
    path = beside(folder, name)
    return load_scene(str(path) if name not in SCENES and path.exists() else name)


def _check_together(
    keep: Sequence[str], fixed: Mapping[str, Any], varied: Mapping[str, Sequence[Any]],
    folder: Path,
) -> None:  # fmt: skip
    """Refuse parameters that do not fit together, such as bodies that a scene lacks."""
    if "scene" not in fixed and "scene" not in varied:
        raise AsperityError(f"fixed.scene is missing: a folder, or one of: {', '.join(SCENES)}")
    everywhere = {"seeds": "scene"} | dict(fixed)
    seeds = varied.get("seeds", [everywhere["seeds"]])
    if "repeat" in varied and "content" not in seeds:
        raise AsperityError(
            'vary.repeat changes seeds alone; it needs fixed.seeds = "content" beside it'
        )
    hands = [key for key in _HAND if key in fixed or key in varied]
    if hands and False in varied.get("hand", [fixed.get("hand", True)]):
        raise AsperityError(f"{hands[0]} needs hand = true")
    of_hand = [name for name in keep if name.startswith("hand.")]
    if of_hand and not hands and "hand" not in varied and not fixed.get("hand"):
        raise AsperityError(f"keep: {', '.join(of_hand)} needs fixed.hand = true")
    for name in varied.get("scene", [fixed.get("scene")]):
        scene = _scene(name, folder)
        if (PROBE in fixed or PROBE in varied) and name not in PROBE_PLATES:
            raise AsperityError(
                f"{PROBE} belongs to the scenes {', '.join(PROBE_PLATES)}, not to {name!r}; "
                "list scenes with other tools under vary.scene"
            )
        # Valid keys of a texture depend on its kind: check each with the first values of others.
        firsts = {key: values[0] for key, values in varied.items()}
        _check_bodies(scene, dict(fixed), "fixed", firsts, folder)
        for key, values in varied.items():
            if key.startswith("bodies."):
                for value in values:
                    _check_bodies(scene, dict(fixed), f"vary.{key}", firsts | {key: value}, folder)


def _check_bodies(
    scene: Scene, fixed: dict[str, Any], where: str, varied: Mapping[str, Any], folder: Path
) -> None:
    """Check the textures of one combination by building those that the study changes."""
    values = fixed | dict(varied)
    bodies = nest({k: v for k, v in values.items() if k.startswith("bodies.")}).get("bodies", {})
    known = scene.document.get("bodies", {})
    names = [body.name for body in scene.bodies]
    require_keys(bodies, "fixed.bodies" if where == "fixed" else "vary.bodies", names)
    for name, body in bodies.items():
        place = f"bodies.{name}"
        require_keys(body, place, ("texture",))
        table = _texture(known.get(name, {}).get("texture", {}), body.get("texture", {}), folder)
        own = folder if "file" in body.get("texture", {}) else scene.folder
        at(where, partial(body_texture, table, f"{place}.texture", own))


def _texture(old: Mapping[str, Any], new: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the table of a texture changed by a study; another kind drops the old keys."""
    fresh = {"kind", "file"} & set(new)
    kept = {} if fresh and any(old.get(k) != new.get(k) for k in fresh) else dict(old)
    table = kept | dict(new)
    if isinstance(new.get("file"), str):
        table["file"] = str(beside(folder, new["file"]))
    return table


def _files_of(columns: Mapping[str, Iterable[Any]], folder: Path) -> dict[str, Path]:
    """Return the files and folders that parameters, key -> values, name: name -> path.

    Files that a scene names are included, because they may be outside its folder.
    """
    out = {}
    for name in columns.get("scene", ()):
        if name not in SCENES:
            out[name] = beside(folder, name)
            out |= {f"{name}: {file}": path for file, path in _scene(name, folder).files.items()}
    for key, values in columns.items():
        if key.endswith(".file"):
            out |= {name: beside(folder, name) for name in values}
    return out


def _unit_and_label(key: str) -> tuple[str, str]:
    """Return the unit of a parameter ("1": none, "": not known), and its axis label."""
    *path, name = key.split(".")
    place = path[1] if path[:1] == ["bodies"] else " ".join(path)
    return _UNITS.get(name, ""), f"{place} {name}".strip().replace("_", " ")


@dataclass
class SceneRuns(Runner):
    """Runs combinations of a study of scenes; neighbours share the scene's bodies."""

    KEYS, INNER, WHOLE, BATCH = _KEYS, _INNER, _WHOLE, _BATCH
    NUMBERS, DEFAULT_KEEP = _NUMBERS, _DEFAULT_KEEP
    checked = staticmethod(_checked)
    check_together = staticmethod(_check_together)
    files_of = staticmethod(_files_of)
    unit_and_label = staticmethod(_unit_and_label)

    _scenes: dict[str, Scene] = field(default_factory=dict, init=False)

    def numbers(
        self, varied: Mapping[str, Any], keep: Sequence[str], more: Sequence[str] = ()
    ) -> list[float]:
        """Run one combination and return its numbers `keep`, then `more`."""
        values = {"dt": _Own.dt, **self.fixed, **varied}
        scene = self._scene_of(values)
        given = {key.partition(".")[2]: values[key] for key in _HAND if key in values}
        hand = Hand(**given) if given else bool(values.get("hand", False))
        run = run_scene(scene, None, dt=values["dt"], hand=hand)
        found = {"coupling.tool_put_back": 0} | flatten(run.summary) | _force_numbers(run)
        missing = next((name for name in keep if name not in found), None)
        if missing is not None:
            raise AsperityError(f"{missing} needs hand = true")
        return [float(found.get(name, math.nan)) for name in (*keep, *more)]

    def _scene_of(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene of a combination; equal bodies are reused from the one before."""
        changes = nest({k: v for k, v in values.items() if k not in _OWN})
        bodies = {k: v for k, v in values.items() if k in ("scene", PROBE)}
        bodies |= {k: v for k, v in changes.items() if k == "bodies"}
        key = hash_content(bodies, values.get("repeat", 0), values.get("seeds"))
        if key not in self._scenes:
            self._scenes = {key: self._with_bodies(values, changes.get("bodies", {}))}
        scene = self._scenes[key]
        sections = {name: dict(changes[name]) for name in _SECTIONS if name in changes}
        motion = sections.get("trajectory", {})
        if "file" in motion:
            sections["trajectory"] = {k: None for k in scene.document.get("trajectory", {})}
            sections["trajectory"]["file"] = str(beside(self.folder, motion["file"]))
        elif "press_force" in motion and "press_depth" not in motion:
            motion["press_depth"] = None
        if values.get("seeds") == "content" and "force.seed" not in values:
            sections["force"] = sections.get("force", {}) | {"seed": seed_of(values, self.seed)}
        changed = scene.changed(**sections) if sections else scene
        return replace(changed, notes=scene.notes)

    def _with_bodies(self, values: Mapping[str, Any], bodies: Mapping[str, Any]) -> Scene:
        scene = _scene(values["scene"], self.folder)
        if PROBE in values:
            texture = scene.document["bodies"]["plate"]["texture"]
            scene = probe_plate(texture, diameter=values[PROBE])
        known = scene.document.get("bodies", {})
        changes: dict[str, Any] = {}
        for name, body in bodies.items():
            old = known.get(name, {}).get("texture", {})
            table = _texture(old, body.get("texture", {}), self.folder)
            changes[name] = {"texture": {k: None for k in old} | table}
        if changes:
            scene = scene.changed(bodies=changes)
        if values.get("seeds") != "content":
            return scene
        seeds: dict[str, Any] = {}
        for name, body in scene.document.get("bodies", {}).items():
            if f"bodies.{name}.texture.seed" not in values:
                texture = body.get("texture", {})
                seeds |= with_seed(
                    {name: body}, seed_of(texture, values.get("repeat", 0), self.seed)
                )
        return scene.changed(bodies=seeds) if seeds else scene


def _force_numbers(run: Run) -> dict[str, float]:
    """Return numbers of the contact force that the run's summary lacks (asperity's own)."""
    force = run.rollout.contact_wrench[:, :3]
    about = force - force.mean(axis=0)
    times = run.rollout.time
    dt = float(times[1] - times[0]) if len(times) > 1 else 1e-3
    power = 0.0
    if len(times) > 8:
        lines = [spectrum(component, dt, periodic=False) for component in force.T]
        power = sum(band_rms(*one, DEFAULT_BAND) ** 2 for one in lines)
    return {
        "mean_force_n": float(np.linalg.norm(force.mean(axis=0))),
        "vibration_rms_n": float(np.sqrt(np.mean(np.sum(about**2, axis=1)))),
        "band_rms_n": float(np.sqrt(power)),
    }
