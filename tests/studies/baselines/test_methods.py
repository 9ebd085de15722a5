"""What every method promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asperity.contact.solver import ContactSolver
from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.studies.baselines import METHODS, choose_methods, voxmap
from asperity.studies.comparison import stimuli

SLOW_TO_PREPARE = {"voxmap-full", "full-meshes"}


@pytest.mark.parametrize("name", [name for name in METHODS if name not in SLOW_TO_PREPARE])
def test_the_same_poses_after_reset_give_the_same_wrenches(name):
    scene = stimuli.ball_on_plate()
    method = METHODS[name]
    if method.can(scene):
        pytest.skip(method.can(scene))
    renderer = method.prepare(scene)
    poses = stimuli.straight_path(scene, 0.4)
    poses[:, 2] -= 3e-4
    laps = []
    for _ in range(2):
        renderer.reset()
        laps.append([renderer.wrench(pose) for pose in poses])
    for one, other in zip(*laps, strict=True):
        np.testing.assert_array_equal(one.force, other.force)
        np.testing.assert_array_equal(one.torque, other.torque)
    assert laps[0][0].force is not laps[0][1].force


@pytest.mark.parametrize("name", list(METHODS))
def test_each_says_where_it_comes_from_and_what_it_is_not(name):
    method = METHODS[name]
    assert method.name == name
    assert any(character.isdigit() for character in method.source)
    assert len(method.what_it_is_not) > 30


def test_asperitys_own_is_the_engine():
    scene = stimuli.ball_on_plate()
    engine = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    pose = scene.start.copy()
    pose[:3] += [0.3e-3, 0.0, -3e-4]
    felt = METHODS["asperity"].prepare(scene).wrench(pose)
    np.testing.assert_array_equal(np.concatenate([felt.force, felt.torque]), engine.wrench(pose, 0))


def test_a_law_of_one_point_refuses_meshes_in_one_line():
    scene = load_scene("hammer-blocks")
    reason = METHODS["minsky"].can(scene)
    assert reason is not None
    assert "is a mesh" in reason
    with pytest.raises(AsperityError, match="Minsky cannot render scene 'hammer-blocks'"):
        METHODS["minsky"].prepare(scene)


def test_an_unknown_method_is_refused_with_the_valid_ones():
    with pytest.raises(AsperityError, match=r"unknown method 'minski' .did you mean 'minsky'"):
        choose_methods(["minski"])
    assert [method.name for method in choose_methods(["ho", "asperity", "ho"])] == [
        "asperity",
        "ho",
    ]


def test_a_voxmap_feels_the_relief_that_its_voxels_resolve():
    scene = stimuli.ball_on_plate()
    poses = stimuli.straight_path(scene, 0.25)
    poses[:, 2] -= 2.5e-4
    along = []
    for smooth in (False, True):
        method = replace(voxmap.FULL, smooth=smooth, size=6e-5)
        renderer = method.prepare(scene)
        forces = np.array([renderer.wrench(pose).force for pose in poses])
        along.append(float(np.ptp(forces[:, 0]) / forces[:, 2].mean()))
    assert along[0] > 3.0 * along[1]
