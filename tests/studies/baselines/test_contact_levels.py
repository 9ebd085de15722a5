"""Contact levels of detail, against the criterion of Otaduy & Lin (2003)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.contact_levels import CONTACT_LEVELS, LevelsMethod, build_levels
from asperity.studies.comparison import stimuli


@pytest.fixture(scope="module")
def scene():
    return stimuli.ball_on_plate()


def felt(method, scene, height=-3e-4):
    # The scene's own start is 0.2 mm above the base: here the smooth ball is 0.1 mm deep.
    renderer = method.prepare(scene)
    poses = stimuli.straight_path(scene, 0.4)
    poses[:, 2] += height
    return np.array([renderer.wrench(pose).force for pose in poses])


def test_levels_double_and_leave_out_more_and_more():
    levels = build_levels(load_scene("probe-plate-grating"))
    sizes = [level.size for level in levels]
    assert sizes[0] == 0.0
    np.testing.assert_allclose(np.divide(sizes[2:], sizes[1:-1]), 2.0)
    deviations = [level.deviation for level in levels]
    assert deviations[0] == 0.0
    assert np.all(np.diff(deviations) > 0.0)
    assert all(body.texture is None for body in levels[-1].bodies)


def test_a_wider_contact_is_taken_coarser():
    renderer = CONTACT_LEVELS.prepare(load_scene("probe-plate-grating"))
    areas = np.geomspace(1e-9, 1.0, 60)
    taken = [renderer.level(area) for area in areas]
    assert taken[0] == 0
    assert taken[-1] == len(renderer.levels) - 1
    assert np.all(np.diff(taken) >= 0)
    # At four times the area a feature of twice the size, as deep, may go.
    level = renderer.levels[2]
    twice = replace(level, size=2.0 * level.size)
    assert twice.weighted(4e-6) == pytest.approx(level.weighted(1e-6))


def test_without_tolerance_it_is_asperity_and_with_all_it_is_the_low_resolution(scene):
    full, low = (felt(METHODS[name], scene) for name in ("asperity", "low-resolution"))
    np.testing.assert_allclose(felt(LevelsMethod(tolerance=0.0), scene), full, atol=1e-9)
    np.testing.assert_allclose(felt(LevelsMethod(tolerance=1.0), scene), low, atol=1e-9)
    np.testing.assert_allclose(low[:, 2], scene.force.stiffness * 1e-4, rtol=1e-6)
    # What filtering takes away: all that is felt along the surface.
    assert np.ptp(full[:, 0]) > 0.1
    assert np.ptp(low[:, 0]) < 1e-9
