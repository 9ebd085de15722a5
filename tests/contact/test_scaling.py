"""Forces grow in proportion with a scene: shapes, textures and poses together."""

import numpy as np
import pytest
import trimesh
from naive_meshes import block, engine_of, thing
from scipy.spatial.transform import Rotation

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.random_surfaces import self_affine

FACTORS = (10.0, 0.1)
SHAPES = ("hull", "cone", "torus", "ball", "block")


def texture(height, pixel, seed, scale):
    heights = self_affine((64, 64), pixel, hurst=0.8, rms_slope=0.2, seed=seed)
    return HeightField(scale * height * heights / np.ptp(heights), scale * pixel, border="wrap")


def mesh_of(shape, size, scale, seed):
    if shape == "block":
        return block(scale * size * np.array([1.0, 0.8, 0.5]))
    solid = {
        "hull": lambda: trimesh.convex.convex_hull(
            np.random.default_rng(seed).normal(size=(12, 3)) / 2
        ),
        "cone": lambda: trimesh.creation.cone(1.0, 2.0, sections=12),
        "torus": lambda: trimesh.creation.torus(1.0, 0.3, 24, 12),
        "ball": lambda: trimesh.creation.icosphere(2),
    }[shape]()
    solid.apply_translation(-solid.bounds.mean(axis=0))
    return mesh_from_arrays(scale * size * solid.vertices, solid.faces, hard_angle=40.0)


def pair(case, scale):
    """Return an engine of two meshes, or of a ball over a mesh or over a turned box."""
    tool, target = SHAPES[case % 5], SHAPES[(case // 5 + 2 * case) % 5]
    fine = texture(5e-5, 60e-6, case, scale) if case % 3 == 0 else None
    coarse = texture(1e-4, 125e-6, case + 1, scale) if case % 3 < 2 else None
    ball = Body("tool", [Geom("sphere", [scale * 3e-3])], fine, "triplanar" if fine else "planar")
    held = (
        ball if case % 4 == 3
        else thing("tool", mesh_of(tool, 3e-3, scale, case), fine, "triplanar")
    )  # fmt: skip
    if case % 8 == 7:
        box = Geom("box", scale * np.array([9e-3, 6e-3, 3e-3]), quaternion=[0.9, 0.3, 0.1, 0.3])
        return engine_of(held, Body("plate", [box], coarse, "triplanar"))
    return engine_of(held, thing("plate", mesh_of(target, 8e-3, scale, case), coarse, "triplanar"))


def answer(engine, pose, scale):
    """Return the wrench of the smaller or larger scene, as that of the one of usual size."""
    engine.reset()
    wrench = engine.wrench(np.r_[scale * pose[:3], pose[3:]], 0.0) / scale
    wrench[3:] /= scale
    return wrench


@pytest.mark.parametrize("case", range(16))
def test_a_scaled_scene_has_scaled_forces(case):
    rng = np.random.default_rng(case)
    usual = pair(case, 1.0)
    scaled = [pair(case, factor) for factor in FACTORS]
    checked = 0
    for depth in (2e-5, 1e-4, 3e-4, 1e-3):
        turn, way = Rotation.random(random_state=rng), rng.normal(size=3)
        way /= np.linalg.norm(way)
        low, high = 0.0, 30e-3  # touching, and apart
        for _ in range(20):
            middle = 0.5 * (low + high)
            pose = np.r_[middle * way, np.roll(turn.as_quat(), 1)]
            touches = answer(usual, pose, 1.0).any()
            low, high = (middle, high) if touches else (low, middle)
        pose = np.r_[max(low - depth, 0.0) * way, np.roll(turn.as_quat(), 1)]
        wrench = answer(usual, pose, 1.0)
        size = np.linalg.norm(wrench[:3])
        if size == 0.0:
            continue
        checked += 1
        for engine, factor in zip(scaled, FACTORS, strict=True):
            off = np.abs(answer(engine, pose, factor) - wrench)
            assert off[:3].max() < 1e-6 * size
            assert off[3:].max() < 1e-6 * size * 5e-3
    assert checked >= 2
