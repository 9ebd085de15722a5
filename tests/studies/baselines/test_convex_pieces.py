"""Penetration depths of convex pieces against closed forms, and clusters of contacts."""

import flat_scenes as flat
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from asperity.scene.builtin import load_scene
from asperity.studies.baselines.convex_pieces import (
    CONVEX_PIECES,
    PieceContacts,
    cluster_contacts,
)
from asperity.studies.baselines.convex_solids import (
    box_solid,
    pieces_of,
    solid_of_faces,
    solid_of_points,
)
from asperity.studies.baselines.minkowski_walk import least_of_all, walk
from asperity.studies.baselines.solid_contacts import solid_contact

UP = np.array([0.0, 0.0, 1.0])
D = 1e-4


def contacts_of(places, normals, depths, areas=None):
    areas = np.zeros(len(depths)) if areas is None else np.array(areas)
    return PieceContacts(np.array(places), np.array(normals), np.array(depths), areas)


def test_near_contacts_are_their_mean_by_depth():
    places = [[0.0, 0.0, 0.0], [2e-3, 0.0, 0.0], [1.0, 0.0, 0.0]]
    normals = [UP, [0.6, 0.0, 0.8], UP]
    found = cluster_contacts(contacts_of(places, normals, [1e-4, 3e-4, 2e-4]), 5e-3)
    assert len(found.depths) == 2
    assert found.places[0] == pytest.approx([1.5e-3, 0.0, 0.0])
    mean = 1e-4 * UP + 3e-4 * np.array([0.6, 0.0, 0.8])
    assert found.normals[0] == pytest.approx(mean / np.linalg.norm(mean))
    assert found.depths[0] == pytest.approx((1.0 + 9.0) / 4.0 * 1e-4)
    assert (found.places[1], found.depths[1]) == (pytest.approx(places[2]), pytest.approx(2e-4))


def test_a_contact_cut_into_many_pieces_is_one():
    rng = np.random.default_rng(0)
    for n in (1, 4, 16):
        places = 1e-3 * rng.uniform(-1, 1, (n, 3))
        found = cluster_contacts(contacts_of(places, np.tile(UP, (n, 1)), np.full(n, 2e-4)), 5e-3)
        assert found.depths == pytest.approx([2e-4])
        assert found.normals == pytest.approx(UP[None])
        assert found.places[0] == pytest.approx(places.mean(axis=0))


def test_larger_areas_weigh_more():
    found = cluster_contacts(
        contacts_of([[0, 0, 0], [1e-3, 0, 0]], [UP, UP], [D, D], [1e-6, 3e-6]), 5e-3
    )
    assert found.places[0, 0] == pytest.approx(0.75e-3, rel=2e-3)
    assert found.areas == pytest.approx([4e-6])


def test_opposite_pushes_are_not_mixed():
    pair = contacts_of(np.zeros((2, 3)), [UP, -UP], [1e-4, 1e-4])
    assert len(cluster_contacts(pair, 5e-3).depths) == 2


PLATES = ("1", "4", "mesh 1", "mesh 8", "mesh 32")


@pytest.mark.parametrize("cells", [0, 5])
@pytest.mark.parametrize("plate", PLATES)
def test_a_flat_foot_is_pushed_by_its_depth_in_its_middle(plate, cells):
    renderer = CONVEX_PIECES.prepare(flat.foot_scene(plate, foot_cells=cells))
    for x, y in ((0.0, 0.0), (1.1e-3, 0.4e-3), (-0.7e-3, -1.3e-3)):
        for yaw in (0.0, 0.3, -0.5):
            for depth in (D, 1e-5):
                renderer.reset()
                felt = renderer.wrench(flat.foot_at(x, y if yaw == 0.0 else 0.0, -depth, yaw))
                assert felt.force == pytest.approx([0, 0, flat.K * depth], rel=5e-3, abs=1e-6)
                assert np.abs(flat.pressure_centre(felt)).max() < 5e-6
                assert felt.contacts == 1


@pytest.mark.parametrize("plate", PLATES)
def test_a_foot_half_over_the_edge_is_pushed_in_the_middle_of_the_overlap(plate):
    renderer = CONVEX_PIECES.prepare(flat.foot_scene(plate))
    for yaw in (0.0, 0.4):
        felt = renderer.wrench(flat.foot_at(6e-3, 0.0, -D, yaw))
        assert felt.force == pytest.approx([0, 0, flat.K * D], rel=1e-3, abs=1e-6)
        # The half of the foot on the plate's side of a line through its middle.
        middle = np.array(flat.half_middle(yaw))
        assert flat.pressure_centre(felt) == pytest.approx(middle, abs=5e-6)


def test_force_does_not_change_along_the_seams_of_four_boxes():
    renderer = CONVEX_PIECES.prepare(flat.foot_scene("4"))
    for start, end, yaw in (((-2e-3, 0), (2e-3, 0), 0.0), ((-2e-3, -1e-3), (2e-3, 1e-3), 0.2)):
        forces, centres = [], []
        for s in np.linspace(0.0, 1.0, 101):
            place = np.array(start) + s * (np.array(end) - start)
            felt = renderer.wrench(flat.foot_at(*place, -D, yaw))
            forces.append(felt.force)
            centres.append(flat.pressure_centre(felt))
        assert np.array(forces)[:, 2] == pytest.approx(flat.K * D, rel=1e-6)
        assert np.abs(np.array(forces)[:, :2]).max() < 1e-9
        assert np.abs(centres).max() < 5e-6


def test_a_tilted_foot_is_pushed_at_its_low_edge_and_gets_there_steadily():
    renderer = CONVEX_PIECES.prepare(flat.foot_scene("4"))
    tilts = np.linspace(0.0, 0.02, 81)
    felt = [renderer.wrench(flat.foot_at(0.3e-3, 0.2e-3, -D, 0.0, tilt)) for tilt in tilts]
    assert np.array([w.force[2] for w in felt]) == pytest.approx(flat.K * D, rel=1e-2)
    x = np.array([flat.pressure_centre(w)[0] for w in felt])
    assert x[-1] == pytest.approx(flat.FOOT[0], abs=0.3e-3)
    assert np.abs(np.diff(x)).max() < 0.5e-3
    assert np.diff(x).min() > -1e-5


def ball_scene(radius, plate):
    return flat.scene(plate, f'<geom type="sphere" size="{radius}" mass="0.01"/>')


def test_a_ball_over_a_plate_also_over_seams_and_an_unbounded_plane():
    plane = '<geom type="plane" size="0 0 1"/>'
    for plate in (flat.plate_of(1), flat.plate_of(4), plane):
        renderer = CONVEX_PIECES.prepare(ball_scene(1.5e-3, plate))
        for x in (0.0, 1e-4, 0.4e-3, 1e-3):
            for depth in (2e-4, 1e-6):
                felt = renderer.wrench(flat.pose_of((x, 0.0, 1.5e-3 - depth)))
                assert felt.force == pytest.approx([0, 0, flat.K * depth], rel=1e-6, abs=1e-12)
                assert np.abs(felt.torque).max() < 1e-9
                assert felt.contacts == 1
        assert renderer.wrench(flat.pose_of((0, 0, 1.6e-3))).contacts == 0


def test_a_ball_pressed_in_beyond_its_centre_keeps_its_depth():
    renderer = CONVEX_PIECES.prepare(ball_scene(0.5e-3, flat.plate_of(1)))
    depths = np.linspace(0.1e-3, 0.9e-3, 9)
    felt = [renderer.wrench(flat.pose_of((0, 0, 0.5e-3 - depth))) for depth in depths]
    assert [w.force[2] for w in felt] == pytest.approx(flat.K * depths, rel=1e-6)


def test_balls_and_capsules_have_closed_forms():
    ball = '<geom type="sphere" size="0.002"/>'
    renderer = CONVEX_PIECES.prepare(ball_scene(1e-3, ball))
    n = np.array([0.48, 0.6, 0.64])
    felt = renderer.wrench(flat.pose_of(2.9e-3 * n))
    assert felt.force == pytest.approx(flat.K * 1e-4 * n, rel=1e-6)
    rod = '<geom type="capsule" size="0.001" fromto="-0.01 0 0 0.01 0 0"/>'
    renderer = CONVEX_PIECES.prepare(ball_scene(1e-3, rod))
    m = np.array([0.0, 0.6, 0.8])
    felt = renderer.wrench(flat.pose_of(np.array([4e-3, 0, 0]) + 1.9e-3 * m))
    assert felt.force == pytest.approx(flat.K * 1e-4 * m, rel=1e-6)
    lying = CONVEX_PIECES.prepare(
        flat.scene(
            flat.plate_of(4),
            '<geom type="capsule" size="0.001" fromto="-0.002 0 0 0.002 0 0" mass="0.01"/>',
        )
    )
    felt = lying.wrench(flat.pose_of((0.5e-3, 0.2e-3, 1e-3 - D)))
    assert felt.force == pytest.approx([0, 0, flat.K * D], rel=1e-6, abs=1e-12)
    assert np.abs(felt.torque).max() < 0.01e-3 * felt.force[2]


def one_contact(a, b, n):
    found, place, hub = np.empty(4), np.empty(3), np.full(2, -1)
    area = solid_contact(a, b, hub, np.array([0.1, 5e-6]), found, place)
    assert area >= 0.0
    assert found[1:] == pytest.approx(n, abs=1e-9)
    return found[0], place


def test_an_edge_over_an_edge():
    # Two square bars on edge, crossed at an angle; their edges pass at z = 0 less the depth.
    half = np.array([10e-3, 1e-3, 1e-3])
    root = np.sqrt(0.5)
    on_edge = np.array([[1, 0, 0], [0, root, -root], [0, root, root]])
    c, s = np.cos(1.0), np.sin(1.0)
    yaw = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    low = box_solid(half).placed(on_edge, np.array([0, 0, -np.sqrt(2) * 1e-3]))
    high = box_solid(half).placed(yaw @ on_edge, np.array([1e-3, 2e-3, np.sqrt(2) * 1e-3 - D]))
    depth, place = one_contact(high, low, UP)
    assert depth == pytest.approx(D, rel=1e-9)
    # The upper edge passes over y = 0 of the lower at x = 1 mm - 2 mm / tan(yaw).
    assert place == pytest.approx([1e-3 - 2e-3 / np.tan(1.0), 0, -0.5 * D], abs=1e-9)


def test_a_corner_over_a_plane():
    rng = np.random.default_rng(2)
    plate = box_solid(np.array([20e-3, 20e-3, 5e-3])).placed(np.eye(3), np.array([0, 0, -5e-3]))
    for _ in range(10):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        if np.abs(turn[2]).min() < 0.3:
            continue
        corners = box_solid(flat.FOOT).vertices @ turn.T
        lowest = corners[:, 2].argmin()
        move = np.array([1e-3, 2e-3, -corners[lowest, 2] - D])
        depth, place = one_contact(box_solid(flat.FOOT).placed(turn, move), plate, UP)
        assert depth == pytest.approx(D, rel=1e-9)
        assert place[:2] == pytest.approx((corners[lowest] + move)[:2], abs=1e-9)


def test_a_foot_on_two_bumps_has_two_clusters():
    bumps = "".join(
        f'<geom type="sphere" size="0.001" pos="{x} 0 -0.001"/>' for x in (-2.6e-3, 2.6e-3)
    )
    renderer = CONVEX_PIECES.prepare(flat.scene(bumps, foot_geom()))
    felt = renderer.wrench(flat.foot_at(0, 0, -D))
    assert felt.contacts == 2
    assert felt.force == pytest.approx([0, 0, 2 * flat.K * D], rel=1e-6, abs=1e-12)
    assert np.abs(felt.torque).max() < 1e-9


def foot_geom():
    return f'<geom type="box" size="{" ".join(map(str, flat.FOOT))}" mass="0.01"/>'


def random_solid(rng, corners):
    points = rng.standard_normal((corners, 3))
    return solid_of_points(1e-3 * points / np.linalg.norm(points, axis=1, keepdims=True))


def difference_depth(a, b):
    """Return the distance from the origin to the hull of all differences of corners."""
    points = (b.vertices[:, None] - a.vertices[None]).reshape(-1, 3)
    return float((-ConvexHull(points).equations[:, 3]).min())


def test_the_depth_of_all_facets_is_that_of_the_minkowski_difference():
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = random_solid(rng, 12), random_solid(rng, 20)
        a = a.placed(np.eye(3), 0.8e-3 * rng.standard_normal(3))
        expected = difference_depth(a, b)
        best, hub = np.empty(4), np.full(2, -1)
        least_of_all(a, b, hub, best)
        if expected > 0.0:
            assert best[0] == pytest.approx(expected, rel=1e-9)
            moved = a.placed(np.eye(3), best[0] * best[1:])
            assert difference_depth(moved, b) == pytest.approx(0.0, abs=1e-12)
        else:
            assert best[0] <= 1e-12


def test_the_walk_keeps_to_the_depth_of_all_facets():
    """Along motions with shallow overlap, the walk's local minimum is the global one."""
    rng = np.random.default_rng(1)
    hubs, exact, ticks = 0, 0, 0
    for _ in range(10):
        a, b = random_solid(rng, 30), random_solid(rng, 30)
        start, way = rng.standard_normal(3), rng.standard_normal(3)
        start *= 1.7e-3 / np.linalg.norm(start)
        hub, best, full, other = np.full(2, -1), np.empty(4), np.empty(4), np.full(2, -1)
        for s in np.linspace(-0.4e-3, 0.4e-3, 81):
            placed = a.placed(np.eye(3), start + s * way / np.linalg.norm(way))
            least_of_all(placed, b, other, full)
            if full[0] <= 0.0:
                hub[:] = -1
                continue
            if hub[0] < 0:
                hub[:], best[:] = other, full
            else:
                hubs += walk(placed, b, hub, best)
                ticks += 1
                exact += abs(best[0] - full[0]) < 1e-12
            # A local minimum is an upper bound.
            assert best[0] >= full[0] - 1e-12
    assert ticks > 200
    assert exact > 0.98 * ticks
    assert hubs < 8 * ticks


def test_virtual_faces_are_those_inside_the_body():
    half = np.array([1e-3, 1e-3, 1e-3])
    boxes = [box_solid(half).placed(np.eye(3), np.array([x, 0, 0])) for x in (-1e-3, 1e-3)]
    pieces = pieces_of(boxes)
    assert [int(solid.real.sum()) for solid in pieces.solids] == [5, 5]
    assert pieces.joined.all()
    apart = pieces_of([boxes[0], boxes[1].placed(np.eye(3), np.array([1e-4, 0, 0]))])
    assert all(solid.real.all() for solid in apart.solids)
    assert not apart.joined[0, 1]
    # A larger face stays, even where a smaller piece covers its middle.
    small = box_solid(0.5 * half).placed(np.eye(3), np.array([0, 0, 1.5e-3]))
    stacked = pieces_of([box_solid(half), small])
    assert stacked.solids[0].real.all()
    assert int(stacked.solids[1].real.sum()) == 5


def test_a_hull_has_the_faces_of_the_solid_not_the_triangles_of_its_mesh():
    u = np.linspace(-1, 1, 9)
    grid = np.array([[x, y, z] for x in u for y in u for z in (-1, 1)])
    solid = solid_of_points(grid)
    assert (len(solid.vertices), len(solid.edges), len(solid.normals)) == (8, 12, 6)
    segment = solid_of_faces(np.array([[0, 0, 0], [1, 0, 0.0]]), [], 0.1)
    assert (len(segment.edges), segment.near.tolist()) == (1, [1, 0])


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks", "file-cad"])
def test_it_renders_the_built_in_scenes(name):
    scene = load_scene(name)
    renderer = CONVEX_PIECES.prepare(scene)
    pose = scene.start.copy()
    pose[2] -= 6e-4
    felt = renderer.wrench(pose)
    k = scene.force.stiffness
    # The tool starts 0.1 or 0.5 mm above a level surface; the file, a little bellied, touches the
    # boss on both sides of its hole.
    deep = 5e-4 if name == "probe-plate" else 1e-4
    assert felt.force[2] == pytest.approx(k * deep, rel=5e-2 if name != "file-cad" else 0.7)
    assert felt.depth == pytest.approx(deep, rel=5e-2)
    assert felt.contacts == (2 if name == "file-cad" else 1)
    assert np.abs(felt.force[:2]).max() < 2e-3 * felt.force[2]


def test_a_push_beside_the_centre_of_mass_turns():
    felt = CONVEX_PIECES.prepare(load_scene("probe-plate"))
    tilted = np.array([0.0, 0.0, 1.3e-3, np.cos(0.2), 0.0, np.sin(0.2), 0.0])
    wrench = felt.wrench(tilted)
    # The centre of mass lies to the +x side of the tip, so the push upwards turns it about +y.
    assert wrench.torque[1] > 1e-4
