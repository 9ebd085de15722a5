"""Choi & Tan's three instabilities, on their laws: where they say one occurs, and where not."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.studies.baselines.choi_tan import FIXED, GOD_OBJECT, NORMAL
from asperity.studies.baselines.placement import place_bodies
from asperity.studies.comparison.drive import simulate_resting_hand
from asperity.studies.stability.measure import symptoms_of
from asperity.studies.stability.resting_point import Rest, clean_stiffness, rest

WAVE = 2e-3
DRIFT = 5e-5


@pytest.fixture(scope="module")
def scene():
    return load_scene("probe-plate").changed(force={"stiffness": 1000.0})


@pytest.fixture(scope="module")
def laws(scene):
    return {method.law: method.prepare(scene) for method in (FIXED, NORMAL, GOD_OBJECT)}


def over(scene, x, z=None):
    pose = scene.start.copy()
    pose[0] = x
    if z is not None:
        pose[2] = z
    return pose


def in_normal_force(run):
    """Slow change of the force across the wall [N]."""
    half = len(run.force) // 2
    return symptoms_of(run.force[half:] * [0.0, 0.0, 1.0], run.place[half:], 1e-3).aliveness


@pytest.mark.parametrize("law", ["fixed", "normal", "god-object"])
def test_buzzing_begins_at_a_stiffness_that_rises_with_the_rate(scene, laws, law):
    renderer, pose = laws[law], over(scene, 0.5 * WAVE)

    def run(rate):
        return lambda k: rest(renderer, 1000.0, pose, Rest(k, rate=rate, seconds=0.2))

    clean = [clean_stiffness(run(rate), halvings=6) for rate in (250.0, 1000.0, 5000.0)]
    assert clean[1] > 2.0 * clean[0]
    assert clean[2] > 2.0 * clean[1]
    for rate, k in ((250.0, clean[0]), (1000.0, clean[1])):
        assert run(rate)(0.5 * k).symptoms.buzzing < 1e-3
        assert run(rate)(2.0 * k).symptoms.buzzing > 0.05


@pytest.mark.parametrize("law", ["fixed", "normal"])
def test_a_stroked_texture_is_noisier_at_a_slow_rate(scene, laws, law):
    """The held force's steps, which Choi & Tan's simulation shows: they fall with the rate."""
    noise = [
        rest(laws[law], 1000.0, over(scene, -1e-3), Rest(1000.0, rate=rate, speed=0.02))
        .symptoms.buzzing
        for rate in (250.0, 1000.0, 4000.0)
    ]  # fmt: skip
    assert noise[0] > 3.0 * noise[1] > 9.0 * noise[2] > 0.0


def test_aliveness_is_a_slow_force_under_a_fixed_direction_while_passive(scene, laws):
    """A drift that nothing resists changes the fixed law's force; a texture's normal resists it."""
    still, moved, strays = {}, {}, {}
    for law, renderer in laws.items():
        # The slope for the law that stays there, for the others where they come to rest.
        pose = over(scene, (0.25 if law == "fixed" else 0.5) * WAVE)
        calm = rest(renderer, 1000.0, pose, Rest(1000.0, seconds=2.0))
        drifting = rest(renderer, 1000.0, pose, Rest(1000.0, seconds=2.0, drift=DRIFT))
        still[law], moved[law] = in_normal_force(calm), in_normal_force(drifting)
        strays[law] = np.ptp(drifting.place[1000:, 0])
        assert drifting.taken.min() > 0.0
        assert drifting.symptoms.buzzing < 1e-4
    assert moved["fixed"] > 2e-3
    assert moved["fixed"] > 50.0 * max(moved["normal"], moved["god-object"])
    assert max(still.values()) < 5e-5
    # Nothing resists it: the hand goes the whole way. A valley holds it.
    assert strays["fixed"] > 2.0 * DRIFT
    assert max(strays["normal"], strays["god-object"]) < 1.0 * DRIFT


def test_without_a_texture_the_same_drift_changes_nothing(scene):
    run = rest(FIXED.prepare(scene.smooth()), 1000.0, over(scene, 0.0),
               Rest(1000.0, seconds=2.0, drift=DRIFT))  # fmt: skip
    assert in_normal_force(run) < 5e-5


def test_ridge_instability_pushes_the_stylus_into_a_valley_unless_the_direction_is_fixed(
    scene, laws
):
    pose = over(scene, 0.02 * WAVE, 1.5e-3 - 0.4e-3)
    away = {
        law: rest(renderer, 1000.0, pose, Rest(1000.0, seconds=0.8)).place[-1, 0]
        for law, renderer in laws.items()
    }
    for law in ("normal", "god-object"):
        assert away[law] > 0.25 * WAVE  # from the ridge beyond the middle of the slope
    assert away["fixed"] == pytest.approx(0.02 * WAVE, abs=1e-9)


def test_the_comparisons_still_hand_feels_neither_noise_nor_slow_forces(scene, laws):
    for renderer in laws.values():
        pose = over(scene, 0.5 * WAVE, 1.5e-3 - 0.1e-3 - 0.58e-3)
        symptoms = simulate_resting_hand(renderer, pose, place_bodies(scene).centre, 0.58)
        assert symptoms.buzzing < 1e-3
        assert symptoms.aliveness < 5e-3


def test_in_a_valley_no_law_moves_the_stylus(scene, laws):
    for renderer in laws.values():
        run = rest(renderer, 1000.0, over(scene, 0.5 * WAVE), Rest(1000.0))
        assert np.ptp(run.place[:, 0]) < 1e-7


def test_energy_that_a_surface_makes_is_seen(scene, laws):
    """An unstable wall gives energy: the observer falls below 0."""
    run = rest(laws["fixed"], 1000.0, over(scene, 0.5 * WAVE), Rest(4e4, seconds=0.2))
    assert run.taken.min() < 0.0
    assert run.symptoms.buzzing > 0.05


def test_bad_input_is_refused(scene, laws):
    with pytest.raises(AsperityError, match="stiffness"):
        Rest(0.0)
    with pytest.raises(AsperityError, match="nothing within 2 mm"):
        rest(laws["fixed"], 1000.0, over(scene, 0.2), Rest(1000.0))
