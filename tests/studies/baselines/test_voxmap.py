"""Voxmap and pointshell, against what McNeely et al. (1999) say of it."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy import spatial

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.studies.baselines import voxmap
from asperity.studies.baselines.displaced_surfaces import area, displaced_surface, spacing_for
from asperity.studies.baselines.placement import Standing
from asperity.studies.baselines.voxmap import Pointshell, Voxmap, VoxmapRenderer
from asperity.studies.comparison import stimuli
from asperity.texture.patterns.patterns import sinusoid

SIZE, K = 1e-3, 400.0
GROUND = Body("ground", [Geom("plane", (0.0, 0.0))])
DOWN = (0.0, 0.0, -1.0)


def renderer(points, normals, grid=None, centre=(0.0, 0.0, 0.0)):
    shell = Pointshell(np.atleast_2d(points).astype(float), np.atleast_2d(normals).astype(float))
    grid = Voxmap(np.zeros((0, 0, 0), np.uint8), np.zeros(3), SIZE) if grid is None else grid
    there = Standing(GROUND, np.eye(3), np.zeros(3))
    return VoxmapRenderer(shell, [(grid, there)], np.array(centre), K)


def at(x, y, z):
    return np.array([x, y, z, 1.0, 0.0, 0.0, 0.0])


def test_the_force_is_that_of_the_plane_through_the_voxels_middle_across_the_points_normal():
    one = renderer((0.0, 0.0, 0.0), DOWN)
    # In the surface's voxel, a quarter of it below its middle.
    felt = one.wrench(at(3e-4, 3e-4, -0.75 * SIZE))
    np.testing.assert_allclose(felt.force, [0.0, 0.0, K * 0.25 * SIZE], atol=1e-12)
    assert felt.depth == pytest.approx(0.25 * SIZE)
    # Above the middle the plane is not reached.
    assert one.wrench(at(3e-4, 3e-4, -0.25 * SIZE)).contacts == 0
    tilted = np.array([math.sin(0.5), 0.0, -math.cos(0.5)])
    felt = renderer((0.0, 0.0, 0.0), tilted).wrench(at(5e-4, 5e-4, -0.9 * SIZE))
    np.testing.assert_allclose(felt.force, -K * 0.4 * SIZE * math.cos(0.5) * tilted, atol=1e-12)


def test_from_voxel_to_voxel_the_force_jumps():
    tilt = 0.3
    one = renderer((0.0, 0.0, 0.0), (math.sin(tilt), 0.0, -math.cos(tilt)))
    before = one.wrench(at(SIZE - 1e-9, 5e-4, -0.9 * SIZE)).depth
    after = one.wrench(at(SIZE + 1e-9, 5e-4, -0.9 * SIZE)).depth
    assert before - after == pytest.approx(SIZE * math.sin(tilt), rel=1e-4)
    # A surface along the voxels is felt without steps: a layer deeper is a voxel deeper.
    level = renderer((0.0, 0.0, 0.0), DOWN)
    depths = [level.wrench(at(0.0, 0.0, z)).depth for z in np.linspace(-0.6e-3, -6e-3, 50)]
    np.testing.assert_allclose(np.diff(depths), 5.4e-3 / 49, rtol=1e-6)


@pytest.mark.parametrize(("points", "counted"), [(1, 1), (4, 4), (10, 10), (11, 10), (500, 10)])
def test_stiffness_grows_with_the_points_up_to_ten(points, counted):
    many = renderer(np.zeros((points, 3)), np.tile(DOWN, (points, 1)))
    felt = many.wrench(at(0.0, 0.0, -2e-3))
    assert felt.contacts == points
    assert felt.force[2] == pytest.approx(K * counted * 1.5e-3)


def test_torque_is_about_the_centre_of_mass():
    one = renderer((2e-3, 0.0, 0.0), DOWN, centre=(0.0, 1e-3, 5e-3))
    felt = one.wrench(at(0.01, 0.0, -1e-3 - 1e-9))
    arm = np.array([2e-3, 0.0, 0.0]) - [0.0, 1e-3, 5e-3]
    np.testing.assert_allclose(felt.torque, np.cross(arm, felt.force), atol=1e-15)


def test_a_tick_costs_as_many_times_more_as_there_are_points():
    # Both beyond what caches hold.
    counts = (600_000, 2_400_000)
    away = [renderer(np.tile([0.0, 0.0, 1.0], (n, 1)), np.tile(DOWN, (n, 1))) for n in counts]
    laps = np.empty((13, 2))
    for lap in laps:
        # By turns, so that a busy machine slows both.
        for i, one in enumerate(away):
            begun = time.thread_time()
            one.wrench(at(0.0, 0.0, 0.0))
            lap[i] = time.thread_time() - begun
    few, many = laps[1:].min(axis=0)
    # Four times as many: a cost that does not grow has 1 here, one by pairs of points 16.
    assert 1.5 < many / few < 12.0


def test_layers_count_from_the_surface_inwards():
    half = 3e-3, 2e-3, 1e-3
    grid = voxmap.build_voxmap(Body("block", [Geom("box", half)]), 1e-4)
    codes = grid.codes.astype(int)
    inside = codes > 1
    # Each layer is as many voxels from the nearest that are not inside, rounded.
    outside = spatial.KDTree(np.argwhere(~inside))
    exact, _ = outside.query(np.argwhere(inside))
    np.testing.assert_array_equal(codes[inside], 1 + np.floor(exact + 0.5))
    taken = np.argwhere(codes)
    middle = codes[tuple((taken.min(axis=0) + taken.max(axis=0)) // 2)] - 1
    assert middle == codes.max() - 1
    assert middle == pytest.approx(min(half) / grid.size, abs=1.0)


@pytest.mark.parametrize("textured", [False, True])
def test_a_box_closes_round_its_inside_textured_or_not(textured):
    texture = sinusoid(wavelength=2e-3, amplitude=1e-4) if textured else None
    body = Body("block", [Geom("box", (3e-3, 2e-3, 1e-3))], texture)
    grid = voxmap.build_voxmap(body, 5e-5)
    room = np.count_nonzero(grid.codes) * grid.size**3
    # The surface's voxels count whole, half of them lies outside.
    room -= 0.5 * np.count_nonzero(grid.codes == 1) * grid.size**3
    assert room == pytest.approx(6e-3 * 4e-3 * 2e-3, rel=0.06 if textured else 0.03)


def test_the_voxmap_of_a_plate_has_no_walls_between_its_boxes():
    one, nine = (stimuli.ball_on_plate(boxes=boxes).bodies for boxes in (1, 9))
    maps = [voxmap.build_voxmap(next(b for b in bodies if b.name == "plate"), 1e-4)
            for bodies in (one, nine)]  # fmt: skip
    assert maps[0].codes.shape == maps[1].codes.shape
    # Samples lie elsewhere, so that voxels which the surface just grazes come and go (1.5 % differ,
    # by a layer); a wall or a gap between boxes is ten layers deep.
    off = np.abs(maps[0].codes.astype(int) - maps[1].codes)
    assert off.max() <= 2
    assert np.count_nonzero(off) < 0.03 * off.size


def test_a_displaced_surface_has_the_area_and_the_height_of_its_texture():
    body = Body(
        "block", [Geom("box", (5e-3, 5e-3, 2e-3))], sinusoid(wavelength=2e-3, amplitude=1e-4)
    )
    surface = displaced_surface(body, 1e-4)
    top = surface.points[surface.normals[:, 2] > 0.5]
    assert top[:, 2].max() == pytest.approx(2.1e-3, abs=1e-6)
    assert top[:, 2].min() >= 1.9e-3 - 1e-6
    smooth = displaced_surface(body, 1e-4, smooth=True)
    assert area(smooth) == pytest.approx(2 * 1e-4 + 4 * 4e-5, rel=1e-6)
    across = np.cross(
        surface.points[surface.faces[:, 1]] - surface.points[surface.faces[:, 0]],
        surface.points[surface.faces[:, 2]] - surface.points[surface.faces[:, 0]],
    )
    outwards = np.sum(across * surface.normals[surface.faces[:, 0]], axis=1)
    assert np.mean(outwards >= -1e-18) > 0.99


def test_a_sheet_without_inside_and_a_textured_plane_without_end_are_refused():
    with pytest.raises(AsperityError, match="encloses no voxel of 5 mm"):
        voxmap.build_voxmap(Body("thin", [Geom("box", (5e-3, 5e-3, 1e-4))]), 5e-3)
    plane = Body("ground", [Geom("plane", (0.0, 0.0))], sinusoid(wavelength=2e-3, amplitude=1e-4))
    assert "textured unbounded plane" in str(voxmap.finite_reason(plane))


HALF = tuple(0.5 * side for side in stimuli.PLATE)


def plate_of_cells(n):
    """Return the plate as a mesh whose faces have n x n cells, or n along its thickness."""
    points, faces = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        lines = [np.linspace(-HALF[i], HALF[i], n + 1) for i in (u, v)]
        for sign in (-1.0, 1.0):
            first = sum(map(len, points))
            face = np.empty((n + 1, n + 1, 3))
            face[..., axis] = sign * HALF[axis]
            face[..., u], face[..., v] = np.meshgrid(*lines, indexing="ij")
            points.append(face.reshape(-1, 3))
            i, j = (k.ravel() + 0 for k in np.meshgrid(range(n), range(n), indexing="ij"))
            a = first + i * (n + 1) + j
            b, c, d = a + n + 1, a + n + 2, a + 1
            both = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
            faces.append(both if sign > 0.0 else both[:, ::-1])
    vertices, number = np.unique(np.round(np.concatenate(points), 12), axis=0, return_inverse=True)
    mesh = mesh_from_arrays(vertices, number.ravel()[np.concatenate(faces)])
    return Body("plate", [Geom("mesh", HALF)], mesh=mesh)


def plate_of_boxes(boxes):
    bodies = stimuli.ball_on_plate(boxes=boxes).smooth().bodies
    return next(body for body in bodies if body.name == "plate")


PLATES = {f"{n}x{n} cells": (plate_of_cells, n) for n in (1, 2, 4, 8, 16, 32)}
PLATES |= {f"{n} boxes": (plate_of_boxes, n) for n in (1, 4)}


@pytest.mark.parametrize("plate", PLATES)
@pytest.mark.parametrize("size", [1e-4, 2.5e-4])
def test_a_flat_foot_feels_the_law_in_its_middle_however_the_plate_is_made(plate, size):
    make, parts = PLATES[plate]
    body = make(parts)
    grid = voxmap.build_voxmap(body, size)
    foot = next(b for b in stimuli.foot_on_plate().smooth().bodies if b.name == "probe")
    # The middle of the voxels in which the top lies.
    middle = grid.corner[2] + (math.floor((HALF[2] - grid.corner[2]) / size) + 0.5) * size
    for points in (500, 1000, 2000, 4000):
        pitch = spacing_for(foot, points)
        shell = voxmap.build_pointshell(displaced_surface(foot, 0.5 * pitch, smooth=True), pitch)
        there = Standing(body, np.eye(3), np.zeros(3))
        one = VoxmapRenderer(shell, [(grid, there)], np.zeros(3), K)
        sole = np.count_nonzero(shell.normals[:, 2] < -0.99)
        for depth in (1.5e-4, 3e-4):
            felt = one.wrench(at(0.0, 0.0, HALF[2] + stimuli.FOOT[2] - depth))
            # Points of the sides touch too and push inwards: they count in N, not in the force.
            law = K * sole * (middle - HALF[2] + depth) * 10.0 / felt.contacts
            assert felt.force[2] == pytest.approx(law, rel=0.05)
            centre = np.array([-felt.torque[1], felt.torque[0]]) / felt.force[2]
            assert np.abs(centre).max() < 5e-5
            # Opposite sides cancel but for where their points lie in the voxels.
            assert np.abs(felt.force[:2]).max() < 0.1 * felt.force[2]


def test_the_plates_voxels_do_not_depend_on_its_cells():
    codes = [voxmap.build_voxmap(plate_of_cells(n), 1e-4).codes for n in (1, 8, 32)]
    for other in codes[1:]:
        np.testing.assert_array_equal(codes[0], other)
