"""Many poses at once: what one pose after the other gives, on any number of threads."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from asperity import AsperityError, ContactSolver, load_scene


def solver_of(name: str) -> tuple[ContactSolver, np.ndarray]:
    """Return the solver of a built-in scene, and poses of its tool above, on and in the bodies."""
    scene = load_scene(name)
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    rng = np.random.default_rng(0)
    poses = np.tile(scene.start, (160, 1))
    poses[:, :2] += rng.uniform(-1e-3, 1e-3, (160, 2))
    poses[:, 2] += rng.uniform(-2e-3, 2e-3, 160)
    turned = poses[:, 3:] + rng.normal(0.0, 0.02, (160, 4))
    poses[:, 3:] = turned / np.linalg.norm(turned, axis=1)[:, None]
    return solver, poses


@pytest.mark.parametrize("name", ["probe-plate-dots", "hammer-blocks"])
def test_as_one_pose_after_the_other(name):
    solver, poses = solver_of(name)
    wanted, sure = [], []
    for pose in poses:
        solver.reset()
        wanted.append(solver.wrench(pose, 0.0).copy())
        count, dropped = solver.contacts.count
        sure.append(dropped == 0 and not solver.contacts.status[:count].any())
    certified = np.zeros(len(poses), bool)
    for threads in (1, 2, 3):
        found = solver.wrenches(poses, threads=threads, certified=certified)
        np.testing.assert_array_equal(found, wanted)
        np.testing.assert_array_equal(certified, sure)
    assert 10 < np.any(found, axis=1).sum() < len(poses)


def test_the_solver_goes_on_from_its_own_pose():
    solver, poses = solver_of("probe-plate")
    pressed = poses[np.argmin(poses[:, 2])]
    before = solver.wrench(pressed, 1e-3).copy()
    solver.wrenches(poses)
    assert solver.contacts.count[0] > 0
    np.testing.assert_allclose(solver.wrench(pressed, 1e-3), before, rtol=1e-9, atol=1e-12)


def test_a_change_of_stiffness_counts_for_many_poses_too():
    solver, poses = solver_of("probe-plate")
    one = solver.wrenches(poses)
    solver.change(replace(solver.settings, stiffness=3.0 * solver.settings.stiffness))
    np.testing.assert_allclose(solver.wrenches(poses), 3.0 * one, rtol=1e-12)


def test_depths_that_are_not_certified_are_told(caplog):
    scene = load_scene("probe-plate-dots").changed(force={"max_nodes": 100, "tolerance": 1e-12})
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    pose = scene.start.copy()
    pose[2] -= 1e-3
    tilted = np.array([*pose[:3], *np.array([0.9, 0.4, 0.1, 0.0]) / np.sqrt(0.98)])
    with caplog.at_level(logging.WARNING):
        solver.wrenches([pose, tilted])
    assert "of 2 poses have a depth that is not certified" in caplog.text


def test_poses_of_another_shape_are_refused():
    solver, poses = solver_of("probe-plate")
    with pytest.raises(AsperityError, match="rows of 7"):
        solver.wrenches(poses[0])
    with pytest.raises(AsperityError, match="finite"):
        solver.wrenches(np.full((2, 7), np.nan))
    with pytest.raises(AsperityError, match="threads"):
        solver.wrenches(poses, threads=0)
    assert solver.wrenches(np.empty((0, 7))).shape == (0, 6)
