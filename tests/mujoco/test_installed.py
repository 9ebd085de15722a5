"""Loops that call MuJoCo's functions feel the textures, and others do not."""

from __future__ import annotations

import contextlib
import gc
import weakref

import mujoco
import numpy as np
import pytest

import asperity.mujoco as textured
from asperity.mujoco.installed import STEPS

XML = """<mujoco><option integrator="{integrator}"/><worldbody>
<geom name="plate" type="box" size=".1 .1 .01" pos="0 0 -.01"/>
<body pos="0 0 .0099"><freejoint/><geom name="ball" size=".01" mass=".1"/></body>
</worldbody></mujoco>"""
BUMPS = textured.pattern("sin_product", wavelength=2e-3, amplitude=5e-5)


def scene(integrator="Euler"):
    model = mujoco.MjModel.from_xml_string(XML.format(integrator=integrator))
    data = mujoco.MjData(model)
    data.qvel[:2] = 0.05, 0.03
    return model, data


def wanted(steps, integrator="Euler"):
    model, data = scene(integrator)
    textured.attach(model, {"plate": BUMPS}).step(data, steps)
    return data.qpos.copy()


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
def test_all_ways_of_stepping_are_one(integrator):
    expected = wanted(60, integrator)
    model, data = scene(integrator)
    surfaces = textured.attach(model, {"plate": BUMPS})
    with surfaces.installed():
        mujoco.mj_step(model, data, nstep=30)
        mujoco.mj_step(m=model, d=data)
        for _ in range(29):
            mujoco.mj_step(model, data)
    assert np.array_equal(data.qpos, expected)


def test_two_halves_of_a_step():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    with surfaces.installed():
        for _ in range(60):
            mujoco.mj_step1(model, data)
            mujoco.mj_step2(model, data)
    assert np.array_equal(data.qpos, wanted(60))


def test_what_calls_mujoco_from_c_feels_textures_too():
    from mujoco import rollout

    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    start = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    with surfaces.installed(callback_too=True):
        states, _ = rollout.rollout(model, data, start[None], nstep=60)
    assert np.allclose(states[0, -1, 1:8], wanted(60), atol=1e-12)


def test_other_models_and_other_callbacks_are_as_before():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    other, own = scene()
    plain, alone = scene()
    mujoco.mj_step(plain, alone, nstep=60)
    calls = []
    mujoco.set_mjcb_passive(lambda m, d: calls.append(m))
    try:
        with surfaces.installed():
            mujoco.mj_step(other, own, nstep=60)
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    assert np.array_equal(own.qpos, alone.qpos)
    assert [m is other for m in calls] == [True] * 60 + [False]


def test_models_can_be_compiled_while_it_is_installed():
    model, _ = scene()
    with textured.attach(model, {"plate": BUMPS}).installed():
        scene()


def test_nested_blocks_and_exceptions_restore_everything():
    originals = {name: getattr(mujoco, name) for name in STEPS}
    one, data = scene()
    two, other = scene()
    first, second = (textured.attach(m, {"plate": BUMPS}) for m in (one, two))
    with contextlib.suppress(RuntimeError), first.installed():
        with first.installed(), second.installed():
            mujoco.mj_step(one, data, nstep=60)
            mujoco.mj_step(two, other, nstep=60)
        mujoco.mj_step(one, data)
        raise RuntimeError("stop")
    assert np.array_equal(other.qpos, wanted(60))
    assert {name: getattr(mujoco, name) for name in STEPS} == originals
    assert mujoco.get_mjcb_passive() is None


def test_a_reset_forgets_what_was_touched():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    surfaces.step(data, 60)
    first = data.qpos.copy()
    for _ in range(2):
        mujoco.mj_resetData(model, data)
        data.qvel[:2] = 0.05, 0.03
        surfaces.step(data, 60)
        assert np.array_equal(data.qpos, first)


def test_data_that_is_dropped_is_let_go():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    surfaces.step(data, 3)
    gone = weakref.ref(data)
    del data
    gc.collect()
    assert gone() is None
    assert surfaces is not None


def test_derivatives_by_differences_work():
    model, data = scene()
    surfaces = textured.attach(model, {"plate": BUMPS})
    surfaces.step(data, 5)
    a = np.zeros((12, 12))
    with surfaces.installed(callback_too=True):
        mujoco.mjd_transitionFD(model, data, 1e-6, True, a, None, None, None)
    assert np.isfinite(a).all()
    assert np.abs(a).max() > 1.0
