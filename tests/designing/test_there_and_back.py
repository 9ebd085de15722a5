"""Targets taken from random surfaces are met from other starts."""

from contextlib import suppress

import numpy as np
import pytest
from scipy.optimize import minimize

from asperity.designing.candidate import DesignSettings, UnreachableError
from asperity.designing.forward import Demand
from asperity.designing.free_map import FreeMap, FreeProblem, Retreating, search_free_map
from asperity.designing.measures import VibrationMeasure
from asperity.designing.pattern_search import at_parameters, demands_of, search_pattern
from asperity.designing.process import process_of
from asperity.designing.unknowns import USUAL_FREE, PatternUnknown
from asperity.errors import AsperityError

SPEEDS = (0.042, 0.083, 0.169)
BASE = tuple(Demand(VibrationMeasure(), 1.0, speed=speed) for speed in SPEEDS)


def _back(kind, seed, settings):
    """Return how far the nearest surface misses the metrics of a random one."""
    rng = np.random.default_rng(seed)
    unknown = PatternUnknown(kind)
    wanted: tuple[Demand, ...] = ()
    while not wanted:
        x, start = rng.uniform(0.1, 0.9, (2, len(unknown.names)))
        with suppress(AsperityError):  # a hand that stays in a notch feels no vibration
            surface = at_parameters(unknown, unknown.parameters(x), BASE, settings)
            wanted = demands_of(surface)
    try:
        found = search_pattern(unknown, wanted, settings, start=unknown.parameters(start))
    except UnreachableError as refused:
        return refused.nearest.worst
    return found[0].worst


@pytest.mark.parametrize("kind", ["sinusoid", "jittered_dots"])
def test_metrics_of_a_surface_are_met_from_elsewhere(kind):
    assert _back(kind, 5, DesignSettings(candidates=1, strokes=2)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(USUAL_FREE))
def test_twenty_of_each_kind(kind):
    misses = [_back(kind, seed, DesignSettings(candidates=1)) for seed in range(20)]
    assert sum(miss < 0.02 for miss in misses) >= 18


def _free_back(seed, samples, settings):
    rng = np.random.default_rng(seed)
    pixel = 12.8e-3 / samples
    other = FreeMap(samples, pixel, rng.uniform(0.3, 1.0), rng.uniform(1e-3, 6e-3),
                    rng.uniform(0.05, 0.25))  # fmt: skip
    problem = FreeProblem(other, BASE, settings, 1000 + seed)
    values = problem.values(problem.unknowns, steps=True)
    wanted = tuple(
        Demand(VibrationMeasure(), float(value), speed=speed)
        for value, speed in zip(values, SPEEDS, strict=True)
    )
    return search_free_map(FreeMap(samples, pixel), wanted, settings)[0]


def test_a_free_map_meets_the_metrics_of_another():
    process = process_of("laser", pixel=1e-4, feature=2e-4)
    settings = DesignSettings(candidates=1, tolerance=0.05, strokes=2, process=process)
    surface = _free_back(3, 96, settings)
    assert surface.worst < 0.05
    assert surface.tile.limits.slope <= 1.01 * process.slope
    assert surface.tile.limits.relief <= 1.01 * process.relief
    assert surface.tile.limits.feature >= 0.99 * process.feature


def test_a_step_to_a_map_without_motion_is_taken_back():
    asked = []

    def loss(x):
        asked.append(float(x[0]))
        if x[0] > 0.95:
            raise AsperityError("the hand stays in a notch")
        return float((x[0] - 0.9) ** 2), 2.0 * (x - 0.9)

    found = minimize(Retreating(loss), [0.0], jac=True, method="L-BFGS-B")
    assert max(asked) > 0.95
    assert found.x[0] == pytest.approx(0.9, abs=1e-3)
    with pytest.raises(AsperityError, match="notch"):
        Retreating(loss)(np.array([2.0]))


@pytest.mark.slow
def test_twenty_free_maps():
    settings = DesignSettings(candidates=1, tolerance=0.05)
    assert all(_free_back(seed, 256, settings).worst < 0.05 for seed in range(20))


def test_layers_are_allowed_for():
    settings = DesignSettings(candidates=1, strokes=2, process=process_of("sla"))
    [surface] = search_pattern(PatternUnknown("jittered_dots"), BASE[1:2], settings)
    assert surface.worst < 0.02
    process = settings.process
    samples = np.array(surface.tile.to_make.samples)
    pixel = surface.tile.to_make.pixel_size
    stepped = process.made(samples, pixel)
    assert np.allclose(stepped, surface.tile.made.samples)
    assert not np.allclose(stepped, process.made(samples, pixel, steps=False), atol=1e-6)


def test_more_than_the_height_allows_is_refused_with_the_nearest():
    unknown = PatternUnknown("jittered_dots", {"height": (1e-5, 5e-5)}, {"pitch": 2e-3})
    wanted = (Demand(VibrationMeasure(), 4.0),)
    settings = DesignSettings(candidates=1, starts=1, strokes=1)
    with pytest.raises(UnreachableError, match=r"height 5e-05.*nearest has") as refused:
        search_pattern(unknown, wanted, settings)
    nearest = refused.value.nearest
    assert nearest.parameters["height"] == pytest.approx(5e-5, rel=0.02)
    assert nearest.reached[0] < 4.0
    accepted = search_pattern(unknown, wanted, settings, accept_nearest=True)
    assert accepted[0].reached[0] == pytest.approx(nearest.reached[0], rel=1e-6)


def test_a_spectrum_above_the_cut_off_of_the_probe_is_refused():
    # 1500 Hz at 40 mm/s are waves of 27 um, which a probe of 3 mm bridges.
    wanted = (Demand(VibrationMeasure("band_rms", (1340.0, 1680.0)), 20.0, speed=0.04),)
    settings = DesignSettings(candidates=1, starts=1, strokes=1)
    unknown = PatternUnknown("sinusoid", {"amplitude": (1e-6, 1e-4)}, {"wavelength": 1e-3})
    with pytest.raises(UnreachableError, match="shorter than a probe of 3 mm follows"):
        search_pattern(unknown, wanted, settings)


def test_bad_unknowns_are_refused():
    with pytest.raises(AsperityError, match="did you mean 'knurl'"):
        PatternUnknown("knurls")
    with pytest.raises(AsperityError, match="must rise"):
        PatternUnknown("knurl", {"height": (2.0, 1.0)})
    with pytest.raises(AsperityError, match="parameter of knurl"):
        PatternUnknown("knurl", {"heigth": (1.0, 2.0)})
