"""The result of a command on stdout: a few lines for people, or JSON with `--json`."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_as_json = False


def set_json(wanted: bool) -> None:
    """Set whether `print_result` prints JSON."""
    global _as_json
    _as_json = wanted


def wants_json() -> bool:
    """Return whether the result is printed as JSON."""
    return _as_json


def announce(line: str) -> None:
    """Print a line beside the result; on stderr with `--json`, whose document stands alone."""
    print(line, file=sys.stderr if _as_json else sys.stdout, flush=True)


def print_result(lines: str | Iterable[str], data: Any) -> None:
    """Print the result of a command: its lines, or its data as one JSON document.

    Parameters
    ----------
    lines : str or iterable of str
    data : dict or list
        Of numbers, texts and arrays, in SI units; NaN and infinite numbers become null.
    """
    if _as_json:
        print(json.dumps(_plain(data), indent=2, ensure_ascii=False), flush=True)
        return
    for line in [lines] if isinstance(lines, str) else lines:
        print(line, flush=True)


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if hasattr(value, "tolist"):  # arrays and scalars of NumPy, which is slow to import
        return _plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
