"""Contact between bodies that all move: equal, opposite, and the same wherever the pair is."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asperity import AsperityError, Body, ContactSolver, ForceSettings, Geom
from asperity.contact import multibody
from asperity.contact.multibody import MultibodySolver
from asperity.texture.patterns.patterns import sinusoid
from contact.naive_meshes import ball_mesh, model_of, thing

WAVES = sinusoid(wavelength=1.5e-3, amplitude=3e-5)
SETTINGS = ForceSettings(stiffness=400.0, friction=0.3, tolerance=1e-9)
FREE = "<freejoint/>"
SPHERE, BOX = '<geom type="sphere" size="0.002"/>', '<geom type="box" size="0.02 0.02 0.01"/>'


def xml_of(tool: str, block: str, joint: str) -> str:
    mass = '<inertial pos="{}" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/>'
    return (
        '<mujoco><compiler inertiafromgeom="false"/><worldbody>'
        '<geom name="floor" type="plane" size="0 0 1" pos="0 0 -0.2"/>'
        f'<body name="block" pos="0 0 -0.01">{joint}{mass.format("0.001 0 0")}{block}</body>'
        f'<body name="tool" pos="0 0 0.05">{FREE}{mass.format("0 0.001 0")}{tool}</body>'
        "</worldbody></mujoco>"
    )


def pair(tool: Body, joint: str = FREE) -> tuple[mujoco.MjModel, list[Body]]:
    """Return a model and the bodies of a tool and a textured block."""
    block = Body("block", [Geom("box", (0.02, 0.02, 0.01))], WAVES, "triplanar")
    kinds = [
        f'<geom type="{g.kind}" size="{" ".join(map(repr, g.size))}" '
        f'pos="{" ".join(map(repr, g.position))}"/>'
        for g in (*tool.geoms, *block.geoms)
    ]
    text = xml_of("".join(kinds[:-1]), kinds[-1], joint)
    return mujoco.MjModel.from_xml_string(text), [block, tool]


def pose(place, turn: Rotation) -> np.ndarray:
    return np.concatenate([place, np.roll(turn.as_quat(), 1)])


BALL = Body("tool", [Geom("sphere", (2e-3,))])
SHAPES = {
    "ball": BALL,
    "two": Body(
        "tool", [Geom("sphere", (2e-3,), (-2e-3, 0, 0)), Geom("sphere", (2e-3,), (2e-3, 0, 0))]
    ),
    "box": Body("tool", [Geom("box", (2e-3, 2e-3, 2e-3))]),
}


def approach(steps: int = 12):
    """Yield places and rotations of a tool that is pressed onto the block and slides."""
    for i in range(steps):
        yield (
            np.array([3e-3 + 4e-5 * i, 1e-3, 1.95e-3 - 3e-6 * i]),
            Rotation.from_rotvec([0.02, 1e-3 * i, 0.3]),
        )


@pytest.mark.parametrize("shape", SHAPES)
def test_a_body_among_fixed_ones_is_the_special_case(shape):
    model, bodies = pair(SHAPES[shape], "")
    one, all_of_them = (
        ContactSolver(model, bodies, "tool", SETTINGS),
        MultibodySolver(model, bodies, SETTINGS),
    )
    at_rest = pose([0, 0, -0.01], Rotation.identity())
    for place, turn in approach():
        here = pose(place, turn)
        wanted = one.wrench(here, 1e-3)
        found = all_of_them.solve([at_rest, here], 1e-3)
        np.testing.assert_allclose(found[1], wanted, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found[0, :3], -wanted[:3], rtol=1e-9, atol=1e-12)
    assert wanted[2] > 0.01
    contact = all_of_them.pairs[0].contact
    np.testing.assert_allclose(contact.stiffness(), one.stiffness(), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_wrenches_turn_with_both_bodies_and_balance(shape):
    """Two bodies that move through space together, at any speed, feel what they feel at rest."""
    model, bodies = pair(SHAPES[shape])
    still, moving = (MultibodySolver(model, bodies, SETTINGS) for _ in range(2))
    centres = np.array([[1e-3, 0, 0], [0, 1e-3, 0]])
    block = pose([0, 0, -0.01], Rotation.identity())
    for i, (place, turn) in enumerate(approach()):
        wanted = still.solve([block, pose(place, turn)], 1e-3)
        whole, along = (
            Rotation.from_rotvec([0.3 * i, 1.0, -0.2 * i]),
            np.array([0.1 * i, 0.2, -0.3]),
        )
        places = [whole.apply([0, 0, -0.01]) + along, whole.apply(place) + along]
        turns = [whole, whole * turn]
        found = moving.solve([pose(p, t) for p, t in zip(places, turns, strict=True)], 1e-3)
        for body in range(2):
            both = np.concatenate([whole.apply(wanted[body, :3]), whole.apply(wanted[body, 3:])])
            np.testing.assert_allclose(found[body], both, rtol=1e-6, atol=1e-10)
        at = [p + t.apply(c) for p, t, c in zip(places, turns, centres, strict=True)]
        about = found[:, 3:] + np.cross(at, found[:, :3])
        np.testing.assert_allclose(found[:, :3].sum(axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose(about.sum(axis=0), 0.0, atol=1e-12)
    assert np.linalg.norm(wanted[1, :3]) > 0.01


def test_friction_belongs_to_the_relative_motion():
    """A block that is drawn along under a ball drags it as far as it moves."""
    model, bodies = pair(BALL)
    solver = MultibodySolver(model, bodies, SETTINGS)
    tool = pose([3e-3, 1e-3, 1.9e-3], Rotation.identity())
    drawn = []
    for i in range(5):
        block = pose([2e-6 * i, 0, -0.01], Rotation.identity())
        drawn.append(solver.solve([block, tool], 1e-3)[1].copy())
    smooth = MultibodySolver(model, bodies, ForceSettings(stiffness=400.0, tolerance=1e-9))
    without = smooth.solve([block, tool], 1e-3)[1]
    # Four steps of 2 um, held by a bristle of 400 N/m that leans along the slope.
    assert drawn[-1][0] - without[0] == pytest.approx(400.0 * 8e-6, rel=0.05)


def test_a_contact_that_was_left_begins_anew():
    model, bodies = pair(BALL)
    solver = MultibodySolver(model, bodies, SETTINGS)
    block = pose([0, 0, -0.01], Rotation.identity())
    first = solver.solve([block, pose([3e-3, 0, 1.9e-3], Rotation.identity())], 1e-3)[1].copy()
    assert not solver.solve([block, pose([3e-3, 0, 0.1], Rotation.identity())], 1e-3).any()
    assert solver.pairs[0].contact.contacts.count[0] == 0
    again = solver.solve([block, pose([3e-3, 0, 1.9e-3], Rotation.identity())], 1e-3)[1]
    np.testing.assert_array_equal(again, first)


def test_three_moving_bodies_in_a_pile():
    """A ball on a block on the ground: the block bears both."""
    ground = '<body name="ground" pos="0 0 -0.03"><geom type="box" size="0.1 0.1 0.01"/></body>'
    model, (block, ball) = pair(BALL)
    text = xml_of(
        '<geom type="sphere" size="0.002"/>', '<geom type="box" size="0.02 0.02 0.01"/>', FREE
    )
    model = mujoco.MjModel.from_xml_string(
        text.replace('<body name="block"', ground + '<body name="block"')
    )
    bodies = [block, ball, Body("ground", [Geom("box", (0.1, 0.1, 0.01))])]
    solver = MultibodySolver(model, bodies, SETTINGS)
    rest = Rotation.identity()
    wrenches = solver.solve(
        [pose([0, 0, -0.01 - 5e-5], rest), pose([0, 0, 1.9e-3], rest), pose([0, 0, -0.03], rest)],
        1e-3,
    )
    assert wrenches[1, 2] > 0.01
    assert wrenches[2, 2] < -0.01
    np.testing.assert_allclose(wrenches[:, :3].sum(axis=0), 0.0, atol=1e-12)
    assert wrenches[0, 2] == pytest.approx(-wrenches[1, 2] - wrenches[2, 2])


def test_a_mesh_that_moves_on_a_mesh():
    tool, block = thing("tool", ball_mesh(2e-3, 2)), thing("block", ball_mesh(8e-3, 3))
    model, bodies = model_of(tool, block, joint=FREE)
    still, moving = (MultibodySolver(model, bodies, SETTINGS) for _ in range(2))
    for i in range(6):
        turn, place = (
            Rotation.from_rotvec([0, 0.02 * i, 0]),
            np.array([1e-4, 2e-4, 9.9e-3 - 1e-5 * i]),
        )
        wanted = still.solve([pose([0, 0, 0], Rotation.identity()), pose(place, turn)], 1e-3)
        whole = Rotation.from_rotvec([0.1 * i, 0.2, 0])
        found = moving.solve([pose([0, 0, 0], whole), pose(whole.apply(place), whole * turn)], 1e-3)
        np.testing.assert_allclose(found[1, :3], whole.apply(wanted[1, :3]), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(found[0, :3], -found[1, :3], atol=1e-12)
    assert np.linalg.norm(found[1, :3]) > 1e-3


def test_pairs_that_share_the_memory_of_the_search_do_not_mix(monkeypatch):
    """Three balls of meshes: the same with memory of its own for each pair."""
    balls = [thing(name, ball_mesh(2e-3, 2)) for name in ("one", "two", "three")]
    model, bodies = model_of(*balls, joint=FREE)
    shared = MultibodySolver(model, bodies, SETTINGS)
    monkeypatch.setattr(multibody, "search_room", lambda *_: None)
    apart = MultibodySolver(model, bodies, SETTINGS)
    still = Rotation.identity()
    for i in range(5):
        places = {"one": [0, 0, 3.9e-3], "two": [1e-4, 2e-4, 1e-5 * i], "three": [3.9e-3, 1e-4, 0]}
        poses = [pose(np.asarray(places[body.name]), still) for body in bodies]
        found = shared.solve(poses, 1e-3)
        np.testing.assert_array_equal(found, apart.solve(poses, 1e-3))
    assert np.abs(found[:, :3]).max(axis=1).min() > 1e-3
    rooms = {id(pair.contact._mesh.space) for pair in shared.pairs}
    assert len(rooms) == 1 < len({id(pair.contact._mesh.space) for pair in apart.pairs})


def test_poses_that_cannot_be_are_refused():
    model, bodies = pair(BALL)
    solver = MultibodySolver(model, bodies, SETTINGS)
    with pytest.raises(AsperityError, match="2 rows of 7"):
        solver.solve(np.zeros(7), 1e-3)
    with pytest.raises(AsperityError, match="not all 0"):
        solver.solve(np.zeros((2, 7)), 1e-3)
    two = '<body name="foot" pos="0 0 -0.02"><geom type="box" size="0.01 0.01 0.002"/></body>'
    text = xml_of(
        '<geom type="sphere" size="0.002"/>', '<geom type="box" size="0.02 0.02 0.01"/>' + two, FREE
    )
    foot = Body("foot", [Geom("box", (0.01, 0.01, 0.002))])
    solver = MultibodySolver(mujoco.MjModel.from_xml_string(text), [*bodies, foot], SETTINGS)
    rest = Rotation.identity()
    poses = [pose([0, 0, -0.01], rest), pose([0, 0, 0.1], rest), pose([0, 0, -0.03], rest)]
    solver.solve(poses, 1e-3)
    poses[2][0] += 1e-4
    with pytest.raises(AsperityError, match=r"foot.*block.*fixed"):
        solver.solve(poses, 1e-3)
    still, fixed = pair(BALL, "")
    with pytest.raises(AsperityError, match="no body"):
        MultibodySolver(still, fixed[:1], SETTINGS)
