"""Depth between meshes: its gradient by differences, brute force, geoms that are the same body."""

import math

import numpy as np
import pytest
from naive_bodies import AT_REST, UP, moved, pose, ripple, rough, solid, turn
from naive_meshes import ball_mesh, block, hook, roller, roof, thing, with_uv
from scipy.spatial.transform import Rotation

from asperity.contact.body_pair import BodyPair
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from oracle.depth import reference_depth

STEP = 2e-8
LEVER = 1e-3
"""Turns are by STEP / LEVER, so that both move the surfaces by as much [m]."""
CLOSE = 1e-6
"""Allowed error of a derivative; of one by a rotation, relative to LEVER."""
EXACT = 1e-11
"""Gap asked for where differences over STEP are taken [m]."""

MESHES = {
    "block": lambda: block((2e-3, 1.5e-3, 1.2e-3), cuts=2),
    "ball": lambda: ball_mesh(1.5e-3, 1),
    "roof": lambda: roof(0.15),
    "roller": lambda: roller(1.2e-3, 1.5e-3, 40),
}


def meshed(kind, name, texture, mapping, seed):
    """Return a body of one of `MESHES`; with texture coordinates if `mapping` asks for them."""
    mesh = MESHES[kind]()
    if mapping == "uv" and texture is not None:
        mesh = with_uv(mesh, texture, seed)
    mapping = mapping if texture is not None else "planar"
    offset = (0.0, 0.0) if mapping == "triplanar" else (3e-4, -2e-4)
    return thing(name, mesh, texture, mapping, offset=offset).body


def meeting(kind_a, kind_b, mapping, textured, seed):
    """Return two meshes that overlap by something like a millimetre, and a normal of the second."""
    rng = np.random.default_rng(seed)
    bodies = [
        meshed(kind, name, rough(2 * seed + i, 8e-6) if letter in textured else None, mapping, seed)
        for i, (letter, kind, name) in enumerate((("a", kind_a, "tool"), ("b", kind_b, "ground")))
    ]
    turn_b = Rotation.random(random_state=rng)
    normal = UP if kind_b in ("block", "roof") else rng.standard_normal(3)
    if kind_b == "roller":
        normal[2] = 0.0
    n = turn_b.apply(normal / np.linalg.norm(normal))
    aside = 4e-4 * rng.standard_normal(3)
    aside -= n * (n @ aside)
    tilt = Rotation.from_rotvec(0.2 * rng.standard_normal(3))
    turn_a = Rotation.random(random_state=rng) if seed % 2 else turn_b * tilt
    pose_a = np.append(2e-3 * n + aside, np.roll(turn_a.as_quat(), 1))
    return *bodies, pose_a, np.append(np.zeros(3), np.roll(turn_b.as_quat(), 1)), n


def check_gradient(pair, at, pose_b, n, close=CLOSE):
    """Hold the gradient to differences, n fixed in B's frame; return how many lay on a kink.

    At a kink two places are equally deep, and a derivative may be that of either.
    """
    found = pair.depth(at, pose_b, n)
    assert found.depth > -math.inf
    gradient = found.gradient * np.array([1.0, 1.0, 1.0, *3 * [1.0 / LEVER]])
    ahead, behind = np.empty(6), np.empty(6)
    for axis in range(6):
        step = STEP if axis < 3 else STEP / LEVER
        ahead[axis] = (pair.depth(moved(at, axis, step), pose_b, n).depth - found.depth) / STEP
        behind[axis] = (found.depth - pair.depth(moved(at, axis, -step), pose_b, n).depth) / STEP
    kinked = ahead - behind > 3e-3
    # Where the depth bends sharply (near a drop point), differences are off by their third order.
    allowed = close + 0.03 * np.abs(ahead - behind)
    assert np.all(np.abs(gradient - 0.5 * (ahead + behind))[~kinked] < allowed[~kinked])
    assert np.all(gradient[kinked] < ahead[kinked] + close)
    assert np.all(gradient[kinked] > behind[kinked] - close)
    return np.count_nonzero(kinked)


def exact_pair(a, b):
    return BodyPair(a, b, tolerance=EXACT)


@pytest.mark.parametrize("mapping", ["planar", "uv", "triplanar", "cylindrical"])
@pytest.mark.parametrize("kind_a", MESHES)
def test_the_gradient_agrees_with_differences(kind_a, mapping):
    """Against every mesh: both textured, the tool, the ground, neither."""
    kinked = total = 0
    for number, kind_b in enumerate(MESHES):
        textured = ("ab", "a", "b", "")[(number + list(MESHES).index(kind_a)) % 4]
        a, b, at, pose_b, n = meeting(kind_a, kind_b, mapping, textured, 10 + number)
        kinked += check_gradient(exact_pair(a, b), at, pose_b, n)
        total += 6
    print(f"{kind_a} {mapping}: {kinked} of {total} derivatives on a kink")
    assert kinked <= 0.05 * total


@pytest.mark.slow
@pytest.mark.parametrize("mapping", ["planar", "uv", "triplanar"])
@pytest.mark.parametrize("kind_a", MESHES)
def test_the_gradient_agrees_with_differences_for_more_seeds(kind_a, mapping):
    for textured in ("ab", "a", "b", ""):
        for seed, kind_b in enumerate(MESHES):
            a, b, at, pose_b, n = meeting(kind_a, kind_b, mapping, textured, 30 + seed)
            # Newton's last step leaves 1e-10 m where the surfaces are steep: ten times as much.
            check_gradient(exact_pair(a, b), at, pose_b, n, 10 * CLOSE)


def slope_normal_of(field, point):
    """Return m of the top of a plate at z = 0 above or below `point`."""
    found = field.derivatives(*point[:2])
    return np.array([-found.h_u, -found.h_v, 1.0])


def plate(texture=None, half=8e-3, cuts=3, **more):
    """Return a plate of triangles whose top lies at z = 0."""
    mesh = block((half, half, 2e-3), (0, 0, -2e-3), cuts)
    return thing("plate", mesh, texture, **more).body


@pytest.mark.parametrize("texture", [None, rough(8, 5e-6)])
@pytest.mark.parametrize("kind", ["roller", "block"])
def test_on_a_rim_of_a_the_slope_of_b_counts(kind, texture):
    tool, ground = meshed(kind, "tool", texture, "planar", 0), plate(rough(3, 8e-6))
    on_rim = 0
    for seed in range(6):
        about = np.random.default_rng(seed).standard_normal(2)
        # A turn of 0.1 lifts the face more steeply than its texture falls.
        at = pose(1e-4 * seed, 2e-4, 1.2e-3, turn([*about, 0.0], 0.1))
        pair = exact_pair(tool, ground)
        found = pair.depth(at, AT_REST, UP)
        local = Rotation.from_quat(np.roll(at[3:], -1)).inv().apply(found.point - at[:3])
        if kind == "block":
            far = np.max(np.abs(local[:2]) - [2e-3, 1.5e-3])
        else:
            # How far out of the prism, seen across its nearest side.
            phi = (np.arctan2(local[1], local[0]) % (math.pi / 20)) - math.pi / 40
            far = np.hypot(*local[:2]) * math.cos(phi) - 1.2e-3 * math.cos(math.pi / 40)
        if abs(far) < 1e-9:
            on_rim += 1
            expected = slope_normal_of(ground.texture, found.point)
            assert found.slope_normal == pytest.approx(expected, abs=1e-7)
        assert check_gradient(pair, at, AT_REST, UP) == 0
    assert on_rim >= 3


@pytest.mark.parametrize("texture", [None, rough(8, 5e-6)])
@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
def test_on_an_edge_of_b_the_slope_of_a_counts(texture, mapping):
    tool = meshed("ball", "tool", texture, mapping, 0)
    pair = exact_pair(tool, plate(rough(3, 8e-6), 3e-3))
    for beyond in (0.2e-3, 0.6e-3):
        at = pose(3e-3 + beyond, 2e-4, 1.4e-3, turn([1, 2, 3], 0.7))
        found = pair.depth(at, AT_REST, UP)
        assert found.point[0] == pytest.approx(3e-3, abs=1e-9)
        if texture is None:
            assert abs(found.slope_normal[0]) > 0.05
        assert check_gradient(pair, at, AT_REST, UP) == 0


@pytest.mark.parametrize("texture", [None, rough(3, 4e-6)])
def test_edge_on_edge_m_is_perpendicular_to_both(texture):
    tool, ground = meshed("block", "tool", None, "planar", 0), plate(texture, 3e-3)
    # On its edge along x, which falls towards where the plate has ended.
    stand = Rotation.from_rotvec([0.0, 0.2, 0.3]) * Rotation.from_rotvec([0.7, 0.0, 0.0])
    at = pose(2.5e-3, 1e-4, 1.7e-3, np.roll(stand.as_quat(), 1))
    found = exact_pair(tool, ground).depth(at, AT_REST, UP)
    assert found.point[0] == pytest.approx(3e-3, abs=1e-9)
    rise = 0.0 if texture is None else texture.derivatives(3e-3, found.point[1]).h_v
    m = found.slope_normal
    assert m @ stand.apply([1.0, 0.0, 0.0]) == pytest.approx(0.0, abs=1e-7)
    assert m @ [0.0, 1.0, rise] == pytest.approx(0.0, abs=1e-7)
    assert m[2] == pytest.approx(1.0)
    assert abs(m[0]) > 0.1
    assert check_gradient(exact_pair(tool, ground), at, AT_REST, UP) == 0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("ridge_is_tool", [True, False])
@pytest.mark.parametrize("sides", [12, 96])
def test_parallel_edges_take_a_slope_between_those_of_the_ridge(side, ridge_is_tool, sides):
    """A ridge of a prism lies on a plate's edge: m is that of a facet beside it, or between."""
    radius, sink = 3e-3, 1e-4
    prism, slab = thing("prism", roller(radius, 4e-3, sides)).body, plate(None, 3e-3)
    lying = turn([1, 0, 0], math.pi / 2)
    at = pose(side * (3e-3 + 0.5 * radius), 0, radius * math.cos(math.pi / 6) - sink, lying)
    pair = exact_pair(prism, slab) if ridge_is_tool else exact_pair(slab, prism)
    places = (at, AT_REST, UP) if ridge_is_tool else (AT_REST, at, -UP)
    found = pair.depth(*places)
    assert found.depth == pytest.approx(sink, abs=1e-12)
    one, other = (math.tan(math.pi / 6 + k * math.pi / sides) for k in (-1, 1))
    along = found.slope_normal[0] / found.slope_normal[2]
    assert one - 1e-6 <= side * along <= other + 1e-6
    # Between convex bodies the depth bends down there: to either side it rises less than it falls.
    for axis in (0, 2):
        there, back = (
            (pair.depth(moved(places[0], axis, step), *places[1:]).depth - found.depth) / step
            for step in (STEP, -STEP)
        )
        assert there - CLOSE <= found.gradient[axis] <= back + CLOSE


def two_charts(texture, jump):
    """Return a plate whose texture is shifted by `jump` [m] for x > 0; a seam runs along x = 0."""
    mesh = block((8e-3, 8e-3, 2e-3), (0, 0, -2e-3), 4)
    points = mesh.vertices[mesh.faces]
    uv = points[:, :, :2] + np.where(points.mean(axis=1)[:, None, :1] > 0, jump, 0.0)
    cut = mesh_from_arrays(
        mesh.vertices, mesh.faces, normals=mesh.normals, uv=uv / np.array(texture.size)
    )
    return thing("plate", cut, texture, "uv").body


def test_the_edge_of_a_chart_is_an_edge_of_the_surface():
    """Where the texture is torn, the higher side's border is met like a rim of the plate."""
    texture = rough(5, 12e-6)
    pair = exact_pair(meshed("ball", "tool", None, "planar", 0), two_charts(texture, 0.37e-3))
    on_seam = kinked = total = 0
    for seed, y in enumerate(np.linspace(-3e-3, 3e-3, 24)):
        at = pose(5e-5 * (seed % 5 - 2), y, 1.45e-3, turn([1, 2, seed], 1.0))
        found = pair.depth(at, AT_REST, UP)
        on_seam += abs(found.point[0]) < 1e-9
        kinked += check_gradient(pair, at, AT_REST, UP)
        total += 6
    print(f"{on_seam} of 24 places on the seam, {kinked} of {total} derivatives on a kink")
    assert on_seam >= 4
    assert kinked <= 0.05 * total


# Brute force.

ALLOWED = 0.005
"""Error of a depth, relative to the textures' peak to peak: 1 % of U, which is k delta^2 / 2."""


def compare(cases, report, **look):
    """Return the relative errors of (tool, pose, ground, normal)."""
    errors, missed = [], 0
    for tool, at, ground, n in cases:
        textures = [b.texture for b in (tool, ground) if b.texture is not None]
        gap = max(1e-9, 1e-3 * min(t.rms for t in textures))
        found = BodyPair(tool, ground, tolerance=gap).depth(at, AT_REST, n)
        missed += not found.certified
        exact = reference_depth(tool, at, ground, AT_REST, n, **look).depth
        # Certified: no deeper than the gap allows; and there is a place as deep as it says.
        assert exact <= found.depth + found.gap + 1e-9
        errors.append(abs(found.depth - exact) / sum(t.relief for t in textures))
    print(f"{report}: mean {100 * np.mean(errors):.5f} %, worst {100 * np.max(errors):.5f} %")
    print(f"{missed} are not certified within the budget")
    assert missed == 0
    return np.array(errors)


def tilted(kind, mapping, tilt, seed, texture, ground):
    """Return a tool over a plate, tilted by degrees about a random axis in its plane."""
    rng = np.random.default_rng(seed)
    tool = meshed(kind, "tool", texture, mapping, seed)
    about = np.append(rng.standard_normal(2), 0.0)
    upside = turn([1, 0, 0], math.pi) if kind == "roof" else np.array([1.0, 0, 0, 0])
    whole = Rotation.from_quat(np.roll(turn(about, math.radians(tilt)), -1))
    whole = whole * Rotation.from_quat(np.roll(upside, -1))
    at = pose(*rng.uniform(-1e-3, 1e-3, 2), 1.2e-3, np.roll(whole.as_quat(), 1))
    return tool, at, ground, UP


CASES = [
    (kind, mapping, tilt)
    for kind in ("block", "roof", "ball", "roller")
    for mapping in ("planar", "uv", "triplanar")
    for tilt in (0.0, 5.0, 15.0, 30.0)
]


def against_brute_force(picked, report, **look):
    cases = []
    for i in picked:
        kind, mapping, tilt = CASES[i]
        ground = plate(rough(200 + i, 8e-6), mapping="triplanar" if i % 2 else "planar")
        cases.append(tilted(kind, mapping, tilt, i, rough(300 + i, 8e-6), ground))
    assert compare(cases, report, **look).max() < ALLOWED


def test_depth_agrees_with_brute_force():
    """Smooth normals over a crease (roof), round, prism, block; every mapping, every tilt."""
    against_brute_force([2, 15, 21, 28, 38], "5 rough meshes", samples=120, zooms=4)


@pytest.mark.parametrize("kind", ["ball", "roller"])
def test_depth_agrees_with_brute_force_on_a_map_round_an_axis(kind):
    case = tilted(kind, "cylindrical", 20.0, 4, rough(31, 8e-6), plate(rough(32, 8e-6)))
    look = {"samples": 120, "zooms": 4}
    assert compare([case], f"{kind}, cylindrical", **look).max() < ALLOWED


@pytest.mark.slow
def test_depth_agrees_with_brute_force_for_every_case():
    against_brute_force(range(len(CASES)), f"{len(CASES)} rough meshes", samples=160, zooms=4)


def test_depth_between_curved_meshes_agrees_with_brute_force():
    for kind_a, kind_b, seed in (("ball", "roof", 2), ("roof", "roller", 4)):
        a, b, at, pose_b, n = meeting(kind_a, kind_b, "planar", "ab", seed)
        found = BodyPair(a, b, tolerance=1e-8).depth(at, pose_b, n)
        exact = reference_depth(a, at, b, pose_b, n, samples=120, zooms=4).depth
        assert abs(found.depth - exact) < ALLOWED * (a.texture.relief + b.texture.relief)


MAPS = (
    ("measured/sandpaper_P40_height16.png", {"pixel_size": 8e-6, "height_range": 200e-6}),
    ("heights/Ground054_1K_Displacement.jpg", {"pixel_size": 10e-6, "height_range": 100e-6}),
    ("measured/mdf_stripes_1_height16.png", {"pixel_size": 10e-6, "height_range": 200e-6}),
)
"""The scales are ours."""


def on_real_maps(data, kind, mapping, tilt, seed):
    fields = []
    for name, scale in (MAPS[seed % 3], MAPS[(seed + 1) % 3]):
        if not (data / name).is_file():
            pytest.skip(f"shared/data has no {name}")
        fields.append(HeightField.from_file(data / name, missing="fill", **scale))
    return tilted(kind, mapping, tilt, seed, fields[0], plate(fields[1]))


@pytest.mark.parametrize("case", [
    ("ball", "uv", 0.0, 2),
    pytest.param(("roof", "planar", 5.0, 1), marks=pytest.mark.slow),
    pytest.param(("block", "triplanar", 5.0, 3), marks=pytest.mark.slow),
], ids=lambda case: case[0])  # fmt: skip
def test_depth_on_real_maps(data, case):
    cases = [on_real_maps(data, *case)]
    assert compare(cases, "on real maps", samples=120, zooms=4).max() < ALLOWED


@pytest.mark.slow
def test_depth_on_real_maps_at_every_tilt(data):
    cases = [on_real_maps(data, k, m, t, i) for i, (k, m, t) in enumerate(CASES[::3])]
    errors = compare(cases, f"{len(cases)} cases on real maps", samples=160, zooms=4)
    assert errors.max() < ALLOWED


# Meshes and geoms that are the same body.


def same(one, other, at, pose_b, n, **how):
    first, second = (BodyPair(*pair, tolerance=EXACT).depth(at, pose_b, n) for pair in (one, other))
    assert first.depth == pytest.approx(second.depth, abs=1e-9), how
    assert first.gradient[:3] == pytest.approx(second.gradient[:3], abs=1e-9), how
    assert first.gradient[3:] == pytest.approx(second.gradient[3:], abs=1e-9 * LEVER), how
    assert first.point == pytest.approx(second.point, abs=1e-8), how


@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
@pytest.mark.parametrize("cuts", [1, 5])
def test_a_box_of_triangles_is_a_box(mapping, cuts):
    half, more = (2e-3, 1.5e-3, 1.2e-3), {"mapping": mapping}
    if mapping == "planar":
        more["offset"] = (1e-4, 3e-4)
    for seed in range(6):
        bodies = []
        for k, name in enumerate(("tool", "ground")):
            texture = rough(seed + 7 * k, 10e-6) if (seed + k) % 3 else None
            box = Body(name, [Geom("box", half)], texture, **more)
            bodies.append((box, thing(name, block(half, cuts=cuts), texture, **more).body))
        rng = np.random.default_rng(seed)
        tilt = turn([*rng.standard_normal(3)], 0.3 * rng.random() * (seed > 0))
        at = pose(*rng.uniform(-1e-3, 1e-3, 2), 2.3e-3, tilt)
        exact = bodies[0][0], bodies[1][0]
        for other in ((bodies[0][1], bodies[1][1]), (bodies[0][0], bodies[1][1])):
            same(other, exact, at, AT_REST, UP, seed=seed)


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "capsule", "ellipsoid"])
def test_a_round_geom_meets_a_box_of_triangles_as_it_meets_a_box(kind):
    texture, half = rough(3, 10e-6), (8e-3, 8e-3, 2e-3)
    boxes = (
        Body("plate", [Geom("box", half)], texture),
        thing("plate", block(half, cuts=4), texture).body,
    )
    for seed in range(4):
        tool = solid(kind, "tool", rough(seed, 6e-6) if seed % 2 else None)
        at = pose(3e-4 * seed, 1e-4, 3.2e-3, turn([1, seed, 2], 0.4 * seed))
        same((tool, boxes[1]), (tool, boxes[0]), at, AT_REST, UP, seed=seed)
        # And as the ground, along the normal of its top.
        if kind in ("sphere", "ellipsoid"):
            low = pose(0, 0, -3.2e-3)
            same((boxes[1], tool), (boxes[0], tool), AT_REST, low, UP, seed=seed)


def test_meshing_does_not_count():
    texture = rough(9, 10e-6)
    tool = meshed("block", "tool", rough(4, 6e-6), "planar", 0)
    at = pose(3e-4, -2e-4, 1.25e-3, turn([1, 2, 0.5], 0.05))
    first = BodyPair(tool, plate(texture, cuts=1), tolerance=EXACT).depth(at, AT_REST, UP)
    for cuts in (4, 16, 64):
        found = BodyPair(tool, plate(texture, cuts=cuts), tolerance=EXACT).depth(at, AT_REST, UP)
        assert found.depth == pytest.approx(first.depth, abs=1e-12)
        assert found.gradient == pytest.approx(first.gradient, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_action_and_reaction(seed):
    """A in B along n is B in A along -n: same depth, opposite m, at points a depth apart."""
    kinds = list(MESHES)
    a, b, at, pose_b, n = meeting(kinds[seed % 4], kinds[(seed + seed // 4) % 4], "uv", "ab", seed)
    one = exact_pair(a, b).depth(at, pose_b, n)
    other = exact_pair(b, a).depth(pose_b, at, -n)
    assert other.depth == pytest.approx(one.depth, abs=2e-11)
    assert other.slope_normal == pytest.approx(-one.slope_normal, abs=1e-5)
    assert other.point == pytest.approx(one.point + one.depth * n, abs=1e-8)


def test_plates_in_and_out_of_register():
    """Crests meet crests: the depth is that of the bases and 2 A; a half wave on, of the bases."""
    amplitude, wavelength, sink = 50e-6, 1e-3, 0.3e-3
    tool = thing("tool", block((2e-3, 1e-3, 1e-3)), ripple(amplitude, wavelength)).body
    pair = BodyPair(tool, plate(ripple(amplitude, wavelength)))
    for shift, rise in ((0.0, 2 * amplitude), (0.5 * wavelength, 0.0), (0.25 * wavelength, None)):
        found = pair.depth(pose(shift, 0, 1e-3 - sink), AT_REST, UP)
        # Two waves of one length a quarter apart: sqrt(2) A.
        rise = math.sqrt(2.0) * amplitude if rise is None else rise
        assert found.depth == pytest.approx(sink + rise, abs=2e-9)
        # Half a wave on all places are equally deep, and any of their slopes is one.
        if shift != 0.5 * wavelength:
            rate = -2 * amplitude * math.pi / wavelength * math.sin(math.pi * shift / wavelength)
            assert found.gradient[:3] == pytest.approx([rate, 0.0, -1.0], abs=1e-3)


def test_smooth_overlap_leaves_out_the_far_side():
    """Of two shelves of one mesh, the tool meets the lower alone if the upper is too deep."""
    pair = BodyPair(thing("tool", block((5e-4, 5e-4, 5e-4))).body, hook().body)
    # On the lower arm: its top is at -5 mm, the upper arm's at 0.
    at = pose(5e-3, 0, -5e-3 + 4.5e-4)
    assert pair.depth(at, AT_REST, UP, smooth_overlap=1e-3).depth == pytest.approx(5e-5)
    assert pair.depth(at, AT_REST, UP).depth == pytest.approx(5.05e-3)


def test_too_many_pairs_are_refused_and_never_left_out():
    balls = [thing(name, ball_mesh(1.5e-3, 3)).body for name in ("tool", "ground")]
    at = pose(0, 0, 2.9e-3)
    with pytest.raises(AsperityError, match="smooth_overlap"):
        BodyPair(*balls).depth(at, AT_REST, UP)
    near = BodyPair(*balls).depth(at, AT_REST, UP, smooth_overlap=3e-4)
    assert near.depth == pytest.approx(1e-4, abs=3e-5)
