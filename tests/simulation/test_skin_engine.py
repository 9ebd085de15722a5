"""A soft tool in a simulation, and its fields in a recording."""

import json

import numpy as np
import pytest
from PIL import Image

from asperity.errors import AsperityError
from asperity.runs.pressure_figure import (
    pressure_figure,
    pressure_images,
    shear_figure,
    traction_images,
)
from asperity.runs.recording import read_recording
from asperity.runs.run_scene import run_scene
from asperity.runs.skin_fields import read_fields
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation


def finger(**changes):
    """Return the fingertip with few taxels and a short motion."""
    skin = {"taxels": [24, 24]} | changes.pop("skin", {})
    return load_scene("finger-plate").changed(
        tool={"skin": skin}, trajectory={"seconds": 0.1}, **changes
    )


def test_a_finger_on_its_coupling_presses_and_is_held_back():
    scene = finger()
    rollout = Simulation(scene).rollout()
    assert np.isfinite(rollout.contact_wrench).all()
    late = rollout.contact_wrench[20:]
    # Pressed with 0.6 N at first; friction of 0.4 and the dots hold against the motion, along x.
    assert late[:, 2].mean() == pytest.approx(0.6, abs=0.1)
    assert -0.6 < late[:, 0].mean() < -0.1
    assert (rollout.contact_count == 1).all()
    assert rollout.penetration_depth.max() < scene.skin.thickness
    # The coupling does not shake: no tick is far from the last.
    assert np.abs(np.diff(late[:, 2])).max() < 0.1


def test_a_smooth_finger_has_the_contact_that_its_modulus_was_fitted_to():
    simulation = Simulation(finger(skin={"friction": 0.0}, coupling={"mode": "direct"}).smooth())
    simulation.step(simulation.trajectory().poses[0])
    skin = simulation.stage.engine.skin
    assert simulation.contact_wrench[2] == pytest.approx(0.6, rel=1e-6)
    assert skin.contact_area == pytest.approx(75e-6, rel=0.1)
    assert skin.compression.max() == pytest.approx(1.05e-3, rel=0.1)


def test_a_direct_skin_without_friction_is_its_contact():
    scene = finger(skin={"friction": 0.0}, coupling={"mode": "direct"})
    simulation = Simulation(scene)
    path = simulation.trajectory()
    for pose in path.poses[:3]:
        simulation.step(pose)
    skin = simulation.stage.engine.skin
    np.testing.assert_allclose(skin.wrench(path.poses[2]), simulation.contact_wrench, atol=1e-12)
    assert simulation.stage.energy == pytest.approx(skin.energy)


def test_fields_are_recorded_at_their_rate(tmp_path):
    file = tmp_path / "recording.h5"
    run = run_scene(finger(), file, field_rate=100.0)
    fields = read_fields(tmp_path)
    np.testing.assert_allclose(fields.time, run.rollout.time[::10])
    assert fields.pressure.shape == (len(fields.time), 24, 24)
    assert fields.shear.shape == (len(fields.time), 24, 24, 2)
    assert fields.column[[0, -1]] == pytest.approx([-7e-3 * 23 / 24, 7e-3 * 23 / 24])
    # The vertical force is mostly that of the pressure: rays there are nearly upright.
    cell = 14e-3 * 12e-3 / 24**2
    force = fields.pressure.sum(axis=(1, 2)) * cell
    np.testing.assert_allclose(force, run.rollout.contact_wrench[::10, 2], rtol=0.15)
    assert len(read_recording(file).time) == len(run.rollout.time)
    assert pressure_images(file, tmp_path / "images") == len(fields.time)
    assert len([*(tmp_path / "images").glob("*.png")]) == len(fields.time)
    assert len(pressure_figure(fields, "finger").axes) == 7
    with pytest.raises(AsperityError, match="largest"):
        pressure_images(file, tmp_path / "other", largest=-1.0)


def test_images_of_three_channels_give_the_fields_back(tmp_path):
    run_scene(finger(), tmp_path / "recording.h5", field_rate=50.0)
    fields = read_fields(tmp_path)
    assert traction_images(tmp_path, tmp_path / "traction") == len(fields.time)
    scale = json.loads((tmp_path / "traction" / "scale.json").read_text("utf-8"))
    assert scale["time_s"] == pytest.approx(fields.time)
    for i in range(len(fields.time)):
        with Image.open(tmp_path / "traction" / f"{i:04d}.png") as image:
            assert (image.mode, image.size) == ("RGB", (24, 24))
            levels = np.asarray(image)[::-1].astype(float)
        expected = {
            "red": fields.shear[i, ..., 0], "green": fields.shear[i, ..., 1],
            "blue": np.maximum(fields.pressure[i], 0.0),
        }  # fmt: skip
        for channel, (name, values) in enumerate(expected.items()):
            about = scale[name]
            found = (levels[..., channel] - about["zero"]) * about["step_pa"]
            np.testing.assert_allclose(found, values, atol=0.5001 * about["step_pa"])
    # What is more than a given largest is cut off.
    traction_images(tmp_path, tmp_path / "cut", shear=1.0, pressure=1.0)
    with Image.open(tmp_path / "cut" / "0000.png") as image:
        levels = np.asarray(image)[::-1]
    assert set(np.unique(levels[..., 0])) <= {1, 128, 255}
    assert (levels[..., 2] == 255).sum() == (fields.pressure[0] >= 1.0).sum()
    with pytest.raises(AsperityError, match=r"shear.*-1"):
        traction_images(tmp_path, tmp_path / "other", shear=-1.0)


def test_the_figure_of_the_shear_has_arrows_against_the_motion(tmp_path):
    run_scene(finger(), tmp_path / "recording.h5", field_rate=50.0)
    figure = shear_figure(read_fields(tmp_path), "finger")
    assert figure.axes[-1].get_ylabel() == "size of the shear [kPa]"
    last = figure.axes[len(figure.axes) - 2].collections[0]
    assert last.U.sum() < 0.0  # the finger slides along columns
    assert abs(last.V.sum()) < 0.5 * abs(last.U.sum())


def test_recordings_without_fields_are_told_apart(tmp_path):
    run_scene(finger(), tmp_path / "recording.h5")
    with pytest.raises(AsperityError, match="field-rate-hz"):
        read_fields(tmp_path)
