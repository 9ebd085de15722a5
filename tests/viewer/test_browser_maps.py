"""In a real browser: maps of pressure and shear, and light that a slow browser goes without."""

import io

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser")
pytest.importorskip("playwright", reason="Playwright is not installed")

from fake_client import FakeServoClient

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.viewer.app import live_page
from asperity.viewer.browser import browser_tab, chromium, close_notes
from asperity.viewer.panels.skin import NOTHING, PRESSURE, RIGHT, SHEAR
from asperity.viewer.session_config import SessionConfig

pytestmark = pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")
SLOW = 180e3
"""[ms]"""
PATIENCE = 120.0
"""Time in which what was asked for is there [s]."""
SPEED, DEEP = 0.01, {"palpation": 1.5e-3, "finger-plate": 1e-3, "probe-plate": 1e-4}
"""[m/s], [m]."""


class Pressing(FakeServoClient):
    """A client without a loop whose tool is pressed, and moves to and fro if told to."""

    def __init__(self):
        super().__init__()
        self.moves = False
        self.show("palpation")

    def show(self, name):
        self.config = SessionConfig(load_scene(name), name)
        self.target = self.config.first_pose
        self.generation += 1

    def live(self):
        snapshot = super().live()
        if snapshot is None:
            return None
        pose = self.config.scene.start.copy()
        pose[2] -= DEEP[self.config.source]
        if self.moves:
            pose[0] += SPEED * (0.1 - abs(snapshot.time % 0.4 - 0.2))
        return snapshot._replace(tool_pose=pose, handle_pose=pose)


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    with (
        Pressing() as servo,
        live_page(servo, tmp_path_factory.mktemp("view"), 4_000, port=0) as page,
    ):
        yield servo, page


@pytest.fixture(scope="module")
def tab(shown):
    try:
        with browser_tab((900, 900)) as out:
            out.set_default_timeout(SLOW)
            out.goto(shown[1].url)
            out.wait_for_selector("canvas")
            out.get_by_role("tab", name="Plots").click()
            yield out
    except AsperityError as reason:  # Chromium does not start
        pytest.skip(str(reason))


def drawn(tab):
    """Return the map as the browser has it (rows, columns, 3)."""
    image = tab.locator("img:not([src*='svg']):visible").first
    image.wait_for()
    return np.asarray(Image.open(io.BytesIO(image.screenshot(timeout=SLOW))).convert("RGB"))


def choose(tab, kind):
    tab.get_by_label("Map").first.click()
    tab.get_by_role("option", name=kind, exact=True).click()


def colours_of(picture):
    return len(np.unique(picture.reshape(-1, 3) // 32, axis=0))


def test_a_soft_scene_shows_its_pressure_and_shear_with_numbers(shown, tab, until):
    tab.get_by_text("kPa pressure").first.wait_for()
    until(lambda: colours_of(drawn(tab)) > 8, PATIENCE)
    pressure = drawn(tab)
    choose(tab, RIGHT)
    # Blue and red over grey, in place of black and yellow.
    until(lambda: np.median(drawn(tab)[:40]) > np.median(pressure[:40]) + 60, PATIENCE)


def test_a_rigid_tool_shows_nothing_until_it_is_asked(shown, tab, until):
    servo, _ = shown
    servo.show("probe-plate")
    tab.get_by_text("kPa pressure").first.wait_for(state="hidden")
    assert tab.get_by_label("Map").first.input_value() == NOTHING
    choose(tab, PRESSURE)
    tab.get_by_text("kPa pressure").first.wait_for()
    until(lambda: colours_of(drawn(tab)) > 8, PATIENCE)
    servo.moves = True
    choose(tab, SHEAR)
    tab.get_by_text("kPa pressure").first.wait_for()
    servo.moves = False
    choose(tab, NOTHING)
    tab.get_by_text("kPa pressure").first.wait_for(state="hidden")


def test_a_slow_browser_goes_without_shadows_and_says_so(shown, tab, until):
    _, page = shown
    light = next(p for p in page.panels if type(p).__name__ == "LightPanel")
    assert not light.full
    tab.evaluate("document.activeElement.blur()")  # in a field it would be typed
    tab.keyboard.press("l")
    until(lambda: light.full, PATIENCE)
    tab.keyboard.press("l")
    until(lambda: not light.full, PATIENCE)
    tab.evaluate("asperityLight = ''; asperityJudge(3)")
    close_notes(tab)  # on a busy machine the first one may still be there
    light._noted.clear()
    light._since.clear()
    tab.get_by_text("Drawn simply").first.wait_for()
    assert not light.full
    tab.evaluate("asperityJudge(60); asperityJudge(60)")  # once
    until(lambda: light.full, PATIENCE)
