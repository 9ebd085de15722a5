"""Meshes of one's own with steep textures, turned any way, that meet at edges and corners."""

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from asperity.contact.solver import ContactSolver
from asperity.scene.from_files import make_scene
from contact.test_mesh_potential import first_pose

PATTERNS = ("dots:1mm", "knurl:1.5mm", "waves:1mm", None)
"""Slopes up to 3.4, 0.5 and 0.3."""


def solid(rng):
    """Return a prism, a box or the convex hull of points, 4 to 12 mm in size [mm]."""
    kind = rng.integers(3)
    if kind == 0:
        radius, height = rng.uniform(3, 6), rng.uniform(4, 12)
        sides = int(rng.integers(16, 60))
        return trimesh.creation.cylinder(radius=radius, height=height, sections=sides)
    if kind == 1:
        return trimesh.creation.box(rng.uniform(5, 12, 3))
    points = rng.normal(size=(int(rng.integers(8, 30)), 3))
    points *= 5.0 / np.linalg.norm(points, axis=1)[:, None]
    return trimesh.convex.convex_hull(points * rng.uniform(0.6, 1.2, 3))


@pytest.mark.parametrize("seed", [2, 15, 28, 31])
def test_steep_textures_are_certified_round_edges(seed, tmp_path):
    """Where a texture folds beside an edge, boxes of 2 um were left with gaps of 0.1 to 0.2 mm."""
    rng, files = np.random.default_rng(seed), []
    for name in "ab":
        files.append(str(tmp_path / f"{name}.stl"))
        solid(rng).export(files[-1])
    textures = PATTERNS[rng.integers(4)], PATTERNS[rng.integers(3)]
    scene = make_scene(
        tool=files[0], target=files[1], tool_texture=textures[0], target_texture=textures[1],
        unit="mm",
    )  # fmt: skip
    engine = ContactSolver(scene.model, scene.bodies, scene.tool, scene.force)
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    place, turn = data.body("target").xpos, Rotation.random(random_state=seed).as_quat()
    along = rng.normal(size=3)
    along /= np.linalg.norm(along)

    def touches(far):
        first_pose(engine, np.concatenate([place + far * along, np.roll(turn, 1)]))
        return engine.contacts.count[0] > 0

    low, high = 0.0, 0.03
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if touches(middle) else (low, middle)
    for deeper in (5e-5, 1e-4, 1.5e-4):
        assert touches(low - deeper)
        count, dropped = engine.contacts.count
        assert dropped == 0
        assert (engine.contacts.status[:count] == 0).all()
