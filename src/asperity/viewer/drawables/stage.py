"""Light, bodies and marks of the 3-D view, in its units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.viewer.drawables.glb import glb
from asperity.viewer.drawables.shapes import Drawable

Array = NDArray[np.float64]
ViserServer = Any
"""`viser.ViserServer`; the package is optional."""
UNITS = 40.0
"""Units of the view per metre. viser draws shadows up to 20 units from the camera, and shifts them
by 0.02 units: a hand tool is seen whole from nearer than that, and its shadow begins at its tip.
"""
_GRID, _SECTION = 0.01, 0.05
"""Distance between lines of the ground, and between strong lines [m]."""
_LARGE = 0.5
"""Size from which on lines are ten times as far apart [m]."""
_SKY, _SKY_ALONE = 0.25, 2.8
"""Intensity of the light from above, beside reflections of a room and without."""
_HORIZON = 14.0
"""Distance at which the ground has faded, over the size of what is seen."""


def set_up_view(server: ViserServer) -> None:
    """Set up background and light of a view whose z axis points upwards."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    scene.set_background_image(_backdrop(), format="png")
    scene.configure_default_lights(False)
    set_light(scene)


def set_light(scene: Any, *, simple: bool = False) -> None:
    """Set the light of a scene of viser, of all browsers or of one.

    Parameters
    ----------
    scene : viser.SceneApi
    simple : bool
        Without shadows and reflections, which take two thirds of the time where a processor draws.
    """
    scene.configure_environment_map(None if simple else "studio", environment_intensity=0.55)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(120, 110, 100),
        intensity=_SKY_ALONE if simple else _SKY,
    )  # fmt: skip
    scene.add_light_directional(
        "/light/key", color=(255, 248, 238), intensity=2.6, cast_shadow=not simple,
        position=(-6.0, -9.0, 16.0),
    )  # fmt: skip


def add_ground(server: ViserServer, height: float, size: float, units: float = UNITS) -> Any:
    """Add a ground with lines, on which shadows fall; return its node.

    The lines are a centimetre apart, for what is larger than a hand tool a decimetre.

    Parameters
    ----------
    server : viser.ViserServer
    height : float
        Of the ground [m].
    size : float
        Of what is seen [m]: the ground fades at some distance.
    units : float
        Of the view per metre.
    """
    apart = units if size < _LARGE else 10.0 * units
    return server.scene.add_grid(
        "/ground", infinite_grid=True, plane="xy", position=(0.0, 0.0, units * height),
        cell_size=apart * _GRID, section_size=apart * _SECTION, cell_thickness=0.7,
        section_thickness=1.1, cell_color=(190, 196, 204), section_color=(160, 168, 178),
        plane_color=(226, 229, 233), plane_opacity=1.0, shadow_opacity=0.32,
        fade_distance=units * _HORIZON * size, fade_strength=1.5,
    )  # fmt: skip


def add_shape(
    server: ViserServer,
    shape: Drawable,
    parent: str,
    *,
    image: NDArray[np.uint8] | None = None,
    units: float = UNITS,
) -> Any:
    """Add a shape under a node, with the image of its atlas if given; return its node."""
    made_of = shape.material
    data = glb(
        units * shape.vertices, shape.normals, shape.colours, shape.faces,
        places=shape.places, image=image,
        roughness=made_of.roughness if made_of else 0.6,
        metallic=made_of.metallic if made_of else 0.0,
    )  # fmt: skip
    return server.scene.add_glb(f"{parent}/{shape.name}", data)


def add_soft_shape(server: ViserServer, shape: Drawable, parent: str) -> Any:
    """Add a shape in its mean colour, whose vertices can be moved; return its node."""
    colour = tuple((255.0 * shape.colours.mean(axis=0)).astype(int).tolist())
    return server.scene.add_mesh_simple(
        f"{parent}/{shape.name}", UNITS * shape.vertices, shape.faces, color=colour, side="double"
    )


def place(node: Any, pose: Array, units: float = UNITS) -> None:
    """Move a node to a pose (7,)."""
    node.position = tuple((units * pose[:3]).tolist())
    node.wxyz = tuple(pose[3:].tolist())


def disc(radius: float) -> tuple[Array, NDArray[np.int64]]:
    """Return the points (n, 3) and triangles (m, 3) of a disc."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    rim = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    i = np.arange(32)
    return np.vstack([np.zeros((1, 3)), rim]), np.stack([0 * i, i + 1, (i + 1) % 32 + 1], axis=1)


def turn_to(normal: Array) -> tuple[float, float, float, float]:
    """Return the rotation that turns z to a unit vector, as a quaternion wxyz."""
    x, y, z = normal.tolist()
    if z < -0.999:
        return (0.0, 1.0, 0.0, 0.0)
    scale = np.sqrt(2.0 * (1.0 + z))
    return (0.5 * scale, -y / scale, x / scale, 0.0)


def _backdrop() -> NDArray[np.uint8]:
    """Return a light background, darker towards the bottom."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    top, bottom = np.array([250.0, 251.0, 253.0]), np.array([206.0, 213.0, 222.0])
    return np.broadcast_to(top + share * (bottom - top), (256, 4, 3)).astype(np.uint8)
