"""No finite input gives a number that is not finite, where meshes touch."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from naive_engine import pose, rotation, turn

from asperity.contact.body_pair import BodyPair
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from contact.naive_meshes import Touch, ball_mesh, block, engine_of, thing, touch

quick = settings(
    max_examples=60, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip

unit = st.floats(-1.0, 1.0)
decades = st.floats(math.log10(0.3e-3), -1.0).map(lambda x: 10.0**x)
quaternions = st.one_of(
    st.sampled_from([(1, 0, 0, 0), (0, 1, 0, 0), (0.5, 0.5, 0.5, 0.5), (0.5**0.5, 0.5**0.5, 0, 0)]),
    st.tuples(unit, unit, unit, unit)
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(lambda q: tuple(np.array(q) / np.linalg.norm(q))),
)
generators = st.integers(0, 2**32).map(np.random.default_rng)
TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) / 2.0


@st.composite
def shapes(draw):
    """Return vertices about as large as 1 and triangles: of a box, a tetrahedron, a ball."""
    rng, kind = draw(generators), draw(st.sampled_from(["box", "finer", "tetrahedron", "ball"]))
    if kind == "tetrahedron":
        return TETRAHEDRON, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
    mesh = {
        "box": lambda: block((0.5, 0.5, 0.5)),
        "finer": lambda: block((0.5, 0.4, 0.2), cuts=3),
        "ball": lambda: ball_mesh(0.5, 1),
    }[kind]()
    # Flat, bumpy, or torn about so that its surface runs through itself.
    jitter = draw(st.sampled_from([0.0, 0.0, 1e-9, 0.02, 0.3]))
    vertices = mesh.vertices + jitter * rng.uniform(-1, 1, mesh.vertices.shape)
    return vertices * draw(st.sampled_from([(1, 1, 1), (1, 1, 0.1), (0.2, 1, 1)])), mesh.faces


@st.composite
def textures(draw, tallest):
    rng = draw(generators)
    shape = (draw(st.integers(4, 16)), draw(st.integers(4, 16)))
    pixels = [tallest * 10.0 ** draw(st.floats(-1.5, 1.0)) for _ in range(2)]
    samples = draw(st.sampled_from([
        lambda: rng.uniform(-1, 1, shape), lambda: rng.choice([-1.0, 1.0], shape),
        lambda: np.ones(shape), lambda: np.tile(np.sin(np.arange(shape[1])), (shape[0], 1)),
    ]))()  # fmt: skip
    amplitude = min(tallest, 10.0 * min(pixels)) * draw(st.sampled_from([1.0, 0.1, 1e-3, 0.0]))
    return HeightField(amplitude * samples, tuple(pixels), draw(st.sampled_from(["wrap", "clamp"])))


@st.composite
def meshes(draw, size):
    """Return a mesh with normals of any direction and texture coordinates of any kind."""
    vertices, faces = draw(shapes())
    rng, corners = draw(generators), (len(faces), 3)
    normals = draw(st.sampled_from([
        lambda: {"hard_angle": None}, lambda: {"hard_angle": 30.0},
        lambda: {"normals": rng.standard_normal((*corners, 3))},
        lambda: {"normals": vertices + 0.3 * rng.standard_normal(vertices.shape)},
    ]))()  # fmt: skip
    uv = draw(st.sampled_from([
        lambda: None, lambda: rng.uniform(-1, 2, (*corners, 2)),
        lambda: np.zeros((*corners, 2)), lambda: vertices[:, [1, 0]] * [1.0, -1.0],
        lambda: vertices[:, [0, 0]], lambda: 1e5 * vertices[:, :2],
        lambda: 1e-9 * vertices[:, :2],
    ]))()  # fmt: skip
    return mesh_from_arrays(size * vertices, faces, uv=uv, **normals)


@st.composite
def things(draw, name):
    size = draw(decades)
    mesh = draw(meshes(size))
    valid = ["planar", "cylindrical", "triplanar", *(["uv"] if mesh.uv is not None else [])]
    texture = draw(st.one_of(st.none(), textures(0.2 * size), textures(0.01 * size)))
    offset = (size * draw(unit), size * draw(unit)) if draw(st.booleans()) else (0.0, 0.0)
    return thing(name, mesh, texture, draw(st.sampled_from(valid)), offset=offset), size


@st.composite
def tools(draw):
    """Return a mesh, mostly, or a geom."""
    if draw(st.booleans()):
        return draw(things("tool"))
    size = draw(decades)
    kind = draw(st.sampled_from(["sphere", "capsule", "ellipsoid", "cylinder", "box"]))
    texture = draw(st.one_of(st.none(), textures(0.05 * size)))
    mapping = draw(st.sampled_from(["planar", "triplanar"]))
    return Body("tool", [Geom(kind, (0.5 * size, 0.3 * size, 0.2 * size))], texture, mapping), size


@st.composite
def poses(draw, reach):
    """Return a pose: touching, inside, exactly in the middle, or up to a kilometre away."""
    scale = draw(st.sampled_from([0.0, 0.01, 0.3, 0.6, 0.6, 1.0, 1e3 / reach]))
    place = [reach * scale * draw(st.one_of(unit, st.just(0.0))) for _ in range(3)]
    return pose(*place, draw(quaternions))


def check(found):
    """Hold all that the engine says of a pose to what it must be, whatever the pose."""
    for name, values in zip(Touch._fields, found, strict=True):
        assert np.isfinite(values).all(), f"{name}: {values}"
    assert np.all(found.depth > 0.0)
    assert np.all(found.gap >= 0.0)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(np.ones(len(found.depth)))
    assert np.all(found.weight > 0.0)
    for body in set(found.body):
        total = found.weight[found.body == body].sum()
        # Less than 1 where a tool slides off an edge, or some patches of a wide one are free; more
        # between walls, each of which has the whole stiffness.
        assert total <= 6.0
    scale = max(np.abs(found.force).sum(), 1e-12)
    assert found.wrench[:3] == pytest.approx(found.force.sum(axis=0), abs=1e-9 * scale)
    if len(found.depth) == 0:
        assert not found.wrench.any()


usual = st.fixed_dictionaries({
    "friction": st.sampled_from([0.0, 0.4, 30.0]),
    "stiffness": st.sampled_from([1e-3, 400.0, 1e6]),
    "max_nodes": st.sampled_from([100, 1000]),
    "tolerance": st.sampled_from([None, 1e-15, 1e-3]),
    "patch_radius": st.sampled_from([1e-5, 2.5e-3, 1.0]),
})  # fmt: skip


@quick
@given(data=st.data(), tool=tools(), ground=things("ground"), force=usual, first=st.booleans())
def test_no_finite_input_gives_a_wrench_that_is_not_finite(data, tool, ground, force, first):
    """Poses have nothing to do with one another: the tool is somewhere else each time."""
    (tool, size), (ground, other) = tool, ground
    reach = max(size, other)
    centre = (0.3 * size, 0.0, 0.0)
    at = data.draw(poses(reach))
    engine = engine_of(tool, ground, poses=[at], tool_first=first, centre=centre, **force)
    for where in data.draw(st.lists(poses(reach), min_size=1, max_size=5)):
        placed = np.append(
            at[:3] + rotation(at).apply(where[:3]),
            np.roll((rotation(at) * rotation(where)).as_quat(), 1),
        )
        check(touch(engine, placed, data.draw(st.sampled_from([1e-3, 1e-3, 0.0]))))


@quick
@given(tool=tools(), ground=things("ground"), places=st.lists(st.tuples(unit, unit, unit, unit)))
def test_a_path_of_small_steps_gives_finite_wrenches(tool, ground, places):
    """With memory and friction: the tool goes on from where it is, deep or not."""
    (tool, size), (ground, other) = tool, ground
    reach = max(size, other)
    engine = engine_of(tool, ground, friction=0.5, max_nodes=300)
    at, angle = np.array([0.0, 0.0, 0.5 * reach]), 0.0
    for *step, turned in places[:20]:
        at = np.clip(at + 0.05 * reach * np.array(step), -reach, reach)
        angle += 0.1 * turned
        check(touch(engine, pose(*at, turn([3, 4, 0], angle))))


@quick
@given(data=st.data(), a=things("a"), b=things("b"), toward=quaternions)
def test_no_finite_input_gives_a_depth_that_is_not_finite(data, a, b, toward):
    (a, size), (b, other) = a, b
    reach = max(size, other)
    pair = BodyPair(a.body, b.body, max_nodes=200)
    for _ in range(3):
        normal = rotation(pose(0, 0, 0, toward)).apply([0, 0, 1])
        try:
            found = pair.depth(data.draw(poses(reach)), data.draw(poses(reach)), normal)
        except AsperityError:  # no room for so many pairs of facets
            continue
        assert math.isfinite(found.depth) or found.depth == -math.inf
        rest = (found.gradient, found.point, found.slope_normal, [found.gap, found.ties])
        assert all(np.isfinite(values).all() for values in rest)
        if found.depth > -math.inf:
            assert found.ties >= 1
            assert found.gap >= 0.0
            assert found.slope_normal @ normal == pytest.approx(1.0, rel=1e-6)


@quick
@given(tool=things("tool"), ground=things("ground"), at=st.data())
def test_the_same_path_gives_the_same_wrenches_after_reset(tool, ground, at):
    (tool, size), (ground, other) = tool, ground
    path = at.draw(st.lists(poses(max(size, other)), min_size=1, max_size=4))
    engine = engine_of(tool, ground, max_nodes=200, friction=0.3)
    first = [touch(engine, p).wrench for p in path]
    engine.reset()
    assert np.array_equal(first, [touch(engine, p).wrench for p in path])


def test_looking_elsewhere_leaves_no_trace():
    """A tool past the middle of a plate keeps its side, wherever one has looked meanwhile."""
    tool = thing("tool", block((1e-3, 1e-3, 4e-3)))
    engine = engine_of(tool, thing("ground", block((20e-3, 20e-3, 1.5e-3), (0, 0, -1.5e-3))))
    for depth in np.arange(1, 71) * 1e-4:
        expected = touch(engine, pose(0, 0, 4e-3 - depth)).wrench
    for elsewhere in ((0, 0, 3e-3), (2e-3, 0, 8e-3), (0, 0, 50e-3)):
        touch(engine, pose(*elsewhere), 0.0)
    assert touch(engine, pose(0, 0, 4e-3 - depth)).wrench == pytest.approx(expected)
