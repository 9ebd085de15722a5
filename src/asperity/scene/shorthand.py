"""Tools, targets, textures and files in one word: `sphere:3mm`, `knurl:0.8mm`, `a.png:colour=red`.

Sizes are those of the whole: a sphere's diameter, a box's sides, a capsule's and a cylinder's
diameter and length from end to end, an ellipsoid's three axes.
"""

from __future__ import annotations

import inspect
import math
import re
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, did_you_mean
from asperity.geometry.bodies import Geom
from asperity.geometry.mesh.checks import LARGEST, SMALLEST, UNITS
from asperity.texture.patterns.patterns import EXAMPLES, PATTERNS

PRIMITIVES = {
    "sphere": "diameter", "box": "length x width x height", "capsule": "diameter x length",
    "cylinder": "diameter x length", "ellipsoid": "length x width x height",
}  # fmt: skip
"""Simple solids, and what their sizes are."""
_NUMBER = r"[0-9]*\.?[0-9]+(?:e-?[0-9]+)?"
_LENGTH = re.compile(rf"^({_NUMBER})\s*([a-zµ]*)$", re.IGNORECASE)
NO_LENGTHS = ("hurst", "rms_slope", "direction", "angle", "jitter", "seed", "periods", "samples")
"""Parameters of patterns that are no lengths."""
_COUNTS = ("seed", "periods", "samples")
"""Those of them that are whole numbers."""
OTHER_NAMES = {"ridges": "grating", "dots": "jittered_dots", "waves": "sinusoid"}
"""Short names of patterns."""


def file_table(text: str) -> dict[str, Any]:
    """Return the table of a file with options, `cast.png:kind=normal,pixel_size=10um`.

    A length has a unit (`size=20x10mm`); other values are numbers, `true`, `false`, or words.
    """
    path, _, rest = text.rpartition(":")
    if not path or "=" not in rest or Path(text).expanduser().exists():
        return {"file": text}
    table: dict[str, Any] = {"file": path}
    key = ""
    for word in rest.split(","):
        name, equals, value = word.partition("=")
        if equals:
            key = name.strip()
            if key in table:
                raise AsperityError(f"{text!r}: {key} is given twice; valid: once")
            table[key] = _option(value.strip())
        elif key:  # a list of numbers, or of words
            before, value = table[key], _option(word.strip())
            listed = before if isinstance(before, list) else [before]
            plain = all(isinstance(one, float) for one in (*listed, value))
            table[key] = [*listed, value] if plain else f"{before},{word.strip()}"
    return table


def _option(value: str) -> Any:
    """Return the value of a file's option."""
    if value in ("true", "false"):
        return value == "true"
    try:
        return float(value)
    except ValueError:
        pass
    words = re.split(r"\s*[x×*]\s*", value)
    found = [_LENGTH.match(word) for word in words]
    unit = found[-1].group(2).replace("µ", "u") if found[-1] else ""
    if unit not in UNITS or not all(found):
        return value
    lengths = [_length(number.group(1), unit) for number in found if number]
    return lengths if len(lengths) > 1 else lengths[0]


def _length(number: str, unit: str) -> float:
    """Return a length [m] without the last digits of a product: 30um is 3e-05."""
    return float(f"{float(number) * UNITS[unit]:.14g}")


def primitive(text: str) -> tuple[Geom, str] | None:
    """Return the solid that a text like `box:20x10x5mm` describes, and a note; None if it is none.

    Raises
    ------
    AsperityError
        A solid with sizes that are not valid; one line.
    """
    kind, colon, rest = text.partition(":")
    kind = kind.strip().lower()
    if kind not in PRIMITIVES:
        return None
    names = PRIMITIVES[kind].split(" x ")
    example = f"{kind}:{'x'.join(['20', '10', '5'][: len(names)])}mm"
    words = re.split(r"\s*[x×*]\s*", rest.strip().lower()) if colon else []
    last = _LENGTH.match(words[-1]) if words else None
    unit = last.group(2) if last else ""
    sizes: list[float] = []
    for word in words:
        found = _LENGTH.match(word)
        own = (found.group(2) or unit) if found else ""
        if found is None or own.replace("µ", "u") not in UNITS:
            sizes = []
            break
        sizes.append(float(found.group(1)) * UNITS[own.replace("µ", "u")])
    if len(sizes) != len(names):
        raise AsperityError(
            f"{text!r} is no {kind}; valid: {PRIMITIVES[kind]} with a unit, such as {example}"
        )
    if not SMALLEST <= max(sizes) <= LARGEST or min(sizes) <= 0.0:
        raise AsperityError(f"{text!r}: valid: 0.1 mm to 2 m for the largest size, none of 0")
    shown = " x ".join(f"{1e3 * size:.4g}" for size in sizes)
    note = f"a {kind} of {shown} mm ({PRIMITIVES[kind]})"
    if kind == "capsule":
        if sizes[1] <= sizes[0]:
            raise AsperityError(f"{text!r}: a capsule is longer than its diameter, from end to end")
        return Geom(kind, (0.5 * sizes[0], 0.5 * (sizes[1] - sizes[0]))), note
    return Geom(kind, [0.5 * size for size in sizes]), note


def pattern(text: str) -> tuple[dict[str, Any], str] | None:
    """Return the texture table of a text like `knurl:0.8mm`, and a note; None if it is none.

    Values without a name are the pattern's parameters in their order; those that are not given are
    as usual for the pattern, scaled with the first.

    Raises
    ------
    AsperityError
        A pattern with parameters that are not valid; one line.
    """
    kind, _, rest = text.partition(":")
    kind = kind.strip().lower()
    if ":" in text:  # alone, they may be names of files
        kind = OTHER_NAMES.get(kind, kind)
    if kind not in PATTERNS:
        return None
    usual = EXAMPLES[kind]
    names = parameters_of(kind)
    given: dict[str, Any] = {}
    for place, word in enumerate(part.strip() for part in rest.split(",") if part.strip()):
        name, equals, value = word.partition("=")
        if not equals:
            name, value = names[place], word
        name = name.strip()
        if name not in names:
            raise AsperityError(
                f"{text!r}: {kind} has no {name!r}{did_you_mean(name, names)}; "
                f"valid: {', '.join(names)}"
            )
        if name in given:
            raise AsperityError(f"{text!r}: {name} is given twice; valid: once")
        given[name] = _value(text, name, value.strip())
    first = next(iter(usual))
    ratio = given.get(first, usual[first]) / usual[first]
    scaled = {
        name: value if name in NO_LENGTHS else float(f"{value * ratio:.6g}")
        for name, value in usual.items()
        if name not in given
    }
    shown = ", ".join(f"{name} {value:.4g}" for name, value in scaled.items())
    note = f"{kind}: {shown} (m, as usual for it)" if scaled else ""
    return {"kind": kind, **scaled, **given}, note


def parameters_of(kind: str) -> list[str]:
    """Return the names of a pattern's parameters, the usual ones first."""
    names = inspect.signature(PATTERNS[kind]).parameters
    return [*EXAMPLES[kind], *(name for name in names if name not in EXAMPLES[kind])]


def _value(text: str, name: str, value: str) -> Any:
    """Return the value of a pattern's parameter: a length with its unit, an angle, or a number."""
    found = _LENGTH.match(value)
    unit = found.group(2).lower().replace("µ", "u") if found else ""
    if found is not None and unit in UNITS and name not in NO_LENGTHS:
        return _length(found.group(1), unit)
    if found is not None and name in NO_LENGTHS:
        number = float(found.group(1))
        if unit == "deg":
            return math.radians(number)
        if unit in ("", "rad"):
            if name not in _COUNTS:
                return number
            if number == int(number):
                return int(number)
    valid = "a number" if name in NO_LENGTHS else "a length with a unit, such as 0.8mm"
    valid = "a whole number, 0 or above" if name in _COUNTS else valid
    raise AsperityError(f"{text!r}: {name} is {value!r}; valid: {valid}")
