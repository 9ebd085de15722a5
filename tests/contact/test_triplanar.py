"""Bounds of maps hold, seen place by place, of triplanar ones and on curved surfaces."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_mesh_physics import AT_REST, UP, meshed, plate, pose, rough, turn

from asperity._core.kernels import kernel
from asperity.contact.body_pair import BodyPair
from asperity.contact.narrow_phase.bounds.curvature import third_of_texture
from asperity.contact.narrow_phase.bounds.texture import bounds_of, plane_slopes, texture_over
from asperity.contact.narrow_phase.bounds.triplanar import mixing, shares_over
from asperity.contact.narrow_phase.displaced_surface import height_on
from asperity.contact.narrow_phase.plane_boxes import plane_normal
from asperity.contact.narrow_phase.smooth_base import root_at
from asperity.contact.narrow_phase.surface_patch import TRIPLANAR
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

KINDS = [("block", 7.0), ("block", 40.0), ("roof", 10.0), ("ball", 25.0), ("roller", 35.0)]


@kernel
def _heights(textures, patch, places, out):
    for i in range(places.shape[0]):
        x, y = places[i, 0], places[i, 1]
        h = height_on(textures, patch, patch.texture, x, y, root_at(patch, x, y))
        for k in range(6):
            out[i, k] = h[k]


@kernel
def _bounds(textures, patch, box, out):
    x0, x1, y0, y1 = box[0], box[1], box[2], box[3]
    x, y, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    over = texture_over(textures, patch, x0, x1, y0, y1)
    out[0], out[1], out[2], out[3] = over.top, over.slope, over.bend, over.bend_size
    least, most = max(over.min_root, 0.0), over.max_root
    root = (0.5 * (least + most), 0.5 * (most - least))
    shares = shares_over(patch, (x, y, half_x, half_y), root)
    m, one, two = shares
    out[4 + (m + 1) % 3], out[4 + (m + 2) % 3] = one.most, two.most
    out[4 + m] = 1.0
    out[9 + (m + 1) % 3], out[9 + (m + 2) % 3] = one.least, two.least
    out[7], out[8] = mixing(shares)


def patches_of(kind, tilt):
    """Return patches of a tilted mesh that its search has made, and the textures."""
    axis = np.array([0.6, 0.8, 0.0])
    lying = Rotation.from_rotvec(np.radians(tilt) * axis)
    lying = lying * Rotation.from_quat(np.roll(turn([1, 0, 0], np.pi), -1))
    pair = BodyPair(meshed(kind, "tool", rough(4, 8e-6), "triplanar", 3), plate(rough(5, 8e-6)))
    pair.depth(pose(1e-4, 2e-4, 1.2e-3, np.roll(lying.as_quat(), 1)), AT_REST, UP)
    patches = pair._space.patches_a
    sides = patches["rectangle"]
    return list(patches[sides[:, 1] > sides[:, 0]][:12]), pair._textures


def eggs():
    """Return an egg-box of 0.6 mm wavelength [m]."""
    one = np.cos(2.0 * np.pi * np.arange(60) / 60)
    return HeightField(2e-5 * np.outer(one, one), 1e-5, "wrap")


def curved_patches_of(kind, mapping, texture):
    """Return the curved patches of a tilted geom that its search has made, and the textures."""
    sizes = {
        "sphere": (2e-3,), "ellipsoid": (1.5e-3, 2e-3, 3e-3), "cylinder": (2e-3, 3e-3),
        "capsule": (1.5e-3, 2e-3),
    }  # fmt: skip
    pair = BodyPair(Body("tool", [Geom(kind, sizes[kind])], texture, mapping), plate())
    lying = Rotation.from_rotvec([0.9, 0.5, 0.2])
    pair.depth(pose(1e-4, 2e-4, 1.6e-3, np.roll(lying.as_quat(), 1)), AT_REST, UP)
    found = [p for p in pair._space.patches_a if p["bulge"] > 0.0 and p["texture"] >= 0]
    assert found
    return found, pair._textures


def weights_of(patch, places):
    w = patch["body_normal"] + places[:, :1] * patch["body_normal_from_x"]
    w = w + places[:, 1:] * patch["body_normal_from_y"]
    if patch["bulge"] > 0.0:
        e11, e12, e22 = patch["ellipse"]
        x, y = places.T
        root = np.sqrt(1.0 - e11 * x * x - 2.0 * e12 * x * y - e22 * y * y)
        w = w + root[:, None] * patch["body_normal_from_root"]
    weights = w**4
    return weights / weights.sum(axis=1, keepdims=True), w / np.linalg.norm(w, axis=1)[:, None]


@pytest.mark.parametrize(("kind", "tilt"), KINDS)
def test_no_place_of_a_box_is_beyond_its_bounds(kind, tilt):
    patches, textures = patches_of(kind, tilt)
    rng, sharper, seen = np.random.default_rng(8), 0, 0
    assert patches
    for patch in patches:
        x0, x1, y0, y1 = patch["rectangle"]
        highest = textures.maps["highest"][patch["texture"]]
        for _ in range(25):
            side = min(x1 - x0, y1 - y0) * 10.0 ** rng.uniform(-2.0, -0.4)
            at = rng.uniform([x0, y0], [x1, y1])
            box = np.array([at[0] - side, at[0] + side, at[1] - side, at[1] + side])
            box = np.clip(box, [x0, x0, y0, y0], [x1, x1, y1, y1])
            found, _ = within_bounds(textures, patch, box, rng)
            sharper += found[0] < highest - 1e-7
            seen += 1
    assert sharper > 0.5 * seen


def within_bounds(textures, patch, box, rng):
    """Return the bounds over a box and its largest second derivative, after places were held to \
those."""
    found, h = np.zeros(12), np.zeros((200, 6))
    _bounds(textures, patch, box, found)
    places = rng.uniform(box[[0, 2]], box[[1, 3]], (200, 2))
    _heights(textures, patch, places, h)
    assert h[:, 0].max() <= found[0] + 1e-12
    assert np.hypot(h[:, 1], h[:, 2]).max() <= found[1] + 1e-9
    bends = np.linalg.eigvalsh(np.stack([h[:, [3, 4]], h[:, [4, 5]]], axis=1))
    assert bends.max() <= found[2] + 1e-6
    assert np.abs(bends).max() <= found[3] + 1e-6
    if patch["mapping"] == TRIPLANAR:
        shares, _ = weights_of(patch, places)
        assert (shares.max(axis=0) <= found[4:7] + 1e-9).all()
        assert (shares.min(axis=0) >= found[9:12] - 1e-9).all()
    return found, bends.max()


@pytest.mark.parametrize(
    ("kind", "mapping"),
    [(kind, "triplanar") for kind in ("sphere", "ellipsoid", "cylinder", "capsule")]
    + [("sphere", "planar"), ("cylinder", "cylindrical"), ("capsule", "cylindrical")],
)
@pytest.mark.parametrize("is_rough", [True, False])
def test_no_place_of_a_curved_surface_is_beyond_its_bounds(kind, mapping, is_rough):
    """And tips of a smooth texture are seen to be concave."""
    patches, textures = curved_patches_of(kind, mapping, rough(4, 8e-6) if is_rough else eggs())
    rng, tips, concave = np.random.default_rng(5), 0, 0
    for patch in patches:
        most = textures.maps["max_curvature"][patch["texture"]]
        # Within half of the outline: the sides of a round patch are those of others.
        reach = 0.6 / np.sqrt(patch["ellipse_max"])
        x0, x1, y0, y1 = np.clip(patch["rectangle"], -reach, reach)
        if kind == "cylinder":
            x0, x1 = patch["rectangle"][:2]
        for _ in range(600):
            side = 10.0 ** rng.uniform(-6.5, -3.5)
            at = rng.uniform([x0, y0], [x1, y1])
            box = np.array([at[0] - side, at[0] + side, at[1] - side, at[1] + side])
            box = np.clip(box, [x0, x0, y0, y0], [x1, x1, y1, y1])
            found, bend = within_bounds(textures, patch, box, rng)
            is_tip = side < 1e-5 and bend < -0.3 * most
            tips += is_tip
            concave += is_tip and found[2] < 0.0
    # Where three maps are mixed fewer, where a planar map is seen at a slant none.
    part = {"triplanar": 0.1, "cylindrical": 0.9, "planar": 0.0}[mapping]
    assert is_rough or (tips >= 5 and concave >= part * tips)


@pytest.mark.parametrize(("kind", "tilt"), KINDS[2:])
def test_second_derivatives_are_those_of_the_mix(kind, tilt):
    """Where normals turn, how much each map counts changes, and so does how fast."""
    patches, textures = patches_of(kind, tilt)
    step, turning = 1e-8, 0
    for patch in patches:
        if patch["is_unit"]:
            continue
        turning += 1
        x0, x1, y0, y1 = patch["rectangle"]
        at = np.random.default_rng(2).uniform([x0, y0], [x1, y1], (20, 2))
        found, one, two = (np.zeros((20, 6)) for _ in range(3))
        _heights(textures, patch, at, found)
        for axis, rows in ((0, (3, 4)), (1, (4, 5))):
            _heights(textures, patch, at - step * np.eye(2)[axis], one)
            _heights(textures, patch, at + step * np.eye(2)[axis], two)
            slopes = (two[:, 1:3] - one[:, 1:3]) / (2.0 * step)
            size = np.abs(found[:, 3:]).max()
            np.testing.assert_allclose(found[:, rows], slopes, rtol=0.0, atol=2e-5 * size)
    assert turning > 0


@kernel
def _third(textures, patch, x, y, half_x, half_y):
    normal = plane_normal(patch, x, y, math.sqrt(half_x * half_x + half_y * half_y))
    slopes = plane_slopes(textures, patch, (x, y, half_x, half_y), normal[4], normal[5])
    return third_of_texture(textures, patch, bounds_of(0.0, slopes, normal, 1.0, 1.0))


@pytest.mark.parametrize(("kind", "tilt"), KINDS)
def test_second_derivatives_change_no_faster_than_they_are_said_to(kind, tilt):
    patches, textures = patches_of(kind, tilt)
    rng, nearest = np.random.default_rng(1), 0.0
    for patch in patches:
        x0, x1, y0, y1 = patch["rectangle"]
        for _ in range(20):
            side = 10.0 ** rng.uniform(-6.0, -4.5)
            at = rng.uniform([x0, y0], [x1, y1])
            places = np.concatenate([[at], at + side * rng.uniform(-1.0, 1.0, (60, 2))])
            h = np.zeros((61, 6))
            _heights(textures, patch, places, h)
            bends = np.stack([h[:, [3, 4]], h[:, [4, 5]]], axis=1)
            changed = np.linalg.norm(bends[1:] - bends[0], ord=2, axis=(1, 2))
            away = np.linalg.norm(places[1:] - at, axis=1)
            most = _third(textures, patch, at[0], at[1], side, side)
            assert (changed <= most * away * (1.0 + 1e-6) + 1e-6).all()
            nearest = max(nearest, (changed / (most * away)).max())
    assert nearest > 0.1


@pytest.mark.parametrize(("kind", "tilt"), KINDS[2:])
def test_weights_change_no_faster_than_they_are_said_to(kind, tilt):
    """By the normal, whose own change `normal_slope` and `normal_bend` bound."""
    patches, textures = patches_of(kind, tilt)
    turning = [patch for patch in patches if not patch["is_unit"]]
    assert turning
    for patch in turning:
        x0, x1, y0, y1 = patch["rectangle"]
        at, found = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)]), np.zeros(12)
        side = 0.1 * min(x1 - x0, y1 - y0)
        _bounds(textures, patch, at[[0, 0, 1, 1]] + side * np.array([-1, 1, -1, 1]), found)
        for way in ([1.0, 0.0], [0.0, 1.0], [0.6, -0.8]):
            s = np.linspace(-side, side, 41)
            shares, w = weights_of(patch, at + s[:, None] * np.array(way))
            first = np.gradient(shares, s, axis=0)
            second = np.gradient(first, s, axis=0)[2:-2]
            speed = np.linalg.norm(np.gradient(w, s, axis=0), axis=1).max()
            assert speed <= 1.01 * patch["normal_slope"]
            assert np.abs(first).sum(axis=1).max() <= 1.05 * found[7] * patch["normal_slope"] + 1e-9
            most = found[8] * patch["normal_slope"] ** 2 + found[7] * patch["normal_bend"]
            assert np.abs(second).sum(axis=1).max() <= 1.05 * most + 1e-6
