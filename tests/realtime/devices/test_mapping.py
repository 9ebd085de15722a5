"""The mapping against rotation matrices, without jumps, and with an honest account of power."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError
from asperity.realtime.devices.mapping import Mapping
from asperity.realtime.devices.protocol import Limits, Reading

FREE = Limits(10.0, 1.0, 1e3, 10.0, radius=0.1, torque_dof=3)


def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1)


def turn(quaternion):
    return Rotation.from_quat(np.roll(quaternion, -1))


def reading(position=(0, 0, 0), rotation=None, velocity=(0,) * 6, buttons=0):
    out = Reading.empty()
    out.pose[:3] = position
    out.pose[3:] = [1, 0, 0, 0] if rotation is None else wxyz(rotation)
    out.twist[:] = velocity
    out.buttons = buttons
    return out


def test_a_point_maps_by_scale_rotation_and_home():
    rotation = Rotation.from_euler("z", 90, degrees=True)
    mapping = Mapping(FREE, scale=2.0, rotation=wxyz(rotation), home=(0.0, -0.12, 0.15))
    mapping.begin_at(reading((0.0, -0.12, 0.15)), [1.0, 2.0, 3.0, 1, 0, 0, 0])
    pose, twist = mapping.to_scene(reading((0.01, -0.12, 0.17), velocity=(0.1, 0, 0, 0, 3.0, 0)))
    np.testing.assert_allclose(pose, [1.0, 2.02, 3.04, 1, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(twist, [0, 0.2, 0, -3.0, 0, 0], atol=1e-15)  # angles do not scale


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_poses_agree_with_matrices_and_the_twist_is_their_rate(seed):
    rng = np.random.default_rng(seed)
    frame, start, device, tool = (
        Rotation.from_quat(q / np.linalg.norm(q)) for q in rng.normal(size=(4, 4))
    )
    home, place, goal = rng.uniform(-0.05, 0.05, (3, 3))
    scale = rng.uniform(0.2, 5.0)
    limits = Limits(10.0, 1.0, 1e3, 10.0, radius=1.0, torque_dof=3)
    mapping = Mapping(limits, scale=scale, rotation=wxyz(frame), home=home)
    mapping.begin_at(reading(place, start), [*goal, *wxyz(tool)])
    pose, _ = mapping.to_scene(reading(place, start))
    np.testing.assert_allclose(pose[:3], goal, atol=1e-12)
    assert (turn(pose[3:]) * tool.inv()).magnitude() < 1e-7  # no jump where it begins
    # A turn of the device by d, in its axes, is one by the same vector in the scene's.
    moved = place + rng.uniform(-0.01, 0.01, 3)
    pose, _ = mapping.to_scene(reading(moved, device * start))
    np.testing.assert_allclose(pose[:3], goal + scale * frame.apply(moved - place), atol=1e-12)
    expected = (frame * device * frame.inv()) * tool
    assert (turn(pose[3:]) * expected.inv()).magnitude() < 1e-7
    # The twist is the finite difference of the poses.
    velocity, h = rng.normal(size=6), 1e-6
    ends = []
    for sign in (-1, 1):
        half = Rotation.from_rotvec(sign * h * velocity[3:])
        measured = reading(place + sign * h * velocity[:3], half * start)
        ends.append(mapping.to_scene(measured)[0].copy())
    _, twist = mapping.to_scene(reading(place, start, velocity))
    np.testing.assert_allclose(twist[:3], (ends[1][:3] - ends[0][:3]) / (2 * h), atol=1e-6)
    rate = (turn(ends[1][3:]) * turn(ends[0][3:]).inv()).as_rotvec() / (2 * h)
    np.testing.assert_allclose(twist[3:], rate, atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_power_at_the_device_is_the_stated_ratio_of_that_in_the_scene(seed, scale, force_scale):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    mapping = Mapping(FREE, scale=scale, force_scale=force_scale, rotation=q / np.linalg.norm(q))
    measured = reading(rng.uniform(-0.05, 0.05, 3), velocity=rng.normal(size=6))
    mapping.begin_at(measured, [0, 0, 0, 1, 0, 0, 0])
    _, twist = mapping.to_scene(measured)
    wrench = rng.normal(size=6)
    there, here = wrench @ twist, mapping.to_device(wrench) @ measured.twist
    assert mapping.power_ratio == pytest.approx(force_scale / scale)
    assert here == pytest.approx(mapping.power_ratio * there, rel=1e-9, abs=1e-12)


def test_stiffness_felt_is_scale_times_force_scale_times_that_of_the_scene():
    mapping = Mapping(FREE, scale=4.0, force_scale=0.5)
    mapping.begin_at(reading(), [0, 0, 0, 1, 0, 0, 0])
    pose, _ = mapping.to_scene(reading((0, 0, -1e-3)))
    force = mapping.to_device(np.array([0, 0, -300.0 * pose[2], 0, 0, 0]))[2]
    assert force / 1e-3 == pytest.approx(4.0 * 0.5 * 300.0)


def test_the_clutch_holds_the_tool_and_nothing_jumps_on_release():
    rng = np.random.default_rng(3)
    mapping = Mapping(FREE, scale=3.0, clutch_button=1)
    mapping.begin_at(reading(), [0, 0, 0, 1, 0, 0, 0])
    first = Rotation.from_rotvec(rng.normal(size=3))
    before = mapping.to_scene(reading((0.01, 0.02, 0.0), first))[0].copy()
    push = np.ones(6)
    assert mapping.to_device(push).any()
    for i in range(5):  # the hand goes elsewhere
        other = Rotation.from_rotvec(rng.normal(size=3))
        away = reading((-0.01 * i, 0.0, 0.0), other, (1,) * 6, buttons=0b10)
        pose, twist = mapping.to_scene(away)
        np.testing.assert_array_equal(pose, before)
        assert not twist.any()
        assert mapping.clutched
        assert not mapping.to_device(push).any()  # and moves freely
    away.buttons = 0b01  # another button is no clutch
    pose, _ = mapping.to_scene(away)
    np.testing.assert_allclose(pose[:3], before[:3], atol=1e-15)
    assert (turn(pose[3:]) * turn(before[3:]).inv()).magnitude() < 1e-7
    assert mapping.to_device(push).any()
    # From there it goes on.
    pose, _ = mapping.to_scene(reading((-0.03, 0.0, 0.0), other))
    assert pose[0] - before[0] == pytest.approx(3.0 * 0.01)


def test_outside_the_workspace_it_slides_along_the_border():
    mapping = Mapping(FREE, home=(0, 0, 0.1))
    mapping.begin_at(reading((0, 0, 0.1)), [0, 0, 0, 1, 0, 0, 0])
    pose, twist = mapping.to_scene(reading((0.3, 0, 0.1), velocity=(5.0, 3.0, 0, 0, 0, 0)))
    np.testing.assert_allclose(pose[:3], [0.1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(twist[:3], [0, 1.0, 0], atol=1e-15)
    assert mapping.outside
    mapping.to_scene(reading((0.09, 0, 0.1)))
    assert not mapping.outside
    pose, _ = mapping.to_scene(reading((1e300, 0, 0)))
    assert np.isfinite(pose).all()


@pytest.mark.parametrize("place", [(np.nan, 0, 0), (0, np.inf, 0), (1e308, 1e308, 1e308)])
def test_no_nonsense_moves_the_handle(place):
    mapping = Mapping(FREE, clutch_button=0)
    mapping.begin_at(reading(), [0.5, 0, 0, 1, 0, 0, 0])
    for buttons in (0, 1, 0):  # also when the clutch is let go of at that moment
        pose, twist = mapping.to_scene(reading(place, buttons=buttons))
        assert np.isfinite(pose).all()
        assert np.isfinite(twist).all()
    pose, _ = mapping.to_scene(reading((0.01, 0, 0)))
    assert np.isfinite(pose).all()
    if not np.isfinite(sum(place)):
        assert pose[0] == pytest.approx(0.51)


def test_what_the_device_cannot_push_is_left_out():
    planar = Limits(5.0, 0.0, 300.0, 2.0, force_dof=2, torque_dof=0, senses_rotation=False)
    mapping = Mapping(planar)
    tool = Rotation.from_euler("x", 30, degrees=True)
    mapping.begin_at(reading(), [0, 0, 0, *wxyz(tool)])
    np.testing.assert_array_equal(mapping.to_device(np.arange(1.0, 7.0)), [1, 2, 0, 0, 0, 0])
    measured = reading((0.01, 0, 0), Rotation.from_euler("z", 80, degrees=True), (0, 0, 0, 1, 1, 1))
    pose, twist = mapping.to_scene(measured)
    np.testing.assert_allclose(pose[3:], wxyz(tool))  # it does not sense rotation
    assert not twist[3:].any()


def test_values_that_are_none_are_refused():
    for options, expected in [
        ({"scale": 0.0}, "scale must be"), ({"force_scale": -1.0}, "force_scale must be"),
        ({"rotation": (1, 1, 0, 0)}, "unit quaternion"), ({"home": (0, 0)}, "home must be 3"),
        ({"clutch_button": 32}, "clutch_button must be"),
        ({"torque_scale": float("nan")}, "torque_scale must be"),
    ]:  # fmt: skip
        with pytest.raises(AsperityError, match=expected):
            Mapping(FREE, **options)
    with pytest.raises(AsperityError, match="not finite"):
        Mapping(FREE).begin_at(reading((np.nan, 0, 0)), [0, 0, 0, 1, 0, 0, 0])
