"""Points from files: text of any program, PTX, PLY, PCD, LAS and LAZ.

Text is read whatever stands between its numbers and whatever stands above them: a count (Leica,
FARO), names of columns (which say where x, y and z are, and in which unit), comments; decimal
commas too.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import columns_of, reading, text_of
from asperity._core.large_tables import numbers_of
from asperity._core.plain_tables import head_of, plain_numbers
from asperity._core.text_form import MISSING, are_decimal_commas, is_number, without_groups
from asperity._core.unpacking import content_of
from asperity.baking.las import read_las
from asperity.baking.pcd import read_pcd
from asperity.baking.point_names import cells_of, heading_of
from asperity.baking.ptx import read_ptx
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import UNITS
from asperity.geometry.mesh.contents import stated_unit
from asperity.geometry.mesh.ply import positions, read_elements, read_head

POINTS = (".xyz", ".pts", ".ptx", ".pcd", ".las", ".laz")
TEXTS = (".asc", ".txt", ".csv", ".dat", ".tsv")
"""Of text that may be points or a map of heights."""
PACKED = (*POINTS[:4], ".ply", *TEXTS)
"""Suffixes that may have `.gz` behind them."""
FEWEST = 16
_FEW, _LONG = 9, 16
"""Columns of points at most, and lines a column from which they are no map."""
_MISSING = (-9999.0, -32767.0, -32768.0, -99999.0)
_FAR = 10.0
"""Coordinates that stand for none, so many times as far from all others as these span."""
_SAMPLE = 200
"""Lines from which the form of a text is found."""
_FIRST = 40
"""Lines from which it is found where all others are read by it."""
_FORMS = ((";", ","), (",", "."), (None, "."), (None, ","), ("\t", "."), ("\t", ","))
"""What stands between numbers (None: spaces or tabs), and the decimal sign; a point always may."""
_ON_THE_GLOBE = re.compile(r"(?i)\b(lat(?:itude)?|lon(?:g(?:itude)?)?)\b")
_FORTRAN = re.compile(r"(?<=\d)[dD](?=[+-]\d)")
"""The sign before a power of ten, as Fortran writes it."""
_MAP_HEADS = re.compile(r"^\W*(ncols|channel|width|height|rows)\b", re.IGNORECASE | re.MULTILINE)


class Points(NamedTuple):
    """Points of a file.

    Attributes
    ----------
    places : (n, 3) array
        In the file's unit.
    unit : str or None
        That it states.
    notes : tuple of str
    """

    places: Array
    unit: str | None = None
    notes: tuple[str, ...] = ()


class _Form(NamedTuple):
    """How a text holds its points."""

    first: int
    """Line with which they begin."""
    separator: str | None
    decimal: str
    width: int
    columns: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    """Of x, y and z, as their names state them; "": not stated."""
    counted: int | None
    """Points, as a line above them has it."""
    texts: bool = False
    """Whether a row has words among its numbers, as the names of points, or times of day."""


def read_points(path: Path) -> Points:
    """Return the points in a file.

    Raises
    ------
    AsperityError
        A file that cannot be read, or with fewer than 16 points; one line.
    """
    with reading(path, "points", (*POINTS, *TEXTS, ".ply"), packed=PACKED) as suffix:
        if suffix == ".ply":
            head = read_head(path)
            unit = stated_unit("\n".join(head.comments))
            found = Points(positions(path, read_elements(path, head, ("vertex",))), unit)
        elif suffix == ".pcd":
            found = Points(read_pcd(path))
        elif suffix in (".las", ".laz"):
            found = Points(*read_las(path))
        elif suffix == ".ptx":
            places, notes = read_ptx(path)
            found = Points(places, None, notes)
        else:
            found = _text(path)
    places, notes = found.places, found.notes
    good = np.ones(len(places), dtype=bool)
    least = float(places.min(initial=0.0))
    if not np.isfinite(least + float(places.max(initial=0.0))):  # row by row takes longer
        good &= np.isfinite(places).all(axis=1)
        notes = (*notes, f"{np.count_nonzero(~good)} points without a place are left out")
    at_origin = np.asarray(places[:, 0] == 0.0)
    at_origin = at_origin & (places[:, 1:] == 0.0).all(axis=1) if at_origin.any() else at_origin
    count = np.count_nonzero(at_origin)
    if count > 1:
        notes += (f"{count} points at 0, 0, 0 are left out: scanners write what is not seen so",)
        good &= ~at_origin
    for axis in range(0 if least > max(_MISSING) else 3):
        lowest = float(np.fmin.reduce(places[:, axis], initial=0.0))
        if lowest not in _MISSING:
            continue
        values = places[good, axis]
        others = values[values != lowest]
        if others.size and others.min() - lowest > _FAR * np.ptp(others):
            notes = (
                *notes,
                f"{len(values) - others.size} points with {'xyz'[axis]} = {lowest:g} are left out: "
                "it stands for what is missing",
            )
            good &= places[:, axis] != lowest
    left = np.count_nonzero(good)
    if left < FEWEST:
        raise AsperityError(f"{path}: {left} points are too few; valid: {FEWEST} or more")
    return Points(places if left == len(places) else places[good], found.unit, notes)


def holds_points(path: Path) -> bool:
    """Return whether a text holds points rather than a map of heights.

    It does if its columns are named x, y and z, or if it has three, or three and whole numbers
    behind them, as colours are, or if it has few columns and many more lines.
    """
    lines = _plain(content_of(path, 20_000)).split("\n")
    form = _form(lines[:-1] or lines)
    if (
        form is None
        or (form.width > 12 and not form.names)
        or _MAP_HEADS.search("\n".join(lines[: form.first]))
    ):
        return False
    rows = [line for line in lines[form.first : -1] if line.strip()]
    is_long = form.width <= _FEW and len(rows) > _LONG * form.width
    if form.names or form.texts:  # words without names are missing heights
        return bool(form.names)
    if form.width == 3 or is_long:
        return True
    more = [_numbers(row, form.separator, form.decimal)[3:] for row in rows[:_SAMPLE]]
    return len(rows) > 2 * form.width and all(v % 1 == 0 and v >= 0 for row in more for v in row)


def _plain(data: bytes) -> str:
    """Return a text without quotes, its numbers as Python writes them."""
    text = without_groups(text_of(data)).replace('"', "")
    return _FORTRAN.sub("e", text) if _FORTRAN.search(text[:2000]) else text


def _numbers(line: str, separator: str | None, decimal: str, *, texts: bool = False) -> list[float]:
    """Return the numbers of a line; an empty list if anything in it is none, or all is missing.

    What is missing is NaN, but for cells at the end. With `texts` words are, if there are three
    numbers beside them.
    """
    words = line.strip(" \r" if separator == "\t" else None).rstrip(";,\t").split(separator)
    if decimal == ",":
        words = [word.replace(",", ".") for word in words]
    try:
        return [float(word) for word in words]
    except ValueError:
        values = [float(word) if is_number(word) else math.nan for word in words]
    known = sum(value == value for value in values)
    is_gap = all(is_number(word) or _is_missing(word) for word in words)
    return values if known and (is_gap or (texts and known >= 3)) else []


def _is_missing(word: str) -> bool:
    return not word.strip() or word.strip().lower() in MISSING


def _form(lines: list[str]) -> _Form | None:
    """Return how lines hold points; None if they hold none."""
    lines = [line.partition("#")[0] if line.lstrip()[:1] != "#" else line for line in lines]
    return _form_of(lines, texts=False) or _form_of(lines, texts=True)


def _form_of(lines: list[str], *, texts: bool) -> _Form | None:
    best: tuple[int, _Form] | None = None
    marks = {".", *(mark for mark in ";,\t" if any(mark in line for line in lines[: 2 * _SAMPLE]))}
    for separator, decimal in _FORMS:
        if (separator or decimal) not in marks:
            continue
        rows = [_numbers(x, separator, decimal, texts=texts) for x in lines[: 2 * _SAMPLE]]
        widths = [len(row) for row in rows if len(row) >= 3]
        if not widths:
            continue
        width = max(set(widths), key=widths.count)
        share = widths.count(width)
        first = next(i for i, row in enumerate(rows) if len(row) == width)
        full = cells_of(lines[first], separator)
        while first and len(rows[first - 1]) > 2 and cells_of(lines[first - 1], separator) == full:
            first -= 1  # rows whose last cells are empty
        names, units, below = heading_of(lines[: first + 1], separator, width)
        wordless = [k for k, value in enumerate(rows[first]) if not (texts and value != value)]
        columns = tuple(names.index(axis) for axis in "xyz") if names else tuple(wordless[:3])
        while names and first > below and _holds(lines[first - 1], separator, decimal, columns):
            first -= 1  # rows that have words, or fewer cells
        counts = [row[0] for row in rows[:first] if len(row) == 1 and row[0] % 1 == 0]
        count = int(counts[-1]) if counts else None
        form = _Form(first, separator, decimal, width, columns, names, units, count, texts)
        if best is None or (share, bool(names)) > (best[0], bool(best[1].names)):
            best = (share, form)
    return None if best is None else best[1]


def _holds(line: str, separator: str | None, decimal: str, columns: tuple[int, ...]) -> bool:
    """Return whether a line has numbers in some columns, whatever the others have."""
    words = line.strip(" \r").replace(decimal, ".").split(separator)
    return len(words) > max(columns) and all(is_number(words[k]) for k in columns)


def _text(path: Path) -> Points:
    """Return the points in a text."""
    lines, form, places = _plain_points(path)
    text = ""
    if places is None:
        text = _plain(content_of(path))
        lines = text.split("\n", 4 * _SAMPLE)[: 4 * _SAMPLE]
        form = _form(lines)
    if form is None:
        shown = next(filter(None, map(str.strip, lines)), "")[:40]
        raise AsperityError(
            f"{path}: no line of it holds three numbers; it begins with {shown!r}; "
            "valid: x, y and z in each line"
        )
    if not form.names and len(_ON_THE_GLOBE.findall("\n".join(lines[: form.first]))) > 1:
        raise AsperityError(f"{path}: has latitude and longitude; valid: x, y, z (project them)")
    if form.separator == "," and are_decimal_commas(lines[form.first :][:_SAMPLE]):
        raise AsperityError(
            f"{path}: commas are decimal marks in it and stand between the numbers too; valid: "
            "semicolons or tabs between them, or decimal points"
        )
    notes = []
    if not form.names and form.width > 5 and _are_rows_and_columns(lines, form):
        form = form._replace(columns=(2, 3, 4))
        notes.append("are its first two columns rows and columns of a scan? "
                     "x, y and z are taken from the three behind them")  # fmt: skip
    elif not form.names and form.width > 3 and _counts_lines(lines, form):
        form = form._replace(columns=(1, 2, 3))
        notes.append("its first column counts the points: x, y and z are those behind it")
    if not form.names and (form.texts or _are_names(lines[: form.first][-1:], form)):
        notes.append(
            f"are x, y and z in columns {', '.join(str(k + 1) for k in form.columns)}? No names of "
            "columns state it: taken so"
        )
    if form.decimal == "," and any("," in line for line in lines[form.first :][:_SAMPLE]):
        notes.append("its numbers have decimal commas")
    if places is None:
        places = _places(path, text, form)
    elif form.width > 3 or form.columns != (0, 1, 2):
        places = np.ascontiguousarray(places[:, list(form.columns)])
    if form.names and form.columns != (0, 1, 2):
        places_of = zip("xyz", form.columns, strict=True)
        notes.append(", ".join(f"{axis} from column {k + 1}" for axis, k in places_of))
    if form.counted is not None and len(places) < form.counted:
        notes.append(f"it is cut short: it counts {form.counted} points and has {len(places)}")
    known = [*filter(None, form.units)]
    unit = known[0] if known else stated_unit("\n".join(lines[: form.first]))
    if len(set(known)) > 1:
        factors = [UNITS[own or known[0]] / UNITS[known[0]] for own in form.units]
        places = places * factors
        notes.append(f"x, y and z are in {', '.join(form.units)}, as their names state")
    return Points(places, unit, tuple(notes))


def _plain_points(path: Path) -> tuple[list[str], _Form | None, Array | None]:
    """Return the first lines of a large text of plain numbers, its form, and all its columns.

    The last is None for other texts. A few lines show the form if all others are read by it.
    """
    first = (head_of(path, 2 * _SAMPLE) or b"").split(b"\n", 2 * _SAMPLE)[:-1]
    if len(first) < 2 * _SAMPLE:
        return [], None, None
    lines = _plain(b"\n".join(first)).split("\n")
    form = _form(lines[:_FIRST])
    if form is None or form.first > _FIRST // 4 or form.texts or form.decimal != ".":
        return lines, form, None
    return lines, form, plain_numbers(path, form.first, form.separator, form.width)


def _places(path: Path, text: str, form: _Form) -> Array:
    """Return the points (n, 3) in a text, whatever else stands in it."""
    body = text.split("\n", form.first)[form.first]
    points = body.replace(",", ".") if form.decimal == "," else body
    found = numbers_of(points, form.separator, form.columns)
    if found is None:
        found = columns_of(points.split("\n"), form.columns, form.separator)
    return _line_by_line(path, body.split("\n"), form) if found is None else found


def _line_by_line(path: Path, lines: list[str], form: _Form) -> Array:
    """Return points (n, 3) among lines of which some hold none."""
    places = []
    for number, line in enumerate(lines, start=form.first + 1):
        line = line.partition("#")[0]
        values = _numbers(line, form.separator, form.decimal, texts=form.texts)
        if len(values) >= form.width or len(values) > max(form.columns):
            places.append([values[k] for k in form.columns])
        elif line.rstrip(" \r")[-1:] in (",", ";", "\t") or all(map(_is_missing, line.split())):
            places += [[math.nan] * 3] * bool(line.strip())
        elif not (len(values) == 1 or line.lstrip()[:2] == "//"):
            raise AsperityError(
                f"{path}: line {number} is {line.strip()[:40]!r}; valid: x, y and z"
            )
    return np.array(places, dtype=np.float64).reshape(-1, 3)


def _are_names(above: list[str], form: _Form) -> bool:
    """Return whether a line above the points has a word for each of their columns."""
    words = [word.strip() for line in above for word in line.lstrip("#/%").split(form.separator)]
    return form.width == len(words) and not any(map(is_number, words))


def _counts_lines(lines: list[str], form: _Form) -> bool:
    """Return whether the first column is 0, 1, 2, ... or 1, 2, 3, ..."""
    rows = [_numbers(x, form.separator, form.decimal) for x in lines[form.first :][:_SAMPLE]]
    first = np.array([row[0] for row in rows if len(row) == form.width])
    return len(first) > 8 and first[0] in (0.0, 1.0) and bool((np.diff(first) == 1.0).all())


def _are_rows_and_columns(lines: list[str], form: _Form) -> bool:
    """Return whether of all columns the third to the fifth alone are not whole, as of FARO."""
    rows = [_numbers(x, form.separator, form.decimal) for x in lines[form.first :][:_SAMPLE]]
    values = np.array([row for row in rows if len(row) == form.width]).reshape(-1, form.width)
    fractions = (values % 1.0 != 0.0).any(axis=0)
    return bool(fractions[2:5].all() and fractions.sum() == 3)
