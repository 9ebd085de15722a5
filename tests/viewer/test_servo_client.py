"""The page's client of a real servo process: changes, replacement, death, and frames."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.realtime.devices.catalogue import entry_of, is_installed
from asperity.realtime.servo.ipc import TICK
from asperity.realtime.servo.parameters import LiveParameters
from asperity.viewer.changes import with_method, with_scene, with_texture
from asperity.viewer.motions import CannedMotion
from asperity.viewer.panels.panel import Frame, ViewModel
from asperity.viewer.panels.status import WELL, WRONG, rows_of, table
from asperity.viewer.tick_buffer import TickBuffer


def test_a_history_keeps_the_last_ticks_and_numbers_all():
    history = TickBuffer(10)
    for n in range(0, 24, 4):
        ticks = np.zeros(4, TICK)
        ticks["time"] = np.arange(n, n + 4.0)
        history.add(ticks)
    ticks, following = history.since(20)
    assert ticks["time"].tolist() == [20, 21, 22, 23]
    assert following == 24
    assert history.since(0)[0]["time"].tolist() == list(range(14, 24))
    history.add(np.zeros(25, TICK))  # more than there is room for
    assert history.count == 49
    assert len(history.since(0)[0]) == 10


def test_the_hand_presses_where_the_page_points(servo, until):
    assert (servo.state, servo.device) == ("running", "mouse")
    target = servo.target.copy()
    target[2] -= 8e-3
    servo.point(target)

    def pressed():
        snapshot = servo.latest()
        return snapshot.device_wrench[2] > 0.3 and snapshot.contact_count > 0

    until(pressed)
    ticks, following = servo.ticks_since(0)
    until(lambda: len(servo.ticks_since(following)[0]) > 10)
    assert (np.diff(ticks["time"]) > 0).all()


def test_parameters_reach_the_loop_and_bad_ones_do_not(servo):
    servo.change(stiffness=150.0, friction=0.4)
    assert (servo.parameters.stiffness, servo.parameters.friction) == (150.0, 0.4)
    with pytest.raises(AsperityError, match="stiffness must lie between"):
        servo.change(stiffness=-1.0)
    assert servo.parameters.stiffness == 150.0


def test_of_two_changes_at_the_same_time_neither_is_lost(servo, monkeypatch):
    """As of two controls, whose callbacks run in threads of their own."""
    computed = LiveParameters.changed

    def slowly(*arguments):
        time.sleep(0.05)  # long enough for the other to begin from the same values
        return computed(*arguments)

    monkeypatch.setattr(LiveParameters, "changed", slowly)
    with ThreadPoolExecutor() as threads:
        for made in ({"friction": 0.3}, {"rate": 500.0}):
            threads.submit(servo.change, **made)
    assert (servo.parameters.friction, servo.parameters.rate) == (0.3, 500.0)
    servo.change(rate=1000.0)


def test_a_motion_goes_on_in_the_loop_and_presses(servo, until):
    lifted = servo.config.first_pose
    servo.point(lifted)
    servo.move(CannedMotion("slide", 0.03, 0.01), press=0.5)
    seen = []

    def moving():
        snapshot = servo.latest()
        seen.append(snapshot.handle_pose[0])
        return np.ptp(seen) > 8e-3 and snapshot.device_wrench[2] > 0.2

    until(moving)


def test_another_texture_is_swapped_in_where_the_hand_is(servo, until):
    servo.change(stiffness=150.0, friction=0.4)
    servo.point(servo.latest().handle_pose)
    before, count = servo.generation, servo.history.count
    place = servo.latest().handle_pose
    servo.restart(with_texture(servo.config, "plate", "jittered_dots")).result(timeout=300.0)
    assert (servo.generation, servo.state) == (before + 1, "running")
    assert np.abs(servo.latest().handle_pose[:2] - place[:2]).max() < 5e-3
    assert (servo.parameters.stiffness, servo.parameters.friction) == (150.0, 0.4)  # they hold on
    until(lambda: servo.history.count > count + 50)
    assert (np.diff(servo.ticks_since(0)[0]["time"]) > 0).all()  # time goes on


def test_what_cannot_begin_leaves_the_loop_as_it_was(servo, until):
    before = servo.generation
    with pytest.raises(AsperityError, match="unknown device 'spoon'"):
        servo.restart(replace(servo.config, device="spoon")).result(timeout=300.0)
    assert (servo.generation, servo.state) == (before, "running")
    assert "spoon" in servo.message
    ticks = servo.latest().ticks
    until(lambda: servo.latest().ticks > ticks)


def test_a_loop_that_is_killed_is_seen_and_begun_again(servo, until):
    os.kill(servo._servo.process.pid, signal.SIGKILL)
    until(lambda: servo.state == "ended")
    assert "killed by SIGKILL" in servo.message
    assert not servo.is_alive
    with pytest.raises(AsperityError, match="no servo loop is running"):
        servo.change(friction=0.1)
    frame = ViewModel(servo).frame(0.0)
    assert not frame.alive
    servo.restart().result(timeout=300.0)
    assert servo.is_alive
    view_model = ViewModel(servo)
    view_model.frame(0.0)
    ticks = servo.latest().ticks
    until(lambda: servo.latest().ticks > ticks + 20)
    assert view_model.frame(1.0).rate > 0.0


@pytest.mark.slow  # begins two processes; what is refused before that is above
@pytest.mark.skipif(
    not is_installed(entry_of("touch")), reason="the Touch's package is not installed"
)
def test_a_device_that_cannot_be_opened_gives_the_old_one_back(servo):
    before = servo.generation
    with pytest.raises(AsperityError):
        servo.restart(replace(servo.config, device="touch")).result(timeout=300.0)
    assert (servo.generation, servo.device, servo.is_alive) == (before + 1, "mouse", True)


@pytest.mark.slow
def test_laws_are_switched_while_rubbing_and_scenes_after(servo, until):
    servo.restart(with_method(servo.config, "Minsky 1995")).result(timeout=300.0)
    assert servo.config.scene.force.law == "minsky"
    servo.restart(with_scene(servo.config, "probe-plate-grating")).result(timeout=300.0)
    assert servo.config.source == "probe-plate-grating"


def test_numbers_turn_colour_when_they_are_wrong(servo, until):
    until(lambda: servo.latest() is not None)
    snapshot = servo.latest()._replace(tick_p99=2e-4, contact_p99=2e-4, misses=0, silences=0)
    ticks = np.empty(0, TICK)
    well = rows_of(Frame(0, 0.0, snapshot, ticks, 0, True, 1, rate=1000.0, live=snapshot), 1000.0)
    assert {colour for *_, colour in well} == {WELL}
    late = snapshot._replace(tick_p99=3e-3)
    wrong = rows_of(
        Frame(0, 0.0, late, ticks, 0, True, 1, rate=500.0, misses=400, live=late), 1000.0
    )
    message = {name: colour for name, _, _, colour in wrong[:4]}
    assert message["rate"] == message["tick, p99"] == message["misses"] == WRONG
    assert "500" in table(wrong)
