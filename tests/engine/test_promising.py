"""Pairs of facets that cannot be as deep as the last contact are left out: nothing is missed."""

import sys
from pathlib import Path

import numpy as np
import pytest

from asperity.contact.chart import SUMMIT
from asperity.contact.deepest import PAIR
from asperity.contact_stage import ContactStage
from asperity.scenes import load_scene
from asperity.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from mesh_cases import about, pressed

DT = 1e-3


def slide(scene, tilt, depth, count=160):
    """Return poses of a slide that tilts, turns and presses as it goes, 50 mm/s."""
    simulation = Simulation(scene)
    start = simulation.trajectory().poses[len(simulation.trajectory().poses) // 3]
    s = np.linspace(0.0, 1.0, count)
    path = []
    for i in range(count):
        turn = np.radians(tilt) * np.array([np.sin(3.0 * s[i]), np.cos(2.0 * s[i]), 0.6 * s[i]])
        path.append(about(start, start[:3], turn))
        path[-1][:2] += 5e-5 * i * np.array([0.8, -0.6])
    depths = depth * (1.0 + 0.5 * np.sin(20.0 * s))
    return pressed(simulation.stage.engine, np.array(path), depths)


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
@pytest.mark.parametrize(("tilt", "depth"), [(0.3, 4e-4), (6.0, 4e-4), (15.0, 2e-4)])
def test_what_was_deepest_leaves_nothing_out(scene, tilt, depth):
    """Each patch is as deep as in a search that knows nothing of the pose before."""
    scene = load_scene(scene).changed(force={"anti_alias": "off"})
    engine, path = ContactStage(scene).engine, slide(scene, tilt, depth)
    anew, deep = felt(engine, path, True)
    known, depths = felt(engine, path, False)
    assert np.abs(anew).max() > 0.0
    patches = 0
    for (one, gap), (other, _) in zip(deep, depths, strict=True):
        assert len(one) == len(other)
        np.testing.assert_array_less(np.abs(one - other), gap + 2e-9)
        patches += len(one)
    assert patches > len(path) // 2
    # Where two places are as deep to the tolerance, either may be felt.
    off = np.abs(known - anew).max(axis=1) > 1e-6 * np.abs(anew).max()
    assert off.mean() < 0.05


def test_few_pairs_are_searched():
    """Of the facets of a file that leans on a machined part, few can be as deep as it was."""
    scene = load_scene("file-cad").changed(force={"anti_alias": "off"})
    engine, path = ContactStage(scene).engine, slide(scene, 6.0, 4e-4)
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
    assert np.isfinite(engine._space.charts_a[0, SUMMIT])
    assert searched[1] < 0.5 * searched[0]
