"""Stimuli: built-in scenes or scenes in folders, with some of their keys changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.scene.builtin import SCENES, load_scene
from asperity.scene.document import Table, at, require_keys, require_table
from asperity.scene.scene import Scene

_STIMULUS = ("scene", "change", "value")


@dataclass(frozen=True)
class Stimulus:
    """A stimulus: its name, and its value on the studied axis, if it has one."""

    name: str
    value: float | None = None


@dataclass(frozen=True)
class Levels:
    """An axis of stimuli: a key of `scene.toml` that takes values.

    Parameters
    ----------
    key : str
        Dotted: `bodies.plate.texture.height`.
    also : mapping
        Other dotted keys, each set to the given multiple of the value.
    label, unit : str
        For tables and figures.
    """

    key: str
    also: Mapping[str, float] = field(default_factory=dict)
    label: str = ""
    unit: str = ""

    def changes(self, value: float) -> dict[str, Any]:
        """Return the sections of `scene.toml` with the keys set."""
        out: dict[str, Any] = {}
        for key, factor in {self.key: 1.0, **self.also}.items():
            *way, last = key.split(".")
            table = out
            for part in way:
                table = table.setdefault(part, {})
            table[last] = value * factor
        return out


@dataclass(frozen=True)
class Stimuli:
    """How every stimulus of an experiment becomes a scene.

    Parameters
    ----------
    base : mapping
        `scene` and `change`: what all share.
    named : mapping
        Stimuli by name, each with `scene`, `change` and `value`, all of which may lack.
    levels : Levels, optional
        The axis, where stimuli are levels on one.
    folder : Path, optional
        Where scenes that are folders are looked for.
    """

    base: Table
    named: Mapping[str, Table]
    levels: Levels | None
    folder: Path | None = None

    def level(self, value: float) -> Stimulus:
        """Return the stimulus at a place on the axis."""
        return Stimulus(f"{value:.9g}", float(value))

    def names(self) -> list[Stimulus]:
        """Return the named stimuli, in the file's order."""
        return [Stimulus(name, table.get("value")) for name, table in self.named.items()]

    def source(self, stimulus: Stimulus) -> str:
        """Return the name or folder of a stimulus's scene."""
        table = self.named.get(stimulus.name, {})
        source: str = table.get("scene") or self.base.get("scene") or ""
        if source in SCENES or self.folder is None or Path(source).is_absolute():
            return source
        beside = self.folder / source
        return str(beside) if beside.exists() else source

    def scene(self, stimulus: Stimulus) -> Scene:
        """Return the scene of a stimulus.

        Raises
        ------
        AsperityError
            As `load_scene`; an unknown key of `scene.toml` by its dotted name.
        """
        scene = load_scene(self.source(stimulus))
        notes = scene.notes
        table = self.named.get(stimulus.name)
        changes = [self.base.get("change", {}), (table or {}).get("change", {})]
        if table is None and self.levels is not None and stimulus.value is not None:
            changes.append(self.levels.changes(stimulus.value))
        for change in changes:
            if change:
                require_keys(change, "", ("bodies", "force", "coupling", "trajectory"))
                scene = scene.changed(**change)
        return replace(scene, notes=notes)


def read_stimuli(document: Table, folder: Path | None) -> Stimuli:
    """Return the stimuli of an experiment's document, its keys and types checked."""
    base = document.get("stimulus", {})
    require_keys(base, "stimulus", ("scene", "change"))
    _check(base, "stimulus")
    named = document.get("stimuli", {})
    for name, table in named.items():
        require_table(table, f"stimuli.{name}")
        require_keys(table, f"stimuli.{name}", _STIMULUS)
        _check(table, f"stimuli.{name}")
        if "scene" not in table and "scene" not in base:
            raise AsperityError(f"stimuli.{name}.scene is missing, and so is stimulus.scene")
    levels = None
    if "levels" in document:
        if "scene" not in base:
            raise AsperityError("stimulus.scene is missing: the scene whose key the levels set")
        levels = _levels(document["levels"])
    if not named and levels is None:
        raise AsperityError("there are no stimuli: give [levels], or a table [stimuli.NAME] each")
    if named and levels is not None and document.get("method") != "matching":
        raise AsperityError("levels and stimuli are both given; give one of them")
    return Stimuli(base, named, levels, folder)


def _check(table: Table, where: str) -> None:
    if "scene" in table and not (isinstance(table["scene"], str) and table["scene"]):
        raise AsperityError(f"{where}.scene must be a text, got {table['scene']!r}")
    require_table(table.get("change", {}), f"{where}.change")
    value = table.get("value")
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise AsperityError(f"{where}.value must be a number, got {value!r}")


def _levels(table: Table) -> Levels:
    require_keys(table, "levels", ("key", "also", "label", "unit", "values"))
    key = table.get("key")
    if not isinstance(key, str) or "." not in key:
        raise AsperityError(
            f"levels.key must be a dotted key of scene.toml, such as bodies.plate.texture.height, "
            f"got {key!r}"
        )
    also = table.get("also", {})
    require_table(also, "levels.also")
    for name, factor in also.items():
        if isinstance(factor, bool) or not isinstance(factor, int | float) or "." not in name:
            raise AsperityError(f"levels.also.{name} must be a dotted key = a factor")
    for name in ("label", "unit"):
        if not isinstance(table.get(name, ""), str):
            raise AsperityError(f"levels.{name} must be a text, got {table[name]!r}")
    return Levels(key, dict(also), table.get("label", key), table.get("unit", ""))


def check_scene(stimuli: Stimuli, stimulus: Stimulus) -> str:
    """Make the scene of a stimulus, refuse what is wrong, and return its digest.

    The digest covers its MJCF, its document and the files that this names, so that a session
    cannot resume with stimuli other than those it began with.
    """
    where = f"stimuli.{stimulus.name}" if stimulus.name in stimuli.named else "stimulus"
    scene = at(f"{where} ({stimulus.name})", lambda: stimuli.scene(stimulus))
    digest = hashlib.sha256(scene.xml.encode())
    digest.update(json.dumps(scene.document, sort_keys=True, default=str).encode())
    for path in _files(scene.document, scene.folder):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _files(document: Any, folder: Path | None) -> list[Path]:
    """Return the files that a scene's document names."""
    if not isinstance(document, Mapping):
        return []
    found = []
    for key, value in document.items():
        if key == "file" and isinstance(value, str):
            path = Path(value) if folder is None else folder / value
            found += [path] if path.is_file() else []
        else:
            found += _files(value, folder)
    return found
