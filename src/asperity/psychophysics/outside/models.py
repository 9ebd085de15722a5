"""Values of a model for the cells of people's answers: from a table, or simulated."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError, require_choice
from asperity.psychophysics.outside.reading import as_text, read_table
from asperity.studies.literature.laboratory import Laboratory, Touch
from asperity.studies.literature.measures import COLUMNS, SKIN_MEASURES, Measure
from asperity.studies.literature.plates import Dots, Gratings, Plate, Sinusoids

SIMULATED = {
    **COLUMNS,
    **{m.kind + ("_through_tissue" if m.transmission else ""): m for m in SKIN_MEASURES},
}
"""The metrics that can be simulated, by name."""
_MIDDLE = {"probe_mm": 3.0, "force_n": 0.58, "speed_mm_s": 83.0}
_DEFAULTS = {"dots": 0.4, "gratings": 0.4, "sinusoid": 0.1}
"""Heights of dots and ridges, and amplitude of a sinusoid, where the table has none [mm]."""


def read_model(path: Path) -> dict[tuple[str, str], float]:
    """Return the values of a table with columns stimulus, value, and perhaps condition."""
    table = read_table(path)
    for column in ("stimulus", "value"):
        if column not in table.columns:
            raise AsperityError(
                f"{path}: a model needs columns stimulus and value, and may have condition; "
                f"it has {', '.join(list(map(str, table.columns))[:10])}"
            )
    values = {}
    for row in table.to_dict("records"):
        values[_cell(row)] = _number(path, row, "value")
    return values


def simulate_model(path: Path, metric: str) -> dict[tuple[str, str], float]:
    """Return a metric of a drag over each stimulus of a table.

    Parameters
    ----------
    path : Path
        Columns stimulus, surface (dots, gratings, sinusoid), spacing_mm, and perhaps condition,
        height_mm, probe_mm, force_n, speed_mm_s; defaults are the middle levels of the studies.
    metric : str
        A key of `SIMULATED`.
    """
    require_choice("metric", metric, SIMULATED)
    measure: Measure = SIMULATED[metric]
    table, lab, values = read_table(path), Laboratory(Hand()), {}
    for column in ("stimulus", "surface", "spacing_mm"):
        if column not in table.columns:
            raise AsperityError(
                f"{path}: stimuli need columns stimulus, surface and spacing_mm; it has "
                f"{', '.join(list(map(str, table.columns))[:10])}"
            )
    for row in table.to_dict("records"):
        numbers = {
            name: _number(path, row, name, default) * 1e-3 ** (name != "force_n")
            for name, default in _MIDDLE.items()
        }
        touch = Touch(numbers["probe_mm"], numbers["force_n"], numbers["speed_mm_s"])
        spacing = _number(path, row, "spacing_mm") * 1e-3
        values[_cell(row)] = float(lab.curve(measure, _plate(path, row), touch, [spacing])[0])
    return values


def _plate(path: Path, row: dict[str, Any]) -> Plate:
    surface = as_text(row["surface"])
    if surface not in _DEFAULTS:
        raise AsperityError(
            f"{path}: surface must be one of {', '.join(_DEFAULTS)}, got {surface!r}"
        )
    height = _number(path, row, "height_mm", _DEFAULTS[surface]) * 1e-3
    if surface == "dots":
        return Dots(height=height)
    return Gratings(height) if surface == "gratings" else Sinusoids(height)


def _cell(row: dict[str, Any]) -> tuple[str, str]:
    condition = row.get("condition", "")
    missing = isinstance(condition, float) and math.isnan(condition)
    return as_text(row["stimulus"]), "" if missing else as_text(condition)


def _number(path: Path, row: dict[str, Any], name: str, default: float | None = None) -> float:
    value = row.get(name)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        if default is None:
            raise AsperityError(f"{path}: {name} is missing for {as_text(row['stimulus'])!r}")
        return default
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise AsperityError(f"{path}: {name} must be a number above 0, got {value!r}")
    return number
