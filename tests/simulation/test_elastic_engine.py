"""An elastic body under a rigid tool: in simulations, on couplings, in recordings."""

import numpy as np
import pytest

from asperity.contact.deformable.elastic_body import elastic_body
from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.geometry.poses import rotated
from asperity.runs.recording import read_recording
from asperity.runs.run_scene import run_scene, take_pictures
from asperity.runs.skin_fields import read_fields
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation
from asperity.simulation.soft_engine import soft_engine
from asperity.simulation.tool_contact import NOT_CERTIFIED


def block(coupling="implicit", seconds=0.1, **elastic):
    """Return the built-in block, coarse, with some keys changed."""
    table = {"spacing": 7e-3, "modes": 12, "pitch": 1e-3} | elastic
    return load_scene("elastic-block").changed(
        bodies={"block": {"elastic": table}}, coupling={"mode": coupling},
        trajectory={"seconds": seconds},
    )  # fmt: skip


def poses(scene, count, depth=1.5e-3, way=5e-5):
    """Return poses that go along, turned a little, at a depth below the first touch."""
    pose = rotated(scene.start, (0.02, -0.03, 0.05))
    for i in range(count):
        moved = pose.copy()
        moved[:3] += (i * way, 0.0, -depth)
        yield moved


def test_the_wrench_is_that_of_the_library_with_the_same_parameters():
    scene = block(friction=0.4)
    solid, (tool,) = scene.elastic, [b for b in scene.bodies if b.name == scene.tool]
    mesh, nodes, cells = solid.divided
    body = elastic_body(
        mesh, nodes, cells, modulus=7e4, poisson=0.45, density=1070.0, modes=12, held=solid.held
    )
    surface = DeformableSurface(
        mesh, thickness=2e-3, modulus=7e4, poisson=0.45, pitch=1e-3, friction=0.4,
        texture=solid.body.texture, mapping="triplanar", offset=solid.body.offset,
    )  # fmt: skip
    centre = scene.model.body(scene.tool).ipos
    contact = ElasticContact(body, surface, [tool], damping=0.1, centres=[centre], leap=0.01)
    engine = soft_engine(scene)
    home = np.array([0.0, 0.0, -0.007, 0.0, 0.0, 0.0, 0.0])  # where the block is
    for i, pose in enumerate(poses(scene, 20)):
        found = engine.wrench(pose, 1e-3)
        local = pose - home
        wanted = (contact.step([local], 1e-3) if i else contact.settle([local]))[0]
        np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert found[2] > 0.2
    assert found[0] < -0.05


def test_a_turned_body_gives_the_same_wrench_turned():
    """The engine's frames: the whole scene turned by a quarter about z, and moved."""
    scene = block(friction=0.0)
    xml = scene.xml.replace(
        '<body name="block" pos="0 0 -0.007">',
        '<body name="block" pos="0.1 0.2 0.3" quat="0.70710678118654757 0 0 0.70710678118654757">',
    )
    assert xml != scene.xml
    from asperity.scene.scene import scene_of

    other = scene_of(xml, scene.document)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    one, two = soft_engine(scene), soft_engine(other)
    for pose in poses(scene, 3, way=1e-3):
        turned = rotated(pose, (0.0, 0.0, 0.5 * np.pi))
        turned[:3] = quarter @ (pose[:3] - [0.0, 0.0, -0.007]) + [0.1, 0.2, 0.3]
        found, wanted = two.wrench(turned, 0.0), one.wrench(pose, 0.0)
        np.testing.assert_allclose(found[:3], quarter @ wanted[:3], atol=1e-9)
        np.testing.assert_allclose(found[3:], quarter @ wanted[3:], atol=1e-10)
        both = np.kron(np.eye(2), quarter)
        np.testing.assert_allclose(
            two.stiffness(), both @ one.stiffness() @ both.T, atol=1e-5 * one.stiffness()[2, 2]
        )
        np.testing.assert_allclose(
            two.contacts.point[0] - [0.1, 0.2, 0.3],
            quarter @ (one.contacts.point[0] - [0.0, 0.0, -0.007]), atol=1e-9,
        )  # fmt: skip


def test_a_stiff_body_tends_to_its_layer_on_a_rigid_surface():
    layer = {"layer_modulus": 7e4, "friction": 0.0}
    scene = block(**layer)
    (tool,) = [b for b in scene.bodies if b.name == scene.tool]
    (pose,) = poses(scene, 1, depth=5e-4)
    local = pose - [0.0, 0.0, -0.007, 0.0, 0.0, 0.0, 0.0]
    rigid = SurfaceContact(scene.elastic.surface, [tool])
    rigid.press(scene.elastic.divided[0].vertices, [local])
    force, errors = rigid.wrenches[0, :3], []
    for modulus in (1e8, 1e10, 1e12):
        found = soft_engine(block(modulus=modulus, **layer)).wrench(pose, 0.0)[:3]
        errors.append(np.abs(found - force).max() / force[2])
    assert errors[0] < 1e-2
    np.testing.assert_allclose(errors[1:], [errors[0] / 1e2, errors[0] / 1e4], rtol=0.1)


def test_it_presses_as_asked_and_is_held_back():
    scene = block()
    rollout = Simulation(scene).rollout()
    late = rollout.contact_wrench[20:]
    assert late[:, 2].mean() == pytest.approx(0.8, abs=0.1)
    assert -0.6 < late[-1, 0] < -0.1
    assert (rollout.contact_count == 1).all()
    assert not (rollout.flags & NOT_CERTIFIED).any()
    # The coupling does not shake: no tick is far from the last.
    assert np.abs(np.diff(late[:, 2])).max() < 0.05


@pytest.mark.parametrize("coupling", ["direct", "semi-implicit", "static"])
def test_other_couplings_hold_it(coupling):
    simulation = Simulation(block(coupling, seconds=0.06))
    rollout = simulation.rollout()
    assert rollout.contact_wrench[:, 2].mean() == pytest.approx(0.8, abs=0.15)
    assert simulation.tool.resets == 0


def test_reset_puts_it_to_rest():
    simulation = Simulation(block(seconds=0.03))
    first = simulation.rollout()
    again = simulation.rollout()
    np.testing.assert_array_equal(again.contact_wrench, first.contact_wrench)
    engine = simulation.stage.engine
    engine.reset()
    assert not engine.displacements.any()
    assert engine.energy == 0.0
    assert engine.contacts.count[0] == 0
    away = simulation.scene.start.copy()
    away[2] += 0.02
    assert not engine.wrench(away, 1e-3).any()
    assert not engine.stiffness().any()


def test_a_tool_that_is_placed_deep_inside_is_pushed_out():
    """From no contact at once to where the body could not be: no error, and a force outwards."""
    engine = soft_engine(block())
    pose = load_scene("elastic-block").start.copy()
    engine.wrench(pose, 1e-3)
    pose[2] -= 0.009
    for dt in (1e-3, 1e-3, 0.0):
        assert engine.wrench(pose, dt)[2] > 1.0
        assert engine.contacts.status[0] == 1
    pose[2] += 0.0085
    assert 0.0 < engine.wrench(pose, 1e-3)[2] < 1.0
    assert engine.contacts.status[0] == 0


def test_it_swings_on_after_the_tool_has_left():
    scene = block(damping=0.02, friction=0.0)
    engine = soft_engine(scene)
    (pose,) = poses(scene, 1)
    engine.wrench(pose, 1e-3)
    stored = engine.energy
    pose[2] += 0.02
    sunk = []
    for _ in range(40):
        assert not engine.wrench(pose, 1e-3).any()
        sunk.append(engine.displacements[:, 2].min())
    assert 0.0 < engine.energy < stored
    assert np.ptp(sunk[20:]) > 1e-6


def test_pressed_harder_than_it_can_bear_the_force_goes_on():
    """Beyond what is linear the layer alone yields; such contacts are not certified."""
    scene = block("direct", friction=0.0)
    simulation = Simulation(scene)
    pose, forces, certified, moved = scene.start.copy(), [], [], []
    down = np.linspace(1e-3, -13e-3, 280)
    for height in np.concatenate([down, down[::-1]]):
        pose[2] = scene.start[2] + height
        simulation.step(pose)
        forces.append(simulation.contact_wrench[2])
        certified.append(not simulation.flags & NOT_CERTIFIED)
        moved.append(simulation.stage.displacements.copy())
    forces, certified = np.array(forces), np.array(certified)
    assert np.isfinite(forces).all()
    assert not certified.all()
    assert certified[:60].all()
    assert certified[-60:].all()
    # It never lets go under a tool that presses, and does not leap when it stops.
    stopped = np.flatnonzero(~certified)
    before = forces[stopped[0] - 1]
    assert (forces[stopped] > 0.9 * before).all()
    assert forces[stopped[0]] < 1.1 * before
    assert (np.diff(forces[stopped[0] :][:40]) > 0.0).all()
    for now in stopped:
        assert np.abs(moved[now]).max() == pytest.approx(7e-3, rel=1e-9)
    assert forces[-1] == 0.0


def test_runs_are_recorded_with_fields_and_drawn_bent(tmp_path):
    scene = block(seconds=0.06, friction=0.3)
    run = run_scene(scene, tmp_path / "recording.h5", field_rate=100.0)
    assert len(read_recording(tmp_path / "recording.h5").time) == len(run.rollout.time)
    fields = read_fields(tmp_path)
    np.testing.assert_allclose(fields.time, run.rollout.time[::10])
    rows, columns = fields.pressure.shape[1:]
    assert fields.shear.shape == (len(fields.time), rows, columns, 2)
    last = 0.021 - 0.021 / columns
    assert fields.column[[0, -1]] == pytest.approx([-last, last])
    cell = 42e-3 * 28e-3 / (rows * columns)
    force = fields.pressure.sum(axis=(1, 2)) * cell
    np.testing.assert_allclose(force, run.rollout.contact_wrench[::10, 2], rtol=0.2)
    # What holds the tool back pulls the surface along.
    pulled = fields.shear[-1].sum(axis=(0, 1)) * cell
    assert pulled[0] == pytest.approx(-run.rollout.contact_wrench[-1, 0], abs=0.15)
    # The picture is drawn with the body as it was: the tool has sunk in.
    assert run.moment.bent[:, 2].min() < -5e-4
    close, _ = take_pictures(run, scene, rows=60)
    from dataclasses import replace

    flat, _ = take_pictures(replace(run, moment=replace(run.moment, bent=None)), scene, rows=60)
    assert np.abs(close.image - flat.image).max() > 0.1


def test_the_fields_are_those_of_the_taxels_on_top():
    scene = block(friction=0.0)
    engine = soft_engine(scene)
    (pose,) = poses(scene, 1)
    engine.wrench(pose, 0.0)
    contact, grid = engine.elastic.surface, engine.grid
    surface, pressure = contact.surface, engine.skin.pressure
    cell = 42e-3 * 28e-3 / pressure.size
    total = (contact.pressure * surface.taxel_area).sum()
    assert pressure.sum() * cell == pytest.approx(total, rel=0.03)
    assert 0.5 * contact.pressure.max() < pressure.max() <= contact.pressure.max()
    # Each place lies in its taxel: the middle of that is at most one edge away.
    assert (grid.taxel >= 0).all()
    faces = np.repeat(np.arange(len(surface.mesh.faces)), np.diff(surface.arrays.first))
    corners = surface.mesh.vertices[surface.mesh.faces[faces[grid.taxel]]]
    place = np.einsum("rcijk,rcijkl->rcijl", surface.arrays.weight[grid.taxel], corners)
    rows, columns = grid.taxels
    x = -0.021 + (np.arange(4 * columns) + 0.5) * 0.0105 / columns
    y = -0.014 + (np.arange(4 * rows) + 0.5) * 0.007 / rows
    away = np.hypot(
        place[..., 0] - x.reshape(1, columns, 1, 4), place[..., 1] - y.reshape(rows, 1, 4, 1)
    )
    assert away.max() < 1.1e-3
    np.testing.assert_allclose(place[..., 2], 0.007, atol=1e-12)


def test_a_run_that_presses_too_hard_has_a_note():
    scene = block(seconds=0.05, modulus=2e4).changed(trajectory={"press_force": 1.0})
    notes = run_scene(scene, None).summary["notes"]
    assert any("of its smallest side: beyond some 20 %" in note for note in notes)
    deeper = block(seconds=0.05, modulus=2e4).changed(trajectory={"press_depth": 8e-3})
    notes = run_scene(deeper, None).summary["notes"]
    assert any("ticks the elastic body was held at its largest" in note for note in notes)
    assert not any("max_nodes" in note for note in notes)
    fine = run_scene(block(seconds=0.05), None).summary["notes"]
    assert not any("smallest side" in note for note in fine)


@pytest.mark.slow
def test_the_block_as_it_is_built_in_keeps_to_its_tick():
    """A quiet core is not at hand: the fastest of several runs of each tick is taken."""
    simulation = Simulation(load_scene("elastic-block"))
    path = simulation.trajectory().poses[:400]
    from time import perf_counter

    best = np.full(len(path), np.inf)
    for _ in range(6):
        simulation.reset()
        for i, pose in enumerate(path):
            begun = perf_counter()
            simulation.step(pose)
            best[i] = min(best[i], perf_counter() - begun)
    assert np.percentile(best[1:], 99) < 1e-3
