"""Contact levels of detail: when a contact is coarsened, and what is felt then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.scene.builtin import load_scene
from asperity.scene.scene import scene_of
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.contact_levels import CONTACT_LEVELS, LevelsMethod, Metrics
from asperity.studies.comparison import stimuli

WAVES = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4}
FULL = LevelsMethod(metrics=Metrics(tolerance=0.0, gap_time=0.0))
STILL = LevelsMethod(metrics=Metrics(gap_time=0.0))


def slid(renderer, scene, height, speed=0.083):
    """Return forces (n, 3), and the levels and areas of the body's contacts, along the path."""
    poses = stimuli.straight_path(scene, speed)
    poses[:, 2] += height
    forces, levels, areas = [], [], []
    renderer.reset()
    for pose in poses:
        forces.append(renderer.wrench(pose).force)
        levels += [contact.levels[1] for contact in renderer.contacts]
        areas += [contact.area for contact in renderer.contacts]
    return np.array(forces), np.array(levels), np.array(areas)


def pad_on_plate(side, textured=True):
    """Return a flat square pad with the plate's waves on a plate that is 6 mm longer."""
    half = 0.5 * side
    xml = f"""<mujoco model="pad"><worldbody>
      <body name="plate" pos="0 0 -0.001">
        <geom type="box" size="{half + 3e-3} {half + 1e-3} 0.001"/></body>
      <body name="probe" pos="0 0 0.001"><freejoint name="hand"/>
        <geom type="box" size="{half} {half} 0.001" mass="0.01"/></body>
    </worldbody></mujoco>"""
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {"plate": {"texture": WAVES}} | ({"probe": {"texture": WAVES}} if textured else {}),
        "force": {"stiffness": 4000.0},
        "trajectory": {"kind": "slide"},
    }
    return scene_of(xml, document, name="pad")


def test_a_wider_contact_is_taken_coarser_and_loses_its_texture():
    taken, changes = [], []
    for side in (0.8e-3, 3e-3, 12e-3):
        scene = pad_on_plate(side)
        forces, levels, areas = slid(STILL.prepare(scene), scene, -0.1e-3)
        taken.append(levels.mean())
        full, _, _ = slid(FULL.prepare(scene), scene, -0.1e-3)
        changes.append(forces[:, 2].std() / full[:, 2].std())
        print(side, levels.min(), levels.max(), areas.mean(), forces.std(0), full.std(0))
    assert np.all(np.diff(taken) > 0)
    assert changes[0] > 0.9
    assert changes[-1] < 0.1


def test_a_faster_contact_is_taken_coarser():
    scene = stimuli.ball_on_plate()
    renderer = CONTACT_LEVELS.prepare(scene)
    taken = [slid(renderer, scene, -3e-4, speed)[1][1:].mean() for speed in (0.05, 0.2, 0.8, 3.0)]
    print(taken)


def test_a_small_ball_feels_full_detail():
    for d in (.5e-3, 1e-3):
        scene = stimuli.ball_on_plate(d)
        a, lv, _ = slid(STILL.prepare(scene), scene, -3e-4)
        b, _, _ = slid(FULL.prepare(scene), scene, -3e-4)
        print(d, lv.mean(), a.std(0), b.std(0), np.abs(a-b).max(), np.sqrt(((a-b)**2).sum(1).mean())/np.sqrt((b**2).sum(1).mean()))


@pytest.mark.parametrize("tool", ["ball", "foot"])
def test_without_tolerance_it_is_full_detail(tool):
    scene = stimuli.ball_on_plate() if tool == "ball" else stimuli.foot_on_plate()
    exact = METHODS["asperity"].prepare(scene)
    fm = METHODS["full-meshes"].prepare(scene)
    poses = stimuli.straight_path(scene, .083); poses[:, 2] -= 2e-4
    e = [exact.wrench(p) for p in poses]; g = [fm.wrench(p) for p in poses]
    for tol in (1e-4, 1e-5, 1e-6, 1e-7, 0):
        r = LevelsMethod(metrics=Metrics(tolerance=tol, gap_time=0.0)).prepare(scene)
        w = [r.wrench(p) for p in poses]
        d = np.array([x.depth for x in w]); f = np.array([x.force for x in w]); fe = np.array([x.force for x in e]); fg=np.array([x.force for x in g])
        print(tool, tol, "depth um", 1e6*np.abs(d - [x.depth for x in e]).max(), 1e6*np.abs(d - [x.depth for x in g]).max(), "force", np.sqrt(((f-fe)**2).sum(1).mean())/np.sqrt((fe**2).sum(1).mean()), np.sqrt(((f-fg)**2).sum(1).mean())/np.sqrt((fg**2).sum(1).mean()))


def meshed_plate(scene, cells):
    n = cells + 1
    x, y = np.meshgrid(np.linspace(-6e-3, 6e-3, n), np.linspace(-3e-3, 3e-3, n), indexing="ij")
    top = np.stack([x, y, np.full_like(x, 1e-3)], -1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    ring = np.concatenate([at[:-1, 0], at[-1, :-1], at[:0:-1, -1], at[0, :0:-1]])
    low = len(top)
    points = np.concatenate([top, top * [1, 1, -1]])
    nxt = np.roll(ring, -1)
    sides = np.concatenate([np.stack([ring, ring + low, nxt + low], 1), np.stack([ring, nxt + low, nxt], 1)])
    mesh = mesh_from_arrays(points, np.concatenate([faces, faces[:, ::-1] + low, sides]), hard_angle=30.0)
    bodies = tuple(replace(b, mesh=mesh) if b.name == "plate" else b for b in scene.bodies)
    return replace(scene, bodies=bodies)


@pytest.mark.parametrize("points", [500, 1000, 2000, 4000])
@pytest.mark.parametrize("plate", [1, 2, 8, 32, "1 box", "4 boxes"])
def test_flat(points, plate):
    boxes = 4 if plate == "4 boxes" else 1
    foot = " ".join(f"{half:.9g}" for half in stimuli.FOOT)
    scene = stimuli._scene(f'<geom type="box" size="{foot}" mass="0.01"/>', stimuli.FOOT[2], boxes).smooth()
    if isinstance(plate, int):
        scene = meshed_plate(scene, plate)
    for m in (LevelsMethod(points=points), replace(FULL, points=points)):
        r = m.prepare(scene)
        pose = scene.start.copy(); pose[:3] += [0.7e-3, 0.4e-3, -1e-4]
        w = r.wrench(pose)
        c = r.contacts
        print(plate, points, len(c), w.force / .4, [1e3 * (k.place - pose[:3]) for k in c], [k.levels for k in c])
