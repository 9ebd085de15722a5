"""The account of energy at the hand, and what keeps it in credit."""

import numpy as np
import pytest

from asperity.dynamics.passivity.controller import PassivityController
from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene, probe_plate
from asperity.scene.trajectory import ScriptedMotion
from asperity.simulation.simulation import Simulation

DT = 1e-3


def bounce(stiffness, controller, *, damping, mass=0.05, seconds=0.5, speed=0.1, push=0.0):
    """Let a mass fly into a sampled wall; return its places and the energy it gained at most.

    The mass is moved exactly while a force is held, in 20 parts of a tick for its damping.
    """
    x, v, last, places, work, most = 1e-3, -speed, 1e-3, [], 0.0, 0.0
    for _ in range(round(seconds / DT)):
        wrench, twist = np.zeros(6), np.zeros(6)
        wrench[2] = -stiffness * min(x, 0.0)
        twist[2] = (x - last) / DT
        force = controller.correct(wrench, twist)[2]
        last = x
        for _ in range(20):
            a = (force - damping * v - push) / mass
            x, v = x + v * DT / 20 + 0.5 * a * (DT / 20) ** 2, v + a * DT / 20
        work += force * (x - last)
        most = max(most, work)
        places.append(x)
    return np.array(places), most


def test_the_account_is_the_work_of_the_held_wrench():
    rng, controller = np.random.default_rng(2), PassivityController(DT, active=False)
    wrench, twist = rng.normal(size=(50, 6)), rng.normal(size=(50, 6))
    for w, v in zip(wrench, twist, strict=True):
        np.testing.assert_array_equal(controller.correct(w, v), w)
    work = np.cumsum(np.einsum("ij,ij->i", wrench[:-1], twist[1:])) * DT
    assert controller.energy == pytest.approx(-work[-1], rel=1e-12)
    assert controller.gained == pytest.approx(max(work.max(), 0.0), rel=1e-12)
    rotations = -np.einsum("ij,ij->", wrench[:-1, 3:], twist[1:, 3:]) * DT
    assert controller.parts[1] == pytest.approx(rotations, rel=1e-12)
    assert controller.interventions == 0


@pytest.mark.parametrize("stiffness", [2000.0, 10000.0])
def test_an_active_wall_is_held_back(stiffness):
    """K T / 2 is 1 and 5 N s/m, the mass has 0.05: pressed on it, it bounces ever higher."""
    watch, keep = PassivityController(DT, active=False), PassivityController(DT)
    loose, gained = bounce(stiffness, watch, damping=0.05, push=0.3, seconds=1.0)
    kept, left = bounce(stiffness, keep, damping=0.05, push=0.3, seconds=1.0)
    assert watch.gained == pytest.approx(gained, rel=1e-6)
    assert gained > 1e-3
    assert watch.interventions == 0
    assert keep.interventions > 0
    assert left <= 1e-6
    assert keep.gained == pytest.approx(left, abs=1e-12)
    assert np.ptp(loose[-200:]) > 3.0 * np.ptp(kept[-200:])
    assert keep.dissipated > 0.0


def test_a_passive_wall_is_left_alone():
    """With the device's own damping counted, above K T / 2: Colgate's bound holds."""
    controller = PassivityController(DT, damping=1.0)
    places, _ = bounce(400.0, controller, damping=1.0, push=0.3)
    assert places.min() < -1e-4
    assert controller.interventions == 0
    assert controller.energy > 0.0


def test_a_coupled_tool_is_passive_by_itself():
    scene = probe_plate().changed(coupling={"mode": "implicit"})
    simulation = Simulation(scene)
    motion = ScriptedMotion("press-and-slide", seconds=1.0)
    controller = PassivityController(simulation.dt)
    simulation.rollout(motion, hand=simulation.hand(motion), controller=controller)
    assert controller.interventions == 0
    assert controller.gained == 0.0
    assert controller.energy > 0.0


def test_nothing_is_gained_from_a_plate_that_is_late():
    """Direct, averaged over the tick: half a tick late, it gives energy."""
    simulation = Simulation(probe_plate())
    motion = ScriptedMotion("press-and-slide", seconds=1.0)
    hand = simulation.hand(motion)
    watch, keep = PassivityController(DT, active=False), PassivityController(DT)
    simulation.rollout(motion, hand=hand, controller=watch)
    simulation.rollout(motion, hand=hand, controller=keep)
    assert watch.gained > 1e-5
    assert keep.gained == 0.0
    assert keep.interventions > 0


def test_energy_follows_what_the_contacts_store():
    """Sampling uses up what the hand has paid; without a reference, all of it goes."""
    simulation = Simulation(probe_plate())
    motion = ScriptedMotion("slide", seconds=6.0)
    controller, lacking = PassivityController(DT), []

    def look(_, __):
        lacking.append(simulation.stage.energy - controller.energy)

    out = simulation.rollout(
        motion, hand=simulation.hand(motion), controller=controller, on_tick=look
    )
    stored = simulation.stage.energy
    assert max(lacking) < 0.2 * stored
    assert np.ptp(out.tool_pose[1000:, 2]) < 1e-4
    pushed = out.device_wrench[:, :3] - out.contact_wrench[:, :3]
    assert np.sqrt(np.mean(pushed**2)) < 0.02


def test_what_limits_keep_from_the_hand_is_not_owed_to_it():
    """Pressed with half of its force, a spring may give back half of its energy."""
    controller, wrench, twist = PassivityController(DT, active=False), np.zeros(6), np.zeros(6)
    twist[2] = -1e-5 / DT
    for depth in np.linspace(1e-5, 1e-3, 100):
        wrench[2] = 400.0 * depth
        controller.correct(wrench, twist, stored=200.0 * depth**2)
        controller.sent(0.5 * wrench)
    assert float(controller._account["owed"]) == pytest.approx(0.5 * 200.0 * 1e-6, rel=0.03)
    assert controller.energy == pytest.approx(0.5 * 200.0 * 1e-6, rel=0.03)


def test_a_contact_that_is_faded_in_is_granted_its_energy():
    controller = PassivityController(DT)
    wrench, rest = np.array([0, 0, 0.6, 0, 0, 0]), np.zeros(6)
    controller.correct(wrench, rest, stored=4e-4)
    controller.grant(4e-4)
    controller.grant(4e-4)
    assert controller.energy == controller.summary()["granted_j"] == 4e-4
    controller.grant(np.nan)
    assert controller.energy == 4e-4
    np.testing.assert_array_equal(controller.correct(wrench, rest, stored=4e-4), wrench)


def test_a_correction_never_adds_to_what_pushes_and_stays_finite():
    rng, controller = np.random.default_rng(7), PassivityController(DT)
    for _ in range(300):
        wrench, twist = rng.normal(size=6), rng.normal(size=6) * 10.0 ** rng.uniform(-12, 2)
        out = controller.correct(wrench, twist).copy()
        assert np.isfinite(out).all()
        if controller.energy >= 0.0:
            for half in (slice(0, 3), slice(3, 6)):
                assert np.linalg.norm(out[half]) <= np.linalg.norm(wrench[half]) + 1e-12
        else:
            bound = np.linalg.norm(wrench) + 10.0 * np.linalg.norm(twist[:3])
            assert np.linalg.norm(out[:3]) <= bound


def test_what_limits_made_of_a_wrench_is_accounted():
    controller = PassivityController(DT, active=False)
    wrench, twist = np.array([0, 0, 5.0, 0, 0, 0]), np.array([0, 0, 0.1, 0, 0, 0])
    controller.correct(wrench, twist)
    controller.sent(0.5 * wrench)
    controller.correct(wrench, twist)
    assert controller.energy == pytest.approx(-2.5 * 0.1 * DT)


def test_what_went_in_and_what_came_out_are_counted_for_each_half():
    controller = PassivityController(DT, active=False)
    wrench = np.array([0, 0, 2.0, 0, 0.1, 0])
    for down, turn in ((-0.1, 3.0), (-0.1, 3.0), (0.05, -1.0)):
        controller.correct(wrench, np.array([0, 0, down, 0, turn, 0]))
    # The first tick held nothing yet.
    np.testing.assert_allclose(controller.put_in, [2.0 * 0.1 * DT, 0.1 * 1.0 * DT])
    np.testing.assert_allclose(controller.got_out, [2.0 * 0.05 * DT, 0.1 * 3.0 * DT])
    told = controller.summary()
    assert told["energy_j"] == pytest.approx(sum(told["put_in_j"]) - sum(told["got_out_j"]))
    controller.reset()
    assert controller.put_in.tolist() == controller.got_out.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_numbers_out_of_this_world_do_not_spoil_the_account(bad):
    controller, wrench, twist = PassivityController(DT), np.ones(6), np.full(6, 0.1)
    for w, v in ((wrench, twist), (bad * wrench, twist), (wrench, bad * twist), (wrench, twist)):
        controller.correct(w, v)
    assert np.isfinite(controller.energy)
    assert np.isfinite(controller.correct(wrench, twist)).all()


def test_wrong_settings_are_refused():
    with pytest.raises(AsperityError, match="max_damping"):
        PassivityController(DT, max_damping=-1.0)
    with pytest.raises(AsperityError, match="dt must lie between"):
        PassivityController(0.0)


def test_a_tool_on_a_coupling_recovers_from_late_ticks():
    """One tick in seven is late by up to 6 ms for a second, and the coupling holds up to 10 N."""
    scene = load_scene("probe-plate-dots").changed(
        coupling={"mode": "implicit"},
        trajectory={"kind": "slide", "seconds": 3.5, "speed": 0.01, "press_force": 0.8},
    )
    simulation, rng = Simulation(scene), np.random.default_rng(1)
    hand, tool, controller = simulation.hand(), simulation.tool, PassivityController(DT)
    last, passed, tick, late = hand.pose.copy(), 1, 0, []
    while tick < 3500:
        pose = hand.pose.copy()
        wrench = simulation.step(pose, hand.twist)
        before = controller.interventions
        felt = controller.correct(wrench, tool.port_twist(last, pose) / passed, passed * DT).copy()
        held = tool.energy + simulation.stage.energy
        if controller.interventions > before:
            controller.forgive(held, passed * DT)
        is_late = 500 < tick < 1500 and rng.random() < 0.15
        last, passed = pose, 1 + int(is_late) * int(rng.integers(1, 7))
        for _ in range(passed):
            hand.advance(felt)
        tick += passed
        if tick > 2500:
            late.append((held, controller.interventions - before))
    held, corrections = np.array(late).T
    assert corrections.sum() == 0
    assert held.max() < 1e-3
