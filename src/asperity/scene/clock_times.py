"""Times of day, and of a date, in a table of poses: made seconds, so that they are numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

from asperity._core.text_table import TextTable

_CLOCK = re.compile(
    r"(?:(\d{4}-\d\d-\d\d)[T ])?(\d{1,2}):(\d\d):(\d\d)([.,]\d{1,9})?(?:Z|[+-]\d\d:?\d\d)?"
)


def in_seconds(text: TextTable) -> tuple[TextTable, str]:
    """Return a table whose times of day are seconds since its first day began, and a note.

    `10:31:05.250`, or `2024-01-10T10:31:05.250Z`: seconds since 1970 if it has a date. A table
    without such times is returned as it is, with "". Zones are left out: a file has one.
    """
    found = _CLOCK.search(text.body[:2000].partition("\n")[0])
    if found is None or (text.separator is None and " " in found.group()):
        return text, ""  # where spaces separate, date and time are two cells

    def seconds(match: re.Match[str]) -> str:
        date, hours, minutes, rest, part = match.groups()
        days = 0
        if date:
            days = datetime.fromisoformat(date).replace(tzinfo=UTC).toordinal() - 719163
        whole = 86400 * days + 3600 * int(hours) + 60 * int(minutes) + int(rest)
        return f"{whole}{(part or '').replace(',', text.decimal).replace('.', text.decimal)}"

    try:
        body = _CLOCK.sub(seconds, text.body)
    except ValueError:  # a date that no calendar has
        return text, ""
    return replace(text, body=body), "times of day are turned into seconds"
