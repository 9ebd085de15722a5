"""Constraint-based simulation of a tool on its coupling, over height fields of full detail."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flat_foot import PLACES, at_place, centre_of_pressure, foot_on_smooth_plate

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.constraint import ConstraintMethod, tiles_of
from asperity.studies.comparison import stimuli

RADIUS = 1.5e-3


@pytest.fixture(scope="module")
def renderer():
    return METHODS["constraint"].prepare(stimuli.ball_on_plate(2.0 * RADIUS))


def surface_of_the_centre(x):
    """Return how high the centre of a ball at x can be at least [m], from the waves' offset."""
    u = x + np.linspace(-0.8, 0.8, 20001) * RADIUS
    waves = stimuli.AMPLITUDE * np.cos(2.0 * math.pi / stimuli.WAVELENGTH * u)
    return float((waves + np.sqrt(RADIUS**2 - (u - x) ** 2)).max())


@pytest.mark.parametrize("boxes", [1, 4])
def test_a_flat_foot_on_a_smooth_plate_feels_the_coupling_under_its_middle(boxes):
    scene = foot_on_smooth_plate(boxes)
    renderer = METHODS["constraint"].prepare(scene)
    assert renderer.wrench(scene.start).contacts == 0
    for depth, (x, y) in zip((1e-4, 3e-4, 2e-4), PLACES, strict=True):
        felt = renderer.wrench(at_place(scene, x, y, depth))
        expected = [0.0, 0.0, scene.force.stiffness * depth]
        np.testing.assert_allclose(felt.force, expected, atol=0.01 * expected[2])
        assert np.abs(centre_of_pressure(felt)).max() < 5e-5
        assert felt.depth == pytest.approx(depth, rel=0.01)


def test_a_ball_that_was_set_down_rests_on_the_offset_of_the_waves(renderer):
    for x in np.linspace(-2.1e-3, 2.2e-3, 9):
        renderer.reset()
        pose = np.array([x, 0.0, surface_of_the_centre(x) - 1e-4, 1.0, 0.0, 0.0, 0.0])
        felt = renderer.wrench(pose)
        place = renderer.data.qpos[:3]
        assert place[2] - surface_of_the_centre(place[0]) == pytest.approx(0.0, abs=2e-6)
        np.testing.assert_allclose(felt.force, 4000.0 * (place - pose[:3]), atol=0.02)


def test_a_slow_slide_follows_the_offset_of_the_waves(renderer):
    renderer.reset()
    x = np.arange(-2e-3, 2e-3, 1e-5)  # 10 mm/s
    poses = np.tile([0.0, 0.0, 1.3e-3, 1.0, 0.0, 0.0, 0.0], (len(x), 1))
    poses[:, 0] = x
    off, along = [], []
    for pose in poses:
        along.append(renderer.wrench(pose).force[0])
        place = renderer.data.qpos
        off.append(place[2] - surface_of_the_centre(place[0]))
    assert np.abs(off).max() < 6e-6  # the largest as it drops from crest to crest
    assert np.median(np.abs(off)) < 1e-6
    assert max(along) > 0.1
    assert min(along) < -0.1
    assert renderer.truncated == 0


def test_a_hand_that_leaps_sets_the_tool_down_anew(renderer):
    one, other = (np.array([x, 0.0, 1.4e-3, 1.0, 0.0, 0.0, 0.0]) for x in (-2e-3, 0.3e-3))
    renderer.reset()
    alone = renderer.wrench(other)
    renderer.reset()
    renderer.wrench(one)
    after = renderer.wrench(other)
    np.testing.assert_array_equal(alone.force, after.force)
    np.testing.assert_array_equal(alone.torque, after.torque)


def test_a_foot_on_waves_has_room_for_all_its_contacts():
    scene = stimuli.foot_on_plate()
    renderer = METHODS["constraint"].prepare(scene)
    pose = at_place(scene, 0.0, 0.0, 0.0)
    for _ in range(3):
        pose[:3] += [5e-5, 0.0, -2e-5]
        felt = renderer.wrench(pose)
    assert felt.contacts > 100
    assert renderer.truncated == 0
    assert abs(centre_of_pressure(felt)[1]) < 5e-5


def test_a_coupling_that_turns_in_the_air_is_felt_and_dies_out(renderer):
    renderer.reset()
    pose = np.array([0.0, 0.0, 5e-3, 1.0, 0.0, 0.0, 0.0])
    assert not renderer.wrench(pose).torque.any()
    pose[3:] = [math.cos(0.01), 0.0, 0.0, math.sin(0.01)]
    torques = [renderer.wrench(pose).torque for _ in range(40)]
    assert torques[0][2] < 0.0  # the tool lags behind
    assert np.abs(torques[-1]).max() < 1e-3 * np.abs(torques[0]).max()
    force = renderer.wrench(pose).force
    assert np.abs(force).max() < 1e-9


def test_tiles_have_the_heights_of_the_texture():
    scene = stimuli.ball_on_plate(boxes=4)
    plate = next(body for body in scene.bodies if body.name == "plate")
    tiles = list(tiles_of(plate, 10_000, 100))
    area = sum(4.0 * tile.size[0] * tile.size[1] for tile in tiles)
    assert area == pytest.approx(stimuli.PLATE[0] * stimuli.PLATE[1])
    assert 4 <= len(tiles) <= 100
    for tile in tiles[::7]:
        rows, columns = tile.heights.shape
        x = tile.position[0] + np.linspace(-tile.size[0], tile.size[0], columns)
        waves = stimuli.AMPLITUDE * np.cos(2.0 * math.pi / stimuli.WAVELENGTH * x)
        top = 0.5 * stimuli.PLATE[2] + np.tile(waves, (rows, 1))
        heights = tile.position[2] + tile.heights * tile.size[2]
        np.testing.assert_allclose(heights, top, atol=1e-8)


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_the_meshes_of_the_papers_scenes_are_refused_in_one_line(name):
    reason = METHODS["constraint"].can(load_scene(name))
    assert reason is not None
    assert "is a mesh" in reason
    assert "\n" not in reason


def test_parameters_out_of_range_are_refused():
    with pytest.raises(AsperityError, match="mass must be"):
        ConstraintMethod(mass=-1.0)
    with pytest.raises(AsperityError, match="substeps must lie between 1 and 100"):
        ConstraintMethod(substeps=0)
