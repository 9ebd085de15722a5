"""Stiffness as a map: one energy whose gradient is the wrench, on geoms and meshes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from naive_engine import ball, engine_for, plate, pose, turn, waves
from scipy.spatial.transform import Rotation

from asperity import AsperityError, Body, FrictionMap, Geom, MultibodySolver, StiffnessMap
from asperity.geometry.bodies import Surface
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.mesh import mesh_from_arrays
from contact.naive_meshes import ball_mesh, brick, engine_of, model_of, roller, slab, thing

K, RADIUS, LEVER = 400.0, 1.5e-3, 2e-3
TIGHT = {"tolerance": 1e-9, "max_nodes": 100000}
RNG = np.random.default_rng(7)
WIDE = StiffnessMap(RNG.uniform(300.0, 1500.0, (40, 40)), 8e-4)
AROUND = StiffnessMap(RNG.uniform(300.0, 1500.0, (12, 12)), 6e-4, "wrap")
TEXTURE = waves(2e-5, 1.5e-3)
FINE = StiffnessMap(RNG.uniform(300.0, 1500.0, (10, 10)), 1.5e-4, "wrap")  # as large as TEXTURE
BOX = Body("tool", [Geom("box", (1.5e-3, 1e-3, 2e-3))])
CAPSULE = Body("tool", [Geom("capsule", (1e-3, 2e-3))])
BRICK = brick((1.5e-3, 1e-3, 2e-3))
TUBE = Body(
    "tube", [Geom("cylinder", (5e-3, 12e-3), (0, 0, -5e-3), tuple(turn([0, 1, 0], math.pi / 2)))]
)


def energy(engine, at) -> float:
    engine.reset()
    engine.wrench(at, 0.0)
    return engine.energy


def moved(at, axis: int, step: float) -> np.ndarray:
    at = at.copy()
    if axis < 3:
        at[axis] += step
    else:
        about = Rotation.from_rotvec(step / LEVER * np.eye(3)[axis - 3])
        at[3:] = np.roll((about * Rotation.from_quat(np.roll(at[3:], -1))).as_quat(), 1)
    return at


def off_gradient(engine, at, step: float = 2e-8) -> float:
    """Return how far the wrench is from minus the gradient of U, relative to its size."""
    engine.reset()
    wrench = engine.wrench(at, 0.0).copy()
    assert engine.contacts.count[0] > 0
    assert not engine.contacts.status[: engine.contacts.count[0]].any()
    wrench[3:] /= LEVER
    off = np.zeros(6)
    for axis in range(6):
        a, b, c, d = (energy(engine, moved(at, axis, s * step)) for s in (-2, -1, 1, 2))
        off[axis] = wrench[axis] + ((a - d) + 8.0 * (c - b)) / (12.0 * step)
    return float(np.abs(off).max() / np.abs(wrench).max())


def pressed(engine, count: int, spread: float, tilt: float, seed: int = 0):
    """Yield random poses of a tool pressed from above into what lies round the origin."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        x, y = rng.uniform(-spread, spread, 2)
        turned = np.roll(Rotation.from_rotvec(rng.normal(0.0, tilt, 3)).as_quat(), 1)
        low, high = -1.5e-3, 8e-3
        for _ in range(40):
            middle = 0.5 * (low + high)
            engine.reset()
            engine.wrench(pose(x, y, middle, turned), 0.0)
            low, high = (middle, high) if engine.contacts.count[0] > 0 else (low, middle)
        yield pose(x, y, low - rng.uniform(2e-5, 2e-4), turned)


def by_uv(stiffness) -> object:
    made = slab().body.mesh
    points = made.vertices[made.faces][:, :, :2]
    uv = 0.5 + points[:, :, ::-1] / 32e-3
    mesh = mesh_from_arrays(made.vertices, made.faces, normals=made.normals, uv=uv)
    return thing("plate", mesh, mapping="uv", stiffness=stiffness)


def laid(body: Body, stiffness, mapping: str = "planar", texture=None) -> Body:
    return replace(body, stiffness=stiffness, mapping=mapping, texture=texture)


GEOMS = {
    "sphere on box": lambda k: (ball(), laid(plate(), k(WIDE))),
    "capsule on box": lambda k: (CAPSULE, laid(plate(), k(WIDE))),
    "box on box": lambda k: (BOX, laid(plate(), k(WIDE))),
    "box on a box's edges": lambda k: (BOX, laid(plate(half=4e-3), k(WIDE))),
    "sphere on triplanar box": lambda k: (ball(), laid(plate(half=4e-3), k(WIDE), "triplanar")),
    "sphere on texture": lambda k: (ball(), laid(plate(), k(FINE), "planar", TEXTURE)),
    "box on texture": lambda k: (BOX, laid(plate(), k(FINE), "planar", TEXTURE)),
    "sphere on cylinder": lambda k: (ball(), laid(TUBE, k(AROUND), "cylindrical")),
    "box on cylinder": lambda k: (BOX, laid(TUBE, k(AROUND), "cylindrical")),
    "capsule on triplanar cylinder": lambda k: (CAPSULE, laid(TUBE, k(AROUND), "triplanar")),
    "sphere with a map": lambda k: (laid(ball(), k(AROUND), "triplanar"), plate()),
    "box with a map on a number": lambda k: (laid(BOX, k(AROUND)), laid(plate(), 900.0)),
}
MESHES = {
    "sphere on slab": lambda k: (ball(), slab(stiffness=k(WIDE))),
    "sphere on uv": lambda k: (ball(), by_uv(k(WIDE))),
    "ball of facets on uv": lambda k: (thing("tool", ball_mesh(RADIUS, 2)), by_uv(k(WIDE))),
    "brick on slab's edges": lambda k: (BRICK, slab(half=4e-3, stiffness=k(WIDE))),
    "brick on texture": lambda k: (BRICK, slab(texture=TEXTURE, stiffness=k(FINE))),
    "sphere on triplanar ball": lambda k: (
        ball(), thing("plate", ball_mesh(6e-3, 2), mapping="triplanar", stiffness=k(AROUND))
    ),
    "sphere on cylindrical roller": lambda k: (
        ball(), thing("plate", roller(5e-3, 6e-3, 40), mapping="cylindrical", stiffness=k(AROUND))
    ),
}  # fmt: skip


def engine_with(name: str, k=lambda found: found, **settings):
    """Return the engine of a case whose map is changed by `k`."""
    if name in MESHES:
        return engine_of(*MESHES[name](k), **settings)
    return engine_for(*GEOMS[name](k), **settings)


def reach(name: str) -> float:
    """Return within which distance of the origin the ground of a case is [m]."""
    return 2e-3 if name.endswith("ball") else 4.5e-3


@pytest.mark.parametrize("name", [*GEOMS, *MESHES])
def test_the_wrench_is_the_gradient_of_the_energy(name):
    engine = engine_with(name, **TIGHT)
    off = [off_gradient(engine, at) for at in pressed(engine, 12, reach(name), 1.0)]
    # One in twelve may be beside a kink of the depth.
    assert sorted(off)[-2] < 1e-6


def smooth_at(found: StiffnessMap, u, v):
    """Return k at places of a clamped map whose middle is at 0, written down anew."""
    c = np.pad(1.0 / found.samples, 2, mode="symmetric")
    x = u / found.pixel_size[0] + 0.5 * found.samples.shape[1] + 0.5
    y = v / found.pixel_size[1] + 0.5 * found.samples.shape[0] + 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)

    def weights(t):
        return ((1 - t) ** 3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6,
                (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6, t**3 / 6)  # fmt: skip

    total = sum(
        p * q * c[j + b, i + a]
        for a, p in enumerate(weights(x - i)) for b, q in enumerate(weights(y - j))
    )  # fmt: skip
    return 1.0 / total


@pytest.mark.parametrize("mesh", [False, True])
def test_the_energy_is_that_of_the_place_where_it_is_largest(mesh):
    rng = np.random.default_rng(3)
    found = StiffnessMap(10.0 ** rng.uniform(2.0, 4.0, (60, 60)), 1e-4)
    ground = slab(stiffness=found) if mesh else laid(plate(), found)
    engine = (engine_of if mesh else engine_for)(ball(), ground, **TIGHT)
    off = np.linspace(-7e-4, 7e-4, 701)
    for _ in range(8):
        x, y = rng.uniform(-2e-3, 2e-3, 2)
        depth = rng.uniform(5e-5, 1.5e-4)
        u, v = np.meshgrid(off, off)
        overlap = depth - RADIUS + np.sqrt(RADIUS**2 - u**2 - v**2)
        by_place = 0.5 * smooth_at(found, x + u, y + v) * np.maximum(overlap, 0.0) ** 2
        found_energy = energy(engine, pose(x, y, RADIUS - depth))
        assert (1.0 - 1e-3) * found_energy < by_place.max() < (1.0 + 1e-9) * found_energy
        # The place is not the deepest one, and its stiffness is felt there.
        row = np.unravel_index(np.argmax(by_place), by_place.shape)
        point, k = engine.contacts.point[0], engine.contacts.weight[0] * K
        assert point[:2] == pytest.approx([x + u[row], y + v[row]], abs=4e-6)
        assert k == pytest.approx(smooth_at(found, *point[:2]), rel=1e-6)
        assert engine.contacts.depth[0] < depth


@pytest.mark.parametrize("name", ["sphere on box", "box on a box's edges", "sphere on cylinder",
                                  "sphere on uv", "brick on slab's edges"])  # fmt: skip
def test_no_work_is_done_round_closed_paths(name):
    engine = engine_with(name, **TIGHT)
    rng = np.random.default_rng(1)
    t = 2.0 * np.pi * np.arange(6001) / 6000
    for at in pressed(engine, 3, 3e-3, 0.5):
        way = np.tile(at, (len(t), 1))
        for axis in range(3):
            size = 1.5e-3 if axis < 2 else 2e-4
            way[:, axis] += size * (np.cos(t + rng.uniform(0, 6)) + np.sin(2 * t + axis)) / 2
        spin = Rotation.from_rotvec(0.1 * np.stack([np.sin(t), np.cos(2 * t), np.sin(t)], axis=1))
        way[:, 3:] = np.roll((spin * Rotation.from_quat(np.roll(at[3:], -1))).as_quat(), 1, axis=1)
        wrench = np.array([engine.wrench(p, 0.0).copy() for p in way])
        turned = Rotation.from_quat(np.roll(way[:, 3:], -1, axis=1))
        steps = np.hstack(
            [np.diff(way[:, :3], axis=0), (turned[1:] * turned[:-1].inv()).as_rotvec()]
        )
        parts = (0.5 * (wrench[1:] + wrench[:-1]) * steps).sum(axis=1)
        assert np.abs(parts).sum() > 1e-6
        assert abs(parts.sum()) < 1e-3 * np.abs(parts).sum()


def test_the_energy_goes_on_where_the_place_leaps():
    """Two hard spots: half-way between them the force leans over at once, the energy does not."""
    samples = np.full((20, 40), 200.0)
    samples[8:12, 10:14] = samples[8:12, 26:30] = 4000.0
    engine = engine_for(ball(), laid(plate(), StiffnessMap(samples, 5e-5)), **TIGHT)
    x = np.linspace(-2e-5, 2e-5, 2001)
    found, sideways = [], []
    for at in x:
        found.append(energy(engine, pose(at, 0.0, RADIUS - 2e-4)))
        sideways.append(engine.contacts.force[0, 0])
    leap = np.argmax(np.abs(np.diff(sideways)))
    assert abs(np.diff(sideways)[leap]) > 0.1 * np.max(np.abs(sideways))
    step = np.abs(np.diff(found))
    assert step.max() < 1.1 * np.max(np.abs(sideways)) * (x[1] - x[0])


@pytest.mark.parametrize("name", [*GEOMS, *MESHES])
def test_a_map_of_one_value_is_that_number(name):
    def even(found):
        return StiffnessMap(np.full_like(found.samples, 700.0), found.pixel_size, found.border)

    more = {"dissipation": 2.0, "friction": 0.2}
    mapped, plain = engine_with(name, even, **more), engine_with(name, lambda _: 700.0, **more)
    for at in pressed(plain, 6, reach(name), 0.5):
        mapped.reset()
        plain.reset()
        for step in range(3):
            there = at + np.array([1e-6 * step, 0, -1e-6 * step, 0, 0, 0, 0])
            got, wanted = mapped.wrench(there, 1e-3), plain.wrench(there, 1e-3)
            assert np.linalg.norm(wanted) > 1e-3
            np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-12 * np.abs(wanted).max())
        np.testing.assert_allclose(mapped.stiffness(), plain.stiffness(), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(mapped.damping(), plain.damping(), rtol=1e-9, atol=1e-9)


def test_a_map_that_hardly_varies_is_nearly_that_number():
    rng = np.random.default_rng(0)
    nearly = StiffnessMap(700.0 * (1.0 + 1e-9 * rng.uniform(-1, 1, (40, 40))), 8e-4)
    for tool in (ball(), CAPSULE, BOX):
        one, two = (engine_for(tool, laid(plate(), k), **TIGHT) for k in (nearly, 700.0))
        for at in pressed(two, 6, 4e-3, 1.0):
            wanted = two.wrench(at, 0.0)
            np.testing.assert_allclose(
                one.wrench(at, 0.0), wanted, rtol=0, atol=3e-6 * np.abs(wanted).max()
            )


@pytest.mark.parametrize("mesh", [False, True])
def test_a_flat_tool_on_a_level_part_of_a_map_feels_no_torque(mesh):
    samples = np.full((32, 32), 500.0)
    samples[:, 16:] = 2000.0
    found = StiffnessMap(samples, 1e-3)
    half = (4e-3, 3e-3, 2e-3)
    if mesh:
        engine = engine_of(brick(half), slab(stiffness=found), **TIGHT)
    else:
        engine = engine_for(Body("tool", [Geom("box", half)]), laid(plate(), found), **TIGHT)
    for x, k in ((-6e-3, 500.0), (6e-3, 2000.0)):
        wrench = engine.wrench(pose(x, 1e-3, 2e-3 - 1e-4), 0.0)
        np.testing.assert_allclose(wrench, [0, 0, k * 1e-4, 0, 0, 0], rtol=1e-9, atol=1e-9)
    # Over the border it leans towards the soft side.
    assert engine.wrench(pose(0.0, 0.0, 2e-3 - 1e-4), 0.0)[4] < -1e-3 * k * 1e-4


def test_two_surfaces_are_springs_in_series():
    series = StiffnessMap(1.0 / (1.0 / WIDE.samples + 1.0 / 900.0), WIDE.pixel_size)
    one = engine_for(laid(ball(), 900.0), laid(plate(), WIDE), **TIGHT)
    two = engine_for(ball(), laid(plate(), series), **TIGHT)
    for at in pressed(one, 6, 4e-3, 0.5):
        np.testing.assert_allclose(one.wrench(at, 0.0), two.wrench(at, 0.0), rtol=1e-9, atol=1e-14)


def test_a_mesh_feels_as_the_same_geom():
    meshed, solid = (
        engine_of(ball(), slab(stiffness=WIDE), **TIGHT),
        engine_for(ball(), laid(plate(), WIDE), **TIGHT),
    )
    for at in pressed(solid, 8, 6e-3, 0.5):
        wanted = solid.wrench(at, 0.0)
        np.testing.assert_allclose(
            meshed.wrench(at, 0.0), wanted, rtol=0, atol=1e-9 * np.abs(wanted).max()
        )


def test_flush_geoms_with_one_map_are_one_solid():
    whole = engine_for(ball(), laid(plate(), WIDE), **TIGHT)
    parts = [Geom("box", (7.5e-3, 15e-3, 2e-3), (x, 0, -2e-3)) for x in (-7.5e-3, 7.5e-3)]
    halves = engine_for(ball(), Body("plate", parts, stiffness=WIDE), **TIGHT)
    surface = Surface(stiffness=WIDE)
    single = engine_for(
        ball(), Body("plate", [replace(part, surface=surface) for part in parts]), **TIGHT
    )
    for x in np.linspace(-6e-4, 6e-4, 25):
        at = pose(x, 1e-3, RADIUS - 1e-4)
        wanted = whole.wrench(at, 0.0)
        for engine in (halves, single):
            np.testing.assert_allclose(engine.wrench(at, 0.0), wanted, rtol=1e-9, atol=1e-12)


def test_stiffness_and_damping_are_those_of_the_place():
    engine = engine_for(ball(), laid(plate(), WIDE), dissipation=3.0, **TIGHT)
    at, speed = pose(2e-3, -1e-3, RADIUS - 1e-4), 0.01
    engine.wrench(at + np.array([0, 0, 1e-3 * speed, 0, 0, 0, 0]), 1e-3)
    damped = engine.wrench(at, 1e-3).copy()
    k, m = engine.contacts.weight[0] * K, engine.contacts.slope_normal[0]
    np.testing.assert_allclose(engine.stiffness()[:3, :3], k * np.outer(m, m), rtol=1e-9)
    push = k * engine.contacts.depth[0]
    np.testing.assert_allclose(damped[:3], push * (1.0 + 3.0 * speed) * m, rtol=1e-9)
    np.testing.assert_allclose(engine.damping()[:3, :3], 3.0 * push * np.outer(m, m), rtol=1e-9)


def test_many_poses_and_moving_bodies():
    for tool, ground in ((ball(), laid(plate(), WIDE)), (BOX, slab(stiffness=WIDE))):
        single = (engine_for if isinstance(ground, Body) else engine_of)(tool, ground, **TIGHT)
        path = list(pressed(single, 8, 4e-3, 0.5))
        wanted = []
        for at in path:
            single.reset()
            wanted.append(single.wrench(at, 0.0).copy())
        np.testing.assert_array_equal(single.wrenches(np.array(path)), wanted)
        model, bodies = model_of(tool, ground, joint="<freejoint/>")
        both = MultibodySolver(model, bodies, single.settings)
        for at, wrench in zip(path, wanted, strict=True):
            found = both.solve(np.array([pose(0, 0, 0), at]), 0.0)
            np.testing.assert_allclose(found[1], wrench, rtol=1e-7, atol=1e-9)
            np.testing.assert_allclose(found[0, :3], -wrench[:3], rtol=1e-7, atol=1e-9)


def test_what_came_before_has_no_influence():
    for tool, ground in ((ball(), laid(plate(), WIDE)), (BOX, slab(stiffness=WIDE))):
        engine = (engine_for if isinstance(ground, Body) else engine_of)(tool, ground, **TIGHT)
        path = list(pressed(engine, 10, 4e-3, 0.3))
        for at in path:
            engine.reset()
            first = engine.wrench(at, 0.0).copy()
            engine.reset()
            for other in path:
                engine.wrench(other, 1e-3)
            np.testing.assert_allclose(engine.wrench(at, 0.0), first, rtol=1e-8, atol=1e-10)


def test_a_material_has_its_number_beside_the_map():
    halved = slab(cuts=2).body.mesh
    left = halved.vertices[halved.faces][:, :, 0].mean(axis=1) < 0.0
    mesh = replace(
        halved, material=left.astype(np.int64),
        materials=(Material("plain"), Material("glass", stiffness=5000.0)),
    )  # fmt: skip
    engine = engine_of(ball(), thing("plate", mesh, stiffness=WIDE), **TIGHT)
    engine.wrench(pose(-5e-3, 0, RADIUS - 5e-5), 0.0)
    assert engine.contacts.weight[0] * K == pytest.approx(5000.0)
    engine.reset()
    engine.wrench(pose(5e-3, 0, RADIUS - 5e-5), 0.0)
    assert 300.0 < engine.contacts.weight[0] * K < 1500.0
    at = pose(-1e-4, 0, RADIUS - 5e-5)
    assert off_gradient(engine, at) < 1e-6


def test_a_map_of_friction_may_lie_beside_it():
    friction = FrictionMap(np.full((6, 6), 0.3), 1e-3)
    engine = engine_for(ball(), replace(laid(plate(), WIDE), friction=friction), **TIGHT)
    plain = engine_for(ball(), laid(plate(), WIDE), friction=0.3, **TIGHT)
    for i in range(20):
        at = pose(1e-3 + 1e-5 * i, 0, RADIUS - 1e-4)
        np.testing.assert_allclose(engine.wrench(at, 1e-3), plain.wrench(at, 1e-3), rtol=1e-12)


# What cannot be.


@pytest.mark.parametrize(
    ("samples", "word"),
    [(np.full((4, 4), -1.0), "-1"), (np.full((4, 4), 0.0), "1e-06"), (np.full((4, 4), 2e9), "2e"),
     (np.full((4, 4), np.nan), "NaN"), (np.full((3, 4), 1.0), "4 or more"), ("high", "numbers")],
)  # fmt: skip
def test_stiffnesses_that_cannot_be(samples, word):
    with pytest.raises(AsperityError, match=word) as caught:
        StiffnessMap(samples, 1e-3)
    assert "\n" not in str(caught.value)


def test_a_map_is_as_large_as_the_texture():
    for found in (WIDE, StiffnessMap(FINE.samples, FINE.pixel_size)):
        with pytest.raises(AsperityError, match=r"valid: 1.5 x 1.5 mm, border 'wrap'"):
            laid(plate(), found, "planar", TEXTURE)


def test_only_one_of_two_bodies_has_a_map():
    with pytest.raises(AsperityError, match=r"'tool' and of 'plate'.*for one of them"):
        engine_for(laid(ball(), AROUND), laid(plate(), WIDE))


@pytest.mark.parametrize("name", ["law", "gradient"])
def test_only_the_law_with_an_energy_takes_a_map(name):
    value = {"law": "minsky", "gradient": "soft"}[name]
    with pytest.raises(AsperityError, match=f"stiffness is a map.*'plate', {name} must be"):
        engine_for(ball(), laid(plate(), WIDE), **{name: value})
