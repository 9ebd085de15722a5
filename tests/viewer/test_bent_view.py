"""An elastic body in the page: it starts with one, which is drawn as the tool bends it."""

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.simulation.soft_engine import soft_engine
from asperity.viewer.drawables.shapes import detail_of, shapes_of
from asperity.viewer.panels.bent import Bent
from asperity.viewer.panels.skin import PRESSURE, Moved, skin_map
from asperity.viewer.panels.taxel_map import SteadyScale

pytest.importorskip("viser")


def block():
    table = {"spacing": 7e-3, "modes": 8, "pitch": 1e-3}
    return load_scene("elastic-block").changed(bodies={"block": {"elastic": table}})


def pressed(scene):
    pose = scene.start.copy()
    pose[2] -= 2e-3
    return pose


def test_vertices_follow_the_surface_at_rest_under_the_tool(until):
    scene = block()
    shapes = shapes_of(scene, 6000)
    bent = Bent()
    bent.begin(scene, shapes)
    own, tool = shapes
    assert bent.bends(own)
    assert not bent.bends(tool)
    bent.follow(scene, pressed(scene))
    until(lambda: bent._making.done())
    moved = bent.moved()
    assert [*moved] == [own.name]
    sunk = moved[own.name] - own.vertices
    engine = soft_engine(scene)
    engine.wrench(pressed(scene), 0.0)
    lowest = engine.displacements[:, 2].min()
    assert sunk[:, 2].min() == pytest.approx(lowest, rel=0.3)  # at the vertices that are drawn
    assert np.abs(sunk[own.vertices[:, 2] < -0.0135]).max() < 0.1 * abs(lowest)
    # What has not moved is not found again.
    bent.follow(scene, pressed(scene))
    assert bent._making is None
    bent.close()


def test_rigid_scenes_have_nothing_that_bends():
    scene = load_scene("probe-plate")
    shapes = shapes_of(scene, 4000)
    bent = Bent()
    bent.begin(scene, shapes)
    assert not any(bent.bends(shape) for shape in shapes)
    bent.follow(scene, scene.start)
    assert bent.moved() == {}
    bent.close()


def test_no_detail_of_it_is_drawn_where_it_was_at_rest():
    scene = block()
    pose = pressed(scene)
    drawn = detail_of(scene, pose, pose[:3] - [0.0, 0.0, 0.008], 4e-3, heights=True)
    assert not any("block" in shape.name for shape in drawn)


def test_the_map_shows_its_pressure():
    scene = block()
    engine = soft_engine(scene)
    pose = pressed(scene)
    scales = {False: SteadyScale(), True: SteadyScale()}
    shown = skin_map(engine, Moved(pose, pose, 0.0), PRESSURE, scales)
    rows, columns = engine.grid.taxels
    assert shown.image.shape[0] > shown.image.shape[1] * rows // columns
    assert shown.pressure == engine.skin.pressure.max() > 0.0
    assert shown.area == engine.skin.contact_area > 0.0


def test_the_page_starts_with_it_and_moves_its_vertices(until):
    from asperity.realtime.servo.scheduling import RealTime
    from asperity.viewer.app import live_panels
    from asperity.viewer.drawables.stage import UNITS
    from asperity.viewer.panels.scene_view import SceneView
    from asperity.viewer.server.server import serve
    from asperity.viewer.servo_client import ServoClient
    from asperity.viewer.session_config import SessionConfig
    from page_client import ScriptedTab

    config = SessionConfig(block(), "elastic-block", real_time=RealTime(busy_wait=False))
    with ServoClient(config) as servo, serve(servo, lambda: live_panels(6000), port=0) as page:
        until(lambda: servo.latest() is not None)
        view = next(panel for panel in page.panels if isinstance(panel, SceneView))
        (node,) = [node for node in view._nodes if node.name == "/scene/block-0"]
        rest = np.array(node.vertices)
        target = pressed(config.scene)
        with ScriptedTab(page.url):
            until(lambda: page.server.get_clients())
            servo.point(target)
            until(lambda: servo.latest().contact_count == 1)
            until(lambda: np.abs(node.vertices - rest).max() > 1e-4 * UNITS)
        servo.point(servo.config.first_pose)
        assert servo.is_alive
