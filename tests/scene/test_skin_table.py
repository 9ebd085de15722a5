"""The table [tool.skin], and the built-in scene of a fingertip."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.scene.scene import read_scene


def finger(**skin):
    return load_scene("finger-plate").changed(tool={"skin": skin})


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"modulus": -1.0}, r"tool\.skin: modulus must lie between"),
        ({"modulus": float("inf")}, r"tool\.skin\.modulus must be finite"),
        ({"poisson": 0.5}, r"tool\.skin: poisson .*below 0\.5"),
        ({"thickness": 0.0}, r"tool\.skin: thickness"),
        ({"thickness": None}, r"tool\.skin\.thickness is missing"),
        ({"taxels": [0, 8]}, r"tool\.skin: rows of taxels"),
        ({"taxels": "many"}, r"tool\.skin\.taxels must be a list"),
        ({"friction": -1.0}, r"tool\.skin: friction"),
        ({"young": 1e5}, r"unknown key tool\.skin\.young"),
        ({"modulsu": 1e5}, r"did you mean tool\.skin\.modulus"),
    ],
)
def test_wrong_values_are_named(changed, words):
    with pytest.raises(AsperityError, match=words) as refused:
        finger(**changed)
    assert "\n" not in str(refused.value)


def test_the_table_must_be_a_table():
    with pytest.raises(AsperityError, match=r"tool\.skin must be a table"):
        load_scene("finger-plate").changed(tool={"skin": 3})


def test_meshes_are_refused():
    with pytest.raises(AsperityError, match=r"tool\.skin: body .* is a mesh"):
        load_scene("file-cad").changed(tool={"skin": {"thickness": 1e-3, "modulus": 1e5}})


def test_the_fingertip_survives_a_folder(tmp_path):
    scene = load_scene("finger-plate")
    scene.save(tmp_path / "finger")
    again = read_scene(tmp_path / "finger")
    assert again.skin is not None
    assert again.skin.taxels == (64, 64)
    assert again.skin.modulus == scene.skin.modulus
    np.testing.assert_array_equal(again.skin.arrays.point, scene.skin.arrays.point)


def test_without_the_table_the_finger_is_rigid():
    assert load_scene("finger-plate").changed(tool={"skin": None}).skin is None
