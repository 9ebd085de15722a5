"""Poses in JSON: turned into a table with names, as CSV has it, so that the same rules hold.

Records, one a pose (`[{"t": 0.0, "position": [...], ...}, ...]`, or one a line), or lists by name
(`{"t": [...], "position": [[...]], "quaternion": [[...]]}`). What stands beside them, as a unit or
the frames in a second, are lines above the table. Numbers keep all the digits that they have.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from asperity._core.files import reading
from asperity._core.text_form import decoded
from asperity._core.text_table import TextTable
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.scene.pose_arrays import names_of
from asperity.scene.pose_columns import meaning_of

JSON_FILES = (".json", ".jsonl", ".ndjson")
_BETWEEN = re.compile(r'[\s#"]+')
"""What would end a cell of the table, or begin a comment."""
_VALID = (
    'valid: records ([{"t": 0, "x": 0, ...}, ...], or one a line), or lists by name '
    '({"t": [...], "position": [[...]], "quaternion": [[...]]})'
)
_Leaves = dict[str, Any]
"""What stands in a record by name, `pose.position.x`: texts (of numbers too), None, or lists."""


def json_table(path: Path) -> tuple[TextTable, tuple[str, ...]]:
    """Return the rows of a JSON file, a pose each, with the names of their columns, and notes.

    Raises
    ------
    AsperityError
        A file that is damaged, or holds neither records nor lists of one length; one line.
    """
    with reading(path, "poses", JSON_FILES, packed=JSON_FILES):
        return table_of(path, _loaded(path))


def table_of(path: Path, found: Any) -> tuple[TextTable, tuple[str, ...]]:
    """Return the rows of records, numbers as their texts, as `json_table` does."""
    notes: list[str] = []
    above: tuple[str, ...] = ()
    if isinstance(found, dict):
        leaves = dict(_leaves(_numbered_as_lists(found)))
        records, beside = _records_within(path, leaves)
        above = tuple(f"{n}: {_cell(value)}" for n, value in beside.items() if _is_cell(value))
        others = [name for name, value in beside.items() if not _is_cell(value)]
        notes += [f"left out: {', '.join(others)[:120]}"] if others else []
    elif isinstance(found, list) and found:
        records = [dict(_leaves(row)) if isinstance(row, dict) else row for row in found]
    else:
        raise _refused(path, "it holds no poses")
    if all(isinstance(record, list) for record in records):
        names, rows = None, [_flat(path, k, row) for k, row in enumerate(records, 1)]
    else:
        names, rows = _in_rows(path, records, notes)
    width = len(rows[0])
    if width == 0:
        raise _refused(path, "it holds no poses")
    wrong = next((k for k, row in enumerate(rows, 1) if len(row) != width), None)
    if wrong is not None:
        raise _refused(
            path, f"record {wrong} has {len(rows[wrong - 1])} numbers, the first {width}"
        )
    head = (*above, "\t".join(names)) if names is not None else above
    body = "\n".join("\t".join(row) for row in rows)
    return TextTable(path, head, body, 1, "\t", ".", width, row="record"), tuple(notes)


def _numbered_as_lists(found: dict[str, Any]) -> dict[str, Any]:
    """Return columns whose values are numbered by rows, `{"x": {"0": 0.1}}` of pandas, as lists."""
    if not all(isinstance(value, dict) and value for value in found.values()):
        return found
    rows = {tuple(value) for value in found.values()}
    if len(rows) != 1 or not all(key.isdigit() for key in rows.pop()):
        return found
    return {name: [*value.values()] for name, value in found.items()}


def _refused(path: Path, reason: str) -> AsperityError:
    return AsperityError(f"{path}: {reason}; {_VALID}")


def _loaded(path: Path) -> Any:
    """Return what a file holds, numbers as their texts; lines of records as a list."""
    text = decoded(content_of(path))
    if text is None:
        raise _refused(path, "cannot be read as JSON: it is no text")
    try:
        return _parsed(text)
    except ValueError as error:
        lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
        if len(lines) < 2 or not all(line.lstrip()[0] in "{[" for _, line in lines):
            raise _refused(path, f"cannot be read as JSON: {error}") from None
    records = []
    for number, line in lines:
        try:
            records.append(_parsed(line))
        except ValueError as error:
            raise _refused(path, f"line {number} cannot be read as JSON: {error}") from None
    return records


def _parsed(text: str) -> Any:
    return json.loads(
        text.lstrip("\ufeff"), parse_float=str, parse_int=str, parse_constant=str,
        object_pairs_hook=_without_twins,
    )  # fmt: skip


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twin = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twin[:40]!r} is there twice")
    return found


def _is_cell(value: Any) -> bool:
    return value is None or isinstance(value, str | bool)


def _cell(value: Any) -> str:
    """Return a value as a cell of a table."""
    return "nan" if value is None else _BETWEEN.sub(" ", str(value)).strip() or "-"


def _leaves(record: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Yield what stands in a record, and in the records within it, by names with dots."""
    for key, value in record.items():
        name = f"{before}{_BETWEEN.sub(' ', key)}"
        if isinstance(value, dict):
            yield from _leaves(value, f"{name}.")
        else:
            yield name, value


def _records_within(path: Path, leaves: _Leaves) -> tuple[list[Any], _Leaves]:
    """Return the records that a table of JSON holds, and what stands beside them."""
    lists = {name: value for name, value in leaves.items() if isinstance(value, list) and value}
    within = [n for n, value in lists.items() if all(isinstance(row, dict) for row in value)]
    beside = {name: value for name, value in leaves.items() if name not in lists}
    if len(within) > 1:
        raise _refused(path, f"it holds several lists of records: {', '.join(within)[:80]}")
    if within:
        return [dict(_leaves(row)) for row in lists[within[0]]], beside
    if not lists:
        return [leaves], {}
    meant = {
        name: len(value)
        for name, value in lists.items()
        if any(meaning_of(column) for column in names_of(name, _shape(value[0]), []))
    }
    if not meant:
        raise _refused(path, f"it holds no poses ({', '.join(lists)[:80]})")
    lengths = [*meant.values()]
    if len({*lengths}) > 1:
        shown = ", ".join(f"{name} has {length}" for name, length in meant.items())
        raise _refused(path, f"its lists differ in length: {shown[:120]}")
    columns = {name: value for name, value in lists.items() if len(value) == lengths[0]}
    rows = zip(*columns.values(), strict=True)
    beside |= {name: value for name, value in lists.items() if name not in columns}
    return [dict(zip(columns, row, strict=True)) for row in rows], beside


def _shape(value: Any) -> tuple[int, ...]:
    """Return the shape of lists within lists by the first of each, () for one value."""
    if not isinstance(value, list):
        return ()
    return (len(value), *(_shape(value[0]) if value else ()))


def _flat(path: Path, number: int, value: Any) -> list[str]:
    """Return the cells of lists within lists, in their order."""
    if _is_cell(value):
        return [_cell(value)]
    if isinstance(value, dict):
        raise _refused(path, f"record {number} holds a record within a list")
    return [cell for part in value for cell in _flat(path, number, part)]


def _in_rows(
    path: Path, records: list[Any], notes: list[str]
) -> tuple[tuple[str, ...], list[list[str]]]:
    """Return the names of the columns of records, and the cells of each; the first has them all."""
    for number, record in enumerate(records, 1):
        if not isinstance(record, dict):
            what = "it holds no poses" if number == 1 else f"record {number} has no names"
            raise _refused(path, what)
    shapes = {name: _shape(value) for name, value in records[0].items()}
    columns = {name: [*names_of(name, shape, notes)] for name, shape in shapes.items()}
    left = [name for name, own in columns.items() if not own]
    more = [n for n in dict.fromkeys(n for record in records for n in record) if n not in shapes]
    if left or more:
        notes.append(f"left out: {', '.join((*left, *more))[:120]}")
    kept = {name: own for name, own in columns.items() if own}
    rows = []
    for number, record in enumerate(records, 1):
        row: list[str] = []
        for name, own in kept.items():
            if name not in record:
                raise _refused(path, f"record {number} has no {name}, which record 1 has")
            value = record[name]
            cells = ["nan"] * len(own) if value is None else _flat(path, number, value)
            if len(cells) != len(own):
                raise _refused(
                    path, f"record {number}: {name} has {len(cells)} values, not {len(own)}"
                )
            row += cells
        rows.append(row)
    return tuple(name for own in kept.values() for name in own), rows
