"""Force laws: the baselines, friction, the sum over contacts, and other ways to the gradient."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from naive_engine import (
    AT_REST,
    STIFFNESS,
    TICK,
    ball,
    baseline_force,
    engine_for,
    plate,
    pose,
    rotation,
    touch,
    turn,
    under_ball,
    waves,
)

from asperity.contact.response.settings import LAWS
from asperity.geometry.bodies import Body, Geom

RADIUS = 1.5e-3
LEVER = 1e-3
TEXTURE = waves(30e-6, 1.1e-3)
TILTED = pose(2e-3, -1e-3, 3e-3, turn([1, 2, 0.5], 0.6))


def over(plate_pose, x, y, depth):
    """Return the pose of a ball that is `depth` deep in a smooth plate."""
    above = rotation(plate_pose).apply([x, y, RADIUS - depth])
    return np.append(plate_pose[:3] + above, turn([3, 1, 2], 1.0))


# Baselines.


@pytest.mark.parametrize("law", ["minsky", "ho"])
@pytest.mark.parametrize("plate_pose", [AT_REST, TILTED])
def test_a_baseline_takes_the_texture_at_one_point(law, plate_pose):
    """Also where the depth is less than the texture is high; the tool's own texture is unseen."""
    settings = {"law": law, "ho_gain": 1.3} if law == "ho" else {"law": law}
    scene = {"poses": [plate_pose], "centre": (4e-4, 0, -2e-4), **settings}
    smooth = engine_for(ball(), plate(TEXTURE), **scene)
    textured = engine_for(ball(texture=waves(9e-6, 3e-4)), plate(TEXTURE), **scene)
    rng = np.random.default_rng(1)
    for depth in (2e-6, 20e-6, 45e-6, 300e-6):
        at = over(plate_pose, *rng.uniform(-3e-3, 3e-3, 2), depth)
        found, under = touch(smooth, at), under_ball(RADIUS, at, plate_pose)
        force = baseline_force(law, under, TEXTURE, plate_pose, 1.3)
        arm = under.place - (at[:3] + rotation(at).apply([4e-4, 0, -2e-4]))
        assert found.depth == pytest.approx([depth], abs=1e-12)
        assert found.wrench[:3] == pytest.approx(force, abs=1e-9 * STIFFNESS * depth)
        assert found.wrench[3:] == pytest.approx(np.cross(arm, force), abs=1e-9)
        np.testing.assert_array_equal(touch(textured, at).wrench, found.wrench)


def test_every_law_has_a_branch_of_its_own_and_a_place_in_the_documents():
    page = (Path(__file__).parents[2] / "docs" / "force_laws.md").read_text("utf-8")
    forces = {}
    for law in LAWS:
        engine = engine_for(ball(), plate(TEXTURE), law=law)
        engine.wrench(pose(1e-4, 0, RADIUS - 1e-4), TICK)
        forces[law] = np.array(engine.wrench(pose(2e-4, 0, RADIUS - 1e-4), TICK)[:3])
        assert forces[law][2] > 0.0, law
        assert f"`{law}`" in page
    for one, other in itertools.combinations(LAWS, 2):
        assert not np.allclose(forces[one], forces[other], rtol=1e-6), (one, other)


def noise_of(seed, ticks=6000, **settings):
    """Return F/(k d) of a ball that slides along a tilted plate by a micrometre a tick."""
    engine = engine_for(
        ball(), plate(TEXTURE), poses=[TILTED], law="siira-pai", seed=seed, **settings
    )
    x = 1e-6 * np.arange(ticks + 1)
    forces = [np.array(engine.wrench(over(TILTED, p, 0, 1e-4), TICK)[:3]) for p in x]
    return rotation(TILTED).inv().apply(forces[1:]) / (STIFFNESS * 1e-4)


def test_noise_of_siira_and_pai_has_its_mean_deviation_and_bandwidth():
    share = noise_of(0, noise_level=0.3, noise_bandwidth=40.0)
    assert share[:, 2] == pytest.approx(np.ones(len(share)), abs=1e-9)
    keep = math.exp(-2.0 * math.pi * 40.0 * TICK)
    # Of a series with memory: the mean's own deviation.
    of_mean = 0.3 * math.sqrt((1 + keep) / (1 - keep) / len(share))
    for across in (share[100:, 0], share[100:, 1]):
        assert abs(across.mean()) < 4 * of_mean
        assert across.std() == pytest.approx(0.3, rel=0.06)
        assert np.corrcoef(across[1:], across[:-1])[0, 1] == pytest.approx(keep, abs=0.03)
    assert abs(np.corrcoef(share[:, 0], share[:, 1])[0, 1]) < 0.1


def test_noise_of_siira_and_pai_repeats_with_its_seed():
    first = noise_of(5, 200)
    np.testing.assert_array_equal(noise_of(5, 200), first)
    for other in (6, 11, 17, 5 + 2**48):
        there = noise_of(other, 200)
        for lag in range(4):
            # Nor is it the same noise a little later.
            for a, b in ((first[lag:], there[: 200 - lag]), (there[lag:], first[: 200 - lag])):
                assert abs(np.corrcoef(a[:, 0], b[:, 0])[0, 1]) < 0.5


def test_there_is_no_noise_without_sliding():
    engine = engine_for(ball(), plate(TEXTURE), law="siira-pai")
    for _ in range(5):
        at_rest = touch(engine, pose(1e-4, 0, RADIUS - 1e-4)).wrench
        assert at_rest == pytest.approx([0, 0, STIFFNESS * 1e-4, 0, 0, 0], abs=1e-12)
    for depth in np.linspace(1e-4, 2e-4, 5):
        pressed = touch(engine, pose(1e-4, 0, RADIUS - depth)).wrench
        assert pressed[:2] == pytest.approx([0, 0], abs=1e-12), "pressing is no sliding"
    slid = touch(engine, pose(1.1e-4, 0, RADIUS - 2e-4)).wrench
    assert np.hypot(*slid[:2]) > 1e-4


def test_a_look_does_not_go_on_with_the_noise():
    engine = engine_for(ball(), plate(TEXTURE), law="siira-pai")
    runs = []
    for looks in (False, True):
        engine.reset()
        runs.append([])
        for x in 1e-6 * np.arange(30):
            runs[-1].append(touch(engine, pose(x, 0, RADIUS - 1e-4)).wrench)
            if looks:
                touch(engine, pose(x, 0, RADIUS - 1e-4), 0.0)
    np.testing.assert_array_equal(*runs)


# Friction: a bristle of STIFFNESS that slips at MU N.

MU, DEPTH = 0.5, 1e-4
NORMAL = STIFFNESS * DEPTH
SLIPS = MU * NORMAL / STIFFNESS
"""How far the bristle bends before it slips [m]."""


def drag_along(engine, path, depth=DEPTH):
    """Return the tangential forces (n, 2) on a ball over a flat plate along a path (n, 2)."""
    return np.array([touch(engine, pose(x, y, RADIUS - depth)).wrench[:2] for x, y in path])


def test_a_bristle_sticks_slips_and_returns():
    """There and back: a spring, then mu N against the motion, and the same the other way."""
    engine = engine_for(ball(), plate(), friction=MU)
    step = SLIPS / 10
    there = np.arange(0, 30) * step
    x = np.concatenate([there, there[::-1][1:]])
    force = drag_along(engine, np.column_stack([x, 0 * x]))
    held, expected = 0.0, []
    for moved in np.diff(x, prepend=x[0]):
        held = np.clip(held + moved, -SLIPS, SLIPS)
        expected.append(-STIFFNESS * held)
    assert force[:, 0] == pytest.approx(np.array(expected), abs=1e-9 * NORMAL)
    assert force[:, 1] == pytest.approx(np.zeros(len(x)), abs=1e-12)
    assert force[29, 0] == pytest.approx(-MU * NORMAL)
    assert force[-1, 0] == pytest.approx(MU * NORMAL)


def test_friction_opposes_motion_in_any_direction_and_stays_in_its_cone():
    engine = engine_for(ball(), plate(), friction=MU)
    angles = np.repeat(np.linspace(0, 5, 8), 40)
    path = np.cumsum(5e-6 * np.column_stack([np.cos(angles), np.sin(angles)]), axis=0)
    force = drag_along(engine, path)
    assert np.all(np.hypot(*force.T) <= MU * NORMAL * (1 + 1e-9))
    for last in range(39, len(path), 40):
        heading = path[last] - path[last - 1]
        # After ten lengths of the bristle it trails behind.
        along = force[last] @ heading / np.linalg.norm(heading)
        assert along == pytest.approx(-MU * NORMAL, rel=1e-3)


def test_friction_has_its_own_stiffness_and_a_tilted_plate():
    engine = engine_for(
        ball(), plate(), poses=[TILTED], friction=MU, bristle_stiffness=100.0, tool_first=True
    )
    for i in range(10):
        found = touch(engine, over(TILTED, i * 1e-6, 0, DEPTH)).wrench
    across = rotation(TILTED).inv().apply(found[:3])
    assert across == pytest.approx([-100.0 * 9e-6, 0.0, NORMAL], abs=1e-9)


def test_no_friction_without_a_coefficient():
    assert not drag_along(
        engine_for(ball(), plate()), [(x, 0.0) for x in np.linspace(0, 1e-3, 9)]
    ).any()


def test_friction_ends_with_the_contact_and_with_reset():
    engine = engine_for(ball(), plate(), friction=MU)
    for interlude in ("lift", "reset"):
        assert drag_along(engine, [(0, 0), (1e-3, 0)])[-1, 0] == pytest.approx(-MU * NORMAL)
        if interlude == "lift":
            touch(engine, pose(1e-3, 0, RADIUS + 1e-3))
        else:
            engine.reset()
        assert drag_along(engine, [(1e-3, 0)]) == pytest.approx(np.zeros((1, 2)), abs=1e-15)


def test_a_look_does_not_bend_or_forget_the_bristle():
    engine = engine_for(ball(), plate(), friction=MU)
    before = drag_along(engine, [(0, 0), (1e-5, 0)])[-1]
    here, away = pose(1e-5, 0, RADIUS - DEPTH), pose(1e-5, 0, 1.0)
    for at in (here, away, pose(5e-4, 0, RADIUS - 1e-6), here):
        looked = touch(engine, at, 0.0).wrench[:2]
        if at is here:
            np.testing.assert_array_equal(looked, before)
    np.testing.assert_array_equal(touch(engine, here).wrench[:2], before)


def test_a_rolling_ball_is_not_braked_and_a_sliding_one_is():
    engine = engine_for(ball(), plate(), friction=MU)
    # It rolls on the circle that the pressed ball touches: its deepest place is at rest.
    steps = 1e-6 * np.arange(300)
    for x in steps:
        rolled = touch(engine, pose(x, 0, RADIUS - DEPTH, turn([0, 1, 0], x / RADIUS))).wrench
    assert abs(rolled[0]) < 0.01 * MU * NORMAL
    for x in steps:
        slid = touch(engine, pose(2 * x, 0, RADIUS - DEPTH)).wrench
    assert slid[0] == pytest.approx(-MU * NORMAL)
    assert slid[4] == pytest.approx(MU * NORMAL * RADIUS)


def test_every_patch_has_its_own_bristle():
    """Along a floor and a wall that are pressed differently; then the wall is left."""
    wall = Body("wall", [Geom("box", (2e-3, 9e-3, 9e-3), (-2e-3, 0, 0))])
    engine = engine_for(ball(), plate(), wall, friction=MU)
    for y in np.linspace(0, 1e-3, 50):
        both = touch(engine, pose(RADIUS - 3 * DEPTH, y, RADIUS - DEPTH))
    assert sorted(both.body) == [0, 1]
    for body, share in ((0, 1.0), (1, 3.0)):
        force = both.force[both.body == body][0]
        assert force[1] == pytest.approx(-MU * share * NORMAL)
        assert np.linalg.norm(force) == pytest.approx(share * NORMAL * math.hypot(1, MU))
    # Half way back only the wall's, which bends further, still pulls back.
    for y in np.linspace(1e-3, 1e-3 - 2 * SLIPS, 50):
        back = touch(engine, pose(RADIUS - 3 * DEPTH, y, RADIUS - DEPTH))
    assert back.force[back.body == 0][0][1] == pytest.approx(MU * NORMAL)
    assert back.force[back.body == 1][0][1] == pytest.approx(-MU * NORMAL)
    left = touch(engine, pose(RADIUS + 1e-6, 1e-3 - 2 * SLIPS, RADIUS - DEPTH))
    assert list(left.body) == [0]
    assert np.hypot(*left.wrench[:2]) == pytest.approx(MU * NORMAL)


@pytest.mark.parametrize("texture", [None, TEXTURE])
@pytest.mark.parametrize("seed", range(4))
def test_friction_makes_no_energy_round_a_closed_path(texture, seed):
    """From a straight bristle: what it gives back was put in. The load varies on the way."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 2 * np.pi, 1500)
    size = rng.uniform(0.2, 20) * SLIPS
    path = sum(
        size * rng.standard_normal(3)[:, None] / k * (np.cos(k * phase + p) - np.cos(p))
        for k, p in zip((1, 2, 3), rng.uniform(0, 6, 3), strict=True)
    )
    path[2] = RADIUS - DEPTH * (1 + 0.5 * np.sin(phase) * rng.choice([-1, 1]))
    rubbed = engine_for(ball(), plate(texture), friction=MU)
    smooth = engine_for(ball(), plate(texture))
    drag = np.array([
        touch(rubbed, pose(*p)).wrench[:3] - touch(smooth, pose(*p)).wrench[:3] for p in path.T
    ])  # fmt: skip
    works = np.einsum("ij,ij->i", 0.5 * (drag[1:] + drag[:-1]), np.diff(path.T, axis=0))
    assert np.sum(works) <= 1e-6 * np.abs(works).sum()
    assert np.abs(works).sum() > 0.0


# The sum.


@pytest.mark.parametrize("law", ["otaduy-lin", "ho"])
def test_the_wrench_is_the_sum_of_the_contacts(law):
    """About the centre of mass, which is not the origin of the tool's frame."""
    centre = (1e-3, 2e-3, -5e-4)
    wall = Body("wall", [Geom("box", (2e-3, 9e-3, 9e-3), (-2e-3, 0, 0))], waves(20e-6, 0.9e-3))
    scene = (ball(texture=waves(5e-6, 0.7e-3)), plate(TEXTURE), wall)
    engine = engine_for(*scene, centre=centre, friction=MU, law=law)
    for y in np.linspace(0, 1e-3, 20):
        at = pose(RADIUS - 1.1e-4, y, RADIUS - 0.9e-4, turn([1, 1, 3], 200 * y))
        found = touch(engine, at)
        assert len(found.depth) == 2
        arms = found.point - (at[:3] + rotation(at).apply(centre))
        torque = np.cross(arms, found.force).sum(axis=0)
        assert found.wrench[:3] == pytest.approx(found.force.sum(axis=0), abs=1e-12)
        assert found.wrench[3:] == pytest.approx(torque, abs=1e-12)


# Other gradients.


def rub(**settings):
    """Return the wrenches and depths of a ball on a texture that it follows without a leap."""
    engine = engine_for(ball(), plate(waves(10e-6, 1.1e-3)), **settings)
    places = np.random.default_rng(4).uniform(-2e-3, 2e-3, (8, 2))
    found = [touch(engine, pose(*p, RADIUS - 5e-5)) for p in places]
    return np.array([f.wrench for f in found]), np.array([f.depth[0] for f in found])


def test_central_differences_tend_to_the_exact_gradient():
    exact, depth = rub()
    size = np.linalg.norm(exact[:, :3], axis=1).max()
    errors = []
    for step, grid in ((4e-5, 20), (2e-5, 60), (1e-5, 180)):
        found, sampled = rub(gradient="differences", step=step, grid=grid, window=2e-4)
        errors.append(np.abs(found - exact)[:, :3].max() / size)
        assert np.abs(found - exact)[:, 3:].max() < 2 * errors[-1] * size * RADIUS
        assert np.all(sampled <= depth + 1e-9)
        # Half a pitch off the peak, the surfaces' curvature lets go of this much.
        assert np.all(sampled > depth - 2000.0 * (2e-4 / grid) ** 2)
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 1e-3


def test_a_large_step_of_the_differences_is_a_low_pass():
    exact, _ = rub()
    found, _ = rub(gradient="differences", step=0.55e-3, grid=100, window=4e-3)
    assert np.abs(found[:, 0]).max() < 0.2 * np.abs(exact[:, 0]).max()


@pytest.mark.parametrize("softness", [4e-6, 1e-6])
def test_the_soft_depth_of_a_ball_on_a_plate(softness):
    """The peak is a paraboloid: delta_soft = delta + s log(2 pi R s / A0), s the softness."""
    engine = engine_for(
        ball(), plate(), gradient="soft", softness=softness, soft_area=1e-7, window=1e-3, grid=120
    )
    found = touch(engine, pose(1e-4, 0, RADIUS - DEPTH))
    more = softness * math.log(2.0 * math.pi * RADIUS * softness / 1e-7)
    assert found.depth[0] - DEPTH == pytest.approx(more, rel=0.02)
    assert found.wrench[:3] == pytest.approx([0, 0, STIFFNESS * found.depth[0]], abs=1e-9)


def test_the_soft_maximum_tends_to_the_deepest_place():
    """Like s log(s / A0): a tenth of the softness, and some more, of the error is left."""
    exact, depth = rub()
    off, turned = [], []
    for softness in (1e-6, 1e-7, 1e-8):
        found, soft = rub(gradient="soft", softness=softness, grid=200, window=4e-4)
        off.append(np.abs(soft - depth).max())
        turned.append(np.abs(found[:, :2] / found[:, 2:3] - exact[:, :2] / exact[:, 2:3]).max())
    assert off[0] > 5 * off[1] > 25 * off[2]
    assert turned[0] > 2 * turned[1] > 4 * turned[2]
    assert turned[2] < 1e-3


def test_the_soft_wrench_is_the_gradient_of_its_energy():
    """The grid lies round the deepest place, and where exactly does not matter."""
    tool = Body("tool", [Geom("ellipsoid", (2e-3, 1.5e-3, 1.2e-3))], waves(5e-6, 1.3e-3))
    engine = engine_for(
        tool, plate(TEXTURE), gradient="soft", softness=1e-6, grid=160, window=6e-4, tolerance=1e-12
    )
    at = pose(2e-4, 3e-4, 1.25e-3, turn([1, 2, 1], 0.3))

    def energy(p):
        found = touch(engine, p)
        assert len(found.depth) == 1
        return 0.5 * STIFFNESS * found.depth[0] ** 2

    wrench = touch(engine, at).wrench * np.array([1, 1, 1, *3 * [1 / LEVER]])
    step = 1e-7
    for axis in range(6):
        ends = []
        for sign in (1.0, -1.0):
            moved = at.copy()
            if axis < 3:
                moved[axis] += sign * step
            else:
                turned = rotation(pose(0, 0, 0, turn(np.eye(3)[axis - 3], sign * step / LEVER)))
                moved[3:] = np.roll((turned * rotation(at)).as_quat(), 1)
            ends.append(energy(moved))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert wrench[axis] == pytest.approx(-slope, abs=1e-4 * np.linalg.norm(wrench[:3]))
