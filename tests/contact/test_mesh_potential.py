"""Contact between meshes has one potential: its gradient, its size, its work round closed paths."""

import math

import numpy as np
import pytest
from naive_engine import pose, waves
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene
from asperity.simulation.tool_contact import ToolContact
from contact.naive_meshes import (
    STIFFNESS,
    ball_mesh,
    block,
    blocks,
    box_corners,
    brick,
    engine_of,
    holed_plate,
    hull_mesh,
    roller,
    slab,
    thing,
    touch,
)

STEP, LEVER = 2e-8, 5e-3


def turned(at, by):
    """Return a pose moved by six coordinates: translation, and rotation about its origin."""
    q = Rotation.from_rotvec(by[3:]) * Rotation.from_quat(np.roll(at[3:], -1))
    return np.append(at[:3] + by[:3], np.roll(q.as_quat(), 1))


def first_pose(engine, at):
    engine.reset()
    return engine.wrench(at, 0.0).copy()


def gradient_error(engine, at):
    """Return how far the wrench is from differences of the energy, over its size, and its size."""
    wrench, falls = first_pose(engine, at), np.zeros(6)
    for k in range(6):
        by = np.zeros(6)
        by[k] = STEP if k < 3 else STEP / LEVER
        for sign in (1.0, -1.0):
            first_pose(engine, turned(at, sign * by))
            falls[k] -= sign * engine.energy / (2.0 * by[k])
    scale = np.array([1.0] * 3 + [1.0 / LEVER] * 3)
    size = np.linalg.norm(wrench * scale)
    return np.abs((wrench - falls) * scale).max() / max(size, 1e-12), np.linalg.norm(wrench[:3])


def anywhere(rng, angle):
    return np.roll(Rotation.from_rotvec(angle * rng.normal(size=3)).as_quat(), 1)


CASES = {
    "off an edge": (
        lambda: engine_of(brick((4e-3, 3e-3, 2e-3)), slab()),
        lambda rng: ([rng.uniform(11e-3, 19e-3), 0, 2e-3 - rng.uniform(0, 2e-4)], 0.02),
    ),
    "waves, off an edge": (
        lambda: engine_of(brick((4e-3, 3e-3, 2e-3)), slab(texture=waves(15e-6, 4e-3))),
        lambda rng: ([rng.uniform(11e-3, 19e-3), 0, 2e-3 - rng.uniform(0, 2e-4)], 0.02),
    ),
    "a corner over a corner": (
        lambda: engine_of(brick((2e-3,) * 3), slab(half=5e-3)),
        lambda rng: (np.array([5e-3, 5e-3, 2.6e-3]) + rng.uniform(-2e-3, 2e-3, 3) * [1, 1, 0.25],
                     1.0),
    ),
    "a brick in a hole": (
        lambda: engine_of(brick((3e-3,) * 3), holed_plate(3e-3)),
        lambda rng: (rng.uniform([-1e-4, -1e-4, -3e-3], [1e-4, 1e-4, -1e-3]), 0.01),
    ),
    "a ball on a ball": (
        lambda: engine_of(thing("tool", ball_mesh(2e-3, 2)), thing("plate", ball_mesh(6e-3, 3))),
        lambda rng: (7.9e-3 * (lambda v: v / np.linalg.norm(v))(rng.normal(size=3)), 3.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_wrench_is_the_gradient_of_the_energy(name):
    """But at kinks, which few poses lie within a step of."""
    make, place = CASES[name]
    engine, rng, errors = make(), np.random.default_rng(0), []
    while len(errors) < 25:
        where, angle = place(rng)
        error, size = gradient_error(engine, np.append(where, anywhere(rng, angle)))
        if size > 0.0:
            errors.append(error)
    print(f"{name}: median {np.median(errors):.1e}, largest {max(errors):.1e}")
    assert np.quantile(errors, 0.9) < 1e-6


def test_the_last_of_a_direction_goes_without_a_leap():
    """A prism on the edges of a cone: one of three directions vanishes between two others.

    Its residual goes to nothing, and the way out leapt by a hundredth where it did.
    """
    turn = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    base = 6e-3 * np.column_stack([np.cos(turn), np.sin(turn), -np.ones(12)])
    ring = 2e-3 * np.column_stack([np.cos(turn[::2]), np.sin(turn[::2]), np.ones(6)])
    corners = np.vstack([ring, ring * [1, 1, -1]])
    engine = engine_of(
        thing("tool", hull_mesh(corners)),
        thing("plate", hull_mesh(np.vstack([base, [0, 0, 6e-3]]))),
    )
    at = np.array([2.67932e-3, -2.23985e-3, 2.7708e-3, -0.790698, 0.548132, 0.038918, -0.269875])
    at[3:] /= np.linalg.norm(at[3:])
    way = np.array([0.484, -0.854, 0.191, 0.0, 0.0, 0.0])
    ways = []
    for s in np.arange(-14e-6, -6e-6, 5e-8):
        first_pose(engine, turned(at, s * way))
        ways.append(math.sqrt(2.0 * engine.energy / STIFFNESS))
    assert min(ways) > 9e-4
    assert np.abs(np.diff(ways)).max() < 2e-7
    errors = [
        gradient_error(engine, turned(at, s * way))[0] for s in (-9e-6, -8e-6, -4e-6, 0, 9e-6)
    ]
    assert max(errors) < 1e-6


def ways_out(one, two, q):
    """Return directions (n, 3) and how far (n,) two convex polyhedra overlap along them [m].

    For points (n, 3) [m] of the one, turned by q about the origin, and of the other: the normals of
    faces of both, and the cross products of their edges.
    """
    rotation = Rotation.from_quat(np.roll(q, -1)).as_matrix()
    hulls = ConvexHull(one @ rotation.T), ConvexHull(two)
    edges = []
    for hull in hulls:
        x = hull.points[hull.simplices]
        edges.append((x - np.roll(x, 1, axis=1)).reshape(-1, 3))
    across = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    size = np.linalg.norm(across, axis=1)
    across = across[size > 1e-9] / size[size > 1e-9, None]
    n = np.vstack([hulls[1].equations[:, :3], -hulls[0].equations[:, :3], across, -across])
    return n, (hulls[1].points @ n.T).max(0) - (hulls[0].points @ n.T).min(0)


def least_way_out(ways, place):
    """Return the least translation that separates the polyhedra, the one at a place (3,) [m]."""
    n, overlap = ways
    return (overlap - n @ place).min()


def random_polyhedra(rng, most=30):
    """Return corners (n, 3) [m] of two convex polyhedra, on spheres of 3 mm."""
    for _ in range(2):
        points = rng.normal(size=(rng.integers(6, most), 3))
        yield 3e-3 * points / np.linalg.norm(points, axis=1)[:, None]


def pressed_together(rng, one, two, depth, near=None):
    """Return a pose of the one from which it is `depth` [m] to leave the other.

    It comes from about where a corner `near` of the other points, from anywhere if it is None.
    """
    along, q = rng.normal(size=3), anywhere(rng, 3.0)
    if near is not None:
        along = 0.1 * along + near / np.linalg.norm(near)
    along, low, high = along / np.linalg.norm(along), 0.0, 2e-2
    ways = ways_out(one, two, q)
    for _ in range(40):
        middle = 0.5 * (low + high)
        is_deep = least_way_out(ways, along * middle) > depth
        low, high = (middle, high) if is_deep else (low, middle)
    return np.append(along * low, q)


def push(engine, at, least):
    """Return way out and force over those of the least translation [m], and the gradient error."""
    error, size = gradient_error(engine, at)
    first_pose(engine, at)
    way_out = math.sqrt(2.0 * engine.energy / STIFFNESS)
    return way_out / least, size / (STIFFNESS * least), error


def compared(pushes):
    """Return ways out, forces and errors of some pushes; print their ranges."""
    taken, forces, errors = zip(*pushes, strict=True)
    print(f"way out {min(taken):.2f} to {max(taken):.2f} of the least, "
          f"force {min(forces):.2f} to {max(forces):.2f}")  # fmt: skip
    return taken, forces, errors


@pytest.mark.parametrize("at_corners", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_random_polyhedra_are_pushed_by_the_least_that_frees_them(seed, at_corners):
    rng, found = np.random.default_rng(seed), []
    for _ in range(3):
        one, two = random_polyhedra(rng)
        engine = engine_of(thing("tool", hull_mesh(one)), thing("plate", hull_mesh(two)))
        for _ in range(10):
            depth, near = rng.uniform(5e-5, 3e-4), two[rng.integers(len(two))]
            at = pressed_together(rng, one, two, depth, near if at_corners else None)
            found.append(push(engine, at, depth))
            assert engine.contacts.count[1] == 0
    taken, forces, errors = compared(found)
    assert min(taken) > 0.85
    assert max(taken) < 1.06
    assert min(forces) > 0.65
    assert max(forces) < 1.1
    assert np.quantile(errors, 0.85) < 1e-6


def least_translation(one, two, rng):
    """Return the least translation [m] that separates convex bodies, points (n, 3), by descent."""

    def overlap(n):
        return (n @ two.T).max(-1) - (n @ one.T).min(-1)

    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    n = n[np.argsort(overlap(n))[:20]]
    for step in np.geomspace(0.1, 1e-6, 50):
        tried = n[:, None] + step * rng.normal(size=(20, 40, 3))
        tried /= np.linalg.norm(tried, axis=2)[..., None]
        tried = np.concatenate([n[:, None], tried], axis=1)
        n = tried[np.arange(20), overlap(tried).argmin(1)]
    return overlap(n).min()


def convex_mesh(rng):
    kind, size = rng.integers(4), rng.uniform(4e-3, 9e-3)
    if kind < 2:
        points = rng.normal(size=(rng.integers(40, 150), 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        return hull_mesh(size * points * rng.uniform(0.5, 1.0, 3))
    if kind == 2:
        return roller(size, size * rng.uniform(0.3, 1.5), 80)
    return block(size * rng.uniform(0.4, 1.0, 3))


@pytest.mark.parametrize("seed", range(4))
def test_convex_meshes_of_many_faces_are_pushed_by_the_least_that_frees_them(seed):
    """Where a corner of B met a face of A the force was up to 1.7 k times the least."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(6):
        meshes = [convex_mesh(rng), hull_mesh(convex_mesh(rng).vertices)]
        one, two = (np.array(mesh.vertices) for mesh in meshes)
        engine = engine_of(*(thing(name, m) for name, m in zip("ab", meshes, strict=True)))
        along, q = rng.normal(size=3), anywhere(rng, 3.0)
        along /= np.linalg.norm(along)
        turned_one = Rotation.from_quat(np.roll(q, -1)).apply(one)
        low, high, depth = 0.0, 4e-2, rng.uniform(5e-5, 3e-4)
        for _ in range(11):
            middle = 0.5 * (low + high)
            is_deep = least_translation(turned_one + middle * along, two, rng) > depth
            low, high = (middle, high) if is_deep else (low, middle)
        least = least_translation(turned_one + low * along, two, rng)
        at = np.append(low * along, q)
        found.append(push(engine, at, least))
    taken, forces, errors = compared(found)
    assert min(taken) > 0.9
    assert max(taken) < 1.06
    assert min(forces) > 0.8
    assert max(forces) < 1.1
    assert np.quantile(errors, 0.8) < 1e-6


def test_the_way_out_of_polyhedra_never_leaps():
    """Directions, patches and crossing edges come and go, each without a step."""
    rng = np.random.default_rng(0)
    for turn in range(16):
        one, two = random_polyhedra(rng)
        engine = engine_of(thing("tool", hull_mesh(one)), thing("plate", hull_mesh(two)))
        near = two[rng.integers(len(two))] if turn % 2 else None
        at, way = pressed_together(rng, one, two, 2e-4, near), rng.normal(size=6)
        way *= np.array([1.0] * 3 + [1.0 / LEVER] * 3) / np.linalg.norm(way)
        last = None
        for s in np.arange(-1.5e-4, 1.5e-4, 2e-7):
            first_pose(engine, turned(at, s * way))
            length = math.sqrt(2.0 * engine.energy / STIFFNESS)
            assert last is None or abs(length - last) < 1e-6, (turn, s)
            last = length


def test_a_prism_of_many_sides_rolls_off_a_block():
    """Its sides are 15 degrees apart: two or three directions at once, as many as come go."""
    engine = engine_of(thing("tool", roller(2e-3, 3e-3, 24)), slab(half=6e-3))
    sizes = []
    for angle in np.linspace(0.0, 1.2, 400):
        q = Rotation.from_euler("xy", [math.pi / 2, angle])
        out = 2e-3 - 1e-4
        place = np.array([6e-3 + out * math.sin(angle), 0.0, out * math.cos(angle)])
        force = first_pose(engine, np.append(place, np.roll(q.as_quat(), 1)))[:3]
        sizes.append(np.linalg.norm(force) / (STIFFNESS * 1e-4))
    print(f"force {min(sizes):.2f} to {max(sizes):.2f} k times the depth")
    assert min(sizes) > 0.5
    assert max(sizes) < 1.2


BALLS = {
    "sphere": lambda: Body("tool", [Geom("sphere", (2e-3,), (3e-4, -2e-4, 5e-4))]),
    "mesh": lambda: thing("tool", ball_mesh(2e-3, 3)),
}


@pytest.mark.parametrize("kind", BALLS)
@pytest.mark.parametrize("at", ["edge", "corner"])
def test_a_ball_is_pushed_off_edges_and_corners_of_a_box_of_triangles(kind, at):
    """It was by up to 1.4 and 1.7 k times the depth."""
    engine, rng, half = (
        engine_of(BALLS[kind](), brick((4e-3,) * 3, "plate")),
        np.random.default_rng(1),
        4e-3,
    )
    middle = np.array([3e-4, -2e-4, 5e-4]) if kind == "sphere" else np.zeros(3)
    sizes, errors = [], []
    for _ in range(25):
        out, depth, place = np.abs(rng.normal(size=3)), rng.uniform(5e-5, 4e-4), np.full(3, half)
        if at == "edge":
            out[0], place[0] = 0.0, rng.uniform(-2e-3, 2e-3)
        place += (2e-3 - depth) * out / np.linalg.norm(out)
        turn = Rotation.random(random_state=rng)
        pose_of = np.append(place - turn.apply(middle), np.roll(turn.as_quat(), 1))
        error, size = gradient_error(engine, pose_of)
        sizes.append(size / (STIFFNESS * depth))
        errors.append(error)
    print(f"{kind}, {at}: force {min(sizes):.2f} to {max(sizes):.2f} k times the depth")
    assert min(sizes) > 0.8
    assert max(sizes) < 1.1
    assert np.quantile(errors, 0.9) < 1e-6


def test_box_meshes_are_pushed_as_the_boxes_are():
    """The same directions, depths and soft least, where the contact is not wide."""
    one, two = (2e-3, 3e-3, 1.5e-3), (5e-3, 4e-3, 3e-3)
    meshes = engine_of(brick(one), brick(two, "plate"))
    geoms = engine_of(Body("tool", [Geom("box", one)]), Body("plate", [Geom("box", two)]))
    rng, off, corners = (
        np.random.default_rng(0),
        [],
        [np.array(list(np.ndindex(2, 2, 2))) * 2.0 * np.array(half) - half for half in (one, two)],
    )
    for _ in range(40):
        at = pressed_together(rng, *corners, rng.uniform(5e-5, 3e-4), corners[1][rng.integers(8)])
        first_pose(meshes, at)
        way = math.sqrt(2.0 * meshes.energy / STIFFNESS)
        first_pose(geoms, at)
        off.append(abs(way / math.sqrt(2.0 * geoms.energy / STIFFNESS) - 1.0))
    print(f"way out off by {np.median(off):.1e} in the median, at most {max(off):.2f}")
    assert np.median(off) < 1e-9
    assert max(off) < 0.15


def test_a_corner_on_an_edge_is_felt():
    """A tetrahedron's corner in a cube's edge: about k times the least way out, not nothing."""
    corner = np.array([(0, 0, 0), (1, 0.6, 2), (-1, 0.6, 2), (0, -1, 2)]) * 2e-3
    block = np.array(list(np.ndindex(2, 2, 2))) * 6e-3 - [3e-3, 3e-3, 6e-3]
    engine = engine_of(thing("tool", hull_mesh(corner)), thing("plate", hull_mesh(block)))
    ways = ways_out(corner, block, [1.0, 0.0, 0.0, 0.0])
    for x in np.linspace(2e-3, 3e-3, 21):
        at = pose(x, 0.3e-3, -1.5e-4)
        least = least_way_out(ways, at[:3])
        size = np.linalg.norm(first_pose(engine, at)[:3])
        if least > 0.0:
            assert 0.5 * STIFFNESS * least < size < 1.5 * STIFFNESS * least


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_a_tilting_loop_on_a_built_in_scene_does_no_work(name):
    scene = load_scene(name).changed(force={"anti_alias": "off", "friction": 0.0})
    engine = ToolContact(scene).engine
    start = scene.start.copy()
    high, low = start[2], start[2] - 8e-3
    for _ in range(40):
        start[2] = 0.5 * (high + low)
        touches = first_pose(engine, start)[2] > 0.05
        high, low = (high, start[2]) if touches else (start[2], low)
    turned_by = Rotation.from_quat(np.roll(start[3:], -1))
    net = gross = 0.0
    last = None
    for p in np.linspace(0.0, 2.0 * math.pi, 1501):
        lean = [0.02 * math.sin(p), 0.014 * math.sin(2 * p), 0.006 * math.cos(p)]
        q = Rotation.from_rotvec(lean) * turned_by
        by = np.array([1e-3 * math.sin(p), 1e-3 * (1 - math.cos(p)), 1e-4 * math.sin(2 * p)])
        place = start[:3] + by
        wrench = touch(engine, np.append(place, np.roll(q.as_quat(), 1))).wrench
        middle = place + q.apply(engine.centre)
        if last is not None:
            mean = 0.5 * (wrench + last[0])
            work = mean[:3] @ (middle - last[1]) + mean[3:] @ (q * last[2].inv()).as_rotvec()
            net, gross = net + work, gross + abs(work)
        last = wrench, middle, q
    print(f"{name}: net over gross work {net / gross:.1e}")
    assert gross > 1e-5
    assert abs(net) < 1e-3 * gross


def test_a_groove_is_as_stiff_as_its_two_walls():
    """A ball between the floor and the wall of a step, at a right angle: they have k each."""
    lines = [-6e-3, 0.0, 6e-3]
    mesh = blocks(lines, [-8e-3, 8e-3], lines, empty=[(1, 0, 1)])
    pieces = [
        box_corners((-6e-3, -8e-3, -6e-3), (0, 8e-3, 6e-3)),
        box_corners((0, -8e-3, -6e-3), (6e-3, 8e-3, 0)),
    ]
    step = thing("plate", mesh, pieces=pieces)
    radius, depth = 2e-3, 1e-4
    engine = engine_of(thing("tool", ball_mesh(radius, 4)), step)
    wrench = first_pose(engine, pose(radius - depth, 0, radius - depth))
    assert wrench[[0, 2]] == pytest.approx([STIFFNESS * depth] * 2, rel=0.02)


PAIRS = {
    "ball and plate": (
        lambda name: thing(name, ball_mesh(2e-3, 2), texture=waves(5e-6, 1e-3)),
        lambda name: slab(name, half=6e-3, texture=waves(15e-6, 4e-3)),
        lambda rng: rng.uniform([-7e-3, -7e-3, 1.5e-3], [7e-3, 7e-3, 2e-3]),
    ),
    "bricks": (
        lambda name: brick((2e-3, 3e-3, 1e-3), name),
        lambda name: brick((3e-3, 2e-3, 2e-3), name),
        lambda rng: rng.uniform(-4e-3, 4e-3, 3),
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_which_body_is_the_tool_makes_no_difference(name):
    """The wrench on the one is minus that on the other, about one point.

    Of two points that are equally deep but for rounding, one or both may be found.
    """
    one, two, place = PAIRS[name]
    there, back = engine_of(one("tool"), two("plate")), engine_of(two("tool"), one("plate"))
    rng, errors = np.random.default_rng(0), []
    for _ in range(150):
        where, q = place(rng), Rotation.random(random_state=rng)
        wrench = first_pose(there, np.append(where, np.roll(q.as_quat(), 1)))
        here = np.append(-q.inv().apply(where), np.roll(q.inv().as_quat(), 1))
        other = first_pose(back, here)
        assert back.energy == pytest.approx(there.energy, rel=1e-9)
        force, torque = -q.apply(other[:3]), -q.apply(other[3:])
        torque -= np.cross(where, force)
        size = np.linalg.norm(wrench[:3])
        if size > 0.0:
            off = np.append(force - wrench[:3], (torque - wrench[3:]) / LEVER)
            errors.append(np.abs(off).max() / size)
    assert len(errors) > 50
    assert np.quantile(errors, 0.98) < 1e-9
    assert max(errors) < 1e-3
