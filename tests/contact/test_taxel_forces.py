"""Contacts of a rigid tool spread over taxels: sum and moment are the wrench's."""

import numpy as np
import pytest

from asperity.contact.solver import ContactSolver
from asperity.contact.taxel_forces import TaxelForces
from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_of
from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks", "file-cad"])
def test_sum_and_moment_are_the_wrench(name):
    scene = load_scene(name)
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    pose = touching_pose(solver, np.array(scene.start))
    pose[2] -= 1e-4
    wrench = np.array(solver.wrench(pose, 1e-3))
    assert np.abs(wrench).max() > 0.01
    turn, count = rotation_of(pose[3:]), int(solver.contacts.count[0])
    low = (solver.contacts.point[:count] - pose[:3]) @ turn
    across = np.linspace(-0.01, 0.01, 9)
    x, y = np.meshgrid(across, across)
    grid = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3) + low.mean(axis=0)
    forces = TaxelForces(grid).of_tool(pose, solver.contacts, wrench, solver.centre)
    centre = pose[:3] + turn @ solver.centre
    arms = grid @ turn.T + pose[:3] - centre
    total = np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])
    np.testing.assert_allclose(total, wrench, atol=1e-9 * np.abs(wrench).max())


def test_without_contact_there_is_none():
    scene = load_scene("probe-plate")
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    pose = np.array([0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])
    wrench = solver.wrench(pose, 1e-3)
    grid = np.random.default_rng(0).normal(size=(12, 3))
    assert not TaxelForces(grid).of_tool(pose, solver.contacts, wrench, solver.centre).any()


@pytest.mark.parametrize(
    "places", [[[0, 0, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[np.nan] * 3] * 4]
)
def test_places_that_cannot_be_used(places):
    with pytest.raises(AsperityError, match="places of taxels must be"):
        TaxelForces(places)
