"""Pressure and shear of rigid tools: their sum and moment are the wrench, and they are recorded."""

import numpy as np
import pytest

from asperity.geometry.poses import rotation_of
from asperity.runs.recording import read_recording
from asperity.runs.run_scene import run_scene
from asperity.runs.skin_fields import read_fields
from asperity.runs.tool_taxels import ToolTaxels, field_engine
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation


def slid(name, ticks=40):
    """Return a scene, the stage of its simulation, and the last pose and wrench of a slide."""
    scene = load_scene(name)
    simulation = Simulation(scene)
    pose = wrench = None
    for pose in simulation.trajectory().poses[:ticks]:
        wrench = simulation.step(pose)
    return scene, simulation.stage, pose, np.array(wrench)


@pytest.mark.parametrize("name", ["probe-plate-dots", "hammer-blocks", "file-cad"])
def test_sum_and_moment_are_the_wrench(name):
    scene, stage, pose, wrench = slid(name)
    taxels = ToolTaxels(scene)
    taxels.fill(pose, stage.contacts, wrench, stage.engine.centre)
    axes, turn = taxels._axes, rotation_of(pose[3:])
    traction = np.concatenate([taxels.shear, -taxels.pressure[..., None]], axis=2)
    forces = taxels._area * traction.reshape(-1, 3)[taxels._cells] @ axes @ turn.T
    np.testing.assert_allclose(forces.sum(axis=0), wrench[:3], atol=1e-9 * abs(wrench[2]))
    arms = (taxels._forces.places - stage.engine.centre) @ turn.T
    size = np.abs(wrench[:3]).max() * np.ptp(arms)
    np.testing.assert_allclose(np.cross(arms, forces).sum(axis=0), wrench[3:], atol=1e-9 * size)
    # The largest pressure is where the contacts are.
    points = stage.contacts.point[: stage.contact_count]
    largest = taxels._forces.places[np.argmax(forces[:, 2])] @ turn.T + pose[:3]
    low, high = points.min(axis=0), points.max(axis=0)
    assert np.linalg.norm(largest - np.clip(largest, low, high)) < 4.0 * taxels.spread


def test_the_grid_lies_on_the_side_that_faces_down():
    scene = load_scene("probe-plate")  # a ball of 3 mm
    taxels = ToolTaxels(scene, taxels=(21, 21))
    np.testing.assert_allclose(taxels.extent, [-1.5e-3, 1.5e-3, -1.5e-3, 1.5e-3], rtol=0.1)
    places = taxels._forces.places
    middle = places[np.linalg.norm(places[:, :2], axis=1).argmin()]
    np.testing.assert_allclose(middle, [0.0, 0.0, -1.5e-3], atol=5e-5)
    hammer = ToolTaxels(load_scene("hammer-blocks"))
    # The face of its head, not the handle of 0.3 m.
    assert hammer.extent[1] - hammer.extent[0] < 0.03


def test_a_run_records_them_and_says_that_the_spread_is_a_choice(tmp_path):
    scene = load_scene("probe-plate-dots").changed(trajectory={"seconds": 0.05})
    done = run_scene(scene, tmp_path / "recording.h5", field_rate=200.0)
    fields = read_fields(tmp_path)
    assert fields.pressure.shape == (11, 32, 32)
    assert any("spread over" in note for note in done.summary["notes"])
    recording = read_recording(tmp_path / "recording.h5")
    ticks = np.rint(fields.time / 1e-3).astype(int)
    cell = np.diff(fields.column).mean() * np.diff(fields.row).mean()
    pushed = cell * fields.pressure.sum(axis=(1, 2))
    np.testing.assert_allclose(pushed, recording.contact_wrench[ticks, 2], rtol=1e-5)


def test_one_engine_for_each_kind_of_scene():
    scene = load_scene("probe-plate")
    engine = field_engine(scene)
    pose = scene.start.copy()
    pose[2] -= 1e-4
    engine.reset()
    wrench = engine.wrench(pose, 0.0)
    assert wrench[2] > 0.0
    assert engine.skin.pressure.max() > 0.0
    assert engine.skin.contact_area > 0.0
    assert engine.grid.taxels == (32, 32)
    soft = field_engine(load_scene("sponge"))
    assert len(soft.grid.taxels) == 2
    assert not isinstance(soft, ToolTaxels)
