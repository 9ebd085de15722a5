"""The loop from a pose of the handle to the wrench that it feels."""

import logging
import subprocess
import sys

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.scene.builtin import load_scene, probe_plate
from asperity.scene.trajectory import ScriptedMotion, Trajectory
from asperity.simulation.simulation import Simulation
from asperity.simulation.tool_contact import (
    BUDGET_SPENT,
    SUB_POSES,
    TOO_FAST,
    _say_compiling,
    announce_compiling,
)

QUIET = {"force": {"anti_alias": "off"}}


@pytest.fixture(scope="module")
def scene():
    return load_scene("probe-plate").changed(**QUIET)


@pytest.fixture
def simulation(scene):
    return Simulation(scene)


def test_the_force_is_stiffness_times_depth_along_the_slope(simulation):
    """On the waves: depth and slope are those of the exact offset of a disk on a sinusoid."""
    pressed = 0.9e-3
    u = np.linspace(0.05e-3, 3.9e-3, 60)
    heights, slopes, _ = Sinusoid(amplitude=1e-4, spacing=2e-3).tracer(3e-3)(u)
    # `offset` is where the disk's lowest point is; the plate's texture has a crest at x = 0.
    for x, height, slope in zip(u, heights, slopes, strict=True):
        depth = height - (pressed - 1.5e-3)
        wrench = simulation.step([x, 0.0, pressed, 1, 0, 0, 0])
        expected = 400.0 * depth * np.array([-slope, 0.0, 1.0])
        np.testing.assert_allclose(wrench[:3], expected, atol=2e-4 * 400.0 * depth)
        assert simulation.contact_count == 1
    assert simulation.flags & ~TOO_FAST == 0


def test_no_contact_no_wrench(simulation):
    np.testing.assert_array_equal(simulation.step([0, 0, 0.05, 1, 0, 0, 0]), np.zeros(6))
    assert simulation.contact_count == 0


def test_state_is_time_pose_and_velocity(simulation):
    simulation.step([0, 0, 0.01, 1, 0, 0, 0])
    assert simulation.state.time == 0.0
    simulation.step([1e-5, 0, 0.01, 1, 0, 0, 0])
    assert simulation.state.time == pytest.approx(1e-3)
    np.testing.assert_allclose(simulation.state.twist, [0.01, 0, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(simulation.state.pose, [1e-5, 0, 0.01, 1, 0, 0, 0])
    simulation.reset()
    simulation.step([0, 0, 0.01, 1, 0, 0, 0])
    assert simulation.state.time == 0.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", range(7))
def test_poses_that_are_not_finite_are_refused(simulation, bad, where):
    pose = np.array([0, 0, 0.01, 1, 0, 0, 0], dtype=float)
    before = simulation.state
    pose[where] = bad
    with pytest.raises(AsperityError, match="finite"):
        simulation.step(pose)
    assert simulation.state is before


def test_a_tick_out_of_range_is_refused(scene):
    for dt in (0.0, -1e-3, np.nan, 1.0):
        with pytest.raises(AsperityError, match="dt must lie between"):
            Simulation(scene, dt=dt)


def test_a_rollout_begins_with_the_force_asked_for(simulation):
    rollout = simulation.rollout(ScriptedMotion(seconds=0.2, press_force=0.7, speed=0.05))
    assert rollout.contact_wrench[0, 2] == pytest.approx(0.7, rel=1e-6)
    assert len(rollout.time) == 201
    assert (rollout.contact_count == 1).all()
    assert rollout.statuses.tolist() == [201, 0, 0]
    np.testing.assert_array_equal(rollout.tool_pose, rollout.handle_pose)
    np.testing.assert_array_equal(rollout.device_wrench, rollout.contact_wrench)
    assert (rollout.tick_seconds > 0.0).all()


def test_a_rollout_can_press_by_depth(simulation):
    path = simulation.trajectory(ScriptedMotion(seconds=0.01, press_depth=2e-4))
    # The start, x = -30 mm, is on a crest of 0.1 mm.
    assert path.poses[0, 2] == pytest.approx(1.5e-3 + 1e-4 - 2e-4, abs=1e-7)


def test_a_start_beside_everything_is_refused(simulation):
    with pytest.raises(AsperityError, match=r"meets nothing.*\(900, 0, 2\) mm.*trajectory.start"):
        simulation.trajectory(ScriptedMotion(start=(0.9, 0.0, 2e-3)))


def test_a_rollout_repeats(simulation):
    motion = ScriptedMotion(seconds=0.05)
    first, second = simulation.rollout(motion), simulation.rollout(motion)
    np.testing.assert_array_equal(first.contact_wrench, second.contact_wrench)


def test_poses_of_a_file_are_followed(simulation):
    poses = np.array([[0, 0, 1.2e-3, 1, 0, 0, 0], [2e-3, 0, 1.2e-3, 1, 0, 0, 0]], dtype=float)
    rollout = simulation.rollout(Trajectory(np.array([3.0, 3.1]), poses))
    np.testing.assert_allclose(rollout.tool_pose[:, 0], np.arange(101) * 2e-5, atol=1e-15)
    # One whole wave: the force has gone round.
    np.testing.assert_allclose(rollout.contact_wrench[0], rollout.contact_wrench[-1], atol=1e-6)


def fast(mode, spacing, ticks, speed=0.169):
    """Return a simulation that has slid at `speed`, with the forces of its last ticks."""
    waves = {"kind": "sinusoid", "wavelength": spacing, "amplitude": 1e-4}
    simulation = Simulation(probe_plate(waves).changed(force={"anti_alias": mode}))
    count = ticks + 10
    poses = np.tile([0, 0, 0.2e-3, 1.0, 0, 0, 0], (count, 1))
    poses[:, 0] = -0.035 + speed * 1e-3 * np.arange(count)
    force = [simulation.step(pose)[0] for pose in poses]
    return simulation, np.array(force[-ticks:])


def test_false_tones_of_a_fast_slide_stay_under_40_db():
    # 400 ticks of 0.169 mm are 67.6 mm: 104 waves of 0.65 mm.
    spacing = 0.65e-3
    simulation, force = fast("band", spacing, 400)
    lines = np.abs(np.fft.rfft(force - force.mean()))
    order = np.fft.rfftfreq(400, 1e-3) * spacing / 0.169
    own = np.abs(order - np.round(order)) < 1e-6
    assert own.sum() > 1
    assert 20 * np.log10(lines[~own].max() / lines.max()) < -40.0
    assert simulation.flags & SUB_POSES
    assert not simulation.flags & BUDGET_SPENT
    _, raw = fast("off", spacing, 400)
    lines = np.abs(np.fft.rfft(raw - raw.mean()))
    assert 20 * np.log10(lines[~own].max() / lines.max()) > -20.0


def test_texture_too_fast_is_told_when_nothing_is_done():
    simulation, _ = fast("off", 0.3e-3, 20)
    assert simulation.flags & TOO_FAST
    simulation, _ = fast("off", 0.5e-3, 20)
    assert not simulation.flags & TOO_FAST


def test_averages_of_a_tool_at_rest_are_its_wrench(scene):
    pose = [0.3e-3, 0, 1.0e-3, 1, 0, 0, 0]
    exact = Simulation(scene).step(pose)
    for mode in ("tick", "band"):
        simulation = Simulation(scene.changed(force={"anti_alias": mode}))
        for _ in range(8):
            np.testing.assert_allclose(simulation.step(pose), exact, rtol=1e-9, atol=1e-12)
        assert simulation.flags == 0


def test_the_first_force_loads_no_plots_and_no_meshes():
    script = (
        "import asperity, sys\n"
        "from asperity.scene.builtin import load_scene\n"
        "from asperity.simulation.simulation import Simulation\n"
        "Simulation(load_scene('probe-plate')).step([0, 0, 1e-3, 1, 0, 0, 0])\n"
        "print([m for m in ('matplotlib', 'rich', 'trimesh', 'xarray', 'h5py', 'tyro',"
        " 'scipy.ndimage')"
        " if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_compiling_is_told_once_and_only_if_nothing_is_kept(tmp_path, monkeypatch, caplog):
    announce = announce_compiling
    _say_compiling.cache_clear()
    monkeypatch.setattr("asperity._core.kernels.kernel_folder", lambda _: tmp_path)
    for _ in range(2):
        announce.cache_clear()
        with caplog.at_level(logging.WARNING):
            announce()
            announce("mesh_tick")
        assert ["compiling the contact kernels" in r.message for r in caplog.records] == [True]
        (tmp_path / "tick.tick-51.py311.1.nbc").touch()
        (tmp_path / "tick.mesh_tick-51.py311.1.nbc").touch()
