"""Friction as a map: read where the contact is, on geoms and meshes, by every mapping."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from naive_engine import ball, engine_for, plate, pose, rotation, touch, turn, waves
from scipy.interpolate import RegularGridInterpolator

from asperity import AsperityError, Body, FrictionMap, Geom, HeightField, MultibodySolver
from asperity.contact.response.stiffness import AT_REST
from asperity.geometry.bodies import Surface
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.mesh import mesh_from_arrays
from contact.naive_meshes import brick, engine_of, model_of, roller, slab, thing, with_uv

RADIUS, DEPTH = 1.5e-3, 5e-5
TEXTURE = waves(2e-5, 1.5e-3)
ROUGH = FrictionMap(np.random.default_rng(3).uniform(0.1, 0.9, (12, 15)), (7e-4, 4e-4), "wrap")
ONCE = FrictionMap(np.random.default_rng(4).uniform(0.1, 0.9, (40, 50)), (1e-3, 6e-4))


def halves(along_v: bool = False) -> FrictionMap:
    """Return a map, 32 mm by 32 mm, of 0.1 before its middle and 0.6 behind it."""
    samples = np.full((32, 32), 0.1)
    samples[:, 16:] = 0.6
    return FrictionMap(samples.T if along_v else samples, 1e-3)


def even(value: float, border: str = "clamp") -> FrictionMap:
    return FrictionMap(np.full((4, 5), value), 3e-3, border)


def coefficient(found: FrictionMap, u: float, v: float) -> float:
    """Return the coefficient of a map at (u, v) [m], written down anew."""
    more = 2
    mode = "wrap" if found.border == "wrap" else "edge"
    samples = np.pad(found.samples, more, mode=mode)
    places = [
        (np.arange(n) - more + 0.5) * pixel
        for n, pixel in zip(samples.shape, found.pixel_size[::-1], strict=True)
    ]
    uv = np.array([u, v])
    uv = uv % found.size if found.border == "wrap" else np.clip(uv, 0.0, found.size)
    return float(RegularGridInterpolator(places, samples)(uv[::-1])[0])


def start(found: FrictionMap, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    return np.array(offset) - (0.5 * np.array(found.size) if found.border == "clamp" else 0.0)


def frictions(engine, at) -> np.ndarray:
    """Return the coefficient of each contact at a pose."""
    engine.reset()
    engine.wrench(at, 0.0)
    return engine.contacts.friction[: engine.contacts.count[0]].copy()


def ratio(engine, first, step, ticks: int = 40) -> float:
    """Return the tangential over the normal force after a slide from a pose, by steps (3,)."""
    engine.reset()
    for i in range(ticks):
        at = np.array(first, dtype=float)
        at[:3] += i * np.asarray(step)
        found = touch(engine, at)
    force, m = found.force.sum(axis=0), found.slope_normal.mean(axis=0)
    along = force @ m / np.linalg.norm(m)
    return math.sqrt(force @ force - along**2) / along


# The two sides of a border, while a ball slides.


def sides():
    """Yield names, engines, and a pose on either side, of a ball that touches every kind."""
    r = RADIUS - DEPTH
    left, right = pose(-8e-3, 1e-3, r), pose(6e-3, 1e-3, r)
    flat, across = plate(), (1e-5, 4e-6, 0.0)
    ground = Body("plate", [Geom("plane", (0, 0, 1))], friction=halves())
    yield "plane", engine_for(ball(), ground), left, right, across
    yield "box", engine_for(ball(), replace(flat, friction=halves())), left, right, across
    rough = replace(plate(HeightField(TEXTURE.samples[:8, :8] * 1e-3, 1e-3)), friction=halves())
    yield "textured box", engine_for(ball(), rough), left, right, across
    three = replace(flat, friction=halves(), mapping="triplanar")
    yield "triplanar box", engine_for(ball(), three), left, right, across
    # A cylinder along x: v runs along it.
    geom = Geom("cylinder", (5e-3, 12e-3), (0, 0, -5e-3), tuple(turn([0, 1, 0], math.pi / 2)))
    tube = Body("tube", [geom], mapping="cylindrical", friction=halves(along_v=True))
    on_top = [pose(x, 0.0, r) for x in (-8e-3, 6e-3)]
    yield "cylinder", engine_for(ball(), tube), *on_top, (1e-5, 0.0, 0.0)
    for mapping in ("planar", "triplanar"):
        mesh = slab(mapping=mapping, friction=halves())
        yield f"{mapping} mesh", engine_of(ball(), mesh), left, right, across
    made = slab().body.mesh
    points = made.vertices[made.faces][:, :, :2]
    mesh = mesh_from_arrays(
        made.vertices, made.faces, normals=made.normals, uv=0.5 + points[:, :, ::-1] / 32e-3
    )
    by_uv = thing("plate", mesh, mapping="uv", friction=halves(along_v=True))
    yield "uv mesh", engine_of(ball(), by_uv), left, right, across


@pytest.mark.parametrize("name", [name for name, *_ in sides()])
def test_a_ball_that_slides_feels_the_friction_of_each_side(name):
    engine, left, right, step = next(rest for what, *rest in sides() if what == name)
    assert ratio(engine, left, step) == pytest.approx(0.1, rel=1e-5)
    assert ratio(engine, right, step) == pytest.approx(0.6, rel=1e-5)
    assert frictions(engine, left) == pytest.approx([0.1])


# The place on the map.


@pytest.mark.parametrize("found", [ROUGH, ONCE])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (1.1e-3, -4e-4)])
@pytest.mark.parametrize("texture", [None, TEXTURE, HeightField(TEXTURE.samples, 1e-4)])
@pytest.mark.parametrize("mesh", [False, True])
def test_a_planar_map_lies_as_the_texture(found, offset, texture, mesh):
    laid = {"friction": found, "offset": offset}
    if mesh:
        engine = engine_of(ball(), slab(texture=texture, **laid))
    else:
        engine = engine_for(ball(), replace(plate(texture), **laid))
    for x, y in np.random.default_rng(1).uniform(-9e-3, 9e-3, (12, 2)):
        got = frictions(engine, pose(x, y, RADIUS - DEPTH))
        place = engine.contacts.point[0, :2] - start(found, offset)
        assert got == pytest.approx([coefficient(found, *place)], abs=1e-9)


@pytest.mark.parametrize("found", [ROUGH, ONCE])
@pytest.mark.parametrize("mesh", [False, True])
def test_a_triplanar_map_lies_on_every_side(found, mesh):
    half = (4e-3, 5e-3, 6e-3)
    laid = {"mapping": "triplanar", "friction": found, "offset": (3e-4, 2e-4)}
    if mesh:
        engine = engine_of(ball(), brick(half, name="block", **laid))
    else:
        engine = engine_for(ball(), Body("block", [Geom("box", half)], **laid))
    rng = np.random.default_rng(2)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            at = rng.uniform(-0.8, 0.8, 3) * half
            at[axis] = sign * (half[axis] + RADIUS - DEPTH)
            u, v = at[[(axis + 1) % 3, (axis + 2) % 3]] - start(found, (3e-4, 2e-4))
            got = frictions(engine, pose(*at))
            assert got == pytest.approx([coefficient(found, u, v)], abs=1e-9)


def test_a_triplanar_map_is_blended_on_a_sphere():
    engine = engine_for(
        ball(), Body("ball", [Geom("sphere", (4e-3,))], mapping="triplanar", friction=ROUGH)
    )
    for n in np.random.default_rng(5).normal(size=(10, 3)):
        n /= np.linalg.norm(n)
        place, share = 4e-3 * n, n**4 / np.sum(n**4)
        own = [coefficient(ROUGH, place[(k + 1) % 3], place[(k + 2) % 3]) for k in range(3)]
        got = frictions(engine, pose(*(4e-3 + RADIUS - DEPTH) * n))
        assert got == pytest.approx([share @ own], abs=1e-9)


@pytest.mark.parametrize("found", [ROUGH, ONCE])
@pytest.mark.parametrize("texture", [None, waves(2e-5, 1.1e-3)])
@pytest.mark.parametrize("kind", ["cylinder", "capsule"])
def test_a_cylindrical_map_closes_round_the_sides_and_leaves_the_ends(found, texture, kind):
    radius, half, offset = 3e-3, 8e-3, (5e-4, -7e-4)
    tube = Body("tube", [Geom(kind, (radius, half))], texture, "cylindrical", offset, None, found)
    engine = engine_for(ball(), tube, friction=0.37)
    times = 2.0 * math.pi * radius / found.size[0]
    stretch = round(times) / times if found.border == "wrap" else 1.0
    for angle, z in zip(
        np.linspace(-3.0, 3.0, 9), np.random.default_rng(6).uniform(-6e-3, 6e-3, 9), strict=True
    ):
        far = radius + RADIUS - DEPTH
        got = frictions(engine, pose(far * math.cos(angle), far * math.sin(angle), z))
        x, y, z = engine.contacts.point[0]
        u, v = np.array([stretch * radius * math.atan2(y, x), z]) - start(found, offset)
        # Both bodies' places are those seen along n, which is some mrad off the radius.
        assert got == pytest.approx([coefficient(found, u, v)], abs=2e-3 if texture else 1e-3)
    end = half + RADIUS - DEPTH + (radius if kind == "capsule" else 0.0)
    assert frictions(engine, pose(1e-5, 0.0, end)) == pytest.approx([0.37])


@pytest.mark.parametrize("found", [ROUGH, ONCE])
@pytest.mark.parametrize("texture", [None, TEXTURE])
def test_a_map_on_texture_coordinates_covers_their_square(found, texture):
    other = TEXTURE if texture is None else texture
    mesh = with_uv(brick((6e-3, 5e-3, 4e-3)).body.mesh, other, seed=7)
    block = thing("block", mesh, texture, "uv", offset=(2e-4, 1e-4), friction=found)
    engine = engine_of(ball(), block)
    points = mesh.vertices[mesh.faces]
    for x, y in np.random.default_rng(8).uniform(-4e-3, 4e-3, (10, 2)):
        got = frictions(engine, pose(x, y, 4e-3 + RADIUS - DEPTH))
        for corners, uv in zip(points, mesh.uv, strict=True):
            if np.ptp(corners[:, 2]) > 0.0 or corners[0, 2] < 0.0:
                continue
            share = np.linalg.solve(
                np.vstack([corners[:, :2].T, np.ones(3)]), [*engine.contacts.point[0, :2], 1.0]
            )
            if share.min() >= 0.0:
                place = share @ uv * found.size
                # The offset moves both maps alike.
                laid = found if texture is None else texture
                place -= np.array([2e-4, 1e-4]) / laid.size * found.size
                wanted = coefficient(found, *place)
        assert got == pytest.approx([wanted], abs=1e-6)


@pytest.mark.parametrize("texture", [None, waves(1e-5, 1.1e-3)])
def test_a_cylindrical_map_on_a_mesh(texture):
    mesh = roller(4e-3, 8e-3, 90)
    engine = engine_of(ball(), thing("roller", mesh, texture, "cylindrical", friction=ROUGH))
    mean = np.mean(np.hypot(*mesh.vertices[:, :2].T))
    periods = round(2.0 * math.pi * mean / ROUGH.size[0])
    for angle in np.linspace(-2.9, 2.9, 7):
        far = 4e-3 + RADIUS - DEPTH
        got = frictions(engine, pose(far * math.cos(angle), far * math.sin(angle), 2e-3))
        for (x, y, z), friction in zip(engine.contacts.point[: len(got)], got, strict=True):
            u = math.atan2(y, x) / (2.0 * math.pi) * periods * ROUGH.size[0]
            # Along a facet the map is linear, by a chord.
            assert friction == pytest.approx(coefficient(ROUGH, u, z), abs=5e-3)


def test_the_map_turns_with_a_tool_and_the_larger_of_two_counts():
    tilted = pose(1e-3, 2e-3, -1e-3, turn([1, 2, 0], 0.4))
    finger = replace(ball(), friction=ROUGH, mapping="triplanar")
    for plates, largest in ((0.0, False), (0.5, True)):
        ground = replace(plate(), friction=plates)
        engine = engine_for(finger, ground, poses=[tilted], tool_first=True, friction=0.9)
        up = rotation(tilted).apply([0, 0, 1.0])
        for angle in (0.3, 1.4, 2.2):
            at = pose(*(tilted[:3] + (RADIUS - DEPTH) * up), turn([3, -1, 2], angle))
            n = rotation(at).inv().apply(-up)
            place, share = RADIUS * n, n**4 / np.sum(n**4)
            own = share @ [
                coefficient(ROUGH, place[(k + 1) % 3], place[(k + 2) % 3]) for k in range(3)
            ]
            got = frictions(engine, at)
            assert got == pytest.approx([max(own, plates) if largest else own], abs=1e-9)


# A map of one value is a number.


def slides(value):
    """Yield engines of a tool on a ground with this friction, and a path."""
    path = [pose(1e-4 * i, 3e-5 * i, RADIUS - DEPTH, turn([1, 0, 0], 0.01 * i)) for i in range(12)]
    low = [pose(at[0], at[1], at[2] + 5e-4, at[3:]) for at in path]
    rough, tool = plate(TEXTURE), Body("tool", [Geom("box", (2e-3,) * 3)])
    yield engine_for(ball(), replace(rough, friction=value), friction=0.05), path
    yield engine_for(tool, replace(rough, friction=value)), low
    # Plates side by side, of one body and of two.
    parts = [Geom("box", (4e-3, 4e-3, 2e-3), (x, 0, -2e-3)) for x in (-4e-3, 4e-3)]
    yield engine_for(tool, Body("plate", parts, friction=value)), low
    two = [Body(f"plate{k}", [part], friction=value) for k, part in enumerate(parts)]
    yield engine_for(tool, *two), low
    for mapping in ("planar", "triplanar"):
        meshed = slab(texture=TEXTURE, mapping=mapping, friction=value, cuts=3)
        yield engine_of(ball(), meshed), path
        yield engine_of(brick((2e-3, 2e-3, 2e-3), friction=0.2), meshed), low
    yield engine_for(ball(), replace(rough, friction=value), law="minsky"), path
    yield engine_for(ball(), replace(rough, friction=value), gradient="soft"), path


@pytest.mark.parametrize("border", ["clamp", "wrap"])
def test_a_map_of_one_value_is_that_number(border):
    for (mapped, path), (plain, _) in zip(slides(even(0.35, border)), slides(0.35), strict=True):
        for at in path:
            got, wanted = mapped.wrench(at, 1e-3), plain.wrench(at, 1e-3)
            assert np.linalg.norm(wanted[:2]) > 0.0 or at is path[0]
            np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-14)
            np.testing.assert_allclose(mapped.stiffness(), plain.stiffness(), rtol=1e-12)
            one, two = mapped.damping(), plain.damping()
            np.testing.assert_allclose(one, two, rtol=1e-12)


def test_between_moving_bodies_too():
    poses = [np.array([pose(0, 0, 0), pose(6e-3 + 1e-5 * i, 0, RADIUS - DEPTH)])
             for i in range(30)]  # fmt: skip
    ground = replace(plate(), friction=halves())
    model, bodies = model_of(ball(), ground, joint="<freejoint/>")
    solver = MultibodySolver(model, bodies)
    for at in poses:
        wrench = solver.solve(at, 1e-3)[1]
    assert -wrench[0] == pytest.approx(0.6 * wrench[2], rel=1e-6)


# Several deepest points, and the bristle.


def test_deepest_points_on_two_frictions_have_their_mean():
    parts = [
        Geom("box", (4e-3, 4e-3, 2e-3), (x, 0, -2e-3), surface=Surface(friction=friction))
        for x, friction in ((-4e-3, even(0.2)), (4e-3, even(0.6)))
    ]
    tool = Body("tool", [Geom("box", (2e-3,) * 3)])
    engine = engine_for(tool, Body("plate", parts))
    for x, share in ((-3e-3, 0.0), (0.0, 0.5), (1e-3, 0.75), (3e-3, 1.0)):
        got = frictions(engine, pose(x, 0, 2e-3 - DEPTH))
        assert got == pytest.approx([0.2 + 0.4 * share], abs=1e-6)


def test_the_friction_of_a_material_comes_before_the_map():
    halved = slab(cuts=2).body.mesh
    left = halved.vertices[halved.faces][:, :, 0].mean(axis=1) < 0.0
    mesh = replace(
        halved, material=left.astype(np.int64),
        materials=(Material("plain"), Material("glass", friction=0.05)),
    )  # fmt: skip
    engine = engine_of(ball(), thing("plate", mesh, friction=even(0.5)))
    for x, wanted in ((-5e-3, 0.05), (5e-3, 0.5)):
        assert frictions(engine, pose(x, 0, RADIUS - DEPTH)) == pytest.approx([wanted])


@pytest.mark.parametrize("least", [0.0, 0.1])
def test_the_force_goes_over_a_border_without_a_leap(least):
    """A bristle keeps its deflection, or what the limit leaves of it; without friction, none."""
    samples = np.full((8, 30), 0.6)
    samples[:, 10:20] = least
    ground = replace(plate(), friction=FrictionMap(samples, 1e-3))
    engine, step = engine_for(ball(), ground), 2e-6
    at = [pose(x, 0, RADIUS - DEPTH) for x in np.arange(-6.5e-3, 6.5e-3, step)]
    force = np.array([engine.wrench(p, 1e-3)[0] for p in at])
    # By its own spring, or by the slope of the limit, a sample long.
    normal = 400.0 * DEPTH
    most = max(400.0 * step, 0.6 * normal * step / 1e-3)
    assert np.abs(np.diff(force)).max() <= most * (1.0 + 1e-9)
    middle = force[len(force) // 2]
    assert middle == pytest.approx(-least * normal, abs=1e-12)
    assert force[-1] == pytest.approx(-0.6 * normal)
    assert engine.contacts.friction[0] == pytest.approx(0.6)


def test_where_there_is_no_friction_the_bristle_is_let_go():
    parts = [
        Geom("box", (8e-3, 4e-3, 2e-3), (0, y, -2e-3), surface=Surface(friction=friction))
        for y, friction in ((-4e-3, 0.6), (4e-3, 0.0))
    ]
    engine, z = engine_for(ball(), Body("plate", parts)), RADIUS - DEPTH
    for i in range(40):
        held = engine.wrench(pose(1e-6 * i, -1e-6, z), 1e-3)
    assert held[0] == pytest.approx(-400.0 * 30e-6)  # of 0.6 N at 50 um
    assert engine.wrench(pose(39e-6, 1e-6, z), 1e-3)[:2] == pytest.approx([0.0, 0.0])
    back = engine.wrench(pose(39e-6, -1e-6, z), 1e-3)
    assert back[:2] == pytest.approx([0.0, 400.0 * 2e-6], abs=1e-12)


def test_where_it_slips_it_damps_and_where_it_sticks_it_holds():
    ground = replace(plate(), friction=halves())
    for x, value in ((-8e-3, 0.1), (8e-3, 0.6)):
        engine, plain = engine_for(ball(), ground), engine_for(ball(), plate(), friction=value)
        for i in range(9):  # the bristle slips on the left, and sticks on the right
            at = pose(x + 1.5e-6 * i, 0, RADIUS - DEPTH)
            engine.wrench(at, 1e-3)
            plain.wrench(at, 1e-3)
        np.testing.assert_allclose(engine.stiffness(), plain.stiffness(), rtol=1e-9)
        assert engine.stiffness()[0, 0] == pytest.approx(400.0 if value == 0.6 else 0.0)
        moving = AT_REST._replace(twist=np.array([1.5e-3, 0, 0, 0, 0, 0]), dt=1e-3)
        one, two = (e.derivatives(moving).damping for e in (engine, plain))
        np.testing.assert_allclose(one, two, rtol=1e-9)


@pytest.mark.parametrize(
    ("samples", "word"),
    [(np.full((4, 4), -0.1), "-0.1"), (np.full((4, 4), 101.0), "101"),
     (np.full((4, 4), np.nan), "NaN"), (np.full((3, 4), 0.1), "4 or more"), ("high", "numbers")],
)  # fmt: skip
def test_coefficients_that_cannot_be(samples, word):
    with pytest.raises(AsperityError, match=word) as caught:
        FrictionMap(samples, 1e-3)
    assert "\n" not in str(caught.value)


def test_other_things_are_no_friction():
    for wrong in (-0.1, 101.0, "0.3", np.full((4, 4), 0.3)):
        with pytest.raises(AsperityError, match="friction must lie between 0 and 100"):
            replace(plate(), friction=wrong)
    assert replace(plate(), friction=halves()).largest_friction == 0.6
