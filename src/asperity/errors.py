"""What asperity raises when its input is wrong: one line that names the value and what is valid."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable


class AsperityError(ValueError):
    """Input that asperity cannot work with. The message is one line, fit to be shown to a user."""


class SurfaceError(AsperityError):
    """A surface, height map or file of heights that cannot be used."""


class OutputError(AsperityError):
    """A result that cannot be written where it was asked for."""


def require_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` if it is finite and above zero, else raise `AsperityError` naming it."""
    if not (math.isfinite(value) and value > 0.0):
        raise AsperityError(f"{name} must be a finite number above 0{_in(unit)}, got {value!r}")
    return float(value)


def require_not_negative(name: str, value: float, unit: str = "") -> float:
    """Return `value` if it is finite and not below zero, else raise `AsperityError` naming it."""
    if not (math.isfinite(value) and value >= 0.0):
        raise AsperityError(f"{name} must be a finite number, 0 or above{_in(unit)}, got {value!r}")
    return float(value)


def require_choice(name: str, value: str, choices: Iterable[str]) -> str:
    """Return `value` if it is one of `choices`, else raise, listing them and the nearest."""
    known = list(choices)
    if value in known:
        return value
    near = difflib.get_close_matches(value, known, n=1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    raise AsperityError(f"unknown {name} {value!r}{hint}; choose from: {', '.join(known)}")


def _in(unit: str) -> str:
    return f" {unit}" if unit else ""
