"""Texture inside any MuJoCo simulation.

import asperity.mujoco as textured
surfaces = textured.attach(model, {"table": "grating:0.5mm"})
surfaces.step(data)          # in place of mujoco.mj_step
"""

from asperity.mujoco.surfaces import Surfaces, attach
from asperity.mujoco.taxels import Taxels
from asperity.mujoco.textures import Layer, pattern, texture

__all__ = ["Layer", "Surfaces", "Taxels", "attach", "pattern", "texture"]
