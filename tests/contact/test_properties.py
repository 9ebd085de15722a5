"""No finite input ever gives a number that is not finite; what the engine remembers, and forgets.

Action and reaction need no test of the engine: it computes the wrench on the tool alone, and that
on the scene's bodies is its negative by definition.
"""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from naive_engine import (
    STIFFNESS,
    Touch,
    ball,
    engine_for,
    plate,
    pose,
    rotation,
    touch,
    turn,
    waves,
)

from asperity.contact.body_pair import BodyPair
from asperity.errors import AsperityError
from asperity.geometry.bodies import KINDS as ALL_KINDS
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

RADIUS = 1.5e-3
KINDS = ALL_KINDS[:-1]  # meshes have a file of their own
quick = settings(
    max_examples=80, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip

# What there is to be touched, and how.

unit = st.floats(-1.0, 1.0)
decades = st.floats(math.log10(0.2e-3), -1.0).map(lambda x: 10.0**x)
quaternions = st.one_of(
    st.sampled_from([(1, 0, 0, 0), (0, 1, 0, 0), (0.5, 0.5, 0.5, 0.5), (0.5**0.5, 0.5**0.5, 0, 0)]),
    st.tuples(unit, unit, unit, unit)
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(lambda q: tuple(np.array(q) / np.linalg.norm(q))),
)


@st.composite
def heights(draw, tallest):
    """Return a map no higher than `tallest`: rough, steep, constant, spiked, tiny, oblong."""
    rows, columns = draw(st.integers(4, 20)), draw(st.integers(4, 20))
    pixels = [tallest * 10.0 ** draw(st.floats(-2.0, 1.0)) for _ in range(2)]
    if draw(st.booleans()):
        pixels[1] = pixels[0]
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = draw(st.sampled_from(["rough", "steps", "constant", "spike", "waves", "4x4"]))
    samples = {
        "rough": rng.uniform(-1, 1, (rows, columns)),
        "steps": rng.choice([-1.0, 1.0], (rows, columns)),
        "constant": np.ones((rows, columns)),
        "spike": 1.0 * (rng.permutation(rows * columns) == 0).reshape(rows, columns),
        "waves": np.tile(np.sin(2 * np.pi * np.arange(columns) / columns), (rows, 1)),
        "4x4": rng.uniform(-1, 1, (4, 4)),
    }[shape]
    # Up to twenty metres a metre.
    amplitude = min(tallest, 10.0 * min(pixels)) * draw(st.sampled_from([1.0, 0.1, 1e-3, 0.0]))
    return HeightField(amplitude * samples, tuple(pixels), draw(st.sampled_from(["wrap", "clamp"])))


@st.composite
def bodies(draw, name, kinds=KINDS):
    """Return a body of up to three geoms of one kind, 0.2 mm to 0.1 m large, with or without."""
    kind, size = draw(st.sampled_from(kinds)), draw(decades)
    ratio = st.floats(-1.0, 0.0).map(lambda x: 10.0**x)
    geoms = []
    for i in range(draw(st.integers(1, 3))):
        a, b, c = size, size * draw(ratio), size * draw(ratio)
        sizes = {
            "plane": draw(st.sampled_from([(0.0, 0.0, 0.1), (a, b, 0.1)])), "sphere": (a,),
            "capsule": (b, a), "cylinder": draw(st.sampled_from([(a, b), (b, a)])),
            "ellipsoid": (a, b, c), "box": (a, b, c),
        }[kind]  # fmt: skip
        place = (0, 0, 0) if i == 0 else tuple(size * draw(unit) for _ in range(3))
        geoms.append(Geom(kind, sizes, place, draw(quaternions)))
    valid = (
        ("planar", "cylindrical", "triplanar")
        if kind in ("capsule", "cylinder")
        else ("planar", "triplanar")
    )
    tallest = 0.5 * min(0.1, *(geom.smallest for geom in geoms))
    texture = draw(st.one_of(st.none(), heights(tallest), heights(tallest)))
    offset = (size * draw(unit), size * draw(unit)) if draw(st.booleans()) else (0.0, 0.0)
    return Body(name, geoms, texture, draw(st.sampled_from(valid)), offset)


def span(*some):
    """Return about the reach of the largest body [m]; that of a plane is 1 mm."""
    return max((max(g.size[:2]) if g.kind != "plane" else 1e-3) for b in some for g in b.geoms)


@st.composite
def poses(draw, reach):
    """Return a pose: touching, inside, exactly in the middle, or up to a kilometre away."""
    scale = draw(st.sampled_from([0.0, 0.01, 0.3, 1.0, 1.0, 2.0, 1e6 * RADIUS / reach]))
    place = [reach * scale * draw(st.one_of(unit, st.just(0.0))) for _ in range(3)]
    return pose(*place, draw(quaternions))


@st.composite
def scenes(draw):
    tool, ground = draw(bodies("tool", KINDS[1:])), draw(bodies("ground"))
    path = draw(st.lists(poses(span(tool, ground)), min_size=1, max_size=5))
    ticks = [draw(st.sampled_from([1e-3, 1e-3, 0.0])) for _ in path]
    return tool, ground, draw(poses(span(ground))), path, ticks, draw(st.booleans())


def check(found):
    """Hold all that the engine says of a pose to what it must be, whatever the pose."""
    for name, values in zip(Touch._fields, found, strict=True):
        assert np.isfinite(values).all(), f"{name}: {values}"
    assert np.all(found.depth > 0.0)
    assert np.all(found.gap >= 0.0)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(np.ones(len(found.depth)))
    # One way out has the whole stiffness; of several each has its share. Walls that lean towards
    # each other have more: neither can be left without the other. A patch that is hardly deep has a
    # large weight, so it is with its depth that it counts.
    assert np.all(found.weight > 0.0)
    assert np.all(found.weight * found.depth < 20.0 * found.depth.max(initial=0.0))
    if len(found.depth) == 1:
        assert found.weight[0] > 0.4
    scale = max(np.abs(found.force).sum(), 1e-12)
    assert found.wrench[:3] == pytest.approx(found.force.sum(axis=0), abs=1e-9 * scale)
    if len(found.depth) == 0:
        assert not found.wrench.any()


HOW = {
    "exact": st.just({}),
    "baselines": st.fixed_dictionaries({"law": st.sampled_from(["minsky", "ho", "siira-pai"])}),
    "grids": st.fixed_dictionaries({
        "gradient": st.sampled_from(["differences", "soft"]),
        "grid": st.integers(4, 24),
        "window": st.sampled_from([1e-5, 1e-3, 0.1]),
        "step": st.sampled_from([1e-8, 2e-5, 1e-2]),
        "softness": st.sampled_from([1e-9, 2e-6, 1e-3]),
        "soft_area": st.sampled_from([1e-12, 1e-6, 1e-2]),
    }),
}  # fmt: skip
usual = st.fixed_dictionaries({
    "friction": st.sampled_from([0.0, 0.4, 30.0]),
    "stiffness": st.sampled_from([1e-3, 400.0, 1e6]),
    "max_nodes": st.sampled_from([100, 1000]),
    "tolerance": st.sampled_from([None, 1e-15, 1e-3]),
})  # fmt: skip


@pytest.mark.parametrize("how", HOW)
@quick
@given(data=st.data(), scene=scenes(), force=usual)
def test_no_finite_input_gives_a_wrench_that_is_not_finite(how, data, scene, force):
    tool, ground, ground_pose, path, ticks, tool_first = scene
    force |= data.draw(HOW[how])
    centre = (0.3 * span(tool), 0.0, 0.0)
    engine = engine_for(
        tool, ground, poses=[ground_pose], tool_first=tool_first, centre=centre, **force
    )
    for at, dt in zip(path, ticks, strict=True):
        check(touch(engine, at, dt))


@quick
@given(data=st.data(), a=bodies("a"), b=bodies("b"), toward=quaternions)
def test_no_finite_input_gives_a_depth_that_is_not_finite(data, a, b, toward):
    pair = BodyPair(a, b, max_nodes=200)
    for _ in range(3):
        normal = rotation(pose(0, 0, 0, toward)).apply([0, 0, 1])
        found = pair.depth(data.draw(poses(span(a, b))), data.draw(poses(span(b))), normal)
        assert math.isfinite(found.depth) or found.depth == -math.inf
        rest = (found.gradient, found.point, found.slope_normal, [found.gap, found.ties])
        assert all(np.isfinite(values).all() for values in rest)
        if found.depth > -math.inf:
            assert found.ties >= 1
            assert found.gap >= 0.0
            assert found.slope_normal @ normal == pytest.approx(1.0, rel=1e-6)


@quick
@given(ground=bodies("ground"), places=st.lists(st.tuples(unit, unit, unit), min_size=2))
def test_a_path_of_small_steps_gives_finite_wrenches(ground, places):
    """With memory and friction: the tool goes on from where it is, deep or not."""
    reach = span(ground)
    engine = engine_for(ball(0.1 * reach), ground, friction=0.5, max_nodes=300)
    at = np.array([0.0, 0.0, reach])
    for step in places[:20]:
        at = np.clip(at + 0.1 * reach * np.array(step), -2 * reach, 2 * reach)
        check(touch(engine, pose(*at)))


# What is remembered.


@pytest.mark.parametrize("kind", ["sphere", "box", "capsule"])
def test_a_thin_plate_pushes_out_on_the_nearer_side(kind):
    """A plate of 3 mm, pressed to its other side and back: the same force, both ways."""
    size = {"sphere": (RADIUS,), "box": (RADIUS,) * 3, "capsule": (RADIUS, 1e-3)}[kind]
    lowest = RADIUS + (1e-3 if kind == "capsule" else 0.0)
    engine = engine_for(Body("tool", [Geom(kind, size)]), plate(thick=3e-3))
    middle = 0.5 * (3e-3 + 2.0 * lowest)  # as far from either side
    depths = np.arange(1, 2 * round(middle * 1e4)) * 1e-4
    down = [touch(engine, pose(1e-4, 2e-4, lowest - d)).wrench[2] for d in depths]
    up = [touch(engine, pose(1e-4, 2e-4, lowest - d)).wrench[2] for d in depths[::-1]]
    assert up[::-1] == pytest.approx(down, abs=1e-12)
    forces = np.array(down)
    shallow = depths < 0.7 * middle
    assert forces[shallow] == pytest.approx(STIFFNESS * depths[shallow], rel=1e-9)
    assert forces[np.argmin(abs(depths - middle))] == pytest.approx(0.0, abs=1e-6)
    assert forces[depths > 1.1 * middle].max() < 0.0
    # The force turns round over a fifth of the way before and after the middle.
    assert np.abs(np.diff(forces)).max() < 10.0 * STIFFNESS * 1e-4


@pytest.mark.parametrize(
    "wrap", [list, lambda p: np.repeat(p, 3)[::3], lambda p: p[::-1].copy()[::-1]]
)
def test_a_pose_may_lie_in_memory_as_it_likes(wrap):
    engine = engine_for(ball(), plate(thick=3e-3))
    place = pose(1e-4, 2e-4, RADIUS - 2e-4)
    first = touch(engine, place).wrench
    for _ in range(2):  # the kernels are told the types of what they get once
        assert np.array_equal(engine.wrench(wrap(place), 1e-3), first)


def test_a_time_may_be_a_whole_number():
    one, other = (engine_for(ball(), plate(thick=3e-3), friction=0.5) for _ in range(2))
    for step in range(3):
        place = pose(1e-5 * step, 0.0, RADIUS - 2e-4)
        dt = (0, 1e-3, 1)[step]
        np.testing.assert_array_equal(one.wrench(place, dt), other.wrench(place, float(dt)))


def corner(texture=None):
    """Return a floor, top at z = 0, and a wall, face at x = 0."""
    floor = Geom("box", (8e-3, 8e-3, 2e-3), (0, 0, -2e-3))
    return Body("corner", [floor, Geom("box", (2e-3, 8e-3, 8e-3), (-2e-3, 0, 4e-3))], texture)


@pytest.mark.parametrize("tool_first", [False, True])
def test_walls_of_one_body_have_the_whole_stiffness_each(tool_first):
    engine = engine_for(ball(), corner(), tool_first=tool_first)
    found = touch(engine, pose(RADIUS - 3e-4, 0, RADIUS - 1e-4))
    order = np.argsort(found.depth)
    assert found.depth[order] == pytest.approx([1e-4, 3e-4], abs=1e-12)
    assert found.normal[order] == pytest.approx(np.array([[0, 0, 1.0], [1.0, 0, 0]]))
    assert found.weight[order] == pytest.approx([1.0, 1.0])
    expected = [STIFFNESS * 3e-4, 0, STIFFNESS * 1e-4]
    assert found.wrench[:3] == pytest.approx(expected, abs=1e-10)


def test_two_bodies_each_have_their_own_stiffness():
    parts = corner().geoms
    engine = engine_for(ball(), Body("floor", parts[:1]), Body("wall", parts[1:]))
    found = touch(engine, pose(RADIUS - 3e-4, 0, RADIUS - 1e-4))
    assert found.weight == pytest.approx([1.0, 1.0])
    assert found.wrench[:3] == pytest.approx([STIFFNESS * 3e-4, 0, STIFFNESS * 1e-4], abs=1e-10)


@pytest.mark.parametrize("tool_first", [False, True])
@pytest.mark.parametrize("x", [RADIUS - 2e-4, RADIUS + 4e-5, RADIUS + 2e-4])
def test_a_patch_that_is_near_but_not_deep_weighs_nothing(x, tool_first):
    """The texture's reach makes the engine look there; MuJoCo's order must not matter."""
    engine = engine_for(ball(), corner(waves(50e-6, 1e-3)), tool_first=tool_first)
    flipped = Body("corner", corner().geoms[::-1], waves(50e-6, 1e-3))
    other = engine_for(ball(), flipped, tool_first=tool_first)
    for z in np.linspace(RADIUS - 1e-4, RADIUS + 1e-4, 21):
        engine.reset()
        other.reset()
        found = touch(engine, pose(x, 1e-4, z))
        check(found)
        again = touch(other, pose(x, 1e-4, z))
        assert again.wrench == pytest.approx(found.wrench, abs=1e-9)


def test_textures_that_cannot_be_are_refused_before_they_are_pushed():
    with pytest.raises(AsperityError, match="at most half"):
        ball(0.2e-3, waves(0.3e-3, 1e-3))


def test_turning_in_place_keeps_the_side():
    """A long box turned about its axis while it is deep in a plate that is thinner."""
    tool = Body("tool", [Geom("box", (1e-3, 1e-3, 5e-3))])
    engine = engine_for(tool, plate(thick=2e-3))
    for depth in np.linspace(1e-4, 3e-3, 30):
        touch(engine, pose(0, 0, 5e-3 - depth))
    for angle in np.linspace(0, 2.0, 100):
        found = touch(engine, pose(0, 0, 5e-3 - 3e-3, turn([0, 0, 1], angle)))
        assert found.normal == pytest.approx(np.array([[0, 0, 1.0]]))
        assert found.depth == pytest.approx([3e-3], abs=1e-12)


@pytest.mark.parametrize("radius", [0.25e-3, 0.75e-3, 1.5e-3])
@pytest.mark.parametrize("speed", [1e-2, 0.1, 0.169, 0.25])
def test_fast_slides_off_an_edge_end_on_the_side(radius, speed):
    """Pressed by 50 um off a plate and down beside it: as far as 0.25 mm a tick (ours)."""
    press, step = 5e-5, speed * 1e-3
    engine = engine_for(ball(radius), plate(half=8e-3))
    for x in np.arange(7e-3, 8e-3 + radius - press, step):
        touch(engine, pose(x, 0, radius - press))
    for z in np.arange(radius - press, -1.5e-3, -step):
        found = touch(engine, pose(8e-3 + radius - press, 0, z))
    assert found.normal == pytest.approx(np.array([[1.0, 0, 0]]))
    assert found.wrench[:3] == pytest.approx([STIFFNESS * press, 0, 0], abs=1e-9)
