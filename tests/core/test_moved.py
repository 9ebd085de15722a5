"""Modules under their old names: found, and said where they are now."""

import importlib

import pytest

from asperity._core.moved import new_name, tables


@pytest.mark.parametrize("old", [*tables()["modules"], *tables()["packages"]])
def test_what_has_moved_is_where_the_table_says(old):
    new = new_name(f"asperity.{old}")
    assert new is not None
    assert importlib.util.find_spec(new) is not None
    with pytest.raises(AttributeError):
        importlib.import_module(f"asperity.{old}").no_such_name  # noqa: B018


@pytest.mark.parametrize(
    "line",
    [
        "from asperity.engine.engine import Engine",
        "from asperity.geometry.mesh import mesh_from_arrays",
        "from asperity.scene import Scene, scene_of",
        "from asperity.scenes.file_cad import file_cad",
        "from asperity.perception.metrics import METRICS",
        *(" import ".join(f"from asperity.{name}".rsplit(".", 1)) for name in tables()["names"]),
        *(f"from asperity import {name}" for name in tables()["public"]),
    ],
)
def test_an_old_name_works_and_warns(line):
    with pytest.warns(DeprecationWarning, match=r": use asperity\."):
        exec(line, {})


def test_what_never_was_is_not_found():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("asperity.nothing")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("asperity.engine.nothing")
