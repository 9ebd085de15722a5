"""A hand of two fingers and a thumb rolls a ball between its fingertips; all are textured.

Fingers and thumb press the ball and move up and down against each other.
"""

import mujoco
import numpy as np

import asperity.mujoco as textured

RADIUS, PRESS, SWING = 0.015, 1.0, 0.006
fingers, motors = "", ""
for name, x, y in (("thumb", -1.0, 0.0), ("index", 0.9, 0.45), ("middle", 0.9, -0.45)):
    away = np.array([x, y]) / np.hypot(x, y)
    at = (RADIUS + 0.008) * away
    fingers += f"""
    <body pos="{at[0]} {at[1]} .05">
      <joint name="{name} in" type="slide" axis="{-away[0]} {-away[1]} 0" damping="2"/>
      <joint name="{name} up" type="slide" axis="0 0 1" damping="1"/>
      <geom name="{name}" type="capsule" size=".008 .012" mass=".03" friction="1"/>
    </body>"""
    hold = 'position kp="4000" kv="20"' if name == "thumb" else "motor"
    motors += f'<{hold} joint="{name} in"/><position joint="{name} up" kp="400" kv="8"/>'
model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="0.0005" gravity="0 0 0" cone="elliptic" impratio="10"/>
  <worldbody>
    <body name="ball" pos="0 0 .05"><freejoint/>
      <geom name="ball" size="{RADIUS}" mass=".02" condim="4" friction="1 .005"/></body>{fingers}
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>""")
data = mujoco.MjData(model)
tips = dict.fromkeys(("thumb", "index", "middle"), textured.pattern("ridges", pitch=0.8e-3))
surfaces = textured.attach(model, {"ball": "knurl:2mm", **tips}, stiffness=1e4)
skin = textured.Taxels(model, "thumb", (6, 12))

turned, forces, slips = [], [], []
for _ in range(6000):
    swing = SWING * np.sin(2.0 * np.pi * data.time) * min(1.0, data.time)
    data.ctrl[:] = 0.0, swing, PRESS, -swing, PRESS, -swing
    surfaces.step(data)
    axis = data.body("ball").xmat.reshape(3, 3)[:, 2]
    turned.append(np.degrees(np.arctan2(axis[0], axis[2])))
    forces.append(skin.forces(data))
    slip = surfaces.contacts(data).slip
    slips.append(np.linalg.norm(slip, axis=1).max(initial=0.0))
late = slice(2000, None)
print(
    f"the ball is at {data.body('ball').xpos.round(4)} m and rolled by "
    f"{np.ptp(turned[late]):.0f} degrees; without slip it is {np.degrees(2 * SWING / RADIUS):.0f}"
)
print(
    f"the thumb presses with {np.linalg.norm(np.sum(forces[late], axis=1), axis=1).mean():.2f} N "
    f"on {np.mean(np.linalg.norm(forces[late], axis=2) > 0.01, axis=0).astype(bool).sum()} taxels"
)
print(f"slip below {1e3 * np.quantile(slips[late], 0.95):.1f} mm/s in 95 % of the ticks")
