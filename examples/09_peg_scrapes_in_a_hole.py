"""A peg goes into a hole that it does not meet in the middle, and scrapes along its walls.

What holds the peg gives way sideways by 1 N a millimetre, as a compliant wrist does.
"""

import mujoco
import numpy as np

import asperity.mujoco as textured

HALF, PLAY, DEPTH, OFF = 0.01, 1e-4, 0.02, 1.5e-4
WEIGHT = 0.1 * 9.81
wall = HALF + PLAY + 0.01
walls = "".join(
    f'<geom type="box" size="{a} {b} {DEPTH / 2}" pos="{x} {y} {-DEPTH / 2}"/>'
    for x, y, a, b in (
        (wall, 0, 0.01, 0.03), (-wall, 0, 0.01, 0.03), (0, wall, 0.03, 0.01), (0, -wall, 0.03, 0.01)
    )
)  # fmt: skip
model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="0.0005" cone="elliptic"/>
  <worldbody>
    <body name="block">{walls}</body>
    <body name="peg" pos="{OFF} 0 .011">
      <joint name="x" type="slide" axis="1 0 0" stiffness="1000" damping="3"/>
      <joint name="y" type="slide" axis="0 1 0" stiffness="1000" damping="3"/>
      <joint name="z" type="slide" axis="0 0 1" damping="2"/>
      <geom name="peg" type="capsule" size="{HALF} .005" mass=".1" friction=".2"/>
    </body>
  </worldbody>
  <actuator><position joint="z" kp="3000" kv="30"/></actuator>
  <sensor><jointactuatorfrc joint="z"/></sensor>
</mujoco>""")


def insert(textures):
    """Return how deep the peg went [m], and what pushed it in (n,) [N]: actuator and weight."""
    data, forces = mujoco.MjData(model), []
    surfaces = textured.attach(model, textures, stiffness=2e4)
    for _ in range(3000):
        data.ctrl[0] = -0.016 * min(1.0, data.time)
        surfaces.step(data)
        forces.append(WEIGHT - data.actuator_force[0])
    surfaces.detach()
    return -data.qpos[2], np.array(forces)


# On the walls of a box, not only on its top.
walls = {
    pitch: {"block": textured.texture(f"knurl:{pitch}", mapping="triplanar", friction=0.2)}
    for pitch in ("0.5mm", "1mm")
}
for name, textures in (("smooth", {}), *((f"knurl of {p}", t) for p, t in walls.items())):
    depth, force = insert(textures)
    late = force[600:2000]
    print(
        f"{name}: {1e3 * depth:.1f} mm in, pushed with {late.mean():.2f} N, "
        f"{late.std():.2f} N rms about it"
    )
