"""The potential of contact between geoms: the wrench is its gradient, and its size is right."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asperity.contact.solver import ContactSolver
from asperity.scene.scene import Scene, scene_of

K = 400.0
LEVER = 3e-3
ROUND = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
WAVES = {"kind": "sinusoid", "wavelength": 1.5e-3, "amplitude": 3e-5}


def scene(bodies: str, tool: str, texture: dict | None = None) -> Scene:
    """Return a scene of bodies and a tool, given as geoms in MJCF."""
    xml = (
        f'<mujoco><worldbody>{bodies}<body name="tool" pos="0 0 0.05"><freejoint/>{tool}</body>'
        "</worldbody></mujoco>"
    )
    force = {"stiffness": K, "anti_alias": "off", "tolerance": 1e-9, "max_nodes": 100000}
    document = {"schema": 1, "tool": {"body": "tool"}, "force": force}
    if texture is not None:
        document["bodies"] = {"plate": {"texture": texture}}
    return scene_of(xml, document)


def solver(bodies: str, tool: str, texture: dict | None = None) -> ContactSolver:
    made = scene(bodies, tool, texture)
    return ContactSolver(made.model, made.bodies, "tool", made.force)


def box(x, y, z, size, name="plate"):
    return (
        f'<body name="{name}" pos="{x} {y} {z}"><geom type="box" '
        f'size="{size[0]} {size[1]} {size[2]}"/></body>'
    )


def wrench(engine: ContactSolver, place, turn: Rotation) -> np.ndarray:
    engine.reset()
    pose = np.concatenate([place, np.roll(turn.as_quat(), 1)])
    return engine.wrench(pose, 0.0).copy()


def moved(turn: Rotation, place: np.ndarray, axis: int, step: float):
    """Return a pose after a small translation, or a rotation about the tool's frame's origin."""
    if axis < 3:
        return place + step * np.eye(3)[axis], turn
    return place, Rotation.from_rotvec(step / LEVER * np.eye(3)[axis - 3]) * turn


def stiffness(engine: ContactSolver, place: np.ndarray, turn: Rotation, step: float):
    """Return the derivative of the wrench (force, torque / LEVER) by (place, turn LEVER)."""
    out = np.zeros((6, 6))
    for axis in range(6):
        to, back = moved(turn, place, axis, step), moved(turn, place, axis, -step)
        out[:, axis] = (wrench(engine, *to) - wrench(engine, *back)) / (2.0 * step)
    out[3:] /= LEVER
    return out


def asymmetry(engine: ContactSolver, place: np.ndarray, turn: Rotation, step=2e-6) -> float:
    """Return the largest asymmetry of the second derivatives of U, over k."""
    by = stiffness(engine, place, turn, step)
    torque = wrench(engine, place, turn)[3:] / LEVER**2
    # Rotations do not commute: by turns about fixed axes the torque's derivative is not symmetric.
    x, y, z = 0.5 * torque
    by[3:, 3:] += np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return float(np.abs(by - by.T).max()) / K


def random_geom(kind: str, rng: np.random.Generator) -> str:
    sizes = rng.uniform(2e-3, 6e-3, {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3))
    size, quat = " ".join(map(str, sizes)), " ".join(map(str, rng.normal(size=4)))
    return f'<geom type="{kind}" size="{size}" quat="{quat}" mass="0.05"/>'


def touching(engine: ContactSolver, way: np.ndarray, turn: Rotation) -> float:
    """Return the largest distance of the tool along a way at which there is a force."""
    low, high = 0.0, 0.03
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if wrench(engine, way * middle, turn).any() else (low, middle)
    return low


@pytest.mark.parametrize("texture", [None, WAVES])
def test_random_pairs_of_solids_have_one_energy(texture):
    rng, sizes, stiff, apart = np.random.default_rng(0), [], [], []
    for _ in range(12):
        kind, other = rng.choice(ROUND, 2)
        body = f'<body name="plate">{random_geom(other, rng)}</body>'
        engine = solver(body, random_geom(kind, rng), texture)
        way, turn = rng.normal(size=3), Rotation.from_quat(rng.normal(size=4))
        way /= np.linalg.norm(way)
        begin = touching(engine, way, turn)
        for depth in (1e-4, 3e-4):
            place = way * (begin - depth)
            force = wrench(engine, place, turn)[:3]
            count = engine.contacts.count[0]
            sizes.append(np.linalg.norm(force) / K / engine.contacts.depth[:count].min())
            apart.append(asymmetry(engine, place, turn))
            stiff.append(np.abs(stiffness(engine, place, turn, 2e-6)[:3, :3]).max() / K)
    # A kink of the depth within a step is no fault: hence the median and one of ten.
    assert np.median(apart) < 2e-6
    assert np.quantile(apart, 0.85) < 1e-4
    assert min(sizes) > 0.5
    assert max(sizes) < 1.1
    if texture is None:
        assert max(stiff) < 1.2


def energy(engine: ContactSolver, place: np.ndarray, turn: Rotation) -> float:
    """Return U [J]."""
    wrench(engine, place, turn)
    return 0.5 * K * float(engine._memory.state["way_out"][0]) ** 2


@pytest.mark.parametrize("texture", [None, WAVES])
@pytest.mark.parametrize("kind", ROUND)
def test_the_wrench_is_the_gradient_of_the_energy_round_an_edge(kind, texture):
    rng = np.random.default_rng(ROUND.index(kind))
    engine = solver(box(0, 0, 0, (0.012, 0.012, 0.002)), random_geom(kind, rng), texture)
    turn, off, sideways = Rotation.from_quat(rng.normal(size=4)), [], 0.0
    for x in np.linspace(0.0105, 0.0155, 21):
        place = np.array([x, 1e-3, 0.0])
        place[2] = _lowest_free(engine, place, turn) - 3e-4
        if place[2] < 1e-3:
            break
        force = wrench(engine, place, turn)
        size = np.linalg.norm(force[:3])
        sideways = max(sideways, force[0] / size)
        for axis in range(6):
            to, back = moved(turn, place, axis, 1e-7), moved(turn, place, axis, -1e-7)
            slope = (energy(engine, *to) - energy(engine, *back)) / 2e-7
            expected = -force[axis] if axis < 3 else -force[axis] / LEVER
            off.append(abs(slope - expected) / size)
    assert sideways > 0.5
    assert np.median(off) < 1e-6
    assert np.quantile(off, 0.9) < 1e-5  # the rest is beside kinks of the depth


def _lowest_free(engine: ContactSolver, place: np.ndarray, turn: Rotation) -> float:
    """Return the height at which the tool is just clear of the body."""
    low, high = 0.0, 0.02
    for _ in range(40):
        middle = 0.5 * (low + high)
        touches = wrench(engine, np.array([*place[:2], middle]), turn).any()
        low, high = (middle, high) if touches else (low, middle)
    return high


def path_round(points: np.ndarray, step: float) -> np.ndarray:
    """Return a closed path through points, in steps of about `step`."""
    sides = []
    for begin, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        count = max(int(np.ceil(np.linalg.norm(end - begin) / step)), 1)
        sides.append(begin + (end - begin) * np.arange(count)[:, None] / count)
    return np.concatenate([*sides, points[:1]])


def work_round(engine: ContactSolver, path: np.ndarray, turn: Rotation) -> tuple[float, float]:
    """Return the work on a closed path and the sum of its amounts [J]."""
    force = np.array([wrench(engine, place, turn)[:3] for place in path])
    parts = (0.5 * (force[1:] + force[:-1]) * np.diff(path, axis=0)).sum(axis=1)
    return float(parts.sum()), float(np.abs(parts).sum())


@pytest.mark.parametrize("depth", [5e-5, 4e-4])
@pytest.mark.parametrize("yaw", [0.0, 20.0, 70.0])
@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere"])
def test_no_work_is_done_round_an_edge(kind, yaw, depth):
    size = {"box": "0.002 0.0015 0.001", "cylinder": "0.0015 0.001", "sphere": "0.001"}[kind]
    engine = solver(
        box(0, 0, 0, (0.012, 0.012, 0.002)), f'<geom type="{kind}" size="{size}" mass="0.05"/>'
    )
    low, high = 3e-3 - depth, 3e-3 + 1e-4
    corners = np.array([[x, 1e-3, z] for x, z in (
        (0.0105, low), (0.0150, low), (0.0150, high), (0.0105, high))])  # fmt: skip
    work, amount = work_round(
        engine, path_round(corners, depth / 25.0), Rotation.from_euler("z", yaw, degrees=True)
    )
    assert amount > 0.5 * K * depth**2
    assert abs(work) < 1e-3 * amount


def test_walls_have_the_whole_stiffness_each():
    """In a corner of floor and wall each pushes with k times its own depth."""
    floor, wall = box(0, 0, -5e-3, (0.02, 0.02, 5e-3)), box(-8e-3, 0, 5e-3, (5e-3, 0.02, 5e-3), "w")
    engine = solver(floor + wall, '<geom type="box" size="0.002 0.002 0.002" mass="0.05"/>')
    force = wrench(engine, np.array([-1.1e-3, 0.0, 1.8e-3]), Rotation.identity())[:3]
    np.testing.assert_allclose(force, [K * 1e-4, 0.0, K * 2e-4], rtol=1e-6, atol=1e-9)


def groove(wide: float) -> str:
    """Return a V of two inclined boxes as one body, or (`wide` < 0) as two."""
    geoms = [
        f'<geom type="box" size="0.004 0.02 0.002" pos="{s * 3.2e-3} 0 0" euler="0 {-s * 45} 0"/>'
        for s in (-1, 1)
    ]
    if wide > 0:
        return f'<body name="plate">{geoms[0]}{geoms[1]}</body>'
    return f'<body name="plate">{geoms[0]}</body><body name="other">{geoms[1]}</body>'


def test_a_groove_is_as_stiff_as_one_body_as_two():
    tool = '<geom type="sphere" size="0.0015" mass="0.05"/>'
    one, two = solver(groove(1.0), tool), solver(groove(-1.0), tool)
    for x in (0.0, 1e-4, -2e-4):
        place = np.array([x, 0.0, 1.5e-3])
        a, b = (wrench(engine, place, Rotation.identity()) for engine in (one, two))
        assert np.linalg.norm(a[:3]) > 0.01
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("pieces", [2, 4])
def test_flush_bodies_are_one_solid(pieces):
    wide = 0.012 / pieces
    whole = box(0, 0, -2e-3, (0.012, 0.012, 2e-3))
    parts = "".join(
        box(
            -0.012 + wide * (2 * i + 1),
            0,
            -2e-3,
            (wide, 0.012, 2e-3),
            "plate" if i == 0 else f"p{i}",
        )
        for i in range(pieces)
    )
    for tool in ("sphere", "box"):
        size = "0.001" if tool == "sphere" else "0.002 0.0015 0.001"
        geom = f'<geom type="{tool}" size="{size}" mass="0.05"/>'
        one, many = solver(whole, geom), solver(parts, geom)
        for x in np.linspace(-7e-3, 7.1e-3, 23):
            for tilt in (0.0, 7.0):
                turn = Rotation.from_euler("xy", [0.5 * tilt, tilt], degrees=True)
                place = np.array([x, 0.3e-3, 0.9e-3])
                a, b = wrench(one, place, turn), wrench(many, place, turn)
                np.testing.assert_allclose(a[:3], b[:3], rtol=0, atol=1e-6 * max(abs(a[2]), 0.01))


def test_corners_turn_the_force_gradually():
    """Corner on corner: at most 1.1 k times the least depth, and no turn within 2 um."""
    engine = solver(
        box(0, 0, 0, (5e-3, 5e-3, 5e-3)),
        '<geom type="box" size="0.005 0.005 0.005" mass="0.05"/>',
    )
    for depth in (1e-4, 3e-4):
        at, force = 0.01 - depth, []
        for shift in (-1e-6, 1e-6):
            force.append(wrench(engine, np.array([at + shift, at, at]), Rotation.identity())[:3])
        sizes = np.linalg.norm(force, axis=1)
        assert sizes.max() < 1.1 * K * depth
        assert force[0] @ force[1] / sizes.prod() > math.cos(math.radians(3.0))


def test_what_came_before_has_no_influence():
    """From any first pose, and after a way through the body, the wrench is the same."""
    engine = solver(
        box(0, 0, 0, (5e-3, 5e-3, 1e-3)), '<geom type="sphere" size="0.001" mass="0.05"/>', WAVES
    )
    place, turn = np.array([1e-3, 2e-3, 1.8e-3]), Rotation.identity()
    first = wrench(engine, place, turn)
    engine.reset()
    for z in np.linspace(-3e-3, 1.8e-3, 50):
        last = engine.wrench(np.array([1e-3, 2e-3, z, 1.0, 0.0, 0.0, 0.0]), 1e-3).copy()
    np.testing.assert_allclose(last, first, rtol=1e-9, atol=1e-12)


def test_many_bodies_side_by_side_are_one():
    """Thirty-six blocks, each a body, under one flat foot: no contact is left out."""
    blocks = "".join(
        box(
            4e-3 * i - 1e-2,
            4e-3 * j - 1e-2,
            -2e-3,
            (1e-3, 1e-3, 2e-3),
            "plate" if i + j == 0 else f"p{i}{j}",
        )
        for i in range(6)
        for j in range(6)
    )
    engine = solver(blocks, '<geom type="box" size="0.012 0.012 0.001" mass="0.05"/>')
    force = wrench(engine, np.array([0.0, 0.0, 0.9e-3]), Rotation.identity())
    assert engine.contacts.count[1] == 0
    np.testing.assert_allclose(force, [0, 0, K * 1e-4, 0, 0, 0], rtol=0, atol=1e-9)


def test_a_part_whose_one_way_out_leads_far_still_counts():
    """A tilted tip and shaft at the rim of a plate: the force vanished where a way was too long."""
    probe = (
        '<geom type="sphere" size="0.0015" mass="0.001"/><geom type="capsule" '
        'fromto="0 0 0.00075 0 0 0.04" size="0.0009" mass="0.004"/>'
    )
    plate = box(0, 0, -4e-3, (0.05, 0.02, 0.004))
    engine = solver(plate, probe, {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4})
    pose = np.array(
        [-0.02523455, 0.0214024, -0.00110475, 0.9669251, 0.22771625, 0.0050341, 0.11478592]
    )
    forces = []
    for y in np.linspace(-2e-6, 2e-6, 21):
        at = pose.copy()
        at[1] += y
        forces.append(engine.wrench(at, 0.0)[:3].copy())
    sizes = np.linalg.norm(forces, axis=1)
    assert sizes.min() > 0.5 * K * 7e-5
    assert np.abs(np.diff(forces, axis=0)).max() < 0.02 * sizes.max()


BALL, FOOT = '<geom type="sphere" size="0.0015"/>', '<geom type="box" size="0.002 0.002 0.001"/>'
RIMS = {
    "a ball over a rim": (
        '<geom type="box" size="0.004 0.004 0.004"/>', BALL,
        (3.5e-3, 1e-3, 5.45e-3), (5.2e-3, 1.3e-3, 5.3e-3),
    ),
    "a ball down a rim": (
        '<geom type="box" size="0.004 0.004 0.004"/>', BALL,
        (3.8e-3, 6e-4, 5.43e-3), (5.6e-3, 1.1e-3, 4.6e-3),
    ),
    "the edge of a foot on a ball": (
        '<geom type="sphere" size="0.006"/>', FOOT, (0.0, 0.0, 6.98e-3), (3.2e-3, 4e-4, 6.7e-3),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RIMS)
def test_spikes_beside_an_edge_have_one_energy(name, tmp_path):
    """Spikes of a pixel, 0.1 mm high, are far deeper along one normal than along the next.

    No way out may come or go with the directions that are searched: the energy leapt by a third.
    """
    body, tool, begin, end = RIMS[name]
    heights = np.zeros((64, 64))
    heights[::4, ::4] = 1e-4
    np.save(tmp_path / "spikes.npy", heights)
    texture = {"file": str(tmp_path / "spikes.npy"), "size": [8e-3, 8e-3],
               "mapping": "triplanar", "border": "wrap"}  # fmt: skip
    engine = solver(f'<body name="plate">{body}</body>', tool, texture)
    turn = Rotation.from_rotvec((0.05, 0.03, 0.2) if tool is FOOT else (0, 0, 0))
    path = np.linspace(begin, end, 300)
    forces = np.array([wrench(engine, place, turn)[:3] for place in path])
    energies = np.array([energy(engine, place, turn) for place in path])
    moved_by = np.diff(path, axis=0)
    missing = np.diff(energies) + (0.5 * (forces[1:] + forces[:-1]) * moved_by).sum(1)
    usual = np.sqrt(2.0 * K * energies.max()) * np.linalg.norm(moved_by[0])
    print(f"{name}: {np.abs(missing).max() / usual:.2f} of k s times a step is no work")
    assert energies.max() > 0.5 * K * 1e-4**2
    assert np.abs(missing).max() < 1.5 * usual  # kinks; leaps were 5 to 10


def test_the_middle_of_flat_contact_is_that_of_its_area():
    """A flat foot that a seam between bodies cuts unevenly: torque and all as on one plate."""
    foot = '<geom type="box" size="0.002 0.0015 0.001"/>'
    whole = solver(box(0, 0, -2e-3, (12e-3, 8e-3, 2e-3)), foot)
    seams = (-12e-3, -1e-3, 3e-3, 12e-3)
    parts = [box(0.5 * (a + b), 0, -2e-3, (0.5 * (b - a), 8e-3, 2e-3), f"p{i}")
             for i, (a, b) in enumerate(itertools.pairwise(seams))]  # fmt: skip
    cut = solver("".join(parts), foot)
    for yaw in (0.0, 0.3, 1.1):
        for x in np.linspace(-4e-3, 5e-3, 19):
            at = np.array([x, 1.3e-3, 1e-3 - 1e-4]), Rotation.from_rotvec([0, 0, yaw])
            one, several = wrench(whole, *at), wrench(cut, *at)
            assert several[:3] == pytest.approx(one[:3], abs=1e-9)
            assert several[3:] == pytest.approx(one[3:], abs=1e-9)
