"""Tables of numbers in text as other programs write them.

Encodings (UTF-8, UTF-16, Windows and Latin-1), separators, decimal commas, lines above the numbers,
and words for missing values differ from program to program; numbers are parsed by NumPy.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity._core.arrays import Array
from asperity._core.files import encodings_of
from asperity._core.large_tables import numbers_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError

_MISSING_WORDS = """
    nan na n/a #n/a #na null none nil - -- --- ----- * ** *** bad void masked missing invalid
    nodata no_data nm undefined undef hole #name? #value! #div/0! #num! 1.#qnan -1.#qnan 1.#ind
    -1.#ind 1.#inf -1.#inf 1.#snan inf -inf +inf infinity -infinity ? #### over under overflow
    -nan nan(ind) -nan(ind) fehlt ungültig
"""
MISSING = frozenset(_MISSING_WORDS.split())
"""Words for a missing value, in lower case; so is an empty cell."""

_MARKS = "#%;!\"'/*"
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
_WORD = re.compile(r"[^\s,;]+")
_NAMES = re.compile(r"\S+(?:\s*[\[(][^\])]*[\])])?")
_COMMENT = re.compile(r"(?i)(?<!\.)#(?!n/?a|name|value|div|num|#)")
_TWO_WORDS = re.compile(r"(?i)\b(no|not)[ _](data|value|measured)\b")
"""Words for a missing value that are two."""
_BLANK = re.compile(r"\n[ \t\r]*\n")
_QUOTED_COMMA = re.compile(r'"[+-]?[\d.]*\d,\d[\d.,]*"')
"""A number with a comma in quotation marks, as spreadsheets write it where commas separate."""


def _grouped(mark: str, decimal: str) -> re.Pattern[str]:
    """Return the pattern of a cell whose marks group thousands."""
    number = rf" *[+-]?\d{{1,3}}(?:[{mark}]\d{{3}})+[{decimal}]\d+ *"
    return re.compile(rf"^{number}(?=[;\t])|(?<=[;\t]){number}(?=[;\t\r\n]|$)", re.MULTILINE)


_GROUPED = {",": _grouped(",", "."), ".": _grouped(".", ",")}
"""Cells that show which mark groups thousands: `1,234.5`, `1.234,5`."""
_EITHER = {
    ",": re.compile(r"[+-]?[1-9]\d{0,2},\d{3}"),
    ".": re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}"),
}
"""Numbers that do not show it."""
_LOOKED_AT = 40
"""Rows from which the separator is found."""


def decoded(content: bytes) -> str | None:
    """Return text, whatever its encoding; None for bytes that are no text."""
    for encoding in encodings_of(content):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        controls = sum(c < " " and c not in "\t\n\r\f\x1a" for c in text[:4096])
        return text if controls <= 0.01 * len(text[:4096]) else None
    return None


def without_groups(text: str) -> str:
    """Return text without marks that group thousands, and without quotes round decimal commas.

    Cells of numbers with commas that are quoted are set apart by semicolons.
    """
    if '"' in text and ";" not in text and _QUOTED_COMMA.search(text):
        text = "\n".join(";".join(cells) for cells in csv.reader(text.splitlines()))
    for mark, grouped in _GROUPED.items():
        if grouped.search(text[:20_000]):
            text = re.sub(rf"(?<=\d)[{mark}](?=\d{{3}})", "", text)
    return text


@dataclass(frozen=True)
class TextTable:
    """Rows of numbers and the lines above them."""

    path: Path
    header: tuple[str, ...]
    """Lines above the numbers, without the signs of a comment."""
    body: str
    first_line: int
    """Number of the first line of numbers in the file, from 1."""
    separator: str | None
    """None where white space separates."""
    decimal: str
    columns: int
    error: type[AsperityError] = AsperityError
    row: str = "line"
    """What a row is in the file."""

    @property
    def names(self) -> tuple[str, ...] | None:
        """Names of the columns: the last line above the numbers that has one for each."""
        for line in reversed(self.header):
            if re.match(r"\s*(?!unnamed)[\w -]+:\s", line, re.IGNORECASE):  # pandas has Unnamed: 0
                continue
            # Spaces alone separate names where each may have a unit: other lines are titles.
            spaced = (None,) if "[" in line or "(" in line else ()
            for separator in (self.separator, "\t", ";", ",", *spaced):
                cells = line.split(separator) if separator else None
                if cells is not None and len(cells) != self.columns:
                    cells = line.rstrip(separator).split(separator)
                found = _NAMES.findall(line) if cells is None else cells
                if len(found) == self.columns and any(re.search(r"[^\W\d]", n) for n in found):
                    return tuple(name.strip().strip("\"'").strip() for name in found)
        return None

    def values(self, columns: list[int] | None = None) -> Array:
        """Return the numbers of some columns, or of all, (rows, columns); NaN where missing."""
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
        body = _TWO_WORDS.sub("nan", body)
        if self.separator is None:
            return _WORD.sub(_word, body)
        lines = []
        for line in body.split("\n"):
            cells = _bare(line).split(self.separator)
            if len(cells) == self.columns + 1 and not cells[-1].strip():
                cells.pop()
            blank = not any(cell.strip() for cell in cells)
            lines.append("" if blank else self.separator.join(map(_cell, cells)))
        return "\n".join(lines)

    @property
    def commas_only(self) -> bool:
        """Whether commas separate whole numbers, or are decimal marks: nothing shows which."""
        return self.separator == "," and "." not in self.body and " " not in self.body.strip()

    @property
    def perhaps_thousands(self) -> str:
        """A number whose mark may group thousands, if all that have one are such; else ""."""
        if self.separator != ";" and (self.separator != "\t" or self.decimal == "."):
            return ""
        rows = self.body[:200_000].splitlines()[:_LOOKED_AT]
        cells = [cell.strip() for row in rows for cell in _bare(row).split(self.separator)]
        marked = [cell for cell in cells if self.decimal in cell]
        either = _EITHER[self.decimal]
        return marked[0] if marked and all(map(either.fullmatch, marked)) else ""

    def rows_at(self) -> Sequence[int]:
        """Return the number of the line of each row."""
        body = self.body.rstrip("\n")
        if "#" not in body and _BLANK.search(body) is None:
            return range(self.first_line, self.first_line + body.count("\n") + 1)
        lines = enumerate(self.body.split("\n"), self.first_line)
        return [number for number, line in lines if _bare(line).strip()]

    def _refuse_line(self, body: str, columns: list[int] | None) -> None:
        for number, line in enumerate(body.split("\n"), self.first_line):
            line = _bare(line)
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
    text = decoded(content_of(path))
    if text is None:
        kind = path.suffix.lower()
        raise error(f"{path}: cannot be read as a {kind} file: no text; valid: rows of numbers")
    if "\n" not in text and "\r" in text:
        text = text.replace("\r", "\n")
    text = without_groups(text)
    start, number, header, above = 0, 0, [], ""
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line, number = text[start:end], number + 1
        rest = text[end + 1 : end + 4000]
        if _is_row(line, texts) and not _is_count(line, rest) and not _is_label(line, rest):
            break
        if line.strip():
            header.append(line.strip().lstrip(_MARKS).strip())
            above = line
        start = end + 1
    else:
        raise error(f"{path}: there are no numbers in it; valid: rows of numbers")
    body = _without_footer(text[start:])
    sample = [_bare(line).strip(" \r") for line in body[:200_000].splitlines()[:_LOOKED_AT]]
    separator, decimal = _format([line for line in sample if line.strip()])
    first = sample[0].rstrip(separator) if separator else sample[0]
    columns = len(first.split(separator))
    wrong = _wrong_word(above, separator, columns)
    if wrong:
        raise error(
            f"{path}: line {number - 1}: {wrong!r} is no number; valid: numbers, and nan for what "
            "is missing"
        )
    return TextTable(path, tuple(header), body, number, separator, decimal, columns, error)


def _wrong_word(line: str, separator: str | None, columns: int) -> str:
    """Return the word that makes a row of numbers look like a line above them, "" if none does."""
    cells = [cell.strip(' \r"') for cell in _bare(line).split(separator)]
    words = [c for c in cells if c.lower() not in MISSING and not _NUMBER.fullmatch(c) and c]
    few = len(cells) == columns > 1 and 0 < len(words) < 0.5 * columns
    few = few and any(_NUMBER.fullmatch(c) for c in cells)  # else it is a line of units
    # The first cell alone names rows and columns that are numbered.
    return words[0][:40] if few and words != cells[:1] else ""


def _without_footer(body: str) -> str:
    """Return rows without the lines of words behind them, as "End of data"."""
    end = len(body)
    for _ in range(20):
        while end and body[end - 1].isspace():
            end -= 1
        start = body.rfind("\n", 0, end) + 1
        words = _WORD.findall(body[start:end].replace('"', " ")) if end - start < 1000 else ["0"]
        if start == 0 or any(_NUMBER.fullmatch(w) or w.lower() in MISSING for w in words):
            break
        if body.find("\n", body.find("\n") + 1) >= start - 1:
            break  # fewer than three rows above: it is not known what is wrong
        end = start
    return body[:end]


def _format(rows: list[str]) -> tuple[str | None, str]:
    """Return the separator of rows, None for white space, and the decimal mark."""
    together = "\n".join(rows)
    between_digits = re.search(r"\d,\d", together) is not None
    for separator in ";\t":
        if separator in together:
            comma = between_digits and not re.search(r"\d\.\d", together)
            return separator, "," if comma else "."
    if "," not in together:
        return None, "."
    # Words with one comma each, between digits: decimal commas, and white space separates.
    words = together.split()
    commas = "." not in together and len(rows[0].split()) > 1
    if commas and all(re.fullmatch(_NUMBER, w) or w.lower() in MISSING for w in words):
        return None, ","
    return ",", "."


def _bare(line: str) -> str:
    """Return a line without the comment at its end."""
    return _COMMENT.split(line, maxsplit=1)[0] if "#" in line else line


def is_number(word: str) -> bool:
    """Return whether a word is a number, or nan or inf."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_row(line: str, texts: bool) -> bool:
    """Return whether a line is a row of numbers, words for missing values among them."""
    words = _WORD.findall(_TWO_WORDS.sub("nan", _bare(line).replace('"', " ")))
    if not words or line.lstrip().startswith(("%", "//")):
        return False
    numbers = sum(_NUMBER.fullmatch(word.replace("−", "-")) is not None for word in words)
    missing = sum(word.lower() in MISSING for word in words)
    if texts and len(words) >= 8:
        return 2 * numbers > len(words)
    return numbers + missing == len(words) and (numbers > 0 or len(words) > 3)


def _cells(line: str) -> int:
    """Return how many cells a row has, whatever separates them."""
    line = _bare(line).strip(" \r").rstrip(",;")
    for separator in (";", "\t", None, ","):
        count = len(line.split(separator))
        if count > 1:
            return count
    return 1


def _is_count(line: str, rest: str) -> bool:
    """Return whether whole numbers are sizes above a table: its rows have more or fewer cells."""
    if not all(word.isdigit() for word in _WORD.findall(line)):
        return False
    below = [row for row in rest.split("\n") if row.strip()][:-1][:_LOOKED_AT]
    counts = {_cells(row) for row in below if _is_row(row, False)}
    return len(below) > 2 and len(counts) == 1 and _cells(line) not in counts


def _is_label(line: str, rest: str) -> bool:
    """Return whether numbers behind an empty cell are names, as of bodies: words are below them."""
    if not line.startswith((",", ";")):
        return False
    below = next((row for row in rest.split("\n") if row.strip()), "")
    return bool(below) and not _is_row(below, False)


def _word(match: re.Match[str]) -> str:
    return "nan" if match.group().lower() in MISSING else match.group()


def _cell(cell: str) -> str:
    word = cell.strip().lower()
    return "nan" if not word or word in MISSING else cell
