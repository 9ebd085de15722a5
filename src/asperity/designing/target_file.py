"""A design's file: what is wanted, of which surfaces, made how. Keys and values are in SI units.

[target]
kind = "metric"              # or spectrum, surface, recording, series
metric = "band_rms"
value = [1.2, 1.4, 1.5]      # lists go together; a single number serves all
speed = [0.042, 0.083, 0.169]

[[surface]]                  # several: equal roughness, other look
pattern = "jittered_dots"    # or "free"
free = {height = [2e-5, 4e-4], pitch = [1e-3, 4e-3]}

[process]
preset = "sla"
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from asperity.designing.candidate import DesignSettings
from asperity.designing.forward import Demand
from asperity.designing.free_map import FreeMap
from asperity.designing.measures import VibrationMeasure
from asperity.designing.plate_stl import PrintedPlate
from asperity.designing.process import process_of
from asperity.designing.references import (
    demands_like_recording,
    demands_like_surface,
    spectrum_demands,
)
from asperity.designing.unknowns import PatternUnknown
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError, require_choice, require_positive
from asperity.scene.document import read_toml

KINDS = ("metric", "spectrum", "surface", "recording", "series")
_CONDITIONS = ("speed", "diameter", "force")
_TOP = ("target", "surface", "process", "hand", "plate", "search")
_MOST_STIMULI = 50
_FREE_TOLERANCE = 0.05
"""Of free maps, if none is given; that of patterns is 2 %."""
_RECORDED_TOLERANCE = 0.25
"""Of what is to be like a recording, if none is given: 2 dB, asperity's. The hand that was recorded
is not the hand of the model, so that no surface has exactly its levels."""


@dataclass(frozen=True)
class SeriesSpec:
    """A series of stimuli evenly spaced in a metric."""

    first: float
    last: float
    steps: int
    scale: str = "linear"
    """Or "log": equal ratios, as Weber's law has it."""

    def values(self) -> list[float]:
        """Return the wanted values, rising."""
        shares = [i / (self.steps - 1) for i in range(self.steps)]
        if self.scale == "log":
            return [self.first * (self.last / self.first) ** share for share in shares]
        return [self.first + (self.last - self.first) * share for share in shares]


@dataclass(frozen=True)
class DesignRequest:
    """What a file asks for."""

    kind: str
    demands: tuple[Demand, ...]
    unknowns: tuple[PatternUnknown | FreeMap, ...]
    settings: DesignSettings = field(default_factory=DesignSettings)
    plate: PrintedPlate = field(default_factory=PrintedPlate)
    starts: tuple[Mapping[str, float] | None, ...] = (None,)
    series: SeriesSpec | None = None
    accept_nearest: bool = False
    free_tolerance: float = _FREE_TOLERANCE
    """Largest relative miss of a free map."""
    mesh: Path | None = None
    """A closed mesh [mm] that carries the surface as well, OBJ or STL."""
    notes: tuple[str, ...] = ()


def read_request(target: str | os.PathLike[str] | Mapping[str, Any]) -> DesignRequest:
    """Return the request in a TOML file, or in a mapping of the same keys.

    Raises
    ------
    AsperityError
        An unknown key, a value of the wrong kind or out of range; one line.
    """
    folder = Path()
    if isinstance(target, Mapping):
        table: Mapping[str, Any] = target
    else:
        path = Path(os.path.expanduser(target))
        table, folder = read_toml(path), path.parent
    _only(table, (*_TOP, "schema"), "the design")
    hand = _made(Hand, table.get("hand", {}), "hand")
    process_table = dict(table.get("process", {}))
    process = process_of(process_table.pop("preset", "none"), **process_table)
    search = dict(table.get("search", {}))
    accept = search.pop("accept", "target")
    require_choice("accept in search", accept, ("target", "nearest"))
    unknowns, starts = _surfaces(table.get("surface"))
    if dict(table.get("target", {})).get("kind") == "recording":
        search.setdefault("tolerance", _RECORDED_TOLERANCE)
    free_tolerance = search.get("tolerance", _FREE_TOLERANCE)
    settings = _made(DesignSettings, search | {"process": process, "hand": hand}, "search")
    wanted = dict(table.get("target", {}))
    if not wanted:
        raise AsperityError('a design needs a table [target], e.g. kind = "metric", value = 1.5')
    kind = require_choice("kind of target", wanted.pop("kind", "metric"), KINDS)
    demands, series, notes = _demands(kind, wanted, settings, folder)
    plate_table = dict(table.get("plate", {}))
    mesh = plate_table.pop("mesh", None)
    if "size" in plate_table:
        plate_table["size"] = tuple(plate_table["size"])
    plate = _made(PrintedPlate, plate_table, "plate")
    return DesignRequest(
        kind, demands, unknowns, settings, plate, starts, series, accept == "nearest",
        free_tolerance,
        None if mesh is None else folder / mesh,
        notes,
    )  # fmt: skip


def _only(table: Any, valid: Sequence[str], where: str) -> None:
    if not isinstance(table, Mapping):
        raise AsperityError(f"{where} must be a table, got {table!r}")
    for name in table:
        require_choice(f"key of {where}", name, valid)


def _made(kind: Any, table: Mapping[str, Any], where: str) -> Any:
    """Return an object made of a table's keys."""
    _only(table, list(inspect.signature(kind).parameters), where)
    try:
        return kind(**table)
    except TypeError as error:
        raise AsperityError(f"{where}: {error}") from None


def _surfaces(
    tables: Any,
) -> tuple[tuple[PatternUnknown | FreeMap, ...], tuple[Mapping[str, float] | None, ...]]:
    if tables is None:
        tables = [{"pattern": "jittered_dots"}]
    if isinstance(tables, Mapping):
        tables = [tables]
    unknowns: list[PatternUnknown | FreeMap] = []
    starts = []
    for given in tables:
        if not isinstance(given, Mapping) or "pattern" not in given:
            raise AsperityError('each [[surface]] needs pattern = "..." or "free"')
        table = dict(given)
        pattern, start = table.pop("pattern"), table.pop("start", None)
        if pattern == "free":
            unknowns.append(_made(FreeMap, table, "surface"))
            if start is not None:
                raise AsperityError("a free map has no start; give rms_slope, or a seed to search")
        else:
            unknown = PatternUnknown(pattern, table.pop("free", {}), table)
            if start is not None:
                _only(start, unknown.names, "start")
                start = {**unknown.parameters(np.full(len(unknown.names), 0.5)), **start}
            unknowns.append(unknown)
        starts.append(start)
    return tuple(unknowns), tuple(starts)


def _demands(
    kind: str, wanted: dict[str, Any], settings: DesignSettings, folder: Path
) -> tuple[tuple[Demand, ...], SeriesSpec | None, tuple[str, ...]]:
    """Return the demands of a target, a series if it is one, and notes."""
    conditions = {name: wanted.pop(name) for name in _CONDITIONS if name in wanted}
    if kind in ("spectrum", "recording"):
        for name, value in conditions.items():
            if isinstance(value, Sequence):
                raise AsperityError(f"{name} of a {kind} must be one number, got {value!r}")
    if kind == "spectrum":
        _only(wanted, ("frequencies", "levels", "quantity"), "target")
        return spectrum_demands(**wanted, **conditions), None, ()
    if kind == "recording":
        _only(wanted, ("file",), "target")
        if "file" not in wanted:
            raise AsperityError('a target of kind "recording" needs file = "..."')
        demands, notes = demands_like_recording(
            folder / wanted["file"], settings.hand, **conditions
        )
        return demands, None, notes
    measure = _made(
        VibrationMeasure,
        {k: tuple(v) if k == "band" else v for k, v in wanted.items()
         if k in ("metric", "band", "quantity")}, "target",
    )  # fmt: skip
    rest = {k: v for k, v in wanted.items() if k not in ("metric", "band", "quantity")}
    if kind == "surface":
        _only(rest, ("like", "jnd", "weber_fraction"), "target")
        if "like" not in rest:
            raise AsperityError(
                'a target of kind "surface" needs like = "map.tiff", or a table of a pattern'
            )
        base = broadcast_demands(measure, {"value": 1.0} | conditions)
        demands, notes = demands_like_surface(folder=folder, base=base, settings=settings, **rest)
        return demands, None, notes
    if kind == "series":
        _only(rest, ("first", "last", "steps", "scale"), "target")
        series = _made(SeriesSpec, rest, "target")
        _check_series(series)
        return broadcast_demands(measure, {"value": series.first} | conditions), series, ()
    _only(rest, ("value", "spacing"), "target")
    if "value" not in rest:
        raise AsperityError('a target of kind "metric" needs value = ...')
    return broadcast_demands(measure, rest | conditions), None, ()


def _check_series(series: SeriesSpec) -> None:
    require_positive("first", series.first)
    require_positive("last", series.last)
    require_choice("scale", series.scale, ("linear", "log"))
    if not series.last > series.first:
        raise AsperityError(f"a series must rise, got {series.first:g} to {series.last:g}")
    whole = isinstance(series.steps, int) and not isinstance(series.steps, bool)
    if not whole or not 3 <= series.steps <= _MOST_STIMULI:
        raise AsperityError(
            f"steps must be a whole number, 3 to {_MOST_STIMULI}, got {series.steps!r}"
        )


def broadcast_demands(measure: VibrationMeasure, table: Mapping[str, Any]) -> tuple[Demand, ...]:
    """Return demands of a measure; lists in the table go together, single values serve all."""
    lists = {k: v for k, v in table.items() if isinstance(v, Sequence) and not isinstance(v, str)}
    lengths = {len(values) for values in lists.values()}
    if len(lengths) > 1 or 0 in lengths:
        shown = ", ".join(f"{k} has {len(v)}" for k, v in lists.items())
        raise AsperityError(f"lists of a target must be of one length: {shown}")
    count = lengths.pop() if lengths else 1
    return tuple(
        Demand(measure, **{k: lists[k][i] if k in lists else v for k, v in table.items()})
        for i in range(count)
    )
