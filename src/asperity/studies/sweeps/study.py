"""STUDY.toml: what is fixed, what varies, in which combinations, and which numbers are kept.

The whole study is checked before anything runs.

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

[zip.person]                  # rows of a table, as one axis
hand.mass = [0.05, 0.1]
hand.stiffness = [300, 500]
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from asperity.errors import AsperityError, require_choice
from asperity.scene.document import at, read_toml, require_keys, require_table, write_toml
from asperity.studies.sweeps.design import LEAF, SweepDesign, Variation, read_design, read_variation

SCHEMA = 1
KINDS = {
    "drag": ("drag_runs", "DragRuns"), "scene": ("scene_runs", "SceneRuns"),
    "function": ("function_runs", "FunctionRuns"),
}  # fmt: skip
"""Kind of study -> module and class that run its combinations.

Each is imported when needed: importing scenes takes as long as importing all that drags need.
"""
_BLOCKS = 20
"""Least number of blocks of a large study: an interrupted sweep loses the blocks in progress."""
_KEYS = ("schema", "title", "kind", "keep", "design", "fixed", "vary", "zip")


@dataclass
class Runner:
    """Runs combinations of a study, one after the other; a subclass is a kind of study."""

    KEYS: ClassVar[tuple[str, ...]] = ()
    """Valid parameters, as dotted keys."""
    INNER: ClassVar[tuple[str, ...]] = ()
    """Prefixes of parameters whose axes come last, because neighbours along them share work."""
    WHOLE: ClassVar[tuple[str, ...]] = ()
    """Parameters that are whole numbers."""
    BATCH: ClassVar[tuple[int, int]] = (1, 256)
    """Least and largest number of combinations in a block."""
    NUMBERS: ClassVar[dict[str, tuple[str, str]]] = {}
    """What can be kept of a combination: name -> (unit, label)."""
    DEFAULT_KEEP: ClassVar[tuple[str, ...]] = ()

    fixed: Mapping[str, Any]
    """Fixed parameters by dotted key, checked."""
    folder: Path
    """Folder to which relative paths refer."""
    seed: int
    """Part of every seed that is derived from content."""

    def numbers(
        self, varied: Mapping[str, Any], keep: Sequence[str], more: Sequence[str] = ()
    ) -> list[float]:
        """Run one combination and return its numbers `keep`, then `more`.

        Of `more`, NaN stands for what the combination does not give.
        """
        raise NotImplementedError

    @staticmethod
    def checked(values: Mapping[str, Any], where: str, folder: Path) -> dict[str, Any]:
        """Return values with dotted keys in the types of their parameters; refuse invalid ones."""
        raise NotImplementedError

    @staticmethod
    def check_together(
        keep: Sequence[str], fixed: Mapping[str, Any], varied: Mapping[str, Sequence[Any]],
        folder: Path,
    ) -> None:  # fmt: skip
        """Refuse parameters, and kept numbers, that do not fit together; by default accept all."""

    @staticmethod
    def files_of(columns: Mapping[str, Iterable[Any]], folder: Path) -> dict[str, Path]:
        """Return the files that parameters, key -> values, name: name -> path."""
        return {}

    @staticmethod
    def unit_and_label(key: str) -> tuple[str, str]:
        """Return the unit of a parameter ("1": none, "": not known), and its axis label."""
        return "", key


def kind_of(name: str) -> type[Runner]:
    """Return the class that runs the combinations of a kind of study."""
    module, of = KINDS[name]
    kind: type[Runner] = getattr(import_module(f"asperity.studies.sweeps.{module}"), of)
    return kind


@dataclass(frozen=True)
class SweepStudy:
    """A study that has been checked.

    Parameters
    ----------
    title : str
    kind : {"drag", "scene"}
        A drag of the 1-D studies, or a run of a scene in simulated time.
    keep : tuple of str
        Names of the numbers that are kept.
    fixed : mapping
        Fixed parameters, by dotted key.
    design : SweepDesign
        Varied parameters and their combinations.
    folder : Path
        Folder to which relative paths refer.
    text : str
        The study as TOML.
    files : mapping
        The files that it names -> hash of their content.
    extras : mapping
        What only the runner needs: a pickled function.
    """

    title: str
    kind: str
    keep: tuple[str, ...]
    fixed: Mapping[str, Any]
    design: SweepDesign
    folder: Path
    text: str
    files: Mapping[str, str]
    extras: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def more(self) -> tuple[str, ...]:
        """Numbers that a combination gives besides, stored so that they may be kept later."""
        return tuple(name for name in kind_of(self.kind).NUMBERS if name not in self.keep)

    @property
    def numbers(self) -> tuple[str, ...]:
        """All numbers that are stored: `keep`, then `more`."""
        return (*self.keep, *self.more)

    @property
    def size(self) -> int:
        """How many combinations there are."""
        return self.design.size

    @property
    def fingerprint(self) -> str:
        """Hash of everything that determines the results, except the program."""
        axes = [[axis.name, axis.columns] for axis in self.design.axes]
        seed = self.design.seed
        return hash_content(self.kind, self.keep, dict(self.fixed), axes, seed, dict(self.files))

    @property
    def basis(self) -> str:
        """Hash of what determines each combination's results beside its varied parameters."""
        return hash_content(self.kind, dict(self.fixed), self.design.seed)

    @property
    def block(self) -> int:
        """Largest number of combinations in a block, which are written together."""
        low, high = kind_of(self.kind).BATCH
        if self.files:
            low, high = 1, 16  # a drag over a height map takes a thousand times as long
        return max(min(self.size // _BLOCKS, high), low)

    @property
    def least(self) -> int:
        """Smallest number of combinations that is worth sending to a worker."""
        return 1 if self.files else int(kind_of(self.kind).BATCH[0])

    def attributes(self, key: str) -> dict[str, str]:
        """Return label and unit of a parameter or of a kept number, as xarray names them."""
        of = kind_of(self.kind)
        unit, label = of.NUMBERS[key] if key in of.NUMBERS else of.unit_and_label(key)
        return {"long_name": label} | ({"units": unit} if unit else {})


def read_study(source: str | Path | Mapping[str, Any], *, folder: Path | None = None) -> SweepStudy:
    """Read and check a study.

    Parameters
    ----------
    source : path or mapping
        STUDY.toml, or its content.
    folder : Path, optional
        Folder to which relative paths of a mapping refer; by default the current folder.

    Raises
    ------
    AsperityError
        One line: the dotted key, its value, and what would be valid.
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
    for section in ("design", "fixed", "vary", "zip"):
        require_table(document.get(section, {}), section)
    of = kind_of(kind)
    keep = _kept(document.get("keep", list(of.DEFAULT_KEEP)), of)
    fixed = of.checked(flatten(document.get("fixed", {})), "fixed", folder)
    tables = {"vary": flatten(document.get("vary", {}), LEAF)} | _zipped(document, of)
    if not any(tables.values()):
        raise AsperityError("vary is empty: name at least one parameter with several values")
    _refuse_twice({"fixed": fixed} | tables)
    read = {where: _variations(table, where, of, folder) for where, table in tables.items()}
    every = [variation for some in read.values() for variation in some]
    of.check_together(keep, fixed, {v.key: v.extremes for v in every}, folder)
    rows = {where.removeprefix("zip."): some for where, some in read.items() if where != "vary"}
    design = read_design(document.get("design", {}), read["vary"], of.INNER, rows)
    named = {key: [value] for key, value in fixed.items()} | {v.key: v.extremes for v in every}
    files = {name: hash_file(path) for name, path in of.files_of(named, folder).items()}
    return SweepStudy(title, kind, keep, fixed, design, folder, text, files)


def _zipped(document: Mapping[str, Any], of: type[Runner]) -> dict[str, dict[str, Any]]:
    """Return the tables under `[zip]`: `zip.NAME` -> dotted key -> values."""
    out = {}
    for name, table in document.get("zip", {}).items():
        require_table(table, f"zip.{name}")
        rows = out[f"zip.{name}"] = flatten(table, LEAF)
        if name in (*of.KEYS, *of.NUMBERS, "sample", "combination", "state", "error"):
            raise AsperityError(f"zip.{name}: the store has something else of that name")
        if len(rows) < 2:
            raise AsperityError(f"zip.{name} must name at least two parameters")
        for key, spec in rows.items():
            if not isinstance(spec, list):
                raise AsperityError(f"zip.{name}.{key} must be a list of values, got {spec!r}")
    return out


def _refuse_twice(tables: Mapping[str, Mapping[str, Any]]) -> None:
    """Raise if a parameter is in two tables."""
    for (one, first), (other, second) in itertools.combinations(tables.items(), 2):
        for key in second:
            if key in first:
                raise AsperityError(f"{key} is under {one} and under {other}; remove one of them")


def _variations(
    table: Mapping[str, Any], where: str, of: type[Runner], folder: Path
) -> list[Variation]:
    """Return the variations of a table, checked."""
    require_keys(table, where, [*of.KEYS, *(k for k in table if k.startswith("bodies."))])
    return [
        _checked(read_variation(key, spec, folder, key in of.WHOLE, where), where, of, folder)
        for key, spec in table.items()
    ]


def _kept(names: Any, of: type[Runner]) -> tuple[str, ...]:
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise AsperityError(f"keep must be a list of names, got {names!r}")
    for i, name in enumerate(names):
        at(f"keep[{i}]", partial(require_choice, "number", name, of.NUMBERS))
    if len(set(names)) != len(names):
        raise AsperityError(f"keep names something twice: {', '.join(names)}")
    return tuple(names)


def _checked(variation: Variation, where: str, of: type[Runner], folder: Path) -> Variation:
    """Return a variation whose values are valid and have the parameter's type."""
    key = variation.key
    values = [of.checked({key: value}, where, folder)[key] for value in variation.extremes]
    if variation.values is not None:
        return variation._replace(values=values)
    if not all(type(v) in (int, float) and math.isfinite(v) for v in values):
        raise AsperityError(
            f"vary.{key} is not a number, so it has no range; give its values as a list"
        )
    return variation


_SEEDS = 2**31 - 1


def hash_content(*parts: Any) -> str:
    """Return the SHA-256 of numbers, texts, lists and tables, regardless of the order of keys."""
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def seed_of(*parts: Any) -> int:
    """Return a seed, 0 to 2^31 - 2, that depends on the content of `parts` alone."""
    return int(hash_content(*parts)[:16], 16) % _SEEDS


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of all files in a folder."""
    if not path.is_dir():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    files = sorted(file for file in path.rglob("*") if file.is_file())
    return hash_content([[file.relative_to(path).as_posix(), hash_file(file)] for file in files])


def flatten(table: Mapping[str, Any], leaf: Iterable[str] = (), where: str = "") -> dict[str, Any]:
    """Return nested tables as one with dotted keys.

    A table with one of the keys `leaf` is kept as a value.
    """
    out: dict[str, Any] = {}
    words = set(leaf)
    for name, value in table.items():
        key = f"{where}.{name}" if where else name
        if isinstance(value, Mapping) and value and not words & set(value):
            out |= flatten(value, words, key)
        else:
            out[key] = value
    return out


def nest(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with dotted keys as nested tables."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        *path, name = key.split(".")
        place = out
        for part in path:
            place = place.setdefault(part, {})
        place[name] = value
    return out
