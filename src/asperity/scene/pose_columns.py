"""Columns of a file of poses: which one is time, x, qw, ..., by name, and in which unit.

Names are split into words: `field.pose.orientation.w`, `quat_w`, `QuatW`, `q_RS_w []` and `qw` are
one column.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from asperity._core.units import ANGLES, LENGTHS, TIMES, named_unit
from asperity.errors import AsperityError
from asperity.scene.pose_angles import Turn, robot_columns, turn_of

COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
"""The columns of a pose, in asperity's order."""
_PLACED = COLUMNS[:4]
_QUATERNION = COLUMNS[4:]
ORDERS = {
    "wxyz": COLUMNS,
    "xyzw": (*_PLACED, "qx", "qy", "qz", "qw"),
    "rotvec": (*_PLACED, "rx", "ry", "rz"),
    "rpy": (*_PLACED, "roll", "pitch", "yaw"),
}
"""Orders of columns that have no names; the second is that of ROS and TUM, the third of UR."""
MATRICES = ("matrix", "matrix-columns")
"""Orders of matrices, (3, 4) or (4, 4), stored row by row (KITTI) or column by column."""


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_TIMES = _set(
    "time timestamp stamp stamps timestamps times t ts sec secs seconds zeit temps tiempo tempo "
    "elapsed ticks nanosec nsecs epoch datetime zeitstempel horodatage"
)
_FRACTIONS = ("nsec", "nsecs", "nanosec", "nanosecs")
"""Names of the nanoseconds beside whole seconds."""
_TURN = _set("q quat quaternion orientation rotation rot ori att attitude r o orient")
_SHORT_TURN = _set("r o")
"""Words that mean a turn only where they stand alone before the axis."""
_PLACE = _set(
    "p pos position t tvec trans translation loc location point tip tool tcp handle coordinate"
)
_OTHER = _set(
    "v vel velocity linear angular twist acc accel acceleration a gyro omega force torque f wrench "
    "rvec rotvec rv axisangle rodrigues err error cov covariance std sigma bias bw ba mean "
    "residual euler rpy roll pitch yaw scale normal"
)
"""Words of columns that are no poses."""
_AXES = {"0": "w", "1": "x", "2": "y", "3": "z", "i": "x", "j": "y", "k": "z", "real": "w",
         "scalar": "w", "re": "w", "r": "w"} | {axis: axis for axis in "wxyz"}  # fmt: skip
_IN_FRAMES = re.compile(r"([tq])([wxyz])_[a-z]\w*_\w+")
"""An axis before the names of the frames that it relates, as Aria's `tx_world_device`."""
_ANGLES = re.compile(r"\b(roll|pitch|yaw|euler|azimuth|heading|deg|rad|r[xyz])\b", re.IGNORECASE)
_FUSED = re.compile(r"(q|quat|rot|ori|o|r|p|t|pos|tip|trans)([wxyz0-3ijkr])")
_KNOWN = "time, x, y, z, qw, qx, qy, qz, as pos_x, tx, position.x, quat_w, orientation.w and others"


class Layout(NamedTuple):
    """Where a file has the columns of a pose, and in which units."""

    places: tuple[int, ...]
    """Of time, x, y, z, qw, qx, qy, qz among the file's columns; -1: of the time, there is none.

    Of angles and vectors, the last three are about x, y, z. Of matrices, behind the time are the
    rows of (3, 4) or (4, 4).
    """
    time_unit: float | None = None
    """[s]; None where no name states it."""
    unit: float | None = None
    """[m]; None where no name states it."""
    nanoseconds: int | None = None
    """The column of nanoseconds beside whole seconds."""
    left_out: tuple[str, ...] = ()
    rate: float | None = None
    """Frames in a second, if the first column counts them."""
    turn: str = "quaternion"
    """Or as the kinds of `Turn`."""
    angle_unit: float | None = None
    """[rad]; None where no name states it."""
    sequence: str = ""
    """Axes of the angles, if lines above the names state them; upper case: moving axes."""


def words_of(name: str) -> list[str]:
    """Return the words of a column's name, in lower case, units left out."""
    bare = re.sub(r"[\[(].*?[\])]", " ", name).strip(" \"'#%")
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    if framed := _IN_FRAMES.fullmatch(bare):
        return [*framed.groups()]
    words = [word.lower() for word in re.split(r"[^A-Za-z0-9]+", bare) if word]
    while len(words) > 1 and any(words[-1] in units for units in (LENGTHS, TIMES, ANGLES)):
        if words[-1] in (*_FRACTIONS, "secs", "sec"):
            break
        if words[-1] in ("min", "h") and words[-2] not in _TIMES:
            break  # x_min is no x
        words.pop()
    out: list[str] = []
    for at, word in enumerate(words):
        fused = _FUSED.fullmatch(word)
        if fused is None or at < len(words) - 1 or word == "time":
            out.append(word)
        else:  # "TCP RX" is a turn, "p_R_x" is the place of R
            out += ("rot" if fused.group(1) == "r" else fused.group(1), fused.group(2))
    return out


def meaning_of(name: str) -> str | None:
    """Return what a column holds: one of `COLUMNS`, "axis?" for x to w alone, or None."""
    words = words_of(name)
    if not words or _OTHER & {*words[:-1]}:
        return None
    last, before = words[-1], {*words[:-1]}
    if "b" in before and before & {"g", "a", "w"}:
        return None  # biases, as OKVIS and EuRoC name them
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
    """Return the layout of named columns; that of a robot's log wins.

    Raises
    ------
    AsperityError
        A column that is not there, but for the time; or of which there are two.
    """
    robot = robot_columns(names)
    if robot is not None:
        times = [at for at, name in enumerate(names) if meaning_of(name) == "time"]
        places = (times[0] if times else -1, *robot)
        return Layout(places, unit=1.0, turn="vector", angle_unit=1.0)
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
        # Beside x alone, tx is a torque: it is left out. Beside base_x, tip_x is a place too.
        single = all(len(words_of(names[at])) == 1 for axis in "xyz" for at in bare[axis])
        found |= {axis: bare.pop(axis) + ([] if single else found.get(axis, [])) for axis in "xyz"}
    elif not bare["w"] and all(axis in found or bare[axis] for axis in "xyz"):
        # A body's name may stand before the first of its columns alone: "tool X", "Y", "Z".
        found |= {axis: bare.pop(axis) for axis in "xyz" if axis not in found}
    for axis, alone in bare.items():
        if alone and f"q{axis}" not in found:
            found[f"q{axis}"] = alone
    turn = None
    if not all(name in found for name in _QUATERNION):
        turn = turn_of(path, names, [words_of(name) for name in names])
    return _checked(path, names, found, turn)


def _checked(
    path: object, names: Sequence[str], found: dict[str, list[int]], turn: Turn | None
) -> Layout:
    wanted: tuple[str, ...] = COLUMNS if turn is None else _PLACED
    if turn is not None and len(turn.places) > 9:
        wanted = ("time",)
    for name in wanted[1:]:
        if len(found.get(name, ())) > 1:
            both = ", ".join(names[at] for at in found[name][:3])
            raise AsperityError(
                f"{path}: several columns are {name}: {both}; keep one of them in the file"
            )
    lacking = [name for name in wanted if name not in found]
    if lacking and lacking != ["time"]:
        turned = {*_QUATERNION} & {*lacking}
        what = "quaternions are wanted; " if turned else ""
        if turned and _ANGLES.search(" ".join(names).replace("_", " ")):
            what = "quaternions are wanted, or roll, pitch, yaw; "
        shown = ", ".join(filter(None, names))
        raise AsperityError(
            f"{path}: no column named {', '.join(lacking)} among {shown[:70]}; "
            f"{what}valid: {_KNOWN}"
        )
    time_at, nanoseconds = _times(names, found)
    placed = tuple(found[name][0] for name in wanted[1:])
    places = (time_at, *placed)
    if turn is not None:
        places = (time_at, *_in_rows(turn, placed))
    time = named_unit(names[time_at], TIMES) if time_at >= 0 else None
    lengths = {named_unit(names[at], LENGTHS) for at in placed[:3]} or {None}
    if len(lengths) > 1:
        raise AsperityError(f"{path}: x, y and z are in different units; valid: one unit")
    length = lengths.pop()
    used = {*places, nanoseconds}
    left_out = tuple(n.strip() for at, n in enumerate(names) if at not in used and n.strip())
    layout = Layout(places, time and time[1], length and length[1], nanoseconds, left_out)
    return layout if turn is None else layout._replace(turn=turn.kind, angle_unit=turn.unit)


def _times(names: Sequence[str], found: dict[str, list[int]]) -> tuple[int, int | None]:
    """Return the column of the time, -1 without, and that of the nanoseconds beside its seconds.

    A log may have a whole time too: nanoseconds belong to the seconds that are named as they are.
    """
    times = found.get("time", [-1])
    parts = found.get("nanoseconds", [None])
    if parts[0] is None or len(times) == 1:
        return times[0], parts[0]
    owner = words_of(names[parts[0]])[:-1]
    same = [at for at in times if words_of(names[at])[:-1] == owner]
    return (same[0], parts[0]) if same else (times[0], None)


def _in_rows(turn: Turn, placed: tuple[int, ...]) -> tuple[int, ...]:
    """Return the columns of a place and a turn; of a matrix, as rows of (3, 4)."""
    if turn.kind != "matrix":
        return (*placed, *turn.places)
    if len(turn.places) > 9:
        return turn.places
    return tuple(at for k in range(3) for at in (*turn.places[3 * k : 3 * k + 3], placed[k]))


def layout_in_order(path: object, order: str, count: int) -> Layout:
    """Return the layout of columns in an order: a key of `ORDERS`, or their names with commas.

    The time may be left out.
    """
    names = ORDERS.get(order) or tuple(re.split(r"[\s,;]+", order.strip().lower()))
    if order in ORDERS and count == len(names) - 1:
        names = names[1:]
    fits = [
        (kind, columns)
        for kind, columns in _TURNED.items()
        if all(names.count(name) == 1 for name in columns) and names.count("time") < 2
    ]
    if not fits:
        raise AsperityError(
            "order must be 'wxyz', 'xyzw', 'rotvec', 'rpy', 'matrix', 'matrix-columns', or the "
            f"names of the columns with commas ({', '.join(COLUMNS)}, or rx, ry, rz or roll, "
            f"pitch, yaw, and - for others), got {order!r}"
        )
    if len(names) > count:
        raise AsperityError(
            f"{path}: {count} numbers in a row, but order= names {len(names)} columns; valid: one "
            "for each"
        )
    time = names.index("time") if "time" in names else -1
    kind, columns = fits[0]
    return Layout((time, *map(names.index, columns)), turn=kind)


_TURNED = {
    "quaternion": COLUMNS[1:],
    "either": ORDERS["rotvec"][1:],
    "roll": ORDERS["rpy"][1:],
}
"""Names of the columns behind the time, by the kind of the turn."""
