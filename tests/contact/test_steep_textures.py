"""Rough meshes on rough meshes: every depth certified, and right where steep textures fold."""

import numpy as np
import pytest
from naive_meshes import engine_of, hull_mesh, quartered, thing
from scipy.spatial.transform import Rotation

from asperity.contact.body_pair import BodyPair
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.random_surfaces import self_affine
from oracle.depth import reference_depth

PIXEL, CERTIFIED = 5e-5, 0
AT_REST = np.array([0.0, 0, 0, 1, 0, 0, 0])


def hull(points, size, cuts=0, hard_angle=40.0):
    """Return the convex hull of points as a mesh of a half width, its triangles cut in four."""
    mesh = hull_mesh(1e-3 * points)  # of a size that a mesh may have
    x = mesh.vertices[mesh.faces]
    for _ in range(cuts):
        x = quartered(x)
    x = x.reshape(-1, 3) - x.reshape(-1, 3).mean(axis=0)
    x *= size / np.abs(x).max()
    corners, which = np.unique(x.round(12), axis=0, return_inverse=True)
    return mesh_from_arrays(corners, which.reshape(-1, 3), hard_angle=hard_angle)


def waves(count, height, samples=128, along_both=True):
    y, x = np.mgrid[:samples, :samples] * 2 * np.pi / samples
    z = height * np.sin(count * x) * (np.sin(count * y) if along_both else 1.0)
    return HeightField(z, PIXEL, border="wrap")


def noise(rng):
    return HeightField(rng.normal(size=(128, 128)) * 5e-6, PIXEL, border="wrap")


def surface(seed, relief):
    z = self_affine((128, 128), PIXEL, hurst=0.8, rms_slope=0.2, seed=seed)
    return HeightField(z * relief / np.ptp(z), PIXEL, border="wrap")


def look(engine, rng, poses):
    """Return how many depths there are 0.2 mm below the first touch, and how many certified."""
    looked = certified = 0
    for _ in range(poses):
        pose = np.r_[0, 0, 0, np.roll(Rotation.random(random_state=rng).as_quat(), 1)]
        away = rng.normal(size=3)
        away /= np.linalg.norm(away)
        low, high = 0.0, 0.04
        for _ in range(12):
            middle = 0.5 * (low + high)
            pose[:3] = middle * away
            touches = engine.wrench(pose, 0.0).any()
            low, high = (middle, high) if touches else (low, middle)
        pose[:3] = (low - 2e-4) * away
        engine.wrench(pose, 0.0)
        count, left_out = engine.contacts.count
        assert left_out == 0
        certified += int((engine.contacts.status[:count] == CERTIFIED).sum())
        looked += int(count)
    return looked, certified


def on_a_sphere(rng, count):
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


@pytest.mark.parametrize("kind", ["noise on waves", "noise on noise", "surface on noise"])
def test_rough_meshes_are_certified_at_the_usual_budget(kind):
    """White noise, whose waves are as short as its pixels, spent the budget in one depth of ten."""
    rng = np.random.default_rng(3)
    textures = {
        "noise on waves": (noise(rng), waves(8, 8e-5)), "noise on noise": (noise(rng), noise(rng)),
        "surface on noise": (surface(5, 1e-4), noise(rng)),
    }  # fmt: skip
    tool, ground = (hull(on_a_sphere(rng, 100), size, 1) for size in (5e-3, 9e-3))
    engine = engine_of(
        thing("tool", tool, textures[kind][0], "triplanar"),
        thing("plate", ground, textures[kind][1], "triplanar"),
    )
    looked, certified = look(engine, rng, 12)
    assert certified == looked > 12


SOLIDS = {
    "sphere": (3e-3,), "capsule": (2e-3, 4e-3), "ellipsoid": (2e-3, 3e-3, 4e-3),
    "cylinder": (3e-3, 4e-3), "box": (3e-3, 4e-3, 2e-3),
}  # fmt: skip


@pytest.mark.parametrize("ground", SOLIDS)
@pytest.mark.parametrize("tool", ["sphere", "capsule", "box"])
def test_rough_solids_are_certified_over_rims_too(tool, ground):
    """The flat face that leans at a rim is searched, not the round body that is level there."""
    rng, found = np.random.default_rng(7), np.zeros(2)
    for texture in (waves(8, 5e-5), noise(rng)):
        bodies = [
            Body(name, [Geom(kind, SOLIDS[kind])], texture, "triplanar")
            for name, kind in (("tool", tool), ("plate", ground))
        ]
        found += look(engine_of(*bodies), rng, 8)
    # Two faces that both fold, and two round bodies, may spend the budget in one of them.
    assert found[1] >= found[0] - 1.0 >= 15.0


def steep_pair(rng):
    """Return two small bodies whose textures fold facets that lean."""

    def mesh(size):
        points = rng.normal(size=(rng.integers(8, 24), 3))
        cuts = int(rng.random() < 0.5)
        return points, size, cuts, rng.choice([20.0, 60.0])

    def texture():
        k = rng.integers(3)
        if k == 0:
            slope, seed = rng.uniform(0.3, 0.6), int(rng.integers(1000))
            z = self_affine((96, 96), PIXEL, hurst=0.8, rms_slope=slope, seed=seed)
            return HeightField(z, PIXEL, border="wrap")
        if k == 1:
            return waves(6, rng.uniform(5e-5, 2e-4), 96)
        return waves(12, rng.uniform(3e-5, 8e-5), 96, along_both=False)

    parts = []
    for name, size in (("a", 1.2e-3), ("b", 2.5e-3)):
        points, size, cuts, angle = mesh(size)
        parts.append(thing(name, hull(points, size, cuts, angle), texture(), "triplanar").body)
    return parts


def steep_pose(rng):
    """Return a pose of the small body about where it touches, and a direction towards it."""
    turn = np.roll(Rotation.random(random_state=rng).as_quat(), 1)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    return np.r_[2.8e-3 * n + rng.normal(size=3) * 5e-4, turn], n


@pytest.mark.parametrize("seed", [34, 46, 48, 53])
def test_folds_are_certified_by_their_outermost_sheet(seed):
    """Where the slope alone does not rule out a fold, boxes were divided without end."""
    rng = np.random.default_rng(seed)
    a, b = steep_pair(rng)
    at, n = steep_pose(rng)
    found = BodyPair(a, b).depth(at, AT_REST, n, smooth_overlap=1e-2)
    assert found.certified
    exact = reference_depth(a, at, b, AT_REST, n, samples=150, zooms=4).depth
    assert found.depth == pytest.approx(exact, abs=1e-8)


def test_a_search_that_ends_with_nothing_found_is_not_certified():
    """A distance of which nothing is known was called certain, if it was above 0."""
    rng = np.random.default_rng(1)
    a, b = steep_pair(rng)
    pair, ended = BodyPair(a, b, max_nodes=100), 0
    for _ in range(20):
        at, n = steep_pose(rng)
        found = pair.depth(at, AT_REST, n, smooth_overlap=1e-2)
        if found.depth == -np.inf and found.nodes > 0:
            ended += not found.certified
    assert ended > 0
