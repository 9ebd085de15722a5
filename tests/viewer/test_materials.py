"""Surfaces look like what they are made of, and are drawn finely near the contact."""

import numpy as np
import pytest

from asperity.drawing.renderer.parts import GROUND_COLOUR, TOOL_COLOUR
from asperity.scene.builtin import load_scene
from asperity.viewer.drawables.ground import ground_height
from asperity.viewer.drawables.materials import material_of
from asperity.viewer.drawables.shapes import detail_of, first_contact, shapes_of


@pytest.mark.parametrize(
    ("colour", "name"),
    [
        (TOOL_COLOUR, "steel"),
        (GROUND_COLOUR, "ceramic"),
        ((0.72, 0.50, 0.30), "wood"),
        ((0.1, 0.1, 0.1), "rubber"),
        ((0.6, 0.6, 0.62), "steel"),
        ((0.1, 0.6, 0.2), "own colour"),
    ],
)
def test_the_material_follows_from_the_colour(colour, name):
    assert material_of(colour).name == name


def test_an_asset_keeps_its_colour_and_hollows_are_darker():
    green = (0.1, 0.6, 0.2)
    paint = material_of(green).paint(-1e-4, 1e-4)
    top, bottom = paint(np.zeros((2, 3)), np.array([1e-4, -1e-4]))
    np.testing.assert_allclose(top, green)
    assert (bottom < top).all()


def test_a_scene_shows_materials_and_no_scale_of_heights():
    shapes = {s.name: s.material.name for s in shapes_of(load_scene("probe-plate-dots"), 5_000)}
    assert set(shapes.values()) == {"ceramic", "steel"}


@pytest.mark.parametrize("scene", ["probe-plate-dots", "hammer-blocks"])
def test_near_the_contact_relief_is_finer_than_in_the_whole(scene):
    made = load_scene(scene)
    at, radius = first_contact(made), 5e-3
    if scene == "probe-plate-dots":
        at = np.array([*at[:2], 0.0])
    detail = detail_of(made, made.start, at, radius, heights=False)
    assert detail
    for shape in detail:
        centre = at if not shape.is_tool else None
        corners = shape.vertices[shape.faces]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        assert np.median(sides) < 0.15e-3
        if centre is not None:
            away = np.linalg.norm(corners.mean(axis=1) - centre, axis=1)
            assert away.max() < 1.1 * radius


BALL_ON = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1" pos="0 0 {height}"
euler="{tilt} 0 0"/><body name="ball" pos="0 0 .12"><freejoint/><geom type="sphere" size=".01"/>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("name", "height"), [("probe-plate", -0.008), ("hammer-blocks", 0.0), ("file-cad", 0.0)]
)
def test_bodies_rest_on_the_ground(name, height):
    scene = load_scene(name)
    assert ground_height(scene) == pytest.approx(height, abs=1e-9)
    drawn = [s.vertices for s in shapes_of(scene, 20_000) if not s.is_tool and len(s.faces)]
    lowest = min(vertices[:, 2].min() for vertices in drawn)
    assert lowest == pytest.approx(height, abs=2e-4)  # the relief of the underside


def test_a_plane_that_is_the_ground_is_not_drawn_as_a_body():
    shown = [s for s in shapes_of(load_scene("hammer-blocks"), 20_000) if len(s.faces)]
    assert not any(s.name.startswith("table") for s in shown)
    assert {s.name.split("-")[0] for s in shown} == {"block", "hammer"}


@pytest.mark.parametrize(
    ("height", "tilt", "texture", "ground"),
    [(0.1, 0, False, 0.1), (0.1, 5, False, None), (0.0, 0, True, None)],
)
def test_a_plane_that_leans_or_has_a_texture_is_drawn(tmp_path, height, tilt, texture, ground):
    (tmp_path / "scene.xml").write_text(BALL_ON.format(height=height, tilt=tilt))
    bodies = '[bodies.world.texture]\nkind = "sinusoid"\nwavelength = 2e-3\namplitude = 1e-4\n'
    text = 'schema = 1\n[tool]\nbody = "ball"\n' + texture * bodies
    (tmp_path / "scene.toml").write_text(text)
    scene = load_scene(tmp_path)
    assert ground_height(scene) == (pytest.approx(ground) if ground is not None else None)
    plane = [s for s in shapes_of(scene, 5_000) if not s.is_tool]
    assert [bool(len(s.faces)) for s in plane] == [ground is None]
