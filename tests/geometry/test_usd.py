"""USD files, as usd-core and people write them."""

import io
import struct

import numpy as np
import pytest
from PIL import Image

import asperity
from asperity.baking.sources import mesh_to_bake
from asperity.errors import AsperityError
from asperity.geometry.mesh import usd
from asperity.geometry.mesh.files import companions, read_mesh

pxr = pytest.importorskip("pxr", reason="usd-core reads USD")
Usd, UsdUtils = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdUtils"))

HEAD = """#usda 1.0
(
    {meta}
)
def Xform "World"
{{
    double3 xformOp:translate = (5, 0, 0)
    float3 xformOp:rotateXYZ = (0, 0, 90)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    def Mesh "Plate"
    {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(0,0,0), (20,0,0), (40,0,0), (0,10,0), (20,10,0), (40,10,2)]
        texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1), (0,0), (1,0), (1,1), (0,1)] (
            interpolation = "faceVarying"
        )
        {more}
    }}
}}
"""
BOUND = """rel material:binding = </Mats/Wood>
        def GeomSubset "right"
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </Mats/Steel>
        }"""
MATERIAL = """
    def Material "{name}"
    {{
        token outputs:surface.connect = </Mats/{name}/S.outputs:surface>
        def Shader "S"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (1, 0.214, 0)
            float inputs:displacement.connect = </Mats/{name}/T.outputs:r>
            token outputs:surface
        }}
        def Shader "T"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float4 inputs:scale = ({scale}, 0, 0, 0)
            float outputs:r
        }}
    }}"""


def stage(path, meta="metersPerUnit = 0.001", more="", materials=()):
    text = HEAD.format(meta=meta, more=more)
    if materials:
        text += "def Scope \"Mats\"\n{" + "".join(
            MATERIAL.format(name=n, file=f, scale=s) for n, f, s in materials
        ) + "\n}\n"  # fmt: skip
    path.write_text(text)
    return path


def waves(count):
    phase = 2 * np.pi * count * np.arange(64) / 64
    stream = io.BytesIO()
    grey = np.tile(np.round(127.5 + 127 * np.sin(phase)), (64, 1)).astype(np.uint8)
    Image.fromarray(grey).save(stream, "png")
    return stream.getvalue()


def test_a_mesh_in_its_unit_where_its_prims_place_it(tmp_path, capfd):
    mesh = read_mesh(stage(tmp_path / "a.usda"))
    assert len(mesh.faces) == 4
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert low == pytest.approx([-5e-3, 0, 0], abs=1e-9)  # turned by 90 degrees, then moved
    assert high == pytest.approx([5e-3, 0.04, 2e-3], abs=1e-9)
    corner = np.flatnonzero((mesh.vertices[mesh.faces] == mesh.vertices[0]).all(axis=2).ravel())
    assert np.ptp(mesh.uv.reshape(-1, 2)[corner], axis=0).max() == 0.0
    assert "its unit is mm, as it states" in mesh.notes
    assert capfd.readouterr().err == ""
    from pxr import Usd

    for name in ("b.usdc", "c.usd"):
        Usd.Stage.Open(str(tmp_path / "a.usda")).Export(str(tmp_path / name))
        np.testing.assert_array_equal(read_mesh(tmp_path / name).vertices, mesh.vertices)


def test_units_axes_and_what_is_left_out(tmp_path):
    mesh = read_mesh(stage(tmp_path / "a.usda", 'doc = "x"'))
    assert np.ptp(mesh.vertices, axis=0)[1] == pytest.approx(0.4)
    assert "it states no metersPerUnit: cm, the default of USD" in mesh.notes
    with pytest.raises(AsperityError, match=r"its metersPerUnit is 0\.7; valid: 1, 0\.1"):
        read_mesh(stage(tmp_path / "a.usda", "metersPerUnit = 0.7"))
    up = stage(tmp_path / "a.usda", 'metersPerUnit = 0.001\n    upAxis = "Y"')
    assert np.ptp(mesh_to_bake(up, None)[0].vertices, axis=0)[1:] == pytest.approx([0.01, 0.04])
    smooth = stage(tmp_path / "a.usda")
    text = smooth.read_text()
    smooth.write_text(text.replace('subdivisionScheme = "none"', 'subdivisionScheme = "loop"'))
    assert any("its subdivision is left out" in note for note in read_mesh(smooth).notes)
    smooth.write_text(
        text.replace("uniform token sub", 'token visibility = "invisible"\nuniform token sub')
    )
    with pytest.raises(AsperityError, match="no triangles"):
        read_mesh(smooth)
    flipped = text.replace(
        "uniform token sub", 'uniform token orientation = "leftHanded"\nuniform token sub'
    )
    smooth.write_text(flipped)
    found = read_mesh(smooth)
    sides = np.cross(*np.diff(found.vertices[found.faces], axis=1).transpose(1, 0, 2))
    assert (sides[:, 2] < 0).all()


def test_coordinates_by_name_holes_repetitions_and_files_that_are_not_there(tmp_path):
    text = stage(tmp_path / "a.usda", more="int[] holeIndices = [1]").read_text()
    text = text.replace("texCoord2f[] primvars:st ", "float2[] primvars:st_0 ")
    more = 'def PointInstancer "i"\n{\n}\ndef "w" (\n    references = @./lost.usda@</W>\n)\n{\n}\n'
    (tmp_path / "a.usda").write_text(text + more)
    mesh = read_mesh(tmp_path / "a.usda")
    assert len(mesh.faces) == 2
    assert mesh.uv is not None
    assert any("a PointInstancer is left out" in note for note in mesh.notes)
    assert "a file that it refers to is not there: lost.usda" in mesh.notes
    (tmp_path / "b.usda").write_text("#usda 1.0\n" + more)
    with pytest.raises(AsperityError, match=r"no triangles in it \(.*lost\.usda"):
        read_mesh(tmp_path / "b.usda")


@pytest.mark.parametrize("packed", [False, True])
def test_materials_of_subsets_bring_their_maps(tmp_path, packed):
    for name, count in (("wood", 4), ("steel", 9)):
        (tmp_path / f"{name}.png").write_bytes(waves(count))
    materials = [("Wood", "./wood.png", 0.1), ("Steel", "./steel.png", 0.06)]
    path = stage(tmp_path / "a.usda", more=BOUND, materials=materials)
    if packed:
        from pxr import UsdUtils

        assert UsdUtils.CreateNewUsdzPackage(str(path), str(tmp_path / "a.usdz"))
        for file in (path, tmp_path / "wood.png", tmp_path / "steel.png"):
            file.unlink()
        path = tmp_path / "a.usdz"
    mesh = read_mesh(path)
    assert [material.name for material in mesh.materials] == ["Wood", "Steel"]
    assert mesh.material.tolist() == [0, 0, 1, 1]
    assert mesh.materials[0].colour == pytest.approx((1.0, 0.5, 0.0), abs=2e-3)
    assert mesh.materials[1].maps["displacement"].height_range == pytest.approx(6e-5)
    scene = asperity.make_scene(tool="sphere:3mm", target=path)
    tables = scene.document["bodies"]["target"]["materials"]
    assert {name: table["height_range"] for name, table in tables.items()} == {
        "Wood": pytest.approx(1e-4), "Steel": pytest.approx(6e-5)
    }  # fmt: skip
    target = next(body for body in scene.bodies if body.name == "target")
    assert target.texture.relief == pytest.approx(1e-4, rel=0.02)


def test_layers_that_it_refers_to_are_its_companions(tmp_path):
    stage(tmp_path / "part.usda")
    (tmp_path / "all.usda").write_text(
        "#usda 1.0\n(\n metersPerUnit = 0.001\n subLayers = [@./part.usda@]\n)\n"
    )
    assert len(read_mesh(tmp_path / "all.usda").faces) == 4
    assert [file.name for file in companions(tmp_path / "all.usda")] == ["part.usda"]


def test_damaged_files_are_refused(tmp_path, capfd):
    content = stage(tmp_path / "a.usda").read_bytes()
    for cut in (20, 300, 600):
        (tmp_path / "a.usda").write_bytes(content[:cut])
        with pytest.raises(AsperityError, match=r"a\.usda: ") as refused:
            read_mesh(tmp_path / "a.usda")
        assert "\n" not in str(refused.value)
        assert len(str(refused.value).replace(str(tmp_path), "")) <= 300
    (tmp_path / "a.usda").write_bytes(content.replace(b"[0, 1, 4, 3", b"[0, 1, 9, 3"))
    with pytest.raises(AsperityError, match="faces of points that it lacks"):
        read_mesh(tmp_path / "a.usda")
    assert capfd.readouterr().err == ""


def test_a_value_that_counts_more_than_the_file_holds_is_refused(tmp_path):
    """usd-core reserved 10 GB for the first two, and read beyond the end of others."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usdc"))
    stage.DefinePrim("/one/two/three", "Xform").SetPropertyOrder(["first", "second", "third"])
    stage.Save()
    data = bytearray((tmp_path / "a.usdc").read_bytes())
    (contents,) = struct.unpack_from("<q", data, 16)
    # A count of 3, before the numbers of three tokens.
    places = [at for at in range(88, contents - 20) if data[at : at + 8] == struct.pack("<Q", 3)]
    assert places
    struct.pack_into("<Q", data, places[0], 1_273_024_508)
    (tmp_path / "b.usdc").write_bytes(data)
    with pytest.raises(AsperityError, match="damaged, or of another kind"):
        read_mesh(tmp_path / "b.usdc")
    # A package without its end is none for zipfile; usd-core opens it all the same.
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usdc"), str(tmp_path / "a.usdz"))
    whole = (tmp_path / "a.usdz").read_bytes()
    at = whole.index(b"PXR-USDC")
    (tmp_path / "b.usdz").write_bytes(whole[:at] + data + whole[at + len(data) : -30])
    with pytest.raises(AsperityError, match="damaged, or of another kind"):
        read_mesh(tmp_path / "b.usdz")


def test_usd_core_may_crash_hang_or_be_missing(tmp_path, monkeypatch):
    path = stage(tmp_path / "a.usda")
    for wrong in ("import os; os.abort()", "import time; time.sleep(30)", "print('nothing')"):
        monkeypatch.setattr(usd, "_PROGRAM", wrong)
        monkeypatch.setattr(usd, "_SECONDS", 0.3 if "sleep" in wrong else 60.0)
        with pytest.raises(AsperityError, match=r"a\.usda: cannot be read as a \.usda file"):
            read_mesh(path)
        assert companions(path) == []
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(AsperityError, match=r"need usd-core, which is not installed; valid: pip"):
        read_mesh(path)


def test_a_file_that_has_changed_is_read_anew(tmp_path):
    path = stage(tmp_path / "a.usda")
    before = read_mesh(path).vertices
    path.write_text(path.read_text().replace("(40,10,2)", "(40,10,4)"))
    assert np.ptp(read_mesh(path).vertices[:, 2]) == pytest.approx(2.0 * np.ptp(before[:, 2]))
