"""OFF files of Geomview: every form in text is read, and what does not add up is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from asperity.errors import AsperityError
from asperity.geometry.mesh.files import read_mesh

BOX = trimesh.creation.box((0.02, 0.03, 0.04))
QUADS = ["4 0 1 3 2", "4 4 6 7 5", "4 0 4 5 1", "4 2 3 7 6", "4 0 2 6 4", "4 1 5 7 3"]
CORNERS = [f"{x} {y} {z}" for x in (0, 0.02) for y in (0, 0.03) for z in (0, 0.04)]


def off(head: str = "OFF\n8 6 12\n", more: str = "", colour: str = "", faces=QUADS) -> str:
    rows = [corner + more for corner in CORNERS] + [face + colour for face in faces]
    return head + "\n".join(rows) + "\n"


def read(tmp_path: Path, text: str):
    (tmp_path / "a.off").write_text(text)
    return read_mesh(tmp_path / "a.off")


@pytest.mark.parametrize(
    "text",
    [
        off(),
        off("OFF 8 6 12\n"),
        off("OFF8 6 12\n"),
        off("OFF\n8 6\n"),
        off("# a box\n\nOFF # of six sides\n# counts:\n8 6 0 # no edges\n"),
        off("COFF\n8 6 0\n", " 255 0 0 255"),
        off("COFF 8 6 0\n", " 0.5 0.5 0.5", " 0.1 0.2 0.3 1"),
        off(colour="  255 0 0"),
        off().replace("\n", "\r\n"),
        off().replace(" ", "\t"),
    ],
)
def test_a_box_in_every_form(tmp_path: Path, text: str) -> None:
    mesh = read(tmp_path, text)
    assert len(mesh.faces) == 12
    assert np.allclose(np.ptp(mesh.vertices, axis=0), (0.02, 0.03, 0.04))
    triangles = mesh.vertices[mesh.faces]
    volume = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    assert abs(volume.sum() / 6.0) == pytest.approx(2.4e-5)
    assert not mesh.notes


def test_a_mesh_that_another_program_wrote(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    ball.export(tmp_path / "ball.off")
    mesh = read_mesh(tmp_path / "ball.off")
    assert len(mesh.faces) == len(ball.faces)
    assert np.allclose(mesh.vertices[mesh.faces], ball.vertices[ball.faces], atol=1e-8)


def test_normals_and_texture_coordinates_of_vertices(tmp_path: Path) -> None:
    rows = [f"{x} {y} 0 0 {x * 10} 1 255 0 0 {x} {y}" for x in (0, 0.02) for y in (0, 0.03)]
    mesh = read(tmp_path, "STCNOFF\n4 1 0\n" + "\n".join([*rows, "4 0 2 3 1"]) + "\n")
    places = mesh.vertices[mesh.faces]
    assert mesh.uv is not None
    assert np.allclose(mesh.uv, places[..., :2])
    slopes = mesh.normals / mesh.normals[..., 2:]
    assert np.allclose(slopes[..., 1], 10 * places[..., 0])


def test_a_concave_polygon_is_cut_as_it_lies(tmp_path: Path) -> None:
    places = ["0 0 0", "0.02 0 0", "0.02 0.02 0", "0.01 0.005 0", "0 0.02 0"]
    mesh = read(tmp_path, "OFF\n5 1 0\n" + "\n".join([*places, "5 0 1 2 3 4"]) + "\n")
    sides = mesh.vertices[mesh.faces]
    area = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])[:, 2] / 2.0
    assert (area > 0.0).all()
    assert area.sum() == pytest.approx(0.02**2 - 0.02 * 0.015 / 2.0)


def test_the_unit_that_a_comment_states(tmp_path: Path) -> None:
    text = "OFF\n# units: mm\n" + off("8 6 0\n").replace("0.0", "")
    assert "its unit is mm, as it states" in read(tmp_path, text).notes


@pytest.mark.parametrize(
    ("text", "note"),
    [
        (off(more=" 0 0 1"), "3 numbers behind each vertex left out"),
        (off(colour=" 7"), "one number behind 6 faces: taken for a colour"),
        (off("OFF 8 7 0\n", faces=[*QUADS, "2 0 1"]), "1 polygon of fewer than three corners"),
    ],
)
def test_what_is_left_out_is_noted(tmp_path: Path, text: str, note: str) -> None:
    assert note in "\n".join(read(tmp_path, text).notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (off()[:-60], "it is cut short, or its counts are wrong: 8 vertices and 6 faces, "),
        (off("OFF\n8 5 0\n"), "a.off: its counts are wrong: 8 vertices and 5 faces, 14 lines"),
        (off("OFF\n9 6 0\n"), "it is cut short, or its counts are wrong"),
        (off("OFF\n7 7 0\n"), "face 1 is '0.02 0.03 0.04'; valid: how many vertices"),
        (off("OFF\n9 5 0\n"), "vertex 9 is '4 0 1 3 2'; valid: 3 numbers, as the first has"),
        (off("OFF\n8 six 0\n"), "its counts are '8 six 0'"),
        (off("OFF\n8 -6 0\n"), "its counts are '8 -6 0'"),
        (off("OFF\n8\n"), "its counts are '8'"),
        (off("8 6 0\n"), "it does not begin with OFF"),
        (off("OFF BINARY\n8 6 0\n"), "it is a binary one; valid: text"),
        (off("4OFF\n8 6 0\n", " 1"), "it begins with 4OFF, of other dimensions; valid: 3"),
        (off("NOFF\n8 6 0\n"), "vertex 1 is '0 0 0'; valid: 6 numbers"),
        (off("COFF\n8 6 0\n"), "vertex 1 is '0 0 0'; valid: 6 numbers"),
        (off().replace("0 0.03 0\n", "0 x 0\n", 1), "vertex 3 is '0 x 0'; valid: 3 numbers"),
        (off(faces=[*QUADS[:5], "4 1 5 7 8"]), "a face names vertex 8; valid: 0 to 7"),
        (off(faces=[*QUADS[:5], "4 1 5 7 -1"]), "a face names vertex -1; valid: 0 to 7"),
        (off(faces=[*QUADS[:5], "4 1 5 7"]), "face 6 is '4 1 5 7'; valid: how many vertices"),
        (off(faces=[*QUADS[:5], "4 1 5 7 3.5"]), "face 6 is '4 1 5 7 3.5'"),
        (off(faces=[*QUADS[:5], "4 1 5 7 3 1 1"]), "face 6 is '4 1 5 7 3 1 1'"),
        ("OFF\n", "its counts are ''"),
        ("OFF\n0 0 0\n", "there are no triangles in it"),
    ],
)
def test_what_does_not_add_up_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(AsperityError) as caught:
        read(tmp_path, text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
