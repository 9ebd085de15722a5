"""What the parser of the command line says, in one line that a user can act on."""

from __future__ import annotations

import re

_KINDS = {"FLOAT": "a number", "INT": "a whole number"}
_HEADINGS = (
    r"^(Value error|Unrecognized options|Missing argument|Invalid choice|Required options); "
)


def one_line(text: str) -> str:
    """Return a parser's boxed message as one line: what is wrong, and what would be valid."""
    plain = re.sub(r"\x1b\[[0-9;]*m|[╭╮╰╯│]", " ", text)
    parts = [" ".join(part.split()).strip("─ ") for part in re.split(r"[─-]{3,}", plain)]
    said = re.sub(_HEADINGS, "", "; ".join(part for part in parts if part))
    wrong = re.search(r"Error parsing (\S+): .*?Argument helptext: \S+ (\S+)", said)
    value = re.search(r"'([^']*)'\](?:\.| does)|: '([^']*)'", said)
    if wrong and value:
        kind = wrong[2].replace("{None}|", "")
        given = value[1] if value[1] is not None else value[2]
        return f"{wrong[1]} must be {_KINDS.get(kind, kind)}, got {given!r}"
    unknown = re.match(r"Unrecognized options: (.*?)(?:; (.*))?$", said)
    if unknown:
        near = re.match(r"Perhaps you meant: (--[\w.-]+)", unknown[2] or "")
        known = re.match(r"(Available subcommands: .*?)(?:;|$)", unknown[2] or "")
        told = f" (did you mean {near[1]}?)" if near else f"; {known[1].lower()}" if known else ""
        return f"unknown: {unknown[1]}{told}"
    return said
