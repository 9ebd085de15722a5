"""STUDY.toml: what stays, what varies, which combinations, what is kept. Checked as a whole.

schema = 1
kind = "drag"                 # or "scene"
keep = ["max_acceleration", "band_rms"]

[design]
kind = "grid"                 # latin-hypercube, sobol, list

[fixed]
diameter = 3e-3

[vary]
spacing = { from = 0.5e-3, to = 3.5e-3, count = 40, scale = "log" }
speed = [0.042, 0.083, 0.169]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from asperity.errors import AsperityError, require_choice
from asperity.scene.document import at, read_toml, require_keys, require_table, write_toml
from asperity.studies.sweeps.content import digest, file_digest, flat
from asperity.studies.sweeps.design import LEAF, SweepDesign, Variation, read_design, read_variation

SCHEMA = 1
KINDS = {"drag": "asperity.studies.sweeps.drags", "scene": "asperity.studies.sweeps.scene_runs"}
"""What is run for each combination; the modules have the same names in them.

Loaded when used: workers on drags have no need of scenes, which take as long to load.
"""
_BLOCKS = 20
"""At least, of a study of many combinations: what is not written yet is lost with the program."""
_KEYS = ("schema", "title", "kind", "keep", "design", "fixed", "vary")


def _module(kind: str) -> ModuleType:
    return import_module(KINDS[kind])


class Runner(Protocol):
    """Runs combinations, one after the other."""

    def numbers(self, varied: Mapping[str, Any], keep: Sequence[str]) -> list[float]:
        """Return what is kept of one combination."""


@dataclass(frozen=True)
class SweepStudy:
    """A checked study.

    Parameters
    ----------
    title : str
    kind : {"drag", "scene"}
        A drag of the 2-D study, or a run of a scene in simulated time.
    keep : tuple of str
        Names of the numbers that are kept.
    fixed : mapping
        Values that stay, by dotted key.
    design : Design
        What varies, and all combinations.
    folder : Path
        Where relative files lie.
    text : str
        The study as TOML.
    files : mapping
        The files that it names, with a hash of what is in them.
    """

    title: str
    kind: str
    keep: tuple[str, ...]
    fixed: Mapping[str, Any]
    design: SweepDesign
    folder: Path
    text: str
    files: Mapping[str, str]

    @property
    def size(self) -> int:
        """How many combinations there are."""
        return self.design.size

    @property
    def fingerprint(self) -> str:
        """Hash of everything that the results follow from, but for the program."""
        axes = [[axis.name, axis.columns] for axis in self.design.axes]
        seed = self.design.seed
        return digest(self.kind, self.keep, dict(self.fixed), axes, seed, dict(self.files))

    @property
    def block(self) -> int:
        """How many combinations are written together, at most."""
        low, high = _module(self.kind).BATCH
        if self.files:
            low, high = 1, 16  # a height map costs a thousand times a shape
        return max(min(self.size // _BLOCKS, high), low)

    @property
    def least(self) -> int:
        """How few combinations are worth a batch of their own."""
        return 1 if self.files else int(_module(self.kind).BATCH[0])

    def unit(self, key: str) -> str:
        """Return the unit of a parameter or of a number that is kept; "" if there is none."""
        of = _module(self.kind)
        return str(of.NUMBERS[key][0] if key in of.NUMBERS else of.unit_of(key))

    def label(self, key: str) -> str:
        """Return what a parameter, or a number that is kept, is called on an axis."""
        of = _module(self.kind)
        return str(of.NUMBERS[key][1] if key in of.NUMBERS else of.label_of(key))


def read_study(source: str | Path | Mapping[str, Any], *, folder: Path | None = None) -> SweepStudy:
    """Return a study, checked as a whole.

    Parameters
    ----------
    source : path or mapping
        STUDY.toml, or what would stand in it.
    folder : Path, optional
        Where relative files lie, for a mapping; by default the current folder.

    Raises
    ------
    AsperityError
        One line: the dotted key, what stands there, and what is valid.
    """
    if isinstance(source, Mapping):
        return _study(source, folder or Path.cwd(), "sweep", write_toml(source))
    path = Path(source)
    if not path.is_file():
        raise AsperityError(f"no such file: {path}; give a study, STUDY.toml")
    document = read_toml(path)
    return at(
        str(path),
        lambda: _study(document, path.absolute().parent, path.stem, path.read_text("utf-8")),
    )


def _study(document: Mapping[str, Any], folder: Path, name: str, text: str) -> SweepStudy:
    require_keys(document, "", _KEYS)
    if document.get("schema") != SCHEMA or isinstance(document.get("schema"), bool):
        raise AsperityError(f"schema must be {SCHEMA}, got {document.get('schema')!r}")
    kind, title = document.get("kind", "drag"), document.get("title", name)
    require_choice("kind", kind, KINDS)
    if not isinstance(title, str):
        raise AsperityError(f"title must be a text, got {title!r}")
    for section in ("design", "fixed", "vary"):
        require_table(document.get(section, {}), section)
    of = _module(kind)
    keep = _kept(document.get("keep", list(of.DEFAULT_KEEP)), of)
    fixed = of.checked(flat(document.get("fixed", {})), "fixed", folder)
    told = flat(document.get("vary", {}), LEAF)
    if not told:
        raise AsperityError("vary is empty: name at least one parameter with several values")
    for key in told:
        if key in fixed:
            raise AsperityError(f"{key} stands under fixed and under vary; leave one out")
    require_keys(told, "vary", [*of.KEYS, *(k for k in told if k.startswith("bodies."))])
    variations = [_checked(read_variation(key, v, folder), of, folder) for key, v in told.items()]
    if kind == "scene":
        of.check_whole(fixed, {v.key: v.extremes for v in variations}, folder)
        _refuse_unfelt(keep, fixed, told)
    design = read_design(document.get("design", {}), variations, of.INNER)
    named = {key: [value] for key, value in fixed.items()} | {v.key: v.extremes for v in variations}
    files = {name: file_digest(path) for name, path in of.files_of(named, folder).items()}
    return SweepStudy(title, kind, keep, fixed, design, folder, text, files)


def _kept(names: Any, of: ModuleType) -> tuple[str, ...]:
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise AsperityError(f"keep must be a list of names, got {names!r}")
    for i, name in enumerate(names):
        at(f"keep[{i}]", lambda name=name: require_choice("number", name, of.NUMBERS))  # type: ignore[misc]
    if len(set(names)) != len(names):
        raise AsperityError(f"keep names something twice: {', '.join(names)}")
    return tuple(names)


def _refuse_unfelt(keep: Iterable[str], fixed: Mapping[str, Any], told: Mapping[str, Any]) -> None:
    of_hand = [name for name in keep if name.startswith("hand.")]
    parts = any(key.startswith("hand.") for key in (*told, *fixed))
    if of_hand and "hand" not in told and not fixed.get("hand") and not parts:
        raise AsperityError(f"keep: {', '.join(of_hand)} needs fixed.hand = true")


def _checked(variation: Variation, of: ModuleType, folder: Path) -> Variation:
    """Return a variation with its values as the parameter has them, all of them valid."""
    key = variation.key
    values = [of.checked({key: value}, "vary", folder)[key] for value in variation.extremes]
    if variation.values is not None:
        return variation._replace(values=values)
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in values) or not all(
        map(math.isfinite, values)
    ):
        raise AsperityError(f"vary.{key} has no range; give its values as a list")
    return variation


def runner(kind: str, fixed: Mapping[str, Any], folder: Path, seed: int) -> Runner:
    """Return what runs the combinations of a kind of study."""
    made: Runner = _module(kind).runner(fixed, folder, seed)
    return made
