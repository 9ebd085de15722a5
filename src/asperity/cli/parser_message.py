"""Error messages of the parser (tyro), rewritten as one line that a user can act on."""

from __future__ import annotations

import re

from asperity.errors import did_you_mean

_KINDS = {"FLOAT": "a number", "INT": "a whole number"}
_HEADINGS = (
    r"^(Value error|Unrecognized options|Missing argument|Invalid choice|Required options); "
)


def one_line(text: str) -> str:
    """Return a parser's boxed message as one line: what is wrong, and what would be valid."""
    plain = re.sub(r"\x1b\[[0-9;]*m|[╭╮╰╯│]", " ", text)
    plain = plain.partition("For full helptext")[0]
    parts = [" ".join(part.split()).strip("─ ") for part in re.split(r"[─-]{3,}", plain)]
    message = re.sub(_HEADINGS, "", "; ".join(part for part in parts if part))
    wrong = re.search(r"Error parsing (\S+): .*?Argument helptext: \S+ (\S+)", message)
    value = re.search(r"'([^']*)'\](?:\.| does)|: '([^']*)'", message)
    if wrong and value:
        kind = wrong[2].replace("{None}|", "")
        given = value[1] if value[1] is not None else value[2]
        return f"{wrong[1]} must be {_KINDS.get(kind, kind)}, got {given!r}"
    unknown = re.match(r"Unrecognized options: (.*?)(?:; (.*))?$", message)
    if unknown:
        near = re.match(r"Perhaps you meant: (--[\w.-]+)", unknown[2] or "")
        known = re.match(r"Available subcommands: (.*?)(?:;|$)", unknown[2] or "")
        if known:  # the first word is no command, so what follows it is not at fault
            word = unknown[1].split(",")[0]
            hint = did_you_mean(word, known[1].split(", "))
            return f"no command {word!r}{hint}; one of: {known[1]}"
        hint = f" (did you mean {near[1]}?)" if near else ""
        return f"unknown: {unknown[1]}{hint}"
    return message
