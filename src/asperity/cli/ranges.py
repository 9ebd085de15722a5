"""The range of an option: declared beside it, in the unit it is typed in, and checked first."""

from __future__ import annotations

from dataclasses import dataclass, is_dataclass
from typing import Any, get_type_hints

from asperity.errors import require_between


@dataclass(frozen=True)
class Between:
    """Smallest and largest valid value; to stand in an option's `Annotated` type.

    The ranges are what hands feel, generously: beyond them lie slips of the unit.
    """

    low: float
    high: float


def check_ranges(options: Any, prefix: str = "--") -> None:
    """Raise `AsperityError`, naming the option and its range, for a value outside its range."""
    for name, hint in get_type_hints(type(options), include_extras=True).items():
        option, value = prefix + name.replace("_", "-"), getattr(options, name)
        if is_dataclass(value):
            check_ranges(value, f"{option}.")
        numbers = value if isinstance(value, tuple) else (value,)
        for bounds in getattr(hint, "__metadata__", ()):
            if isinstance(bounds, Between):
                for number in numbers:
                    if number is not None:
                        require_between(option, number, bounds.low, bounds.high)
