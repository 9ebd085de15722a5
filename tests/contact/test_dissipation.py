"""Damping of contacts: it takes energy, and a ball that falls on a plate comes to rest."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from asperity.scene.scene import Scene, scene_of
from asperity.simulation.simulation import Simulation

K, MASS, RADIUS = 2000.0, 0.02, 1.5e-3
WAVES = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4}
BALL = f'<geom type="sphere" size="{RADIUS}" mass="{MASS}"/>'


def scene_with(texture: dict | None, **force: float) -> Scene:
    """Return the scene of a ball over a plate."""
    xml = (
        '<mujoco><worldbody><body name="plate" pos="0 0 -0.005"><geom type="box" size="0.3 0.3 '
        f'0.005"/></body><body name="ball" pos="0 0 0.05"><freejoint/>{BALL}</body></worldbody>'
        "</mujoco>"
    )
    bodies = {} if texture is None else {"bodies": {"plate": {"texture": texture}}}
    return scene_of(xml, {"schema": 1, "tool": {"body": "ball"}, "force": force, **bodies})


def falling(dissipation: float, seconds: float, height: float, texture=None) -> np.ndarray:
    """Return the height of a ball that falls on a plate, each millisecond [m]."""
    simulation = Simulation(scene_with(texture, stiffness=K, friction=0.2, dissipation=dissipation))
    free = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.001"/><worldbody><body name="ball"><freejoint/>'
        f'<geom type="sphere" size="{RADIUS}" mass="{MASS}" contype="0" conaffinity="0"/></body>'
        "</worldbody></mujoco>"
    )
    data, heights = mujoco.MjData(free), []
    data.qpos[2] = RADIUS + height
    for _ in range(round(1e3 * seconds)):
        data.xfrc_applied[1] = simulation.step(data.qpos[:7])
        mujoco.mj_step(free, data)
        heights.append(data.qpos[2])
    return np.array(heights)


def test_a_ball_comes_to_rest_on_waves():
    """After 3 s it swings by less than 0.05 mm; without damping by 2 mm."""
    still = falling(10.0, 3.0, 2.5e-3, WAVES)[-300:]
    assert np.ptp(still) < 5e-5
    assert np.mean(still) == pytest.approx(RADIUS - MASS * 9.81 / K, abs=1e-4)
    assert np.ptp(falling(0.0, 1.0, 2.5e-3, WAVES)[-300:]) > 5e-4


@pytest.mark.parametrize("dissipation", [0.5, 1.5])
def test_the_restitution_is_that_of_hunt_and_crossley(dissipation):
    height = 5e-3
    speed = np.sqrt(2.0 * 9.81 * height)
    z = falling(dissipation, 0.08, height) - RADIUS
    after = z[np.argmin(z) :]
    bounced = np.sqrt(2.0 * 9.81 * after.max())
    assert bounced / speed == pytest.approx(1.0 - 2.0 / 3.0 * dissipation * speed, abs=0.06)
