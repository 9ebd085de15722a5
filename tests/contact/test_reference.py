"""The brute-force reference against closed forms."""

import math

import numpy as np
import pytest
from naive_bodies import AT_REST, UP, highest, plate, pose, ripple, rough, solid, turn
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.offsets.analytic import Sinusoid
from oracle.depth import reference_depth

A, L = 50e-6, 1e-3
QUICK = {"samples": 120, "zooms": 5}


def depth_on_plane(body, quaternion):
    """Return how far `body` reaches below its middle, from its depth in a plane."""
    at = pose(0, 0, 1e-3, quaternion)
    return reference_depth(body, at, solid("plane"), AT_REST, UP, **QUICK).depth + 1e-3


@pytest.mark.parametrize("ground", [solid("plane", "ground"), plate()])
def test_a_sphere_on_a_flat(ground):
    found = reference_depth(solid("sphere"), pose(1e-4, 2e-4, 1.4e-3), ground, AT_REST, UP, **QUICK)
    assert found.depth == pytest.approx(1e-4, abs=1e-12)
    assert found.point_on_a == pytest.approx([1e-4, 2e-4, -1e-4], abs=1e-8)
    assert found.point_on_b == pytest.approx([1e-4, 2e-4, 0.0], abs=1e-8)
    assert found.resolution < 1e-9


def test_poses_and_normals_turn_together():
    towards = np.array([0.3, -0.2, 0.9])
    towards /= np.linalg.norm(towards)
    low, high = pose(1e-3, 2e-3, 3e-3), pose(*([1e-3, 2e-3, 3e-3] + 2.9e-3 * towards))
    found = reference_depth(solid("sphere"), high, solid("sphere"), low, towards, **QUICK)
    assert found.depth == pytest.approx(1e-4, abs=1e-12)
    assert found.point_on_b == pytest.approx(low[:3] + 1.5e-3 * towards, abs=1e-8)


def test_a_tilted_box_stands_on_its_rim_or_corner():
    lowest = 2e-3 * math.sin(0.1) + 1.2e-3 * math.cos(0.1)
    assert depth_on_plane(solid("box"), turn([0, 1, 0], 0.1)) == pytest.approx(lowest, abs=1e-10)
    corner = turn([1, 2, 0], 0.3)
    down = Rotation.from_quat(np.roll(corner, -1)).as_matrix()[2]
    lowest = np.abs(down) @ [2e-3, 1.5e-3, 1.2e-3]
    assert depth_on_plane(solid("box"), corner) == pytest.approx(lowest, abs=1e-10)


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_cylinder_and_capsule_on_a_plane(angle):
    q = turn([1, 0.5, 0], angle)
    rim = 1.5e-3 * math.sin(angle) + 1.2e-3 * math.cos(angle)
    assert depth_on_plane(solid("cylinder"), q) == pytest.approx(rim, abs=1e-10)
    end = 1.2e-3 + 1.5e-3 * math.cos(angle)
    assert depth_on_plane(solid("capsule"), q) == pytest.approx(end, abs=1e-10)


def test_an_ellipsoid_on_a_plane():
    q = turn([1, 2, 3], 0.8)
    down = Rotation.from_quat(np.roll(q, -1)).as_matrix()[2]
    lowest = np.linalg.norm(down * [2e-3, 1.5e-3, 1.2e-3])
    assert depth_on_plane(solid("ellipsoid"), q) == pytest.approx(lowest, abs=1e-12)


@pytest.mark.parametrize("place", [0.0, 1.3e-4, 4.9e-4])
def test_a_sphere_on_a_sinusoid_is_the_offset_curve(place):
    offset = Sinusoid(A, L).tracer(3e-3)(place).height
    ground = plate(ripple(A, L, 256))
    found = reference_depth(solid("sphere"), pose(place, 0, 1.49e-3), ground, AT_REST, UP, **QUICK)
    # The stored sinusoid is a spline through 256 samples a period: 4e-12 m off at most.
    assert found.depth == pytest.approx(offset + 1e-5, abs=5e-12)


def test_plates_in_and_out_of_register():
    tool = Body("tool", [Geom("box", (2e-3, 1e-3, 1e-3))], ripple(A, L))
    ground = plate(ripple(A, L))
    for shift, clearance in ((0.0, 0.0), (0.5 * L, 2 * A)):
        # In register crest meets crest: both reach A towards each other.
        at = pose(shift, 0, 1e-3 + 1.7 * A)
        found = reference_depth(tool, at, ground, AT_REST, UP, **QUICK)
        assert found.depth == pytest.approx(0.3 * A - clearance, abs=1e-10)


@pytest.mark.parametrize(("degrees", "at_least"), [(5, 0.002), (30, 0.02)])
def test_a_tilted_texture_shifts_sideways(degrees, at_least):
    """Both textures vary along x only, so the depth is a maximum over one number."""
    tilt, half, thick = math.radians(degrees), 2e-3, 1.2e-3
    tool = Body("tool", [Geom("box", (half, 1e-3, thick))], ripple(A, 0.31e-3))
    ground = plate(ripple(A, 0.47e-3))
    c, s = math.cos(tilt), math.sin(tilt)

    def overlap(x, shifted=True):
        t = tool.texture.heights(x, 0.0)
        # The face looks along -z of the tool; z of the world is -s x + c z of the tool.
        across = c * x - s * (thick + (t if shifted else 0.0))
        up = -s * x - c * thick - (t * c if shifted else t / c)
        return ground.texture.heights(across, 0.0) - up

    exact = highest(overlap, -half, half, 40001)
    found = reference_depth(
        tool, pose(0, 0, 0, turn([0, 1, 0], tilt)), ground, AT_REST, UP, samples=250
    )
    assert found.depth == pytest.approx(exact, abs=1e-9)
    unshifted = highest(lambda x: overlap(x, False), -half, half, 40001)
    assert abs(unshifted - exact) > at_least * A


def test_textures_of_each_mapping_lie_where_they_should():
    texture, across = ripple(A, L), turn([0, 1, 0], math.pi / 2)
    roller = Body("roller", [Geom("cylinder", (1e-3, 2e-3))], texture, "cylindrical")
    # A map that wraps is stretched so that it goes round a whole number of times.
    times = 2.0 * math.pi * 1e-3 / texture.size[0]
    scale = 1e-3 * max(round(times), 1) / times
    for angle in (0.4, -2.0):
        # The side's lowest line lies at angle pi - angle from the geom's x axis.
        q = (Rotation.from_quat(np.roll(across, -1)) * Rotation.from_euler("z", angle)).as_quat()
        at = pose(0, 0, 1e-3, np.roll(q, 1))
        found = reference_depth(roller, at, solid("plane"), AT_REST, UP, **QUICK)
        down = Rotation.from_quat(q).inv().apply(-UP)
        middle = math.atan2(down[1], down[0])
        exact = highest(
            lambda phi, m=middle: (1e-3 + texture.heights(scale * phi, 0)) * np.cos(phi - m),
            middle - 1.0, middle + 1.0, 20001,
        )  # fmt: skip
        assert found.depth == pytest.approx(exact - 1e-3, abs=1e-9)
    block = Body("block", [Geom("box", (2e-3, 2e-3, 2e-3))], rough(3, 20e-6), "triplanar")
    found = reference_depth(
        solid("sphere"), pose(3.4e-3, 1e-4, 2e-4), block, AT_REST, [1.0, 0.0, 0.0], **QUICK
    )
    u, v = found.point_on_b[1:]
    assert found.point_on_b[0] == pytest.approx(2e-3 + block.texture.heights(u, v), abs=1e-12)


def test_where_silhouettes_do_not_overlap():
    found = reference_depth(solid("sphere"), pose(0.1, 0, 1e-3), plate(), AT_REST, UP)
    assert found.depth == -math.inf
    assert np.isnan(found.point_on_a).all()
    upside_down = pose(0, 0, 0, turn([1, 0, 0], math.pi))
    with pytest.raises(AsperityError, match="plane"):
        reference_depth(solid("plane"), upside_down, solid("plane"), AT_REST, UP)


def test_pieces_make_one_plate():
    texture, at = rough(5, 10e-6), pose(1e-4, 3e-4, 1.48e-3)
    depths = [
        reference_depth(solid("sphere"), at, plate(texture, 4e-3, n), AT_REST, UP, **QUICK).depth
        for n in (1, 2, 4)
    ]
    assert np.ptp(depths) < 1e-12
