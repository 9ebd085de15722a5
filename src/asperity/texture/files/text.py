"""Heights from text: a matrix, a column, points in three columns, a profile in two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_form import is_number
from asperity._core.text_table import TextTable, read_text_table
from asperity._core.units import LENGTHS, named_unit, short_unit
from asperity.errors import SurfaceError
from asperity.texture.files.interferometers import is_wyko, is_zygo, load_wyko, load_zygo
from asperity.texture.files.points import Grid, on_grid, profile, scattered, stray
from asperity.texture.files.stored import NO_UNIT, NO_UNITS, Stored, check_size, refuse
from asperity.texture.files.text_columns import (
    FEW,
    ColumnUnits,
    are_counted,
    are_named,
    are_numbered,
    are_on_the_globe,
    columns_of_heights,
    is_even,
    names_of,
    units_of,
)
from asperity.texture.files.text_header import Header, read_header

_NUMBERING = ("", "row", "index", "idx", "n", "nr", "no", "y", "line", "zeile", "unnamed: 0", "y/x")
"""Names of a first column that numbers the rows of a matrix."""
_BOTTOM = "its first row is at v = 0, the bottom"
_BLOCK = 4
"""Rows of a block, at least."""
_SIDE = 64
"""Of a square map, from which a column that has all its heights is suspected."""
_LONG = 16
"""Rows a column from which few columns are hardly a map."""


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
    names = _names_beside(values, names_of(table))
    header = read_header(table.header, names, values.shape)
    if header.nodata is not None:
        values[values == header.nodata] = np.nan
    if header.shape and 1 in values.shape and values.size == math.prod(header.shape):
        values = values.reshape(header.shape)  # ESRI's grid needs no ends of lines
    if table.commas_only and names is None and values.shape[1] == 2 < len(values):
        refuse(path, "two columns of whole numbers, or decimal commas? valid: decimal points, or "
               "place and height with a line of names above")  # fmt: skip
    columns = _columns(path, values, names)
    header = header.of(values if columns is None else values[:, columns[-1]])
    if columns is not None:
        stored = _from_columns(path, values, names, columns, pixel_size, header)
    else:
        stored = _first_block(table, values, blocks, header, names)
    doubt = _doubt_of_thousands(table)
    return stored if doubt is None else stored._replace(notes=(*stored.notes, doubt))


def _names_beside(values: Array, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
    """Return a name for each column; None if there are others than the columns have."""
    count = values.shape[1]
    if names is None or len(names) == count:
        return names
    return names[:count] if not any(names[count:]) else None


def _columns(path: Path, values: Array, names: Sequence[str] | None) -> tuple[int, ...] | None:
    """Return the columns of points, or of a profile; None for a matrix."""
    try:
        return columns_of_heights(values, names)
    except LookupError:
        shown = f" ({', '.join(names)[:80]})" if names else ""
        refuse(path, f"{values.shape[1]} columns{shown}, the first of even places: which one has "
               "the heights? Valid: places and one column of heights, or x, y and z")  # fmt: skip


def _first_block(
    table: TextTable, values: Array, blocks: list[int], header: Header, names: Sequence[str] | None
) -> Stored:
    """Return a matrix: of several, the first."""
    if len(blocks) == 1:
        return _without_axes(_matrix(table, values, header), names)
    stored = _without_axes(_matrix(table, values[: blocks[0]], header), names)
    note = f"its rows are in {len(blocks)} blocks: the first, of {blocks[0]}, is read"
    return stored._replace(notes=(*stored.notes, note))


def _doubt_of_thousands(table: TextTable) -> str | None:
    """Return a doubt whether a mark in numbers groups thousands, None where none is due."""
    number = table.perhaps_thousands
    if not number:
        return None
    whole = number.replace(table.decimal, "")
    return (
        f"is {number} {whole}? It is read as a number with a decimal mark; write thousands "
        "without one"
    )


def _from_columns(
    path: Path, values: Array, names: Sequence[str] | None, columns: tuple[int, ...],
    pixel_size: float | None, header: Header,
) -> Stored:  # fmt: skip
    """Return points, or a profile, as a map or a line of heights."""
    units, numbered = units_of(names, columns), are_numbered(names, columns)
    above = not units.word and not units.no_length and header.scale is not None
    if above:  # as of heights whose names state it
        scale = header.scale or 1.0
        units = ColumnUnits(header.unit or "", scale, scale, of_heights=True, across=scale)
    known = names or {2: ("x", "z"), 3: ("x", "y", "z")}[len(columns)]
    called = ", ".join(known[at] for at in columns)
    if len(columns) == 3 and are_on_the_globe(names, columns):
        refuse(path, f"its places are angles ({called}); valid: x, y, z in a unit of length "
               "(project them)")  # fmt: skip
    if len(columns) == 2:
        grid = _profile(path, values[:, columns])
    else:
        x, y, z = (values[:, at] for at in columns)
        y = -y if numbered else y  # rows are numbered from the top
        y = y if numbered else y * (units.across / units.lateral)
        step = pixel_size / units.lateral if pixel_size and units.word else None
        grid = _map(path, (x, y, z), called, step, pixel_size)
    notes = [f"{grid.note} ({called})", *_left_out(names, columns, values.shape[1])]
    if names and len(columns) == 3 and not are_named(names, columns):
        notes.append(f"are {called} x, y and heights? Their names do not state it: taken so")
    size = (grid.pixel_size[0] * units.lateral, grid.pixel_size[1] * units.lateral)
    if numbered:
        notes.append("rows are numbered from the top")
        notes.append(f"heights in {units.word}" if units.word else NO_UNIT)
        return Stored(grid.values, tuple(notes), None, units.scale, units.word)
    if units.no_length:
        notes.append(f"its heights are in {units.no_length!r}, which is no length")
        return Stored(grid.values, tuple(notes), size, None, units.no_length)
    follow = not units.word
    of_samples = grid.pixel_size[0] == 1.0 and not units.of_places and header.pixel is not None
    if of_samples or are_counted(names, columns):
        notes.append(f"places ({called.partition(',')[0]}) are numbers of samples, or no lengths")
        notes.append(f"heights in {units.word}" if units.word else NO_UNIT)
        return Stored(grid.values, tuple(notes), header.pixel, units.scale, units.word)
    notes.append(_said(units) + (", as a line above states" if above else ""))
    return Stored(grid.values, tuple(notes), size, units.scale, units.word, sizes_follow=follow)


def _profile(path: Path, columns: Array) -> Grid:
    """Return the line of a profile's heights."""
    grid = profile(*columns.T)
    if grid is None:
        refuse(path, "two columns, but the first does not grow like places in a row; "
               "valid: place and height, one column of heights, or a matrix")  # fmt: skip
    return grid


def _map(
    path: Path, points: tuple[Array, Array, Array], called: str, step: float | None,
    pixel_size: float | None,
) -> Grid:  # fmt: skip
    """Return the map of points, on their grid or linear between them at a step."""
    grid = on_grid(*points)
    if grid is not None:
        return grid
    x, y, _ = points
    if (at := stray(x, y)) is not None:
        middle = f"{np.median(x):.6g}, {np.median(y):.6g}"
        refuse(path, f"point {at + 1} is at {x[at]:.6g}, {y[at]:.6g}, far from all others (about "
               f"{middle}): is it damaged? Valid: the points without it")  # fmt: skip
    try:
        return scattered(*points, step)
    except OverflowError:
        refuse(path, f"pixel_size={pixel_size:g} is too small for {len(points[0])} points that "
               "lie on no grid; valid: about their distance, or none")  # fmt: skip
    except Exception:
        refuse(path, f"points ({called}) that lie on no grid and span no area; valid: "
               "x, y, z of points on a surface")  # fmt: skip


def _left_out(names: Sequence[str] | None, columns: tuple[int, ...], count: int) -> list[str]:
    """Return a note on the columns that are neither places nor heights, if there are some."""
    if names and len(names) > len(columns):
        left = [name for at, name in enumerate(names) if at not in columns and name]
        return [f"columns left out: {', '.join(left)[:80]}"] if left else []
    if not names and count > len(columns):
        return [f"{count - len(columns)} columns behind x, y and z are left out"]
    return []


def _said(units: ColumnUnits) -> str:
    """Return the note on the units of places and heights."""
    if not units.word:
        return NO_UNITS
    of_places, of_heights = (units.of_places, units.lateral), (units.word, units.scale)
    if units.of_places and units.of_heights and of_places != of_heights:
        return f"places in {units.of_places}, heights in {units.word}"
    unsaid = "" if units.of_heights else ", which the heights' column does not say"
    return f"places and heights in {units.word}{unsaid}"


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


def _without_axes(stored: Stored, names: Sequence[str] | None) -> Stored:
    """Return a matrix without a first row and column that number its samples, with a note.

    A spreadsheet leaves their corner empty, or names the column otherwise.
    """
    values, notes = stored.values, stored.notes
    if min(values.shape) < 4:
        return stored
    turned = np.flipud(values) if any("top of the map" in note for note in notes) else values
    row, column = turned[0, 1:], turned[1:, 0]
    if np.isnan(turned[0, 0]) and is_even(row) and is_even(column):
        steps = float(np.diff(row).mean()), abs(float(np.diff(column).mean()))
        notes = (
            *notes,
            f"its first row and column number the samples, by {steps[0]:g} and {steps[1]:g}, and "
            "are left out",
        )
        return _as_placed(
            stored._replace(values=values[-len(column) :, 1:], notes=notes), row, column
        )
    if names and names[0].strip().casefold() in _NUMBERING and is_even(turned[:, 0]):
        notes = (*notes, f"its first column, {names[0]!r}, numbers the rows and is left out")
        return stored._replace(values=values[:, 1:], notes=notes)
    heads = np.array([float(n) if is_number(n) else np.nan for n in (names or ())[1:]])
    if heads.size == values.shape[1] - 1 and is_even(heads) and is_even(turned[:, 0]):
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
    values, dropped = _without_numbers(values)
    if dropped:
        notes = (*notes, f"{dropped} and is left out")
        return stored._replace(values=values, notes=notes)
    first = [
        word
        for word, grows in (
            ("row", is_even(turned[0, 1:]) and not is_even(turned[1, 1:])),
            ("column", is_even(turned[1:, 0]) and not is_even(turned[1:, 1])),
        )
        if grows
    ]
    if first:
        which = " and ".join(first)
        notes = (*notes, f"is its first {which} places? It grows evenly, others do not: leave it "
                 "out of the file, if so")  # fmt: skip
    return stored._replace(notes=notes)


def _without_numbers(values: Array) -> tuple[Array, str]:
    """Return a matrix without a row or column of 0, 1, 2, ... beside heights that are not whole.

    pandas writes them where columns, or rows, have no names.
    """
    for what, turned in (("row", values), ("column", values.T)):
        line, rest = turned[0], turned[1:]
        if np.array_equal(line, np.arange(line.size)) and not (rest == np.round(rest)).all():
            return (rest if what == "row" else rest.T), f"its first {what} numbers its samples"
    return values, ""


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
    if 4 <= columns <= FEW and rows > _LONG * columns:
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
        notes.append(NO_UNITS if header.follows else NO_UNIT)
        return Stored(values, tuple(notes), size, 1.0, sizes_follow=header.follows)
    said = header.unit or short_unit(header.scale)
    notes.append(f"heights in {said}, as the file states")
    return Stored(values, tuple(notes), size, header.scale, said)
