"""A running MuJoCo model on a page in the browser."""

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity.cli.main import main
from asperity.errors import AsperityError

pytest.importorskip("viser")
from asperity.mujoco.model_panel import ModelPanel
from asperity.mujoco.page import ModelPage, contact_forces
from asperity.viewer.drawables.stage import UNITS

XML = """<mujoco><option timestep="0.001" cone="elliptic"/>
  <custom><text name="texture:table" data="knurl:2mm"/></custom>
  <worldbody>
    <geom name="table" type="box" size=".02 .02 .005" pos="0 0 -.005"/>
    <geom type="mesh" mesh="wedge" pos=".05 0 0"/>
    <body name="ball" pos="0 0 .0051"><freejoint/><geom size=".005" mass=".02"/></body>
  </worldbody>
  <asset><mesh name="wedge" vertex="0 0 0 .01 0 0 0 .01 0 0 0 .01"/></asset>
</mujoco>"""


def test_bodies_and_forces_are_where_the_model_has_them():
    model = mujoco.MjModel.from_xml_string(XML)
    data, time = mujoco.MjData(model), [0.0]
    surfaces = textured.attach(model)
    surfaces.step(data, 400)
    with ModelPage(surfaces, port=0, triangles=5000, now=lambda: time[0]) as page:
        assert page.show(data)
        ball = page._frames[model.body("ball").id]
        np.testing.assert_allclose(ball.position, UNITS * data.body("ball").xpos, rtol=1e-6)
        points, forces = contact_forces(model, data)
        # On the ball: the table, which comes second, cannot move.
        np.testing.assert_allclose(forces.sum(axis=0), data.qfrc_constraint[:3], atol=1e-9)
        assert forces[:, 2].sum() > 0.01
        arrows = np.asarray(page._arrows.points)
        np.testing.assert_allclose(arrows[:, 0], UNITS * points, atol=1e-4)
        along = arrows[:, 1] - arrows[:, 0]
        np.testing.assert_allclose(np.cross(along, forces), 0.0, atol=1e-4)
        # No more pictures than a page shows, however often it is asked to.
        time[0] = 0.01
        assert not page.show(data)
        time[0] = 0.05
        assert page.show(data)


def test_what_cannot_be_shown_is_refused():
    surfaces = textured.attach(mujoco.MjModel.from_xml_string(XML))
    with pytest.raises(AsperityError, match="triangles must lie between"):
        ModelPage(surfaces, port=0, triangles=3)


def test_a_model_file_runs_on_a_page(tmp_path, capsys):
    file = tmp_path / "model.xml"
    file.write_text(XML, "utf-8")
    options = ["--simulate", "--no-open", "--port", "0", "--seconds", "0.5"]
    assert main(["view", str(file), *options]) == 0
    printed = capsys.readouterr().out
    assert "http://127.0.0.1:" in printed
    assert float(printed.split("ended after ")[1].split()[0]) > 0.1
    assert main(["view", str(tmp_path / "none.xml"), *options]) == 2
    assert "no model file" in capsys.readouterr().err


def test_a_model_is_paused_moved_and_reset_from_the_page():
    xml = XML.replace("<freejoint/>", '<joint name="z" type="slide" axis="0 0 1"/>').replace(
        "</mujoco>",
        """<actuator><motor joint="z" name="push" ctrlrange="-1 2"/><motor joint="z"/></actuator>
        <keyframe><key qpos="0.5" ctrl="0.25 7" time="3"/></keyframe></mujoco>""",
    )
    surfaces = textured.attach(mujoco.MjModel.from_xml_string(xml))
    data = mujoco.MjData(surfaces.model)
    with ModelPage(surfaces, port=0, triangles=5000) as page:
        panel = ModelPanel(page.server, surfaces)
        panel.start(data)
        assert (data.time, data.qpos[0]) == (3.0, 0.5)
        assert [control.value for control in panel._controls] == [0.25, 7.0]
        panel._changed[0] = -1.0
        assert not panel.act(data)
        assert data.ctrl.tolist() == [-1.0, 7.0]
        surfaces.step(data, 10)
        panel._pause(None)
        panel.show(data, np.array([[0.0, 3.0, 4.0]]))
        assert panel.is_paused
        assert "**3.01 s** · paused" in panel._state.content
        assert "contacts: 1 · largest force: 5.00 N" in panel._state.content
        panel._reset(None)
        assert panel.act(data)
        assert (data.time, data.ctrl.tolist()) == (3.0, [0.25, 7.0])


def test_flexes_move_and_a_plane_is_the_ground():
    xml = """<mujoco><worldbody>
      <geom name="floor" type="plane" size="1 1 .1"/>
      <flexcomp name="pad" type="grid" dim="2" count="4 4 1" spacing=".02 .02 .02" pos="0 0 .1"
        radius=".002" mass=".1" rgba=".9 .2 .1 1"><edge equality="true"/>
        <contact selfcollide="none"/></flexcomp>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data, surfaces = mujoco.MjData(model), textured.attach(model, {"pad": "knurl:3mm"})
    with ModelPage(surfaces, port=0, triangles=5000) as page:
        drawn = {name for name in page.server.scene._handle_from_node_name}
        assert "/ground" in drawn
        assert not any(name.endswith("floor") for name in drawn)
        ((_, mesh),) = page._flexes
        assert len(mesh.faces) == 18
        assert mesh.color == (230, 51, 26)
        before = np.array(mesh.vertices)
        surfaces.step(data, 50)
        page.show(data)
        fallen = before[:, 2] - mesh.vertices[:, 2]
        np.testing.assert_allclose(fallen, UNITS * 0.5 * 9.81 * 0.1**2, rtol=0.1)
