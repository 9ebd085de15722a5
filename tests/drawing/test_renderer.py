"""Pictures show what is there: displaced surfaces at their places, shaded, with a shadow."""

import numpy as np
import pytest

from asperity.drawing.renderer.contact import (
    ContactMoment,
    Picture,
    close_picture,
    contact_width,
    whole_picture,
)
from asperity.drawing.renderer.parts import scene_parts
from asperity.drawing.renderer.render import Lamp, camera_at, hollows, look, shade
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.displaced.geoms import body_sheets
from asperity.geometry.displaced.meshes import mesh_sheets
from asperity.geometry.displaced.view import Camera, ViewBall, coarsened
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.runs.contact_figure import contact_figure
from asperity.scene.builtin import load_scene
from asperity.texture.patterns.patterns import sinusoid

WAVES = sinusoid(wavelength=2e-3, amplitude=1e-4)
HOME = np.array([0.0, 0, 0, 1, 0, 0, 0])
VIEW = ViewBall(np.array([0.3e-3, 0, 3e-3]), 4e-3, 80)


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


@pytest.mark.parametrize("geom", [Geom("box", (1e-3, 8e-4, 6e-4)), Geom("cylinder", (8e-4, 1e-3))])
def test_displaced_faces_end_at_their_edges(geom):
    """They would not meet: each is displaced along its own normal."""
    is_box, found = geom.kind == "box", 0
    for sheet in body_sheets(Body("b", [geom], WAVES), HOME, VIEW._replace(centre=np.zeros(3))):
        points = sheet.points
        assert points.shape == sheet.normals.shape == (*sheet.height.shape, 3)
        for line in (points[0], points[-1], points[:, 0], points[:, -1]):
            radius = np.hypot(line[:, 0], line[:, 1])
            at = np.abs(line) if is_box else np.stack([radius, np.abs(line[:, 2])], axis=1)
            found += bool((np.isclose(at, geom.size[: at.shape[1]]).sum(axis=1) >= 2).all())
    assert found == (6 * 4 if is_box else 2 + 2)


def test_the_nearest_surface_is_seen_at_its_distance():
    ball = Body("ball", [Geom("sphere", (1e-3,))])
    floor = Body("floor", [Geom("plane", (0.0, 0.0))])
    view = ViewBall(np.zeros(3), 5e-3, 200)
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
    view = ViewBall(np.zeros(3), 9e-3, 300)
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


def test_contacts_at_one_place_are_drawn_as_one():
    class Found:
        count = np.array([3])
        point = np.array([[0, 0, 0], [1e-3, 0, 0], [1e-9, 0, 0], [9, 9, 9.0]])
        normal = np.tile([0, 0, 1.0], (4, 1))
        force = np.array([[0, 0, 1.0], [0, 0, 2], [0, 1, 4], [9, 9, 9]])
        depth = np.array([1e-4, 2e-4, 1e-4, 9])

    moment = ContactMoment.of(0.0, HOME, Found)
    np.testing.assert_allclose(moment.point, [[0, 0, 0], [1e-3, 0, 0]], atol=1e-8)
    np.testing.assert_allclose(moment.force, [[0, 1, 5], [0, 0, 2]])
    np.testing.assert_allclose(moment.depth, [1e-4, 2e-4])
    Found.count = np.array([0])
    assert ContactMoment.of(0.0, HOME, Found).point.shape == (0, 3)


def test_a_moment_without_contact_has_a_picture_too():
    scene = load_scene("probe-plate")
    none = np.zeros((0, 3))
    moment = ContactMoment(0.0, scene.start, none, none, none, np.zeros(0))
    for draw in (close_picture, whole_picture):
        image = draw(scene, moment, columns=120, rows=90).image
        assert image.shape == (90, 120, 4)
        assert np.isfinite(image).all()
        assert image[..., 3].mean() > 0.1


SOLID = (Geom("mesh", (1e-2, 1e-2, 1e-2)),)


def ball_mesh(radius, turns=24):
    """Return a ball of triangles, whose texture coordinates are torn along one line."""
    u, v = (a.ravel() for a in np.meshgrid(np.arange(turns + 1), np.arange(1, turns)))
    longitude, latitude = 2 * np.pi * u / turns, np.pi * (v / turns - 0.5)
    points = radius * np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
         np.sin(latitude)], axis=1,
    )  # fmt: skip
    number = np.arange(len(u)).reshape(turns - 1, turns + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return mesh_from_arrays(points, faces, uv=np.stack([u / turns, v / turns], axis=1))


def mesh_points(body, view, **options):
    sheets = list(mesh_sheets(body, HOME, view, **options))
    return np.concatenate([sheet.points.reshape(-1, 3) for sheet in sheets]), sheets


@pytest.mark.parametrize("mapping", ["planar", "triplanar", "cylindrical", "uv"])
def test_a_mesh_is_displaced_along_its_normals(mapping):
    mesh = ball_mesh(3e-3)
    texture = sinusoid(wavelength=2e-3, amplitude=1e-4, periods=9)
    body = Body("ball", SOLID, texture, mapping, mesh=mesh)
    points, sheets = mesh_points(body, ViewBall(np.zeros(3), 4e-3, 100))
    away = np.linalg.norm(points, axis=1) - 3e-3
    assert -1.7e-4 < away.min() < -0.8e-4  # triangles lie a little within the ball
    assert 0.8e-4 < away.max() <= 1e-4 * (1 + 1e-3)
    for sheet in sheets:
        np.testing.assert_allclose(np.linalg.norm(sheet.normals, axis=-1), 1.0, atol=1e-9)
        assert np.mean(np.sum(sheet.normals * sheet.points, axis=-1) > 0) > 0.95


def test_a_mesh_s_relief_and_slope_are_the_texture_s():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * 1e-2
    mesh = mesh_from_arrays(corners, [[0, 1, 2], [0, 2, 3]])
    points, sheets = mesh_points(
        Body("plate", SOLID, WAVES, mesh=mesh), ViewBall(np.zeros(3), 2e-2, 800)
    )
    phase = 2 * np.pi * points[:, 0] / 2e-3
    np.testing.assert_allclose(points[:, 2], 1e-4 * np.cos(phase), atol=2e-7)
    normals = np.concatenate([sheet.normals.reshape(-1, 3) for sheet in sheets])
    slope = -1e-4 * np.sin(phase) * 2 * np.pi / 2e-3
    np.testing.assert_allclose(-normals[:, 0] / normals[:, 2], slope, atol=2e-3)


def test_only_what_the_camera_sees_is_fine():
    mesh = ball_mesh(3e-3)
    body = Body("ball", SOLID, WAVES, "triplanar", mesh=mesh)
    everything, _ = mesh_points(body, ViewBall(np.zeros(3), 4e-3, 100))
    camera = from_above(1e-3, centre=(0.0, 0.0, 2e-3))
    points, _ = mesh_points(body, ViewBall(np.zeros(3), 4e-3, 100, camera))
    assert len(points) < 0.5 * len(everything)
    near = np.abs(points[:, :2]).max(axis=1) < 0.5e-3
    assert (near & (points[:, 2] > 0)).sum() > 5 * (near & (points[:, 2] < 0)).sum()
    # Nothing is left out: what is out of view throws shadows.
    assert np.ptp(points[:, 0]) > 5.9e-3


def test_one_cannot_see_through_where_a_texture_is_torn():
    mesh = ball_mesh(3e-3)
    texture = sinusoid(wavelength=2e-3, amplitude=2e-4, periods=9)
    torn = mesh.uv.copy()
    torn[: len(torn) // 2, :, 0] += 1 / 18  # half a wave between the upper and lower triangles
    mesh = type(mesh)(mesh.vertices, mesh.faces, mesh.normals, torn)
    body = Body("ball", SOLID, texture, "uv", mesh=mesh)
    x, y, z = np.eye(3)
    camera = Camera(np.zeros(3), y, z, x, 3e-3, 301, 301)
    sheets = [(0, s) for s in mesh_sheets(body, HOME, ViewBall(np.zeros(3), 4e-3, 600, camera))]
    seen = look(sheets, camera)
    assert (seen.depth < 0).all()  # the near side, everywhere
    without = [(0, s) for _, s in sheets if not _is_strip(s)]
    assert (look(without, camera).depth > 0).any()


def _is_strip(sheet):
    return sheet.corners[0].tolist() == [0, 1, sheet.points.shape[1] // 2]


def test_relief_finer_than_a_pixel_is_averaged():
    fine = sinusoid(wavelength=1e-3, amplitude=1e-4, periods=8, samples=64)
    assert coarsened(fine, 1e-5) is fine
    coarse = coarsened(fine, 1.3e-4)
    assert coarse.size == pytest.approx(fine.size)
    assert coarse.samples.shape[1] == 64
    u = np.linspace(0, 8e-3, 50)
    np.testing.assert_allclose(coarse.heights(u, 0.0), fine.heights(u, 0.0), atol=6e-6)


def test_a_level_floor_is_open_and_a_hollow_is_not():
    x, _, z = np.eye(3)
    camera = camera_at(
        np.zeros(3), z, x, azimuth=0.3, elevation=0.5, width=2e-2, columns=400, rows=300
    )
    floor = Body("floor", [Geom("plane", (0.0, 0.0))])
    block = Body("block", [Geom("box", (2e-3, 2e-3, 4e-3))])
    view = ViewBall(np.zeros(3), 3e-2, 200, camera)
    level = look([(0, s) for s in body_sheets(floor, HOME, view)], camera)
    assert np.isfinite(level.depth).all()
    np.testing.assert_allclose(hollows(level, camera), 1.0, atol=1e-6)
    both = look([(0, s) for b in (floor, block) for s in body_sheets(b, HOME, view)], camera)
    assert hollows(both, camera).min() < 0.8


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_a_tool_that_is_a_mesh_has_pictures(name):
    scene = load_scene(name)
    parts = scene_parts(scene, scene.start)
    tool = [part for part in parts if part.is_tool]
    assert len({part.colour for part in tool}) == 2  # steel and wood
    assert np.sum([part.faces for part in tool], axis=0).tolist() == [1] * len(tool[0].faces)
    up = np.array([[0.0, 0.0, 1.0]])
    moment = ContactMoment(0.0, scene.start, scene.start[None, :3], up, 0.5 * up, np.array([1e-4]))
    assert 2e-3 < contact_width(scene, moment) < 5e-2
    for draw in (close_picture, whole_picture):
        image = draw(scene, moment, columns=150, rows=120).image
        assert np.isfinite(image).all()
        assert image[..., 3].min() == 1.0  # the table fills it
        assert image[..., :3].std() > 0.05
    # The whole tool is in the image.
    eye = whole_picture(scene, moment, columns=150, rows=120).camera
    body = tool[0].body
    turn = np.array([eye.place(p + scene.start[:3]) for p in body.mesh.vertices])
    if name == "hammer-blocks":
        assert turn.min() > 0
        assert (turn.max(axis=0) < [150, 120]).all()


@pytest.mark.parametrize("lean", [(-1.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_no_word_of_a_picture_is_cut_off(lean):
    picture = Picture(np.full((220, 220, 4), 0.8), from_above(0.02, 220))
    point = np.array([[0.0098 * lean[0], 0.0098 * lean[1], 0.0]])
    normal, force = np.array([[0.0, 0.0, 1.0]]), 0.58 * np.array([[*lean, 0.0]])
    moment = ContactMoment(0.0, HOME, point, normal, force, np.array([1e-4]))
    figure = contact_figure(picture, picture, moment, "a scene")
    figure.draw_without_rendering()
    axis = figure.axes[1]
    frame, words = axis.get_window_extent(), [text for text in axis.texts if text.get_text()]
    assert len(words) == 3  # the bar's length, the normal, the force
    for text in words:
        box = text.get_window_extent()
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1
