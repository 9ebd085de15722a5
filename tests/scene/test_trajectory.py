"""Scripted motions keep their speed and begin smoothly; files of poses are read or refused."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.poses import (
    interpolate_pose,
    mean_twist,
    require_pose,
    rotated,
    rotation_between,
)
from asperity.scene.trajectory import ScriptedMotion, Trajectory, at_ticks, scripted
from asperity.scene.trajectory_file import read_poses

START = np.array([0.1, -0.2, 0.3, 1.0, 0.0, 0.0, 0.0])
ROWS = np.array([[0.0, 0, 0, 0, 1, 0, 0, 0], [0.5, 1e-3, 0, 0, 1, 0, 0, 0]])


def test_a_slide_goes_to_and_fro_at_exactly_its_speed():
    motion = ScriptedMotion(seconds=2.0, speed=0.05, length=0.04, direction=0.6)
    path = scripted(motion, START)
    away = path.poses[:, :3] - START[:3]
    along = away @ [np.cos(0.6), np.sin(0.6), 0.0]
    np.testing.assert_allclose(away[:, :2], np.outer(along, [np.cos(0.6), np.sin(0.6)]), atol=1e-15)
    assert along.min() >= -1e-15
    assert along.max() == pytest.approx(0.04, abs=1e-9)
    speeds = np.abs(np.diff(along)) / 1e-3
    np.testing.assert_allclose(speeds[60:700], 0.05, rtol=1e-9)
    assert speeds.max() <= 0.05 * (1 + 1e-9)
    # Smooth: no acceleration beyond that of a cosine ramp.
    assert np.abs(np.diff(along, 2)).max() / 1e-6 <= 1.01 * np.pi / 2 * 0.05 / 0.05


def test_a_line_too_short_for_its_speed_is_done_slower():
    path = scripted(ScriptedMotion(seconds=1.0, speed=1.0, length=1e-3), START)
    x = path.poses[:, 0] - START[0]
    assert 0.99e-3 < x.max() <= 1e-3 + 1e-12
    assert x.min() >= -1e-12


def test_a_circle_has_its_radius_and_speed():
    path = scripted(ScriptedMotion(kind="circle", seconds=1.0, speed=0.05, radius=0.008), START)
    middle = START[:2] + np.array([0.0, 0.008])
    np.testing.assert_allclose(np.linalg.norm(path.poses[:, :2] - middle, axis=1), 0.008)
    steps = np.linalg.norm(np.diff(path.poses[:, :2], axis=0), axis=1) / 1e-3
    np.testing.assert_allclose(steps[60:], 0.05, rtol=1e-4)
    assert steps[0] < 0.001


def test_press_and_slide_begins_and_ends_above():
    path = scripted(ScriptedMotion(kind="press-and-slide", seconds=2.0), START, lift=1.4e-3)
    z = path.poses[:, 2] - START[2]
    assert z[0] == pytest.approx(2.4e-3)
    assert z[-1] == pytest.approx(2.4e-3)
    np.testing.assert_allclose(z[250:-250], 0.0, atol=1e-15)
    moved = np.flatnonzero(np.abs(np.diff(path.poses[:, 0])) > 1e-12)
    assert moved[0] >= 250
    assert moved[-1] <= 1751
    assert np.abs(np.diff(path.poses[:, 0], 2)).max() / 1e-6 < 1.2 * np.pi / 2 * 0.083 / 0.05


def test_rotate_turns_in_place():
    path = scripted(ScriptedMotion(kind="rotate", seconds=1.0, turning=2.0), START)
    assert np.ptp(path.poses[:, :3], axis=0).max() == 0.0
    rate = mean_twist(path.poses[500], path.poses[501], 1e-3)
    np.testing.assert_allclose(rate, [0, 0, 0, 0, 0, 2.0], atol=1e-9)


def test_between_poses_the_way_is_even_and_short():
    a = START
    b = rotated(a, (0.3, -0.4, 0.5))
    b[:3] += [0.01, 0.02, 0.03]
    b[3:] *= -1.0  # the same orientation
    np.testing.assert_allclose(rotation_between(a, b), (0.3, -0.4, 0.5), atol=1e-12)
    for s in (0.0, 0.3, 1.0):
        mixed = interpolate_pose(a, b, s)
        np.testing.assert_allclose(mixed[:3], a[:3] + s * (b[:3] - a[:3]))
        np.testing.assert_allclose(
            rotation_between(a, mixed), s * np.array([0.3, -0.4, 0.5]), atol=1e-12
        )


def test_ticks_between_given_poses_are_interpolated():
    path = Trajectory(ROWS[:, 0] + 7.0, ROWS[:, 1:])
    poses = at_ticks(path, 0.1)
    np.testing.assert_allclose(poses[:, 0], np.arange(6) * 2e-4, atol=1e-18)


@pytest.mark.parametrize("suffix", [".csv", ".npy", ".npz", ".txt"])
def test_files_of_poses(tmp_path, suffix):
    path = tmp_path / f"poses{suffix}"
    if suffix == ".npy":
        np.save(path, ROWS)
    elif suffix == ".npz":
        np.savez(path, times=ROWS[:, 0], poses=ROWS[:, 1:])
    else:
        lines = ["# from a device", "time, x, y, z, qw, qx, qy, qz"]
        path.write_text("\n".join([*lines, *(", ".join(map(str, row)) for row in ROWS)]))
    read = read_poses(path)
    np.testing.assert_array_equal(read.times, ROWS[:, 0])
    np.testing.assert_array_equal(read.poses, ROWS[:, 1:])


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("0 0 0 0 1 0 0 0\n1 0 0 0 2 0 0 0\n", ["line 2", "norm", "2"]),
        ("0 0 0 0 1 0 0 0\n1 0 nan 0 1 0 0 0\n", ["line 2", "finite"]),
        ("0 0 0 0 1 0 0 0\n\n0 0 0 0 1 0 0 0\n", ["line 3", "increase"]),
        ("0 0 0 0 1 0 0\n", ["7 numbers", "valid: 8"]),
        ("0 0 0 0 1 0 0 0\n1 0 zero 0 1 0 0 0\n", ["line 2", "is no number"]),
        ("time,x\n", ["no numbers"]),
    ],
)
def test_wrong_rows_are_named(tmp_path, text, names):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(AsperityError) as refused:
        read_poses(path)
    said = str(refused.value)
    assert "\n" not in said
    for name in ["poses.csv", *names]:
        assert name in said


def test_wrong_arrays_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", ROWS[:, :5])
    with pytest.raises(AsperityError, match=r"\(2, 5\).*\(n, 8\)"):
        read_poses(tmp_path / "a.npy")
    np.savez(tmp_path / "b.npz", t=ROWS, p=ROWS)
    with pytest.raises(AsperityError, match="times"):
        read_poses(tmp_path / "b.npz")
    (tmp_path / "c.npy").write_bytes(b"no array")
    with pytest.raises(AsperityError, match=r"c\.npy: cannot be read"):
        read_poses(tmp_path / "c.npy")
    with pytest.raises(AsperityError, match="no such file"):
        read_poses(tmp_path / "d.csv")


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ([0, 0, 0, 1, 0, 0], "7 numbers"),
        ("here", "7 numbers"),
        ([0, 0, np.nan, 1, 0, 0, 0], "finite"),
        ([0, np.inf, 0, 1, 0, 0, 0], "finite"),
        ([0, 0, 0, np.nan, 0, 0, 0], "finite"),
        ([0, 0, 0, 1.00001, 0, 0, 0], "norm is 1.00001"),
        ([0, 0, 0, 0, 0, 0, 0], "norm is 0"),
        ([1e308, 1e308, 0, 1, 0, 0, 0], "finite"),
    ],
)
def test_poses_that_are_none_are_refused(pose, says):
    with pytest.raises(AsperityError, match=says):
        require_pose(pose)


def test_small_errors_of_a_norm_are_mended():
    pose = require_pose([0, 0, 0, 1.0 + 9e-7, 0, 0, 0])
    assert np.linalg.norm(pose[3:]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "slyde"}, {"speed": -1.0}, {"seconds": 0.0}, {"length": np.nan}, {"ramp": 0.0},
        {"press_force": -1.0}, {"start": (1.0, 2.0)}, {"press_depth": np.inf},
    ],
)  # fmt: skip
def test_motions_that_cannot_be_are_refused(wrong):
    with pytest.raises(AsperityError):
        ScriptedMotion(**wrong)
