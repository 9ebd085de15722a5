"""3MF files as modellers and slicers write them."""

import io
import zipfile

import numpy as np
import pytest
from PIL import Image

import asperity
from asperity.errors import AsperityError
from asperity.geometry.mesh.files import read_mesh

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
SPACES = {
    "m": "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "p": "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "b": "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02",
}
START = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
CORNERS = np.array([(x, y, z) for z in (0, 10) for y in (0, 20) for x in (0, 40)], dtype=float)
FACES = np.array([
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
])  # fmt: skip


def mesh_of(corners=CORNERS, faces=FACES, look="", prefix=""):
    vertices = [f'<{prefix}vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in corners]
    rows = [f'<{prefix}triangle v1="{a}" v2="{b}" v3="{c}"{look}/>' for a, b, c in faces]
    return (
        f"<{prefix}mesh><{prefix}vertices>{''.join(vertices)}</{prefix}vertices>"
        f"<{prefix}triangles>{''.join(rows)}</{prefix}triangles></{prefix}mesh>"
    )


def box(number=1, more="", **options):
    return f'<object id="{number}" {more}>{mesh_of(**options)}</object>'


def model(resources=None, build='<item objectid="1"/>', unit="millimeter", required=""):
    spaces = " ".join(f'xmlns:{name}="{uri}"' for name, uri in SPACES.items())
    unit = f' unit="{unit}"' if unit else ""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><model xmlns="{CORE}" {spaces}{unit} '
        f'requiredextensions="{required}"><resources>{resources or box()}</resources>'
        f"<build>{build}</build></model>"
    )


@pytest.fixture
def write(tmp_path):
    def make(root=None, name="3D/3dmodel.model", **files):
        path = tmp_path / "a.3mf"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(name, root or model())
            for inside, content in files.items():
                archive.writestr(inside, content)
        return path

    return make


def solid(mesh):
    """Return the extents [mm] and the volume [mm^3] of a mesh."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    return *(np.ptp(mesh.vertices, axis=0) * 1e3), volume * 1e9


@pytest.mark.parametrize(
    ("unit", "length"),
    [("millimeter", 40), ("centimeter", 400), ("inch", 1016), ("micron", None), ("", 40)],
)
def test_the_unit_is_the_one_that_the_file_states(write, unit, length):
    path = write(model(unit=unit))
    if length is None:
        with pytest.raises(AsperityError, match=r"valid: 0\.1 mm to 2 m"):
            read_mesh(path)
        return
    mesh = read_mesh(path)
    assert solid(mesh) == pytest.approx([length, length / 2, length / 4, length**3 / 8])
    assert any("the default of 3MF" in note for note in mesh.notes) == (unit == "")
    with pytest.raises(AsperityError, match="its unit is 'parsec'; valid: micron, millimeter"):
        read_mesh(write(model(unit="parsec")))


def test_items_and_components_place_objects(write):
    turned = "0 1 0 -1 0 0 0 0 1 100 0 0"  # x to y, y to -x
    mirrored = "-1 0 0 0 1 0 0 0 1 0 0 0"
    pair = (
        f'<object id="2"><components><component objectid="1" transform="{mirrored}"/>'
        '<component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 30"/></components></object>'
    )
    items = f'<item objectid="2" transform="{turned}"/><item objectid="1" printable="0"/>'
    mesh = read_mesh(write(model(box() + pair, items)))
    assert solid(mesh) == pytest.approx([20, 80, 40, 16000])
    assert mesh.vertices.min(axis=0) == pytest.approx([0.08, -0.04, 0])
    assert not any("turned" in note for note in mesh.notes)  # wound anew
    assert any("1 of its 2 items, not to be printed, left out" in note for note in mesh.notes)
    mesh = read_mesh(write(model(build="")))
    assert any("its build is empty" in note for note in mesh.notes)


def test_names_with_prefixes_in_a_part_of_another_name(write):
    root = (
        f'<c:model xmlns:c="{CORE}" unit="millimeter"><c:resources><c:object id="7">'
        f'{mesh_of(prefix="c:")}</c:object></c:resources><c:build><c:item objectid="7"/></c:build>'
        "</c:model>"
    )
    relation = f'<Relationship Type="{START}" Target="/3D/Part.MODEL" Id="r"/>'
    path = write(root, "3d/part.model", **{"_rels/.rels": f"<Relationships>{relation}</>"})
    assert solid(read_mesh(path)) == pytest.approx([40, 20, 10, 8000])


def test_projects_of_slicers(write):
    """Bambu Studio and OrcaSlicer keep objects in parts; PrusaSlicer's volumes are of triangles."""
    inner = model(box(1) + box(2, corners=CORNERS * 3, more='type="other"') + box(3), build="")
    parts = "".join(
        f'<component p:path="/3D/Objects/a_1.model" objectid="{n}"/>' for n in (1, 2, 3)
    )
    root = model(
        f'<object id="4" type="model"><components>{parts}</components></object>',
        '<item objectid="4" transform="1 0 0 0 1 0 0 0 1 128 128 5"/>', required="p",
    )  # fmt: skip
    config = (
        '<config><object id="4"><part id="1" subtype="normal_part"/>'
        '<part id="3" subtype="negative_part"/></object></config>'
    )
    path = write(root, **{"3D/Objects/a_1.model": inner, "Metadata/model_settings.config": config})
    mesh = read_mesh(path)
    assert solid(mesh) == pytest.approx([40, 20, 10, 8000])
    assert any("left out (negative_part)" in note for note in mesh.notes)
    assert any("no part of the solid left out (other)" in note for note in mesh.notes)

    corners = np.concatenate([CORNERS, CORNERS * 2])
    config = (
        '<config><object id="1"><volume firstid="0" lastid="11"><metadata type="volume" '
        'key="volume_type" value="ModelPart"/></volume><volume firstid="12" lastid="23"><metadata '
        'key="volume_type" value="ParameterModifier"/></volume></object></config>'
    )
    faces = np.concatenate([FACES, FACES + 8])
    path = write(
        model(box(corners=corners, faces=faces)), **{"Metadata/Slic3r_PE_model.config": config}
    )
    mesh = read_mesh(path)
    assert solid(mesh) == pytest.approx([40, 20, 10, 8000])
    assert any("left out (parametermodifier)" in note for note in mesh.notes)


def test_colours_and_pictures(write):
    stream = io.BytesIO()
    Image.new("RGB", (8, 8), (200, 100, 50)).save(stream, "png")
    texture = (
        '<m:texture2d id="5" path="/3D/Textures/Skin.png" contenttype="image/png"/>'
        '<m:texture2dgroup id="6" texid="5"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0"/>'
        '<m:tex2coord u="0.5" v="0.25"/></m:texture2dgroup>'
    )
    look = ' pid="6" p1="0" p2="1" p3="2"'
    path = write(model(texture + box(look=look)), **{"3D/textures/skin.png": stream.getvalue()})
    mesh = read_mesh(path)
    assert mesh.uv[0] == pytest.approx(np.array([(0, 0), (1, 0), (0.5, 0.25)]))
    assert [m.maps["colour"].name for m in mesh.materials] == ["Skin.png"]
    scene = asperity.make_scene(tool="sphere:3mm", target=path)
    assert scene.model.geom("target-shape").rgba[:3] * 255 == pytest.approx([200, 100, 50], abs=1)
    assert np.ptp(scene.bodies[0].mesh.vertices[:, 2]) == pytest.approx(0.01)
    with pytest.raises(AsperityError, match="names texture coordinate 9 of group 6, which has 3"):
        read_mesh(
            write(model(texture + box(look=' pid="6" p1="9"')), **{"3D/textures/skin.png": "x"})
        )
    base = (
        '<basematerials id="5"><base name="PLA" displaycolor="#FF0000FF"/>'
        '<base name="PETG" displaycolor="#00FF00"/></basematerials>'
    )
    halves = box(faces=FACES[:6], more='pid="5" pindex="1"') + box(
        2, faces=FACES[6:], look=' pid="5" p1="0"'
    )
    mesh = read_mesh(write(model(base + halves, '<item objectid="1"/><item objectid="2"/>')))
    assert [(m.name, m.colour) for m in mesh.materials] == [("PETG", (0, 1, 0)), ("PLA", (1, 0, 0))]


@pytest.mark.parametrize(
    ("root", "said"),
    [
        (model(box(corners=CORNERS * np.nan)), "a vertex has 'nan'; valid: finite numbers"),
        (model(box(corners=CORNERS * 1e30)), "valid: 0.1 mm to 2 m"),
        (model(box(faces=FACES + 1)), "has a triangle of vertex 8; valid: 0 to 7"),
        (model(box(faces=[])), "there are no triangles in it"),
        (model(build='<item objectid="9"/>'), "it has no object 9"),
        (model(build='<item objectid="1" transform="1 2"/>'), "a transform has 2 numbers"),
        (model('<object id="1"><components><component objectid="1"/></components></object>'),
         "its components contain themselves"),
        (model(required="b"), "requires the extension .*beamlattice"),
        (model()[:700], "cannot be read as a .3mf file"),
        (model().replace("v1=", "w1="), "it is damaged"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(write, root, said):
    with pytest.raises(AsperityError, match=said) as caught:
        read_mesh(write(root))
    assert "\n" not in str(caught.value)


def test_archives_that_are_damaged(write, tmp_path):
    with pytest.raises(AsperityError, match=r"there is no 3D/3dmodel\.model in it"):
        read_mesh(write("x", "readme.txt"))
    data = write().read_bytes()
    for content in (data[: len(data) // 2], b"PK\3\4", b"<model/>", data[:60] + b"xx" + data[62:]):
        (tmp_path / "b.3mf").write_bytes(content)
        with pytest.raises(AsperityError, match=r"b\.3mf: ") as caught:
            read_mesh(tmp_path / "b.3mf")
        assert "\n" not in str(caught.value)
