"""Tables of other people's answers: CSV and Excel, by a mapping of columns or a known form.

Known forms are recognised by their columns: PsychoPy's wide CSV, and those of three public data
sets of which none is shipped (docs/data.md has how to get each). Everything else needs the columns
of its method (`METHODS`), under these names or mapped: `rating=Roughness`.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array
from asperity._core.data import table_beside
from asperity._core.files import text_of
from asperity._core.text_form import MISSING
from asperity.errors import AsperityError, require_choice
from asperity.psychophysics.outside.answers import METHODS, Answers

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Form:
    """A table's form: how it is recognised and what its columns mean."""

    name: str
    has: Sequence[str]
    """Columns by which it is recognised."""
    mapping: Mapping[str, list[str]]
    """Name in `METHODS`, or `condition` -> columns."""
    only: Mapping[str, str] = field(default_factory=dict)
    """Column -> the value of the rows that hold what is wanted."""
    words: Mapping[str, str] = field(default_factory=dict)

    def fits(self, table: pd.DataFrame) -> bool:
        """Return whether a table has the form."""
        return set(self.has) <= set(table.columns)


FORMS = tuple(Form(**entry) for entry in table_beside(__file__, "forms.toml")["form"])

_OWN = ("participant", "session", "date", "expName", "psychopyVersion", "frameRate", "expStart")


def psychopy_mapping(
    path: Path, columns: list[str], given: Mapping[str, list[str]]
) -> dict[str, list[str]]:
    """Return the mapping of PsychoPy's wide CSV: what is given, and the rest by its names.

    A slider's answer is the one column that ends in `.response`, an answer by key in `.keys`; the
    stimulus is the one column of the conditions' file, whose names have no dot. Where there are
    several, `--columns` has to name one.
    """
    mapping = dict(given)
    if "participant" not in mapping and "participant" in columns:
        mapping["participant"] = ["participant"]
    pair = {"first", "second"} <= {*mapping, *columns}
    wanted, ending = ("chosen", ".keys") if pair else ("rating", ".response")
    if wanted not in mapping and "rank" not in mapping:
        mapping[wanted] = [_only(path, wanted, [c for c in columns if c.endswith(ending)])]
    if not pair and "stimulus" not in mapping:
        own = [
            c for c in columns
            if "." not in c and c not in _OWN and not c.startswith("Unnamed")
            and [c] not in mapping.values()
        ]  # fmt: skip
        mapping["stimulus"] = [_only(path, "stimulus", own)]
    return mapping


def _only(path: Path, wanted: str, candidates: list[str]) -> str:
    if len(candidates) != 1:
        which = f"one of {', '.join(candidates[:8])}" if candidates else "a column"
        raise AsperityError(f"{path}: say which column is the {wanted}: --columns {wanted}={which}")
    return candidates[0]


_LARGEST = 64 * 2**20
"""Largest file that is read [bytes]."""
_DECIMAL_COMMA = re.compile(r"(?<![\d,])\d+,\d+(?![\d,])")
_POINT = re.compile(r"(?<![\d.])\d+\.\d+(?![\d.])")
"""Numbers with a decimal mark."""
_NO_CHOICE = ("None", "none", "NaN", "nan", "NA", "N/A", "null", "-")
"""Words where nothing was chosen, as PsychoPy's for no key."""
_CODES = (-1.0, -9.0, -99.0, -999.0, -9999.0, 99.0, 999.0, 9999.0, 88.0, 77.0)
"""Numbers by which questionnaires mark a missing answer."""


def read_answers(
    files: Sequence[Path],
    *,
    columns: Sequence[str] = (),
    method: str | None = None,
    where: Sequence[str] = (),
) -> Answers:
    """Read answers from one or several tables of the same form.

    Parameters
    ----------
    files : sequence of Path
        CSV (comma, semicolon or tab) or XLSX.
    columns : sequence of str
        `name=column` for each column whose name differs: of `METHODS`, and `condition`, which may
        be given more than once. `participant` may be left out where a file is a person.
    method : str, optional
        A key of `METHODS`; by default what the columns allow.
    where : sequence of str
        `column=value`: keep these rows alone.
    """
    import pandas as pd  # slow to import

    if not files:
        raise AsperityError("give at least one file of answers")
    if method is not None:
        require_choice("method", method, METHODS)
    parts = [_read_one(Path(file), columns, method, where) for file in files]
    kinds = {part.method for part in parts}
    if len(kinds) > 1:
        raise AsperityError(f"the files are of different methods: {', '.join(sorted(kinds))}")
    first = parts[0]
    table = pd.concat([part.table for part in parts], ignore_index=True)
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    return Answers(first.method, table, first.form, notes, first.words)


def _read_one(
    path: Path, columns: Sequence[str], method: str | None, where: Sequence[str]
) -> Answers:
    raw = read_table(path)
    mapping = _pairs("columns", columns)
    form = None if mapping else next((f for f in FORMS if f.fits(raw)), None)
    notes: list[str] = []
    words: dict[str, str] = {}
    name = "table"
    if form is not None:
        mapping, name, words = dict(form.mapping), form.name, dict(form.words)
        raw = _kept(path, raw, form, notes, where)
    elif "psychopyVersion" in raw.columns or "expName" in raw.columns:
        mapping, name = psychopy_mapping(path, list(raw.columns), mapping), "PsychoPy"
    raw = _where(path, raw, where)
    return _tidy(path, raw, mapping, method, (name, words, notes))


def read_table(path: Path) -> pd.DataFrame:
    """Return the table of a file, every cell as it stands; errors are one line."""
    from zipfile import BadZipFile

    import pandas as pd  # slow to import

    if not path.is_file():
        raise AsperityError(f"{path}: no such file")
    if path.stat().st_size > _LARGEST:
        raise AsperityError(f"{path}: larger than {_LARGEST >> 20} MiB; give a part of it")
    kind = path.suffix.lower()
    if kind == ".mat":
        raise AsperityError(
            f"{path}: a MATLAB file; write it as a table first: writetable(T, 'table.csv')"
        )
    try:
        # Stimuli and people may be named NA or None: empty cells alone are missing in each column.
        cells = {"keep_default_na": False, "na_values": [""]}
        if kind in (".xlsx", ".xlsm"):
            found = pd.read_excel(path, **cells)
        elif kind in (".csv", ".tsv", ".txt"):
            text = without_comments(text_of(path.read_bytes()))
            separator = max(",;\t", key=text.partition("\n")[0].count)
            comma = separator != "," and _DECIMAL_COMMA.search(text) and not _POINT.search(text)
            found = pd.read_csv(
                io.StringIO(text), sep=separator, decimal="," if comma else ".", **cells
            )
        else:
            what = kind or "a file without ending"
            raise AsperityError(f"{path}: cannot read {what} as a table; give .csv, .tsv or .xlsx")
    except ImportError as error:
        raise AsperityError(
            f"{path}: reading Excel files needs openpyxl: pip install 'asperity[excel]'"
        ) from error
    except (ValueError, OSError, KeyError, BadZipFile, pd.errors.ParserError) as error:
        if isinstance(error, AsperityError):
            raise
        raise AsperityError(f"{path}: not a table that can be read: it is empty or damaged") from (
            error
        )
    if found.empty:
        raise AsperityError(f"{path}: the table has no rows")
    found.columns = [str(column).strip() for column in found.columns]
    return found


def without_comments(text: str) -> str:
    """Return a text without the lines above its table that begin with #."""
    while text.startswith("#"):
        text = text.partition("\n")[2]
    return text


def _pairs(option: str, given: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for pair in given:
        name, _, column = pair.partition("=")
        if not name or not column:
            raise AsperityError(f"{option} must be name=column, got {pair!r}")
        found.setdefault(name, []).append(column)
    return found


def _where(path: Path, raw: pd.DataFrame, where: Sequence[str]) -> pd.DataFrame:
    for column, values in _pairs("where", where).items():
        _require(path, raw, column)
        raw = raw[raw[column].astype(str).isin(values)]
        if raw.empty:
            raise AsperityError(f"{path}: no row has {column} = {' or '.join(values)}")
    return raw


def _kept(
    path: Path, raw: pd.DataFrame, form: Form, notes: list[str], where: Sequence[str]
) -> pd.DataFrame:
    """Return the rows of a known form that hold what is asked for."""
    asked = _pairs("where", where)
    for column, value in form.only.items():
        if column in asked:
            continue
        other = raw[raw[column].astype(str) != value]
        if len(other):
            notes.append(f"{len(other)} rows whose {column} is not {value} were left out")
        raw = raw[raw[column].astype(str) == value]
    if raw.empty:
        raise AsperityError(f"{path}: no row is left of the form {form.name}")
    return raw


def _require(path: Path, raw: pd.DataFrame, column: str) -> None:
    if column not in raw.columns:
        names = ", ".join(map(str, list(raw.columns)[:12]))
        raise AsperityError(f"{path}: no column {column!r}; it has {names}")


def _tidy(
    path: Path, raw: pd.DataFrame, mapping: dict[str, list[str]], method: str | None,
    about: tuple[str, dict[str, str], list[str]],
) -> Answers:  # fmt: skip
    """Return the answers of a table by a mapping."""
    import pandas as pd  # slow to import

    name, words, notes = about
    known = {column for needed in METHODS.values() for column in needed} | {"condition"}
    for target, sources in mapping.items():
        if target not in known:
            raise AsperityError(f"columns name {target!r}; valid are {', '.join(sorted(known))}")
        for source in sources:
            _require(path, raw, source)
    named = {str(column).casefold(): column for column in reversed(list(raw.columns))}
    have = {c: mapping.get(c, [named.get(c, c)]) for c in known if c in mapping or c in named}
    method = method or next(
        (m for m, needed in METHODS.items() if {*needed} - {"participant", "trial"} <= set(have)),
        None,
    )
    if method is None:
        needs = "; ".join(f"{m}: {', '.join(needed)}" for m, needed in METHODS.items())
        names = ", ".join(list(map(str, raw.columns))[:10])
        raise AsperityError(
            f"{path}: columns of no method; map them with --columns name=column ({needs}); "
            f"it has {names}"
        )
    table = pd.DataFrame(index=raw.index)
    for column in METHODS[method]:
        if column in have:
            table[column] = raw[have[column][0]]
        elif column == "participant":
            table[column] = path.stem
            notes.append("no participant: each file counts as one person")
        elif column == "trial":
            table[column] = 0
        else:
            raise AsperityError(
                f"{path}: {method} needs a column {column}; map it: --columns {column}=NAME"
            )
    parts = [raw[source].map(as_text) for source in have.get("condition", [])]
    table["condition"] = parts[0].str.cat(parts[1:], sep=", ") if parts else ""
    return _checked(path, method, table, name, words, notes)


def _checked(
    path: Path, method: str, table: pd.DataFrame, name: str, words: dict[str, str],
    notes: list[str],
) -> Answers:  # fmt: skip
    import pandas as pd  # slow to import

    numbers = [column for column in ("rating", "rank") if column in table]
    for column in numbers:
        table[column] = table[column].map(_or_missing)
        values = pd.to_numeric(table[column], errors="coerce")
        bad = table[column][values.isna() & table[column].notna()]
        if len(bad):
            raise AsperityError(f"{path}: {column} must be a number, got {bad.iloc[0]!r}")
        table[column] = values
        notes += _coded(column, values.dropna().to_numpy())
    if method == "choice":
        table["chosen"] = table["chosen"].where(~table["chosen"].isin(_NO_CHOICE))
    if table.empty:
        raise AsperityError(f"{path}: no answers in it")
    missing = table.drop(columns="condition").isna().any(axis=1)
    if missing.any():
        what = {"magnitude": "rating", "choice": "choice", "ranking": "rank"}[method]
        notes.append(f"{int(missing.sum())} of {len(table)} rows have no {what} and were left out")
        table = table[~missing]
    if table.empty:
        raise AsperityError(f"{path}: every row lacks an answer")
    for column in table.columns.difference(numbers):
        table[column] = table[column].map(as_text)
    if method == "choice":
        table["chosen"] = _chosen(path, table)
    return Answers(method, table.reset_index(drop=True), name, tuple(notes), words)


def _or_missing(cell: object) -> object:
    """Return an answer, or NaN for a word that stands for a missing one."""
    return math.nan if isinstance(cell, str) and cell.strip().lower() in MISSING else cell


def _coded(column: str, values: Array) -> list[str]:
    """Return a doubt of answers that look like a code for a missing one, far from all others."""
    for code in np.unique(values):
        others = values[values != code]
        if code in _CODES and others.size and np.abs(others - code).min() > np.ptp(others):
            count = int(np.count_nonzero(values == code))
            return [
                f"is a {column} of {code:g} a missing answer? It is there {count} times, far from "
                f"all others ({others.min():g} to {others.max():g}): empty its cells, if so"
            ]
    return []


def _chosen(path: Path, table: pd.DataFrame) -> pd.Series:
    """Return the name of what was chosen: given as such, or as first or second."""
    places = {"first": "first", "1": "first", "second": "second", "2": "second"}
    found = table["chosen"].copy()
    named = (found == table["first"]) | (found == table["second"])
    for i in table.index[~named]:
        place = places.get(str(found[i]).lower())
        if place is None:
            raise AsperityError(
                f"{path}: chosen must be the name of the first or the second, or 1 or 2, "
                f"got {found[i]!r}"
            )
        found[i] = table.loc[i, place]
    return found


def as_text(value: object) -> str:
    """Return a cell as text; whole numbers lose their .0."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value).strip()
