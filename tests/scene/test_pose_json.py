"""Poses in JSON: one motion, whatever their form; the rules of names are those of CSV."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.scene.trajectory_file import read_poses

N = 12
T = np.arange(N) * 1e-3
P = np.column_stack([0.04 * T, 0.0 * T, 0.01 + 0.0 * T])
Q = np.tile([np.cos(0.15), 0.02, np.sin(0.15), 0.0], (N, 1))
Q /= np.linalg.norm(Q, axis=1, keepdims=True)
X, Y, Z = P.T
QW, QX, QY, QZ = Q.T


def matrices() -> np.ndarray:
    w, x, y, z = Q[0]
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out = np.tile(np.eye(4), (N, 1, 1))
    out[:, :3, :3], out[:, :3, 3] = turn, P
    return out


def lists(**columns) -> dict:
    return {name: np.asarray(values).tolist() for name, values in columns.items()}


def records(**columns) -> list:
    return [dict(zip(columns, map(_plain, row), strict=True)) for row in zip(*columns.values())]  # noqa: B905


def _plain(value):
    return np.asarray(value).tolist()


def ros() -> list:
    return [
        {
            "header": {"stamp": {"sec": 1732523000, "nanosec": 1_000_000 * k}, "frame_id": "base"},
            "pose": {
                "position": dict(zip("xyz", P[k].tolist(), strict=True)),
                "orientation": dict(zip("wxyz", Q[k].tolist(), strict=True)),
            },
        }
        for k in range(N)
    ]


NAMED = lists(t=T, x=X, y=Y, z=Z, qw=QW, qx=QX, qy=QY, qz=QZ)
FORMS = {
    "lists": lists(t=T, position=P, quaternion_wxyz=Q),
    "xyzw": lists(time=T, position=P, quaternion_xyzw=np.roll(Q, -1, axis=1)),
    "columns": NAMED,
    "lists within": {"pose": lists(position=P, orientation_wxyz=Q), "timestamps": T.tolist()},
    "one pose": {"data": lists(t=T, pose=np.column_stack([P, Q]))},
    "units in names": lists(time_ms=1e3 * T, position_mm=1e3 * P, quaternion_wxyz=Q),
    "records": records(t=T, position=P, quaternion_wxyz=Q),
    "records of columns": records(time=T, x=X, y=Y, z=Z, qw=QW, qx=QX, qy=QY, qz=QZ),
    "ros": ros(),
    "records beside others": {"version": 2, "unit": "mm", "poses": records(
        t=T, position=1e3 * P, quaternion_wxyz=Q)},
    "frames of a camera": {"fps": 1000.0, "frames": records(
        frame=np.arange(N), file_path=["a.png"] * N, transform_matrix=matrices())},
    "rows without names": np.column_stack([T, P, Q]).tolist(),
}  # fmt: skip


def check(found) -> None:
    np.testing.assert_allclose(found.times - found.times[0], T, atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], P, atol=1e-9)
    np.testing.assert_allclose(found.poses[:, 3:], Q, atol=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_one_motion_in_every_form(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(FORMS[form], indent=1))
    check(read_poses(path))


@pytest.mark.parametrize("form", ["records", "ros", "rows without names"])
@pytest.mark.parametrize("name", ["a.jsonl", "a.ndjson", "a.json", "a.jsonl.gz"])
def test_a_record_a_line(tmp_path: Path, form: str, name: str) -> None:
    text = "".join(json.dumps(record) + "\n" for record in FORMS[form]).encode()
    (tmp_path / name).write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    check(read_poses(tmp_path / name))


def test_times_keep_their_digits(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    times = [1732523000123456789 + 1_000_001 * k for k in range(N)]
    path.write_text(json.dumps({**lists(position=P, quaternion_wxyz=Q), "t": times}))
    found = read_poses(path)
    assert np.ptp(np.diff(found.times)) < 1e-15
    assert found.times[1] == pytest.approx(1.000001e-3, rel=1e-12)


def test_an_order_that_nothing_states_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(lists(t=T, position=P, quaternion=Q)))
    found = read_poses(path)
    check(found)
    assert "no name states the order of 'quaternion'" in "\n".join(found.notes)


def test_what_is_no_pose_is_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    values = {**lists(t=T, position=P, quaternion_wxyz=Q), "bounds": [0, 1], "force": [[1, 2]] * N}
    path.write_text(json.dumps(values))
    notes = "\n".join(read_poses(path).notes)
    assert "left out: bounds" in notes
    assert "left out: force" in notes


def test_poses_that_are_null_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    rows = records(t=T, position=P, quaternion_wxyz=Q)
    rows[5] |= {"position": None, "quaternion_wxyz": None}
    path.write_text(json.dumps(rows))
    found = read_poses(path)
    assert len(found.times) == N - 1
    assert "1 of 12 poses are missing and left out, the first in record 6" in "\n".join(found.notes)


def changed(**more) -> str:
    return json.dumps({**lists(t=T, position=P, quaternion_wxyz=Q), **more})


ROWS = records(t=T, position=P, quaternion_wxyz=Q)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"t": [0, 1', "cannot be read as JSON: "),
        ("", "the file is empty"),
        ("\x00\x01\x02\x03" * 9, "cannot be read as JSON: it is no text"),
        ("[]", "it holds no poses"),
        ("3", "it holds no poses"),
        ("[1, 2, 3]", "it holds no poses"),
        ("[{}, {}]", "it holds no poses"),
        ('{"t": 1, "t": 2}', "'t' is there twice"),
        (changed(t=[0.0, 1.0]), "its lists differ in length: t has 2, position has 12"),
        (changed(position=None), "no column named x, y, z among"),
        (json.dumps([*ROWS[:3], {"t": 1.0}]), "record 4 has no position, which record 1 has"),
        (json.dumps([*ROWS[:3], [1, 2]]), "record 4 has no names"),
        (json.dumps([*ROWS[:3], ROWS[3] | {"position": [1, 2]}]),
         "record 4: position has 2 values, not 3"),
        (json.dumps([*ROWS[:3], ROWS[3] | {"position": [1, 2, {"z": 3}]}]),
         "record 4 holds a record within a list"),
        (json.dumps([*ROWS[:3], ROWS[3] | {"position": [1, 2, "far"]}]),
         "record 4: 'far' is no number"),
        ("[[0, 1, 2], [0, 1]]", "record 2 has 2 numbers, the first 3"),
        (json.dumps({"a": ROWS, "b": ROWS}), "it holds several lists of records: a, b"),
        ("\n".join([*map(json.dumps, ROWS[:3]), '{"t": ']), "line 4 cannot be read as JSON"),
        ("[" * 100_000, "cannot be read as a .json file: it is damaged"),
    ],
)  # fmt: skip
def test_what_holds_no_poses_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(AsperityError) as caught:
        read_poses(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(path))


def test_columns_numbered_by_rows_as_pandas_writes_them(tmp_path):
    names = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
    table = {name: {str(n): 0.01 * n if name in ("time", "x") else float(name == "qw")
                    for n in range(20)} for name in names}  # fmt: skip
    (tmp_path / "a.json").write_text(json.dumps(table))
    found = read_poses(tmp_path / "a.json")
    np.testing.assert_allclose(found.times, 0.01 * np.arange(20))
    np.testing.assert_allclose(found.poses[:, 0], 0.01 * np.arange(20))


def test_an_order_that_no_name_states_is_doubted_by_the_first_pose(tmp_path):
    records = [{"t": 0.01 * n, "p": [0, 0, 0.01], "q": [0.0, 0.0, 0.1, 0.995]} for n in range(20)]
    (tmp_path / "a.json").write_text(json.dumps(records))
    assert any("is the order x, y, z, w?" in n for n in read_poses(tmp_path / "a.json").notes)
