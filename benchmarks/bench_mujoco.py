"""What textures add to a step of MuJoCo, and MuJoCo's own height field beside them.

    python benchmarks/bench_mujoco.py [--steps 4000]

An arm of seven joints drags its tip over a textured plate; a hand of ten fingers holds a textured
ball; a ball lies on waves, given as a texture and as MuJoCo's height field of 256^2 and 1024^2
samples. All times are medians of one run, in the processor's time of this thread.
"""

from __future__ import annotations

import argparse
import time

import mujoco
import numpy as np

import asperity.mujoco as textured

BARS = {"arm": 2.0, "arm_us": 50.0, "hand_hz": 500.0}
FINGERS = 10


def arm() -> mujoco.MjModel:
    """Return an arm of seven hinges over a plate, held by position servos."""
    links, ends = "", ""
    for i in range(7):
        axis = "0 1 0" if i % 2 else "0 0 1"
        links += (
            f'<body pos="0 0 {0.1 if i else 0.05}"><joint name="j{i}" axis="{axis}" damping="1"/>'
            '<geom type="capsule" fromto="0 0 0 0 0 .1" size=".02" mass=".5" contype="0" '
            'conaffinity="0"/>'
        )
        ends += "</body>"
    tip = '<body pos="0 0 .1"><geom name="tip" size=".008" mass=".05"/></body>'
    servos = "".join(f'<position joint="j{i}" kp="200" kv="20"/>' for i in range(7))
    return mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.002" cone="elliptic" integrator="implicitfast"/><worldbody>'
        '<geom name="plate" type="box" size=".3 .3 .01" pos=".3 0 .31"/>'
        f"{links}{tip}{ends}</worldbody><actuator>{servos}</actuator></mujoco>"
    )


def hand() -> mujoco.MjModel:
    """Return ten fingertips on slides that press a ball from all sides."""
    fingers, motors = "", ""
    for i in range(FINGERS):
        turn = 2.0 * np.pi * i / FINGERS
        x, y = np.cos(turn), np.sin(turn)
        fingers += (
            f'<body pos="{0.0398 * x} {0.0398 * y} 0"><joint name="f{i}" type="slide" '
            f'axis="{-x} {-y} 0" damping="2"/><joint type="slide" axis="0 0 1" stiffness="200" '
            f'damping="1"/><geom name="tip{i}" type="capsule" size=".008 .01" mass=".03" '
            'contype="2" conaffinity="1"/></body>'
        )
        motors += f'<motor joint="f{i}"/>'
    return mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.002" cone="elliptic"/><worldbody>'
        '<body name="ball"><freejoint/><geom name="ball" size=".032" mass=".1" contype="1" '
        f'conaffinity="2"/></body>{fingers}</worldbody><actuator>{motors}</actuator></mujoco>'
    )


def waves_field(samples: int, half: float) -> np.ndarray:
    """Return waves of 2 mm in MuJoCo's height field, 0 to 1."""
    at = np.linspace(-half, half, samples)
    return np.tile(0.5 + 0.5 * np.cos(2.0 * np.pi * at / 2e-3), (samples, 1))


def on_waves(samples: int) -> mujoco.MjModel:
    """Return a ball that is held in waves of 0.1 mm; with `samples`, MuJoCo's height field."""
    ground = '<geom name="ground" type="box" size=".02 .02 .01" pos="0 0 -.01"/>'
    asset = ""
    if samples:
        asset = (
            f'<asset><hfield name="waves" nrow="{samples}" ncol="{samples}" '
            'size=".02 .02 .0002 .01"/></asset>'
        )
        ground = '<geom name="ground" type="hfield" hfield="waves" pos="0 0 -.0001"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.001" cone="elliptic"/>{asset}<worldbody>{ground}'
        '<body name="ball"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
        '<geom name="tip" size=".0015" mass=".05"/></body></worldbody></mujoco>'
    )
    if samples:
        model.hfield_data[:] = waves_field(samples, 0.02).ravel()
    return model


def median_step(step, data, count: int) -> float:
    """Return the median time of a step [us]."""
    times = np.empty(count)
    for i in range(count):
        start = time.thread_time_ns()
        step(data)
        times[i] = time.thread_time_ns() - start
    return 1e-3 * float(np.median(times))


def true_depth(x: float, z: float, radius: float) -> float:
    """Return how deep a ball lies in the waves, vertically, by brute force [m]."""
    u = x + np.linspace(-0.9, 0.9, 200_001) * radius
    ball = z - np.sqrt(radius**2 - (u - x) ** 2)
    return max(float(np.max(1e-4 * np.cos(2.0 * np.pi * u / 2e-3) - ball)), 0.0)


def compare(model: mujoco.MjModel, textures: dict, control, steps: int):
    """Return the time of a step without and with textures [us], and the number of contacts.

    The two take turns of 100 steps, since a processor's clock changes meanwhile.
    """
    steppers = (lambda d: mujoco.mj_step(model, d), textured.attach(model, textures).step)
    datas = [mujoco.MjData(model) for _ in steppers]
    for step, data in zip(steppers, datas, strict=True):
        control(data)
        for _ in range(500):
            step(data)
    turns = [
        [median_step(step, data, 100) for step, data in zip(steppers, datas, strict=True)]
        for _ in range(steps // 100)
    ]
    plain, rough = np.median(turns, axis=0)
    return float(plain), float(rough), datas[1].ncon


def bench_arm(steps: int) -> bool:
    model = arm()

    def control(data: mujoco.MjData) -> None:
        data.ctrl[:] = 0.3, 0.9, 0.0, 1.4, 0.0, -0.9, 0.0
        data.qpos[:] = data.ctrl

    probe = mujoco.MjData(model)
    control(probe)
    mujoco.mj_forward(model, probe)
    place = probe.geom("tip").xpos
    model.geom("plate").pos[:] = place[0], place[1], place[2] - 0.0178
    mujoco.mj_forward(model, probe)
    ridges = {"plate": textured.pattern("ridges", pitch=2e-3)}
    plain, rough, contacts = compare(model, ridges, control, steps)
    print(
        f"arm of 7 joints, {contacts} contact: {plain:.1f} us a step without texture, "
        f"{rough:.1f} us with it: {rough / plain:.2f} times, {rough - plain:.1f} us more"
    )
    return rough <= BARS["arm"] * plain or rough - plain <= BARS["arm_us"]


def bench_hand(steps: int) -> bool:
    model = hand()

    def control(data: mujoco.MjData) -> None:
        data.ctrl[:] = 1.0

    bumps = {"ball": textured.pattern("sin_product", wavelength=2e-3, amplitude=5e-5)}
    plain, rough, contacts = compare(model, bumps, control, steps)
    real = 1e6 * model.opt.timestep / rough
    print(f"hand, {contacts} contacts: {plain:.0f} us a step without texture, {rough:.0f} us with "
          f"it: {1e6 / rough:.0f} steps a second, {real:.1f} times real time")  # fmt: skip
    return 1e6 / rough >= BARS["hand_hz"] and contacts >= FINGERS


def bench_height_fields(steps: int) -> None:
    waves = {"ground": textured.pattern("waves", wavelength=2e-3, amplitude=1e-4, samples=64)}
    places = 0.9e-3 + np.linspace(0.0, 2e-3, 40)
    for samples in (0, 256, 1024):
        model = on_waves(samples)
        data, errors = mujoco.MjData(model), []
        run = lambda d, m=model: mujoco.mj_forward(m, d)  # noqa: E731
        if samples == 0:
            run = textured.attach(model, waves).forward
        for x in places:
            data.qpos[:] = x, 0.00155
            run(data)
            deep = -float(data.contact.dist.min()) if data.ncon else 0.0
            if samples == 0 and data.ncon:
                # MuJoCo's depth is along the textured normal, asperity's own is upright.
                deep /= abs(float(data.contact.frame[0, 2]))
            errors.append(deep - true_depth(float(x), 0.00155, 0.0015))
        cost = median_step(run, data, steps)
        name = f"height field of {samples}^2" if samples else "texture"
        rms = 1e6 * float(np.sqrt(np.mean(np.square(errors))))
        print(f"ball on waves, {name}: {cost:.1f} us a step, error of depth {rms:.3f} um rms")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=4000)
    steps = parser.parse_args().steps
    good = [bench_arm(steps), bench_hand(steps)]
    bench_height_fields(steps)
    return 0 if all(good) else 1


if __name__ == "__main__":
    raise SystemExit(main())
