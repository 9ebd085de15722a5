"""Wrong poses, bodies and settings: one line that names the value and what is valid."""

import dataclasses
import math
import re
from functools import partial

import mujoco
import numpy as np
import pytest
from naive_engine import AT_REST, ball, engine_for, plate, pose, waves

from asperity.contact.body_pair import BodyPair
from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation
from asperity.texture.height_field import HeightField


def refused(call, *words):
    """Run what must be refused; hold its message to one line with these words."""
    with pytest.raises(AsperityError) as caught:
        call()
    said = str(caught.value)
    assert "\n" not in said
    for word in words:
        assert word in said, said


# Poses.

POSES = {
    "nan": [0, 0, math.nan, 1, 0, 0, 0],
    "inf": [math.inf, 0, 0, 1, 0, 0, 0],
    "-inf": [0, 0, 0, 1, 0, 0, -math.inf],
    "six": [0, 0, 0, 1, 0, 0],
    "eight": [0, 0, 0, 1, 0, 0, 0, 0],
    "table": [[0, 0, 0, 1, 0, 0, 0]],
    "text": "here",
    "texts": ["x", "y", "z", 1, 0, 0, 0],
    "none": None,
    "complex": [0, 0, 0, 1j, 0, 0, 0],
}
QUATERNIONS = {
    "zero": [0, 0, 0, 0], "half": [0.5, 0, 0, 0], "two": [2, 0, 0, 0], "huge": [1e200, 0, 0, 0],
    "degrees": [1, 90, 0, 0],
}  # fmt: skip


@pytest.fixture(scope="module")
def simulation():
    return Simulation(load_scene("probe-plate"))


@pytest.fixture(scope="module")
def pair():
    return BodyPair(ball(), plate(waves(20e-6, 1e-3)))


@pytest.mark.parametrize("name", POSES)
def test_poses_of_a_simulation_that_are_none_are_refused(simulation, name):
    before = simulation.state
    refused(lambda: simulation.step(POSES[name]), "handle pose", "must be")
    assert simulation.state is before


@pytest.mark.parametrize("name", QUATERNIONS)
def test_quaternions_that_do_not_turn_are_refused(simulation, pair, name):
    wrong = [0, 0, 1e-3, *QUATERNIONS[name]]
    words = ("finite",) if name == "huge" else ("quaternion", "must have norm 1")
    refused(lambda: simulation.step(wrong), *words)
    for poses in ((wrong, AT_REST), (AT_REST, wrong)):
        refused(lambda poses=poses: pair.depth(*poses, (0, 0, 1)), "quaternion", "length 1")


def test_a_refused_pose_leaves_the_next_wrench_as_it_was():
    """Friction and all: as if the pose had never been asked for."""
    path = [pose(x, 0, 1.2e-3) for x in np.linspace(0, 1e-4, 9)]
    scene = load_scene("probe-plate").changed(force={"friction": 0.5})
    runs = []
    for hostile in (False, True):
        simulation = Simulation(scene)
        runs.append([])
        for at in path:
            runs[-1].append(simulation.step(at))
            if hostile:
                for wrong in (at * math.nan, at * 2.0):
                    refused(partial(simulation.step, wrong))
    np.testing.assert_array_equal(*runs)


@pytest.mark.parametrize("name", POSES)
def test_poses_of_a_pair_that_are_none_are_refused(pair, name):
    for poses in ((POSES[name], AT_REST), (AT_REST, POSES[name])):
        refused(lambda poses=poses: pair.depth(*poses, (0, 0, 1)), "pose must be 7 finite numbers")


@pytest.mark.parametrize(
    "normal", [(0, 0, 0), (0, 0, 2), (0, 1), (math.nan, 0, 1), (math.inf, 0, 0), "up", None]
)
def test_normals_that_are_none_are_refused(pair, normal):
    refused(lambda: pair.depth(AT_REST, AT_REST, normal), "normal must")


@pytest.mark.parametrize("value", [0.0, -1e-9, math.nan, math.inf, "small", None])
def test_a_pair_needs_a_tolerance(value):
    refused(lambda: BodyPair(ball(), plate(), tolerance=value), "tolerance", repr(value))


@pytest.mark.parametrize("value", [0, 99, -1, math.nan, 1e12, None])
def test_a_pair_needs_a_budget(value):
    refused(lambda: BodyPair(ball(), plate(), max_nodes=value), "max_nodes", "between", repr(value))


# Settings.

POSITIVE = (
    "stiffness", "object_stiffness", "bristle_stiffness", "step", "lever", "window", "softness",
    "soft_area", "ho_gain", "noise_bandwidth", "tolerance",
)  # fmt: skip
ANY_NUMBER = (*POSITIVE, "friction", "dissipation", "noise_level", "patch_radius")
WHOLE = ("grid", "max_nodes", "seed")


def test_every_setting_is_in_the_lists_above():
    names = {field.name for field in dataclasses.fields(ForceSettings)}
    assert names == {*ANY_NUMBER, *WHOLE, "law", "gradient", "edge_fade"}


def test_the_fade_at_edges_is_without_effect():
    with pytest.warns(DeprecationWarning, match="without effect"):
        ForceSettings(edge_fade=1e-3)


@pytest.mark.parametrize("name", ANY_NUMBER)
@pytest.mark.parametrize("value", [-1.0, -1e-300, math.nan, math.inf, -math.inf, "400", [1.0]])
def test_settings_that_are_no_number_or_negative_are_refused(name, value):
    refused(lambda: ForceSettings(**{name: value}), name, repr(value))


@pytest.mark.parametrize("name", POSITIVE)
def test_settings_that_must_not_be_zero(name):
    refused(lambda: ForceSettings(**{name: 0.0}), name, "0.0")


@pytest.mark.parametrize("name", ["friction", "noise_level", "dissipation"])
def test_settings_that_may_be_zero(name):
    assert getattr(ForceSettings(**{name: 0}), name) == 0


@pytest.mark.parametrize("name", ANY_NUMBER)
@pytest.mark.parametrize("value", [1e-320, 1e308])
def test_settings_at_the_ends_of_floats_are_refused_or_harmless(name, value):
    """Whatever is let through gives finite wrenches."""
    kinds = {"softness": "soft", "soft_area": "soft", "window": "soft"}
    kinds |= {"step": "differences", "lever": "differences"}
    laws = {"ho_gain": "ho", "noise_level": "siira-pai", "noise_bandwidth": "siira-pai"}
    more = {"gradient": kinds.get(name, "exact"), "law": laws.get(name, "otaduy-lin")}
    if name == "bristle_stiffness":
        more["friction"] = 0.5
    try:
        engine = engine_for(ball(), plate(waves(20e-6, 1e-3)), **{name: value}, **more)
    except AsperityError as error:
        assert name in str(error)  # noqa: PT017
        assert "\n" not in str(error)  # noqa: PT017
        return
    for x in (0.0, 1e-5, 3e-4):
        assert np.isfinite(engine.wrench(pose(x, 0, 1.4e-3), 1e-3)).all()


@pytest.mark.parametrize("name", WHOLE)
@pytest.mark.parametrize("value", [-1, 1.5, 200.0, True, "100", None, math.nan, 2**70])
def test_settings_that_are_no_whole_number_in_range(name, value):
    refused(lambda: ForceSettings(**{name: value}), name, repr(value))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law": "otaduy"}, ["law", "'otaduy'", "did you mean 'otaduy-lin'", "minsky, ho"]),
        ({"law": None}, ["law", "None", "otaduy-lin"]),
        ({"law": ["ho"]}, ["law", "['ho']", "otaduy-lin"]),
        ({"gradient": "softer"}, ["gradient", "did you mean 'soft'", "exact, differences"]),
        ({"gradient": "soft", "law": "ho"}, ["gradient 'soft'", "'otaduy-lin'", "'ho'"]),
        ({"grid": 3}, ["grid", "between 4 and 1000", "3"]),
        ({"max_nodes": 99}, ["max_nodes", "between 100", "99"]),
    ],
)
def test_choices_and_ranges_are_named(change, words):
    refused(lambda: ForceSettings(**change), *words)


# Bodies.


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Geom("cone", (1e-3,)), ["kind of geom 'cone'", "sphere", "box"]),
        (lambda: Geom("spere", (1e-3,)), ["did you mean 'sphere'"]),
        (lambda: Geom("sphere", (0.0,)), ["sphere", "above 0", "0.0"]),
        (lambda: Geom("sphere", (-1e-3,)), ["sphere", "above 0", "-0.001"]),
        (lambda: Geom("box", (1e-3, 1e-3, math.nan)), ["box", "above 0", "nan"]),
        (lambda: Geom("box", (1e-3, math.inf, 1e-3)), ["box", "above 0", "inf"]),
        (lambda: Geom("box", (1e-3, 1e-3)), ["box needs 3 sizes"]),
        (lambda: Geom("capsule", (1e-3,)), ["capsule needs 2 sizes"]),
        (lambda: Geom("plane", (-1.0, 1.0, 0.1)), ["plane", "-1.0"]),
        (lambda: Geom("sphere", ("1 mm",)), ["sphere", "'1 mm'"]),
        (lambda: Geom("sphere", 1e-3), ["sphere", "0.001"]),
        (lambda: Geom("sphere", (1e-3,), (0, 0)), ["position", "3 finite numbers"]),
        (lambda: Geom("sphere", (1e-3,), (0, 0, math.nan)), ["position", "nan"]),
        (lambda: Geom("sphere", (1e-3,), (0, 0, 0), (1, 1, 0, 0)), ["quaternion", "length 1"]),
        (lambda: Geom("sphere", (1e-3,), (0, 0, 0), (0, 0, 0, 0)), ["quaternion", "length 1"]),
        (lambda: Body("b", []), ["'b'", "one at least"]),
        (lambda: Body("b", [Geom("box", (1e-3,) * 3)], mapping="uv"), ["mapping uv", "planar"]),
        (
            lambda: Body("b", [Geom("box", (1e-3,) * 3)], mapping="cylindrical"),
            ["'b'", "a box has no cylindrical mapping", "triplanar"],
        ),
        (lambda: Body("b", [Geom("sphere", (1,))], offset=(0, math.nan)), ["offset", "nan"]),
        (lambda: Body("b", [Geom("sphere", (1,))], offset=(0,)), ["offset", "2 finite"]),
    ],
)
def test_bodies_that_cannot_be_are_refused(call, words):
    refused(call, *words)


def test_a_texture_taller_than_the_body_is_refused():
    """Half of the smallest extent is allowed: the least of all geoms, whatever the sign."""
    geoms = [Geom("box", (9e-3, 9e-3, 1e-3)), Geom("capsule", (0.6e-3, 5e-3))]
    for sign in (1.0, -1.0):
        Body("b", geoms, HeightField(np.full((4, 4), sign * 0.3e-3), 1e-3))
        tall = HeightField(np.full((4, 4), sign * 0.31e-3), 1e-3)
        refused(lambda tall=tall: Body("b", geoms, tall), "'b'", "0.31 mm", "0.6 mm", "0.3 mm")
    Body("b", [Geom("plane", (0, 0, 0.1))], HeightField(np.full((4, 4), 0.1), 1e-3))


def test_an_engine_needs_the_bodies_of_its_model():
    xml = (
        '<mujoco><worldbody><body name="plate"><geom type="box" size="1 1 1"/></body>'
        '<body name="tool"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(xml)
    box, sphere = Geom("box", (1, 1, 1)), Geom("sphere", (0.1,))
    bodies = [Body("plate", [box]), Body("tool", [sphere])]
    assert np.isfinite(ContactSolver(model, bodies, "tool").wrench(pose(0, 0, 1.05), 1e-3)).all()
    refused(lambda: ContactSolver(model, bodies, "tol"), "'tol'", "plate, tool")
    refused(
        lambda: ContactSolver(model, [Body("plate", [box, box]), bodies[1]], "tool"),
        "'plate'", "2 geoms", "1 that can be touched",
    )  # fmt: skip


@pytest.mark.parametrize("wrong", ["nan", "inf", "short", "no turn"])
def test_a_pose_that_is_none_is_refused(wrong):
    """It felt nothing, in silence."""
    xml = (
        '<mujoco><worldbody><body name="plate"><geom type="box" size="1 1 1"/></body>'
        '<body name="tool"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    bodies = [Body("plate", [Geom("box", (1, 1, 1))]), Body("tool", [Geom("sphere", (0.1,))])]
    engine = ContactSolver(mujoco.MjModel.from_xml_string(xml), bodies, "tool")
    at = np.array(pose(0, 0, 1.05))
    if wrong == "short":
        at, said = at[:6], "7"
    elif wrong == "no turn":
        at[3:], said = 0.0, "norm"
    else:
        at[1], said = float(wrong), "finite"
    refused(lambda: engine.wrench(at, 1e-3), "pose", said)
    refused(lambda: engine.wrenches(at[None]), "poses", said)
    refused(lambda: engine.wrench(pose(0, 0, 1.05), -1e-3), "dt", "-0.001")
    refused(lambda: engine.wrench(pose(0, 0, 1.05), math.nan), "dt", "nan")


def test_a_refusal_says_what_the_lowest_and_highest_are():
    """Every number of `ForceSettings` that is bounded names both ends."""
    for name in ANY_NUMBER:
        with pytest.raises(AsperityError) as caught:
            ForceSettings(**{name: -1.0})
        assert re.search(r"between \S+ and \S+|above 0|0 or above", str(caught.value)), name
