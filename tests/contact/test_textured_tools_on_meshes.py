"""A textured primitive meets a box of triangles as it meets the box, from the first touch on.

Textures touch before the smooth bodies do.
"""

import numpy as np
import pytest
from naive_meshes import STIFFNESS, ball_mesh, block, engine_of, thing

from asperity.contact.body_pair import BodyPair
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.random_surfaces import self_affine

HALF, RADIUS, HIGH = (8e-3, 6e-3, 4e-3), 2e-3, 1e-4
TOOLS = {
    "sphere": (RADIUS,), "capsule": (RADIUS, 3e-3), "ellipsoid": (RADIUS, 1.5e-3, RADIUS),
    "cylinder": (RADIUS, 3e-3),
}  # fmt: skip


def rough():
    heights = self_affine((64, 64), 5e-5, hurst=0.8, rms_slope=0.3, seed=1)
    return HeightField((heights - heights.min()) * HIGH / np.ptp(heights), 5e-5, border="wrap")


@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("level", [True, False], ids=["constant", "rough"])
def test_a_side_is_felt_as_that_of_the_primitive(kind, mapping, level):
    texture = HeightField(np.full((16, 16), HIGH), 1e-4, border="wrap") if level else rough()
    tool = Body("tool", [Geom(kind, TOOLS[kind])], texture, mapping)
    of_triangles = engine_of(tool, thing("plate", block(HALF)))
    of_the_box = engine_of(tool, Body("plate", [Geom("box", HALF)]))
    felt = 0
    for gap in (9e-5, 6e-5, 3e-5, 0.0, -2e-5):
        pose = np.array([HALF[0] + RADIUS + gap, 1e-3, 5e-4, 1.0, 0.0, 0.0, 0.0])
        wanted = of_the_box.wrench(pose, 0.0).copy()
        felt += bool(wanted.any())
        size = np.linalg.norm(wanted[:3]) + 1e-9
        found = of_triangles.wrench(pose, 0.0)
        assert found[:3] == pytest.approx(wanted[:3], abs=1e-6 * size)
        # Along a level side the places where box and mesh are touched may differ.
        if kind in ("sphere", "ellipsoid"):
            assert found[3:] == pytest.approx(wanted[3:], abs=1e-6 * size * RADIUS)
    assert felt >= 1


@pytest.mark.parametrize("of_triangles", [False, True], ids=["box", "mesh"])
@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
def test_the_corner_of_a_box_in_a_raised_sphere_is_found(mapping, of_triangles):
    """Only a sliver of the sphere's flank touches a corner: its depth along a face is known."""
    level = HeightField(np.full((16, 16), HIGH), 1e-4, border="wrap")
    ball = Body("tool", [Geom("sphere", (RADIUS,))], level, mapping)
    box = thing("plate", block(HALF)).body if of_triangles else Body("plate", [Geom("box", HALF)])
    pair = BodyPair(ball, box)
    rng, rest, checked = np.random.default_rng(0), np.array([0.0, 0.0, 0.0, 1.0, 0, 0, 0]), 0
    raised = RADIUS + HIGH
    for _ in range(400):
        away, n = np.abs(rng.normal(size=3)), np.eye(3)[rng.integers(3)]
        away /= np.linalg.norm(away)
        if away @ n < 0.25:  # steeper flanks are not searched
            continue
        middle = np.array(HALF) + away * (raised - rng.choice([2e-5, 1e-4, 3e-4]))
        corner = np.array(HALF) - middle
        across = corner - n * (corner @ n)
        known = np.sqrt(raised**2 - across @ across) + corner @ n
        more = {"smooth_overlap": 1e-3} if of_triangles else {}
        found = pair.depth(np.r_[middle, 1.0, 0.0, 0.0, 0.0], rest, n, **more)
        assert found.depth + found.gap >= known - 1e-9
        checked += 1
    assert checked > 200


@pytest.mark.parametrize("angle", [0.0, 20.0, 35.0, 45.0, 60.0, 90.0])
def test_a_textured_ball_of_triangles_touches_an_edge_before_it_is_in_it(angle):
    """The texture reaches the edge obliquely to the faces, whose distance is larger than it."""
    level = HeightField(np.full((16, 16), HIGH), 1e-4, border="wrap")
    engine = engine_of(
        thing("tool", ball_mesh(RADIUS, 3), level, "triplanar"), thing("plate", block(HALF))
    )
    way = np.array([np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])
    depth = 3e-5
    edge = np.array([HALF[0], 1e-3, HALF[2]])
    pose = np.r_[edge + way * (RADIUS + HIGH - depth), 1.0, 0.0, 0.0, 0.0]
    force = np.linalg.norm(engine.wrench(pose, 0.0)[:3])
    assert 0.5 < force / (STIFFNESS * depth) < 1.5


@pytest.mark.parametrize(
    ("middle", "way"),
    [
        ([2.2189, 6.4501, 5.0223], [0.1570, 0.5495, 0.8206]),
        ([5.0549, -4.5757, 4.2226], [0.5573, -0.5664, 0.6071]),
        ([2.5702, -6.2560, 4.4560], [0.2417, -0.7658, 0.5959]),
    ],
)
def test_a_raised_sphere_is_as_deep_over_a_rough_rim_as_a_larger_one(middle, way):
    """The sphere's base lies beyond the rim, which its raised surface touches."""
    heights = self_affine((64, 64), 5e-5, hurst=0.8, rms_slope=0.2, seed=1)
    uneven = HeightField(heights * 5e-5 / np.ptp(heights), 5e-5, border="wrap")
    rod = Body("plate", [Geom("cylinder", (5e-3, 4e-3))], uneven, "triplanar")
    level = HeightField(np.full((16, 16), HIGH), 1e-4, border="wrap")
    raised = Body("tool", [Geom("sphere", (RADIUS,))], level, "triplanar")
    larger = Body("tool", [Geom("sphere", (RADIUS + HIGH,))])
    here, rest = np.r_[1e-3 * np.array(middle), 1.0, 0, 0, 0], np.array([0.0, 0, 0, 1, 0, 0, 0])
    n = np.array(way) / np.linalg.norm(way)
    one, two = (BodyPair(ball, rod).depth(here, rest, n) for ball in (raised, larger))
    assert one.certified
    assert two.certified
    assert one.depth == pytest.approx(two.depth, abs=2e-9)
