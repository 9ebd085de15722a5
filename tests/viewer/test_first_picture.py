"""What a page shows before its loop runs: right, and never half-made without a word."""

import threading
import time

import numpy as np
import pytest

pytest.importorskip("viser")

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.viewer.app import live_page
from asperity.viewer.changes import on_coupling
from asperity.viewer.drawables.stage import UNITS
from asperity.viewer.server.server import OpenServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig


@pytest.fixture
def servo():
    """Return a client that nobody has started."""
    client = ServoClient(SessionConfig(on_coupling(load_scene("probe-plate")), "probe-plate"))
    yield client
    client.close()


def test_a_server_says_that_the_page_is_being_made_until_it_is(servo, tmp_path):
    server = OpenServer(port=0)
    line = server._waiting
    assert "being made ready" in line.content
    with live_page(servo, tmp_path, 4_000, at=server) as page:
        assert page.url == server.url
        assert line._impl.removed
        status = next(p for p in page.panels if type(p).__name__ == "StatusPanel")
        deadline = time.monotonic() + 20.0
        while "probe-plate: starting ..." not in status._line.content:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        # The tool where its hand will begin, and no ghost beside it.
        view = next(p for p in page.panels if type(p).__name__ == "SceneView")
        np.testing.assert_allclose(view._tool.position, UNITS * servo.config.first_pose[:3])
        assert not view._ghost.visible
    server.close()  # again


def test_a_page_that_cannot_be_made_leaves_no_server(servo, tmp_path, monkeypatch):
    from asperity.viewer.panels.status import StatusPanel

    def failing(*_):
        raise RuntimeError("no panel")

    monkeypatch.setattr(StatusPanel, "build", failing)
    server = OpenServer(port=0)
    with pytest.raises(RuntimeError), live_page(servo, tmp_path, 4_000, at=server):
        pass
    assert server._closed


def test_what_is_asked_of_a_starting_loop_waits_or_is_refused(servo):
    with pytest.raises(AsperityError, match="still starting"):
        servo.change(friction=0.3)
    began = []
    servo._replace = lambda *_: began.append(threading.current_thread().name)
    asked = servo.restart(servo.config)
    time.sleep(0.1)
    assert not asked.done()
    servo.start()
    asked.result(timeout=10.0)
    assert began == ["MainThread", "asperity-restart_0"]
