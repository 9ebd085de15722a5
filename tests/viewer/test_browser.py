"""The page in a real browser: it is drawn, dragged, given wrong input, and outlives its loop.

Software draws a frame or two a second, so what is tested is what happens, not how fast.
"""

import io
import os
import signal

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser")
pytest.importorskip("playwright", reason="Playwright is not installed")

from asperity.errors import AsperityError
from asperity.viewer.browser import browser_tab, chromium, close_notes
from asperity.viewer.drawables.stage import UNITS

pytestmark = pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")
SLOW = 120e3
"""[ms]"""


@pytest.fixture(scope="module")
def tab(page):
    try:
        with browser_tab((760, 600)) as out:
            out.set_default_timeout(SLOW)
            out.goto(page.url)
            out.wait_for_selector("canvas")
            out.get_by_text("probe-plate · mouse").wait_for()
            close_notes(out)
            yield out
    except AsperityError as reason:  # Chromium does not start
        pytest.skip(str(reason))


def canvas(page, tab):
    """Return what is drawn (rows, columns, 3), without the panels."""
    page.pause()
    tab.wait_for_timeout(500)
    shot = tab.screenshot(timeout=SLOW)
    page.pause(False)
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))[:, :430]


def on_screen(page, point):
    """Return where a point of the shown world is on the screen [pixels]."""
    (client,) = page.server.get_clients().values()
    camera = client.camera
    w, x, y, z = camera.wxyz
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    right, down, ahead = (np.asarray(point) - camera.position) @ turn
    focal = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
    return (
        0.5 * camera.image_width + focal * right / ahead,
        0.5 * camera.image_height + focal * down / ahead,
    )


def test_the_scene_is_drawn(page, servo, tab, until):
    def drawn():
        seen = canvas(page, tab)
        colours = len(np.unique(seen.reshape(-1, 3) // 16, axis=0))
        return seen.std(axis=(0, 1)).max() > 15.0 and colours > 30

    until(drawn)


def test_dragging_the_gizmo_changes_the_force(page, servo, tab, until, panel):
    mouse = panel("MousePanel")

    def is_felt():
        return servo.latest().device_wrench[2] > 0.1

    def drag(wait):
        """Return whether the hand feels the plate while the gizmo is dragged down, from above."""
        mouse.holder.take(None, -1e9)
        servo.point(servo.config.first_pose)
        mouse._put(servo.target)
        until(lambda: not is_felt())
        tab.wait_for_timeout(wait)
        tip = np.add(mouse._gizmo.position, [0.0, 0.0, 0.0175 * UNITS])  # of the arrow upwards
        x, y = on_screen(page, tip)
        tab.mouse.move(x, y)
        tab.wait_for_timeout(wait)
        tab.mouse.down()
        try:
            # As far as it takes: whoever draws slowly takes only a part of what the pointer does.
            for step in range(1, 31):
                tab.mouse.move(x, y + 2.0 * step)
                for _ in range(5):
                    tab.wait_for_timeout(wait / 50)
                    if is_felt():
                        return True
            return False
        finally:
            tab.mouse.up()

    # Longer, where the processor takes its time to draw.
    assert any(drag(wait) for wait in (500, 2_000, 8_000, 8_000)), servo.target


def test_a_number_that_is_typed_reaches_the_loop(servo, tab, until):
    tab.get_by_role("tab", name="Contact").click()
    before = servo.parameters.stiffness
    field = tab.locator(f"input[type=text][value='{before:.0f}']").first
    field.fill("33000")
    tab.keyboard.press("Enter")  # its value has changed, and with it what finds it
    until(lambda: servo.parameters.stiffness == 33000.0)
    servo.change(stiffness=before)


def test_a_bad_file_is_refused_in_the_page(servo, tab, tmp_path):
    (tmp_path / "bad.png").write_bytes(b"this is no picture")
    generation = servo.generation
    tab.get_by_role("tab", name="Surfaces").click()
    with tab.expect_file_chooser() as chooser:
        tab.get_by_role("button", name="Image or array of heights").click()
    chooser.value.set_files(tmp_path / "bad.png")
    tab.get_by_text("bad.png is not a .png file, or damaged").wait_for()
    assert (servo.generation, servo.is_alive) == (generation, True)


def test_the_page_outlives_its_loop_and_begins_another(servo, tab, until):
    os.kill(servo._servo.process.pid, signal.SIGKILL)
    tab.get_by_text("The loop has ended").wait_for()
    generation = servo.generation
    tab.get_by_role("button", name="Restart the loop").click()
    until(lambda: servo.generation == generation + 1, 180.0)
    tab.get_by_text("probe-plate · mouse").wait_for()
