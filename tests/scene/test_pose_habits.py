"""Files of poses with gaps, several bodies, and frames in their names: right, or refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses

N = 24
T = np.arange(N) * 1e-2
P = np.column_stack([0.04 * T, 0.02 - 0.01 * T, 0.01 + 0.0 * T])
Q = np.tile([np.cos(0.15), 0.02, np.sin(0.15), 0.0], (N, 1))
Q /= np.linalg.norm(Q, axis=1, keepdims=True)
HEAD = "time,x,y,z,qw,qx,qy,qz\n"
GONE = [0, 1, 7]


def lines(*columns: np.ndarray) -> list[str]:
    return [",".join(f"{v:.17g}" for v in row) for row in np.column_stack(columns)]


def read(path: Path, text: str, **options):
    path.write_text(text, "utf-8")
    return read_poses(path, **options)


def check(found, kept=slice(None)) -> None:
    np.testing.assert_allclose(found.times - found.times[0], T[kept] - T[kept][0], atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], P[kept], atol=1e-9)
    np.testing.assert_allclose(found.poses[:, 3:], Q[kept], atol=1e-9)


@pytest.mark.parametrize("gap", ["", "nan", "<NA>", "lost", "0", "-9999", "-3.697314e28"])
def test_rows_without_a_pose_are_left_out_the_first_too(tmp_path: Path, gap: str) -> None:
    rows = lines(T, P, Q)
    for row in GONE:
        rows[row] = ",".join([f"{T[row]:g}", *[gap] * 7])
    kept = [row for row in range(N) if row not in GONE]
    found = read(tmp_path / "a.csv", HEAD + "\n".join(rows))
    check(found, kept)
    assert "3 of 24 poses are missing and left out, the first in line 2" in " ".join(found.notes)


def test_rows_without_a_pose_in_arrays(tmp_path: Path) -> None:
    places, turns = P.copy(), Q.copy()
    places[GONE], turns[GONE] = np.nan, 0.0
    np.savez(tmp_path / "a.npz", t=T, position=places, quaternion_wxyz=turns)
    found = read_poses(tmp_path / "a.npz")
    check(found, [row for row in range(N) if row not in GONE])
    assert "3 of 24 poses are missing" in " ".join(found.notes)


def test_a_column_that_is_empty_at_first_is_a_column(tmp_path: Path) -> None:
    rows = [f"{row}," + ("1" if k > 4 else "") for k, row in enumerate(lines(T, P, Q))]
    check(read(tmp_path / "a.csv", HEAD.strip() + ",button\n" + "\n".join(rows)))


def test_names_of_frames_behind_the_axis(tmp_path: Path) -> None:
    names = [f"{c}_world_device" for c in ("tx", "ty", "tz", "qw", "qx", "qy", "qz")]
    head = ",".join(["graph_uid", "tracking_timestamp_us", *names]) + "\n"
    check(read(tmp_path / "a.csv", head + "\n".join(lines(0 * T, 1e6 * T, P, Q))))


def test_a_rate_above_the_rows_gives_the_times(tmp_path: Path) -> None:
    head = "FREQUENCY,100\nx,y,z,qw,qx,qy,qz\n"
    found = read(tmp_path / "a.csv", head + "\n".join(lines(P, Q)))
    check(found)
    assert "times are those of 100 poses in a second, as the file states" in found.notes
    records = [{"p": p.tolist(), "quat_wxyz": q.tolist()} for p, q in zip(P, Q, strict=True)]
    check(read(tmp_path / "a.json", json.dumps({"fps": 100, "frames": records})))


@pytest.mark.parametrize("name", ["device", "id", "child_name"])
@pytest.mark.parametrize("apart", [0.0, 0.003])
def test_bodies_by_turns_are_refused(tmp_path: Path, name: str, apart: float) -> None:
    rows = []
    for k in range(N):
        for place, body in enumerate(("0", "1") if name == "id" else ("left", "right")):
            time = T[k : k + 1] + place * apart
            rows.append(f"{body}," + lines(time, P[k : k + 1] + 0.1 * place, Q[k : k + 1])[0])
    with pytest.raises(AsperityError, match=rf"poses of 2 bodies, .* as its column '{name}'"):
        read(tmp_path / "a.csv", f"{name},{HEAD}" + "\n".join(rows))


def test_trials_one_after_the_other_are_no_bodies(tmp_path: Path) -> None:
    rows = [f"{k // 8},{row}" for k, row in enumerate(lines(T, P, Q))]
    check(read(tmp_path / "a.csv", f"trial_id,{HEAD}" + "\n".join(rows)))


def test_json_by_times_is_refused_by_what_it_holds(tmp_path: Path) -> None:
    tree = {f"{t:g}": {"pos": p.tolist(), "q": [1, 0, 0, 0]} for t, p in zip(T, P, strict=True)}
    with pytest.raises(AsperityError, match=r"it holds no poses \(0\.pos, 0\.q"):
        read(tmp_path / "a.json", json.dumps(tree))


@pytest.mark.parametrize(
    ("unit", "size"), [("Time (min)", 60.0), ("time_min", 60.0), ("t [h]", 3600.0)]
)
def test_times_in_minutes_and_hours(tmp_path: Path, unit: str, size: float) -> None:
    head = HEAD.replace("time", unit)
    check(read(tmp_path / "a.csv", head + "\n".join(lines(T / size, P, Q))))
    extremes = HEAD.strip() + ",x_min,x_max\n"  # which are no minutes
    check(read(tmp_path / "b.csv", extremes + "\n".join(lines(T, P, Q, P[:, :2]))))


def test_the_columns_of_a_robot_s_matrix(tmp_path: Path) -> None:
    matrices = Rotation.from_quat(np.roll(Q, -1, axis=1)).as_matrix()
    names = [f"{column}{axis}" for column in "noa" for axis in "xyz"]
    head = ",".join(["time", *names, "px", "py", "pz"]) + "\n"
    columns = matrices.transpose(0, 2, 1).reshape(N, 9)
    check(read(tmp_path / "a.csv", head + "\n".join(lines(T, columns, P))))


def test_a_unit_in_a_line_that_a_spreadsheet_has_filled_with_empty_cells(tmp_path: Path) -> None:
    text = "Units,mm,,,,,,\n" + HEAD + "\n".join(lines(T, 1e3 * P, Q))
    check(read(tmp_path / "a.csv", text))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("before", [0, 1])
@pytest.mark.parametrize("behind", [0, 1, 2])
@pytest.mark.parametrize("cell", ["", "ok"])
def test_names_count_beside_empty_columns(tmp_path, separator, before, behind, cell) -> None:
    names = ["", "time", "x", "y", "z", "qx", "qy", "qz", "qw", "button", "state"]
    rows = []
    for k, row in enumerate(lines(T, P, np.roll(Q, -1, axis=1))):
        more = cell if k % 3 else ""  # not in the first row
        rows.append(separator.join([*[more] * before, *row.split(","), *[more] * behind]))
    head = separator.join(names[1 - before : 9 + behind])
    found = read(tmp_path / "a.csv", "\n".join([head, *rows]))
    check(found)
    assert not any("no names" in note for note in found.notes)


def test_names_behind_the_sign_of_a_comment_that_separates_too(tmp_path: Path) -> None:
    text = ";" + HEAD.replace(",", ";") + "\n".join(lines(T, P, Q)).replace(",", ";")
    found = read(tmp_path / "a.txt", text)
    check(found)
    assert not any("no names" in note for note in found.notes)


@pytest.mark.parametrize("name", ["tracking_valid", "isTracked", "bPoseIsValid"])
@pytest.mark.parametrize("words", [("1", "0"), ("True", "False")])
def test_poses_that_a_column_marks_as_lost_are_left_out(tmp_path: Path, name: str, words) -> None:
    poses = P.copy()
    poses[GONE] = P[0] + 0.01  # what a driver writes meanwhile, as the last place that it knew
    rows = lines(T, poses, Q)
    flags = [words[row in GONE] for row in range(N)]
    text = "\n".join(f"{row},{flag}" for row, flag in zip(rows, flags, strict=True))
    found = read(tmp_path / "a.csv", HEAD.strip() + f",{name}\n" + text)
    check(found, [row for row in range(N) if row not in GONE])
    assert f"poses are missing where {name!r} is 0" in " ".join(found.notes)
    all_there = "\n".join(f"{row},{words[0]}" for row in lines(T, P, Q))
    check(read(tmp_path / "b.csv", HEAD.strip() + f",{name}\n" + all_there))


@pytest.mark.parametrize("first", [132512345678901234, 637512345678901234])
def test_ticks_of_windows_and_of_net_are_tenths_of_a_microsecond(tmp_path: Path, first) -> None:
    rows = [f"{first + 100000 * n}," + row for n, row in enumerate(lines(P, Q))]
    found = read(tmp_path / "a.csv", HEAD.replace("time", "ticks") + "\n".join(rows))
    check(found)
    assert "times in 100 ns (ticks), by their size" in found.notes


@pytest.mark.parametrize("turned", [False, True])
def test_matrices_in_one_list_of_16(tmp_path: Path, turned: bool) -> None:
    matrices = np.tile(np.eye(4), (N, 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(np.roll(Q, -1, axis=1)).as_matrix()
    matrices[:, :3, 3] = P
    lists = (matrices.transpose(0, 2, 1) if turned else matrices).reshape(N, 16).tolist()
    records = [{"timestamp": t, "transform": m} for t, m in zip(T.tolist(), lists, strict=True)]
    check(read(tmp_path / "a.json", json.dumps(records)))


MESSAGE = """header:
  stamp:
    {sec}: {s}
    {nano}: {ns:9d}
  frame_id: "base"
pose:
  pose:
    position:
      x: {x!r}
      y: {y!r}
      z: {z!r}
    orientation:
      x: {qx!r}
      y: {qy!r}
      z: {qz!r}
      w: {qw!r}
  covariance: [0.1, 0.0, 0.0]
---
"""


@pytest.mark.parametrize("names", [("secs", "nsecs"), ("sec", "nanosec")])
@pytest.mark.parametrize("name", ["a.txt", "a.yaml"])
def test_messages_of_ros_as_they_are_printed(tmp_path: Path, names, name: str) -> None:
    text = ""
    for t, p, q in zip(T, P.tolist(), Q.tolist(), strict=True):
        keys = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), p + q, strict=True))
        ns = round(1e9 * t)
        text += MESSAGE.format(sec=names[0], nano=names[1], s=1_700_000_000, ns=ns, **keys)
    check(read(tmp_path / name, text))
    wrong = text.replace("covariance: [0.1, 0.0, 0.0]", "covariance 3")
    with pytest.raises(AsperityError, match=r"line 17 is 'covariance 3'; valid: messages"):
        read(tmp_path / name, wrong)


def test_rows_of_ros2_have_no_names_and_a_word(tmp_path: Path) -> None:
    whole = np.full(N, 1_700_000_000), np.round(1e9 * T).astype(int)
    turns = np.roll(Q, -1, axis=1)
    rows = (
        ",".join([str(s), str(ns), "base", *(f"{v:.17g}" for v in (*p, *q))])
        for s, ns, p, q in zip(*whole, P, turns, strict=True)
    )
    found = read(tmp_path / "a.csv", "\n".join(rows))
    check(found)
    assert "as of ROS 2" in " ".join(found.notes)


def test_poses_of_colmap_are_doubted_or_refused(tmp_path: Path) -> None:
    """They are of the world in the camera, in no unit."""
    path = tmp_path / "images.csv"
    rows = lines(np.arange(N), Q, P, np.ones(N))
    found = read(path, "image_id,qw,qx,qy,qz,tx,ty,tz,camera_id\n" + "\n".join(rows), rate_hz=30)
    assert "poses of the world in a camera, as COLMAP's?" in " ".join(found.notes)
    head = (
        "# Image list with two lines of data per image:\n#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, "
        "CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
    )
    own = "\n".join(f"{row.replace(',', ' ')} a.jpg\n10.5 20.5 -1 3.5 4.5 17" for row in rows)
    with pytest.raises(AsperityError, match="COLMAP's images, which are poses of the world"):
        read(tmp_path / "images.txt", head + own, rate_hz=30)


@pytest.mark.parametrize("start", [1.23e11, 9.87e12, 2e12, 5e15])
@pytest.mark.parametrize("step", [1e7, 1e6])
def test_times_since_a_start_show_their_unit_by_their_steps(tmp_path: Path, start, step) -> None:
    """Nanoseconds of a clock that counts from no epoch, as OpenXR's."""
    times = start + step * np.arange(N)
    found = read(tmp_path / "a.csv", HEAD + "\n".join(lines(times, P, Q)))
    np.testing.assert_allclose(found.times, 1e-9 * step * np.arange(N), atol=1e-9)
    seconds = read(tmp_path / "b.csv", HEAD + "\n".join(lines(1.7e9 + np.arange(N), P, Q)))
    np.testing.assert_allclose(seconds.times, np.arange(N), atol=1e-6)


def test_biases_beside_a_pose_are_no_places(tmp_path: Path) -> None:
    names = "timestamp, p_WS_W_x, p_WS_W_y, p_WS_W_z, q_WS_w, q_WS_x, q_WS_y, q_WS_z, "
    biases = "b_g_x, b_g_y, b_g_z, b_a_x, b_a_y, b_a_z"
    check(read(tmp_path / "a.csv", f"{names}{biases}\n" + "\n".join(lines(T, P, Q, P, P))))


@pytest.mark.parametrize(("name", "said"), [("a.bvh", "joints of a skeleton"), ("a.bag", "of ROS")])
def test_kinds_that_hold_other_things_are_named(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(AsperityError, match=said):
        read(tmp_path / name, "HIERARCHY\n1 2 3 4 5 6\n")


def test_a_time_beyond_all_numbers_is_refused(tmp_path: Path) -> None:
    rows = lines(1.7e9 + T, P, Q)
    rows[3] = "1e9999999" + rows[3][rows[3].index(",") :]
    with pytest.raises(AsperityError, match="time must be finite"):
        read(tmp_path / "a.csv", HEAD + "\n".join(rows))
