"""Columns of a file of poses that turn the tool otherwise than by quaternions, by their names.

Three angles, three components of a rotation vector, or the entries of a matrix.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from asperity._core.units import ANGLES, named_unit
from asperity.errors import AsperityError

_ROLLS = {"roll": 0, "pitch": 1, "yaw": 2, "heading": 2}
_VECTOR = frozenset({"rotvec", "rv", "rvec", "axisangle", "rodrigues"})
_EULER = frozenset({"euler", "eul", "angle", "angles", "ang", "rpy"})
_EITHER = frozenset({"r", "rot", "rotation", "o", "ori", "orientation", "orient", "attitude"})
_RATES = frozenset(
    {"v", "vel", "velocity", "rate", "w", "omega", "angular", "acc", "err", "error", "std", "cov",
     "sigma", "joint"}
)  # fmt: skip
"""Words of columns that hold no angle of a pose."""
_ENTRY = re.compile(r"(?:.*[^A-Za-z])?(?:r|m|t|h|rot|mat|matrix|tf|transform|pose)[\W_]*"
                    r"([0-4])[\W_]?([0-4])[\W_]*", re.IGNORECASE)  # fmt: skip
_NUMBERED = re.compile(r"(.*?)[\W_]*(\d\d?)[\W_]*")
_UR = re.compile(r"(actual|target)_tcp_pose_([0-5])", re.IGNORECASE)


class Turn(NamedTuple):
    """Columns that turn the tool."""

    places: tuple[int, ...]
    """Of three angles about x, y, z; or of the entries of (3, 3), (3, 4) or (4, 4), by rows."""
    kind: str
    """"roll", "euler", "vector", "either" of the two, or "matrix"."""
    unit: float | None = None
    """[rad]; None where no name states it."""


def turn_of(path: object, names: Sequence[str], words: Sequence[Sequence[str]]) -> Turn | None:
    """Return the columns of named angles or of a named matrix, None if there are none.

    Parameters
    ----------
    path : path
    names : sequence of str
    words : sequence of sequences of str
        Of each name, in lower case, units left out.

    Raises
    ------
    AsperityError
        Two columns of one angle, or angles in different units.
    """
    at_name = {name.strip().lower(): at for at, name in enumerate(names)}
    if all(f"{column}{axis}" in at_name for column in "noa" for axis in "xyz"):
        entries = (at_name[f"{column}{axis}"] for axis in "xyz" for column in "noa")
        return Turn(tuple(entries), "matrix")  # normal, orientation, approach: of robots
    found: dict[int, list[int]] = {}
    kinds = set()
    for at, own in enumerate(words):
        angle = _angle(own)
        if angle is not None:
            found.setdefault(angle[0], []).append(at)
            kinds.add(angle[1])
    if len(found) < 3:
        return _matrix(names)
    for several in found.values():
        if len(several) > 1:
            both = ", ".join(names[at] for at in several[:3])
            raise AsperityError(f"{path}: several columns are one angle: {both}; valid: one")
    places = tuple(found[axis][0] for axis in range(3))
    units = {named_unit(names[at], ANGLES) for at in places}
    values = {unit[1] for unit in units if unit}
    if len(values) > 1:
        raise AsperityError(f"{path}: its angles are in different units; valid: one unit")
    kind = kinds.pop() if len(kinds) == 1 else "euler"
    return Turn(places, kind, values.pop() if values else None)


def _angle(words: Sequence[str]) -> tuple[int, str] | None:
    """Return the axis and the kind of the angle that a column holds, None if it holds none."""
    if not words or _RATES & {*words}:
        return None
    if words[-1] in _ROLLS:
        return _ROLLS[words[-1]], "roll"
    before = {*words[:-1]}
    if words[-1] not in ("x", "y", "z") or {"q", "quat", "quaternion"} & before:
        return None
    for kinds, kind in ((_VECTOR, "vector"), (_EULER, "euler"), (_EITHER, "either")):
        if kinds & before:
            return "xyz".index(words[-1]), kind
    return None


def _matrix(names: Sequence[str]) -> Turn | None:
    """Return the entries of a matrix, named `r11`, `m00`, `T[0,3]` and the like."""
    found: dict[tuple[int, int], int] = {}
    for at, name in enumerate(names):
        entry = _ENTRY.fullmatch(name.strip())
        if entry is not None:
            found.setdefault((int(entry.group(1)), int(entry.group(2))), at)
    first = 0 if (0, 0) in found else 1
    for rows, columns in ((4, 4), (3, 4), (3, 3)):
        wanted = [(first + i, first + j) for i in range(rows) for j in range(columns)]
        if all(entry in found for entry in wanted):
            return Turn(tuple(found[entry] for entry in wanted), "matrix")
    return _flat_matrix(names)


def _flat_matrix(names: Sequence[str]) -> Turn | None:
    """Return the 16 entries of a matrix that are numbered through, as `O_T_EE[0]` of Franka's.

    By rows or by columns: where its 0 0 0 1 is shows that.
    """
    found: dict[str, dict[int, int]] = {}
    for at, name in enumerate(names):
        entry = _NUMBERED.fullmatch(name.strip())
        if entry is not None:
            found.setdefault(entry.group(1), {})[int(entry.group(2))] = at
    whole = {name: own for name, own in found.items() if {*own} == {*range(16)}}
    own = whole.get("O_T_EE", next(iter(whole.values())) if len(whole) == 1 else None)
    return None if own is None else Turn(tuple(own[k] for k in range(16)), "matrix")


def robot_columns(names: Sequence[str]) -> tuple[int, ...] | None:
    """Return the columns of a UR robot's pose in its log (RTDE), the actual one before the target.

    x, y, z [m] and a rotation vector [rad] in the base's frame, as the robot's manual states.
    """
    found: dict[str, dict[int, int]] = {}
    for at, name in enumerate(names):
        match = _UR.fullmatch(name.strip())
        if match is not None:
            found.setdefault(match.group(1).lower(), {})[int(match.group(2))] = at
    for which in ("actual", "target"):
        if len(found.get(which, ())) == 6:
            return tuple(found[which][k] for k in range(6))
    return None
