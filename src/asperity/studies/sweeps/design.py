"""The combinations of a study: full grids, sampled designs, lists.

In a grid every variation is an axis. In a sampled design the ranges without a `count`, and the
values under `choose`, are sampled together along the axis `sample`; all other variations cross it.
In a list all variations change together, along the axis `combination`.
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
from asperity.texture.files.images import IMAGE_SUFFIXES
from asperity.texture.files.instruments import INSTRUMENT_SUFFIXES

DESIGNS = ("grid", "latin-hypercube", "sobol", "list")
SCALES = ("linear", "log")
LEAF = ("from", "to", "values", "choose", "folder")
"""Keys by which the table of one variation differs from a table of several."""
_KEYS = ("from", "to", "count", "scale", "whole", "values", "choose", "folder", "pattern")
_MAPS = {*INSTRUMENT_SUFFIXES, *IMAGE_SUFFIXES, ".npy", ".npz"}
"""Suffixes of the files taken from a folder if no pattern is given. Text files may hold heights,
but more often describe them."""
MOST = 10_000_000
"""Largest number of combinations of a study."""


class Variation(NamedTuple):
    """How one parameter varies: over `values`, or, where that is None, anywhere in a range."""

    key: str
    values: list[Any] | None
    low: float
    high: float
    log: bool
    whole: bool
    drawn: bool
    """Whether it is sampled; otherwise it is an axis."""

    @property
    def extremes(self) -> list[Any]:
        """Every value that can occur, or both ends of the range."""
        if self.values is not None:
            return self.values
        return [int(self.low), int(self.high)] if self.whole else [self.low, self.high]

    def at(self, fraction: NDArray[np.float64]) -> list[Any]:
        """Return the values at fractions, 0 to 1, of the range."""
        if self.values is not None:
            last = len(self.values) - 1
            return [self.values[min(int(p * len(self.values)), last)] for p in fraction]
        if self.whole:
            span = self.high - self.low + 1.0
            return [int(min(self.low + math.floor(p * span), self.high)) for p in fraction]
        if self.log:
            ratio = math.log(self.high / self.low)
            return [float(self.low * math.exp(p * ratio)) for p in fraction]
        return [float(self.low + p * (self.high - self.low)) for p in fraction]


class Axis(NamedTuple):
    """One dimension of the results, and the parameters that vary along it: key -> values."""

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
        """Return the varied parameters, key -> values, of combinations numbered from 0."""
        places = np.unravel_index(np.asarray(numbers, dtype=np.int64), self.shape)
        return {
            key: [values[i] for i in place]
            for axis, place in zip(self.axes, places, strict=True)
            for key, values in axis.columns.items()
        }


def read_variation(
    key: str, spec: Any, folder: Path, whole: bool = False, table: str = "vary"
) -> Variation:
    """Read and check how one parameter varies.

    Parameters
    ----------
    key : str
        Dotted key of the parameter.
    spec : list or mapping
        Its entry under `[vary]`: values; or a table: `from`, `to` with `count` and `scale`;
        `values`; `choose`; `folder` with `pattern`.
    folder : Path
        Folder to which relative paths refer.
    whole : bool
        Whether the parameter takes whole numbers only; then a number n stands for 0 to n - 1.
    table : str
        The table in which it stands: `vary`, or `zip.NAME`, in which values may repeat.
    """
    where = f"{table}.{key}"
    if whole and type(spec) is int and 1 <= spec <= MOST:
        spec = {"from": 0, "to": spec - 1, "count": spec} if spec > 1 else [0]
    if isinstance(spec, list):
        spec = {"values": spec}
    if not isinstance(spec, Mapping):
        raise AsperityError(
            f"{where} must be a list of values or a range {{from = ..., to = ...}}, got {spec!r}; "
            f"a fixed value goes under fixed.{key}"
        )
    require_keys(spec, where, _KEYS)
    given = [name for name in ("from", "values", "choose", "folder") if name in spec]
    if len(given) != 1:
        raise AsperityError(f"{where} needs one of from (and to), values, choose, folder")
    form = given[0]
    goes_with = {"from": {"to", "count", "scale", "whole"}, "folder": {"pattern"}}.get(form, set())
    for name in spec:
        if name != form and name not in goes_with:
            raise AsperityError(f"{where}.{name} does not go with {where}.{form}")
    if form == "from":
        return _range(key, {"whole": whole} | dict(spec), where)
    values = _files(where, spec, folder) if form == "folder" else spec[form]
    if not isinstance(values, list) or not values:
        raise AsperityError(f"{where}.{form} must be a list of at least one value, got {values!r}")
    if table == "vary" and len({_identity(value) for value in values}) != len(values):
        twice = next(v for v in values if values.count(v) > 1)
        raise AsperityError(f"{where} has the value {twice!r} twice")
    return Variation(key, list(values), 0.0, 1.0, False, False, form == "choose")


def _identity(value: Any) -> str:
    """Return a key that is equal for values that are: 1 and 1.0, but not true."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return repr(float(value) if number else value)


def _range(key: str, spec: Mapping[str, Any], where: str) -> Variation:
    low, high = _number(spec, "from", where), _number(spec, "to", where)
    if not high > low:
        raise AsperityError(f"{where} must rise, got {low:g} to {high:g}")
    scale = spec.get("scale", "linear")
    at(f"{where}.scale", lambda: require_choice("scale", scale, SCALES))
    if scale == "log" and not low > 0.0:
        raise AsperityError(f"{where}.from must be above 0 for a log scale, got {low:g}")
    whole = spec.get("whole", False)
    if not isinstance(whole, bool):
        raise AsperityError(f"{where}.whole must be true or false, got {whole!r}")
    if whole and (low % 1 or high % 1 or scale == "log"):
        raise AsperityError(f"{where}: whole numbers need a linear range from whole to whole")
    drawn = Variation(key, None, low, high, scale == "log", whole, True)
    if "count" not in spec:
        return drawn
    count = _whole(spec, "count", where, 2, MOST)
    if whole and count != high - low + 1:
        raise AsperityError(f"{where}.count must be {int(high - low) + 1}, every whole number")
    if whole:
        values: list[Any] = list(range(int(low), int(high) + 1))
    else:
        values = drawn.at(np.arange(count) / (count - 1))
        values[-1] = high
    return Variation(key, values, low, high, scale == "log", whole, False)


def _number(spec: Mapping[str, Any], name: str, where: str) -> float:
    value = spec.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AsperityError(f"{where}.{name} must be a finite number, got {value!r}")
    return float(value)


def _whole(spec: Mapping[str, Any], name: str, where: str, low: int, high: int) -> int:
    value = spec.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise AsperityError(
            f"{where}.{name} must be a whole number from {low} to {high}, got {value!r}"
        )
    return value


def _files(where: str, spec: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the files of a folder, relative to the folder of the study."""
    name, pattern = spec["folder"], spec.get("pattern", "*")
    for key, value in (("folder", name), ("pattern", pattern)):
        if not isinstance(value, str):
            raise AsperityError(f"{where}.{key} must be a text, got {value!r}")
    place = beside(folder, name)
    if not place.is_dir():
        raise AsperityError(f"{where}.folder: no such folder: {place}")
    files = sorted(p.name for p in place.glob(pattern) if p.is_file() and p.name[0] != ".")
    if "pattern" not in spec and not where.endswith("trajectory.file"):
        files = [file for file in files if Path(file).suffix.lower() in _MAPS]
    if not files:
        wanted = f"is called {pattern}" if "pattern" in spec else "is a map of heights"
        raise AsperityError(f"{where}: no file in {place} {wanted}")
    return [(Path(name) / file).as_posix() for file in files]


def read_design(
    spec: Mapping[str, Any], variations: Sequence[Variation], inner: Sequence[str],
    zipped: Mapping[str, Sequence[Variation]] | None = None,
) -> SweepDesign:  # fmt: skip
    """Return the combinations of variations according to `[design]`.

    Parameters
    ----------
    spec : mapping
        The table `[design]`: `kind`, `count`, `seed`.
    variations : sequence of Variation
    inner : sequence of str
        Prefixes of keys whose axes come last, because neighbours along them share work.
    zipped : mapping, optional
        Name -> variations that go along together, as one axis of that name.
    """
    require_keys(spec, "design", ("kind", "count", "seed"))
    kind = spec.get("kind", "grid")
    at("design.kind", lambda: require_choice("design", kind, DESIGNS))
    seed = _whole({"seed": 0} | dict(spec), "seed", "design", 0, 2**31 - 1)
    if kind in ("grid", "list") and "count" in spec:
        raise AsperityError(
            f"design.count is for sampled designs; the values determine that of a {kind}"
        )
    if kind in ("grid", "list"):
        variations = [_every(v) for v in variations]
    drawn = [v for v in variations if v.drawn]
    fixed = [v for v in variations if not v.drawn]
    axes = [Axis(v.key, {v.key: v.values or []}) for v in fixed]
    axes += [_zipped(name, together) for name, together in (zipped or {}).items()]
    axes.sort(key=lambda axis: all(key.startswith(tuple(inner)) for key in axis.columns))
    if kind not in ("grid", "list"):
        axes = [_sampled(kind, spec, seed, drawn), *axes]
    elif drawn:
        what = "choose" if drawn[0].values is not None else "a range without count"
        raise AsperityError(
            f"vary.{drawn[0].key}: {what} is for sampled designs (design.kind = "
            f'"latin-hypercube" or "sobol"); give {"values" if what == "choose" else "count"}'
        )
    elif kind == "list":
        if zipped:
            raise AsperityError("zip does not go with a list, in which all go along together")
        axes = [_together(axes)]
    design = SweepDesign(kind, seed, tuple(axes))
    if design.size > MOST:
        raise AsperityError(f"the study has {design.size} combinations; valid: {MOST} at most")
    return design


def _every(variation: Variation) -> Variation:
    """Return a range of whole numbers as all of them, and others as they are."""
    if not (variation.drawn and variation.whole) or variation.high - variation.low >= MOST:
        return variation
    values = list(range(int(variation.low), int(variation.high) + 1))
    return variation._replace(values=values, drawn=False)


def _zipped(name: str, variations: Sequence[Variation]) -> Axis:
    """Return variations that go along together, each row of values once."""
    sizes = {v.key: len(v.values or []) for v in variations}
    if len(set(sizes.values())) != 1:
        counts = ", ".join(f"{size} of {key}" for key, size in sizes.items())
        raise AsperityError(f"zip.{name}: all need equally many values, got {counts}")
    columns = {v.key: v.values or [] for v in variations}
    rows = list(zip(*columns.values(), strict=True))
    known = [tuple(map(_identity, row)) for row in rows]
    if len(set(known)) != len(rows):
        twice = next(row for row, one in zip(rows, known, strict=True) if known.count(one) > 1)
        raise AsperityError(f"zip.{name} has the row {', '.join(map(str, twice))} twice")
    return Axis(name, columns)


def _together(axes: Sequence[Axis]) -> Axis:
    sizes = {axis.name: axis.size for axis in axes}
    if len(set(sizes.values())) != 1:
        counts = ", ".join(f"{size} of {name}" for name, size in sizes.items())
        raise AsperityError(f"in a list all variations need equally many values, got {counts}")
    return Axis("combination", {axis.name: axis.columns[axis.name] for axis in axes})


def _sampled(kind: str, spec: Mapping[str, Any], seed: int, drawn: Sequence[Variation]) -> Axis:
    """Return the sampled variations along one axis."""
    from scipy.stats import qmc  # slow to import, and rarely needed

    if not drawn:
        raise AsperityError(
            f'design.kind = "{kind}" samples ranges without count; every range under [vary] has one'
        )
    if "count" not in spec:
        raise AsperityError("design.count is missing: the number of sampled points")
    count = _whole(spec, "count", "design", 2, MOST)
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
