"""Scenes of a flat smooth foot on plates that are divided in different ways."""

from __future__ import annotations

import numpy as np

from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene, scene_of

FOOT = np.array([3e-3, 1.5e-3, 1e-3])
"""Half sides of the foot [m]; its frame is at its centre."""
PLATE = np.array([12e-3, 6e-3, 2e-3])
"""Length, width and thickness of the plate [m]; its top is z = 0."""
K = 1000.0


def grid_box(half, n) -> str:
    """Return the vertices and faces of a box whose top and bottom have n x n cells, as MJCF."""
    u = np.linspace(-1.0, 1.0, n + 1)
    x, y = np.meshgrid(u * half[0], u * half[1], indexing="ij")
    level = [
        np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)]) for z in (-half[2], half[2])
    ]
    points, m, faces = np.concatenate(level), n + 1, []
    for i in range(n):
        for j in range(n):
            a, b, c, d = i * m + j, (i + 1) * m + j, (i + 1) * m + j + 1, i * m + j + 1
            top = m * m
            faces += [
                [a + top, b + top, c + top],
                [a + top, c + top, d + top],
                [a, c, b],
                [a, d, c],
            ]
    rim = [i * m for i in range(n)] + [n * m + j for j in range(n)]
    rim += [(n - i) * m + n for i in range(n)] + [n - j for j in range(n)]
    for a, b in zip(rim, rim[1:] + rim[:1], strict=True):
        faces += [[a, b, b + m * m], [a, b + m * m, a + m * m]]
    numbers = [" ".join(f"{v:.9g}" for v in np.ravel(part)) for part in (points, faces)]
    return f'vertex="{numbers[0]}" face="{numbers[1]}"'


def plate_of(boxes: int, height: float = 0.0) -> str:
    """Return the geoms of a plate of boxes in a square."""
    side = round(boxes**0.5)
    half = PLATE / 2 / [side, side, 1]
    return "".join(
        f'<geom type="box" size="{half[0]} {half[1]} {half[2]}" '
        f'pos="{(2 * i + 1 - side) * half[0]} {(2 * j + 1 - side) * half[1]} {height - half[2]}"/>'
        for i in range(side)
        for j in range(side)
    )


def scene(plate: str, tool: str, assets: str = "") -> Scene:
    """Return a scene of the geoms of a plate and of a tool."""
    xml = f"""<mujoco><asset>{assets}</asset><worldbody>
      <body name="plate">{plate}</body>
      <body name="probe" pos="0 0 0.002"><freejoint/>{tool}</body>
    </worldbody></mujoco>"""
    document = {"schema": 1, "tool": {"body": "probe"}, "force": {"stiffness": K, "friction": 0.0}}
    return scene_of(xml, document, name="flat")


def foot_scene(plate: str = "1", *, foot_cells: int = 0) -> Scene:
    """Return a foot over a plate.

    Parameters
    ----------
    plate : str
        Number of boxes, or "mesh N": a mesh of N x N cells.
    foot_cells : int
        0: the foot is a box; else a mesh of that many cells along each side.
    """
    assets, size = "", " ".join(map(str, FOOT))
    tool = f'<geom type="box" size="{size}" mass="0.01"/>'
    if foot_cells:
        assets += f'<mesh name="foot" {grid_box(FOOT, foot_cells)}/>'
        tool = '<geom type="mesh" mesh="foot" mass="0.01"/>'
    if plate.startswith("mesh"):
        assets += f'<mesh name="plate" {grid_box(PLATE / 2, int(plate.split()[1]))}/>'
        geoms = f'<geom type="mesh" mesh="plate" pos="0 0 {-PLATE[2] / 2}"/>'
    else:
        geoms = plate_of(int(plate))
    return scene(geoms, tool, assets)


def pose_of(place, yaw=0.0, tilt=0.0):
    """Return a pose: yaw about z after a tilt about y [rad]."""
    a, b = [np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)], [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]
    turn = [a[0] * b[0], -a[3] * b[2], a[0] * b[2], a[3] * b[0]]
    return np.array([*place, *turn])


def foot_at(x, y, gap, yaw=0.0, tilt=0.0):
    """Return the pose of a foot whose lowest corner is `gap` above the plate [m]."""
    turned = pose_of((0, 0, 0), yaw, tilt)
    low = np.abs(rotation_of(turned[3:])[2]) @ FOOT
    return pose_of((x, y, low + gap), yaw, tilt)


def pressure_centre(wrench):
    """Return the centre of pressure from the tool's centre (2,) [m], at the sole's height."""
    force, torque = wrench.force, wrench.torque
    level = -FOOT[2]
    return np.array([
        (-torque[1] + level * force[0]) / force[2], (torque[0] + level * force[1]) / force[2]
    ])  # fmt: skip


def half_middle(yaw):
    """Return the middle of that half of the foot, turned by `yaw`, that lies at x < 0 (2,) [m]."""
    c, s = np.cos(yaw), np.sin(yaw)
    u = (np.arange(2000) + 0.5) / 1000 - 1
    a, b = np.meshgrid(u * FOOT[0], u * FOOT[1])
    x, y = c * a - s * b, s * a + c * b
    return x[x < 0].mean(), y[x < 0].mean()
