"""Drag a spherical tip over a plate of raised dots; print force and torque on the hand."""

from asperity import ScriptedMotion, Simulation, load_scene

simulation = Simulation(load_scene("probe-plate-dots"))  # or a folder: scene.xml and scene.toml
wrench = simulation.step([-0.0292, 0.0, 1.5e-3, 1.0, 0.0, 0.0, 0.0])  # place [m], quaternion wxyz
print("force [N]", wrench[:3].round(3), "torque [N m]", wrench[3:].round(4))
run = simulation.rollout(ScriptedMotion(kind="slide", speed=0.083, press_force=0.58, seconds=0.5))
along, up = run.device_wrench[:, 0], run.device_wrench[:, 2]
print(f"{len(run.time)} ticks of 1 ms, {run.statuses[0]} depths certified")
print(f"F_x {along.min():.2f} to {along.max():.2f} N, F_z {up.min():.2f} to {up.max():.2f} N")
