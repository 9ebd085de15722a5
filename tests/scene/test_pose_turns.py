"""Poses whose turns are angles, rotation vectors or matrices, against naive trigonometry."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_of
from asperity.scene.trajectory_file import read_poses

N = 12
T = np.arange(N) * 1e-3
P = np.column_stack([0.04 * T, 0.0 * T + 2e-3, 0.01 + 0.1 * T])
ROLL, PITCH, YAW = 0.3 + 0.01 * np.arange(N), -0.5 + 0.02 * np.arange(N), 1.1 + 0.0 * T
DEG = 180.0 / np.pi


def about(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out


def turns(order: str) -> np.ndarray:
    """Return matrices of the angles about fixed axes in an order, the first one first."""
    angles = dict(zip("xyz", (ROLL, PITCH, YAW), strict=True))
    out = []
    for k in range(N):
        turn = np.eye(3)
        for axis in order:
            turn = about(axis, angles[axis][k]) @ turn
        out.append(turn)
    return np.array(out)


def vectors(matrices: np.ndarray) -> np.ndarray:
    """Return rotation vectors from the angle and the axis of matrices, angles below pi."""
    out = []
    for m in matrices:
        angle = np.arccos((np.trace(m) - 1.0) / 2.0)
        axis = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
        out.append(angle * axis / (2.0 * np.sin(angle)))
    return np.array(out)


R = turns("xyz")
V = vectors(R)
FOUR = np.zeros((N, 4, 4))
FOUR[:, :3, :3], FOUR[:, :3, 3], FOUR[:, 3, 3] = R, P, 1.0
THREE = FOUR[:, :3]
ANGLES = np.column_stack([ROLL, PITCH, YAW])


def write(path: Path, head: str, *columns: np.ndarray, separator: str = ",") -> Path:
    table = np.column_stack([np.reshape(column, (N, -1)) for column in columns])
    lines = (separator.join(f"{value:.12g}" for value in row) for row in table)
    path.write_text(head + "\n".join(lines) + "\n", "utf-8")
    return path


def check(found, expected: np.ndarray = R, times: np.ndarray = T) -> None:
    np.testing.assert_allclose(found.times, times, atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], P, atol=1e-9)
    read = np.array([rotation_of(pose[3:]) for pose in found.poses])
    np.testing.assert_allclose(read, expected, atol=1e-7)


def noted(found, words: str) -> bool:
    return any(re.search(words, note) for note in found.notes)


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("time,x,y,z,roll [rad],pitch [rad],yaw [rad]\n", (T, P, ANGLES)),
        ("time,x,y,z,roll_deg,pitch_deg,yaw_deg\n", (T, P, DEG * ANGLES)),
        ("t;px [mm];py [mm];pz [mm];Roll(°);Pitch(°);Yaw(°)\n", (T, 1e3 * P, DEG * ANGLES)),
        ("# angles in degrees\nt,yaw,pitch,roll,tx,ty,tz\n", (T, DEG * ANGLES[:, ::-1], P)),
        ("time,x,y,z,rx [deg],ry [deg],rz [deg]\n", (T, P, DEG * ANGLES)),
        ("time,x,y,z,euler_x [rad],euler_y [rad],euler_z [rad]\n", (T, P, ANGLES)),
        ("time,pos_x,pos_y,pos_z,rot_x_deg,rot_y_deg,rot_z_deg\n", (T, P, DEG * ANGLES)),
    ],
)
def test_named_angles_turn_about_fixed_axes_and_it_is_said(tmp_path, head, columns) -> None:
    found = read_poses(write(tmp_path / "a.csv", head, *columns, separator=";,"[";" not in head]))
    check(found)
    assert noted(found, r"angles about fixed axes, x, y, z in turn \(Rz Ry Rx.*angles='zyx'")


def test_the_order_and_the_unit_may_be_given(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "time,x,y,z,roll,pitch,yaw\n", T, P, ANGLES)
    with pytest.raises(AsperityError, match=r"in degrees or radians\? .*angle_unit='deg' or 'rad'"):
        read_poses(path)
    for order in ("xyz", "zyx", "yzx"):
        check(read_poses(path, angles=order, angle_unit="rad"), turns(order))
        # About the tool's own axes, the last turn is the first.
        check(read_poses(path, angles=order[::-1].upper(), angle_unit="rad"), turns(order))
    bare = write(tmp_path / "b.csv", "", T, P, DEG * ANGLES)
    check(read_poses(bare, order="rpy", angle_unit="deg"))
    check(read_poses(bare, order="time,x,y,z,roll,pitch,yaw", angle_unit="deg"))
    stated = write(tmp_path / "c.csv", "t,x,y,z,roll_deg,pitch_deg,yaw_deg\n", T, P, ANGLES)
    found = read_poses(stated, angle_unit="rad")
    check(found)
    assert noted(found, "angles in rad, as given; the file states otherwise")
    with pytest.raises(AsperityError, match="unknown angles"):
        read_poses(path, angles="xzx", angle_unit="rad")
    wrong = write(tmp_path / "d.csv", "t,x,y,z,roll_rad,pitch_rad,yaw_rad\n", T, P, DEG * ANGLES)
    assert noted(read_poses(wrong), r"are the angles in rad\? They reach 63")


def test_rotation_vectors_of_robots(tmp_path: Path) -> None:
    found = read_poses(write(tmp_path / "a.csv", "t,x,y,z,rx,ry,rz\n", T, P, V))
    check(found)
    assert noted(found, "rotation vectors.*angles='xyz'")
    assert noted(found, "angles in rad; angle_unit='deg' changes that")
    check(read_poses(write(tmp_path / "b.csv", "", T, P, V), order="rotvec"))
    check(
        read_poses(
            write(tmp_path / "f.csv", "t,tvec_x,tvec_y,tvec_z,rvec_x,rvec_y,rvec_z\n", T, P, V)
        )
    )
    head = "t;TCP X [mm];TCP Y [mm];TCP Z [mm];TCP RX [rad];TCP RY [rad];TCP RZ [rad]\n"
    check(read_poses(write(tmp_path / "g.csv", head, T, 1e3 * P, V, separator=";")))
    timeless = write(tmp_path / "c.csv", "", P, V)
    check(read_poses(timeless, order="rotvec", rate_hz=1000))
    with pytest.raises(AsperityError, match="no times; valid: times, or rate_hz="):
        read_poses(timeless, order="rotvec")
    names = [f"{which}_TCP_pose_{k}" for which in ("target", "actual") for k in range(6)]
    joints = [f"actual_q_{k}" for k in range(6)]
    head = " ".join(["timestamp", *joints, *names]) + "\n"
    log = write(tmp_path / "d.csv", head, T, 0 * V, 0 * V, 0 * P, 0 * V, P, V, separator=" ")
    found = read_poses(log)
    check(found)
    assert noted(found, "rotation vectors")
    degrees = write(tmp_path / "e.csv", "t,x,y,z,rx,ry,rz\n", T, P, DEG * ANGLES)
    found = read_poses(degrees)
    check(found)
    assert noted(found, r"angles reach 63.*: in degrees; angle_unit='rad' changes that")


@pytest.mark.parametrize("matrices", [THREE, FOUR])
def test_matrices_without_names(tmp_path: Path, matrices: np.ndarray) -> None:
    kitti = write(tmp_path / "00.txt", "", matrices, separator=" ")
    with pytest.raises(AsperityError, match=r"no times; valid: times, or rate_hz=.*KITTI"):
        read_poses(kitti)
    found = read_poses(kitti, rate_hz=1000.0)
    check(found)
    assert noted(found, "taken as matrices row by row")
    assert noted(found, "1000 poses in a second")
    check(read_poses(write(tmp_path / "b.csv", "", T, matrices)))
    np.save(tmp_path / "c.npy", matrices)
    check(read_poses(tmp_path / "c.npy", rate_hz=1000.0))
    np.savez(tmp_path / "d.npz", times=T, poses=matrices)
    check(read_poses(tmp_path / "d.npz"))
    for path in (tmp_path / "e.csv",):
        write(path, "", T, matrices.transpose(0, 2, 1))
        check(read_poses(path, order="matrix-columns"))
    found = read_poses(write(tmp_path / "f.csv", "", T, np.round(matrices, 4)))
    assert noted(found, "off rotations by up to ")


def test_four_rows_a_matrix_and_matrices_by_columns(tmp_path: Path) -> None:
    rows = FOUR.reshape(-1, 4)
    text = "\n".join(" ".join(f"{x:.12g}" for x in row) for row in rows)
    (tmp_path / "a.txt").write_text(text)
    check(read_poses(tmp_path / "a.txt", rate_hz=1000.0))
    by_columns = write(tmp_path / "b.csv", "", T, FOUR.transpose(0, 2, 1))
    found = read_poses(by_columns)
    check(found)
    assert noted(found, "column by column")
    still = FOUR.copy()
    still[:, :3, 3] = 0.0
    assert noted(read_poses(write(tmp_path / "c.csv", "", T, still)), r"or column by column\?")


@pytest.mark.parametrize("first", [0, 1])
def test_named_matrices(tmp_path: Path, first: int) -> None:
    names = [f"m{i + first}{j + first}" for i in range(3) for j in range(4)]
    check(read_poses(write(tmp_path / "a.csv", ",".join(["time", *names]) + "\n", T, THREE)))
    names = [f"T_{i + first}{j + first}" for i in range(4) for j in range(4)]
    head = ",".join(["time", *names]) + "\n"
    check(read_poses(write(tmp_path / "c.csv", head, T, FOUR)))
    found = read_poses(write(tmp_path / "d.csv", head, T, FOUR.transpose(0, 2, 1)))
    check(found)
    assert noted(found, "the place is in the last row of its matrices: they are transposed")
    with pytest.raises(AsperityError, match="the last row of its matrices is not 0 0 0 1"):
        read_poses(write(tmp_path / "e.csv", head, T, FOUR + 0.1))
    names = [f"R[{i + first},{j + first}]" for i in range(3) for j in range(3)]
    head = ";".join(["time", "x_mm", "y_mm", "z_mm", *names]) + "\n"
    check(read_poses(write(tmp_path / "b.csv", head, T, 1e3 * P, R, separator=";")))


@pytest.mark.parametrize("transposed", [False, True])
def test_matrices_that_are_numbered_through(tmp_path: Path, transposed: bool) -> None:
    stored = FOUR.transpose(0, 2, 1) if transposed else FOUR
    names = [*(f"O_T_EE[{k}]" for k in range(16)), *(f"F_T_EE[{k}]" for k in range(16))]
    head = ",".join(["time", *names]) + "\n"
    check(read_poses(write(tmp_path / "a.csv", head, T, stored, 0.0 * stored)))
    joints = ",".join(["time", *(f"joint_{k}" for k in range(16))]) + "\n"
    with pytest.raises(AsperityError, match="the last row of its matrices is not 0 0 0 1"):
        read_poses(write(tmp_path / "b.csv", joints, T, stored + 0.1))


@pytest.mark.parametrize(
    ("matrices", "words"),
    [
        (2.0 * THREE, "off by 3"),
        (THREE * [[[1.0], [1.0], [-1.0]]], "mirrored"),
        (np.ones((N, 12)), "no matrix"),
        (FOUR + 0.1, "the last row is not 0 0 0 1"),
        (np.ones((N, 15)), "15 numbers; valid: 8"),
    ],
)
def test_numbers_that_are_no_poses_are_refused(tmp_path: Path, matrices, words: str) -> None:
    path = write(tmp_path / "a.txt", "", matrices, separator=" ")
    with pytest.raises(AsperityError, match=words) as refused:
        read_poses(path, rate_hz=10.0)
    assert len(str(refused.value).replace(str(path), "")) <= 300


def test_angles_of_motion_capture(tmp_path: Path) -> None:
    head = (
        "Format Version,1.23,Rotation Type,XYZ,Length Units,Millimeters\n\n"
        ",,Rotation,Rotation,Rotation,Position,Position,Position\n"
        "Frame,Time (Seconds),X,Y,Z,X,Y,Z\n"
    )
    found = read_poses(write(tmp_path / "a.csv", head, np.arange(N), T, DEG * ANGLES, 1e3 * P))
    check(found, turns("zyx"))
    assert noted(found, "angles about moving axes, x, y, z in turn")


@pytest.mark.parametrize(("unit", "factor"), [("deg", DEG), ("rad", 1.0), ("", DEG)])
def test_the_line_of_units_says_what_vicon_s_angles_are(tmp_path, unit: str, factor: float) -> None:
    head = "Objects\n100\n,,Tool,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,U,U,U,mm,mm,mm\n"
    columns = np.arange(1, N + 1), 0.0 * T, factor * V, 1e3 * P
    path = write(tmp_path / "a.csv", head.replace("U,", f"{unit},"), *columns)
    found = read_poses(path, angles="rotvec")
    np.testing.assert_allclose(
        [rotation_of(pose[3:]) for pose in found.poses], R, atol=1e-7, rtol=0.0
    )
    assert noted(read_poses(path), "angles='xyz'" if unit == "rad" else "'rotvec' and others")
    assert noted(found, "in degrees") == (unit == "")


def test_a_rate_takes_the_place_of_times_and_options_that_do_nothing_are_refused(tmp_path) -> None:
    q = np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))
    path = write(tmp_path / "a.csv", "time,x,y,z,qw,qx,qy,qz\n", T, P, q)
    found = read_poses(path, rate_hz=500)
    np.testing.assert_allclose(found.times, 2.0 * T, atol=1e-12)
    assert noted(found, "those of the file are left out")
    check(read_poses(write(tmp_path / "b.csv", "x,y,z,qw,qx,qy,qz\n", P, q), rate_hz=1000),
          np.tile(np.eye(3), (N, 1, 1)))  # fmt: skip
    for option in ({"angles": "xyz"}, {"angle_unit": "deg"}):
        with pytest.raises(AsperityError, match="is for angles, but it has none"):
            read_poses(path, **option)
    with pytest.raises(AsperityError, match="rate_hz must be a finite number above 0"):
        read_poses(path, rate_hz=0)
