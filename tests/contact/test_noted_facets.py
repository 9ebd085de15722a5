"""What facets are near is noted for some ticks: a tool feels as if they were looked for in each."""

import numpy as np
import pytest
from naive_engine import pose
from scipy.spatial.transform import Rotation

from asperity._core.kernels import kernel
from asperity.contact.broad_phase.facet_pairs import moved_since, size_of
from asperity.contact.broad_phase.neighbour_list import _take_from_all, near_pairs
from asperity.contact.broad_phase.neighbour_records import note_nothing, noted_facets
from asperity.contact.narrow_phase.surface_patch import FLATTEST
from asperity.geometry.poses import rotated
from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.tool_contact import ToolContact
from contact.naive_meshes import ball_mesh, engine_of, slab, thing

DT = 1e-3


def felt(engine, path, anew):
    """Return the wrench at each pose; with nothing noted before, if `anew`."""
    engine.reset()
    out = []
    for there in path:
        if anew:
            note_nothing(engine._facets.memory.noted)
        out.append(engine.wrench(there, DT).copy())
    return np.array(out)


def is_taken_from_outer(engine):
    """Return whether there is an outer ring."""
    return engine._facets.memory.noted.outer.holds[:, 3].max() >= 0.0


def assert_noted_is_as_good_as_new(engine, path):
    anew, noted = felt(engine, path, True), felt(engine, path, False)
    size = np.abs(anew).max()
    assert size > 0.0
    np.testing.assert_allclose(noted, anew, rtol=0.0, atol=1e-9 * size)


@pytest.mark.parametrize(("scene", "count"), [("file-cad", 120), ("hammer-blocks", 240)])
@pytest.mark.parametrize("speed", [0.01, 0.1, 0.6])
def test_a_tool_of_a_scene_that_slides_and_tilts(scene, count, speed):
    """Slowly, as a hand does, and so fast that what is noted holds for no tick."""
    scene = load_scene(scene).changed(force={"anti_alias": "off"})
    engine = ToolContact(scene).engine
    start = touching_pose(engine, scene.start)
    start[2] -= 5e-4
    s = np.linspace(0.0, 1.0, count)[:, None]
    way = speed * DT * count * s * [0.8, 0.6, 0.0] - 2e-4 * np.sin(9.0 * s) * [0.0, 0.0, 1.0]
    tilt = 0.5 * speed * np.sin(7.0 * s) * [0.7, 0.4, 1.0]
    path = np.array([rotated(start, turn) for turn in tilt])
    path[:, :3] += way
    assert_noted_is_as_good_as_new(engine, path)
    assert is_taken_from_outer(engine) == (speed < 0.5)


def test_a_ball_that_rolls_and_jumps():
    """Every facet of the ball comes round; and a jump leaves nothing of what was noted."""
    radius = 3e-3
    engine = engine_of(thing("tool", ball_mesh(radius, 3)), slab(half=10e-3))
    x = np.concatenate([np.linspace(-6e-3, 6e-3, 150), np.linspace(0.0, 3e-3, 50)])
    out = radius - 1e-4
    path = [rotated(pose(a, 1e-3, out), np.array([0.0, a / radius, 0.3 * a / radius])) for a in x]
    assert_noted_is_as_good_as_new(engine, path)


@kernel
def _near(table, a, b, way, near, reach, speed, noted, facing):
    return near_pairs(table, a, b, way, near, reach, speed, noted, facing)


@kernel
def _wanted(table, a, b, way, near, reach, noted, facing):
    return _take_from_all(table, a, b, way, near, reach, FLATTEST, noted, facing)


@pytest.mark.parametrize("speed", [2e-5, 1e-4])
@pytest.mark.parametrize(
    ("cuts", "rolls", "often"),
    [(3, False, False), (3, True, False), (4, True, False), (3, False, True)],
)
def test_no_facet_that_is_near_is_missed(cuts, speed, rolls, often):
    """Pair by pair, two balls of small facets: one goes round the other, pressed by turns.

    Where facets are large, what is too narrow may not be seen.
    """
    large, small = 15e-3, 6e-3
    engine = engine_of(thing("tool", ball_mesh(small, 2)), thing("plate", ball_mesh(large, cuts)))
    table, facing = engine._facets.table, engine._facets.space.footprint.facing
    a = engine._tool
    b = 1 - a
    noted, anew = noted_facets(2), noted_facets(2)
    deeper, ticks, ends = (5e-4, 50, 25) if often else (1.4e-3, 150, 120)
    missed = several = outer = 0
    for tick in range(900):
        s = speed * tick / large
        out = large + small - 1.2e-3 - 2e-4 * np.sin(0.07 * tick)
        there = pose(out * np.sin(s), out * np.sin(0.6 * s) * np.cos(s), 0.0)
        there[2] = np.sqrt(out**2 - there[0] ** 2 - there[1] ** 2)
        turn = np.sin([0.9 * s, 0.7 * s, 1.3 * s]) if rolls else np.zeros(3)
        way = np.column_stack([Rotation.from_rotvec(turn).as_matrix(), there[:3]])
        # How deep a contact may be changes at once where one ends.
        near, reach = (deeper if tick % ticks > ends else 2e-4), 1e-4
        count = _near(table, a, b, way, near, reach, 1.2 * speed, noted, facing)
        got = {tuple(pair) for pair in facing.pairs[:count].tolist()}
        # Two corners may be farther apart than any side of either can tell.
        count = _wanted(table, a, b, way, near, 0.3 * reach, anew, facing)
        want = {tuple(pair) for pair in anew.inner.pairs[b, :count].tolist()}
        missed += len(want - got)
        several += len(want)
        outer += noted.outer.holds[b, 3] >= 0.0
    assert missed == 0
    assert several > 900 * 20
    # There is room for the outer ring of the finer one where it is narrow.
    assert (outer > 600) == (cuts == 3 or speed < 5e-5)


@kernel
def _moved(table, a, before, after):
    return moved_since(table, a, before, after), size_of(table, a)


def test_no_point_moves_farther_than_is_said_and_no_direction_turns_more():
    """Of a long tool that is turned about a place in it, as it is held."""
    engine = ToolContact(load_scene("file-cad")).engine
    table, a = engine._facets.table, engine._tool
    rng = np.random.default_rng(3)
    root = table.root[a]
    corners = table.middle[root] + table.reach[root] * rng.choice([-1.0, 1.0], (64, 3))
    sharp, count = [], 300
    for _ in range(count):
        one, other = Rotation.random(random_state=rng), Rotation.from_rotvec(rng.normal(0, 0.1, 3))
        held = rng.uniform(-1.0, 1.0, 3) * table.reach[root]
        before = np.column_stack([one.as_matrix(), rng.normal(0, 0.01, 3)])
        turned_on = (other * one).as_matrix()
        drift = rng.normal(0, 1e-4, 3)
        after = np.column_stack([turned_on, before @ np.append(held, 1.0) - turned_on @ held])
        after[:, 3] += drift
        said, size = _moved(table, a, before, after)
        placed = np.column_stack([corners, np.ones(64)])
        most = np.linalg.norm(placed @ (after - before).T, axis=1).max()
        bent = np.linalg.svd(after[:, :3] - before[:, :3], compute_uv=False)[0]
        assert said >= most * (1.0 - 1e-12)
        assert said >= bent * size * (1.0 - 1e-12)
        assert said <= max(most, bent * size) * (1.0 + 1e-9)
        sharp.append(said / most)
    assert np.median(sharp) < 1.5
