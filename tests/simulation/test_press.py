"""Where a tool touches: nothing thin is leapt over on the way."""

import numpy as np
import pytest

from asperity import Simulation
from asperity.errors import AsperityError
from asperity.scene.scene import scene_of
from asperity.simulation.press import pressed_pose, touching_pose

XML = """<mujoco><worldbody>
  <body name="plate"><geom type="box" size="0.02 0.02 0.0002"/>
    <geom type="box" pos="0 0 -0.03" size="0.02 0.02 0.005"/></body>
  <body name="tool" pos="0 0 0.05"><freejoint/><geom type="sphere" size="5e-4" mass="0.01"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def simulation():
    return Simulation(scene_of(XML, {"schema": 1, "tool": {"body": "tool"}}))


@pytest.mark.parametrize("height", [0.001, 0.013, 0.047, 0.1, 0.3])
def test_a_small_tool_finds_a_thin_plate_above_a_thick_one(simulation, height):
    start = np.array([0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0])
    engine = simulation.stage.engine
    touching = touching_pose(engine, start)
    assert touching[2] == pytest.approx(7e-4, abs=1e-12)
    pressed = pressed_pose(engine, touching, 0.02)
    assert pressed[2] == pytest.approx(7e-4 - 0.02 / 400.0, abs=1e-9)


def test_nothing_below_is_said_once_the_way_has_been_searched(simulation):
    start = np.array([0.5, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0])
    with pytest.raises(AsperityError, match="meets nothing within 1 m"):
        touching_pose(simulation.stage.engine, start)
