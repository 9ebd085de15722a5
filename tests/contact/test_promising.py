"""Pairs of facets that cannot be as deep as the last contact are left out: nothing is missed."""

import functools
import sys
from pathlib import Path

import numpy as np
import pytest
from naive_engine import patches_of_meshes

from asperity._core.kernels import kernel
from asperity.contact.narrow_phase.warm_start import SubRegions, fill_known_depths
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from mesh_cases import LEAD, families, pressed

DT = 1e-3
FAMILIES = ("own path", "flat, turned", "tilted by 1 to 10 degrees", "on an edge")


@functools.cache
def slide(name, family, count=120):
    """Return an engine, and poses from above into a scene's own motion, or one that is perturbed.

    `benchmarks/mesh_cases.py` tells how.
    """
    scene = load_scene(name).changed(force={"anti_alias": "off"})
    simulation = Simulation(scene)
    engine = simulation.stage.engine
    path = families(scene, simulation)[family]
    path = path[len(path) // 3 :][:count].copy()
    if family != "own path":
        path = pressed(engine, path, 4e-4 + 2e-4 * np.sin(0.3 * np.arange(count)))
    into = np.tile(path[0], (len(LEAD), 1))
    into[:, 2] += LEAD
    return engine, np.concatenate([into, path])


def felt(engine, path, forgets):
    """Return wrenches, and depths and gaps of all patches; with no place known before, or with."""
    engine.reset()
    wrenches, depths = [], []
    for there in path:
        if forgets:
            engine._mesh.memory.guess[:] = np.nan
        wrenches.append(engine.wrench(there, DT).copy())
        found = patches_of_meshes(engine)
        depths.append((found["depth"], found["gap"]))
    return np.array(wrenches), depths


@pytest.mark.parametrize("scene", ["file-cad", "hammer-blocks"])
@pytest.mark.parametrize("family", FAMILIES)
def test_what_was_deepest_leaves_nothing_out(scene, family):
    """Each patch is as deep as in a search that knows nothing of the pose before."""
    engine, path = slide(scene, family)
    anew, deep = felt(engine, path, True)
    known, depths = felt(engine, path, False)
    assert np.abs(anew).max() > 0.0
    patches = 0
    for (one, gap), (other, _) in zip(deep, depths, strict=True):
        assert len(one) == len(other)
        np.testing.assert_array_less(np.abs(one - other), gap + 2e-9)
        patches += len(one)
    assert patches > len(path)
    # Where two places are as deep to the tolerance, either may be felt.
    off = np.abs(known - anew).max(axis=1) > 1e-6 * np.abs(anew).max()
    assert off.mean() < 0.05


def test_few_pairs_are_searched():
    """Of the facets of a file that leans on a machined part, few can be as deep as it was."""
    engine, path = slide("file-cad", FAMILIES[2])
    candidates, searched = engine._space.candidates, []
    for forgets in (True, False):
        engine.reset()
        counts = []
        for there in path:
            if forgets:
                engine._mesh.memory.guess[:] = np.nan
            candidates["bound"] = np.nan
            engine.wrench(there, DT)
            counts.append(np.count_nonzero(candidates["bound"] > -np.inf))
        searched.append(np.median(counts))
    assert searched[1] < 0.5 * searched[0]


@kernel
def _known_depths(textures, count, regions, lines, memory):
    stride, parts = memory.patches_b.shape[0], regions.depth.shape[0]
    fill_known_depths(textures, count, stride, regions, parts, lines, memory)


def test_a_place_says_nothing_of_a_part_that_it_is_not_in():
    engine, path = slide("file-cad", FAMILIES[0])
    engine.reset()
    for there in path[:20]:
        engine._space.candidates["bound"] = np.nan
        engine.wrench(there, DT)
    memory, lines = engine._space, engine._mesh.space.lines
    # Whatever was bounded last may have been left out.
    pairs, rng = (
        np.count_nonzero(memory.candidates["bound"] > -np.inf) - 1,
        np.random.default_rng(3),
    )
    known = left_out = 0
    for _ in range(200):
        extent = memory.candidates[rng.integers(pairs)]["extent"]
        low, high = extent[::2], extent[1::2]
        if not (low < high).all():
            continue
        at = rng.uniform(low, high)
        away = lines[:, :2] @ at + lines[:, 2]
        if np.abs(away).min() < 1e-4:
            continue  # its base may lie beyond the line
        here, depths = np.sign(away), np.zeros(4)
        parts = np.array([here, -here, here * [1, -1], here * [-1, 1]])
        regions = SubRegions(np.tile(at, (4, 1)), parts, depths, np.zeros((4, 3)), 0.0)
        _known_depths(engine._scene.textures, pairs, regions, lines, memory)
        assert (depths[1:] == -np.inf).all()
        known += depths[0] > -np.inf
        left_out += 1
    assert known > 0.2 * left_out > 4
