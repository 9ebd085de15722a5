"""Meshes that nobody on this project made, with maps of every kind, rubbed straight from files."""

import importlib.util
import itertools

import numpy as np
import pytest
import trimesh
from naive_engine import turn

from asperity import Simulation, make_scene
from asperity.errors import AsperityError
from asperity.geometry.convex import pieces

UNITS = {"featuretype.STL": "in", "idler_riser.STL": "in", "wallhole.obj": "cm"}
"""What the meshes ask for that are too large in metres."""
MESHES = (
    "angle_block.STL", "assembly_peg_ring.stl", "block.stl", "featuretype.STL", "fuze.obj",
    "hammerblock.stl", "hammerhandle.stl", "hammerhead.stl", "ico4uv.obj", "idler_riser.STL",
    "nail.stl", "octagonal_pocket.ply", "spot.obj", "spot_control_mesh.obj", "unit_cube.STL",
    "wallhole.obj",
)  # fmt: skip
MAPS = {
    "none": None,
    "constant": {"file": "heights/Metal049A_1K_Displacement.jpg"},
    "8 bit": {"file": "heights/Ground054_1K_Displacement.jpg"},
    "16 bit": {"file": "heights/derived_fabric_pattern_07_height16.png"},
    "palette": {"file": "heights/hterrain_sand_depth.png"},
    "normals": {"file": "heights/fabric_pattern_07_nor_gl_1k.jpg", "kind": "normal-opengl"},
    "gaps": {"file": "measured/bullet_land_striae.npz", "missing": "fill"},
    "instrument": {"file": "measured/tmd-1.tmd"},
}
TICKS = 40
PAIRS = list(zip(MESHES, itertools.cycle(MAPS), strict=False))
pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"needs {name}")
    for name in ("coacd", "xatlas")
]


@pytest.fixture
def quick(monkeypatch):
    """Cut meshes coarsely, 7 s for the slowest; else it is 40 s. Results are kept as always."""
    coarse = {"mcts_iterations": 5, "mcts_nodes": 5, "mcts_max_depth": 1}
    coarse |= {"resolution": 300, "preprocess_resolution": 30, "seed": 0}
    monkeypatch.setattr(pieces, "_SETTINGS", coarse)


def texture_of(data, kind):
    """Return the table of a kind of map, or skip."""
    if MAPS[kind] is None:
        return None
    if kind == "instrument" and importlib.util.find_spec("SurfaceTopography") is None:
        pytest.skip("SurfaceTopography, which reads .tmd, is not installed")
    return MAPS[kind] | {"file": data / MAPS[kind]["file"]}


def told(source):
    return {"file": source, "unit": UNITS.get(source.name, "m")}


def extent(source):
    """Return the extents of a mesh in its unit [m]."""
    scale = {"in": 0.0254, "cm": 0.01, "m": 1.0}[UNITS.get(source.name, "m")]
    return scale * np.ptp(trimesh.load(source, force="mesh").vertices, axis=0)


def box(path, sides, middle=(0.0, 0.0, 0.0)):
    trimesh.creation.box(sides, trimesh.transformations.translation_matrix(middle)).export(path)
    return path


def ball(path, radius):
    trimesh.creation.icosphere(3, radius).export(path)
    return path


def reach_of(scene):
    return sum(b.texture.relief for b in scene.bodies if b.texture is not None)


def rub(scene, size, start):
    """Slide, turn and press a tool deeper and deeper: it is finite, and it is pushed."""
    simulation = Simulation(scene.changed(force={"anti_alias": "off"}))
    reach = reach_of(scene)
    wrenches = []
    for s in np.linspace(0.0, 1.0, TICKS):
        at = start.copy()
        at[0] += 0.02 * size * np.sin(3.0 * s)
        at[1] += 0.01 * size * np.sin(5.0 * s)
        at[2] -= 2e-4 + s * (reach + 0.02 * size)
        at[3:] = turn([1, 2, 3], 0.05 * np.sin(4.0 * s))
        wrench = simulation.step(at)
        assert np.isfinite(wrench).all()
        count = simulation.contact_count
        assert np.isfinite(simulation.contacts.depth[:count]).all()
        assert (wrench == 0.0).all() or count > 0
        wrenches.append(wrench)
    assert np.array(wrenches)[:, 2].max() > 0.0


def high_place(mesh):
    """Return the middle of the widest of the highest triangles: over holes there is nothing."""
    corners = mesh.vertices[mesh.faces]
    low = corners[..., 2].min(axis=1)
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    top = low > mesh.vertices[:, 2].max() - 0.1 * np.ptp(mesh.vertices[:, 2])
    area[~top] = 0.0
    return corners[np.argmax(area if top.any() else low)].mean(axis=0)


def check_as_tool(data, folder, name, kind):
    source = data / "meshes" / name
    sides = extent(source)
    ground = box(folder / "ground.stl", np.minimum(1.5 * sides.max(), 1.9) * np.array([1, 1, 0.2]))
    scene = make_scene(
        tool=told(source), tool_texture=texture_of(data, kind),
        target=ground, target_texture=texture_of(data, "16 bit"),
    )  # fmt: skip
    rub(scene, sides.min(), scene.start)


def check_as_target(data, folder, name, kind):
    source = data / "meshes" / name
    sides = extent(source)
    make = ball if len(name) % 2 else lambda path, r: box(path, (2 * r, 2 * r, 2 * r))
    radius = max(0.1 * sides.min(), 1e-3)
    tool = make(folder / "tool.stl", radius)
    scene = make_scene(
        tool=tool, target=told(source), target_texture=texture_of(data, kind),
    )  # fmt: skip
    start = scene.start.copy()
    (target,) = (body for body in scene.bodies if body.name == "target")
    start[:3] = high_place(target.mesh)
    start[2] += radius + reach_of(scene)
    rub(scene, sides.min(), start)


def test_every_real_mesh_is_rubbed(data):
    files = {path.name for path in (data / "meshes").iterdir() if path.suffix != ".txt"}
    assert files == set(MESHES)


@pytest.mark.parametrize(("name", "unit"), UNITS.items())
@pytest.mark.parametrize("role", ["tool", "target"])
def test_a_mesh_too_large_in_metres_asks_for_its_unit(data, tmp_path, name, unit, role):
    files = dict.fromkeys(("tool", "target"), box(tmp_path / "box.stl", (0.1, 0.1, 0.1)))
    with pytest.raises(AsperityError) as refused:
        make_scene(**files | {role: data / "meshes" / name})
    line = str(refused.value)
    assert "\n" not in line
    assert line.startswith(f"{role}: mesh {name.split('.')[0]!r}: its extents are ")
    assert "valid: 0.1 mm to 2 m" in line
    assert f"unit={unit!r}" in line


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("name", "kind"), PAIRS)
def test_each_mesh_with_one_kind_of_map(data, tmp_path, name, kind):
    """Every mesh and every kind once: those at even places as the tool, the others under it."""
    check = (check_as_tool, check_as_target)[MESHES.index(name) // len(MAPS) ^ (len(name) % 2)]
    check(data, tmp_path, name, kind)


@pytest.mark.slow
@pytest.mark.parametrize("check", [check_as_tool, check_as_target])
@pytest.mark.parametrize("kind", MAPS)
@pytest.mark.parametrize("name", MESHES)
def test_every_mesh_with_every_kind_of_map(data, tmp_path, name, kind, check):
    check(data, tmp_path, name, kind)


@pytest.mark.slow
def test_a_press_ends_as_if_it_began_there(data, tmp_path):
    """A CAD part pressed 3 mm into a cube's top, 0.1 mm a tick: once 14 N sideways."""
    cube = tmp_path / "cube.obj"
    lines = [f"v {x} {y} {z}" for x in (-25, 25) for y in (-25, 25) for z in (-25, 25)]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    for side in ("1243", "5786", "1562", "3487", "1375", "2684"):
        lines.append("f " + " ".join(f"{v}/{k}" for k, v in enumerate(side, 1)))
    cube.write_text("\n".join(lines) + "\n")
    rough = texture_of(data, "16 bit")
    scene = make_scene(
        tool=told(data / "meshes/idler_riser.STL"), tool_texture=rough,
        target={"file": cube, "unit": "mm"}, target_texture=rough,
    ).changed(force={"anti_alias": "off"})  # fmt: skip
    poses = [scene.start + 1e-4 * i * np.array([1, 0, -1, 0, 0, 0, 0]) for i in range(31)]
    pressed = Simulation(scene)
    for pose in poses:
        wrench = pressed.step(pose)
    fresh = Simulation(scene).step(poses[-1])
    assert fresh[2] > 1.0
    np.testing.assert_allclose(wrench, fresh, atol=0.3)
