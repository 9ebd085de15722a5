"""Columns of a file of poses: which one is time, x, qw, ..., by name, and in which unit.

Names are split into words: `field.pose.orientation.w`, `quat_w`, `QuatW`, `q_RS_w []` and `qw` are
one column.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from asperity._core.units import LENGTHS, TIMES, named_unit
from asperity.errors import AsperityError

COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
"""The columns of a pose, in asperity's order."""
ORDERS = {
    "wxyz": COLUMNS,
    "xyzw": ("time", "x", "y", "z", "qx", "qy", "qz", "qw"),
}
"""Orders of columns that have no names; the second is that of ROS and TUM."""


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_TIMES = _set(
    "time timestamp stamp timestamps times t sec secs seconds zeit temps tiempo tempo elapsed "
    "nanosec nsecs"
)
_FRACTIONS = ("nsec", "nsecs", "nanosec", "nanosecs")
"""Names of the nanoseconds beside whole seconds."""
_TURN = _set("q quat quaternion orientation rotation rot ori att attitude r o orient")
_SHORT_TURN = _set("r o")
"""Words that mean a turn only where they stand alone before the axis."""
_PLACE = _set(
    "p pos position t trans translation loc location point tip tool tcp handle coordinate"
)
_OTHER = _set(
    "v vel velocity linear angular twist acc accel acceleration a gyro omega force torque f wrench "
    "err error cov covariance std sigma bias bw ba mean residual euler roll pitch yaw scale normal"
)
"""Words of columns that are no poses."""
_AXES = {"0": "w", "1": "x", "2": "y", "3": "z", "i": "x", "j": "y", "k": "z", "real": "w",
         "scalar": "w", "re": "w", "r": "w"} | {axis: axis for axis in "wxyz"}  # fmt: skip
_ANGLES = re.compile(r"\b(roll|pitch|yaw|euler|azimuth|heading|deg|rad|r[xyz])\b", re.IGNORECASE)
_FUSED = re.compile(r"(q|quat|rot|ori|o|r|p|t|pos|tip|trans)([wxyz0-3ijkr])")
_KNOWN = "time, x, y, z, qw, qx, qy, qz, as pos_x, tx, position.x, quat_w, orientation.w and others"


class Layout(NamedTuple):
    """Where a file has the columns of a pose, and in which units."""

    places: tuple[int, ...]
    """Of time, x, y, z, qw, qx, qy, qz among the file's columns."""
    time_unit: float | None = None
    """[s]; None where no name states it."""
    unit: float | None = None
    """[m]; None where no name states it."""
    nanoseconds: int | None = None
    """The column of nanoseconds beside whole seconds."""
    left_out: tuple[str, ...] = ()
    rate: float | None = None
    """Frames in a second, if the first column counts them."""


def _words(name: str) -> list[str]:
    """Return the words of a column's name, in lower case, units left out."""
    bare = re.sub(r"[\[(].*?[\])]", " ", name).strip(" \"'#%")
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    words = [word.lower() for word in re.split(r"[^A-Za-z0-9]+", bare) if word]
    while len(words) > 1 and (words[-1] in LENGTHS or words[-1] in TIMES):
        if words[-1] in (*_FRACTIONS, "secs", "sec"):
            break
        words.pop()
    out: list[str] = []
    for at, word in enumerate(words):
        fused = _FUSED.fullmatch(word)
        out += fused.groups() if fused and at == len(words) - 1 and word != "time" else (word,)
    return out


def meaning_of(name: str) -> str | None:
    """Return what a column holds: one of `COLUMNS`, "axis?" for x to w alone, or None."""
    words = _words(name)
    if not words or _OTHER & {*words[:-1]}:
        return None
    last, before = words[-1], {*words[:-1]}
    if last in _FRACTIONS:
        return "nanoseconds"
    if last in _TIMES and not (before & _TURN):
        return "time"
    axis = _AXES.get(last)
    if axis is None:
        return None
    if before & _TURN - _SHORT_TURN or (before <= _SHORT_TURN and before):
        return f"q{axis}"
    if last not in "xyzw":
        return None
    return last if before & _PLACE else f"{last}?"


def layout_of(path: object, names: Sequence[str]) -> Layout:
    """Return the layout of named columns.

    Raises
    ------
    AsperityError
        A column that is not there, or of which there are two.
    """
    found: dict[str, list[int]] = {}
    for at, name in enumerate(names):
        meaning = meaning_of(name)
        if meaning is not None:
            found.setdefault(meaning, []).append(at)
    # x alone is a place, unless only its neighbours are; then it is part of a quaternion.
    bare = {axis: found.pop(f"{axis}?", []) for axis in "xyzw"}
    for axis in "xyz":  # of two, the one that states a length is a place
        long = [at for at in bare[axis] if named_unit(names[at], LENGTHS)]
        if len(bare[axis]) == 2 and len(long) == 1 and bare["w"]:
            found.setdefault(axis, long)
            bare[axis].remove(long[0])
    turned = all(f"q{axis}" in found for axis in "xyz")
    if all(bare[axis] for axis in "xyz") and (turned or "x" not in found):
        # Beside them, tx is a torque: it is left out.
        found |= {axis: bare.pop(axis) for axis in "xyz"}
    for axis, places in bare.items():
        if places and f"q{axis}" not in found:
            found[f"q{axis}"] = places
    return _checked(path, names, found)


def _checked(path: object, names: Sequence[str], found: dict[str, list[int]]) -> Layout:
    for name in COLUMNS[1:]:
        if len(found.get(name, ())) > 1:
            both = ", ".join(names[at] for at in found[name][:3])
            raise AsperityError(
                f"{path}: several columns are {name}: {both}; keep one of them in the file"
            )
    lacking = [name for name in COLUMNS if name not in found]
    if lacking:
        turned = {"qw", "qx", "qy", "qz"} & {*lacking}
        what = "quaternions are wanted; " if turned else ""
        if turned and _ANGLES.search(" ".join(names).replace("_", " ")):
            what = "angles are not read, as their order is not stated: quaternions are wanted; "
        shown = ", ".join(filter(None, names))
        raise AsperityError(
            f"{path}: no column named {', '.join(lacking)} among {shown[:70]}; "
            f"{what}valid: {_KNOWN}"
        )
    places = tuple(found[name][0] for name in COLUMNS)
    nanoseconds = found.get("nanoseconds", [None])[0]
    time = named_unit(names[places[0]], TIMES)
    lengths = {named_unit(names[at], LENGTHS) for at in places[1:4]}
    if len(lengths) > 1:
        raise AsperityError(f"{path}: x, y and z are in different units; valid: one unit")
    length = lengths.pop()
    used = {*places, nanoseconds}
    left_out = tuple(n.strip() for at, n in enumerate(names) if at not in used and n.strip())
    return Layout(
        places, time and time[1], length and length[1], nanoseconds, left_out
    )  # fmt: skip


def layout_in_order(path: object, order: str, count: int) -> Layout:
    """Return the layout of columns in an order: a key of `ORDERS`, or their names with commas."""
    names = ORDERS.get(order) or tuple(re.split(r"[\s,;]+", order.strip().lower()))
    if sorted(name for name in names if name in COLUMNS) != sorted(COLUMNS):
        raise AsperityError(
            "order must be 'wxyz', 'xyzw', or the names of the columns with commas "
            f"({', '.join(COLUMNS)}, and - for others), got {order!r}"
        )
    if len(names) > count:
        raise AsperityError(
            f"{path}: {count} numbers in a row, but order= names {len(names)} columns; valid: one "
            "for each"
        )
    return Layout(tuple(names.index(name) for name in COLUMNS))
