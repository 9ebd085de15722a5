"""Rows of numbers in text as other programs write them: encoding, separator, missing values."""

from __future__ import annotations

import csv
import re

from asperity._core.files import encodings_of

_MISSING_WORDS = """
    nan na n/a #n/a #na null none nil - -- --- ----- * ** *** bad void masked missing invalid
    nodata no_data nm undefined undef hole #name? #value! #div/0! #num! 1.#qnan -1.#qnan 1.#ind
    -1.#ind 1.#inf -1.#inf 1.#snan inf -inf +inf infinity -infinity ? #### over under overflow
    -nan nan(ind) -nan(ind) <na> n.a. n/d lost fehlt ungültig
    #nv #n/d #wert! #bezug! #zahl! #ref! #valeur! #nombre! #valor! #¡valor! #¡num! #null!
"""
MISSING = frozenset(_MISSING_WORDS.split())
"""Words for a missing value, in lower case; so is an empty cell."""
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
WORD = re.compile(r"[^\s,;]+")
_COMMENT = re.compile(r"(?i)(?<!\.)#(?!n/?[ad]\b|nv\b|[^\s,;#]{2,9}[!?]|#)")
TWO_WORDS = re.compile(r"(?i)\b(no|not)[ _](data|value|measured)\b")
"""Words for a missing value that are two."""
_QUOTED_COMMA = re.compile(r'"[+-]?[\d.]*\d,\d[\d.,]*"')
"""A number with a comma in quotation marks, as spreadsheets write it where commas separate."""


def _grouped(mark: str, decimal: str) -> re.Pattern[str]:
    """Return the pattern of a cell whose marks group thousands."""
    number = rf" *[+-]?\d{{1,3}}(?:[{mark}]\d{{3}})+[{decimal}]\d+ *"
    return re.compile(rf"^{number}(?=[;\t])|(?<=[;\t]){number}(?=[;\t\r\n]|$)", re.MULTILINE)


_GROUPED = {",": _grouped(",", "."), ".": _grouped(".", ","), " ": _grouped(" ", ".,")}
"""Cells that show which mark groups thousands: `1,234.5`, `1.234,5`, `1 234,5`."""
_APART = "'’\u00a0\u2009\u202f"
"""Marks that group thousands and stand between no cells: Swiss, French."""
_NEVER_BETWEEN = re.compile(rf"(?<=\d)[{_APART}](?=\d{{3}}(?!\d))")
_HEAD = 20_000
"""Characters in which marks that group thousands show."""
LOOKED_AT, OPENING = 40, 200_000
"""Rows from which the separator is found, within so many characters."""
_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f]")
"""Of which texts have hardly any."""


def decoded(content: bytes) -> str | None:
    """Return text, whatever its encoding; None for bytes that are no text."""
    for encoding in encodings_of(content):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        head = text[:4096]
        return text if len(_CONTROLS.findall(head)) <= 0.01 * len(head) else None
    return None


def without_groups(text: str) -> str:
    """Return text without marks that group thousands, and without quotes round decimal commas.

    Cells of numbers with commas that are quoted are set apart by semicolons.
    """
    if '"' in text and ";" not in text and _QUOTED_COMMA.search(text):
        text = "\n".join(";".join(cells) for cells in csv.reader(text.splitlines()))
    head = text[:_HEAD]
    if any(mark in head for mark in _APART) and _NEVER_BETWEEN.search(head):
        text = _NEVER_BETWEEN.sub("", text)
    for mark, grouped in _GROUPED.items():
        if (";" in head or "\t" in head) and grouped.search(head):
            text = re.sub(rf"(?<=\d)[{mark}](?=\d{{3}})", "", text)
    return text


def wrong_word(line: str, separator: str | None, columns: int) -> str:
    """Return the word that makes a row of numbers look like a line above them, "" if none does."""
    cells = [cell.strip(' \r"') for cell in bare(line).split(separator)]
    words = [c for c in cells if c.lower() not in MISSING and not _NUMBER.fullmatch(c) and c]
    few = len(cells) == columns > 1 and 0 < len(words) < 0.5 * columns
    few = few and any(_NUMBER.fullmatch(c) for c in cells)  # else it is a line of units
    # The first cell alone names rows and columns that are numbered.
    return words[0][:40] if few and words != cells[:1] else ""


def without_footer(body: str) -> str:
    """Return rows without the lines of words behind them, as "End of data"."""
    end = len(body)
    for _ in range(20):
        while end and body[end - 1].isspace():
            end -= 1
        start = body.rfind("\n", 0, end) + 1
        if start == 0 or end - start >= 1000 or not is_footer(body[start:end]):
            break
        if body.find("\n", body.find("\n") + 1) >= start - 1:
            break  # fewer than three rows above: it is not known what is wrong
        end = start
    return body[:end]


def is_footer(line: str) -> bool:
    """Return whether a line behind rows has no number, and no word for a missing one."""
    words = (found.group() for found in WORD.finditer(line.replace('"', " ")))
    return not any(_NUMBER.fullmatch(word) or word.lower() in MISSING for word in words)


def first_rows(body: str) -> list[str]:
    """Return the rows from which the form of all is found."""
    return "\n".join(body[:OPENING].split("\n", LOOKED_AT)[:LOOKED_AT]).splitlines()[:LOOKED_AT]


def format_of(rows: list[str]) -> tuple[str | None, str]:
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


def bare(line: str) -> str:
    """Return a line without the comment at its end."""
    return _COMMENT.split(line, maxsplit=1)[0] if "#" in line else line


def is_number(word: str) -> bool:
    """Return whether a word is a number, or nan or inf."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def is_row(line: str, texts: bool) -> bool:
    """Return whether a line is a row of numbers, words for missing values among them."""
    line = bare(line)
    words = WORD.findall(TWO_WORDS.sub("nan", line.replace('"', " ").replace("−", "-")))
    if not words or line.lstrip().startswith(("%", "//")):
        return False
    others = [word for word in words if not _NUMBER.fullmatch(word)]
    numbers = len(words) - len(others)
    missing = sum(word.lower() in MISSING for word in others)
    if numbers + missing == len(words):
        return numbers > 0 or len(words) > 3
    return texts and len(words) >= 8 and 2 * numbers > len(words)


def is_almost_empty(line: str) -> bool:
    """Return whether a line is a row of which all but the first cells are missing."""
    return re.sub(r"[ \r]", "", line).endswith((",,,", ";;;", "\t\t\t"))


def are_decimal_commas(rows: list[str]) -> bool:
    """Return whether commas between cells are decimal marks too, as in `0,012,1,5`.

    Every second cell is then the fraction of a number: some of these begin with 0, no other does.
    """
    cells = [row.strip().strip(",").split(",") for row in rows if row.strip()]
    if not cells or any(len(row) % 2 or len(row) < 4 for row in cells):
        return False
    padded = [[re.match(r"\s*[+-]?0\d", cell) is not None for cell in row] for row in cells]
    return any(any(row[1::2]) for row in padded) and not any(any(row[::2]) for row in padded)


def _cells(line: str) -> int:
    """Return how many cells a row has, whatever separates them."""
    line = bare(line).strip(" \r").rstrip(",;")
    for separator in (";", "\t", None, ","):
        count = len(line.split(separator))
        if count > 1:
            return count
    return 1


def is_heading(line: str) -> bool:
    """Return whether a line has words, and no number among them."""
    words = [word for word in WORD.findall(line.replace('"', " ")) if word.lower() not in MISSING]
    return bool(words) and not any(_NUMBER.fullmatch(word) for word in words)


def is_count(line: str, rest: str) -> bool:
    """Return whether numbers are sizes above a table: its rows have more or fewer cells.

    Whole numbers; or any above a line of words, below which the rows are.
    """
    lines = [row for row in rest.split("\n", 8) if row.strip()][:2]
    if len(lines) == 2 and is_heading(lines[0]) and is_row(lines[1], False):
        return 1 < _cells(line) != _cells(lines[1])
    if not all(found.group().isdigit() for found in WORD.finditer(line)):
        return False
    below = [row for row in rest.split("\n") if row.strip()][:-1][:LOOKED_AT]
    counts = {_cells(row) for row in below if is_row(row, False)}
    return len(below) > 2 and len(counts) == 1 and _cells(line) not in counts


def is_label(line: str, rest: str, texts: bool) -> bool:
    """Return whether numbers behind an empty cell are names, as of bodies: words are below them."""
    if not line.startswith((",", ";")):
        return False
    below = next((row for row in rest.split("\n") if row.strip()), "")
    return bool(below) and not is_row(below, texts)
