"""OBJ and PLY files with rarer habits: weights, polygons of two corners, names of coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.mesh.files import read_mesh

SIZE = np.array([0.04, 0.03, 0.01])
CORNERS = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)]) * SIZE
UV = CORNERS[:, :2] / SIZE[:2]
QUADS = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def obj(vertices: list[str], faces: str = "") -> str:
    lines = [*(f"v {vertex}" for vertex in vertices), *("vt {:g} {:g}".format(*uv) for uv in UV)]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in quad) for quad in QUADS]
    return "\n".join(lines) + f"\n{faces}"


def is_box(mesh) -> None:
    assert len(mesh.faces) == 12
    np.testing.assert_allclose(mesh.vertices[mesh.faces].max(axis=(0, 1)), SIZE, rtol=1e-6)
    wanted = mesh.vertices[mesh.faces][..., :2] / SIZE[:2]
    np.testing.assert_allclose(mesh.uv, wanted, atol=1e-6)


def test_vertices_of_an_obj_are_divided_by_their_weights(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    weights = np.arange(1.0, 9.0)
    path.write_text(obj(["{:g} {:g} {:g} {:g}".format(*(w * c), w)
                         for c, w in zip(CORNERS, weights, strict=True)]))  # fmt: skip
    mesh = read_mesh(path)
    is_box(mesh)
    assert any("7 vertices divided by a weight" in note for note in mesh.notes)
    # A weight of 1 changes nothing; colours, of six and seven numbers, are none.
    for behind in ("1.0", "0.1 0.2 0.3", "0.1 0.2 0.3 0.5"):
        path.write_text(obj(["{:g} {:g} {:g} {}".format(*c, behind) for c in CORNERS]))
        mesh = read_mesh(path)
        is_box(mesh)
        assert not any("weight" in note for note in mesh.notes)
    path.write_text(obj(["{:g} {:g} {:g} 0".format(*c) for c in CORNERS]))
    with pytest.raises(AsperityError, match="v 1 is '0 0 0 0'; valid: a weight w other than 0"):
        read_mesh(path)


@pytest.mark.parametrize(
    "form", ["{:g}  {:g} {:g} {:g}", " {:g} {:g} {:g} {:g} ", "{:g}\t{:g} {:g} {:g}"]
)
def test_one_vertex_among_others_is_divided_by_its_weight(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.obj"
    rows = ["{:g} {:g} {:g}".format(*c) for c in CORNERS]
    rows[5] = form.format(*(2.0 * CORNERS[5]), 2.0)
    path.write_text(obj(rows))
    mesh = read_mesh(path)
    is_box(mesh)
    assert any("1 vertex divided by a weight" in note for note in mesh.notes)


def test_what_an_obj_calls_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    rows = ["{:g} {:g} {:g}".format(*c) for c in CORNERS]
    path.write_text(obj(rows, "call more.obj 1 2\ncsh -rm all\n"))
    mesh = read_mesh(path)
    is_box(mesh)
    assert "what it calls is not read: more.obj 1 2, -rm all" in mesh.notes


def test_a_polygon_of_two_corners_takes_no_texture_from_others(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(obj(["{:g} {:g} {:g}".format(*c) for c in CORNERS], "f 1 2\nf 3\n"))
    mesh = read_mesh(path)
    is_box(mesh)
    assert any("2 polygons of fewer than three corners left out" in n for n in mesh.notes)


@pytest.mark.parametrize(
    "names", [("s", "t"), ("texture_u", "texture_v"), ("tex_u", "tex_v"), ("s0", "t0"),
              ("texcoord_u", "texcoord_v"), ("uv_u", "uv_v"), ("U", "V")],
)  # fmt: skip
def test_names_of_texture_coordinates_of_a_ply(tmp_path: Path, names: tuple[str, str]) -> None:
    head = ["ply", "format ascii 1.0", "element vertex 8", *(f"property float {n}" for n in "xyz"),
            *(f"property float {n}" for n in names), "element face 6",
            "property list uchar int vertex_indices", "end_header"]  # fmt: skip
    rows = [" ".join(f"{value:g}" for value in row) for row in np.c_[CORNERS, UV]]
    faces = [f"4 {' '.join(map(str, quad))}" for quad in QUADS]
    path = tmp_path / "a.ply"
    path.write_text("\n".join([*head, *rows, *faces]) + "\n")
    is_box(read_mesh(path))


def test_faces_of_a_ply_without_their_coordinates_are_noted(tmp_path: Path) -> None:
    head = ["ply", "format ascii 1.0", "element vertex 8", *(f"property float {n}" for n in "xyz"),
            "element face 6", "property list uchar int vertex_indices",
            "property list uchar float texcoord", "end_header"]  # fmt: skip
    rows = [" ".join(f"{value:g}" for value in row) for row in CORNERS]
    faces = [
        f"4 {' '.join(map(str, quad))} " + ("8 " + "0.5 " * 8 if quad != QUADS[2] else "0")
        for quad in QUADS
    ]
    path = tmp_path / "a.ply"
    path.write_text("\n".join([*head, *rows, *faces]) + "\n")
    mesh = read_mesh(path)
    assert mesh.uv is None
    assert any("texture coordinates of its faces are left out" in note for note in mesh.notes)
