"""The engine where meshes touch: stiffness, continuity, sides, holes, register, capacity."""

import math

import numpy as np
import pytest
from naive_engine import pose, rotation, turn, waves

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from contact.naive_meshes import (
    STIFFNESS,
    ball_mesh,
    block,
    blocks,
    brick,
    engine_of,
    holed_plate,
    hook,
    roller,
    slab,
    slide,
    thing,
    touch,
)

UP = np.array([0.0, 0.0, 1.0])
PRESS = 1e-3
SPEED = 50e-3
"""Of the slides [m/s]: 50 um a tick."""


def ripple(amplitude, wavelength):
    """Return `amplitude * cos(2 pi u / wavelength)`."""
    u = (np.arange(128) + 0.5) * wavelength / 128
    row = amplitude * np.cos(2 * np.pi * u / wavelength)
    return HeightField(np.tile(row, (4, 1)), wavelength / 128, "wrap")


def along_x(start, end, z, y=0.0, q=(1.0, 0, 0, 0), step=SPEED * 1e-3):
    return [pose(x, y, z, q) for x in np.arange(start, end, step)]


def both(first, second):
    """Return the quaternion of two turns (wxyz) after one another, the second one first."""
    q = rotation(pose(0, 0, 0, first)) * rotation(pose(0, 0, 0, second))
    return np.roll(q.as_quat(), 1)


# How stiff.


@pytest.mark.parametrize("half", [0.2e-3, 0.7e-3, 2e-3, 5e-3, 12e-3])
@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_flat_contact_has_the_stiffness_k_however_wide(half, yaw):
    """One patch or four: the force is k times the depth, and a centred tool feels no torque."""
    engine = engine_of(brick((half, 0.7 * half, 1e-3)), slab(half=20e-3), patch_radius=2.5e-3)
    counts = set()
    for depth in (1e-6, 1e-5, 1e-4, 5e-4, 1.5e-3):
        found = touch(engine, pose(1e-3, -2e-3, 1e-3 - depth, turn(UP, yaw)))
        counts.add(len(found.depth))
        assert found.weight.sum() == pytest.approx(1.0, abs=1e-12)
        assert found.depth == pytest.approx(np.full(len(found.depth), depth), abs=1e-9)
        expected = [0, 0, STIFFNESS * depth, 0, 0, 0]
        assert found.wrench == pytest.approx(expected, abs=1e-6 * STIFFNESS * depth)
    assert max(counts) <= 4
    if half == 0.2e-3:
        assert counts == {1}
    if half == 12e-3:
        assert counts == {4}


def test_a_round_tool_on_a_mesh_has_the_stiffness_k():
    for tool in (Body("tool", [Geom("sphere", (1.5e-3,))]), thing("tool", ball_mesh(1.5e-3, 3))):
        engine = engine_of(tool, slab())
        lowest = 1.5e-3
        if not isinstance(tool, Body):
            lowest = -tool.body.mesh.vertices[:, 2].min()
        for depth in (1e-5, 1e-4, 1e-3):
            found = touch(engine, pose(1e-3, -2e-3, lowest - depth))
            assert found.wrench[:3] == pytest.approx([0, 0, STIFFNESS * depth], rel=1e-6, abs=1e-9)


def boxes(count, texture=None, half=15e-3):
    """Return a plate of `count` x `count` boxes."""
    side = half / count
    middles = side * (2.0 * np.arange(count) + 1.0) - half
    return Body(
        "plate",
        [Geom("box", (side, side, 2e-3), (x, y, -2e-3)) for x in middles for y in middles],
        texture,
    )


TOOLS = {
    "mesh": lambda texture: brick((4e-3, 3e-3, 1e-3), texture=texture),
    "ball": lambda texture: Body("tool", [Geom("sphere", (1.5e-3,))]),
}
ENOUGH = 40_000
"""Boxes to look at: under the default of 4000 wide textured contacts spend their budget."""
PATH = [(0.3e-3, 0.2e-3, 0.0, 0.0), (4.1e-3, -3.3e-3, 0.3, 0.0), (-7.6e-3, 7.4e-3, 0.2, 0.06),
        (2e-3, 7.5e-3, -0.5, 0.02), (13e-3, 2e-3, 0.3, 0.01)]  # fmt: skip


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("kind", TOOLS)
def test_how_a_plate_is_made_does_not_count(kind, textured):
    """Of 2 triangles or 8192: the same wrench at every pose, within 1 %."""
    texture = waves(40e-6, 1.3e-3) if textured else None
    tool = TOOLS[kind](waves(20e-6, 0.9e-3) if textured else None)
    lowest = 1e-3 if kind == "mesh" else 1.5e-3
    plates = [slab(cuts=n, texture=texture) for n in (1, 4, 16, 64)]
    check_alike(tool, lowest, plates)


@pytest.mark.parametrize("textured", [False, True])
def test_of_how_many_boxes_a_plate_is_does_not_count(textured):
    texture = waves(40e-6, 1.3e-3) if textured else None
    tool = TOOLS["mesh"](waves(20e-6, 0.9e-3) if textured else None)
    check_alike(tool, 1e-3, [slab(texture=texture), *(boxes(n, texture) for n in (1, 2, 4))])


def check_alike(tool, lowest, plates):
    """Hold the wrenches on all plates to those on the first: the force, and its arm by 40 um."""
    rows = []
    for plate in plates:
        engine = engine_of(tool, plate, max_nodes=ENOUGH)
        for x, y, yaw, tilt in PATH:
            q = both(turn(UP, yaw), turn([1, 0.5, 0], tilt))
            engine.reset()
            touch(engine, pose(x, y, lowest + 1e-3, q))
            found = touch(engine, pose(x, y, lowest - 2e-4, q))
            assert not found.status.any()
            rows.append(found.wrench)
    rows = np.array(rows).reshape(len(plates), len(PATH), 6)
    assert np.all(np.linalg.norm(rows[0, :, :3], axis=1) > 0.02)
    for which, other in enumerate(rows[1:], 1):
        for row, first in zip(other, rows[0], strict=True):
            size = np.linalg.norm(first[:3])
            assert np.linalg.norm(row[:3] - first[:3]) < 0.01 * size, which
            assert np.linalg.norm(row[3:] - first[3:]) < 0.01 * size * 4e-3, which


@pytest.mark.parametrize("tool_first", [False, True])
@pytest.mark.parametrize("half", [1e-3, 3e-3])
def test_where_the_scene_stands_does_not_count(half, tool_first):
    texture = waves(30e-6, 1.1e-3)
    tool = brick((half, 0.7 * half, 1e-3), texture=waves(20e-6, 0.7e-3))
    there = pose(0.3, -0.2, 0.1, turn([1, -2, 1], 1.3))
    scene = {"friction": 0.3, "centre": (1e-3, 0, 2e-4), "max_nodes": ENOUGH}
    here = engine_of(tool, slab(texture=texture), **scene)
    moved = engine_of(tool, slab(texture=texture), poses=[there], tool_first=tool_first, **scene)
    world = rotation(there)
    for s in np.linspace(0, 1, 20):
        at = pose(s * 1e-3, 2e-4, 1e-3 - 5e-5, turn([0.1, 0.1, 1], s))
        turned = (world * rotation(at)).as_quat()
        elsewhere = np.append(there[:3] + world.apply(at[:3]), np.roll(turned, 1))
        found, expected = touch(moved, elsewhere).wrench, touch(here, at).wrench
        size = np.linalg.norm(expected[:3])
        assert world.inv().apply(found[:3]) == pytest.approx(expected[:3], abs=1e-6 * size)
        assert world.inv().apply(found[3:]) == pytest.approx(expected[3:], abs=1e-8 * size)


@pytest.mark.parametrize("textured", [False, True])
def test_action_and_reaction(textured):
    """Which of two bodies is the tool does not count, where n is the same: flat on flat."""
    top, low = (waves(30e-6, 1.1e-3), waves(20e-6, 0.7e-3)) if textured else (None, None)
    small = block((3e-3, 2e-3, 1e-3))
    plate = slab(texture=low).body.mesh
    one = engine_of(thing("tool", small, top), thing("plate", plate, low), max_nodes=ENOUGH)
    two = engine_of(thing("tool", plate, low), thing("plate", small, top), max_nodes=ENOUGH)
    for x, y, yaw in ((0, 0, 0), (1.3e-3, -4e-4, 0.3), (5e-3, 2e-3, -1.0)):
        # The lines that split a footprint follow the ground's axes: patches are alike along them.
        at = pose(x, y, 1e-3 - 5e-5, turn(UP, 0.0 if textured else yaw))
        one.reset()
        two.reset()
        first = touch(one, at)
        back = rotation(at).inv()
        other = touch(two, np.append(-back.apply(at[:3]), np.roll(back.as_quat(), 1)))
        # The other engine's world is the first tool's frame, its centre of mass the plate's.
        force = rotation(at).apply(other.wrench[:3])
        torque = rotation(at).apply(other.wrench[3:])
        size = np.linalg.norm(first.wrench[:3])
        assert force == pytest.approx(-first.wrench[:3], abs=0.01 * size)
        about_plate = first.wrench[3:] + np.cross(at[:3], first.wrench[:3])
        # B is touched at A's place, a depth away: a moment of at most k delta times delta.
        assert torque == pytest.approx(-about_plate, abs=size * (first.depth.max() + 1e-5))


# How smooth.


def report(name, found):
    print(
        f"{name}: force {100 * found.largest_change:.2f} %, torque "
        f"{100 * found.largest_turn:.2f} % a tick, patches {sorted(set(found.count.tolist()))}"
    )


def slide_off(yaw, half=(4e-3, 4e-3, 2e-3), thing_=brick, press=PRESS, y=1e-3, **more):
    engine = engine_of(thing_(half), slab(**more))
    reach = 1.5 * max(half[:2])
    path = along_x(15e-3 - reach, 15e-3 + reach, half[2] - press, y, turn(UP, math.radians(yaw)))
    return slide(engine, path)


@pytest.mark.parametrize("half", [(4e-3, 4e-3, 2e-3), (8e-3, 3e-3, 2e-3)])
@pytest.mark.parametrize("yaw", [0, 20, 45, 80])
def test_sliding_off_an_edge_is_continuous(yaw, half):
    found = slide_off(yaw, half)
    report(f"off an edge, yawed {yaw}, {half}", found)
    # It turns sideways over the last millimetre, as deep as the tool is pressed.
    assert found.largest_change < 4.0 * SPEED * 1e-3 / PRESS
    assert found.largest_turn <= 4.0 * SPEED * 1e-3 / PRESS
    assert np.linalg.norm(found.wrench[-1]) == 0.0


@pytest.mark.parametrize("yaw", [0, 30])
def test_sliding_onto_an_edge_is_as_continuous(yaw):
    """Backwards in mid air, down, and on: as off, since nothing but the pose counts."""
    engine = engine_of(brick((4e-3, 4e-3, 2e-3)), slab())
    q = turn(UP, math.radians(yaw))
    there = slide(engine, along_x(12e-3, 18e-3, 1e-3, 0.0, q))
    back = slide(engine, along_x(12e-3, 18e-3, 1e-3, 0.0, q)[::-1])
    together = np.linalg.norm(there.wrench) > 0
    assert together
    assert back.wrench[::-1] == pytest.approx(there.wrench, abs=1e-6)


SEAMS = {
    "boxes": lambda: boxes(4),
    "finer boxes": lambda: boxes(8),
    "patches": lambda: slab(cuts=16),
    "lists": lambda: thing(
        "plate",
        blocks(np.linspace(-15e-3, 15e-3, 6), [-15e-3, 15e-3], [-4e-3, 0]),
        pieces=[
            [(x + a, y, z) for a in (0, 6e-3) for y in (-15e-3, 15e-3) for z in (-4e-3, 0)]
            for x in np.linspace(-15e-3, 9e-3, 5)
        ],
    ),
}


@pytest.mark.parametrize("seams", SEAMS)
@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_seams_of_a_plate_are_not_felt(seams, tilt):
    """As on a plate of one piece, to a thousandth."""
    tool = brick((4e-3, 3e-3, 2e-3))
    q = both(turn(UP, 0.35), turn([0, 1, 0], tilt))
    path = along_x(-8e-3, 8e-3, 2e-3 - 3e-4, 1e-3, q)
    found, whole = (
        slide(engine_of(tool, SEAMS[seams]()), path),
        slide(engine_of(tool, slab()), path),
    )
    report(f"over {seams}, tilted {tilt}", found)
    size = np.linalg.norm(whole.wrench[:, :3], axis=1).max()
    assert np.abs(found.wrench - whole.wrench)[:, :3].max() < 1e-3 * size
    assert np.abs(found.wrench - whole.wrench)[:, 3:].max() < 1e-3 * size * 5e-3


@pytest.mark.parametrize("kind", ["ball", "flat"])
def test_a_tool_that_has_climbed_an_edge_feels_the_top_alone(kind):
    """Slid from beside a plate over its edge, as deep as 0.3 mm (ball), a 30 um lip (flat)."""
    ball = Body("tool", [Geom("sphere", (1.5e-3,))])
    tool, low, press = (
        (ball, 1.5e-3, 3e-4) if kind == "ball" else (brick((4e-3, 4e-3, 2e-3)), 2e-3, 3e-5)
    )
    found = slide(engine_of(tool, slab()), along_x(-22e-3, -3e-3, low - press))
    assert found.wrench[-1, :3] == pytest.approx([0, 0, STIFFNESS * press], rel=0.01)


def test_two_plates_flush_with_each_other_do_not_hold_a_tool():
    """Two bodies side by side: what is felt is along the normal, once or twice k delta."""
    left, right = (
        thing(name, block((10e-3, 15e-3, 2e-3), (x, 0, -2e-3)))
        for name, x in (("left", -10e-3), ("right", 10e-3))
    )
    press = 3e-5
    engine = engine_of(brick((4e-3, 4e-3, 2e-3)), left, right)
    found = slide(engine, along_x(-8e-3, 8e-3, 2e-3 - press))
    assert np.all(found.wrench[:, 2] > 0.99 * STIFFNESS * press)
    assert np.all(found.wrench[:, 2] < 2.01 * STIFFNESS * press)
    assert np.abs(found.wrench[:, 0]).max() < 0.1 * STIFFNESS * press


def test_a_ball_over_a_large_ball_turns_its_force_smoothly():
    """Facets of the ground bend by 3.6 degrees: over a ridge the tool turns about it.

    Its middle goes round the ridge on a circle of its own radius, by a tick's way over that.
    """
    ground = thing("plate", ball_mesh(20e-3, 4))
    turned = SPEED * 1e-3 * (21.5 / 20) / 1.5e-3
    print(f"over a ridge a force turns by {100 * turned:.2f} % a tick")
    # A mesh has corners: their force turns at once, by the bend of a ridge of either, at most.
    corners = 1.2 * (1.05 / 2**3 + 1.05 / 2**4)
    for tool, most in (
        (Body("tool", [Geom("sphere", (1.5e-3,))]), turned),
        (thing("tool", ball_mesh(1.5e-3, 3)), turned + corners),
    ):
        away = 20e-3 + 1.5e-3 - 3e-4
        angles = np.arange(-0.3, 0.3, SPEED * 1e-3 / 20e-3)
        path = [pose(away * math.sin(a), 0.1e-3, away * math.cos(a)) for a in angles]
        found = slide(engine_of(tool, ground), path)
        report(f"ball on ball ({type(tool).__name__})", found)
        assert np.all(found.count >= 1)
        assert found.largest_change < 1.05 * most


def test_a_roller_over_the_edge_of_a_box():
    """It drops over the edge: as fast as its depth falls, no faster."""
    ground, radius = slab(), 3e-3
    lying = turn([1, 0, 0], math.pi / 2)
    tool = thing("tool", roller(radius, 4e-3, 96))
    engine = engine_of(tool, ground)
    sink = 5e-4
    path = [pose(x, 0, radius - sink, lying) for x in np.arange(10.017e-3, 19e-3, SPEED * 1e-3)]
    found = slide(engine, path)
    report("roller over an edge", found)
    # Past the edge the ball of the rim lies lower by its sagitta: the slope of a circle.
    beyond = np.clip(np.array([p[0] for p in path]) - 15e-3, 0, None)
    depth = np.maximum(sink - (radius - np.sqrt(radius**2 - np.minimum(beyond, radius) ** 2)), 0)
    fall = np.abs(np.diff(depth)).max() / sink
    print(f"its depth falls by {100 * fall:.2f} % a tick")
    # The slope by which the force leans grows too, and so does the part that fades.
    assert found.largest_change < 2.0 * fall
    assert found.count[-1] == 0


@pytest.mark.parametrize("half", [(2.2e-3, 1.6e-3, 2e-3), (6e-3, 5e-3, 2e-3)])
def test_every_change_of_the_number_of_patches_is_smooth(half):
    """Tilting, yawing, lifting and sliding on a rough plate, out over its edges and back.

    No edge is left wholly: coming back, the tool would meet the plate's side.
    """
    tool, plate = brick(half), slab(texture=waves(20e-6, 9e-3))
    path = []
    for p in np.linspace(0, 1, 3000):
        tilt = turn([math.cos(9 * p), math.sin(9 * p), 0], 0.03 * math.sin(25 * p))
        q = both(turn(UP, 0.1 * math.sin(9 * p)), tilt)
        z = half[2] - 2.5e-4 + 1e-4 * math.sin(13 * p)
        x = (14e-3 + half[0]) * math.sin(5 * p)
        path.append(pose(x, 9e-3 * math.sin(3 * p), z, q))
    found = slide(engine_of(tool, plate), path)
    report(f"tumbling {half}", found)
    changed = np.flatnonzero(np.diff(found.count))
    force = np.linalg.norm(found.wrench[:, :3], axis=1).max()
    jumps = np.linalg.norm(np.diff(found.wrench[:, :3], axis=0), axis=1) / force
    assert len(changed) >= 3
    print(f"at {len(changed)} changes of the number of patches: {100 * jumps[changed].max():.2f} %")
    assert jumps.max() < 0.02


def test_turning_on_an_edge_is_continuous():
    """A flat tool that overhangs an edge yaws in place: only its top is touched."""
    engine = engine_of(brick((6e-3, 5e-3, 2e-3)), slab())
    tilt = turn([1, 0.3, 0], 0.01)
    path = [
        pose(-11.5e-3, 4.7e-3, 1.5e-3, both(turn(UP, a), tilt)) for a in np.arange(1.4, 2.2, 2e-3)
    ]
    found = slide(engine, path)
    report("yawing on an edge", found)
    assert found.largest_change < 0.02
    assert np.abs(found.wrench[:, :2]).max() < 0.1 * found.wrench[:, 2].max()


def test_over_an_edge_the_tool_is_pushed_out_the_shorter_way():
    engine = engine_of(brick((4e-3, 4e-3, 2e-3)), slab())
    for x in np.arange(12e-3, 18.95e-3, 1e-4):
        wide = 19e-3 - x
        force = touch(engine, pose(x, 0, 1e-3)).wrench[:3]
        if wide > 1.5001 * PRESS:  # its weight begins there
            assert force == pytest.approx([0, 0, STIFFNESS * PRESS])
        elif wide <= PRESS / 1.6:
            assert force == pytest.approx([STIFFNESS * wide, 0, 0])
        least = STIFFNESS * min(wide, PRESS)
        assert 0.5 * least < np.linalg.norm(force) < 1.1 * least


# Which side.


def through(kind, texture):
    """Push a tool into a plate of 3 mm, and from the far side back."""
    tool, lowest = {
        "tall brick": (brick((1.5e-3, 1.5e-3, 4e-3)), 4e-3),
        "capsule": (Body("tool", [Geom("capsule", (1.2e-3, 3e-3))]), 4.2e-3),
        "brick": (brick((1.5e-3,) * 3), 1.5e-3),
        "ball": (Body("tool", [Geom("sphere", (1.5e-3,))]), 1.5e-3),
    }[kind]
    engine = engine_of(tool, slab(thick=3e-3, texture=texture))
    room, whole = (0.0 if texture is None else 30e-6), 3e-3 + 2.0 * lowest
    steps = np.arange(1, int(whole * 1e4)) * 1e-4
    for depth in np.concatenate([steps, steps[::-1]]):
        found = touch(engine, pose(1e-4, 2e-4, lowest - depth))
        # The way out on the other side is the rest; one half as long again does not count.
        if max(depth, whole - depth) < 1.55 * min(depth, whole - depth) + 4.0 * room:
            continue
        up = depth < whole - depth
        least = depth if up else whole - depth
        assert found.weight.sum() == pytest.approx(1.0), depth
        normal = UP if up else [0, 0, -1]
        assert found.normal == pytest.approx(np.tile(normal, (len(found.depth), 1))), depth
        assert found.depth == pytest.approx(np.full(len(found.depth), least), abs=1e-9 + room)
        force = STIFFNESS * found.mean_depth
        assert found.wrench[2] == pytest.approx(force if up else -force, rel=1e-3)


@pytest.mark.parametrize("texture", [None, waves(30e-6, 1.1e-3)])
@pytest.mark.parametrize("kind", ["tall brick", "capsule", "brick", "ball"])
def test_in_a_thin_plate_the_nearer_side_counts_whatever_came_before(kind, texture):
    through(kind, texture)


@pytest.mark.parametrize("kind", ["brick", "geom ball"])
def test_after_leaving_sideways_the_other_side_pushes_the_other_way(kind):
    tool = brick((1.5e-3,) * 3) if kind == "brick" else Body("tool", [Geom("sphere", (1.5e-3,))])
    engine = engine_of(tool, slab(thick=3e-3))
    for depth in np.arange(1, 24) * 1e-4:
        assert touch(engine, pose(10e-3, 0, 1.5e-3 - depth)).wrench[2] > 0.0
    # Out over the edge at x = 15 mm, down, back below the plate, and up against it.
    for x in np.arange(10e-3, 18e-3, 1e-4):
        touch(engine, pose(x, 0, 1.5e-3 - 2.3e-3))
    for z in np.arange(-0.8e-3, -6e-3, -1e-4):
        assert not touch(engine, pose(18e-3, 0, z)).wrench.any()
    for x in np.arange(18e-3, 10e-3, -1e-4):
        assert not touch(engine, pose(x, 0, -6e-3)).wrench.any()
    for depth in np.arange(1, 23) * 1e-4:
        found = touch(engine, pose(10e-3, 0, -3e-3 - 1.5e-3 + depth))
        assert found.wrench[2] == pytest.approx(-STIFFNESS * depth)


def test_a_path_leaves_no_trace():
    """The wrench is that of a first pose, whatever came before."""
    engine = engine_of(brick((1.5e-3,) * 3), slab(thick=3e-3))
    rng = np.random.default_rng(1)
    places = rng.uniform([-16e-3, -16e-3, -5e-3], [16e-3, 16e-3, 2e-3], (200, 3))
    after = [touch(engine, pose(*place)).wrench for place in places]
    for place, wrench in zip(places, after, strict=True):
        engine.reset()
        assert touch(engine, pose(*place)).wrench == pytest.approx(wrench, abs=1e-9)


# What is hollow.


@pytest.mark.parametrize("kind", ["brick", "roller", "cylinder"])
def test_a_peg_feels_the_hole_and_not_the_hull(kind):
    hole = 3e-3
    tool = {
        "brick": lambda: brick((2.5e-3, 2.5e-3, 6e-3)),
        "roller": lambda: thing("tool", roller(2.5e-3, 6e-3, 48)),
        "cylinder": lambda: Body("tool", [Geom("cylinder", (2.5e-3, 6e-3))]),
    }[kind]()
    engine = engine_of(tool, holed_plate(hole))
    for z in np.arange(8e-3, -6e-3, -2e-4):
        found = touch(engine, pose(0, 0, z))
        assert not found.wrench.any(), z
        assert len(found.depth) == 0
    room = 0.5e-3
    for push in (-1e-4, 1e-5, 1e-4, 4e-4, 1e-3, 4e-4, 1e-4):
        for step in np.linspace(0, 1, 5):
            del step
            found = touch(engine, pose(room + push, 1e-4, -2e-3))
        if push < 0.0:
            assert not found.wrench.any()
            continue
        assert found.normal == pytest.approx(np.tile([-1.0, 0, 0], (len(found.depth), 1)))
        expected = [-STIFFNESS * push, 0, 0]
        assert found.wrench[:3] == pytest.approx(expected, abs=1e-6 * STIFFNESS * push)
    # Into a corner: each of two walls at a right angle has the whole stiffness.
    for push in np.linspace(0, 2e-4, 5):
        found = touch(engine, pose(room + push, room + push, -2e-3))
    if kind == "brick":
        assert found.wrench[:3] == pytest.approx(
            [-STIFFNESS * 2e-4, -STIFFNESS * 2e-4, 0], rel=1e-6
        )


def test_a_peg_that_stands_on_the_rim_feels_the_top():
    engine = engine_of(brick((2.5e-3, 2.5e-3, 6e-3)), holed_plate(3e-3))
    for x in (6e-3, 8e-3):
        engine.reset()
        touch(engine, pose(x, 0, 7e-3))
        found = touch(engine, pose(x, 0, 6e-3 - 1e-4))
        assert found.normal == pytest.approx(np.tile(UP, (len(found.depth), 1)))
        assert found.wrench[2] <= STIFFNESS * 1.0001e-4
    assert found.wrench[2] > 0.0


@pytest.mark.parametrize("kind", ["brick", "geom ball"])
def test_the_far_arm_of_a_hook_is_not_met(kind):
    """Two arms 3 mm apart: the upper one pushes up, the lower one is not paired with its top."""
    size = 1e-3
    tool = brick((size,) * 3) if kind == "brick" else Body("tool", [Geom("sphere", (size,))])
    engine = engine_of(tool, hook())
    for depth in np.arange(1, 15) * 1e-4:
        found = touch(engine, pose(5e-3, 0, size - depth))
        assert found.wrench[2] == pytest.approx(STIFFNESS * depth)
    engine.reset()
    # In the mouth: a gap of 3 mm for a tool of 2 mm.
    for z in (-2e-3 - 1.5e-3, -2e-3 - 1.2e-3, -2e-3 - 1.9e-3):
        assert not touch(engine, pose(5e-3, 0, z)).wrench.any()
    for depth in np.arange(1, 10) * 1e-4:
        up = touch(engine, pose(5e-3, 0, -2e-3 - size + depth))
        assert up.wrench[2] == pytest.approx(-STIFFNESS * depth)
    for z in np.linspace(-2e-3 - size, -5e-3 + size, 10):
        touch(engine, pose(5e-3, 0, z))
    for depth in np.arange(1, 10) * 1e-4:
        down = touch(engine, pose(5e-3, 0, -5e-3 + size - depth))
        assert down.wrench[2] == pytest.approx(STIFFNESS * depth)


def test_a_hook_held_as_a_tool_feels_its_near_arm():
    """It reaches round the edge of a plate of 2 mm: the plate lies in a mouth of 3 mm."""
    bar = thing("plate", block((20e-3, 20e-3, 1e-3)))
    for direction in (1, -1):
        engine = engine_of(hook(name="tool"), bar)
        # The mouth is from -5 to -2 mm in the hook's frame, and open towards x.
        for z in (4.5e-3 - 1e-3 * direction * s for s in (0.2, 0.3, 0.2)):
            assert not touch(engine, pose(-24e-3, 0, z - 1e-3)).wrench.any()
        free = 3e-3 if direction == 1 else 4e-3
        for depth in np.arange(1, 10) * 1e-4:
            found = touch(engine, pose(-24e-3, 0, free - direction * depth))
            expected = direction * STIFFNESS * depth
            assert found.wrench[2] == pytest.approx(expected, rel=1e-6)


# In register.


@pytest.mark.parametrize("half", [1e-3, 5e-3])
def test_two_waved_plates_in_and_out_of_register(half):
    """Equal waves, shifted by s: the crests of the sum are 2 A cos(pi s / L) high, everywhere."""
    amplitude, length, sink = 50e-6, 0.5e-3, 0.2e-3
    tool = brick((half, half, 1e-3), texture=ripple(amplitude, length))
    engine = engine_of(tool, slab(texture=ripple(amplitude, length)))
    for shift in (0.0, 0.1, 0.25, 0.4, 0.5, 1.0):
        engine.reset()
        touch(engine, pose(shift * length, 0, 3e-3))
        found = touch(engine, pose(shift * length, 0, 1e-3 - sink))
        rise = 2 * amplitude * abs(math.cos(math.pi * shift))
        normal = STIFFNESS * (sink + rise)
        assert found.wrench[2] == pytest.approx(normal, rel=1e-4), shift
        if shift in (0.0, 1.0):
            assert np.abs(found.wrench[:2]).max() < 1e-6 * normal
        elif shift < 0.5:
            slope = 2 * amplitude * math.pi / length * math.sin(math.pi * shift)
            assert found.wrench[0] == pytest.approx(normal * slope, rel=1e-3), shift


@pytest.mark.parametrize("texture", [None, ripple(50e-6, 0.5e-3)])
@pytest.mark.parametrize("half", [1e-3, 5e-3])
def test_a_centred_flat_tool_feels_no_torque(half, texture):
    """In register too: to a tenth of the half width, since the tied places are samples.

    The wide one has more than the 1024 places that are kept: their middle is off by more.
    """
    tool = brick((half, half, 1e-3), texture=texture)
    for name in ("mesh", "box"):
        plate = slab(texture=texture) if name == "mesh" else boxes(1, texture)
        found = touch(engine_of(tool, plate, max_nodes=ENOUGH), pose(0, 0, 0.95e-3))
        allowed = 1e-6 if texture is None else (0.1 if half == 1e-3 else 0.5)
        assert np.abs(found.wrench[3:]).max() < allowed * found.wrench[2] * half


def test_a_closed_path_over_one_patch_does_no_work():
    """A ball on a gentle mesh plate: one patch, one n; the textures never make it leap."""
    ground = slab(texture=waves(10e-6, 8e-3))
    engine = engine_of(Body("tool", [Geom("sphere", (1.5e-3,))]), ground)
    net = gross = 0.0
    axis, count = np.array([0.6, 0.0, 0.8]), 256
    for p in 2 * math.pi * np.arange(count) / count:
        place = np.array([math.cos(p), math.sin(p), 0.02 * math.sin(2 * p)])
        speed = 1e-3 * np.array([-math.sin(p), math.cos(p), 0.04 * math.cos(2 * p)])
        at = np.append(1e-3 * place + [0, 0, 1.3e-3], turn(axis, 0.05 * math.sin(p)))
        found = touch(engine, at)
        assert len(found.depth) == 1
        power = found.wrench[:3] @ speed + 0.05 * math.cos(p) * (found.wrench[3:] @ axis)
        net += power * 2 * math.pi / count
        gross += abs(power) * 2 * math.pi / count
    print(f"net over gross work: {net / gross:.1e}")
    assert gross > 1e-8
    assert abs(net) < 1e-6 * gross


def test_work_round_a_whole_scene_is_nothing():
    """n and patches change, and the tool slides off an edge and on again."""
    engine = engine_of(brick((4e-3, 3e-3, 2e-3)), slab(texture=waves(15e-6, 4e-3)), friction=0.0)
    net = gross = 0.0
    count = 1500
    last = None
    for p in np.append(2 * math.pi * np.arange(count) / count, 2 * math.pi):
        q = turn([0.3 * math.cos(p), 0.2 * math.sin(p), 1.0], 0.3 * math.sin(p))
        at = pose(11e-3 + 4e-3 * math.cos(p), 3e-3 * math.sin(p),
                  1.7e-3 + 1e-4 * math.sin(3 * p), q)  # fmt: skip
        wrench = touch(engine, at).wrench
        if last is not None:
            turned = (rotation(at) * rotation(last[0]).inv()).as_rotvec()
            mean = 0.5 * (wrench + last[1])
            work = mean[:3] @ (at[:3] - last[0][:3]) + mean[3:] @ turned
            net, gross = net + work, gross + abs(work)
        last = at, wrench
    print(f"net over gross work of a slide off and on an edge: {net / gross:.1e}")
    assert abs(net) < 1e-3 * gross


# Too much.


def bumpy(name, half, cuts, seed):
    """Return a plate on (a tool over) z = 0, bumpy there, of `cuts` x `cuts` pairs."""
    mesh = block((half, half, 1e-3), (0, 0, -1e-3 if name == "plate" else 1e-3), cuts)
    vertices = mesh.vertices.copy()
    on = np.abs(vertices[:, 2]) < 1e-9
    vertices[on, 2] += 2e-5 * np.random.default_rng(seed).standard_normal(np.count_nonzero(on))
    return thing(name, mesh_from_arrays(vertices, mesh.faces))


def test_too_many_pairs_of_facets_are_flagged():
    """Two plates of 8192 small facets face to face: no room for them all, and it says so."""
    engine = engine_of(bumpy("tool", 8e-3, 64, 1), bumpy("plate", 8e-3, 64, 2))
    for z in (1e-3, 1e-4, 0.0, -1e-4, -1e-3):
        found = touch(engine, pose(1e-4, 0, z, turn(UP, 0.1)))
        assert all(np.isfinite(values).all() for values in found)
        if z < 1e-3:  # farther away no facets are near each other
            assert engine.contacts.count[1] > 0, z
        if found.wrench.any():
            assert np.any(found.status == 2), z
    assert found.wrench[2] > 0.0
    # A small tool has room on the same plate.
    small = engine_of(brick((4e-4, 4e-4, 1e-3)), bumpy("plate", 8e-3, 64, 2))
    touch(small, pose(0, 0, 2e-3))
    found = touch(small, pose(0, 0, 1e-3 - 1e-4))
    assert found.wrench[2] > 0.0
    assert not np.any(found.status == 2)
    assert small.contacts.count[1] == 0


def test_where_nothing_is_found_for_want_of_room_it_is_flagged_too():
    """With dozens of bodies there is no room for all patches: the rows that there are say so."""
    grounds = [
        thing(f"tile{i}", block((3e-3, 3e-3, 1e-3), (6.5e-3 * (i % 6 - 2.5),
                                                     6.5e-3 * (i // 6 - 2.5), -1e-3)))
        for i in range(36)
    ]  # fmt: skip
    engine = engine_of(brick((20e-3, 20e-3, 2e-3)), *grounds)
    touch(engine, pose(0, 0, 3e-3))
    found = touch(engine, pose(0, 0, 2e-3 - 1e-4))
    assert np.isfinite(found.wrench).all()
    full = 36 * STIFFNESS * 1e-4
    assert found.wrench[2] == pytest.approx(full, rel=1e-6) or np.any(found.status == 2)
