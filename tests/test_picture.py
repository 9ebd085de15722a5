"""Pictures show what is there: displaced surfaces at their places, shaded, with a shadow."""

import numpy as np
import pytest

from asperity.geometry.bodies import Body, Geom
from asperity.picture.contact import Moment, close_picture, whole_picture
from asperity.picture.render import Camera, Lamp, look, shade
from asperity.picture.sheets import View, body_sheets
from asperity.scenes import load_scene
from asperity.texture.patterns import sinusoid

WAVES = sinusoid(wavelength=2e-3, amplitude=1e-4)
HOME = np.array([0.0, 0, 0, 1, 0, 0, 0])
VIEW = View(np.array([0.3e-3, 0, 3e-3]), 4e-3, 80)


def from_above(width, pixels=201, centre=(0.0, 0.0, 0.0)):
    x, y, z = np.eye(3)
    return Camera(np.array(centre), x, y, z, width, pixels, pixels)


def points_of(geom, **options):
    sheets = list(body_sheets(Body("b", [geom], WAVES, **options), HOME, VIEW))
    return np.concatenate([sheet.points.reshape(-1, 3) for sheet in sheets]), sheets


def test_a_plate_is_displaced_by_its_texture_on_every_face():
    points, sheets = points_of(Geom("box", (3e-3, 2e-3, 3e-3)))
    assert len(sheets) == 5  # the face below is out of view
    height = 1e-4 * np.cos(2 * np.pi * points[:, 0] / 2e-3)
    top = np.abs(points[:, 2] - 3e-3) < 2e-4
    inside = np.abs(points[:, :2]).max(axis=1) < 1.8e-3
    chosen = top & inside
    assert chosen.sum() > 500
    np.testing.assert_allclose(points[chosen, 2], 3e-3 + height[chosen], atol=1e-6)


@pytest.mark.parametrize(
    ("geom", "distance"),
    [
        (Geom("sphere", (3e-3,)), lambda p: np.linalg.norm(p, axis=1) - 3e-3),
        (Geom("cylinder", (3e-3, 20e-3)), lambda p: np.hypot(p[:, 0], p[:, 1]) - 3e-3),
        (
            Geom("capsule", (2e-3, 1e-3)),
            lambda p: np.linalg.norm(
                p - np.clip(p * [0, 0, 1], [0, 0, -1e-3], [0, 0, 1e-3]), axis=1
            ) - 2e-3,
        ),
    ],
)  # fmt: skip
def test_round_bodies_stay_within_their_relief(geom, distance):
    points, sheets = points_of(geom)
    away = distance(points)
    assert np.abs(away).max() <= 1e-4 * (1 + 1e-3)
    assert away.max() > 0.9e-4
    for sheet in sheets:
        np.testing.assert_allclose(np.linalg.norm(sheet.normals, axis=-1), 1.0, atol=1e-9)
        assert np.mean(np.sum(sheet.normals * sheet.points, axis=-1) > 0) > 0.95


def test_the_nearest_surface_is_seen_at_its_distance():
    ball = Body("ball", [Geom("sphere", (1e-3,))])
    floor = Body("floor", [Geom("plane", (0.0, 0.0))])
    view = View(np.zeros(3), 5e-3, 200)
    sheets = [(0, s) for s in body_sheets(floor, HOME, view)]
    sheets += [(1, s) for s in body_sheets(ball, HOME, view)]
    seen = look(sheets, from_above(4e-3))
    assert seen.number[100, 100] == 1
    assert seen.number[10, 10] == 0
    assert seen.depth[100, 100] == pytest.approx(-1e-3, abs=1e-6)
    assert seen.depth[10, 10] == pytest.approx(0.0, abs=1e-9)
    inside = (seen.number == 1).sum() * (4e-3 / 201) ** 2
    assert inside == pytest.approx(np.pi * 1e-6, rel=0.02)


def test_a_ball_throws_a_shadow():
    ball = Body("ball", [Geom("sphere", (1e-3,), (0, 0, 2e-3))])
    floor = Body("floor", [Geom("plane", (0.0, 0.0))])
    view = View(np.zeros(3), 9e-3, 300)
    ground = [(0, s) for s in body_sheets(floor, HOME, view)]
    camera = from_above(8e-3)
    bright = {}
    for name, sheets in (("alone", ground), ("both", ground + [
        (1, s) for s in body_sheets(ball, HOME, view)
    ])):  # fmt: skip
        lamp = Lamp.over(sheets, camera, np.array([0.0, 0.0, 1.0]), 300)
        bright[name] = shade(look(ground, camera), camera, lamp, [(0.8, 0.8, 0.8)])[..., 0]
    darker = bright["both"] < 0.8 * bright["alone"]
    assert 0.01 < darker.mean() < 0.3


def test_a_moment_without_contact_has_a_picture_too():
    scene = load_scene("probe-plate")
    none = np.zeros((0, 3))
    moment = Moment(0.0, scene.start, none, none, none, np.zeros(0))
    for draw in (close_picture, whole_picture):
        image = draw(scene, moment, columns=120, rows=90).image
        assert image.shape == (90, 120, 4)
        assert np.isfinite(image).all()
        assert image[..., 3].mean() > 0.1
