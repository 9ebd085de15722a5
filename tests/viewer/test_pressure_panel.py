"""The map of the pressure on a soft skin in the page."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.simulation.skin_engine import SkinEngine
from asperity.viewer.panels.pressure import PressurePanel, pressure_map


def pressed(name):
    scene = load_scene(name)
    pose = scene.start.copy()
    pose[2] -= 1.5e-3
    return scene, pose


@pytest.mark.parametrize("name", ["finger-plate", "palpation"])
def test_a_map_shows_the_pressure_of_the_pose(name):
    scene, pose = pressed(name)
    engine = SkinEngine(scene, scene.skin)
    shown = pressure_map(engine, pose, 0.0)
    rows, columns = scene.skin.taxels
    assert shown.image.shape == (4 * rows, 4 * columns, 3)
    assert shown.largest == engine.skin.pressure.max() > 0.0
    assert shown.area == engine.skin.contact_area
    lightest = np.unravel_index(np.argmax(shown.image[::4, ::4].sum(axis=2)), (rows, columns))
    assert engine.skin.pressure[::-1][lightest] > 0.97 * shown.largest
    # The scale falls slowly.
    pose[2] += 1e-3
    assert pressure_map(engine, pose, shown.lightest).lightest == 0.98 * shown.lightest


class Gui:
    """What the panel asks of viser's controls."""

    def add_image(self, image, *, label, visible):
        return SimpleNamespace(image=image, label=label, visible=visible)

    def add_markdown(self, content, *, visible):
        return SimpleNamespace(content=content, visible=visible)


def panel_on(scene, clients=1):
    panel = PressurePanel()
    servo = SimpleNamespace(config=SimpleNamespace(scene=scene))
    panel.build(SimpleNamespace(gui=Gui(), get_clients=lambda: [None] * clients), servo)
    return panel, servo


def frames(panel, pose, generation=1, first=0):
    """Update the panel until a map has been made, or for a second."""
    snapshot = SimpleNamespace(tool_pose=pose)
    for number in range(first, first + 100):
        panel.update(SimpleNamespace(number=number, generation=generation, snapshot=snapshot))
        time.sleep(0.02 if panel._making is None else 0.2)
        if panel._text.content:
            return


def test_the_page_shows_it_and_hides_it_for_another_scene():
    scene, pose = pressed("palpation")
    panel, servo = panel_on(scene)
    frames(panel, pose)
    assert panel._image.visible
    assert panel._image.image.max() > 100
    assert "kPa" in panel._text.content
    servo.config.scene, panel._text.content = load_scene("probe-plate"), ""
    panel.update(SimpleNamespace(number=1, generation=2, snapshot=None))
    assert not panel._image.visible
    assert not panel._text.visible
    panel.close()


def test_nothing_is_computed_while_nobody_looks():
    scene, pose = pressed("palpation")
    panel, _ = panel_on(scene, clients=0)
    snapshot = SimpleNamespace(tool_pose=pose)
    for number in range(20):
        panel.update(SimpleNamespace(number=number, generation=1, snapshot=snapshot))
    assert panel._making is None
    assert panel._text.content == ""
    panel.close()
