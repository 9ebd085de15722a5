"""Scenes as users of MuJoCo write them."""

import codecs
import io
import threading

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

import asperity
from asperity.errors import AsperityError
from asperity.scene.mjcf import warnings_as_notes

RADIUS, K = 0.002, 400.0
WAVES = 0.5 * (1 + np.cos(2 * np.pi * np.arange(-16, 17) / 16))
SIZE = 'size=".02 .02 .001 .005"'
TOML = f'schema = 1\n[tool]\nbody = "tool"\n[force]\nstiffness = {K}\n'


def ball(more=""):
    return f'<geom type="sphere" size="{RADIUS}" {more}/>'


def tool(inside, more=""):
    return f'<body name="tool" pos="0 0 .01" {more}><freejoint/>{inside}</body>'


def plate(more="", name='name="plate"'):
    return f'<body {name}><geom type="box" size=".02 .02 .005" pos="0 0 -.005" {more}/></body>'


@pytest.fixture
def load(tmp_path):
    def write_and_load(*bodies, head="", toml=TOML, files=(), name="scene.xml"):
        text = f"<mujoco>{head}<worldbody>{''.join(bodies)}</worldbody></mujoco>"
        (tmp_path / name).write_bytes(text.encode())
        if toml is not None:
            (tmp_path / "scene.toml").write_bytes(
                toml if isinstance(toml, bytes) else toml.encode()
            )
        for file, content in dict(files).items():
            (tmp_path / file).parent.mkdir(exist_ok=True, parents=True)
            (tmp_path / file).write_bytes(content)
        return asperity.load_scene(tmp_path)

    return write_and_load


def noted(scene, *words):
    return any(all(word in note for word in words) for note in scene.notes)


def body(scene, name):
    return next(body for body in scene.bodies if body.name == name)


def picture(rows):
    stream = io.BytesIO()
    Image.fromarray(np.round(255 * rows).astype(np.uint8)).save(stream, "png")
    return stream.getvalue()


# Height fields


RAMP = np.outer(np.linspace(0, 1, 9), np.ones(7)) + np.linspace(0, 0.5, 7)
"""Rises along x by 0.5 and, in the file, downwards by 1."""


def inline(rows, name="waves", size=SIZE):
    values = " ".join(f"{value:.6g}" for value in np.asarray(rows).ravel())
    shape = f'nrow="{len(rows)}" ncol="{len(rows[0])}"'
    return f'<asset><hfield name="{name}" {shape} elevation="{values}" {size}/></asset>'


def of_mujoco(scene_xml, x, y):
    """Return the height of the highest surface at a place, as MuJoCo's rays see it."""
    model = mujoco.MjModel.from_xml_string(scene_xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom = np.zeros(1, dtype=np.int32)
    far = mujoco.mj_ray(model, data, [x, y, 1.0], [0, 0, -1.0], None, 1, -1, geom)
    return 1.0 - far


@pytest.mark.parametrize("from_file", [False, True])
def test_a_height_field_has_the_heights_that_mujoco_has(load, from_file):
    rows = RAMP / RAMP.max()
    geom = '<geom type="hfield" hfield="waves" pos=".001 .002 -.001"/>'
    parked = tool(ball(), "").replace('pos="0 0 .01"', 'pos=".5 0 .01"')
    files = {"a/waves.png": picture(rows)} if from_file else {}
    asset = f'<asset><hfield name="waves" file="a/waves.png" {SIZE}/></asset>'
    head = asset if from_file else inline(rows)
    scene = load(f'<body name="plate">{geom}</body>', parked, head=head, files=files)
    field, offset = body(scene, "plate").texture, body(scene, "plate").offset
    assert field.border == "clamp"
    for x, y in [(0.0, 0.0), (0.011, 0.002), (-0.012, 0.01), (0.001, -0.013), (0.015, 0.017)]:
        u, v = x - offset[0] + 0.5 * field.size[0], y - offset[1] + 0.5 * field.size[1]
        expected = of_mujoco(scene.xml, x, y)
        assert -0.001 + field.heights(u, v) == pytest.approx(expected, abs=2e-5)
    assert noted(scene, "height field 'waves' is a plate of 40 mm x 40 mm", "7 x 9 heights")


@pytest.mark.slow
def test_a_ball_on_the_crest_of_a_height_field(load):
    crest = np.tile(WAVES, (33, 1))
    geom = '<geom type="hfield" hfield="waves" pos="0 0 -.001"/>'
    scene = load(f'<body name="plate">{geom}</body>', tool(ball()), head=inline(crest))
    simulation = asperity.Simulation(scene)
    for z in np.linspace(2.5e-3, 1.9e-3, 30):
        wrench = simulation.step([0, 0, z, 1, 0, 0, 0])
    assert wrench[2] == pytest.approx(K * 1e-4, rel=0.02)


def test_height_fields_beside_others_turned_small_or_only_seen(load):
    geom = '<geom type="hfield" hfield="waves" euler="0 0 90"/>'
    plane = '<geom type="plane" size="1 1 .1" pos="0 0 -.2"/>'
    scene = load(geom, plane, tool(ball()), head=inline([[0, 1], [0, 1]]))
    assert noted(scene, "is a separate body, 'waves'")
    assert body(scene, "waves").texture.samples.shape == (5, 5)
    assert body(scene, "waves").texture.relief == pytest.approx(1e-3)
    assert body(scene, "world").texture is None
    seen = '<geom type="hfield" hfield="waves" contype="0" conaffinity="0"/>'
    scene = load(plate(), seen, tool(ball()), head=inline([[0, 1], [0, 1]]))
    assert not noted(scene, "height field")
    with pytest.raises(AsperityError, match="a height field is fixed to the tool"):
        load(plate(), tool(f"{ball()}<body>{geom}</body>"), head=inline([[0, 1], [0, 1]]))


def test_a_scene_with_a_height_field_is_saved_and_changed(load, tmp_path):
    geom = '<geom type="hfield" hfield="waves"/>'
    asset = f'<asset><hfield name="waves" file="waves.png" {SIZE}/></asset>'
    files = {"waves.png": picture(RAMP / 1.5)}
    scene = load(f'<body name="plate">{geom}</body>', tool(ball()), head=asset, files=files)
    scene.save(tmp_path / "saved")
    again = asperity.load_scene(tmp_path / "saved")
    before, after = body(scene, "plate").texture, body(again, "plate").texture
    assert after.samples == pytest.approx(before.samples, abs=1e-8)
    own = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4}
    changed = scene.changed(bodies={"plate": {"texture": own}})
    assert body(changed, "plate").texture.relief == pytest.approx(2e-4, rel=0.01)


# The tool


def mass_of(scene):
    model = scene.model
    i = model.body(scene.tool).id
    return model.body_mass[i], model.body_ipos[i], model.body_inertia[i]


def test_rigid_bodies_on_the_tool_are_part_of_it(load):
    tip = f'''<body pos="0 0 -.01" euler="90 0 0">
        <geom type="capsule" fromto="0 0 0 0 .01 0" size="{RADIUS}"/></body>'''
    handle = '<body name="handle" pos="0 0 .02"><geom type="box" size=".001 .002 .01"/></body>'
    deep = f'<body name="a" pos=".001 0 0">{tip}</body>'
    scene = load(plate(), tool(ball() + deep + handle))
    geoms = body(scene, "tool").geoms
    assert [geom.kind for geom in geoms] == ["sphere", "capsule", "box"]
    assert geoms[1].position == pytest.approx([0.001, 0, -0.005])
    assert geoms[2].position == pytest.approx([0, 0, 0.02])
    assert noted(scene, "'handle'", "fixed to the tool 'tool' and part of it")
    flat = f"""{ball()}<geom type="capsule" fromto=".001 0 -.01 .001 0 0" size="{RADIUS}"/>
        <geom type="box" size=".001 .002 .01" pos="0 0 .02"/>"""
    mass, centre, inertia = mass_of(scene)
    expected = mass_of(load(plate(), tool(flat)))
    assert mass == pytest.approx(expected[0])
    assert centre == pytest.approx(expected[1], abs=1e-9)
    assert np.sort(inertia) == pytest.approx(np.sort(expected[2]), rel=1e-6)
    i = scene.model.body("tool").id
    assert scene.model.body_subtreemass[i] == pytest.approx(mass)


def test_a_mesh_and_an_explicit_inertia_on_the_tool(load):
    corners = "0 0 0 .01 0 0 0 .01 0 0 0 .02"
    head = f'<asset><mesh name="m" vertex="{corners}"/></asset>'
    child = """<body name="c" pos="0 0 .003" quat="0 1 0 0">
        <inertial mass=".5" pos="0 0 0" diaginertia="1e-5 1e-5 1e-5"/>
        <geom type="mesh" mesh="m" pos=".001 0 0"/></body>"""
    scene = load(plate(), tool(child), head=head)
    found = body(scene, "tool").mesh
    low, high = found.vertices.min(axis=0), found.vertices.max(axis=0)
    assert low == pytest.approx([0.001, -0.01, -0.017], abs=1e-6)
    assert high == pytest.approx([0.011, 0, 0.003], abs=1e-6)
    assert mass_of(scene)[0] == pytest.approx(0.5)


def test_a_tool_with_joints_inside_is_refused(load):
    hinged = f'<body name="finger"><joint axis="1 0 0"/>{ball()}</body>'
    with pytest.raises(AsperityError, match="'finger' has a joint; only the tool"):
        load(plate(), tool(ball() + hinged))


# Names, friction and what is not used


def test_bodies_without_a_name_get_one(load):
    named = '<geom name="floor" type="box" size=".1 .1 .01" pos="0 0 -.1"/>'
    two = f"<body>{named}</body><body>{named.replace('floor', 'b')}</body>"
    scene = load(plate(name=""), two, tool(ball()))
    assert [b.name for b in scene.bodies] == ["body-1", "floor", "b", "tool"]
    assert noted(scene, "a body without a name is called 'floor'")


def test_friction_of_geoms_is_taken_over(load):
    scene = load(plate('friction="0.8"'), tool(ball('friction="0.3"')))
    assert scene.force.friction == pytest.approx(0.8)
    assert noted(scene, "friction is 0.8, as MuJoCo takes it")
    scene = load(plate('friction="0.8"'), tool(ball('friction="0.3" priority="1"')))
    assert scene.force.friction == pytest.approx(0.3)
    head = '<default><geom friction=".4"/></default>'
    assert load(plate(), tool(ball()), head=head).force.friction == pytest.approx(0.4)
    frictionless = load(plate('friction="0.8" condim="1"'), tool(ball('condim="1"')))
    assert frictionless.force.friction == 0.0
    scene = load(plate('friction="0.8"'), tool(ball()), toml=TOML + "friction = 0.1\n")
    assert scene.force.friction == pytest.approx(0.1)
    assert noted(scene, "friction is 0.1, of force.friction; geoms have 1")
    beside = plate('friction="0.2" pos="1 0 0"', 'name="other"').replace('pos="0 0 -.005"', "")
    scene = load(plate('friction="0.8"'), beside, tool(ball('friction="0.1"')))
    assert scene.force.friction == 0.0
    assert noted(scene, "friction is that of the geoms, the larger one of two: 0.1, 0.2, 0.8")
    assert {b.name: b.friction for b in scene.bodies}["other"] == 0.2
    assert load(plate(), tool(ball())).force.friction == 0.0


def drag(scene, x):
    """Return the ratio of tangential to normal force of the tool, drawn along y at a place."""
    simulation = asperity.Simulation(scene)
    pose = np.array([x, 0.0, RADIUS - 1e-4, 1.0, 0.0, 0.0, 0.0])
    for k in range(40):
        pose[1] = 2e-5 * k
        force = simulation.step(pose)[:3]
    return -force[1] / force[2]


def test_geoms_have_the_friction_of_their_own(load):
    def box(x, more):
        return f'<geom type="box" size=".01 .02 .005" pos="{x} 0 -.005" {more}/>'

    halves = box(-0.01, 'friction=".5"') + box(0.01, 'friction=".2" name="right"')
    scene = load(f'<body name="plate">{halves}</body>', tool(ball('friction=".1"')))
    assert scene.force.friction == 0.0
    assert drag(scene, -0.005) == pytest.approx(0.5, rel=1e-3)
    assert drag(scene, 0.005) == pytest.approx(0.2, rel=1e-3)
    # The document comes first, for a geom as for the whole.
    toml = TOML + "[bodies.plate.geoms.right]\nfriction = 0.3\n"
    scene = load(f'<body name="plate">{halves}</body>', tool(ball('friction=".1"')), toml=toml)
    assert drag(scene, -0.005) == pytest.approx(0.5, rel=1e-3)
    assert drag(scene, 0.005) == pytest.approx(0.3, rel=1e-3)
    scene = load(
        f'<body name="plate">{halves}</body>', tool(ball()), toml=TOML + "friction = 0.4\n"
    )
    assert drag(scene, -0.005) == pytest.approx(0.4, rel=1e-3)
    # Less than the tool's own, by priority: no values of single geoms give that.
    halves = halves.replace('friction=".2"', 'friction=".2" priority="1"')
    one = 'friction=".3"'
    scene = load(
        f'<body name="plate">{halves}</body>', tool(ball(one) + ball(one.replace("3", "9")))
    )
    assert noted(scene, "friction of geoms is not used: by priority and condim it is 0.2, 0.5, 0.9")


def test_what_is_not_used_is_noted(load):
    scene = load(plate('margin=".001" solref=".01 1"'), tool(ball()))
    assert noted(scene, "margin of geoms is not used: contact begins where surfaces touch")
    assert noted(scene, "solref of geoms is not used: stiffness and damping are those of [force]")
    assert load(plate(), tool(ball())).notes == ()


# Files


@pytest.mark.parametrize(
    "toml",
    [codecs.BOM_UTF8 + TOML.encode(), TOML.encode("utf-16"), TOML.replace("\n", "\r\n").encode()],
)
def test_scene_toml_of_windows(load, toml):
    assert load(plate(), tool(ball()), toml=toml).force.stiffness == K


def test_a_folder_without_scene_toml_runs_as_by_default_and_can_be_saved(load, tmp_path):
    scene = load(plate(), tool(ball()), toml=None)
    assert scene.tool == "tool"
    assert noted(scene, "there is no scene.toml: the tool is 'tool'", "Scene.save")
    scene.save(tmp_path / "saved")
    assert asperity.load_scene(tmp_path / "saved").tool == "tool"
    nameless = tool(ball()).replace('name="tool"', "")
    scene = load(plate(), nameless, toml=None)
    assert scene.tool == "body-2"
    with pytest.raises(AsperityError, match="bodies with a freejoint: none; valid: one"):
        load(plate(), toml=None)
    with pytest.raises(AsperityError, match="bodies with a freejoint: 'tool', 'b'; valid: one"):
        load(plate(), tool(ball()), tool(ball()).replace('"tool"', '"b"'), toml=None)


def test_a_file_of_another_name_and_urdf(tmp_path):
    urdf = """<robot name="r"><link name="world"/><link name="tool">
      <inertial><mass value="0.1"/>
        <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><sphere radius="0.002"/></geometry></collision></link>
      <joint name="j" type="floating"><parent link="world"/><child link="tool"/></joint>
      <link name="base">
        <collision><geometry><box size="0.04 0.04 0.01"/></geometry></collision></link>
      <joint name="f" type="fixed"><parent link="world"/><child link="base"/>
        <origin xyz="0 0 -0.005"/></joint>
    </robot>"""
    (tmp_path / "robot.urdf").write_text(urdf)
    for path in (tmp_path, tmp_path / "robot.urdf"):
        scene = asperity.load_scene(path)
        assert scene.name == "robot"
        assert scene.tool == "tool"
        assert len(scene.bodies) == 2
    (tmp_path / "other.xml").write_text(
        f"<mujoco><worldbody>{plate()}{tool(ball())}</worldbody></mujoco>"
    )
    assert asperity.load_scene(tmp_path / "other.xml").name == "other"
    with pytest.raises(AsperityError, match=r"no such file: .*scene.xml.* other.xml, robot.urdf"):
        asperity.load_scene(tmp_path)


def test_include_defaults_and_assets_in_folders(load):
    corners = [(x, y, z) for x in (-20, 20) for y in (-20, 20) for z in (-10, 0)]
    obj = "".join("v {} {} {}\n".format(*c) for c in corners)
    quads = (1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)
    obj += "".join("f {} {} {} {}\n".format(*q) for q in quads)
    head = """<compiler meshdir="parts" assetdir="none"/>
      <default><default class="red"><geom rgba="1 0 0 1"/></default></default>
      <asset><mesh name="plate" file="plate.obj" scale=".001 .001 .001"/></asset>"""
    tip = f"<mujocoinclude><body name='tip'>{ball()}</body></mujocoinclude>"
    scene = load('<body name="plate"><geom type="mesh" mesh="plate" class="red"/></body>',
                 tool('<include file="tip.xml"/>'), head=head,
                 files={"parts/plate.obj": obj.encode(), "tip.xml": tip.encode()})  # fmt: skip
    assert [geom.kind for geom in body(scene, "tool").geoms] == ["sphere"]
    assert np.ptp(body(scene, "plate").mesh.vertices, axis=0) == pytest.approx([0.04, 0.04, 0.01])


@pytest.mark.parametrize(
    ("xml", "said"),
    [
        ("<mujoco><asset><hfield file='no.png' size='1 1 1 1'/></asset></mujoco>",
         "names the file 'no.png', which cannot be opened; valid"),
        ("<mujoco><worldbody><geom type='sphere'", "is not MJCF"),
        ("no xml", "is not MJCF"),
        (" \n", "the file is empty"),
        ("<mujoco>\n<worldbody></mujoco>", r"its XML is damaged in line 2 at <worldbody>"),
        ("<mujoco><worldbody><geom sise='1'/></worldbody></mujoco>",
         r"is not MJCF: unrecognized attribute: 'sise'"),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_refused_in_one_line(tmp_path, xml, said):
    (tmp_path / "scene.xml").write_text(xml)
    (tmp_path / "scene.toml").write_text(TOML)
    with pytest.raises(AsperityError, match=said) as caught:
        asperity.load_scene(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("toml", [TOML, None])
def test_a_mocap_body_is_held_with_what_is_fixed_to_it(load, toml):
    tip = f'<body name="tip" pos="0 0 -.001">{ball()}</body>'
    scene = load(plate(), f'<body name="tool" mocap="true" pos="0 0 .01">{tip}</body>', toml=toml)
    assert scene.tool == "tool"
    assert noted(scene, "the tool is a mocap body")
    assert noted(scene, "'tip': fixed to the tool 'tool' and part of it")
    assert scene.start[:3] == pytest.approx([0, 0, 0.01])
    with pytest.raises(AsperityError, match="no freejoint; valid: a freejoint alone"):
        load(plate(), f'<body name="tool"><joint type="slide"/>{ball()}</body>')


@pytest.mark.parametrize(
    "start",
    ["package://robot_description", "package://other", "model://robot_description", "file://{}"],
)
def test_packages_of_ros_are_folders(tmp_path, start):
    start = start.format(tmp_path / "robot_description")
    mesh = trimesh.creation.box((0.04, 0.04, 0.01))
    (tmp_path / "robot_description" / "meshes").mkdir(parents=True)
    (tmp_path / "robot_description" / "urdf").mkdir()
    mesh.export(tmp_path / "robot_description" / "meshes" / "plate.stl")
    path = tmp_path / "robot_description" / "urdf" / "r.urdf"
    sphere = f'<collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>'
    path.write_text(
        f'<robot name="r"><link name="world"><collision><geometry><mesh filename="{start}'
        '/meshes/plate.stl"/></geometry></collision></link><link name="tool"><inertial>'
        '<mass value="0.1"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/>'
        f'</inertial>{sphere}</link><joint name="k" type="floating"><parent link="world"/>'
        '<child link="tool"/></joint></robot>'
    )
    scene = asperity.load_scene(path)
    assert np.ptp(body(scene, "world").mesh.vertices, axis=0) == pytest.approx([0.04, 0.04, 0.01])


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("package://pkg/meshes/a.stl", "cannot be opened; .*or from that of the package"),
        ("a.dae", r"names the mesh 'a\.dae', of a kind that is not read; valid: \.stl, \.obj"),
    ],
)
def test_meshes_of_ros_that_are_not_read_are_named(tmp_path, file: str, words: str) -> None:
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r"><link name="base"><collision><geometry><mesh filename="{file}"/>'
        "</geometry></collision></link></robot>"
    )
    with pytest.raises(AsperityError, match=words) as refused:
        asperity.load_scene(tmp_path / "r.urdf")
    assert len(str(refused.value).replace(str(tmp_path), "")) <= 300


def test_a_tool_of_metres_and_one_that_touches_nothing_are_doubted(load) -> None:
    large = tool(f'<geom type="sphere" size="{1e3 * RADIUS}"/>')
    assert noted(load(plate(), large), "is 'tool' in m? It is 4 m across")
    assert noted(load(plate('contype="2" conaffinity="2"'), tool(ball())), "touches nothing")
    head = '<option o_friction=".2 .2 .005 .0001 .0001"><flag override="enable"/></option>'
    assert noted(load(plate(), tool(ball()), head=head), "not used", "o_friction")
    assert not load(plate(), tool(ball())).notes


def test_macros_of_xacro_are_named(tmp_path) -> None:
    for inside in ('<xacro:property name="w" value="1"/>', '<link name="${prefix}base"/>'):
        (tmp_path / "r.urdf").write_text(f'<robot name="r">{inside}</robot>')
        with pytest.raises(AsperityError, match=r"has macros of xacro; valid: .*xacro r.urdf") as e:
            asperity.load_scene(tmp_path / "r.urdf")
        assert "MJCF" not in str(e.value)


def test_values_that_are_hardly_in_si_units_are_doubted(load) -> None:
    motion = '[trajectory]\nkind = "slide"\nspeed = 83.0\npress_force = 580.0\n'
    scene = load(plate(), tool(ball()), toml=TOML + "friction = 30.0\n" + motion)
    assert noted(scene, "is trajectory.speed = 83 m/s right? Usual: 10 m/s at most")
    assert noted(scene, "is trajectory.press_force = 580 N right?")
    assert noted(scene, "is force.friction = 30 right?")


def test_a_scene_toml_in_another_encoding_is_named(load) -> None:
    with pytest.raises(AsperityError, match="line 7 is no text in UTF-8; valid: saved as UTF-8"):
        load(plate(), tool(ball()), toml=(TOML + "\n# Rauheit 3 µm\n").encode("latin-1"))


def test_threads_that_read_scenes_at_once_leave_no_trace_in_mujoco():
    """The first to enter may be the first to leave: MuJoCo knows one function for all threads."""
    inside, left = threading.Event(), threading.Event()

    def outlast():
        with warnings_as_notes([]):
            inside.set()
            left.wait(10.0)

    other = threading.Thread(target=outlast)
    with warnings_as_notes([]):
        other.start()
        assert inside.wait(10.0)
    left.set()
    other.join()
    assert mujoco.get_mju_user_warning() is None


def test_warnings_of_mujoco_are_notes_and_not_printed(load, capfd) -> None:
    head = '<compiler settotalmass=".2"/>'
    if mujoco.__version__.startswith("4"):  # others do not warn of it
        assert noted(load(plate(), tool(ball()), head=head), "MuJoCo:", "settotalmass")
    load(plate(), tool(ball()), head=head)
    assert capfd.readouterr() == ("", "")
    assert mujoco.get_mju_user_warning() is None


def test_contact_exclusions_hold_and_are_noted(load) -> None:
    pair = '<exclude body1="plate" body2="tool"/>'
    scene = load(plate(), tool(ball()), head=f"<contact>{pair}</contact>")
    assert noted(scene, "'tool' does not touch plate, as <exclude> states")
    pressed = asperity.Simulation(scene).step([0, 0, RADIUS - 1e-4, 1, 0, 0, 0])
    assert not np.any(pressed)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("stifness = 3", r"unknown key force\.stifness \(did you mean force\.stiffness\?\); valid"),
        (f"friction = 4{'0' * 400}", r"force\.friction must be finite"),
    ],
)
def test_what_scene_toml_has_wrong_is_one_short_line(load, tmp_path, line: str, said: str) -> None:
    with pytest.raises(AsperityError, match=said) as refused:
        load(plate(), tool(ball()), toml=TOML + line + "\n")
    assert len(str(refused.value).replace(str(tmp_path), "")) <= 300


def test_a_tool_beside_what_is_only_seen_is_doubted(load) -> None:
    seen = load(plate('contype="0" conaffinity="0"'), tool(ball()))
    assert noted(seen, "all other geoms are only seen: 'tool' touches nothing")


def test_a_file_named_with_backslashes_is_found_and_saved(load, tmp_path) -> None:
    picture = io.BytesIO()
    Image.fromarray(np.round(255 * np.tile(WAVES, (33, 1))).astype(np.uint8)).save(picture, "png")
    texture = (
        "[bodies.plate.texture]\nfile = 'maps\\a.png'\npixel_size = 1e-4\nheight_range = 1e-5\n"
    )
    scene = load(
        plate(), tool(ball()), toml=TOML + texture, files={"maps/a.png": picture.getvalue()}
    )
    assert body(scene, "plate").texture is not None
    scene.save(tmp_path / "saved")
    assert body(asperity.load_scene(tmp_path / "saved"), "plate").texture is not None


def test_a_picture_of_a_material_need_not_be_there(load) -> None:
    head = (
        '<asset><texture name="t" type="2d" file="no.png"/><material name="m" texture="t"/></asset>'
    )
    scene = load(plate('material="m"'), tool(ball()), head=head)
    assert noted(scene, "pictures on materials are left out: no.png")


def test_a_tool_without_geoms_and_contact_that_is_switched_off_are_named(load) -> None:
    bare = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    with pytest.raises(AsperityError, match=r"'tool', no .*<collision>.*can be touched: plate"):
        load(plate(), tool(bare))
    off = load(plate(), tool(ball()), head='<option><flag contact="disable"/></option>')
    assert noted(off, "by the flags of option 'tool' touches nothing")
