"""Local minimum distances of shapes whose minima are known, and the repulsion they give."""

import flat_scenes as flat
import numpy as np
import pytest

from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene
from asperity.studies.baselines.displaced_surfaces import displaced_surface, spacing_for
from asperity.studies.baselines.local_minima import RigidMotion, near_pairs, room_for
from asperity.studies.baselines.local_minimum_distances import DETAIL, LOW, LmdRenderer
from asperity.studies.baselines.normal_cones import tree_of
from asperity.studies.baselines.placement import Standing
from asperity.studies.baselines.smooth_surfaces import tree_of_body
from asperity.texture.patterns.patterns import sinusoid

K, GAP = 400.0, 1e-3
S = LOW.stand_off


def ball(radius, spacing=None):
    body = Body("ball", [Geom("sphere", [radius])])
    if spacing is None:
        return tree_of_body(body, 1000)
    return tree_of(displaced_surface(body, spacing, smooth=True))


def wavy_plate(amplitude, wave, spacing):
    texture = sinusoid(wavelength=wave, amplitude=amplitude)
    body = Body("plate", [Geom("box", [6e-3, 2e-3, 1e-3])], texture)
    return tree_of(displaced_surface(body, spacing))


def box(half, points=None):
    body = Body("box", [Geom("box", half)])
    if points is None:
        return tree_of_body(body, 1000)
    return tree_of(displaced_surface(body, spacing_for(body, points), smooth=True))


def renderer(tool, other, stand_off=S, band=5e-6):
    there = Standing(None, np.eye(3), np.zeros(3))
    return LmdRenderer(
        tool, [(other, there)], np.zeros(3), stiffness=K, stand_off=stand_off, band=band
    )


def pose(x, y, z):
    return np.array([x, y, z, 1.0, 0.0, 0.0, 0.0])


PLATES = ("1", "4", "mesh 1", "mesh 8", "mesh 32")


@pytest.mark.parametrize("cells", [0, 5])
@pytest.mark.parametrize("plate", PLATES)
def test_a_foot_over_a_plate_has_one_minimum_in_its_middle(plate, cells):
    pair = LOW.prepare(flat.foot_scene(plate, foot_cells=cells))
    for x, y, yaw in ((0, 0, 0), (1.1e-3, 0.4e-3, 0), (0, 0, 0.3), (-0.7e-3, 0, -0.5)):
        for gap in (GAP, 1e-5):
            felt = pair.wrench(flat.foot_at(x, y, gap, yaw))
            assert felt.force == pytest.approx([0, 0, flat.K * (S - gap)], rel=1e-6, abs=1e-6)
            assert np.abs(flat.pressure_centre(felt)).max() < 1e-6
            assert felt.contacts == 1
    for yaw in (0.0, 0.4):
        felt = pair.wrench(flat.foot_at(6e-3, 0.0, GAP, yaw))
        assert felt.force == pytest.approx([0, 0, flat.K * (S - GAP)], rel=1e-6, abs=1e-6)
        middle = np.array(flat.half_middle(yaw))
        assert flat.pressure_centre(felt) == pytest.approx(middle, abs=5e-6)


@pytest.mark.parametrize("points", [500, 1500, 4000])
def test_the_number_of_samples_of_flat_surfaces_has_no_influence(points):
    """Also of surfaces cut into small triangles on both sides, which do not match."""
    pair = renderer(box(flat.FOOT, points), box(flat.PLATE / 2, points))
    whole = renderer(box(flat.FOOT), box(flat.PLATE / 2))
    for x, y, yaw in ((0.0, 0.0, 0.0), (0.31e-3, 0.17e-3, 0.25)):
        place = flat.foot_at(x, y, GAP + flat.PLATE[2] / 2, yaw)
        felt, expected = pair.wrench(place), whole.wrench(place)
        assert felt.contacts == expected.contacts == 1
        assert felt.force == pytest.approx([0, 0, K * (S - GAP)], rel=1e-6, abs=1e-6)
        assert felt.torque == pytest.approx(expected.torque, abs=1e-8)


def test_more_pairs_than_there_is_room_for_are_not_dropped():
    pair = renderer(box(flat.FOOT, 4000), box(flat.PLATE / 2, 4000))
    place = flat.foot_at(0, 0, GAP + flat.PLATE[2] / 2)
    expected = pair.wrench(place)
    pair._room = room_for(3)
    felt = pair.wrench(place)
    assert pair._room.distances.size > 100
    np.testing.assert_array_equal(felt.force, expected.force)
    np.testing.assert_array_equal(felt.torque, expected.torque)


def test_force_does_not_change_along_the_seams_of_four_boxes():
    pair = LOW.prepare(flat.foot_scene("4"))
    for s in np.linspace(-2e-3, 2e-3, 41):
        felt = pair.wrench(flat.foot_at(s, 0.4 * s, GAP, 0.2))
        assert felt.force == pytest.approx([0, 0, flat.K * (S - GAP)], rel=1e-6, abs=1e-6)
        assert np.abs(flat.pressure_centre(felt)).max() < 1e-6


def test_a_tilted_foot_is_pushed_at_its_low_edge_and_gets_there_steadily():
    pair = LOW.prepare(flat.foot_scene("4"))
    tilts = np.linspace(0.0, 5e-3, 101)
    felt = [pair.wrench(flat.foot_at(0.3e-3, 0.2e-3, GAP, 0.0, tilt)) for tilt in tilts]
    x = np.array([flat.pressure_centre(w)[0] for w in felt])
    assert np.array([w.force[2] for w in felt]) == pytest.approx(flat.K * (S - GAP), rel=1e-3)
    assert x[-1] == pytest.approx(flat.FOOT[0], abs=0.5e-3)
    assert np.abs(np.diff(x)).max() < 0.5e-3


def test_a_foot_over_two_bumps_has_two_minima():
    bumps = "".join(
        f'<geom type="sphere" size="0.001" pos="{x} 0 -0.001"/>' for x in (-2.6e-3, 2.6e-3)
    )
    size = " ".join(map(str, flat.FOOT))
    pair = LOW.prepare(flat.scene(bumps, f'<geom type="box" size="{size}" mass="0.01"/>'))
    felt = pair.wrench(flat.foot_at(0, 0, GAP))
    assert felt.contacts == 2
    assert felt.force == pytest.approx([0, 0, 2 * flat.K * (S - GAP)], rel=1e-6, abs=1e-9)
    assert np.abs(felt.torque).max() < 1e-9


def test_balls_have_closed_forms():
    plane = '<geom type="plane" size="0 0 1"/>'
    tool = '<geom type="sphere" size="0.0015" mass="0.01"/>'
    for plate in (flat.plate_of(1), flat.plate_of(4), plane):
        pair = LOW.prepare(flat.scene(plate, tool))
        for x in (0.0, 0.2e-3, 1e-3):
            for gap in (GAP, 0.0, -1e-4):
                felt = pair.wrench(pose(x, 0, 1.5e-3 + gap))
                assert felt.force == pytest.approx([0, 0, flat.K * (S - gap)], rel=1e-6, abs=1e-9)
                assert felt.contacts == 1
    pair = renderer(ball(2e-3), ball(3e-3))
    for way in np.random.default_rng(0).standard_normal((4, 3)):
        n = way / np.linalg.norm(way)
        places, directions, distances = pair.minima(pose(*(6e-3 * n)))
        assert distances == pytest.approx([1e-3], rel=1e-9)
        assert places[0] == pytest.approx(np.array([4e-3 * n, 3e-3 * n]), abs=1e-12)
        assert directions[0] == pytest.approx(n, abs=1e-12)


def test_edges_and_corners_have_closed_forms():
    half, root = [10e-3, 1e-3, 1e-3], np.sqrt(0.5)
    bar = Body("bar", [Geom("box", half, quaternion=[np.cos(np.pi / 8), np.sin(np.pi / 8), 0, 0])])
    pair = renderer(tree_of_body(bar, 1000), tree_of_body(bar, 1000))
    place = pose(1e-3, 2e-3, 2e-3 / root + GAP)
    place[3:] = [np.cos(0.5), 0, 0, np.sin(0.5)]
    places, directions, distances = pair.minima(place)
    assert distances == pytest.approx([GAP], rel=1e-9)
    assert directions[0] == pytest.approx([0, 0, 1], abs=1e-9)
    assert places[0, 1, :2] == pytest.approx([1e-3 - 2e-3 / np.tan(1.0), 0], abs=1e-9)
    place = np.array([0.4e-3, 0.3e-3, 0, 0.8, 0.4, 0.4, 0.2])
    place[3:] /= np.linalg.norm(place[3:])
    turn = flat.rotation_of(place[3:])
    signs = -np.sign(turn[2])
    corner = turn @ (signs * flat.FOOT)
    place[2] = 1e-3 + GAP - corner[2]
    pair = renderer(box(flat.FOOT), box([12e-3, 12e-3, 1e-3]))
    places, directions, distances = pair.minima(place)
    assert distances == pytest.approx([GAP], rel=1e-9)
    assert directions[0] == pytest.approx([0, 0, 1], abs=1e-9)
    assert places[0, 0] == pytest.approx(corner + place[:3], abs=2e-6)


def test_force_grows_from_nothing_and_never_jumps():
    pair = renderer(ball(2e-3, 0.2e-3), ball(3e-3, 0.3e-3), 1e-3)
    n = np.array([0.36, 0.48, 0.8])
    distances = np.linspace(7e-3, 5.05e-3, 80)
    forces = np.array([pair.wrench(pose(*(d * n))).force for d in distances])
    size = np.linalg.norm(forces, axis=1)
    expected = K * np.maximum(1e-3 - (distances - 5e-3), 0.0)
    assert size[distances > 6.06e-3].max() == 0.0
    assert size == pytest.approx(expected, abs=K * 0.06e-3)
    step = K * (distances[0] - distances[1])
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < 1.5 * step


def minima_over(c, amplitude, wave, radius, stand_off):
    """Return how many places of the wave are locally nearest to a ball's middle c, in range."""
    x = np.linspace(-5e-3, 5e-3, 200_001)
    h = 1e-3 + amplitude * np.sin(2 * np.pi * x / wave)
    away = np.hypot(x - c[0], h - c[1])
    least = (away[1:-1] < away[:-2]) & (away[1:-1] < away[2:])
    found = away[1:-1][least] - radius
    return np.sort(found[found < stand_off])


@pytest.mark.parametrize("x", [0.0, 0.4e-3, 1.0e-3])
@pytest.mark.parametrize("z", [2.1e-3, 2.8e-3])
def test_a_ball_over_waves_has_one_for_each_bump_that_faces_it(x, z):
    amplitude, wave, radius, stand_off = 0.2e-3, 1.5e-3, 0.8e-3, 1.2e-3
    plate = wavy_plate(amplitude, wave, 0.05e-3)
    # The map's phase is the plate's own: asked of the surface, not assumed.
    phase = crest_of(plate, wave)
    pair = renderer(ball(radius), plate, stand_off)
    distances = pair.minima(pose(x, 0.0, z))[2]
    expected = minima_over((x - phase + 0.25 * wave, z), amplitude, wave, radius, stand_off)
    assert distances[: len(expected)] == pytest.approx(expected, abs=0.02e-3)
    # A facet in a valley, where the smooth distance is largest, may hold a shallow one of its own.
    assert len(distances) <= len(expected) + 1


def crest_of(tree, wave):
    """Return where a crest of the top lies [m]."""
    corners = tree.triangles.reshape(-1, 3)
    top = corners[corners[:, 2] > corners[:, 2].max() - 1e-6]
    turns = np.exp(2j * np.pi * top[:, 0] / wave)
    return float(np.angle(turns.mean()) / (2 * np.pi) * wave)


def test_cones_lose_nothing_and_save_much():
    one, other = ball(1e-3, 0.15e-3), wavy_plate(0.15e-3, 2e-3, 0.25e-3)
    blind = [tree._replace(angles=np.full_like(tree.angles, np.pi)) for tree in (one, other)]
    rng = np.random.default_rng(1)
    looked = {True: np.zeros(2, np.int64), False: np.zeros(2, np.int64)}
    for _ in range(2):
        shift = np.array([*rng.uniform(-1e-3, 1e-3, 2), rng.uniform(2.3e-3, 2.6e-3)])
        found = {}
        for with_cones, (a, b) in ((True, (one, other)), (False, blind)):
            room, motion = room_for(4096), RigidMotion(np.eye(3), shift)
            n = near_pairs(a, b, motion, 0.8e-3, room, looked[with_cones])
            assert n <= 4096
            found[with_cones] = np.sort(room.distances[:n][room.strict[:n]])
        assert found[True] == pytest.approx(found[False])
        assert len(found[True]) > 0
    assert 3 * looked[True][1] < looked[False][1]


@pytest.mark.parametrize("plate", ["1", "mesh 8"])
def test_surfaces_that_cross_push_with_all_their_stand_off(plate):
    pair = LOW.prepare(flat.foot_scene(plate, foot_cells=4))
    for gap in (0.0, -1e-4):
        felt = pair.wrench(flat.foot_at(0.1e-3, 0, gap, 0.3))
        assert felt.force == pytest.approx([0, 0, flat.K * S], rel=1e-3, abs=2e-2 * flat.K * S)
        assert np.abs(flat.pressure_centre(felt)).max() < 0.05e-3


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks", "file-cad"])
def test_it_renders_the_built_in_scenes(name):
    scene = load_scene(name)
    felt = LOW.prepare(scene).wrench(scene.start)
    k, gap = scene.force.stiffness, 1e-4 if name == "probe-plate" else 5e-4
    minima = 2 if name == "file-cad" else 1
    assert felt.contacts == minima
    assert felt.depth == pytest.approx(S - gap, rel=2e-2)
    assert felt.force[2] == pytest.approx(minima * k * (S - gap), rel=0.1)


def test_detail_feels_the_waves_of_a_plate():
    scene = load_scene("probe-plate")
    pair = DETAIL.prepare(scene)
    start = scene.start.copy()
    start[2] += 3e-4
    forces = [pair.wrench(start + x * np.eye(7)[0]).force for x in np.linspace(0, 2e-3, 21)]
    assert np.ptp(np.array(forces)[:, 0]) > 0.05
