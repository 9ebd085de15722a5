"""Parts of the model that a laboratory can switch on: lift-off, and a finger with skin."""

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.normal_motion import NormalProbe
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.laboratory import Laboratory, Plan
from asperity.studies.literature.measures import COLUMNS
from asperity.studies.literature.plates import Dots, Sinusoids
from asperity.studies.literature.pressed import pressed_roughness
from asperity.studies.skin.pressed_finger import PressedFinger

BAND = COLUMNS["band_rms"]
PLAN = Plan(spacings=8)


def test_a_light_probe_on_a_stiff_surface_changes_nothing():
    light = NormalProbe(mass=1e-4, stiffness=0.0, damping=0.3, contact_stiffness=2e5)
    places = [1e-3, 2e-3]
    paper, lifting = (
        Laboratory(normal=normal).curve(BAND, Sinusoids(), PLAN.touch(), places)
        for normal in (None, light)
    )
    np.testing.assert_allclose(lifting, paper, rtol=0.05)


def test_a_heavy_probe_that_flies_over_the_dots_is_another_model():
    touch = PLAN.touch(speed=0.169)
    curves = [
        Laboratory(normal=normal).curve(BAND, Dots(lines=1), touch, [2e-3])
        for normal in (None, NormalProbe())
    ]
    assert abs(np.log(curves[1] / curves[0]))[0] > 0.1


def test_a_finger_with_skin_knows_force_and_surface_but_not_speed():
    lab = Laboratory(plan=PLAN, skin=PressedFinger())
    slow, fast = (
        lab.curve(BAND, Sinusoids(), PLAN.touch(probe=Finger(), speed=v), [2e-3])
        for v in (0.042, 0.169)
    )
    assert slow == fast > 0.0
    low, high = (pressed_roughness(Sinusoids(a), 2e-3, 0.58, PressedFinger()) for a in (1e-9, 1e-4))
    assert low < 1e-4 < high
    # Probes are as they were.
    touch = PLAN.touch()
    assert lab.curve(BAND, Sinusoids(), touch, [2e-3]) == pytest.approx(
        Laboratory().curve(BAND, Sinusoids(), touch, [2e-3])
    )


def test_what_skin_on_springs_gets_of_the_finger_and_what_it_misses():
    lab = Laboratory(plan=PLAN, skin=PressedFinger(), dots=Dots(lines=2))
    wanted = {"finger.low_relief": True, "finger.dots": False, "finger.small_elements": False}
    for finding in FINDINGS:
        if finding.id in wanted:
            assert finding.judge(lab, BAND).holds is wanted[finding.id], finding.id
