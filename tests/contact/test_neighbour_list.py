"""Neighbour lists: the wrench is that of a full BVH traversal in every tick."""

import numpy as np
import pytest
from naive_engine import pose
from scipy.spatial.transform import Rotation

from asperity._core.kernels import kernel
from asperity.contact.broad_phase.facet_pairs import (
    half_diagonal,
    largest_displacement,
    pair_limits,
)
from asperity.contact.broad_phase.neighbour_list import (
    RelativePose,
    _rebuild_from_bvh,
    neighbour_pairs,
)
from asperity.contact.broad_phase.neighbour_records import clear_lists, neighbour_list
from asperity.contact.narrow_phase.steep_plane import FLATTEST
from asperity.geometry.poses import rotated
from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.tool_contact import ToolContact
from contact.naive_meshes import ball_mesh, engine_of, slab, thing

DT = 1e-3


def wrenches(engine, path, anew):
    """Return the wrench at each pose; with empty lists in each tick if `anew`."""
    engine.reset()
    out = []
    for there in path:
        if anew:
            clear_lists(engine._mesh.memory.lists)
        out.append(engine.wrench(there, DT).copy())
    return np.array(out)


def has_outer_list(engine):
    """Return whether there is an outer list."""
    return engine._mesh.memory.lists.outer.state["count"].max() >= 0


def assert_lists_change_nothing(engine, path):
    anew, listed = wrenches(engine, path, True), wrenches(engine, path, False)
    size = np.abs(anew).max()
    assert size > 0.0
    np.testing.assert_allclose(listed, anew, rtol=0.0, atol=1e-9 * size)


@pytest.mark.parametrize(("scene", "count"), [("file-cad", 120), ("hammer-blocks", 240)])
@pytest.mark.parametrize("speed", [0.01, 0.1, 0.6])
def test_a_tool_of_a_scene_that_slides_and_tilts(scene, count, speed):
    """Slowly, as a hand moves, and so fast that no list stays valid for a tick."""
    scene = load_scene(scene).changed(force={"anti_alias": "off"})
    engine = ToolContact(scene).engine
    start = touching_pose(engine, scene.start)
    start[2] -= 5e-4
    s = np.linspace(0.0, 1.0, count)[:, None]
    way = speed * DT * count * s * [0.8, 0.6, 0.0] - 2e-4 * np.sin(9.0 * s) * [0.0, 0.0, 1.0]
    tilt = 0.5 * speed * np.sin(7.0 * s) * [0.7, 0.4, 1.0]
    path = np.array([rotated(start, turn) for turn in tilt])
    path[:, :3] += way
    assert_lists_change_nothing(engine, path)
    assert has_outer_list(engine) == (speed < 0.5)


def test_a_ball_that_rolls_and_jumps():
    """Every facet of the ball comes round; a jump invalidates all lists."""
    radius = 3e-3
    engine = engine_of(thing("tool", ball_mesh(radius, 3)), slab(half=10e-3))
    x = np.concatenate([np.linspace(-6e-3, 6e-3, 150), np.linspace(0.0, 3e-3, 50)])
    out = radius - 1e-4
    path = [rotated(pose(a, 1e-3, out), np.array([0.0, a / radius, 0.3 * a / radius])) for a in x]
    assert_lists_change_nothing(engine, path)


@kernel
def _listed(table, tool, transform, limits, step, lists, facets):
    pose = RelativePose(tool, 1 - tool, 1 - tool, transform, half_diagonal(table, tool), step)
    return neighbour_pairs(table, pose, pair_limits(*limits), lists, facets)


@kernel
def _traversed(table, tool, transform, limits, lists, facets):
    pose = RelativePose(tool, 1 - tool, 1 - tool, transform, half_diagonal(table, tool), 0.0)
    return _rebuild_from_bvh(table, pose, pair_limits(*limits), lists, facets)


def as_numbers(pairs):
    """Return one number for each pair of facets."""
    return pairs.astype(np.int64) @ [1 << 32, 1]


@pytest.mark.parametrize("speed", [2e-5, 1e-4])
@pytest.mark.parametrize(
    ("cuts", "rolls", "often"),
    [(3, False, False), (3, True, False), (5, True, False), (3, False, True)],
)
def test_no_facet_that_is_near_is_missed(cuts, speed, rolls, often):
    """Pair by pair, two balls of small facets: one moves around the other, pressed in turns.

    (A test with large facets might not notice limits that are too narrow.)
    """
    large, small = 15e-3, 6e-3
    engine = engine_of(thing("tool", ball_mesh(small, 2)), thing("plate", ball_mesh(large, cuts)))
    table, facets = engine._mesh.model.facets, engine._mesh.space.region.facets
    tool = engine._scene.tool
    lists, anew = neighbour_list(2), neighbour_list(2)
    deeper, ticks, ends = (5e-4, 50, 25) if often else (1.4e-3, 150, 120)
    missed = several = outer = 0
    for tick in range(900):
        s = speed * tick / large
        out = large + small - 1.2e-3 - 2e-4 * np.sin(0.07 * tick)
        there = pose(out * np.sin(s), out * np.sin(0.6 * s) * np.cos(s), 0.0)
        there[2] = np.sqrt(out**2 - there[0] ** 2 - there[1] ** 2)
        turn = np.sin([0.9 * s, 0.7 * s, 1.3 * s]) if rolls else np.zeros(3)
        transform = np.column_stack([Rotation.from_rotvec(turn).as_matrix(), there[:3]])
        # The depth that a contact may have changes abruptly where one ends.
        max_depth, reach = (deeper if tick % ticks > ends else 2e-4), 1e-4
        limits = (max_depth, reach, FLATTEST)
        count = _listed(table, tool, transform, limits, 1.2 * speed, lists, facets)
        got = as_numbers(facets.pairs[:count])
        # Less reach, as two corners may be farther apart than any side of their facets shows.
        limits = (max_depth, 0.3 * reach, FLATTEST)
        count = _traversed(table, tool, transform, limits, anew, facets)
        want = as_numbers(anew.inner.pairs[1 - tool, :count])
        missed += np.count_nonzero(~np.isin(want, got))
        several += len(want)
        outer += lists.outer.state["count"][1 - tool] >= 0
    assert missed == 0
    assert several > 900 * 20
    # The outer list of the finer ball fits only where it is narrow.
    assert (outer > 600) == (cuts == 3 or speed < 5e-5), outer


@kernel
def _moved(table, a, before, after):
    return largest_displacement(table, a, before, after), half_diagonal(table, a)


def test_no_point_moves_farther_than_the_bound_and_no_direction_turns_more():
    """For a long tool that rotates about a point in it, as when it is held."""
    engine = ToolContact(load_scene("file-cad")).engine
    table, a = engine._mesh.model.facets, engine._scene.tool
    rng = np.random.default_rng(3)
    root = table.root[a]
    corners = table.middle[root] + table.reach[root] * rng.choice([-1.0, 1.0], (64, 3))
    sharp, count = [], 300
    for _ in range(count):
        one, other = Rotation.random(random_state=rng), Rotation.from_rotvec(rng.normal(0, 0.1, 3))
        pivot = rng.uniform(-1.0, 1.0, 3) * table.reach[root]
        before = np.column_stack([one.as_matrix(), rng.normal(0, 0.01, 3)])
        turned_on = (other * one).as_matrix()
        drift = rng.normal(0, 1e-4, 3)
        after = np.column_stack([turned_on, before @ np.append(pivot, 1.0) - turned_on @ pivot])
        after[:, 3] += drift
        bound, size = _moved(table, a, before, after)
        placed = np.column_stack([corners, np.ones(64)])
        most = np.linalg.norm(placed @ (after - before).T, axis=1).max()
        bent = np.linalg.svd(after[:, :3] - before[:, :3], compute_uv=False)[0]
        assert bound >= most * (1.0 - 1e-12)
        assert bound >= bent * size * (1.0 - 1e-12)
        assert bound <= max(most, bent * size) * (1.0 + 1e-9)
        sharp.append(bound / most)
    assert np.median(sharp) < 1.5
