"""Trajectories of the handle from files."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_table import TextTable, read_text_table
from asperity._core.units import ANGLES, LENGTHS, TIMES
from asperity._core.unpacking import suffix_of
from asperity.errors import AsperityError, require_choice, require_positive
from asperity.scene.clock_times import exact_times, in_seconds
from asperity.scene.pose_arrays import array_columns
from asperity.scene.pose_columns import COLUMNS, MATRICES, ORDERS, Layout, layout_in_order
from asperity.scene.pose_doubts import ROUNDED, note_rounded, pose_doubts, unit_poses
from asperity.scene.pose_flags import lost_poses
from asperity.scene.pose_json import JSON_FILES, json_table
from asperity.scene.pose_names import (
    ROS2,
    are_ros2,
    frame_rate,
    named_columns,
    named_layout,
    of_the_world,
    require_one_body,
)
from asperity.scene.pose_times import EPOCH, since_the_first, unit_of
from asperity.scene.pose_turns import CONVENTIONS, are_blocks, in_quaternions, matrix_layout
from asperity.scene.pose_yaml import is_messages, yaml_table
from asperity.scene.trajectory import Trajectory

UNITS, TIME_UNITS = ("m", "cm", "mm", "um", "nm", "in"), ("s", "ms", "us", "ns")
_ROS = "a log of ROS; `rostopic echo -p TOPIC`, `ros2 topic echo --csv TOPIC` write it as text"
_NOT_READ = {
    ".bvh": "joints of a skeleton", ".c3d": "markers", ".trc": "markers", ".fbx": "an animation",
    ".bag": _ROS, ".db3": _ROS, ".mcap": _ROS,
}  # fmt: skip
"""What other files hold that are met among those of poses."""
_LENGTH_WORD = re.compile(
    r"(?<![A-Za-z_])(mm|cm|µm|um|(?i:(?:milli|centi|micro)met\w+|inch\w*))(?![A-Za-z])"
)
_TIME_WORD = re.compile(r"(?<![A-Za-z_])(ms|us|µs|ns|(?:milli|micro|nano)sec\w+)(?![A-Za-z])")
_ANGLE_WORD = re.compile(r"(?<![A-Za-z_])(deg(?:rees?)?|rad(?:ians?)?)(?![A-Za-z])", re.IGNORECASE)
_SEQUENCE = re.compile(r"\b(?:rotation )?type\W+([XYZ]{3})\b", re.IGNORECASE)
"""How OptiTrack states the axes of its angles, which are moving ones, in degrees."""


@dataclass(frozen=True)
class _Origins(Sequence[str]):
    """Where rows of a file stand, in words that are made when they are needed."""

    row: str
    numbers: Sequence[int]

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, at: Any) -> Any:
        return f"{self.row} {self.numbers[at]}"


class _Table(NamedTuple):
    """Numbers of a file of poses in its layout's columns, as stored."""

    values: Array
    layout: Layout
    notes: tuple[str, ...] = ()
    origins: Sequence[str] = ()
    named: bool = False
    start: float = 0.0
    """What was subtracted from the times."""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of damaged numbers
def read_poses(
    path: str | os.PathLike[str],
    *,
    order: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    angles: str | None = None,
    angle_unit: str | None = None,
    rate_hz: float | None = None,
) -> Trajectory:
    """Return a trajectory from a text file, from JSON, or from `.npy` or `.npz`.

    Text: a row a pose, separated by commas, semicolons, tabs or spaces. A line above the rows, or
    behind #, names the columns, in any order: time, x, y, z, qw, qx, qy, qz, also as `tx`,
    `pos_x`, `field.pose.orientation.w` and the like, with units (`x [mm]`, `time_ms`); instead of
    the quaternion also roll, pitch, yaw, or rx, ry, rz, or the entries of a matrix (`m00`). Without
    names the order is the first, and a note states it; 12 or 16 numbers are matrices (3, 4) or
    (4, 4) if they are rotations, as KITTI writes them, a time before them or not. JSON: records
    with these names, or lists by them (`asperity.scene.pose_json`). `.npy`: an array of these
    columns, or (n, 3, 4), (n, 4, 4). `.npz`: arrays `times` (n,) and `poses` (n, 7), or matrices.

    Parameters
    ----------
    path : str or path
    order : str, optional
        Order of the columns, instead of what the names state: `"wxyz"` or `"xyzw"` (ROS, TUM) for
        the quaternion behind time, x, y, z, `"rotvec"` (UR) or `"rpy"` for the three angles there;
        `"matrix"` by rows or `"matrix-columns"`; or all names with commas.
    unit : str, optional
        Unit of x, y and z (`"mm"`), by default what the names state, else m.
    time_unit : str, optional
        Unit of the times (`"ms"`), by default what the names state, else s; times since an epoch
        are in s, ms, us or ns by their size.
    angles : str, optional
        Meaning of three angles, by default what the names state or is usual, with a note:
        `"rotvec"`, a rotation vector; `"xyz"` and other orders, about fixed axes one after the
        other, `"XYZ"` about those of the tool.
    angle_unit : {"rad", "deg"}, optional
        By default what the names state.
    rate_hz : float, optional
        Poses in a second, above 0, for files without times.

    Returns
    -------
    Trajectory
        Its notes name what was taken, converted, normalised and doubted.

    Raises
    ------
    AsperityError
        The file does not exist, cannot be read, or holds invalid poses or times.
    """
    path = Path(path)
    if not path.is_file():
        if path.is_dir():
            valid = "give a file of poses (.csv, .json, .npy, .npz)"
            raise AsperityError(f"{path} is a folder; {valid}")
        if not path.exists():
            raise AsperityError(f"no such file of poses: {path}")
    if what := _NOT_READ.get(path.suffix.lower()):
        raise AsperityError(
            f"{path}: it holds {what}; valid: poses of one body (.csv, .json, .npy)"
        )
    lengths = None if unit is None else LENGTHS[require_choice("unit", unit, UNITS)]
    times = None if time_unit is None else TIMES[require_choice("time_unit", time_unit, TIME_UNITS)]
    if angles is not None:
        require_choice("angles", angles, CONVENTIONS)
    if rate_hz is not None:
        require_positive("rate_hz", rate_hz, "[Hz]")
    if path.suffix.lower() in (".npy", ".npz"):
        table = _read_arrays(path, order, rate_hz)
    else:
        table = _read_text(path, order, rate_hz)
    table = _without_missing(table)
    values, turned = in_quaternions(path, table.values, table.layout, angles, angle_unit)
    notes = [*table.notes, *turned]
    poses = values[:, 1:]
    length = unit_of(lengths, table.layout.unit, "x, y, z", "unit", LENGTHS, notes)
    if length != 1.0:
        poses[:, :3] *= length
    seconds = since_the_first(table.values[:, 0], table.start, table.layout.time_unit, times, notes)
    unit_quaternions, found = unit_poses(seconds, poses)
    note_rounded(poses, unit_quaternions, found, notes)
    checked = found.off < ROUNDED and math.isfinite(found.far)
    poses = unit_quaternions if checked else poses
    known = table.named or table.layout.turn != "quaternion"
    notes += pose_doubts(seconds, poses, known, found)
    return Trajectory(seconds, poses, path.name, table.origins, tuple(notes), checked)


def _no_names(path: Path, order: str | None, values: Array) -> tuple[Layout, tuple[str, ...]]:
    """Return the layout of columns without names, and the notes that state it."""
    count = values.shape[1]
    if count in (12, 13, 16, 17) and (order is None or order in MATRICES):
        layout, notes = matrix_layout(path, values, order)
        return layout, tuple(notes)
    if order in MATRICES:
        raise AsperityError(f"{path}: {count} numbers in a row; valid for matrices: 12 or 16")
    if count != len(COLUMNS) and order is None:
        valid = ", ".join(COLUMNS)
        raise AsperityError(
            f"{path}, line 1: {count} numbers; valid: 8 ({valid}), matrices of 12 or 16, names "
            "above, or order="
        )
    usual = "xyzw" if path.suffix.lower() == ".tum" else "wxyz"
    layout = layout_in_order(path, order or usual, count)
    if order is not None:
        return layout, ()
    other = "xyzw" if usual == "wxyz" else "wxyz"
    names = ", ".join(ORDERS[usual])
    return layout, (f"no names of columns: taken as {names}; order={other!r} changes that",)


def _read_arrays(path: Path, order: str | None, rate: float | None) -> _Table:
    names, values, said = array_columns(path)
    if names is not None:
        layout = (
            named_columns(path, names, rate)
            if order is None
            else layout_in_order(path, order, len(names))
        )
        if layout.left_out:
            said = (*said, f"columns left out: {', '.join(layout.left_out)[:120]}")
        chosen, timed = _timed(path, _chosen(values, layout), layout, rate)
        return _Table(chosen, layout, (*said, *timed), named=not said)
    if values.shape[1:] in ((3, 4), (4, 4)) and len(values):
        values = values.reshape(len(values), -1)
    if values.ndim != 2 or len(values) == 0 or (order is None and values.shape[1] not in _WIDTHS):
        raise AsperityError(
            f"{path} has shape {values.shape}; valid: (n, 8), columns {', '.join(COLUMNS)}; "
            "matrices (n, 3, 4) or (n, 4, 4); or order="
        )
    layout, notes = _no_names(path, order, values)
    values, timed = _timed(path, _chosen(values, layout), layout, rate)
    return _Table(values, layout, (*notes, *timed))


_WIDTHS = (8, 12, 13, 16, 17)


def _chosen(values: Array, layout: Layout) -> Array:
    """Return the columns of a layout; a time that is not there is 0."""
    found = values[:, layout.places]
    if layout.places[0] < 0:
        found[:, 0] = 0.0
    return found


def _timed(
    path: Path, values: Array, layout: Layout, rate: float | None, names: str = "",
    stated: float | None = None,
) -> tuple[Array, tuple[str, ...]]:  # fmt: skip
    """Return columns whose first is the time [s], of poses at a rate if one is given, and notes."""
    rate_of_file = layout.rate
    if layout.places[0] >= 0 and rate_of_file is None and rate is None:
        return values, ()
    if rate_of_file is not None:
        values[:, 0] = (values[:, 0] - values[0, 0]) / rate_of_file
        by = "given" if rate is not None else "the file states"
        return values, (f"times are frames at {rate_of_file:g} Hz, as {by}",)
    by = "given" if rate is not None else "the file states"
    rate = rate or stated
    if rate is None:
        among = f"no column named time{names}" if names else "no times"
        raise AsperityError(
            f"{path}: {among}; valid: times, or rate_hz=, the poses in a second (10 of KITTI)"
        )
    values[:, 0] = np.arange(len(values)) / rate
    there = "; those of the file are left out" if layout.places[0] >= 0 else ""
    return values, (f"times are those of {rate:g} poses in a second, as {by}{there}",)


def _read_text(path: Path, order: str | None, rate: float | None) -> _Table:
    said: tuple[str, ...] = ()
    if suffix_of(path, JSON_FILES) in JSON_FILES:
        read, said = json_table(path)
    elif path.suffix.lower() not in (".csv", ".tum") and is_messages(path):
        read, said = yaml_table(path)
    else:
        read = read_text_table(path, texts=True)
    text, note = in_seconds(read)
    rows = text.rows_at()
    names = text.names
    notes = of_the_world(path, text.header, names or ())
    shown = ""
    if names is None and order is None and are_ros2(text):
        names, notes = ROS2, (f"no names of columns: taken as {', '.join(ROS2)}, as of ROS 2",)
        text = replace(text, header=("\t".join(ROS2),))
    if names is None:
        values = text.values()
        if order in (None, "matrix") and are_blocks(values):
            values, rows = values.reshape(-1, 16), rows[::4]
        layout, said_of = _no_names(path, order, values)
        notes = (*notes, *said_of)
    else:
        layout = _named(path, text, names, order, rate)
        if layout.left_out and order is None:
            require_one_body(path, text, names)
        fullest = max(text.header, key=lambda line: sum(map(str.isalpha, line)))
        shown = f" among {fullest[:70]}"
        if order is not None:
            known = ", ".join(names)[:90]
            notes = (
                *notes,
                f"columns in the order {order}, as given; their names: {known}",
            )
        elif layout.left_out:
            notes = (*notes, f"columns left out: {', '.join(layout.left_out)[:120]}")
        values = text.values([at for at in layout.places if at >= 0])
    notes = (*said, *notes, note) if note else (*said, *notes)
    layout = _units_above(text, layout)
    if names is None:
        values = _chosen(values, layout)
    elif layout.places[0] < 0:
        values = np.column_stack([np.zeros(len(values)), values])
    lost, why = lost_poses(text, names or ())
    if lost is not None and len(lost) == len(values):
        values[lost, 1:], notes = np.nan, (*notes, why)
    start = 0.0
    if layout.places[0] >= 0 and np.abs(values[:1, 0]).max() > EPOCH:
        start, values[:, 0] = exact_times(text.complete(), layout.places[0], values[:, 0])
    if layout.nanoseconds is not None:
        values[:, 0] += 1e-9 * text.values([layout.nanoseconds])[:, 0]
    values, timed = _timed(path, values, layout, rate, shown, frame_rate(text.header))
    notes = (*notes, *timed)
    unsure = any(note.startswith("no name states the order") for note in said)
    is_named = (names is not None and not unsure) or order is not None
    origins = _Origins(text.row, rows)
    return _Table(values, layout, notes, origins, is_named, start)


def _without_missing(table: _Table) -> _Table:
    """Return a table without its missing poses, and a note on them.

    All numbers of such a pose are NaN, or its quaternion is one number four times, as 0 or -9999.
    """
    values = table.values
    missing = np.isnan(values[:, 1])
    if missing.any():
        missing &= np.isnan(values[:, 1:]).all(axis=1)
    if table.layout.turn == "quaternion":
        first = values[:, 4]
        same = values[:, 5] == first
        if same.any():
            missing |= same & (values[:, 6:] == first[:, None]).all(axis=1) & (np.abs(first) != 0.5)
    if not missing.any() or missing.all():
        return table
    kept, origins = np.flatnonzero(~missing), table.origins
    if not isinstance(origins, _Origins):
        origins = _Origins("row", range(len(values)))
    note = (
        f"{len(values) - len(kept)} of {len(values)} poses are missing and left out, the first in "
        f"{origins[int(np.argmax(missing))]}: the path across is that of the neighbours"
    )
    origins = _Origins(origins.row, [origins.numbers[k] for k in kept.tolist()])
    return table._replace(values=values[kept], notes=(*table.notes, note), origins=origins)


def _units_above(text: TextTable, layout: Layout) -> Layout:
    """Return a layout with the units and the axes that lines above the rows state."""
    if layout.unit is None:
        layout = layout._replace(unit=_in_comments(text, _LENGTH_WORD, LENGTHS))
    if layout.time_unit is None:
        layout = layout._replace(time_unit=_in_comments(text, _TIME_WORD, TIMES))
    if layout.turn in ("quaternion", "matrix"):
        return layout
    sequence = _SEQUENCE.search("\n".join(text.header))
    if sequence is not None:
        layout = layout._replace(sequence=sequence.group(1).upper())
    if layout.angle_unit is None:
        unit = _in_comments(text, _ANGLE_WORD, ANGLES)
        layout = layout._replace(angle_unit=ANGLES["deg"] if sequence and unit is None else unit)
    return layout


def _in_comments(text: TextTable, word: re.Pattern[str], units: dict[str, float]) -> float | None:
    """Return the unit that lines above the rows state, but for the names; None unless it is one."""
    # Spreadsheets write empty cells behind a line, as many as there are columns.
    cells = [[cell for cell in line.split(text.separator) if cell] for line in text.header]
    lines = [line for line, own in zip(text.header, cells, strict=True) if len(own) != text.columns]
    stated = {units.get(found.casefold()) for line in lines for found in word.findall(line)}
    return stated.pop() if len(stated) == 1 else None


def _named(
    path: Path, text: TextTable, names: tuple[str, ...], order: str | None, rate: float | None
) -> Layout:
    if order in MATRICES:
        return matrix_layout(path, text.values(), order)[0]
    if order is not None:
        return layout_in_order(path, order, text.columns)
    return named_layout(path, text, names, rate)
