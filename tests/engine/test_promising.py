"""Pairs of facets that cannot be as deep as the last contact are left out: nothing is missed."""

import functools
import sys
from pathlib import Path

import numpy as np
import pytest

from asperity.contact.deepest import PAIR
from asperity.scenes import load_scene
from asperity.simulation import Simulation

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
            engine._facets.memory.guess[:] = np.nan
        wrenches.append(engine.wrench(there, DT).copy())
        count = engine.contacts.count[0]
        depths.append((engine.contacts.depth[:count].copy(), engine.contacts.gap[:count].copy()))
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
    looks, searched = engine._space.looks, []
    for forgets in (True, False):
        engine.reset()
        counts = []
        for there in path:
            if forgets:
                engine._facets.memory.guess[:] = np.nan
            looks[:, PAIR] = 0.0
            engine.wrench(there, DT)
            counts.append(np.count_nonzero(looks[:, PAIR]))
        searched.append(np.median(counts))
    assert searched[1] < 0.5 * searched[0]
