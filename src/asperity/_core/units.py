"""Units of length, time and angle as other programs write them, and those that a heading names."""

from __future__ import annotations

import math
import re
import unicodedata

LENGTHS = {
    "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "метр": 1.0, "м": 1.0,
    "dm": 0.1, "cm": 1e-2, "centimeter": 1e-2, "centimeters": 1e-2, "centimetres": 1e-2,
    "mm": 1e-3, "millimeter": 1e-3, "millimeters": 1e-3, "millimetre": 1e-3,
    "millimetres": 1e-3, "мм": 1e-3,
    "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mum": 1e-6, "micron": 1e-6, "microns": 1e-6,
    "micrometer": 1e-6, "micrometers": 1e-6, "micrometre": 1e-6, "micrometres": 1e-6,
    "mikrometer": 1e-6, "мкм": 1e-6, "mkm": 1e-6,
    "nm": 1e-9, "nanometer": 1e-9, "nanometers": 1e-9, "nanometre": 1e-9, "nanometres": 1e-9,
    "нм": 1e-9, "pm": 1e-12,
    "å": 1e-10, "angstrom": 1e-10, "angstroms": 1e-10, "ångström": 1e-10, "ang": 1e-10,
    "kå": 1e-7, "inch": 0.0254, "inches": 0.0254, "in": 0.0254, "mil": 2.54e-5, "mils": 2.54e-5,
    "thou": 2.54e-5,
    "μin": 2.54e-8, "uin": 2.54e-8, "μinch": 2.54e-8, "microinch": 2.54e-8, "microinches": 2.54e-8,
    "ƒêm": 1e-6, "¦ìm": 1e-6, "¥ìm": 1e-6, "ìì": 1e-3, "ìêì": 1e-6, "íì": 1e-9,
}  # fmt: skip
"""Units of length [m], in lower case; the last are those of Asian and Cyrillic code pages."""
TIMES = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0,
    "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3, "millis": 1e-3,
    "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "usec": 1e-6, "microsecond": 1e-6, "microseconds": 1e-6,
    "ns": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "nanosecond": 1e-9, "nanoseconds": 1e-9,
    "min": 60.0, "mins": 60.0, "minute": 60.0, "minutes": 60.0,
    "h": 3600.0, "hr": 3600.0, "hrs": 3600.0, "hour": 3600.0, "hours": 3600.0,
}  # fmt: skip
"""Units of time [s], in lower case."""
ANGLES = {
    "rad": 1.0, "rads": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3,
    "deg": math.pi / 180.0, "degs": math.pi / 180.0, "degree": math.pi / 180.0,
    "degrees": math.pi / 180.0, "°": math.pi / 180.0,
}  # fmt: skip
"""Units of angle [rad], in lower case."""
SHORT = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
"""Those that options take, and notes are written in [m]."""

_BRACKETS = re.compile(r"[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]")
_TIMES_A_UNIT = re.compile(
    r"[×x*]?\s*(?:(\d+\.?\d*e[+-]?\d+)|10\s*(?:\^|\*\*)?\s*([+-]\d+))\s*[×x*]?\s*([^\W\d]+)",
    re.IGNORECASE,
)
"""A power of ten of units: `1e-6 m`, `x10^-6 m`."""
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_AMBIGUOUS = ("in", "ang", "m", "s", "м", "min", "h")
"""Words that stand for a unit only in brackets, or behind a sign."""


def length_of(word: str) -> float | None:
    """Return what a word stands for as a unit of length [m], None for another word."""
    return _value(word.strip().replace("^", ""), LENGTHS)


def _value(word: str, units: dict[str, float]) -> float | None:
    """Return the value of a unit, in any case and form of its letters, None for another word."""
    plain = word.strip(".").casefold()
    return units.get(plain, units.get(unicodedata.normalize("NFKC", plain).casefold()))


def _in_brackets(inside: str, units: dict[str, float]) -> float | None:
    """Return the value of a unit, also behind a power of ten, None for other words."""
    several = _TIMES_A_UNIT.fullmatch(unicodedata.normalize("NFKC", inside).replace("−", "-"))
    if several is None:
        return _value(inside, units)
    number, power, word = several.groups()
    value = _value(word, units)
    factor = float(number) if number else float(f"1e{power}")
    return None if value is None or factor == 0.0 else factor * value


def named_unit(heading: str, units: dict[str, float]) -> tuple[str, float] | None:
    """Return the unit that a heading names, as written, and its value; None if it names none.

    In brackets (`height [µm]`, `[1e-6 m]`), behind a sign (`z_um`, `z/mm`, `x-mm`), behind "in",
    as the last word (`Height µm`), or in capitals behind it (`heightUm`, `timeMs`).
    """
    text = heading.strip().strip("\"'#%").strip()
    for inside in _BRACKETS.findall(text):
        value = _in_brackets(inside, units)
        if value is not None:
            return inside, value
    text = _BRACKETS.sub(" ", text).strip()
    words = re.split(r"[\s_/,:=.-]+", text)
    word = words[-1] if len(words) > 1 else ""
    value = _value(word, units)
    camel = _CAMEL.split(text)
    if value is None and len(camel) > 1 and camel[-1].casefold() not in _AMBIGUOUS:
        word, value = camel[-1], _value(camel[-1], units)
    signed = re.search(r"([_/:=]|\bin\s|\s-\s)\s*" + re.escape(word) + "$", text, re.IGNORECASE)
    if value is None or (word.casefold() in _AMBIGUOUS and not signed):
        return None
    return word, value


def short_unit(metres: float) -> str:
    """Return how notes write a unit of length: its short name, or its size."""
    names = {value: name for name, value in SHORT.items()}
    return names.get(metres, f"{metres:g} m")
