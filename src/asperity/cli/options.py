"""Options with a unit: one `Range` beside an option gives its unit, its range and its SI value.

    speed_mm_s: Annotated[float, Range(0.1, 1e4, "mm/s")] = 83.0

From this follow the range in the help, the check (`check_ranges`) and its message, and the value in
SI units under a name without the unit (`in_si`): `speed`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from inspect import signature
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

from tyro.conf import Positional, arg

from asperity.errors import require_between

SI_FACTORS = {
    "": 1.0, "s": 1.0, "m": 1.0, "mm": 1e-3, "um": 1e-6, "mm/s": 1e-3, "deg": math.pi / 180.0,
    "deg/s": math.pi / 180.0, "Hz": 1.0, "kHz": 1e3, "kg": 1.0, "N": 1.0, "N/m": 1.0, "N s/m": 1.0,
    "kPa": 1e3,
}  # fmt: skip
"""By how much a value in a unit is multiplied to be in SI units."""
_POSITIONAL = Positional[Any].__metadata__[0]  # type: ignore[misc]
Options = TypeVar("Options")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Range:
    """Smallest and largest valid value of an option, and the unit in which it is typed.

    The ranges are wide enough for anything that a hand can feel; a value beyond them is most
    likely in the wrong unit.
    """

    low: float
    high: float
    unit: str = ""

    @property
    def suffix(self) -> str:
        """How the name of an option in this unit ends: `_mm_s`."""
        return "_" + self.unit.lower().replace("/", "_").replace(" ", "_")

    def __str__(self) -> str:
        return f"{self.low:.12g} to {self.high:.12g} {self.unit}".rstrip()


def command(options: type[Options]) -> type[Options]:
    """Decorate a dataclass of options so that its help shows unit, range and default."""
    for option, hint in get_type_hints(options, include_extras=True).items():
        nested = is_dataclass(hint.__origin__ if _metadata(hint) else hint)
        if not nested and _POSITIONAL not in _metadata(hint):
            ending = _Hint(range_of(hint), getattr(options, option, None))
            shown = arg(help_behavior_hint=ending, metavar=_metavar(hint))
            options.__annotations__[option] = Annotated[hint, shown]
    return options


@dataclass(frozen=True)
class _Hint:
    """The end of an option's help: range and default, as far as there are any."""

    valid: Range | None
    default: Any

    def __call__(self, shown: str) -> str:
        parts = [str(self.valid)] if self.valid else []
        if not any(self.default is silent for silent in (None, False, ())):
            parts.append(f"default: {shown if self.default is not True else 'on'}")
        return f"({'; '.join(parts)})" if parts else ""


def _metavar(hint: Any) -> str | None:
    """Return how the value of an option that may be absent is shown; None: as the parser does."""
    kinds = {int | None: "INT", float | None: "FLOAT", str | None: "STR", Path | None: "PATH"}
    return kinds.get(get_args(hint)[0] if _metadata(hint) else hint)


def range_of(hint: Any) -> Range | None:
    """Return the range in an option's annotated type, or None."""
    return next((m for m in _metadata(hint) if isinstance(m, Range)), None)


def _metadata(hint: Any) -> tuple[Any, ...]:
    """Return what stands beside a type in its `Annotated`."""
    return getattr(hint, "__metadata__", ())


def ranges(options: Any) -> Iterator[tuple[str, Any, Range | None]]:
    """Yield name, value and range of each option, not of those nested in it."""
    hints = get_type_hints(type(options), include_extras=True)
    for field in fields(options):
        yield field.name, getattr(options, field.name), range_of(hints[field.name])


def check_ranges(options: Any, prefix: str = "--") -> None:
    """Raise `AsperityError`, naming the option and its range, for a value outside its range."""
    hints = get_type_hints(type(options), include_extras=True)
    for name, value, valid in ranges(options):
        option = prefix + name.replace("_", "-")
        if is_dataclass(value):
            unprefixed = any(getattr(m, "name", None) == "" for m in _metadata(hints[name]))
            check_ranges(value, prefix if unprefixed else f"{option}.")
        if valid is not None:
            for number in value if isinstance(value, tuple) else (value,):
                if number is not None:
                    require_between(option, number, valid.low, valid.high, valid.unit)


def in_si(options: Any) -> SimpleNamespace:
    """Return options in SI units, each by its name without the unit: `speed_mm_s` as `speed`."""
    out = {}
    for name, value, valid in ranges(options):
        if valid is None or value is None:
            out[name if valid is None else name.removesuffix(valid.suffix)] = value
            continue
        factor = SI_FACTORS[valid.unit]
        if factor != 1.0:
            value = tuple(v * factor for v in value) if isinstance(value, tuple) else value * factor
        out[name.removesuffix(valid.suffix)] = value
    return SimpleNamespace(**out)


def with_options(function: Callable[..., Result], options: Any, **others: Any) -> Result:
    """Call a function, or make settings, with the options named as its parameters, and others."""
    names = [name for name in signature(function).parameters if hasattr(options, name)]
    return function(**{name: getattr(options, name) for name in names} | others)
