"""Times of day, and of a date, in a table of poses: made seconds, so that they are numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal, DecimalException

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_table import TextTable


def _clock(between: str) -> re.Pattern[str]:
    """Return the pattern of a time of day, also behind a date and one of some characters."""
    return re.compile(
        rf"(?:(\d{{1,4}}([-/.])\d{{1,2}}\2\d{{1,4}})[{between}])?(\d{{1,2}}):(\d\d):(\d\d)"
        r"([.,]\d{1,9})?(?:Z|[+-]\d\d:?\d\d)?(?: ?([AaPp])\.?[Mm]\b\.?)?"
    )


_CLOCK, _JOINED = _clock("T _"), _clock("T_")
_ISO = re.compile(r"\d{4}-\d\d-\d\d")


def in_seconds(text: TextTable) -> tuple[TextTable, str]:
    """Return a table whose times of day are seconds since its first day began, and a note.

    `10:31:05.250`, or `2024-01-10T10:31:05.250Z`: seconds since 1970 if it has a date. Dates in
    other orders are counted as they come. A table without such times is returned as it is, with
    "". Zones are left out: a file has one.
    """
    clock = _JOINED if text.separator is None else _CLOCK  # else date and time are two cells
    if clock.search(text.body[:2000].partition("\n")[0]) is None:
        return text, ""
    dates: dict[str, int] = {}

    def seconds(match: re.Match[str]) -> str:
        date, _, hours, minutes, rest, part, half = match.groups()
        days, hour = 0, int(hours)
        if date and _ISO.fullmatch(date):
            days = datetime.fromisoformat(date).replace(tzinfo=UTC).toordinal() - 719163
        elif date:
            days = dates.setdefault(date, len(dates))
        if half:
            hour = hour % 12 + 12 * (half in "Pp")
        whole = 86400 * days + 3600 * hour + 60 * int(minutes) + int(rest)
        return f"{whole}{(part or '').replace(',', text.decimal).replace('.', text.decimal)}"

    try:
        body = clock.sub(seconds, text.body)
    except ValueError:  # a date that no calendar has
        return text, ""
    return replace(text, body=body), "times of day are turned into seconds"


def exact_times(text: TextTable, column: int, values: Array) -> tuple[float, Array]:
    """Return the first of long times, and all of them less it, without a loss of digits."""
    cells = (line.split(text.separator)[column] for line in text.body.split("\n") if line.strip())
    try:
        numbers = [Decimal(cell.strip().replace(",", ".")) for cell in cells]
        return float(numbers[0]), np.array([float(n - numbers[0]) for n in numbers])
    except (DecimalException, IndexError):
        return float(values[0]), values - values[0]
