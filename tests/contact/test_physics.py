"""The wrench is the gradient of an energy: signs, finite differences, edges, work, reaction."""

import math

import numpy as np
import pytest
from naive_bodies import (
    AT_REST,
    ROUND,
    UP,
    Pair,
    engine_of,
    meeting,
    moved,
    plate,
    pose,
    ripple,
    rough,
    solid,
    touch,
    turn,
)
from scipy.spatial.transform import Rotation

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.offsets.analytic import Sinusoid
from oracle.depth import reference_depth

STEP = 2e-8
LEVER = 1e-3
"""Turns are by STEP / LEVER, so that both move the surfaces by as much [m]."""
CLOSE = 1e-6
"""Allowed error of a derivative; of one by a rotation, relative to LEVER."""
STIFFNESS = 400.0


def derivatives(depth_at, at):
    """Return d(depth) by each of six motions: central, and from either side; turns per LEVER."""
    here = depth_at(at)
    ahead, behind = np.empty(6), np.empty(6)
    for axis in range(6):
        step = STEP if axis < 3 else STEP / LEVER
        ahead[axis] = (depth_at(moved(at, axis, step)) - here) / STEP
        behind[axis] = (here - depth_at(moved(at, axis, -step))) / STEP
    return 0.5 * (ahead + behind), ahead, behind


def check_gradient(pair, at, pose_b, n):
    """Hold the gradient to differences, n fixed in B's frame; return how many lay on a kink.

    At a kink two places are equally deep, and a derivative may be that of either.
    """
    found = pair.along(at, pose_b, n, 1e-11)
    gradient = found.gradient * np.array([1.0, 1.0, 1.0, *3 * [1.0 / LEVER]])
    central, ahead, behind = derivatives(lambda p: pair.along(p, pose_b, n, 1e-11).depth, at)
    kinked = ahead - behind > 3e-3
    assert gradient[~kinked] == pytest.approx(central[~kinked], abs=CLOSE)
    assert np.all(gradient[kinked] < ahead[kinked] + CLOSE)
    assert np.all(gradient[kinked] > behind[kinked] - CLOSE)
    return np.count_nonzero(kinked)


def count_kinks(kind_a, textured, seeds):
    """Check the gradients of all pairs with `kind_a`; return how many derivatives were kinks."""
    kinked = total = 0
    for kind_b in (*ROUND, "plane"):
        for seed in seeds:
            a, at, b, pose_b, n = meeting(kind_a, kind_b, seed, textured)
            kinked += check_gradient(Pair(a, b), at, pose_b, n)
            total += 6
    print(f"{kind_a} {textured!r}: {kinked} of {total} derivatives on a kink")
    return kinked / total


@pytest.mark.parametrize("kind_a", ROUND)
def test_the_gradient_agrees_with_differences(kind_a):
    """Every pair of kinds: both textured, the tool, the ground, neither."""
    for seed, textured in enumerate(("ab", "a", "b", "")):
        assert count_kinks(kind_a, textured, [seed]) <= 0.02


@pytest.mark.slow
@pytest.mark.parametrize("textured", ["ab", "a", "b", ""])
@pytest.mark.parametrize("kind_a", ROUND)
def test_the_gradient_agrees_with_differences_for_many_seeds(kind_a, textured):
    assert count_kinks(kind_a, textured, range(4, 10)) <= 0.02


def slopes_of(field, point):
    """Return m of the top of a plate at z = 0 below or above `point`."""
    found = field.derivatives(*point[:2])
    return np.array([-found.h_u, -found.h_v, 1.0])


@pytest.mark.parametrize("texture", [None, rough(8, 5e-6)])
@pytest.mark.parametrize("kind", ["cylinder", "box"])
def test_on_a_rim_of_a_the_slope_of_b_counts(kind, texture):
    tool, ground = solid(kind, "tool", texture), plate(rough(3, 8e-6))
    on_rim = 0
    for seed in range(8):
        about = np.random.default_rng(seed).standard_normal(2)
        # A turn of 0.1 lifts the face more steeply than its texture falls.
        at = pose(1e-4 * seed, 2e-4, 1.2e-3, turn([*about, 0.0], 0.1))
        found = Pair(tool, ground).along(at, AT_REST, UP, 1e-11)
        local = Rotation.from_quat(np.roll(at[3:], -1)).inv().apply(found.point - at[:3])
        far = np.hypot(*local[:2]) - 1.5e-3 if kind == "cylinder" else (
            np.max(np.abs(local[:2]) - [2e-3, 1.5e-3])
        )  # fmt: skip
        if abs(far) < 1e-9:
            on_rim += 1
            assert found.m == pytest.approx(slopes_of(ground.texture, found.point), abs=1e-7)
        assert check_gradient(Pair(tool, ground), at, AT_REST, UP) == 0
    assert on_rim >= 4


@pytest.mark.parametrize("texture", [None, rough(8, 5e-6)])
def test_on_an_edge_of_b_the_slope_of_a_counts(texture):
    tool, ground = solid("sphere", "tool", texture), plate(rough(3, 8e-6), 3e-3)
    for beyond in (0.2e-3, 0.6e-3):
        at = pose(3e-3 + beyond, 2e-4, 1.4e-3)
        found = Pair(tool, ground).along(at, AT_REST, UP, 1e-11)
        assert found.point[0] == pytest.approx(3e-3, abs=1e-9)
        if texture is None:
            across = found.point - at[:3]
            assert found.m == pytest.approx(across / across[2], abs=1e-7)
        assert check_gradient(Pair(tool, ground), at, AT_REST, UP) == 0


@pytest.mark.parametrize("texture", [None, rough(3, 4e-6)])
def test_edge_on_edge_m_is_perpendicular_to_both(texture):
    tool, ground = solid("box"), plate(texture, 3e-3)
    # On its edge along x, which falls towards where the plate has ended.
    stand = Rotation.from_rotvec([0.0, 0.2, 0.3]) * Rotation.from_rotvec([0.7, 0.0, 0.0])
    at = pose(2.5e-3, 1e-4, 1.7e-3, np.roll(stand.as_quat(), 1))
    found = Pair(tool, ground).along(at, AT_REST, UP, 1e-11)
    assert found.point[0] == pytest.approx(3e-3, abs=1e-9)
    rise = 0.0 if texture is None else texture.derivatives(3e-3, found.point[1]).h_v
    assert found.m @ stand.apply([1.0, 0.0, 0.0]) == pytest.approx(0.0, abs=1e-7)
    assert found.m @ [0.0, 1.0, rise] == pytest.approx(0.0, abs=1e-7)
    assert found.m[2] == pytest.approx(1.0)
    # Neither the plate's slope nor that of a face of the tool beside its edge.
    assert abs(found.m[0]) > 0.1
    assert check_gradient(Pair(tool, ground), at, AT_REST, UP) == 0


@pytest.mark.parametrize("kind_a", ROUND)
def test_action_and_reaction(kind_a):
    """A in B along n is B in A along -n: same depth, opposite m, at points a depth apart."""
    for kind_b in ROUND:
        a, at, b, pose_b, n = meeting(kind_a, kind_b, 2)
        one = Pair(a, b).along(at, pose_b, n, 1e-11)
        other = Pair(b, a).along(pose_b, at, -n, 1e-11)
        assert other.depth == pytest.approx(one.depth, abs=2e-11), kind_b
        assert other.m == pytest.approx(-one.m, abs=1e-5), kind_b
        assert other.point == pytest.approx(one.point + one.depth * n, abs=1e-8), kind_b


# The engine: all patches, the law, the sum.


@pytest.mark.parametrize("ground", [plate(), solid("plane", "ground")])
def test_a_flat_plate_pushes_along_its_normal(ground):
    engine = engine_of(solid("sphere"), ground)
    for depth in (1e-6, 1e-4, 5e-4):
        found = touch(engine, pose(1e-3, 2e-3, 1.5e-3 - depth))
        assert found.wrench == pytest.approx([0, 0, STIFFNESS * depth, 0, 0, 0], abs=1e-12)
        assert np.sum(found.weight) == pytest.approx(1.0)
    assert touch(engine, pose(1e-3, 2e-3, 1.6e-3)).wrench == pytest.approx(np.zeros(6), abs=0.0)


def test_the_underside_of_a_plate_pushes_down():
    engine = engine_of(solid("sphere"), plate())
    found = touch(engine, pose(1e-3, 2e-3, -4e-3 - 1.4e-3))
    assert found.wrench == pytest.approx([0, 0, -STIFFNESS * 1e-4, 0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_a_centred_flat_tool_feels_no_torque(kind):
    found = touch(engine_of(solid(kind), plate()), pose(0, 0, 1.19e-3))
    assert found.wrench[:3] == pytest.approx([0.0, 0.0, STIFFNESS * 10e-6], abs=1e-12)
    assert np.abs(found.wrench[3:]).max() < 1e-6 * found.wrench[2] * LEVER


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_textures_in_register_push_at_the_middle(kind):
    """All crests of the tool lie on crests of the plate: the middle of many equal places acts."""
    texture = ripple(20e-6, 0.5e-3)
    found = touch(engine_of(solid(kind, "tool", texture), plate(texture)), pose(0, 0, 1.19e-3))
    assert found.wrench[2] == pytest.approx(STIFFNESS * 50e-6, rel=1e-6)
    assert np.abs(found.wrench[:2]).max() < 1e-6 * found.wrench[2]
    # The middle is that of samples of the tied places: to a fifteenth of the half width (ours).
    assert np.abs(found.wrench[3:]).max() < found.wrench[2] * 0.1e-3


def single(kind, textured, seed):
    """Return tool, ground and a pose in which they touch in one patch, on a plate."""
    tool = solid(kind, "tool", rough(seed, 8e-6) if "a" in textured else None)
    ground = plate(rough(seed + 50, 8e-6) if "b" in textured else None)
    rng = np.random.default_rng(seed)
    at = pose(*rng.uniform(-1e-3, 1e-3, 2), 0.0, turn([*rng.standard_normal(2), 0.0], 0.4))
    at[2] = Pair(tool, ground).along(at, AT_REST, UP).depth - 60e-6
    return tool, ground, at


@pytest.mark.parametrize("textured", ["ab", "a", "b", ""])
@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "capsule", "cylinder", "box"])
def test_the_wrench_is_minus_the_gradient_of_the_energy(kind, textured):
    tool, ground, at = single(kind, textured, 4)
    engine = engine_of(tool, ground)
    found = touch(engine, at)
    central, ahead, behind = derivatives(lambda p: touch(engine, p).energy, at)
    wrench = found.wrench * np.array([1.0, 1.0, 1.0, *3 * [1.0 / LEVER]])
    size = np.linalg.norm(found.wrench[:3])
    if len(found.depth) == 1:
        assert np.all(np.abs(ahead - behind) < 3e-3 * size), "a kink: choose another seed"
    assert wrench == pytest.approx(-central, abs=2e-6 * size)


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "cylinder"])
def test_the_energy_is_that_of_the_reference(kind):
    tool, ground, at = single(kind, "ab", 7)
    found = touch(engine_of(tool, ground), at)
    exact = reference_depth(tool, at, ground, AT_REST, UP, samples=150, zooms=4).depth
    assert found.energy == pytest.approx(0.5 * STIFFNESS * exact**2, rel=0.01)
    assert not found.status.any()


def test_the_offset_of_the_studies():
    """Sphere on a sinusoid: height and F_u / F_n of the 2-D studies."""
    amplitude, wavelength, sink = 0.1e-3, 1.5e-3, 20e-6
    trace = Sinusoid(amplitude, wavelength).tracer(3e-3)
    engine = engine_of(solid("sphere"), plate(ripple(amplitude, wavelength, 256)))
    places = np.linspace(0.0, wavelength, 97)
    places = places[np.abs(places - 0.5 * wavelength) > 1e-6]
    exact = trace(places)
    for place, height, slope in zip(places, exact.height, exact.slope, strict=True):
        found = touch(engine, pose(place, 3e-4, 1.5e-3 + height - sink))
        assert np.sum(found.weight * found.depth) == pytest.approx(sink, abs=1e-4 * amplitude)
        # Height falls where the slope is negative: the tool is pushed forward there.
        assert found.wrench[0] / found.wrench[2] == pytest.approx(-slope, abs=1e-4)
        assert found.wrench[1] == pytest.approx(0.0, abs=1e-4 * found.wrench[2])


def loop_work(engine, centre, count, size):
    """Return net and gross work along a closed path that moves and turns [J]."""
    phase = 2.0 * math.pi * np.arange(count) / count
    axis = np.array([0.6, 0.0, 0.8])
    net = gross = 0.0
    for p in phase:
        place = centre[:3] + size * np.array([math.cos(p), math.sin(p), 0.02 * math.sin(2 * p)])
        speed = size * np.array([-math.sin(p), math.cos(p), 0.04 * math.cos(2 * p)])
        at = np.append(place, turn(axis, 0.05 * math.sin(p)))
        wrench = touch(engine, at).wrench
        power = wrench[:3] @ speed + 0.05 * math.cos(p) * (wrench[3:] @ axis)
        net += power * 2.0 * math.pi / count
        gross += abs(power) * 2.0 * math.pi / count
    return net, gross


def test_no_work_round_a_smooth_loop():
    """The textures are so gentle that the contact never leaps."""
    tool = solid("sphere", "tool", rough(1, 2e-6, 6e-3, 3e-3))
    ground = plate(rough(2, 10e-6, 12e-3, 4e-3))
    net, gross = loop_work(engine_of(tool, ground), pose(0, 0, 1.4e-3), 256, 1e-3)
    assert gross > 1e-6
    assert abs(net) < 1e-6 * gross


def test_work_round_a_kinked_loop_falls_with_the_step():
    """What one loop loses depends on where its steps meet the kinks; many are held to the bar."""
    engine = engine_of(solid("sphere"), plate(ripple(50e-6, 0.8e-3)))
    lost = []
    for count in (500, 8000):
        ratios = []
        for k in range(10):
            start = pose(0.1e-3 + 1.7e-5 * k, 1.3e-5 * k, 1.45e-3)
            net, gross = loop_work(engine, start, count, 1e-3)
            ratios.append(abs(net) / gross)
        lost.append(np.mean(ratios))
    print("net over gross work on kinked loops:", ", ".join(f"{x:.1e}" for x in lost))
    assert lost[0] < 0.02
    assert lost[1] < lost[0] / 8.0


def test_a_body_and_its_pieces_push_alike():
    """Stiffness does not depend on the number of geoms that overlap."""
    tool = Body("tool", [Geom("box", (1e-3, 1e-3, 1e-3), (x, 0, 0)) for x in (-1e-3, 1e-3)])
    found = touch(engine_of(tool, plate()), pose(0, 0, 0.95e-3))
    assert found.wrench[:3] == pytest.approx([0, 0, STIFFNESS * 50e-6], rel=1e-6)
