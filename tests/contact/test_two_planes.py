"""Bounds of the overlap of two planes hold: no sampled point of a box is deeper."""

import sys
from pathlib import Path

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.contact.narrow_phase.bounds.plane_pairs import quarter_bounds
from asperity.contact.narrow_phase.bounds.planes import lifts_within, planes_of
from asperity.contact.narrow_phase.newton_ascent import is_within
from asperity.contact.narrow_phase.overlap import overlap_at
from asperity.contact.narrow_phase.patch_pair import searches_a
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from mesh_cases import about, pressed

GRID = 9
"""Places along either side of a quarter."""


@kernel
def _evaluate(textures, memory, number, box, threshold, bounds, highest):
    """Fill the bounds of a box's quarters, and the deepest of some places in each of them."""
    stride, search = memory.patches_b.shape[0], memory.search[0]
    a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
    patch, other = (a, b) if searches_a(a, b) else (b, a)
    x0, x1, y0, y1 = box[0], box[1], box[2], box[3]
    whole = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0))
    lifts = lifts_within(textures, patch, other, whole)
    planes, at = planes_of(patch, other, lifts), search.at
    quarter_bounds(textures, patch, other, planes, (x0, x1, y0, y1), threshold, bounds)
    for child in range(4):
        highest[child] = -np.inf
        half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        for i in range(GRID):
            for j in range(GRID):
                x = x0 + half_x * ((child & 1) + i / (GRID - 1.0))
                y = y0 + half_y * ((child >> 1) + j / (GRID - 1.0))
                overlap_at(textures, patch, other, x, y, search, at)
                if at.f > highest[child] and is_within(patch, other, at, search):
                    highest[child] = at.f


@pytest.mark.parametrize(
    ("name", "tilt"), [("file-cad", 4.0), ("file-cad", 6.0), ("hammer-blocks", 12.0)]
)
def test_no_place_of_a_quarter_is_deeper_than_its_bound(name, tilt):
    """At any pruning threshold; where a facet leans, a threshold makes the bounds sharper."""
    scene = load_scene(name).changed(force={"anti_alias": "off"})
    simulation = Simulation(scene)
    engine, path = simulation.stage.engine, simulation.trajectory().poses
    here = path[len(path) // 3]
    turn = np.radians(tilt) * np.array([0.8, 0.6, 0.0])
    at_pose = pressed(engine, about(here, here[:3], turn)[None].repeat(2, 0), np.full(2, 4e-4))[0]
    engine.reset()
    memory, rng = engine._space, np.random.default_rng(5)
    for above in (1e-3, 5e-4, 2.5e-4, 0.0):
        # Nothing is known of where it was deepest: all pairs that may touch are searched.
        engine._mesh.memory.guess[:] = np.nan
        memory.candidates["bound"] = np.nan
        engine.wrench(at_pose + above * np.eye(7)[2], 1e-3)
    # Whatever was bounded last may have been left out.
    bounds = memory.candidates["bound"]
    candidates = memory.candidates[: np.count_nonzero(bounds > -np.inf) - 1]
    bounds, highest = np.zeros(4), np.zeros(4)
    seen = sharper = 0
    for _ in range(600):
        candidate = candidates[rng.integers(len(candidates))]
        x0, x1, y0, y1 = candidate["box"]
        side = 10.0 ** rng.uniform(-4.0, -2.8)
        middle = rng.uniform([x0, y0], [x1, y1])
        box = np.array([middle[0] - side, middle[0] + side, middle[1] - side, middle[1] + side])
        box = np.clip(box, [x0, x0, y0, y0], [x1, x1, y1, y1])
        given = (memory, int(candidate["number"]), box)

        def bounded(threshold, given=given):
            _evaluate(engine._scene.textures, *given, threshold, bounds, highest)
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
        for threshold in (top - 1e-4, top - 2e-5, top - 1e-6, top + 1e-6):
            found, _ = bounded(threshold)
            assert (np.maximum(found, threshold)[there] >= high[there] - 1e-12).all()
            assert (found <= np.maximum(wide, threshold) + 1e-12).all()
            sharper += np.count_nonzero(found < wide - 1e-9)
    assert seen > 200
    assert sharper > 60
