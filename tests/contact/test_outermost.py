"""Steep textures fold curved surfaces: bounds and heights are those of the outermost sheet."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_mesh_physics import AT_REST, UP, pose
from test_triplanar import curved_patches_of

from asperity._core.kernels import kernel
from asperity.contact.body_pair import BodyPair
from asperity.contact.narrow_phase.displaced_surface import height_at, height_on, surface_at
from asperity.contact.narrow_phase.outermost import highest_over
from asperity.contact.narrow_phase.records import POINT
from asperity.contact.narrow_phase.smooth_base import parameters_at, root_at
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

KINDS = [(kind, "triplanar") for kind in ("sphere", "ellipsoid", "cylinder", "capsule")]
KINDS += [("sphere", "planar"), ("cylinder", "cylindrical")]


def steep_eggs():
    """Return an egg-box of 0.6 mm wavelength with slopes to 1.6 [m]."""
    one = np.cos(2.0 * np.pi * np.arange(60) / 60)
    return HeightField(1.5e-4 * np.outer(one, one), 1e-5, "wrap")


@kernel
def _points(textures, patch, bases, point, out):
    """Fill height over the base, place in parameters, and u, v, z of displaced points."""
    for i in range(bases.shape[0]):
        x, y = bases[i, 0], bases[i, 1]
        surface_at(textures, patch, x, y, point[0])
        out[i, 0] = height_on(textures, patch, patch.texture, x, y, root_at(patch, x, y))[0]
        out[i, 1], out[i, 2] = parameters_at(patch, point[0].p[0], point[0].p[1])
        for k in range(3):
            out[i, 3 + k] = point[0].p[k]


@kernel
def _highest(textures, patch, boxes, out):
    for i in range(boxes.shape[0]):
        box = (boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3])
        out[i] = highest_over(textures, patch, box)


@kernel
def _heights(textures, patch, places, point, out):
    for i in range(places.shape[0]):
        out[i] = height_at(textures, patch, places[i, 0], places[i, 1], point[0])[0]


def bases_on(patch, count, rng):
    """Return random parameters within a curved patch, (n, 2) [m]."""
    x0, x1, y0, y1 = patch["rectangle"]
    x, y = rng.uniform([x0, y0], [x1, y1], (count, 2)).T
    e11, e12, e22 = patch["ellipse"]
    square = 1.0 - e11 * x * x - 2.0 * e12 * x * y - e22 * y * y
    root = np.sqrt(np.maximum(square, 0.0))
    inside = root >= patch["min_root"]
    for border in patch["borders"][: patch["border_count"]]:
        g = border["constant"] + border["from_x"] * x + border["from_y"] * y
        g += border["from_root"] * root + border["from_square"] * (x * x + y * y)
        inside &= g <= 0.0
    return np.stack([x, y], axis=1)[inside]


@pytest.mark.parametrize(("kind", "mapping"), KINDS)
def test_no_point_over_a_box_is_higher_than_its_bound(kind, mapping):
    patches, textures = curved_patches_of(kind, mapping, steep_eggs())
    rng, sharper = np.random.default_rng(3), []
    for patch in patches:
        bases = bases_on(patch, 400_000, rng)
        points, scratch = np.zeros((len(bases), 6)), np.zeros(1, POINT)
        _points(textures, patch, bases, scratch, points)
        boxes = np.zeros((300, 4))
        boxes[:, :2] = points[rng.integers(len(points), size=300), 1:3]
        boxes[:, 2:] = 1e-4 * 10.0 ** rng.uniform(-1.0, 0.7, (300, 1))
        found = np.zeros(300)
        _highest(textures, patch, boxes, found)
        for (x, y, half_x, half_y), bound in zip(boxes, found, strict=True):
            over = (abs(points[:, 1] - x) <= half_x) & (abs(points[:, 2] - y) <= half_y)
            assert points[over, 0].max() <= bound + 1e-12
            sharper.append(bound - points[over, 0].max())
    assert np.median(sharper) < 5e-5


@pytest.mark.parametrize(("kind", "mapping"), KINDS)
def test_the_height_over_a_place_is_that_of_the_outermost_sheet(kind, mapping):
    patches, textures = curved_patches_of(kind, mapping, steep_eggs())
    rng, below, missed, folded = np.random.default_rng(4), 0, 0, 0
    for patch in patches:
        bases = bases_on(patch, 4000, rng)
        points, scratch = np.zeros((len(bases), 6)), np.zeros(1, POINT)
        _points(textures, patch, bases, scratch, points)
        heights = np.zeros(len(bases))
        _heights(textures, patch, points[:, 3:5].copy(), scratch, heights)
        missed += (heights == -np.inf).mean() / len(patches)
        seen = heights > -np.inf
        below += (heights[seen] < points[seen, 5] - 1e-9).mean() / len(patches)
        folded += (heights[seen] > points[seen, 5] + 1e-6).mean() / len(patches)
    assert folded > 0.02
    assert below < 3e-3
    assert missed < 0.02


def displaced_sphere(radius, texture, turn, count, rng):
    """Return random points of a sphere with a triplanar map, turned [m]."""
    w = rng.standard_normal((count, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    at, weights = radius * w, w**4
    maps = [texture.heights(at[:, (k + 1) % 3], at[:, (k + 2) % 3]) for k in range(3)]
    height = (weights * np.stack(maps, axis=1)).sum(axis=1) / weights.sum(axis=1)
    return turn.apply(at + height[:, None] * w)


def test_contact_at_an_overhang_of_a_sphere_is_found():
    """A steeply textured sphere between the bumps of a plate touches them with its sides."""
    one, radius = np.cos(np.pi * np.arange(60) / 30), 8e-4
    bumps = HeightField(4e-4 * np.outer(one, one), 4e-5, "wrap")
    tool = Body("tool", [Geom("sphere", (radius,))], steep_eggs(), "triplanar")
    pair = BodyPair(tool, Body("ground", [Geom("plane", (0.0, 0.0))], bumps, "planar"))
    rng, certified = np.random.default_rng(6), 0
    for turn in Rotation.random(25, random_state=7):
        place = np.append(rng.uniform(-1e-3, 1e-3, 2), radius - rng.uniform(0.0, 3e-4))
        points = place + displaced_sphere(radius, steep_eggs(), turn, 400_000, rng)
        sampled = (bumps.heights(points[:, 0], points[:, 1]) - points[:, 2]).max()
        found = pair.depth(pose(*place, np.roll(turn.as_quat(), 1)), AT_REST, UP)
        certified += found.certified
        assert sampled <= found.depth + 1e-9
        assert found.depth <= sampled + 5e-6
    assert certified > 20
