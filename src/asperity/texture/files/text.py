"""Heights from text: a matrix, a column, points in three columns, a profile in two."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_table import TextTable, is_number, read_text_table
from asperity._core.units import LENGTHS, length_of, named_unit, short_unit
from asperity.errors import SurfaceError
from asperity.texture.files.interferometers import is_wyko, is_zygo, load_wyko, load_zygo
from asperity.texture.files.points import Grid, on_grid, profile, scattered
from asperity.texture.files.stored import NO_UNIT, NO_UNITS, Stored, check_size, refuse
from asperity.texture.files.text_header import Header, read_header

_AXIS = re.compile(r"(?:^|.*[\s_./-])([xyz])(?:$|[\s_.,/:(\[-].*)", re.IGNORECASE)
_ROW = re.compile(r"rows?|row[ _]?(?:index|idx|no|nr)|zeile|ligne|[ij]?_?line", re.IGNORECASE)
_COLUMN = re.compile(
    r"col(?:umn)?s?|col(?:umn)?[ _]?(?:index|idx|no|nr)|spalte|colonne", re.IGNORECASE
)
"""Names of the numbers of a row, from the top, and of a column of a map."""
_HEIGHTS = re.compile(
    "height|höhe|hauteur|altezza|altura|výška|высота|高|높이|depth|tiefe|elevation|topo",
    re.IGNORECASE,
)
_NUMBERING = ("", "row", "index", "idx", "n", "nr", "no", "y", "line", "zeile", "unnamed: 0", "y/x")
"""Names of a first column that numbers the rows of a matrix."""
_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*[^\W\d][^\[\]()]*?)\s*[\])]")
_PAIR = re.compile(r"([^\W\d_]+)/([^\W\d_]+)$")
"""Units of places and heights in one name, as of Dektak's `Raw_Micrometer/Angstrom`."""
_BOTTOM = "its first row is at v = 0, the bottom"
_BLOCK = 4
"""Rows of a block, at least."""
_SIDE = 64
"""Of a square map, from which a column that has all its heights is suspected."""
_LONG = 16
"""Rows a column from which few columns are hardly a map."""
_FEW = 8
"""Columns of points, at most: with colours or normals behind x, y and z."""


def load_text(path: Path, pixel_size: float | None = None) -> Stored:
    """Return the heights in a text file, and the pixel size and unit that it states.

    Parameters
    ----------
    path : Path
    pixel_size : float, optional
        Step of the map of points that lie on no grid [m].
    """
    check_size(path, path.stat().st_size // 16)
    if is_zygo(path):
        return load_zygo(path)
    table = read_text_table(path, error=SurfaceError)
    if is_wyko(table):
        return load_wyko(table)
    values = table.values()
    blocks = _blocks(table)
    values = values[:, ~np.isnan(values).all(axis=0)] if np.isnan(values[0]).any() else values
    names = _names(table)
    if names is not None and len(names) != values.shape[1]:
        names = names[: values.shape[1]] if not any(names[values.shape[1] :]) else None
    header = read_header(table.header, names, values.shape[1])
    if header.nodata is not None:
        values[values == header.nodata] = np.nan
    if header.shape and 1 in values.shape and values.size == math.prod(header.shape):
        values = values.reshape(header.shape)  # ESRI's grid needs no ends of lines
    if table.commas_only and names is None and values.shape[1] == 2 < len(values):
        refuse(path, "two columns of whole numbers, or decimal commas? valid: decimal points, or "
               "place and height with a line of names above")  # fmt: skip
    try:
        columns = _columns(values, names)
    except LookupError:
        shown = f" ({', '.join(names)[:80]})" if names else ""
        refuse(path, f"{values.shape[1]} columns{shown}, the first of even places: which one has "
               "the heights? Valid: places and one column of heights, or x, y and z")  # fmt: skip
    if columns is not None:
        stored = _from_columns(path, values, names, columns, pixel_size)
    else:
        values = values[: blocks[0]] if len(blocks) > 1 else values
        stored = _without_axes(_matrix(table, values, header), names)
        if len(blocks) > 1:
            note = f"its rows are in {len(blocks)} blocks: the first, of {blocks[0]}, is read"
            stored = stored._replace(notes=(*stored.notes, note))
    number = table.perhaps_thousands
    if not number:
        return stored
    doubt = (
        f"is {number} {number.replace(table.decimal, '')}? It is read as a number with a decimal"
    )
    return stored._replace(notes=(*stored.notes, f"{doubt} mark; write thousands without one"))


def _names(table: TextTable) -> tuple[str, ...] | None:
    """Return the names of the columns, with the units that another line below them states."""
    names = table.names
    units = [name.strip("[]() ") for name in names or ()]
    if names is None or not any(units) or not all(length_of(u) or u in ("", "-") for u in units):
        return names
    above = replace(table, header=table.header[:-1]).names
    if above is None:
        return names
    return tuple(f"{name} [{u}]" if u else name for name, u in zip(above, units, strict=True))


def _columns(values: Array, names: Sequence[str] | None) -> tuple[int, ...] | None:
    """Return the columns of x, y and z, or of place and height; None for a matrix.

    Raises `LookupError` for a profile with heights in several columns.
    """
    rows, count = values.shape
    if count == 1 or rows < 3:
        return None
    if names is not None:
        found: dict[str, int] = {}
        for at, name in enumerate(names):
            axis = _AXIS.fullmatch(re.sub(r"[\[(].*?[\])]", "", name).strip())
            key = axis.group(1).lower() if axis else ("z" if _HEIGHTS.search(name) else "")
            found.setdefault(key, at)
        row, column = (next(filter(of.fullmatch, names), None) for of in (_ROW, _COLUMN))
        if row and column and "z" in found:
            return names.index(column), names.index(row), found["z"]
        if {"x", "y", "z"} <= {*found}:
            return found["x"], found["y"], found["z"]
        if "x" in found and {"y", "z"} & {*found} and count <= _FEW:
            return found["x"], found.get("z", found.get("y", 0))
    if count == 2:
        return 0, 1
    if count > _FEW or rows < 4:
        return None
    if count == 3 and rows > 16:
        if _even(values[:, 0]):  # a profile, and which column has its heights is not known
            raise LookupError
        return 0, 1, 2
    return (0, 1, 2) if rows > 2 * count and on_grid(*values[:, :3].T) is not None else None


def _from_columns(
    path: Path, values: Array, names: Sequence[str] | None, columns: tuple[int, ...],
    pixel_size: float | None,
) -> Stored:  # fmt: skip
    """Return points, or a profile, as a map or a line of heights."""
    stated = [named_unit(names[at], LENGTHS) if names else None for at in columns]
    said = stated[-1] or next((unit for unit in stated if unit), None)
    word, scale = said or ("", 1.0)
    other = _BRACKET.search(names[columns[-1]]) if names and not stated[-1] else None
    numbered = bool(names and len(columns) == 3 and _COLUMN.fullmatch(names[columns[0]]))
    lateral = 1.0 if numbered else (stated[0] or said or ("", 1.0))[1]
    pair = (
        _PAIR.search(names[columns[-1]]) if names and len(columns) == 2 and not stated[0] else None
    )
    if pair and length_of(pair.group(1)) and length_of(pair.group(2)):
        lateral = length_of(pair.group(1)) or 1.0
        stated[0] = pair.group(1), lateral
    known = names or {2: ("x", "z"), 3: ("x", "y", "z")}[len(columns)]
    called = ", ".join(known[at] for at in columns)
    notes = []
    if names and len(names) > len(columns):
        left = [name for at, name in enumerate(names) if at not in columns]
        notes.append(f"columns left out: {', '.join(left)[:80]}")
    elif not names and values.shape[1] > len(columns):
        notes.append(f"{values.shape[1] - len(columns)} columns behind x, y and z are left out")
    grid: Grid | None
    if len(columns) == 2:
        grid = profile(*values[:, columns].T)
        if grid is None:
            refuse(path, "two columns, but the first does not grow like places in a row; "
                   "valid: place and height, one column of heights, or a matrix")  # fmt: skip
    else:
        x, y, z = (values[:, at] for at in columns)
        if numbered:  # rows are numbered from the top
            y = -y
        grid = on_grid(x, y, z)
        if grid is None:
            step = pixel_size / lateral if pixel_size and said else None
            try:
                grid = scattered(x, y, z, step)
            except OverflowError:
                refuse(path, f"pixel_size={pixel_size:g} is too small for {len(x)} points that "
                       "lie on no grid; valid: about their distance, or none")  # fmt: skip
            except Exception:
                refuse(path, f"points ({called}) that lie on no grid and span no area; valid: "
                       "x, y, z of points on a surface")  # fmt: skip
    notes = [f"{grid.note} ({called})", *notes]
    size = (grid.pixel_size[0] * lateral, grid.pixel_size[1] * lateral)
    if numbered:
        notes.append("rows are numbered from the top")
        notes.append(f"heights in {word}" if said else NO_UNIT)
        return Stored(grid.values, tuple(notes), None, scale, word)
    if other:
        notes.append(f"its heights are in {other.group(1)!r}, which is no length")
        return Stored(grid.values, tuple(notes), size, None, other.group(1))
    if not said:
        notes.append(NO_UNITS)
    elif stated[0] and stated[-1] and stated[0] != stated[-1]:
        notes.append(f"places in {stated[0][0]}, heights in {word}")
    else:
        unsaid = "" if stated[-1] else ", which the heights' column does not say"
        notes.append(f"places and heights in {word}{unsaid}")
    return Stored(grid.values, tuple(notes), size, scale, word, sizes_follow=not said)


def _blocks(table: TextTable) -> list[int]:
    """Return the rows of each block that a blank line or a head sets apart; else of all."""
    at = np.asarray(table.rows_at())
    ends = np.flatnonzero(np.diff(at) > 1) + 1
    if not len(ends):
        return [len(at)]
    lines = table.body.split("\n")
    between = (lines[at[k - 1] + 1 - table.first_line : at[k] - table.first_line] for k in ends)
    apart = [any(not line.strip() or ":" in line for line in gap) for gap in between]
    counts = np.diff([0, *ends[apart].tolist(), len(at)]).tolist()
    return counts if min(counts) >= _BLOCK else [len(at)]


def _even(line: Array) -> bool:
    """Return whether numbers grow by even steps, as places and row numbers do."""
    steps = np.diff(line)
    return bool(line.size > 2 and steps[0] != 0.0 and np.ptp(steps) <= 1e-3 * abs(steps.mean()))


def _without_axes(stored: Stored, names: Sequence[str] | None) -> Stored:
    """Return a matrix without a first row and column that number its samples, with a note.

    A spreadsheet leaves their corner empty, or names the column otherwise.
    """
    values, notes = stored.values, stored.notes
    if min(values.shape) < 4:
        return stored
    turned = np.flipud(values) if any("top of the map" in note for note in notes) else values
    row, column = turned[0, 1:], turned[1:, 0]
    if np.isnan(turned[0, 0]) and _even(row) and _even(column):
        steps = float(np.diff(row).mean()), abs(float(np.diff(column).mean()))
        notes = (
            *notes,
            f"its first row and column number the samples, by {steps[0]:g} and {steps[1]:g}, and "
            "are left out",
        )
        return _as_placed(
            stored._replace(values=values[-len(column) :, 1:], notes=notes), row, column
        )
    if names and names[0].strip().casefold() in _NUMBERING and _even(turned[:, 0]):
        notes = (*notes, f"its first column, {names[0]!r}, numbers the rows and is left out")
        return stored._replace(values=values[:, 1:], notes=notes)
    heads = np.array([float(n) if is_number(n) else np.nan for n in (names or ())[1:]])
    if heads.size == values.shape[1] - 1 and _even(heads) and _even(turned[:, 0]):
        steps = float(np.diff(heads).mean()), abs(float(np.diff(turned[:, 0]).mean()))
        shown = f"by {steps[0]:g} and {steps[1]:g}"
        notes = (*notes, f"its first row and column are places, {shown}, and are left out")
        stored = stored._replace(values=values[:, 1:], notes=notes)
        stored = _as_placed(stored, heads, turned[:, 0])
        notes = stored.notes
        unit = named_unit(names[0], LENGTHS) if names else None
        if unit is None or stored.pixel_size is not None:
            return stored
        # What the corner names is the unit of the places, not of the heights.
        notes = tuple(note for note in notes if not note.startswith("heights in "))
        notes = (*notes, f"places in {unit[0]}", NO_UNIT)
        size = abs(steps[0]) * unit[1], steps[1] * unit[1]
        return stored._replace(pixel_size=size, scale=1.0, unit="", notes=notes)
    first = [
        word
        for word, grows in (
            ("row", _even(turned[0, 1:]) and not _even(turned[1, 1:])),
            ("column", _even(turned[1:, 0]) and not _even(turned[1:, 1])),
        )
        if grows
    ]
    if first:
        which = " and ".join(first)
        notes = (*notes, f"is its first {which} places? It grows evenly, others do not: leave it "
                 "out of the file, if so")  # fmt: skip
    return stored._replace(notes=notes)


def _as_placed(stored: Stored, x: Array, y: Array) -> Stored:
    """Return a matrix as the places of its columns x and rows y have it: both grow from its corner.

    A matrix whose first row is the top already lies as a picture, whatever its y.
    """
    values, notes = stored.values, stored.notes
    if x[1] < x[0]:
        values, notes = (
            np.fliplr(values),
            (*notes, "places along x decrease: its columns are turned"),
        )
    if y[1] < y[0] and _BOTTOM in notes:
        values = np.flipud(values)
        notes = (*(n for n in notes if n != _BOTTOM), "its first row is the top of the map, as its "
                 "places state")  # fmt: skip
    return stored._replace(values=values, notes=notes)


def _matrix(table: TextTable, values: Array, header: Header) -> Stored:
    """Return a matrix, or a column, with the scale that its header states."""
    rows, columns = values.shape
    notes = [*header.notes]
    size = header.pixel
    if size is None and (header.width or header.height):
        pu = header.width / columns if header.width else None
        pv = header.height / rows if header.height else None
        size = (pu or pv or 0.0, pv or pu or 0.0)
    if header.picture:
        values = np.flipud(values)
        notes.append("its first row is the top of the map")
    elif min(rows, columns) > 1:
        notes.append(_BOTTOM)
    side = math.isqrt(rows)
    if columns == 1 and side >= _SIDE and side * side == rows:
        doubt = f"is it a map of {side} x {side}? Put each of its rows in a line"
        notes.append(f"a line of {rows} heights: {doubt}")
    if 4 <= columns <= _FEW and rows > _LONG * columns:
        notes.append(f"a map of {columns} columns and {rows} rows: are they points, x, y and z in "
                     "each line? Keep three columns, or name them")  # fmt: skip
    if header.shape not in (None, values.shape):
        stated = f"{header.shape[1]} x {header.shape[0]}"
        notes.append(f"is it cut short? It states {stated} heights, and has {columns} x {rows}")
    if header.nodata is not None:
        notes.append(f"values of {header.nodata:g} are missing (nodata)")
    heading = table.header[-1][:60] if table.header and not header.picture else ""
    if heading and size is None:
        notes.append(f"the line above the numbers: {heading}")
    if header.unit is not None and header.scale is None:
        notes.append(f"its values are in {header.unit!r}, which is no length")
        return Stored(values, tuple(notes), size, None, header.unit)
    if header.scale is None:
        notes.append(NO_UNIT)
        return Stored(values, tuple(notes), size, 1.0)
    said = header.unit or short_unit(header.scale)
    notes.append(f"heights in {said}, as the file states")
    return Stored(values, tuple(notes), size, header.scale, said)
