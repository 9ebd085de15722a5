"""A mouse's hand: its pointer's steps are not felt as texture; motions; who holds the tool."""

import numpy as np
import pytest
from dragged import SPEED, dragged, in_band, smooth_plate

from asperity.errors import AsperityError
from asperity.realtime.devices.catalogue import device
from asperity.realtime.devices.mouse import FASTEST, LONGEST, MouseDevice, SmoothedTarget
from asperity.realtime.devices.pointer_file import MAX_POSES, PointerFile
from asperity.realtime.devices.protocol import Reading
from asperity.scene.builtin import load_scene
from asperity.viewer.motions import CannedMotion, motion_table
from asperity.viewer.panels.mouse import CONTROL_TIMEOUT, Holder, _near_tool

ORIGIN = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def at(x=0.0, z=0.0, angle=0.0):
    return np.array([x, 0.0, z, np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def test_steps_of_a_dragged_pointer_are_not_felt_as_texture(tmp_path):
    textured = load_scene("probe-plate").changed(coupling={"mode": "implicit"})
    texture, _ = dragged(tmp_path, "texture", scene=textured)
    for number, message in enumerate(({}, {"jitter": 0.01}, {"rate": 20.0})):
        force, acceleration = dragged(tmp_path, f"smooth-{number}", scene=smooth_plate(), **message)
        assert in_band(force) < 0.05 * in_band(texture), message
        assert np.abs(acceleration).max() < 1.0


def test_an_even_drag_comes_out_even():
    led = SmoothedTarget(ORIGIN, 1e-3)
    x = []
    for tick in range(1500):
        if tick % 16 == 0:
            led.lead_to(at(x=0.05e-3 * tick))
        x.append(led.advance()[0])
    speed = np.diff(x[700:]) / 1e-3
    np.testing.assert_allclose(speed, 0.05, rtol=1e-6)


def test_a_target_goes_straight_no_faster_than_allowed_and_arrives():
    led = SmoothedTarget(ORIGIN, 1e-3)
    led.lead_to(at(x=0.3, z=-0.1, angle=2.0))
    path = np.array([led.advance().copy() for _ in range(1200)])
    speed = np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1) / 1e-3
    assert speed.max() <= FASTEST * (1 + 1e-9)
    np.testing.assert_allclose(path[-1], at(x=0.3, z=-0.1, angle=2.0), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(path[:, 3:], axis=1), 1.0)
    assert np.abs(np.diff(path[:, 0], 2)).max() / 1e-6 < 60.0  # no jerks [m/s^2]


def test_a_hand_presses_with_the_force_that_was_chosen_and_lets_go(tmp_path):
    """Against a stiff floor at z = 0, from 2 mm above it and from 3 mm too deep."""
    for name, z in (("above", 2e-3), ("deep", -3e-3)):
        pointer, now, reading = PointerFile(tmp_path / name, at(z=z)), [0.0], Reading.empty()
        pointer.point(at(z=z), press=0.8)
        hand = MouseDevice(tmp_path / name, clock=lambda now=now: now[0])
        hand.open()
        force = 0.0
        for tick in range(4000):
            now[0] = 1e-3 * (tick + 1)
            hand.read(reading)
            force = max(0.0, -400.0 * reading.pose[2] - 4.0 * reading.twist[2])
            hand.write(np.array([0.0, 0.0, force, 0.0, 0.0, 0.0]))
            if tick == 2700:
                assert force == pytest.approx(0.8, rel=0.02), name
                pointer.point(at(z=2e-3))
        assert force == 0.0


def test_a_loop_that_was_late_is_not_late_because_of_that(tmp_path):
    PointerFile(tmp_path / "p", ORIGIN)
    now = [0.0]
    hand = MouseDevice(tmp_path / "p", clock=lambda: now[0])
    hand.open()
    now[0] = 5.0
    assert hand.read(Reading.empty())
    assert hand.hand.time == pytest.approx(LONGEST)


def test_the_last_word_is_taken_whole_and_once(tmp_path):
    above = PointerFile(tmp_path / "p", ORIGIN)
    below = PointerFile(tmp_path / "p")
    assert below.news().table is None
    assert below.news() is None
    above.point(at(x=1.0), press=0.5)
    above.point(at(x=2.0), press=0.7)
    message = below.news()
    assert (message.pose[0], message.press) == (2.0, 0.7)
    poses = np.repeat(ORIGIN[None], 5, axis=0)
    above.move(poses, loop=1, step=1e-3, begun=3.0)
    message = below.news()
    assert (len(message.table), message.loop, message.step, message.begun) == (5, 1, 1e-3, 3.0)
    assert message.press is None
    with pytest.raises(AsperityError, match=f"valid: 1 to {MAX_POSES}"):
        above.move(np.zeros((MAX_POSES + 1, 7)), loop=0, step=1e-3, begun=0.0)
    with pytest.raises(AsperityError, match="no pointer file at"):
        PointerFile(tmp_path / "none")


def test_a_mouse_without_a_page_says_what_to_do():
    with pytest.raises(AsperityError, match="asperity view SCENE"):
        device("mouse").open()


@pytest.mark.parametrize("kind", ["slide", "circle"])
def test_a_motion_goes_round_without_a_jump(kind):
    made = motion_table(CannedMotion(kind, SPEED, 0.02, 0.7), at(x=0.01, z=0.03))
    assert len(made.poses) <= MAX_POSES
    np.testing.assert_allclose(made.poses[0], at(x=0.01, z=0.03), atol=1e-15)
    np.testing.assert_allclose(made.poses[-1], made.poses[made.loop], atol=1e-9)
    around = np.concatenate([made.poses[made.loop : -1], made.poses[made.loop :]])
    speed = np.linalg.norm(np.diff(around[:, :3], axis=0), axis=1) / made.step
    assert speed.max() == pytest.approx(SPEED, rel=1e-2)
    assert np.abs(np.diff(speed)).max() < 0.1 * SPEED
    assert np.ptp(made.poses[:, 2]) == 0.0
    slow = motion_table(CannedMotion(kind, 1e-3, 0.2), ORIGIN)  # long: in coarser steps
    assert len(slow.poses) <= MAX_POSES


@pytest.mark.parametrize(
    ("motion", "why"),
    [
        ({"kind": "jump"}, "unknown motion 'jump'"),
        ({"speed": 9.0}, "speed must lie between"),
        ({"length": 0.0}, "length must lie between"),
        ({"direction": float("nan")}, "direction must lie between"),
    ],
)
def test_motions_out_of_range_are_refused(motion, why):
    with pytest.raises(AsperityError, match=why):
        CannedMotion(**motion)


def test_one_tab_holds_the_tool_until_it_rests_is_closed_or_another_takes_it():
    holder = Holder()
    assert holder.may(1, 0.0)
    assert not holder.may(2, 1.0)
    assert holder.may(1, 2.0)
    assert not holder.may(2, 2.0 + 0.9 * CONTROL_TIMEOUT)
    assert holder.may(2, 2.0 + 1.1 * CONTROL_TIMEOUT)
    holder.take(3, 8.0)
    assert not holder.may(2, 8.1)
    holder.gone(3)
    assert holder.may(2, 8.2)


def test_the_gizmo_is_on_what_is_seen_of_the_tool():
    """The handle of the ball of `palpation` is not drawn; a probe's centre of mass is in it."""
    assert np.abs(_near_tool(load_scene("palpation"))).max() < 0.0061
    assert _near_tool(load_scene("probe-plate"))[2] > 0.02
