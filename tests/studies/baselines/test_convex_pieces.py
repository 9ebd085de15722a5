"""Clusters of contacts: means weighted by depth, whatever the number of pieces."""

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.scene.scene import scene_of
from asperity.studies.baselines.convex_pieces import CONVEX_PIECES, cluster_contacts

UP = np.array([0.0, 0.0, 1.0])


def test_near_contacts_are_their_mean_by_depth():
    places = np.array([[0.0, 0.0, 0.0], [2e-3, 0.0, 0.0], [1.0, 0.0, 0.0]])
    normals = np.array([UP, [0.6, 0.0, 0.8], UP])
    where, along, deep = cluster_contacts(places, normals, np.array([1e-4, 3e-4, 2e-4]), 5e-3)
    assert len(deep) == 2
    assert where[0] == pytest.approx([1.5e-3, 0.0, 0.0])
    mean = 1e-4 * UP + 3e-4 * np.array([0.6, 0.0, 0.8])
    assert along[0] == pytest.approx(mean / np.linalg.norm(mean))
    assert deep[0] == pytest.approx((1.0 + 9.0) / 4.0 * 1e-4)
    assert (where[1], deep[1]) == (pytest.approx(places[2]), pytest.approx(2e-4))


def test_a_contact_cut_into_many_pieces_is_one():
    rng = np.random.default_rng(0)
    for n in (1, 4, 16):
        places = 1e-3 * rng.uniform(-1, 1, (n, 3))
        where, along, deep = cluster_contacts(places, np.tile(UP, (n, 1)), np.full(n, 2e-4), 5e-3)
        assert deep == pytest.approx([2e-4])
        assert along == pytest.approx(UP[None])
        assert where[0] == pytest.approx(places.mean(axis=0))


def test_opposite_pushes_are_not_mixed():
    deep = cluster_contacts(np.zeros((2, 3)), np.array([UP, -UP]), np.array([1e-4, 1e-4]), 5e-3)[2]
    assert len(deep) == 2


def two_boxes():
    """Return the plate of probe-plate as two boxes that meet at x = 0."""
    one = '<geom name="slab" type="box" size="0.05 0.02 0.004" rgba="0.80 0.74 0.63 1"/>'
    xml = load_scene("probe-plate").xml
    assert one in xml
    halves = "".join(
        f'<geom type="box" pos="{x} 0 0" size="0.025 0.02 0.004"/>' for x in (-0.025, 0.025)
    )
    document = {"schema": 1, "tool": {"body": "probe"}}
    return scene_of(xml.replace(one, halves), document, name="halves")


def test_a_ball_is_pushed_by_its_depth_also_over_a_seam():
    whole, halves = (
        CONVEX_PIECES.prepare(load_scene("probe-plate")),
        CONVEX_PIECES.prepare(two_boxes()),
    )
    k = load_scene("probe-plate").force.stiffness
    for x in (-0.02, 0.0, 1e-4):
        pose = np.array([x, 0.0, 1.3e-3, 1.0, 0.0, 0.0, 0.0])
        felt = whole.wrench(pose)
        assert felt.force == pytest.approx([0.0, 0.0, k * 2e-4], abs=1e-6)
        assert felt.depth == pytest.approx(2e-4)
        assert felt.contacts == 1
        cut = halves.wrench(pose)
        assert cut.contacts == 1
        assert cut.force[2] / two_boxes().force.stiffness == pytest.approx(2e-4, rel=0.15)
    assert whole.wrench(np.array([0.0, 0.0, 1.6e-3, 1.0, 0.0, 0.0, 0.0])).contacts == 0


def test_a_push_beside_the_centre_of_mass_turns():
    felt = CONVEX_PIECES.prepare(load_scene("probe-plate"))
    tilted = np.array([0.0, 0.0, 1.3e-3, np.cos(0.2), 0.0, np.sin(0.2), 0.0])
    wrench = felt.wrench(tilted)
    # The centre of mass lies to the +x side of the tip, so the push upwards turns it about +y.
    assert wrench.torque[1] > 1e-4
