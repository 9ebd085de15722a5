"""Contact levels of detail: when a contact is coarsened, and what is felt then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.bodies import Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.scene.builtin import load_scene
from asperity.scene.scene import scene_of
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.contact_levels import CONTACT_LEVELS, LevelsMethod, Metrics
from asperity.studies.comparison import stimuli

WAVES = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4}
FULL = LevelsMethod(metrics=Metrics(tolerance=0.0, gap_time=0.0))
STILL = LevelsMethod(metrics=Metrics(gap_time=0.0))


def slid(renderer, scene, height, speed=0.083):
    """Return forces (n, 3), and the levels and areas of the body's contacts, along the path."""
    poses = stimuli.straight_path(scene, speed)
    poses[:, 2] += height
    forces, levels, areas = [], [], []
    renderer.reset()
    for pose in poses:
        forces.append(renderer.wrench(pose).force)
        levels += [contact.levels[1] for contact in renderer.contacts]
        areas += [contact.area for contact in renderer.contacts]
    return np.array(forces), np.array(levels), np.array(areas)


def pad_on_plate(side):
    """Return a flat square pad with the plate's waves on a plate that is 6 mm longer."""
    half = 0.5 * side
    xml = f"""<mujoco model="pad"><worldbody>
      <body name="plate" pos="0 0 -0.001">
        <geom type="box" size="{half + 3e-3} {half + 1e-3} 0.001"/></body>
      <body name="probe" pos="0 0 0.001"><freejoint name="hand"/>
        <geom type="box" size="{half} {half} 0.001" mass="0.01"/></body>
    </worldbody></mujoco>"""
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {"plate": {"texture": WAVES}, "probe": {"texture": WAVES}},
        "force": {"stiffness": 4000.0},
        "trajectory": {"kind": "slide"},
    }
    return scene_of(xml, document, name="pad")


def test_a_wider_contact_is_taken_coarser_and_loses_its_texture():
    taken, changes = [], []
    for side in (0.8e-3, 3e-3, 6e-3):
        scene = pad_on_plate(side)
        felt, levels, areas = slid(STILL.prepare(scene), scene, -0.1e-3)
        full, finest, _ = slid(FULL.prepare(scene), scene, -0.1e-3)
        assert finest.max() == 0
        taken.append(levels.mean())
        changes.append(felt[:, 2].std() / full[:, 2].std())
        assert 0.8 < areas.mean() / side**2 < 1.2
    # Measured: levels 2, 3 and 3.9; 87, 42 and 18 % of the change of the normal force.
    assert np.all(np.diff(taken) > 0.5)
    assert changes[0] > 0.8
    assert np.all(np.diff(changes) < 0.0)
    assert changes[-1] < 0.25


def test_a_faster_contact_is_taken_coarser():
    scene = stimuli.ball_on_plate()
    renderer = CONTACT_LEVELS.prepare(scene)
    # The first tick has no speed.
    taken = [slid(renderer, scene, -3e-4, speed)[1][1:].mean() for speed in (0.05, 0.8, 3.0)]
    assert np.all(np.diff(taken) > 0.5)


def test_a_near_eye_asks_for_fine_levels_and_a_far_one_does_not():
    scene = stimuli.ball_on_plate()
    strict = Metrics(tolerance=0.0, gap_time=0.0)
    renderer = LevelsMethod(metrics=strict).prepare(scene)
    taken = []
    for away in (1e-3, 0.1, 1.0):
        renderer.metrics = replace(strict, eye=(0.0, -away, 0.0))
        taken.append(slid(renderer, scene, -3e-4)[1].mean())
    assert taken[0] < taken[1] < taken[2]


def test_a_small_ball_on_waves_four_times_its_size_feels_them_in_full():
    scene = stimuli.ball_on_plate(0.5e-3)
    felt, full = (slid(method.prepare(scene), scene, -3e-4)[0] for method in (STILL, FULL))
    # Measured: 99 % along the surface, 102 % across it.
    for axis in (0, 2):
        assert felt[:, axis].std() == pytest.approx(full[:, axis].std(), rel=0.15)


@pytest.mark.parametrize("tool", ["ball", "foot"])
def test_without_tolerance_it_has_the_depth_and_the_force_of_full_detail(tool):
    scene = stimuli.ball_on_plate() if tool == "ball" else stimuli.foot_on_plate()
    poses = stimuli.straight_path(scene, 0.25)
    poses[:, 2] -= 2e-4
    exact = METHODS["asperity"].prepare(scene)
    wanted = [exact.wrench(pose) for pose in poses]
    force = np.array([one.force for one in wanted])
    renderer = FULL.prepare(scene)
    off = []
    for tolerance in (1e-4, 1e-5, 0.0):
        renderer.metrics = Metrics(tolerance=tolerance, gap_time=0.0)
        felt = [renderer.wrench(pose) for pose in poses]
        away = np.array([one.force for one in felt]) - force
        off.append(np.sqrt((away**2).sum() / (force**2).sum()))
    assert off[0] > off[1] > off[2]
    # Measured: 4.9 % and 4.8 um (ball), 0.7 % and 0.6 um (foot).
    assert off[2] < 0.06
    np.testing.assert_allclose(
        [one.depth for one in felt], [one.depth for one in wanted], atol=6e-6
    )


def as_mesh(scene, cells):
    """Return a scene whose plate is a mesh, its top and bottom of cells x cells rectangles."""
    n = cells + 1
    half = 0.5 * np.array(stimuli.PLATE)
    x, y = np.meshgrid(*(np.linspace(-h, h, n) for h in half[:2]), indexing="ij")
    top = np.stack([x, y, np.full_like(x, half[2])], axis=-1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (at[i, j].ravel() for i, j in _CORNERS)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    ring = np.concatenate([at[:-1, 0], at[-1, :-1], at[:0:-1, -1], at[0, :0:-1]])
    low, following = len(top), np.roll(ring, -1)
    sides = [[ring, ring + low, following + low], [ring, following + low, following]]
    faces = [faces, faces[:, ::-1] + low, *(np.stack(side, axis=1) for side in sides)]
    points = np.concatenate([top, top * [1.0, 1.0, -1.0]])
    mesh = mesh_from_arrays(points, np.concatenate(faces), hard_angle=30.0)
    plate = next(body for body in scene.bodies if body.name == "plate")
    plate = replace(plate, mesh=mesh, geoms=(Geom("mesh", half),))
    return replace(scene, bodies=tuple(plate if b.name == "plate" else b for b in scene.bodies))


_INNER, _OUTER = slice(None, -1), slice(1, None)
_CORNERS = ((_INNER, _INNER), (_OUTER, _INNER), (_OUTER, _OUTER), (_INNER, _OUTER))


@pytest.mark.parametrize(
    "points",
    [500, 4000, *(pytest.param(points, marks=pytest.mark.slow) for points in (1000, 2000))],
)
@pytest.mark.parametrize("plate", [1, 2, 8, 32, "one box", "four boxes"])
def test_a_flat_contact_does_not_depend_on_meshing(points, plate):
    scene = stimuli.foot_on_plate().smooth()
    if plate == "four boxes":
        boxes = stimuli.ball_on_plate(boxes=4).smooth().bodies
        four = next(body for body in boxes if body.name == "plate")
        scene = replace(scene, bodies=tuple(four if b.name == "plate" else b for b in scene.bodies))
    elif plate != "one box":
        scene = as_mesh(scene, plate)
    pose = scene.start.copy()
    # Beside the middle, so that a centre of pressure that is drawn there would show.
    pose[:3] += [0.7e-3, 0.4e-3, -3e-4]
    for metrics in (Metrics(), FULL.metrics):
        renderer = LevelsMethod(metrics=metrics, points=points).prepare(scene)
        force = renderer.wrench(pose).force
        (contact,) = renderer.contacts
        np.testing.assert_allclose(force, [0.0, 0.0, 0.4], atol=0.02)
        np.testing.assert_allclose(contact.place[:2], pose[:2], atol=5e-5)


def test_what_cannot_be_sampled_and_no_points_are_refused():
    assert CONTACT_LEVELS.can(load_scene("probe-plate")) is None
    with pytest.raises(AsperityError, match="is a textured mesh: displaced, it opens"):
        CONTACT_LEVELS.prepare(load_scene("hammer-blocks"))
    with pytest.raises(AsperityError, match="number of points must be a finite number above 0"):
        LevelsMethod(points=0)
    with pytest.raises(AsperityError, match="tolerance must be a finite number, 0 or above"):
        Metrics(tolerance=-1.0)
