"""Errors for invalid input; messages are one line that names the value and what would be valid."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from typing import Any


class AsperityError(ValueError):
    """Input that asperity cannot work with. The message is one line, fit to be shown to a user."""


class SurfaceError(AsperityError):
    """A surface, height map or file of heights that cannot be used."""


class OutputError(AsperityError):
    """A result that cannot be written to the requested place."""


def require_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` if it is finite and above zero, else raise `AsperityError` naming it."""
    if not (_is_finite(value) and value > 0.0):
        raise AsperityError(f"{name} must be a finite number above 0{_in(unit)}, got {value!r}")
    return float(value)


def require_not_negative(name: str, value: float, unit: str = "") -> float:
    """Return `value` if it is finite and not below zero, else raise `AsperityError` naming it."""
    if not (_is_finite(value) and value >= 0.0):
        raise AsperityError(f"{name} must be a finite number, 0 or above{_in(unit)}, got {value!r}")
    return float(value)


def require_between(name: str, value: float, low: float, high: float, unit: str = "") -> float:
    """Return `value` if it lies between `low` and `high`, else raise `AsperityError` naming it."""
    if not (_is_finite(value) and low <= value <= high):
        raise AsperityError(
            f"{name} must lie between {low:.12g} and {high:.12g}{_in(unit)}, got {value!r}"
        )
    return float(value)


def require_choice(name: str, value: str, choices: Iterable[str]) -> str:
    """Return `value` if it is one of `choices`, else raise, listing them and the nearest.

    µm is um.
    """
    known = list(choices)
    if isinstance(value, str):
        value = re.sub("^[µμ](?=m$)", "u", value)
        if value in known:
            return value
    hint = did_you_mean(value, known)
    raise AsperityError(f"unknown {name} {value!r}{hint}; choose from: {', '.join(known)}")


def did_you_mean(word: Any, known: Iterable[str], form: str = "{!r}") -> str:
    """Return a hint for a message at the nearest of the known words, "" if none is near."""
    near = difflib.get_close_matches(str(word), list(known), n=1)
    return f" (did you mean {form.format(near[0])}?)" if near else ""


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(value)
    except (TypeError, OverflowError):
        return False


def _in(unit: str) -> str:
    return f" {unit}" if unit else ""


def require_finite(name: str, values: Any, count: int) -> tuple[float, ...]:
    """Return `values` as `count` finite floats, else raise `AsperityError` naming them."""
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise AsperityError(f"{name} must be {count} finite numbers, got {values!r}")
    return numbers
