"""Tables of numbers in text as other programs write them.

Encodings (UTF-8, UTF-16, Windows and Latin-1), separators, decimal commas, lines above the numbers,
and words for missing values differ from program to program; numbers are parsed by NumPy, those of
a large file of nothing else straight from it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.large_tables import numbers_of
from asperity._core.plain_tables import ends_plainly, head_of, plain_lines, plain_numbers
from asperity._core.spreadsheets import SHEETS, text_of_sheet
from asperity._core.text_form import (
    LOOKED_AT,
    MISSING,
    OPENING,
    TWO_WORDS,
    WORD,
    are_decimal_commas,
    bare,
    decoded,
    first_rows,
    format_of,
    is_almost_empty,
    is_count,
    is_footer,
    is_label,
    is_number,
    is_row,
    without_footer,
    without_groups,
    wrong_word,
)
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError

_MARKS = "#%;!\"'/*"
_NAMES = re.compile(r"\S+(?:\s*[\[(][^\])]*[\])])?")
_QUOTED = re.compile(r'"([^"]*)"')
_LETTER = re.compile(r"[^\W\d]")
_BLANK = re.compile(r"\n[ \t\r]*\n")


_EITHER = {
    ",": re.compile(r"[+-]?[1-9]\d{0,2},\d{3}"),
    ".": re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}"),
}
"""Numbers that do not show it."""


@dataclass(frozen=True)
class TextTable:
    """Rows of numbers and the lines above them."""

    path: Path
    header: tuple[str, ...]
    """Lines above the numbers, without the signs of a comment."""
    body: str
    """The rows as text; only the first ones where `numbers` has all of them."""
    first_line: int
    """Number of the first line of numbers in the file, from 1."""
    separator: str | None
    """None where white space separates."""
    decimal: str
    columns: int
    error: type[AsperityError] = AsperityError
    row: str = "line"
    """What a row is in the file."""
    numbers: Array | None = field(default=None, compare=False, repr=False)
    """All rows, of a large file in which each line is one and holds nothing but numbers."""
    whole: tuple[str, ...] = field(default=(), compare=False, repr=False)
    """Lines above the numbers as they are, empty cells at their beginning too."""
    full: int = 0
    """Cells of the first row, with those that are empty in all rows."""

    @property
    def names(self) -> tuple[str, ...] | None:
        """Names of the columns: the last line above the numbers that has one for each."""
        for line, whole in reversed([*zip(self.header, self.whole or self.header, strict=True)]):
            if re.match(r"\s*(?!unnamed)[\w -]+:\s", line, re.IGNORECASE):  # pandas has Unnamed: 0
                continue
            quoted = _QUOTED.findall(whole) if whole.startswith('"') else []
            if len(quoted) == self.columns - 1 and self.body.startswith('"'):
                return ("", *quoted)  # R writes no name above those of the rows
            # Spaces alone separate names where each may have a unit: other lines are titles.
            spaced = (None,) if "[" in line or "(" in line else ()
            for separator in (self.separator, "\t", ";", ",", *spaced):
                found = _NAMES.findall(line) if separator is None else self._split(line, separator)
                if separator is not None and whole.startswith(separator):
                    first = self._split(whole, separator)  # whose name is empty, or a comment
                    found = first if len(first) == self.columns else found
                if len(found) == self.columns and any(map(_LETTER.search, found)):
                    return tuple(name.strip().strip("\"'").strip() for name in found)
        return None

    def _split(self, line: str, separator: str) -> list[str]:
        """Return the cells of a line above, without those whose column is empty."""
        cells = line.split(separator)
        if self.columns < len(cells) == self.full:
            return cells[: self.columns]
        return cells if len(cells) == self.columns else line.rstrip(separator).split(separator)

    def values(self, columns: list[int] | None = None) -> Array:
        """Return the numbers of some columns, or of all, (rows, columns); NaN where missing.

        They are the caller's to change, `numbers` among them.
        """
        if self.numbers is not None:
            every = [*range(self.columns)]
            return self.numbers if columns in (None, every) else self.numbers[:, columns]
        body = self.body
        if self.decimal == ",":
            body = body.replace(",", ".")
        try:
            return self._parsed(body, columns)
        except (ValueError, IndexError, UnicodeError):
            body = self._tidied(body)
        try:
            return self._parsed(body, columns)
        except (ValueError, IndexError, UnicodeError):
            self._refuse_line(body, columns)
            raise

    def _parsed(self, body: str, columns: list[int] | None) -> Array:
        found = numbers_of(body, self.separator, columns)
        if found is not None and (columns is not None or found.shape[1] == self.columns):
            return found
        return np.loadtxt(
            body.split("\n"), delimiter=self.separator, comments="#", ndmin=2, usecols=columns,
            encoding=None,
        )  # fmt: skip

    def _tidied(self, body: str) -> str:
        """Return the text with `nan` for missing values, and numbers as NumPy reads them."""
        body = re.sub(r"[\x00\x1a\f]", "", body.replace("−", "-").replace('"', ""))
        body = re.sub(r"(?i)(?<=\d)d(?=[+-]?\d)", "e", body)
        body = TWO_WORDS.sub("nan", body)
        if self.separator is None:
            return WORD.sub(_word, body)
        lines = []
        for line in body.split("\n"):
            cells = bare(line).split(self.separator)
            while len(cells) > self.columns and not cells[-1].strip():
                cells.pop()
            blank = not any(cell.strip() for cell in cells)
            lines.append("" if blank else self.separator.join(map(_cell, cells)))
        return "\n".join(lines)

    @property
    def commas_only(self) -> bool:
        """Whether commas separate whole numbers, or are decimal marks: nothing shows which."""
        if self.separator != "," or "." in self.body:
            return False
        body = self.complete().body
        return "." not in body and " " not in body.strip()

    def complete(self) -> TextTable:
        """Return the table with all of its rows as text, and no numbers."""
        if self.numbers is None:
            return self
        text = decoded(content_of(self.path)) or ""
        body = without_footer(text.split("\n", self.first_line - 1)[-1])
        return replace(self, body=body, numbers=None)

    @property
    def perhaps_thousands(self) -> str:
        """A number whose mark may group thousands, if all that have one are such; else ""."""
        if self.separator != ";" and (self.separator != "\t" or self.decimal == "."):
            return ""
        rows = first_rows(self.body)
        cells = [cell.strip() for row in rows for cell in bare(row).split(self.separator)]
        marked = [cell for cell in cells if self.decimal in cell]
        either = _EITHER[self.decimal]
        return marked[0] if marked and all(map(either.fullmatch, marked)) else ""

    def rows_at(self) -> Sequence[int]:
        """Return the number of the line of each row."""
        if self.numbers is not None:
            return range(self.first_line, self.first_line + len(self.numbers))
        body = self.body.rstrip("\n")
        if "#" not in body and _BLANK.search(body) is None:
            return range(self.first_line, self.first_line + body.count("\n") + 1)
        lines = enumerate(self.body.split("\n"), self.first_line)
        return [number for number, line in lines if bare(line).strip()]

    def _refuse_line(self, body: str, columns: list[int] | None) -> None:
        for number, line in enumerate(body.split("\n"), self.first_line):
            line = bare(line)
            if not line.strip():
                continue
            cells = line.split(self.separator)
            where = f"{self.path}: {self.row} {number}"
            if len(cells) != self.columns:
                raise self.error(
                    f"{where} has {len(cells)} columns, the first {self.columns}"
                ) from None
            for at, cell in enumerate(cells):
                if (columns is None or at in columns) and not is_number(cell):
                    shown = repr(cell.strip()[:40])
                    if any("\x7f" <= char <= "\x9f" or char < " " for char in cell.strip()):
                        shown = "what stands there, which is no text,"
                    raise self.error(
                        f"{where}: {shown} is no number; valid: numbers, and nan for what is "
                        "missing"
                    ) from None
        raise self.error(f"{self.path}: its numbers cannot be read; valid: rows of numbers")


def read_text_table(
    path: Path, *, texts: bool = False, error: type[AsperityError] = AsperityError
) -> TextTable:
    """Return the table of numbers in a text file.

    Parameters
    ----------
    path : Path
    texts : bool
        Whether a row may have words among 8 or more cells, as logs do.
    error : type
        Of the error to raise.

    Raises
    ------
    AsperityError
        No text, or no row of numbers.
    """
    if path.suffix.lower() in SHEETS:
        return _table(path, text_of_sheet(path, error), texts, error)
    plain = _plain_table(path, texts)
    if plain is not None:
        return replace(plain, error=error)
    text = decoded(content_of(path))
    if text is None:
        kind = path.suffix.lower()
        raise error(f"{path}: cannot be read as a {kind} file: no text; valid: rows of numbers")
    if "\n" not in text and "\r" in text:
        text = text.replace("\r", "\n")
    return _table(path, without_groups(text), texts, error)


def _plain_table(path: Path, texts: bool) -> TextTable | None:
    """Return the table of a large file of plain numbers, judged by its head; None for others."""
    head = head_of(path, 2 * LOOKED_AT)
    text = None if head is None or b"\n" not in head else decoded(head)
    if head is None or text is None or without_groups(text) != text:
        return None
    try:
        table = _table(path, text, texts, AsperityError, is_whole=False)
    except AsperityError:
        return None
    above = table.first_line - 1
    start = len(head) - len(head.split(b"\n", above)[-1])
    if len(table.body) < OPENING and table.body.count("\n") < LOOKED_AT:
        return None
    if table.decimal != "." or not ends_plainly(head[:start]):
        return None
    lines = plain_lines(path, start)
    if lines is None or is_footer(lines[1]):
        return None
    form = table.separator, table.columns, "latin-1"
    numbers = plain_numbers(path, above, *form, rows=lines[0])
    if numbers is None or len(numbers) != lines[0]:  # else there are blank lines
        return None
    return replace(table, numbers=numbers)


def _table(
    path: Path, text: str, texts: bool, error: type[AsperityError], *, is_whole: bool = True
) -> TextTable:
    """Return the table in a text, or in the first part of one."""
    start, number, header, whole, above = 0, 0, [], [], ""
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line, number = text[start:end], number + 1
        rest = text[end + 1 : end + 4000]
        counts = is_count(line, rest) and not (texts and is_almost_empty(line))
        if is_row(line, texts) and not counts and not is_label(line, rest, texts):
            break
        if line.strip():
            header.append(line.strip().lstrip(_MARKS).strip())
            whole.append(line.strip(" \r"))
            above = line
        start = end + 1
    else:
        shown = f"; it begins with {header[0][:40]!r}" if header else ""
        raise error(f"{path}: it holds no numbers in rows{shown}; valid: rows of numbers")
    body = without_footer(text[start:]) if is_whole else text[start:]
    sample = [bare(line).strip(" \r") for line in first_rows(body)]
    separator, decimal = format_of([line for line in sample if line.strip()])
    columns = _width(body, separator, sample[0])
    if separator == "," and decimal == "." and "." not in body and are_decimal_commas(sample):
        raise error(
            f"{path}: commas are decimal marks in it and stand between the numbers too; valid: "
            "semicolons or tabs between them, or decimal points"
        )
    wrong = wrong_word(above, separator, columns)
    if wrong:
        raise error(
            f"{path}: line {number - 1}: {wrong!r} is no number; valid: numbers, and nan for what "
            "is missing"
        )
    full = len(sample[0].split(separator))
    return TextTable(
        path, tuple(header), body, number, separator, decimal, columns, error, whole=tuple(whole),
        full=full,
    )  # fmt: skip


def _width(body: str, separator: str | None, first: str) -> int:
    """Return the number of columns: empty cells that end the first row count if others have them.

    A separator behind each row separates nothing.
    """
    full = len(first.rstrip(separator).split(separator)) if separator else len(first.split())
    there = len(first.split(separator))
    if separator is None or there == full:
        return full
    cell = rf"[^\n{separator}]*"
    last = rf"^(?:{cell}{separator}){{{full},{there - 1}}}{cell}[^\s{separator}]"
    counts = (found.group().count(separator) + 1 for found in re.finditer(last, body, re.MULTILINE))
    return max(counts, default=full)


def _word(match: re.Match[str]) -> str:
    return "nan" if match.group().lower() in MISSING else match.group()


def _cell(cell: str) -> str:
    word = cell.strip().lower()
    return "nan" if not word or word in MISSING else cell
