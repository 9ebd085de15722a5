"""Pictures of runs have few pixels in tests of commands, unless a test looks at them."""

import pytest


@pytest.fixture
def full_pictures():
    """Ask for pictures as large as a user's."""


@pytest.fixture(autouse=True)
def small_pictures(request, monkeypatch):
    """Draw a run's pictures with a 25th of their pixels: they take most of a short run's time."""
    if "full_pictures" in request.fixturenames:
        return
    from asperity.drawing.renderer import contact
    from asperity.runs.run_scene import take_pictures

    monkeypatch.setitem(take_pictures.__kwdefaults__, "rows", 124)
    monkeypatch.setattr(contact, "_SHADOW", 180)
