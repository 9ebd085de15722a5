"""A hand that nobody has, and the device that it holds."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.errors import AsperityError
from asperity.geometry.poses import rotated, rotation_between
from asperity.geometry.rigid_body import centre_of_mass
from asperity.realtime.devices.protocol import Device, Limits, Reading
from asperity.realtime.devices.simulated import SimulatedDevice
from asperity.scene.builtin import probe_plate
from asperity.scene.trajectory import ScriptedMotion
from asperity.simulation.simulation import Simulation

START = np.array([0.1, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0])
CENTRE = np.array([0.01, 0.0, 0.05])


def still(_):
    return START


def test_a_held_force_moves_it_as_eq_7_says():
    hand = SimulatedHand(still, centre=CENTRE)
    force, numbers = np.array([0.3, -0.2, 0.5]), Hand()
    begin = centre_of_mass(START, CENTRE)
    for _ in range(40):
        hand.advance(np.append(force, np.zeros(3)))

    def rates(_, y):
        pull = force - numbers.stiffness * y[:3] - numbers.damping * y[3:]
        return np.append(y[3:], pull / numbers.mass)

    exact = solve_ivp(rates, (0, 0.04), np.zeros(6), rtol=1e-10, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(centre_of_mass(hand.pose, CENTRE) - begin, exact[:3], rtol=1e-7)
    np.testing.assert_allclose(hand.twist[:3], exact[3:], rtol=1e-7)


def test_a_torque_turns_it_about_its_centre_of_mass():
    settings = HandSettings()
    hand = SimulatedHand(still, settings, centre=CENTRE)
    torque = np.array([0.02, -0.01, 0.03])
    for _ in range(1500):
        hand.advance(np.append(np.zeros(3), torque))
    turn = rotation_between(START, hand.pose)
    np.testing.assert_allclose(turn, torque / settings.rotational_stiffness, rtol=1e-6)
    np.testing.assert_allclose(
        centre_of_mass(hand.pose, CENTRE), centre_of_mass(START, CENTRE), atol=1e-12
    )


def test_free_it_follows_its_target_exactly():
    def target(t):
        return rotated(START + np.append([0.1 * t, 0.0, 0.0], np.zeros(4)), (0.0, 0.0, 2.0 * t))

    hand = SimulatedHand(target, centre=CENTRE)
    for _ in range(100):
        hand.advance(np.zeros(6))
    np.testing.assert_allclose(hand.pose, target(0.1), atol=1e-5)
    np.testing.assert_allclose(hand.twist[3:], [0, 0, 2.0], atol=1e-3)


@pytest.mark.parametrize("mode", ["direct", "implicit", "static"])
def test_the_pressing_force_is_reached_and_kept(mode):
    simulation = Simulation(probe_plate().changed(coupling={"mode": mode}))
    motion = ScriptedMotion(seconds=1.4)
    rollout = simulation.rollout(motion, hand=simulation.hand(motion))
    felt = rollout.device_wrench[:, 2]
    assert felt[900:].mean() == pytest.approx(motion.press_force, rel=0.03)


def test_a_hand_comes_to_press_while_its_device_comes_up():
    """Leant on from the first tick, a surface that pushes softly at first is fallen through."""
    motion, soft = ScriptedMotion(seconds=1.2), 0.25

    def largest(press_in):
        simulation = Simulation(probe_plate().changed(coupling={"mode": "implicit"}))
        hand = simulation.hand(motion, press_in=press_in)
        pushed = []
        for tick in range(1200):
            wrench = simulation.step(hand.pose)
            pushed.append(wrench[2])
            hand.advance(min(1.0, tick * 1e-3 / soft) * wrench)
        return np.array(pushed)

    fallen, eased = largest(0.0), largest(soft)
    late = slice(900, None)
    assert eased[late].mean() == pytest.approx(motion.press_force, rel=0.03)
    settled = eased[late].max()
    assert fallen[:300].max() > 1.5 * settled
    assert eased[:300].max() < 1.2 * settled


def test_without_a_wanted_force_it_does_not_press():
    hand = SimulatedHand(still, HandSettings(press_force=None))
    assert hand.offset == 0.0
    for _ in range(10):
        hand.advance(np.array([0, 0, 0.5, 0, 0, 0]))
    assert hand.offset == 0.0
    eager = SimulatedHand(still, HandSettings(press_force=0.6))
    assert eager.offset == pytest.approx(0.6 / 300.0)
    for _ in range(50):
        eager.advance(np.zeros(6))  # in the air it does not push on and on
    assert eager.offset == pytest.approx(0.6 / 300.0)


def test_a_session_through_the_device_is_the_same_as_without():
    """One loop over the protocol, its clock turned by hand; one without device. No difference."""
    now = [0.0]
    a, b = SimulatedHand(still, centre=CENTRE), SimulatedHand(still, centre=CENTRE)
    device: Device = SimulatedDevice(a, clock=lambda: now[0])
    device.open()
    reading = Reading.empty()
    rng = np.random.default_rng(1)
    assert not device.read(reading)
    for _ in range(200):
        force = 0.5 * rng.normal(size=3)
        arm = centre_of_mass(reading.pose, CENTRE) - reading.pose[:3]
        device.write(np.append(force, np.cross(arm, force)))  # a force at the centre of mass
        b.advance(np.append(force, np.zeros(3)))
        now[0] += 1e-3
        assert device.read(reading)
        np.testing.assert_allclose(reading.pose, b.pose, atol=1e-12)
        np.testing.assert_allclose(reading.twist, b.twist, atol=1e-9)
    device.close()
    device.close()
    assert not device.read(reading)
    assert reading.error


def test_the_device_cuts_what_is_too_much_and_ignores_what_is_no_number():
    now = [0.0]
    limits = Limits(max_force=2.0, max_torque=0.0, max_stiffness=400.0, max_damping=4.0)
    device = SimulatedDevice(SimulatedHand(still), limits=limits, clock=lambda: now[0])
    device.open()
    device.write(np.array([0, 0, 50.0, 9.0, 0, 0]))
    device.write(np.full(6, np.nan))
    now[0] = 0.5
    reading = Reading.empty()
    device.read(reading)
    assert reading.pose[2] - START[2] == pytest.approx(2.0 / 300.0, rel=1e-3)
    np.testing.assert_array_equal(reading.pose[3:], START[3:])


def test_a_long_pause_is_not_made_up_for_in_full():
    now = [0.0]
    hand = SimulatedHand(still)
    device = SimulatedDevice(hand, clock=lambda: now[0])
    device.open()
    now[0] = 3600.0
    assert device.read(Reading.empty())
    assert hand.time == pytest.approx(1.0)
    now[0] += 1e-3
    device.read(Reading.empty())
    assert hand.time == pytest.approx(1.001)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"moment": 0.0}, "moment"),
        ({"press_force": -1.0}, "press_force"),
        ({"normal": (0.0, 0.0, 0.0)}, "normal"),
        ({"press_time": np.inf}, "press_time"),
        ({"press_in": -0.1}, "press_in"),
    ],
)
def test_wrong_settings_are_refused(options, said):
    with pytest.raises(AsperityError, match=said):
        HandSettings(**options)
