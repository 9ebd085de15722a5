"""Bounds of the overlap of two planes hold: no place of a box is deeper, seen place by place."""

import sys
from pathlib import Path

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.contact.narrow_phase.bounds.plane_pairs import between_planes, quarter_bounds
from asperity.contact.narrow_phase.bounds.texture import sideways
from asperity.contact.narrow_phase.newton_ascent import is_within
from asperity.contact.narrow_phase.overlap import F, overlap_at
from asperity.contact.narrow_phase.penetration import PAIR, walks_on_a
from asperity.contact.narrow_phase.surface_patch import Q_LEAST
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from mesh_cases import about, pressed

GRID = 9
"""Places along either side of a quarter."""


@kernel
def _look(textures, space, pair, stride, box, enough, bounds, work, at, highest):
    """Fill the bounds of a box's quarters, and the deepest of some places in each of them."""
    cx, cy = space.charts_a[pair // stride], space.charts_b[pair % stride]
    if not walks_on_a(cx, cy):
        cx, cy = cy, cx
    moved = (sideways(textures, cx) + sideways(textures, cy)) / cy[Q_LEAST]
    flat = between_planes(cx, cy)
    x0, x1, y0, y1 = box[0], box[1], box[2], box[3]
    quarter_bounds(textures, cx, cy, flat, (x0, x1, y0, y1), moved, enough, bounds)
    for child in range(4):
        highest[child] = -np.inf
        half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        for i in range(GRID):
            for j in range(GRID):
                x = x0 + half_x * ((child & 1) + i / (GRID - 1.0))
                y = y0 + half_y * ((child >> 1) + j / (GRID - 1.0))
                overlap_at(textures, cx, cy, x, y, work, at)
                if at[F] > highest[child] and is_within(cx, cy, at, work):
                    highest[child] = at[F]
    return moved


@pytest.mark.parametrize(
    ("name", "tilt"), [("file-cad", 8.0), ("file-cad", 30.0), ("hammer-blocks", 12.0)]
)
def test_no_place_of_a_quarter_is_deeper_than_its_bound(name, tilt):
    """Whatever depth is enough; and where a facet leans, what is enough makes bounds sharper."""
    scene = load_scene(name).changed(force={"anti_alias": "off"})
    simulation = Simulation(scene)
    engine, path = simulation.stage.engine, simulation.trajectory().poses
    here = path[len(path) // 3]
    turn = np.radians(tilt) * np.array([0.8, 0.6, 0.0])
    at_pose = pressed(engine, about(here, here[:3], turn)[None].repeat(2, 0), np.full(2, 4e-4))[0]
    engine.reset()
    space, rng = engine._space, np.random.default_rng(5)
    for above in (1e-3, 5e-4, 2.5e-4, 0.0):
        # Nothing is known of where it was deepest: all pairs that may touch are searched.
        engine._facets.memory.guess[:] = np.nan
        space.looks[:, 0] = np.nan
        engine.wrench(at_pose + above * np.eye(7)[2], 1e-3)
    stride = len(space.charts_b)
    # Whatever was bounded last may have been left out.
    looks = space.looks[: np.count_nonzero(space.looks[:, 0] > -np.inf) - 1]
    bounds, highest = np.zeros(4), np.zeros(4)
    seen = sharper = 0
    for _ in range(600):
        look = looks[rng.integers(len(looks))]
        x0, x1, y0, y1 = look[5:9]
        side = 10.0 ** rng.uniform(-4.0, -2.8)
        middle = rng.uniform([x0, y0], [x1, y1])
        box = np.array([middle[0] - side, middle[0] + side, middle[1] - side, middle[1] + side])
        box = np.clip(box, [x0, x0, y0, y0], [x1, x1, y1, y1])
        given = (space, int(look[PAIR]), stride, box)

        def bounded(enough, given=given):
            _look(engine._textures, *given, enough, bounds, space.work, space.at, highest)
            return bounds.copy(), highest.copy()

        wide, high = bounded(-np.inf)
        if not (box[1] - box[0] < 2 * (box[3] - box[2]) < 4 * (box[1] - box[0])):
            continue  # halves
        there = high > -np.inf
        assert (wide[there] >= high[there] - 1e-12).all()
        if not there.any():
            continue
        seen += 1
        top = high[there].max()
        for enough in (top - 1e-4, top - 2e-5, top - 1e-6, top + 1e-6):
            told, _ = bounded(enough)
            assert (np.maximum(told, enough)[there] >= high[there] - 1e-12).all()
            assert (told <= np.maximum(wide, enough) + 1e-12).all()
            sharper += np.count_nonzero(told < wide - 1e-9)
    assert seen > 200
    assert sharper > 60
