"""Pressure and shear on a soft skin in the page."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.simulation.skin_engine import SkinEngine
from asperity.viewer.panels.skin import (
    PRESSURE,
    RIGHT,
    SHEAR,
    SHOWN,
    UP,
    Moved,
    SkinPanel,
    skin_map,
)
from asperity.viewer.panels.taxel_map import SteadyScale, taxel_map


def pressed(name):
    scene = load_scene(name)
    pose = scene.start.copy()
    pose[2] -= 1.5e-3
    return scene, pose


def scales():
    return {False: SteadyScale(), True: SteadyScale()}


def at_rest(pose):
    return Moved(pose, pose, 0.0)


@pytest.mark.parametrize("name", ["finger-plate", "palpation"])
def test_a_map_shows_the_pressure_of_the_pose(name):
    scene, pose = pressed(name)
    engine = SkinEngine(scene, scene.skin)
    made = skin_map(engine, at_rest(pose), PRESSURE, scales())
    rows, columns = scene.skin.taxels
    assert made.image.shape[1] == 4 * columns
    assert made.image.shape[0] > 4 * rows  # with the bar
    pressure = engine.skin.pressure
    assert made.pressure == pressure.max() > 0.0
    assert made.area == engine.skin.contact_area
    chart = made.image[: 4 * rows : 4, ::4].sum(axis=2)
    lightest = chart == chart.max()
    assert pressure[::-1][lightest].min() > 0.9 * np.percentile(pressure[pressure > 0.0], 97)


def test_shear_of_a_finger_that_slides_is_its_friction_backwards():
    scene, pose = pressed("finger-plate")
    engine = SkinEngine(scene.smooth(), scene.smooth().skin)
    before = pose.copy()
    before[0] -= 1e-3  # to the right
    made = skin_map(engine, Moved(before, pose, 0.02), SHEAR, scales())
    shear, pressure = engine.skin.shear, engine.skin.pressure
    assert shear[..., 0].sum() == pytest.approx(-0.4 * pressure.sum(), rel=0.15)
    assert made.shear == pytest.approx(np.hypot(shear[..., 0], shear[..., 1]).max())
    # At rest there is none, whatever was before.
    skin_map(engine, at_rest(pose), SHEAR, scales())
    assert abs(engine.skin.shear[..., 0].sum()) < 0.01 * pressure.sum()


def test_signed_maps_are_blue_and_red_and_the_others_dark():
    values = np.zeros((8, 8))
    values[0, 0], values[7, 7] = -1e3, 1e3
    image = taxel_map(values, 1e3, signed=True)[:256].astype(int)
    assert image.shape[:2] == (256, 256)
    low, high = image[-4, 4], image[4, -4]  # rows go upwards
    assert low[2] > low[0] + 80
    assert high[0] > high[2] + 80
    assert np.ptp(image[128, 128]) < 5
    assert taxel_map(np.zeros((8, 8)), 1e3)[:256].max() < 20


def test_what_a_wide_map_says_stays_legible_in_the_panel():
    narrow, wide = (taxel_map(np.zeros((8, n)), 1e3)[33 if n == 8 else 32 :] for n in (8, 256))

    def height(image):
        dark = np.nonzero((image.max(axis=2) < 120).any(axis=1))[0]
        below = dark[dark > len(image) - 40 * image.shape[1] // 360]
        return np.ptp(below) / max(image.shape[1] / 360, 1.0)

    assert height(wide) == pytest.approx(height(narrow), rel=0.4)


def test_arrows_point_where_the_shear_does():
    arrows = np.zeros((32, 32, 2))
    arrows[16:, 16:] = (0.0, 1e3)  # upwards, in the upper right
    plain, drawn = (taxel_map(np.zeros((32, 32)), 1e3, arrows=a) for a in (None, arrows))
    rows, columns = np.nonzero(np.any(plain != drawn, axis=2))
    assert rows.max() < 140
    assert columns.min() > 120
    # The head, the wider end, is above.
    first = columns < columns.min() + 12
    widths = [np.ptp(columns[first][rows[first] == r]) for r in np.unique(rows[first])[:12]]
    assert np.argmax(widths) < 9


def test_the_scale_does_not_jump():
    scale = SteadyScale()
    assert scale.update(1.3e4) == 2e4
    assert [scale.update(v) for v in (1e4, 1.9e4, 7e3, 0.0)] == [2e4] * 4
    assert scale.update(2.1e4) == 5e4
    # Far less for a while, and it shrinks to what there was meanwhile; not before.
    ends = [scale.update(3e3 + i) for i in range(20)]
    assert ends[:19] == [5e4] * 19
    assert ends[19] == 5e3
    # One larger value in between begins the while anew.
    scale = SteadyScale()
    scale.update(1e4)
    assert all(scale.update(5e3 if i % 15 == 14 else 1e2) == 1e4 for i in range(60))


class Gui:
    """What the panel asks of viser's controls."""

    def add_dropdown(self, label, options, *, visible, hint):
        return SimpleNamespace(label=label, value=options[0], visible=visible)

    def add_image(self, image, *, label, visible):
        return SimpleNamespace(image=image, label=label, visible=visible)

    def add_markdown(self, content, *, visible):
        return SimpleNamespace(content=content, visible=visible)


def panel_on(scene, clients=1):
    panel = SkinPanel()
    servo = SimpleNamespace(config=SimpleNamespace(scene=scene))
    panel.build(SimpleNamespace(gui=Gui(), get_clients=lambda: [None] * clients), servo)
    return panel, servo


def frames(panel, pose, generation=1, first=0, speed=0.0):
    """Update the panel until a map has been made, or for a second."""
    for number in range(first, first + 100):
        moved = pose.copy()
        moved[0] += speed * number / 30.0
        snapshot = SimpleNamespace(tool_pose=moved, time=number / 30.0)
        panel.update(SimpleNamespace(number=number, generation=generation, snapshot=snapshot))
        time.sleep(0.02 if panel._making is None else 0.2)
        if panel._text.content:
            return


def test_the_page_shows_it_and_hides_it_for_another_scene():
    scene, pose = pressed("palpation")
    panel, servo = panel_on(scene)
    frames(panel, pose)
    assert panel._image.visible
    assert panel._kind.visible
    assert panel._image.image.max() > 100
    assert "kPa pressure" in panel._text.content
    assert "kPa shear" in panel._text.content
    first, last, low, high = scene.skin.extent
    size = f"{1e3 * (last - first):.3g} x {1e3 * (high - low):.3g} mm"
    assert f"The map is {size} large" in panel._text.content
    # Of a rigid tool, only on request.
    servo.config.scene, panel._text.content = load_scene("probe-plate"), ""
    panel.update(SimpleNamespace(number=1, generation=2, snapshot=None))
    assert not panel._image.visible
    assert not panel._text.visible
    panel._kind.value = PRESSURE
    pose = servo.config.scene.start.copy()
    pose[2] -= 1e-4
    frames(panel, pose, generation=2, first=8)
    assert panel._image.visible
    assert "kPa pressure" in panel._text.content
    assert " 0 kPa shear" in panel._text.content  # none, and not what rounding leaves
    panel.close()


def test_another_kind_is_shown_of_a_tool_at_rest_too():
    scene, pose = pressed("palpation")
    panel, _ = panel_on(scene)
    frames(panel, pose)
    images = [panel._image.image]
    for kind in (SHEAR, RIGHT, UP):
        panel._kind.value, panel._text.content = kind, ""
        frames(panel, pose, first=8)
        images.append(panel._image.image)
    assert len(SHOWN) == 5
    assert all(np.any(a != b) for i, a in enumerate(images) for b in images[:i])
    panel.close()


def test_the_friction_of_the_motion_is_shown():
    scene, pose = pressed("finger-plate")
    panel, _ = panel_on(scene)
    frames(panel, pose, first=1, speed=0.05)
    shear = panel._engine[1].skin.shear
    assert shear[..., 0].sum() < -0.2 * panel._engine[1].skin.pressure.sum()
    panel.close()


def test_nothing_is_computed_while_nobody_looks():
    scene, pose = pressed("palpation")
    panel, _ = panel_on(scene, clients=0)
    snapshot = SimpleNamespace(tool_pose=pose, time=0.0)
    for number in range(20):
        panel.update(SimpleNamespace(number=number, generation=1, snapshot=snapshot))
    assert panel._making is None
    assert panel._text.content == ""
    panel.close()
