"""A scene from files: a nib and a tile as meshes, and an image as relief, all written here."""

import numpy as np
import trimesh
from PIL import Image

import asperity

trimesh.creation.capsule(height=20.0, radius=3.0, count=[12, 12]).export("nib.stl")  # [mm]
trimesh.creation.box((40.0, 30.0, 5.0)).export("tile.obj")
x, y = np.meshgrid(np.arange(128) / 128, np.arange(128) / 128)
waves = np.cos(2 * np.pi * 4 * x) * np.cos(2 * np.pi * 4 * y)  # repeats without a seam
Image.fromarray(np.uint8(127.5 * (1.0 + waves))).save("waves.png")

scene = asperity.make_scene(
    tool="nib.stl",
    target="tile.obj",
    target_texture={"file": "waves.png", "mapping": "triplanar", "pixel_size": 6.25e-5},
    unit="mm",
)
for note in scene.notes:
    print(note)  # what the files do not say, and was chosen
scene.save("nib-on-tile")  # scene.xml and scene.toml, to be changed at will

simulation = asperity.Simulation(scene.changed(trajectory={"seconds": 0.2}))
run = simulation.rollout()
force = np.linalg.norm(run.device_wrench[:, :3], axis=1)
print(f"{len(run.time)} ticks, {run.statuses[0]} of {run.statuses.sum()} depths certified")
print(f"force {force.min():.2f} to {force.max():.2f} N")
