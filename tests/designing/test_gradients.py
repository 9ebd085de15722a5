"""Hand-written adjoints against differences, and the model of a design against the integrator."""

from dataclasses import replace

import numpy as np
import pytest

from asperity.designing.candidate import DesignSettings
from asperity.designing.forward import Demand, TouchBench, stroke_places
from asperity.designing.free_map import FreeMap, FreeProblem
from asperity.designing.judge import JudgedTile
from asperity.designing.measures import VibrationMeasure
from asperity.designing.process import process_of
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.texture.patterns.patterns import jittered_dots, rough

MEASURES = [
    VibrationMeasure(),
    VibrationMeasure("band_rms", (60.0, 90.0), "force"),
    VibrationMeasure("threshold_power"),
    VibrationMeasure("max_acceleration"),
]


def _field(kind):
    if kind == "rough":
        return rough(size=6.4e-3, pixel_size=1e-4, hurst=0.8, rms_slope=0.15, cutoff=8e-4)
    return jittered_dots(pitch=2e-3, height=1e-4, diameter=8e-4, flank=3e-4, periods=3, samples=20)


@pytest.mark.parametrize("measure", MEASURES, ids=lambda one: f"{one.metric}-{one.quantity}")
@pytest.mark.parametrize("kind", ["rough", "jittered_dots"])
def test_gradient_by_heights_is_that_of_differences(kind, measure):
    field = _field(kind)
    samples, pixel = np.array(field.samples), field.pixel_size[0]
    bench = TouchBench((Demand(measure, 1.0),), strokes=2)
    _, gradient = bench.values_and_gradient(samples, pixel, lambda values: np.ones_like(values))
    rng = np.random.default_rng(3)
    smooth = np.real(np.fft.ifft2(
        np.fft.fft2(rng.standard_normal(samples.shape))
        * np.exp(-((np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in samples.shape[::-1])))
                    / 0.08) ** 2))
    ))  # fmt: skip
    smooth /= np.abs(smooth).max()
    step = 1e-9
    up, down = (bench.values(samples + s * smooth, pixel)[0] for s in (step, -step))
    difference = (up - down) / (2.0 * step)
    assert np.sum(gradient * smooth) == pytest.approx(difference, rel=1e-4)


def test_gradient_of_a_free_map_holds_its_limits_and_prior():
    process = process_of("sla", slope=0.2, relief=1e-4)
    demands = tuple(Demand(VibrationMeasure(), 1.0, speed=v) for v in (0.042, 0.083))
    problem = FreeProblem(
        FreeMap(samples=48, pixel_size=1.5e-4), demands, DesignSettings(process=process), 0
    )
    problem.with_noise = True
    x = problem.unknowns
    _, gradient = problem.loss(x)
    rng = np.random.default_rng(0)
    for part in (slice(0, 16), slice(16, None)):
        direction = np.zeros(x.size)
        direction[part] = rng.standard_normal(x[part].size)
        up, down = (problem.loss(x + s * direction)[0] for s in (1e-6, -1e-6))
        assert np.dot(gradient, direction) == pytest.approx((up - down) / 2e-6, rel=1e-4)


@pytest.mark.parametrize("kind", ["rough", "jittered_dots"])
@pytest.mark.parametrize("speed", [0.042, 0.169])
def test_model_agrees_with_the_integrated_motion(kind, speed):
    field = _field(kind)
    demand = Demand(VibrationMeasure(), 1.0, speed=speed)
    [value] = TouchBench((demand,), strokes=2).values(np.array(field.samples), field.pixel_size[0])
    judged = JudgedTile(field, 2).value(demand, Hand())
    assert value == pytest.approx(judged, rel=5e-3)


def test_strokes_stay_on_the_map():
    assert np.all(stroke_places(0.01, 4, 0.9) < 0.01)
    assert len(set(stroke_places(0.01, 4))) == 4


def test_bad_demands_are_refused():
    demand = Demand(VibrationMeasure(), 1.0)
    with pytest.raises(AsperityError, match="speed"):
        replace(demand, speed=0.0)
    with pytest.raises(AsperityError, match="did you mean 'band_rms'"):
        VibrationMeasure("band_rm")
    with pytest.raises(AsperityError, match="force"):
        VibrationMeasure("threshold_power", quantity="force")
