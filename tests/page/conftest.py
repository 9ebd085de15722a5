"""One servo and one page for all tests of a module, and what finds the page's parts."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))


def pytest_collection_modifyitems(items):
    """Have one process do all tests that use the page: two servo loops are more than two cores."""
    for item in items:
        if "page" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.xdist_group("page"))


def wait_until(what, seconds=180.0):
    """Wait until something holds; fail if it does not within so long [s]."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def until():
    return wait_until


# Not for longer than a module: a loop that goes on takes a core from whatever is tested next.
@pytest.fixture(scope="module")
def page():
    """Return a page on a plate, with few triangles, that the mouse moves."""
    pytest.importorskip("viser")
    from asperity.page.changes import on_coupling
    from asperity.page.choice import Choice
    from asperity.page.link import Link
    from asperity.page.panels import live_panels
    from asperity.page.server import serve
    from asperity.scenes import load_scene

    choice = Choice(on_coupling(load_scene("probe-plate")), "probe-plate")
    with Link(choice) as link, serve(link, lambda: live_panels(20_000), port=0) as made:
        yield made


@pytest.fixture
def link(page):
    """Return the page's link, its hand in the air and its loop running."""
    made = page.link
    if not made.is_alive:
        made.restart().result(timeout=300.0)
    made.point(made.choice.first_pose)
    return made


@pytest.fixture
def panel(page):
    """Return what gives a panel by its class's name."""
    return lambda name: next(p for p in page.panels if type(p).__name__ == name)
