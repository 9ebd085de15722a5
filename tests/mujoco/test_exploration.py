"""The environment keeps Gymnasium's rules, and what it feels tells textures apart."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from asperity import AsperityError

gymnasium = pytest.importorskip("gymnasium")
exploration = pytest.importorskip("asperity.mujoco.exploration")
ROOT = Path(__file__).parents[2]


def test_gymnasiums_own_checks():
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make(exploration.ID).unwrapped, skip_render_check=True)


def test_an_episode_ends_with_the_reward_of_the_guess():
    env = exploration.TextureExploration()
    for guess, reward in ((2, 1.0), (1, 0.0)):
        env.reset(seed=1, options={"texture": "bumps"})
        action = np.zeros(6)
        action[2 + guess] = 1.0
        steps = [env.step(action) for _ in range(exploration.ACTIONS)]
        assert [bool(step[2]) for step in steps] == [False] * (exploration.ACTIONS - 1) + [True]
        assert steps[-1][1] == reward
        assert sum(step[1] for step in steps[:-1]) == 0.0
        assert steps[-1][4] == {"texture": "bumps"}


def test_what_is_refused():
    with pytest.raises(AsperityError, match="two textures at least"):
        exploration.TextureExploration({})
    with pytest.raises(AsperityError, match="no texture 'silk'"):
        exploration.TextureExploration().reset(options={"texture": "silk"})


def test_the_example_beats_chance_by_far():
    path = ROOT / "examples" / "06_tell_textures_apart.py"
    done = subprocess.run(
        [sys.executable, str(path), "--strokes", "6"], capture_output=True, text=True, check=True
    )
    share = int(re.match(r"(\d+)%", done.stdout)[1])
    assert share >= 75, done.stdout
