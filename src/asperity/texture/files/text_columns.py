"""What the columns of a text of heights are: points, a profile, or none of both, a matrix.

By their names, else by their numbers; and the units that the names state.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_table import TextTable
from asperity._core.units import LENGTHS, length_of, named_unit
from asperity.texture.files.points import on_grid

FEW = 8
"""Columns of points, at most: with colours or normals behind x, y and z."""
_AXIS = re.compile(r"(?:^|.*[\s_./-])([xyz])(?:$|[\s_.,/:(\[-].*)", re.IGNORECASE)
_ROW = re.compile(r"rows?|row[ _]?(?:index|idx|no|nr)|zeile|ligne|[ij]?_?line", re.IGNORECASE)
_COLUMN = re.compile(
    r"col(?:umn)?s?|col(?:umn)?[ _]?(?:index|idx|no|nr)|spalte|colonne", re.IGNORECASE
)
"""Names of the numbers of a row, from the top, and of a column of a map."""
_HEIGHTS = re.compile(
    "height|höhe|hauteur|altezza|altura|výška|высота|高|높이|depth|tiefe|elevation|topo|altit|relief",
    re.IGNORECASE,
)
_COMPASS = {"east": "x", "easting": "x", "north": "y", "northing": "y"}
_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*[^\W\d][^\[\]()]*?)\s*[\])]")
_GLOBE = re.compile(r"(?i)(?<![a-z])(?:lat(?:itude)?|lon(?:g(?:itude)?)?)(?![a-z])")
_COUNTED = re.compile(
    r"(?i)[xyij]?[\W_]*(?:px|pixels?|idx|ind(?:ex|ices)|samples?|points?|frames?|steps?|n[ro]?|i|j)"
    r"[\W_]*\d?|time|zeit|temps|t"
)
"""Names of places that are numbers of samples, or times."""
_NOMINAL = re.compile(r"(?i)(?<![a-z])(?:nom(?:inal)?|soll|theo\w*|cad|design|target)(?![a-z])")
"""Words of columns that have what a drawing states, beside what was measured."""
_PAIR = re.compile(r"([^\W\d_]+)/([^\W\d_]+)$")
"""Units of places and heights in one name, as of Dektak's `Raw_Micrometer/Angstrom`."""


@dataclass(frozen=True)
class ColumnUnits:
    """Units of places and heights, as the names of columns state them.

    Attributes
    ----------
    word : str
        Unit of the heights, or else of the places; "" where no name states one.
    scale, lateral : float
        Metres in one unit of the heights, and of the places.
    of_places : str
        As the name of the first column states it.
    of_heights : bool
        Whether the heights' own column states its unit.
    no_length : str
        What stands in its brackets and is no length.
    across : float
        Metres in one unit of y.
    """

    word: str = ""
    scale: float = 1.0
    lateral: float = 1.0
    of_places: str = ""
    of_heights: bool = False
    no_length: str = ""
    across: float = 1.0


def names_of(table: TextTable) -> tuple[str, ...] | None:
    """Return the names of the columns, with the units that another line below them states."""
    names = table.names
    units = [name.strip("[]() ") for name in names or ()]
    if names is None or not any(units) or not all(length_of(u) or u in ("", "-") for u in units):
        return names
    above = replace(table, header=table.header[:-1], whole=table.whole[:-1]).names
    if above is None:
        return names
    return tuple(f"{name} [{u}]" if u else name for name, u in zip(above, units, strict=True))


def columns_of_heights(values: Array, names: Sequence[str] | None) -> tuple[int, ...] | None:
    """Return the columns of x, y and z, or of place and height; None for a matrix.

    Raises `LookupError` for a profile with heights in several columns.
    """
    rows, count = values.shape
    if count == 1 or rows < 3:
        return None
    found = _points_or_profile(values, names)
    if found is None or len(found) == 2:
        return found
    flat = [np.ptp(values[:, at]) == 0.0 for at in found[:2]]
    # A profile whose y, or x, is the same everywhere.
    return found if flat[0] == flat[1] else (found[int(flat[0])], found[2])


def _points_or_profile(values: Array, names: Sequence[str] | None) -> tuple[int, ...] | None:
    count = values.shape[1]
    named = _by_names(names, count) if names is not None else None
    if named is not None and len(named) == 2 and count == 3 and not _grows(values[:, named[0]]):
        # Names of x and y, and of something else: points, for the places of a profile grow.
        return *named, next(at for at in range(3) if at not in named)
    return named or _by_numbers(values)


def are_named(names: Sequence[str], columns: tuple[int, ...]) -> bool:
    """Return whether the names of points state their places."""
    found = _by_names(names, len(names))
    return found is not None and found[:2] == columns[:2]


def _grows(places: Array) -> bool:
    steps = np.diff(places)
    return bool((steps > 0.0).all() or (steps < 0.0).all())


def _by_names(names: Sequence[str], count: int) -> tuple[int, ...] | None:
    """Return the columns that names call x, y and z, row, column and height, or x and height."""
    measured = ["" if _NOMINAL.search(name) else name for name in names]
    if measured != [*names] and (chosen := _by_names(measured, count)) is not None:
        return chosen
    found: dict[str, int] = {}
    for at, name in enumerate(names):
        bare = re.sub(r"[\[(].*?[\])]", "", name).strip()
        axis = _AXIS.fullmatch(_COMPASS.get(bare.casefold(), bare))
        key = axis.group(1).lower() if axis else ("z" if _HEIGHTS.search(name) else "")
        found.setdefault(key, at)
    row, column = (next(filter(of.fullmatch, names), None) for of in (_ROW, _COLUMN))
    if row and column and "z" in found:
        return names.index(column), names.index(row), found["z"]
    if {"x", "y", "z"} <= {*found}:
        return found["x"], found["y"], found["z"]
    if "x" in found and {"y", "z"} & {*found} and count <= FEW:
        return found["x"], found.get("z", found.get("y", 0))
    return None


def _by_numbers(values: Array) -> tuple[int, ...] | None:
    """Return the columns of a profile, if there are two, or of points, if they look like such."""
    rows, count = values.shape
    if count == 2:
        return 0, 1
    if count > FEW or rows < 4:
        return None
    if count == 3 and rows > 16:
        if is_even(values[:, 0]):  # a profile, and which column has its heights is not known
            raise LookupError
        return 0, 1, 2
    return (0, 1, 2) if rows > 2 * count and on_grid(*values[:, :3].T) is not None else None


def is_even(line: Array) -> bool:
    """Return whether numbers grow by even steps, as places and row numbers do."""
    steps = np.diff(line)
    return bool(line.size > 2 and steps[0] != 0.0 and np.ptp(steps) <= 1e-3 * abs(steps.mean()))


def are_numbered(names: Sequence[str] | None, columns: tuple[int, ...]) -> bool:
    """Return whether points have numbers of rows, from the top, and of columns as their places."""
    return bool(names and len(columns) == 3 and _COLUMN.fullmatch(names[columns[0]]))


def are_on_the_globe(names: Sequence[str] | None, columns: tuple[int, ...]) -> bool:
    """Return whether places are latitude and longitude, which are angles."""
    return bool(names and all(_GLOBE.search(names[at]) for at in columns[:2]))


def are_counted(names: Sequence[str] | None, columns: tuple[int, ...]) -> bool:
    """Return whether places are numbers of samples, or in what is no length, as their names say."""
    if not names:
        return False
    name = names[columns[0]].strip()
    other = _BRACKET.search(name)
    return named_unit(name, LENGTHS) is None and (
        other is not None or _COUNTED.fullmatch(name) is not None
    )


def units_of(names: Sequence[str] | None, columns: tuple[int, ...]) -> ColumnUnits:
    """Return the units that the names of points, or of a profile, state."""
    if not names:
        return ColumnUnits()
    stated = [named_unit(names[at], LENGTHS) for at in columns]
    heights = names[columns[-1]]
    said = stated[-1] or next((unit for unit in stated if unit), None)
    word, scale = said or ("", 1.0)
    of_places, lateral = stated[0] or ("", (said or ("", 1.0))[1])
    if are_numbered(names, columns):
        lateral = 1.0
    if len(columns) == 2 and not of_places and (pair := _PAIR.search(heights)):
        metres = length_of(pair.group(1))
        if metres and length_of(pair.group(2)):
            of_places, lateral = pair.group(1), metres
    other = None if stated[-1] else _BRACKET.search(heights)
    across = stated[1][1] if len(columns) == 3 and stated[1] else lateral
    return ColumnUnits(
        word, scale, lateral, of_places, stated[-1] is not None, other.group(1) if other else "",
        across,
    )  # fmt: skip
