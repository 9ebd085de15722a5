"""A textured primitive meets a box of triangles as it meets the box itself, from the first touch on.

Textures touch before the smooth bodies do.
"""

import numpy as np
import pytest
from naive_meshes import block, engine_of, thing

from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.random_surfaces import self_affine

HALF, RADIUS, HIGH = (8e-3, 6e-3, 4e-3), 2e-3, 1e-4
TOOLS = {
    "sphere": (RADIUS,), "capsule": (RADIUS, 3e-3), "ellipsoid": (RADIUS, 1.5e-3, RADIUS),
    "cylinder": (RADIUS, 3e-3),
}  # fmt: skip


def rough():
    heights = self_affine((64, 64), 5e-5, hurst=0.8, rms_slope=0.3, seed=1)
    return HeightField((heights - heights.min()) * HIGH / np.ptp(heights), 5e-5, border="wrap")


@pytest.mark.parametrize("mapping", ["planar", "triplanar"])
@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("level", [True, False], ids=["constant", "rough"])
def test_a_side_is_felt_as_that_of_the_primitive(kind, mapping, level):
    texture = HeightField(np.full((16, 16), HIGH), 1e-4, border="wrap") if level else rough()
    tool = Body("tool", [Geom(kind, TOOLS[kind])], texture, mapping)
    of_triangles = engine_of(tool, thing("plate", block(HALF)))
    of_the_box = engine_of(tool, Body("plate", [Geom("box", HALF)]))
    felt = 0
    for gap in (9e-5, 6e-5, 3e-5, 0.0, -2e-5):
        pose = np.array([HALF[0] + RADIUS + gap, 1e-3, 5e-4, 1.0, 0.0, 0.0, 0.0])
        wanted = of_the_box.wrench(pose, 0.0).copy()
        felt += bool(wanted.any())
        size = np.linalg.norm(wanted[:3]) + 1e-9
        found = of_triangles.wrench(pose, 0.0)
        assert found[:3] == pytest.approx(wanted[:3], abs=1e-6 * size)
        # Along a level side the places where box and mesh are touched may differ.
        if kind in ("sphere", "ellipsoid"):
            assert found[3:] == pytest.approx(wanted[3:], abs=1e-6 * size * RADIUS)
    assert felt >= 1
