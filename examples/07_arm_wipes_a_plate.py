"""An arm of seven joints wipes plates of finer and coarser texture.

The arm is moved by torques J^T F: a spring draws its tip round a circle, and 3 N press it down.
"""

import mujoco
import numpy as np

import asperity.mujoco as textured

RADIUS, SECONDS, PRESS = 0.05, 3.0, 3.0

links, ends = "", ""
for i in range(7):
    axis = "0 1 0" if i % 2 else "0 0 1"
    links += (
        f'<body pos="0 0 {0.1 if i else 0.05}"><joint name="j{i}" axis="{axis}" damping=".5"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 .1" size=".02" mass=".3" contype="0" '
        'conaffinity="0"/>'
    )
    ends += "</body>"
model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="0.001" cone="elliptic" integrator="implicitfast"/>
  <worldbody>
    <geom name="plate" type="box" size=".1 .1 .01" friction=".3" pos=".34 0 .155"/>
    {links}
    <body pos="0 0 .1">
      <geom name="tip" size=".003" mass=".05" friction=".3"/>
      <site name="tip"/>
    </body>
    {ends}
  </worldbody>
  <sensor><accelerometer site="tip"/></sensor>
</mujoco>""")


def wipe(texture):
    """Return force on the tip (n, 3) [N], and its acceleration (n, 3) [m/s^2]."""
    data = mujoco.MjData(model)
    data.qpos[[1, 3, 5]] = 0.3, 1.2, 1.2
    surfaces = textured.attach(model, {"plate": texture}, stiffness=2e4)
    jacobian, force, felt = np.zeros((3, model.nv)), np.zeros(6), []
    mujoco.mj_forward(model, data)
    for _ in range(round(SECONDS / model.opt.timestep)):
        turn = 2.0 * np.pi * data.time / SECONDS
        goal = np.array([0.34 + RADIUS * np.cos(turn), RADIUS * np.sin(turn), 0.168])
        tip = data.site("tip")
        mujoco.mj_jacSite(model, data, jacobian, None, tip.id)
        pull = 400.0 * (goal - tip.xpos) - 10.0 * jacobian @ data.qvel
        if abs(tip.xpos[2] - goal[2]) < 2e-3:
            pull[2] = -PRESS - 10.0 * (jacobian @ data.qvel)[2]
        data.qfrc_applied[:] = data.qfrc_bias + jacobian.T @ pull - 0.2 * data.qvel
        surfaces.step(data)
        total = np.zeros(3)
        for number in range(data.ncon):
            mujoco.mj_contactForce(model, data, number, force)
            total += data.contact[number].frame.reshape(3, 3).T @ force[:3]
        felt.append(np.append(total, data.sensordata))
    surfaces.detach()
    late = np.array(felt)[len(felt) // 3 :]
    return late[:, :3], late[:, 3:]


for height in (1e-5, 5e-5, 2e-4):
    force, acceleration = wipe(textured.pattern("ridges", pitch=2e-3, height=height))
    shaking = np.linalg.norm(acceleration - acceleration.mean(axis=0), axis=1)
    print(
        f"ridges of 2 mm, {1e3 * height:.2f} mm high: "
        f"pressed with {abs(force[:, 2]).mean():.2f} N, "
        f"sideways {np.linalg.norm(force[:, :2], axis=1).mean():.2f} N; "
        f"the force varies by {force.std(axis=0).round(2)} N, "
        f"vibration {np.sqrt(np.mean(shaking**2)):.1f} m/s^2 rms"
    )
