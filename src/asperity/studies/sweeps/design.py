"""Which combinations a study has: full grids, sampled designs, lists.

In a grid every variation is an axis. In a sampled design the ranges without a `count`, and the
values under `choose`, are drawn together, along the axis `sample`; all other variations cross it.
In a list all variations go along together, along the axis `combination`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_choice
from asperity.scene.document import at, beside, require_keys
from asperity.texture.files.arrays import INSTRUMENT_SUFFIXES
from asperity.texture.files.images import IMAGE_SUFFIXES

DESIGNS = ("grid", "latin-hypercube", "sobol", "list")
SCALES = ("linear", "log")
LEAF = ("from", "to", "values", "choose", "folder")
"""Keys that tell the table of a variation from a table of variations."""
_KEYS = ("from", "to", "count", "scale", "whole", "values", "choose", "folder", "pattern")
_MAPS = {*INSTRUMENT_SUFFIXES, *IMAGE_SUFFIXES, ".npy", ".npz"}
"""What a folder's files are called that are taken if no pattern is given. Text files may be maps,
too, but are more often about them."""
MOST = 10_000_000
"""Combinations of one study."""


class Variation(NamedTuple):
    """How one parameter varies: over `values`, or, where that is None, anywhere in a range."""

    key: str
    values: list[Any] | None
    low: float
    high: float
    log: bool
    whole: bool
    drawn: bool
    """Whether it is sampled rather than an axis of its own."""

    @property
    def extremes(self) -> list[Any]:
        """Every value that can occur, or both ends of the range."""
        if self.values is not None:
            return self.values
        return [int(self.low), int(self.high)] if self.whole else [self.low, self.high]

    def at(self, part: NDArray[np.float64]) -> list[Any]:
        """Return the values at parts, 0 to 1, of the range."""
        if self.values is not None:
            last = len(self.values) - 1
            return [self.values[min(int(p * len(self.values)), last)] for p in part]
        if self.whole:
            span = self.high - self.low + 1.0
            return [int(min(self.low + math.floor(p * span), self.high)) for p in part]
        if self.log:
            ratio = math.log(self.high / self.low)
            return [float(self.low * math.exp(p * ratio)) for p in part]
        return [float(self.low + p * (self.high - self.low)) for p in part]


class Axis(NamedTuple):
    """One dimension of the results, with what varies along it: key -> values."""

    name: str
    columns: dict[str, list[Any]]

    @property
    def size(self) -> int:
        """How many places it has."""
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True)
class SweepDesign:
    """All combinations of a study: the outer product of its axes, the last one fastest."""

    kind: str
    seed: int
    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of places on each axis."""
        return tuple(axis.size for axis in self.axes)

    @property
    def size(self) -> int:
        """How many combinations there are."""
        return math.prod(self.shape)

    def columns(self, numbers: Sequence[int]) -> dict[str, list[Any]]:
        """Return what varies, key -> values, of the combinations with these numbers from 0."""
        places = np.unravel_index(np.asarray(numbers, dtype=np.int64), self.shape)
        return {
            key: [values[i] for i in place]
            for axis, place in zip(self.axes, places, strict=True)
            for key, values in axis.columns.items()
        }


def read_variation(key: str, told: Any, folder: Path) -> Variation:
    """Return what stands under `[vary]` for one parameter, checked.

    Parameters
    ----------
    key : str
        Dotted key of the parameter.
    told : list or mapping
        Values; or a table: `from`, `to` with `count` and `scale`; `values`; `choose`; `folder`
        with `pattern`.
    folder : Path
        Where relative folders begin.
    """
    where = f"vary.{key}"
    if isinstance(told, list):
        told = {"values": told}
    if not isinstance(told, Mapping):
        raise AsperityError(
            f"{where} must be a list of values or a range {{from = ..., to = ...}}, got {told!r}; "
            f"a value that stays stands under fixed.{key}"
        )
    require_keys(told, where, _KEYS)
    given = [name for name in ("from", "values", "choose", "folder") if name in told]
    if len(given) != 1:
        raise AsperityError(f"{where} needs one of from (and to), values, choose, folder")
    way = given[0]
    goes_with = {"from": {"to", "count", "scale", "whole"}, "folder": {"pattern"}}.get(way, set())
    for name in told:
        if name != way and name not in goes_with:
            raise AsperityError(f"{where}.{name} does not go with {where}.{way}")
    if way == "from":
        return _range(key, told, where)
    values = _files(where, told, folder) if way == "folder" else told[way]
    if not isinstance(values, list) or not values:
        raise AsperityError(f"{where}.{way} must be a list of at least one value, got {values!r}")
    if len({_same(value) for value in values}) != len(values):
        twice = next(v for v in values if values.count(v) > 1)
        raise AsperityError(f"{where} has the value {twice!r} twice")
    return Variation(key, list(values), 0.0, 1.0, False, False, way == "choose")


def _same(value: Any) -> str:
    """Return what two values share that are one: 1 and 1.0, but not true."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return repr(float(value) if number else value)


def _range(key: str, told: Mapping[str, Any], where: str) -> Variation:
    low, high = _number(told, "from", where), _number(told, "to", where)
    if not high > low:
        raise AsperityError(f"{where} must rise, got {low:g} to {high:g}")
    scale = told.get("scale", "linear")
    at(f"{where}.scale", lambda: require_choice("scale", scale, SCALES))
    if scale == "log" and not low > 0.0:
        raise AsperityError(f"{where}.from must be above 0 for a log scale, got {low:g}")
    whole = told.get("whole", False)
    if not isinstance(whole, bool):
        raise AsperityError(f"{where}.whole must be true or false, got {whole!r}")
    if whole and (low % 1 or high % 1 or scale == "log"):
        raise AsperityError(f"{where}: whole numbers need a linear range from whole to whole")
    drawn = Variation(key, None, low, high, scale == "log", whole, True)
    if "count" not in told:
        return drawn
    count = _whole(told, "count", where, 2, MOST)
    if whole and count != high - low + 1:
        raise AsperityError(f"{where}.count must be {int(high - low) + 1}, every whole number")
    if whole:
        values: list[Any] = list(range(int(low), int(high) + 1))
    else:
        values = drawn.at(np.arange(count) / (count - 1))
        values[-1] = high
    return Variation(key, values, low, high, scale == "log", whole, False)


def _number(told: Mapping[str, Any], name: str, where: str) -> float:
    value = told.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AsperityError(f"{where}.{name} must be a finite number, got {value!r}")
    return float(value)


def _whole(told: Mapping[str, Any], name: str, where: str, low: int, high: int) -> int:
    value = told.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise AsperityError(
            f"{where}.{name} must be a whole number from {low} to {high}, got {value!r}"
        )
    return value


def _files(where: str, told: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the files of a folder, as the study would name them one by one."""
    name, pattern = told["folder"], told.get("pattern", "*")
    for key, value in (("folder", name), ("pattern", pattern)):
        if not isinstance(value, str):
            raise AsperityError(f"{where}.{key} must be a text, got {value!r}")
    place = beside(folder, name)
    if not place.is_dir():
        raise AsperityError(f"{where}.folder: no such folder: {place}")
    files = sorted(p.name for p in place.glob(pattern) if p.is_file() and p.name[0] != ".")
    if "pattern" not in told and not where.endswith("trajectory.file"):
        files = [file for file in files if Path(file).suffix.lower() in _MAPS]
    if not files:
        wanted = f"is called {pattern}" if "pattern" in told else "is a map of heights"
        raise AsperityError(f"{where}: no file in {place} {wanted}")
    return [(Path(name) / file).as_posix() for file in files]


def read_design(
    told: Mapping[str, Any], variations: Sequence[Variation], inner: Sequence[str]
) -> SweepDesign:
    """Return the combinations of the variations, as `[design]` says.

    Parameters
    ----------
    told : mapping
        `kind`, `count`, `seed`.
    variations : sequence of Variation
    inner : sequence of str
        Beginnings of the keys whose axes come last, where neighbours share work.
    """
    require_keys(told, "design", ("kind", "count", "seed"))
    kind = told.get("kind", "grid")
    at("design.kind", lambda: require_choice("design", kind, DESIGNS))
    seed = _whole({"seed": 0} | dict(told), "seed", "design", 0, 2**31 - 1)
    if kind in ("grid", "list") and "count" in told:
        raise AsperityError(f"design.count is for sampled designs; a {kind} has as many as it has")
    drawn = [v for v in variations if v.drawn]
    fixed = [v for v in variations if not v.drawn]
    fixed.sort(key=lambda v: v.key.startswith(tuple(inner)))
    if kind in ("grid", "list"):
        if drawn:
            what = "choose" if drawn[0].values is not None else "a range without count"
            raise AsperityError(
                f"vary.{drawn[0].key}: {what} is for sampled designs (design.kind = "
                f'"latin-hypercube" or "sobol"); give {"values" if what == "choose" else "count"}'
            )
        axes = [Axis(v.key, {v.key: v.values or []}) for v in fixed]
        if kind == "list":
            axes = [_together(axes)]
    else:
        axes = [_sampled(kind, told, seed, drawn), *(Axis(v.key, {v.key: v.values or []})
                for v in fixed)]  # fmt: skip
    design = SweepDesign(kind, seed, tuple(axes))
    if design.size > MOST:
        raise AsperityError(f"the study has {design.size} combinations; valid: {MOST} at most")
    return design


def _together(axes: Sequence[Axis]) -> Axis:
    sizes = {axis.name: axis.size for axis in axes}
    if len(set(sizes.values())) != 1:
        told = ", ".join(f"{size} of {name}" for name, size in sizes.items())
        raise AsperityError(f"in a list every variation has equally many values, got {told}")
    return Axis("combination", {axis.name: axis.columns[axis.name] for axis in axes})


def _sampled(kind: str, told: Mapping[str, Any], seed: int, drawn: Sequence[Variation]) -> Axis:
    """Return the drawn variations along one axis."""
    from scipy.stats import qmc  # slow to import, and seldom needed

    if not drawn:
        raise AsperityError(
            f'design.kind = "{kind}" draws ranges without count; every one under [vary] has one'
        )
    if "count" not in told:
        raise AsperityError("design.count is missing: how many points are drawn")
    count = _whole(told, "count", "design", 2, MOST)
    if kind == "sobol" and count & (count - 1):
        below = 1 << (count.bit_length() - 1)
        raise AsperityError(
            f"design.count must be a power of two for sobol, {below} or {2 * below}, got {count}"
        )
    rng = np.random.default_rng(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # newer SciPy calls the argument rng
        if kind == "sobol":
            points = qmc.Sobol(len(drawn), scramble=True, seed=rng).random(count)
        else:
            points = qmc.LatinHypercube(len(drawn), seed=rng).random(count)
    return Axis("sample", {v.key: v.at(points[:, i]) for i, v in enumerate(drawn)})
