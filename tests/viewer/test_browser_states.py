"""In a real browser: every state of the page says what it is, and its keys and buttons work."""

import time

import numpy as np
import pytest

pytest.importorskip("viser")
pytest.importorskip("playwright", reason="Playwright is not installed")

from fake_client import FakeServoClient

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import PASSIVITY
from asperity.viewer.app import live_panels
from asperity.viewer.browser import browser_tab, chromium, close_notes
from asperity.viewer.link import LinkRequests
from asperity.viewer.server.script import hide_settings_menu
from asperity.viewer.server.server import serve
from asperity.viewer.session_config import SessionConfig
from asperity.viewer.timeline import Timeline, TimelineClient

pytestmark = pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")
SLOW = 120e3
"""[ms]"""


class Steered(FakeServoClient):
    """A client without a loop whose hand can be moved, and whose force can be taken."""

    def __init__(self):
        super().__init__()
        self.target, self.moving, self.robbed = self.config.first_pose, False, False

    def give(self, seconds):
        ticks = super().give(seconds)
        if self.robbed:
            kept = self.history._ticks
            kept["flags"], kept["device_wrench"][:, 2] = PASSIVITY, 0.01
        return ticks

    def point(self, pose, press=None):
        self.target = np.array(pose)

    def move(self, motion, press=None):
        self.moving = True

    def reset(self):
        self.was_reset = True


@pytest.fixture(scope="module")
def shown():
    with Steered() as servo:
        timeline, links = Timeline(servo), LinkRequests()

        class Advancing:
            title = ""

            def build(self, server, servo):
                pass

            def update(self, frame):
                timeline.advance(frame)

            def close(self):
                pass

        def panels():
            return [Advancing(), *live_panels(4_000, timeline=timeline, links=links)]

        client = TimelineClient(servo, timeline)
        with serve(client, panels, port=0, links=links) as page:
            yield servo, page, timeline


@pytest.fixture(scope="module")
def tab(shown):
    _, page, _ = shown
    try:
        with browser_tab((900, 800)) as out:
            out.set_default_timeout(SLOW)
            out.goto(page.url)
            out.wait_for_selector("canvas")
            out.get_by_role("button", name="Lift off").wait_for()
            close_notes(out)
            yield out
    except AsperityError as reason:  # Chromium does not start
        pytest.skip(str(reason))


def until(what, seconds=60.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.05)


def panel(page, kind):
    return next(one for one in page.panels if type(one).__name__ == kind)


def test_paused_is_said_on_every_tab_with_the_button_that_ends_it(shown, tab):
    _, _, timeline = shown
    tab.get_by_role("tab", name="Surfaces").click()  # and has the focus
    tab.keyboard.press("Space")
    until(lambda: not timeline.is_live)
    for name in ("Hand", "Contact", "Surfaces"):
        tab.get_by_role("tab", name=name).click()
        tab.locator('[role=status]:has-text("Paused in the last seconds")').wait_for()
        assert "rate" in tab.locator("table").first.inner_text()
    tab.reload()
    tab.locator('[role=status]:has-text("Paused")').wait_for()
    timeline.play()
    tab.locator('[role=status]:has-text("Replaying the last seconds")').wait_for()
    tab.get_by_role("button", name="Back to live").click()
    until(lambda: timeline.is_live)
    tab.locator('[role=status]:has-text("probe-plate")').wait_for()


def test_a_force_that_is_taken_is_said_and_a_pressing_hand_is_held(shown, tab):
    servo, page, _ = shown
    mouse = panel(page, "MousePanel")
    mouse.is_moving = True
    servo.robbed = True
    alert = tab.locator('[role=alert]:has-text("passivity controller takes most")')
    alert.wait_for()
    until(lambda: not mouse.is_moving)  # it does not press on
    servo.robbed = False
    alert.wait_for(state="hidden")


def test_keys_move_the_hand_zoom_and_reset(shown, tab):
    servo, page, _ = shown
    before = servo.target.copy()
    tab.keyboard.press("ArrowRight")
    until(lambda: np.linalg.norm(servo.target[:2] - before[:2]) == pytest.approx(5e-4))
    tab.keyboard.press("PageDown")
    until(lambda: before[2] - servo.target[2] == pytest.approx(2.5e-4))
    view = panel(page, "SceneView")
    tab.keyboard.press("z")
    until(lambda: view.detail.zoomed)
    tab.keyboard.press("z")
    until(lambda: not view.detail.zoomed)
    tab.keyboard.press("r")
    until(lambda: getattr(servo, "was_reset", False))
    np.testing.assert_allclose(servo.target, servo.config.first_pose)


def test_help_explains_keys_and_words(shown, tab):
    tab.keyboard.press("?")
    tab.get_by_text("Keys, signs and words").wait_for()
    assert "Passivity controller" in tab.locator("[role=dialog]").inner_text()
    tab.get_by_role("button", name="Close").click()
    tab.get_by_text("Keys, signs and words").wait_for(state="hidden")
    tab.keyboard.press("h")
    tab.get_by_text("Keys, signs and words").wait_for()
    tab.keyboard.press("Escape")
    tab.get_by_text("Keys, signs and words").wait_for(state="hidden")
    title = tab.locator("tr:has-text('fallbacks')").first.get_attribute("title")
    assert "too late" in title


def test_saving_makes_a_scene_and_a_link_asks_before_anything_changes(shown, tab, tmp_path):
    servo, page, _ = shown
    panel(page, "ActionsPanel")._folder = tmp_path
    tab.get_by_role("button", name="Save").click()
    until(lambda: any(tmp_path.iterdir()))
    (saved,) = tmp_path.iterdir()
    assert load_scene(str(saved)).tool == "probe"
    tab.get_by_role("button", name="Link", exact=True).click()
    link = tab.locator("[role=dialog] input").first.input_value()
    assert link.startswith(f"{page.url}/?scene=probe-plate")
    tab.goto(link)
    tab.get_by_text("Follow the link?").wait_for()
    assert servo.config.source == "probe-plate"
    tab.get_by_role("button", name="Stay here").click()


def test_laws_that_meshes_cannot_have_are_grey_and_the_header_names_the_scene(shown, tab):
    servo, _, _ = shown
    before = servo.config
    servo.config = SessionConfig(load_scene("file-cad"), "file-cad")
    servo.generation += 1
    tab.get_by_text("asperity: file-cad").wait_for()
    tab.get_by_role("tab", name="Contact").click()
    tab.get_by_label("law").first.click()
    refused = tab.locator('[role=option]:has-text("(not for meshes)")').first
    refused.wait_for()
    assert refused.evaluate("one => getComputedStyle(one).pointerEvents") == "none"
    tab.keyboard.press("Escape")
    servo.config = before
    servo.generation += 1
    tab.get_by_text("asperity: probe-plate").wait_for()


def test_a_participant_has_no_settings_menu(shown, tab):
    _, page, _ = shown
    assert tab.locator(".tabler-icon-adjustments").first.is_visible()
    hide_settings_menu(page.server)
    tab.locator(".tabler-icon-adjustments").first.wait_for(state="hidden")
