"""The page as a tab without a browser sees it: every control, and what is said when it fails."""

import io
import json
import time
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from asperity.runs.recording import read_attributes, read_recording
from asperity.viewer import changes
from asperity.viewer.changes import texture_of
from asperity.viewer.drawables.stage import UNITS
from asperity.viewer.panels.panel import ViewModel
from asperity.viewer.panels.record import RecordPanel
from asperity.viewer.timeline import Timeline
from page_client import ScriptedTab


@pytest.fixture
def tab(page, until):
    with ScriptedTab(page.url) as out:
        until(lambda: page.server.get_clients())
        yield out


def test_thirty_updates_a_second_are_made_and_triangles_are_bounded(page, until, panel):
    before = page.updates
    until(lambda: page.updates > before + 10)
    stage = panel("SceneView")
    assert 0 < sum(len(shape.faces) for shape in stage.shapes) <= 20_000


def test_dragging_the_gizmo_presses_the_tool(page, servo, tab, until, panel):
    mouse = panel("MousePanel")
    mouse.holder.take(None, -1e9)
    mouse._put(servo.target)  # where an earlier test left the gizmo is another place
    place = np.array(mouse._gizmo.position)
    for step in range(20):
        tab.drag("/gizmo", place - [0.0, 0.0, 0.05 * step], mouse._gizmo.wxyz)
        time.sleep(1.0 / 60.0)
    until(lambda: servo.latest().device_wrench[2] > 0.3)
    goal = servo.config.first_pose[2] - 0.95 / UNITS
    until(lambda: servo.target[2] == pytest.approx(goal, abs=1e-6))  # the last drag may come later
    tab.drag("/gizmo", place, mouse._gizmo.wxyz)
    until(lambda: servo.latest().contact_count == 0)


def test_a_second_tab_may_look_but_not_move_until_it_takes_the_tool(page, servo, tab, until, panel):
    mouse = panel("MousePanel")
    mouse.holder.take(None, -1e9)
    place = np.array(mouse._gizmo.position)
    tab.drag("/gizmo", place)
    until(lambda: mouse.holder._client is not None)
    with ScriptedTab(page.url) as other:
        until(lambda: len(page.server.get_clients()) == 2)
        before = servo.target.copy()
        other.drag("/gizmo", np.add(place, [1.0, 0.0, 0.0]))
        until(lambda: any("Another tab" in title for title, _ in other.notes))
        np.testing.assert_array_equal(servo.target, before)
        other.press(mouse._take)
        until(lambda: mouse.holder._client == max(page.server.get_clients()))
        other.drag("/gizmo", np.add(place, [0.1, 0.0, 0.0]))
        until(lambda: servo.target[0] != before[0])


def test_numbers_reach_the_loop_between_ticks(servo, tab, until, panel):
    controls, generation = panel("ControlsPanel"), servo.generation
    tab.set(controls._stiffness, 220.0)
    tab.set(controls._friction, 0.35)
    until(lambda: (servo.parameters.stiffness, servo.parameters.friction) == (220.0, 0.35))
    tab.set(controls._coupling, "static")
    until(lambda: servo.parameters.coupling.mode == "static")
    tab.set(controls._coupling, "implicit")
    tab.set(controls._rate, "500")
    until(lambda: servo.parameters.rate == 500.0)
    tab.set(controls._rate, "1000")
    until(lambda: servo.parameters.rate == 1000.0)
    assert servo.generation == generation
    assert tab.notes == []


def test_changes_are_undone_one_by_one_and_reset_brings_the_scene_back(servo, tab, until, panel):
    controls, first, texture = panel("ControlsPanel"), servo.config, texture_of
    relief = texture(first.scene, "plate").relief
    servo.reset()  # an earlier test may have left other numbers than the scene's own
    own = first.scene.force.friction
    until(lambda: servo.parameters.friction == own)
    tab.set(controls._friction, 0.61)
    until(lambda: servo.parameters.friction == 0.61)
    made = changes.with_texture(servo.config, "plate", "knurl", relief=2e-4)
    servo.restart(made).result()
    assert servo.parameters.friction == 0.61
    servo.reset()
    assert texture(servo.config.scene, "plate").relief == relief
    until(lambda: servo.parameters.friction == own)
    servo.undo()  # the reset
    assert texture(servo.config.scene, "plate").relief == pytest.approx(2e-4, rel=1e-3)
    assert servo.parameters.friction == 0.61
    servo.undo()
    assert texture(servo.config.scene, "plate").relief == relief
    assert servo.parameters.friction == 0.61
    servo.undo()
    assert servo.parameters.friction == own


def test_motions_start_and_stop(servo, tab, until, panel):
    mouse = panel("MousePanel")
    mouse.holder.take(None, -1e9)
    for control, value in (
        (mouse._kind, "circle"), (mouse._speed, 40.0), (mouse._length, 6.0), (mouse._force, 0.5),
    ):  # fmt: skip
        tab.set(control, value)
    tab.press(mouse._start)
    until(lambda: mouse.is_moving)
    seen = []

    def round_and_pressed():
        snapshot = servo.latest()
        seen.append(snapshot.handle_pose[:2])
        return (np.ptp(seen, axis=0) > 3e-3).all() and snapshot.device_wrench[2] > 0.2

    until(round_and_pressed)
    tab.press(mouse._stop)
    until(lambda: not mouse.is_moving)
    mouse.holder.take(None, -1e9)
    mouse.lift_off(SimpleNamespace(client_id=None, client=None))
    until(lambda: servo.latest().contact_count == 0)


def test_a_texture_is_chosen_and_a_dropped_image_is_felt(servo, tab, until, panel):
    surfaces = panel("TexturesPanel")
    tab.set(surfaces._body, "plate")
    tab.set(surfaces._kind, "jittered_dots")
    until(lambda: surfaces._relief.value == pytest.approx(0.4))
    tab.set(surfaces._relief, 0.25)
    until(lambda: surfaces._relief.value == 0.25)
    generation = servo.generation
    tab.press(surfaces._apply)
    until(lambda: servo.generation == generation + 1, 300.0)
    assert texture_of(servo.config.scene, "plate").relief == pytest.approx(2.5e-4)
    until(lambda: surfaces._generation == generation + 1)

    file, (i, j) = io.BytesIO(), np.mgrid[:64, :64]
    Image.fromarray((127 + 120 * np.sin(i / 5.0) * np.cos(j / 7.0)).astype(np.uint8)).save(
        file, "PNG"
    )
    tab.upload(surfaces._drop, "bumps.png", file.getvalue())
    until(lambda: surfaces._image is not None)
    tab.set(surfaces._relief, 0.1)
    tab.set(surfaces._pixel, 80.0)
    until(lambda: surfaces._pixel.value == 80.0)
    tab.press(surfaces._apply)
    until(lambda: servo.generation == generation + 2, 300.0)
    made = texture_of(servo.config.scene, "plate")
    assert made.relief == pytest.approx(1e-4, rel=0.05)
    assert made.pixel_size[0] == pytest.approx(8e-5)


def test_what_is_wrong_is_said_in_the_page_and_the_loop_goes_on(
    servo, tab, until, panel, monkeypatch
):
    surfaces, controls = panel("TexturesPanel"), panel("ControlsPanel")
    generation = servo.generation
    tab.upload(surfaces._drop, "bad.png", b"this is no picture")
    until(lambda: any("bad.png is not a .png file" in text for _, text in tab.notes))
    tab.upload(surfaces._drop, "big.png", b"x", size=2**40)
    until(lambda: any("valid: at most 64 MB" in text for _, text in tab.notes))
    assert not surfaces._uploads._folder.joinpath("big.png").exists()
    # As where its package is not installed; `test_servo_client` has a device that does not open.
    monkeypatch.setattr(changes, "is_installed", lambda entry: False)
    tab.set(controls._device, "touch")
    until(lambda: any("touch needs pip install" in text for _, text in tab.notes))
    until(lambda: controls._device.value == "mouse")
    assert (servo.generation, servo.is_alive) == (generation, True)


def test_what_is_changed_while_it_records_stands_in_the_recording(page, servo, until, tmp_path):
    record, view_model = RecordPanel(Timeline(servo), tmp_path), ViewModel(servo)
    record.build(page.server, servo)
    record.start()
    until(lambda: record._recorder.ticks > 100)
    record.update(view_model.frame(0.0))  # nothing has changed yet
    before = servo.parameters.stiffness
    servo.change(stiffness=before - 21.0)
    record.update(view_model.frame(0.1))
    ticks = record._recorder.ticks
    until(lambda: record._recorder.ticks > ticks + 100)
    record.update(view_model.frame(0.2))
    record.stop()
    (change,) = json.loads(read_attributes(record.path)["parameter_changes"])
    assert change["stiffness"] == before - 21.0
    assert change["friction"] == servo.parameters.friction
    assert 0.05 < change["after"] < read_recording(record.path).time[-1]
    servo.change(stiffness=before)


def test_a_scene_is_chosen(servo, tab, until, panel):
    controls, generation = panel("ControlsPanel"), servo.generation
    tab.set(controls._scene, "probe-plate-grating")
    until(lambda: servo.generation == generation + 1, 300.0)
    assert servo.config.source == "probe-plate-grating"
    stage = panel("SceneView")
    until(lambda: stage._scene is servo.config.scene)
    until(lambda: controls._generation == generation + 1)
    assert controls._scene.value == "probe-plate-grating"
    tab.set(controls._scene, "probe-plate")
    until(lambda: servo.generation == generation + 2, 300.0)
    assert servo.config.source == "probe-plate"


def test_what_is_being_made_ready_is_not_put_back(page, servo, until, panel):
    controls, felt = panel("ControlsPanel"), servo.parameters.friction
    controls._under_way += 1
    controls._friction.value = felt + 0.25
    controls._generation, before = -1, page.updates
    until(lambda: page.updates > before + 3)
    assert controls._friction.value == felt + 0.25
    controls._under_way -= 1
    until(lambda: controls._friction.value == felt)


def test_a_page_of_another_origin_cannot_open_the_socket(page):
    import viser

    with pytest.raises(InvalidStatus):
        connect(
            page.url.replace("http", "ws", 1),
            origin="http://evil.example",
            subprotocols=[f"viser-v{viser.__version__}"],
        )


def test_a_tab_that_goes_leaves_the_loop_alone(page, servo, until):
    tab = ScriptedTab(page.url)
    until(lambda: page.server.get_clients())
    tab._socket.socket.close()  # as a killed browser's
    generation, ticks = servo.generation, servo.latest().ticks
    until(lambda: servo.latest().ticks > ticks + 20)
    assert (servo.generation, servo.state) == (generation, "running")
