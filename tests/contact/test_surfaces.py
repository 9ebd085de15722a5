"""Bodies with several surfaces: texture, friction and stiffness of each geom."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity import AsperityError, Body, ContactSolver, Geom, Scene, Simulation
from asperity.scene.scene import read_scene, scene_of
from contact.naive_meshes import ball_mesh, engine_of, thing

K = 400.0
TWO = (
    '<body name="plate"><geom name="left" type="box" size="0.02 0.02 0.005" pos="-0.02 0 -0.005"/>'
    '<geom name="right" type="box" size="0.02 0.02 0.005" pos="0.02 0 -0.005"/></body>'
)
BALL = '<geom type="sphere" size="0.002"/>'
WAVES = {"kind": "sinusoid", "wavelength": 1.5e-3, "amplitude": 3e-5}
DOTS = {"kind": "sinusoid", "wavelength": 0.9e-3, "amplitude": 2e-5, "direction": 1.0}

BOTH = {"plate": {"geoms": {"left": {"texture": WAVES}, "right": {"texture": DOTS}}}}


def scene(bodies: str, tables: dict, tool: str = BALL, **force) -> Scene:
    xml = (
        f'<mujoco><worldbody>{bodies}<body name="tool" pos="0 0 0.05"><freejoint/>{tool}</body>'
        "</worldbody></mujoco>"
    )
    force = {"stiffness": K, "tolerance": 1e-9, **force}
    document = {"schema": 1, "tool": {"body": "tool"}, "force": force, "bodies": tables}
    return scene_of(xml, document)


def solver(*args, **kw) -> ContactSolver:
    made = scene(*args, **kw)
    return ContactSolver(made.model, made.bodies, "tool", made.force)


def at(x: float, y: float = 3e-4, depth: float = 5e-5) -> np.ndarray:
    return np.array([x, y, 2e-3 - depth, 1.0, 0, 0, 0])


def test_each_geom_has_its_texture():
    both = solver(TWO, BOTH)
    one, other = (solver(TWO, {"plate": {"texture": texture}}) for texture in (WAVES, DOTS))
    for x in np.linspace(5e-3, 7e-3, 9):
        for engine, sign in ((one, -1), (other, 1)):
            both.reset()
            engine.reset()
            found, wanted = both.wrench(at(sign * x), 0.0), engine.wrench(at(sign * x), 0.0)
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-13)
            assert both.contacts.status[0] == 0


def test_a_geom_without_its_own_has_the_bodys_surface():
    mixed = solver(TWO, {"plate": {"texture": WAVES, "geoms": {"right": {}}}})
    rough = solver(TWO, {"plate": {"texture": WAVES}})
    np.testing.assert_allclose(mixed.wrench(at(-6e-3), 0.0), rough.wrench(at(-6e-3), 0.0))
    flat = mixed.wrench(at(6e-3), 0.0)
    assert flat[:3] == pytest.approx([0.0, 0.0, K * 5e-5], abs=1e-12)


def test_the_seam_between_two_textures_is_a_step_and_no_more():
    """A tool that slides over it feels at most what either side or both give, and is pushed up."""
    both = solver(TWO, BOTH)
    for x in np.linspace(-4e-4, 4e-4, 41):
        both.reset()
        wrench = both.wrench(at(x, depth=1e-4), 0.0)
        assert 0.0 < wrench[2] < 1.1 * K * 1.6e-4
        assert np.hypot(wrench[0], wrench[1]) < 0.5 * wrench[2]


def test_the_gradient_of_a_seam_is_exact():
    both = solver(
        TWO,
        {"plate": {"geoms": {
            "left": {"texture": WAVES, "stiffness": 900.0},
            "right": {"texture": DOTS, "stiffness": 250.0},
        }}},
    )  # fmt: skip

    def energy(x: float) -> float:
        both.reset()
        both.wrench(at(x, depth=1e-4), 0.0)
        return 0.5 * K * both._memory.state["way_out"][0] ** 2

    for x in (-3e-4, -5e-5, 4e-5, 2.3e-4):
        both.reset()
        force = both.wrench(at(x, depth=1e-4), 0.0)[0]
        slope = (energy(x + 1e-8) - energy(x - 1e-8)) / 2e-8
        assert force == pytest.approx(-slope, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(
    ("plate", "tool", "wanted"), [(1000.0, None, 1000.0), (1000.0, 3000.0, 750.0), (None, None, K)]
)
def test_stiffness_of_two_surfaces(plate, tool, wanted):
    tables = {"plate": {} if plate is None else {"stiffness": plate}}
    if tool is not None:
        tables["tool"] = {"stiffness": tool}
    engine = solver(TWO, tables)
    assert engine.wrench(at(6e-3), 0.0)[2] == pytest.approx(wanted * 5e-5)
    assert engine.stiffness()[2, 2] == pytest.approx(wanted)
    contacts = engine.contacts
    assert K * contacts.weight[0] * contacts.depth[0] == pytest.approx(wanted * 5e-5)


@pytest.mark.parametrize(
    ("plate", "tool", "wanted"), [(0.5, None, 0.5), (0.2, 0.6, 0.6), (None, None, 0.1)]
)
def test_friction_of_two_surfaces(plate, tool, wanted):
    tables = {"plate": {"geoms": {"right": {} if plate is None else {"friction": plate}}}}
    if tool is not None:
        tables["tool"] = {"friction": tool}
    simulation = Simulation(scene(TWO, tables, friction=0.1))
    for i in range(60):
        wrench = simulation.step(at(6e-3 + 1e-5 * i))
    assert -wrench[0] == pytest.approx(wanted * wrench[2], rel=1e-6)


def test_friction_of_geoms_is_advanced_in_the_order_of_time():
    """Within a tick of averaging, too: as a friction of the whole scene is."""
    steps = {"kind": "stripes", "pitch": 1e-3, "width": 5e-4, "depth": 1e-4, "fillet": 4e-5}
    everywhere = {"plate": {"texture": steps}}
    geoms = {name: {"texture": steps, "friction": 0.3} for name in ("left", "right")}
    runs = []
    for tables, friction in ((everywhere, 0.3), ({"plate": {"geoms": geoms}}, 0.0)):
        simulation = Simulation(scene(TWO, tables, friction=friction, anti_alias="tick"))
        runs.append([simulation.step(at(2e-3 + 2e-4 * i)).copy() for i in range(40)])
    np.testing.assert_allclose(runs[1], runs[0], rtol=1e-9, atol=1e-12)


def test_a_mesh_has_friction_and_stiffness_too():
    plate = Body("plate", [Geom("box", (0.02, 0.02, 0.005), (0, 0, -0.005))], stiffness=1200.0)
    ball = thing("tool", ball_mesh(2e-3, 3), friction=0.4)
    engine = engine_of(ball, plate, stiffness=K, bristle_stiffness=1e5)
    for i in range(60):
        wrench = engine.wrench(at(6e-3 + 1e-5 * i), 1e-3)
    depths = engine.contacts.weight[: engine.contacts.count[0]].sum()
    assert depths == pytest.approx(3.0)
    assert wrench[2] == pytest.approx(1200.0 * engine.contacts.depth[0], rel=1e-3)
    assert -wrench[0] == pytest.approx(0.4 * wrench[2], rel=1e-3)


def test_surfaces_of_a_scene_are_saved_and_smoothed(tmp_path: Path):
    np.save(tmp_path / "map.npy", np.outer(np.hanning(8), np.hanning(8)) * 1e-5)
    texture = {"file": str(tmp_path / "map.npy"), "pixel_size": 1e-4}
    made = scene(TWO, {"plate": {"geoms": {"left": {"texture": texture, "friction": 0.3}}}})
    made.save(tmp_path / "out")
    again = read_scene(tmp_path / "out")
    left, right = again.bodies[0].surfaces
    assert left.friction == 0.3
    assert left.texture.highest == pytest.approx(made.bodies[0].surfaces[0].texture.highest)
    assert right.texture is None
    assert again.smooth().bodies[0].surfaces[0].texture is None
    assert again.smooth().bodies[0].surfaces[0].friction == 0.3
    assert again.shortest_wavelength < 1.0


@pytest.mark.parametrize(
    ("tables", "words"),
    [({"geoms": {"middle": {}}}, ["bodies.plate.geoms", "'middle'", "left, right"]),
     ({"geoms": {"left": {"colour": 1}}}, ["bodies.plate.geoms.left.colour", "texture, friction"]),
     ({"geoms": {"left": {"friction": -1}}}, ["bodies.plate.geoms.left", "friction", "0"]),
     ({"stiffness": 0.0}, ["bodies.plate", "stiffness"]),
     ({"friction": "high"}, ["bodies.plate", "friction", "number"])],
)  # fmt: skip
def test_surfaces_that_cannot_be(tables, words):
    with pytest.raises(AsperityError) as caught:
        scene(TWO, {"plate": tables})
    for word in words:
        assert word in str(caught.value)
