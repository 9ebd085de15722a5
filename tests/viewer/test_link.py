"""The page's link to a servo process as it is: change, swap, death, and the panels' frames."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.realtime.devices.catalogue import entry_of, is_installed
from asperity.realtime.servo.tick_row import WIDTH, slices
from asperity.viewer.changes import with_method, with_scene, with_texture
from asperity.viewer.history import History
from asperity.viewer.motions import CannedMotion
from asperity.viewer.panels.panel import Frame
from asperity.viewer.panels.status import WELL, WRONG, rows_of, table
from asperity.viewer.view_model import Frames

TIME = slices()["time"].start


def test_a_history_keeps_the_last_rows_and_numbers_all():
    history = History(10)
    for n in range(0, 24, 4):
        history.add(np.repeat(np.arange(n, n + 4.0)[:, None], WIDTH, axis=1))
    rows, following = history.since(20)
    assert rows[:, 0].tolist() == [20, 21, 22, 23]
    assert following == 24
    assert history.since(0)[0][:, 0].tolist() == list(range(14, 24))
    history.add(np.zeros((25, WIDTH)))  # more than there is room for
    assert history.count == 49
    assert len(history.since(0)[0]) == 10


def test_the_hand_presses_where_the_page_points(link, until):
    assert (link.state, link.device) == ("running", "mouse")
    target = link.target.copy()
    target[2] -= 8e-3
    link.point(target)

    def pressed():
        moment = link.latest()
        return moment.device_wrench[2] > 0.3 and moment.contact_count > 0

    until(pressed)
    rows, following = link.rows_since(0)
    until(lambda: len(link.rows_since(following)[0]) > 10)
    assert (np.diff(rows[:, TIME]) > 0).all()


def test_parameters_reach_the_loop_and_bad_ones_do_not(link):
    link.change(stiffness=150.0, friction=0.4)
    assert (link.parameters.stiffness, link.parameters.friction) == (150.0, 0.4)
    with pytest.raises(AsperityError, match="stiffness must lie between"):
        link.change(stiffness=-1.0)
    assert link.parameters.stiffness == 150.0


def test_a_motion_goes_on_in_the_loop_and_presses(link, until):
    lifted = link.choice.first_pose
    link.point(lifted)
    link.move(CannedMotion("slide", 0.03, 0.01), press=0.5)
    seen = []

    def moving():
        moment = link.latest()
        seen.append(moment.handle_pose[0])
        return np.ptp(seen) > 8e-3 and moment.device_wrench[2] > 0.2

    until(moving)


def test_another_texture_is_swapped_in_where_the_hand_is(link, until):
    link.change(stiffness=150.0, friction=0.4)
    link.point(link.latest().handle_pose)
    before, count = link.generation, link.history.count
    place = link.latest().handle_pose
    link.restart(with_texture(link.choice, "plate", "jittered_dots")).result(timeout=300.0)
    assert (link.generation, link.state) == (before + 1, "running")
    assert np.abs(link.latest().handle_pose[:2] - place[:2]).max() < 5e-3
    assert (link.parameters.stiffness, link.parameters.friction) == (150.0, 0.4)  # they hold on
    until(lambda: link.history.count > count + 50)
    assert (np.diff(link.rows_since(0)[0][:, TIME]) > 0).all()  # time goes on


def test_what_cannot_begin_leaves_the_loop_as_it_was(link, until):
    before = link.generation
    with pytest.raises(AsperityError, match="unknown device 'spoon'"):
        link.restart(replace(link.choice, device="spoon")).result(timeout=300.0)
    assert (link.generation, link.state) == (before, "running")
    assert "spoon" in link.told
    ticks = link.latest().ticks
    until(lambda: link.latest().ticks > ticks)


def test_a_loop_that_is_killed_is_seen_and_begun_again(link, until):
    os.kill(link._servo.process.pid, signal.SIGKILL)
    until(lambda: link.state == "ended")
    assert "killed by SIGKILL" in link.told
    assert not link.is_alive
    with pytest.raises(AsperityError, match="no servo loop is running"):
        link.change(friction=0.1)
    frame = Frames(link).take(0.0)
    assert not frame.alive
    link.restart().result(timeout=300.0)
    assert link.is_alive
    frames = Frames(link)
    frames.take(0.0)
    ticks = link.latest().ticks
    until(lambda: link.latest().ticks > ticks + 20)
    assert frames.take(1.0).rate > 0.0


@pytest.mark.slow  # begins two processes; what is refused before that is above
@pytest.mark.skipif(
    not is_installed(entry_of("touch")), reason="the Touch's package is not installed"
)
def test_a_device_that_cannot_be_opened_gives_the_old_one_back(link):
    before = link.generation
    with pytest.raises(AsperityError):
        link.restart(replace(link.choice, device="touch")).result(timeout=300.0)
    assert (link.generation, link.device, link.is_alive) == (before + 1, "mouse", True)


@pytest.mark.slow
def test_laws_are_switched_while_rubbing_and_scenes_after(link, until):
    link.restart(with_method(link.choice, "Minsky 1995")).result(timeout=300.0)
    assert link.choice.scene.force.law == "minsky"
    link.restart(with_scene(link.choice, "probe-plate-grating")).result(timeout=300.0)
    assert link.choice.source == "probe-plate-grating"


def test_numbers_turn_colour_when_they_are_wrong(link, until):
    until(lambda: link.latest() is not None)
    moment = link.latest()._replace(tick_p99=2e-4, contact_p99=2e-4, misses=0, silences=0)
    rows = np.empty((0, WIDTH))
    well = rows_of(Frame(0, 0.0, moment, rows, 0, True, 1, rate=1000.0), 1000.0)
    assert {colour for *_, colour in well} == {WELL}
    wrong = rows_of(
        Frame(0, 0.0, moment._replace(tick_p99=3e-3), rows, 0, True, 1, rate=500.0, misses=400),
        1000.0,
    )
    told = {name: colour for name, _, _, colour in wrong[:4]}
    assert told["rate"] == told["tick, p99"] == told["misses"] == WRONG
    assert "500" in table(wrong)
