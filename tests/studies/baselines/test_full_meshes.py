"""Penalty contact of displaced meshes through python-fcl."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.studies.baselines import METHODS
from asperity.studies.baselines.full_meshes import FullMeshMethod
from asperity.studies.comparison import stimuli
from asperity.studies.comparison.properties import tangential_rms

pytest.importorskip("fcl")


def path(scene, height):
    poses = stimuli.straight_path(scene, 0.25)
    poses[:, 2] += height
    return poses


def test_it_gives_asperitys_force_by_another_way():
    scene = stimuli.ball_on_plate()
    poses = path(scene, -2e-4)
    own = METHODS["asperity"].prepare(scene)
    theirs = FullMeshMethod(points=60_000).prepare(scene)
    both = [(own.wrench(pose), theirs.wrench(pose)) for pose in poses]
    off = [abs(a.depth - b.depth) for a, b in both]
    assert max(off) < 5e-6
    a, b = (np.array([pair[k].force for pair in both]) for k in (0, 1))
    assert tangential_rms(a - b) < 0.2 * tangential_rms(a)


def test_a_flat_foot_on_a_smooth_plate_is_as_deep_as_it_is_moved():
    scene = stimuli.foot_on_plate().changed(bodies={"plate": {"texture": None}})
    renderer = FullMeshMethod(points=5_000).prepare(scene)
    pose = scene.start.copy()
    assert renderer.wrench(pose).contacts == 0
    for depth in (1e-4, 3e-4, 2e-4):
        pose[2] = scene.start[2] - 2e-4 - depth
        felt = renderer.wrench(pose)
        assert felt.depth == pytest.approx(depth, abs=2e-6)
        np.testing.assert_allclose(felt.force, [0.0, 0.0, scene.force.stiffness * depth], atol=0.02)
        # Felt under its middle, as well as so coarse a mesh has it: within a quarter of the foot.
        assert np.abs(felt.torque).max() < 0.25 * stimuli.FOOT[0] * felt.force[2]


def test_the_search_takes_up_where_it_was_and_finds_the_same():
    scene = stimuli.ball_on_plate()
    poses = path(scene, -2e-4)
    renderer = FullMeshMethod(points=20_000).prepare(scene)
    going = [renderer.wrench(pose).depth for pose in poses]
    anew = []
    for pose in poses:
        renderer.reset()
        anew.append(renderer.wrench(pose).depth)
    np.testing.assert_allclose(going, anew, atol=2e-6)
