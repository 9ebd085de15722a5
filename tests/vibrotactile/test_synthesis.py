"""Synthesis: the filter's spectrum, no seams, seeded, and what lies between models."""

import numpy as np
import pytest
from scipy import signal
from texture_models import model_of

from asperity.errors import AsperityError
from asperity.vibrotactile.lsf import coefficients_of, frequencies_of, power_gain
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.rates import at_rate, raised
from asperity.vibrotactile.synthesis import Synthesiser


def test_one_model_is_scipys_filter():
    model = model_of()
    made = Synthesiser(model, seed=3).block(np.full(500, 0.02), np.full(500, 0.2))
    noise = np.random.default_rng(3).standard_normal(500) * np.sqrt(model.variance[0])
    assert made == pytest.approx(signal.lfilter([1.0], coefficients_of(model.ar[0]), noise))


def test_an_arma_model_is_scipys_filter_too():
    b = np.array([1.0, 0.5, 0.2])
    ma = np.tile(frequencies_of(b), (4, 1))
    model = model_of(ma=ma, gain=np.full(4, 1.7))
    made = Synthesiser(model, seed=3).block(np.full(500, 0.1), np.full(500, 1.0))
    noise = np.random.default_rng(3).standard_normal(500) * np.sqrt(model.variance[3])
    expected = signal.lfilter(1.7 * b, coefficients_of(model.ar[3]), noise)
    assert made == pytest.approx(expected)


def test_blocks_and_samples_are_the_same_stream():
    model, n = model_of(), 300
    speed, force = np.linspace(0.0, 0.15, n), np.linspace(1.2, 0.0, n)
    whole = Synthesiser(model, seed=1).block(speed, force)
    one = Synthesiser(model, seed=1)
    begin = one.block(speed[:100], force[:100])
    middle = [one.next(v, f) for v, f in zip(speed[100:130], force[100:130], strict=True)]
    end = one.block(speed[130:], force[130:])
    assert np.concatenate([begin, middle, end]) == pytest.approx(whole, abs=1e-12)
    one.reset()
    assert one.block(speed, force) == pytest.approx(whole, abs=0)


def test_crossing_models_leaves_no_seam():
    # The speed changes suddenly, twenty times a second: the filter's memory goes on, so the steps
    # there are as elsewhere. Filters that began anew would step from wherever it is to about zero.
    model, n = model_of(), 50000
    places = np.arange(n)
    speeds = np.where(places // 50 % 2, 0.024, 0.02)
    made = Synthesiser(model, seed=0).block(speeds, np.full(n, 1.0))
    steps, across = np.abs(np.diff(made)), places[1:] % 50 == 0
    rms = np.sqrt(np.mean(steps[across] ** 2)), np.sqrt(np.mean(steps[~across] ** 2))
    assert rms[0] < 1.3 * rms[1]
    assert np.sqrt(np.mean(made**2)) > 1.5 * rms[0]


def test_between_models_the_resonance_goes_with_the_speed():
    model = model_of()
    frequency = np.linspace(20, 450, 4000)
    for speed in (0.02, 0.04, 0.06, 0.08, 0.1):
        density = model.filter_at(speed, 0.6).density(frequency, model.rate)
        assert frequency[np.argmax(density)] == pytest.approx(50 + 2000 * speed, abs=6.0)


def test_size_follows_the_variance():
    model, n = model_of(), 200000
    made = Synthesiser(model).block(np.full(n, 0.05), np.full(n, 0.6))
    there = model.filter_at(0.05, 0.6)
    assert there.variance == pytest.approx(np.mean([0.1 * 0.04, 0.1]), rel=0.2)
    assert np.var(made) == pytest.approx(there.variance * power_gain(there.ar), rel=0.05)


def test_beyond_the_models_the_nearest_counts():
    model = model_of()
    for beyond, nearest in (((0.5, 0.6), (0.1, 0.6)), ((0.06, 9.0), (0.06, 1.0)),
                            ((0.0, 0.0), (0.02, 0.2))):  # fmt: skip
        assert model.filter_at(*beyond).ar == pytest.approx(model.filter_at(*nearest).ar)
    # And there is no jump on the way out.
    inside, outside = model.filter_at(0.1 - 1e-9, 0.5), model.filter_at(0.1 + 1e-9, 0.5)
    assert inside.variance == pytest.approx(outside.variance, rel=1e-5)


def test_every_mixed_filter_is_stable():
    rng, model = np.random.default_rng(0), model_of()
    for speed, force in rng.uniform(0.0, (0.3, 2.0), (300, 2)):
        assert np.abs(np.roots(model.filter_at(speed, force).ar)).max() < 1.0


def test_a_lower_rate_keeps_the_spectrum():
    model = model_of(rate=4000.0)
    low = at_rate(model, 1000.0)
    frequency = np.linspace(30, 400, 200)
    for i in range(4):
        place = model.speeds[i], model.forces[i]
        before = model.filter_at(*place).density(frequency, 4000.0)
        after = low.filter_at(*place).density(frequency, 1000.0)
        assert np.max(np.abs(10 * np.log10(after / before))) < 3.0
    with pytest.raises(AsperityError, match="rate"):
        at_rate(low, 4000.0)


def test_a_higher_rate_adds_nothing_above():
    model, n = model_of(), 4000
    made = Synthesiser(model).block(np.full(n, 0.1), np.full(n, 1.0))
    fine = raised(made, 1000.0, 4000.0)
    assert fine.size == 4 * n
    frequency, density = signal.welch(fine, 4000.0, nperseg=1024)
    assert density[frequency > 560].sum() < 1e-4 * density.sum()
    assert np.var(fine) == pytest.approx(np.var(made), rel=0.02)


def test_bad_models_and_input_are_one_line():
    with pytest.raises(AsperityError, match="one line in force and speed"):
        model_of(forces=np.full(4, 0.5))
    bad = model_of().ar.copy()
    bad[2] = bad[2][::-1]
    with pytest.raises(AsperityError, match="model 3: AR line spectral"):
        model_of(ar=bad)
    with pytest.raises(AsperityError, match="model 2: variance"):
        model_of(variance=np.array([1.0, -1.0, 1.0, 1.0]))
    with pytest.raises(AsperityError, match="finite"):
        Synthesiser(model_of()).block([np.nan], [1.0])
    with pytest.raises(AsperityError, match="3 to"):
        TextureModel("x", 1000.0, np.ones(2), np.ones(2), np.ones((2, 2)), np.ones(2))
