"""The largest stable stiffness, beside what is known of it, and what a still hand feels."""

import json

import numpy as np
import pytest

from asperity.cli import main
from asperity.errors import AsperityError
from asperity.scene.builtin import probe_plate
from asperity.studies.stability.measure import (
    StabilitySettings,
    Wall,
    measure_stability,
    measure_symptoms,
    symptoms_of,
)

QUICK = StabilitySettings(rates=(1000.0,), dampings=(1.0,), places=2)


@pytest.fixture(scope="module")
def scene():
    return probe_plate()


@pytest.fixture(scope="module")
def smooth(scene):
    quiet = scene.changed(force={"anti_alias": "off"}, bodies={"plate": {"texture": None}})
    return Wall(quiet, QUICK)


@pytest.mark.parametrize(("rate", "damping"), [(500.0, 0.3), (1000.0, 1.0), (4000.0, 0.3)])
def test_a_plain_wall_is_stable_up_to_colgates_bound(smooth, rate, damping):
    """For a mass alone the limit is a little above what is passive for every hand."""
    limit = smooth.limit(smooth.places()[0], rate, damping)
    assert 0.98 < limit / (2.0 * damping * rate) < 1.3


def test_an_oscillation_decays_below_the_limit_and_not_above(smooth):
    """The exact limit: the poles of the sampled wall lie on the unit circle."""
    pose, mass, damping, T = smooth.places()[0], QUICK.hand.mass, 1.0, 1e-3
    decay = np.exp(-damping * T / mass)
    drift = (1.0 - decay) * mass / damping

    def radius(stiffness):
        held = np.array([(T - drift) / damping, drift / mass])
        step = np.array([[1.0, drift], [0.0, decay]])
        step[:, 0] -= stiffness * held
        return np.abs(np.linalg.eigvals(step)).max()

    low, high = 100.0, 1e5
    while high / low > 1.0001:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    assert smooth.decays(pose, 0.95 * low, 1.0 / T, damping)
    assert not smooth.decays(pose, 1.05 * low, 1.0 / T, damping)


def test_a_notch_is_far_stiffer_than_the_wall(scene):
    """A tip of 3 mm cannot reach the bottom of the waves: it lies on two flanks, at a kink."""
    wall = Wall(scene.changed(force={"anti_alias": "off"}), QUICK)
    crest, notch = wall.places()
    assert wall.raised(crest) == pytest.approx(1.0, abs=0.1)
    assert wall.raised(notch) > 10.0
    assert wall.limit(notch, 1000.0, 1.0) < 0.5 * wall.limit(crest, 1000.0, 1.0)


def test_a_hand_in_a_notch_feels_it_buzz_and_less_through_a_coupling(scene):
    notch = Wall(scene.changed(force={"anti_alias": "off"}), QUICK).places()[1]
    notch[0] += 1e-4  # beside it: exactly in it nothing moves the hand
    direct, coupled = (
        measure_symptoms(scene.changed(coupling={"mode": mode}), QUICK, [notch])
        for mode in ("direct", "implicit")
    )
    assert direct.force == pytest.approx(QUICK.force, rel=0.1)
    assert direct.buzzing > 1e-2
    assert coupled.buzzing < 0.6 * direct.buzzing
    assert direct.aliveness < 0.02


def test_symptoms_are_read_off_their_own_frequencies():
    """A force that changes slowly by 30 mN, and shakes by 50 mN at 300 Hz."""
    time = np.arange(4000) * 1e-3
    force = np.zeros((4000, 3))
    force[:, 2] = 0.6 + 0.03 * np.sin(2.0 * np.pi * 10.0 * time)
    force[:, 0] = 0.05 * np.sin(2.0 * np.pi * 300.0 * time)
    moved = 1e-4 * np.sin(2.0 * np.pi * 10.0 * time)[:, None] * [[0.0, 0.0, 1.0]]
    symptoms = symptoms_of(force, moved, 1e-3)
    assert symptoms.aliveness == pytest.approx(0.03 / np.sqrt(2.0), rel=0.01)
    assert symptoms.buzzing == pytest.approx(0.05 / np.sqrt(2.0), rel=0.01)
    assert symptoms[2] == pytest.approx(0.6, rel=0.01)
    assert symptoms[3] == pytest.approx(2e-4, rel=0.01)


def test_the_measurement_has_all_its_parts(scene):
    settings = StabilitySettings(rates=(1000.0,), dampings=(2.0,), places=2)
    ticks = []
    result = measure_stability(scene, settings, modes=("direct",), progress=lambda: ticks.append(1))
    assert len(ticks) == 1
    np.testing.assert_allclose(result.bound, [[4000.0]])
    assert (result.textured <= result.median).all()
    assert (result.median <= 1.3 * result.bound).all()
    assert result.raised.shape == (2,)
    assert set(result.symptoms) == {"direct"}


def test_the_command_writes_chart_and_numbers(tmp_path, capsys):
    out = tmp_path / "chart"
    options = ["--rates-khz", "1", "--dampings-n-s-m", "1", "--places", "1", "--out", str(out)]
    assert main(["stability", "probe-plate", *options]) == 0
    written = json.loads((out / "stability.json").read_text())
    assert written["colgate_n_m"] == [[2000.0]]
    assert written["plain_n_m"][0][0] == pytest.approx(2000.0, rel=0.3)
    assert (out / "stability.png").stat().st_size > 10_000
    said = capsys.readouterr().out.strip()
    # The answer first, in one sentence; the scene's 400 N/m is below the limit.
    answer, details = said.splitlines()
    assert answer.startswith("probe-plate at 1 kHz is stable up to ")
    assert answer.endswith("with a damping of 1 N s/m; the scene's 400 N/m is below that for all "
                           "of these dampings")  # fmt: skip
    assert "2 b / T" in details


@pytest.mark.parametrize(
    "options", [{"rates": ()}, {"rates": (0.0,)}, {"dampings": (-1.0,)}, {"force": np.nan}]
)
def test_wrong_settings_are_refused(options):
    with pytest.raises(AsperityError):
        StabilitySettings(**options)
