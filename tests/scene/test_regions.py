"""Several materials on one mesh, each with a map of its own."""

import numpy as np
import pytest
from PIL import Image

import asperity
from asperity.errors import AsperityError
from asperity.geometry.mesh.materials import Material
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.scene.regions import laid_together
from asperity.scene.scale import scale_table
from asperity.texture.height_field import HeightField

HALF, DEPTH = 0.01, 0.004


def sheet(rng, count):
    """Return a square of triangles with texture coordinates and materials at random."""
    line = np.linspace(0.0, 0.02, count)
    x, y = np.meshgrid(line, line)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    steps = np.array([(0, 1, count + 1), (0, count + 1, count)])
    faces = (first[:, None, None] + steps).reshape(-1, 3)
    uv = rng.uniform(0.0, 1.0, (len(faces), 3, 2))
    material = rng.integers(-1, 3, len(faces))
    mesh = mesh_from_arrays(points, faces, uv=uv, material=material)
    materials = tuple(Material(name) for name in ("wood", "steel", "cork"))
    return Mesh(
        mesh.vertices, mesh.faces, mesh.normals, mesh.uv, "sheet", (), materials, mesh.material
    )


def field(rng, shape, pixel, border):
    waves = rng.normal(size=(4, 3))
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]] / max(shape) * 2 * np.pi
    values = sum(a * np.sin(k * u + 2 * b * v + b) for k, (a, b, _) in enumerate(waves, 1))
    return HeightField(1e-5 * values, pixel, border)


def test_each_material_has_its_own_map_unchanged():
    rng = np.random.default_rng(5)
    mesh = sheet(rng, 8)
    wrapped = mesh.material == 1
    uv = mesh.uv.copy()
    uv[wrapped] = 3.0 * uv[wrapped] - 7.3  # beyond 0..1, where it repeats
    mesh = Mesh(mesh.vertices, mesh.faces, mesh.normals, uv, "s", (), mesh.materials, mesh.material)
    fields = {0: field(rng, (40, 64), (1e-4, 2e-4), "clamp"),
              1: field(rng, (32, 24), (3e-4, 3e-4), "wrap")}  # fmt: skip
    laid, texture = laid_together(mesh, fields)
    assert laid.uv.min() > 0.0
    assert laid.uv.max() < 1.0
    weights = rng.dirichlet(np.ones(3), len(mesh.faces))
    old, new = (np.einsum("ij,ijk->ik", weights, m.uv) for m in (mesh, laid))
    found = texture.heights(*(new * texture.size).T)
    for number in (-1, 0, 1, 2):
        which = mesh.material == number
        assert which.any()
        right = np.zeros(which.sum())
        if number in fields:
            right = fields[number].heights(*(old[which] * fields[number].size).T)
            assert np.ptp(right) > 1e-5
        assert np.abs(found[which] - right).max() < 1e-4 * np.ptp(fields[0].samples)


def waves(amplitude, count, size=96):
    phase = 2 * np.pi * count * (np.arange(size) + 0.5) / size
    grey = np.round(127.5 + 127.5 * amplitude * np.sin(phase))
    return np.tile(grey, (size, 1)).astype(np.uint8)


@pytest.fixture
def halves(tmp_path):
    """Return an OBJ of a block whose left half is of wood, its right of steel, its sides bare."""

    def write(*lines):
        x = (-2 * HALF, 0.0, 2 * HALF)
        rows = ["mtllib block.mtl"]
        rows += [f"v {a} {b} {c}" for c in (0.0, -DEPTH) for b in (-HALF, HALF) for a in x]
        rows += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
        for name, k in (("wood", 1), ("steel", 2)):
            rows += [f"usemtl {name}", f"f {k}/1 {k + 1}/2 {k + 4}/3 {k + 3}/4"]
        sides = ["7 10 11", "7 11 8", "8 11 12", "8 12 9", "1 7 8", "1 8 2", "2 8 9", "2 9 3",
                 "3 9 12", "3 12 6", "6 12 11", "6 11 5", "5 11 10", "5 10 4", "4 10 7",
                 "4 7 1"]  # fmt: skip
        rows += ["usemtl sides", *(f"f {side}" for side in sides)]
        (tmp_path / "block.obj").write_text("\n".join(rows) + "\n")
        (tmp_path / "block.mtl").write_text("\n".join(lines) + "\n")
        Image.fromarray(waves(1.0, 4)).save(tmp_path / "wood_disp.png")
        Image.fromarray(waves(0.5, 9)).save(tmp_path / "steel_disp.png")
        return tmp_path / "block.obj"

    return write


WOOD = ("newmtl wood", "Kd 0.8 0.4 0.2", "disp -mm 0 1e-4 wood_disp.png")
STEEL = ("newmtl steel", "Kd 0.2 0.4 0.8", "disp -mm 0 6e-5 steel_disp.png")
SIDES = ("newmtl sides",)


def felt(scene, x):
    """Return the normal force of the tool where it is pressed 0.2 mm in, along a line."""
    simulation = asperity.Simulation(scene)
    places = x + np.linspace(-5e-3, 5e-3, 21)
    simulation.step([places[0], 0.0, 0.01, 1, 0, 0, 0])
    return np.array([
        simulation.step([place, 0.0, 1.5e-3 - 2e-4, 1, 0, 0, 0])[2] for place in places
    ])  # fmt: skip


def test_an_obj_with_two_materials_feels_like_each_of_them(halves):
    both = asperity.make_scene(tool="sphere:3mm", target=halves(*WOOD, *STEEL, *SIDES))
    body = next(body for body in both.bodies if body.name == "target")
    assert body.texture is not None
    assert any("maps of 2 of its 3 materials are one texture" in note for note in both.notes)
    assert any("smooth, since no map is there for them: sides" in note for note in both.notes)
    assert "texture of wood" in scale_table(both)
    assert both.model.geom("target-shape").rgba[:3] == pytest.approx([0.5, 0.4, 0.5], abs=2e-3)
    start = {"anti_alias": "off"}
    for one, x in ((WOOD, -HALF), (STEEL, HALF)):
        alone = asperity.make_scene(tool="sphere:3mm", target=halves(*one, *SIDES))
        right = felt(alone.changed(force=start), x)
        assert np.ptp(right) > 0.005
        assert felt(both.changed(force=start), x) == pytest.approx(right, abs=2e-4)
        assert np.ptp(felt(alone.changed(force=start), -x)) < 1e-3  # smooth there


def test_it_is_saved_and_read_and_changed(halves, tmp_path):
    scene = asperity.make_scene(tool="sphere:3mm", target=halves(*WOOD, *STEEL, *SIDES))
    scene.save(tmp_path / "saved")
    again = asperity.load_scene(tmp_path / "saved")
    one, two = (next(b for b in s.bodies if b.name == "target") for s in (scene, again))
    np.testing.assert_array_equal(one.texture.samples, two.texture.samples)
    np.testing.assert_array_equal(one.mesh.uv, two.mesh.uv)
    assert all(body.texture is None for body in again.smooth().bodies)
    grooves = {"kind": "sinusoid", "wavelength": 1e-3, "amplitude": 2e-5}
    wood = {**dict.fromkeys(again.document["bodies"]["target"]["materials"]["wood"]), **grooves}
    changed = again.changed(bodies={"target": {"materials": {"steel": None, "wood": wood}}})
    assert next(b for b in changed.bodies if b.name == "target").texture.relief < 4.1e-5
    for table, said in (
        ({"steal": grooves}, r"materials.steal: no such material .did you mean .steel"),
        ({"wood": {**grooves, "mapping": "planar"}}, "mapping 'uv'"),
    ):
        with pytest.raises(AsperityError, match=said):
            again.changed(bodies={"target": {"materials": table}})
    with pytest.raises(AsperityError, match="without a texture of the whole body"):
        again.changed(bodies={"target": {"texture": grooves}})
    with pytest.raises(AsperityError, match="whose file has materials"):
        again.changed(bodies={"tool": {"materials": {"wood": grooves}}})
