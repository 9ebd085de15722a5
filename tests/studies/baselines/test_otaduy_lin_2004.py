"""The algorithm of Otaduy & Lin (2004) as published: projections, differences, closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flat_foot import PLACES, at_place, centre_of_pressure, foot_on_smooth_plate
from scipy.optimize import minimize_scalar

from asperity._core.kernels import kernel
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom, covers
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.poses import rotation_of
from asperity.scene.builtin import load_scene
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.otaduy_lin_2004 import PublishedMethod
from asperity.studies.baselines.projection import View, project, shapes_of
from asperity.studies.comparison import stimuli
from asperity.texture.height_field import HeightField

RADIUS = 1.5e-3


def test_force_and_torque_go_to_the_closed_form_as_grid_and_step_are_refined():
    scene = stimuli.ball_on_plate(2.0 * RADIUS)
    poses = stimuli.straight_path(scene, 0.35)
    # Beside the middles of the troughs, where the ball touches two crests.
    poses[:, :3] += [1.0e-4, 0.0, -3.5e-4]
    exact = np.array([wave_force(pose[0], pose[2]) for pose in poses])
    errors = []
    for cells, step in ((50, 2e-5), (400, 2e-5)):
        renderer = PublishedMethod(cells=cells, step=step).prepare(scene)
        felt = [renderer.wrench(pose) for pose in poses]
        force = np.array([one.force for one in felt])
        size = np.linalg.norm(exact, axis=1)
        errors.append(np.linalg.norm(force[:, [0, 2]] - exact, axis=1) / size)
        assert np.abs(force[:, 1]).max() < 1e-3 * size.max()
        # On a smooth ball the force goes through its centre, where the centre of mass is.
        torque = np.array([one.torque for one in felt])
        assert np.abs(torque).max() < 0.05 * RADIUS * size.max()
        assert renderer.evaluations == 11 * len(poses)
        assert {one.contacts for one in felt} == {1}
    assert errors[0].max() < 0.03
    assert errors[1].max() < 1e-3


def wave_force(x, z):
    """Return F_x and F_z [N] of a ball at (x, z) on the waves, from the offset of their curve."""
    number = 2.0 * math.pi / stimuli.WAVELENGTH

    def lack(u):
        below = z - math.sqrt(RADIUS**2 - (u - x) ** 2)
        return below - stimuli.AMPLITUDE * math.cos(number * u)

    # Of equally spaced starts the best, so that no crest is missed.
    starts = x + np.linspace(-0.6, 0.6, 241) * RADIUS
    near = starts[np.argmin([lack(u) for u in starts])]
    found = minimize_scalar(
        lack, bounds=(near - 2e-5, near + 2e-5), method="bounded", options={"xatol": 1e-13}
    )
    slope = -stimuli.AMPLITUDE * number * math.sin(number * found.x)
    return stimuli.STIFFNESS * -found.fun * np.array([-slope, 1.0])


@pytest.mark.parametrize("boxes", [1, 4, 16, 64])
def test_a_flat_foot_on_a_smooth_plate_is_felt_under_its_middle(boxes):
    scene = foot_on_smooth_plate(boxes)
    renderer = METHODS["otaduy-lin-2004"].prepare(scene)
    assert renderer.wrench(scene.start).contacts == 0
    for depth, (x, y) in zip((1e-4, 3e-4, 2e-4), PLACES, strict=True):
        felt = renderer.wrench(at_place(scene, x, y, depth))
        np.testing.assert_allclose(felt.force, [0, 0, scene.force.stiffness * depth], atol=1e-6)
        assert np.abs(centre_of_pressure(felt)).max() < 5e-5


def test_a_tilted_probe_feels_asperitys_force_and_torque():
    scene = load_scene("probe-plate")
    own, theirs = METHODS["asperity"].prepare(scene), PublishedMethod(cells=600).prepare(scene)
    rng = np.random.default_rng(4)
    for _ in range(5):
        pose = scene.start.copy()
        pose[:3] += [rng.uniform(0, 0.02), rng.uniform(-2e-3, 2e-3), -3e-4]
        pose[3:] += [0.0, *rng.uniform(-0.03, 0.03, 3)]
        pose[3:] /= np.linalg.norm(pose[3:])
        a, b = own.wrench(pose), theirs.wrench(pose)
        assert b.depth == pytest.approx(a.depth, abs=2e-7)
        np.testing.assert_allclose(b.force, a.force, atol=5e-3 * np.linalg.norm(a.force))
        np.testing.assert_allclose(b.torque, a.torque, atol=5e-3 * np.linalg.norm(a.torque))


@pytest.mark.parametrize("name", ["hammer-blocks", "file-cad"])
def test_the_meshes_of_the_papers_scenes_push_the_tool_out(name):
    scene = load_scene(name)
    renderer = METHODS["otaduy-lin-2004"].prepare(scene)
    pose = scene.start.copy()
    if name == "file-cad":
        pose[0] += 0.02
    for _ in range(40):
        felt = renderer.wrench(pose)
        if felt.contacts:
            break
        pose[2] -= 1e-4
    assert felt.contacts
    deep = pose.copy()
    deep[2] -= 3e-4
    more = renderer.wrench(deep)
    assert more.depth - felt.depth == pytest.approx(3e-4, rel=0.3)
    assert more.force[2] > 0.9 * np.linalg.norm(more.force)


@kernel
def projected(shapes, frames, view, out):
    """Fill the smooth and the textured heights (2, cells, cells) of bodies in a view."""
    project(shapes, frames, view, out[0], out[1])


def seen(body, turn, at=(0.0, 0.0, 0.0), cells=48, half=4e-3):
    """Return smooth and textured heights, and x, y, of a body with an orientation."""
    out = np.empty((2, cells, cells))
    frame = np.column_stack([turn, at])[None]
    projected(shapes_of([body]), frame, View(half, cells, math.inf), out)
    at_sample = (np.arange(cells) + 0.5) * (2.0 * half / cells) - half
    return out, *np.meshgrid(at_sample, at_sample, indexing="ij")


def any_turn(seed):
    quaternion = np.random.default_rng(seed).normal(size=4)
    return rotation_of(quaternion / np.linalg.norm(quaternion))


@pytest.mark.parametrize("kind", ["sphere", "capsule", "ellipsoid", "cylinder", "box"])
def test_a_ray_meets_a_solid_where_its_surface_begins(kind):
    sizes = {"sphere": [2e-3], "capsule": [1e-3, 1.5e-3], "cylinder": [1.2e-3, 1.5e-3]}
    geom = Geom(
        kind, sizes.get(kind, [1e-3, 2e-3, 1.5e-3]), position=[3e-4, -2e-4, 1e-4],
        quaternion=[0.5, 0.5, -0.5, 0.5],
    )  # fmt: skip
    for seed in range(4):
        turn = any_turn(seed)
        (smooth, _), x, y = seen(Body("b", [geom]), turn)
        hit = np.isfinite(smooth)
        assert 100 < hit.sum() < hit.size
        for above, inside in ((1e-8, False), (-1e-8, True)):
            place = np.stack([x, y, smooth + above], axis=-1)[hit] @ turn
            assert (covers(geom, place) == inside).mean() > 0.99
        # And nowhere above: not from a sample whose ray misses either.
        for z in np.linspace(-4e-3, 4e-3, 33):
            level = np.where(hit, np.maximum(smooth + 1e-8, z), z)
            assert not covers(geom, np.stack([x, y, level], axis=-1) @ turn).any()


@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
def test_a_mesh_is_seen_as_the_solid_of_its_shape(mapping):
    rng = np.random.default_rng(1)
    texture = HeightField(rng.normal(scale=2e-5, size=(16, 16)), (2e-4, 2e-4), "wrap")
    half = np.array([1.5e-3, 2e-3, 1e-3])
    box = Body("box", [Geom("box", half)], texture, mapping)
    corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(q[0], q[i], q[i + 1]) for q in quads for i in (1, 2)]
    mesh = Body(
        "mesh", [Geom("mesh", half)], texture, mapping, mesh=mesh_from_arrays(corners, faces)
    )
    for seed in range(3):
        turn = any_turn(seed + 10)
        (smooth, rough), _, _ = seen(box, turn, (2e-4, -1e-4, 3e-4))
        (also_smooth, also_rough), _, _ = seen(mesh, turn, (2e-4, -1e-4, 3e-4))
        both = np.isfinite(smooth)
        np.testing.assert_array_equal(both, np.isfinite(also_smooth))
        np.testing.assert_allclose(smooth[both], also_smooth[both], atol=1e-12)
        assert np.std(rough[both] - smooth[both]) > 5e-6
        # Rays through an edge may take either face.
        assert (np.abs(rough[both] - also_rough[both]) < 1e-12).mean() > 0.995


def test_parameters_out_of_range_are_refused():
    with pytest.raises(AsperityError, match="cells must lie between 4 and 1000, got 2"):
        PublishedMethod(cells=2)
    with pytest.raises(AsperityError, match="step"):
        PublishedMethod(step=0.0)
