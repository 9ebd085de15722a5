"""Penalty contact of displaced meshes through python-fcl."""

from __future__ import annotations

import numpy as np
import pytest
from flat_foot import (
    PLACES,
    at_place,
    centre_of_pressure,
    foot_on_smooth_plate,
)

from asperity.geometry.displaced.sheet import facing_outwards, grid_triangles
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.crossing_curve import crossing_segments, middle_of, vector_area
from asperity.studies.baselines.displaced_surfaces import DisplacedSurface
from asperity.studies.baselines.full_meshes import FullMeshMethod, FullMeshRenderer, Meshes
from asperity.studies.baselines.placement import Standing
from asperity.studies.comparison import stimuli
from asperity.studies.comparison.measures import tangential_rms

pytest.importorskip("fcl")


def path(scene, height):
    poses = stimuli.straight_path(scene, 0.25)
    poses[:, 2] += height
    return poses


def test_it_gives_asperitys_force_by_another_way():
    scene = stimuli.ball_on_plate()
    poses = path(scene, -2e-4)
    own = METHODS["asperity"].prepare(scene)
    theirs = FullMeshMethod(points=60_000).prepare(scene)
    both = [(own.wrench(pose), theirs.wrench(pose)) for pose in poses]
    off = [abs(a.depth - b.depth) for a, b in both]
    assert max(off) < 5e-6
    a, b = (np.array([pair[k].force for pair in both]) for k in (0, 1))
    assert tangential_rms(a - b) < 0.2 * tangential_rms(a)


@pytest.mark.parametrize("boxes", [1, 4])
@pytest.mark.parametrize("points", [500, 4_000])
def test_a_flat_foot_on_a_smooth_plate_is_felt_under_its_middle(boxes, points):
    scene = foot_on_smooth_plate(boxes)
    renderer = FullMeshMethod(points=points).prepare(scene)
    assert renderer.wrench(scene.start).contacts == 0
    for depth, (x, y) in zip((1e-4, 3e-4, 2e-4), PLACES, strict=True):
        felt = renderer.wrench(at_place(scene, x, y, depth))
        assert felt.depth == pytest.approx(depth, abs=2e-6)
        np.testing.assert_allclose(felt.force, [0.0, 0.0, scene.force.stiffness * depth], atol=0.01)
        assert np.abs(centre_of_pressure(felt)).max() < 1e-6


@pytest.mark.parametrize("cells", [1, 2, 5, 32])
def test_it_does_not_matter_how_a_flat_plate_is_meshed(cells):
    plate, foot = block([12e-3, 6e-3, 2e-3], cells), block([6e-3, 3e-3, 2e-3], 3)
    there = Standing(None, np.eye(3), np.array([0.0, 0.0, -1e-3]))
    renderer = FullMeshRenderer(
        Meshes(foot, foot), [(Meshes(plate, plate), there)], np.zeros(3), 4000.0, 1e-6
    )
    for x, y in ((0.0, 0.0), (1.3e-3, -0.7e-3), (-0.21e-3, 1.1e-3)):
        felt = renderer.wrench(np.array([x, y, 0.9e-3, 1.0, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(felt.force, [0.0, 0.0, 0.4], atol=0.01)
        assert np.abs(centre_of_pressure(felt, (3e-3, 1.5e-3, 1e-3))).max() < 1e-6


def block(sides, cells):
    """Return a block whose faces have so many cells along each side."""
    at = np.linspace(-0.5, 0.5, cells + 1)
    points, normals, faces = [], [], []
    for axis in range(3):
        for sign in (-0.5, 0.5):
            face = np.zeros((cells + 1, cells + 1, 3))
            face[..., (axis + 1) % 3], face[..., (axis + 2) % 3] = np.meshgrid(at, at)
            face[..., axis] = sign
            w = np.zeros_like(face)
            w[..., axis] = 2.0 * sign
            triangles = grid_triangles(cells + 1, cells + 1)
            triangles = facing_outwards(face.reshape(-1, 3), w.reshape(-1, 3), triangles)
            faces.append(triangles + len(points) * len(w.reshape(-1, 3)))
            points.append((face * sides).reshape(-1, 3))
            normals.append(w.reshape(-1, 3))
    return DisplacedSurface(*map(np.concatenate, (points, normals, faces)))


def test_the_vector_area_of_a_crossing_is_that_of_the_part_inside():
    plate, foot = (block([4.0, 4.0, 2.0], n) for n in (2, 7))
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = foot.points * [0.5, 0.25, 0.5] + [1.5, 0.5, 1.25]
    one, two = moved[foot.faces] @ turn.T, plate.points[plate.faces] @ turn.T
    i, j = (k.ravel() for k in np.indices((len(one), len(two))))
    segments = crossing_segments(one[i], two[j])
    # The foot covers x 0.5 to 2.5 and y 0 to 1 of a plate up to x = 2, whose top is z = 1.
    top, side = 1.5 * 1.0, 1.0 * 0.25
    np.testing.assert_allclose(vector_area(segments) @ turn, [side, 0.0, top], atol=1e-9)


def test_the_middle_of_points_is_that_of_their_hull():
    n = np.array([0.0, 0.0, 1.0])
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float)
    many = np.concatenate([corners, np.tile(corners[:1], (50, 1)), [[0.1, 0.2, 0.0]]])
    np.testing.assert_allclose(middle_of(many, n), [1.0, 0.5, 0.0], atol=1e-12)
    line = np.linspace(0, 1, 9)[:, None] ** 3 * [[1.0, 2.0, 0.0]]
    np.testing.assert_allclose(middle_of(line, n)[:2], [0.5, 1.0], atol=1e-9)
    np.testing.assert_allclose(middle_of(line[:1], n), line[0])


def test_the_search_takes_up_where_it_was_and_finds_the_same():
    scene = stimuli.ball_on_plate()
    poses = path(scene, -2e-4)
    renderer = FullMeshMethod(points=20_000).prepare(scene)
    going = [renderer.wrench(pose).depth for pose in poses]
    anew = []
    for pose in poses:
        renderer.reset()
        anew.append(renderer.wrench(pose).depth)
    np.testing.assert_allclose(going, anew, atol=2e-6)
