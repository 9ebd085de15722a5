"""Columns of points by the names above them: which are x, y and z, and in which unit."""

from __future__ import annotations

import re

from asperity._core.units import LENGTHS, named_unit
from asperity.geometry.mesh.checks import UNITS
from asperity.scene.pose_columns import meaning_of

_AXES = {
    "x": "x", "y": "y", "z": "z", "east": "x",
    "easting": "x", "north": "y", "northing": "y", "elevation": "z", "height": "z", "x-coord": "x",
    "y-coord": "y", "z-coord": "z",
}  # fmt: skip
_HEADING = re.compile(
    r"^([a-z:0-9-]+?)(?:[\s_]*coordinates?)?(?:[\s_]*[\[(]([a-zµμ]+)[\])]|[\s_]+([a-zµμ]+))?$"
)
_NUMBERED = re.compile(r"points\w*:([012])")
"""How ParaView and VeloView name the columns of places."""
_NOT_MEASURED = re.compile(
    r"(?i)(?<![a-z])(?:nom(?:inal)?|soll|theo\w*|cad|design|target|dev(?:iation)?|abw\w*)(?![a-z])"
)
"""Words of columns that have what a drawing states, or how far a point is off it."""


def cells_of(line: str, separator: str | None) -> int:
    """Return how many cells a line has, empty ones at its end too."""
    return len(line.strip(" \r").split(separator))


def heading_of(
    lines: list[str], separator: str | None, width: int
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Return the axes that columns are, "" for others, their units, and the line below their names.

    Empty if no line above the last, the first row, names x, y and z; it may have more cells, which
    are empty. A column that is named x alone wins over `pos_x`.
    """
    *above, row = lines
    for at, line in reversed([*enumerate(above)]):
        plain = line.strip().lstrip("#/%").strip()
        for cut in dict.fromkeys((separator, ",", ";", "\t", None)):
            words = [word.strip() for word in plain.split(cut)]
            if len(words) != width and not width < len(words) == cells_of(row, cut):
                continue
            words = ["" if _NOT_MEASURED.search(word) else word for word in words[:width]]
            for axis_of in (_alone, _within):
                found = [axis_of(word) for word in words]
                axes = tuple(axis for axis, _ in found)
                if all(axes.count(axis) == 1 for axis in "xyz"):
                    stated = dict(found)
                    units = [re.sub("[µμ]", "u", stated[axis]) for axis in "xyz"]
                    if not any(units) and at + 1 < len(above):  # a line of units below
                        cells = [cell.strip("[]() \r") for cell in above[at + 1].split(cut)]
                        below = dict(zip(axes, cells, strict=False))
                        units = [re.sub("[µμ]", "u", below.get(axis, "")) for axis in "xyz"]
                    return axes, tuple(unit if unit in UNITS else "" for unit in units), at + 1
    return (), (), 0


def _alone(name: str) -> tuple[str, str]:
    """Return the axis that a column's whole name is, "" for another, and the unit behind it."""
    found = _HEADING.match(name.lower())
    axis = _AXES.get(found.group(1), "") if found else ""
    return axis, (found[2] or found[3] or "") if found else ""


def _within(name: str) -> tuple[str, str]:
    """Return the axis that part of a column's name states, as of a pose's, and its unit."""
    axis, unit = _alone(name)
    numbered = _NUMBERED.fullmatch(name.lower())
    if axis:
        return axis, unit
    if numbered:
        return "xyz"[int(numbered[1])], ""
    meaning = (meaning_of(name) or "").rstrip("?")
    named = named_unit(name, LENGTHS)
    return (meaning if meaning in ("x", "y", "z") else ""), named[0].lower() if named else ""
