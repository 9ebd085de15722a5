"""The image of a mesh's relief: what is painted where, and the file that carries it."""

import io
import json
import struct

import numpy as np
import pytest
from PIL import Image

from asperity.geometry.displaced.relief import MeshRelief
from asperity.scene.builtin import load_scene
from asperity.viewer.drawables.atlas import Atlas
from asperity.viewer.drawables.colours import height_colours
from asperity.viewer.drawables.glb import glb
from asperity.viewer.drawables.materials import by_height
from asperity.viewer.drawables.shapes import shapes_of
from asperity.viewer.pictures import PICTURED, PICTURES


@pytest.fixture(scope="module")
def block():
    scene = load_scene("hammer-blocks")
    return next(body for body in scene.bodies if body.name == "block-1" and body.mesh)


def painted(body):
    """Return what colours a body by height."""
    return by_height(body.texture.lowest, body.texture.highest, (0.5, 0.5, 0.5))


def test_each_place_has_the_colour_of_its_height(block):
    faces = np.ones(len(block.mesh.faces), bool)
    faces[::5] = False  # some have no place in it
    atlas = Atlas(block, faces, painted(block))
    image = atlas.image()
    rng = np.random.default_rng(1)
    chosen = rng.choice(np.flatnonzero(faces), 400)
    weights = rng.dirichlet((1.0, 1.0, 1.0), 400)[:, None]
    places = atlas.places(chosen, weights)[:, 0]
    assert (places > 0.0).all()
    assert (places < 1.0).all()
    column, row = np.floor(places.T * image.shape[0]).astype(int)
    height, turned = MeshRelief(block, 1e-5).heights(chosen, weights)
    field = block.texture
    wanted = height_colours(height[:, 0], field.lowest, field.highest, (0.5, 0.5, 0.5))
    shade = 1.0 - 0.55 * (1.0 - turned)
    away = np.abs(image[row, column] / 255.0 - wanted * shade)
    # A pixel is a tenth of a millimetre, on flanks of stripes.
    assert np.median(away) < 0.02
    assert np.quantile(away, 0.95) < 0.2


def test_triangles_do_not_share_pixels(block):
    faces = np.ones(len(block.mesh.faces), bool)
    atlas = Atlas(block, faces, painted(block))
    size = len(atlas.image())
    corners = atlas.places(np.arange(len(faces)), np.tile(np.eye(3), (len(faces), 1, 1))) * size
    inside = np.random.default_rng(2).dirichlet((1.0, 1.0, 1.0), 50)
    owner = np.full((size, size), -1)
    for number, triangle in enumerate(corners):
        for x, y in np.floor(inside @ triangle).astype(int):
            assert owner[y, x] in (-1, number)
            owner[y, x] = number


def test_a_mesh_with_relief_has_an_image_and_others_have_colours():
    shapes = shapes_of(load_scene("hammer-blocks"), 20_000)
    assert sum(len(shape.faces) for shape in shapes) <= 20_000
    by_name = {shape.name.rsplit("-", 1)[0]: shape for shape in shapes}
    assert by_name["table"].atlas is None
    painted = by_name["block-1"]
    assert painted.places.shape == (len(painted.vertices), 2)


def test_the_file_holds_the_image(tmp_path):
    image = np.zeros((16, 32, 3), np.uint8)
    image[:, 16:] = (200, 40, 40)
    triangle = np.eye(3)
    data = glb(
        triangle, triangle, triangle, np.array([[0, 1, 2]]), places=triangle[:, :2], image=image
    )
    magic, version, size, length = struct.unpack("<4sIII", data[:16])
    assert (magic, version, size) == (b"glTF", 2, len(data))
    message = json.loads(data[20 : 20 + length])
    primitive = message["meshes"][0]["primitives"][0]
    assert set(primitive["attributes"]) == {"POSITION", "NORMAL", "TEXCOORD_0"}
    view = message["bufferViews"][message["images"][0]["bufferView"]]
    start = 20 + length + 8 + view["byteOffset"]
    shown = np.asarray(Image.open(io.BytesIO(data[start : start + view["byteLength"]])))
    assert np.abs(shown.astype(int) - image).max() < 60
    assert view["byteOffset"] + view["byteLength"] == message["buffers"][0]["byteLength"]


@pytest.mark.parametrize("name", PICTURED)
def test_the_pictures_of_the_report_come_with_the_package(name):
    assert Image.open(PICTURES / f"{name}.jpg").size == (1400, 800)
