"""The studies along a line and the same drags in six directions, with a simulated hand."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.studies.otaduy_lin_2004.drags import Condition
from asperity.studies.otaduy_lin_2004.six_dof import drag_in_scene
from asperity.studies.otaduy_lin_2004.studies import FACTORS, StudySettings

METRICS = ("max_acceleration", "band_rms")
MIDDLE = StudySettings().middle()


@pytest.fixture(scope="module")
def sweep():
    return StudySettings().simulator()


@pytest.fixture(scope="module")
def drags():
    """Return a function that remembers drags."""
    known = {}

    def drag(condition):
        if condition not in known:
            known[condition] = drag_in_scene(condition)
        return known[condition]

    return drag


@pytest.mark.parametrize("study", FACTORS)
def test_a_drag_in_six_directions_is_that_of_the_study(study, sweep, drags):
    """At the outer levels of each factor: value within 8 %, and the same order."""
    factor, levels = FACTORS[study][0], StudySettings().levels()[study]
    for metric in METRICS:
        line, scene = [], []
        for level in (levels[0], levels[-1]):
            condition = Condition(spacing=1.2e-3, **(MIDDLE | {factor: level}))
            drag = drags(condition)
            assert drag.normal_force == pytest.approx(condition.normal_force, rel=1e-3)
            line.append(sweep.metric(metric, condition))
            scene.append(getattr(drag, metric))
        np.testing.assert_allclose(scene, line, rtol=0.08)
        assert (line[0] < line[1]) == (scene[0] < scene[1])


def test_the_peak_over_spacing_is_where_the_study_has_it(sweep, drags):
    spacings = [0.9e-3, 1.42e-3, 2.2e-3]
    conditions = [Condition(spacing=s, **MIDDLE) for s in spacings]
    line = [sweep.metric("max_acceleration", c) for c in conditions]
    scene = [drags(c).max_acceleration for c in conditions]
    np.testing.assert_allclose(scene, line, rtol=0.05)
    assert np.argmax(line) == np.argmax(scene) == 1


def test_a_hand_as_heavy_along_the_normal_does_not_press_evenly():
    """What the studies leave out: then the force rises and falls by a fifth and more."""
    condition = Condition(spacing=2e-3, **MIDDLE)
    full = drag_in_scene(condition, kind="full")
    assert full.normal_force == pytest.approx(condition.normal_force, rel=0.03)
    assert full.normal_force_deviation > 0.2 * condition.normal_force


def test_an_unknown_hand_is_refused():
    with pytest.raises(AsperityError, match="choose from: constant, guided, full"):
        drag_in_scene(Condition(spacing=2e-3, **MIDDLE), kind="left")


@pytest.mark.slow
@pytest.mark.parametrize("study", FACTORS)
def test_all_three_studies_come_out(study, sweep, drags):
    """Peaks within 8 % and every order of levels that the line study tells apart by 5 %."""
    factor, levels = FACTORS[study][0], StudySettings().levels()[study]
    spacings = np.geomspace(0.5e-3, 3.5e-3, 11)
    for metric in METRICS:
        rows = []
        for level in levels:
            conditions = [
                Condition(spacing=float(s), **(MIDDLE | {factor: level})) for s in spacings
            ]
            line = np.array([sweep.metric(metric, c) for c in conditions])
            scene = np.array([getattr(drags(c), metric) for c in conditions])
            np.testing.assert_allclose(scene, line, rtol=0.12)
            peaks = [_peak(spacings, values) for values in (line, scene)]
            assert peaks[1] == pytest.approx(peaks[0], rel=0.08)
            rows.append((line, scene))
        for a, b in ((0, 1), (1, 2), (0, 2)):
            differs = np.abs(np.log(rows[a][0] / rows[b][0])) > 0.05
            agree = (rows[a][0] < rows[b][0]) == (rows[a][1] < rows[b][1])
            assert agree[differs].all()


def _peak(spacings, values):
    i = int(np.clip(np.argmax(values), 1, len(values) - 2))
    x, y = np.log(spacings[i - 1 : i + 2]), np.log(values[i - 1 : i + 2])
    a, b, _ = np.polyfit(x, y, 2)
    return float(np.exp(-0.5 * b / a))
