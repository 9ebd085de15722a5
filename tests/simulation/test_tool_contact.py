"""The contact at a pose, and how its wrench changes with the pose."""

import numpy as np
import pytest

from asperity.contact.solver import ContactSolver
from asperity.geometry.poses import rotated
from asperity.geometry.rigid_body import centre_of_mass
from asperity.scene.builtin import load_scene, probe_plate
from asperity.simulation.anti_aliasing import LEAP
from asperity.simulation.simulation import Simulation
from asperity.simulation.tool_contact import BUDGET_SPENT, ToolContact

QUIET = {"anti_alias": "off"}
AXES = np.eye(6)


def moved(pose, step, centre):
    """Return a pose moved by a translation of its centre of mass and a turn about it."""
    out = rotated(pose, step[3:])
    out[:3] += centre_of_mass(pose, centre) + step[:3] - centre_of_mass(out, centre)
    return out


def pressed(scene, depth, tilt):
    """Return a stage, and a pose in which the probe is that deep in a plate without texture."""
    stage = ToolContact(scene)
    pose = rotated(np.array([0.0, 0.0, 1.5e-3 - depth, 1, 0, 0, 0]), tilt)
    stage.evaluate(pose)  # bristles begin here
    return stage, pose


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.2, -0.3, 0.1)])
def test_the_stiffness_is_the_derivative_of_the_wrench(tilt):
    """Shallow: of the Hessian, the term in proportion to the depth is left out."""
    scene = probe_plate({"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4})
    smooth = scene.changed(force=QUIET, bodies={"plate": {"texture": None}})
    stage, pose = pressed(smooth, 2e-6, tilt)
    contact = stage.evaluate(pose)
    assert contact.count == 1
    for axis in range(6):
        step = 5e-8 * AXES[axis] / (1.0 if axis < 3 else 0.07)
        ends = [
            stage.evaluate(moved(pose, sign * step, stage.engine.centre)).wrench
            for sign in (1.0, -1.0)
        ]
        slope = (ends[0] - ends[1]) / 2.0
        np.testing.assert_allclose(slope, -contact.stiffness @ step, atol=2e-4 * 400.0 * 5e-8)


def test_a_bristle_that_sticks_is_stiff_across_and_one_that_slips_is_not():
    scene = probe_plate().changed(
        force={**QUIET, "friction": 0.5, "bristle_stiffness": 900.0},
        bodies={"plate": {"texture": None}},
    )
    stage, pose = pressed(scene, 5e-4, (0.0, 0.0, 0.0))
    sticks = stage.evaluate(moved(pose, 1e-6 * AXES[0], stage.engine.centre))
    np.testing.assert_allclose(np.diag(sticks.stiffness)[:3], [900.0, 900.0, 400.0], rtol=1e-6)
    further = 2e-6 * AXES[0] + 1e-6 * AXES[1]
    after = stage.evaluate(moved(sticks.pose, further, stage.engine.centre))
    np.testing.assert_allclose(
        after.wrench, sticks.wrench - sticks.stiffness @ further, rtol=1e-3, atol=1e-7
    )
    slips = stage.evaluate(moved(pose, 1e-2 * AXES[0], stage.engine.centre))
    np.testing.assert_allclose(np.diag(slips.stiffness)[:3], [0.0, 0.0, 400.0], atol=1e-6)


@pytest.mark.parametrize("name", ["probe-plate-dots", "hammer-blocks"])
def test_the_stiffness_is_positive_semidefinite(name):
    scene = load_scene(name).changed(force={"friction": 0.0})
    simulation, stage = Simulation(scene), ToolContact(scene)
    for pose in simulation.trajectory().poses[:60:12]:
        contact = stage.evaluate(pose)
        values = np.linalg.eigvalsh(contact.stiffness)
        assert values[0] > -1e-9 * values[-1]
        np.testing.assert_allclose(contact.stiffness, contact.stiffness.T, atol=1e-12 * values[-1])
        trace = np.trace(contact.stiffness[:3, :3])
        assert trace >= 400.0 * (1 - 1e-9)  # k sum w |m|^2, |m| >= 1
        assert stage.energy > 0.0


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks"])
def test_direct_without_averaging_is_the_engine_itself(name):
    scene = load_scene(name).changed(force=QUIET)
    simulation = Simulation(scene)
    poses = simulation.trajectory().poses[:15]
    engine = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    for pose in poses:
        np.testing.assert_array_equal(simulation.step(pose), engine.wrench(pose, 1e-3))


def test_without_contact_there_is_neither_wrench_nor_stiffness():
    stage = ToolContact(probe_plate())
    contact = stage.evaluate(np.array([0, 0, 0.05, 1, 0, 0, 0.0]))
    assert contact.count == 0
    np.testing.assert_array_equal(contact.wrench, 0.0)
    np.testing.assert_array_equal(contact.stiffness, 0.0)
    assert stage.energy == 0.0


class Stopwatch:
    """A clock that goes on by `cost` at each evaluation of the engine it is tied to."""

    def __init__(self, cost):
        self.cost, self.time, self.evaluations = cost, 0.0, 0
        self.left = []

    def __call__(self):
        return self.time

    def tie_to(self, engine):
        ask = engine.wrench

        def wrench(pose, dt, seconds):
            self.left.append(seconds)
            self.time += self.cost
            self.evaluations += 1
            return ask(pose, dt)

        engine.wrench = wrench


def watched(friction, step):
    """Return a stage that has slid by steps along x [m], 0.1 ms an evaluation, and its clock.

    With them the pose of the next tick.
    """
    scene = probe_plate({"kind": "sinusoid", "wavelength": 5e-4, "amplitude": 5e-5})
    scene = scene.changed(force={"anti_alias": "tick", "friction": friction})
    watch = Stopwatch(1e-4)
    stage = ToolContact(scene, now=watch)
    watch.tie_to(stage.engine)
    pose = np.array([0.0, 0.0, 1.4e-3, 1, 0, 0, 0])
    for _ in range(6):
        stage.evaluate(pose)
        pose = pose + step * np.eye(7)[0]
    return stage, watch, pose


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("seconds", [0.0, 2.5e-4, 3.5e-4])
def test_sub_poses_keep_to_the_time_there_is(friction, seconds):
    """0.1 ms an evaluation: as many as fit, but always the pose itself; and the flag says so."""
    stage, watch, pose = watched(friction, 8e-4)
    before = watch.evaluations
    contact = stage.evaluate(pose, seconds=seconds, search_seconds=seconds)
    done = watch.evaluations - before
    assert done == max(1, int(seconds / watch.cost))
    # And a search has the time that those before it have left.
    assert watch.left[before:] == pytest.approx([seconds - n * watch.cost for n in range(done)])
    assert contact.flags & BUDGET_SPENT
    free = stage.evaluate(pose + 8e-4 * np.eye(7)[0])
    assert not free.flags & BUDGET_SPENT
    assert watch.left[-1] == np.inf


@pytest.mark.parametrize("turn", [0.0, 0.11])
def test_a_tool_placed_elsewhere_is_evaluated_once(turn):
    """First poses, and poses that no hand reaches in a tick: nothing to average over."""
    stage, watch, pose = watched(0.0, 1e-4)
    if turn == 0.0:
        stage.reset()
    before = watch.evaluations
    contact = stage.evaluate(rotated(pose, [0.0, 0.0, turn]))
    assert watch.evaluations == before + 1
    assert contact.count == 1
    assert contact.wrench[2] > 0.0
    assert not contact.flags


def test_one_that_takes_long_leaves_the_others_out_and_the_pose_itself_is_looked_at():
    """There is time for six. The first takes as long as five of them."""
    stage, watch, pose = watched(0.4, 1e-3)
    ask, begun, asked = stage.engine.wrench, watch.time, []

    def slow_at_first(at, dt, seconds):
        asked.append(at[0])
        watch.time += 0.0 if len(asked) > 1 else 4e-4
        return ask(at, dt, seconds)

    stage.engine.wrench = slow_at_first
    contact = stage.evaluate(pose, seconds=6.5e-4)
    assert len(asked) == 2
    assert asked[-1] == pytest.approx(6 * 1e-3)
    assert watch.time - begun == pytest.approx(6e-4)
    assert contact.flags & BUDGET_SPENT


@pytest.mark.parametrize("name", ["hammer-blocks", "probe-plate-dots"])
def test_contacts_are_those_of_the_last_pose_when_others_were_looked_at_after_it(name, monkeypatch):
    monkeypatch.setitem(LEAP, "tick", 0.01)  # so that intervals are halved
    scene = load_scene(name).changed(force={"anti_alias": "tick", "friction": 0.0})
    simulation, halved = Simulation(scene), 0
    solver = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    stage, asked = simulation.stage, []
    ask = stage.engine.wrench
    stage.engine.wrench = lambda pose, *rest: (asked.append(pose), ask(pose, *rest))[1]
    for pose in simulation.trajectory().poses[:150]:
        asked.clear()
        simulation.step(pose)
        if np.array_equal(asked[-1], pose):
            continue
        halved += 1
        solver.wrench(pose, 1e-3)
        n = stage.contact_count
        assert n == solver.contacts.count[0]
        np.testing.assert_array_equal(stage.contacts.normal[:n], solver.contacts.normal[:n])
        depth, gap = stage.contacts.depth[:n], solver.contacts.gap[:n]
        np.testing.assert_allclose(depth, solver.contacts.depth[:n], atol=1e-9 + 2.0 * gap.max())
        assert stage.energy == pytest.approx(solver.energy, rel=1e-3)
    assert halved >= 1


def test_what_there_was_no_room_for_is_told_without_a_contact_too():
    stage, statuses = ToolContact(probe_plate()), np.zeros(3, np.int64)
    stage.evaluate(np.array([0.0, 0.0, 0.1, 1, 0, 0, 0]))
    contacts = stage.engine.contacts
    assert contacts.count.tolist() == [0, 0]
    stage.count_statuses(statuses)
    assert statuses.tolist() == [0, 0, 0]
    contacts.count[:] = 0, 7
    stage.count_statuses(statuses)
    assert statuses.tolist() == [0, 0, 1]
    contacts.count[:] = 2, 7
    contacts.status[:2] = 1, 2
    stage.count_statuses(statuses)
    assert statuses.tolist() == [0, 1, 2]
