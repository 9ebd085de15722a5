"""A Gymnasium environment: a finger explores a plate and classifies its texture.

    import asperity.mujoco.exploration
    env = gymnasium.make("asperity/TextureExploration-v0")

It needs `pip install 'asperity[gym]'`.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.mujoco.surfaces import Surfaces, attach
from asperity.mujoco.taxels import Taxels
from asperity.mujoco.textures import pattern
from asperity.texture.height_field import HeightField

ID = "asperity/TextureExploration-v0"
ACTIONS = 25
"""Actions in an episode."""
_STEPS = 40
"""Steps of simulation in an action: 20 ms."""
_SPEED, _PRESS = 0.06, (0.2, 1.0)
"""Largest speed [m/s], and range of the pressing force [N]."""
_TAXELS = (4, 6)
_WINDOW = 320
"""Samples of the acceleration in the spectrum: 0.16 s."""
_BANDS = 20
"""Bands of the spectrum, from 6 Hz to 1 kHz."""
_MODEL = """<mujoco><option timestep="0.0005" gravity="0 0 0" cone="elliptic"/>
<worldbody><geom name="plate" type="box" size=".08 .03 .005" pos="0 0 -.005"/>
<body name="finger" pos="0 0 .0041">
  <joint name="x" type="slide" axis="1 0 0" damping="1"/>
  <joint name="z" type="slide" axis="0 0 1" damping="1" range="-.01 .01" limited="true"/>
  <geom name="tip" type="capsule" fromto="0 0 0 0 0 .02" size=".004" mass=".03" friction=".3"/>
  <site name="inside"/>
</body></worldbody>
<actuator><velocity joint="x" kv="100"/><motor joint="z"/></actuator>
<sensor><accelerometer site="inside"/></sensor></mujoco>"""


def usual_textures() -> dict[str, HeightField]:
    """Return the textures among which the environment chooses."""
    return {
        "fine ridges": pattern("ridges", pitch=1e-3, height=5e-5),
        "coarse ridges": pattern("ridges", pitch=2.5e-3, height=1e-4),
        "bumps": pattern("sin_product", wavelength=1.5e-3, amplitude=5e-5),
        "rough": pattern("rough", size=0.0128, pixel_size=5e-5, rms_slope=0.15, cutoff=4e-4),
    }


class TextureExploration(gymnasium.Env[NDArray[np.float64], NDArray[np.float64]]):
    """A finger on a textured plate.

    Actions are numbers from -1 to 1: the speed along the plate, the pressing force, and a score for
    each texture, the largest of which is the guess. Observations are position and velocity along
    and normal to the plate [m, m/s], the forces there [N], the force on each taxel along its normal
    [N], and the logarithm of the acceleration's power over the last 0.16 s in 20 bands up to 1 kHz,
    each a third of an octave or a line of the spectrum. The last action's guess has the reward 1 if
    it is right.

    Parameters
    ----------
    textures : dict of HeightField, optional
        Two or more; by default `usual_textures()`.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(self, textures: dict[str, HeightField] | None = None) -> None:
        self.textures = usual_textures() if textures is None else dict(textures)
        if len(self.textures) < 2:
            raise AsperityError(f"two textures at least, got {len(self.textures)}")
        self._plates: list[tuple[mujoco.MjModel, Surfaces, Taxels]] = []
        for field in self.textures.values():
            model = mujoco.MjModel.from_xml_string(_MODEL)
            surfaces = attach(model, {"plate": field}, stiffness=3e3, dissipation=5.0)
            self._plates.append((model, surfaces, Taxels(model, "tip", _TAXELS)))
        lines = np.fft.rfftfreq(_WINDOW, 0.0005)
        edges = np.geomspace(6.0, 1001.0, _BANDS + 1)
        nearest = np.argmin(np.abs(lines[:, None] - np.sqrt(edges[1:] * edges[:-1])), axis=0)
        inside = (lines[:, None] >= edges[:-1]) & (lines[:, None] < edges[1:])
        inside[nearest, np.arange(_BANDS)] = True
        self._in_band = inside / inside.sum(axis=0)
        size = 6 + _TAXELS[0] * _TAXELS[1] + _BANDS
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2 + len(self.textures),), np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Put the finger on a random plate; `options={"texture": name}` chooses it."""
        super().reset(seed=seed)
        names = list(self.textures)
        chosen = (options or {}).get("texture")
        self._texture = int(self.np_random.integers(len(names)))
        if chosen is not None:
            if chosen not in names:
                raise AsperityError(f"no texture {chosen!r}; valid: {', '.join(names)}")
            self._texture = names.index(chosen)
        self._model, self._surfaces, self._taxels = self._plates[self._texture]
        self._data = mujoco.MjData(self._model)
        self._data.qpos[0] = self.np_random.uniform(-0.03, 0.03)
        self._count, self._waves = 0, np.zeros(_WINDOW)
        return self._observation(), {}

    def step(
        self, action: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Move the finger for 20 ms."""
        given = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        share = 0.5 * (given[1] + 1.0)
        speed = _SPEED * given[0]
        place = self._data.qpos[0]
        if abs(place) > 0.06 and place * speed > 0.0:  # the plate's end
            speed = 0.0
        self._data.ctrl[:] = speed, -(_PRESS[0] + share * (_PRESS[1] - _PRESS[0]))
        self._waves = np.roll(self._waves, -_STEPS)
        for i in range(_WINDOW - _STEPS, _WINDOW):
            self._surfaces.step(self._data)
            self._waves[i] = self._data.sensordata[2]
        self._count += 1
        ended = self._count == ACTIONS
        is_right = int(np.argmax(given[2:])) == self._texture
        info = {"texture": list(self.textures)[self._texture]} if ended else {}
        return self._observation(), float(ended and is_right), ended, False, info

    def _observation(self) -> NDArray[np.float64]:
        data = self._data
        normals = np.linalg.norm(self._taxels.forces(data), axis=1)
        power = np.abs(np.fft.rfft(self._waves - self._waves.mean())) ** 2 @ self._in_band
        return np.concatenate(
            [data.qpos, data.qvel, data.qfrc_constraint, normals, np.log(power + 1e-3)]
        )


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=TextureExploration)
