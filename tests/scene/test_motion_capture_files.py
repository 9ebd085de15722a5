"""Poses as programs of motion capture write them: names in several lines, frames, gaps."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses

N = 12
T = np.arange(N) * 1e-2
P = np.column_stack([0.04 * T + 0.1, 0.02 + 0.0 * T, 0.01 + 0.0 * T])
Q = np.tile([np.cos(0.15), 0.02, np.sin(0.15), 0.0], (N, 1))
Q /= np.linalg.norm(Q, axis=1, keepdims=True)
XYZW = np.roll(Q, -1, axis=1)


def table(*columns: np.ndarray, separator: str = ",") -> str:
    rows = np.column_stack(columns)
    return "".join(separator.join(f"{value:.12g}" for value in row) + "\n" for row in rows)


def check(found, kept: np.ndarray | None = None) -> None:
    kept = np.ones(N, dtype=bool) if kept is None else kept
    np.testing.assert_allclose(found.times, T[kept] - T[kept][0], atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], P[kept], atol=1e-9)
    np.testing.assert_allclose(found.poses[:, 3:], Q[kept], atol=1e-9)


def motive(*bodies: str, markers: int = 0, kind: str = "Quaternion", places: str = "Meters") -> str:
    """Return an export of OptiTrack's: each body is as the first, 1 m beside it."""
    turn = ["X", "Y", "Z", "W"] if kind == "Quaternion" else ["X", "Y", "Z"]
    heads = [["", "Type"], ["", "Name"], ["", "ID"], ["", ""], ["Frame", "Time (Seconds)"]]
    columns = [np.arange(N), T]
    for number, body in enumerate(bodies):
        count = len(turn) + 3
        for head, cell in zip(heads, ("Rigid Body", body, f"7D{number}"), strict=False):
            head += [cell] * (count + 1)
        heads[3] += ["Rotation"] * len(turn) + ["Position"] * 3 + ["Mean Marker Error"]
        heads[4] += [*turn, "X", "Y", "Z", ""]
        factor = 1e3 if places == "Millimeters" else 1.0
        columns += [XYZW[:, : len(turn)], factor * (P + number), 0.0 * T + 2e-4]
        for marker in range(markers):
            cells = ("Rigid Body Marker", f"{body}:Marker{marker}", f"M{number}{marker}")
            for head, cell in zip(heads, cells, strict=False):
                head += [cell] * 3
            heads[3] += ["Position"] * 3
            heads[4] += ["X", "Y", "Z"]
            columns.append(factor * (P + 0.5))
    first = f"Format Version,1.23,Capture Frame Rate,100.0,Type,{kind},Length Units,{places}"
    return first + "\n\n" + "".join(",".join(head) + "\n" for head in heads) + table(*columns)


@pytest.mark.parametrize("places", ["Meters", "Millimeters"])
@pytest.mark.parametrize("markers", [0, 3])
def test_one_body_of_motive_is_read_and_its_markers_are_not(
    tmp_path: Path, places: str, markers: int
) -> None:
    (tmp_path / "a.csv").write_text(motive("tool", markers=markers, places=places))
    check(read_poses(tmp_path / "a.csv"))


def test_several_bodies_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(motive("probe", "board", markers=2))
    with pytest.raises(AsperityError, match="poses of 2 bodies, probe, board; valid: one"):
        read_poses(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text(motive("probe", "board"))
    check(read_poses(tmp_path / "b.csv", order="-,time,qx,qy,qz,qw,x,y,z,-"))


def vicon(*objects: str, rate: str = "100") -> str:
    heads = [["", ""], ["Frame", "Sub Frame"], ["", ""]]
    columns = [np.arange(1, N + 1), 0.0 * T]
    for number, name in enumerate(objects):
        heads[0] += [f"Global Angle {name}:{name}", *[""] * 6]
        heads[1] += ["RX", "RY", "RZ", "RW", "TX", "TY", "TZ"]
        heads[2] += ["", "", "", "", "mm", "mm", "mm"]
        columns += [XYZW, 1e3 * (P + number)]
    above = f"Objects\n{rate}\n" if rate else "Objects\n"
    return above + "".join(",".join(head) + "\n" for head in heads) + table(*columns)


def test_frames_of_vicon_are_times_at_the_rate_above(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(vicon("Tool"))
    found = read_poses(tmp_path / "a.csv")
    check(found)
    assert "times are frames at 100 Hz, as the file states" in found.notes
    (tmp_path / "b.csv").write_text(vicon("Tool", rate=""))
    with pytest.raises(AsperityError, match=r"named time among Frame,Sub Frame,RX.*rate_hz="):
        read_poses(tmp_path / "b.csv")
    check(read_poses(tmp_path / "b.csv", rate_hz=100))
    (tmp_path / "c.csv").write_text(vicon("Tool", "Plate"))
    with pytest.raises(AsperityError, match="poses of 2 bodies, Global Angle Tool:Tool, Global"):
        read_poses(tmp_path / "c.csv")


@pytest.mark.parametrize(
    "head",
    [
        "time,x,y,z,qw,qx,qy,qz\ns,mm,mm,mm,-,-,-,-\n",
        "t,px,py,pz,qw,qx,qy,qz\n(s),(mm),(mm),(mm),,,,\n",
        "Time (s),X (mm),Y (mm),Z (mm),W,X,Y,Z\n", "t,x,y,z,qw,qx,qy,qz\n,mm,mm,mm,,,,\n",
    ],
)  # fmt: skip
def test_units_may_stand_in_a_line_of_their_own(tmp_path: Path, head: str) -> None:
    (tmp_path / "a.csv").write_text(head + table(T, 1e3 * P, Q))
    check(read_poses(tmp_path / "a.csv"))


@pytest.mark.parametrize("gap", ["nan,nan,nan,nan,nan,nan,nan", ",,,,,,", "-,-,-,-,-,-,-"])
def test_poses_that_are_missing_are_left_out_aloud(tmp_path: Path, gap: str) -> None:
    lines = table(T, P, Q).split("\n")
    for row in (4, 5):
        lines[row] = f"{T[row]:.9g},{gap}"
    (tmp_path / "a.csv").write_text("time,x,y,z,qw,qx,qy,qz\n" + "\n".join(lines))
    found = read_poses(tmp_path / "a.csv")
    check(found, np.isin(np.arange(N), (4, 5), invert=True))
    assert any(
        "2 of 12 poses are missing and left out, the first in line 6" in n for n in found.notes
    )
    lines[7] = lines[7].replace(lines[7].split(",")[2], "nan")  # part of a pose
    (tmp_path / "a.csv").write_text("time,x,y,z,qw,qx,qy,qz\n" + "\n".join(lines))
    with pytest.raises(AsperityError, match=r"line 9.* finite"):
        read_poses(tmp_path / "a.csv")


def test_a_tum_without_names_has_the_scalar_last(tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_text(table(T, P, XYZW, separator=" "))
    found = read_poses(tmp_path / "a.tum")
    check(found)
    assert any("order='wxyz' changes that" in note for note in found.notes)
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress((tmp_path / "a.tum").read_bytes()))
    check(read_poses(tmp_path / "a.txt.gz", order="xyzw"))


@pytest.mark.parametrize(
    ("separator", "decimal", "stamp"),
    [
        (",", ".", "2024-01-10T10:10:10{}Z"), (",", ".", "2024-01-10 23:59:59{}"),
        (";", ",", "2024-01-10T10:10:10{}+01:00"), (" ", ".", "2024-02-29T00:00:00{}"),
        (",", ".", "09:08:07{}"), ("\t", ".", "9:08:07{}"),
        (",", ".", "10.01.2024 10:10:10{}"), (",", ".", "2024/1/10 9:10:10{}"),
        (";", ",", "1/10/2024 12:10:10{} AM"), (",", ".", "11:10:10{} p.m."),
    ],
)  # fmt: skip
def test_times_of_day_are_seconds(tmp_path: Path, separator: str, decimal: str, stamp: str) -> None:
    rows = table(P, Q, separator=separator).replace(".", decimal).splitlines()
    parts = [f"{decimal}{round(100 * t):02d}" for t in T]
    lines = [stamp.format(part) + separator + row for part, row in zip(parts, rows, strict=True)]
    head = separator.join(["timestamp", "x", "y", "z", "qw", "qx", "qy", "qz"])
    (tmp_path / "a.csv").write_text("\n".join([head, *lines]))
    found = read_poses(tmp_path / "a.csv")
    np.testing.assert_allclose(found.times - found.times[0], T, atol=1e-9)
    assert "times of day are turned into seconds" in found.notes


def test_times_of_two_days_and_dates_in_a_cell_before_them(tmp_path: Path) -> None:
    days = [f"31.12.2023 23:59:59.{k}" for k in range(5, 10)]
    days += [f"01.01.2024 00:00:00.{k}" for k in range(len(T) - 5)]
    rows = [f"{d},{r}" for d, r in zip(days, table(P, Q).splitlines(), strict=True)]
    head = "timestamp,x,y,z,qw,qx,qy,qz"
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    times = read_poses(tmp_path / "a.csv").times
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-9)
    text = "\n".join([f"date,{head}", *rows[:5]])  # where spaces separate, as a cell
    (tmp_path / "a.txt").write_text(text.replace(",", " "))
    times = read_poses(tmp_path / "a.txt").times
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-9)
