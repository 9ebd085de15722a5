"""One servo and one page for all tests of a module, and what finds the page's parts."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))


def wait_until(what, seconds=180.0, message=lambda: ""):
    """Wait until a condition holds; fail after some time [s], with the client's message."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, f"after {seconds:g} s: {message()}"
        time.sleep(0.02)


@pytest.fixture
def until(request):
    """Return `wait_until`, which tells of the page, if there is one, when it waits in vain."""

    def message():
        if "page" not in request.fixturenames:
            return ""
        page = request.getfixturevalue("page")
        servo, out = page.servo, []
        for panel in page.panels:
            values = vars(panel).items()
            out += [f"{k}={v.value!r}" for k, v in values if hasattr(v, "value")]
        tab = request.getfixturevalue("tab") if "tab" in request.fixturenames else None
        notes = getattr(tab, "notes", [])
        state = (servo.state, servo.message, servo.generation, servo.config.source, servo.is_alive)
        return f"{state}, {notes}, {out}, clients {list(page.server.get_clients())}"

    return lambda what, seconds=180.0: wait_until(what, seconds, message)


# Not for longer than a module: a loop that goes on takes a core from whatever is tested next.
@pytest.fixture(scope="module")
def page():
    """Return a page on a plate, with few triangles, that the mouse moves."""
    pytest.importorskip("viser")
    from asperity.realtime.servo.scheduling import RealTime
    from asperity.scene.builtin import load_scene
    from asperity.viewer.app import live_panels
    from asperity.viewer.changes import on_coupling
    from asperity.viewer.server.server import serve
    from asperity.viewer.servo_client import ServoClient
    from asperity.viewer.session_config import SessionConfig

    # A loop that keeps a core busy leaves too little of two to a browser that draws by software.
    config = SessionConfig(
        on_coupling(load_scene("probe-plate")), "probe-plate", real_time=RealTime(busy_wait=False)
    )
    with ServoClient(config) as servo, serve(servo, lambda: live_panels(20_000), port=0) as made:
        yield made


@pytest.fixture
def servo(page):
    """Return the page's servo client, its hand in the air and its loop running."""
    made = page.servo
    if not made.is_alive:
        made.restart().result(timeout=300.0)
    made.point(made.config.first_pose)
    wait_until(lambda: is_shown(page))
    return made


def is_shown(page):
    """Whether every panel shows what the loop runs on now, and does not put it there later."""
    shown = (getattr(p, "_generation", page.servo.generation) for p in page.panels)
    return all(generation == page.servo.generation for generation in shown)


@pytest.fixture
def panel(page):
    """Return what gives a panel by its class's name."""
    return lambda name: next(p for p in page.panels if type(p).__name__ == name)
