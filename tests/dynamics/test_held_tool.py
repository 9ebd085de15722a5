"""A tool on its coupling: free, in contact, spinning, and on a handle that leaps."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from asperity.dynamics.linear_contact import LinearContact
from asperity.dynamics.virtual_coupling.coupled_tool import REACH, CoupledTool
from asperity.dynamics.virtual_coupling.settings import (
    COUPLING_MODES,
    MASS,
    MOMENTS,
    CouplingSettings,
    coupled_body,
    gains_for,
)
from asperity.errors import AsperityError
from asperity.geometry.poses import rotated, rotation_between, rotation_of
from asperity.geometry.rigid_body import RigidBody, centre_of_mass
from asperity.scene.builtin import load_scene, probe_plate
from asperity.simulation.simulation import Simulation
from asperity.simulation.tool_contact import ToolContact

COUPLED = COUPLING_MODES[1:]
START = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
BODY = RigidBody(
    0.05, np.array([0.01, 0.0, 0.03]), np.array([6e-5, 4e-5, 2e-5]), rotation_of(
        rotated(START, (0.3, -0.2, 0.5))[3:])
)  # fmt: skip
NOTHING = LinearContact(START, np.zeros(6), np.zeros((6, 6)), 0, 0)


def held(mode, **options):
    return CoupledTool(BODY, CouplingSettings(mode, **options))


def follow(tool, handle, ticks, contact=NOTHING):
    """Return the wrenches of some ticks with the handle at rest."""
    return np.array([tool.advance(handle, np.zeros(6), contact).copy() for _ in range(ticks)])


@pytest.mark.parametrize("mode", COUPLED)
def test_a_free_tool_comes_to_its_handle_and_the_hand_feels_nothing(mode):
    tool = held(mode)
    tool.reset(START)
    handle = rotated(START + np.array([0.01, -0.02, 0.005, 0, 0, 0, 0]), (0.4, 0.1, -0.3))
    wrench = follow(tool, handle, 300)
    np.testing.assert_allclose(tool.pose, handle, atol=1e-8)
    np.testing.assert_allclose(wrench[-1], 0.0, atol=1e-6)
    np.testing.assert_allclose(tool.twist, 0.0, atol=1e-6)


def test_the_implicit_step_converges_to_the_closed_form():
    """Critically damped: x = h (1 - (1 + f t) exp(-f t)), its error in proportion to the tick."""
    h, seconds, errors = 4e-3, 0.02, []
    for dt in (1e-3, 1e-4):
        tool = CoupledTool(BODY, CouplingSettings("implicit"), dt=dt)
        f = np.sqrt(tool.gains.stiffness / BODY.mass)
        tool.reset(START)
        follow(tool, START + h * np.eye(7)[0], round(seconds / dt))
        exact = h * (1.0 - (1.0 + f * seconds) * np.exp(-f * seconds))
        errors.append(abs(tool.pose[0] - exact) / h)
    assert errors[0] < 0.1
    assert errors[1] < 0.15 * errors[0]


@pytest.mark.parametrize(
    ("mode", "stiffness"),
    [("semi-implicit", k) for k in (400.0, 8000.0)]  # up to the stiffest device; no more there
    + [(mode, k) for mode in ("implicit", "static") for k in (400.0, 1e5, 1e9)],
)
def test_stiff_contact_settles_where_it_balances_the_coupling(mode, stiffness):
    """A wall: k z below 0. Pressed by h, the tool rests at -K h / (K + k)."""
    tool = held(mode)
    tool.reset(START)
    handle, wrench = START - 0.003 * np.eye(7)[2], np.zeros(6)
    handle = handle.copy()
    for _ in range(400):
        z = tool.pose[2]
        k, push = np.zeros((6, 6)), np.zeros(6)
        if z < 0.0:
            jacobian = np.zeros(6)
            jacobian[2] = 1.0
            k, push = stiffness * np.outer(jacobian, jacobian), -stiffness * z * jacobian
        contact = LinearContact(tool.pose.copy(), push, k, int(z < 0.0), 0)
        wrench = tool.advance(handle, np.zeros(6), contact).copy()
    K = tool.gains.stiffness
    assert tool.pose[2] == pytest.approx(-K * 0.003 / (K + stiffness), rel=1e-6, abs=1e-12)
    assert wrench[2] == pytest.approx(0.003 * K * stiffness / (K + stiffness), rel=1e-5)
    assert tool.resets == 0


@pytest.mark.parametrize("mode", ["implicit", "semi-implicit"])
def test_a_fast_spin_keeps_its_momentum(mode):
    """Nothing holds it: the angular momentum stays, and so does the bound on its velocity."""
    tool = held(mode, stiffness=1.0, damping=0.0, rotational_stiffness=1e-4, rotational_damping=0.0)
    tool.reset(START)
    momentum = np.array([0.05, 0.03, -0.04])  # 1000 rad/s and more
    tool._motion.momentum[3:] = momentum
    for _ in range(2000):
        tool.advance(START, np.zeros(6), NOTHING)
        assert np.linalg.norm(tool.twist[3:]) <= 1.01 * np.linalg.norm(momentum) / 2e-5
    # The coupling's spring of 1e-4 N m/rad turns it by 3e-4 N m s a second at most.
    np.testing.assert_allclose(tool._motion.momentum[3:], momentum, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(tool.pose[3:]), 1.0, atol=1e-12)


@pytest.mark.parametrize("mode", COUPLED)
def test_a_handle_that_spins_fast_is_followed(mode):
    """50 rad/s about an axis that is none of the tool's own, for three turns and then at rest."""
    tool = held(mode)
    tool.reset(START)
    handle, spin = START.copy(), np.array([30.0, -30.0, 25.0])
    for _ in range(400):
        handle = rotated(handle, 1e-3 * spin)
        wrench = tool.advance(handle, np.append(np.zeros(3), spin), NOTHING)
        assert np.isfinite(wrench).all()
    assert np.linalg.norm(rotation_between(tool.pose, handle)) < 0.3
    np.testing.assert_allclose(tool.twist[3:], spin, rtol=0.2, atol=3.0)
    wrench = follow(tool, handle, 200)[-1]
    np.testing.assert_allclose(wrench, 0.0, atol=1e-4)
    assert tool.resets == 0


@pytest.mark.parametrize("mode", ["implicit", "semi-implicit"])
def test_action_is_reaction(mode):
    """What the hand feels is what the tool's momentum lost."""
    tool, rng = held(mode), np.random.default_rng(5)
    tool.reset(START)
    before = tool._motion.momentum.copy()
    for _ in range(20):
        handle = rotated(START + np.append(0.01 * rng.normal(size=3), np.zeros(4)),
                        0.3 * rng.normal(size=3))  # fmt: skip
        wrench = tool.advance(handle, 0.1 * rng.normal(size=6), NOTHING)
        np.testing.assert_allclose(tool._motion.momentum - before, -1e-3 * wrench, atol=1e-12)
        before = tool._motion.momentum.copy()


def test_an_old_contact_does_not_pull():
    tool = held("direct")
    k = np.zeros((6, 6))
    k[2, 2] = 400.0
    contact = LinearContact(START, np.array([0, 0, 0.4, 0, 0, 0]), k, 1, 0)
    for z, force in ((0.0, 0.4), (-1e-3, 0.8), (5e-4, 0.2), (2e-3, 0.0)):
        pose = START + z * np.eye(7)[2]
        wrench = tool.advance(pose, np.zeros(6), contact)
        np.testing.assert_allclose(wrench, [0, 0, force, 0, 0, 0], atol=1e-12)


def test_an_old_contact_is_told_about_the_centre_of_mass():
    """Turned by a little, the wrench changes by stiffness times turn, not by where the frame is."""
    tool = held("direct")
    k = np.diag([100.0, 200.0, 400.0, 1.0, 2.0, 3.0])
    contact = LinearContact(START, np.array([0.1, 0.2, 0.4, 0, 0, 0.0]), k, 1, 0)
    pose = rotated(START, (1e-4, 2e-4, -1e-4))
    moved = centre_of_mass(pose, BODY.centre) - centre_of_mass(START, BODY.centre)
    pose[:3] -= moved  # the centre of mass stays
    wrench = tool.advance(pose, np.zeros(6), contact)
    np.testing.assert_allclose(wrench - contact.wrench, [0, 0, 0, -1e-4, -4e-4, 3e-4], atol=1e-10)


def test_a_handle_out_of_reach_takes_its_tool_along():
    tool = held("implicit")
    tool.reset(START)
    far = START + REACH * np.array([0.7, 0.8, 0.0, 0, 0, 0, 0])
    np.testing.assert_array_equal(tool.advance(far, np.zeros(6), NOTHING), 0.0)
    np.testing.assert_array_equal(tool.pose, far)
    assert tool.resets == 1


LEAP = st.tuples(*[st.floats(-0.2, 0.2)] * 2, st.floats(-0.03, 0.2), *[st.floats(-3.0, 3.0)] * 3)


@pytest.fixture(scope="module")
def simulations():
    scene = probe_plate()
    return {m: Simulation(scene.changed(coupling={"mode": m})) for m in COUPLED}


@pytest.mark.parametrize("mode", COUPLED)
@settings(max_examples=6, deadline=None, derandomize=True, phases=[Phase.generate])
@given(leaps=st.lists(LEAP, min_size=1, max_size=4), lift=st.floats(-2e-3, 2e-3))
def test_a_handle_that_leaps_about_leaves_everything_finite_and_it_settles(
    simulations, mode, leaps, lift
):
    simulation = simulations[mode]
    simulation.reset()
    rest = simulation.scene.start + lift * np.eye(7)[2]
    for leap in leaps:
        pose = rotated(rest + np.append(leap[:3], np.zeros(4)), leap[3:])
        for _ in range(3):
            assert np.isfinite(simulation.step(pose)).all()
    # Held still above the plate, and then put down. One that is under it has to come through first.
    above = rest + 0.05 * np.eye(7)[2]
    for _ in range(400):
        wrench = simulation.step(above)
        assert np.isfinite(wrench).all()
        assert np.isfinite(simulation.state.pose).all()
    still = np.array([simulation.step(above) for _ in range(20)])
    assert np.abs(np.diff(still, axis=0)).max() < 5e-3
    if all(leap[2] >= 0.0 for leap in leaps):  # else it may hang under the plate
        np.testing.assert_allclose(simulation.state.pose[:3], above[:3], atol=1e-5)
        np.testing.assert_allclose(rotation_between(simulation.state.pose, above), 0.0, atol=1e-4)
        np.testing.assert_allclose(wrench, 0.0, atol=2e-2)
        last = np.array([simulation.step(rest) for _ in range(150)])
        assert np.abs(np.diff(last[-20:], axis=0)).max() < 5e-3


@pytest.mark.parametrize("mode", COUPLED)
def test_a_mesh_tool_settles_on_its_block(mode):
    scene = load_scene("hammer-blocks").changed(coupling={"mode": mode})
    simulation = Simulation(scene)
    pose = simulation.trajectory().poses[0]
    leap = pose + 0.2 * np.eye(7)[2]
    for _ in range(3):
        assert np.isfinite(simulation.step(leap)).all()
    wrenches = np.array([simulation.step(pose) for _ in range(160)])
    assert np.isfinite(wrenches).all()
    # The face is not under the centre of mass, so that the coupling yields by turning too.
    assert 0.5 * scene.motion.press_force < wrenches[-1, 2] < scene.motion.press_force
    np.testing.assert_allclose(simulation.contact_wrench, wrenches[-1], rtol=0.01, atol=1e-3)


def test_direct_is_the_contact_at_the_handle_exactly():
    scene = probe_plate("jittered_dots")
    simulation, stage = Simulation(scene), ToolContact(scene)
    for pose in simulation.trajectory().poses[:150]:
        wrench = simulation.step(pose)
        np.testing.assert_array_equal(wrench, stage.evaluate(pose).wrench)
        np.testing.assert_array_equal(simulation.contact_wrench, wrench)
        np.testing.assert_array_equal(simulation.state.pose, pose)


def test_numbers_out_of_bounds_put_the_tool_back_on_the_handle():
    tool = held("implicit")
    tool.reset(START)
    far = START.copy()
    far[0] = 1e300
    tool.advance(far, np.zeros(6), NOTHING)
    tool.advance(START, np.zeros(6), NOTHING)
    wrench = follow(tool, START, 400)[-1]
    assert np.isfinite(tool.pose).all()
    assert np.isfinite(wrench).all()
    bad = LinearContact(tool.pose.copy(), np.full(6, np.nan), np.zeros((6, 6)), 1, 0)
    np.testing.assert_array_equal(tool.advance(START, np.zeros(6), bad), 0.0)
    assert tool.resets >= 1
    np.testing.assert_array_equal(tool.pose, START)


def test_gains_are_from_the_mass_or_the_device():
    class Touch:
        max_force, max_stiffness, max_damping, max_rotational_stiffness = 3.3, 400.0, 4.0, 0.0

    free = gains_for(BODY, CouplingSettings("implicit"))
    assert free.damping == pytest.approx(2.0 * np.sqrt(free.stiffness * BODY.mass))
    capped = gains_for(BODY, CouplingSettings("implicit"), limits=Touch())
    assert (capped.stiffness, capped.damping) == (400.0, 4.0)
    assert capped.rotational_stiffness == free.rotational_stiffness
    given = CouplingSettings("implicit", 100.0, 1.0, 0.2, 0.01)
    assert gains_for(BODY, given)[:3] == (100.0, 1.0, 0.2)


@pytest.mark.parametrize("name", ["probe-plate", "hammer-blocks", "file-cad"])
def test_a_held_tool_weighs_what_the_scene_says_within_bounds(name):
    scene = load_scene(name)
    body = coupled_body(scene.model, scene.tool)
    assert MASS[0] <= body.mass <= MASS[1]
    assert (body.moments >= MOMENTS[0]).all()
    assert (body.moments <= MOMENTS[1]).all()
    np.testing.assert_allclose(body.axes.T @ body.axes, np.eye(3), atol=1e-9)
    assert coupled_body(scene.model, scene.tool, mass_scale=10.0).mass == 10.0 * body.mass


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"mode": "rigid"}, "choose from: direct, implicit, semi-implicit, static"),
        ({"stiffness": -1.0}, "stiffness must lie between"),
        ({"damping": np.nan}, "damping must lie between"),
        ({"mass_scale": 0.0}, "mass_scale must lie between"),
    ],
)
def test_wrong_settings_are_refused(options, said):
    with pytest.raises(AsperityError, match=said):
        CouplingSettings(**options)


def test_a_semi_implicit_coupling_too_stiff_for_the_tick_is_refused():
    settings = CouplingSettings("semi-implicit", stiffness=1e5)
    CoupledTool(BODY, CouplingSettings("implicit", stiffness=1e5), dt=0.01)
    with pytest.raises(AsperityError, match="unstable at a tick"):
        CoupledTool(BODY, settings, dt=0.01)
