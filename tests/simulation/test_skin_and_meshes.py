"""Scenes in which a mesh presses into a soft skin, or a soft tool is pressed on a mesh."""

import numpy as np
import pytest
import trimesh

from asperity.scene.from_files import make_scene
from asperity.scene.scene import read_scene
from asperity.simulation.simulation import Simulation

LAYER = {"modulus": 3e4, "taxels": [24, 24], "friction": 0.4}
PRESS = {"kind": "slide", "seconds": 0.05, "speed": 0.05, "press_force": 0.5}


@pytest.fixture
def stl(tmp_path):
    """Return the file of a rounded tool of 12 mm."""
    made = trimesh.creation.capsule(height=6.0, radius=3.0, count=(16, 16))
    made.export(tmp_path / "tip.stl")
    return {"file": str(tmp_path / "tip.stl"), "unit": "mm"}


def test_a_mesh_presses_into_a_sponge(stl, tmp_path):
    scene = make_scene(tool=stl, target="box:30x20x10mm", tool_texture="knurl:0.8mm")
    layer = LAYER | {"thickness": 4e-3}
    scene = scene.changed(bodies={"target": {"skin": layer}}, trajectory=PRESS)
    scene.save(tmp_path / "sponge")
    again = read_scene(tmp_path / "sponge")
    assert again.skin.body.name == "target"
    forces = Simulation(again).rollout().contact_wrench[:, :3]
    assert 0.25 < np.median(forces[-20:, 2]) < 1.0
    assert forces[-1, 0] < 0.0  # friction


def test_a_soft_tool_is_pressed_on_a_mesh(stl):
    scene = make_scene(tool="sphere:6mm", target=stl, target_texture="knurl:0.8mm")
    layer = LAYER | {"thickness": 2e-3}
    scene = scene.changed(tool={"skin": layer}, trajectory=PRESS | {"length": 2e-3})
    forces = Simulation(scene).rollout().contact_wrench[:, :3]
    assert 0.25 < np.median(forces[-20:, 2]) < 1.0
