"""Robotics packages that others wrote run with textures as they are, and unchanged without.

They run on MuJoCo 3.3 to 3.5: `make test-robots` makes an environment of their own.
"""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured

STEPS = 1000
RIDGES = {"name": "ridges", "pitch": 2e-3, "height": 2e-4}


class Client:
    """An environment, its model, and its steps with random actions."""

    def __init__(self, textures, far):
        self.textures, self.far = textures, far
        self._rng = np.random.default_rng(0)

    def random(self, low, high):
        return self._rng.uniform(low, high)


class Wipe(Client):
    """robosuite's arm that wipes a table: its own loop of `mj_step1` and `mj_step2`."""

    def __init__(self):
        super().__init__({"table_collision": textured.pattern(**RIDGES)}, "robot0_link0_collision")
        robosuite = pytest.importorskip("robosuite")
        np.random.seed(0)  # noqa: NPY002 (it draws where to wipe)
        self.env = robosuite.make(
            "Wipe", robots="Panda", has_renderer=False, has_offscreen_renderer=False,
            use_camera_obs=False, hard_reset=False, horizon=10**6,
        )  # fmt: skip
        self.model, self.data = self.env.sim.model._model, self.env.sim.data._data

    def step(self):
        action = 0.2 * self.random(-1.0, 1.0) * np.ones(self.env.action_dim)
        action[2] = self.random(-1.0, 0.2)  # down, until it wipes
        self.env.step(action)


class Gym(Client):
    """An environment of Gymnasium's: `mj_step` with `nstep`."""

    def start(self, env):
        self.env = env
        env.reset(seed=0)
        self.model, self.data = env.unwrapped.model, env.unwrapped.data

    def step(self):
        space = self.env.action_space
        _, _, ended, cut, _ = self.env.step(self.random(space.low, space.high).astype(space.dtype))
        if ended or cut:
            self.env.reset(seed=0)


class Hammer(Gym):
    """metaworld's hammer, whose head and block are textured."""

    def __init__(self):
        block = textured.pattern("waves", wavelength=2e-3)
        super().__init__({"hammer": textured.pattern(**RIDGES), "hammerblock": block}, "nail_link")
        pytest.importorskip("metaworld")
        gymnasium = pytest.importorskip("gymnasium")
        self.start(gymnasium.make("Meta-World/MT1", env_name="hammer-v3", seed=0))


class Hand(Gym):
    """The Shadow hand with touch sensors, which turns a textured block."""

    def __init__(self):
        super().__init__({"object": textured.pattern("waves", wavelength=1e-3)}, "floor0")
        gymnasium = pytest.importorskip("gymnasium")
        gymnasium.register_envs(pytest.importorskip("gymnasium_robotics"))
        name = "HandManipulateBlock_BooleanTouchSensors-v1"
        self.start(gymnasium.make(name).unwrapped)


class Manipulator(Client):
    """dm_control's arm with a ball, which steps through its own wrappers."""

    def __init__(self):
        super().__init__({"ball": textured.pattern("waves", wavelength=1e-3)}, "floor")
        suite = pytest.importorskip("dm_control.suite")
        self.env = suite.load("manipulator", "bring_ball", {"random": 0})
        self.env.reset()
        self.model, self.data = self.env.physics.model.ptr, self.env.physics.data.ptr

    def step(self):
        spec = self.env.action_spec()
        if self.env.step(self.random(spec.minimum, spec.maximum)).last():
            self.env.reset()


CLIENTS = [Wipe, Hammer, Hand, Manipulator]


def run(client, steps, textures=None):
    """Step a client with random actions; return its state and MuJoCo's warnings."""
    surfaces = None if textures is None else textured.attach(client.model, textures)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if surfaces is None:
            for _ in range(steps):
                client.step()
        else:
            with surfaces.installed():
                for _ in range(steps):
                    client.step()
    state = np.concatenate([client.data.qpos, client.data.qvel, client.data.qacc_warmstart])
    assert np.isfinite(state).all()
    return state, [w.number > 0 for w in client.data.warning], surfaces


@pytest.mark.parametrize("kind", CLIENTS)
def test_a_thousand_random_steps_with_texture(kind):
    _, plain, _ = run(kind(), 100)
    client = kind()
    _, rough, surfaces = run(client, STEPS, client.textures)
    assert not any(now and not before for now, before in zip(rough, plain, strict=True))
    assert surfaces.touched_pairs > 0 or kind in (Manipulator, Wipe)


@pytest.mark.parametrize("kind", CLIENTS)
def test_where_no_textured_pair_touches_the_state_is_the_same_to_the_bit(kind):
    without, _, _ = run(kind(), 80)
    for textures in (
        {name: textured.pattern("waves", amplitude=0.0) for name in kind().textures},
        {kind().far: textured.pattern("waves", wavelength=1e-3)},
    ):
        client = kind()
        state, _, surfaces = run(client, 80, textures)
        if surfaces.touched_pairs == 0:
            assert np.array_equal(state, without)
        else:
            assert "far" not in textures


def test_this_is_a_version_that_is_supported():
    assert tuple(map(int, mujoco.__version__.split(".")[:2])) >= (3, 3)
