"""Small pieces of Markdown that the page is made of."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

from asperity.studies.literature.table import MARKS

_COLUMNS = 110


def wrapped(text: str) -> str:
    """Return paragraphs, parted by empty lines, filled anew."""
    parts = [" ".join(part.split()) for part in text.strip().split("\n\n")]
    return "\n\n".join(textwrap.fill(part, _COLUMNS, break_on_hyphens=False) for part in parts)


def figure(path: str, alt: str) -> str:
    """Return an image over the whole width."""
    return f"```{{image}} {path}\n:alt: {alt}\n:width: 100%\n```\n"


def names(ids: Iterable[str]) -> str:
    """Return ids as a list in code."""
    return ", ".join(f"`{name}`" for name in ids)


def value_text(value: Any) -> str:
    """Return a measured value for reading: three digits, lists in brackets where they nest."""
    if isinstance(value, list):
        inner = ", ".join(value_text(entry) for entry in value)
        return f"[{inner}]" if value and not isinstance(value[0], list) else inner
    if isinstance(value, bool):
        return MARKS[value]
    if isinstance(value, float):
        return f"{value:.3g}"
    return "none" if value is None else str(value)
