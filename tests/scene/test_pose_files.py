"""Files of poses as other programs write them: one motion, whatever the order, names and units."""

from __future__ import annotations

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
XYZW = np.roll(Q, -1, axis=1)
EPOCH = 1732523000.123


def write(path: Path, head: str, *columns: np.ndarray, separator: str = ",") -> Path:
    table = np.column_stack(columns)
    lines = (separator.join(f"{value:.17g}" for value in row) for row in table)
    path.write_text(head + "\n".join(lines) + "\n", "utf-8")
    return path


def check(found, *, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(found.times, T, atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], P, atol=atol)
    np.testing.assert_allclose(found.poses[:, 3:], Q, atol=max(atol, 1e-9))


NAMED = {
    "ros": ("time,x,y,z,qx,qy,qz,qw\n", (T, P, XYZW)),
    "long": ("timestamp,pos_x,pos_y,pos_z,quat_x,quat_y,quat_z,quat_w\n", (T, P, XYZW)),
    "tum": ("# ground truth\n# timestamp tx ty tz qx qy qz qw\n", (T, P, XYZW)),
    "euroc": (
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
        "q_RS_z [],v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1]\n",
        (1e9 * T, P, Q, P, T),
    ),
    "ndi": ("Time (ms);Q0;Qx;Qy;Qz;Tx (mm);Ty (mm);Tz (mm);Error\n", (1e3 * T, Q, 1e3 * P, T)),
    "camel": ("Time,PosX,PosY,PosZ,RotW,RotX,RotY,RotZ\n", (T, P, Q)),
    "dots": ("t, tool.position.x, tool.position.y, tool.position.z, tool.orientation.x, "
             "tool.orientation.y, tool.orientation.z, tool.orientation.w\n", (T, P, XYZW)),
    "quaternion first": ("qw qx qy qz x_m y_m z_m time_us\n", (Q, P, 1e6 * T)),
    "w x y z alone": ("t,px,py,pz,w,x,y,z\n", (T, P, Q)),
    "comment states mm": ("# positions in mm\ntime,x,y,z,qw,qx,qy,qz\n", (T, 1e3 * P, Q)),
    "with velocities": (
        "time,x,y,z,vx,vy,vz,qx,qy,qz,qw,twist.angular.x,twist.angular.y,twist.angular.z\n",
        (T, P, P, XYZW, P),
    ),
    "motive": (
        "Frame,Time,Body 1,Body 1,Body 1,Body 1,Body 1,Body 1,Body 1\n"
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n"
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n",
        (np.arange(N), T, XYZW, P),
    ),
    "torques": ("t,x,y,z,qw,qx,qy,qz,fx,fy,fz,tx,ty,tz\n", (T, P, Q, 0 * P, 1 + P)),
    "others in ms": ("time,x,y,z,qw,qx,qy,qz,latency [ms],gap [mm]\n", (T, P, Q, T, T)),
    "units above": ("units: mm, ms\ntime,x,y,z,qw,qx,qy,qz\n", (1e3 * T, 1e3 * P, Q)),
    "units of a program": (
        'Format Version,1.23,Length Units,Millimeters,Rotation Type,Quaternion\n\n,,"1","1","1",'
        '"1","1","1","1"\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n'
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n",
        (np.arange(N), T, XYZW, 1e3 * P),
    ),
    "camel units": ("timeMs,xMm,yMm,zMm,qw,qx,qy,qz\n", (1e3 * T, 1e3 * P, Q)),
    "nanoseconds": ("timestampNs,x,y,z,qw,qx,qy,qz\n", (1e9 * T, P, Q)),
    "two lines": (
        "Frame,Time,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n"
        ",(Seconds),X,Y,Z,W,X,Y,Z\n",
        (np.arange(N), T, XYZW, P),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", NAMED)
def test_names_decide_the_order_and_the_units(tmp_path: Path, name: str) -> None:
    head, columns = NAMED[name]
    separator = ";" if ";" in head else "," if "," in head else " "
    found = read_poses(write(tmp_path / "a.csv", head, *columns, separator=separator))
    check(found)
    assert not any("order" in note for note in found.notes)


@pytest.mark.parametrize(
    ("name", "factor"), [("", 1.0), ("", 1e3), ("", 1e6), ("", 1e9), (" [ms]", 1e3), (" [s]", 1.0)]
)
def test_times_since_an_epoch_begin_at_0(tmp_path: Path, name: str, factor: float) -> None:
    whole = [round((1732523000123 + i) * 10**6) for i in range(N)]
    unit = round(1e9 / factor)
    digits = [f"{t // unit}.{t % unit:09d}" if unit == 10**9 else str(t // unit) for t in whole]
    rows = [",".join(map(repr, row)) for row in np.column_stack([P, XYZW]).tolist()]
    lines = [f"{t},{row}" for t, row in zip(digits, rows, strict=True)]
    (tmp_path / "a.csv").write_text(f"time{name},x,y,z,qx,qy,qz,qw\n" + "\n".join(lines))
    found = read_poses(tmp_path / "a.csv")
    np.testing.assert_allclose(found.times, T, atol=1e-12)
    assert any("epoch" in note for note in found.notes)


def test_seconds_and_nanoseconds_are_added(tmp_path: Path) -> None:
    head = "header.stamp.sec,header.stamp.nanosec,frame_id,position.x,position.y,position.z,"
    head += "orientation.x,orientation.y,orientation.z,orientation.w\n"
    rows = [
        f"1732523000,{123000000 + 1000000 * i},base,"
        + ",".join(map(repr, [*P[i].tolist(), *XYZW[i].tolist()]))
        for i in range(N)
    ]
    (tmp_path / "a.csv").write_text(head + "\n".join(rows))
    check(read_poses(tmp_path / "a.csv"))


def test_nanoseconds_belong_to_their_seconds_and_not_to_a_whole_time(tmp_path: Path) -> None:
    head = "Time,header.stamp.secs,header.stamp.nsecs,pose.position.x,pose.position.y,"
    head += "pose.position.z,pose.orientation.x,pose.orientation.y,pose.orientation.z,"
    head += "pose.orientation.w,pose.covariance_0\n"
    parts = np.round(T * 1e9).astype(int) + 995_000_000  # the second changes on the way
    rows = [
        f"{1732523000.995 + t:.3f},{1732523000 + n // 10**9},{n % 10**9},"
        + ",".join(map(repr, [*p, *x, 0.0]))
        for t, n, p, x in zip(T, parts.tolist(), P.tolist(), XYZW.tolist(), strict=True)
    ]
    (tmp_path / "a.csv").write_text(head + "\n".join(rows))
    check(read_poses(tmp_path / "a.csv"))


def test_without_names_the_order_is_noted_and_may_be_set(tmp_path: Path) -> None:
    own = read_poses(write(tmp_path / "a.csv", "", T, P, Q))
    check(own)
    assert any("qw, qx, qy, qz; order='xyzw'" in note for note in own.notes)
    assert not any("is the order" in note for note in own.notes)
    ros = write(tmp_path / "b.csv", "", T, P, XYZW)
    assert any("is the order x, y, z, w?" in note for note in read_poses(ros).notes)
    check(read_poses(ros, order="xyzw"))
    check(read_poses(ros, order="time,x,y,z,qx,qy,qz,qw"))
    mixed = write(tmp_path / "c.txt", "", np.arange(N), P, XYZW, T, separator="\t")
    check(read_poses(mixed, order="-,x,y,z,qx,qy,qz,qw,time"))
    np.save(tmp_path / "d.npy", np.column_stack([T, P, XYZW]))
    check(read_poses(tmp_path / "d.npy", order="xyzw"))
    with pytest.raises(AsperityError, match="order must be 'wxyz', 'xyzw'"):
        read_poses(ros, order="zyx")


def test_units_may_be_given_and_a_contradiction_is_noted(tmp_path: Path) -> None:
    plain = write(tmp_path / "a.csv", "t,x,y,z,qw,qx,qy,qz\n", 1e3 * T, 1e3 * P, Q)
    doubted = read_poses(plain).notes
    assert any("are x, y, z in m? They reach 10 m" in note for note in doubted)
    assert any("are the times in s? There are 1 s" in note for note in doubted)
    check(read_poses(plain, unit="mm", time_unit="ms"))
    stated = write(tmp_path / "b.csv", "t,x_cm,y_cm,z_cm,qw,qx,qy,qz\n", T, 1e3 * P, Q)
    found = read_poses(stated, unit="mm")
    check(found)
    assert "x, y, z in mm, as given; the file states cm" in found.notes


def test_rounded_quaternions_are_normalised_and_others_refused(tmp_path: Path) -> None:
    for digits in (4, 3, 2):
        path = write(tmp_path / "a.csv", "t,x,y,z,qw,qx,qy,qz\n", T, P, np.round(Q, digits))
        found = read_poses(path)
        check(found, atol=10.0**-digits)
        np.testing.assert_allclose(np.linalg.norm(found.poses[:, 3:], axis=1), 1.0, atol=1e-12)
        assert any("12 of 12 quaternions are rounded" in note for note in found.notes)
    with pytest.raises(AsperityError, match="must have norm 1"):
        read_poses(write(tmp_path / "b.csv", "t,x,y,z,qw,qx,qy,qz\n", T, P, 2 * Q))


def test_a_tool_that_turns_over_is_doubted_and_a_change_of_sign_is_not(tmp_path: Path) -> None:
    head = "t,x,y,z,qw,qx,qy,qz\n"
    flips = Q * np.where(np.arange(N) % 2, 1.0, -1.0)[:, None]
    assert read_poses(write(tmp_path / "a.csv", head, T, P, flips)).notes == ()
    turned = np.where(np.arange(N)[:, None] < 5, Q, XYZW)
    notes = read_poses(write(tmp_path / "b.csv", head, T, P, turned)).notes
    assert any("from pose 4 to 5 (more than 45)" in note for note in notes)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("time,x,y,z,roll,pitch,yaw\n", ["qw, qx, qy, qz", "degrees or radians", "angle_unit="]),
        ("time,x,y,z,azimuth,elevation,roll\n", ["qw, qx, qy, qz", "quaternions are wanted"]),
        ("a,b,c,d,e,f,g\n", ["no column named time", "quat_w"]),
        ("time,tool_x,tip_x,y,z,qw,qx,qy,qz\n", ["several columns are x: tool_x, tip_x"]),
        ("T,X,Y,Z,W,X,Y,Z\n", ["several columns are x: X, X"]),
        ("time,x [mm],y [mm],z [m],qw,qx,qy,qz\n", ["different units"]),
    ],
)
def test_columns_that_do_not_make_a_pose_are_named(tmp_path: Path, head: str, words: list) -> None:
    path = write(tmp_path / "a.csv", head, np.ones((N, head.count(",") + 1)))
    with pytest.raises(AsperityError) as refused:
        read_poses(path)
    message = str(refused.value)
    assert "\n" not in message
    assert len(message.replace(str(path), "")) <= 300
    for word in words:
        assert word in message


ARRAYS = {
    "xyzw in a name": {"timestamps": T, "positions": P, "quaternions_xyzw": XYZW},
    "millimetres": {"t_ms": 1e3 * T, "pos_mm": 1e3 * P, "quat_wxyz": Q, "note": np.array("x")},
    "one array": {"arr_0": np.column_stack([T, P, Q])},
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_that_names_tell_apart(tmp_path: Path, name: str) -> None:
    np.savez(tmp_path / "a.npz", **ARRAYS[name])
    check(read_poses(tmp_path / "a.npz"))


def test_a_structured_array_has_named_columns(tmp_path: Path) -> None:
    order = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"]
    rows = [tuple(row) for row in np.column_stack([T, P, XYZW])]
    np.save(tmp_path / "a.npy", np.array(rows, dtype=[(name, "f8") for name in order]))
    check(read_poses(tmp_path / "a.npy"))
    fields = np.zeros(N, dtype=[("time", "f8"), ("pos", "f8", 3), ("quat", "f8", 4)])
    fields["time"], fields["pos"], fields["quat"] = T, P, Q
    np.save(tmp_path / "b.npy", fields)
    found = read_poses(tmp_path / "b.npy")
    check(found)
    assert any("order of 'quat': its quaternion is taken as qw" in note for note in found.notes)


def test_arrays_that_are_no_poses_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", a=np.zeros(0), b=np.zeros((2, 2)))
    np.savez(tmp_path / "b.npz", t=T, tool_position=P, board_position=P, quat_xyzw=XYZW)
    for name, words in (
        ("a.npz", r"holds a \(0,\), b \(2, 2\)"),
        ("b.npz", "several columns are x"),
    ):
        with pytest.raises(AsperityError, match=words):
            read_poses(tmp_path / name)


def test_names_of_pandas_and_of_a_body_before_its_first_column(tmp_path: Path) -> None:
    head = "Unnamed: 0,timestamps,tool X [mm],Y [mm],Z [mm],QX,QY,QZ,QW\n"
    check(read_poses(write(tmp_path / "a.csv", head, np.arange(N), T, 1e3 * P, XYZW)))


def test_decimal_commas_in_quotation_marks(tmp_path: Path) -> None:
    rows = (",".join(f'"{v:.12f}"'.replace(".", ",") for v in row) for row in np.c_[T, P, Q])
    path = tmp_path / "a.csv"
    path.write_text("time,x,y,z,qw,qx,qy,qz\n" + "\n".join(rows), "utf-8")
    check(read_poses(path))


def test_poses_at_the_origin_amid_others_are_doubted(tmp_path: Path) -> None:
    head = "time,x,y,z,qw,qx,qy,qz\n"
    poses = np.c_[P, Q]
    poses[4:6] = [0, 0, 0, 1, 0, 0, 0]
    found = read_poses(write(tmp_path / "a.csv", head, T, poses))
    assert any("was tracking lost? 2 of 12" in n and "pose 5" in n for n in found.notes)
    poses = np.c_[P - P[0], np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))]  # begins there
    assert not read_poses(write(tmp_path / "b.csv", head, T, poses)).notes


def test_leaps_and_gaps_are_noted(tmp_path: Path) -> None:
    head = "time,x,y,z,qw,qx,qy,qz\n"
    leap = P.copy()
    leap[6:, 0] += 0.2
    found = read_poses(write(tmp_path / "a.csv", head, T, leap, Q))
    assert any("leaps by 200 mm from pose 6 to 7, at 200 m/s" in note for note in found.notes)
    late = np.where(np.arange(N) > 5, T + 5.0, T)
    found = read_poses(write(tmp_path / "b.csv", head, late, P, Q))
    assert any("there are 5.001 s without a pose behind pose 6" in note for note in found.notes)


def test_two_places_are_refused_whatever_their_names(tmp_path: Path) -> None:
    for other in ("base_x,base_y,base_z", "goal_x,goal_y,goal_z"):
        head = f"time,tip_x,tip_y,tip_z,{other},qw,qx,qy,qz\n"
        with pytest.raises(AsperityError, match=r"several columns are x: .*tip_x"):
            read_poses(write(tmp_path / "a.csv", head, T, P, P + 1.0, Q))
